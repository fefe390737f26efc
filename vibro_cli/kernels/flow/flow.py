"""The flow of one body on one piece in closed form, and its inverse, the time of flight.

On an arc the half-angle variables obey Euler's top ``S' = wPC, C' = -wPS, P' = -wSC``; the state at
``t`` follows from the state at 0 by the addition theorems. On a line the motion is a parabola.
Equations of motion: A (1), B (30)-(33); model of the half-angle form: DLMF 22.8. Flights come
from the event loop, or from their rows in the log (:func:`replay_flight`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from vibro_cli.compile.kernel import SERIES_LENGTH, kernel, struct
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.numerics.elliptic import (
    HYPERBOLIC_TINY,
    ROOT_COMPLEMENT_TINY,
    TRIGONOMETRIC,
    angle_difference,
    angle_sum,
    carlson_rf,
    quarter_period,
    rf_near_logarithm,
    set_theta_constants,
    sine_cosine,
    theta_functions,
    trigonometric_form,
)
from vibro_cli.kernels.world import Flight, FlightRow, States, TrackData, World, track_on

LINE = 3  # form of a flight on a line, in addition to those of kernels.numerics.elliptic
POLYNOMIAL = 4  # ... and on a segment of a motion in contact across pieces


@kernel
def librates(flight: Flight) -> bool:
    """Return whether a flight is that of a free pendulum: on an arc, moving and in no group."""
    return flight.form <= HYPERBOLIC_TINY and flight.grouped == 0 and flight.at_rest == 0


@kernel
def flow(flight: Flight, t: float) -> tuple[float, float, float]:
    """Return ``(S, C, P)`` of the body a time ``t`` (s) after the start of a flight."""
    c0 = flight.flow_c
    p0 = flight.flow_p
    if flight.at_rest == 1:
        return flight.s, flight.c, flight.p
    if t == 0.0 and flight.grouped == 0:
        return flight.flow_s, c0, p0
    if flight.form == LINE:
        a = flight.line_acceleration
        return flight.flow_s + t * (p0 + 0.5 * a * t), c0, p0 + a * t
    if flight.form == POLYNOMIAL:
        return polynomial_flow(flight, t)
    s, c, d, common = theta_functions(flight, flight.frequency * t)
    if flight.form == HYPERBOLIC_TINY:
        # Homogeneous of degree 0 in (c, d, C, P): scaled against underflow at a crest.
        scale = 1.0 / (abs(c) + abs(s * c0))
        c *= scale
        d *= scale
        c0 *= scale
        p0 *= scale
    s, c, p = by_addition(flight.flow_s, c0, p0, s, c, d, common)
    if flight.grouped == 1:
        return body_of_group(flight, s, c, p)
    return s, c, p


@kernel
def flow_of_two(a: Flight, b: Flight, age_a: float, age_b: float) -> States:
    """Return ``(S, C, P)`` of two bodies, each a time (s) after the start of its flight.

    The operations are those of :func:`flow`. For two librations they alternate, so that the
    processor can overlap them.
    """
    both = a.form == TRIGONOMETRIC and b.form == TRIGONOMETRIC and librates(a) and librates(b)
    if not both or age_a == 0.0 or age_b == 0.0:
        a_s, a_c, a_p = flow(a, age_a)
        b_s, b_c, b_p = flow(b, age_b)
        return a_s, a_c, a_p, b_s, b_c, b_p
    a_s, a_c = sine_cosine(a.frequency * age_a * a.argument_scale)
    b_s, b_c = sine_cosine(b.frequency * age_b * b.argument_scale)
    a_s, a_c, a_d, a_common = trigonometric_form(a, a_s, a_c)
    b_s, b_c, b_d, b_common = trigonometric_form(b, b_s, b_c)
    a_s, a_c, a_p = by_addition(a.flow_s, a.flow_c, a.flow_p, a_s, a_c, a_d, a_common)
    b_s, b_c, b_p = by_addition(b.flow_s, b.flow_c, b.flow_p, b_s, b_c, b_d, b_common)
    return a_s, a_c, a_p, b_s, b_c, b_p


@kernel
def by_addition(
    s0: float, c0: float, p0: float, s: float, c: float, d: float, common: float
) -> tuple[float, float, float]:
    """Return the state from that at the start, by the addition theorems."""
    sc0 = s * c0
    inverse = 1.0 / (c * c + sc0 * sc0)
    return (
        (s0 * (c * d) + p0 * c0 * (s * common)) * inverse,
        (c0 * (d * common) - s0 * p0 * (s * c)) * inverse,
        (p0 * (c * common) - s0 * c0 * (s * d)) * inverse,
    )


@kernel
def path_on_segment(flight: Flight, t: float) -> tuple[float, float]:
    """Return the distance moved (m) and the speed (m/s) a time ``t`` (s) into a segment."""
    x = t / flight.segment
    speed = 0.0
    way = 0.0
    for k in range(SERIES_LENGTH - 1, -1, -1):
        term = flight.series[k] / (k + 1.0)
        speed = speed * x + term
        way = way * x + term / (k + 2.0)
    start = flight.flow_p
    return t * (start + t * way), start + t * speed


@kernel
def polynomial_flow(flight: Flight, t: float) -> tuple[float, float, float]:
    """Return ``(S, C, P)`` on a segment of a motion in lasting contact across pieces."""
    way, speed = path_on_segment(flight, t)
    p = speed * flight.rate_ratio
    if flight.half_curvature == 0.0:
        return flight.flow_s + way, flight.flow_c, p
    s, c = sine_cosine(way * flight.half_curvature)
    s, c = place_from_start(flight, s, c)
    return s, c, p


@kernel
def body_of_group(flight: Flight, s: float, c: float, p: float) -> tuple[float, float, float]:
    """Return a body's state from that of its group's pendulum, which it leads by a fixed angle."""
    s, c = angle_sum(s, c, flight.shift_s, flight.shift_c)
    return s, c, p * flight.rate_ratio


@kernel
def group_of_body(flight: Flight, s: float, c: float) -> tuple[float, float]:
    """Return ``(S, C)`` of a group's pendulum from that of one of its bodies."""
    return angle_difference(s, c, flight.shift_s, flight.shift_c)


