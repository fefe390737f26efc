"""Polynomials in rows of coefficients: their value, and their first root, never passed over."""

from __future__ import annotations

from collections.abc import Sequence

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.numerics.conservative_advancement import safe_step_second_order

NO_ROOT = -1.0
_EPSILON = 2.0**-52


@kernel
def value_of(row: Sequence[float], first: int, last: int, at: float) -> float:
    """Return ``row[first] + row[first + 1] t + ... + row[last] t^(last - first)`` (Horner)."""
    value = row[last]
    for k in range(last - 1, first - 1, -1):
        value = value * at + row[k]
    return value


@kernel
def slope_of(row: Sequence[float], first: int, last: int, at: float) -> float:
    """Return the derivative of :func:`value_of`."""
    slope = 0.0
    for k in range(last, first, -1):
        slope = slope * at + (k - first) * row[k]
    return slope


@kernel
def fall_bound(row: Sequence[float], first: int, last: int, end: float) -> float:
    """Return B with ``p'' >= -B`` on [0, end], from the sizes of the coefficients."""
    rest = 0.0
    for k in range(last, first + 2, -1):
        degree = k - first
        rest = (rest + degree * (degree - 1) * abs(row[k])) * end
    return rest - 2.0 * row[first + 2]


@kernel
def first_fall(row: Sequence[float], first: int, last: int, end: float) -> float:
    """Return the first t in [0, end] at which a polynomial falls to zero, or NO_ROOT.

    At the start it is positive, or the root is there. Steps are those of a parabola that lies
    below it throughout, so that none passes a root; they converge to a simple one quadratically.
    """
    bound = fall_bound(row, first, last, end)
    value = row[first]
    slope = row[first + 1]
    if value > 0.0 and value + min(slope, 0.0) * end - 0.5 * max(bound, 0.0) * end * end > 0.0:
        return NO_ROOT
    at = 0.0
    while value > 0.0:
        if bound > 0.0:
            step = safe_step_second_order(value, slope, bound)
        elif slope < 0.0:
            step = -value / slope
        else:
            return NO_ROOT
        if step <= 0.5 * _EPSILON * at:
            return at
        at += step
        if at > end:
            return NO_ROOT
        value = value_of(row, first, last, at)
        slope = slope_of(row, first, last, at)
    return at
