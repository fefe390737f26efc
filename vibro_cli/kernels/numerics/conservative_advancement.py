"""Steps that never pass the first root of a function with bounded derivatives; polynomials.

Trigonometric polynomials are of degree 2, ``a + b cos x + c sin x + d cos 2x + e sin 2x``, on an
interval that begins at ``x = 0``. Steps to a simple root converge like Newton's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.kernels.numerics.elliptic import sine_cosine, twice_angle

# Replaces a bound of zero, which would be a divisor.
LEAST_BOUND = 1.0e-200
NO_ROOT = -1.0


@kernel
def safe_step_second_order(g: float, rate: float, bound: float) -> float:
    """Return the step up to which ``g + g' h - B h^2/2`` is positive, given ``g'' >= -B``.

    ``g`` and the bound B are not negative. With ``B = 0`` a function that does not fall now never
    does: the step is longer than any run.
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
    by ``h^3 <= H h^2``; its root is a valid step if it lies within the interval. There are two
    trials.
    """
    bound_third = max(bound_third, LEAST_BOUND)
    step = safe_step_second_order(g, rate, bound_second)
    # Leaving contact from rest (g = g' = 0 < g''), the first bound gives no step at all.
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

    The function must not fall now, ``g' >= 0``, and ``|g'''| <= B``. Half the rounding is allowed
    for ``g''``, if that is negative, and half for ``B``.
    """
    step: float = math.pow(3.0 * rounding / max(bound_third, LEAST_BOUND), 1.0 / 3.0)
    if second < 0.0:
        step = min(step, math.sqrt(rounding / -second))
    return step


@kernel
def safe_return(g: float, rate: float, level: float, frequency: float) -> float:
    """Return a step up to which ``g >= 0`` is positive, given ``g'' >= -w^2 (g + Y)``, ``Y > 0``.

    By Sturm's comparison ``g + Y`` stays above the oscillation of frequency ``w`` with the same
    initial state. ``atan x >= 3 x/(1 + 2 sqrt(1 + x^2))`` (Shafer) bounds the time at which that
    reaches the ``level`` Y.
    """
    return safe_time(_rise(g, rate, level, frequency), frequency * (2.0 * level + g), frequency)


@kernel
def safe_time(over: float, under: float, frequency: float) -> float:
    """Return a lower bound of ``2 atan(over/under)/w``, for a rise of ``over >= 0``."""
    return 6.0 * over / (frequency * (under + 2.0 * math.sqrt(under * under + over * over)))


@kernel
def is_clear_before(time: float, slope: float, level: float, frequency: float) -> bool:
    """Return whether ``g`` is positive for a time before a zero at which it falls with ``-slope``.

    Backwards from the zero ``g`` rises, and the bound of :func:`safe_return` holds. It is compared
    here without its root and quotient, with a margin of 1 % for the rounding of the zero.
    """
    over = 2.0 * slope
    under = frequency * (2.0 * level)
    # sqrt(u^2 + v^2) <= u + (sqrt 2 - 1) v for v <= u
    hypotenuse = max(over, under) + 0.4142135623730951 * min(over, under)
    bound = time * (frequency * (under + 2.0 * hypotenuse))
    return slope > 0.0 and 0.99 * (6.0 * over) > bound


