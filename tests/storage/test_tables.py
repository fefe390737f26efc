"""Columns to parquet and back: units, nulls, bits, damage."""

import csv
import io
import json
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.effort import calls
from tests.fake_run import columns_of
from vibro_cli.storage import tables
from vibro_cli.storage.tables import (
    as_array,
    parquet_bytes,
    read_column,
    read_parquet,
    rows_by_group,
    stream,
    to_arrow,
)
from vibro_cli.systems.columns import Column, Table
from vibro_cli.systems.trace import SYSTEM
from vibro_cli.systems.trace import tables as of_trace

ROOT = Path(__file__).parents[2]
ORIGIN = {"name": "by-hand", "gravity": 9.81}
TABLES = [
    of_trace.collisions(),
    of_trace.collisions(sided=True),
    of_trace.EVENTS,
    of_trace.MOTION,
    SYSTEM.summary(1),
    SYSTEM.summary(5),
]


def file_of(table: Table, columns: dict[str, Any] | None = None) -> bytes:
    return parquet_bytes(to_arrow(table, columns or columns_of(table), ORIGIN))


def written(table: Table, columns: dict[str, Any] | None = None) -> pa.Table:
    return read_parquet(io.BytesIO(file_of(table, columns)))


@pytest.mark.parametrize("table", TABLES, ids=lambda table: f"{table.name}-{len(table.columns)}")
def test_file_keeps_names_types_units_descriptions_and_nullability(table: Table) -> None:
    found = written(table).schema
    assert found.names == [column.name for column in table.columns]
    for column in table.columns:
        kept = found.field(column.name)
        assert str(kept.type).replace("double", "float64") == column.type
        assert kept.nullable == column.nullable
        assert kept.metadata[b"unit"].decode() == column.unit
        assert kept.metadata[b"description"].decode() == column.description


@pytest.mark.parametrize("table", TABLES, ids=lambda table: f"{table.name}-{len(table.columns)}")
def test_missing_values_are_null_and_the_others_keep_their_bits(table: Table) -> None:
    columns = columns_of(table)
    found = written(table, columns)
    for column in table.columns:
        values = found[column.name].to_pylist()
        assert (values[0] is None) == column.nullable
        assert values[1:] == list(columns[column.name][1:])


def test_metadata_hold_the_origin() -> None:
    metadata = written(of_trace.EVENTS).schema.metadata
    assert json.loads(metadata[b"vibro:scenario"]) == ORIGIN
    assert metadata[b"vibro:version"] == version("vibro-cli").encode()
    assert metadata[b"vibro:schema"] == b"events/1"


def test_special_doubles_keep_their_bits() -> None:
    special = np.array([-0.0, 5e-324, np.inf, -np.inf, np.nextafter(1.0, 2.0)])
    columns = columns_of(of_trace.MOTION, special.size)
    columns["speed"] = special
    assert written(of_trace.MOTION, columns)["speed"].to_numpy().tobytes() == special.tobytes()


def test_words_and_strided_columns_are_kept() -> None:
    columns = columns_of(of_trace.EVENTS, 3)
    columns["event"] = np.array(["Übergang", "", "κ→∞"], dtype=object)
    columns["t"] = np.arange(6.0)[::2]
    columns["ball"] = np.ma.MaskedArray(np.arange(6), mask=np.arange(6) == 2)[::2]
    found = written(of_trace.EVENTS, columns)
    assert found["event"].to_pylist() == ["Übergang", "", "κ→∞"]
    assert found["t"].to_pylist() == [0.0, 2.0, 4.0]
    assert found["ball"].to_pylist() == [0, None, 4]