@kernel
def place_from_start(flight: Flight, sine: float, cosine: float) -> tuple[float, float]:
    """Return ``(S, C)`` at a half-angle from the start of a flow, given by sine and cosine."""
    return angle_sum(flight.flow_s, flight.flow_c, sine, cosine)


@kernel
def angle_from_start(flight: Flight, s: float, c: float) -> tuple[float, float]:
    """Return the sine and cosine of the half-angle from the start of a flow to a position."""
    return angle_difference(s, c, flight.flow_s, flight.flow_c)


@kernel
def angular_acceleration(flight: Flight, s: float, c: float) -> float:
    """Return the second derivative (rad/s^2) of the angle of a body on an arc, ``-w^2 sin f``.

    Returns 0 on a segment across pieces, where only its bound is used.
    """
    if flight.form == POLYNOMIAL or flight.at_rest == 1:
        return 0.0
    if flight.grouped == 1:
        s, c = group_of_body(flight, s, c)
    return pendulum_acceleration(flight.frequency, s, c)


@kernel
def pendulum_acceleration(w: float, s: float, c: float) -> float:
    """Return ``-w^2 sin f`` (rad/s^2)."""
    return -2.0 * (w * w * s * c)


@kernel
def angular_jerk(flight: Flight, s: float, c: float, p: float) -> float:
    """Return the third derivative (rad/s^3) of the angle on an arc, ``-w^2 cos f f'``."""
    if flight.form == POLYNOMIAL:
        return 0.0
    rate = 2.0 * flight.own_frequency * p
    if flight.grouped == 1:
        s, c = group_of_body(flight, s, c)
    return pendulum_jerk(flight.frequency, s, c, rate)


@kernel
def angular_jerk_at(flight: Flight, age: float, s: float, c: float, p: float) -> float:
    """Return :func:`angular_jerk` at an ``age`` (s), also on a segment across pieces."""
    if flight.form != POLYNOMIAL or flight.at_rest == 1:
        return angular_jerk(flight, s, c, p)
    x = age / flight.segment
    jerk = 0.0
    for k in range(SERIES_LENGTH - 1, 0, -1):
        jerk = jerk * x + k * flight.series[k]
    return 2.0 * flight.half_curvature * (jerk / flight.segment)


