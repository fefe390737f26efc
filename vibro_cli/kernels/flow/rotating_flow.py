"""The flow of one body on one piece of a rotating trace, and its times of passage and of turning.

``kappa v' = -g sin(alpha) + Omega^2 (x_C - x0) cos(alpha)``. On an arc, in the half-angle variables
of ``kernels.world``, ``S' = wPC, C' = -wPS`` and ``P^2 = m - V`` with the potential
``V = S^2 - tilt S C - spread S^2 C^2``, where ``tilt = sign Omega^2 (O_x - x0)/g`` and
``spread = Omega^2 rho/g``. With f measured from any position of the orbit, ``tan(f/2)`` moves under
a quartic (``kernels.numerics.weierstrass_motion``). On a line the acceleration is linear in
position, and the motion is a sum of cosh and sinh. The kernels override those of
``kernels.flow.flow``.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.flow.flow import (
    POLYNOMIAL,
    angle_from_start,
    body_of_group,
    group_of_body,
    place_from_start,
    polynomial_flow,
)
from vibro_cli.kernels.numerics.conservative_advancement import safe_step_second_order
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.numerics.elliptic import (
    angle_difference,
    angle_sum,
    sine_cosine,
    twice_angle,
)
from vibro_cli.kernels.numerics.weierstrass_motion import (
    period_of,
    place_beside_turn,
    quartic_motion,
    refer_to_saddle,
    set_quartic_constants,
    squared_rate,
    start_beside_saddle,
    time_to_place,
)
from vibro_cli.kernels.world import Flight, States

# Form of a flight on a line, in addition to those of kernels.flow.flow: gaps are not parabolas.
TURNING_LINE = 5


@kernel
def torque(tilt: float, spread: float, s: float, c: float) -> float:
    """Return ``f''/w^2`` of a body on an arc: ``-sin f + tilt cos f + spread sin f cos f``."""
    sine, cosine = twice_angle(s, c)
    return sine * (spread * cosine - 1.0) + tilt * cosine


@kernel
def torque_of(flight: Flight, s: float, c: float) -> float:
    """Return the :func:`torque` of a flight; a group adds ``twist cos 2f``."""
    sine, cosine = twice_angle(s, c)
    double = (cosine - sine) * (cosine + sine)
    return torque(flight.tilt, flight.spread, s, c) + flight.twist * double


@kernel
def stiffness(tilt: float, spread: float, s: float, c: float) -> float:
    """Return the derivative of :func:`torque` with respect to the angle."""
    sine, cosine = twice_angle(s, c)
    return -cosine - tilt * sine + spread * ((cosine - sine) * (cosine + sine))


@kernel
def set_motion(flight: Flight) -> None:
    """Set the constants of the motion on an arc; ``turns_over`` must be set.

    Its angles and times count from the start of the flight, but those of a motion whose energy is
    measured from a saddle count from there and from the place nearest to it.
    """
    flight.origin_s = flight.flow_s
    flight.origin_c = flight.flow_c
    flight.nearest = 0.0
    flight.lead = 0.0
    if passes_saddle(flight):
        _set_from_nearest(flight)
    else:
        _set_from_start(flight)


@kernel
def passes_saddle(flight: Flight) -> bool:
    """Return whether a motion passes its saddle, or turns beside it: all but on the separatrix."""
    return flight.saddle_root != NEVER and flight.saddle_root != 0.0


@kernel
def _set_from_nearest(flight: Flight) -> None:
    """Set the motion from where it is nearest to its saddle.

    How long it stays there depends on that place, which relative to the start is lost in rounding.
    """
    s, c = flight.saddle_s, flight.saddle_c
    a0, a1, a2, _ = quartic_about(flight.tilt, flight.spread, flight.twist, s, c, 0.0)
    sine, cosine = angle_difference(flight.flow_s, flight.flow_c, s, c)
    side = flight.flow_p
    if flight.saddle_root >= 0.0:
        side = sine * cosine
        # Below a crest that is more than half a turn away the start may be, too.
        if 0.0 < 6.0 * a0 * a2 < 4.0 * a1 * a1 and abs(a0 * sine) > abs(2.0 * a1 * cosine):
            side = a1
    side = math.copysign(1.0, side)
    flight.nearest = start_beside_saddle(flight, a0, a1, a2, flight.saddle_root, side)
    flight.origin_s, flight.origin_c = s, c
    flight.lead = _time_from_nearest(flight, flight.flow_s, flight.flow_c, flight.flow_p)
    s, c, _ = state_of_motion(flight, 0.0)
    if s * flight.flow_s + c * flight.flow_c < 0.0:
        # Both signs of (S, C) are the same place; they change after a lap.
        flight.origin_s, flight.origin_c = -flight.origin_s, -flight.origin_c


@kernel
def _set_from_start(flight: Flight) -> None:
    p = flight.flow_p
    tilt, spread, twist = flight.tilt, flight.spread, flight.twist
    a0, a1, a2, a3 = quartic_about(tilt, spread, twist, flight.flow_s, flight.flow_c, p * p)
    if flight.saddle_root == NEVER:
        set_quartic_constants(flight, a0, a1, a2, a3, p, flight.turns_over)
        return
    b0, b1, b2, _ = quartic_about(tilt, spread, twist, flight.saddle_s, flight.saddle_c, 0.0)
    set_quartic_constants(flight, a0, a1, a2, pull_at_start(flight), p, flight.turns_over)
    refer_to_saddle(flight, b0, b1, b2, flight.saddle_root)


@kernel
def pull_at_start(flight: Flight) -> float:
    """Return a quarter of the torque at the start of a flight on an arc.

    Beside its saddle the torque is lost in rounding at the start itself.
    """
    if flight.saddle_root == NEVER:
        return flight.quartic_3
    s, c = flight.saddle_s, flight.saddle_c
    a0, a1, a2, _ = quartic_about(flight.tilt, flight.spread, flight.twist, s, c, 0.0)
    s, c = angle_difference(flight.flow_s, flight.flow_c, s, c)
    return s * (s * (a1 * (3.0 * c * c - s * s) + a0 * s * c) + 3.0 * a2 * c * (c - s) * (c + s))


@kernel
def heading(flight: Flight) -> float:
    """Return a number with the sign in which a flight on an arc sets out; 0 in equilibrium."""
    return flight.flow_p if flight.flow_p != 0.0 else pull_at_start(flight)


@kernel
def quartic_about(
    tilt: float, spread: float, twist: float, s: float, c: float, square: float
) -> tuple[float, float, float, float]:
    """Return the coefficients a0 to a3 of the quartic about a position where ``P^2 = square``."""
    sine, cosine = twice_angle(s, c)
    turned_sine = tilt * cosine - sine
    turned_cosine = cosine + tilt * sine
    twice, double = twice_angle(sine, cosine)
    double_cosine = spread * double - 2.0 * twist * twice
    double_sine = spread * (sine * cosine) + twist * double
    return (
        square - turned_cosine,
        0.25 * (turned_sine - double_sine),
        (2.0 * square - turned_cosine + double_cosine) / 6.0,
        0.25 * (turned_sine + double_sine),
    )


@kernel
def flow(flight: Flight, t: float) -> tuple[float, float, float]:
    """Return ``(S, C, P)`` of the body a time ``t`` (s) after the start of a flight."""
    if flight.at_rest == 1:
        return flight.s, flight.c, flight.p
    if t == 0.0 and flight.grouped == 0:
        return flight.flow_s, flight.flow_c, flight.flow_p
    if flight.form == TURNING_LINE:
        way, speed = _on_line(flight, t)
        return flight.flow_s + way, flight.flow_c, speed
    if flight.form == POLYNOMIAL:
        return polynomial_flow(flight, t)
    s, c, rate = state_of_motion(flight, flight.frequency * t)
    if flight.grouped == 1:
        return body_of_group(flight, s, c, rate)
    return s, c, rate


@kernel
def state_of_motion(flight: Flight, t: float) -> tuple[float, float, float]:
    """Return ``(S, C, P)`` on an arc a time ``t``, times w, after the start of the flight."""
    sine, cosine, rate = quartic_motion(flight, flight.lead + t)
    if flight.nearest != 0.0:
        # The tangents differ, not the angles.
        sine += flight.nearest * cosine
        size = 1.0 / (sine * sine + cosine * cosine)
        root = math.sqrt(size)
        sine, cosine, rate = sine * root, cosine * root, rate * size
    s, c = angle_sum(flight.origin_s, flight.origin_c, sine, cosine)
    return s, c, rate


@kernel
def fall_from_saddle(
    tilt: float, spread: float, saddle_s: float, saddle_c: float, s: float, c: float
) -> float:
    """Return how much lower ``V`` is at a position than at a saddle, to its last digits."""
    a0, a1, a2, _ = quartic_about(tilt, spread, 0.0, saddle_s, saddle_c, 0.0)
    s, c = angle_difference(s, c, saddle_s, saddle_c)
    return s * s * (a0 * s * s + (4.0 * a1 * s + 6.0 * a2 * c) * c)


@kernel
def squared_rate_ahead(flight: Flight, sine: float, cosine: float) -> float:
    """Return ``P^2`` at half an angle from the start of a flight on an arc."""
    if flight.saddle_root == NEVER:
        return squared_rate(flight, sine, cosine)
    s, c = place_from_start(flight, sine, cosine)
    rate = rate_at(flight, s, c)
    return rate * abs(rate)


@kernel
def rate_at(flight: Flight, s: float, c: float) -> float:
    """Return ``|P|`` where a flight on an arc passes a position, or ``-|P|`` where ``P^2 < 0``."""
    root = flight.saddle_root
    if root == NEVER:
        sine, cosine = angle_from_start(flight, s, c)
        square = squared_rate(flight, sine, cosine)
    else:
        saddle_s, saddle_c = flight.saddle_s, flight.saddle_c
        fall = fall_from_saddle(flight.tilt, flight.spread, saddle_s, saddle_c, s, c)
        square = fall - root * abs(root)
        if fall == 0.0:
            return -root  # at the saddle, where the square may underflow
    return math.copysign(math.sqrt(abs(square)), square)


@kernel
def flow_of_two(a: Flight, b: Flight, age_a: float, age_b: float) -> States:
    """Return ``(S, C, P)`` of two bodies, each a time (s) after the start of its flight."""
    a_s, a_c, a_p = flow(a, age_a)
    b_s, b_c, b_p = flow(b, age_b)
    return a_s, a_c, a_p, b_s, b_c, b_p


@kernel
def displacement(flight: Flight, t: float) -> tuple[float, float]:
    """Return sine and cosine of half the angle that a body has moved since its flight began.

    On a line: the distance (m) and 1.
    """
    if flight.at_rest == 1:
        return 0.0, 1.0
    if flight.form == TURNING_LINE:
        way, _ = _on_line(flight, t)
        return way, 1.0
    if passes_saddle(flight):
        # From the place nearest to the saddle a short way is a difference.
        _set_from_start(flight)
    sine, cosine, _ = quartic_motion(flight, flight.frequency * t)
    if passes_saddle(flight):
        _set_from_nearest(flight)
    return sine, cosine


@kernel
def _on_line(flight: Flight, t: float) -> tuple[float, float]:
    """Return the distance ``way`` (m) and the speed (m/s) on a line: ``v' = a + b^2 way``."""
    v = flight.flow_p
    a = flight.line_acceleration
    b = flight.line_growth
    x = b * t
    if x == 0.0:
        return t * (v + 0.5 * a * t), v + a * t
    half = math.sinh(0.5 * x)
    if flight.saddle_root < NEVER:
        ahead = _growing_speed(flight)
        back = math.exp(-0.5 * x)
        way = 2.0 * half * (ahead * half + v * back) / b
        return way, ahead * math.sinh(x) + v * (back * back)
    sine = math.sinh(x) / b
    return v * sine + a * (2.0 * half * half / (b * b)), v * math.cosh(x) + a * sine


