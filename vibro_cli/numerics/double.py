"""Sums of doubles that keep their rounding error."""

from __future__ import annotations

from vibro_cli.numerics.engine import kernel


@kernel
def add_to_time(high: float, low: float, step: float) -> tuple[float, float]:
    """Add a step to a time held in two doubles (Knuth's two-sum).

    Parameters
    ----------
    high, low
        The time, s; ``high + low`` unevaluated.
    step
        What is added, s.

    Returns
    -------
    The new time as two doubles, s.
    """
    term = step + low
    total = high + term
    part = total - high
    return total, (high - (total - part)) + (term - part)


@kernel
def time_between(high: float, low: float, earlier_high: float, earlier_low: float) -> float:
    """Return the time from one instant to another, both held in two doubles, s."""
    return (high - earlier_high) + (low - earlier_low)
