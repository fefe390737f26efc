"""The certified search for the first contact of two neighbours, on a line and on two pieces.

Bounds on the derivatives of the gap over both flights prove that each step ends before the first
contact. When a simple root ahead is certified to be the first one, it is refined on the flows
themselves. Nothing is sampled, and no contact is passed over.

Two bodies that separate from contact start with a gap of zero, up to the rounding of their
positions. Late in an accumulation this rounding exceeds the gap itself. The gap is therefore
computed as the difference of two displacements since then, which has only their rounding. The
rounding that thousands of bounces would accumulate in the positions is corrected: for two free
bodies in their positions, which changes no time, for others in the time of the next contact.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.contact.contact_kinematics import (
    centre_position,
    centre_tangent,
    distance_gap,
    half_gap_sine,
    is_bound,
    present_gap,
)
from vibro_cli.kernels.flow.flow import (
    LINE,
    POLYNOMIAL,
    acceleration_at,
    flow_of_two,
    quickness,
    small_step,
    tangential_acceleration,
)
from vibro_cli.kernels.numerics.conservative_advancement import (
    LEAST_BOUND,
    first_root_of_parabola,
    safe_step_third_order,
    unresolved_step,
)
from vibro_cli.kernels.numerics.constants import EPSILON, NEVER
from vibro_cli.kernels.numerics.double_double import time_between
from vibro_cli.kernels.numerics.elliptic import HYPERBOLIC_TINY, theta_functions
from vibro_cli.kernels.world import (
    PARTING,
    RELEASED,
    Flight,
    PairData,
    PieceData,
    State,
    States,
    TrackData,
    World,
    contact_of,
    flights_of,
    track_of,
    track_on,
    tracks_of,
)

Ages = tuple[float, float]  # times (s) since the flights of both bodies of a pair began

# Below every time, even that of a root before now.
NONE_BEFORE_LIMIT = -NEVER
UNFINISHED = -3.0 * NEVER  # in addition: the search continues at the next call
# Steps of a search made at once: another pair may meet before it is finished.
STEPS_AT_ONCE = 100
# A correction below this size, relative to the time scales, is the last one.
FINAL_CORRECTION = 1.0e-5
# ... and below this one where the iteration is of third order, not of fourth.
FINAL_CORRECTION_BY_DISTANCE = 1.0e-6
# A gap below this share of the scale of positions cannot be distinguished from contact.
UNRESOLVED = 4.0 * EPSILON
# Shares of the time in which a body falls from rest by no more than rounding: a refinement may move
# by the first, and a contact in the past by less than the second counts as now.
ONE_INSTANT = 0.1
OF_NOW = 1.0e-5
# Bodies that overlap by more than this many times that must not overlap any further.
DEEP = 4.0


@kernel
def keep_states(pair: PairData, states: States) -> None:
    """Keep the states of both bodies as those of contact."""
    pair.a_s, pair.a_c, pair.a_p, pair.b_s, pair.b_c, pair.b_p = states


@kernel
def keep_flows(world: World, j: int, age_a: float, age_b: float) -> None:
    """Keep the states of a pair's flights at their ages (s) as those of contact."""
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    keep_states(pair, flow_of_two(a, b, age_a, age_b))


@kernel
def keep_after_small_step(world: World, j: int, ages: Ages, change: float, states: States) -> None:
    """Advance states at the ages (s) by a small change (s) and keep them as those of contact."""
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    age_a, age_b = ages
    a_s, a_c, a_p, b_s, b_c, b_p = states
    pair.a_s, pair.a_c, pair.a_p = small_step(a, age_a, change, a_s, a_c, a_p)
    pair.b_s, pair.b_c, pair.b_p = small_step(b, age_b, change, b_s, b_c, b_p)


