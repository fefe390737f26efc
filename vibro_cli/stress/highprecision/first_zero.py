"""First zero of a polynomial on (0, 1], with coefficients in whole multiples of ``2^-BITS``.

An interval of midpoint m and half width h has no zero if ``p(m) > |p'(m)| h + B h^2/2``, with B a
bound of ``|p''|`` from the coefficients; else it is halved.
"""

from __future__ import annotations

from vibro_cli.stress.highprecision.motion import BITS, Series, Whole, value_of

# Terms below this share of the greatest are rounding where the polynomial must begin with a zero.
ROUNDING_BITS = 104
FINEST = 150  # halvings
SLOPPY = 1.0 + 1.0e-9  # for the doubles that the bounds are computed in


class Undecided(ArithmeticError):
    """What happens depends on digits beyond the working precision."""


def without_leading_zeros(series: Series, zero: float = 2.0**-ROUNDING_BITS) -> Series:
    """The polynomial divided by the power of its variable that it begins with.

    Empty if nothing of it is above rounding.
    """
    least = max(abs(value) for value in series) * zero
    for k, value in enumerate(series):
        if abs(value) > max(least, 2.0 ** (BITS - 140)):
            return series[k:]
    return []


def _derivative(series: Series) -> Series:
    return [k * value for k, value in enumerate(series)][1:]


def first_zero(series: Series, end: Whole) -> Whole | None:
    """Return where a polynomial that is positive at 0 first is not, None if nowhere up to ``end``.

    Raises
    ------
    Undecided
        If it is not positive at 0.
    """
    if series[0] <= 0:
        raise Undecided("a distance is not positive at the start of a step")
    slope = _derivative(series)
    second = SLOPPY * float(sum(k * abs(value) for k, value in enumerate(slope)))
    stack = [(0, end)]
    negative = None  # a place where it is negative
    while stack:
        low, high = stack.pop()
        if negative is not None and low >= negative:
            continue
        middle, half = (low + high) >> 1, float(high - low) / 2.0 ** (BITS + 1)
        value, rate = value_of(series, middle), value_of(slope, middle)
        if float(value) > SLOPPY * (abs(float(rate)) * half + 0.5 * second * half * half):
            continue
        if value <= 0:
            negative = middle
        if high - low < 1 << (BITS - FINEST):
            return middle
        if negative == middle and abs(float(rate)) > second * half and _is_positive(series, low):
            return _polished(series, slope, low, middle)
        stack += [(middle, high), (low, middle)]
    if negative is not None or value_of(series, end) > 0:
        return None if negative is None else negative
    return end


def _is_positive(series: Series, low: Whole) -> bool:
    return value_of(series, low) > 0


def _polished(series: Series, slope: Series, low: Whole, high: Whole) -> Whole:
    """The zero between a positive and a negative value, in steps of Newton that stay between."""
    u = high
    for _ in range(4 * BITS):
        value = value_of(series, u)
        if value > 0:
            low = u
        else:
            high = u
        rate = value_of(slope, u)
        following = u - ((value << BITS) // rate) if rate else low
        if not low < following < high:
            following = (low + high) >> 1
        if abs(following - u) <= 1 or high - low <= 1:
            return following
        u = following
    return u
