"""`vibro show`: rows and columns on the terminal and in other forms."""

import io
import json
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.commands.conftest import Vibro
from tests.effort import calls
from tests.fake_run import columns_of
from vibro_cli.commands import show
from vibro_cli.storage import tables
from vibro_cli.storage.tables import parquet_bytes, read_parquet, to_arrow
from vibro_cli.systems.trace import tables as of_trace


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """A table of events with 50 rows."""
    path = tmp_path / "events.parquet"
    columns = columns_of(of_trace.EVENTS, 50)
    data = to_arrow(of_trace.EVENTS, columns, {"name": "x"})
    path.write_bytes(parquet_bytes(data))
    return path


def row_numbers(text: str) -> list[int]:
    return [int(line.split()[0]) for line in text.splitlines() if line.split()[0].isdigit()]


def test_the_table_has_names_units_and_aligned_numbers(vibro: Vibro, table: Path) -> None:
    outcome = vibro("show", table, "--columns", "t,speed,ball", "--rows", "2")
    assert outcome.text.splitlines() == [
        "row            t       speed  ball",
        "               s         m/s",
        "  1  0.333333333           -     -",
        "  2   1.33333333  701.333333   201",
    ]
    assert outcome.err == "rows 1 to 2 of 50\n"


def test_the_only_row_of_a_table_is_listed_by_column(vibro: Vibro, tmp_path: Path) -> None:
    """With some of its columns it is a table as any other."""
    pq.write_table(pa.table({"mass": [2.5], "name": ["x"]}), tmp_path / "one.parquet")
    listed = [line.split() for line in vibro("show", "one.parquet").text.splitlines()]
    assert listed == [["mass", "2.5"], ["name", "x"]]
    chosen = vibro("show", "one.parquet", "--columns", "mass,name").text.splitlines()
    assert [chosen[0].split(), chosen[-1].split()] == [["row", "mass", "name"], ["1", "2.5", "x"]]


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        (None, range(1, 21)),
        ("3", range(1, 4)),
        ("-3", range(48, 51)),
        ("10:12", range(10, 13)),
        ("49:", range(49, 51)),
        (":2", range(1, 3)),
        ("all", range(1, 51)),
        ("70", range(1, 51)),
        ("-70", range(1, 51)),
        ("60:70", range(0)),
        ("0", range(0)),
    ],
)
def test_rows_are_chosen_by_number(
    vibro: Vibro, table: Path, rows: str | None, expected: range
) -> None:
    outcome = vibro("show", table, *(() if rows is None else ("--rows", rows)))
    assert outcome.code == 0
    assert row_numbers(outcome.text) == list(expected)


@pytest.mark.parametrize("rows", ["x", "0:3", "5:4", "1:2:3", ""])
def test_rows_that_cannot_be_are_wrong_usage(vibro: Vibro, table: Path, rows: str) -> None:
    outcome = vibro("show", table, "--rows", rows)
    assert outcome.code == 2
    assert "expected N, -N, FROM:TO or all" in outcome.err


def test_json_has_units_and_all_rows(vibro: Vibro, table: Path) -> None:
    (found,) = vibro("show", table, "--json", "--columns", "t,event").lines
    assert [column["unit"] for column in found["columns"]] == ["s", ""]
    assert len(found["rows"]) == 50
    assert found["rows"][1] == {"t": 1 + 1 / 3, "event": "event-1"}


def test_other_forms_have_all_rows_unless_told(vibro: Vibro, table: Path, tmp_path: Path) -> None:
    assert vibro("show", table, "--format", "csv").text.count("\n") == 51
    assert len(vibro("show", table, "--format", "jsonl", "--rows", "5").lines) == 5
    copy = tmp_path / "copy.parquet"
    copy.write_bytes(vibro("show", table, "--format", "parquet").out)
    assert copy.read_bytes() == table.read_bytes()


