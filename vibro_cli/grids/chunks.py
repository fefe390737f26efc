"""Chunks of a grid: the unit of work, and of the parts on the disk.

What a part holds depends on the grid and on the number of its chunk alone, so that the bytes are
the same from any number of workers, in any order.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vibro_cli.grids.axes import Column
from vibro_cli.grids.document import Grid
from vibro_cli.grids.room import Room
from vibro_cli.grids.solving import Solved, Table
from vibro_cli.grids.systems import system_of_grid
from vibro_cli.grids.tables import impact_table_of, part_file, summary_table
from vibro_cli.storage.files import write_file
from vibro_cli.storage.provenance import entry

# Rows of a part: what readers of parquet like (100,000 and more, also where points have fewer
# impacts than elsewhere), and what a chunk may take of memory.
_POINTS_OF_A_PART = 100_000
_IMPACTS_OF_A_PART = 300_000
# However they are spread, no more than this.
_MOST_IMPACTS_OF_A_PART = 1_500_000
# A part has as many groups of rows as can have so many each.
_ROWS_OF_A_GROUP = 100_000
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
    """Points that are solved at one go; the results do not depend on it."""

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


@dataclass(frozen=True)
class Encoded:
    """The parts of a chunk, ready to be written."""

    files: dict[str, memoryview]
    """Contents by their names in the folder of the grid, the summary's last."""
    receipt: Receipt
    """What will be on the disk, but for its files."""

    def write(self, folder: Path) -> Receipt:
        """Write the parts, each whole or not at all.

        Raises
        ------
        OSError
            If a part cannot be written.
        """
        for name, content in self.files.items():
            write_file(folder / name, content)
        files = {name: entry(content) for name, content in self.files.items()}
        return replace(self.receipt, files=files)


def encode_chunk(
    grid: Grid, chunks: Chunks, chunk: int, solved: Iterable[Solved], room: Room
) -> Encoded:
    """Make the parts of a chunk.

    Parameters
    ----------
    grid, chunks, chunk
        The grid, how it is divided, and the number of the chunk.
    solved
        Its stretches, in order.
    room
        Memory to work in; the parts are there, until the next chunk is made.
    """
    stretches = list(solved)
    indices = np.arange(*chunks.range_of(chunk))
    impacts = sum(one.impacts for one in stretches)
    contents, whole = _contents(grid, chunk, stretches, indices, room)
    return Encoded(contents, receipt_of(chunk, whole["status"], whole["end_cause"], impacts, {}))


def _contents(
    grid: Grid, chunk: int, stretches: list[Solved], indices: Column, room: Room
) -> tuple[dict[str, memoryview], Table]:
    """The files of a chunk, the summary's last, and the columns of its summary."""
    names = file_names(grid, chunk)
    contents: dict[str, memoryview] = {}
    logged = [logged for one in stretches for logged in one.logged]
    for name in grid.kept_tables:
        contents[names[name]] = _impacts_file(grid, name, chunk, logged, indices, room)
    for one in logged:
        one.give_back()
    whole = _whole([one.summary for one in stretches])
    table = summary_table(grid)
    given = [indices + 1, *grid.design.columns(indices).values()]
    columns = dict(zip([column.name for column in table.columns], given, strict=False))
    groups = lambda: [{**columns, **whole}]  # noqa: E731
    contents[names["summary"]] = part_file(grid, table, groups, len(indices), chunk, room)
    return contents, whole


def _impacts_file(
    grid: Grid, name: str, chunk: int, logged: list[Any], indices: Column, room: Room
) -> memoryview:
    """The file of a table of the impacts of a chunk."""
    table, system = impact_table_of(grid, name), system_of_grid(grid)
    counts = system.impact_counts(table, logged, indices)
    starts = group_starts(counts)

    def groups() -> Iterator[Table]:
        for points in np.split(indices, starts):
            yield system.impact_columns(table, logged, points, room)

    return part_file(grid, table, groups, int(counts.sum()), chunk, room)


def group_starts(counts: Column) -> Column:
    """Return the points with which further groups of rows begin, each with about as many rows."""
    until = np.cumsum(counts)
    groups = max(1, int(until[-1]) // _ROWS_OF_A_GROUP)
    shares = until[-1] * np.arange(1, groups) // groups
    starts = np.unique(np.searchsorted(until, shares, side="right"))
    return starts[starts > 0]


def part_bytes(grid: Grid, solved: Solved, indices: Column) -> float:
    """Return how many bytes a point takes on the disk, judged by some of them."""
    contents, _ = _contents(grid, 0, [solved], indices, Room())
    return sum(map(len, contents.values())) / len(indices)


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


def _joined(name: str, tables: list[Table]) -> Any:
    """One column of several tables, freed there; null where a table does not have it."""
    parts = []
    for table in tables:
        if name in table:
            parts.append(table.pop(name))
        else:
            rows = len(next(iter(table.values())))
            parts.append(np.ma.MaskedArray(np.zeros(rows, dtype=np.int64), mask=True))
    if len(parts) == 1:
        return parts[0]
    if any(np.ma.isMaskedArray(part) for part in parts):
        return np.ma.concatenate(parts)  # type: ignore[no-untyped-call]
    return np.concatenate(parts)


def _whole(tables: list[Table]) -> Table:
    return {name: _joined(name, tables) for name in list(tables[0])}
