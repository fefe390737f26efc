"""What happens on a flight of a rotating trace between its start and its end.

On an arc a force passes its limit where a trigonometric polynomial of degree 2 in the angle from
the start has a zero, on a line where a linear function of the way has one; each such place is
passed once in a period with the rate that takes a body beyond. The kernels stand in for those of
``kernels.events.liftoff_slip``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.cluster.rotating_clusters import kept
from vibro_cli.kernels.cluster.trace_forces import AT_TIME, fit_forces, set_ends, set_forces
from vibro_cli.kernels.events.liftoff_slip import (
    CAUTION,
    Course,
    Passage,
    Span,
    set_course,
    set_sides,
)
from vibro_cli.kernels.flow.flow import flow, group_of_body
from vibro_cli.kernels.flow.replay import recall_flight
from vibro_cli.kernels.flow.rotating_flight import fall_through_zero, potential, scaled
from vibro_cli.kernels.flow.rotating_flow import (
    TURNING_LINE,
    half_range,
    half_way,
    sides_turned,
    time_on_line,
    turn_on_line,
)
from vibro_cli.kernels.numerics.elliptic import sine_cosine
from vibro_cli.kernels.numerics.trigonometric_polynomial import (
    Harmonics,
    combined,
    harmonic_size,
    harmonic_slope,
    harmonic_value,
    next_zero,
)
from vibro_cli.kernels.numerics.weierstrass_motion import period_of, squared_rate
from vibro_cli.kernels.world import NEVER, BodyForces, Flight, World

# Places are looked for this far (rad) beyond where a flight has come: times decide.
MARGIN = 1.0e-9
# A polynomial of degree 2 has no more zeros in a turn.
MOST_ZEROS = 4


@kernel
def rotates(flight: Flight) -> bool:
    """Tell whether the full orbit of a flight on an arc takes it all the way round."""
    return flight.turns_over == 1


@kernel
def orbit_period(flight: Flight) -> float:
    """Period (s) of the full orbit of a flight on an arc that turns back."""
    return period_of(flight) / flight.frequency


@kernel
def _state_after(flight: Flight, duration: float) -> tuple[float, float, float]:
    """``(S, C, P)`` of the motion on an arc a time (s) after its start."""
    s, c, p = flow(flight, duration)
    if flight.grouped == 0:
        return s, c, p
    s, c = group_of_body(flight, s, c)
    return s, c, p / flight.rate_ratio


@kernel
def turning_courses(flight: Flight, duration: float, courses: Sequence[Course]) -> int:
    """Set the courses of the turning points that a flight has come to; return their number."""
    if flight.form == TURNING_LINE:
        way = turn_on_line(flight)
        courses[0].after = time_on_line(flight, way, 0.0) if way * flight.flow_p > 0.0 else NEVER
        courses[0].period = NEVER
        return 1
    if flight.turns_over == 1:
        return 0
    _, _, p = _state_after(flight, duration)
    left, right = sides_turned(flight, p, duration)
    count = 0
    for number in range(2):
        side = 1.0 if number == 0 else -1.0
        if right if number == 0 else left:
            sine, cosine = sine_cosine(side * half_way(flight, side))
            _set_place(courses[count], flight, sine, cosine, 0.0, duration)
            count += 1
    return count


@kernel
def _set_place(
    course: Course, flight: Flight, sine: float, cosine: float, p: float, duration: float
) -> None:
    """Set when a flight passes a place whose half angle from the start has this sine and cosine."""
    s = flight.flow_s * cosine + flight.flow_c * sine
    c = flight.flow_c * cosine - flight.flow_s * sine
    set_course(course, flight, s, c, p, duration)


@kernel
def look_at_one(world: World, span: Span, friction: float, flight: Flight) -> tuple[bool, bool]:
    """Set the forces on a body alone, if it may pass a limit; which ones it may."""
    row = world.log[span.row]
    body = world.bodies[row.body]
    sign = world.pieces[row.piece].sign
    track = world.tracks[row.body * world.settings[0].pieces + row.piece]
    lifts = True
    slips = friction >= 0.0
    if sign != 0.0:
        energy = row.p * row.p + potential(track, row.s, row.c)
        least = track.least_press + sign * (4.0 / body.kappa) * energy
        if sign > 0.0:
            least = max(least, track.least_still)
        most = track.most_angular / (track.frequency * track.frequency) * (1.0 - 1.0 / body.kappa)
        caution = CAUTION * (1.0 + abs(track.tilt) + track.spread + 4.0 * abs(energy))
        lifts = least <= caution
        slips = slips and most >= friction * least - caution
        if not lifts and not slips:
            return False, False
    recall_flight(world, row, span.row, flight)
    set_ends(world, span.row, span.duration, flight)
    fit_forces(world, span.row, flight)
    set_sides(span, world.forces[world.settings[0].bodies], friction)
    return lifts, slips


@kernel
def normal_of_one(world: World, number: int, found: Passage, flight: Flight) -> float:
    """Normal force (N) of a body alone where it is in a passage."""
    set_forces(world, number, AT_TIME, found.after, flight)
    return world.forces[world.settings[0].bodies].normal


@kernel
def limit_courses(
    one: BodyForces, friction: float, flight: Flight, duration: float, courses: Sequence[Course]
) -> int:
    """Set the courses at whose states a limit is passed: of friction, or negative, of lift-off."""
    press = kept(one.press)
    drag = kept(one.drag)
    if friction >= 0.0 and harmonic_size(drag) == 0.0:
        return 0
    ways = 0.0, 0.0
    if flight.form != TURNING_LINE:
        ways = half_range(flight, _state_after(flight, duration), duration)
    count = 0
    for number in range(1 if friction < 0.0 else 2):
        # What is left before the limit, and what must be positive there.
        spare = press
        beside = 1.0, 0.0, 0.0, 0.0, 0.0
        if friction >= 0.0:
            beside = scaled(1.0 if number == 0 else -1.0, drag)
            spare = combined(scaled(friction, press), -1.0, beside)
        if flight.form == TURNING_LINE:
            _set_on_line(spare, beside, flight, courses[count])
            count += 1
        else:
            count = _add_on_arc(spare, beside, ways, flight, duration, courses, count)
    return count


@kernel
def _set_on_line(spare: Harmonics, beside: Harmonics, flight: Flight, course: Course) -> None:
    """Set when a linear function of the way (m) falls through zero, where another is positive."""
    force, growth, _, _, _ = spare
    at, slope, _, _, _ = beside
    course.period = NEVER
    course.after = NEVER
    if growth != 0.0 and at - slope * (force / growth) > 0.0:
        course.after = fall_through_zero(flight, force, growth)


@kernel
def _add_on_arc(
    spare: Harmonics,
    beside: Harmonics,
    ways: tuple[float, float],
    flight: Flight,
    duration: float,
    courses: Sequence[Course],
    count: int,
) -> int:
    """Set when a function of the angle falls through zero, where another one is positive."""
    left, right = ways
    slope = harmonic_slope(spare)
    angle = 2.0 * left - MARGIN
    for _ in range(MOST_ZEROS):
        angle = next_zero(spare, angle, 2.0 * right + MARGIN)
        if angle == math.inf:
            return count
        sine, cosine = sine_cosine(angle)
        falls = -harmonic_value(slope, sine, cosine)
        if harmonic_value(beside, sine, cosine) <= 0.0:
            continue
        sine, cosine = sine_cosine(0.5 * angle)
        square = squared_rate(flight, sine, cosine)
        p = math.copysign(math.sqrt(max(square, 0.0)), falls)
        if square > 0.0 and (flight.turns_over == 0 or p * flight.flow_p > 0.0):
            _set_place(courses[count], flight, sine, cosine, p, duration)
            count += 1
    return count