@kernel
def contact_on_line(
    world: World, j: int, ages: Ages, touching: int, limit: float, between: float
) -> float:
    """Return the first contact (s) of two bodies on one line, where the gap is a parabola in time.

    The line may consist of several pieces in a row; the left ends of the bodies' pieces are
    ``between`` (m) apart.
    """
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    age_a, age_b = ages
    a_s, a_c, a_p, b_s, b_c, b_p = flow_of_two(a, b, age_a, age_b)
    world.clock[0].evaluations += 1
    gap = max((b_s - a_s) + between - contact_of(world, j).sine, 0.0)
    rate = b_p - a_p
    second = tangential_acceleration(b, 0.0, b_s, b_c) - tangential_acceleration(a, 0.0, a_s, a_c)
    if touching != 0:
        # They separate, whatever the rounding of their speeds.
        gap = 0.0
        rate = max(rate, 0.0)
        if touching == RELEASED:
            second = max(second, 0.0)
    h = first_root_of_parabola(gap, rate, second)
    if h < 0.0 or h > limit:
        pair.searched = limit
        return NONE_BEFORE_LIMIT
    keep_flows(world, j, age_a + h, age_b + h)
    return h


@kernel
def paths_of(
    world: World, j: int, straight: bool
) -> tuple[PieceData, TrackData, PieceData, TrackData, float]:
    """Return the pieces and paths of a pair, and the distance (m) along them at which they touch.

    On one line (``straight``) both centres are put on the path of a, and the gap is that along the
    line. The line of centres of unequal bodies is inclined, which would add a transverse velocity.
    """
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    track_b = track_on(world, pair.a if straight else pair.b, b.piece)
    reach = contact_of(world, j).sine if straight else pair.distance
    return world.pieces[a.piece], track_of(world, pair.a), world.pieces[b.piece], track_b, reach


@kernel
def _gap_at(
    world: World, j: int, straight: bool, age_a: float, age_b: float
) -> tuple[States, float, float, float]:
    """Return the states of a pair at the ages (s) of its flights, its gap and two derivatives."""
    a, b = flights_of(world, world.pairs[j])
    piece_a, track_a, piece_b, track_b, reach = paths_of(world, j, straight)
    a_s, a_c, a_p, b_s, b_c, b_p = flow_of_two(a, b, age_a, age_b)
    world.clock[0].evaluations += 1
    along_a = acceleration_at(a, track_a.path_radius, age_a, a_s, a_c)
    along_b = acceleration_at(b, track_b.path_radius, age_b, b_s, b_c)
    states = a_s, a_c, a_p, b_s, b_c, b_p
    along = along_a, along_b
    gap, rate, second = distance_gap(piece_a, track_a, piece_b, track_b, states, along, reach)
    return states, gap, rate, second


@kernel
def contact_by_distance(
    world: World, j: int, straight: bool, touching: int, horizon: float, limit: float, ages: Ages
) -> float:
    """Return the first contact (s) by the distance of centres, from ``d'' >= -(|A_a| + |A_b|)``.

    ``straight`` if both bodies are on one line. Other parameters and the result as for
    :func:`kernels.contact.arc_contact.contact_on_arc`.
    """
    pair = world.pairs[j]
    age_a, age_b = ages
    bound, bound_3 = _derivative_bounds(world, j, straight, ages)
    t = pair.searched
    for _ in range(STEPS_AT_ONCE):
        states, gap, rate, second = _gap_at(world, j, straight, age_a + t, age_b + t)
        depth, gap = -gap, max(gap, 0.0)
        begins = touching if t == 0.0 else 0
        if begins != 0:
            gap = 0.0
            rate = max(rate, 0.0)
            if rate == 0.0 and second < 0.0 and begins == PARTING:
                keep_states(pair, states)
                return 0.0
            if begins == RELEASED:
                second = max(second, 0.0)
        step = safe_step_third_order(gap, rate, second, bound, bound_3)
        if gap == 0.0 and rate >= 0.0 and not (begins == PARTING and second < 0.0):
            step = max(step, _unresolved_step(world, j, straight, depth, second, bound_3))
        if rate < 0.0:
            guess = first_root_of_parabola(gap, rate, second)
            h = _refine_by_distance(world, j, straight, (age_a + t, age_b + t), guess, step, bound)
            if h > NONE_BEFORE_LIMIT:
                if t + h < 0.0:
                    # Already in contact, by rounding: now, in the present states.
                    keep_flows(world, j, age_a, age_b)
                    return 0.0
                pair.searched = limit
                return t + h if t + h <= limit else NONE_BEFORE_LIMIT
        if t + step == t:
            keep_states(pair, states)
            return t
        t += step
        if t > horizon:
            break
    pair.searched = t
    return NONE_BEFORE_LIMIT if t > horizon else UNFINISHED


