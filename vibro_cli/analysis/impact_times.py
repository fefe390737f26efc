"""Derivatives of the times of impacts with respect to numbers of a scenario, for a trace at rest.

Each event starts new flights at a time T with a position x and a speed v, which depend on the
numbers p. For a flight of duration t from (T0, x0, v0), at a fixed time

``dx = J (dx0, dv0) - xdot dT0 + (dx/dw) dw``,  ``x(t) = X(w t; x0, v0/w)`` on an arc, so that
``dx/dw = (xdot t - J12 v0)/w,   dv/dw = (v + t vdot - J22 v0)/w``,

with the closed form J of ``kernels.tangent``. The time of an event with g(x, p) = 0 changes by
``dT = -dg/gdot``, which adds ``xdot dT`` and ``vdot dT`` to the changes of x and v. The system, and
gaps, laws, walls and junctions are evaluated with numbers that carry their derivatives
(``numerics.elementwise``); no finite differences are used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.assemble import body_of, speed_of, system_of, trace_of
from vibro_cli.compile.kernel import dtype
from vibro_cli.compile.native import compiled
from vibro_cli.errors import VibroError
from vibro_cli.kernels.impact.laws import weight_and_response
from vibro_cli.kernels.tangent.flight_jacobian import Arrival, find_arrivals
from vibro_cli.kernels.tangent.frame import SERIES_ROWS, TERMS
from vibro_cli.kernels.world import CAUSE_NAMES, COLLISION, CROSSING, END_NAMES, START, WALL, Flight
from vibro_cli.mechanics.initial_conditions import wall_position
from vibro_cli.mechanics.system import InitialState, TraceSystem
from vibro_cli.mechanics.trace import sine_cosine
from vibro_cli.numerics import elementwise
from vibro_cli.numerics.elementwise import Dual, Floats, change_of, value_of
from vibro_cli.scenario.models import Scenario
from vibro_cli.scenario.problems import KeyPath, ScenarioError, path_text, suggestion
from vibro_cli.systems.driver import body_record, with_logs
from vibro_cli.systems.request import Limits
from vibro_cli.systems.run import begun
from vibro_cli.systems.trace import SYSTEM
from vibro_cli.systems.trace.motion import Places
from vibro_cli.systems.trace.system_template import changed
from vibro_cli.systems.trace.world import make_world


class NoDerivative(VibroError, ValueError):
    """Times of impacts have no derivative, or none is known; the message says why."""


@dataclass(frozen=True)
class ImpactTimes:
    """The requested impacts of a motion."""

    t: Floats
    """[impact] times (s)."""
    pairs: NDArray[np.int64]
    """[impact, 2] numbers of the bodies, from 1"""
    word: tuple[str, ...]
    """Events up to the last impact: ``12`` (impact), ``1>``, ``1<`` (junction), ``1|`` (wall)."""
    end_cause: str
    _differentiation: _Differentiation = field(repr=False)

    @cached_property
    def derivative(self) -> Floats:
        """[impact, number] of their times (s) with respect to the numbers, in SI units."""
        return self._differentiation.derivative()


def number_at(scenario: Scenario, path: KeyPath, other: str = "") -> float:
    """Return the number that a scenario has at a path.

    `other` is a name that the caller accepts besides the paths of the scenario.

    Raises
    ------
    NoDerivative
        If there is none (the message names the nearest key), or if there are unequal ones.
    """
    found: Any = scenario
    try:
        for part in path:
            found = found[part] if isinstance(part, int) else getattr(found, part)
    except (AttributeError, IndexError, TypeError):
        found = None
        try:
            scenario.replace({path_text(path): 1.0})
        except ScenarioError as error:
            problem = error.problems[0]
            message = f"{path_text(path)}: found {problem.found}, expected {problem.expected}"
            if other and len(path) == 1:
                message += f", or {other}{suggestion(path_text(path), [other])}"
            raise NoDerivative(message) from error
    if isinstance(found, tuple) and found and len(set(found)) == 1:
        found = found[0]
    if isinstance(found, bool) or not isinstance(found, float):
        raise NoDerivative(
            f"{path_text(path)}: found no number, expected one given in the scenario"
        )
    return found


def differentiated(scenario: Scenario, paths: Sequence[KeyPath], more: int = 0) -> TraceSystem:
    """Return the system of a scenario with derivatives with respect to the numbers at `paths`.

    Derivatives with respect to `more` further numbers follow; they are null at first.
    """
    unit = np.eye(len(paths), len(paths) + more)
    values = {
        path: Dual(number_at(scenario, path), unit[n]) for n, path in enumerate(paths)
    }  # fmt: skip
    known = changed(scenario, values)
    trace = trace_of(known)
    bodies = tuple(map(body_of, known.balls))
    initial = []
    for number, (ball, body) in enumerate(zip(known.balls, bodies, strict=True), 1):
        if ball.touching is not None:
            raise NoDerivative(f"balls[{number}].touching: found a body that starts in contact")
        piece = trace.pieces[ball.arc - 1]
        place: Any = ball.position if piece.is_line else ball.angle
        initial.append(InitialState(piece.index, place, speed_of(ball, body, piece)))
    return system_of(known, trace, bodies, tuple(initial), None)


def impact_times(
    scenario: Scenario,
    system: TraceSystem,
    paths: Sequence[KeyPath],
    count: int,
    stop_time: float | None,
) -> ImpactTimes:
    """Return the first impacts of a motion, and the derivatives of their times.

    Parameters
    ----------
    scenario, system
        The scenario, and the system built from it.
    paths
        Paths of the numbers with respect to which times are differentiated.
    count, stop_time
        Number of impacts, and the time (s) at which the motion stops in any case, if there is one.

    Raises
    ------
    NoDerivative
        For lasting contact, simultaneous impacts of one body with two others, grazing contacts,
        bodies that stop at a junction, and a rotating trace.
    """
    if system.turning is not None:
        raise NoDerivative("found a trace that turns, expected one at rest")
    varied, moving = (differentiated(scenario, paths, more) for more in (0, 1))
    _check_starts(varied, system)
    stretch, _ = begun(SYSTEM, system, Limits(stop_time, count)).whole()
    logs, arrivals = stretch.logs, _arrivals(system, stretch)
    events = _events_of(logs["log"], logs["impacts"], arrivals)
    made = logs["impacts"][: sum(one.other is not None for one in events)]
    return ImpactTimes(
        t=made["t"],
        pairs=np.stack([made["a"], made["b"]], axis=1) + 1,
        word=tuple(one.word for one in events),
        end_cause=END_NAMES[stretch.cause],
        _differentiation=_Differentiation(
            varied, moving, Places(system), logs, arrivals, events, len(paths)
        ),
    )


def _arrivals(system: TraceSystem, stretch: Any) -> Any:
    own = make_world(system)
    world = with_logs(SYSTEM.loop, own, stretch.engine, stretch.logs, stretch.clock)
    arrivals = np.zeros(len(stretch.logs["log"]), dtype=dtype(Arrival))
    current = np.zeros((1, len(system.bodies)), dtype=np.int64)
    scratch = np.zeros(1, dtype=dtype(Flight))
    find: Any = compiled(find_arrivals)
    series = np.zeros((SERIES_ROWS, TERMS + 1))
    find(world, arrivals, current, series, scratch)
    return arrivals


@dataclass(frozen=True)
class _Event:
    """An event, and its rows in the log of flights."""

    word: str
    row: int
    other: int | None = None
    """For an impact, the row of body b; `row` is that of body a."""


def _events_of(log: Any, impacts: Any, arrivals: Any) -> list[_Event]:
    """Return the events of a whole run; raise `NoDerivative` at one that has no derivative."""
    found: list[_Event] = []
    paired: set[int] = set()
    columns = (log[name].tolist() for name in ("t", "t_low", "body"))
    rows = {key: number for number, key in enumerate(zip(*columns, strict=True))}
    closing = impacts["normal_a"] * impacts["speed_a_pre"]
    closing -= impacts["normal_b"] * impacts["speed_b_pre"]
    touching = impacts["contact"].astype(bool) | ~(closing > 0.0)
    for number, (row, cause) in enumerate(zip(log, log["cause"].tolist(), strict=True)):
        if number in paired or cause == START:
            continue
        if row["grouped"] or cause not in (COLLISION, CROSSING, WALL):
            words = CAUSE_NAMES[cause].replace("_", " ")
            raise NoDerivative(f"bodies in lasting contact ({words}) at {row['t']:.9g} s")
        if cause != COLLISION:
            found.append(_boundary_event(number, row, arrivals[number]["speed"]))
            continue
        impact = min(len(paired) // 2, len(impacts) - 1)
        struck = impacts[impact]
        pair = [rows.get((row["t"], row["t_low"], struck[end]), -1) for end in "ab"]
        if number not in pair or -1 in pair or not paired.isdisjoint(pair):
            raise NoDerivative(
                f"several impacts at one instant or lasting contact at {row['t']:.9g} s"
            )
        if touching[impact]:
            raise NoDerivative(f"bodies that only touch at {struck['t']:.9g} s")
        paired.update(pair)
        found.append(_Event(f"{struck['a'] + 1}{struck['b'] + 1}", *pair))
    return found


def _boundary_event(number: int, row: Any, speed: float) -> _Event:
    """Return the event of a body at a junction or a wall."""
    body, wall = row["body"] + 1, row["cause"] == WALL
    if speed == 0.0:
        raise NoDerivative(f"body {body} stops at an end of its piece at {row['t']:.9g} s")
    if wall and row["at_rest"]:
        raise NoDerivative(f"body {body} comes to rest at a wall at {row['t']:.9g} s")
    return _Event(f"{body}{'|' if wall else '>' if speed > 0.0 else '<'}", number)


def _check_starts(varied: TraceSystem, system: TraceSystem) -> None:
    for number, (one, other) in enumerate(zip(varied.initial, system.initial, strict=True), 1):
        if one.piece != other.piece:
            raise NoDerivative(f"body {number} starts on a junction")


@dataclass
class _State:
    """A body at the start of a flight."""

    piece: int
    begun: Any
    """Time (s)."""
    place: Any
    """Angle (rad) on an arc, distance (m) on a line."""
    speed: Any
    """Speed (m/s)."""


class _Differentiation:
    """A pass through the events of a run with numbers that carry derivatives.

    The numbers of `moving` carry one derivative more, with respect to time: at an impact, that of
    the place of a body is its speed.
    """

    def __init__(
        self, varied: TraceSystem, moving: TraceSystem, places: Places, logs: Any, arrivals: Any,
        events: Sequence[_Event], size: int,
    ) -> None:  # fmt: skip
        self._system, self._moving, self._places, self._size = varied, moving, places, size
        self._log, self._impacts, self._arrivals = logs["log"], logs["impacts"], arrivals
        self._events = events
        self._records = [body_record(body) for body in varied.bodies]
        self._states: list[_State] = []

    def derivative(self) -> Floats:
        """Return the derivatives of the times of impacts, shape [impact, number]."""
        self._states = [
            _State(start.piece, 0.0, start.position, start.speed) for start in self._system.initial
        ]
        ends = self._ends()
        delays: list[Floats] = []
        for one in self._events:
            if one.other is None:
                self._leave(one.row, ends[one.row])
            else:
                pair = (one.row, one.other)
                delays.append(self._collide(self._impacts[len(delays)], pair, ends))
        return np.array(delays).reshape(len(delays), self._size)

    def _ends(self) -> list[float]:
        """Return where on its piece the body of each row ended its previous flight."""
        log, current = self._log, [state.piece for state in self._states]
        pieces = np.empty(len(log), dtype=np.int64)
        for n, (body, piece) in enumerate(zip(log["body"], log["piece"], strict=True)):
            pieces[n], current[body] = current[body], piece
        ends: list[float] = self._places.position(pieces, log["before_s"], log["before_c"]).tolist()
        return ends

    def _carried(self, body: int, place: float, arrival: Any) -> tuple[Any, Any]:
        """Return place and speed of a body at the time of its event, which is held fixed."""
        start, size = self._states[body], self._size
        piece, old = self._system.trace.pieces[start.piece], self._system.bodies[body]
        age, pull = float(arrival["age"]), float(arrival["acceleration"])
        begun, x0 = change_of(start.begun, size), change_of(start.place, size)
        j = [float(arrival[name]) for name in ("way_way", "way_speed", "speed_way", "speed_speed")]
        if piece.is_line:
            slope = sine_cosine(piece.start_slope)[0]
            force = change_of(-self._system.gravity / old.kappa * slope, size)
            v0 = change_of(start.speed, size)
            moved = x0 + age * v0 + 0.5 * age * age * force - arrival["speed"] * begun
            return Dual(place, moved), Dual(arrival["speed"], v0 + age * force - pull * begun)
        rho = piece.path_radius(old.radius)
        w = old.natural_rate(self._system.gravity, rho)
        rate0 = start.speed / rho
        rate, pull = arrival["speed"] / value_of(rho), pull / value_of(rho)
        v0, faster = change_of(rate0, size), change_of(w, size) / value_of(w)
        turned = j[0] * x0 + j[1] * v0 - rate * begun
        turned = turned + (rate * age - j[1] * value_of(rate0)) * faster
        spun = j[2] * x0 + j[3] * v0 - pull * begun
        spun = spun + (rate + age * pull - j[3] * value_of(rate0)) * faster
        return Dual(place, turned), rho * Dual(rate, spun)

    def _moved(self, body: int, place: Any, speed: Any, arrival: Any, delay: Floats) -> Any:
        """Return position and speed corrected for the derivative `delay` of the event's time."""
        piece = self._system.trace.pieces[self._states[body].piece]
        scale = value_of(piece.path_scale(self._radius(body)))
        place = place + Dual(0.0, arrival["speed"] / scale * delay)
        return place, speed + Dual(0.0, arrival["acceleration"] * delay)

    def _radius(self, body: int) -> Any:
        return self._system.bodies[body].radius

    def _leave(self, number: int, at: float) -> None:
        """Advance a body past a junction or a wall."""
        row, arrival = self._log[number], self._arrivals[number]
        body, wall = int(row["body"]), row["cause"] == WALL
        piece = self._system.trace.pieces[self._states[body].piece]
        right = arrival["speed"] > 0.0
        place, speed = self._carried(body, at, arrival)
        end: Any = piece.angle_end if right else piece.angle_start
        if wall:
            end = wall_position(piece, self._radius(body), bool(right))
        scale = value_of(piece.path_scale(self._radius(body)))
        delay = (change_of(end, self._size) - place.change) * (scale / arrival["speed"])
        _, speed = self._moved(body, place, speed, arrival, delay)
        if wall:
            ends = self._system.right_end if right else self._system.left_end
            assert ends is not None
            speed = -ends.restitution * speed
        self._begin(body, row, Dual(float(row["t"]), delay), end, speed)

    def _begin(self, body: int, row: Any, instant: Dual, place: Any, speed: Any) -> None:
        """Start a flight, on the piece of its row."""
        before, pieces = self._states[body].piece, self._system.trace.pieces
        after = int(row["piece"])
        if after != before:
            right = after == (before + 1) % len(pieces) and value_of(speed) > 0.0
            one, other, radius = pieces[before], pieces[after], self._radius(body)
            edge = one.angle_end if right else one.angle_start
            beyond = (place - edge) * one.path_scale(radius) / other.path_scale(radius)
            place = (other.angle_start if right else other.angle_end) + beyond
        self._states[body] = _State(after, instant, place, speed)

    def _collide(self, struck: Any, pair: tuple[int, int], at: Sequence[float]) -> Floats:
        """Advance past an impact of one pair; return the derivative of its time."""
        bodies = int(struck["a"]), int(struck["b"])
        arrivals = [self._arrivals[row] for row in pair]
        ends = [
            self._carried(body, at[row], arrival)
            for body, row, arrival in zip(bodies, pair, arrivals, strict=True)
        ]
        gap, normals = self._contact(bodies, [place for place, _ in ends], arrivals)
        closing = struck["normal_a"] * struck["speed_a_pre"]
        closing -= struck["normal_b"] * struck["speed_b_pre"]
        delay: Floats = gap.change[:-1] / closing
        ends = [
            self._moved(body, *end, arrival, delay)
            for body, end, arrival in zip(bodies, ends, arrivals, strict=True)
        ]
        normals = [Dual(n.value, n.change[:-1] + n.change[-1] * delay) for n in normals]
        speeds = self._law(struck, bodies, normals, [speed for _, speed in ends])
        instant = Dual(float(struck["t"]), delay)
        for body, row, end, speed in zip(bodies, pair, ends, speeds, strict=True):
            self._begin(body, self._log[row], instant, end[0], speed)
        return delay

    def _contact(
        self, bodies: tuple[int, int], places: Sequence[Any], arrivals: Sequence[Any]
    ) -> tuple[Any, list[Any]]:
        """Return the gap (m) and n·t of both paths, with the derivative with respect to time."""
        centres, tangents, radii = [], [], [self._moving.bodies[body].radius for body in bodies]
        for body, place, radius, arrival in zip(bodies, places, radii, arrivals, strict=True):
            piece = self._moving.trace.pieces[self._states[body].piece]
            rate = arrival["speed"] / value_of(piece.path_scale(radius))
            moving: Any = Dual(place.value, np.append(place.change, rate))
            centre, tangent = piece.centre_and_tangent(moving, radius)
            centres.append(centre)
            tangents.append(tangent)
        x, y = centres[1][0] - centres[0][0], centres[1][1] - centres[0][1]
        distance = elementwise.square_root(x * x + y * y)
        normals = [(x * along + y * up) / distance for along, up in tangents]
        return distance - (radii[0] + radii[1]), normals

    def _law(
        self, struck: Any, bodies: tuple[int, int], normals: list[Any], speeds: list[Any]
    ) -> list[Any]:
        """Return the speeds after an impact, see ``kernels.impact.laws``."""
        system, law = self._system, int(struck["law"])
        (qa, ha), (qb, hb) = (
            weight_and_response(law, self._records[body], normal)
            for body, normal in zip(bodies, normals, strict=True)
        )
        k = system.restitution_of(int(struck["pair"]))
        impulse = (1.0 + k) * (qa * speeds[0] - qb * speeds[1]) / (qa * ha + qb * hb)
        return [speeds[0] - impulse * ha, speeds[1] + impulse * hb]
