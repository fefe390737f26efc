"""What a run is asked for, whatever the system: where it stops, and what is computed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibro_cli.systems.instants import asked_for, left_out, steps_to

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
    """The growth of small changes of the start on a trace, see ``simulation.tangents``."""

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