@pytest.mark.parametrize("rows", [0, 1, tables._FEW_ROWS, tables._FEW_ROWS + 1])
def test_words_of_few_and_of_many_rows_are_kept(rows: int) -> None:
    words = ("none", "", "κ→∞", "Übergang")
    table = Table(
        "words",
        "one row",
        (
            Column("coded", "string", "", "a word as its code", words=words),
            Column("same", "string", "", "the same word in every row", words=words),
            Column("given", "string", "", "a word, or none", nullable=True),
        ),
    )
    codes, same = np.arange(rows) % 3, np.full(rows, 3)
    given = [None if row % 5 == 0 else words[row % 4] for row in range(rows)]
    texts = np.array(given, dtype=object)
    found = written(table, {"coded": codes, "same": same, "given": texts})
    assert found["coded"].to_pylist() == [words[code] for code in codes]
    assert found["same"].to_pylist() == [words[3]] * rows
    assert found["given"].to_pylist() == given


def test_writing_does_not_import_pandas() -> None:
    code = """
import sys
from tests.fake_run import columns_of
from vibro_cli.systems.trace import tables as of_trace
from vibro_cli.storage import tables
table = of_trace.EVENTS
tables.parquet_bytes(tables.to_arrow(table, columns_of(table), {}))
sys.exit("pandas" in sys.modules)
"""
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0


def test_columns_are_read_as_arrow_does(tmp_path: Path) -> None:
    names = ["bool", "int", "float", "missing", "gaps", "word", "gap"]
    kinds = [pa.bool_(), pa.int64(), pa.float64(), pa.float64(), pa.int64(), *[pa.string()] * 2]
    rows = [(n % 3 == 0, n, n / 7, n / 3 if n % 2 else None, n if n % 5 else None, f"w{n % 4}",
             None if n % 4 else "w") for n in range(100)]  # fmt: skip
    columns = zip(zip(*rows, strict=True), kinds, strict=True)
    table = pa.table([pa.array(values, kind) for values, kind in columns], names=names)
    for data in (table, table.slice(13, 50), table.slice(13, 0)):
        pq.write_table(data, tmp_path / "table.parquet", row_group_size=30)
        for name in names:
            expected = data[name].to_numpy()
            for found in (as_array(data[name]), read_column([tmp_path / "table.parquet"], name)):
                assert found.dtype.kind == expected.dtype.kind
                np.testing.assert_array_equal(found, expected, err_msg=name)


def test_rows_are_read_from_the_groups_they_are_in(tmp_path: Path) -> None:
    table = pa.table({"n": range(100), "x": [n / 7 for n in range(100)]})
    pq.write_table(table, tmp_path / "table.parquet", row_group_size=30)
    for rows in (
        slice(0, 5),
        slice(28, 61),
        slice(-3, None),
        slice(99, 200),
        slice(7, 7),
        slice(50, 35),
        slice(200, 300),
    ):
        first, last, _ = rows.indices(100)
        for columns in (None, ["x", "n"], ["x"]):
            found = pa.concat_tables(rows_by_group(tmp_path / "table.parquet", rows, columns))
            expected = table if columns is None else table.select(columns)
            assert found.equals(expected.slice(first, last - first))


def test_groups_without_rows_are_passed_over(tmp_path: Path) -> None:
    """Other programs write them."""
    table, file = pa.table({"n": range(5)}), tmp_path / "table.parquet"
    with pq.ParquetWriter(file, table.schema) as writer:
        for part in (table.slice(0, 3), table.slice(3, 0), table.slice(3)):
            writer.write_table(part)
    assert pq.read_metadata(file).num_row_groups == 3
    for rows in (slice(None), slice(3), slice(3, None), slice(3, 3)):
        assert pa.concat_tables(rows_by_group(file, rows)).equals(table[rows])


def test_a_group_with_less_rows_than_it_should_have_is_damaged(tmp_path: Path) -> None:
    file = tmp_path / "table.parquet"
    pq.write_table(pa.table({"n": range(100)}), file)
    hundred, more = b"\x16\xc8\x01", b"\x16\xca\x01"  # 64-bit integers of Thrift
    file.write_bytes(file.read_bytes().replace(hundred, more))
    assert pq.read_metadata(file).row_group(0).num_rows == 101
    with pytest.raises(OSError, match=r"^group 1 of rows: found 100 rows, expected 101$"):
        list(rows_by_group(file, slice(None)))


