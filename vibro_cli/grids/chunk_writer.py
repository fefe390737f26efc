"""The parts of a chunk: files built in memory as stretches arrive, then written to disk."""

from __future__ import annotations

import json
import mmap
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vibro_cli.grids.axes import Array
from vibro_cli.grids.chunks import Chunks, Receipt, file_names, receipt_of
from vibro_cli.grids.document import Grid
from vibro_cli.grids.solving import (
    SUMMARY,
    Solved,
    end_to_end,
    impact_table_of,
    summary_table,
)
from vibro_cli.storage.files import MemoryFile, entry, replace_file
from vibro_cli.storage.tables import (
    arrow_schema,
    parquet_options,
    plain_numbers,
    record_batch,
)
from vibro_cli.systems.columns import Table
from vibro_cli.systems.contract import Columns


@dataclass(frozen=True)
class Encoded:
    """The parts of a chunk, ready to be written."""

    files: Mapping[str, MemoryFile]
    """Contents by name in the folder of the grid, the summary last."""
    receipt: Receipt
    """Receipt of the chunk, without its files."""

    def write(self, folder: Path) -> Receipt:
        """Write each part atomically and release its memory; return the complete receipt.

        Raises `OSError` if a part cannot be written.
        """
        files = {}
        for name, content in self.files.items():
            # Opening the folder has removed what is left of killed processes: to look for it among
            # the parts for each would take quadratic time.
            replace_file(folder / name, *content.pieces())
            files[name] = entry(*content.pieces())
            content.release()
        return replace(self.receipt, files=files)


