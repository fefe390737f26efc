"""Derivatives of the instants of impacts with respect to numbers of a scenario of a trace at rest.

Each event begins new flights at an instant T with a place x and a speed v, all of which depend on
the numbers p. A flight of length t from (T0, x0, v0) gives at a fixed time

``dx = J (dx0, dv0) - xdot dT0 + (dx/dw) dw``,  ``x(t) = X(w t; x0, v0/w)`` on an arc, so that
``dx/dw = (xdot t - J12 v0)/w,   dv/dw = (v + t vdot - J22 v0)/w``,

with the closed form J of ``kernels.tangent``. An event with g(x, p) = 0 is at ``dT = -dg/gdot``,
and x and v there change by ``xdot dT`` and ``vdot dT`` more. Gap, law, wall and junction are
evaluated with numbers that carry their derivatives (``numerics.elementwise``), as is the system
that is built from the scenario: nothing is differenced.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.assemble import body_of, speed_of, system_of, trace_of
from vibro_cli.compile import kernel as engine
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
from vibro_cli.scenario.problems import KeyPath, ScenarioError, path_text
from vibro_cli.systems.driver import body_record, with_logs
from vibro_cli.systems.request import Limits
from vibro_cli.systems.run import begun
from vibro_cli.systems.trace import SYSTEM
from vibro_cli.systems.trace.motion import Places
from vibro_cli.systems.trace.system_template import changed
from vibro_cli.systems.trace.world import make_world


class NoDerivative(VibroError, ValueError):
    """Instants that have no derivative to a number, or none that is known; the message says why."""


@dataclass(frozen=True)
class ImpactTimes:
    """Impacts of a motion, as far as they were asked for."""

    t: Floats
    """[impact] s"""
    pairs: NDArray[np.int64]
    """[impact, 2] numbers of the bodies, from 1"""
    derivative: Floats
    """[impact, number] of their instants (s) to the numbers, in SI units"""
    word: tuple[str, ...]
    """What happened until the last of them: ``12`` (impact), ``1>``, ``1<`` (junction), ``1|``"""
    end_cause: str


def number_at(scenario: Scenario, path: KeyPath) -> float:
    """Return the number that a scenario has at a path.

    Raises
    ------
    NoDerivative
        If there is none, with the nearest key, or several unequal ones.
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
            raise NoDerivative(message) from error
    if isinstance(found, tuple) and found and len(set(found)) == 1:
        found = found[0]
    if isinstance(found, bool) or not isinstance(found, float):
        raise NoDerivative(
            f"{path_text(path)}: found no number there, expected one that the scenario gives"
        )
    return found


def differentiated(scenario: Scenario, paths: Sequence[KeyPath]) -> TraceSystem:
    """Return the system of a scenario whose numbers carry their derivatives to those at paths."""
    unit = np.eye(len(paths))
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
    scenario: Scenario, system: TraceSystem, paths: Sequence[KeyPath], count: int, stop_time: float
) -> ImpactTimes:
    """Return the first impacts of a motion, and how their instants change with some numbers.

    Parameters
    ----------
    scenario, system
        What is solved, and what was built of it.
    paths
        Of the numbers.
    count, stop_time
        How many impacts are wanted, and the time (s) after which none is waited for.

    Raises
    ------
    NoDerivative
        At lasting contact, at impacts of one body with two others at one instant, at passing
        touches, where a body stops at a junction, and for a rotating trace.
    """
    if system.turning is not None:
        raise NoDerivative("found a trace that turns, expected one at rest")
    walk = _Walk(differentiated(scenario, paths), system, len(paths))
    stretch, _ = begun(SYSTEM, system, Limits(stop_time, count)).whole()
    logs = stretch.logs
    walk.follow(logs["log"], logs["impacts"], _arrivals(system, stretch))
    t = np.array([one.value for one in walk.instants])
    return ImpactTimes(
        t=t,
        pairs=np.array(walk.pairs, dtype=np.int64).reshape(-1, 2),
        derivative=np.array([one.change for one in walk.instants]).reshape(-1, len(paths)),
        word=tuple(walk.word),
        end_cause=END_NAMES[stretch.cause],
    )


