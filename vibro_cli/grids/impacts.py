"""From the logs of a chunk's points to the columns of its impacts."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from vibro_cli.grids.axes import Column
from vibro_cli.grids.room import Room
from vibro_cli.mechanics.laws import LAW_NAMES
from vibro_cli.mechanics.system import System
from vibro_cli.simulation.entry import zeros
from vibro_cli.simulation.impacts import ImpactTable, runs_of, sidedness
from vibro_cli.simulation.stacks import Stack
from vibro_cli.simulation.world import ImpactRow, World
from vibro_cli.storage.schema import Table
from vibro_cli.storage.tables import Words

_ROWS_OF_A_BLOCK = 1 << 17


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
    give_back: Callable[[], None] = lambda: None
    """Called once the log is not needed any more."""

    def of(self, first: int, last: int) -> Logged:
        """Return the impacts of the points from one number to before another."""
        begin, end = np.searchsorted(self.points, [first, last])
        rows = int(self.counts[:begin].sum())
        log = self.log[rows : rows + int(self.counts[begin:end].sum())]
        masses = None if self.masses is None else self.masses[begin:end]
        points, counts = self.points[begin:end], self.counts[begin:end]
        stack = self.stack
        if stack is not None:
            stack = stack._replace(of_runs=stack.of_runs[begin:end])
        return replace(self, points=points, counts=counts, log=log, masses=masses, stack=stack)


@dataclass(eq=False)
class _Block:
    """Memory for logs, one after another."""

    rows: Any
    used: int = 0
    logs: int = 0
    """How many of them are still needed."""


class LogSpace:
    """Room for the logs of one thread; any thread may tell that one is not needed any more.

    Memory that is written to for the first time costs more than what is written, so that it is
    used again, and a log takes no more of it than it has rows.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._block = _Block(zeros(0, ImpactRow))
        self._spare: list[_Block] = []

    def take(self, rows: int) -> Any:
        """Return a log with room for at least some rows."""
        with self._lock:
            if self._block.logs == 0:
                self._block.used = 0
            if len(self._block.rows) - self._block.used < rows:
                self._block = self._another(rows)
            return self._block.rows[self._block.used :]

    def _another(self, rows: int) -> _Block:
        if self._block.logs == 0:
            self._spare.append(self._block)
        for block in self._spare:
            if len(block.rows) >= rows:
                self._spare.remove(block)
                block.used = 0
                return block
        self._spare.clear()  # all of them are too small
        return _Block(zeros(max(rows + rows // 4, _ROWS_OF_A_BLOCK), ImpactRow))

    def keep(self, log: Any, rows: int) -> Callable[[], None]:
        """Keep the first rows of the log that was taken last; return what gives them back."""
        block = self._block
        if not np.shares_memory(log, block.rows):
            return lambda: None  # it has outgrown its room
        with self._lock:
            block.used += rows
            block.logs += 1
        return partial(self._give_back, block)

    def _give_back(self, block: _Block) -> None:
        with self._lock:
            block.logs -= 1
            if block.logs == 0 and block is not self._block:
                self._spare.append(block)


def counts_of(logged: Sequence[Logged], points: Column) -> Column:
    """Return how many impacts each of some points has (numbers from 0, in order)."""
    counts = np.zeros(len(points), dtype=np.int64)
    for one in logged:
        counts[np.searchsorted(points, one.points)] = one.counts
    return counts


def impact_columns(
    table: Table, logged: Sequence[Logged], points: Column, room: Room
) -> dict[str, Any]:
    """Return the columns of a table of impacts, in order of the points.

    Parameters
    ----------
    table
        Which columns there are.
    logged
        All impacts of these points, perhaps with those of others.
    points
        Numbers of points, from 0, one after another.
    room
        Where the columns are.
    """
    own = [one.of(int(points[0]), int(points[-1]) + 1) for one in logged]
    counts = counts_of(own, points)
    rows = np.cumsum(counts) - counts
    filled = ImpactTable(int(counts.sum()), [column.name for column in table.columns], room)
    for one in own:
        firsts = rows[np.searchsorted(points, one.points)]
        runs = runs_of(one.system, one.points + 1, one.counts, firsts, one.masses)
        filled.fill(one.world, one.engine, one.log, runs, sidedness(one.system), one.stack)
    columns = filled.columns()
    if "law" in columns:
        columns["law"] = Words(columns["law"], LAW_NAMES)
    if "side" in columns:
        columns["side"] = np.ma.masked_equal(columns["side"], 0)
    return columns