@kernel
def _growing_speed(flight: Flight) -> float:
    """Return the sum of the speed on a line and that lost to the saddle; it grows as ``e^(b t)``.

    Where both nearly cancel it follows from the energy relative to the saddle.
    """
    v = flight.flow_p
    along = flight.line_acceleration / flight.line_growth
    if v * along >= 0.0:
        return v + along
    return -flight.saddle_root * abs(flight.saddle_root) / (v - along)


@kernel
def angular_acceleration(flight: Flight, s: float, c: float) -> float:
    """Return the second derivative (rad/s^2) of the angle of a body on an arc.

    Returns 0 on a segment of a motion in contact, where only its bound is used.
    """
    if flight.form == POLYNOMIAL or flight.at_rest == 1:
        return 0.0
    w = flight.frequency
    if flight.grouped == 1:
        s, c = group_of_body(flight, s, c)
        return w * w * torque_of(flight, s, c)
    return w * w * torque(flight.tilt, flight.spread, s, c)


@kernel
def angular_jerk(flight: Flight, s: float, c: float, p: float) -> float:
    """Return the third derivative (rad/s^3) of the angle of a body on an arc."""
    if flight.form == POLYNOMIAL:
        return 0.0
    w = flight.frequency
    if flight.grouped == 1:
        s, c = group_of_body(flight, s, c)
        bend = stiffness(flight.tilt, flight.spread, s, c)
        bend -= 4.0 * flight.twist * (2.0 * s * c) * ((c - s) * (c + s))
        return w * w * bend * (2.0 * flight.own_frequency * p)
    return w * w * stiffness(flight.tilt, flight.spread, s, c) * (2.0 * w * p)


