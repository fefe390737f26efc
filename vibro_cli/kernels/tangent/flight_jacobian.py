"""The derivative of a flight with respect to its initial state, in closed form.

With ``u = w t`` the half-angle variables of a flight are rational in those of its start and in
``s, c, d = sn, cn, dn(u|m)``, ``m = S0^2 + P0^2``. So is the derivative, except for the derivatives
of s, c, d with respect to m at constant u:

``2 s_m = c Q,  2 c_m = -s Q,  2 d_m = -s R``  with

``Q = -d D,                     R = s/d - m c D``         below the separatrix, and
``Q = (d F/sqrt(m) - s/c)/m,    R = c F/sqrt(m)``         above it,

where ``D(u|m)`` is the integral of ``(sn/dn)^2`` from 0 to u, and ``F = x + D(x|1/m)/m``,
``x = sqrt(m) u``. They have no singularity at ``m = 0`` or ``m = 1``. D follows from the
logarithmic derivative of the theta function of dn (DLMF 22.16.20, 22.16.30 and 20.2.3):

``m (1 - m) D = (E/K - (1 - m)) u + z' theta_3'(z)/theta_3(z),  z = z' u,  z' = pi/(2 K)``.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import FloatMatrix, kernel
from vibro_cli.kernels.flow.flow import LINE, POLYNOMIAL
from vibro_cli.kernels.numerics.elliptic import (
    TRIGONOMETRIC,
    ThetaConstants,
    sine_cosine,
    theta_functions,
)
from vibro_cli.kernels.world import Flight

# Below this parameter the nome is one sixteenth of it.
LEAST_PARAMETER = 1.0e-200


@kernel
def flight_jacobian(
    flight: Flight, t: float, series: FloatMatrix
) -> tuple[float, float, float, float]:
    """Return the derivative of a flight's state at time ``t`` (s) with respect to its start.

    The state is displacement along the path of the centre and speed (m, m/s), or angle and rate:
    the matrix is the same. For a body in lasting contact on one piece it is that of its group.
    ``series`` is scratch (see ``kernels.tangent.rotating_jacobian``).

    Returns
    -------
    ``d way/d way0`` (1), ``d way/d speed0`` (s), ``d speed/d way0`` (1/s), ``d speed/d speed0``
    (1); NaN for a motion in contact across pieces, which has no closed form.
    """
    if flight.form == LINE:
        return 1.0, t, 0.0, 1.0
    if flight.form == POLYNOMIAL:
        return math.nan, math.nan, math.nan, math.nan
    w = flight.frequency
    one, two, three, four = pendulum_jacobian(
        flight, flight.flow_s, flight.flow_c, flight.flow_p, w * t
    )
    return one, two / w, w * three, four


@kernel
def pendulum_jacobian(
    theta: ThetaConstants, s0: float, c0: float, p0: float, u: float
) -> tuple[float, float, float, float]:
    """Return the derivative of a pendulum's angle and rate with respect to its start.

    The unit of time is 1/w.
    """
    s, c, d, common = theta_functions(theta, u)
    s /= common
    c /= common
    d /= common
    q, r = derivative_by_parameter(theta, u, s, c, d)
    # Near a crest c, d, c0 and p0 are all small: scaling keeps their products from underflow.
    scale = 1.0 / (abs(c) + abs(s * c0))
    c1 = c * scale
    c01 = c0 * scale
    p01 = p0 * scale
    sc01 = s * c01
    inverse = 1.0 / (c1 * c1 + sc01 * sc01)
    # The angle: direct terms, and terms through the parameter.
    a_direct = scale * c1 * inverse
    b_direct = scale * (s * d * scale) * inverse
    a_way = ((p01 * c * d - s0 * c01 * s) * q + s * s * p01 * r) * inverse
    # The rate.
    p = (p01 * c1 - s0 * c01 * (s * d * scale)) * inverse
    c_direct = (2.0 * p * s * s * s0 * c01 - (c0 - s0) * (c0 + s0) * s * (d * scale)) * scale
    r_way = -p01 * s * q - s0 * c01 * (c * d * q - s * s * r)
    r_way = (r_way + 2.0 * p * s * c1 * s0 * s0 * q) * inverse
    return (
        a_direct + a_way * (s0 * c01),
        b_direct + a_way * p01,
        c_direct * inverse + r_way * (s0 * c01),
        a_direct + r_way * p01,
    )


@kernel
def derivative_by_parameter(
    theta: ThetaConstants, u: float, s: float, c: float, d: float
) -> tuple[float, float]:
    """Return Q and R: ``2 ds/dm = c Q``, ``2 dc/dm = -s Q`` and ``2 dd/dm = -s R``."""
    m = theta.parameter
    if theta.reciprocal == 0:
        way = square_integral(theta, m, abs(theta.complementary_modulus), 1.0, u)
        return -d * way, s / d - m * c * way
    root = math.sqrt(m)
    way = square_integral(theta, 1.0 / m, abs(theta.complementary_modulus) / root, root, u)
    way = root * u + way / m
    return (d * way / root - s / c) / m, c * way / root


@kernel
def square_integral(theta: ThetaConstants, m: float, root: float, rate: float, u: float) -> float:
    """Return the integral ``D(x|m)`` of ``(sn/dn)^2`` from 0 to ``x = rate u``, for ``m <= 1``.

    Either ``theta`` has the constants of m and ``rate`` is 1, or it has those of 1/m and ``rate``
    is ``1/sqrt(m)``. ``root`` is ``sqrt(1 - m)``; u is the argument of the functions of ``theta``.
    """
    complement = root * root
    q = 0.5 * theta.two_nome
    q3 = q * q * q
    q8 = q3 * q3 * (q * q)
    trigonometric = theta.form == TRIGONOMETRIC
    small = m if trigonometric else complement
    ratio = q / small if small > LEAST_PARAMETER else 0.0625
    # The mean of sn^2 over the parameter, or over its complement.
    mean = ratio * (8.0 - 32.0 * q3 + 72.0 * q8) / (1.0 - 2.0 * (q - q * q3 + q * q8))
    if trigonometric:
        scale = theta.argument_scale / rate
        slope = _trigonometric_slope(q, q3, q8, u * theta.argument_scale)
        rest = 1.0 - scale * scale * mean
        return (rest * (rate * u) - 4.0 * scale * ratio * slope) / complement
    scale = (1.0 + theta.argument_scale) / rate
    z = u + u * theta.argument_scale
    n = math.floor(z / theta.half_period + 0.5)
    r = (z - n * theta.half_period) - n * theta.half_period_low
    slope = ratio * _hyperbolic_slope(q, q3, r)
    if n != 0.0:
        slope += 2.0 * n / complement
    return (scale * slope - (1.0 - scale * scale * mean) * (rate * u)) / m


@kernel
def _trigonometric_slope(q: float, q3: float, q8: float, z: float) -> float:
    """Return ``-theta_3'(z)/(4 q theta_3(z))`` of nome q (DLMF 20.2.3)."""
    sine, cosine = sine_cosine(z)
    s2 = 2.0 * sine * cosine
    c2 = 1.0 - 2.0 * sine * sine
    s4 = 2.0 * s2 * c2
    c4 = 1.0 - 2.0 * s2 * s2
    s6 = s2 * c4 + c2 * s4
    slope = s2 + 2.0 * q3 * s4 + 3.0 * q8 * s6 + 8.0 * (q8 * q3 * q3 * q) * (s4 * c4)
    return slope / (1.0 + 2.0 * q * (c2 + q3 * c4 + q8 * (c2 * c4 - s2 * s4)))


@kernel
def _hyperbolic_slope(q: float, q3: float, r: float) -> float:
    """Return the derivative of ``ln theta_3(i r)`` of nome q, over q, for ``exp(2 |r|) <= 1/q``."""
    fall = math.exp(-2.0 * abs(r))
    rise = 1.0 / fall
    x1 = q * rise
    x2 = q * fall
    q6 = q3 * q3
    middle = 2.0 + 4.0 * q * q * (x1 + x2) + 6.0 * q6 * (x1 * x1 + q * q + x2 * x2)
    even = 1.0 + (x1 + x2) + q * q * (x1 * x1 + x2 * x2)
    even += q6 * (x1 * x1 * x1 + x2 * x2 * x2)
    slope = (rise - fall) * middle / even
    return slope if r >= 0.0 else -slope