@kernel
def _unresolved_step(
    world: World, j: int, straight: bool, depth: float, second: float, bound_3: float
) -> float:
    """Return a time (s) for which two bodies stay in contact or apart by less than rounding.

    Returns 0 if their overlap, ``depth`` (m), exceeds rounding.
    """
    piece_a, track_a, piece_b, track_b, reach = paths_of(world, j, straight)
    size = _size(piece_a, track_a) + _size(piece_b, track_b) + reach
    # Bodies in contact overlap where a closed trace misses its start.
    unresolved = max(UNRESOLVED * size, world.settings[0].closing_error)
    return unresolved_step(second, bound_3, unresolved) if depth <= DEEP * unresolved else 0.0


@kernel
def _derivative_bounds(world: World, j: int, straight: bool, ages: Ages) -> tuple[float, float]:
    """Return bounds on ``-d''`` (m/s^2) and ``|d'''|`` (m/s^3) of the distance d of two bodies.

    They hold while the bodies are apart: ``d''' = n J + 3 (V_t A)/d - 3 d' V_t^2/d^2`` with the
    relative velocity V, its component V_t across the line of centres, acceleration A and jerk J;
    ``|d'| V_t^2 <= 0.385 |V|^3``. On one line V_t is zero.
    """
    a, b = flights_of(world, world.pairs[j])
    age_a, age_b = ages
    _, track_a, _, track_b, distance = paths_of(world, j, straight)
    span = min(a.exit_after - age_a, b.exit_after - age_b)
    speed_a, jerk_a = speed_and_jerk(a, track_a, age_a + span)
    speed_b, jerk_b = speed_and_jerk(b, track_b, age_b + span)
    acceleration = a.acceleration_bound + b.acceleration_bound
    if straight:
        return acceleration, jerk_a + jerk_b
    speed = speed_a + speed_b
    turning = speed / distance
    across = turning * (3.0 * acceleration + 1.2 * turning * speed)
    return acceleration, jerk_a + jerk_b + across


@kernel
def speed_and_jerk(flight: Flight, track: TrackData, until: float) -> tuple[float, float]:
    """Return bounds on the speed (m/s) and the jerk (m/s^3) of a body's centre on its flight."""
    if flight.at_rest == 1:
        return 0.0, 0.0
    speed = most_speed(flight, track, until)
    if flight.form == POLYNOMIAL:
        speed = abs(flight.flow_p) + flight.acceleration_bound * flight.segment
    rho = track.path_radius
    if rho == 0.0:
        return speed, flight.jerk_bound
    bend = speed / rho
    return speed, rho * flight.jerk_bound + bend * (3.0 * flight.acceleration_bound + bend * speed)


@kernel
def most_speed(flight: Flight, track: TrackData, until: float) -> float:
    """Return a bound on the speed (m/s) of a body's centre up to an age (s) of its flight.

    The flight must not be a segment.
    """
    if flight.form == LINE:
        return abs(flight.flow_p) + abs(flight.line_acceleration) * until
    return 2.0 * flight.frequency * track.path_radius * math.sqrt(flight.parameter)


@kernel
def pace(flight: Flight) -> float:
    """Return the rate (1/s) by which a flight's derivatives grow from each order to the next."""
    return max(flight.frequency, flight.line_growth)


@kernel
def _size(piece: PieceData, track: TrackData) -> float:
    """Return the scale (m) of a body's positions on a piece, for their rounding."""
    return abs(piece.x) + abs(piece.y) + piece.length + track.path_radius


