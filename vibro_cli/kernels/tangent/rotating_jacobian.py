"""The derivative of a flight on a rotating trace with respect to its initial state.

On an arc, in units of 1/w, the angle obeys

``f'' = Q(f) = -sin f + tilt cos f + spread/2 sin 2f + twist cos 2f``

(``twist`` for a group only). Relative to an angle ``f0`` of the motion, ``u = tan((f - f0)/2)``
moves under a quartic, and a small change ``delta`` of u obeys the linearised equation:

``u'' = 2 a0 u^3 + 6 a1 u^2 + 6 a2 u + 2 a3,
delta'' = (6 a0 u^2 + 12 a1 u + 6 a2) delta + (u + u^3) dE``

where ``dE = f' df' - Q df`` is the change of the energy, on which the quartic depends. One solution
is ``delta = u'``, with dE = 0; one other solution is needed. Both are power series in time. A
flight is divided into equal parts. The series of a part start in its middle, where the closed form
gives the state, so that they need to hold for half its length only. On a line the motion is linear
in its start: ``s'' = a + b^2 s``. These kernels override those of
``kernels.tangent.flight_jacobian``.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import FloatMatrix, kernel
from vibro_cli.kernels.flow.flow import POLYNOMIAL
from vibro_cli.kernels.flow.rotating_flow import TURNING_LINE, state_of_motion
from vibro_cli.kernels.numerics.elliptic import twice_angle
from vibro_cli.kernels.tangent.frame import TERMS
from vibro_cli.kernels.world import Flight

# Rows of the series, in powers of the time from the middle over half the length of a part: u, its
# square, the stiffness 6 a0 u^2 + 12 a1 u + 6 a2, and the change.
_PLACE, _SQUARE, _STIFFNESS, _CHANGE = range(4)
# Bound of the last terms of a part.
REST = 1.0e-17
# Half the length of a part, in units of the time scale of the motion: longer parts would need more
# terms, shorter ones would be more numerous. Most parts have 25 to 30 terms.
HALF = 0.65
# Rate of a body in equilibrium: it avoids 0/0, and the formulas hold for any motion, however slow.
SLOWEST = 1.0e-150


@kernel
def flight_jacobian(
    flight: Flight, t: float, series: FloatMatrix
) -> tuple[float, float, float, float]:
    """Override :func:`kernels.tangent.flight_jacobian.flight_jacobian` on a rotating trace."""
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
    whole = flight.frequency * t
    strength = 1.0 + flight.flow_p * flight.flow_p
    strength += abs(flight.tilt) + abs(flight.spread) + abs(flight.twist)
    parts = 1 + int(0.5 * whole * math.sqrt(strength) / HALF)
    one, two, three, four = 1.0, 0.0, 0.0, 1.0
    done = 0
    while done < parts:
        half = 0.5 * whole / parts
        terms, a, b, c, d = _over_part(flight, (2 * done + 1) * half, half, series)
        if terms > 0:
            one, three = a * one + b * three, c * one + d * three
            two, four = a * two + b * four, c * two + d * four
            done += 1
        else:
            parts *= 2
            done = 0
            one, two, three, four = 1.0, 0.0, 0.0, 1.0
    unit = 0.5 * t / parts
    return one, two * unit, three / unit, four


@kernel
def _over_part(
    flight: Flight, middle: float, half: float, series: FloatMatrix
) -> tuple[int, float, float, float, float]:
    """Return the derivative of angle and rate at the end of a part with respect to its start.

    The unit of time is half its length. The first item is the greatest power of time needed, or 0
    if this exceeds the room in the series: then the part is too long.
    """
    a0, a1, a2, a3, rate = _quartic_from(flight, middle, half)
    size = abs(rate) + 2.0 * abs(a3)
    terms = _expand(a0, a1, a2, a3, rate, size, series)
    if terms == 0:
        return 0, 1.0, 0.0, 0.0, 1.0
    even, odd, slope, back = _sums(series, _PLACE, terms)
    even_change, odd_change, slope_change, back_change = _sums(series, _CHANGE, terms)
    u, rate = even + odd, slope + back
    pull = 2.0 * (a3 + u * (3.0 * a2 + u * (3.0 * a1 + u * a0)))
    a, c = _as_angle(u, rate, rate / size, pull / size)
    b, d = _as_angle(u, rate, even_change + odd_change, slope_change + back_change)
    u, rate = even - odd, slope - back
    pull = 2.0 * (a3 + u * (3.0 * a2 + u * (3.0 * a1 + u * a0)))
    e, g = _as_angle(u, rate, rate / size, pull / size)
    f, h = _as_angle(u, rate, even_change - odd_change, slope_change - back_change)
    # Map the changes at the start to those at the end; both matrices have determinant 1.
    return terms, a * h - b * g, b * e - a * f, c * h - d * g, d * e - c * f


@kernel
def _quartic_from(
    flight: Flight, t: float, unit: float
) -> tuple[float, float, float, float, float]:
    """Return a0 to a3 relative to the angle at time ``t``, and u' there, in a unit of time."""
    s = flight.flow_s
    c = flight.flow_c
    p = 0.0
    if flight.at_rest == 0:
        s, c, p = state_of_motion(flight, t)
    sine, cosine = twice_angle(s, c)
    double_sine = sine * cosine
    double_cosine = 0.5 * (cosine - sine) * (cosine + sine)
    pull = flight.tilt * cosine - sine
    bend = -cosine - flight.tilt * sine
    double_pull = flight.spread * double_sine + 2.0 * flight.twist * double_cosine
    double_bend = 2.0 * flight.spread * double_cosine - 4.0 * flight.twist * double_sine
    square = unit * unit
    a3 = 0.25 * square * (pull + double_pull)
    return (
        square * (p * p + bend),
        0.25 * square * (pull - double_pull),
        square * (2.0 * p * p + bend + double_bend) / 6.0,
        a3,
        SLOWEST if p == 0.0 and a3 == 0.0 else unit * p,
    )


