"""Points that are runs: those of the systems besides the trace, solved one after another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vibro_cli.api import simulate
from vibro_cli.grids.axes import Column
from vibro_cli.grids.document import Grid
from vibro_cli.grids.points import document_at, reason_of
from vibro_cli.grids.solving import Solved
from vibro_cli.grids.tables import ball_count
from vibro_cli.scenario import ScenarioError, any_scenario_of
from vibro_cli.storage.schema import Table, summary
from vibro_cli.systems.run import SystemRun, tables_of_runs

AnySystemRun = SystemRun[Any]


@dataclass(frozen=True)
class LoggedRuns:
    """Runs of points that were solved, with what their impacts are made from."""

    points: Column
    """Numbers of the points, from 0 in the grid, in order."""
    runs: Sequence[AnySystemRun]

    def give_back(self) -> None:
        """Nothing: their logs are their own."""


class RunSolver:
    """Solves stretches of a grid's points, in one thread, each as a run of its own.

    Parameters
    ----------
    grid
        The grid, of a system other than the trace.
    engine
        ``"numba"`` or ``"python"``; both give the same bits.
    """

    def __init__(self, grid: Grid, engine: str = "numba") -> None:
        self._grid = grid
        self._engine = engine
        self._table = summary(ball_count(grid), grid.system)

    def compile(self) -> None:
        """Make or load the machine code now, with the first point that is valid."""
        for index in range(self._grid.design.points):
            if isinstance(self._run(self._values(np.array([index]))[0]), SystemRun):
                return

    def solve(self, indices: Column) -> Solved:
        """Solve some points, given by their numbers from 0."""
        found = [self._run(values) for values in self._values(indices)]
        records = [one.summary_record() if isinstance(one, SystemRun) else one for one in found]
        table = _columns_of(records, self._table)
        done = np.array([isinstance(one, SystemRun) for one in found])
        runs = [one for one in found if isinstance(one, SystemRun)]
        kept = [LoggedRuns(indices[done], runs)] if self._grid.keep.collisions and runs else []
        return Solved(table, kept, impacts_of(table, self._grid))

    def _values(self, indices: Column) -> list[dict[Any, Any]]:
        """The values of the axes at some points, a mapping for each."""
        columns = {path: c.tolist() for path, c in self._grid.design.columns(indices).items()}
        return [{path: c[row] for path, c in columns.items()} for row in range(len(indices))]

    def _run(self, values: dict[Any, Any]) -> AnySystemRun | dict[str, Any]:
        """The run of a point, or a summary that says why there is none."""
        try:
            scenario = any_scenario_of(document_at(self._grid.base, values))
            run = simulate(scenario, self._engine)
        except ScenarioError as error:
            return {"status": "invalid", "reason": reason_of(error)}
        except (ArithmeticError, ValueError, IndexError, RuntimeError) as error:
            return {"status": "failed", "reason": f"{type(error).__name__}: {error}"}
        assert isinstance(run, SystemRun)
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


def counts_of_runs(table: Table, logged: Sequence[LoggedRuns], points: Column) -> Column:
    """Return how many rows of a table of impacts each of some points (numbers from 0) has."""
    counts = np.zeros(len(points), dtype=np.int64)
    for one in logged:
        rows = [run.impact_count(_name(table)) for run in one.runs]
        counts[np.searchsorted(points, one.points)] = rows
    return counts


def columns_of_runs(table: Table, logged: Sequence[LoggedRuns], points: Column) -> dict[str, Any]:
    """Return the columns of a table of the impacts of runs, in order of the points.

    Parameters
    ----------
    table
        Which columns there are.
    logged
        All runs of these points, perhaps with those of others.
    points
        Numbers of points, from 0, one after another.
    """
    numbered = [pair for one in logged for pair in zip(one.points.tolist(), one.runs, strict=True)]
    numbered = sorted(
        (pair for pair in numbered if points[0] <= pair[0] <= points[-1]), key=lambda pair: pair[0]
    )
    if not numbered:
        kinds = {"float64": np.float64, "int64": np.int64, "bool": np.bool_, "string": object}
        return {column.name: np.zeros(0, kinds[column.type]) for column in table.columns}
    found, run = tables_of_runs([run for _, run in numbered], _name(table))
    scenarios = np.array([point + 1 for point, _ in numbered], dtype=np.int64)[run]
    wanted = [column.name for column in table.columns]
    return {name: scenarios if name == "scenario" else found[name] for name in wanted}


def _name(table: Table) -> str:
    """The name of a table of runs, from that of a grid."""
    return table.name.removeprefix("grid-")