def _arrivals(system: TraceSystem, stretch: Any) -> Any:
    own = make_world(system)
    world = with_logs(SYSTEM.loop, own, stretch.engine, stretch.logs, stretch.clock)
    arrivals = np.zeros(len(stretch.logs["log"]), dtype=engine.dtype(Arrival))
    current = np.zeros((1, len(system.bodies)), dtype=np.int64)
    scratch = np.zeros(1, dtype=engine.dtype(Flight))
    find: Any = compiled(find_arrivals)
    series = np.zeros((SERIES_ROWS, TERMS + 1))
    find(world, arrivals, current, series, scratch)
    return arrivals


@dataclass
class _State:
    """A body at the start of a flight."""

    piece: int
    begun: Any
    """Instant (s)"""
    place: Any
    """Angle (rad) on an arc, distance (m) on a line"""
    speed: Any
    """m/s"""


class _Walk:
    """Through the events of a run, with numbers that carry derivatives."""

    def __init__(self, varied: TraceSystem, system: TraceSystem, size: int) -> None:
        self._system = varied
        self._places = Places(system)
        self._size = size
        self._records = [body_record(body) for body in varied.bodies]
        self.instants: list[Dual] = []
        self.pairs: list[tuple[int, int]] = []
        self.word: list[str] = []
        self._states = [
            _State(start.piece, 0.0, start.position, start.speed) for start in varied.initial
        ]
        for number, (one, other) in enumerate(zip(varied.initial, system.initial, strict=True), 1):
            if one.piece != other.piece:
                raise NoDerivative(f"body {number} starts on a junction")

    def follow(self, log: Any, impacts: Any, arrivals: Any) -> None:
        """Go through the rows of a whole run."""
        impact = 0
        told: set[int] = set()
        rows = {(row["t"], row["t_low"], row["body"]): n for n, row in enumerate(log)}
        for number, row in enumerate(log):
            if number in told or row["cause"] == START:
                continue
            if row["grouped"] or row["cause"] not in (COLLISION, CROSSING, WALL):
                cause = CAUSE_NAMES[row["cause"]].replace("_", " ")
                raise NoDerivative(f"bodies in lasting contact ({cause}) at {row['t']:.9g} s")
            if row["cause"] != COLLISION:
                self._leave(row, arrivals[number])
                continue
            struck = impacts[min(impact, len(impacts) - 1)]
            pair = [rows.get((row["t"], row["t_low"], struck[end])) for end in "ab"]
            if number not in pair or None in pair or any(one in told for one in pair):
                raise NoDerivative(
                    f"several impacts at one instant or lasting contact at {row['t']:.9g} s"
                )
            told.update(one for one in pair if one is not None)
            self._collide(struck, [(log[one], arrivals[one]) for one in pair])
            impact += 1

    def _carried(self, body: int, row: Any, arrival: Any) -> tuple[Any, Any]:
        """Place and speed of a body at the time of its event, which does not change yet."""
        start, size = self._states[body], self._size
        piece, old = self._system.trace.pieces[start.piece], self._system.bodies[body]
        age, pull = float(arrival["age"]), float(arrival["acceleration"])
        begun, x0 = change_of(start.begun, size), change_of(start.place, size)
        j = [float(arrival[name]) for name in ("way_way", "way_speed", "speed_way", "speed_speed")]
        s, c = (np.array([row[name]]) for name in ("before_s", "before_c"))
        place = float(self._places.position([start.piece], s, c)[0])
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
        """Place and speed at an instant that changes."""
        piece = self._system.trace.pieces[self._states[body].piece]
        scale = value_of(piece.path_scale(self._radius(body)))
        place = place + Dual(0.0, arrival["speed"] / scale * delay)
        return place, speed + Dual(0.0, arrival["acceleration"] * delay)

    def _radius(self, body: int) -> Any:
        return self._system.bodies[body].radius

    def _leave(self, row: Any, arrival: Any) -> None:
        """A junction or a wall."""
        body, t = int(row["body"]), float(row["t"])
        piece = self._system.trace.pieces[self._states[body].piece]
        right = arrival["speed"] > 0.0
        if arrival["speed"] == 0.0:
            raise NoDerivative(f"body {body + 1} stops at an end of its piece at {t:.9g} s")
        place, speed = self._carried(body, row, arrival)
        wall = row["cause"] == WALL
        end: Any = piece.angle_end if right else piece.angle_start
        if wall:
            end = wall_position(piece, self._radius(body), bool(right))
        scale = value_of(piece.path_scale(self._radius(body)))
        delay = (change_of(end, self._size) - place.change) * (scale / arrival["speed"])
        _, speed = self._moved(body, place, speed, arrival, delay)
        instant = Dual(t, delay)
        if not wall:
            self.word.append(f"{body + 1}{'>' if right else '<'}")
            self._begin(body, row, instant, end, speed)
            return
        if row["at_rest"]:
            raise NoDerivative(f"body {body + 1} comes to rest at a wall at {t:.9g} s")
        ends = self._system.right_end if right else self._system.left_end
        assert ends is not None
        self.word.append(f"{body + 1}|")
        self._begin(body, row, instant, end, -ends.restitution * speed)

    def _begin(self, body: int, row: Any, instant: Dual, place: Any, speed: Any) -> None:
        """Begin a flight, on another piece if there the row is."""
        before, pieces = self._states[body].piece, self._system.trace.pieces
        after = int(row["piece"])
        if after != before:
            right = after == (before + 1) % len(pieces) and value_of(speed) > 0.0
            one, other, radius = pieces[before], pieces[after], self._radius(body)
            edge = one.angle_end if right else one.angle_start
            beyond = (place - edge) * one.path_scale(radius) / other.path_scale(radius)
            place = (other.angle_start if right else other.angle_end) + beyond
        self._states[body] = _State(after, instant, place, speed)

    def _collide(self, struck: Any, rows: Sequence[tuple[Any, Any]]) -> None:
        """An impact of one pair."""
        t, bodies = float(struck["t"]), (int(struck["a"]), int(struck["b"]))
        closing = struck["normal_a"] * struck["speed_a_pre"]
        closing -= struck["normal_b"] * struck["speed_b_pre"]
        if struck["contact"] or not closing > 0.0:
            raise NoDerivative(f"bodies that only touch at {t:.9g} s")
        ends = [self._carried(body, *one) for body, one in zip(bodies, rows, strict=True)]
        gap, _ = self._contact(bodies, [place for place, _ in ends])
        delay = gap.change / closing
        ends = [
            self._moved(body, *end, row[1], delay)
            for body, end, row in zip(bodies, ends, rows, strict=True)
        ]
        _, normals = self._contact(bodies, [place for place, _ in ends])
        speeds = self._law(struck, bodies, normals, [speed for _, speed in ends])
        instant = Dual(t, delay)
        self.instants.append(instant)
        self.pairs.append((bodies[0] + 1, bodies[1] + 1))
        self.word.append(f"{bodies[0] + 1}{bodies[1] + 1}")
        for body, end, row, speed in zip(bodies, ends, rows, speeds, strict=True):
            self._begin(body, row[0], instant, end[0], speed)

    def _contact(self, bodies: tuple[int, int], places: Sequence[Any]) -> tuple[Any, list[Any]]:
        """Gap of two bodies (m), and n t of the paths of both."""
        pieces = [self._system.trace.pieces[self._states[body].piece] for body in bodies]
        centres, tangents = [], []
        for body, piece, place in zip(bodies, pieces, places, strict=True):
            centres.append(piece.body_centre(place, self._radius(body)))
            sine, cosine = sine_cosine(piece.slope(place))
            tangents.append((cosine, sine))
        x, y = centres[1][0] - centres[0][0], centres[1][1] - centres[0][1]
        distance = elementwise.square_root(x * x + y * y)
        normals = [(x * along + y * up) / distance for along, up in tangents]
        return distance - (self._radius(bodies[0]) + self._radius(bodies[1])), normals

    def _law(
        self, struck: Any, bodies: tuple[int, int], normals: list[Any], speeds: list[Any]
    ) -> list[Any]:
        """Speeds after an impact, see ``kernels.impact.laws``."""
        system, law = self._system, int(struck["law"])
        (qa, ha), (qb, hb) = (
            weight_and_response(law, self._records[body], normal)
            for body, normal in zip(bodies, normals, strict=True)
        )
        k = system.restitution_of(int(struck["pair"]))
        impulse = (1.0 + k) * (qa * speeds[0] - qb * speeds[1]) / (qa * ha + qb * hb)
        return [speeds[0] - impulse * ha, speeds[1] + impulse * hb]
