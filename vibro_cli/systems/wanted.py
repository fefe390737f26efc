"""What is to be computed beside the impacts, whatever the system."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Wanted:
    """Sampled motion."""

    times: tuple[float, ...] | None = None
    """Instants of the motion table (s)."""
    step: float | None = None
    """Or its step (s), to the end of the run."""

    def skipped(self) -> tuple[str, ...]:
        """Return what is not computed, and why."""
        if self.times is None and self.step is None:
            return ("sampled motion: not asked for (output.step or output.times)",)
        return ()

    def instants(self, end: float) -> NDArray[np.float64] | None:
        """Return the instants of the sampled motion of a run with this end, None if none."""
        if self.times is not None:
            return np.array(self.times, dtype=np.float64)
        if self.step is None:
            return None
        count = int(np.floor(end / self.step * (1.0 + 1e-12))) + 1
        return np.arange(count, dtype=np.float64) * self.step