@kernel
def first_return(g: float, rate: float, level: float, frequency: float) -> float:
    """Estimate the time after which ``g`` is zero, given ``g'' = -w^2 (g + Y)``.

    Parameters as for :func:`safe_return`. The error is at most 0.6 %, since a quotient replaces the
    arc tangent.
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
    """Return the tangent of half the phase until the return, times ``w (2 Y + g)``."""
    if g == 0.0:
        return 2.0 * rate if rate > 0.0 else 0.0
    pull = frequency * frequency * (g * (g + 2.0 * level))
    root = math.sqrt(rate * rate + pull)
    if rate < 0.0:
        return pull / (root - rate)
    return rate + root


@kernel
def first_root_of_parabola(g: float, rate: float, second: float) -> float:
    """Return the first ``h >= 0`` at which ``g + g' h + g'' h^2/2`` falls through zero, or NO_ROOT.

    ``g >= 0``; with ``g = 0`` the function must be falling to have its root now.
    """
    if g <= 0.0 and (rate < 0.0 or (rate == 0.0 and second < 0.0)):
        return 0.0
    if rate >= 0.0 and second >= 0.0:
        return NO_ROOT
    if second == 0.0:
        return g / -rate  # without the square of a slow rate, which may be zero
    discriminant = rate * rate - 2.0 * second * g
    if discriminant < 0.0:
        return NO_ROOT
    root = math.sqrt(discriminant)
    if rate < 0.0:
        return 2.0 * g / (root - rate)
    return (rate + root) / (-second)


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
def curvature_bound(row: Sequence[float], first: int, last: int, end: float) -> float:
    """Return B with ``p'' >= -B`` on [0, end], from the sizes of the coefficients."""
    rest = 0.0
    for k in range(last, first + 2, -1):
        degree = k - first
        rest = (rest + degree * (degree - 1) * abs(row[k])) * end
    return rest - 2.0 * row[first + 2]


@kernel
def first_zero_crossing(row: Sequence[float], first: int, last: int, end: float) -> float:
    """Return the first t in [0, end] at which a polynomial falls to zero, or NO_ROOT.

    If it is not positive at the start, the root is there. Each step ends at the root of a parabola
    that lies below the polynomial throughout, so that none passes a root. The steps converge
    quadratically to a simple root.
    """
    bound = curvature_bound(row, first, last, end)
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
        if step <= 0.5 * EPSILON * at:
            return at
        at += step
        if at > end:
            return NO_ROOT
        value = value_of(row, first, last, at)
        slope = slope_of(row, first, last, at)
    return at


Harmonics = tuple[float, float, float, float, float]

# A value below this share of the coefficients is zero up to rounding.
ROUNDING = 1.0e-14
# Least step (rad), below what rounding resolves where a function is stationary.
LEAST_STEP = 1.0e-8
# A zero is polished by this many of Newton's steps, each smaller than POLISHED (rad).
NEWTON_STEPS = 2
POLISHED = 1.0e-3


@kernel
def harmonic_value(h: Harmonics, sine: float, cosine: float) -> float:
    """Return the value at the ``x`` that has this sine and cosine."""
    a, b, c, d, e = h
    twice, double = twice_angle(sine, cosine)
    return a + b * cosine + c * sine + d * double + e * twice


@kernel
def harmonic_slope(h: Harmonics) -> Harmonics:
    """Return the derivative of a function."""
    _, b, c, d, e = h
    return 0.0, c, -b, 2.0 * e, -2.0 * d


@kernel
def harmonic_size(h: Harmonics) -> float:
    """Return a bound on the absolute value of a function."""
    a, b, c, d, e = h
    return abs(a) + math.sqrt(b * b + c * c) + math.sqrt(d * d + e * e)


@kernel
def mirrored(h: Harmonics) -> Harmonics:
    """Return the same function of ``-x``."""
    a, b, c, d, e = h
    return a, b, -c, d, -e


@kernel
def turned(h: Harmonics, sine: float, cosine: float) -> Harmonics:
    """Return the same function of ``x + y``, where ``y`` has this sine and cosine."""
    a, b, c, d, e = h
    twice, double = twice_angle(sine, cosine)
    return (
        a,
        b * cosine + c * sine,
        c * cosine - b * sine,
        d * double + e * twice,
        e * double - d * twice,
    )


@kernel
def scaled(weight: float, h: Harmonics) -> Harmonics:
    """Return a multiple of a function."""
    a, b, c, d, e = h
    return weight * a, weight * b, weight * c, weight * d, weight * e


@kernel
def combined(g: Harmonics, weight: float, h: Harmonics) -> Harmonics:
    """Return the sum of a function and a multiple of another one."""
    ga, gb, gc, gd, ge = g
    a, b, c, d, e = h
    return ga + weight * a, gb + weight * b, gc + weight * c, gd + weight * d, ge + weight * e


@kernel
def first_zero_crossing_of_harmonics(h: Harmonics, limit: float) -> float:
    """Return the first ``x`` before ``limit`` (rad) where ``h`` falls through 0, or ``NO_ROOT``."""
    slope = harmonic_slope(h)
    size = harmonic_size(h)
    floor = ROUNDING * size
    if size == 0.0:
        return NO_ROOT
    x = 0.0
    while x < limit:
        sine, cosine = sine_cosine(x)
        value = harmonic_value(h, sine, cosine)
        rate = harmonic_value(slope, sine, cosine)
        if value <= floor:
            if rate < 0.0:
                return x
            value = floor
        x += safe_step_second_order(value, rate, 4.0 * size)
    return NO_ROOT


@kernel
def next_zero(h: Harmonics, start: float, limit: float) -> float:
    """Return the first ``x`` (rad) from ``start`` to ``limit`` where the sign changes, or infinity.

    The zero is polished. Where the function starts at zero, up to rounding, it has the sign that it
    takes next.
    """
    sine, cosine = sine_cosine(start)
    slope = harmonic_slope(h)
    value = harmonic_value(h, sine, cosine)
    if abs(value) <= ROUNDING * harmonic_size(h):
        value = harmonic_value(slope, sine, cosine)
    ahead = turned(h, sine, cosine)
    if value < 0.0:
        ahead = scaled(-1.0, ahead)
    step = first_zero_crossing_of_harmonics(ahead, limit - start)
    if step == NO_ROOT:
        return math.inf
    x = start + step
    for _ in range(NEWTON_STEPS):
        sine, cosine = sine_cosine(x)
        rate = harmonic_value(slope, sine, cosine)
        change = harmonic_value(h, sine, cosine)
        if abs(change) >= POLISHED * abs(rate):
            # Nearly a double zero: Newton's steps are unreliable.
            return x
        x -= change / rate
    return x


@kernel
def least_value(h: Harmonics, limit: float) -> float:
    """Return the least value of a function from 0 to ``limit`` (rad)."""
    slope = harmonic_slope(h)
    bend = harmonic_slope(slope)
    size = harmonic_size(slope)
    x = 0.0
    least = math.inf
    while x < limit:
        sine, cosine = sine_cosine(x)
        least = min(least, harmonic_value(h, sine, cosine))
        # From one stationary point to the next.
        rate = harmonic_value(slope, sine, cosine)
        change = harmonic_value(bend, sine, cosine)
        step = safe_step_second_order(abs(rate), change if rate >= 0.0 else -change, 4.0 * size)
        x += max(step, LEAST_STEP)
    sine, cosine = sine_cosine(limit)
    return min(least, harmonic_value(h, sine, cosine))


@kernel
def greatest_quotient(
    top: Harmonics, below: Harmonics, low: float, high: float, known: float
) -> float:
    """Return the greatest ``|top|/below`` between two angles (rad), or ``known`` if greater.

    ``below`` must be positive there.
    """
    sine, cosine = sine_cosine(low)
    below = turned(below, sine, cosine)
    for side in range(2):
        one = scaled(1.0 if side == 0 else -1.0, turned(top, sine, cosine))
        known = _greatest_positive(one, below, high - low, known)
    return known


@kernel
def _greatest_positive(top: Harmonics, below: Harmonics, limit: float, known: float) -> float:
    """Return the greatest ``top/below`` from 0 to ``limit`` (rad), or ``known`` if greater."""
    top_slope = harmonic_slope(top)
    below_slope = harmonic_slope(below)
    # Bound on the second derivative of top' below - top below', of degree 3.
    bound = 32.0 * harmonic_size(top) * harmonic_size(below)
    known = max(known, _quotient(top, below, 0.0), _quotient(top, below, limit))
    x = 0.0
    while x < limit:
        # Where this excess is positive, the quotient is below ``known``.
        excess = combined(scaled(-1.0, top), known, below)
        sine, cosine = sine_cosine(x)
        spare = harmonic_value(excess, sine, cosine)
        n = harmonic_value(below, sine, cosine)
        n_rate = harmonic_value(below_slope, sine, cosine)
        f = harmonic_value(top, sine, cosine)
        f_rate = harmonic_value(top_slope, sine, cosine)
        growth = f_rate * n - f * n_rate
        if spare > ROUNDING * harmonic_size(excess) or growth <= 0.0:
            rate = known * n_rate - f_rate
            step = safe_step_second_order(max(spare, 0.0), rate, 4.0 * harmonic_size(excess))
            x += max(step, LEAST_STEP)
        else:
            # It rises above ``known``: on to its maximum.
            f_bend = harmonic_value(harmonic_slope(top_slope), sine, cosine)
            n_bend = harmonic_value(harmonic_slope(below_slope), sine, cosine)
            rate = f_bend * n - f * n_bend
            x += max(safe_step_second_order(growth, rate, bound), LEAST_STEP)
            known = max(known, _quotient(top, below, min(x, limit)))
    return known


@kernel
def _quotient(top: Harmonics, below: Harmonics, x: float) -> float:
    sine, cosine = sine_cosine(x)
    return harmonic_value(top, sine, cosine) / harmonic_value(below, sine, cosine)
