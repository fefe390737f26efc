"""Conversion of tables to Arrow and to bytes, and reading of Parquet files.

Columns are checked against their declarations (`systems.columns`). Equal columns give equal bytes:
tables contain nothing about the machine or the time. The tables of a run grow while it continues,
and each group of rows is written out as soon as it is complete.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import threading
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from errno import ESTALE
from functools import cache, partial
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vibro_cli import __version__
from vibro_cli.systems.columns import Column, Table

_ARROW_TYPES = {
    "float64": pa.float64(),
    "int64": pa.int64(),
    "bool": pa.bool_(),
    "string": pa.string(),
}
_ENCODINGS = {pa.float64(): "BYTE_STREAM_SPLIT", pa.int64(): "DELTA_BINARY_PACKED"}
# Six of the eight bytes of a double are noise: more effort reduces files by only 1 or 2 per cent.
_LEVEL = -5
_JSON_ROWS_AT_ONCE = 4096
_JSON = json.JSONEncoder(ensure_ascii=False, allow_nan=False)
# Up to so many rows, words are joined in Python, in less time than Arrow needs to import the module
# that does it faster.
_FEW_ROWS = 1 << 10


def arrow_schema(
    table: Table, origin: Mapping[str, Any], more: Mapping[str, str] | None = None
) -> pa.Schema:
    """Return the Arrow schema of a table, with units and descriptions of fields and its origin.

    `origin` is plain data from which the rows were computed, usually the resolved scenario; `more`
    are further entries of the metadata.
    """
    metadata = {
        "vibro:schema": table.schema_id,
        "vibro:version": __version__,
        "vibro:scenario": json.dumps(origin, ensure_ascii=False, allow_nan=False),
        "vibro:units": json.dumps({column.name: column.unit for column in table.columns}),
        **(more or {}),
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
    """Convert a column to Arrow: masked entries, None and NaN in a float column become null."""
    if column.words and values.dtype != object:
        return _words(np.ma.getdata(values), column.words, None)
    array = values if type(values) is np.ndarray else np.ma.getdata(values)
    mask = _missing(column, values, array)
    if mask is not None and not column.nullable:
        row = int(np.argmax(mask))
        raise ValueError(f"column {column.name!r} has no value in row {row + 1}, and must have one")
    present = None if mask is None else _bits(~mask)
    if column.type == "string":
        given = array.tolist()
        codes = {word: code for code, word in enumerate(dict.fromkeys(given))}
        numbers = np.fromiter(map(codes.__getitem__, given), np.int32, len(given))
        return _words(numbers, list(codes), present)
    if column.type == "bool":
        content = _bits(array.astype(bool, casting="safe", copy=False))
    else:
        content = pa.py_buffer(array.astype(column.type, order="C", casting="safe", copy=False))
    return pa.Array.from_buffers(_ARROW_TYPES[column.type], array.size, [present, content])


def _missing(column: Column, values: Any, array: Any) -> Any:
    """Return flags of rows without a value, or None if every row has one."""
    mask: Any = np.ma.getmask(values)
    if column.type == "float64":
        # The minimum is nan if any number is: a fast test without extra memory.
        if array.size and math.isnan(array.min()):
            mask = mask | np.isnan(array)
    elif column.type == "string":
        nothing: Any = None
        mask = mask | np.equal(array, nothing)
    return mask if mask is not np.ma.nomask and np.any(mask) else None


# Columns are assembled from buffers, and read from them: Arrow's own conversion, even of lists,
# imports pandas if it is installed, which takes longer than a short run.


def _bits(flags: np.ndarray[Any, np.dtype[np.bool_]]) -> pa.Buffer:
    """Return flags packed for Arrow, the first in the lowest bit."""
    return pa.py_buffer(np.packbits(flags, bitorder="little"))


def _words(
    codes: np.ndarray[Any, np.dtype[Any]], words: Sequence[str | None], present: pa.Buffer | None
) -> pa.Array:
    """Return words that are given as integer codes, from 0; `present` are flags, None if all are.

    None takes no bytes.
    """
    encoded = [b"" if word is None else word.encode() for word in words]
    if len(codes) <= _FEW_ROWS:
        return _texts([encoded[code] for code in codes.tolist()], present)
    if (codes == codes[0]).all():  # laws and most regimes: Arrow would take far longer
        word, ends = encoded[codes[0]], np.arange(len(codes) + 1, dtype=np.int32)
        return _strings(word * len(codes), len(word) * ends, present)
    numbers = [present, pa.py_buffer(codes.astype(np.int32))]
    indices = pa.Array.from_buffers(pa.int32(), len(codes), numbers)
    return pa.DictionaryArray.from_arrays(indices, _texts(encoded)).dictionary_decode()


def _texts(encoded: Sequence[bytes], present: pa.Buffer | None = None) -> pa.Array:
    """Return texts from their bytes."""
    offsets = np.cumsum([0, *map(len, encoded)], dtype=np.int32)
    return _strings(b"".join(encoded), offsets, present)


def _strings(content: bytes, offsets: Any, present: pa.Buffer | None) -> pa.Array:
    """Return the texts between successive offsets in `content`."""
    buffers = [present, pa.py_buffer(offsets), pa.py_buffer(content)]
    return pa.Array.from_buffers(pa.string(), len(offsets) - 1, buffers)


def record_batch(table: Table, columns: Mapping[str, Any]) -> pa.RecordBatch:
    """Return rows of a table from `columns` (arrays of equal length), without their origin.

    Numbers are not copied. Raises `ValueError` if names, types or missing values differ from the
    declaration.
    """
    names = [column.name for column in table.columns]
    if list(columns) != names:
        odd = sorted(set(names) ^ set(columns)) or ["(the order)"]
        raise ValueError(f"columns of {table.name!r} differ from its schema: {', '.join(odd)}")
    arrays = [_arrow_column(column, columns[column.name]) for column in table.columns]
    return pa.RecordBatch.from_arrays(arrays, schema=_row_schema(table))


def to_arrow(table: Table, columns: Mapping[str, Any], origin: Mapping[str, Any]) -> pa.Table:
    """Return the Arrow table of `columns` (arrays of equal length); `origin` as `arrow_schema`.

    Raises `ValueError` if names, types or missing values differ from the declaration.
    """
    return pa.Table.from_batches([record_batch(table, columns)], arrow_schema(table, origin))


def parquet_bytes(data: pa.Table) -> bytes:
    """Return a table as a Parquet file: zstd, floats split by bytes, integers as differences."""
    sink = pa.BufferOutputStream()
    pq.write_table(data, sink, **parquet_options(data.schema))
    content: bytes = sink.getvalue().to_pybytes()
    return content


def parquet_options(schema: pa.Schema, repeated: Collection[str] = ()) -> dict[str, Any]:
    """Return the encoding of columns; words and `repeated` numbers use dictionaries."""
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
    """Open a Parquet file for reading with verification of page checksums.

    Paths are passed as bytes, since Arrow encodes text as UTF-8 whatever the file system uses.
    """
    file = pa.OSFile(os.fsencode(source)) if isinstance(source, Path) else source
    with _names_in_utf8():
        return pq.ParquetFile(file, page_checksum_verification=True, **options)


@contextmanager
def _names_in_utf8() -> Iterator[None]:
    """Raise `pyarrow.ArrowException` if the name of a column is not in UTF-8."""
    try:
        yield
    except UnicodeDecodeError as error:
        raise pa.ArrowInvalid("the name of a column is not in UTF-8") from error


def read_parquet(source: Path | BinaryIO) -> pa.Table:
    """Read a Parquet file and verify the checksums of its pages.

    Raises `OSError` if it cannot be read or is damaged, `pyarrow.ArrowException` if it is not
    Parquet or has two columns of the same name.
    """
    with _opened(source) as file:
        return once_each(file.read())


def once_each(table: pa.Table) -> pa.Table:
    """Return a foreign table after checking that the names of its columns are unique.

    Raises `pyarrow.ArrowException` otherwise, since columns are accessed by name only.
    """
    with _names_in_utf8():
        names = Counter(table.column_names)
    for name, times in names.items():
        if times > 1:
            raise pa.ArrowInvalid(f"{times} columns are named {name!r}")
    return table


def unit_of(field: pa.Field) -> str:
    """Return the unit of a column, empty for dimensionless numbers and for words."""
    return str((field.metadata or {}).get(b"unit", b""), "utf-8")


def units_of_numbers(schema: pa.Schema) -> dict[str, str]:
    """Return the units of a table's columns of numbers, by name; empty if dimensionless."""
    return {
        field.name: unit_of(field)
        for field in schema
        if pa.types.is_integer(field.type) or pa.types.is_floating(field.type)
    }


