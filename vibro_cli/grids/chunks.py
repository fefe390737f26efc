"""Chunks of a grid: the unit of work, and of the parts on the disk.

What a part holds depends on the grid and on the number of its chunk alone, so that the bytes are
the same from any number of workers, in any order.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from vibro_cli.grids.axes import Array
from vibro_cli.grids.document import Grid

# Rows of a part: what readers of parquet like (100,000 and more), and what a chunk may take of
# memory.
_POINTS_OF_A_PART = 100_000
_IMPACTS_OF_A_PART = 300_000
# However they are spread, no more than this.
_MOST_IMPACTS_OF_A_PART = 1_500_000
# Impacts that are solved at one go: between two stretches a thread can be told to stop.
_IMPACTS_OF_A_STRETCH = 40_000
_LONGEST_STRETCH = 8192
# Stretches of a small grid, for any number of threads to share.
_FEWEST_STRETCHES = 64
# From so many parts on they are cut where the impacts are, a chunk into so many stretches.
_MANY_PARTS = 8
_STRETCHES_OF_A_CHUNK = 8


class Expected(NamedTuple):
    """How many impacts a point may be expected to have."""

    mean: float
    most: float


def has_many_parts(grid: Grid, impacts: Expected) -> bool:
    """Whether a grid has so many parts of impacts that they are cut where the impacts are."""
    own_size = grid.chunk_points is not None or not grid.keep.collisions
    return not own_size and grid.design.points * impacts.mean > _MANY_PARTS * _IMPACTS_OF_A_PART


Division = int | tuple[int, ...]
"""Points of a chunk, or of each: what the folder of a grid tells of its chunks."""


@dataclass(frozen=True)
class Chunks:
    """How the points of a grid are divided."""

    points: int
    """Points of the grid."""
    division: Division
    """Points of a chunk, where the last one may have fewer; or of each chunk."""
    stretch: int
    """Points that are solved at one go, at most; groups of rows have whole stretches."""

    @staticmethod
    def of(grid: Grid, impacts: Expected, density: Array | None = None) -> Chunks:
        """Divide a grid whose points are expected to have so many impacts.

        `density` is the same for points of each of some equal parts of the grid, where it has many
        parts.
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
        """Divide a grid into chunks that are known."""
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
        """Points of each chunk."""
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
        """Return the stretches of a chunk, each as its first point and the one after its last."""
        first, last = self.range_of(chunk)
        length = self.stretch
        if isinstance(self.division, tuple):
            length = min(length, -(-(last - first) // _STRETCHES_OF_A_CHUNK))
        starts = range(first, last, length)
        return [(start, min(start + length, last)) for start in starts]


def _cut(points: int, density: Array) -> tuple[int, ...]:
    """Cut points into chunks with about as many impacts each, but no more points than impacts.

    ``density`` is the number of impacts of a point in each of some equal parts.
    """
    reached = np.concatenate([[0.0], np.cumsum(np.maximum(density, 1.0))]) * points / len(density)
    count = max(1, int(reached[-1] / _IMPACTS_OF_A_PART))
    shares = reached[-1] * np.arange(1, count + 1) / count
    ends = np.interp(shares, reached, np.linspace(0.0, points, len(reached)))
    sizes = np.diff(np.unique(np.round(ends[:-1]).astype(np.int64)), prepend=0, append=points)
    return tuple(size for size in sizes.tolist() if size > 0)


@dataclass(frozen=True)
class Receipt:
    """What is on the disk of one chunk."""

    chunk: int
    points: int
    impacts: int
    invalid: int
    failed: int
    end_causes: dict[str, int]
    """How many of its runs ended by each cause."""
    files: dict[str, dict[str, Any]]
    """Size and SHA-256 of each file, by its name in the folder of the grid."""

    def counts(self) -> dict[str, Any]:
        """Return the numbers alone."""
        return {name: value for name, value in asdict(self).items() if name != "files"}


def file_names(grid: Grid, chunk: int) -> dict[str, str]:
    """Return the names of a chunk's files by the tables they hold."""
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
