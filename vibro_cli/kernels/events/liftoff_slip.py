"""Turning points, lift-offs and slips between the start and the end of a flight.

At a lift-off or slip a force passes its limit: the normal force of a body falls through zero, or
rolling needs more friction than there is. On an arc, alone or in contact, the normal force is
``a + b cos f + c sin f`` and the friction ``q |sin f|`` in the angle f of the pendulum, so both are
known in closed form; on a line both are constant. Segments of a motion in contact across pieces are
short compared with its time scales. There the ends of each segment decide, and the vertex of a
parabola through the ends and the middle. A body alone is not examined further if bounds from its
energy and its piece exclude both limits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from vibro_cli.compile.kernel import Series, kernel, struct
from vibro_cli.kernels.cluster.trace_forces import (
    AT_TIME,
    extreme_on_segment,
    fit_forces,
    note_forces,
    row_of,
    set_ends,
    set_forces,
)
from vibro_cli.kernels.flow.flight import passing_rate
from vibro_cli.kernels.flow.flow import LINE, POLYNOMIAL, flow, replay_flight, time_of_flight
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.numerics.elliptic import quarter_period
from vibro_cli.kernels.world import BodyForces, Flight, World, track_on

TURNING = 0
LIFT_OFF = 1
SLIP = 2

# A force beyond its limit by less than this share of the forces is so only by rounding.
FORCE_ROUNDING = 1.0e-12
# Margin of bounds for rounding, as a share of a body's weight.
CAUTION = 1.0e-6
# Positions on an orbit that can be searched at once: up to four angles, on either branch.
MOST_PLACES = 8


@struct
class Span:
    """A flight of the log, up to its end or as far as the run has come."""

    row: int  # of the log
    duration: float  # s
    ended: int  # 0: the flight continues
    found: Series  # number of passages of each kind that earlier searches found
    begun: int  # 1: its start was examined by one of them
    lift_start: int  # 1: the normal force is negative at the start
    lift_end: int  # and at the end
    slip_start: int  # 1: friction is beyond its limit at the start
    slip_end: int  # and at the end
    normal: float  # at the start, N


@struct
class Passage:
    """An instant on a flight at which something happens, and the state there."""

    span: int
    kind: int
    after: float  # from the start of the flight, s
    s: float
    c: float
    p: float
    normal: float  # N


@struct
class Course:
    """The passages of a flight through one state of its orbit: the next time and the period (s)."""

    after: float
    period: float


@struct
class Progress:
    """What is searched for, and how far the search through the spans has come."""

    turning_points: int  # 1 if turning points are wanted
    friction: float  # coefficient of friction of the trace, negative if slip is not wanted
    span: int  # the next span
    kind: int  # the next kind of passage on it
    filled: int  # passages filled in so far
    group: int  # 1 + row of the first body of the group whose forces are set; 0: none


class Search(NamedTuple):
    """A search for passages on some flights, with room for its results, and scratch."""

    spans: Sequence[Span]
    progress: Sequence[Progress]  # one
    passages: Sequence[Passage]
    courses: Sequence[Course]  # MOST_PLACES
    flights: Sequence[Flight]  # two: that of the present span, and scratch


@kernel
def find_passages(world: World, search: Search) -> int:
    """Find passages from the state of ``progress`` on, until all spans are done or room runs out.

    Fills in the forces at both ends of the spans, and the passages; those of one flight and kind
    are in order of time. Spans are best given in the order of the log. Returns the number of
    passages; if they fill the room there may be more.
    """
    now = search.progress[0]
    now.filled = 0
    while now.span < len(search.spans):
        if now.kind == TURNING:
            if now.turning_points == 1 and not _add_turnings(world, search):
                return now.filled
            now.kind = LIFT_OFF
        if not _add_limits(world, search):
            return now.filled
        now.kind = TURNING
        now.span += 1
    return now.filled


@kernel
def _add_turnings(world: World, search: Search) -> bool:
    """Add the turning points of a flight; return whether there was room for all."""
    span = search.spans[search.progress[0].span]
    flight = search.flights[0]
    replay_flight(world, world.log[span.row], span.row, flight)
    if flight.at_rest == 1:
        return True
    if flight.form == POLYNOMIAL:
        if span.ended == 0:
            return True
        search.courses[0].after = _turning_on_segment(flight, span.duration)
        search.courses[0].period = NEVER
        return _add(search, 1, TURNING)
    return _add(search, turning_courses(flight, span.duration, search.courses), TURNING)


@kernel
def turning_courses(flight: Flight, duration: float, courses: Sequence[Course]) -> int:
    """Set the courses of the turning points of a flight; return their number."""
    if flight.form == LINE:
        a = flight.line_acceleration
        courses[0].after = -flight.p / a if a != 0.0 else NEVER
        courses[0].period = NEVER
        return 1
    if flight.complementary_modulus <= 0.0:
        return 0
    s = math.sqrt(flight.parameter)
    c = math.copysign(flight.complementary_modulus, flight.flow_c)
    set_course(courses[0], flight, s, c, 0.0, duration)
    set_course(courses[1], flight, -s, c, 0.0, duration)
    return 2


@kernel
def _turning_on_segment(flight: Flight, duration: float) -> float:
    """Return the time (s) of the turning point on a segment across pieces, or NEVER.

    Segments are short: the speed is nearly linear in time.
    """
    low = 0.0
    high = duration
    _, _, start = flow(flight, low)
    _, _, end = flow(flight, high)
    if start * end >= 0.0:
        return NEVER
    while True:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            return middle
        _, _, p = flow(flight, middle)
        if p * start > 0.0:
            low = middle
        else:
            high = middle


@kernel
def set_course(
    course: Course, flight: Flight, s: float, c: float, p: float, duration: float
) -> None:
    """Set the course of a flight on an arc through a state that lies on its orbit."""
    course.after = NEVER
    course.period = NEVER
    if flight.at_rest == 1:
        return
    first = time_of_flight(flight, s, c, p)
    if rotates(flight):
        # A rotation passes a position once on its piece, and only ahead.
        ahead = s * flight.flow_c - c * flight.flow_s
        if ahead * flight.flow_p > 0.0 and first <= duration:
            course.after = first
        return
    course.after = first
    course.period = orbit_period(flight)


@kernel
def rotates(flight: Flight) -> bool:
    """Return whether the full orbit of a flight on an arc passes the highest point."""
    return flight.complementary_modulus < 0.0


@kernel
def orbit_period(flight: Flight) -> float:
    """Return the period (s) of the full orbit of a flight on an arc that turns back."""
    return 4.0 * quarter_period(flight.parameter, flight.complementary_modulus) / flight.frequency


@kernel
def _add(search: Search, count: int, kind: int) -> bool:
    """Add the passages of some courses in order of time; return whether there was room for all.

    A turning point at the very end belongs to an impact or a wall and is left out; a limit passed
    there is added.
    """
    now = search.progress[0]
    span = search.spans[now.span]
    before = span.found[kind]
    found = 0
    while count > 0:
        least = 0
        for number in range(1, count):
            if search.courses[number].after < search.courses[least].after:
                least = number
        course = search.courses[least]
        after = course.after
        if after > span.duration or (kind == TURNING and after == span.duration):
            return True
        course.after += course.period
        if after <= 0.0:
            continue
        found += 1
        if found <= before:
            continue
        if now.filled == len(search.passages):
            return False
        row = search.passages[now.filled]
        row.span = now.span
        row.kind = kind
        row.after = after
        row.s, row.c, row.p = flow(search.flights[0], after)
        now.filled += 1
        span.found[kind] += 1.0
    return True


@kernel
def _add_limits(world: World, search: Search) -> bool:
    """Add the passages of force limits on a flight; return whether there was room for all."""
    now = search.progress[0]
    span = search.spans[now.span]
    row = world.log[span.row]
    # A sliding body needs no friction, whatever its normal force.
    friction = now.friction if world.bodies[row.body].kappa > 1.0 else -1.0
    if row.grouped == 1:
        place, lifts, slips = _look_at_group(world, search, friction)
    elif row.at_rest == 1:
        _look_at_rest(world, search, friction)
        return True
    else:
        place = world.settings[0].bodies
        lifts, slips = look_at_one(world, span, friction, search.flights[0])
    if not lifts and not slips:
        return True
    one = world.forces[place]
    if now.kind == LIFT_OFF:
        if lifts:
            first = now.filled
            count = _courses(world, search, one, -1.0)
            done = _add(search, count, LIFT_OFF)
            for number in range(first, now.filled):
                _set_normal(world, search, search.passages[number], place)
            if not done:
                return False
        now.kind = SLIP
    # Without friction no limit is passed within a flight, see set_sides.
    if not slips or friction == 0.0:
        return True
    return _add(search, _courses(world, search, one, friction), SLIP)


@kernel
def _courses(world: World, search: Search, one: BodyForces, friction: float) -> int:
    """Set the courses through the states at a limit; return their number.

    The limit is that of ``friction``, or lift-off if ``friction`` is negative.
    """
    span = search.spans[search.progress[0].span]
    row = world.log[span.row]
    flight = search.flights[0]
    if row.at_rest == 1:
        return 0
    if flight.form != POLYNOMIAL:
        return limit_courses(one, friction, flight, span.duration, search.courses)
    count = 0
    for side in range(-1, 2):
        if (side == 0) == (friction < 0.0):
            after = _limit_on_segment(world, search, one, float(side), abs(friction))
            search.courses[count].after = after
            search.courses[count].period = NEVER
            count += 1
    return count


@kernel
def _limit_on_segment(
    world: World, search: Search, one: BodyForces, side: float, weight: float
) -> float:
    """Return the time (s) at which a body in contact passes a limit on its segment, or NEVER.

    ``side F - weight N`` passes zero then; its ends and its extreme between them decide.
    """
    span = search.spans[search.progress[0].span]
    start = _excess(one.normal_terms[0], one.friction_terms[0], side, weight)
    end = _excess(one.normal_terms[2], one.friction_terms[2], side, weight)
    share, _ = extreme_on_segment(one, side, weight)
    low = 0.0
    high = share * span.duration
    inner = _excess_at(world, search, one, high, side, weight) if share > 0.0 else start
    if start > 0.0 or inner <= 0.0:
        low = high
        high = span.duration
        if inner > 0.0 or end <= 0.0:
            return NEVER
    while True:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            # Friction in the other direction has its own limit.
            return high if side * one.acceleration >= 0.0 else NEVER
        if _excess_at(world, search, one, middle, side, weight) > 0.0:
            high = middle
        else:
            low = middle


@kernel
def _excess_at(
    world: World, search: Search, one: BodyForces, after: float, side: float, weight: float
) -> float:
    """Return the :func:`_excess` of a body in contact ``after`` (s) the start of its segment."""
    number = search.spans[search.progress[0].span].row
    set_forces(world, number, AT_TIME, after, search.flights[1])
    along = math.copysign(one.friction, one.acceleration)
    return _excess(one.normal, along, side, weight)


@kernel
def _excess(normal: float, along: float, side: float, weight: float) -> float:
    """Return by how much ``side F - weight N`` exceeds zero and its rounding."""
    rounding = FORCE_ROUNDING * (abs(normal) + abs(along))
    return side * along - weight * normal - rounding


@kernel
def _look_at_group(world: World, search: Search, friction: float) -> tuple[int, bool, bool]:
    """Set the forces on a body in contact; return their index and which limits it may pass.

    The forces of its whole group are set at once, for the spans that follow.
    """
    now = search.progress[0]
    span = search.spans[now.span]
    row = world.log[span.row]
    flight = search.flights[0]
    replay_flight(world, row, span.row, flight)
    goes_on = flight.form == POLYNOMIAL and row.at_rest == 0 and span.ended == 0
    # Of several launches at one instant only the last one lasts.
    if goes_on or span.duration <= 0.0:
        return 0, False, False
    leader = row_of(world, span.row, row.group_first)
    if now.group != leader + 1:
        set_ends(world, leader, span.duration, search.flights[1])
        if flight.form == POLYNOMIAL:
            set_forces(world, leader, AT_TIME, 0.5 * span.duration, search.flights[1])
            note_forces(world, leader, 1)
        else:
            fit_forces(world, leader, search.flights[1])
        now.group = leader + 1
    place = (row.body - row.group_first) % world.settings[0].bodies
    set_sides(world, span, world.forces[place], friction)
    return place, True, friction >= 0.0


@kernel
def _look_at_rest(world: World, search: Search, friction: float) -> None:
    """Set the forces on a body alone at rest, which are constant: no limit is passed."""
    span = search.spans[search.progress[0].span]
    flight = search.flights[0]
    replay_flight(world, world.log[span.row], span.row, flight)
    set_ends(world, span.row, span.duration, flight)
    set_sides(world, span, world.forces[world.settings[0].bodies], friction)


@kernel
def look_at_one(world: World, span: Span, friction: float, flight: Flight) -> tuple[bool, bool]:
    """Set the forces on a body alone if it may pass a limit; return which ones it may pass."""
    row = world.log[span.row]
    body = world.bodies[row.body]
    piece = world.pieces[row.piece]
    track = track_on(world, row.body, row.piece)
    one = world.forces[world.settings[0].bodies]
    if piece.sign == 0.0:
        one.start_normal = body.weight * piece.tangent_x
        one.start_friction = body.weight * (1.0 - 1.0 / body.kappa) * abs(piece.tangent_y)
        one.end_normal = one.start_normal
        one.end_friction = one.start_friction
        set_sides(world, span, one, friction)
        return False, False
    top = (
        min(track.highest_s2, row.parameter)
        if row.complementary_modulus >= 0.0
        else track.highest_s2
    )
    bottom = min(track.lowest_s2, top)
    # N/(m g) = sign (A - B S^2)
    a = 1.0 + 4.0 * row.parameter / body.kappa
    b = 2.0 + 4.0 / body.kappa
    least = a - b * top if piece.sign > 0.0 else b * bottom - a
    widest = 0.5 if bottom <= 0.5 <= top else (top if top < 0.5 else bottom)
    most = 2.0 * math.sqrt(max(widest * (1.0 - widest), 0.0)) * (1.0 - 1.0 / body.kappa)
    lifts = least <= CAUTION * (a + b)
    slips = friction >= 0.0 and most >= friction * least - CAUTION * (a + b)
    if not lifts and not slips:
        return False, False
    replay_flight(world, row, span.row, flight)
    s, c, p = flow(flight, 0.0)
    one.start_normal, one.start_friction = _forces(world, span.row, s, c, p)
    s, c, p = flow(flight, span.duration)
    one.end_normal, one.end_friction = _forces(world, span.row, s, c, p)
    set_sides(world, span, one, friction)
    one.normal_terms[0] = piece.sign * body.weight * (4.0 * flight.parameter - 2.0) / body.kappa
    one.normal_terms[1] = piece.sign * body.weight * (1.0 + 2.0 / body.kappa)
    one.normal_terms[2] = 0.0
    one.friction_terms[2] = body.weight * (1.0 - 1.0 / body.kappa)
    return lifts, slips


@kernel
def _forces(world: World, number: int, s: float, c: float, p: float) -> tuple[float, float]:
    """Return the normal force and the friction (N) of a body alone on an arc.

    ``N = m g sign (cos f + (4/kappa) P^2)``.
    """
    row = world.log[number]
    body = world.bodies[row.body]
    sign = world.pieces[row.piece].sign
    normal = sign * body.weight * ((c - s) * (c + s) + (4.0 / body.kappa) * p * p)
    return normal, body.weight * (1.0 - 1.0 / body.kappa) * abs(2.0 * s * c)


@kernel
def _set_normal(world: World, search: Search, found: Passage, place: int) -> None:
    """Fill in the normal force of a passage."""
    number = search.spans[found.span].row
    if world.log[number].grouped == 1:
        set_forces(world, number, AT_TIME, found.after, search.flights[1])
        found.normal = world.forces[place].normal
    else:
        found.normal = normal_of_one(world, number, found, search.flights[0])


@kernel
def normal_of_one(world: World, number: int, found: Passage, flight: Flight) -> float:
    """Return the normal force (N) of a body alone on an arc at a passage."""
    normal, _ = _forces(world, number, found.s, found.c, found.p)
    return normal


@kernel
def set_sides(world: World, span: Span, one: BodyForces, friction: float) -> None:
    """Set on which side of its limits a body starts and ends.

    Without friction a body that moves on an arc always slips: the instants at which rolling needs
    no friction, as at a bottom, do not count.
    """
    span.normal = one.start_normal
    span.lift_start = 1 if beyond(one.start_normal, one.start_friction, -1.0) else 0
    span.lift_end = 1 if beyond(one.end_normal, one.end_friction, -1.0) else 0
    span.slip_start = 0
    span.slip_end = 0
    if friction >= 0.0:
        span.slip_start = 1 if beyond(one.start_normal, one.start_friction, friction) else 0
        span.slip_end = 1 if beyond(one.end_normal, one.end_friction, friction) else 0
    if friction == 0.0:
        row = world.log[span.row]
        moves_on_arc = row.p != 0.0 and world.pieces[row.piece].sign != 0.0
        slips = moves_on_arc or span.slip_start + span.slip_end > 0
        span.slip_start = 1 if slips else 0
        span.slip_end = span.slip_start


@kernel
def beyond(normal: float, force: float, friction: float) -> bool:
    """Return whether a body is beyond a limit by more than the rounding of its forces.

    The limit is lift-off if ``friction`` is negative: the trace would have to pull. Otherwise
    rolling needs more friction than there is.
    """
    if friction < 0.0:
        return normal < -FORCE_ROUNDING * (abs(normal) + force)
    return force - friction * normal > FORCE_ROUNDING * (abs(normal) + force)


@kernel
def limit_courses(
    one: BodyForces, friction: float, flight: Flight, duration: float, courses: Sequence[Course]
) -> int:
    """Set the courses through the states at a limit; return their number.

    The limit is that of ``friction``, or lift-off if ``friction`` is negative.
    """
    if flight.form == LINE:
        return 0
    a = one.normal_terms[0]
    b = one.normal_terms[1]
    c = one.normal_terms[2]
    q = one.friction_terms[2]
    if friction < 0.0:
        # -N rises through zero.
        return _zero_courses((-a, -b, -c), 0.0, 0, duration, courses, flight)
    if q <= 0.0:
        return 0
    a *= -friction
    b *= -friction
    c *= friction
    count = _zero_courses((a, b, q - c), 1.0, 0, duration, courses, flight)
    return _zero_courses((a, b, -q - c), -1.0, count, duration, courses, flight)


@kernel
def _zero_courses(
    excess: tuple[float, float, float],
    side: float,
    count: int,
    duration: float,
    courses: Sequence[Course],
    flight: Flight,
) -> int:
    """Add the courses through the states at which ``a + b cos f + c sin f`` rises through zero.

    A ``side`` other than 0 selects the states whose sine has its sign. Returns the new number of
    courses.
    """
    a, b, c = excess
    size = math.sqrt(b * b + c * c)
    if size <= abs(a):
        return count
    middle = math.atan2(c, b)
    width = math.acos(-a / size)
    for number in range(2):
        way = 1.0 if number == 0 else -1.0
        angle = middle + way * width
        if side != 0.0 and math.sin(angle) * side <= 0.0:
            continue
        slope = -way * size * math.sin(width)
        s = math.sin(0.5 * angle)
        c_half = math.cos(0.5 * angle)
        count = _branch_course(s, c_half, slope, count, duration, courses, flight)
        count = _branch_course(-s, -c_half, slope, count, duration, courses, flight)
    return count


@kernel
def _branch_course(
    s: float,
    c: float,
    slope: float,
    count: int,
    duration: float,
    courses: Sequence[Course],
    flight: Flight,
) -> int:
    """Add the course of a position passed with a rate of the sign of ``slope``, if there is one."""
    p = passing_rate(flight, s, c, slope)
    if p == 0.0:
        return count
    set_course(courses[count], flight, s, c, p, duration)
    return count + 1
