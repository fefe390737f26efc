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

LINE = 3  # a flight's form on a line, beside those of kernels.numerics.elliptic
POLYNOMIAL = 4  # ... and on a segment of a motion in contact across pieces


@kernel
def librates(flight: Flight) -> bool:
    """Tell whether a flight is that of a free pendulum: on an arc, moving, by itself."""
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

    The same operations as of :func:`flow` for each; for two librations they take turns, so that
    the processor need not wait for one to end before it begins the other.
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
    """State from that at the start, by the addition theorems."""
    sc0 = s * c0
    inverse = 1.0 / (c * c + sc0 * sc0)
    return (
        (s0 * (c * d) + p0 * c0 * (s * common)) * inverse,
        (c0 * (d * common) - s0 * p0 * (s * c)) * inverse,
        (p0 * (c * common) - s0 * c0 * (s * d)) * inverse,
    )


@kernel
def path_on_segment(flight: Flight, t: float) -> tuple[float, float]:
    """Way along the path (m) and speed (m/s) a time ``t`` after the start of a segment."""
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
    """``(S, C, P)`` on a segment of a motion in lasting contact across pieces."""
    way, speed = path_on_segment(flight, t)
    p = speed * flight.rate_ratio
    if flight.half_curvature == 0.0:
        return flight.flow_s + way, flight.flow_c, p
    s, c = sine_cosine(way * flight.half_curvature)
    s, c = place_from_start(flight, s, c)
    return s, c, p


@kernel
def body_of_group(flight: Flight, s: float, c: float, p: float) -> tuple[float, float, float]:
    """State of a body from that of its group's pendulum, which it leads by a constant angle."""
    s, c = angle_sum(s, c, flight.shift_s, flight.shift_c)
    return s, c, p * flight.rate_ratio


@kernel
def group_of_body(flight: Flight, s: float, c: float) -> tuple[float, float]:
    """Half-angle of the group's pendulum from that of the body."""
    return angle_difference(s, c, flight.shift_s, flight.shift_c)


@kernel
def place_from_start(flight: Flight, sine: float, cosine: float) -> tuple[float, float]:
    """``(S, C)`` of the place whose half-angle from the start of a flow has sine and cosine."""
    return angle_sum(flight.flow_s, flight.flow_c, sine, cosine)


@kernel
def angle_from_start(flight: Flight, s: float, c: float) -> tuple[float, float]:
    """Sine and cosine of the half-angle from the start of a flow to a place."""
    return angle_difference(s, c, flight.flow_s, flight.flow_c)


@kernel
def angular_acceleration(flight: Flight, s: float, c: float) -> float:
    """Second derivative (rad/s^2) of the angle of a body on an arc, ``-w^2 sin f``.

    On a segment across pieces, 0 in place of it: there only its bound is used.
    """
    if flight.form == POLYNOMIAL or flight.at_rest == 1:
        return 0.0
    if flight.grouped == 1:
        s, c = group_of_body(flight, s, c)
    return pendulum_acceleration(flight.frequency, s, c)


@kernel
def pendulum_acceleration(w: float, s: float, c: float) -> float:
    """``-w^2 sin f`` (rad/s^2)."""
    return -2.0 * (w * w * s * c)


@kernel
def angular_jerk(flight: Flight, s: float, c: float, p: float) -> float:
    """Third derivative (rad/s^3) of the angle of a body on an arc, ``-w^2 cos f f'``."""
    if flight.form == POLYNOMIAL:
        return 0.0
    rate = 2.0 * flight.own_frequency * p
    if flight.grouped == 1:
        s, c = group_of_body(flight, s, c)
    return pendulum_jerk(flight.frequency, s, c, rate)


@kernel
def angular_jerk_at(flight: Flight, age: float, s: float, c: float, p: float) -> float:
    """As :func:`angular_jerk`, on a segment across pieces too (at its ``age``, s)."""
    if flight.form != POLYNOMIAL or flight.at_rest == 1:
        return angular_jerk(flight, s, c, p)
    x = age / flight.segment
    jerk = 0.0
    for k in range(SERIES_LENGTH - 1, 0, -1):
        jerk = jerk * x + k * flight.series[k]
    return 2.0 * flight.half_curvature * (jerk / flight.segment)


@kernel
def pendulum_jerk(w: float, s: float, c: float, rate: float) -> float:
    """``-w^2 cos f f'`` (rad/s^3)."""
    return -(w * w) * ((c - s) * (c + s)) * rate