def count_rows(path: Path) -> int:
    """Return the number of rows of a Parquet file; raises as `read_parquet`."""
    with _opened(path) as file:
        return int(file.metadata.num_rows)


def rows_by_group(
    source: Path, rows: slice, columns: Sequence[str] | None = None
) -> Iterator[pa.Table]:
    """Yield some rows of a Parquet file, one table per group of rows, and at least one table.

    `columns` are by default all. Of the required groups only pages up to the last row are read and
    verified; raises as `read_parquet`.
    """
    with _opened(source) as file:
        first, last, _ = rows.indices(file.metadata.num_rows)
        begins = _groups_of(file, first, last)
        if not begins:
            yield _of_groups(file, [], columns)
        for group, begin in begins.items():
            start = max(first - begin, 0)
            yield _beginning(file, group, last - begin, columns).slice(start, last - begin - start)


def _beginning(
    file: pq.ParquetFile, group: int, rows: int, columns: Sequence[str] | None
) -> pa.Table:
    """Return the rows of a group up to a number of them."""
    rows, found = min(rows, file.metadata.row_group(group).num_rows), 0
    parts: list[pa.RecordBatch] = []
    batches = file.iter_batches(rows, [group], columns)
    while found < rows:
        part = next(batches, None)
        if part is None:
            raise OSError(f"group {group + 1} of rows: found {found:,} rows, expected {rows:,}")
        parts.append(part)
        found += part.num_rows
    return _in_order(pa.Table.from_batches(parts), columns)


