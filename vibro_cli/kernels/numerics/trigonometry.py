"""Sine and cosine of one argument together, the same bits in both engines."""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.compile.lanes import Lanes, choose, has_bit

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
# Added to a double of less than 2^51 in size and subtracted again, it leaves the nearest integer.
TO_WHOLE = 6755399441055744.0  # 1.5 * 2^52
# Beyond this the two-part reduction loses digits and the library's own reduction is used.
REDUCTION_LIMIT = 1.0e5


@kernel
def sine_cosine(x: float) -> tuple[float, float]:
    """Return ``(sin x, cos x)`` for any finite ``x`` in radians."""
    if abs(x) > REDUCTION_LIMIT:
        return math.sin(x), math.cos(x)
    quadrant, s, c = in_quadrant(x)
    turn = int(quadrant) & 3
    # Two choices of two values each, which need no jump: quadrants come in no order.
    sine = c if turn & 1 else s
    cosine = s if turn & 1 else c
    return -sine if turn & 2 else sine, -cosine if (turn + 1) & 2 else cosine


@kernel
def sine_cosine_in_lanes(x: Lanes) -> tuple[Lanes, Lanes]:
    """Do what :func:`sine_cosine` does for ``x`` up to ``REDUCTION_LIMIT`` in size, in lanes."""
    quadrant, s, c = in_quadrant(x)
    odd = has_bit(quadrant, 1)
    sine = choose(odd, c, s)
    cosine = choose(odd, s, c)
    turned = choose(has_bit(quadrant, 2), -sine, sine)
    return turned, choose(has_bit(quadrant + 1.0, 2), -cosine, cosine)


@kernel
def in_quadrant(x: float) -> tuple[float, float, float]:
    """Return the number of the quadrant nearest to ``x``, and sine and cosine from there."""
    # To the nearest quadrant, without a way through an integer: its place is used at once.
    quadrant = (x * TWO_OVER_PI + TO_WHOLE) - TO_WHOLE
    r = (x - quadrant * HALF_PI_HIGH) - quadrant * HALF_PI_LOW
    z = r * r
    w = z * z
    # Terms in pairs: a processor works on them at the same time.
    odd = (SIN_3 + z * SIN_5) + w * ((SIN_7 + z * SIN_9) + w * (SIN_11 + z * SIN_13))
    even = (COS_4 + z * COS_6) + w * ((COS_8 + z * COS_10) + w * (COS_12 + z * COS_14))
    return quadrant, r + (r * z) * odd, (1.0 - 0.5 * z) + w * even
