"""What a grid needs of the system of its scenarios: a solver, and columns from what it has logged.

All else is the same for every system: axes, chunks, parts, manifest, shards, workers. A trace is
solved many points at a time; the points of other systems are runs, one after another.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from vibro_cli.grids.axes import Column
from vibro_cli.grids.document import Grid
from vibro_cli.grids.impacts import counts_of, impact_columns
from vibro_cli.grids.room import Room
from vibro_cli.grids.runs import RunSolver, columns_of_runs, counts_of_runs
from vibro_cli.grids.solving import Solved
from vibro_cli.grids.solving import Solver as TraceSolver
from vibro_cli.storage.schema import Table


class Solver(Protocol):
    """Solves stretches of a grid's points, in one thread."""

    def compile(self) -> None:
        """Make or load the machine code now."""

    def solve(self, indices: Column) -> Solved:
        """Solve some points, given by their numbers from 0."""


class GridSystem(Protocol):
    """A system, as grids see it."""

    sampled_by: str
    """Engine of the few points that are solved ahead: ``python``, or ``numba`` where an interpreted
    run would take long."""

    def solver(self, grid: Grid, engine: str) -> Solver:
        """Return a solver of the points of a grid; engine ``"python"`` or ``"numba"``."""

    def impact_counts(self, table: Table, logged: Sequence[Any], points: Column) -> Column:
        """Return how many rows of a table of impacts each of some points has.

        ``logged`` is what solvers have logged, ``points`` are numbers from 0, in order.
        """

    def impact_columns(
        self, table: Table, logged: Sequence[Any], points: Column, room: Room
    ) -> dict[str, Any]:
        """Return the columns of a table of impacts of some points, one after another.

        They may be in the room; ``logged`` may hold other points too.
        """


class _Trace:
    """Bodies on a trace, at rest or turning."""

    sampled_by = "python"

    def solver(self, grid: Grid, engine: str) -> Solver:
        return TraceSolver(grid, engine)

    def impact_counts(self, table: Table, logged: Sequence[Any], points: Column) -> Column:
        return counts_of(logged, points)

    def impact_columns(
        self, table: Table, logged: Sequence[Any], points: Column, room: Room
    ) -> dict[str, Any]:
        return impact_columns(table, logged, points, room)


class _Runs:
    """A system whose points are runs."""

    def __init__(self, sampled_by: str) -> None:
        self.sampled_by = sampled_by

    def solver(self, grid: Grid, engine: str) -> Solver:
        return RunSolver(grid, engine)

    def impact_counts(self, table: Table, logged: Sequence[Any], points: Column) -> Column:
        return counts_of_runs(table, logged, points)

    def impact_columns(
        self, table: Table, logged: Sequence[Any], points: Column, room: Room
    ) -> dict[str, Any]:
        return columns_of_runs(table, logged, points)


_SYSTEMS: dict[str, GridSystem] = {
    "trace": _Trace(),
    "table": _Runs("python"),
    "springs": _Runs("numba"),  # a step of the series takes the interpreter a millisecond
}


def system_of_grid(grid: Grid) -> GridSystem:
    """Return the system of a grid's scenarios."""
    return _SYSTEMS[grid.system]