@kernel
def acceleration_slopes(flight: Flight, s: float, c: float) -> tuple[float, float]:
    """Return the first two derivatives (1/s^2) of ``f''`` with respect to f, of a body alone."""
    w = flight.frequency
    sine, cosine = twice_angle(s, c)
    bend = sine - flight.tilt * cosine - 4.0 * flight.spread * (sine * cosine)
    return w * w * stiffness(flight.tilt, flight.spread, s, c), w * w * bend


@kernel
def tangential_acceleration(flight: Flight, path_radius: float, s: float, c: float) -> float:
    """Return the acceleration (m/s^2) of a body's centre along its path."""
    if flight.form == TURNING_LINE:
        if flight.at_rest == 1:
            return 0.0
        b = flight.line_growth
        return flight.line_acceleration + b * b * (s - flight.flow_s)
    return path_radius * angular_acceleration(flight, s, c)


@kernel
def small_step(
    flight: Flight, age: float, dt: float, s: float, c: float, p: float
) -> tuple[float, float, float]:
    """Advance the state at ``age`` (s) by a last small step ``dt`` (s), to second order."""
    if flight.grouped == 1 or flight.at_rest == 1 or flight.form == TURNING_LINE:
        return flow(flight, age + dt)
    a = flight.frequency * dt
    force = 0.5 * torque(flight.tilt, flight.spread, s, c)
    change = stiffness(flight.tilt, flight.spread, s, c) * p
    return (
        s + a * (p * c + 0.5 * a * (force * c - p * p * s)),
        c - a * (p * s + 0.5 * a * (force * s + p * p * c)),
        p + a * (force + 0.5 * a * change),
    )


