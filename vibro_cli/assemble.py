"""Build the systems to solve from scenarios; the only module that knows both.

Mechanical errors of a scenario are collected and reported together. The numbers of a scenario of a
trace may be arrays (see ``numerics.elementwise``). The numbers of the system are then arrays too,
and the same checks find which of many scenarios are invalid. Checks that need a search, such as
where a body touches a piece that it does not roll on, take a single scenario only.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Any

from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.mechanics import initial_conditions, reachability
from vibro_cli.mechanics.potential import Turning
from vibro_cli.mechanics.system import (
    CUSTOM,
    INERTIA_RATIO,
    Body,
    InitialState,
    TraceSystem,
    Wall,
    mass_from_density,
    neighbours,
)
from vibro_cli.mechanics.trace import ArcShape, Piece, Trace
from vibro_cli.numerics import elementwise
from vibro_cli.numerics.elementwise import Some
from vibro_cli.scenario.base import AnyScenario, BodyTable, check_scenario
from vibro_cli.scenario.models import Ball, Scenario
from vibro_cli.scenario.models import Wall as WallTable
from vibro_cli.scenario.problems import Problem, ScenarioError, in_order
from vibro_cli.systems import system_named


def trace_of(scenario: Scenario) -> Trace:
    """Return the trace of a scenario; raise ``ValueError`` if its pieces do not make a chain."""
    table = scenario.trace
    shapes = [ArcShape(arc.shape, arc.radius, arc.length, arc.end_slope) for arc in table.arcs]
    return Trace.chain(table.start_slope, shapes, table.closed)


def speed_of(ball: Ball, body: Body, piece: Piece) -> float:
    """Return the initial speed (m/s) of a body's centre on a piece."""
    if ball.speed is not None:
        return ball.speed
    if ball.omega is not None:
        return initial_conditions.speed_of_omega(body, ball.omega)
    if ball.rate is None or not elementwise.occurs(ball.rate != 0.0):
        return 0.0
    speed = initial_conditions.speed_of_rate(piece, body, ball.rate)
    return elementwise.choose(ball.rate != 0.0, speed, 0.0)  # type: ignore[no-any-return]


def system_of(
    scenario: Scenario,
    trace: Trace,
    bodies: tuple[Body, ...],
    initial: tuple[InitialState, ...],
    turning: Turning | None,
) -> TraceSystem:
    """Return the system of a scenario from its parts."""
    left, right = scenario.ends.left, scenario.ends.right
    return TraceSystem(
        gravity=scenario.gravity,
        trace=trace,
        bodies=bodies,
        initial=initial,
        restitution=scenario.collision.k,
        law=scenario.collision.law,
        inadmissible=scenario.collision.inadmissible,
        surface=scenario.trace.surface,
        left_end=Wall(left.wall) if isinstance(left, WallTable) else None,
        right_end=Wall(right.wall) if isinstance(right, WallTable) else None,
        turning=turning,
    )


class Problems:
    """Collects the problems of a scenario, each with its place there."""

    def __init__(self, scenario: AnyScenario) -> None:
        self._scenario = scenario
        self.found: list[Problem] = []

    def refuse(self, wrong: Some) -> bool:
        """Return whether there is a problem, which the caller then adds."""
        return bool(wrong)

    def refused(self, pieces: Iterable[Piece], wrong: Iterable[Some]) -> list[Piece]:
        """Return the pieces that have a problem."""
        return [piece for piece, one in zip(pieces, wrong, strict=True) if self.refuse(one)]

    def add(self, path: str, found: str, expected: str) -> None:
        """Add a problem: what was found at a key, and what was expected there."""
        place = self._scenario.place(path)
        self.found.append(Problem.at(place, path, found, expected))

    def raise_if_any(self) -> None:
        """Raise a ScenarioError with all problems found so far, in the order of the file."""
        if self.found:
            raise ScenarioError(in_order(self.found))


_MASSES = (1e-100, 1e100)


def bodies_of(balls: Sequence[BodyTable], problems: Problems) -> tuple[Body, ...]:
    """Return the bodies; add a problem for each mass that is too small or large to compute with."""
    bodies = tuple(map(body_of, balls))
    low, high = _MASSES
    for number, (ball, body) in enumerate(zip(balls, bodies, strict=True), 1):
        if problems.refuse(elementwise.outside(body.mass, low, high)):
            key = "mass" if ball.mass is not None else "density"
            found = repr(ball.mass) if ball.mass is not None else f"a mass of {body.mass!r} kg"
            problems.add(f"balls[{number}].{key}", found, f"a mass from {low} to {high} kg")
    return bodies


