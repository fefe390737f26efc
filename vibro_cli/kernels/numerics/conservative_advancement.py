"""Steps that never pass the first root of a function with bounded derivatives; polynomials."""

from __future__ import annotations

import math
from collections.abc import Sequence

from vibro_cli.compile.kernel import kernel

# In place of a bound that is zero, so that divisions by it have a result.
LEAST_BOUND = 1.0e-200


@kernel
def safe_step_second_order(g: float, rate: float, bound: float) -> float:
    """Return the step up to which ``g + g' h - B h^2/2`` is positive, given ``g'' >= -B``.

    Parameters
    ----------
    g
        The function now, not negative.
    rate
        Its derivative now.
    bound
        ``B``, not negative. With ``B = 0`` a function that does not fall now never does: the step
        is longer than any run.
    """
    bound = max(bound, LEAST_BOUND)
    root = math.sqrt(rate * rate + 2.0 * bound * g)
    if rate < 0.0:
        return 2.0 * g / (root - rate)
    return (rate + root) / bound


@kernel
def safe_step_third_order(
    g: float, rate: float, second: float, bound_second: float, bound_third: float
) -> float:
    """Return a step that stays before the first root, given ``|g''| <= A`` and ``|g'''| <= B``.

    The cubic lower bound ``g + g' h + g'' h^2/2 - B h^3/6`` is made quadratic on a trial interval
    by ``h^3 <= H h^2``; its root is a valid step if it lies within the interval. Two trials.
    """
    bound_third = max(bound_third, LEAST_BOUND)
    step = safe_step_second_order(g, rate, bound_second)
    # Out of contact at rest (g = g' = 0 < g'') the first bound gives no step at all.
    trial = max(2.0 * step, second / bound_third)
    for _ in range(2):
        a = second - bound_third * trial * (1.0 / 3.0)
        discriminant = rate * rate - 2.0 * a * g
        found = trial
        if discriminant >= 0.0:
            root = math.sqrt(discriminant)
            x = trial
            if rate < 0.0:
                x = 2.0 * g / (root - rate)
            elif a < 0.0:
                x = (rate + root) / (-a)
            found = min(x, trial)
        step = max(step, found)
        trial = 1.5 * trial if found == trial else 1.02 * found
    return step


@kernel
def unresolved_step(second: float, bound_third: float, rounding: float) -> float:
    """Return a step over which a function falls by no more than its rounding.

    It does not fall now, ``g' >= 0``, and ``|g'''| <= B``: half the rounding is for ``g''``, if
    that is negative, half for ``B``.
    """
    step: float = (3.0 * rounding / max(bound_third, LEAST_BOUND)) ** (1.0 / 3.0)
    if second < 0.0:
        step = min(step, math.sqrt(rounding / -second))
    return step


@kernel
def safe_return(g: float, rate: float, level: float, frequency: float) -> float:
    """Return a step up to which ``g`` is positive, given ``g'' >= -w^2 (g + Y)``, ``Y > 0``.

    By Sturm's comparison ``g + Y`` stays above the oscillation of frequency ``w`` that starts like
    it; ``atan x >= 3 x/(1 + 2 sqrt(1 + x^2))`` (Shafer) bounds the time at which that is at ``Y``.

    Parameters
    ----------
    g
        The function now, not negative.
    rate
        Its derivative now.
    level, frequency
        ``Y`` and ``w``.
    """
    return safe_time(_rise(g, rate, level, frequency), frequency * (2.0 * level + g), frequency)


@kernel
def safe_time(over: float, under: float, frequency: float) -> float:
    """Lower bound of ``2 atan(over/under)/w``, for a rise of ``over >= 0``."""
    return 6.0 * over / (frequency * (under + 2.0 * math.sqrt(under * under + over * over)))


@kernel
def is_clear_before(time: float, slope: float, level: float, frequency: float) -> bool:
    """Tell whether ``g`` is positive for a time before a zero at which it falls.

    Seen backwards from the zero, where it rises, the bound of :func:`safe_return` holds; here it is
    compared without its root and quotient, and with 1 % in hand for the rounding of the zero.

    Parameters
    ----------
    time
        The time before the zero.
    slope
        ``-g'`` at the zero.
    level, frequency
        ``Y`` and ``w``, ``g'' >= -w^2 (g + Y)``.
    """
    return slope > 0.0 and is_clear_with(time, slope, level, frequency)


@kernel
def is_clear_with(time: float, slope: float, level: float, frequency: float) -> bool:
    """Do what :func:`is_clear_before` does for a slope that is positive."""
    over = 2.0 * slope
    under = frequency * (2.0 * level)
    # sqrt(u^2 + v^2) <= u + (sqrt 2 - 1) v for v <= u
    hypotenuse = max(over, under) + 0.4142135623730951 * min(over, under)
    return 0.99 * (6.0 * over) > time * (frequency * (under + 2.0 * hypotenuse))


@kernel
def first_return(g: float, rate: float, level: float, frequency: float) -> float:
    """Estimate the time after which ``g`` is zero, given ``g'' = -w^2 (g + Y)``.

    Parameters as for :func:`safe_return`; within 0.6 %, by a quotient in place of the arc tangent.
    """
    return time_of_rise(_rise(g, rate, level, frequency), frequency * (2.0 * level + g), frequency)


@kernel
def time_of_rise(over: float, under: float, frequency: float) -> float:
    """Estimate ``2 atan(over/under)/w``, for a rise of ``over >= 0``."""
    square = over * over
    both = over * under
    bottom = (square + 1.38404246 * both) + 1.40701764 * (under * under)
    return 2.0 * (1.56171565 * square + 1.39869396 * both) / (frequency * bottom)


@kernel
def _rise(g: float, rate: float, level: float, frequency: float) -> float:
    """Tangent of half the phase until the return, times ``w (2 Y + g)``."""
    if g == 0.0:
        return 2.0 * rate if rate > 0.0 else 0.0
    pull = frequency * frequency * (g * (g + 2.0 * level))
    root = math.sqrt(rate * rate + pull)
    if rate < 0.0:
        return pull / (root - rate)
    return rate + root


@kernel
def first_root_of_parabola(g: float, rate: float, second: float) -> float:
    """Return the first ``h >= 0`` at which ``g + g' h + g'' h^2/2`` falls through zero, or -1.

    ``g >= 0``; with ``g = 0`` the function must be falling to have its root now.
    """
    if g <= 0.0 and (rate < 0.0 or (rate == 0.0 and second < 0.0)):
        return 0.0
    if rate >= 0.0 and second >= 0.0:
        return -1.0
    discriminant = rate * rate - 2.0 * second * g
    if discriminant < 0.0:
        return -1.0
    root = math.sqrt(discriminant)
    if rate < 0.0:
        return 2.0 * g / (root - rate)
    return (rate + root) / (-second)


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
