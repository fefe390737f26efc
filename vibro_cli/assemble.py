"""From scenarios to the systems that are solved: the only place that knows both.

All that is mechanically wrong with a scenario is gathered and told at once. The numbers of a
scenario of a trace may be arrays (see ``numerics.elementwise``): then so are those of the system.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Any, TypeAlias

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
from vibro_cli.scenario.base import AnyScenario, BodyTable, check_scenario
from vibro_cli.scenario.models import Ball, Scenario
from vibro_cli.scenario.models import Wall as WallTable
from vibro_cli.scenario.problems import Problem, ScenarioError
from vibro_cli.systems import system_named


def trace_of(scenario: Scenario) -> Trace:
    """Return the trace; raises ``ValueError`` if the pieces do not make a chain."""
    table = scenario.trace
    shapes = [ArcShape(arc.shape, arc.radius, arc.length, arc.end_slope) for arc in table.arcs]
    return Trace.chain(table.start_slope, shapes, table.closed)


def speed_of(ball: Ball, body: Body, piece: Piece) -> float:
    """Return the speed (m/s) with which the centre of a body starts on a piece."""
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


# Within these bounds no product or quotient of the mechanics leaves the range of doubles.
SIZES = (1e-30, 1e30)
# Beyond it the sum of two times, or a time in units of a period, leaves that range.
LONGEST = 1e300

Given = tuple[str, float | None]
"""A key of the scenario and its number, None where none is given."""


def given(table: Any, path: str, *keys: str) -> list[Given]:
    """Return keys of a table at a path, with their numbers; 0 is right where its key allows it."""
    return [(f"{path}.{key}", getattr(table, key) or None) for key in keys]


class Findings:
    """Collects what is wrong, each with its place in the scenario."""

    def __init__(self, scenario: AnyScenario) -> None:
        self._scenario = scenario
        self.problems: list[Problem] = []

    def add(self, path: str, found: str, expected: str) -> None:
        """Add what was found at a key, and what was expected there."""
        place = self._scenario.place(path)
        self.problems.append(Problem.at(place, path, found, expected))

    def add_wrong_lengths(self, given: Iterable[Given]) -> None:
        """Add the lengths (m) that doubles cannot compute with."""
        low, high = SIZES
        for path, length in given:
            if length is not None and not low <= length <= high:
                self.add(path, repr(length), f"a length from {low} to {high} m")

    def add_wrong_numbers(self, given: Iterable[Given]) -> None:
        """Add the places, speeds and rates that doubles cannot compute with."""
        high = SIZES[1]
        for path, value in given:
            if value is not None and abs(value) > high:
                self.add(path, repr(value), f"a number from {-high} to {high}")

    def add_wrong_time(self, stop_time: float | None) -> None:
        """Add the end of the run (s) if doubles cannot compute with it."""
        if stop_time is not None and stop_time > LONGEST:
            self.add("stop.time", repr(stop_time), f"a time up to {LONGEST} s")

    def settle(self) -> None:
        """Raise everything found so far, in the order of the file."""
        if self.problems:
            by_place = sorted(self.problems, key=lambda found: (found.line or 0, found.column or 0))
            raise ScenarioError(by_place)


_MASSES = (1e-100, 1e100)


def bodies_of(balls: Sequence[BodyTable], findings: Findings) -> tuple[Body, ...]:
    """Return the bodies; one of a mass that doubles cannot compute with is a finding."""
    bodies = tuple(map(body_of, balls))
    low, high = _MASSES
    for number, (ball, body) in enumerate(zip(balls, bodies, strict=True), 1):
        if not low <= body.mass <= high:
            key = "mass" if ball.mass is not None else "density"
            found = repr(ball.mass) if ball.mass is not None else f"a mass of {body.mass!r} kg"
            findings.add(f"balls[{number}].{key}", found, f"a mass from {low} to {high} kg")
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

_GRAVITIES = (1e-30, 1e30)
_MOST_SLOPE = 1e3
# Rates of turning (rad/s), of either sign.
_RATES = (1e-10, 1e10)


def build_system(scenario: Scenario) -> TraceSystem:
    """Return the system of a scenario, checked against the mechanics.

    Raises ScenarioError with every problem: a trace that does not close or meets itself, bodies
    that do not fit it, that could touch over others, or that start out of order or overlapping.
    """
    findings = Findings(scenario)
    _check_sizes(scenario, findings)
    findings.settle()
    trace = _trace(scenario, findings)
    bodies = bodies_of(scenario.balls, findings)
    findings.settle()
    trace_is_sound = _check_trace(trace, findings)
    turning = _turning(scenario, trace, findings)
    fits = _check_fit(trace, bodies, findings, trace_is_sound)
    initial = _initial(scenario, trace, bodies, findings)
    if trace_is_sound and fits:
        _check_contacts(trace, bodies, findings)
    _check_walls(scenario, trace, bodies, initial, findings)
    findings.settle()
    entered = (
        initial_conditions.enter_piece(trace, state) for state in initial if state is not None
    )
    return system_of(scenario, trace, bodies, tuple(entered), turning)


def _trace(scenario: Scenario, findings: Findings) -> Trace:
    try:
        return trace_of(scenario)
    except ValueError as error:
        findings.add("trace.arcs", str(error), "pieces that make a chain")
        raise ScenarioError(findings.problems) from error


def _check_sizes(scenario: Scenario, findings: Findings) -> None:
    """Check that sizes, slopes, speeds and times are such that doubles can compute with them."""
    sizes: list[Given] = []
    slopes: list[Given] = [("trace.start_slope", scenario.trace.start_slope)]
    speeds: list[Given] = []
    for number, arc in enumerate(scenario.trace.arcs, 1):
        path = f"trace.arcs[{number}]"
        sizes += [(f"{path}.radius", arc.radius), (f"{path}.length", arc.length)]
        slopes.append((f"{path}.end_slope", arc.end_slope))
    for number, ball in enumerate(scenario.balls, 1):
        path = f"balls[{number}]"
        sizes += [(f"{path}.radius", ball.radius or None), (f"{path}.thickness", ball.thickness)]
        speeds += [(f"{path}.{key}", getattr(ball, key)) for key in ("rate", "omega", "speed")]
    low, high = _GRAVITIES
    if not low <= scenario.gravity <= high:
        expected = f"an acceleration from {low} to {high} m/s^2"
        findings.add("gravity", repr(scenario.gravity), expected)
    findings.add_wrong_time(scenario.stop.time)
    findings.add_wrong_lengths(sizes)
    for path, slope in slopes:
        if slope is not None and abs(slope) > _MOST_SLOPE:
            findings.add(path, repr(slope), f"a slope from {-_MOST_SLOPE} to {_MOST_SLOPE} rad")
    findings.add_wrong_numbers(speeds)


def _turning(scenario: Scenario, trace: Trace, findings: Findings) -> Turning | None:
    """The axis and the rate of a trace that turns; None at rest, which a rate of 0 is."""
    table = scenario.trace.turning
    if table is None or table.rate == 0.0:
        return None
    low, high = _RATES
    if not low <= abs(table.rate) <= high:
        findings.add("trace.turning.rate", repr(table.rate), f"0, or a rate from {low} to {high}")
    if table.through_arc is None:
        return Turning(table.x or 0.0, table.rate)
    return Turning(trace.pieces[table.through_arc - 1].center[0], table.rate)


def _check_trace(trace: Trace, findings: Findings) -> bool:
    """Check that the trace closes if it should, and meets itself nowhere."""
    if trace.closed:
        distance, turn = trace.closing_error()
        turns_once = abs(abs(turn) - math.tau) <= _CLOSING_TOLERANCE
        if not turns_once or distance > _CLOSING_TOLERANCE * trace.length:
            found = f"ends {distance:.3g} m apart and a turn of {math.degrees(turn):.9g} deg"
            expected = "a trace that ends where and how it began, after a turn of 360 deg"
            findings.add("trace.closed", found, expected)
            return False
    overlapping = reachability.overlapping_pieces(trace)
    for index in overlapping:
        piece = trace.pieces[index]
        sweep = math.degrees(piece.angle_end - piece.angle_start)
        expected = "less than a full turn (a full turn of one arc only if the trace is closed)"
        findings.add(f"trace.arcs[{index + 1}].end_slope", f"an arc of {sweep:.9g} deg", expected)
    if overlapping:
        return False
    meeting = {frozenset(pair) for pair in reachability.touched_pieces(trace, 0.0)}
    for first, second in sorted(sorted(pair) for pair in meeting):
        found = f"a trace whose arcs {first + 1} and {second + 1} meet"
        findings.add(f"trace.arcs[{second + 1}]", found, "a trace that does not meet itself")
    return not meeting


def _check_fit(
    trace: Trace, bodies: tuple[Body, ...], findings: Findings, trace_is_sound: bool
) -> bool:
    """Check that every body fits every valley and touches only the piece it rolls on."""
    before = len(findings.problems)
    touched: dict[float, tuple[tuple[int, int], ...]] = {}
    for number, body in enumerate(bodies, 1):
        path = f"balls[{number}].radius"
        narrow = reachability.narrow_valleys(trace, body.radius)
        if narrow:
            tightest = min(narrow, key=lambda index: trace.pieces[index].radius)
            limit = f"less than {trace.pieces[tightest].radius!r}, the radius of the valley"
            findings.add(path, repr(body.radius), f"{limit} that is arc {tightest + 1}")
        elif trace_is_sound:
            if body.radius not in touched:
                touched[body.radius] = reachability.touched_pieces(trace, body.radius)
            if touched[body.radius]:
                own, other = touched[body.radius][0]
                expected = "a body that touches no other piece than the one it rolls on"
                found = f"{body.radius!r}, which on arc {own + 1} may touch arc {other + 1}"
                findings.add(path, found, expected)
    return len(findings.problems) == before


def _check_contacts(trace: Trace, bodies: tuple[Body, ...], findings: Findings) -> None:
    """Check that bodies touch only as neighbours do."""
    known: dict[tuple[float, float], tuple[int, ...]] = {}
    for a, b in combinations(range(len(bodies)), 2):
        pair = bodies[a].radius, bodies[b].radius
        if pair not in known:
            known[pair] = reachability.joined_behind(trace, *pair)
        for index in known[pair]:
            piece = trace.pieces[index]
            sweep = math.degrees(piece.angle_end - piece.angle_start)
            expected = f"one on which bodies {a + 1} and {b + 1} cannot touch through its gap"
            path = f"trace.arcs[{index + 1}].end_slope"
            findings.add(path, f"an arc of {sweep:.9g} deg", expected)
    for over in reachability.overreaching(trace, tuple(body.radius for body in bodies)):
        first, second = over.first + 1, over.second + 1
        if over.pieces is not None:
            arcs = f"arcs {over.pieces[0] + 1} and {over.pieces[1] + 1}"
            found = f"bodies that from {arcs} may touch body {first} across a gap of the trace"
            findings.add(f"balls[{second}].radius", found, "contacts of neighbours only")
            continue
        small = min(over.over, key=lambda index: bodies[index].radius)
        expected = f"one so large that bodies {first} and {second} cannot touch over it"
        findings.add(f"balls[{small + 1}].radius", repr(bodies[small].radius), expected)


def _initial(
    scenario: Scenario, trace: Trace, bodies: tuple[Body, ...], findings: Findings
) -> list[InitialState | None]:
    """Return where each body starts, None where that could not be told."""
    states: list[InitialState | None] = []
    for index, (ball, body) in enumerate(zip(scenario.balls, bodies, strict=True)):
        previous = (bodies[index - 1], states[index - 1]) if index else None
        position = _position(index, ball, body, trace, previous, findings)
        if position is None:
            states.append(None)
            continue
        states.append(
            InitialState(ball.arc - 1, position, speed_of(ball, body, trace.pieces[ball.arc - 1]))
        )
    _check_order(scenario, trace, bodies, states, findings)
    return states


def _position(
    index: int,
    ball: Ball,
    body: Body,
    trace: Trace,
    previous: tuple[Body, InitialState | None] | None,
    findings: Findings,
) -> float | None:
    piece = trace.pieces[ball.arc - 1]
    if not piece.path_radius(body.radius) > 0.0:
        return None  # it does not fit this valley, which has been said
    path = f"balls[{index + 1}]"
    if ball.touching is None:
        key = "position" if piece.is_line else "angle"
        given = ball.position if piece.is_line else ball.angle
        settled = None if given is None else initial_conditions.settle(piece, given)
        if settled is None:
            limits = f"{piece.angle_start!r} to {piece.angle_end!r}"
            findings.add(f"{path}.{key}", repr(given), f"a place on arc {ball.arc}, {limits}")
        return settled
    if previous is None or previous[1] is None:
        return None
    beside = initial_conditions.beside(trace, previous[0], previous[1], body)
    if beside is None:
        found = f"no room to the right of body {index}"
        findings.add(f"{path}.touching", found, "a contact on the trace")
        return None
    on, position = beside
    if on != piece.index:
        found = f"arc {ball.arc}, while the contact with body {index} is on arc {on + 1}"
        findings.add(f"{path}.arc", found, f"arc {on + 1}")
        return None
    return position


def _check_order(
    scenario: Scenario,
    trace: Trace,
    bodies: tuple[Body, ...],
    states: list[InitialState | None],
    findings: Findings,
) -> None:
    """Check that the bodies start in order along the trace and that no two overlap."""
    for a, b in neighbours(len(bodies), trace.closed):
        left, right = states[a], states[b]
        if left is None or right is None:
            continue
        later, ball = max(a, b), scenario.balls[max(a, b)]
        keys = ("touching", "angle", "position")
        key = next(key for key in keys if getattr(ball, key) is not None)
        path = f"balls[{later + 1}].{key}"
        if b > a and (left.piece, left.position) >= (right.piece, right.position):
            key = "arc" if left.piece != right.piece else key
            found = f"body {b + 1} not to the right of body {a + 1}"
            findings.add(f"balls[{b + 1}].{key}", found, "bodies in order from left to right")
            continue
        gap, rounding = initial_conditions.gap(trace, bodies[a], left, bodies[b], right)
        if gap < -rounding:
            found = f"bodies {min(a, b) + 1} and {later + 1} that overlap by {-gap:.6g} m"
            findings.add(path, found, "bodies that do not overlap")


def _check_over_outermost(
    trace: Trace, bodies: tuple[Body, ...], at_right: bool, findings: Findings
) -> None:
    """Check that no inner body reaches a wall over those between it and the wall."""
    side, outer = ("right", len(bodies) - 1) if at_right else ("left", 0)
    row = bodies[::-1] if at_right else bodies
    step = initial_conditions.reaches_over(trace.mirrored() if at_right else trace, row)
    if step is not None:
        number = outer - step if at_right else step
        reach = f"body {number + 1} cannot reach the {side} wall over it"
        found = repr(bodies[outer].radius)
        findings.add(f"balls[{outer + 1}].radius", found, f"one so large that {reach}")


def _check_walls(
    scenario: Scenario,
    trace: Trace,
    bodies: tuple[Body, ...],
    states: list[InitialState | None],
    findings: Findings,
) -> None:
    """Check that the outer bodies, and none else, can meet their walls, and start free of them."""
    for side, index, piece in (
        ("left", 0, trace.pieces[0]),
        ("right", len(bodies) - 1, trace.pieces[-1]),
    ):
        if not isinstance(getattr(scenario.ends, side), WallTable):
            continue
        at_right = side == "right"
        touch = initial_conditions.wall_position(piece, bodies[index].radius, at_right)
        if touch is None:
            found = f"a wall that body {index + 1} cannot meet on arc {piece.index + 1}"
            findings.add(f"ends.{side}", found, "an end piece with room for the body at its wall")
            continue
        _check_over_outermost(trace, bodies, at_right, findings)
        state = states[index]
        if state is None or state.piece != piece.index:
            continue
        beyond = state.position - touch if at_right else touch - state.position
        if beyond > 1e-15 * max(1.0, abs(touch)):
            ball = scenario.balls[index]
            key = "angle" if ball.angle is not None else "position"
            path = f"balls[{index + 1}].{'touching' if ball.touching else key}"
            found = f"body {index + 1} reaching into the {side} wall"
            expected = f"a place free of it: {touch!r} or further {'left' if at_right else 'right'}"
            findings.add(path, found, expected)


AnySystem: TypeAlias = Any
"""What is solved, of whatever kind."""


def build_any(scenario: AnyScenario) -> AnySystem:
    """Return the system of a scenario of whatever kind, checked against its mechanics.

    Raises ScenarioError with everything that is wrong, and TypeError for what is no scenario.
    """
    check_scenario(scenario)
    return system_named(scenario.system).build(scenario)


def warnings_of(scenario: AnyScenario, system: AnySystem) -> tuple[str, ...]:
    """Return what a user should know about a sound system before running it, a sentence each."""
    return system_named(scenario.system).warnings(scenario, system)
