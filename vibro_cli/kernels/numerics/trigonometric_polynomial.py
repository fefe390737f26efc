"""Trigonometric polynomials of degree 2: first zeros, least values and greatest quotients.

``a + b cos x + c sin x + d cos 2x + e sin 2x``, on an interval that begins at ``x = 0``. Steps that
a bound on the second derivative proves never to pass a zero; they converge to one like Newton's.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.numerics.conservative_advancement import safe_step_second_order
from vibro_cli.kernels.numerics.elliptic import sine_cosine

Harmonics = tuple[float, float, float, float, float]

# A value below this share of the coefficients is zero up to rounding.
ROUNDING = 1.0e-14
# Least step (rad): where a function is stationary, less than rounding can tell.
LEAST_STEP = 1.0e-8
NOWHERE = -1.0
# A zero is polished by steps that are smaller than this (rad) from the first one on.
NEWTON_STEPS = 2
POLISHED = 1.0e-3


@kernel
def harmonic_value(h: Harmonics, sine: float, cosine: float) -> float:
    """Value where ``x`` has this sine and cosine."""
    a, b, c, d, e = h
    double = (cosine - sine) * (cosine + sine)
    return a + b * cosine + c * sine + d * double + e * (2.0 * sine * cosine)


@kernel
def harmonic_slope(h: Harmonics) -> Harmonics:
    """The derivative."""
    _, b, c, d, e = h
    return 0.0, c, -b, 2.0 * e, -2.0 * d


@kernel
def harmonic_size(h: Harmonics) -> float:
    """Bound on the size."""
    a, b, c, d, e = h
    return abs(a) + math.sqrt(b * b + c * c) + math.sqrt(d * d + e * e)


@kernel
def mirrored(h: Harmonics) -> Harmonics:
    """The same function of ``-x``."""
    a, b, c, d, e = h
    return a, b, -c, d, -e


@kernel
def turned(h: Harmonics, sine: float, cosine: float) -> Harmonics:
    """The same function of ``x + y``, where ``y`` has this sine and cosine."""
    a, b, c, d, e = h
    double = (cosine - sine) * (cosine + sine)
    twice = 2.0 * sine * cosine
    return (
        a,
        b * cosine + c * sine,
        c * cosine - b * sine,
        d * double + e * twice,
        e * double - d * twice,
    )


@kernel
def combined(g: Harmonics, weight: float, h: Harmonics) -> Harmonics:
    """A function and a multiple of another one."""
    ga, gb, gc, gd, ge = g
    a, b, c, d, e = h
    return (
        ga + weight * a,
        gb + weight * b,
        gc + weight * c,
        gd + weight * d,
        ge + weight * e,
    )


@kernel
def _step(h: Harmonics, slope: Harmonics, x: float) -> float:
    """Step from ``x`` up to which the function has no zero."""
    sine, cosine = sine_cosine(x)
    value = harmonic_value(h, sine, cosine)
    rate = harmonic_value(slope, sine, cosine)
    size = harmonic_size(h)
    if value < 0.0:
        value = -value
        rate = -rate
    return safe_step_second_order(value, rate, 4.0 * size)


@kernel
def first_fall(h: Harmonics, limit: float) -> float:
    """First place before ``limit`` (rad) where the function falls through zero, or ``NOWHERE``."""
    slope = harmonic_slope(h)
    size = harmonic_size(h)
    floor = ROUNDING * size
    if size == 0.0:
        return NOWHERE
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
    return NOWHERE


@kernel
def next_zero(h: Harmonics, start: float, limit: float) -> float:
    """First place (rad) from ``start`` to ``limit`` where the sign changes, polished; or infinity.

    Where the function is zero up to rounding it has the sign that it takes next.
    """
    sine, cosine = sine_cosine(start)
    slope = harmonic_slope(h)
    value = harmonic_value(h, sine, cosine)
    if abs(value) <= ROUNDING * harmonic_size(h):
        value = harmonic_value(slope, sine, cosine)
    ahead = turned(h, sine, cosine)
    if value < 0.0:
        a, b, c, d, e = ahead
        ahead = -a, -b, -c, -d, -e
    step = first_fall(ahead, limit - start)
    if step == NOWHERE:
        return math.inf
    x = start + step
    for _ in range(NEWTON_STEPS):
        sine, cosine = sine_cosine(x)
        rate = harmonic_value(slope, sine, cosine)
        change = harmonic_value(h, sine, cosine)
        if abs(change) >= POLISHED * abs(rate):
            # It hardly changes its sign: a double zero.
            return x
        x -= change / rate
    return x


@kernel
def least_value(h: Harmonics, limit: float) -> float:
    """Least value from 0 to ``limit`` (rad)."""
    slope = harmonic_slope(h)
    bend = harmonic_slope(slope)
    x = 0.0
    least = math.inf
    while x < limit:
        sine, cosine = sine_cosine(x)
        least = min(least, harmonic_value(h, sine, cosine))
        # From one place at which it is stationary to the next.
        x += max(_step(slope, bend, x), LEAST_STEP)
    sine, cosine = sine_cosine(limit)
    return min(least, harmonic_value(h, sine, cosine))


@kernel
def greatest_quotient(top: Harmonics, below: Harmonics, limit: float, known: float) -> float:
    """The greatest ``|top|/below`` from 0 to ``limit`` (rad), or ``known`` if that is greater.

    ``below`` must be positive there.
    """
    for turn in range(2):
        side = combined((0.0, 0.0, 0.0, 0.0, 0.0), 1.0 if turn == 0 else -1.0, top)
        known = _greatest_positive(side, below, limit, known)
    return known


@kernel
def _greatest_positive(top: Harmonics, below: Harmonics, limit: float, known: float) -> float:
    """As :func:`greatest_quotient`, of ``top/below``."""
    top_slope = harmonic_slope(top)
    below_slope = harmonic_slope(below)
    # Bound on the second derivative of top' below - top below', of degree 3.
    bound = 32.0 * harmonic_size(top) * harmonic_size(below)
    known = max(known, _quotient(top, below, 0.0), _quotient(top, below, limit))
    x = 0.0
    while x < limit:
        # Where the excess of what is known is positive, nothing is greater.
        excess = combined(combined((0.0, 0.0, 0.0, 0.0, 0.0), -1.0, top), known, below)
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
            # It grows beyond that: on to where it is greatest.
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
