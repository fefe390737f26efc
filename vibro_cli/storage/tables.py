"""Tables as their systems declare them: to arrow, to bytes, and back from parquet files.

What a column must be is said in `systems.columns`; here it is held to it. Equal columns give equal
bytes: nothing of the machine or of the time goes into a table. Tables of a run grow while it goes
on, and leave memory with each group of rows.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import threading
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from errno import ESTALE
from functools import cache, partial
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vibro_cli.systems import system_named
from vibro_cli.systems.columns import Column, Table


def as_json() -> dict[str, object]:
    """The description of all tables as plain values (`vibro schema tables`)."""
    return {
        table.schema_id: {
            "row": table.row,
            "columns": [
                {
                    key: getattr(column, key)
                    for key in ("name", "type", "unit", "nullable", "description")
                }
                for column in table.columns
            ],
        }
        for table in system_named("trace").tables()
    }


def as_markdown(system: str = "trace") -> str:
    """The description of all tables of a system as Markdown, as it stands in docs/."""
    parts = []
    for table in system_named(system).tables():
        lines = [
            f"`{table.file}.parquet`: {table.row} in each row.",
            "",
            "| column | type | unit | null | meaning |",
            "|---|---|---|---|---|",
        ]
        for column in table.columns:
            null = "yes" if column.nullable else ""
            lines.append(
                f"| `{column.name}` | {column.type} | {column.unit} | {null} "
                f"| {column.description} |"
            )
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


_ARROW_TYPES = {
    "float64": pa.float64(),
    "int64": pa.int64(),
    "bool": pa.bool_(),
    "string": pa.string(),
}
_ENCODINGS = {pa.float64(): "BYTE_STREAM_SPLIT", pa.int64(): "DELTA_BINARY_PACKED"}
# Of the bytes of a double six are noise: more effort makes files smaller by a hundredth or two.
_LEVEL = -5
_JSON_LINES_AT_ONCE = 4096


@dataclass(frozen=True)
class Origin:
    """What a table came from, as it stands in the file's metadata.

    `scenario` is the resolved scenario, `version` that of the program; `more` are further entries.
    """

    scenario: Mapping[str, Any]
    version: str
    more: Mapping[str, str] = field(default_factory=dict)


def arrow_schema(table: Table, origin: Origin) -> pa.Schema:
    """The arrow schema of a table, with units and descriptions of its fields and its origin."""
    scenario = json.dumps(origin.scenario, ensure_ascii=False, allow_nan=False)
    metadata = {
        "vibro:schema": table.schema_id,
        "vibro:version": origin.version,
        "vibro:scenario": scenario,
        "vibro:units": json.dumps({column.name: column.unit for column in table.columns}),
        **origin.more,
    }
    return _row_schema(table).with_metadata(metadata)


@cache
def _row_schema(table: Table) -> pa.Schema:
    return pa.schema(
        pa.field(
            column.name,
            _ARROW_TYPES[column.type],
            nullable=column.nullable,
            metadata={"unit": column.unit, "description": column.description},
        )
        for column in table.columns
    )


def _arrow_column(column: Column, values: Any) -> pa.Array:
    """One column as arrow: masked entries, None and, in a nullable float column, NaN are null."""
    if column.words and values.dtype != object:
        content = _of_numbers(np.ma.getdata(values), column.words)
        return pa.Array.from_buffers(pa.string(), len(values), [None, *content])
    array = values if type(values) is np.ndarray else np.ma.getdata(values)
    mask = _missing(column, values, array)
    if mask is not None and not column.nullable:
        row = int(np.argmax(mask))
        raise ValueError(f"column {column.name!r} has no value in row {row + 1}, and must have one")
    present = None if mask is None else _bits(~mask)
    if column.type == "string":
        content = _string_buffers(array)
    elif column.type == "bool":
        content = [_bits(array.astype(bool, casting="safe", copy=False))]
    else:
        content = [pa.py_buffer(array.astype(column.type, order="C", casting="safe", copy=False))]
    return pa.Array.from_buffers(_ARROW_TYPES[column.type], array.size, [present, *content])


def _missing(column: Column, values: Any, array: Any) -> Any:
    """Flags of the rows without a value; None where every row has one."""
    mask: Any = np.ma.getmask(values)
    if column.type == "float64":
        # The least of numbers with a nan among them is nan: one look, no memory.
        if array.size and math.isnan(array.min()):
            mask = mask | np.isnan(array)
    elif column.type == "string":
        nothing: Any = None
        mask = mask | np.equal(array, nothing)
    return mask if mask is not np.ma.nomask and np.any(mask) else None


# Columns are put together from buffers, and taken apart likewise: arrow's own conversion, of lists
# too, imports pandas where it is installed, which takes longer than a short run.


def _bits(flags: np.ndarray[Any, np.dtype[np.bool_]]) -> pa.Buffer:
    """Flags packed as arrow has them, the first in the lowest bit."""
    return pa.py_buffer(np.packbits(flags, bitorder="little"))


def _string_buffers(words: np.ndarray[Any, np.dtype[Any]]) -> list[pa.Buffer]:
    """Offsets and bytes of words as arrow has them; None takes no bytes."""
    encoded = {word: b"" if word is None else word.encode() for word in set(words.tolist())}
    if len(encoded) == 1:  # as in most columns of words
        (part,) = encoded.values()
        return _repeated(part, len(words))
    parts = [encoded[word] for word in words.tolist()]
    offsets = np.zeros(len(parts) + 1, dtype=np.int32)
    np.cumsum([len(part) for part in parts], out=offsets[1:])
    return [pa.py_buffer(offsets), pa.py_buffer(b"".join(parts))]


def _repeated(word: bytes, count: int) -> list[pa.Buffer]:
    """Offsets and bytes of one word again and again."""
    offsets = np.arange(count + 1, dtype=np.int32) * len(word)
    return [pa.py_buffer(offsets), pa.py_buffer(word * count)]


def _of_numbers(numbers: np.ndarray[Any, np.dtype[Any]], words: Sequence[str]) -> list[pa.Buffer]:
    """Offsets and bytes of words that are given by their numbers, from 0."""
    encoded = [word.encode() for word in words]
    count = len(numbers)
    if count and np.min(numbers) == np.max(numbers):
        return _repeated(encoded[int(numbers[0])], count)
    lengths = np.array([len(word) for word in encoded])
    offsets = np.zeros(count + 1, dtype=np.int32)
    np.cumsum(lengths[numbers], out=offsets[1:])
    padded = np.array(encoded).view(np.uint8).reshape(len(encoded), -1)
    inside = np.arange(padded.shape[1]) < lengths[:, None]
    content = padded[numbers][inside[numbers]]
    return [pa.py_buffer(offsets), pa.py_buffer(content)]


def record_batch(table: Table, columns: Mapping[str, Any]) -> pa.RecordBatch:
    """Rows of a table, `columns` (arrays of equal length), with no word of where they are from.

    Numbers are not copied. Raises `ValueError` when names, types or missing values are not those of
    `table`.
    """
    names = [column.name for column in table.columns]
    if list(columns) != names:
        odd = sorted(set(names) ^ set(columns)) or ["(the order)"]
        raise ValueError(f"columns of {table.name!r} differ from its schema: {', '.join(odd)}")
    arrays = [_arrow_column(column, columns[column.name]) for column in table.columns]
    return pa.RecordBatch.from_arrays(arrays, schema=_row_schema(table))


def to_arrow(table: Table, columns: Mapping[str, Any], origin: Origin) -> pa.Table:
    """The arrow table of `columns` (arrays of equal length).

    Raises `ValueError` when names, types or missing values are not those of `table`.
    """
    return pa.Table.from_batches([record_batch(table, columns)], arrow_schema(table, origin))


def parquet_bytes(data: pa.Table) -> bytes:
    """An arrow table as a parquet file: zstd, floats split by bytes, integers by differences."""
    sink = pa.BufferOutputStream()
    pq.write_table(data, sink, **parquet_options(data.schema))
    content: bytes = sink.getvalue().to_pybytes()
    return content


def parquet_options(schema: pa.Schema, repeated: Collection[str] = ()) -> dict[str, Any]:
    """Return how columns are encoded: by dictionaries those of words, and of `repeated` numbers."""
    encodings = {
        field.name: _ENCODINGS[field.type]
        for field in schema
        if field.type in _ENCODINGS and field.name not in repeated
    }
    words = [field.name for field in schema if pa.types.is_string(field.type)]
    return {
        "use_dictionary": [*words, *repeated],
        "compression": "zstd",
        "compression_level": _LEVEL,
        "column_encoding": encodings,
        "write_page_checksum": True,
    }


def _opened(source: Path | BinaryIO, **options: Any) -> pq.ParquetFile:
    """A parquet file open for reading, its pages to be held to their checksums.

    Arrow takes texts for UTF-8, and names of files in other letters for others; bytes as they are.
    """
    file = pa.OSFile(os.fsencode(source)) if isinstance(source, Path) else source
    return pq.ParquetFile(file, page_checksum_verification=True, **options)


def read_parquet(source: Path | BinaryIO) -> pa.Table:
    """A parquet file as written, its pages held to their checksums.

    Raises `OSError` for a file that cannot be read or is damaged, `pyarrow.ArrowException` for one
    that is no parquet, or has two columns of one name.
    """
    with _opened(source) as file:
        return once_each(file.read())


def once_each(table: pa.Table) -> pa.Table:
    """A table of somebody else, if none of its columns has the name of another.

    Raises `pyarrow.ArrowException` otherwise: names are all that columns are asked for by.
    """
    try:
        names = Counter(table.column_names)
    except UnicodeDecodeError as error:
        raise pa.ArrowInvalid("the name of a column is not in UTF-8") from error
    for name, times in names.items():
        if times > 1:
            raise pa.ArrowInvalid(f"{times} columns are named {name!r}")
    return table


def unit_of(field: pa.Field) -> str:
    """The unit of a column; an empty text for a plain number and for words."""
    return str((field.metadata or {}).get(b"unit", b""), "utf-8")


def units_of_numbers(schema: pa.Schema) -> dict[str, str]:
    """The units of the columns of numbers of a table, by name; an empty text for plain numbers."""
    return {
        field.name: unit_of(field)
        for field in schema
        if pa.types.is_integer(field.type) or pa.types.is_floating(field.type)
    }


def count_rows(path: Path) -> int:
    """Return how many rows a parquet file has; raises as `read_parquet`."""
    with _opened(path) as file:
        return int(file.metadata.num_rows)


def rows_by_group(
    source: Path, rows: slice, columns: Sequence[str] | None = None
) -> Iterator[pa.Table]:
    """Yield some rows of a parquet file as they are read, group by group; one table at least.

    `columns` are those wanted, all by default. Only the groups of rows that they are in are read,
    and held to their checksums; raises as `read_parquet`.
    """
    with _opened(source) as file:
        first, last, _ = rows.indices(file.metadata.num_rows)
        begins = _groups_of(file, first, last)
        if not begins:
            yield _of_groups(file, [], columns)
        for group, begin in begins.items():
            start = max(first - begin, 0)
            yield _of_groups(file, [group], columns).slice(start, max(last - begin - start, 0))


class FileTable:
    """The table of a parquet file, of which columns are read when they are asked for, and kept.

    The file stays open: another one that takes its place is not mixed in. It has what is asked of a
    table of pyarrow here, and its copies are such tables. Raises as `read_parquet`.
    """

    def __init__(self, path: Path) -> None:
        self._file = _opened(path)
        self._columns: dict[str, pa.ChunkedArray] = {}
        self._lock = threading.Lock()
        self.schema = once_each(self._file.schema_arrow.empty_table()).schema
        self.num_rows = self._file.metadata.num_rows

    def select(self, names: Sequence[str]) -> pa.Table:
        """Return a table of some columns."""
        with self._lock:
            missing = [name for name in names if name not in self._columns]
            if missing:
                found = self._read(missing)
                self._columns.update(zip(found.column_names, found.columns, strict=True))
        schema = pa.schema([self.schema.field(name) for name in names], self.schema.metadata)
        return pa.table([self._columns[name] for name in names], schema)

    def _read(self, names: list[str]) -> pa.Table:
        return self._file.read(names)

    def slice(self, first: int, count: int) -> pa.Table:
        """Return some rows."""
        with self._lock:
            begins = _groups_of(self._file, first, first + count)
            start = first - next(iter(begins.values()), first)
            return _of_groups(self._file, list(begins), None).slice(start, count)

    def __reduce__(self) -> tuple[Any, ...]:
        return pa.Table.from_batches, (self.select(self.schema.names).to_batches(), self.schema)


def dataset_of(parts: Sequence[Path]) -> Any:
    """The rows of parquet files, one after another, as pyarrow's dataset; raises as `FileTable`."""
    import pyarrow.dataset as dataset
    from pyarrow.fs import LocalFileSystem

    form = dataset.ParquetFileFormat(page_checksum_verification=True)
    names, local = [os.fsencode(part) for part in parts], LocalFileSystem()
    return dataset.FileSystemDatasetFactory(local, names, form).finish()


