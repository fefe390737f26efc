"""What a grid needs of the system of its scenarios: a solver.

All else is the same for every system: axes, chunks, parts, manifest, shards, workers. A trace is
solved many points at a time; the points of other systems are runs, one after another.
"""

from __future__ import annotations

from typing import Protocol

from vibro_cli.grids.axes import Column
from vibro_cli.grids.document import Grid
from vibro_cli.grids.solving import Solved
from vibro_cli.systems import system_named


class Solver(Protocol):
    """Solves stretches of a grid's points, in one thread."""

    def solve(self, indices: Column) -> Solved:
        """Solve some points, given by their numbers from 0."""


def solver_of(grid: Grid, engine: str = "compiled") -> Solver:
    """Return a solver of the points of a grid; engine ``"python"`` or ``"compiled"``."""
    return system_named(grid.system).solver(grid, engine)