@kernel
def _refine_by_distance(
    world: World, j: int, straight: bool, ages: Ages, guess: float, safe: float, bound: float
) -> float:
    """Refine a contact by Halley's iteration on the distance; accept only a certified first root.

    A guess that is negative, or beyond the range in which the derivatives are valid, is rejected.

    Before a root with slope ``d' < 0`` the gap is positive for ``2 |d'|/B``. If that reaches back
    into the safe step from now, no earlier root exists.
    """
    a, b = flights_of(world, world.pairs[j])
    age_a, age_b = ages
    fastest = max(pace(a), pace(b))
    brief = min(a.brief, b.brief)
    if not (0.0 <= guess < 3.0 * safe + ONE_INSTANT * brief and guess * fastest < 1.0):
        return NONE_BEFORE_LIMIT
    h = guess
    for _ in range(12):
        states, gap, rate, second = _gap_at(world, j, straight, age_a + h, age_b + h)
        if rate >= 0.0:
            return NONE_BEFORE_LIMIT
        change = -gap * rate / (rate * rate - 0.5 * gap * second)
        h += change
        if abs(h - guess) > 0.5 * guess + ONE_INSTANT * brief:
            return NONE_BEFORE_LIMIT
        _, _, a_p, _, _, b_p = states
        quick = max(quickness(a.frequency, a_p), quickness(b.frequency, b_p))
        slope = max(fastest, quick) * rate
        if abs(change) * (abs(second) - slope) < -FINAL_CORRECTION_BY_DISTANCE * rate:
            if h < -OF_NOW * brief or h + 1.98 * rate / max(bound, LEAST_BOUND) >= safe:
                return NONE_BEFORE_LIMIT
            before = age_a + h - change, age_b + h - change
            keep_after_small_step(world, j, before, change, states)
            return h
    return NONE_BEFORE_LIMIT


# A flight whose relative rate times its duration exceeds this (rad, or a share of the bodies'
# positions) is timed accurately enough by positions.
FAR = 0.2
# Times the frequency; displacements over longer flights are no smaller than positions.
LONG = 1.0
# Times the greater frequency; a shorter bounce is a short one. Its end from displacements may come
# before that from positions, and before another contact.
SHORT = 0.001
# Corrections of a time below this share of it are its rounding.
SETTLED = 1.0e-11
MOST_STEPS = 6
# Gaps at the start of a bounce below this share of the positions are their rounding.
PLACES_ROUNDING = 4.0 * EPSILON
# Below this n t a path is nearly across the line of centres, and a gap does not move its body.
LEAST_NORMAL = 0.1
# Near the top of a bounce Newton's step is unreliable; above this share of t it is replaced.
LONG_STEP = 0.5


@kernel
def displacement(flight: Flight, t: float) -> tuple[float, float]:
    """Return sine and cosine of half the angle that a body has moved since its flight began.

    ``S C0 - C S0`` and ``C C0 + S S0`` with the state of :func:`flow` inserted and ``1 - cn``
    written as ``sn^2/(1 + cn)``: no difference of positions is left. On a line: the distance (m)
    and 1.
    """
    s0 = flight.flow_s
    c0 = flight.flow_c
    p0 = flight.flow_p
    if flight.at_rest == 1:
        return 0.0, 1.0
    if flight.form == LINE:
        return t * (p0 + 0.5 * flight.line_acceleration * t), 1.0
    s, c, d, common = theta_functions(flight, flight.frequency * t)
    sc0 = s * c0
    rest = s * s / (common + c)
    both = c0 * c0 * common + s0 * s0 * c
    inverse = 1.0 / (c * c + sc0 * sc0)
    sine = (p0 * s * both - s0 * c0 * d * rest) * inverse
    return sine, (d * both + s0 * p0 * c0 * (s * rest)) * inverse


@kernel
def _start(flight: Flight) -> State:
    """Return a body's state at the start of its flight; a group's flow is that of its pendulum."""
    if flight.grouped == 1:
        return flight.s, flight.c, flight.p
    return flight.flow_s, flight.flow_c, flight.flow_p


@kernel
def short_bounce(a: Flight, b: Flight) -> float:
    """Return the longest duration (s) of a short bounce of two bodies."""
    fastest = max(pace(a), pace(b))
    return SHORT / fastest if fastest > 0.0 else 0.0