def test_of_a_group_only_the_pages_up_to_the_last_row_are_read(tmp_path: Path) -> None:
    table = pa.table({"x": [n / 7 for n in range(10_000)]})
    file = tmp_path / "table.parquet"
    pq.write_table(
        table, file, data_page_size=1000, write_page_checksum=True, use_dictionary=False,
        compression="none",
    )  # fmt: skip
    data = bytearray(file.read_bytes())
    last = pq.read_metadata(file).row_group(0).column(0)
    data[last.data_page_offset + last.total_compressed_size - 100] ^= 1
    file.write_bytes(data)
    (found,) = rows_by_group(file, slice(20, 30))
    assert found.equals(table.slice(20, 10))
    with pytest.raises(OSError, match="CRC"):
        list(rows_by_group(file, slice(9_990, None)))


def test_an_empty_table_is_written_with_its_schema() -> None:
    found = written(of_trace.collisions(), columns_of(of_trace.collisions(), 0))
    assert found.num_rows == 0
    assert found.schema.field("t").metadata[b"unit"] == b"s"


def test_bytes_do_not_depend_on_how_rows_are_divided() -> None:
    """As the lengths of stretches do not: of either engine, or of a run that was continued."""
    rng, rows = np.random.default_rng(4), 2 * tables.GROUP_ROWS + 12_345
    words = pa.array(["left", "right", "none"])
    columns = {
        "number": pa.array(rng.normal(size=rows), mask=rng.random(rows) < 0.3),
        "count": pa.array(rng.integers(-(1 << 62), 1 << 62, rows), mask=rng.random(rows) < 0.1),
        "flag": pa.array(rng.random(rows) < 0.5),
        "word": words.take(pa.array(rng.integers(0, 3, rows))),
    }
    whole = pa.record_batch(columns)

    def written(lengths: list[int]) -> bytes:
        sink = io.BytesIO()
        growing = tables.GrowingTable(sink, whole.schema)
        ends = np.cumsum(lengths).tolist()
        for end, length in zip(ends, lengths, strict=True):
            growing.write([whole.slice(end - length, length)])
        growing.finish()
        return sink.getvalue()

    once = written([rows])
    assert pq.read_table(io.BytesIO(once)).equals(pa.table(columns))
    for most in (1000, 50_000, 100_000):
        lengths = rng.integers(0, most, rows).tolist()
        used = int(np.searchsorted(np.cumsum(lengths), rows))
        lengths = [*lengths[:used], rows - sum(lengths[:used])]
        assert written(lengths) == once


def test_equal_input_gives_equal_bytes() -> None:
    table = of_trace.collisions()
    one, other = (file_of(table, columns_of(table, 5000)) for _ in range(2))
    assert one == other


def test_columns_are_encoded_as_declared() -> None:
    table = of_trace.EVENTS
    group = pq.ParquetFile(io.BytesIO(file_of(table)))
    chunks = group.metadata.row_group(0)
    for position, column in enumerate(table.columns):
        chunk = chunks.column(position)
        assert chunk.compression == "ZSTD"
        expected = {"float64": "BYTE_STREAM_SPLIT", "int64": "DELTA_BINARY_PACKED"}
        assert expected.get(column.type, "RLE_DICTIONARY") in chunk.encodings


def test_every_flipped_bit_of_the_data_is_noticed() -> None:
    table = of_trace.MOTION
    content = file_of(table, columns_of(table, 200))
    chunk = pq.ParquetFile(io.BytesIO(content)).metadata.row_group(0).column(0)
    page_end = chunk.data_page_offset + chunk.total_compressed_size
    for place in range(page_end - 40, page_end):
        damaged = bytearray(content)
        damaged[place] ^= 1
        with pytest.raises(OSError, match="CRC checksum"):
            read_parquet(io.BytesIO(bytes(damaged)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda columns: columns.pop("speed"), "speed"),
        (lambda columns: columns.update(extra=columns["t"]), "extra"),
        (lambda columns: columns.update(t=columns.pop("t")), "the order"),
        (lambda columns: columns["t"].__setitem__(1, np.nan), "'t' has no value in row 2"),
    ],
    ids=["missing", "unknown", "order", "null"],
)
def test_columns_that_differ_from_the_schema_are_refused(change: Any, message: str) -> None:
    columns = columns_of(of_trace.MOTION)
    change(columns)
    with pytest.raises(ValueError, match=message):
        to_arrow(of_trace.MOTION, columns, ORIGIN)


