"""Solve a stretch of points: their summaries and, if kept, the columns of their impacts.

Points of a trace are solved in batches, those of other systems as single runs. Everything else is
the same for all systems: axes, chunks, parts, manifest, shards, workers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
import pyarrow as pa

from vibro_cli.assemble import build_any
from vibro_cli.grids.axes import DTYPES, Array, kind_of, type_of
from vibro_cli.grids.document import Grid, document_at, reason_of
from vibro_cli.scenario import fields
from vibro_cli.scenario.loading import any_scenario_of
from vibro_cli.scenario.models import section
from vibro_cli.scenario.problems import KeyPath, ScenarioError, path_text
from vibro_cli.storage.tables import record_batch
from vibro_cli.systems import system_named
from vibro_cli.systems.columns import Column, Table
from vibro_cli.systems.contract import Columns
from vibro_cli.systems.run import record_of, summed_up
from vibro_cli.systems.tables import impacts_of_runs

SUMMARY = "grid-summary"
_NUMBER = Column("scenario", "int64", "", "number of the scenario in the grid, from 1")


def axis_column(path: KeyPath, root: fields.Model) -> Column:
    """Return the column of an axis's values, for scenarios with the model `root`."""
    kind = kind_of(path, root)
    text = fields.description(path, root) or "value of this key of the scenario"
    return Column(path_text(path), type_of(kind), kind.unit, text[:1].lower() + text[1:])


def summary_table(grid: Grid) -> Table:
    """Return the table of summaries of a grid."""
    axes = [axis_column(path, grid.root) for path in grid.design.paths]
    of_runs = system_named(grid.system).summary(ball_count(grid), is_followed(grid)).columns
    return Table(SUMMARY, "one scenario", (_NUMBER, *axes, *of_runs))


def impact_table_of(grid: Grid, name: str = "collisions") -> Table:
    """Return a table of impacts with the columns that a grid keeps."""
    table = system_named(grid.system).table(name, ["side"] if _may_be_sided(grid) else [])
    kept = grid.keep.columns
    columns = [column for column in table.columns if kept is None or column.name in kept]
    columns = [replace(c, nullable=True) if c.name == "side" else c for c in columns]
    return Table(f"grid-{name}", table.row, (_NUMBER, *columns))


def ball_count(grid: Grid) -> int:
    """Return the number of bodies of every scenario of a grid."""
    balls = grid.base.data.get("balls", ())
    return len(balls) if isinstance(balls, list) else 0


def is_followed(grid: Grid) -> bool:
    """Return whether a grid requests Lyapunov exponents."""
    return section(grid.base.data, "analysis").get("lyapunov") is True


def _may_be_sided(grid: Grid) -> bool:
    """Return whether some scenarios may have two bodies on a closed trace (column `side`)."""
    closed = section(grid.base.data, "trace").get("closed") is True
    return ball_count(grid) == 2 and (closed or ("trace", "closed") in grid.design.paths)


@dataclass
class Solved:
    """The results of a stretch of points."""

    summary: Columns
    impacts: int
    """Number of impacts, kept or not."""
    kept: Mapping[str, pa.RecordBatch]
    """Rows of the kept tables of impacts, by name."""


class Solver(Protocol):
    """Solves stretches of a grid's points, in one thread."""

    interrupted: Callable[[], bool]
    """Called repeatedly during long runs; when it returns true they end, with unusable results."""

    def solve(self, indices: Array) -> Solved:
        """Solve the points with these indices, from 0."""


def solver_of(grid: Grid, engine: str = "compiled") -> Solver:
    """Return a solver of the points of a grid; engine ``"python"`` or ``"compiled"``."""
    return system_named(grid.system).solver(grid, engine)