def body_of(ball: BodyTable) -> Body:
    """Return a body; its numbers may be arrays (see ``numerics.elementwise``)."""
    if ball.inertia_ratio is not None or ball.body is None:
        kind, ratio = CUSTOM, 0.0 if ball.inertia_ratio is None else ball.inertia_ratio
    else:
        kind, ratio = ball.body, INERTIA_RATIO[ball.body]
    mass = ball.mass
    if mass is None:
        assert ball.density is not None  # one of both is given
        mass = mass_from_density(kind, ball.radius, ball.density, ball.thickness)
    return Body(kind, ball.radius, mass, ratio)


_CLOSING_TOLERANCE = 1e-12
_PROBABLY_DEGREES = 4.0 * math.pi
"""Angle of an arc (rad) above which its slopes were probably given in degrees."""

# Magnitudes of the rate of a rotating trace (rad/s).
_RATES = (1e-10, 1e10)


def build_system(scenario: Scenario, sound_trace: Trace | None = None) -> TraceSystem:
    """Return the system of a scenario after checking its mechanics.

    `sound_trace` is its trace, if a system with the same trace has been built before.
    Raises ScenarioError with every problem: a trace that does not close or meets itself; bodies
    that do not fit it, that could touch over others, or that start out of order or overlapping.
    """
    problems = Problems(scenario)
    trace = sound_trace or _trace(scenario, problems)
    bodies = bodies_of(scenario.balls, problems)
    problems.raise_if_any()
    trace_is_sound = sound_trace is not None or _check_trace(trace, problems)
    turning = _turning(scenario, trace, problems)
    fits = check_fit(trace, bodies, problems, trace_is_sound)
    initial = initial_states(scenario, trace, bodies, problems)
    if trace_is_sound and fits:
        check_gaps(trace, bodies, problems)
        _check_contacts(trace, bodies, problems)
    check_walls(scenario, trace, bodies, initial, problems)
    problems.raise_if_any()
    entered = (
        initial_conditions.enter_piece(trace, state) for state in initial if state is not None
    )
    return system_of(scenario, trace, bodies, tuple(entered), turning)


def with_start_of(scenario: Scenario, system: TraceSystem) -> Scenario:
    """Return a copy of a scenario in which the bodies start as in `system`, built from it."""
    changes: dict[str, float] = {}
    for number, state in enumerate(system.initial, 1):
        place = "position" if system.trace.pieces[state.piece].is_line else "angle"
        values = {"arc": state.piece + 1, place: float(state.position), "speed": float(state.speed)}
        changes |= {f"balls[{number}].{key}": value for key, value in values.items()}
    return scenario.replace(changes)


def _trace(scenario: Scenario, problems: Problems) -> Trace:
    try:
        return trace_of(scenario)
    except ValueError as error:
        problems.add("trace.arcs", str(error), "pieces that make a chain")
        raise ScenarioError(problems.found) from error


def _turning(scenario: Scenario, trace: Trace, problems: Problems) -> Turning | None:
    """Return the axis and rate of a rotating trace; None at rest or for a rate of 0."""
    table = scenario.trace.turning
    if table is None or table.rate == 0.0:
        return None
    low, high = _RATES
    if not low <= abs(table.rate) <= high:
        problems.add("trace.turning.rate", repr(table.rate), f"0, or a rate from {low} to {high}")
    if table.through_arc is None:
        return Turning(table.x or 0.0, table.rate)
    return Turning(trace.pieces[table.through_arc - 1].centre[0], table.rate)


def _check_trace(trace: Trace, problems: Problems) -> bool:
    """Check that a closed trace closes, and that no trace meets itself."""
    if trace.closed:
        distance, turn = trace.closing_error()
        turns_once = abs(abs(turn) - math.tau) <= _CLOSING_TOLERANCE
        if not turns_once or distance > _CLOSING_TOLERANCE * trace.length:
            found = f"ends {distance:.3g} m apart and a turn of {math.degrees(turn):.9g} deg"
            expected = (
                "a trace that ends at its start, in its initial direction, after a turn of 360 deg"
            )
            problems.add("trace.closed", found, expected)
            return False
    if not check_turns(trace, problems):
        return False
    meeting = {frozenset(pair) for pair in reachability.touched_pieces(trace, 0.0)}
    for first, second in sorted(sorted(pair) for pair in meeting):
        found = f"a trace whose arcs {first + 1} and {second + 1} meet"
        problems.add(f"trace.arcs[{second + 1}]", found, "a trace that does not meet itself")
    return not meeting


def check_turns(trace: Trace, problems: Problems) -> bool:
    """Check that no arc overlaps itself."""
    before = len(problems.found)
    for piece in problems.refused(trace.pieces, reachability.overlapping_pieces(trace)):
        expected = "less than a full turn (a full turn of one arc only if the trace is closed)"
        if abs(piece.angle_end - piece.angle_start) > _PROBABLY_DEGREES:
            expected += "; a number without a unit is in rad"
        problems.add(f"trace.arcs[{piece.index + 1}].end_slope", _arc(piece), expected)
    return len(problems.found) == before


