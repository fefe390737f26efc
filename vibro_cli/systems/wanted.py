"""What a run is asked for, whatever the system: where it stops, what is computed, who is told.

Motion is asked for at instants that the run has come to, and at no others; how far a run is can be
told to whoever wants to know while it goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Instants = NDArray[np.float64]

UNLIMITED = 2**62
"""The count of a stop that is not set."""

FINAL = ("inadmissible", "end_of_trace", "lift_off", "wall_contact", "accumulation")
"""Ends after which nothing can follow, whatever the stop."""

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


@dataclass(frozen=True)
class Wanted:
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

    @property
    def motion(self) -> bool:
        """Whether sampled motion is wanted."""
        return self.times is not None or self.step is not None

    def left_out(self, end: float) -> tuple[str, ...]:
        """Say which sampled motion there is not of a run with this end (s), and why."""
        return left_out(self.times, self.step, end)


NOTHING_MORE = Wanted()


class Sampling:
    """The instants of the motion table, as a run comes to them.

    Parameters
    ----------
    wanted
        Ascending instants (s), or their step.
    """

    def __init__(self, wanted: Wanted) -> None:
        self._wanted = wanted
        self._told = 0

    def until(self, end: float, ended: bool) -> list[NDArray[np.float64]]:
        """Return the next instants before the end (s) of a stretch, not many in each array.

        When the run has ended, all that are left. There is one array at least.
        """
        instants = self._left(end)
        if not ended:
            instants = instants[instants < end]
        self._told += len(instants)
        firsts = range(0, max(len(instants), 1), _AT_ONCE)
        return [instants[first : first + _AT_ONCE] for first in firsts]

    def _left(self, end: float) -> NDArray[np.float64]:
        if self._wanted.times is not None:
            listed = asked_for(self._wanted.times, None, end)
            assert listed is not None
            return listed[self._told :]
        assert self._wanted.step is not None
        count = steps_to(end, self._wanted.step)
        return np.arange(self._told, count, dtype=np.float64) * self._wanted.step


Watcher = Callable[[float, int], None]
"""Called with the simulated time (s) and the number of impacts so far."""

_watcher: ContextVar[Watcher | None] = ContextVar("watcher", default=None)


@contextmanager
def watched_by(watcher: Watcher) -> Iterator[None]:
    """Have the runs of this thread tell a watcher how far they are, each time a log is full."""
    token = _watcher.set(watcher)
    try:
        yield
    finally:
        _watcher.reset(token)


def tell(time: float, impacts: float) -> None:
    """Tell the watcher of this thread, if there is one, how far its run is."""
    watcher = _watcher.get()
    if watcher is not None:
        watcher(time, int(impacts))
