"""The certified search for the first contact of two neighbours, on a line and on two pieces.

Each step is one that provably ends before the first contact, from bounds on the derivatives of the
gap over both flights; when a simple root ahead is certified to be the first one, it is refined on
the flows themselves. Nothing is sampled and no contact is passed over.

Two bodies that part from contact have a gap of zero there, up to the rounding of their places. Its
later value as a difference of two places is rounded as the places are, which late in an
accumulation is more than the gap itself; as a difference of two displacements from there it is
rounded as these are. What thousands of bounces would add up in the places is taken back: of two
free bodies in their places, where it changes no time, of others in the time of the next contact.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.contact.contact_kinematics import (
    centre_position,
    centre_tangent,
    distance_gap,
    half_gap_sine,
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

# Below every time, as that of a root before now may be.
NONE_BEFORE_LIMIT = -NEVER
UNFINISHED = -3.0 * NEVER  # beside it: the search goes on when it is called again
# So many steps of a search are made at once: another pair may meet before it is done.
STEPS_AT_ONCE = 100
# A correction below this size, relative to the time scales, is the last one.
FINAL_CORRECTION = 1.0e-5
# ... and below this one where the iteration is of third order, not of fourth.
FINAL_CORRECTION_BY_DISTANCE = 1.0e-6
# Share of the size of the places by which a gap cannot be told from contact.
UNRESOLVED = 4.0 * EPSILON
# Shares of the time in which a body at rest falls no farther than rounding: instants within the
# first are tried as one, and a contact that is over by less than the second is one of now.
ONE_INSTANT = 0.1
OF_NOW = 1.0e-5
# Times that, bodies are in one another by more than rounding and must not go further.
DEEP = 4.0


@kernel
def keep_states(pair: PairData, states: States) -> None:
    """Keep states of both bodies as those of contact."""
    pair.a_s, pair.a_c, pair.a_p, pair.b_s, pair.b_c, pair.b_p = states


@kernel
def keep_flows(world: World, j: int, age_a: float, age_b: float) -> None:
    """Keep the states of a pair's flights at their ages (s) as those of contact."""
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    keep_states(pair, flow_of_two(a, b, age_a, age_b))


@kernel
def keep_after_small_step(world: World, j: int, ages: Ages, change: float, states: States) -> None:
    """Keep as those of contact states at the ages (s) of both flights, a small change (s) on."""
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
    """First contact of two bodies on one line, where the gap is a parabola in time.

    The line may be several pieces in a row, whose left ends are ``between`` (m) apart.
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
        # They go apart, whatever the rounding of their speeds says.
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
    """Pieces and paths of a pair, and the distance (m) along them at which they touch.

    On one line the bodies are searched along it: centres on one path have no speed across their
    distance, as those of unequal bodies have, and come together as their speeds along it say.
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
    """States of a pair at ages (s) of its flights; its gap there and two derivatives of that."""
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
    """First contact of two bodies by the distance of centres, from ``d'' >= -(|A_a| + |A_b|)``.

    ``straight`` if both are on one line. Other parameters and the result as for
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
                    # In contact already, by rounding: now, in the states of now.
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
    """Time (s) for which two bodies are at least in contact, or apart by less than rounding.

    None if they are in one another by more than that, as deep (m) as they are.
    """
    piece_a, track_a, piece_b, track_b, reach = paths_of(world, j, straight)
    size = _size(piece_a, track_a) + _size(piece_b, track_b) + reach
    # Bodies in contact get into one another where a closed trace misses its start.
    unresolved = max(UNRESOLVED * size, world.settings[0].closing_error)
    return unresolved_step(second, bound_3, unresolved) if depth <= DEEP * unresolved else 0.0


@kernel
def _derivative_bounds(world: World, j: int, straight: bool, ages: Ages) -> tuple[float, float]:
    """Bounds on ``-d''`` (m/s^2) and ``|d'''|`` (m/s^3) of the distance d of two bodies.

    They hold while these are apart: ``d''' = n J + 3 (V_t A)/d - 3 d' V_t^2/d^2`` with the relative
    velocity V, its part V_t across the line of centres, acceleration A and jerk J; ``|d'| V_t^2 <=
    0.385 |V|^3``. On one line nothing is across.
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
    """Bounds on the speed (m/s) and the jerk (m/s^3) of a body's centre on its flight."""
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
    """Bound on the speed (m/s) of a body's centre up to an age (s) of a flight; of no segment."""
    if flight.form == LINE:
        return abs(flight.flow_p) + abs(flight.line_acceleration) * until
    return 2.0 * flight.frequency * track.path_radius * math.sqrt(flight.parameter)


@kernel
def pace(flight: Flight) -> float:
    """Return the rate (1/s) at which a flight's derivatives grow from one to the next."""
    return max(flight.frequency, flight.line_growth)


@kernel
def _size(piece: PieceData, track: TrackData) -> float:
    """Size (m) of a body's places on a piece, for their rounding."""
    return abs(piece.x) + abs(piece.y) + piece.length + track.path_radius