def _arc(piece: Piece) -> str:
    return f"an arc of {math.degrees(piece.angle_end - piece.angle_start):.9g} deg"


def check_fit(
    trace: Trace, bodies: tuple[Body, ...], problems: Problems, trace_is_sound: bool
) -> bool:
    """Check that every body fits every valley and, on a sound trace, touches its own piece only."""
    before = len(problems.found)
    touched: dict[float, tuple[tuple[int, int], ...]] = {}
    for number, body in enumerate(bodies, 1):
        path = f"balls[{number}].radius"
        narrow = problems.refused(trace.pieces, reachability.narrow_valleys(trace, body.radius))
        if narrow:
            tightest = min(narrow, key=lambda piece: piece.radius)
            limit = f"less than {tightest.radius!r}, the radius of the valley"
            problems.add(path, repr(body.radius), f"{limit} that is arc {tightest.index + 1}")
        elif trace_is_sound:
            if body.radius not in touched:
                touched[body.radius] = reachability.touched_pieces(trace, body.radius)
            if touched[body.radius]:
                own, other = touched[body.radius][0]
                expected = "a body that touches only the piece it rolls on"
                found = f"{body.radius!r}, which on arc {own + 1} may touch arc {other + 1}"
                problems.add(path, found, expected)
    return len(problems.found) == before


def check_gaps(trace: Trace, bodies: tuple[Body, ...], problems: Problems) -> None:
    """Check that no arc is so nearly a full turn that bodies touch across its gap."""
    checked = list(range(len(bodies)))
    if all(elementwise.is_number(body.radius) for body in bodies):  # arrays are not compared
        of_size: dict[float, list[int]] = {}
        for index in checked:
            of_size.setdefault(bodies[index].radius, []).append(index)
        # Two bodies of each size represent all bodies of that size.
        checked = sorted(index for alike in of_size.values() for index in alike[:2])
    for a, b in combinations(checked, 2):
        joined = reachability.joined_behind(trace, bodies[a].radius, bodies[b].radius)
        for piece in problems.refused(trace.pieces, joined):
            expected = f"one on which bodies {a + 1} and {b + 1} cannot touch through its gap"
            problems.add(f"trace.arcs[{piece.index + 1}].end_slope", _arc(piece), expected)


def _check_contacts(trace: Trace, bodies: tuple[Body, ...], problems: Problems) -> None:
    """Check that only neighbours can touch."""
    for over in reachability.overreaching(trace, tuple(body.radius for body in bodies)):
        first, second = over.first + 1, over.second + 1
        if over.pieces is not None:
            arcs = f"arcs {over.pieces[0] + 1} and {over.pieces[1] + 1}"
            found = f"bodies that from {arcs} may touch body {first} across a gap of the trace"
            problems.add(f"balls[{second}].radius", found, "contacts of neighbours only")
            continue
        small = min(over.over, key=lambda index: bodies[index].radius)
        expected = f"one so large that bodies {first} and {second} cannot touch over it"
        problems.add(f"balls[{small + 1}].radius", repr(bodies[small].radius), expected)


def initial_states(
    scenario: Scenario, trace: Trace, bodies: tuple[Body, ...], problems: Problems
) -> list[InitialState | None]:
    """Return the initial state of each body, None where it could not be determined."""
    states: list[InitialState | None] = []
    for ball, body in zip(scenario.balls, bodies, strict=True):
        position = _next_position(scenario, trace, bodies, states, problems)
        if position is None:
            states.append(None)
            continue
        piece = trace.pieces[ball.arc - 1]
        states.append(InitialState(piece.index, position, speed_of(ball, body, piece)))
    _check_order(scenario, trace, bodies, states, problems)
    return states


def _next_position(
    scenario: Scenario,
    trace: Trace,
    bodies: tuple[Body, ...],
    states: Sequence[InitialState | None],
    problems: Problems,
) -> float | None:
    """Return the position of the next body after `states`; None if it could not be determined."""
    index = len(states)
    ball, body, path = scenario.balls[index], bodies[index], f"balls[{index + 1}]"
    piece = trace.pieces[ball.arc - 1]
    if not elementwise.holds(piece.path_radius(body.radius) > 0.0):
        return None  # the body does not fit this valley: `check_fit` has added that problem
    if ball.touching is None:
        key = "position" if piece.is_line else "angle"
        given = ball.position if piece.is_line else ball.angle
        settled = math.nan if given is None else initial_conditions.snap_to_piece(piece, given)
        if problems.refuse(elementwise.is_nan(settled)):
            limits = f"{piece.angle_start!r} to {piece.angle_end!r}"
            problems.add(f"{path}.{key}", repr(given), f"a position on arc {ball.arc}, {limits}")
            return None
        return settled
    if (previous := states[-1]) is None:
        return None
    beside = initial_conditions.beside(trace, bodies[index - 1], previous, body)
    if beside is None:
        found = f"no room to the right of body {index}"
        problems.add(f"{path}.touching", found, "a contact on the trace")
        return None
    on, position = beside
    if on != piece.index:
        found = f"arc {ball.arc}, while the contact with body {index} is on arc {on + 1}"
        problems.add(f"{path}.arc", found, f"arc {on + 1}")
        return None
    return position