@kernel
def pendulum_jerk(w: float, s: float, c: float, rate: float) -> float:
    """Return ``-w^2 cos f f'`` (rad/s^3)."""
    return -(w * w) * ((c - s) * (c + s)) * rate


@kernel
def acceleration_slopes(flight: Flight, s: float, c: float) -> tuple[float, float]:
    """Return the first two derivatives (1/s^2) of ``f''`` with respect to f, of a body alone."""
    w = flight.frequency
    return pendulum_jerk(w, s, c, 1.0), -pendulum_acceleration(w, s, c)


@kernel
def tangential_acceleration(flight: Flight, path_radius: float, s: float, c: float) -> float:
    """Return the acceleration (m/s^2) of a body's centre along its path."""
    if flight.form == LINE:
        return flight.line_acceleration if flight.at_rest == 0 else 0.0
    return path_radius * angular_acceleration(flight, s, c)


@kernel
def acceleration_at(flight: Flight, path_radius: float, age: float, s: float, c: float) -> float:
    """Return :func:`tangential_acceleration` at an ``age`` (s), also on a segment across pieces."""
    if flight.form != POLYNOMIAL or flight.at_rest == 1:
        return tangential_acceleration(flight, path_radius, s, c)
    x = age / flight.segment
    acceleration = 0.0
    for k in range(SERIES_LENGTH - 1, -1, -1):
        acceleration = acceleration * x + flight.series[k]
    return acceleration


@kernel
def angular_acceleration_at(flight: Flight, age: float, s: float, c: float) -> float:
    """Return :func:`angular_acceleration` at an ``age`` (s), also on a segment across pieces."""
    if flight.form != POLYNOMIAL or flight.at_rest == 1:
        return angular_acceleration(flight, s, c)
    return 2.0 * flight.half_curvature * acceleration_at(flight, 0.0, age, s, c)


@kernel
def small_step(
    flight: Flight, age: float, dt: float, s: float, c: float, p: float
) -> tuple[float, float, float]:
    """Advance the state at ``age`` (s) by a last small step ``dt`` (s)."""
    if flight.grouped == 1 or flight.at_rest == 1:
        return flow(flight, age + dt)
    if flight.form == LINE:
        a = flight.line_acceleration
        return s + dt * (p + 0.5 * a * dt), c, p + a * dt
    return advance_slightly(flight.frequency, dt, s, c, p)


@kernel
def advance_slightly(
    frequency: float, dt: float, s: float, c: float, p: float
) -> tuple[float, float, float]:
    """Advance a state by one third-order step, for ``w dt`` and ``w P dt`` below 1e-4."""
    a = frequency * dt
    s2 = s * s
    c2 = c * c
    p2 = p * p
    half = 0.5 * a
    third = a * a * (1.0 / 6.0)
    return (
        s + a * (p * c * (1.0 + third * (4.0 * s2 - p2 - c2)) - half * s * (p2 + c2)),
        c - a * (p * s * (1.0 - third * (4.0 * c2 + p2 - s2)) + half * c * (p2 - s2)),
        p - a * (s * c * (1.0 - third * (4.0 * p2 + c2 - s2)) + half * p * (c2 - s2)),
    )


# Up to this P a small last step of the pendulum is also a small step of the body.
SWIFT = 4.0


@kernel
def quickness(frequency: float, p: float) -> float:
    """Return the rate (1/s) at which a state on an arc changes, which limits the last step.

    A body that is fast for its weight turns much faster than the pendulum oscillates.
    """
    return frequency * max(1.0, abs(p) * (1.0 / SWIFT))


# Products of two numbers this small would underflow.
TINY_PRODUCT = 1.0e-200
# Above this parameter a path through the bottom is timed in two parts, from the bottom.
SPLIT_PARAMETER = 0.9
# A path ahead takes less than this share of the period of S and C: at most one half.
LONGEST_AHEAD = 0.75


