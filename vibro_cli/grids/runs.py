"""Points that are runs: those of the systems besides the trace, solved one after another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vibro_cli.api import simulate
from vibro_cli.grids.axes import Column
from vibro_cli.grids.document import Grid
from vibro_cli.grids.points import document_at, reason_of
from vibro_cli.grids.solving import Solved
from vibro_cli.grids.tables import ball_count, impact_table_of
from vibro_cli.scenario import ScenarioError, any_scenario_of
from vibro_cli.storage.schema import Table, summary
from vibro_cli.storage.tables import record_batch
from vibro_cli.systems.run import Run
from vibro_cli.systems.tables import impacts_of_runs


class RunSolver:
    """Solves stretches of a grid's points, in one thread, each as a run of its own.

    Parameters
    ----------
    grid
        The grid, of a system other than the trace.
    engine
        ``"compiled"`` or ``"python"``; both give the same bits.
    """

    def __init__(self, grid: Grid, engine: str = "compiled") -> None:
        self._grid = grid
        self._engine = engine
        self._table = summary(ball_count(grid), grid.system)
        self._kept = {name: impact_table_of(grid, name) for name in grid.kept_tables}

    def solve(self, indices: Column) -> Solved:
        """Solve some points, given by their numbers from 0."""
        found = [self._run(values) for values in self._values(indices)]
        records = [one.summary_record() if isinstance(one, Run) else one for one in found]
        table = _columns_of(records, self._table)
        done = np.array([isinstance(one, Run) for one in found])
        runs = [one for one in found if isinstance(one, Run)]
        kept = {
            name: record_batch(of_impacts, columns_of_runs(of_impacts, indices[done], runs))
            for name, of_impacts in self._kept.items()
        }
        return Solved(table, impacts_of(table, self._grid), kept)

    def _values(self, indices: Column) -> list[dict[Any, Any]]:
        """The values of the axes at some points, a mapping for each."""
        columns = {path: c.tolist() for path, c in self._grid.design.columns(indices).items()}
        return [{path: c[row] for path, c in columns.items()} for row in range(len(indices))]

    def _run(self, values: dict[Any, Any]) -> Run | dict[str, Any]:
        """The run of a point, or a summary that says why there is none."""
        try:
            scenario = any_scenario_of(document_at(self._grid.base, values))
            run = simulate(scenario, self._engine)
        except ScenarioError as error:
            return {"status": "invalid", "reason": reason_of(error)}
        except (ArithmeticError, ValueError, IndexError, RuntimeError) as error:
            return {"status": "failed", "reason": f"{type(error).__name__}: {error}"}
        return run


def impacts_of(table: dict[str, Any], grid: Grid) -> int:
    """Return how many impacts there are in the points of a summary."""
    return int(sum(np.ma.filled(table[name], 0).sum() for name in grid.counted))


def _columns_of(records: Sequence[dict[str, Any]], table: Table) -> dict[str, Any]:
    """Summaries as columns."""
    columns: dict[str, Any] = {}
    for column in table.columns:
        values = [record.get(column.name) for record in records]
        if column.type == "string":
            columns[column.name] = np.array(values, dtype=object)
        elif column.type == "int64":
            mask = [value is None for value in values]
            columns[column.name] = np.ma.MaskedArray([value or 0 for value in values], mask)
        else:
            columns[column.name] = np.array(values, dtype=np.float64)
    return columns


def columns_of_runs(table: Table, points: Column, runs: Sequence[Run]) -> dict[str, Any]:
    """Return the columns of a table of the impacts of runs.

    Parameters
    ----------
    table
        Which columns there are.
    points, runs
        Numbers of points, from 0 in the grid, in order, and the run of each.
    """
    if not runs:
        kinds = {"float64": np.float64, "int64": np.int64, "bool": np.bool_, "string": object}
        return {column.name: np.zeros(0, kinds[column.type]) for column in table.columns}
    # The name of the table of a run.
    kept = runs[0].kind.impact_logs[table.name.removeprefix("grid-")]
    logs = [run.history()[kept.log] for run in runs]
    found, run = impacts_of_runs(kept, [run.system for run in runs], logs)
    wanted = [column.name for column in table.columns]
    return {name: points[run] + 1 if name == "scenario" else found[name] for name in wanted}
