"""Requests to a run of any system: where it stops, what is computed, when motion is sampled."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.errors import VibroError

Instants = NDArray[np.float64]

UNLIMITED = 2**62
"""Count that stands for a stop that is not set."""

EARLY_ENDS = {
    "end_of_trace": "reached an end of the trace",
    "lift_off": "lifted off the trace",
    "wall_contact": "began to roll along the wall",
    "accumulation": "ended where impacts accumulate",
}
"""Causes other than an inadmissible impact that end a run for good, as predicates."""
FINAL = ("inadmissible", *EARLY_ENDS)
"""Causes after which a run cannot continue, whatever the stop."""

CHANGEABLE = ("stop", "output")
"""Sections of a scenario that may change when a run is continued."""

# A time that exceeds the end by this relative amount counts as the end.
ROUNDING = 1.0e-12


def within_run(times: Any, end: float, extrapolate: bool) -> Instants:
    """Return times (s) as an array, after checking that they lie within a run that ended at `end`.

    Raises `ValueError` for a time before the start or after the end (with `extrapolate`: for one
    that is not finite), for an array of several dimensions, and for anything but real numbers.
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
        "(extrapolate=True continues the first and last flights, as if nothing happened)"
    )


def _reached(instants: Instants, end: float) -> Any:
    return (instants >= 0.0) & (instants <= end * (1.0 + ROUNDING))


# Number of instants that are sampled together.
_AT_ONCE = 1 << 14
# Time (s) for which sampling goes on after an interruption: mostly it reaches the end of the run.
_GRACE = 1.0


@dataclass(frozen=True)
class Limits:
    """Limits of a run, which stops at the first one reached."""

    time: float | None = None
    """Time (s)."""
    collisions: int | None = None
    """Impacts of two bodies."""
    bounces: int | None = None
    """Impacts on the wall of a table."""


NO_LIMITS = Limits()
STOPS = tuple(field.name for field in fields(Limits))
"""Keys of ``stop``, which are also the names of the end causes."""


def never() -> bool:
    """Return false: nothing interrupts a run. A run with a lambda here could not be pickled."""
    return False


@dataclass(frozen=True)
class OutputRequest:
    """Outputs to compute besides the impacts."""

    times: tuple[float, ...] | None = None
    """Instants of the motion table (s)."""
    step: float | None = None
    """Alternatively its time step (s), up to the end of the run."""
    turning_points: bool = False
    friction: float | None = None
    """Friction coefficient of a trace; slip events mark where rolling needs more."""
    lyapunov: bool = False
    """The growth of small perturbations of the start, see ``systems.tangents``."""
    figures: bool = False
    """The motion as needed by figures, for systems that are slow to solve."""
    interrupted: Callable[[], bool] = never
    """Called repeatedly; when it returns true a run that is streamed ends after its last event."""

    @property
    def motion(self) -> bool:
        """Whether sampled motion is requested."""
        return self.times is not None or self.step is not None

    def left_out(self, end: float) -> tuple[str, ...]:
        """Return which sampled motion a run with this end (s) lacks, and why."""
        if not self.motion:
            return ("sampled motion: not requested (output.step or output.times)",)
        asked = len(self.times or ())
        missing = asked - int(np.sum(_reached(np.array(self.times), end))) if asked else 0
        if not missing:
            return ()
        return (f"sampled motion: {missing} of {asked} times after the end, t = {end!r} s",)


NOTHING_MORE = OutputRequest()


class TooManyInstants(VibroError):
    """The step of the sampled motion is so short that its multiples are not exact."""


class Sampling:
    """The instants of the motion table, as a run reaches them; given times must ascend."""

    def __init__(self, wanted: OutputRequest) -> None:
        self._times = None if wanted.times is None else np.array(wanted.times, dtype=np.float64)
        self._step = wanted.step
        self._sampled = 0
        self._interrupted = wanted.interrupted
        self._latest = math.inf
        self.missing_from: float | None = None
        """The first instant (s) that an interruption left out, if any."""

    def until(self, end: float, ended: bool) -> Iterator[Instants]:
        """Yield the next instants before the end (s) of a stretch, in arrays of limited length.

        When the run has ended, these are all that remain. At least one array is yielded. Arrays
        are made one at a time, since a stretch may have any number of instants up to 2^53, above
        which `TooManyInstants` is raised. `_GRACE` s after an interruption no more are made.
        """
        first, self._sampled = self._sampled, self._count(end, ended)
        for number in range(first, max(self._sampled, first + 1), _AT_ONCE):
            instants = self._numbered(number, min(number + _AT_ONCE, self._sampled))
            if len(instants) and self._is_late():
                if self.missing_from is None:
                    self.missing_from = float(instants[0])
                return
            yield instants

    def _is_late(self) -> bool:
        if self._latest == math.inf and self._interrupted():
            self._latest = time.monotonic() + _GRACE
        return time.monotonic() > self._latest

    def _numbered(self, first: int, beyond: int) -> Instants:
        if self._times is not None:
            return self._times[first:beyond]
        assert self._step is not None
        return np.arange(first, beyond, dtype=np.float64) * self._step

    def _count(self, end: float, ended: bool) -> int:
        """Count the instants up to the end of the run (s), or before the end of a stretch."""
        if self._times is not None:
            return int(np.sum(_reached(self._times, end) if ended else self._times < end))
        assert self._step is not None
        if end > 2**53 * self._step:  # beyond it numbers of instants are not exact
            found = f"output.step: found {self._step!r} s, more than 2^53 instants"
            raise TooManyInstants(f"{found} until t = {end!r} s; expected a longer step")
        count = int(np.floor(end / self._step * (1.0 + ROUNDING))) + 1
        while not ended and count > 0 and (count - 1) * self._step >= end:
            count -= 1
        return count


MANY_SAMPLES = 1e8
"""Rows of the motion table (some gigabytes) above which the user is warned."""


def many_samples(step: float | None, end: float | None, bodies: int) -> Iterator[str]:
    """Yield a warning if samples up to the end (s) would fill a disk, as with a mistyped step."""
    if step is not None and end is not None and bodies * end / step > MANY_SAMPLES:
        rows = f"{bodies * end / step:.0e} rows of motion until stop.time"
        yield f"output.step = {step:g} s asks for {rows}"
