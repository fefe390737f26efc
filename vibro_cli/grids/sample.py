"""A few points solved ahead: how many impacts to expect, and how long they take."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from vibro_cli.grids.axes import Column
from vibro_cli.grids.chunks import part_bytes
from vibro_cli.grids.document import Grid
from vibro_cli.grids.solving import Solver

# The number of points that tell how the grid is divided; it must not depend on the machine.
_POINTS = 32
_MOST_IMPACTS = 500
# A point that has more is taken to have this many times as many, if its stop allows.
_MANY = 10.0
# Impacts for which compiling is worth its time, and how many a point without any counts for.
_WORTH_COMPILING = 100_000
_LEAST_WORK = 10.0
# Least time (s) of a sample that is timed.
_TIMED = 0.3


def spread(grid: Grid, count: int) -> Column:
    """Return the numbers of some points spread evenly over a grid."""
    points = grid.design.points
    return np.unique(np.arange(min(count, points)) * points // min(count, points))


def expected_impacts(grid: Grid) -> float:
    """Return how many impacts a point may be expected to have; the same on every machine."""
    stop = grid.base.data.get("stop")
    most = stop.get("collisions") if isinstance(stop, dict) else None
    limit = float(most) if isinstance(most, int) and most > 0 else _MANY * _MOST_IMPACTS
    limited = grid
    if ("stop", "collisions") not in grid.design.paths:
        limited = grid.stopped_at(min(int(limit), _MOST_IMPACTS))
    solved = Solver(limited.without_collisions(), "python").solve(spread(grid, _POINTS))
    counts = np.ma.filled(solved.summary["collisions"], 0).astype(np.float64)
    counts[counts >= _MOST_IMPACTS] = limit
    return float(np.mean(counts))


def engine_for(grid: Grid, impacts_of_a_point: float) -> str:
    """Return the engine for a grid: small ones are done before the kernels would be compiled."""
    work = grid.design.points * (impacts_of_a_point + _LEAST_WORK)
    return "numba" if work > _WORTH_COMPILING else "python"


@dataclass(frozen=True)
class Estimate:
    """What a grid will take, judged by a sample of its points."""

    sampled: int
    impacts: float
    """Impacts of a point, on average."""
    seconds: float
    """Time of a point in one thread (s)."""
    bytes: float
    """Bytes of a point on the disk."""


def estimate(grid: Grid, engine: str) -> Estimate:
    """Time points spread over the grid for about half a second."""
    solver = Solver(grid, engine)
    if engine == "numba":
        solver.compile()
    count = 16
    while True:
        points = spread(grid, count)
        begin = time.perf_counter()
        solved = solver.solve(points)
        taken = time.perf_counter() - begin
        if taken >= _TIMED or len(points) == grid.design.points:
            break
        count *= 4
    size = part_bytes(grid, solved, points)
    return Estimate(len(points), solved.impacts / len(points), taken / len(points), size)
