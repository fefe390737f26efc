"""The tables of a grid's parts: which columns they have, and those of impacts from the logs."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from vibro_cli import __version__
from vibro_cli.grids.axes import Array, Model, kind_of, type_of, unit_of
from vibro_cli.grids.buffers import Lease
from vibro_cli.grids.document import Grid
from vibro_cli.kernels.ensemble.points import Stack
from vibro_cli.kernels.statistics.impact_columns import WORDS
from vibro_cli.kernels.world import ImpactRow, World
from vibro_cli.mechanics.system import System
from vibro_cli.scenario import fields
from vibro_cli.scenario.problems import KeyPath, path_text
from vibro_cli.storage.parquet_files import PartFile
from vibro_cli.storage.schema import Column, Table, summary, table_named
from vibro_cli.storage.tables import Origin, Words, arrow_schema
from vibro_cli.systems.trace.event_loop import zeros
from vibro_cli.systems.trace.impacts import ImpactTable, runs_of, sidedness

SUMMARY = "grid-summary"
# Columns of impacts that readers of a few scenarios or moments look at first.
_ORDERED = ("scenario", "n", "t")
_NUMBER = Column("scenario", "int64", "", "number of the scenario in the grid, from 1")


def axis_column(path: KeyPath, root: Model) -> Column:
    """Return the column of an axis' values, of scenarios with the model `root`."""
    kind = kind_of(path, root)
    text = fields.description(path, root) or "value of this key of the scenario"
    return Column(path_text(path), type_of(kind), unit_of(kind), text[:1].lower() + text[1:])


def summary_table(grid: Grid) -> Table:
    """Return the table of summaries of a grid's scenarios."""
    axes = [axis_column(path, grid.root) for path in grid.design.paths]
    of_runs = summary(ball_count(grid), grid.system, is_followed(grid)).columns
    return Table(SUMMARY, "one scenario", (_NUMBER, *axes, *of_runs))


def impact_table_of(grid: Grid, name: str = "collisions") -> Table:
    """Return a table of the impacts that a grid keeps."""
    table = table_named(name, ["side"] if _may_be_sided(grid) else [], grid.system)
    kept = grid.keep.columns
    columns = [column for column in table.columns if kept is None or column.name in kept]
    columns = [_nullable(c) if c.name == "side" else c for c in columns]
    return Table(f"grid-{name}", table.row, (_NUMBER, *columns))


def ball_count(grid: Grid) -> int:
    """Return the number of bodies of every scenario of a grid."""
    balls = grid.base.data.get("balls", ())
    return len(balls) if isinstance(balls, list) else 0


def is_followed(grid: Grid) -> bool:
    """Whether exponents of every point are wanted."""
    analysis = grid.base.data.get("analysis", {})
    return isinstance(analysis, dict) and analysis.get("lyapunov") is True


def _may_be_sided(grid: Grid) -> bool:
    """Whether some scenarios have two bodies on a closed trace, which may meet two ways."""
    trace = grid.base.data.get("trace", {})
    closed = isinstance(trace, dict) and trace.get("closed") is True
    return ball_count(grid) == 2 and (closed or ("trace", "closed") in grid.design.paths)


def _nullable(column: Column) -> Column:
    return Column(column.name, column.type, column.unit, column.description, nullable=True)


def part_file(grid: Grid, table: Table, chunk: int, room: Callable[[str, int], Any]) -> PartFile:
    """Return the file of one part, to be filled: the same bytes for the same rows of the same grid.

    ``table`` and ``chunk`` are what it is a part of; ``room(name, size)`` gives memory for it.
    """
    resolved = grid.resolved()
    origin = Origin(resolved["scenario"], __version__, _metadata(resolved, chunk))
    names = [column.name for column in table.columns]
    skipped_by = [name for name in names if table.name == SUMMARY or name in _ORDERED]
    return PartFile(partial(room, f"file of {table.name}"), arrow_schema(table, origin), skipped_by)


def _metadata(resolved: dict[str, Any], chunk: int) -> dict[str, str]:
    return {
        "vibro:grid": json.dumps(resolved, ensure_ascii=False, allow_nan=False),
        "vibro:part": str(chunk),
    }


_ROWS_AT_LEAST = 1 << 14


@dataclass(frozen=True)
class Logged:
    """Impacts of some points that share a setting, as the solver has logged them."""

    system: System
    world: World
    """The records of the system, of either engine."""
    engine: str
    """Of interpreted records."""
    points: Array
    """Numbers of the points, from 0 in the grid, ascending."""
    counts: Array
    """How many impacts each has."""
    log: Any
    """The impacts, point by point."""
    masses: Array | None = None
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
    table: Table, logged: Sequence[Logged], points: Array, room: Lease
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
