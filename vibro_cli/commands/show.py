"""`vibro show`: print a table on the terminal with its units, or convert it."""

import math
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibro_cli.commands.shared.error_handling import (
    DONE,
    FAILED,
    CommandError,
    reason,
    suggestion,
)
from vibro_cli.commands.shared.options import TableFormat, json_option, table_files
from vibro_cli.commands.shared.terminal import json_encoder, say
from vibro_cli.errors import exhausted, printable, similar

if TYPE_CHECKING:
    import pyarrow

_ROWS = "20"
_ROWS_AT_ONCE = 4096


@dataclass(frozen=True, kw_only=True)
class ShowCommand:
    """Show a table on the terminal, with its units."""

    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="A parquet table.", autocompletion=table_files)
    ]
    rows: Annotated[
        str | None,
        typer.Option(
            metavar="N",
            help="Show the first N rows, the last N with -N, rows FROM:TO (from 1), or all "
            f"[default: {_ROWS}; all with --format or --json].",
        ),
    ] = None
    columns: Annotated[
        str | None, typer.Option(metavar="A,B,…", help="Show only these columns, in this order.")
    ] = None
    form: Annotated[
        TableFormat | None, typer.Option("--format", help="Print the rows in this format.")
    ] = None
    as_json: Annotated[
        bool, json_option(help="Print columns, units and rows as one JSON object.")
    ] = False

    def __post_init__(self) -> None:
        if self.form is not None and self.as_json:
            raise typer.BadParameter("expected one of --format and --json")
        _row_range(self._rows)

    @property
    def _rows(self) -> str:
        everything = self.form is not None or self.as_json
        return self.rows if self.rows is not None else ("all" if everything else _ROWS)

    def __call__(self) -> int:
        """Print the chosen rows and columns of a table in the chosen form."""
        names = None if self.columns is None else [name.strip() for name in self.columns.split(",")]
        try:
            if self.form is not None or self.as_json:
                _print_whole(_parts(self.file, _row_range(self._rows), names), self.form)
            else:
                self._print_lines(names)
        except (TypeError, ValueError) as error:  # a table of another program
            form = self.form or ("json" if self.as_json else "text")
            text = f"cannot be shown as {form}: {' '.join(str(error).split())}"
            raise CommandError(f"{self.file}: {text} (choose columns with --columns)") from error
        return DONE

    def _print_lines(self, names: Sequence[str] | None) -> None:
        """Print the chosen rows and columns as text."""
        parts = partial(_parts, self.file, _row_range(self._rows))
        chosen, total = _chosen(self.file, _row_range(self._rows), names)
        if total == len(chosen) == 1 and names is None:
            print("\n".join(_listed(next(parts(None)))))
        else:
            width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
            for line in _blocks(parts, names, chosen, width):
                print(line)
            shown = f"rows {chosen.start + 1} to {chosen.stop}" if chosen else "no rows"
            say(f"{shown} of {total}")


def _row_range(text: str) -> tuple[int | None, int | None]:
    """Return the rows chosen by `--rows` as the two ends of a slice."""
    start, colon, stop = text.partition(":")
    try:
        if text == "all":
            return None, None
        if colon:
            first, last = int(start or 1), int(stop) if stop else None
            if first < 1 or (last is not None and last < first):
                raise ValueError(text)
            return first - 1, last
        number = int(text)
    except ValueError as error:
        raise typer.BadParameter(
            f"--rows: found {text!r}, expected N, -N, FROM:TO or all"
        ) from error
    return (0, number) if number >= 0 else (number, None)


def _print_whole(parts: "Iterator[pyarrow.Table]", form: TableFormat | None) -> None:
    """Print all rows in a machine-readable format, JSON by default."""
    from vibro_cli.storage.tables import stream

    if form is None:
        for text in _as_json(parts):
            sys.stdout.write(text)
    else:
        stream(parts, form, sys.stdout.buffer)
    sys.stdout.flush()


def _chosen(
    file: Path, rows: tuple[int | None, int | None], columns: Sequence[str] | None
) -> tuple[range, int]:
    """Return the chosen row numbers (from 0) and the number of rows; raise as `_readable` does."""
    from vibro_cli.storage.tables import count_rows

    with _readable(file, columns):
        total = count_rows(file)
    return range(total)[slice(*rows)], total