@kernel
def _is_long(flight: Flight, t: float) -> bool:
    """Return whether displacements over a time t (s) are no more accurate than positions."""
    if flight.form == POLYNOMIAL or flight.form == HYPERBOLIC_TINY:
        return True
    return flight.frequency * t > LONG


@kernel
def _step(gap: float, rate: float, first_rate: float, t: float) -> float:
    """Return the step from t towards the end of a bounce that began at 0 with ``first_rate``.

    It is Newton's step, or where that is long, the step for a rate that falls linearly.
    """
    if rate < 0.0 and gap >= LONG_STEP * t * rate and gap <= -LONG_STEP * t * rate:
        return -gap / rate
    return t * (first_rate + rate) / (first_rate - rate)


@kernel
def _left_over(gap: float, rounding: float, first_rate: float, t: float) -> float:
    """Return the part of a gap at the start of a bounce that exceeds rounding, to be corrected.

    Overlapping bodies separate by at most half the height of the bounce.
    """
    if gap >= -rounding:
        return max(gap - rounding, 0.0)
    return max(gap + rounding, -0.125 * first_rate * t)


@kernel
def _ends_in_places(a: Flight, b: Flight, t: float) -> bool:
    """Return whether rounding is corrected in two bodies' positions, not in the bounce time t (s).

    Late in an accumulation rounding is not small compared with the bounces. Bodies that are held to
    others, or at rest at a wall, are not moved.
    """
    return not is_bound(a) and not is_bound(b) and t <= short_bounce(a, b)


@kernel
def close_gap(world: World, j: int) -> None:
    """Move two free bodies at the end of a bounce back into contact if rounding has parted them.

    Each moves half of the gap along its path. The pair must have separated from contact; states and
    normals of its present contact must be set. Rounding of many bounces that are timed by
    displacements would add up, and then count in the time of one.
    """
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    lasted = time_between(pair.contact_t, pair.contact_t_low, pair.begin_t, pair.begin_t_low)
    if is_bound(a) or is_bound(b) or _is_long(a, lasted) or _is_long(b, lasted):
        return
    if 2.0 * (b.own_frequency * b.p - a.own_frequency * a.p) * lasted < -FAR:
        return
    gap, size = present_gap(world, j)
    rounding = EPSILON * size
    if abs(gap) <= rounding or min(pair.normal_a, pair.normal_b) < LEAST_NORMAL:
        return
    half = 0.5 * min(max(gap, -DEEP * rounding), DEEP * rounding)
    track_a, track_b = tracks_of(world, pair)
    _move(a, track_a, half / pair.normal_a)
    _move(b, track_b, -half / pair.normal_b)


@kernel
def _move(flight: Flight, track: TrackData, way: float) -> None:
    """Move a body along its path by a distance ``way`` (m) as small as rounding."""
    if track.path_radius == 0.0:
        flight.s += way
    else:
        turn = 0.5 * way / track.path_radius
        s = flight.s
        flight.s = s + flight.c * turn
        flight.c -= s * turn
    flight.before_s = flight.s
    flight.before_c = flight.c


@kernel
def polish_root_on_arc(world: World, j: int, t: float, orientation: float) -> float:
    """Polish the approximate time t (s) of a contact on one arc that ends a flight from contact.

    The states of contact in the pair are polished too. A flight that is not a short one is left as
    it is.
    """
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    if _is_long(a, t) or _is_long(b, t):
        return t
    a_s, a_c, a_p = _start(a)
    b_s, b_c, b_p = _start(b)
    first_rate = 2.0 * (b.own_frequency * b_p - a.own_frequency * a_p)
    if first_rate <= 0.0:
        return t  # up to rounding it does not separate: there is no bounce
    launched, _ = half_gap_sine(contact_of(world, j), a_s, a_c, b_s, b_c, orientation)
    if _ends_in_places(a, b, t):
        launched = 0.0
    for _ in range(MOST_STEPS):
        rate = 2.0 * (b.own_frequency * pair.b_p - a.own_frequency * pair.a_p)
        if rate >= first_rate or rate * t < -FAR:
            break
        sine_a, cosine_a = displacement(a, t)
        sine_b, cosine_b = displacement(b, t)
        gap = 2.0 * (sine_b * cosine_a - cosine_b * sine_a)
        gap += _left_over(2.0 * launched, PLACES_ROUNDING, first_rate, t)
        change = _step(gap, rate, first_rate, t)
        t += change
        world.clock[0].evaluations += 1
        keep_flows(world, j, t, t)
        if abs(change) <= SETTLED * t:
            break
    return t