class ChunkWriter:
    """The unfinished parts of a chunk with a number of stretches.

    `indices` are the indices of its points in the grid, from 0; `spare` is the memory for its
    parts, see :class:`MemoryFile`.
    """

    def __init__(
        self, grid: Grid, chunk: int, indices: Array, stretches: int, spare: list[mmap.mmap]
    ) -> None:
        self._grid = grid
        self._chunk = chunk
        self._indices = indices
        self._stretches = stretches
        self._spare = spare
        self._lock = threading.Lock()
        self._busy = False
        self._come: dict[int, Solved] = {}
        self._summaries: list[Columns] = []
        self._impacts = 0
        self._parts = {
            name: part_file(grid, impact_table_of(grid, name), chunk, MemoryFile(spare))
            for name in grid.kept_tables
        }

    @staticmethod
    def of(grid: Grid, chunks: Chunks, chunk: int, spare: list[mmap.mmap]) -> ChunkWriter:
        """Return a writer for a chunk, with empty parts."""
        indices = np.arange(*chunks.range_of(chunk))
        return ChunkWriter(grid, chunk, indices, len(chunks.stretches(chunk)), spare)

    def add(self, number: int, solved: Solved) -> Encoded | None:
        """Add a stretch, given by its index from 0, in any order and from any thread.

        Consecutive stretches are encoded as soon as possible, by one thread at a time. Returns the
        parts to the thread that completes them, None to all others.
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

    def _following(self) -> list[Solved] | None:
        """Return the next stretches in order, None without any or if another thread encodes."""
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
        for name, part in self._parts.items():
            part.take(solved.kept[name])

    def _whole(self) -> Encoded:
        """Return the parts, once all stretches have been added."""
        names = file_names(self._grid, self._chunk)
        contents = {names[name]: part.finish() for name, part in self._parts.items()}
        # The pieces of each column are freed as soon as it is complete.
        whole = {
            name: end_to_end([one.pop(name) for one in self._summaries])
            for name in list(self._summaries[0])
        }
        table = summary_table(self._grid)
        given = [self._indices + 1, *self._grid.design.columns(self._indices).values()]
        columns = dict(zip([column.name for column in table.columns], given, strict=False))
        file = part_file(self._grid, table, self._chunk, MemoryFile(self._spare))
        file.add([record_batch(table, {**columns, **whole})])
        contents[names["summary"]] = file.finish()
        receipt = receipt_of(self._chunk, whole["status"], whole["end_cause"], self._impacts, {})
        return Encoded(contents, receipt)


def part_bytes(grid: Grid, solved: Sequence[Solved], indices: Array) -> float:
    """Return the number of bytes per point on disk, estimated from stretches of solved points."""
    writer = ChunkWriter(grid, 0, indices, len(solved), [])
    *_, made = [writer.add(number, stretch) for number, stretch in enumerate(solved)]
    assert made is not None
    return sum(map(len, made.files.values())) / len(indices)


# Columns of impacts by which readers select scenarios or times.
_ORDERED = ("scenario", "n", "t")
# Least number of rows of a group, except for the last one of a part; groups have whole stretches.
_ROWS_OF_A_GROUP = 100_000
# Size of a page (bytes), which must fit in the cache while it is split, compressed and checksummed.
_PAGE = 1 << 17
# Number of bytes passed on at a time to Python, which needs the interpreter's lock.
_PASSED_ON = 1 << 20
# Number of values sampled to decide whether a column has few distinct ones.
_SAMPLE = 512


class PartFile:
    """An unfinished Parquet file in the empty file `content`.

    It is encoded as by `tables.parquet_bytes`, except that columns with few distinct numbers in the
    first group use a dictionary, and that pages fit in the processor's cache. Minima and maxima of
    row groups, by which readers skip groups, are stored for the columns `skipped_by` only.
    """

    def __init__(self, schema: pa.Schema, skipped_by: Sequence[str], content: MemoryFile) -> None:
        self._schema = schema
        self._skipped_by = list(skipped_by)
        self._waiting: list[pa.RecordBatch] = []
        self._content = content
        self._sink = pa.BufferedOutputStream(pa.PythonFile(content, "w"), _PASSED_ON)
        self._writer: Any = None

    def take(self, batch: pa.RecordBatch) -> None:
        """Add rows, which are kept until their group is complete."""
        self._waiting.append(batch)
        if sum(one.num_rows for one in self._waiting) >= _ROWS_OF_A_GROUP:
            self.add(self._waiting)

    def add(self, batches: Sequence[pa.RecordBatch]) -> None:
        """Write a group of rows, and release the batches."""
        group = pa.Table.from_batches(batches, self._schema)
        if self._writer is None:
            self._writer = self._begun(group)
        self._writer.write_table(group, row_group_size=max(group.num_rows, 1))
        self._waiting = []

    def finish(self) -> MemoryFile:
        """Return the complete file, with at least one group."""
        if self._waiting and (self._writer is None or any(one.num_rows for one in self._waiting)):
            self.add(self._waiting)
        self._writer.close()
        self._sink.flush()
        return self._content

    def _begun(self, group: pa.Table) -> pq.ParquetWriter:
        """Return the writer of the file, whose encoding depends on the first group of rows."""
        numbers = [one.name for one in self._schema if pa.types.is_floating(one.type)]
        return pq.ParquetWriter(
            self._sink,
            self._schema,
            write_statistics=self._skipped_by,
            data_page_size=_PAGE,
            **parquet_options(self._schema, [name for name in numbers if _has_few(group[name])]),
        )


def _has_few(column: pa.ChunkedArray) -> bool:
    """Return whether a sample of a column has few distinct numbers."""
    # Sample the joined chunks, as their boundaries depend on how the points were solved.
    values = np.concatenate([np.empty(0), *map(plain_numbers, column.chunks)])
    step = max(1, len(values) // _SAMPLE)
    return len(np.unique(values[::step])) <= len(values[::step]) // 8


def part_file(grid: Grid, table: Table, chunk: int, content: MemoryFile) -> PartFile:
    """Return a file for a part of a table; equal rows of equal grids give equal bytes.

    The part belongs to ``table`` and ``chunk``; `content` is empty.
    """
    resolved = grid.resolved()
    definition = json.dumps(resolved, ensure_ascii=False, allow_nan=False)
    more = {"vibro:grid": definition, "vibro:part": str(chunk)}
    schema = arrow_schema(table, resolved["scenario"], more)
    skipped_by = [name for name in schema.names if table.name == SUMMARY or name in _ORDERED]
    return PartFile(schema, skipped_by, content)