def _parts(
    file: Path, rows: tuple[int | None, int | None], columns: Sequence[str] | None
) -> "Iterator[pyarrow.Table]":
    """Yield the chosen rows and columns of a file, part by part; raise as `_readable` does."""
    from vibro_cli.storage.tables import rows_by_group

    with _readable(file, columns):
        yield from rows_by_group(file, slice(*rows), columns)


@contextmanager
def _readable(file: Path, columns: Sequence[str] | None) -> Iterator[None]:
    """Turn errors of reading a file in the block into `CommandError`.

    It is raised when the file is missing, damaged or not parquet, or lacks a column.
    """
    import pyarrow

    from vibro_cli.storage.tables import schema_of

    if file.is_dir():
        raise CommandError(f"{file}: found a folder, expected {_file_like(file)}")
    try:
        if columns is not None:
            _check_columns(file, columns, schema_of(file).names)
        yield
    except FileNotFoundError as error:
        beside = {path.name: path for path in file.parent.glob("*.parquet")}
        close = similar(file.name, beside)
        hint = "" if close is None else f" (did you mean {str(beside[close])!r}?)"
        raise CommandError(f"{file}: no such file{hint}") from error
    except OSError as error:
        raise CommandError(f"{file}: cannot be read: {reason(error)}", FAILED) from error
    except pyarrow.ArrowException as error:
        if exhausted(error):
            raise
        raise CommandError(
            f"{file}: not a parquet table: {' '.join(str(error).split())}"
        ) from error


def _check_columns(file: Path, wanted: Sequence[str], known: Sequence[str]) -> None:
    """Raise `CommandError` unless all columns exist and each is requested once."""
    unknown = [name for name in wanted if name not in known]
    if unknown:
        hint = suggestion(unknown[0], known)
        raise CommandError(
            f"{file}: found no column {unknown[0]!r}{hint}, expected some of {', '.join(known)}"
        )
    twice = [name for name in wanted if wanted.count(name) > 1]
    if twice:
        raise CommandError(
            f"{file}: found the column {twice[0]!r} {wanted.count(twice[0])} times, expected each "
            "column once"
        )


def _file_like(folder: Path) -> str:
    """Suggest a parquet file in a folder, preferably a summary, or say that there is none."""
    found = sorted(folder.glob("*.parquet")) + sorted(folder.glob("*/*.parquet"))
    if not found:
        return "a parquet file; the folder holds none"
    first = min(found, key=lambda path: "summary" not in path.relative_to(folder).parts[0])
    return f"a file like {printable(str(first))}"


def _meta(data: "pyarrow.Table", name: str, key: bytes) -> str:
    """Return an entry of a column's metadata, or "" if it is missing."""
    return ((data.schema.field(name).metadata or {}).get(key) or b"").decode(errors="replace")


def _as_json(parts: "Iterator[pyarrow.Table]") -> Iterator[str]:
    """Yield a JSON object, piece by piece: columns with units and descriptions, and the rows."""
    from vibro_cli.storage.tables import json_rows

    begin, encoder = next(parts), json_encoder()
    columns = [
        {
            "name": name,
            "unit": _meta(begin, name, b"unit"),
            "description": _meta(begin, name, b"description"),
        }
        for name in begin.column_names
    ]
    before = encoder.encode({"columns": columns, "rows": []})[:-2]
    for batch in (batch for part in chain([begin], parts) for batch in part.to_batches()):
        for texts in json_rows(batch, encoder):
            yield before + ", ".join(texts)
            before = ", "
    yield "]}\n" if before == ", " else f"{before}]}}\n"


def _few_rows(parts: "Iterator[pyarrow.Table]") -> "Iterator[pyarrow.RecordBatch]":
    """Return the rows in batches small enough to hold as text in memory."""
    return (batch for part in parts for batch in part.to_batches(max_chunksize=_ROWS_AT_ONCE))


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value + 0.0:.9g}"  # no -0
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return str(value) if isinstance(value, int) else printable(str(value))


