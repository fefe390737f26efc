"""Chunks of a grid, the units of work and of the parts on disk.

The content of a part depends only on the grid and the index of its chunk, so that its bytes are the
same for any number and order of workers.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from vibro_cli.grids.axes import Array
from vibro_cli.grids.document import Grid

# Rows of a part: a compromise between readers of Parquet (100,000 or more) and memory.
_POINTS_OF_A_PART = 100_000
_IMPACTS_OF_A_PART = 300_000
# Greatest number for any distribution of impacts over points.
_MOST_IMPACTS_OF_A_PART = 1_500_000
# Impacts of a stretch, which is solved without interruption: threads can stop between stretches.
_IMPACTS_OF_A_STRETCH = 40_000
_LONGEST_STRETCH = 8192
# Least number of stretches of a small grid, to be shared by threads.
_FEWEST_STRETCHES = 64
# With more parts than this, chunks are cut by the density of impacts, and have equal numbers of
# stretches.
_MANY_PARTS = 8
_STRETCHES_OF_A_CHUNK = 8


class Expected(NamedTuple):
    """Expected numbers of impacts per point."""

    mean: float
    most: float


def has_many_parts(grid: Grid, impacts: Expected) -> bool:
    """Return whether a grid has enough parts to be cut by the density of impacts."""
    own_size = grid.chunk_points is not None or not grid.keep.collisions
    return not own_size and grid.design.points * impacts.mean > _MANY_PARTS * _IMPACTS_OF_A_PART


Division = int | tuple[int, ...]
"""Points per chunk, or the points of each chunk, as stored in the folder of a grid."""


@dataclass(frozen=True)
class Chunks:
    """The division of the points of a grid."""

    points: int
    """Number of points of the grid."""
    division: Division
    """Points per chunk (the last one may have fewer), or the points of each chunk."""
    stretch: int
    """Greatest number of points solved together; row groups consist of whole stretches."""

    @staticmethod
    def of(grid: Grid, impacts: Expected, density: Array | None = None) -> Chunks:
        """Divide a grid by the expected numbers of impacts of its points.

        `density` are the expected impacts per point in equal sections of a grid with many parts.
        """
        if density is not None:
            return Chunks.of_division(grid, _cut(grid.design.points, density), impacts)
        size = _POINTS_OF_A_PART
        if grid.keep.collisions:
            wished = int(_IMPACTS_OF_A_PART / max(impacts.mean, 1.0))
            possible = int(_MOST_IMPACTS_OF_A_PART / max(impacts.most, 1.0))
            size = max(1, min(size, wished, possible))
        return Chunks.of_division(grid, grid.chunk_points or size, impacts)

    @staticmethod
    def of_division(grid: Grid, division: Division, impacts: Expected) -> Chunks:
        """Divide a grid into chunks of a given division."""
        points = grid.design.points
        if isinstance(division, tuple):
            return Chunks(points, division, _LONGEST_STRETCH)
        stretch = int(_IMPACTS_OF_A_STRETCH / max(impacts.mean, 1.0))
        stretch = min(stretch, _LONGEST_STRETCH, division, points // _FEWEST_STRETCHES)
        return Chunks(points, division, max(1, stretch))

    @property
    def count(self) -> int:
        """Number of chunks."""
        return len(self._ends)

    @property
    def sizes(self) -> list[int]:
        """Number of points of each chunk."""
        sizes: list[int] = np.diff(self._ends, prepend=0).tolist()
        return sizes

    @cached_property
    def _ends(self) -> Array:
        """The point after the last one of each chunk."""
        if isinstance(self.division, tuple):
            return np.cumsum(self.division)
        return np.minimum(np.arange(0, self.points, self.division) + self.division, self.points)

    def range_of(self, chunk: int) -> tuple[int, int]:
        """Return the first point of a chunk and the one after its last, from 0."""
        return int(self._ends[chunk - 1]) if chunk else 0, int(self._ends[chunk])

    def stretches(self, chunk: int) -> list[tuple[int, int]]:
        """Return the stretches of a chunk, each as its first point and the point after its last."""
        first, last = self.range_of(chunk)
        length = self.stretch
        if isinstance(self.division, tuple):
            length = min(length, -(-(last - first) // _STRETCHES_OF_A_CHUNK))
        starts = range(first, last, length)
        return [(start, min(start + length, last)) for start in starts]


def _cut(points: int, density: Array) -> tuple[int, ...]:
    """Divide points into chunks with about equal numbers of impacts, at least one per point.

    ``density`` is the number of impacts per point in equal sections of the grid.
    """
    reached = np.concatenate([[0.0], np.cumsum(np.maximum(density, 1.0))]) * points / len(density)
    count = max(1, int(reached[-1] / _IMPACTS_OF_A_PART))
    shares = reached[-1] * np.arange(1, count + 1) / count
    ends = np.interp(shares, reached, np.linspace(0.0, points, len(reached)))
    sizes = np.diff(np.unique(np.round(ends[:-1]).astype(np.int64)), prepend=0, append=points)
    return tuple(size for size in sizes.tolist() if size > 0)


@dataclass(frozen=True)
class Receipt:
    """Record of a finished chunk on disk."""

    chunk: int
    points: int
    impacts: int
    invalid: int
    failed: int
    end_causes: dict[str, int]
    """Number of its runs by cause of the end."""
    files: dict[str, dict[str, Any]]
    """Size and SHA-256 of each file, by name in the folder of the grid."""

    def counts(self) -> dict[str, Any]:
        """Return the receipt without files."""
        return {name: value for name, value in asdict(self).items() if name != "files"}


def file_names(grid: Grid, chunk: int) -> dict[str, str]:
    """Return the names of a chunk's files, by table."""
    return {table: f"{table}/part-{chunk:06d}.parquet" for table in ("summary", *grid.kept_tables)}


def receipt_of(
    chunk: int, status: Any, end_cause: Any, impacts: int, files: dict[str, dict[str, Any]]
) -> Receipt:
    """Return the receipt of a chunk from columns of its summary."""
    return Receipt(
        chunk=chunk,
        points=len(status),
        impacts=impacts,
        invalid=int(np.count_nonzero(status == "invalid")),
        failed=int(np.count_nonzero(status == "failed")),
        end_causes=dict(sorted(Counter(filter(None, end_cause.tolist())).items())),
        files=files,
    )
