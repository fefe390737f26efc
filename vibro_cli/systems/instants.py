"""Instants at which the motion of a run is asked for: those that it has come to, and no others."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Instants = NDArray[np.float64]

# A time beyond the end by its rounding is the end.
ROUNDING = 1.0e-12


def within_run(times: Any, end: float, extrapolate: bool) -> Instants:
    """Return times (s) as an array, if a run that ended at a time (s) has come to all of them.

    Raises
    ------
    ValueError
        If one is before the start or after the end, unless they are to be extrapolated.
    """
    instants = np.atleast_1d(np.asarray(times, dtype=np.float64))
    outside = instants[~_reached(instants, end)]
    if extrapolate or not len(outside):
        return instants
    raise ValueError(
        f"t = {float(outside[0])!r} s is outside the run, expected a time from 0 to {end!r} s "
        "(extrapolate=True goes on with the first and last flights, as if nothing happened)"
    )


def _reached(instants: Instants, end: float) -> Any:
    return (instants >= 0.0) & (instants <= end * (1.0 + ROUNDING))


def asked_for(times: tuple[float, ...] | None, step: float | None, end: float) -> Instants | None:
    """Return the instants (s) of the motion table of a run that ended at a time (s).

    Those of a list that it has come to, or multiples of a step up to the end; None for neither.
    """
    if times is not None:
        listed: Instants = np.array(times, dtype=np.float64)
        reached: Instants = listed[_reached(listed, end)]
        return reached
    if step is None:
        return None
    return np.arange(steps_to(end, step), dtype=np.float64) * step


def steps_to(end: float, step: float) -> int:
    """Return how many multiples of a step there are from 0 to an end (s)."""
    return int(np.floor(end / step * (1.0 + ROUNDING))) + 1


def left_out(times: tuple[float, ...] | None, step: float | None, end: float) -> tuple[str, ...]:
    """Say which sampled motion there is not, and why."""
    if times is None and step is None:
        return ("sampled motion: not asked for (output.step or output.times)",)
    missing = len(times) - int(np.sum(_reached(np.array(times), end))) if times else 0
    if not missing:
        return ()
    return (f"sampled motion: {missing} of {len(times or ())} times after the end, t = {end!r} s",)