class PartsTable(FileTable):
    """The same of a table in the files of a grid, too many to stay open.

    `owner` is what keeps their folder. A reader raises ``OSError`` once they are gone or replaced.
    """

    def __init__(self, parts: Sequence[Path], owner: object) -> None:
        self._parts, self._owner = parts, owner
        self._written = self._times()
        self._data = dataset_of(parts)
        self._columns, self._lock = {}, threading.Lock()
        self.schema, self.num_rows = self._data.schema, self._data.count_rows()

    def _times(self) -> list[int]:
        return [part.stat().st_mtime_ns for part in self._parts]

    def _read(self, names: list[str] | None, rows: int | None = None) -> pa.Table:
        if self._times() != self._written:
            raise OSError(ESTALE, "the table was replaced", str(self._parts[0].parent))
        read = self._data.to_table if rows is None else partial(self._data.head, rows)
        return read(columns=names)

    def slice(self, first: int, count: int) -> pa.Table:
        """Return some rows."""
        return self._read(None, first + count).slice(first)


AnyTable: TypeAlias = pa.Table | FileTable


def _groups_of(file: pq.ParquetFile, first: int, last: int) -> dict[int, int]:
    """The groups that have rows from `first` to before `last`, with the first row of each."""
    sizes = [file.metadata.row_group(n).num_rows for n in range(file.num_row_groups)]
    ends = np.cumsum([0, *sizes])
    groups = np.flatnonzero((ends[:-1] < last) & (ends[1:] > first)).tolist()
    return {group: int(ends[group]) for group in groups}


