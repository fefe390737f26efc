"""Chunks of a grid: the unit of work, and of the parts on the disk.

What a part holds depends on the grid and on the number of its chunk alone, so that the bytes are
the same from any number of workers, in any order.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from vibro_cli.grids.document import Grid

# Rows of a part: what readers of parquet like (100,000 and more, also where points have fewer
# impacts than elsewhere), and what a chunk may take of memory.
_POINTS_OF_A_PART = 100_000
_IMPACTS_OF_A_PART = 300_000
# However they are spread, no more than this.
_MOST_IMPACTS_OF_A_PART = 1_500_000
# Impacts that are solved at one go: between two stretches a thread can be told to stop.
_IMPACTS_OF_A_STRETCH = 40_000
_LONGEST_STRETCH = 8192
# Stretches of a small grid, for any number of threads to share.
_FEWEST_STRETCHES = 64


class Expected(NamedTuple):
    """How many impacts a point may be expected to have."""

    mean: float
    most: float
    crossings: float = 0.0
    """And junctions crossed, on average: they take as long."""


@dataclass(frozen=True)
class Chunks:
    """How the points of a grid are divided."""

    points: int
    """Points of the grid."""
    size: int
    """Points of a chunk; the last one may have fewer."""
    stretch: int
    """Points that are solved at one go; groups of rows have whole stretches."""

    @staticmethod
    def of(grid: Grid, impacts: Expected) -> Chunks:
        """Divide a grid whose points are expected to have so many impacts."""
        size = _POINTS_OF_A_PART
        if grid.keep.collisions:
            wished = int(_IMPACTS_OF_A_PART / max(impacts.mean, 1.0))
            possible = int(_MOST_IMPACTS_OF_A_PART / max(impacts.most, 1.0))
            size = max(1, min(size, wished, possible))
        return Chunks.of_size(grid, grid.chunk_points or size, impacts)

    @staticmethod
    def of_size(grid: Grid, size: int, impacts: Expected) -> Chunks:
        """Divide a grid into chunks of a known size."""
        stretch = int(_IMPACTS_OF_A_STRETCH / max(impacts.mean, 1.0))
        points = grid.design.points
        stretch = min(stretch, _LONGEST_STRETCH, size, points // _FEWEST_STRETCHES)
        return Chunks(points, size, max(1, stretch))

    @property
    def count(self) -> int:
        """Number of chunks."""
        return -(-self.points // self.size)

    def range_of(self, chunk: int) -> tuple[int, int]:
        """Return the first point of a chunk and the one after its last, from 0."""
        return chunk * self.size, min((chunk + 1) * self.size, self.points)

    def stretches(self, chunk: int) -> list[tuple[int, int]]:
        """Return the stretches of a chunk, each as its first point and the one after its last."""
        first, last = self.range_of(chunk)
        starts = range(first, last, self.stretch)
        return [(start, min(start + self.stretch, last)) for start in starts]


@dataclass(frozen=True)
class Receipt:
    """What is on the disk of one chunk."""

    chunk: int
    points: int
    impacts: int
    invalid: int
    failed: int
    inadmissible: int
    files: dict[str, dict[str, Any]]
    """Size and SHA-256 of each file, by its name in the folder of the grid."""

    def counts(self) -> dict[str, int]:
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
        inadmissible=int(np.count_nonzero(end_cause == "inadmissible")),
        files=files,
    )
