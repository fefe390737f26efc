"""Forces of a rotating trace along the flights of a log: extremes, and passages of limits.

On an arc a force passes its limit at a zero of a trigonometric polynomial of degree 2 in the angle
from the start, on a line at a zero of a linear function of the distance. Each zero is passed once
in a period in the direction beyond the limit. Friction acts along the trace; the constraint that
holds a body in the trace's plane against the Coriolis force ``2 m Omega v cos(alpha)`` is taken to
be smooth. These kernels override those of ``kernels.events.liftoff_slip`` and
``kernels.statistics.run_statistics``.
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
from vibro_cli.kernels.flow.flow import flow, group_of_body, place_from_start, replay_flight
from vibro_cli.kernels.flow.rotating_flight import (
    next_zero_crossing_on_line,
    normal_harmonics_of_one,
    potential,
    torque_harmonics,
)
from vibro_cli.kernels.flow.rotating_flow import (
    TURNING_LINE,
    half_range,
    sides_turned,
    squared_rate_ahead,
    time_on_line,
    time_to_turn,
    turn_on_line,
)
from vibro_cli.kernels.numerics.conservative_advancement import (
    Harmonics,
    combined,
    greatest_quotient,
    harmonic_size,
    harmonic_slope,
    harmonic_value,
    least_value,
    next_zero,
    scaled,
    turned,
)
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.numerics.elliptic import (
    angle_difference,
    angle_sum,
    sine_cosine,
    twice_angle,
)
from vibro_cli.kernels.numerics.weierstrass_motion import period_of
from vibro_cli.kernels.statistics.run_statistics import Outcome, friction_demand
from vibro_cli.kernels.world import (
    BodyData,
    BodyForces,
    Flight,
    FlightRow,
    TrackData,
    World,
    track_on,
)

# Zeros are searched this far (rad) beyond the range of a flight; their times decide.
MARGIN = 1.0e-9
# A trigonometric polynomial of degree 2 has at most this many zeros in a turn.
MOST_ZEROS = 4


@kernel
def rotates(flight: Flight) -> bool:
    """Return whether the full orbit of a flight on an arc goes all the way round."""
    return flight.turns_over == 1


@kernel
def orbit_period(flight: Flight) -> float:
    """Return the period (s) of the full orbit of a flight on an arc that turns back."""
    return period_of(flight) / flight.frequency


@kernel
def _state_after(flight: Flight, duration: float) -> tuple[float, float, float]:
    """Return ``(S, C, P)`` of the motion on an arc a time (s) after its start."""
    s, c, p = flow(flight, duration)
    if flight.grouped == 0:
        return s, c, p
    s, c = group_of_body(flight, s, c)
    return s, c, p / flight.rate_ratio


@kernel
def turning_courses(flight: Flight, duration: float, courses: Sequence[Course]) -> int:
    """Set the courses of the turning points that a flight reaches; return their number."""
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
            courses[count].after = time_to_turn(flight, side)
            courses[count].period = orbit_period(flight)
            count += 1
    return count


@kernel
def _bounds_on_arc(world: World, row: FlightRow) -> tuple[float, float, float]:
    """Return bounds on a whole arc for a flight of a body alone, as shares of its weight.

    A lower bound of the normal force, an upper bound of the friction, and the rounding of the
    former.
    """
    sign = world.pieces[row.piece].sign
    track = track_on(world, row.body, row.piece)
    kappa = world.bodies[row.body].kappa
    energy = row.p * row.p + potential(track, row.s, row.c)
    least = track.least_normal + sign * (4.0 / kappa) * energy
    if sign > 0.0:
        least = max(least, track.least_still)
    most = track.most_angular / (track.frequency * track.frequency) * (1.0 - 1.0 / kappa)
    return least, most, CAUTION * (1.0 + abs(track.tilt) + track.spread + 4.0 * abs(energy))


@kernel
def look_at_one(world: World, span: Span, friction: float, flight: Flight) -> tuple[bool, bool]:
    """Set the forces on a body alone if it may lift off or slip; return whether it may, each."""
    row = world.log[span.row]
    lifts = True
    slips = friction >= 0.0
    if world.pieces[row.piece].sign != 0.0:
        least, most, caution = _bounds_on_arc(world, row)
        lifts = least <= caution
        slips = slips and most >= friction * least - caution
        if not lifts and not slips:
            return False, False
    replay_flight(world, row, span.row, flight)
    set_ends(world, span.row, span.duration, flight)
    fit_forces(world, span.row, flight)
    set_sides(world, span, world.forces[world.settings[0].bodies], friction)
    return lifts, slips


@kernel
def normal_of_one(world: World, number: int, found: Passage, flight: Flight) -> float:
    """Return the normal force (N) of a body alone at a passage."""
    set_forces(world, number, AT_TIME, found.after, flight)
    return world.forces[world.settings[0].bodies].normal


@kernel
def limit_courses(
    one: BodyForces, friction: float, flight: Flight, duration: float, courses: Sequence[Course]
) -> int:
    """Set the courses of passages of a limit: slip, or lift-off for a negative ``friction``.

    Return their number.
    """
    normal_terms = kept(one.normal_terms)
    friction_terms = kept(one.friction_terms)
    ways = 0.0, 0.0
    if flight.form != TURNING_LINE:
        ways = half_range(flight, _state_after(flight, duration), duration)
    count = 0
    for number in range(1 if friction < 0.0 else 2):
        # The margin before the limit, and a function that must be positive there.
        spare = normal_terms
        beside = 1.0, 0.0, 0.0, 0.0, 0.0
        if friction >= 0.0:
            beside = scaled(1.0 if number == 0 else -1.0, friction_terms)
            spare = combined(scaled(friction, normal_terms), -1.0, beside)
        if flight.form == TURNING_LINE:
            _set_on_line(spare, beside, flight, courses[count])
            count += 1
        else:
            count = _add_on_arc(spare, beside, ways, flight, duration, courses, count)
    return count


@kernel
def _set_on_line(spare: Harmonics, beside: Harmonics, flight: Flight, course: Course) -> None:
    """Set when a linear function of the distance (m) falls through zero, if another is positive."""
    force, growth, _, _, _ = spare
    at, slope, _, _, _ = beside
    course.period = NEVER
    course.after = NEVER
    if growth != 0.0 and at - slope * (force / growth) > 0.0:
        course.after = next_zero_crossing_on_line(flight, force, growth)


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
    """Set when a function of the angle falls through zero, if another is positive there.

    Return the new number of courses.
    """
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
        square = squared_rate_ahead(flight, sine, cosine)
        p = math.copysign(math.sqrt(max(square, 0.0)), falls)
        if square > 0.0 and (flight.turns_over == 0 or p * flight.flow_p > 0.0):
            s, c = place_from_start(flight, sine, cosine)
            set_course(courses[count], flight, s, c, p, duration)
            count += 1
    return count


@kernel
def arc_share(track: TrackData, kappa: float, s: float, c: float, squared: float) -> float:
    """Return ``N/(m g)``, up to the sign of the arc, at ``(S, C)`` with ``P^2 = squared``."""
    sine, cosine = twice_angle(s, c)
    return cosine + sine * (track.tilt + track.spread * sine) + 4.0 / kappa * squared


@kernel
def update_statistics_alone(
    world: World,
    number: int,
    duration: float,
    end: tuple[float, float, float],
    outcome: Outcome,
    scratch: Flight,
) -> None:
    """Tally the normal forces and the friction demand of a flight of a body alone."""
    row = world.log[number]
    body = world.bodies[row.body]
    track = track_on(world, row.body, row.piece)
    if world.pieces[row.piece].sign == 0.0:
        replay_flight(world, row, number, scratch)
        end_s, _, end_p = end
        _update_statistics_on_line(body, track, row.s, outcome)
        _update_statistics_on_line(body, track, end_s, outcome)
        if row.p * end_p < 0.0:
            _update_statistics_on_line(body, track, row.s + turn_on_line(scratch), outcome)
        return
    bound, most, caution = _bounds_on_arc(world, row)
    bound -= caution
    known = outcome.most_demand == math.inf or outcome.most_demand * bound >= most
    if body.weight * bound >= outcome.least_force and (most == 0.0 or known):
        return  # certainly neither less force nor more demand than known
    replay_flight(world, row, number, scratch)
    low, high = half_range(scratch, end, duration)
    least = _least_on_arc(world, row, scratch, low, high)
    outcome.least_force = min(outcome.least_force, body.weight * least)
    if most == 0.0 or outcome.most_demand * least >= most:
        # The known demand exceeds all that this flight can need.
        return
    if least <= 0.0:
        outcome.most_demand = math.inf
        return
    sign = world.pieces[row.piece].sign
    normal_terms = scaled(sign, normal_harmonics_of_one(scratch, track, body.kappa))
    pull = scaled(1.0 - 1.0 / body.kappa, torque_harmonics(scratch))
    outcome.most_demand = greatest_quotient(
        pull, normal_terms, 2.0 * low, 2.0 * high, outcome.most_demand
    )


@kernel
def _least_on_arc(world: World, row: FlightRow, flight: Flight, low: float, high: float) -> float:
    """Return the least normal force over the weight, between two half angles from the start."""
    track = track_on(world, row.body, row.piece)
    sign = world.pieces[row.piece].sign
    kappa = world.bodies[row.body].kappa
    least = math.inf
    for place in range(track.extreme_count + 2):
        half = low if place == 0 else high
        if place > 1:
            # A stationary point, which does not depend on the energy.
            s = track.extremes[2 * place - 4]
            c = track.extremes[2 * place - 3]
            sine, cosine = angle_difference(s, c, row.s, row.c)
            half = math.atan2(sine, cosine)
        if low <= half <= high:
            s, c = sine_cosine(half)
            rate = squared_rate_ahead(flight, s, c)
            s, c = angle_sum(row.s, row.c, s, c)
            least = min(least, sign * arc_share(track, kappa, s, c, rate))
    return least


@kernel
def _update_statistics_on_line(
    body: BodyData, track: TrackData, s: float, outcome: Outcome
) -> None:
    """Tally the forces at a position (m) on a line, along which both are linear."""
    normal = body.weight * (track.line_normal + track.line_normal_growth * s)
    pull = track.line_acceleration + track.line_growth * track.line_growth * s
    outcome.least_force = min(outcome.least_force, normal)
    if body.kappa > 1.0:
        demand = friction_demand((body.kappa - 1.0) * body.mass * abs(pull), normal)
        outcome.most_demand = max(outcome.most_demand, demand)


@kernel
def pendulum_range(
    world: World, number: int, duration: float, end: tuple[float, float, float], flight: Flight
) -> tuple[float, float]:
    """Return the least and greatest angle (rad) from the start of a group's motion."""
    end_s, end_c, end_p = end
    s, c = group_of_body(flight, end_s, end_c)
    low, high = half_range(flight, (s, c, end_p / flight.rate_ratio), duration)
    return 2.0 * low, 2.0 * high


@kernel
def extremes_on_arc(one: BodyForces, low: float, high: float) -> tuple[float, float]:
    """Return the least normal force (N) and greatest friction demand between two angles (rad)."""
    normal_terms = kept(one.normal_terms)
    friction_terms = kept(one.friction_terms)
    sine, cosine = sine_cosine(low)
    least = least_value(turned(normal_terms, sine, cosine), high - low)
    if harmonic_size(friction_terms) == 0.0:
        return least, 0.0
    if least <= 0.0:
        return least, math.inf
    return least, greatest_quotient(friction_terms, normal_terms, low, high, 0.0)
