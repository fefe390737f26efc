"""The motion in a run on a trace: flights from its log, positions and speeds from half-angles.

Of a run that is too long to be kept, only the start and the end of each flight are stored. States
during requested flights need rows of the log, which are collected by solving the run once more.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from vibro_cli.compile.kernel import Overrides
from vibro_cli.kernels.flow.flow import Sample, sample_flights
from vibro_cli.kernels.world import CAUSE_NAMES, RUNNING, Flight, World
from vibro_cli.mechanics.system import TraceSystem, natural_rate
from vibro_cli.numerics.elementwise import Floats
from vibro_cli.systems.driver import angles_of, called, with_logs, zeros
from vibro_cli.systems.request import Limits, within_run
from vibro_cli.systems.run import Stretch, ahead, begun
from vibro_cli.systems.tables import events_until
from vibro_cli.systems.trace import SYSTEM
from vibro_cli.systems.trace.world import make_world, turns_of


class Places:
    """Geometry of every body on every piece, as arrays indexed ``[body, piece]`` or ``[piece]``.

    Numbers of the system may be arrays over several systems (see ``numerics.elementwise``). Then
    `of_rows` is the index of each row's system, from 0, for the rows of a table of runs; the arrays
    have a last axis for the rows, and methods need a piece for each row.
    """

    def __init__(self, system: TraceSystem, of_rows: Any = None) -> None:
        self._of_rows = of_rows
        pieces, bodies = system.trace.pieces, system.bodies
        self.sign = np.array([piece.sign for piece in pieces])
        self.radius = self._numbers([0.0 if piece.is_line else piece.radius for piece in pieces])
        self.centre_x = self._numbers([piece.centre[0] for piece in pieces])
        self.centre_y = self._numbers([piece.centre[1] for piece in pieces])
        self.start_s = self._numbers([piece.start_s for piece in pieces])
        self.angle_start = self._numbers([piece.angle_start for piece in pieces])
        self.angle_end = self._numbers([piece.angle_end for piece in pieces])
        self.turn = self._numbers([math.tau * turns_of(piece) for piece in pieces])
        self.body_radius = self._numbers([body.radius for body in bodies])
        self.kappa = self._numbers([body.kappa for body in bodies])
        self.gravity: float = self.of_rows(system.gravity)
        radii = [[0.0 if p.is_line else p.path_radius(b.radius) for p in pieces] for b in bodies]
        flat = self._numbers([radius for row in radii for radius in row])
        self.path_radius = flat.reshape(len(bodies), len(pieces), *flat.shape[1:])
        self.system = system

    def of_rows(self, numbers: Any) -> Any:
        """Return a number of the system, or for several systems its value for each row."""
        return numbers if np.ndim(numbers) == 0 else numbers[self._of_rows]

    def _numbers(self, values: Sequence[Any]) -> Floats:
        return np.stack(np.broadcast_arrays(*map(self.of_rows, values)))

    @staticmethod
    def _at(table: Floats, *index: Any) -> Any:
        """Return entries of a table, row by row if it has an axis for the rows."""
        if table.ndim == len(index):
            return table[index]
        return table[(*index, np.arange(table.shape[-1]))]

    def position(self, piece: Any, s: Floats, c: Floats) -> Floats:
        """Return the angle phi or psi (rad) on arcs, distance from the left end (m) on lines."""
        sign = self.sign[piece]
        hump = sign < 0.0
        half = angles_of(np.where(hump, -c, s), np.where(hump, s, c))
        angle = 2.0 * half + self._at(self.turn, piece)
        ends = self._at(self.angle_start, piece), self._at(self.angle_end, piece)
        # A half-angle leaves whole turns open: at the ends of a circle rounding would decide.
        beyond = np.rint((angle - 0.5 * (ends[0] + ends[1])) / (2.0 * math.tau))
        angle = np.clip(angle - 2.0 * math.tau * beyond, *ends)
        return np.where(sign == 0.0, s, angle)

    def angle(self, piece: Any, position: Floats) -> Floats:
        """Return the angle phi or psi (rad) of a position, nan on lines."""
        return np.where(self.sign[piece] == 0.0, np.nan, position)

    def arc_length(self, piece: Any, position: Floats) -> Floats:
        """Return the arc length (m) from the left end of the trace to the contact point."""
        begin = self._at(self.angle_start, piece)
        along = self._at(self.radius, piece) * (position - begin)
        start = self._at(self.start_s, piece)
        s: Floats = start + np.where(self.sign[piece] == 0.0, position, along)
        return s

    def centre(self, body: Any, piece: Any, s: Floats, c: Floats) -> tuple[Floats, Floats]:
        """Return the coordinates (m) of the centres of bodies at ``(S, C)``."""
        rho = self.path_radius[body, piece]
        x = self.centre_x[piece] + self.sign[piece] * rho * (2.0 * s * c)
        y = self.centre_y[piece] - rho * ((c - s) * (c + s))
        for index, data in enumerate(self.system.trace.pieces):
            if data.is_line:
                here = piece == index
                radius = self.body_radius[body][here] if np.ndim(body) else self.body_radius[body]
                tangent = (math.cos(data.start_slope), math.sin(data.start_slope))
                x[here] = data.start[0] + s[here] * tangent[0] - radius * tangent[1]
                y[here] = data.start[1] + s[here] * tangent[1] + radius * tangent[0]
        return x, y

    def frequency(self, body: Any, piece: Any) -> Floats:
        """Return ``w = sqrt(g/(kappa rho))`` (rad/s), 0 on lines."""
        rho = self._at(self.path_radius, body, piece)
        with np.errstate(divide="ignore"):
            return np.where(rho > 0.0, natural_rate(self.gravity, self.kappa[body], rho), 0.0)

    def speed_factor(self, body: Any, piece: Any) -> Floats:
        """Return ``v/P``: ``2 w rho`` on arcs, 1 on lines."""
        rho = self._at(self.path_radius, body, piece)
        return np.where(rho > 0.0, 2.0 * self.frequency(body, piece) * rho, 1.0)

    def rate(self, body: Any, piece: Any, p: Floats) -> Floats:
        """Return the rate of the angle (rad/s) from ``P``, or the speed (m/s) on a line."""
        frequency = self.frequency(body, piece)
        return np.where(frequency > 0.0, 2.0 * frequency * p, p)


CAUSES = ("cause_start", "cause_end")
"""Columns of flights with the causes of their start and end."""
_WORDS = np.array([*CAUSE_NAMES, "end"], dtype=object)
"""The causes in words, by their integer codes."""


def states_at(world: World, rows: Any, after: Floats, overrides: Overrides) -> Any:
    """Return the states of flights, rows of the log, at times (s) after their starts.

    The states are records of ``Sample``. ``world`` has the log, interpreted or compiled, and
    ``overrides`` belongs to its kernels.
    """
    order = np.argsort(rows, kind="stable")
    samples = zeros(len(rows), Sample)
    samples["row"], samples["after"] = np.asarray(rows)[order], np.asarray(after)[order]
    called(sample_flights, overrides, world, samples, len(samples), zeros(1, Flight))
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    return samples.take(place)


def _points_along(durations: Any, counts: Any, lasts: float) -> tuple[Any, Floats]:
    """Return for each point along flights the number of its flight and the time since its start.

    The points of a flight are evenly spaced from its start to its end, or until `lasts` (s).
    """
    spans = np.minimum(np.atleast_1d(durations), lasts).tolist()
    each = np.atleast_1d(counts)
    times = [np.linspace(0.0, span, count) for span, count in zip(spans, each, strict=True)]
    return np.repeat(np.arange(len(each)), each), np.concatenate(times)


def places_and_rates(places: Places, body: int, piece: int, states: Any) -> tuple[Floats, Floats]:
    """Return the angles (rad) and rates (rad/s) of a body on a piece from records of ``Sample``.

    On a line: positions (m) and speeds (m/s).
    """
    position = places.position(np.full(len(states), piece), states["s"], states["c"])
    return position, places.rate(body, piece, states["p"])


class Paths:
    """All flights of a stretch of a run with their ends, by body and then by time.

    `world` has the records of the run, of either engine, with the logs of the stretch.
    """

    def __init__(self, places: Places, world: World, stretch: Stretch) -> None:
        self.places, self.world, self.stretch = places, world, stretch
        self.overrides = SYSTEM.overrides(places.system)
        log, (end_t, end_t_low) = stretch.logs["log"], stretch.end
        order = np.argsort(log["body"].astype(np.int32), kind="stable")
        self.log = log.take(order)
        self.number = order
        self.body = self.log["body"]
        self.piece = self.log["piece"]
        last = np.append(self.body[1:] != self.body[:-1], True)
        self.last = last
        following = np.minimum(np.arange(len(self.log)) + 1, len(self.log) - 1)

        def then(name: str) -> Any:
            return self.log[name][following]

        self.t_end = np.where(last, end_t, then("t"))
        self.t_end_low = np.where(last, end_t_low, then("t_low"))
        self.duration = (self.t_end - self.log["t"]) + (self.t_end_low - self.log["t_low"])

    def states(self, rows: Any, after: Any) -> Any:
        """Return the states (records of ``Sample``) of flights at times (s) after their starts."""
        return states_at(self.world, self.number[rows], after, self.overrides)

    def table(self) -> dict[str, Any]:
        """Return the flights as columns: body, arc, times, positions and rates at both ends."""
        columns = self.columns()
        return columns | {name: _WORDS[columns[name]] for name in CAUSES}

    def columns(self) -> dict[str, Any]:
        """Return the flights as columns, with integer codes for the causes."""
        following = np.minimum(np.arange(len(self.log)) + 1, len(self.log) - 1)
        ends = {name: self.log[f"before_{name}"][following] for name in "scp"}
        last = np.flatnonzero(self.last)
        for name, values in ends.items():
            values[last] = self.states(last, self.duration[last])[name]
        return {
            "ball": self.body + 1,
            "arc": self.piece + 1,
            "t_start": self.log["t"].copy(),
            "t_end": self.t_end.copy(),
            "angle_start": self.places.position(self.piece, self.log["s"], self.log["c"]),
            "rate_start": self.places.rate(self.body, self.piece, self.log["p"]),
            "angle_end": self.places.position(self.piece, ends["s"], ends["c"]),
            "rate_end": self.places.rate(self.body, self.piece, ends["p"]),
            "contact": self.log["grouped"] == 1,
            "cause_start": self.log["cause"].copy(),
            "cause_end": np.where(self.last, len(CAUSE_NAMES), self.log["cause"][following]),
        }

    def curve(
        self, index: Any, count: Any, lasts: float = math.inf
    ) -> tuple[Floats, Floats, Floats]:
        """Return exact times, positions and rates along flights, see ``systems.run.Run``."""
        each, after = _points_along(self.duration[index], count, lasts)
        rows = np.atleast_1d(index)[each]
        states = self.states(rows, after)
        body, piece = self.body[rows[0]], self.piece[rows[0]]
        return self.log["t"][rows] + after, *places_and_rates(self.places, body, piece, states)

    def sample(self, instants: Floats, side: str = "after") -> dict[str, Any]:
        """Return the columns of the motion table, see ``systems.contract.Trajectory``."""
        bodies = len(self.places.system.bodies)
        chosen = np.empty((len(instants), bodies), dtype=np.int64)
        for body in range(bodies):
            rows = np.flatnonzero(self.body == body)
            begun = events_until(self.log["t"][rows], instants, side)
            chosen[:, body] = rows[np.maximum(begun - 1, 0)]
        return self._motion(np.repeat(instants, bodies), chosen.ravel())

    def _motion(self, times: Floats, chosen: Any) -> dict[str, Any]:
        ages = (times - self.log["t"][chosen]) - self.log["t_low"][chosen]
        body, piece = self.body[chosen], self.piece[chosen]
        # Before the start of the run the first flight is extended backwards.
        states = self.states(chosen, np.where(times < 0.0, ages, np.maximum(ages, 0.0)))
        s, c, p = (states[name] for name in "scp")
        position = self.places.position(piece, s, c)
        x, y = self.places.centre(body, piece, s, c)
        return {
            "t": times,
            "ball": body + 1,
            "arc": piece + 1,
            "angle": self.places.angle(piece, position),
            "s": self.places.arc_length(piece, position),
            "x": x,
            "y": y,
            "speed": self.places.speed_factor(body, piece) * p,
            "energy": states["energy"].copy(),
        }


MOST_FLIGHTS = 200_000
"""Logs of runs with more flights than this are not kept for figures and reports."""


# Auxiliary columns that are gathered with those of the flights.
_NUMBER, _LASTS = "number", "lasts"


class LongMotion:
    """The motion of a compiled run on a trace whose log is not kept.

    The run has `flights` flights; if it was interrupted, it ended when this many had begun.
    """

    def __init__(
        self, system: TraceSystem, limits: Limits, flights: int, interrupted: bool = False
    ) -> None:
        self.system = system
        self._limits = limits
        self._most = flights if interrupted else math.inf
        self._places = Places(system)
        self._overrides = SYSTEM.overrides(system)
        self._world = make_world(system)
        self.state: dict[str, Any] = {}
        """Complete state of the run after its last event."""
        self._table, self._numbers, self._durations = self._gathered(flights)
        self._asked: Any = np.zeros(0, dtype=np.int64)
        self._near: World | None = None

    def flights(self) -> dict[str, Any]:
        """Return all flights of all bodies: start, end and why each one ended."""
        return self._table

    def look_at(self, rows: Any) -> None:
        """Collect the rows of the log for flights, given as rows of their table."""
        numbers = np.unique(self._numbers[np.asarray(rows, dtype=np.int64)])
        if len(self._asked) and np.all(_among(self._asked, numbers)):
            return
        logs, clock = self._rows_of(numbers)
        self._near = with_logs(SYSTEM.loop, self._world, "compiled", logs, clock)
        self._asked = numbers

    def flight_curve(
        self, index: Any, count: Any, lasts: float = math.inf
    ) -> tuple[Floats, Floats, Floats]:
        """Return times, angles (positions) and rates along flights, see ``systems.run.Run``."""
        rows = np.atleast_1d(index)
        self.look_at(rows)
        assert self._near is not None
        each, after = _points_along(self._durations[rows], count, lasts)
        logged = np.searchsorted(self._asked, self._numbers[rows])
        states = states_at(self._near, logged[each], after, self._overrides)
        body, piece = (int(self._table[name][rows[0]]) - 1 for name in ("ball", "arc"))
        times = self._table["t_start"][rows][each] + after
        return times, *places_and_rates(self._places, body, piece, states)

    def sample(self, times: Any, side: str = "after", extrapolate: bool = False) -> dict[str, Any]:
        """Return the columns of the motion table at times (s), see ``systems.run.Run``."""
        end = float(np.max(self._table["t_end"]))
        instants = within_run(times, end, extrapolate)
        order = np.argsort(instants, kind="stable")
        waiting = instants[order]
        parts: list[dict[str, Any]] = []
        for stretch in self._stretches():
            until = stretch.end[0]
            count = len(waiting)
            if stretch.cause == RUNNING:
                count = int(np.searchsorted(waiting, until, "left" if side == "after" else "right"))
            if count or not parts:  # empty columns if there are no times
                parts.append(self._paths(stretch).sample(waiting[:count], side))
            waiting = waiting[count:]
            if not len(waiting):
                break
        return self._in_order(parts, order)

    def _in_order(self, parts: list[dict[str, Any]], order: Any) -> dict[str, Any]:
        """Join samples and restore the original order of the times (all bodies at each time)."""
        bodies = np.arange(len(self.system.bodies))
        rows = np.empty(len(order) * len(bodies), dtype=np.int64)
        rows[(order[:, None] * len(bodies) + bodies).ravel()] = np.arange(len(rows))
        return {name: np.concatenate([part[name] for part in parts])[rows] for name in parts[0]}

    def _stretches(self) -> Iterator[Stretch]:
        self._solved = run = begun(SYSTEM, self.system, self._limits)
        return ahead(run.until(lambda: run.driver.rows["log"] >= self._most))

    def _paths(self, stretch: Stretch) -> Paths:
        recorded = stretch.engine, stretch.logs, stretch.clock
        self._world = with_logs(SYSTEM.loop, self._world, *recorded)
        return Paths(self._places, self._world, stretch)

    def _gathered(self, flights: int) -> tuple[dict[str, Any], Any, Any]:
        """Solve the run; return its table of flights, their rows in the log and durations (s)."""
        columns: dict[str, Any] = {}
        bodies, edges, count = np.arange(len(self.system.bodies) + 1), [], 0
        for stretch, own in _numbered(self._stretches()):
            paths = self._paths(stretch)
            over = np.flatnonzero(~paths.last if stretch.cause == RUNNING else paths.last)
            over = over[: flights - count]  # a different run may have more; its state reveals it
            table = paths.columns() | {_NUMBER: own[paths.number], _LASTS: paths.duration}
            columns = columns or self._room(table, flights)
            for name, values in table.items():
                columns[name][count : count + len(over)] = values[over]
            edges.append((count + np.searchsorted(paths.body[over], bodies)).tolist())
            count += len(over)
        self.state = self._solved.state
        # Flights are sorted by body within each stretch: sort them by body over the whole run.
        order = [slice(*each[body : body + 2]) for body in bodies[:-1] for each in edges]
        for name in list(columns):
            columns[name] = np.concatenate([columns[name][rows] for rows in order])
        numbers, durations = columns.pop(_NUMBER), columns.pop(_LASTS)
        return columns | {name: _WORDS[columns[name]] for name in CAUSES}, numbers, durations

    def _room(self, table: dict[str, Any], flights: int) -> dict[str, Any]:
        """Allocate columns for `flights` flights, with small types for small integers."""
        greatest = {
            "ball": len(self.system.bodies),
            "arc": len(self.system.trace.pieces),
            **dict.fromkeys(CAUSES, len(CAUSE_NAMES)),
            _NUMBER: flights,
        }
        types = {name: np.min_scalar_type(number) for name, number in greatest.items()}
        return {n: np.empty(flights, types.get(n, values.dtype)) for n, values in table.items()}

    def _rows_of(self, wanted: Any) -> tuple[dict[str, Any], Any]:
        """Return logs of some flights only, given by their ascending numbers."""
        flights, segments = [], []
        for stretch, own in _numbered(self._stretches()):
            rows = np.flatnonzero(_among(wanted, own) & (np.arange(len(own)) >= stretch.known))
            flights.append(stretch.logs["log"][rows])
            found = stretch.logs["segments"]
            found = found[np.isin(found["flight"], rows)]
            found["flight"] = np.searchsorted(wanted, own[found["flight"]])
            segments.append(found)
            if np.max(own) >= wanted[-1]:
                break
        rows_of = {"log": np.concatenate(flights), "segments": np.concatenate(segments)}
        return {**stretch.logs, **rows_of}, stretch.clock


def _among(ascending: Any, numbers: Any) -> Any:
    """Return which numbers occur in an array of ascending numbers, which is not empty."""
    return ascending.take(np.searchsorted(ascending, numbers), mode="clip") == numbers


def _numbered(stretches: Iterator[Stretch]) -> Iterator[tuple[Stretch, Any]]:
    """Yield stretches, each with the row numbers of its flights in the log of the whole run."""
    count, carried = 0, np.zeros(0, dtype=np.int64)
    for stretch in stretches:
        log = stretch.logs["log"]
        new = len(log) - stretch.known
        own = np.concatenate([carried, np.arange(count, count + new)])
        count += new
        carried = own[last_of_each(log)]
        yield stretch, own


def last_of_each(log: Any) -> Any:
    """Return the index of each body's last row in the log of flights."""
    last = np.empty(int(log["body"].max()) + 1, dtype=np.int64)
    last[log["body"]] = np.arange(len(log))  # the last assignment wins
    return last