def _listed(data: "pyarrow.Table") -> Iterator[str]:
    """Yield the only row of a table, one line for each column."""
    names = [printable(name) for name in data.column_names]
    values = [_text(data[name][0].as_py()) for name in data.column_names]
    left, right = max(map(len, names)), max(map(len, values))
    for name, value, column in zip(names, values, data.column_names, strict=True):
        unit, meaning = (printable(_meta(data, column, key)) for key in (b"unit", b"description"))
        yield f"{name:{left}}  {value:>{right}}  {unit:8}  {meaning}".rstrip()


class _Column:
    """A column of a table on the terminal; numbers are right-aligned, words left-aligned."""

    def __init__(self, head: Sequence[str]) -> None:
        self.head = head
        self.width = max(map(len, head))
        self._words = False

    def fit(self, array: "pyarrow.Array") -> None:
        """Widen the column to fit these values."""
        if not _all_floats(array):
            words = array.to_pylist()
            self.width = max(self.width, *map(len, map(_text, words)), 0)
            self._words = self._words or any(isinstance(value, str) for value in words)
            return
        import numpy as np

        # Only those become text that may be longer than every value so far.
        values = array.to_numpy()
        longest = np.array(_LONGEST)[np.searchsorted(_DECADES, abs(values), "right")] + (values < 0)
        for length in range(longest.max(initial=0), self.width, -1):
            texts = map(_text, set(values[longest == length].tolist()))
            self.width = max(self.width, *map(len, texts), 0)

    def form(self, values: Sequence[Any]) -> str:
        """Return the format of a cell, padded to the column's width."""
        of_number = isinstance(next(iter(values), None), float)
        return f"%{'-' if self._words else ''}{self.width}{'.9g' if of_number else 's'}"


# Floats from each of these magnitudes on have at most so many characters; the first are below all.
_DECADES = (1e-99, 1e-3, 1e-2, 1e-1, 1.0, 1e9, 1e100)
_LONGEST = (15, 14, 13, 12, 11, 10, 14, 15)


def _all_floats(array: "pyarrow.Array") -> bool:
    return str(array.type) == "double" and not array.null_count


def _cells(array: "pyarrow.Array") -> list[Any]:
    """Return the values as texts, or as numbers if all are floats, which is faster."""
    if _all_floats(array):
        return [*(array.to_numpy() + 0.0).tolist()]  # no -0
    return [*map(_text, array.to_pylist())]


def _blocks(
    parts: "Callable[[Sequence[str] | None], Iterator[pyarrow.Table]]",
    names: Sequence[str] | None,
    chosen: range,
    width: int | None,
) -> Iterator[str]:
    """Yield the lines of a table, in blocks of as many columns as fit; number the rows from 1.

    `parts` reads the chosen rows of some columns: once for the widths, and once for each block.
    """
    columns: dict[str, _Column] = {}
    for part in parts(names):
        for name in part.column_names:
            head = printable(name), printable(_meta(part, name, b"unit"))
            columns.setdefault(name, _Column(head))
        for rows in _few_rows(iter([part])):
            for name, column in columns.items():
                column.fit(rows[name])
    number = _Column(["row".rjust(len(str(chosen.stop if chosen else 0))), ""])
    for place, block in enumerate(_fitting(columns, number.width, width)):
        shown = [number, *(columns[name] for name in block)]
        yield from ([""] if place else [])
        yield from _lines(shown, [column.head for column in shown])
        row = chosen.start + 1
        for rows in _few_rows(parts(block)):
            numbers = range(row, row + rows.num_rows)
            yield from _lines(shown, [numbers, *(_cells(rows[name]) for name in block)])
            row = numbers.stop


def _fitting(columns: dict[str, _Column], used: int, width: int | None) -> Iterator[list[str]]:
    """Yield the column names of each block that fits a width, of which `used` is taken."""
    block: list[str] = []
    room = math.inf if width is None else width - used
    left = room
    for name, column in columns.items():
        left -= column.width + 2
        if left < 0 and block:
            yield block
            block, left = [], room - column.width - 2
        block.append(name)
    yield block


def _lines(columns: Sequence[_Column], values: Sequence[Sequence[Any]]) -> Iterator[str]:
    line = "  ".join(column.form(some) for column, some in zip(columns, values, strict=True))
    return ((line % cells).rstrip() for cells in zip(*values, strict=True))