def _of_groups(
    file: pq.ParquetFile, groups: Sequence[int], columns: Sequence[str] | None
) -> pa.Table:
    found = once_each(file.read_row_groups(groups, columns))
    return found if columns is None else found.select(list(columns))


def schema_of(path: Path) -> pa.Schema:
    """The names, types and units of the columns of a parquet file; raises as `read_parquet`."""
    with _opened(path) as file:
        return file.schema_arrow


def read_column(parts: Sequence[Path], name: str) -> np.ndarray[Any, np.dtype[Any]]:
    """One column of parquet files, one after another; null is NaN in numbers and None in words.

    Raises as `read_parquet`.
    """
    found = []
    for part in parts:
        with _opened(part, read_dictionary=[name]) as file:
            # Group by group, so that no more than the column is ever there.
            groups = [file.read_row_group(n, [name]) for n in range(file.num_row_groups)]
            found += [as_array(rows[name]) for rows in groups or [file.read([name])]]
    return np.concatenate(found)


def as_array(column: pa.ChunkedArray) -> np.ndarray[Any, np.dtype[Any]]:
    """A column as an array; null is NaN in numbers and None in words."""
    if pa.types.is_string(column.type):
        return np.array(column.to_pylist(), dtype=object)
    whole = column.combine_chunks()
    chunks = whole.chunks if isinstance(whole, pa.ChunkedArray) else [whole]
    parts = [_as_array(chunk) for chunk in chunks or [pa.array([], column.type)]]
    return np.concatenate(parts) if len(parts) > 1 else parts[0]


