"""Numbers held in two doubles, some 31 digits: sums and products with their rounding errors.

Sources: Knuth (two-sum), Dekker 1971 (product); the sums are those of Hida, Li and Bailey 2001.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.numerics.error_free import product_error


@kernel
def pair_plus(high: float, low: float, more: float, more_low: float) -> tuple[float, float]:
    """Return the sum of two pairs."""
    total = high + more
    part = total - high
    rest = (high - (total - part)) + (more - part) + (low + more_low)
    result = total + rest
    return result, rest - (result - total)


@kernel
def pair_times(high: float, low: float, factor: float) -> tuple[float, float]:
    """Return a pair times a double; both must stay below 1e300 in size."""
    product = high * factor
    rest = product_error(high, factor, product) + low * factor
    result = product + rest
    return result, rest - (result - product)
