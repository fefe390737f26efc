"""Jacobi's elliptic functions, each value to a few units in its last place.

Near a zero only the distance of the argument from that zero counts, so the quarter period must be
known to more digits than a double has. It is computed to 80 digits by Gauss's arithmetic-geometric
mean (DLMF 19.8.5). The argument is reduced by multiples of it to at most half of it in magnitude,
where ``kernels.numerics.elliptic`` computes all three functions to a few units. A flight does
without this reduction: its argument is the rounded product of a frequency and a time, so the zeros
are known no better than to its last place.
"""

from __future__ import annotations

import math
from decimal import Context, Decimal

from vibro_cli.kernels.numerics.elliptic import ThetaConstants, set_theta_constants, theta_functions

EXACT = Context(prec=80)
HALF_PI = Decimal(
    "1.57079632679489661923132169163975144209858469968755291048747229615390820314310449931402"
)
# Means whose relative difference is below this one differ by about its square after one more step.
ALIKE = Decimal("1e-41")


class Jacobi:
    """The solution of ``s' = c d, c' = -s d, d' = -m s c`` from ``(0, 1, 1)``.

    For ``m <= 1`` these are sn, cn, dn of parameter ``m``, for ``m > 1`` their continuation.

    Parameters
    ----------
    complementary_modulus
        ``sign(1 - m) sqrt|1 - m|``, at most 1: near ``m = 1`` it keeps digits that ``m`` loses.

    Raises
    ------
    ValueError
        If ``m`` would be negative or too large.
    """

    def __init__(self, complementary_modulus: float) -> None:
        if not -1.0e150 <= complementary_modulus <= 1.0:
            raise ValueError(
                f"complementary_modulus must be in -1e150 ... 1, not {complementary_modulus!r}"
            )
        m = 1.0 - complementary_modulus * abs(complementary_modulus)
        self._theta = ThetaConstants()
        set_theta_constants(self._theta, m, complementary_modulus)
        self._root = abs(complementary_modulus)
        self._over = complementary_modulus < 0.0
        self._modulus = math.sqrt(m) if self._over else 1.0
        self.quarter_period = _quarter_period(complementary_modulus)
        """K(m), for ``m > 1`` K(1/m)/sqrt m, where |s| is greatest and c (for ``m > 1`` d) is 0.
        Infinite for ``m = 1``."""

    def functions(self, u: float) -> tuple[float, float, float]:
        """Return ``(s, c, d)`` at any ``u`` with ``|u| < 1e60``."""
        quarters, v = self._reduced(u)
        s, c, d, common = theta_functions(self._theta, v)
        changing, lasting = (d, c) if self._over else (c, d)
        if quarters % 2 == 1:
            # DLMF 22.4.3: a quarter period further they are cd, -k' sd, k' nd.
            root = self._root
            s, changing, lasting, common = (
                changing / self._modulus, -root * s, root / self._modulus * common, lasting,
            )  # fmt: skip
        if quarters % 4 >= 2:
            s, changing = -s, -changing
        c, d = (lasting, changing) if self._over else (changing, lasting)
        return s / common, c / common, d / common

    def _reduced(self, u: float) -> tuple[int, float]:
        """Return the number of quarter periods nearest to ``u``, and the accurate remainder."""
        if self.quarter_period.is_infinite():
            return 0, u
        exact = Decimal(u)
        quarters = EXACT.divide(exact, self.quarter_period).to_integral_value()
        return int(quarters), float(EXACT.fma(quarters.copy_negate(), self.quarter_period, exact))


def _quarter_period(complementary_modulus: float) -> Decimal:
    """Return ``pi/2`` over the mean of 1 (``sqrt m`` for ``m > 1``) and ``sqrt|1 - m|``."""
    a, b = Decimal(1), Decimal(abs(complementary_modulus))
    if b == 0:
        return Decimal("inf")
    if complementary_modulus < 0.0:
        a = EXACT.sqrt(EXACT.fma(b, b, a))
    while abs(EXACT.subtract(a, b)) > ALIKE * a:
        product = EXACT.multiply(a, b)
        a, b = EXACT.multiply(EXACT.add(a, b), Decimal("0.5")), EXACT.sqrt(product)
    return EXACT.divide(HALF_PI, EXACT.multiply(EXACT.add(a, b), Decimal("0.5")))