def _check_order(
    scenario: Scenario,
    trace: Trace,
    bodies: tuple[Body, ...],
    states: list[InitialState | None],
    problems: Problems,
) -> None:
    """Check that the bodies start in order along the trace, without overlap, and have room."""
    gaps = []
    for a, b in neighbours(len(bodies), trace.closed):
        left, right = states[a], states[b]
        if left is None or right is None:
            continue
        path = _path_of_place(scenario, max(a, b))
        if b > a and problems.refuse(initial_conditions.out_of_order(left, right)):
            path = f"balls[{b + 1}].arc" if left.piece != right.piece else path
            found = f"body {b + 1} not to the right of body {a + 1}"
            problems.add(path, found, "bodies in order from left to right")
            continue
        gap, rounding = initial_conditions.gap(trace, bodies[a], left, bodies[b], right)
        if problems.refuse(gap < -rounding):
            first, second = min(a, b) + 1, max(a, b) + 1
            found = f"bodies {first} and {second} that overlap by {-gap:.6g} m"
            problems.add(path, found, "bodies that do not overlap")
            continue
        gaps.append(gap - 2.0 * rounding)
    if trace.closed and len(bodies) == 2 and len(trace.pieces) == 1:
        # Opposite each other in one circle, their centres are 2 R − r_1 − r_2 apart.
        touching = bodies[0].radius + bodies[1].radius
        rounding = initial_conditions.GAP_ROUNDING * EPSILON * touching
        gaps.append(trace.pieces[0].radius - touching - rounding)
    if trace.closed and len(gaps) == len(bodies) > 1 and problems.refuse(sum(gaps) <= 0.0):
        found = "bodies that touch one another all around the closed trace"
        problems.add("balls", found, "room between two of them")


def _path_of_place(scenario: Scenario, index: int) -> str:
    """Return the key that gives the initial position of a body."""
    ball = scenario.balls[index]
    keys = ("touching", "angle", "position")
    return next(f"balls[{index + 1}].{key}" for key in keys if getattr(ball, key) is not None)


def check_walls(
    scenario: Scenario,
    trace: Trace,
    bodies: tuple[Body, ...],
    states: Sequence[InitialState | None],
    problems: Problems,
) -> None:
    """Check that only the outer bodies can meet the walls, and that they start clear of them."""
    for side, index, piece in (
        ("left", 0, trace.pieces[0]),
        ("right", len(bodies) - 1, trace.pieces[-1]),
    ):
        if not isinstance(getattr(scenario.ends, side), WallTable):
            continue
        at_right = side == "right"
        touch = initial_conditions.wall_position(piece, bodies[index].radius, at_right)
        if problems.refuse(elementwise.is_nan(touch)):
            found = f"a wall that body {index + 1} cannot meet on arc {piece.index + 1}"
            problems.add(f"ends.{side}", found, "an end piece with room for the body at its wall")
            continue
        step = initial_conditions.reaches_over(trace, bodies, at_right)
        if problems.refuse(step > 0):
            inner = index - step if at_right else step
            expected = f"one so large that body {inner + 1} cannot reach the {side} wall over it"
            problems.add(f"balls[{index + 1}].radius", repr(bodies[index].radius), expected)
        state = states[index]
        if state is None or state.piece != piece.index:
            continue
        within = initial_conditions.reaches_into_wall(piece, state.position, touch, at_right)
        if problems.refuse(within):
            found = f"body {index + 1} reaching into the {side} wall"
            unit, way = "m" if piece.is_line else "rad", "left" if at_right else "right"
            expected = f"a position clear of it: {touch!r} {unit} or further {way}"
            problems.add(_path_of_place(scenario, index), found, expected)


def build_any(scenario: AnyScenario) -> Any:
    """Return the system of a scenario of any kind after checking its mechanics.

    Raises ScenarioError with every problem, and TypeError if `scenario` is not a scenario.
    """
    check_scenario(scenario)
    return system_named(scenario.system).build(scenario)