@kernel
def _expand(
    a0: float, a1: float, a2: float, a3: float, rate: float, size: float, series: FloatMatrix
) -> int:
    """Set the series of a part; return the power of their last terms, 0 if there is no room.

    Two terms of each are set at once: the term of t^(k + 2) follows from those up to t^k.
    """
    _begin(a1, a2, a3, rate, size, series)
    for k in range(2, TERMS - 2, 2):
        u = series[_PLACE, k]
        u_next = series[_PLACE, k + 1]
        square = series[_SQUARE, k]
        square_next = series[_SQUARE, k + 1]
        series[_STIFFNESS, k] = 6.0 * a0 * square + 12.0 * a1 * u
        series[_STIFFNESS, k + 1] = 6.0 * a0 * square_next + 12.0 * a1 * u_next
        force = 6.0 * (a1 * square + a2 * u)
        force_next = 6.0 * (a1 * square_next + a2 * u_next)
        cube, cube_next, square, square_next, change, change_next = _products(series, k)
        share = 1.0 / ((k + 1) * (k + 2))
        share_next = 1.0 / ((k + 2) * (k + 3))
        change = (change + 4.0 * size * (u + cube)) * share
        change_next = (change_next + 4.0 * size * (u_next + cube_next)) * share_next
        u = (2.0 * a0 * cube + force) * share
        u_next = (2.0 * a0 * cube_next + force_next) * share_next
        series[_PLACE, k + 2] = u
        series[_PLACE, k + 3] = u_next
        series[_SQUARE, k + 2] = square
        series[_SQUARE, k + 3] = square_next + 2.0 * rate * u
        series[_CHANGE, k + 2] = change
        series[_CHANGE, k + 3] = change_next
        last = abs(change) + abs(change_next) + (k + 3) * (abs(u) + abs(u_next)) / size
        if not last > REST:  # true for nan too
            return k + 3
    return 0


@kernel
def _begin(a1: float, a2: float, a3: float, rate: float, size: float, series: FloatMatrix) -> None:
    """Set the first four terms of the series; the change starts orthogonal to (u', u'')."""
    along = rate / size
    pull = 2.0 * a3 / size
    scale = 1.0 / (along * along + pull * pull)
    place = -pull * scale
    speed = along * scale
    series[_PLACE, 0] = 0.0
    series[_PLACE, 1] = rate
    series[_PLACE, 2] = a3
    series[_PLACE, 3] = a2 * rate
    series[_SQUARE, 0] = 0.0
    series[_SQUARE, 1] = 0.0
    series[_SQUARE, 2] = rate * rate
    series[_SQUARE, 3] = 2.0 * rate * a3
    series[_STIFFNESS, 0] = 6.0 * a2
    series[_STIFFNESS, 1] = 12.0 * a1 * rate
    series[_CHANGE, 0] = place
    series[_CHANGE, 1] = speed
    series[_CHANGE, 2] = 3.0 * a2 * place
    series[_CHANGE, 3] = a2 * speed + rate * (2.0 * a1 * place + size / 1.5)


@kernel
def _products(series: FloatMatrix, k: int) -> tuple[float, float, float, float, float, float]:
    """Return terms of products of series: six independent sums in one loop.

    Returns
    -------
    The terms of t^k and t^(k + 1) of u u^2, of t^(k + 2) and t^(k + 3) of u u (the latter without
    2 u_1 u_(k + 2), which is not known yet), and of t^k and t^(k + 1) of stiffness times change.
    """
    cube, cube_next = 0.0, 0.0
    square, square_next = series[_PLACE, 1] * series[_PLACE, k + 1], 0.0
    change = series[_CHANGE, 0] * series[_STIFFNESS, k]
    change_next = series[_CHANGE, 0] * series[_STIFFNESS, k + 1]
    change_next += series[_CHANGE, k + 1] * series[_STIFFNESS, 0]
    for i in range(1, k + 1):
        factor = series[_PLACE, i]
        cube += factor * series[_SQUARE, k - i]
        cube_next += factor * series[_SQUARE, k + 1 - i]
        factor = series[_PLACE, i + 1]
        square += factor * series[_PLACE, k + 1 - i]
        square_next += factor * series[_PLACE, k + 2 - i]
        factor = series[_CHANGE, i]
        change += factor * series[_STIFFNESS, k - i]
        change_next += factor * series[_STIFFNESS, k + 1 - i]
    return cube, cube_next, square, square_next, change, change_next


@kernel
def _sums(series: FloatMatrix, row: int, terms: int) -> tuple[float, float, float, float]:
    """Return the sums of the even and odd terms, and of the derivatives of odd and even terms."""
    even, odd, slope, back = 0.0, 0.0, 0.0, 0.0
    for k in range(terms, 0, -2):
        high = series[row, k]
        low = series[row, k - 1]
        even += low
        odd += high
        slope += k * high
        back += (k - 1) * low
    return even, odd, slope, back


@kernel
def _as_angle(u: float, rate: float, change: float, change_rate: float) -> tuple[float, float]:
    """Return half the changes of angle and rate, from those of u and u'."""
    share = 1.0 / (1.0 + u * u)
    return share * change, share * (change_rate - 2.0 * u * rate * share * change)