class RunSolver:
    """Solves stretches of a grid's points, in one thread, each point as a single run."""

    def __init__(self, grid: Grid, engine: str = "compiled") -> None:
        self.interrupted: Callable[[], bool] = lambda: False
        self._grid = grid
        self._engine = engine
        self._table = system_named(grid.system).summary(ball_count(grid), is_followed(grid))
        self._kept = {name: impact_table_of(grid, name) for name in grid.kept_tables}
        every = system_named(grid.system).impact_logs
        self._logs = {name: every[name] for name in self._kept}

    def solve(self, indices: Array) -> Solved:
        """Solve the points with these indices, from 0."""
        found = [self._run(values) for values in self._values(indices)]
        table = columns_of_records([record for record, *_ in found], self._table)
        done = np.array([system is not None for _, system, _ in found])
        runs = [(system, logs) for _, system, logs in found if system is not None]
        kept = {
            name: record_batch(of_impacts, self._impacts(name, indices[done], runs))
            for name, of_impacts in self._kept.items()
        }
        return Solved(table, int(counts_of(table, self._grid).sum()), kept)

    def _impacts(
        self, name: str, points: Array, runs: Sequence[tuple[Any, Mapping[str, Any]]]
    ) -> Columns:
        """Return the columns of a table of impacts of runs, each given by its system and logs.

        `points` are the indices in the grid, from 0, of the points of these runs.
        """
        columns, log = self._kept[name].columns, self._logs[name]
        if not runs:
            return {column.name: np.zeros(0, DTYPES[column.type]) for column in columns}
        systems, logs = zip(*runs, strict=True)
        found, run = impacts_of_runs(log, systems, [one[log.log] for one in logs])
        wanted = [column.name for column in columns]
        return {name: points[run] + 1 if name == "scenario" else found[name] for name in wanted}

    def _values(self, indices: Array) -> list[dict[Any, Any]]:
        """Return the values of the axes at some points, one mapping per point."""
        columns = {path: c.tolist() for path, c in self._grid.design.columns(indices).items()}
        return [{path: c[row] for path, c in columns.items()} for row in range(len(indices))]

    def _run(
        self, values: dict[Any, Any]
    ) -> tuple[Mapping[str, Any], Any | None, Mapping[str, Any]]:
        """Return the summary of a point, its system (None without a run) and the logs."""
        logs = [kept.log for kept in self._logs.values()]
        try:
            scenario = any_scenario_of(document_at(self._grid.base, values))
            kind, system = system_named(scenario.system), build_any(scenario)
            limits, wanted = kind.limits(scenario), kind.wanted(scenario)
            found, kept = summed_up(
                kind, system, limits, self._engine, wanted, logs, self.interrupted
            )
        except ScenarioError as error:
            return {"status": "invalid", "reason": reason_of(error)}, None, {}
        except (ArithmeticError, ValueError, IndexError, RuntimeError) as error:
            reason = f"{type(error).__name__}: {error}"
            return {"status": "failed", "reason": reason}, None, {}
        return record_of(found), system, kept


def counts_of(summary: Columns, grid: Grid) -> Array:
    """Return the number of impacts of each point of a summary."""
    counts: Array = np.sum([np.ma.filled(summary[name], 0) for name in grid.counted], axis=0)
    return counts


def columns_of_records(records: Sequence[Mapping[str, Any]], table: Table) -> Columns:
    """Return records as columns of a table; missing values are null."""
    columns: Columns = {}
    for column in table.columns:
        values = [record.get(column.name) for record in records]
        if column.type == "string":
            columns[column.name] = np.array(values, dtype=object)
        elif column.type == "int64":
            mask = [value is None for value in values]
            columns[column.name] = np.ma.MaskedArray([value or 0 for value in values], mask)
        else:
            columns[column.name] = np.array(values, dtype=column.type)
    return columns


def end_to_end(parts: Sequence[Any]) -> Any:
    """Concatenate parts of a column, some of which may be masked."""
    if len(parts) == 1:
        return parts[0]
    masked = any(np.ma.isMaskedArray(part) for part in parts)
    join: Any = np.ma.concatenate if masked else np.concatenate
    return join(parts)
