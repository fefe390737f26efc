"""The flights of a run as whole paths: start, end, and what they pass in between."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibro_cli.compile.kernel import Overrides, dtype, interpreted, interpreted_copies
from vibro_cli.compile.native import compiled
from vibro_cli.kernels.flow.replay import Sample, sample_flights
from vibro_cli.kernels.world import CAUSE_NAMES, Flight, World
from vibro_cli.systems.rows import record_array
from vibro_cli.systems.trace.geometry import Floats, Places
from vibro_cli.systems.wanted import within_run

CAUSES = ("cause_start", "cause_end")
"""Columns of flights: why each begins and ends."""


def states_at(world: World, rows: Any, after: Floats, overrides: Overrides | None) -> Any:
    """Return records of ``Sample``: flights, rows of the log, a time (s) after each has begun.

    ``world`` has the log, interpreted or compiled, and ``overrides`` is that of its kernels.
    """
    order = np.argsort(rows, kind="stable")
    samples = np.zeros(len(rows), dtype=dtype(Sample))
    samples["row"], samples["after"] = np.asarray(rows)[order], np.asarray(after)[order]
    log: Any = world.log
    if isinstance(log, np.ndarray):
        scratch = np.zeros(1, dtype=dtype(Flight))
        compiled(sample_flights, overrides)(world, samples, len(samples), scratch)
        found = samples
    else:
        copies = interpreted_copies(samples, Sample)
        fill: Any = interpreted(sample_flights, overrides)
        fill(world, copies, len(copies), [Flight()])
        found = record_array(copies, Sample)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    return found.take(place)


def places_and_rates(places: Places, body: int, piece: int, states: Any) -> tuple[Floats, Floats]:
    """Return angles (rad) and their rates (rad/s) of records of ``Sample`` of a body on a piece.

    On a line positions (m) and speeds (m/s).
    """
    position = places.position(np.full(len(states), piece), states["s"], states["c"])
    frequency = places.frequencies[body, piece]
    return position, states["p"] * (2.0 * frequency if frequency > 0.0 else 1.0)


class InWords:
    """Causes in words, of rows that are asked for; all of them as an array of numpy."""

    def __init__(self, numbers: Any) -> None:
        self._numbers = numbers
        self._words = np.array([*CAUSE_NAMES, "end"], dtype=object)

    def __getitem__(self, rows: Any) -> Any:
        return self._words[self._numbers[rows]]

    def __len__(self) -> int:
        return len(self._numbers)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return self[:]


class _Sorted:
    """Columns of records in another order, each put into it when it is asked for."""

    def __init__(self, records: Any, order: Any) -> None:
        self._records = records
        self._order = order
        self._columns: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._columns:
            self._columns[name] = self._records[name][self._order]
        return self._columns[name]

    def __len__(self) -> int:
        return len(self._order)


class Paths:
    """All flights of a run, body by body in order of time, each with its end.

    Parameters
    ----------
    places
        Geometry of the system.
    world
        The records of the run with its logs, interpreted or compiled.
    log
        Rows of ``FlightRow``, those of the world.
    end_t, end_t_low
        The instant at which the run ended (two doubles, s).
    overrides
        Of the run's kernels.
    """

    def __init__(
        self,
        places: Places,
        world: World,
        log: Any,
        end_t: float,
        end_t_low: float,
        overrides: Overrides | None,
    ) -> None:
        self.places = places
        self._world = world
        self._overrides = overrides
        order = np.argsort(log["body"].astype(np.int32), kind="stable")
        self.log = _Sorted(log, order)
        self.number = order
        self.body = self.log["body"]
        self.piece = self.log["piece"]
        self._end = end_t
        last = np.append(self.body[1:] != self.body[:-1], True)
        self.last = last
        following = np.minimum(np.arange(len(self.log)) + 1, len(self.log) - 1)

        def then(name: str) -> Any:
            return self.log[name][following]

        self.t_end = np.where(last, end_t, then("t"))
        self.t_end_low = np.where(last, end_t_low, then("t_low"))
        self.duration = (self.t_end - self.log["t"]) + (self.t_end_low - self.log["t_low"])

    def states(self, rows: Any, after: Any) -> Any:
        """Return records of ``Sample``: flights of these paths a time (s) after their starts."""
        return states_at(self._world, self.number[rows], after, self._overrides)

    def table(self) -> dict[str, Any]:
        """Return the flights as columns: body, arc, times, positions and rates at both ends."""
        columns = self.columns()
        return columns | {name: InWords(columns[name])[:] for name in CAUSES}

    def columns(self) -> dict[str, Any]:
        """Return the flights as columns, the causes as numbers."""
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
            "rate_start": self._rate(self.log["p"]),
            "angle_end": self.places.position(self.piece, ends["s"], ends["c"]),
            "rate_end": self._rate(ends["p"]),
            "contact": self.log["grouped"] == 1,
            "cause_start": self.log["cause"].copy(),
            "cause_end": np.where(self.last, len(CAUSE_NAMES), self.log["cause"][following]),
        }

    def _rate(self, p: Floats) -> Floats:
        """Rate of the angle (rad/s) from ``P``; on a line the speed (m/s)."""
        frequency = self.places.frequency(self.body, self.piece)
        return np.where(frequency > 0.0, 2.0 * frequency * p, p)

    def curve(
        self, index: int, count: int, lasts: float = math.inf
    ) -> tuple[Floats, Floats, Floats]:
        """Return times, positions and rates at ``count`` points along one flight, exactly.

        ``lasts`` is how much of it is wanted, s.
        """
        start = float(self.log["t"][index])
        after = np.linspace(0.0, min(float(self.duration[index]), lasts), count)
        rows = np.full(count, index)
        states = self.states(rows, after)
        body, piece = self.body[index], self.piece[index]
        return start + after, *places_and_rates(self.places, body, piece, states)

    def sample(self, times: Any, side: str = "after", extrapolate: bool = False) -> dict[str, Any]:
        """Return the motion of every body at given times (see ``systems.run.Run.sample``)."""
        if side not in ("after", "before"):
            raise ValueError(f"side must be 'after' or 'before', not {side!r}")
        times = within_run(times, self._end, extrapolate)
        bodies = len(self.places.system.bodies)
        chosen = np.empty((len(times), bodies), dtype=np.int64)
        for body in range(bodies):
            rows = np.flatnonzero(self.body == body)
            starts = self.log["t"][rows]
            where = np.searchsorted(starts, times, side="right" if side == "after" else "left")
            chosen[:, body] = rows[np.maximum(where - 1, 0)]
        return self._motion(np.repeat(times, bodies), chosen.ravel())

    def _motion(self, times: Floats, chosen: Any) -> dict[str, Any]:
        ages = (times - self.log["t"][chosen]) - self.log["t_low"][chosen]
        body, piece = self.body[chosen], self.piece[chosen]
        # Before the start of the run the first flight is followed backwards.
        states = self.states(chosen, np.where(times < 0.0, ages, np.maximum(ages, 0.0)))
        s, c, p = (states[name] for name in "scp")
        position = self.places.position(piece, s, c)
        x, y = self.places.centre(body, piece, s, c)
        return {
            "t": times,
            "ball": body + 1,
            "arc": piece + 1,
            "angle": self.places.angle(piece, s, c),
            "s": self.places.arc_length(piece, position),
            "x": x,
            "y": y,
            "speed": self.places.speed_factor(body, piece) * p,
            "energy": states["energy"].copy(),
        }