@kernel
def quickness(frequency: float, p: float) -> float:
    """Return the rate (1/s) at which a state on an arc changes; last steps are of second order."""
    return frequency * max(1.0, abs(p))


# More than ever needed: the steps to a turning point converge like Newton's.
TURNING_STEPS = 200
# Half an angle (rad) from a saddle below which a slow rate is lost in rounding.
ON_SADDLE = 1.0e-7
# A position is the start, or a whole turn away, up to rounding if the sine of half the angle is
# below this.
ROUNDING_OF_PLACES = 1.0e-14
# Up to this share beyond the tangent of where a motion turns beside its saddle, the way from there
# follows from the rate.
BESIDE_TURN = 0.05


@kernel
def time_of_flight(flight: Flight, s: float, c: float, p: float) -> float:
    """Return the time (s) from the start of a flight on an arc to a state of its orbit."""
    sine, cosine = angle_from_start(flight, s, c)
    at_start = abs(sine) <= ROUNDING_OF_PLACES
    if flight.turns_over == 1 and cosine < 0.0 and at_start:
        # The position from which it starts, a whole turn ahead.
        return period_of(flight) / flight.frequency
    if passes_saddle(flight):
        after = _time_from_nearest(flight, s, c, p) - flight.lead
        if after >= 0.0:
            return after / flight.frequency
        if at_start and p * flight.flow_p > 0.0 and sine * cosine * p >= 0.0:
            return 0.0  # ahead of the start, but both times are rounded
        return (after + period_of(flight)) / flight.frequency
    return _time_to_angle(flight, sine, cosine, p)


