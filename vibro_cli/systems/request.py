"""What a run is asked for, whatever the system: where it stops and what is computed.

Motion is asked for at instants that the run has come to, and at no others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Instants = NDArray[np.float64]

UNLIMITED = 2**62
"""The count of a stop that is not set."""

EARLY_ENDS = {
    "end_of_trace": "came to an end of the trace",
    "lift_off": "left the trace",
    "wall_contact": "came to roll along the wall",
    "accumulation": "ended where impacts accumulate",
}
"""What runs did that ended for good without an inadmissible impact, in words."""
FINAL = ("inadmissible", *EARLY_ENDS)
"""Ends after which nothing can follow, whatever the stop."""

CHANGEABLE = ("stop", "output")
"""Sections of a scenario that may be others when a run goes on."""

# A time beyond the end by its rounding is the end.
ROUNDING = 1.0e-12


def within_run(times: Any, end: float, extrapolate: bool) -> Instants:
    """Return times (s) as an array, if a run that ended at a time (s) has come to all of them.

    Raises `ValueError` if one is before the start or after the end, or not finite if they are to be
    extrapolated; for an array of several dimensions, or of what are no real numbers.
    """
    given = np.asarray(times)
    if np.ma.is_masked(times):
        raise ValueError("times: found a masked value, expected numbers (s)")
    if given.dtype.kind in "bcSUmM":
        raise ValueError(f"times: found {given.dtype}, expected numbers (s)")
    try:
        instants = np.atleast_1d(given.astype(np.float64))
    except (OverflowError, TypeError, ValueError):
        raise ValueError(f"times: found {times!r:.60}, expected numbers (s)") from None
    if instants.ndim > 1:
        raise ValueError(f"times: found an array of shape {instants.shape}, expected shape (n,)")
    outside = instants[~(np.isfinite(instants) if extrapolate else _reached(instants, end))]
    if not len(outside):
        return instants
    found = f"t = {float(outside[0])!r} s is outside the run, expected a"
    if extrapolate:
        raise ValueError(f"{found} finite time")
    raise ValueError(
        f"{found} time from 0 to {end!r} s "
        "(extrapolate=True goes on with the first and last flights, as if nothing happened)"
    )


def _reached(instants: Instants, end: float) -> Any:
    return (instants >= 0.0) & (instants <= end * (1.0 + ROUNDING))


# Instants of which the motion is made together.
_AT_ONCE = 1 << 14


@dataclass(frozen=True)
class Limits:
    """Where a run stops: whichever comes first."""

    time: float | None = None
    """s."""
    collisions: int | None = None
    """Impacts of two bodies."""
    bounces: int | None = None
    """Impacts on the wall of a table."""


NO_LIMITS = Limits()


@dataclass(frozen=True)
class OutputRequest:
    """What is to be computed beside the impacts."""

    times: tuple[float, ...] | None = None
    """Instants of the motion table (s)."""
    step: float | None = None
    """Or its step (s), to the end of the run."""
    turning_points: bool = False
    friction: float | None = None
    """Coefficient of friction of a trace; slip events where rolling needs more."""
    lyapunov: bool = False
    """The growth of small changes of the start, see ``systems.tangents``."""
    figures: bool = False
    """The motion as figures need it, of a system that takes long to solve."""

    @property
    def motion(self) -> bool:
        """Whether sampled motion is wanted."""
        return self.times is not None or self.step is not None

    def left_out(self, end: float) -> tuple[str, ...]:
        """Say which sampled motion there is not of a run with this end (s), and why."""
        if not self.motion:
            return ("sampled motion: not asked for (output.step or output.times)",)
        asked = len(self.times or ())
        missing = asked - int(np.sum(_reached(np.array(self.times), end))) if asked else 0
        if not missing:
            return ()
        return (f"sampled motion: {missing} of {asked} times after the end, t = {end!r} s",)


NOTHING_MORE = OutputRequest()


class Sampling:
    """The instants of the motion table, ascending or by their step, as a run comes to them."""

    def __init__(self, wanted: OutputRequest) -> None:
        self._times = None if wanted.times is None else np.array(wanted.times, dtype=np.float64)
        self._step = wanted.step
        self._told = 0

    def until(self, end: float, ended: bool) -> Iterator[Instants]:
        """Yield the next instants before the end (s) of a stretch, not many in each array.

        When the run has ended, all that are left. There is one array at least. A stretch may have
        any number of them: they are made as they are asked for.
        """
        first, self._told = self._told, self._count(end, ended)
        for number in range(first, max(self._told, first + 1), _AT_ONCE):
            yield self._numbered(number, min(number + _AT_ONCE, self._told))

    def _numbered(self, first: int, beyond: int) -> Instants:
        if self._times is not None:
            return self._times[first:beyond]
        assert self._step is not None
        return np.arange(first, beyond, dtype=np.float64) * self._step

    def _count(self, end: float, ended: bool) -> int:
        """How many instants there are up to the end of the run (s), or before that of a stretch."""
        if self._times is not None:
            return int(np.sum(_reached(self._times, end) if ended else self._times < end))
        assert self._step is not None
        count = int(np.floor(end / self._step * (1.0 + ROUNDING))) + 1
        while not ended and count > 0 and (count - 1) * self._step >= end:
            count -= 1
        return count


MANY_SAMPLES = 1e8
"""Rows of the motion table, some gigabytes, that a user is warned of."""


def many_samples(step: float | None, end: float | None, bodies: int) -> Iterator[str]:
    """Warn of samples of bodies until the end (s) that fill a disk, as by a step with a slip."""
    if step is not None and end is not None and bodies * end / step > MANY_SAMPLES:
        rows = f"{bodies * end / step:.0e} rows of motion until stop.time"
        yield f"output.step = {step:g} s asks for {rows}"
