"""The derivative of a flight on a trace that turns, with respect to the state it starts from.

On an arc, in units of 1/w, the angle and its change obey

``f'' = Q(f) = -sin f + tilt cos f + spread/2 sin 2f + twist cos 2f,    delta'' = Q'(f) delta``

(``twist`` of a group only). Both are expanded in powers of time: ``sin f`` and ``cos f`` from
``f'`` by ``(sin f)' = f' cos f``, those of 2f likewise. A step is as long as the last coefficients
say. On a line the motion is linear in its start: ``s'' = a + b^2 s``. The kernels stand in for
those of ``kernels.tangent.flight_jacobian`` and ``kernels.tangent.follow``.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import FloatMatrix, kernel
from vibro_cli.kernels.flow.flow import POLYNOMIAL
from vibro_cli.kernels.flow.replay import recall_flight
from vibro_cli.kernels.flow.rotating_flow import TURNING_LINE, pull_of
from vibro_cli.kernels.structs import Flight
from vibro_cli.kernels.tangent.world import TERMS
from vibro_cli.kernels.world import World

# Rows of the series: sine and cosine of f and of 2f, f', Q'(f), and the change for one of the angle
# and for one of the rate at the start.
_SINE, _COSINE, _SINE_2, _COSINE_2, _RATE, _STIFFNESS, _OF_ANGLE, _OF_RATE = range(8)
# The last terms of a step are at most this.
REST = 1.0e-18


@kernel
def flight_jacobian(
    flight: Flight, t: float, series: FloatMatrix
) -> tuple[float, float, float, float]:
    """Do what :func:`kernels.tangent.flight_jacobian.flight_jacobian` does on a turning trace."""
    if flight.form == POLYNOMIAL:
        return math.nan, math.nan, math.nan, math.nan
    if flight.form == TURNING_LINE:
        b = flight.line_growth
        x = b * t
        if x == 0.0:
            return 1.0, t, 0.0, 1.0
        sine = math.sinh(x)
        cosine = math.cosh(x)
        return cosine, sine / b, b * sine, cosine
    w = flight.frequency
    one, two, three, four = 1.0, 0.0, 0.0, 1.0
    sine = 2.0 * flight.flow_s * flight.flow_c
    cosine = (flight.flow_c - flight.flow_s) * (flight.flow_c + flight.flow_s)
    rate = 2.0 * flight.flow_p
    left = w * t
    while left > 0.0:
        _expand(flight, sine, cosine, rate, series)
        step = min(_reach(series), left)
        left -= step
        angle_angle, rate_angle = _sum(series, _OF_ANGLE, step)
        angle_rate, rate_rate = _sum(series, _OF_RATE, step)
        one, three = angle_angle * one + angle_rate * three, rate_angle * one + rate_rate * three
        two, four = angle_angle * two + angle_rate * four, rate_angle * two + rate_rate * four
        sine, _ = _sum(series, _SINE, step)
        cosine, _ = _sum(series, _COSINE, step)
        rate, _ = _sum(series, _RATE, step)
    return one, two / w, w * three, four


@kernel
def _expand(flight: Flight, sine: float, cosine: float, rate: float, series: FloatMatrix) -> None:
    """Set the series of the motion from a state, and of its two changes."""
    tilt = flight.tilt
    half = 0.5 * flight.spread
    twist = flight.twist
    series[_SINE, 0] = sine
    series[_COSINE, 0] = cosine
    series[_SINE_2, 0] = 2.0 * sine * cosine
    series[_COSINE_2, 0] = (cosine - sine) * (cosine + sine)
    series[_RATE, 0] = rate
    series[_OF_ANGLE, 0] = 1.0
    series[_OF_ANGLE, 1] = 0.0
    series[_OF_RATE, 0] = 0.0
    series[_OF_RATE, 1] = 1.0
    for k in range(TERMS):
        s1 = series[_SINE, k]
        c1 = series[_COSINE, k]
        s2 = series[_SINE_2, k]
        c2 = series[_COSINE_2, k]
        series[_STIFFNESS, k] = 2.0 * (half * c2 - twist * s2) - c1 - tilt * s1
        up, down, up_2, down_2, angle, speed = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(k + 1):
            r = series[_RATE, k - i]
            up += r * series[_COSINE, i]
            down += r * series[_SINE, i]
            up_2 += r * series[_COSINE_2, i]
            down_2 += r * series[_SINE_2, i]
            stiff = series[_STIFFNESS, k - i]
            angle += stiff * series[_OF_ANGLE, i]
            speed += stiff * series[_OF_RATE, i]
        next_ = 1.0 / (k + 1)
        series[_SINE, k + 1] = up * next_
        series[_COSINE, k + 1] = -down * next_
        series[_SINE_2, k + 1] = 2.0 * up_2 * next_
        series[_COSINE_2, k + 1] = -2.0 * down_2 * next_
        series[_RATE, k + 1] = (tilt * c1 - s1 + half * s2 + twist * c2) * next_
        next_ /= k + 2
        series[_OF_ANGLE, k + 2] = angle * next_
        series[_OF_RATE, k + 2] = speed * next_


@kernel
def _reach(series: FloatMatrix) -> float:
    """Time up to which the last terms of the series are nothing, in units of 1/w."""
    reach = math.inf
    for k in range(TERMS - 1, TERMS + 1):
        last = abs(series[_RATE, k]) + abs(series[_OF_ANGLE, k + 1]) + abs(series[_OF_RATE, k + 1])
        if last > 0.0:
            reach = min(reach, (REST / last) ** (1.0 / k))
    return reach


@kernel
def _sum(series: FloatMatrix, row: int, t: float) -> tuple[float, float]:
    """Value and derivative of one of the series."""
    value = 0.0
    slope = 0.0
    for k in range(TERMS, 0, -1):
        value = value * t + series[row, k]
        slope = slope * t + k * series[row, k]
    return value * t + series[row, 0], slope


@kernel
def leans(world: World, number: int, flight: Flight) -> bool:
    """Do what :func:`kernels.tangent.follow.leans` does on a turning trace."""
    row = world.log[number]
    if row.at_rest == 0:
        return False
    recall_flight(world, row, number, flight)
    if flight.form == TURNING_LINE:
        return row.grouped == 1 or flight.line_acceleration != 0.0
    return row.grouped == 1 or pull_of(flight, flight.flow_s, flight.flow_c) != 0.0
