"""Large parquet files, written group of rows by group of rows.

Those of a run grow while it goes on, and leave memory with each group; those of a grid are made in
memory that is there already.
"""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vibro_cli.storage.tables import (
    Origin,
    arrow_schema,
    json_lines,
    numbers_in,
    parquet_options,
    plain_numbers,
    record_batch,
    words_in,
)
from vibro_cli.systems.columns import Table

# Rows of a group: where it ends depends on nothing but the table.
GROUP_ROWS = 1 << 16


class GrowingTable:
    """A table on its way to a file; its bytes do not depend on how rows are added.

    Parameters
    ----------
    file
        Open for writing.
    table, origin
        What the columns must be, and what stands in the file's metadata.
    """

    def __init__(self, file: BinaryIO, table: Table, origin: Origin) -> None:
        self._table = table
        self._file = Counted(file)
        schema = arrow_schema(table, origin)
        self._schema = schema
        self._writer = pq.ParquetWriter(
            self._file, schema, use_dictionary=words_in(schema), **parquet_options(schema)
        )
        self._waiting: list[pa.RecordBatch] = []
        self._rows = 0

    def add(self, columns: Mapping[str, Any]) -> None:
        """Add rows; raises `ValueError` for columns that are not those of the table."""
        batch = record_batch(self._table, columns)
        self._waiting.append(batch)
        self._rows += batch.num_rows
        while self._rows >= GROUP_ROWS:
            self._write(GROUP_ROWS)

    def finish(self) -> dict[str, Any]:
        """Write the rest and the end of the file; return what a manifest says of it."""
        if self._rows or not self._writer.writer:
            self._write(self._rows)
        self._writer.close()
        return self._file.entry()

    def abandon(self) -> None:
        """Write no more, not even an end: a file that was not finished is removed by its owner."""
        self._writer.is_open = False  # else it would write its end when it is collected

    def _write(self, count: int) -> None:
        waiting = pa.Table.from_batches(self._waiting, self._schema)
        group = waiting.slice(0, count).combine_chunks()
        self._writer.write_table(group, row_group_size=max(count, 1))
        self._waiting = waiting.slice(count).to_batches()
        self._rows -= count


class StreamedTable:
    """A table on its way to an open binary stream, row by row as they come (see `tables.stream`).

    Parameters
    ----------
    form
        csv, jsonl, arrow or parquet.
    """

    def __init__(self, sink: BinaryIO, form: str, table: Table, origin: Origin) -> None:
        self._sink = sink
        self._table = table
        schema = arrow_schema(table, origin)
        self._schema = schema
        self._writer: Any = None
        if form == "csv":
            from pyarrow import csv

            options = csv.WriteOptions(quoting_style="needed")
            self._writer = csv.CSVWriter(sink, schema, write_options=options)
        elif form == "arrow":
            self._writer = pa.ipc.new_stream(sink, schema)
        elif form == "parquet":
            self._growing = GrowingTable(sink, table, origin)
        elif form != "jsonl":
            raise ValueError(f"there is no form {form!r} of a table")
        self._form = form

    def add(self, columns: Mapping[str, Any]) -> None:
        """Write rows; raises `ValueError` for columns that are not those of the table."""
        if self._form == "parquet":
            self._growing.add(columns)
            return
        rows = pa.Table.from_batches([record_batch(self._table, columns)], self._schema)
        if self._writer is not None:
            self._writer.write_table(rows)
        else:
            for lines in json_lines(rows):
                self._sink.write(lines)
        self._sink.flush()

    def finish(self) -> None:
        """Write what belongs to the end."""
        if self._form == "parquet":
            self._growing.finish()
        elif self._writer is not None:
            self._writer.close()
        self._sink.flush()