class FileTable:
    """The table in a Parquet file, whose columns are read on first use and kept.

    The file stays open, so that a new file in its place cannot be mixed in. The class has those
    methods of a pyarrow table that are used here; copies are pyarrow tables. Raises as
    `read_parquet`.
    """

    def __init__(self, path: Path) -> None:
        self._file = _opened(path)
        self._columns: dict[str, pa.ChunkedArray] = {}
        self._lock = threading.Lock()
        self.schema = once_each(self._file.schema_arrow.empty_table()).schema
        self.num_rows = self._file.metadata.num_rows

    def select(self, names: Sequence[str]) -> pa.Table:
        """Return a table of these columns."""
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
    """Return the concatenated rows of Parquet files as a pyarrow dataset; raises as `FileTable`."""
    import pyarrow.dataset as dataset
    from pyarrow.fs import LocalFileSystem

    form = dataset.ParquetFileFormat(page_checksum_verification=True)
    names, local = [os.fsencode(part) for part in parts], LocalFileSystem()
    return dataset.FileSystemDatasetFactory(local, names, form).finish()


class PartsTable(FileTable):
    """The table in the files of a grid, which are too many to stay open.

    `owner` keeps their folder alive. Reading raises ``OSError`` once they are removed or replaced.
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
    """Return the groups with rows from `first` up to but excluding `last`, and their first rows."""
    sizes = [file.metadata.row_group(n).num_rows for n in range(file.num_row_groups)]
    ends = np.cumsum([0, *sizes])
    groups = np.flatnonzero(np.maximum(ends[:-1], first) < np.minimum(ends[1:], last)).tolist()
    return {group: int(ends[group]) for group in groups}


def _of_groups(
    file: pq.ParquetFile, groups: Sequence[int], columns: Sequence[str] | None
) -> pa.Table:
    return _in_order(file.read_row_groups(groups, columns), columns)


def _in_order(found: pa.Table, columns: Sequence[str] | None) -> pa.Table:
    """Return a table that was read, with its columns in the order asked for."""
    once_each(found)
    return found if columns is None else found.select(list(columns))


def schema_of(path: Path) -> pa.Schema:
    """Return names, types and units of a Parquet file's columns; raises as `read_parquet`."""
    with _opened(path) as file:
        return file.schema_arrow