@pytest.mark.parametrize("form", ["csv", "jsonl", "json", "arrow", "parquet", "text"])
@pytest.mark.parametrize("rows", ["all", "8:33", "15:15", "60:70"])
def test_of_a_long_table_no_more_than_a_group_of_rows_is_there(
    vibro: Vibro, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: str, rows: str
) -> None:
    data = pa.table({"n": range(50), "x": [n / 7 for n in range(50)]})
    pq.write_table(data, tmp_path / "long.parquet", row_group_size=10)
    read: list[int] = []

    def read_groups(file: Any, groups: Any, columns: Any) -> pa.Table:
        read.append(len(groups))
        return real(file, groups, columns)

    def read_beginning(file: Any, group: Any, rows: Any, columns: Any) -> pa.Table:
        read.append(1)
        return real_beginning(file, group, rows, columns)

    real, real_beginning = tables._of_groups, tables._beginning
    monkeypatch.setattr(tables, "_of_groups", read_groups)
    monkeypatch.setattr(tables, "_beginning", read_beginning)
    options = {"json": ["--json"], "text": []}.get(form, ["--format", form])
    outcome = vibro("show", "long.parquet", "--rows", rows, *options)
    assert outcome.code == 0
    chosen = {"all": slice(0, 50), "8:33": slice(7, 33), "15:15": slice(14, 15)}
    expected = data.to_pylist()[chosen.get(rows, slice(0))]
    if form == "json":
        empty = {"unit": "", "description": ""}
        columns = [{"name": name, **empty} for name in ("n", "x")]
        assert outcome.text == json.dumps({"columns": columns, "rows": expected}) + "\n"
    elif form == "jsonl":
        assert outcome.lines == expected
    elif form == "arrow":
        assert pa.ipc.open_stream(outcome.out).read_all().to_pylist() == expected
    elif form == "parquet":
        assert pq.read_table(io.BytesIO(outcome.out)).to_pylist() == expected
    elif form == "text":
        found = [line.split() for line in outcome.text.splitlines()[1:] if line.strip()]
        shown = [[str(row["n"] + 1), str(row["n"]), f"{row['x']:.9g}"] for row in expected]
        assert found == shown
    else:
        lines = outcome.text.splitlines()
        assert lines[0] == '"n","x"'
        found = [line.split(",") for line in lines[1:]]
        assert [{"n": int(n), "x": float(x)} for n, x in found] == expected
    assert max(read) == (rows != "60:70")
    # The widths of a terminal's table are read first.
    assert len(read) == {"all": 5, "8:33": 4}.get(rows, 1) * (1 + (form == "text"))


def test_a_wide_table_is_cut_into_blocks_that_fit(table: Path) -> None:
    data = read_parquet(table).slice(0, 3)

    def parts(names: Sequence[str] | None) -> Iterator[pa.Table]:
        yield data.select(names or data.column_names)

    blocks = "\n".join(show._blocks(parts, None, range(3), 40)).split("\n\n")
    assert len(blocks) > 1
    names = [name for block in blocks for name in block.splitlines()[0].split()[1:]]
    assert names == data.column_names
    for block in blocks:
        assert all(len(line) <= 40 for line in block.splitlines())
        assert [line.split()[0] for line in block.splitlines()[2:]] == ["1", "2", "3"]


def damaged(content: bytes) -> bytes:
    """A file with one bit flipped in the data of its first column."""
    first = pq.ParquetFile(io.BytesIO(content)).metadata.row_group(0).column(0)
    place = first.data_page_offset + first.total_compressed_size - 10
    return content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :]


@pytest.mark.parametrize(
    ("change", "code", "message"),
    [
        (lambda path: path.unlink(), 2, "no such file"),
        (lambda path: path.write_text("t,event\n"), 2, "not a parquet table"),
        (lambda path: path.write_bytes(b""), 2, "not a parquet table"),
        (lambda path: path.write_bytes(damaged(path.read_bytes())), 1, "CRC checksum"),
        (lambda path: (path.unlink(), path.mkdir()), 2, "found a folder"),
    ],
    ids=["missing", "text", "empty", "damaged", "folder"],
)
def test_a_file_that_is_no_table_is_one_line(
    vibro: Vibro, table: Path, change: Any, code: int, message: str
) -> None:
    change(table)
    outcome = vibro("show", table)
    assert outcome.code == code
    assert outcome.out == b""
    assert outcome.err.startswith(f"{table}: ")
    assert message in outcome.err
    assert outcome.err.count("\n") == 1


@pytest.mark.parametrize("form", [[], ["--json"], ["--format", "csv"], ["--columns", "t"]])
def test_a_table_with_two_columns_of_one_name_is_one_line(
    vibro: Vibro, table: Path, form: list[str]
) -> None:
    twice = pa.table([pa.array([1.0]), pa.array([2.0])], names=["t", "t"])
    pq.write_table(twice, table)
    outcome = vibro("show", table, *form)
    assert outcome.code == 2
    assert outcome.err == f"{table}: not a parquet table: 2 columns are named 't'\n"


def test_a_table_of_a_like_name_is_suggested(vibro: Vibro, table: Path) -> None:
    missing = table.with_name("event.parquet")
    outcome = vibro("show", missing)
    assert outcome.err == f"{missing}: no such file (did you mean '{table}'?)\n"


def test_an_unknown_column_is_named_with_those_there_are(vibro: Vibro, table: Path) -> None:
    outcome = vibro("show", table, "--columns", "t,speeed")
    assert outcome.code == 2
    assert (
        "found no column 'speeed' (did you mean 'speed'?), expected some of t, event, ball"
        in outcome.err
    )


@pytest.mark.parametrize("form", [[], ["--json"], ["--format", "csv"]])
def test_a_column_named_twice_is_told(vibro: Vibro, table: Path, form: list[str]) -> None:
    outcome = vibro("show", table, "--columns", "t,speed,t", *form)
    assert outcome.code == 2
    assert "found the column 't' 2 times, expected each column once" in outcome.err


