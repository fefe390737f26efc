"""The parts of a chunk, made as its stretches come: files in memory, then on the disk."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from vibro_cli.grids.axes import Array
from vibro_cli.grids.buffers import Room, Rooms
from vibro_cli.grids.chunks import Chunks, Receipt, file_names, receipt_of
from vibro_cli.grids.document import Grid
from vibro_cli.grids.solving import Columns, Solved, impact_table_of, part_file, summary_table
from vibro_cli.storage.files import write_file
from vibro_cli.storage.parquet_files import PartFile
from vibro_cli.storage.provenance import entry
from vibro_cli.storage.tables import record_batch

# A group of rows has no fewer, but for the last one of a part; it has whole stretches.
_ROWS_OF_A_GROUP = 100_000


@dataclass(frozen=True)
class Encoded:
    """The parts of a chunk, ready to be written."""

    files: Mapping[str, memoryview]
    """Contents by their names in the folder of the grid, the summary's last."""
    receipt: Receipt
    """What will be on the disk, but for its files."""
    give_back: Callable[[], None]
    """Called once the contents are not needed any more."""

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


@dataclass
class _Part:
    """A part of impacts in the making."""

    file: PartFile
    batches: list[pa.RecordBatch] = field(default_factory=list)
    """Rows that wait for their group to be whole."""
    solved: list[Solved] = field(default_factory=list)
    """The stretches they are of."""
    groups: int = 0


class Making:
    """The parts of a chunk in the making.

    Parameters
    ----------
    grid, chunk
        The grid, and the number of the chunk.
    indices, stretches
        Numbers of its points, from 0 in the grid, and how many stretches they make.
    rooms
        Memory for the parts; it is taken with the first group of rows.
    """

    def __init__(
        self, grid: Grid, chunk: int, indices: Array, stretches: int, rooms: Rooms
    ) -> None:
        self._grid = grid
        self._chunk = chunk
        self._indices = indices
        self._stretches = stretches
        self._rooms = rooms
        self._taken: Room | None = None
        self._lock = threading.Lock()
        self._busy = False
        self._come: dict[int, Solved] = {}
        self._summaries: list[Columns] = []
        self._impacts = 0
        self._parts = {
            name: _Part(part_file(grid, impact_table_of(grid, name), chunk, self._room))
            for name in grid.kept_tables
        }
        # Stretches whose rows some parts still need.
        self._needed: dict[int, int] = {}

    @staticmethod
    def of(grid: Grid, chunks: Chunks, chunk: int, rooms: Rooms) -> Making:
        """Return the parts of a chunk, with nothing in them."""
        indices = np.arange(*chunks.range_of(chunk))
        return Making(grid, chunk, indices, len(chunks.stretches(chunk)), rooms)

    def add(self, number: int, solved: Solved) -> Encoded | None:
        """Take in a stretch, given by its number from 0, in any order and from any thread.

        What can be encoded is, by one thread at a time. Returns the parts to the thread that makes
        them whole, None to all others.
        """
        with self._lock:
            self._come[number] = solved
        while (following := self._following()) is not None:
            for one in following:
                self._take(one)
            if len(self._summaries) == self._stretches:
                return self._whole()
            with self._lock:
                self._busy = False
        return None

    def _room(self, name: str, size: int) -> Array:
        if self._taken is None:
            self._taken = self._rooms.take()
        return self._taken(name, size)

    def _following(self) -> list[Solved] | None:
        """The next stretches in order, for the thread that calls; none if another one is at it."""
        with self._lock:
            number, found = len(self._summaries), []
            while not self._busy and number in self._come:
                found.append(self._come.pop(number))
                number += 1
            if not found:
                return None
            self._busy = True
            return found

    def _take(self, solved: Solved) -> None:
        self._summaries.append(solved.summary)
        self._impacts += solved.impacts
        if self._parts:
            self._needed[id(solved)] = len(self._parts)
        for name, part in self._parts.items():
            part.batches.append(solved.kept[name])
            part.solved.append(solved)
            if sum(batch.num_rows for batch in part.batches) >= _ROWS_OF_A_GROUP:
                self._end_group(part)

    def _end_group(self, part: _Part) -> None:
        """Write the rows of a part that wait, and give back what is not needed any more."""
        part.file.add(part.batches)
        part.groups += 1
        part.batches.clear()
        for solved in part.solved:
            self._needed[id(solved)] -= 1
            if not self._needed[id(solved)]:
                del self._needed[id(solved)]
                solved.give_back()
        part.solved.clear()

    def _whole(self) -> Encoded:
        """The parts, once all stretches are taken in."""
        contents: dict[str, memoryview] = {}
        names = file_names(self._grid, self._chunk)
        for name, part in self._parts.items():
            if part.batches and (part.groups == 0 or any(b.num_rows for b in part.batches)):
                self._end_group(part)
            contents[names[name]] = part.file.finish()
        whole = {name: _joined(name, self._summaries) for name in list(self._summaries[0])}
        table = summary_table(self._grid)
        given = [self._indices + 1, *self._grid.design.columns(self._indices).values()]
        columns = dict(zip([column.name for column in table.columns], given, strict=False))
        file = part_file(self._grid, table, self._chunk, self._room)
        file.add([record_batch(table, {**columns, **whole})])
        contents[names["summary"]] = file.finish()
        receipt = receipt_of(self._chunk, whole["status"], whole["end_cause"], self._impacts, {})
        assert self._taken is not None
        return Encoded(contents, receipt, partial(self._rooms.give_back, self._taken))


def part_bytes(grid: Grid, solved: Solved, indices: Array) -> float:
    """Return how many bytes a point takes on the disk, judged by some of them."""
    made = Making(grid, 0, indices, 1, Rooms()).add(0, solved)
    assert made is not None
    return sum(map(len, made.files.values())) / len(indices)


def _joined(name: str, tables: list[Columns]) -> Any:
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