def _as_array(chunk: pa.Array) -> np.ndarray[Any, np.dtype[Any]]:
    if pa.types.is_dictionary(chunk.type):
        # One object for each word, and a last one for null.
        words = np.array([*chunk.dictionary.to_pylist(), None], dtype=object)
        numbers = plain_numbers(chunk.indices)
        found: np.ndarray[Any, np.dtype[Any]] = words[_or_null(chunk, numbers, len(words) - 1)]
        return found
    return _or_null(chunk, plain_numbers(chunk), math.nan)


def _or_null(chunk: pa.Array, numbers: Any, null: float) -> np.ndarray[Any, np.dtype[Any]]:
    """The numbers of an array with another one where it is null."""
    if chunk.null_count == 0:
        return np.asarray(numbers)
    present = _flags(chunk.buffers()[0], chunk)
    return np.where(present, numbers, null)


def plain_numbers(chunk: pa.Array) -> np.ndarray[Any, np.dtype[Any]]:
    """The numbers or flags of an array, anything at all where it is null; numbers are no copy."""
    if pa.types.is_boolean(chunk.type):
        return _flags(chunk.buffers()[1], chunk)
    size = chunk.type.bit_width // 8
    kind = ("f" if pa.types.is_floating(chunk.type) else "i") + str(size)
    content = chunk.buffers()[1] if len(chunk) else b""
    return np.frombuffer(content, kind, len(chunk), size * chunk.offset)