@kernel
def _time_from_nearest(flight: Flight, s: float, c: float, p: float) -> float:
    """Return the time, times w, to a state from the place nearest to the saddle.

    It is negative within half a period before.
    """
    sine, cosine = angle_difference(s, c, flight.origin_s, flight.origin_c)
    turn = flight.nearest * cosine
    sine -= turn
    away = sine if turn > 0.0 else -sine
    if turn != 0.0 and -abs(turn) <= away < BESIDE_TURN * abs(turn):
        # Where it turns, the rate says how far it has moved; the position does so up to rounding.
        p /= cosine * cosine
        sine, cosine = place_beside_turn(flight, p), 1.0
    if sine == 0.0 and p * flight.start_rate >= 0.0:
        return 0.0  # it is there
    after = time_to_place(flight, sine, cosine, p)
    whole = period_of(flight)
    return after if after <= 0.5 * whole else after - whole


@kernel
def _time_to_angle(flight: Flight, sine: float, cosine: float, p: float) -> float:
    """Return :func:`time_of_flight` to a position given by half the angle from the start."""
    after = time_to_place(flight, sine, cosine, p) / flight.frequency
    # At a saddle the motion is lost in rounding: the body stays there.
    return after if 0.0 <= after < NEVER else NEVER


@kernel
def time_to_turn(flight: Flight, side: float) -> float:
    """Return the first time (s) at which an oscillation turns on one side; 0 if it starts there.

    A start whose distance from the turning point underflows counts as there.
    """
    if flight.saddle_root < NEVER:
        # Half the time until it comes back to its start: no position is as exact beside a saddle.
        p = flight.flow_p
        back = time_of_flight(flight, flight.flow_s, flight.flow_c, -p) if p != 0.0 else 0.0
        if (p if p != 0.0 else -heading(flight)) * side < 0.0:
            back += period_of(flight) / flight.frequency
        return 0.5 * back
    half = half_way(flight, side)
    if half == 0.0:
        return 0.0
    sine, cosine = sine_cosine(side * half)
    return _time_to_angle(flight, sine, cosine, 0.0)


@kernel
def half_way(flight: Flight, side: float) -> float:
    """Return half the angle (rad) from the start of a flight on an arc to its turn on one side.

    ``P^2`` falls to zero there. A bound on its second derivative proves that no step passes a zero.
    """
    if flight.at_rest == 1:
        return 0.0
    bound = 2.0 * (1.0 + abs(flight.tilt) + abs(flight.spread) + 2.0 * abs(flight.twist))
    square = flight.flow_p * flight.flow_p
    slope = 4.0 * pull_at_start(flight) * side
    if square == 0.0:
        if slope <= 0.0:
            return 0.0
        half = 2.0 * slope / bound
    else:
        half = safe_step_second_order(square, slope, bound)
    for _ in range(TURNING_STEPS):
        if flight.saddle_root < NEVER:
            before = -side * _beyond_saddle(flight, half * side)
            if abs(before) < ON_SADDLE:
                # Here P^2 is lost in rounding: the energy says whether the body turns, and where.
                if before > 0.0 and flight.saddle_root >= 0.0:
                    s, c = flight.saddle_s, flight.saddle_c
                    rise = math.sqrt(stiffness(flight.tilt, flight.spread, s, c))
                    return half + max(before - flight.saddle_root / rise, 0.0)
                half += 2.0 * ON_SADDLE
        s, c = sine_cosine(half)
        square = squared_rate_ahead(flight, s * side, c)
        s, c = place_from_start(flight, s * side, c)
        # The derivative of P^2 with respect to half the angle.
        slope = torque_of(flight, s, c) * side
        if square <= 0.0:
            return half
        step = safe_step_second_order(square, slope, bound)
        if step <= 4.0e-16 * half:
            return half
        half += step
    return half


@kernel
def _beyond_saddle(flight: Flight, half: float) -> float:
    """Return the sine of half the angle from the saddle to a position given from the start."""
    s, c = sine_cosine(half)
    s, c = place_from_start(flight, s, c)
    s, c = angle_difference(s, c, flight.saddle_s, flight.saddle_c)
    return math.copysign(s, s * c)


