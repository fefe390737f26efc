"""Sine, cosine, angles; Jacobi's functions by theta series in the nome, and Carlson's integral.

The functions solve Euler's top ``s' = c d, c' = -s d, d' = -m s c`` from ``(0, 1, 1)`` for every
``m >= 0``: for ``m <= 1`` they are sn, cn, dn of parameter ``m``; for ``m > 1`` they follow from
those of parameter ``1/m`` by the reciprocal-modulus transformation. Constants that depend on ``m``
alone are set once for a flight (:func:`set_theta_constants`). One evaluation then costs one sine
and cosine or one exponential, and a division that the caller shares (:func:`theta_functions`).

The parameter is given twice, as ``m`` and as the signed root of its complement
``complementary_modulus = sign(1 - m) sqrt|1 - m|``, because near the separatrix the complement
holds all the information and ``m`` none. Formulas: DLMF 20.2, 22.2 (theta series), 19.36 (Carlson's
R_F).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from vibro_cli.compile.kernel import has_bit, kernel, struct


@struct
class ThetaConstants:
    """Constants of the theta series of one parameter (fields of a flight)."""

    parameter: float  # m
    complementary_modulus: float  # sign(1 - m) sqrt|1 - m|
    form: int  # TRIGONOMETRIC, HYPERBOLIC, HYPERBOLIC_TINY
    reciprocal: int  # 1: m > 1, so cn and dn are exchanged
    argument_scale: float  # z = u scale (trigonometric), z = u + u scale (hyperbolic)
    even_0: float
    even_2: float
    even_4: float
    odd_1: float
    odd_3: float
    sum_0: float
    sum_2: float
    difference_1: float
    difference_3: float
    sine_scale: float
    cosine_scale: float
    delta_scale: float
    two_nome: float
    root_nome: float  # square root of the complementary nome (hyperbolic)
    half_period: float  # -ln(complementary nome), high part
    half_period_low: float  # and low part


@struct
class QuarticConstants(ThetaConstants):
    """Constants of the motion under one quartic (fields of a flight)."""

    quartic_0: float  # a0
    quartic_1: float  # a1
    quartic_2: float  # a2
    quartic_3: float  # a3
    start_rate: float  # u' at the start: its square is a4
    lattice: int  # RECTANGULAR, RHOMBIC or BESIDE_SADDLE
    turns_over: int  # 1: u passes infinity
    root: float  # z of the greatest real root, of the real one (rhombic), of Re e2 (saddle)
    second: float  # e1 - e2; rhombic: real part of e1 - e2
    third: float  # e1 - e3; rhombic: imaginary part of e1 - e2
    rate_scale: float  # argument of the theta functions for one unit of time
    back: float  # u'^2 z where it comes back to the start
    returns_early: int  # 1: it comes back within half a period


TWO_OVER_PI = 2.0 / math.pi
# pi/2 in two parts; the first has 33 bits, so that its product with a quadrant number is exact.
HALF_PI_HIGH = 1.57079632673412561417e00
HALF_PI_LOW = 6.07710050650619224932e-11
# Minimax coefficients on |r| <= pi/4 of FreeBSD's msun (k_sin.c, k_cos.c), error below 1.1 ulp.
SIN_3 = -1.66666666666666324348e-01
SIN_5 = 8.33333333332248946124e-03
SIN_7 = -1.98412698298579493134e-04
SIN_9 = 2.75573137070700676789e-06
SIN_11 = -2.50507602534068634195e-08
SIN_13 = 1.58969099521155010221e-10
COS_4 = 4.16666666666666019037e-02
COS_6 = -1.38888888888741095749e-03
COS_8 = 2.48015872894767294178e-05
COS_10 = -2.75573143513906633035e-07
COS_12 = 2.08757232129817482790e-09
COS_14 = -1.13596475577881948265e-11
# Added to a double below 2^51 in size and subtracted again, it rounds to the nearest integer.
TO_WHOLE = 6755399441055744.0  # 1.5 * 2^52
# Beyond this the two-part reduction loses digits and the library's own reduction is used.
REDUCTION_LIMIT = 1.0e5


@kernel
def sine_cosine(x: float) -> tuple[float, float]:
    """Return ``(sin x, cos x)`` for any finite ``x`` in radians."""
    if abs(x) > REDUCTION_LIMIT:
        return math.sin(x), math.cos(x)
    return reduced_sine_cosine(x)


@kernel
def reduced_sine_cosine(x: float) -> tuple[float, float]:
    """Return :func:`sine_cosine` of ``x`` up to ``REDUCTION_LIMIT`` in size."""
    quadrant, s, c = in_quadrant(x)
    # Each value is chosen without a branch, which could not be predicted.
    odd = has_bit(quadrant, 1)
    sine = c if odd else s
    cosine = s if odd else c
    turned = -sine if has_bit(quadrant, 2) else sine
    return turned, -cosine if has_bit(quadrant + 1.0, 2) else cosine


@kernel
def angle_sum(s: float, c: float, by_s: float, by_c: float) -> tuple[float, float]:
    """Return the sine and cosine of the sum of two angles, given theirs."""
    return s * by_c + c * by_s, c * by_c - s * by_s


@kernel
def angle_difference(s: float, c: float, from_s: float, from_c: float) -> tuple[float, float]:
    """Return the sine and cosine of the difference of two angles, given theirs."""
    return s * from_c - c * from_s, c * from_c + s * from_s


@kernel
def twice_angle(s: float, c: float) -> tuple[float, float]:
    """Return the sine and cosine of twice an angle, given its own."""
    return 2.0 * s * c, (c - s) * (c + s)


@kernel
def in_quadrant(x: float) -> tuple[float, float, float]:
    """Return the number of quarter turns nearest to ``x``; sine and cosine of the remainder."""
    # Rounded to the nearest quadrant without conversion to an integer, which would take longer.
    quadrant = (x * TWO_OVER_PI + TO_WHOLE) - TO_WHOLE
    r = (x - quadrant * HALF_PI_HIGH) - quadrant * HALF_PI_LOW
    z = r * r
    w = z * z
    # Terms in pairs, which a processor evaluates at the same time.
    odd = (SIN_3 + z * SIN_5) + w * ((SIN_7 + z * SIN_9) + w * (SIN_11 + z * SIN_13))
    even = (COS_4 + z * COS_6) + w * ((COS_8 + z * COS_10) + w * (COS_12 + z * COS_14))
    return quadrant, r + (r * z) * odd, (1.0 - 0.5 * z) + w * even


@kernel
def fill_angles(y: Sequence[float], x: Sequence[float], angles: list[float]) -> None:
    """Fill in the angles (rad, -pi to pi) of the vectors ``(x, y)``."""
    for number in range(len(angles)):
        angles[number] = math.atan2(y[number], x[number])


# Above this parameter the series run in the complementary nome (hyperbolic form).
PARAMETER_SPLIT = 0.8
# Below this root of the complement, products of it underflow and the flow rescales its formulas.
ROOT_COMPLEMENT_TINY = 1.0e-70
# Below this, a quarter period follows from its expansion at the separatrix.
ROOT_COMPLEMENT_SMALL = 1.0e-3
# Where two of Carlson's arguments sum to less than this share of the third, R_F is a logarithm to
# its last place.
LOGARITHM_LIMIT = 1.0e-18
# Below this, the hyperbolic sine follows from its power series, accurate to the last place.
SMALL_ARGUMENT = 0.35

TRIGONOMETRIC = 0
HYPERBOLIC = 1
HYPERBOLIC_TINY = 2  # hyperbolic, complement so small that its products would underflow


@kernel
def set_theta_constants(theta: ThetaConstants, m: float, complementary_modulus: float) -> None:
    """Fill ``theta`` for parameter ``m`` and complementary modulus ``sign(1 - m) sqrt|1 - m|``."""
    theta.parameter = m
    theta.complementary_modulus = complementary_modulus
    root = abs(complementary_modulus)
    rate = 1.0  # factor of the argument under the reciprocal-modulus transformation
    excess = 0.0  # rate - 1 without cancellation
    reduced = m
    theta.reciprocal = 0
    if complementary_modulus < 0.0:
        rate = math.sqrt(m)
        excess = root * root / (1.0 + rate)
        root = root / rate
        reduced = 1.0 / m
        theta.reciprocal = 1
    if reduced <= PARAMETER_SPLIT:
        nome = _direct_nome(reduced, root)
        theta.form = TRIGONOMETRIC
    else:
        nome = _complementary_nome(theta, reduced, root)
        theta.form = HYPERBOLIC if root > ROOT_COMPLEMENT_TINY else HYPERBOLIC_TINY
    _set_series(theta, nome, rate, excess)


@kernel
def set_libration(theta: ThetaConstants, m: float, complementary_modulus: float) -> None:
    """Fill ``theta`` for a parameter ``m`` up to ``PARAMETER_SPLIT``."""
    theta.parameter = m
    theta.complementary_modulus = complementary_modulus
    theta.reciprocal = 0
    theta.form = TRIGONOMETRIC
    _set_series(theta, _direct_nome(m, complementary_modulus), 1.0, 0.0)


@kernel
def _direct_nome(m: float, complementary_modulus: float) -> float:
    """Return the nome of ``m`` (DLMF 19.5.5 with ``lambda = (1 - sqrt k')/(2 (1 + sqrt k'))``)."""
    b = 1.0 + math.sqrt(complementary_modulus)
    small = 0.5 * m / ((1.0 + complementary_modulus) * b * b)
    x = small * small
    x = x * x
    x2 = x * x
    high = (15.0 + x * 150.0) + x2 * (1707.0 + x * 20910.0)
    return small * ((1.0 + x * 2.0) + x2 * high)


@kernel
def _complementary_nome(theta: ThetaConstants, m: float, complementary_modulus: float) -> float:
    """Return the complementary nome; set its root, and its logarithm in two doubles."""
    k = math.sqrt(m)
    root = complementary_modulus * math.sqrt(0.5 / (1.0 + k)) / (1.0 + math.sqrt(k))
    x = root * root
    x = x * x
    x = x * x
    root *= 1.0 + x * (1.0 + 7.0 * x)
    theta.root_nome = root
    if root > 0.0:
        h = -math.log(root)
        back = math.exp(-h)
        theta.half_period = 2.0 * h
        theta.half_period_low = -2.0 * (root - back) / back
    else:
        theta.half_period = 1.0e300
        theta.half_period_low = 0.0
    return root * root


@kernel
def _set_series(theta: ThetaConstants, nome: float, rate: float, excess: float) -> None:
    """Set the coefficients of the even and odd parts of the theta series, and the scales."""
    q = nome
    q2 = q * q
    q4 = q2 * q2
    q6 = q4 * q2
    q8 = q4 * q4
    q9 = q8 * q
    q10 = q8 * q2
    q12 = q6 * q6
    theta_3_less_1 = 2.0 * ((q + q4) + q9)
    theta_3 = 1.0 + theta_3_less_1
    theta_4 = 1.0 - 2.0 * (q - q4 + q9)
    theta_2 = 1.0 + q2 + q6 + q12  # of theta_2, without the factor 2 q^(1/4)
    theta.even_0 = 1.0 - 2.0 * q4
    theta.even_2 = q2
    theta.even_4 = q12
    theta.odd_1 = 1.0 - 3.0 * q8
    theta.odd_3 = q6
    theta.sum_0 = 1.0 - q2 - q6 + q12
    theta.sum_2 = q4 - q10
    theta.difference_1 = q - q4 * q - 2.0 * q10 * q
    theta.difference_3 = q9
    theta.two_nome = 2.0 * q
    inverse = 1.0 / theta_3
    if theta.form == TRIGONOMETRIC:
        theta.argument_scale = rate * inverse * inverse
        theta.sine_scale = theta_3 / (theta_2 * rate)
        theta.cosine_scale = theta_4 / theta_2
        theta.delta_scale = theta_4 * inverse
    else:
        theta.argument_scale = (
            (excess - theta_3_less_1 * (2.0 + theta_3_less_1)) * inverse * inverse
        )
        theta.sine_scale = theta_3 / (theta_4 * rate)
        theta.cosine_scale = theta_2 / theta_4
        theta.delta_scale = theta_2 * inverse


@kernel
def theta_functions(theta: ThetaConstants, u: float) -> tuple[float, float, float, float]:
    """Return ``(s D, c D, d D, D)``: the three functions at ``u`` over a common denominator."""
    if theta.form == TRIGONOMETRIC:
        s, c = sine_cosine(u * theta.argument_scale)
        return trigonometric_form(theta, s, c)
    s, c, d, common = _hyperbolic(theta, u)
    if theta.reciprocal == 1:
        return s, d, c, common
    return s, c, d, common


@kernel
def trigonometric_form(
    theta: ThetaConstants, s: float, c: float
) -> tuple[float, float, float, float]:
    """Return :func:`theta_functions` from the sine and cosine of ``u argument_scale``."""
    x = theta.two_nome - 2.0 * theta.two_nome * (s * s)
    x2 = x * x
    total = theta.sum_0 + x2 * theta.sum_2
    difference = x * (theta.difference_1 + x2 * theta.difference_3)
    even = theta.even_0 + x2 * (theta.even_2 + x2 * theta.even_4)
    odd = x * (theta.odd_1 + x2 * theta.odd_3)
    sine = (theta.sine_scale * s) * (total - difference)
    cosine = (theta.cosine_scale * c) * (total + difference)
    delta = theta.delta_scale * (even + odd)
    if theta.reciprocal == 1:
        return sine, delta, cosine, even - odd
    return sine, cosine, delta, even - odd


@kernel
def _hyperbolic(theta: ThetaConstants, u: float) -> tuple[float, float, float, float]:
    z = u + u * theta.argument_scale
    n = math.floor(z / theta.half_period + 0.5)
    r = (z - n * theta.half_period) - n * theta.half_period_low
    e = math.exp(-abs(r))
    e2 = e * e
    x1 = theta.root_nome / e if e > 0.0 else 0.0
    x2 = theta.root_nome * e
    x = x1 * x1 + x2 * x2
    square = x * x
    even = theta.even_0 + square * theta.even_2
    odd = x * (theta.odd_1 + square * theta.odd_3)
    total = theta.sum_0 + square * theta.sum_2
    difference = x * theta.difference_1
    distance = 1.0 - e2 if abs(r) > SMALL_ARGUMENT else 2.0 * e * _hyperbolic_sine(abs(r))
    s = theta.sine_scale * distance * (total - difference)
    c = theta.cosine_scale * (2.0 * e) * (even - odd)
    d = theta.delta_scale * (2.0 * e) * (even + odd)
    if r < 0.0:
        s = -s
    if n - 2.0 * math.floor(0.5 * n) != 0.0:
        s = -s
        c = -c
    return s, c, d, (1.0 + e2) * (total + difference)


@kernel
def _hyperbolic_sine(r: float) -> float:
    """Return the hyperbolic sine of r below ``SMALL_ARGUMENT``, by its power series."""
    z = r * r
    series = 1.0 + z * (1.0 / 42.0) * (1.0 + z * (1.0 / 72.0) * (1.0 + z * (1.0 / 110.0)))
    return r + r * z * (1.0 / 6.0) * (1.0 + z * (1.0 / 20.0) * series)


@kernel
def rf_near_logarithm(root_x: float, root_y: float, z: float) -> float:
    """Return Carlson's ``R_F(x, y, z)`` for x and y below 1e-18 z, given their square roots.

    It is ``ln(4 sqrt z/(sqrt x + sqrt y))/sqrt z`` (DLMF 19.27.2); x and y themselves may
    underflow.
    """
    root = math.sqrt(z)
    return math.log(4.0 * root / (root_x + root_y)) / root


@kernel
def quarter_period(m: float, complementary_modulus: float) -> float:
    """Return the argument from the bottom to the turning point (m < 1) or to the top (m > 1).

    It is K(m) for a libration, ``K(1/m)/sqrt m`` for a rotation and infinite on the separatrix.
    """
    root = abs(complementary_modulus)
    if root == 0.0:
        return math.inf
    size = 1.0 if complementary_modulus >= 0.0 else m
    if root >= ROOT_COMPLEMENT_SMALL:
        return carlson_rf(root * root, 0.0, size)
    scale = math.sqrt(size)
    relative = root / scale
    logarithm = math.log(4.0 / relative)
    # DLMF 19.12.1; the next term is below 1e-17.
    quarter = 0.25 * relative * relative
    return (
        logarithm + quarter * (logarithm - 1.0 + 2.25 * quarter * (logarithm - 7.0 / 6.0))
    ) / scale


@kernel
def carlson_rf(x: float, y: float, z: float) -> float:
    """Return Carlson's ``R_F(x, y, z)`` for non-negative arguments, at most one of them zero.

    Duplication until the spread is below 1e-2 is followed by the series to seventh order (DLMF
    19.36.1), whose eighth-order terms are below 1e-17: every duplication adds a rounding error, the
    series hardly any. Where x and y are so small that many duplications would be needed, the
    logarithm is exact. Two zero arguments give infinity.
    """
    if x + y <= 0.0 or y + z <= 0.0 or z + x <= 0.0:
        return math.inf
    if x + y < LOGARITHM_LIMIT * z:
        return rf_near_logarithm(math.sqrt(x), math.sqrt(y), z)
    a = (x + y + z) * (1.0 / 3.0)
    dx = a - x
    dy = a - y
    dz = a - z
    spread = max(abs(dx), abs(dy), abs(dz))
    factor = 1.0
    while spread >= 1.0e-2 * a * factor:
        sx = math.sqrt(x)
        sy = math.sqrt(y)
        sz = math.sqrt(z)
        shift = sx * (sy + sz) + sy * sz
        x = 0.25 * (x + shift)
        y = 0.25 * (y + shift)
        z = 0.25 * (z + shift)
        a = 0.25 * (a + shift)
        factor *= 4.0
    scale = 1.0 / (a * factor)
    dx *= scale
    dy *= scale
    dz *= scale
    e2 = dx * dy - dz * dz
    e3 = dx * dy * dz
    series = e2 * (
        -0.1 + e2 * (1.0 / 24.0 - e2 * (5.0 / 208.0)) - e3 * (3.0 / 44.0 - e2 * (1.0 / 16.0))
    ) + e3 * (1.0 / 14.0 + e3 * (3.0 / 104.0))
    root = 1.0 / math.sqrt(a)
    return root + root * series