def test_a_column_of_another_type_is_refused() -> None:
    columns = columns_of(of_trace.MOTION)
    columns["arc"] = columns["t"]
    with pytest.raises(TypeError, match="int64"):
        to_arrow(of_trace.MOTION, columns, ORIGIN)


@pytest.mark.parametrize("form", ["csv", "jsonl", "arrow", "parquet"])
def test_streams_read_back_to_the_same_doubles(form: str) -> None:
    table = of_trace.EVENTS
    columns = columns_of(table, 10_000)
    columns["t"] = np.random.default_rng(1).standard_normal(10_000) ** 9
    sink = io.BytesIO()
    stream(iter([to_arrow(table, columns, ORIGIN)]), form, sink)
    sink.seek(0)
    if form == "csv":
        rows = csv.DictReader(sink.getvalue().decode().splitlines())
        found = np.array([float(row["t"]) for row in rows])
    elif form == "jsonl":
        found = np.array([json.loads(line)["t"] for line in sink])
    elif form == "arrow":
        found = pa.ipc.open_stream(sink).read_all()["t"].to_numpy()
    else:
        found = read_parquet(sink)["t"].to_numpy()
    assert found.tobytes() == columns["t"].tobytes()


def test_null_is_an_empty_field_of_csv_and_null_in_json_lines() -> None:
    table = of_trace.EVENTS
    data = to_arrow(table, columns_of(table, 1), ORIGIN)
    commas, lines = io.BytesIO(), io.BytesIO()
    stream(iter([data]), "csv", commas)
    stream(iter([data]), "jsonl", lines)
    assert next(csv.DictReader(commas.getvalue().decode().splitlines()))["value"] == ""
    assert json.loads(lines.getvalue())["value"] is None


def test_json_lines_hold_what_those_of_python_hold() -> None:
    doubles = [5.0, -0.0, 1e22, 1e-5, 5e-324, -1.7e308, 0.1, None]
    rows: dict[str, Any] = {
        'a"b%s': doubles,
        "n": [*range(-3, 4), None],
        "single": pa.array([0.1] * 8, pa.float32()),
        "flag": [True, None, False, True] * 2,
        "word": ["é", 'x"\n', None, ""] * 2,
        "list": [[1.5], [], None, [2.5, None]] * 2,
    }
    data, lines = pa.table(rows), io.BytesIO()
    stream(iter([data]), "jsonl", lines)
    expected = [json.dumps(row, ensure_ascii=False) for row in data.to_pylist()]
    found = lines.getvalue().decode().splitlines()
    # By their texts in Python: 5 equals 5.0, and 0 equals -0.0.
    assert [repr(json.loads(line)) for line in found] == [repr(json.loads(x)) for x in expected]


def test_numbers_in_json_lines_are_not_written_one_by_one() -> None:
    """Rows were made dictionaries, and each of those a text: 36 s for a million impacts."""
    x = np.random.default_rng(1).standard_normal(4000)
    data = pa.table({"n": range(4000), "x": x, "y": -x})
    assert calls(lambda: stream(iter([data]), "jsonl", io.BytesIO())) < 4000


def test_an_unknown_form_is_refused() -> None:
    data = to_arrow(of_trace.MOTION, columns_of(of_trace.MOTION), ORIGIN)
    with pytest.raises(ValueError, match="no form 'xlsx'"):
        stream(iter([data]), "xlsx", io.BytesIO())


def test_pandas_reads_the_file(tmp_path: Path) -> None:
    table = of_trace.collisions()
    path = tmp_path / "collisions.parquet"
    path.write_bytes(file_of(table))
    assert list(pd.read_parquet(path)["n"]) == [0, 1, 2]