def test_format_and_json_exclude_each_other(vibro: Vibro, table: Path) -> None:
    assert vibro("show", table, "--json", "--format", "csv").code == 2


def test_numbers_of_json_are_exact(vibro: Vibro, table: Path) -> None:
    rows = json.loads(vibro("show", table, "--json").text)["rows"]
    assert [row["t"] for row in rows] == list(columns_of(of_trace.EVENTS, 50)["t"])


def test_rows_of_json_are_not_written_value_by_value(vibro: Vibro, tmp_path: Path) -> None:
    """They are as many objects and as exact as if Python had written each."""
    numbers = [(-1) ** n * 1.1 ** (n - 5000) for n in range(10_000)]
    words = ["κ", 'a "b"', None, "line\nbreak"] * 2500
    data = pa.table({"n": range(10_000), "x": numbers, "word": words})
    pq.write_table(data, tmp_path / "long.parquet", row_group_size=3000)
    (found,) = vibro("show", "long.parquet", "--json").lines
    assert found["rows"] == data.to_pylist()
    parts = [data.select(["n", "x"])]
    assert calls(lambda: deque(show._as_json(iter(parts)), maxlen=0)) < 1000


def test_json_is_ascii_where_the_terminal_is(
    vibro: Vibro, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pq.write_table(pa.table({"κ": ["µ", "🎱"]}), tmp_path / "words.parquet")
    monkeypatch.setattr(show, "json_encoder", json.JSONEncoder)
    outcome = vibro("show", "words.parquet", "--json")
    assert outcome.out.isascii()
    assert outcome.lines[0]["rows"] == [{"κ": "µ"}, {"κ": "🎱"}]


@pytest.mark.parametrize(
    ("names", "named"),
    [
        (["collisions.parquet", "summary.parquet"], "a file like done/summary.parquet"),
        (
            ["collisions/part-000000.parquet", "summary/part-000000.parquet"],
            "a file like done/summary/part-000000.parquet",
        ),
        (["motion.parquet"], "a file like done/motion.parquet"),
        (["notes.txt"], "a parquet file; the folder holds none"),
    ],
)
def test_of_a_folder_a_file_is_named_that_is_there(
    vibro: Vibro, names: list[str], named: str
) -> None:
    for name in names:
        Path("done", name).parent.mkdir(parents=True, exist_ok=True)
        Path("done", name).touch()
    outcome = vibro("show", "done")
    assert (outcome.code, outcome.err) == (2, f"done: found a folder, expected {named}\n")


def test_words_begin_where_the_name_of_their_column_does(vibro: Vibro, table: Path) -> None:
    lines = vibro("show", table, "--columns", "t,event,ball", "--rows", "10:11").text.splitlines()
    assert [line.index("event") for line in (lines[0], *lines[2:])] == [lines[0].index("event")] * 3
    assert {len(line) for line in (lines[0], *lines[2:])} == {len(lines[0])}


def test_a_column_of_floats_is_as_wide_as_its_longest_text() -> None:
    """Bounds of the lengths exclude values: none may be below a length, alone or among others."""
    digits = (1.0, 1.5, 1.23456789, 9.99999999, 9.999999994, 9.9999999951, 9.9999999999999)
    values = [
        sign * float(f"{digit!r}e{power}")
        for power in range(-324, 308)
        for digit in digits
        for sign in (1, -1)
    ]
    values += [0.0, -0.0, float("inf"), float("-inf"), float("nan")]
    lengths = [len(f"{value + 0.0:.9g}") for value in values]
    for value, length in zip(values, lengths, strict=True):
        assert column_width([value]) == length
    for first in range(0, len(values), 7):
        assert column_width(values[first : first + 50]) == max(lengths[first : first + 50])


def column_width(values: list[float]) -> int:
    column = show._Column(["", ""])
    column.fit(pa.array(values))
    return column.width


def test_floats_beside_missing_ones_look_as_without(vibro: Vibro, tmp_path: Path) -> None:
    """Columns of floats alone become text line by line, others value by value."""
    values = [-0.0, 1 / 3, -1e-5, 1e300, float("inf"), float("nan"), 123456789.5, 2.0]
    table = pa.table({"all": values, "some": [*values[:-1], None]})
    pq.write_table(table, tmp_path / "some.parquet")
    lines = vibro("show", "some.parquet").text.splitlines()
    found = [line.split()[1:] for line in lines[2:]]
    assert [row[0] for row in found] == [f"{value + 0.0:.9g}" for value in values]
    assert [row[1] for row in found] == [row[0] for row in found[:-1]] + ["-"]
    assert {len(line) for line in (lines[0], *lines[2:])} == {len(lines[0])}
