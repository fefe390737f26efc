"""Steps that never pass the first root of a function whose derivatives are bounded."""

from __future__ import annotations

import math

from vibro_cli.numerics.engine import kernel


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
        ``B > 0``.
    """
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