@kernel
def _refine_by_distance(
    world: World, j: int, straight: bool, ages: Ages, guess: float, safe: float, bound: float
) -> float:
    """Halley's iteration on the distance, accepted only if the root is certified to be the first.

    A guess that is negative, or beyond what the derivatives tell of, leads nowhere.

    Before a root with slope ``d' < 0`` the gap is positive for ``2 |d'|/B``; if that reaches back
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


# A flight whose relative rate times its length is more than this (rad, or a share of the bodies'
# places) is timed well enough by places.
FAR = 0.2
# Times the frequency; displacements of longer flights are no smaller than places.
LONG = 1.0
# Times the greater frequency; a bounce that ends sooner is a short one, whose end as displacements
# tell it may come before that which places tell, and before another contact.
SHORT = 0.001
# Corrections of an instant below this share of it are its rounding.
SETTLED = 1.0e-11
MOST_STEPS = 6
# Gaps at the start of a bounce below this share of the places are their rounding.
PLACES_ROUNDING = 4.0 * EPSILON
# Bodies whose path is more nearly across their line of centres are not moved along it by gaps.
LEAST_NORMAL = 0.1
# Near the top of a bounce a step of Newton's leads anywhere; one longer than this share is not his.
LONG_STEP = 0.5


@kernel
def displacement(flight: Flight, t: float) -> tuple[float, float]:
    """Sine and cosine of half the angle through which a body has gone since its flight began.

    ``S C0 - C S0`` and ``C C0 + S S0`` with the state of :func:`flow` put in and ``1 - cn`` as
    ``sn^2/(1 + cn)``: no difference of places is left. On a line the way (m) and 1.
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
    """State where a flight starts; a group's flow is that of its pendulum."""
    if flight.grouped == 1:
        return flight.s, flight.c, flight.p
    return flight.flow_s, flight.flow_c, flight.flow_p


@kernel
def short_bounce(a: Flight, b: Flight) -> float:
    """Return how long (s) a bounce of two bodies may last and be a short one."""
    fastest = max(pace(a), pace(b))
    return SHORT / fastest if fastest > 0.0 else 0.0


@kernel
def _is_long(flight: Flight, t: float) -> bool:
    """Tell whether displacements of a flight over a time t (s) are not better than its places."""
    if flight.form == POLYNOMIAL or flight.form == HYPERBOLIC_TINY:
        return True
    return flight.frequency * t > LONG


@kernel
def _step(gap: float, rate: float, first_rate: float, t: float) -> float:
    """Step from t towards the end of a bounce that began at 0 with ``first_rate``.

    Newton's, or where that is long the one that holds for a rate that falls evenly.
    """
    if rate < 0.0 and gap >= LONG_STEP * t * rate and gap <= -LONG_STEP * t * rate:
        return -gap / rate
    return t * (first_rate + rate) / (first_rate - rate)


@kernel
def _left_over(gap: float, rounding: float, first_rate: float, t: float) -> float:
    """What of a gap at the start of a bounce is more than rounding, and is to be taken back.

    Bodies in one another come apart by at most half the height of the bounce.
    """
    if gap >= -rounding:
        return max(gap - rounding, 0.0)
    return max(gap + rounding, -0.125 * first_rate * t)


@kernel
def _ends_in_places(a: Flight, b: Flight, t: float) -> bool:
    """Tell whether the places of two bodies take back rounding, not the time t (s) of their bounce.

    Late in an accumulation rounding is not small against bounces. Bodies that are held to others,
    or rest at a wall, stay where they are.
    """
    free = a.grouped + b.grouped == 0 and a.wall_side == 0 and b.wall_side == 0
    return free and t <= short_bounce(a, b)


@kernel
def close_gap(world: World, j: int) -> None:
    """Put two free bodies at the end of a bounce back into contact if rounding has parted them.

    Each goes half of the way along its path. The pair has parted from contact; states and normals
    of its contact now must be set.
    """
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    lasted = time_between(pair.contact_t, pair.contact_t_low, pair.begin_t, pair.begin_t_low)
    if not _ends_in_places(a, b, lasted):
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
    """Move a body along its path by a way (m) that is as short as rounding."""
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
    """Time of a contact on one arc (s), t nearly, that ends a flight from contact.

    The states of contact, left in the pair, are sharpened too; a flight that is not a short one is
    left as it is.
    """
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    if _is_long(a, t) or _is_long(b, t):
        return t
    a_s, a_c, a_p = _start(a)
    b_s, b_c, b_p = _start(b)
    first_rate = 2.0 * (b.own_frequency * b_p - a.own_frequency * a_p)
    if first_rate <= 0.0:
        return t  # up to rounding it does not part: there is no bounce
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
    """As :func:`polish_root_on_arc`, for two pieces, by ``d^2 - (r_a + r_b)^2``."""
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    if _is_long(a, t) or _is_long(b, t):
        return t
    piece_a, track_a, piece_b, track_b, reach = paths_of(world, j, straight)
    # The line of centres where the flights begin, drawn to the length it has in contact.
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
    """Rate (m^2/s) of the square of the distance of two bodies that is (x, y) in their states."""
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
    """How far a body's centre has gone since its flight began (m)."""
    sine, cosine = displacement(flight, t)
    if piece.sign == 0.0:
        return piece.tangent_x * sine, piece.tangent_y * sine
    # Along the tangent half-way.
    s, c, _ = _start(flight)
    tx, ty = centre_tangent(piece, s, c)
    chord = 2.0 * track.path_radius * sine
    sign = piece.sign
    return chord * (tx * cosine - sign * ty * sine), chord * (ty * cosine + sign * tx * sine)