@kernel
def half_range(
    flight: Flight, end: tuple[float, float, float], duration: float
) -> tuple[float, float]:
    """Return the range of half-angles (rad) from its start that a flight on an arc covers."""
    end_s, end_c, end_p = end
    sine, cosine = angle_from_start(flight, end_s, end_c)
    half = math.atan2(sine, cosine)
    if flight.turns_over == 1 and cosine < 0.0 and half * flight.flow_p < 0.0:
        # After a whole turn only rounding decides on which side of its start it ends.
        half -= math.copysign(2.0 * math.pi, half)
    low = min(half, 0.0)
    high = max(half, 0.0)
    if flight.at_rest == 1 or flight.turns_over == 1:
        return low, high
    left, right = sides_turned(flight, end_p, duration)
    if right:
        high = max(high, half_way(flight, 1.0))
    if left:
        low = min(low, -half_way(flight, -1.0))
    return low, high


@kernel
def sides_turned(flight: Flight, end_p: float, duration: float) -> tuple[bool, bool]:
    """Return on which sides (left, right) an oscillation ending with ``P = end_p`` has turned."""
    start_p = heading(flight)
    argument = flight.frequency * duration
    period = period_of(flight)
    # With the same direction at both ends it has turned twice or not at all.
    twice = argument >= period or (argument >= 0.5 * period and start_p * end_p > 0.0)
    left = twice or (start_p < 0.0 and end_p > 0.0)
    return left, twice or (start_p > 0.0 and end_p < 0.0)


@kernel
def squared_speed(flight: Flight, way: float) -> float:
    """Return the squared speed (m^2/s^2) of a body that has moved ``way`` (m) along a line."""
    b = flight.line_growth
    v = flight.flow_p
    if flight.saddle_root < NEVER:
        along = flight.line_acceleration / b + b * way
        return along * along - flight.saddle_root * abs(flight.saddle_root)
    return v * v + way * (2.0 * flight.line_acceleration + b * b * way)


@kernel
def turns_before(flight: Flight, way: float) -> bool:
    """Return whether a body on a line comes to rest before it has moved ``way`` (m)."""
    a = flight.line_acceleration
    b = flight.line_growth
    if a * way >= 0.0:
        return False
    turns = flight.flow_p * flight.flow_p * (b * b) <= a * a
    if flight.saddle_root < NEVER:
        turns = flight.saddle_root >= 0.0
    return turns and abs(a) < b * b * abs(way)


@kernel
def turn_on_line(flight: Flight) -> float:
    """Return the signed distance (m) to where a body turns back, or 0 if it never does."""
    v = flight.flow_p
    a = flight.line_acceleration
    b = flight.line_growth
    square = (a - b * v) * (a + b * v)
    if flight.saddle_root < NEVER:
        square = b * b * flight.saddle_root * abs(flight.saddle_root)
    if v * a >= 0.0 or square < 0.0:
        return 0.0
    return -v * v / (a + math.copysign(math.sqrt(square), a))


@kernel
def time_on_line(flight: Flight, way: float, speed: float) -> float:
    """Return the time (s) to ``speed`` at ``way`` (m); ``tanh(b t/2)/b`` is rational in both."""
    v = flight.flow_p
    a = flight.line_acceleration
    b = flight.line_growth
    if v * speed >= 0.0:
        x = way / (v + speed) if way != 0.0 else 0.0
    else:
        x = (speed - v) / (2.0 * a + b * b * way)
    if b * x < 1.0e-8:
        return 2.0 * x
    if b * x > 0.5 and flight.saddle_root < NEVER:
        # A hyperbolic tangent near 1 has lost the time, the part that grows or decays has not.
        along = a / b
        if speed * (along + b * way) < 0.0:
            return math.log((v - along) / (speed - along - b * way)) / b
        ahead = _growing_speed(flight)
        return math.log((speed + along + b * way) / ahead) / b if ahead != 0.0 else NEVER
    if b * x >= 1.0:
        return NEVER  # it only approaches that position
    return 2.0 * math.atanh(b * x) / b