@kernel
def time_of_flight(flight: Flight, s1: float, c1: float, p1: float) -> float:
    """Return the first time (s) at which a flight on an arc reaches the state ``(S1, C1, P1)``.

    The state is one of the flow's pendulum. It must lie on the flight's orbit, less than a period
    ahead. Relative error a few ulp.
    """
    m = flight.parameter
    if flight.complementary_modulus < 0.0:
        far = flight.flow_c * c1 + flight.flow_s * s1 < 0.0 or s1 * flight.flow_s <= 0.0
        u = _rotation_argument(flight, s1, c1) if far else _argument_by_addition(flight, s1, c1, p1)
    elif m > SPLIT_PARAMETER and not _stays_on_one_side(
        flight.flow_s * flight.flow_c, flight.flow_p, s1 * c1, p1
    ):
        u = _libration_argument(flight, s1, c1, p1)
    else:
        u = _argument_by_addition(flight, s1, c1, p1)
    return u / flight.frequency


@kernel
def time_ahead(flight: Flight, s1: float, c1: float, p1: float) -> float:
    """Return the time (s) to a state that lies ahead, without a turn on the way.

    The state is known up to rounding. If it is as close as that, it may lie behind the start, and
    :func:`time_of_flight` may return a whole period; this function then returns 0.
    """
    after = time_of_flight(flight, s1, c1, p1)
    if after * flight.frequency > LONGEST_AHEAD * _double_period(flight):
        return 0.0
    return after


@kernel
def _stays_on_one_side(sc0: float, p0: float, sc1: float, p1: float) -> bool:
    """Return whether a libration goes from one state to the next without passing S = 0.

    ``sc`` is S C, whose sign is that of sin f. In a libration C keeps its sign, and on a path to
    the same side without a turning point |P| falls outwards.
    """
    if sc0 * sc1 <= 0.0:
        return False
    if p0 * p1 > 0.0:
        return (abs(p1) - abs(p0)) * (sc0 * p0) < 0.0
    return sc0 * p0 >= 0.0


@kernel
def _libration_argument(flight: Flight, s1: float, c1: float, p1: float) -> float:
    """Return the argument between two states of a libration, both counted from the bottom."""
    m = flight.parameter
    quarter = quarter_period(m, flight.complementary_modulus)
    # Mirrored so that it starts to the right: mirror images take the same time.
    right = flight.flow_p > 0.0 or (flight.flow_p == 0.0 and flight.flow_s * flight.flow_c < 0.0)
    side = 1.0 if right else -1.0
    s0 = side * flight.flow_s
    first = _argument_along_libration(m, quarter, s0, flight.flow_c, side * flight.flow_p)
    second = _argument_along_libration(m, quarter, side * s1, c1, side * p1)
    if second < first:
        return second - first + 4.0 * quarter
    return second - first


@kernel
def _argument_along_libration(m: float, quarter: float, s: float, c: float, p: float) -> float:
    """Return the argument since the last passage of S = 0 with P > 0, in ``[-K, 3K)``."""
    outward = s if c > 0.0 else -s
    if p == 0.0:
        return quarter if outward > 0.0 else -quarter
    u = outward * carlson_rf(p * p, m * c * c, m)
    return u if p > 0.0 else 2.0 * quarter - u


@kernel
def _rotation_argument(flight: Flight, s1: float, c1: float) -> float:
    """Return the argument between two positions of a rotation, both counted from the bottom.

    ``(S, C)`` repeat after two turns, four times ``half_turn``. On an arc with the bottom inside it
    the second position may be one such period further on.
    """
    m = flight.parameter
    complement = flight.complementary_modulus * flight.complementary_modulus
    half_turn = quarter_period(m, flight.complementary_modulus)
    first = _argument_along_rotation(m, complement, half_turn, flight.flow_s, flight.flow_c)
    second = _argument_along_rotation(m, complement, half_turn, s1, c1)
    ahead = second - first if flight.flow_p > 0.0 else first - second
    return ahead if ahead >= 0.0 else ahead + 4.0 * half_turn