def read_column(parts: Sequence[Path], name: str) -> np.ndarray[Any, np.dtype[Any]]:
    """Read a column of Parquet files, concatenated; null becomes NaN in numbers, None in words.

    Raises as `read_parquet`.
    """
    found = []
    for part in parts:
        with _opened(part, read_dictionary=[name]) as file:
            # Group by group, so that memory holds no more than the column.
            groups = [file.read_row_group(n, [name]) for n in range(file.num_row_groups)]
            found += [as_array(rows[name]) for rows in groups or [file.read([name])]]
    return np.concatenate(found)


def as_array(column: pa.ChunkedArray) -> np.ndarray[Any, np.dtype[Any]]:
    """Return a column as an array; null becomes NaN in numbers and None in words."""
    if pa.types.is_string(column.type):
        return np.array(column.to_pylist(), dtype=object)
    parts = [_as_array(chunk) for chunk in column.chunks or [column.combine_chunks()]]
    return np.concatenate(parts) if len(parts) > 1 else parts[0]


def _as_array(chunk: pa.Array) -> np.ndarray[Any, np.dtype[Any]]:
    if pa.types.is_dictionary(chunk.type):
        # One object per word, and a last one for null.
        words = np.array([*chunk.dictionary.to_pylist(), None], dtype=object)
        numbers = plain_numbers(chunk.indices)
        found: np.ndarray[Any, np.dtype[Any]] = words[_or_null(chunk, numbers, len(words) - 1)]
        return found
    return _or_null(chunk, plain_numbers(chunk), math.nan)


def _or_null(chunk: pa.Array, numbers: Any, null: float) -> np.ndarray[Any, np.dtype[Any]]:
    """Return the numbers of an array, with `null` in place of null."""
    if chunk.null_count == 0:
        return np.asarray(numbers)
    present = _flags(chunk.buffers()[0], chunk)
    return np.where(present, numbers, null)


def plain_numbers(chunk: pa.Array) -> np.ndarray[Any, np.dtype[Any]]:
    """Return the numbers (not copied) or flags of an array, arbitrary where it is null."""
    if pa.types.is_boolean(chunk.type):
        return _flags(chunk.buffers()[1], chunk)
    size = chunk.type.bit_width // 8
    kind = ("f" if pa.types.is_floating(chunk.type) else "i") + str(size)
    content = chunk.buffers()[1] if len(chunk) else b""
    return np.frombuffer(content, kind, len(chunk), size * chunk.offset)


def _flags(bits: Any, chunk: pa.Array) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Return the flags of an array from Arrow's packed bits."""
    if not len(chunk):
        return np.empty(0, dtype=np.bool_)
    flags = np.unpackbits(np.frombuffer(bits, np.uint8), bitorder="little")
    return flags[chunk.offset : chunk.offset + len(chunk)].view(np.bool_)


# Rows per group of a Parquet file, so that groups depend on the table only.
GROUP_ROWS = 1 << 16


