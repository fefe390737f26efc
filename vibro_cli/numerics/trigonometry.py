"""Sine and cosine of one argument together, the same bits in both engines."""

from __future__ import annotations

import math

from vibro_cli.numerics.engine import kernel

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
# Beyond this the two-part reduction loses digits and the library's own reduction is used.
REDUCTION_LIMIT = 1.0e5


@kernel
def sine_cosine(x: float) -> tuple[float, float]:
    """Return ``(sin x, cos x)`` for any finite ``x`` in radians."""
    if abs(x) > REDUCTION_LIMIT:
        return math.sin(x), math.cos(x)
    quadrant = math.floor(x * TWO_OVER_PI + 0.5)
    r = (x - quadrant * HALF_PI_HIGH) - quadrant * HALF_PI_LOW
    z = r * r
    s = r + r * z * (SIN_3 + z * (SIN_5 + z * (SIN_7 + z * (SIN_9 + z * (SIN_11 + z * SIN_13)))))
    c = (
        1.0
        - 0.5 * z
        + z * z * (COS_4 + z * (COS_6 + z * (COS_8 + z * (COS_10 + z * (COS_12 + z * COS_14)))))
    )
    turn = int(quadrant) & 3
    if turn == 0:
        return s, c
    if turn == 1:
        return c, -s
    if turn == 2:
        return -s, -c
    return -c, s