@kernel
def _argument_along_rotation(
    m: float, complement: float, half_turn: float, s: float, c: float
) -> float:
    """Return the signed argument from f = 0 to f in (-2 pi, 2 pi); ``half_turn`` is that to pi."""
    u = s * carlson_rf(complement + c * c, m * c * c, m)
    if c >= 0.0:
        return u
    if s >= 0.0:
        return 2.0 * half_turn - u
    return -2.0 * half_turn - u


@kernel
def _argument_by_addition(flight: Flight, s1: float, c1: float, p1: float) -> float:
    """Return ``u = 2 |s| R_F((c+d)(1+c), (c+d)(1+d), (1+c)(1+d))``.

    s, c and d are the elliptic functions of the difference of the arguments of both states.
    """
    m = flight.parameter
    s0 = flight.flow_s
    c0 = flight.flow_c
    p0 = flight.flow_p
    g = p0 * p0 + (s0 * c1) * (s0 * c1)
    if g < TINY_PRODUCT:
        scale = 1.0 / (abs(p0) + abs(s0 * c1))
        c0 *= scale
        p0 *= scale
        c1 *= scale
        p1 *= scale
        g = p0 * p0 + (s0 * c1) * (s0 * c1)
    inverse = 1.0 / g
    s = (s1 * p0 * c0 - s0 * p1 * c1) * inverse
    c = (p1 * p0 + s1 * c1 * s0 * c0) * inverse
    d = (m * c1 * c0 + s1 * p1 * s0 * p0) * inverse
    size = abs(s)
    if size == 0.0:
        # The same position: now, or after half a period with the opposite rate.
        return 0.0 if c > 0.0 else 0.5 * _double_period(flight)
    one_c = 1.0 + c if c > -0.5 else size * size / (1.0 - c)
    one_d = 1.0 + d if d > -0.5 else m * size * size / (1.0 - d)
    if c >= 0.0 and d >= 0.0:
        root = math.sqrt(c + d)
    else:
        # The root of c + d = (1 - m) s^2/(d - c), which itself may underflow.
        root = abs(flight.complementary_modulus) * size / math.sqrt(abs(d - c))
    if root < ROOT_COMPLEMENT_TINY:
        u = rf_near_logarithm(root * math.sqrt(one_c), root * math.sqrt(one_d), one_c * one_d)
    else:
        both = root * root
        u = carlson_rf(both * one_c, both * one_d, one_c * one_d)
    u *= 2.0 * size
    if s >= 0.0:
        return u
    return _double_period(flight) - u


@kernel
def _double_period(flight: Flight) -> float:
    """Return the argument after which s and c repeat (4 K for m < 1)."""
    if flight.form == TRIGONOMETRIC:
        return 2.0 * math.pi / flight.argument_scale
    return 2.0 * (flight.half_period + flight.half_period_low) / (1.0 + flight.argument_scale)


# Margin for rounding of a bound on a half-period, as a share.
CAUTION = 1.0e-9


@struct
class Sample:
    """One body at one time."""

    row: int  # of the log
    after: float  # from the start of that flight, s
    s: float
    c: float
    p: float
    energy: float  # J


@kernel
def replay_flight(world: World, row: FlightRow, number: int, flight: Flight) -> None:
    """Set up a flight from its row, the ``number``-th of the log, for evaluation of its flow."""
    track = track_on(world, row.body, row.piece)
    flight.piece = row.piece
    flight.s = row.s
    flight.c = row.c
    flight.p = row.p
    flight.at_rest = row.at_rest
    flight.grouped = row.grouped
    flight.form = 0
    flight.own_frequency = track.frequency
    flight.frequency = track.frequency
    flight.flow_s = row.s
    flight.flow_c = row.c
    flight.flow_p = row.p
    if row.grouped == 1:
        replay_group(world, row, number, flight)
        if flight.form == POLYNOMIAL:
            flight.half_curvature = 0.5 / track.path_radius if track.path_radius > 0.0 else 0.0
            return
    replay_flow(track, row, flight)


