"""From the logs of some points to the columns of their impacts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vibro_cli.grids.axes import Column
from vibro_cli.grids.room import Lease
from vibro_cli.kernels.ensemble.stacks import Stack
from vibro_cli.kernels.statistics.impact_columns import WORDS
from vibro_cli.kernels.world import ImpactRow, World
from vibro_cli.mechanics.system import System
from vibro_cli.simulation.entry import zeros
from vibro_cli.simulation.impacts import ImpactTable, runs_of, sidedness
from vibro_cli.storage.schema import Table
from vibro_cli.storage.tables import Words

_ROWS_AT_LEAST = 1 << 14


@dataclass(frozen=True)
class Logged:
    """Impacts of some points that share a setting, as the solver has logged them."""

    system: System
    world: World
    """The records of the system, of either engine."""
    engine: str
    """Of interpreted records."""
    points: Column
    """Numbers of the points, from 0 in the grid, ascending."""
    counts: Column
    """How many impacts each has."""
    log: Any
    """The impacts, point by point."""
    masses: Column | None = None
    """[point, ball] (kg); those of the system for None."""
    stack: Stack | None = None
    """The systems of the points, if there are several."""


class LogSpace:
    """Room for the logs of a stretch, one after another; used again for the next stretch.

    Memory that is written to for the first time costs more than what is written.
    """

    def __init__(self) -> None:
        self._rows: Any = zeros(0, ImpactRow)
        self._used = 0

    def clear(self) -> None:
        """Take all logs for done with."""
        self._used = 0

    def take(self, rows: int) -> Any:
        """Return a log with room for at least some rows."""
        if len(self._rows) - self._used < rows:
            # Logs that are in use keep what was there before.
            self._rows = zeros(max(rows + rows // 4, _ROWS_AT_LEAST), ImpactRow)
            self._used = 0
        return self._rows[self._used :]

    def keep(self, log: Any, rows: int) -> Any:
        """Return the first rows of the log that was taken last, perhaps grown; they are kept."""
        if not np.shares_memory(log, self._rows):
            self._rows, self._used = log, 0
        self._used += rows
        return log[:rows]


def impact_columns(
    table: Table, logged: Sequence[Logged], points: Column, room: Lease
) -> dict[str, Any]:
    """Return the columns of a table of impacts, in order of the points.

    Parameters
    ----------
    table
        Which columns there are.
    logged
        All impacts of these points.
    points
        Numbers of points, from 0, one after another.
    room
        Where the columns are.
    """
    counts = np.zeros(len(points), dtype=np.int64)
    for one in logged:
        counts[np.searchsorted(points, one.points)] = one.counts
    rows = np.cumsum(counts) - counts
    filled = ImpactTable(int(counts.sum()), [column.name for column in table.columns], room)
    for one in logged:
        firsts = rows[np.searchsorted(points, one.points)]
        runs = runs_of(one.system, one.points + 1, one.counts, firsts, one.masses)
        filled.fill(one.world, one.engine, one.log, runs, sidedness(one.system), one.stack)
    columns = filled.columns()
    for name in columns.keys() & WORDS.keys():
        columns[name] = Words(columns[name], WORDS[name])
    if "side" in columns:
        columns["side"] = np.ma.masked_equal(columns["side"], 0)
    return columns