@kernel
def acceleration_slopes(flight: Flight, s: float, c: float) -> tuple[float, float]:
    """Derivatives (1/s^2) with the angle of the acceleration of a body alone on an arc: two."""
    w = flight.frequency
    return pendulum_jerk(w, s, c, 1.0), -pendulum_acceleration(w, s, c)


@kernel
def tangential_acceleration(flight: Flight, path_radius: float, s: float, c: float) -> float:
    """Acceleration (m/s^2) of a body's centre along its path."""
    if flight.form == LINE:
        return flight.line_acceleration if flight.at_rest == 0 else 0.0
    return path_radius * angular_acceleration(flight, s, c)


@kernel
def acceleration_at(flight: Flight, path_radius: float, age: float, s: float, c: float) -> float:
    """As :func:`tangential_acceleration`, on a segment across pieces too (at its ``age``, s)."""
    if flight.form != POLYNOMIAL or flight.at_rest == 1:
        return tangential_acceleration(flight, path_radius, s, c)
    x = age / flight.segment
    acceleration = 0.0
    for k in range(SERIES_LENGTH - 1, -1, -1):
        acceleration = acceleration * x + flight.series[k]
    return acceleration


@kernel
def angular_acceleration_at(flight: Flight, age: float, s: float, c: float) -> float:
    """As :func:`angular_acceleration`, on a segment across pieces too (at its ``age``, s)."""
    if flight.form != POLYNOMIAL or flight.at_rest == 1:
        return angular_acceleration(flight, s, c)
    return 2.0 * flight.half_curvature * acceleration_at(flight, 0.0, age, s, c)


@kernel
def small_step(
    flight: Flight, age: float, dt: float, s: float, c: float, p: float
) -> tuple[float, float, float]:
    """Carry the state at ``age`` (s) over a last small step ``dt`` (s)."""
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
    """Third-order step of the half-angle variables, for ``w dt`` and ``w P dt`` below 1e-4."""
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


# Up to this P a last small step of a pendulum is a small one of a body too.
SWIFT = 4.0


@kernel
def quickness(frequency: float, p: float) -> float:
    """Rate (1/s) at which a state on an arc changes, against which a last step must be short.

    A body that is fast against its weight turns much faster than the pendulum swings.
    """
    return frequency * max(1.0, abs(p) * (1.0 / SWIFT))


# Products of two such numbers would underflow.
TINY_PRODUCT = 1.0e-200
# Above this parameter a path through the bottom is timed in two parts, from the bottom.
SPLIT_PARAMETER = 0.9
# No way ahead takes this share of the argument after which S and C return; most is one half.
LONGEST_AHEAD = 0.75


@kernel
def time_of_flight(flight: Flight, s1: float, c1: float, p1: float) -> float:
    """Return the first time (s) at which an arc's flight takes its start to ``(S1, C1, P1)``.

    The state is one of the flow's pendulum and must lie on the flight's orbit, less than a
    period ahead. Relative error a few ulp.
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

    The energy says where it is up to rounding: one that is reached within that is behind the start
    for :func:`time_of_flight`, a whole period away.
    """
    after = time_of_flight(flight, s1, c1, p1)
    if after * flight.frequency > LONGEST_AHEAD * _double_period(flight):
        return 0.0
    return after


@kernel
def _stays_on_one_side(sc0: float, p0: float, sc1: float, p1: float) -> bool:
    """Tell whether a libration goes from one state to the next one without passing S = 0.

    ``sc`` is S C, whose sign is that of sin f; in a libration C keeps its sign, and on a path to
    the same side without a turning point |P| falls outwards.
    """
    if sc0 * sc1 <= 0.0:
        return False
    if p0 * p1 > 0.0:
        return (abs(p1) - abs(p0)) * (sc0 * p0) < 0.0
    return sc0 * p0 >= 0.0


@kernel
def _libration_argument(flight: Flight, s1: float, c1: float, p1: float) -> float:
    """Argument between two states of a libration, each counted from a passage of the bottom."""
    m = flight.parameter
    quarter = quarter_period(m, flight.complementary_modulus)
    # Seen from the side on which it starts to the right: mirror images take the same time.
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
    """Argument since the last passage of S = 0 with P > 0, in ``[-K, 3K)``."""
    outward = s if c > 0.0 else -s
    if p == 0.0:
        return quarter if outward > 0.0 else -quarter
    u = outward * carlson_rf(p * p, m * c * c, m)
    return u if p > 0.0 else 2.0 * quarter - u


