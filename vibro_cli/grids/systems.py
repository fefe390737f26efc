"""What a grid needs of the system of its scenarios: a solver.

All else is the same for every system: axes, chunks, parts, manifest, shards, workers. A trace is
solved many points at a time; the points of other systems are runs, one after another.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from vibro_cli.grids.axes import Column
from vibro_cli.grids.document import Grid
from vibro_cli.grids.runs import RunSolver
from vibro_cli.grids.solving import Solved
from vibro_cli.grids.solving import Solver as TraceSolver


class Solver(Protocol):
    """Solves stretches of a grid's points, in one thread."""

    def compile(self) -> None:
        """Make or load the machine code now."""

    def solve(self, indices: Column) -> Solved:
        """Solve some points, given by their numbers from 0."""


@dataclass(frozen=True)
class GridSystem:
    """A system, as grids see it."""

    solver: Callable[[Grid, str], Solver]
    """Gives a solver of the points of a grid; engine ``"python"`` or ``"numba"``."""
    sampled_by: str
    """Engine of the few points that are solved ahead: ``python``, or ``numba`` where an interpreted
    run would take long."""


_SYSTEMS = {
    "trace": GridSystem(TraceSolver, "python"),
    "table": GridSystem(RunSolver, "python"),
    "springs": GridSystem(RunSolver, "numba"),  # a step of the series takes a millisecond else
}


def system_of_grid(grid: Grid) -> GridSystem:
    """Return the system of a grid's scenarios."""
    return _SYSTEMS[grid.system]
