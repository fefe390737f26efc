"""When and where a body passes a place, or turns, on a flight of a turning trace.

The kernels stand in for those of ``kernels.flow.time_of_flight``.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.flow.rotating_flow import pull_of
from vibro_cli.kernels.numerics.conservative_advancement import safe_step_second_order
from vibro_cli.kernels.numerics.trigonometry import sine_cosine
from vibro_cli.kernels.numerics.weierstrass_motion import period_of, squared_rate, time_to_place
from vibro_cli.kernels.structs import NEVER, Flight

# More than ever needed: the steps to a turning point converge like Newton's.
TURNING_STEPS = 200
# A place is a whole turn away up to rounding if the sine of half the angle is below this.
WHOLE_TURN = 1.0e-14


@kernel
def time_to(flight: Flight, s: float, c: float, p: float) -> float:
    """Time (s) from the start of a flight on an arc to a state of its orbit."""
    sine = s * flight.flow_c - c * flight.flow_s
    cosine = c * flight.flow_c + s * flight.flow_s
    if flight.turns_over == 1 and cosine < 0.0 and abs(sine) <= WHOLE_TURN:
        # The place from which it starts, a whole turn on.
        return period_of(flight) / flight.frequency
    after = time_to_place(flight, sine, cosine, p) / flight.frequency
    # Lost in rounding at a saddle, a body stays there.
    return after if 0.0 <= after < NEVER else NEVER


@kernel
def half_way(flight: Flight, side: float) -> float:
    """Half the angle (rad) from the start of a flight on an arc to its turning point on one side.

    ``P^2`` falls to zero there; steps that its second derivative proves never to pass a zero.
    """
    if flight.at_rest == 1:
        return 0.0
    bound = 2.0 * (1.0 + abs(flight.tilt) + abs(flight.spread) + 2.0 * abs(flight.twist))
    square = flight.flow_p * flight.flow_p
    slope = 4.0 * flight.quartic_3 * side
    if square == 0.0:
        if slope <= 0.0:
            return 0.0
        half = 2.0 * slope / bound
    else:
        half = safe_step_second_order(square, slope, bound)
    for _ in range(TURNING_STEPS):
        s, c = sine_cosine(half)
        square = squared_rate(flight, s * side, c)
        slope = _squared_rate_slope(flight, s * side, c) * side
        if square <= 0.0:
            return half
        step = safe_step_second_order(square, slope, bound)
        if step <= 4.0e-16 * half:
            return half
        half += step
    return half


@kernel
def _squared_rate_slope(flight: Flight, s: float, c: float) -> float:
    """Derivative of ``P^2`` with half the angle, where that from the start has ``s`` and ``c``."""
    place_s = flight.flow_s * c + flight.flow_c * s
    place_c = flight.flow_c * c - flight.flow_s * s
    return pull_of(flight, place_s, place_c)


@kernel
def half_range(
    flight: Flight, end: tuple[float, float, float], duration: float
) -> tuple[float, float]:
    """Half the angles (rad) from its start that a flight on an arc takes in."""
    end_s, end_c, end_p = end
    half = math.atan2(
        end_s * flight.flow_c - end_c * flight.flow_s, end_c * flight.flow_c + end_s * flight.flow_s
    )
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
    """Tell on which sides an oscillation on an arc has turned, which ends with ``P = end_p``."""
    start_p = flight.flow_p if flight.flow_p != 0.0 else flight.quartic_3
    argument = flight.frequency * duration
    period = period_of(flight)
    # With equal directions at both ends it has turned twice, or gone straight on.
    twice = argument >= period or (argument >= 0.5 * period and start_p * end_p > 0.0)
    left = twice or (start_p < 0.0 and end_p > 0.0)
    return left, twice or (start_p > 0.0 and end_p < 0.0)


@kernel
def squared_speed(flight: Flight, way: float) -> float:
    """Square of the speed (m^2/s^2) where a body on a line has gone a way (m)."""
    b = flight.line_growth
    v = flight.flow_p
    return v * v + way * (2.0 * flight.line_acceleration + b * b * way)


@kernel
def turns_before(flight: Flight, way: float) -> bool:
    """Tell whether a body comes to rest before it has gone ``way`` (m)."""
    a = flight.line_acceleration
    b = flight.line_growth
    if a * way >= 0.0:
        return False
    slowest = -a
    return slowest * (1.0 if way > 0.0 else -1.0) < b * b * abs(way) and (
        flight.flow_p * flight.flow_p * (b * b) <= a * a
    )


@kernel
def turn_on_line(flight: Flight) -> float:
    """Way (m) to the place at which a body turns back, or 0 if it never does."""
    v = flight.flow_p
    a = flight.line_acceleration
    b = flight.line_growth
    square = (a - b * v) * (a + b * v)
    if v * a >= 0.0 or square < 0.0:
        return 0.0
    return -v * v / (a + math.copysign(math.sqrt(square), a))


@kernel
def time_on_line(flight: Flight, way: float, speed: float) -> float:
    """Time (s) to ``speed`` at a ``way`` (m): ``tanh(b t/2)/b`` is rational in the states."""
    v = flight.flow_p
    a = flight.line_acceleration
    b = flight.line_growth
    if v * speed >= 0.0:
        x = way / (v + speed) if way != 0.0 else 0.0
    else:
        x = (speed - v) / (2.0 * a + b * b * way)
    if b * x < 1.0e-8:
        return 2.0 * x
    if b * x >= 1.0:
        return NEVER  # to where it would come to rest
    return 2.0 * math.atanh(b * x) / b