def _flags(bits: Any, chunk: pa.Array) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Flags of an array as arrow has them packed."""
    if not len(chunk):
        return np.empty(0, dtype=np.bool_)
    flags = np.unpackbits(np.frombuffer(bits, np.uint8), bitorder="little")
    return flags[chunk.offset : chunk.offset + len(chunk)].view(np.bool_)


# Rows of a group of a parquet file: where it ends depends on nothing but the table.
GROUP_ROWS = 1 << 16


class _RowWriter:
    """Writes rows to an open binary stream as csv, jsonl, arrow (IPC stream) or parquet.

    The bytes do not depend on how rows are added.
    """

    def __init__(self, sink: BinaryIO | Counted, form: str, schema: pa.Schema) -> None:
        self._sink, self._schema = sink, schema
        self._writer: Any = None
        self._grouped = form == "parquet"
        self._waiting: list[pa.RecordBatch] = []
        if form == "csv":
            from pyarrow import csv

            options = csv.WriteOptions(quoting_style="needed")
            self._writer = csv.CSVWriter(sink, schema, write_options=options)
        elif form == "arrow":
            self._writer = pa.ipc.new_stream(sink, schema)
        elif form == "parquet":
            counted = sink if isinstance(sink, Counted) else Counted(sink)
            self._writer = pq.ParquetWriter(counted, schema, **parquet_options(schema))
        elif form != "jsonl":
            raise ValueError(f"there is no form {form!r} of a table")

    def write(self, rows: pa.Table) -> None:
        """Write rows; of jsonl some thousands of lines at a time, of parquet whole groups."""
        if self._grouped:
            self._waiting += rows.to_batches()
            self._write_groups(GROUP_ROWS)
        elif self._writer is not None:
            self._writer.write_table(rows)
        else:
            self._write_lines(rows)

    def _write_lines(self, rows: pa.Table) -> None:
        for batch in rows.to_batches(max_chunksize=_JSON_LINES_AT_ONCE):
            lines = (json.dumps(r, ensure_ascii=False, allow_nan=False) for r in batch.to_pylist())
            self._sink.write("".join(f"{line}\n" for line in lines).encode())

    def _write_groups(self, least: int) -> None:
        """Write groups of rows that wait, while there are so many."""
        while sum(batch.num_rows for batch in self._waiting) >= least:
            waiting = pa.Table.from_batches(self._waiting, self._schema)
            group = waiting.slice(0, GROUP_ROWS).combine_chunks()
            self._writer.write_table(group, row_group_size=GROUP_ROWS)
            self._waiting = waiting.slice(GROUP_ROWS).to_batches()

    def close(self) -> None:
        """Write what is left and belongs to the end."""
        self._write_groups(1)
        if self._writer is not None:
            self._writer.close()

    def abandon(self) -> None:
        """Write no more, not even the end of a parquet file."""
        self._writer.is_open = False  # else it would write its end when it is collected


def stream(parts: Iterator[pa.Table], form: str, sink: BinaryIO) -> None:
    """Write rows, which come in one part at least, as csv, jsonl, arrow (IPC stream) or parquet.

    Numbers of csv and jsonl read back to the same doubles; null is an empty field or `null`.
    """
    begin = next(parts)
    writer = _RowWriter(sink, form, begin.schema)
    for part in chain([begin], parts):
        writer.write(part)
    writer.close()


class GrowingTable:
    """A table on its way to an open binary stream, row by row as they come (see :func:`stream`)."""

    def __init__(
        self, sink: BinaryIO | Counted, table: Table, origin: Origin, form: str = "parquet"
    ) -> None:
        self._sink = sink
        self._table = table
        self._schema = arrow_schema(table, origin)
        self._rows = _RowWriter(sink, form, self._schema)

    def add(self, columns: Mapping[str, Any]) -> None:
        """Write rows; raises `ValueError` for columns that are not those of the table."""
        self._rows.write(pa.Table.from_batches([record_batch(self._table, columns)], self._schema))
        self._sink.flush()

    def finish(self) -> None:
        """Write what belongs to the end."""
        self._rows.close()
        self._sink.flush()

    def abandon(self) -> None:
        """Write no more, not even an end: a file that was not finished is removed by its owner."""
        self._rows.abandon()


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
