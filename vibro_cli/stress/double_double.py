"""Arithmetic of numbers in two doubles, for the judge alone.

A number is ``high + low`` with ``|low| <= ulp(high)/2``. Every operation below has a relative error
of a few 2^-104 of its result, or of the larger operand for sums (Joldes, Muller and Popescu 2017);
the judge counts 2^-98 for each.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import fused, kernel

Wide = tuple[float, float]

# Terms of the series of sine and cosine.
_TERMS = 14
# pi/2 in three doubles.
_QUARTER_HIGH = 1.5707963267948966
_QUARTER_MIDDLE = 6.123233995736766e-17
_QUARTER_LOW = -1.4973849048591833e-33


@kernel
def quick_sum(a: float, b: float) -> Wide:
    """Exact sum of two doubles, ``|a| >= |b|``."""
    total = a + b
    return total, b - (total - a)


@kernel
def exact_sum(a: float, b: float) -> Wide:
    """Exact sum of two doubles (Knuth)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@kernel
def exact_product(a: float, b: float) -> Wide:
    """Exact product of two doubles."""
    product = a * b
    return product, fused(a, b, -product)


@kernel
def add(a: Wide, b: Wide) -> Wide:
    """Sum of two wide numbers."""
    high, low = exact_sum(a[0], b[0])
    more, least = exact_sum(a[1], b[1])
    high, low = quick_sum(high, low + more)
    return quick_sum(high, low + least)


@kernel
def negative(a: Wide) -> Wide:
    """The negative of a wide number."""
    return -a[0], -a[1]


@kernel
def multiply(a: Wide, b: Wide) -> Wide:
    """Product of two wide numbers."""
    high, low = exact_product(a[0], b[0])
    return quick_sum(high, low + (a[0] * b[1] + a[1] * b[0]))


@kernel
def scale(a: Wide, b: float) -> Wide:
    """Product of a wide number and a double."""
    high, low = exact_product(a[0], b)
    return quick_sum(high, low + a[1] * b)


@kernel
def divide(a: Wide, b: Wide) -> Wide:
    """Quotient of two wide numbers, by three steps of long division."""
    first = a[0] / b[0]
    rest = add(a, negative(scale(b, first)))
    second = rest[0] / b[0]
    rest = add(rest, negative(scale(b, second)))
    third = rest[0] / b[0]
    return add(quick_sum(first, second), (third, 0.0))


@kernel
def square_root(a: Wide) -> Wide:
    """Square root of a positive wide number, by two steps of Newton's iteration."""
    root = (a[0] ** 0.5, 0.0)
    for _ in range(2):
        rest = add(a, negative(multiply(root, root)))
        root = add(root, scale(divide(rest, root), 0.5))
    return root


@kernel
def sine_cosine(a: Wide) -> tuple[Wide, Wide]:
    """Sine and cosine, absolute error below 1e-28 for ``|a| < 1e3``."""
    quarters = float(round(a[0] / _QUARTER_HIGH))
    small = add(a, exact_product(-quarters, _QUARTER_HIGH))
    small = add(small, exact_product(-quarters, _QUARTER_MIDDLE))
    small = add(small, exact_product(-quarters, _QUARTER_LOW))
    square = negative(multiply(small, small))
    sine, less = (0.0, 0.0), (0.0, 0.0)
    for k in range(_TERMS, 0, -1):
        sine = divide(multiply(add((1.0, 0.0), sine), square), (2.0 * k * (2.0 * k + 1.0), 0.0))
        less = divide(multiply(add((1.0, 0.0), less), square), (2.0 * k * (2.0 * k - 1.0), 0.0))
    sine = multiply(small, add((1.0, 0.0), sine))
    cosine = add((1.0, 0.0), less)
    turned = int(quarters) % 4
    if turned == 1:
        sine, cosine = cosine, negative(sine)
    elif turned == 2:
        sine, cosine = negative(sine), negative(cosine)
    elif turned == 3:
        sine, cosine = negative(cosine), sine
    return sine, cosine
