"""Sums and products of doubles that keep their rounding errors; numbers held in two doubles.

Sources: Knuth (two-sum), Dekker 1971 (product); the sums are those of Hida, Li and Bailey 2001.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel

SPLITTER = 134217729.0  # 2^27 + 1: splits the 53 bits of a double in two halves


@kernel
def add_to_time(high: float, low: float, step: float) -> tuple[float, float]:
    """Add a step to a time (s) in two doubles, ``high + low`` unevaluated (Knuth's two-sum)."""
    term = step + low
    total = high + term
    part = total - high
    return total, (high - (total - part)) + (term - part)


@kernel
def time_between(high: float, low: float, earlier_high: float, earlier_low: float) -> float:
    """Return the time from one instant to another, both held in two doubles, s."""
    return (high - earlier_high) + (low - earlier_low)


@kernel
def difference_of_products(a: float, b: float, c: float, d: float) -> float:
    """Return ``a b - c d`` to about one rounding, even where the products cancel.

    Both products are formed with their rounding errors (Dekker 1971, Veltkamp's split). The factors
    must stay below 1e300 in size.
    """
    first = a * b
    second = c * d
    return (first - second) + (product_error(a, b, first) - product_error(c, d, second))


@kernel
def sum_of_products(a: float, b: float, c: float, d: float) -> tuple[float, float]:
    """Return ``a b + c d`` in two doubles."""
    first = a * b
    second = c * d
    return dd_add(first, product_error(a, b, first), second, product_error(c, d, second))


@kernel
def product_error(a: float, b: float, product: float) -> float:
    """Return ``a b - product`` exactly, for the rounded product."""
    shifted_a = SPLITTER * a
    a_high = shifted_a - (shifted_a - a)
    a_low = a - a_high
    shifted_b = SPLITTER * b
    b_high = shifted_b - (shifted_b - b)
    b_low = b - b_high
    return ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


@kernel
def dd_add(high: float, low: float, more: float, more_low: float) -> tuple[float, float]:
    """Return the sum of two numbers that are each held in two doubles."""
    total = high + more
    part = total - high
    rest = (high - (total - part)) + (more - part) + (low + more_low)
    result = total + rest
    return result, rest - (result - total)


@kernel
def dd_multiply(high: float, low: float, factor: float) -> tuple[float, float]:
    """Return a number in two doubles times a double; both must stay below 1e300 in size."""
    product = high * factor
    rest = product_error(high, factor, product) + low * factor
    result = product + rest
    return result, rest - (result - product)