@kernel
def _rotation_argument(flight: Flight, s1: float, c1: float) -> float:
    """Argument between two places of a rotation, each counted from the bottom.

    ``(S, C)`` return after two turns, of four times ``half_turn``; an arc with the bottom inside it
    may have them beyond the range from which they are counted.
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
    """Signed argument from f = 0 to f in (-2 pi, 2 pi), ``half_turn`` being that of f = pi."""
    u = s * carlson_rf(complement + c * c, m * c * c, m)
    if c >= 0.0:
        return u
    if s >= 0.0:
        return 2.0 * half_turn - u
    return -2.0 * half_turn - u


@kernel
def _argument_by_addition(flight: Flight, s1: float, c1: float, p1: float) -> float:
    """``u = 2 |s| R_F((c+d)(1+c), (c+d)(1+d), (1+c)(1+d))`` with s, c, d of the difference."""
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
        # The same place: now, or after half a period with the opposite rate.
        return 0.0 if c > 0.0 else 0.5 * _double_period(flight)
    one_c = 1.0 + c if c > -0.5 else size * size / (1.0 - c)
    one_d = 1.0 + d if d > -0.5 else m * size * size / (1.0 - d)
    if c >= 0.0 and d >= 0.0:
        root = math.sqrt(c + d)
    else:
        # c + d = (1 - m) s^2/(d - c): its root, since it may underflow itself.
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
    """Argument after which s and c return (4 K for m < 1)."""
    if flight.form == TRIGONOMETRIC:
        return 2.0 * math.pi / flight.argument_scale
    return 2.0 * (flight.half_period + flight.half_period_low) / (1.0 + flight.argument_scale)


# Share by which a bound on a half period is lowered, so that rounding cannot make it pass over one.
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
    """Set up a flight from its row, the ``number``-th of the log, so that its flow can be asked."""
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
    """Fill in what a flight in lasting contact has beyond its own state."""
    flight.flow_s = row.flow_s
    flight.flow_c = row.flow_c
    flight.flow_p = row.flow_p
    flight.shift_s = row.shift_s
    flight.shift_c = row.shift_c
    flight.rate_ratio = row.rate_ratio
    flight.frequency = row.frequency
    flight.line_acceleration = row.line_acceleration
    flight.segment = row.segment
    # Rows of segments are in order of their flights, of which each has one or none.
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
        # Without an end in time it is no segment: what the row has is of a closed form.
        if flight.segment < NEVER:
            flight.form = POLYNOMIAL
        for k in range(SERIES_LENGTH):
            flight.series[k] = world.segments[low].series[k]


@kernel
def half_period(row: FlightRow, frequency: float, duration: float) -> float:
    """Half the period (s) of a flight's full orbit, or a time that stands for it.

    It is asked for to be compared, as a whole and by half, with the duration: where bounds decide
    that, one of them or infinity is returned.
    """
    # K >= pi/2, and K/sqrt(m) for a rotation.
    argument = frequency * duration
    least = 0.5 * math.pi * (1.0 - CAUTION) / math.sqrt(max(row.parameter, 1.0))
    if argument < least:
        return NEVER
    if row.complementary_modulus > 0.0:
        # K = pi/2 over the mean of 1 and k' that is between their arithmetic and geometric ones;
        # here those of (1 + k')/2 and sqrt k'.
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
    """Energy (J) of a body; carried on a free flight, from the state in lasting contact."""
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
    """Height (m) of a body's centre above its lowest place: potential energy over weight."""
    rise = track.line_rise * s if track.path_radius == 0.0 else 2.0 * track.path_radius * s * s
    return track.bottom + rise


@kernel
def sample_flights(
    world: World, samples: Sequence[Sample], count: int, scratch: Sequence[Flight]
) -> None:
    """Fill in states; it takes least time if those of a flight stand together."""
    flight = scratch[0]
    row = -1
    for number in range(count):
        sample = samples[number]
        if sample.row != row:
            row = sample.row
            replay_flight(world, world.log[row], row, flight)
        sample.s, sample.c, sample.p = flow(flight, sample.after)
        sample.energy = energy_of_row(world, world.log[row], sample.s, sample.c, sample.p)
