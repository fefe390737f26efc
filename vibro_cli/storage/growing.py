"""Parquet files that grow: rows are added while a run goes on, and leave memory group by group."""

import hashlib
from collections.abc import Mapping
from typing import Any, BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq

from vibro_cli.storage.tables import (
    Origin,
    arrow_schema,
    json_lines,
    parquet_options,
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