class GrowingTable:
    """A table that is written to an open binary stream as rows arrive.

    Its form is csv, jsonl, arrow (IPC stream) or parquet. The bytes of Parquet do not depend on how
    rows are divided between calls.
    """

    def __init__(self, sink: BinaryIO | Counted, schema: pa.Schema, form: str = "parquet") -> None:
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

    def write(self, batches: Sequence[pa.RecordBatch]) -> None:
        """Write rows: some thousands of lines at a time for jsonl, whole groups for Parquet."""
        if self._grouped:
            self._waiting += batches
            self._write_groups(GROUP_ROWS)
        else:
            write = self._write_lines if self._writer is None else self._writer.write
            for batch in batches:
                write(batch)
        self._sink.flush()

    def _write_lines(self, rows: pa.RecordBatch) -> None:
        for texts in json_rows(rows, _JSON):
            self._sink.write("\n".join([*texts, ""]).encode())

    def _write_groups(self, least: int) -> None:
        """Write groups from the waiting rows, as long as there are at least `least`."""
        while sum(batch.num_rows for batch in self._waiting) >= least:
            waiting = pa.Table.from_batches(self._waiting, self._schema)
            # A column of a group fits in one page, so its bytes do not depend on the batches.
            self._writer.write_table(waiting.slice(0, GROUP_ROWS), row_group_size=GROUP_ROWS)
            self._waiting = waiting.slice(GROUP_ROWS).to_batches()

    def finish(self) -> None:
        """Write the remaining rows and the end of the file."""
        self._write_groups(1)
        if self._writer is not None:
            self._writer.close()
        self._sink.flush()

    def abandon(self) -> None:
        """Stop writing a Parquet file, without its end; the owner of the file removes it."""
        self._writer.is_open = False  # otherwise garbage collection would write the end


def json_rows(rows: pa.RecordBatch, encoder: json.JSONEncoder) -> Iterator[list[str]]:
    """Yield the rows as JSON objects, some thousands at a time; `encoder` is that of words."""
    from pyarrow import compute

    names = map(encoder.encode, rows.schema.names)
    texts = [f"{', ' if n else '{'}{name}: ".encode() for n, name in enumerate(names)]
    # Arrow would import pandas to convert Python's texts.
    *keys, end, between = _texts([*texts, b"}", b""])
    null = {"null_handling": "replace", "null_replacement": "null"}
    for first in range(0, rows.num_rows, _JSON_ROWS_AT_ONCE):
        columns = rows.slice(first, _JSON_ROWS_AT_ONCE).columns
        values = (_json_texts(column, encoder) for column in columns)
        parts = chain.from_iterable(zip(keys, values, strict=True))
        yield compute.binary_join_element_wise(*parts, end, between, **null).to_pylist()


def _json_texts(column: pa.Array, encoder: json.JSONEncoder) -> pa.Array:
    """Return each value of a column as JSON; numbers by Arrow, five times faster than Python."""
    from pyarrow import compute

    if pa.types.is_integer(column.type) or pa.types.is_boolean(column.type):
        return column.cast(pa.string())
    if column.type == pa.float64() and compute.all(compute.is_finite(column)).as_py() is not False:
        texts = column.cast(pa.string())
        # A whole number must not be read back as an integer, which has no negative zero.
        return compute.replace_substring_regex(texts, r"^(-?\d+)$", r"\1.0")
    return _texts([encoder.encode(value).encode() for value in column.to_pylist()])


def stream(parts: Iterator[pa.Table], form: str, sink: BinaryIO) -> None:
    """Write rows, in one or more parts, as csv, jsonl, arrow (IPC stream) or parquet.

    Numbers in csv and jsonl read back to the same doubles; null is an empty field or `null`.
    """
    begin = next(parts)
    table = GrowingTable(sink, begin.schema, form)
    for part in chain([begin], parts):
        table.write(part.to_batches())
    table.finish()


class Counted:
    """A file that counts its bytes and computes its checksum while it is written."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._sum = hashlib.sha256()
        self._size = 0
        self.closed = False

    def write(self, content: Any) -> int:
        """Write bytes; return their number."""
        self._sum.update(content)
        self._size += len(content)
        self._file.write(content)
        return len(content)

    def tell(self) -> int:
        """Return the number of bytes written."""
        return self._size

    def flush(self) -> None:
        """Do nothing: the file is unbuffered."""

    def close(self) -> None:
        """Do nothing: whoever opened the file closes it."""

    def entry(self) -> dict[str, Any]:
        """Return the file's entry for a manifest."""
        return {"bytes": self._size, "sha256": self._sum.hexdigest()}