@kernel
def polish_root_by_distance(world: World, j: int, straight: bool, t: float) -> float:
    """Polish a contact as :func:`polish_root_on_arc`, on two pieces, by ``d^2 - (r_a + r_b)^2``."""
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    if _is_long(a, t) or _is_long(b, t):
        return t
    piece_a, track_a, piece_b, track_b, reach = paths_of(world, j, straight)
    # The line of centres at the start of the flights, scaled to its length in contact.
    a_s, a_c, a_p = _start(a)
    b_s, b_c, b_p = _start(b)
    ax, ay = centre_position(piece_a, track_a, a_s, a_c)
    bx, by = centre_position(piece_b, track_b, b_s, b_c)
    launched = math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
    scale = reach / launched
    launched = 0.0 if _ends_in_places(a, b, t) else (launched - reach) * (launched + reach)
    rounding = 2.0 * PLACES_ROUNDING * reach * (abs(bx) + abs(by) + reach)
    x = (bx - ax) * scale
    y = (by - ay) * scale
    size = reach + track_a.path_radius + track_b.path_radius
    first_rate = _rate_of_square(world, j, straight, x, y, (a_s, a_c, a_p, b_s, b_c, b_p))
    if first_rate <= 0.0:
        return t
    for _ in range(MOST_STEPS):
        mx, my = _centre_displacement(a, piece_a, track_a, t)
        nx, ny = _centre_displacement(b, piece_b, track_b, t)
        ux = nx - mx
        uy = ny - my
        states = pair.a_s, pair.a_c, pair.a_p, pair.b_s, pair.b_c, pair.b_p
        rate = _rate_of_square(world, j, straight, x + ux, y + uy, states)
        if rate >= first_rate or rate * t < -2.0 * FAR * reach * size:
            break
        gap = (2.0 * x + ux) * ux + (2.0 * y + uy) * uy
        gap += _left_over(launched, rounding, first_rate, t)
        change = _step(gap, rate, first_rate, t)
        t += change
        world.clock[0].evaluations += 1
        keep_flows(world, j, t, t)
        if abs(change) <= SETTLED * t:
            break
    return t


@kernel
def _rate_of_square(
    world: World, j: int, straight: bool, x: float, y: float, states: States
) -> float:
    """Return the rate (m^2/s) of the squared length of (x, y), the vector between two centres."""
    piece_a, track_a, piece_b, track_b, _ = paths_of(world, j, straight)
    a_s, a_c, a_p, b_s, b_c, b_p = states
    tax, tay = centre_tangent(piece_a, a_s, a_c)
    tbx, tby = centre_tangent(piece_b, b_s, b_c)
    va = track_a.speed_factor * a_p
    vb = track_b.speed_factor * b_p
    return 2.0 * (x * (vb * tbx - va * tax) + y * (vb * tby - va * tay))


@kernel
def _centre_displacement(
    flight: Flight, piece: PieceData, track: TrackData, t: float
) -> tuple[float, float]:
    """Return the displacement (m) of a body's centre since its flight began."""
    sine, cosine = displacement(flight, t)
    if piece.sign == 0.0:
        return piece.tangent_x * sine, piece.tangent_y * sine
    # The chord is parallel to the tangent halfway.
    s, c, _ = _start(flight)
    tx, ty = centre_tangent(piece, s, c)
    chord = 2.0 * track.path_radius * sine
    sign = piece.sign
    return chord * (tx * cosine - sign * ty * sine), chord * (ty * cosine + sign * tx * sine)