@kernel
def replay_flow(track: TrackData, row: FlightRow, flight: Flight) -> None:
    """Set the form and the constants of a flow in closed form."""
    if track.path_radius == 0.0:
        flight.form = LINE
        if row.grouped == 0:
            flight.line_acceleration = track.line_acceleration
        return
    set_theta_constants(flight, row.parameter, row.complementary_modulus)


@kernel
def replay_group(world: World, row: FlightRow, number: int, flight: Flight) -> None:
    """Set the fields that only a flight in lasting contact uses."""
    flight.flow_s = row.flow_s
    flight.flow_c = row.flow_c
    flight.flow_p = row.flow_p
    flight.shift_s = row.shift_s
    flight.shift_c = row.shift_c
    flight.rate_ratio = row.rate_ratio
    flight.frequency = row.frequency
    flight.line_acceleration = row.line_acceleration
    flight.segment = row.segment
    # Rows of segments are in the order of their flights; each flight has one or none.
    segments = world.clock[0].segment_rows
    low = max(segments - (world.clock[0].flight_rows - number), 0)
    high = min(number, segments)
    while low < high:
        middle = (low + high) // 2
        if world.segments[middle].flight < number:
            low = middle + 1
        else:
            high = middle
    if low < world.clock[0].segment_rows and world.segments[low].flight == number:
        # A row of infinite duration is no segment: it holds constants of a closed form.
        if flight.segment < NEVER:
            flight.form = POLYNOMIAL
        for k in range(SERIES_LENGTH):
            flight.series[k] = world.segments[low].series[k]


@kernel
def half_period(row: FlightRow, frequency: float, duration: float) -> float:
    """Return half the period (s) of a flight's full orbit, or a bound that serves as well.

    Callers compare the half-period and half of it with ``duration``. Where bounds decide both
    comparisons, one of them or NEVER is returned.
    """
    # K >= pi/2, and K/sqrt(m) for a rotation.
    argument = frequency * duration
    least = 0.5 * math.pi * (1.0 - CAUTION) / math.sqrt(max(row.parameter, 1.0))
    if argument < least:
        return NEVER
    if row.complementary_modulus > 0.0:
        # K = (pi/2)/AGM(1, k'), and the AGM lies between the arithmetic and the geometric mean,
        # here of (1 + k')/2 and sqrt k'.
        root = math.sqrt(row.complementary_modulus)
        least = (2.0 * math.pi) * (1.0 - CAUTION) / ((1.0 + root) * (1.0 + root))
        if argument < least:
            return NEVER
        if argument < 2.0 * least:
            mean = math.sqrt(2.0 * (1.0 + row.complementary_modulus) * root)
            if argument > math.pi * (1.0 + CAUTION) / mean:
                return 2.0 * least / frequency
    return 2.0 * quarter_period(row.parameter, row.complementary_modulus) / frequency


@kernel
def energy_of_row(world: World, row: FlightRow, s: float, c: float, p: float) -> float:
    """Return the energy (J) of a body: as carried on a free flight, from the state in contact."""
    body = world.bodies[row.body]
    if row.grouped == 0:
        return body.weight * row.specific_energy
    gravity = world.settings[0].gravity
    track = track_on(world, row.body, row.piece)
    speed = track.speed_factor * p
    kinetic = 0.5 * body.kappa * speed * speed / gravity
    return body.weight * (height_of(track, gravity, body.kappa, s, c) + kinetic)


@kernel
def height_of(track: TrackData, gravity: float, kappa: float, s: float, c: float) -> float:
    """Return the height (m) of a centre above its lowest position: potential energy over weight."""
    rise = track.line_rise * s if track.path_radius == 0.0 else 2.0 * track.path_radius * s * s
    return track.bottom + rise


@kernel
def sample_flights(
    world: World, samples: Sequence[Sample], count: int, scratch: Sequence[Flight]
) -> None:
    """Fill in states; this is fastest if the samples of a flight follow one another."""
    flight = scratch[0]
    row = -1
    for number in range(count):
        sample = samples[number]
        if sample.row != row:
            row = sample.row
            replay_flight(world, world.log[row], row, flight)
        sample.s, sample.c, sample.p = flow(flight, sample.after)
        sample.energy = energy_of_row(world, world.log[row], sample.s, sample.c, sample.p)