class Counted:
    """A file of which size and checksum are known when it is written."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._sum = hashlib.sha256()
        self._size = 0
        self.closed = False

    def write(self, content: Any) -> int:
        """Write bytes; returns how many."""
        self._sum.update(content)
        self._size += len(content)
        self._file.write(content)
        return len(content)

    def tell(self) -> int:
        """Return how many bytes are written."""
        return self._size

    def flush(self) -> None:
        """Nothing waits here."""

    def close(self) -> None:
        """Leave the file to whoever has opened it."""

    def entry(self) -> dict[str, Any]:
        """Return what a manifest says of the file."""
        return {"bytes": self._size, "sha256": self._sum.hexdigest()}


Room = Callable[[int], Any]

# Bytes of a page, which is split, compressed and summed up before the next one: in the cache.
_PAGE = 1 << 17
# Numbers by which it is judged whether a column has few different ones.
_SAMPLE = 512
# Memory is asked for so many groups like the first one; what is not written to costs nothing.
_GROUPS_AT_FIRST = 8
# What a file takes at its end (bytes), and for each group.
_AT_THE_END, _OF_A_GROUP = 1 << 20, 1 << 16


class PartFile:
    """A parquet file in the making, in memory that `room(bytes)` gives.

    It is encoded as by `tables.parquet_bytes`, but numbers of which the first group has only a few
    different ones go into a dictionary, and pages stay in the processor's cache. The least and
    largest value of row groups, by which readers skip them, is there of the columns `skipped_by`
    only.
    """

    def __init__(self, room: Room, schema: pa.Schema, skipped_by: Sequence[str]) -> None:
        self._room = room
        self._schema = schema
        self._skipped_by = list(skipped_by)
        self._groups: list[list[int]] = []
        self._few: list[str] = []
        self._writer: Any = None

    def add(self, batches: Sequence[pa.RecordBatch]) -> None:
        """Write a group of rows; the batches are not needed afterwards."""
        group = pa.Table.from_batches(batches, self._schema)
        if self._writer is None:
            self._few = [n for n in numbers_in(self._schema) if _has_few(group[n])]
            self._begin(_GROUPS_AT_FIRST * _most_bytes(group) + _AT_THE_END)
        elif self._sink.tell() + _most_bytes(group) + _AT_THE_END > len(self._block):
            self._move(2 * len(self._block) + _most_bytes(group))
        self._write(group)
        self._groups.append([batch.num_rows for batch in batches])

    def finish(self) -> memoryview:
        """Return the whole file, once at least one group is written."""
        self._writer.close()
        return memoryview(self._block)[: self._sink.tell()]

    def _begin(self, size: int) -> None:
        self._block = self._room(size)
        self._sink = pa.FixedSizeBufferWriter(pa.py_buffer(self._block))
        self._writer = pq.ParquetWriter(
            self._sink,
            self._schema,
            use_dictionary=[*words_in(self._schema), *self._few],
            write_statistics=self._skipped_by,
            data_page_size=_PAGE,
            **parquet_options(self._schema, self._few),
        )

    def _write(self, group: pa.Table) -> None:
        self._writer.write_table(group, row_group_size=max(group.num_rows, 1))

    def _move(self, size: int) -> None:
        """Go on in more memory: what is written already is read and written again."""
        before = pq.ParquetFile(pa.BufferReader(pa.py_buffer(self.finish())))
        self._begin(size)
        for number, lengths in enumerate(self._groups):
            rows = before.read_row_group(number).combine_chunks()
            ends = np.cumsum(lengths).tolist()
            batches = [
                batch
                for end, length in zip(ends, lengths, strict=True)
                for batch in rows.slice(end - length, length).to_batches()
            ]
            self._write(pa.Table.from_batches(batches, self._schema))


def _most_bytes(group: pa.Table) -> int:
    """The most that a group of rows can take in a file."""
    return int(group.nbytes) * 5 // 4 + _OF_A_GROUP


def _has_few(column: pa.ChunkedArray) -> bool:
    """Whether a column seems to repeat a few numbers, judged by some of them."""
    # Of all rows: how they lie in chunks depends on how the points were solved.
    values = np.concatenate([np.empty(0), *map(plain_numbers, column.chunks)])
    step = max(1, len(values) // _SAMPLE)
    return len(np.unique(values[::step])) <= len(values[::step]) // 8
