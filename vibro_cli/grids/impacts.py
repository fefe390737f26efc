"""From the logs of a chunk's points to the columns of its impacts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vibro_cli.grids.axes import Column
from vibro_cli.grids.room import Room
from vibro_cli.mechanics.laws import LAW_NAMES
from vibro_cli.mechanics.system import System
from vibro_cli.simulation.entry import zeros
from vibro_cli.simulation.impacts import ImpactTable, runs_of, sidedness
from vibro_cli.simulation.world import ImpactRow, World
from vibro_cli.storage.schema import Table
from vibro_cli.storage.tables import Words


@dataclass(frozen=True)
class Logged:
    """Impacts of some points that share a setting, as the solver has logged them."""

    system: System
    world: World
    """The records of the system, of either engine."""
    engine: str
    """Of interpreted records."""
    points: Column
    """Numbers of the points, from 0 in the grid."""
    counts: Column
    """How many impacts each has."""
    log: Any
    """The impacts, point by point."""
    masses: Column | None = None
    """[point, ball] (kg); those of the system for None."""
    give_back: Callable[[], None] = lambda: None
    """Called once the log is not needed any more."""


class SpareLogs:
    """Logs that are used again; one thread takes them, any may put them back."""

    def __init__(self) -> None:
        self._spare: list[Any] = []

    def take(self, rows: int) -> Any:
        """Return a log with room for at least some rows."""
        while self._spare:
            log = self._spare.pop()
            if len(log) >= rows:
                return log
        return zeros(rows + rows // 8, ImpactRow)

    def put(self, log: Any) -> None:
        """Take back a log."""
        self._spare.append(log)


def impact_columns(
    table: Table, logged: Sequence[Logged], points: Column, room: Room
) -> dict[str, Any]:
    """Return the columns of a table of impacts, in order of the points.

    Parameters
    ----------
    table
        Which columns there are.
    logged
        All impacts of these points.
    points
        Numbers of points, from 0, in order.
    room
        Where the columns are; the logs are given back.
    """
    counts = np.zeros(len(points), dtype=np.int64)
    places = [np.searchsorted(points, one.points) for one in logged]
    for one, at in zip(logged, places, strict=True):
        counts[at] = one.counts
    rows = np.cumsum(counts) - counts
    filled = ImpactTable(int(counts.sum()), [column.name for column in table.columns], room)
    for one, at in zip(logged, places, strict=True):
        runs = runs_of(one.system, one.points + 1, one.counts, rows[at], one.masses)
        filled.fill(one.world, one.engine, one.log, runs, sidedness(one.system))
        one.give_back()
    columns = filled.columns()
    if "law" in columns:
        columns["law"] = Words(columns["law"], LAW_NAMES)
    if "side" in columns:
        columns["side"] = np.ma.masked_equal(columns["side"], 0)
    return columns
