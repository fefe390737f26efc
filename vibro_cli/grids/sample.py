"""A few points solved ahead: how many impacts to expect, and how long they take."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from vibro_cli.grids.axes import Column
from vibro_cli.grids.chunks import Chunks, Division, Expected, has_many_parts
from vibro_cli.grids.document import Grid
from vibro_cli.grids.parts import part_bytes
from vibro_cli.grids.systems import solver_of

# The number of points that tell how the grid is divided; it must not depend on the machine.
_POINTS = 32
_MOST_IMPACTS = 500
# Where a grid has many parts: parts of it with about so many impacts, and points of each that are
# solved ahead, of at least a hundred times as many.
_IMPACTS_OF_A_BLOCK = 50_000
_MOST_BLOCKS = 4096
_POINTS_OF_A_BLOCK = 16
_LEAST_SHARE = 100
_GOLDEN = 0.5 * (5.0**0.5 - 1.0)
# A point that has more is taken to have this many times as many, if its stop allows.
_MANY = 10.0
# Least time (s) of a sample that is timed.
_TIMED = 0.3


def spread(grid: Grid, count: int) -> Column:
    """Return the numbers of about so many points spread over a grid, along every axis of it."""
    points = grid.design.points
    if count >= points:
        return np.arange(points)
    # Equal steps would meet the same values of the last axes again and again.
    shares = (0.5 + _GOLDEN * np.arange(count)) % 1.0
    return np.unique((shares * points).astype(np.int64))


def expected_impacts(grid: Grid) -> Expected:
    """Return how many impacts a point may be expected to have: the same on every machine."""
    stop = grid.base.data.get("stop")
    given = [stop.get(name) if isinstance(stop, dict) else None for name in grid.counted]
    limits = [float(most) for most in given if isinstance(most, int) and most > 0]
    limit = sum(limits) if len(limits) == len(given) else _MANY * _MOST_IMPACTS
    free = [name for name in grid.counted if ("stop", name) not in grid.design.paths]
    limited = grid.stopped_at(min(int(limit), _MOST_IMPACTS), free)
    solved = solver_of(limited.without_collisions()).solve(spread(grid, _POINTS)).summary
    each = [np.ma.filled(solved[name], 0).astype(np.float64) for name in grid.counted]
    counts = np.sum(each, axis=0)
    counts[counts >= _MOST_IMPACTS] = limit
    crossings = np.ma.filled(solved.get("crossings", np.zeros(1)), 0)
    return Expected(float(np.mean(counts)), float(np.max(counts)), float(np.mean(crossings)))


def impact_density(grid: Grid, impacts: Expected, engine: str) -> Column | None:
    """Return how many impacts a point may be expected to have, for equal parts of a grid.

    None for a grid of a few parts. The same with either engine, on every machine.
    """
    if not has_many_parts(grid, impacts):
        return None
    points = grid.design.points
    blocks = int(points * impacts.mean / _IMPACTS_OF_A_BLOCK)
    blocks = max(1, min(blocks, _MOST_BLOCKS, points // (_LEAST_SHARE * _POINTS_OF_A_BLOCK)))
    shares = (np.arange(_POINTS_OF_A_BLOCK) * _GOLDEN) % 1.0
    sample = ((np.arange(blocks)[:, None] + shares) * (points / blocks)).astype(np.int64)
    distinct, places = np.unique(sample, return_inverse=True)
    solver = solver_of(grid.without_collisions(), engine)
    solved = solver.solve(distinct).summary
    counts = np.sum([np.ma.filled(solved[n], 0).astype(np.float64) for n in grid.counted], axis=0)
    density: Column = counts[places].reshape(sample.shape).mean(axis=1)
    return density


def chunks_of(grid: Grid, known: Division | None, engine: str) -> Chunks:
    """Return how a grid is divided: as a folder has it already, or by its expected impacts."""
    expected = expected_impacts(grid)
    if known is not None and grid.chunk_points is None:
        return Chunks.of_division(grid, known, expected)
    return Chunks.of(grid, expected, impact_density(grid, expected, engine))


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


def estimate(grid: Grid, engine: str, stretch: int) -> Estimate:
    """Time points spread over the grid for about half a second, as many at one go as it solves."""
    solver = solver_of(grid, engine)
    count = 16
    while True:
        points = spread(grid, count)
        begin = time.perf_counter()
        for first in range(0, len(points), stretch):
            solver.solve(points[first : first + stretch])
        taken = time.perf_counter() - begin
        if taken >= _TIMED or len(points) == grid.design.points:
            break
        count *= 4
    solved = solver.solve(points)
    size = part_bytes(grid, solved, points)
    return Estimate(len(points), solved.impacts / len(points), taken / len(points), size)
