"""What the figures of a run need of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vibro_cli.mechanics.system import System

Array = NDArray[np.float64]
Table = Mapping[str, NDArray[Any]]


class Recorded(Protocol):
    """A finished run: the system, its impacts and its flights between events."""

    @property
    def system(self) -> System:
        """The system that was solved."""

    @property
    def collisions(self) -> Table:
        """The impacts, with the columns of `collisions.parquet`."""

    def flights(self) -> Table:
        """The flights of every ball between events, with their first and last states."""

    def flight_curve(self, index: int, count: int) -> tuple[Array, Array, Array]:
        """Times, positions and rates along one flight."""


class Remembered:
    """A finished run whose tables are asked for once, however many figures are drawn of it."""

    def __init__(self, run: Recorded) -> None:
        self._run = run
        self.system = run.system
        self.collisions = run.collisions
        self._flights = run.flights()

    def flights(self) -> Table:
        """Return the flights of every ball between events."""
        return self._flights

    def flight_curve(self, index: int, count: int) -> tuple[Array, Array, Array]:
        """Return times, positions and rates along one flight."""
        return self._run.flight_curve(index, count)
