"""Large parquet files, made group of rows by group of rows in memory that is there already."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vibro_cli.storage.tables import numbers_in, parquet_options, plain_numbers, words_in

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
