"""`vibro show`: a table on the terminal, with units, or in another form."""

import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
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
from vibro_cli.commands.shared.terminal import json_text, printable, say
from vibro_cli.errors import similar

if TYPE_CHECKING:
    import pyarrow

_ROWS = "20"
_DIGITS = 9
_JSON_ROWS = 4096
_WHOLE = ("arrow", "parquet")
"""Forms with parts of their own, which are those of the whole table."""


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
            help="The first N rows, the last with -N, rows FROM:TO (from 1), or all "
            f"[default: {_ROWS}; with --format and --json all].",
        ),
    ] = None
    columns: Annotated[
        str | None, typer.Option(metavar="A,B,…", help="Only these columns, in this order.")
    ] = None
    form: Annotated[
        TableFormat | None, typer.Option("--format", help="Write the rows in this form.")
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
        given = self.file, _row_range(self._rows), names
        if self.form is not None or self.as_json:
            try:
                _print_whole(_parts(*given, self.form), self.form)
            except (TypeError, ValueError) as error:  # of a table that is not one of ours
                text = f"cannot be shown as {self.form or 'json'}: {' '.join(str(error).split())}"
                text = f"{self.file}: {text} (choose columns with --columns)"
                raise CommandError(text) from error
            return DONE
        chosen, first, total = _read(*given)
        if total == chosen.num_rows == 1 and names is None:
            print("\n".join(_listed(chosen)))
        else:
            width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
            print("\n".join(_blocks(chosen, first, width)))
            shown = (
                f"rows {first + 1} to {first + chosen.num_rows}" if chosen.num_rows else "no row"
            )
            say(f"{shown} of {total}")
        return DONE


def _row_range(text: str) -> tuple[int | None, int | None]:
    """The rows that `--rows` asks for, as the two ends of a slice."""
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
    """Print every row in a form for programs, as JSON if none is named."""
    from vibro_cli.storage.tables import stream, stream_parts

    if form is None:
        for text in _as_json(parts):
            sys.stdout.write(text)
    elif form in _WHOLE:
        stream(next(parts), form, sys.stdout.buffer)
    else:
        stream_parts(parts, form, sys.stdout.buffer)
    sys.stdout.flush()


def _read(
    file: Path, rows: tuple[int | None, int | None], columns: Sequence[str] | None
) -> "tuple[pyarrow.Table, int, int]":
    """Some rows and columns of a file, the first row's number (from 0), and how many there are.

    Raises as `_readable`.
    """
    from vibro_cli.storage.tables import read_rows

    with _readable(file, columns):
        return read_rows(file, slice(*rows), columns)


def _parts(
    file: Path,
    rows: tuple[int | None, int | None],
    columns: Sequence[str] | None,
    form: TableFormat | None,
) -> "Iterator[pyarrow.Table]":
    """The rows of `_read` for a form, as they are read, where the form has no parts of its own."""
    from vibro_cli.storage.tables import rows_by_group

    if form in _WHOLE:
        yield _read(file, rows, columns)[0]
        return
    with _readable(file, columns):
        yield from rows_by_group(file, slice(*rows), columns)


@contextmanager
def _readable(file: Path, columns: Sequence[str] | None) -> Iterator[None]:
    """Read columns of a file in the block.

    Raises `CommandError` when the file is not there, no parquet, or damaged, or lacks a column.
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
        raise CommandError(f"{file}: no parquet table: {' '.join(str(error).split())}") from error


def _check_columns(file: Path, wanted: Sequence[str], known: Sequence[str]) -> None:
    """Raise `CommandError` unless all columns are there, each wanted once."""
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
    """A parquet file in a folder, the summary of a run or grid before others, or what one is."""
    found = sorted(folder.glob("*.parquet")) + sorted(folder.glob("*/*.parquet"))
    if not found:
        return "a parquet file, and it holds none"
    first = min(found, key=lambda path: "summary" not in path.relative_to(folder).parts[0])
    return f"a file like {printable(str(first))}"


def _meta(data: "pyarrow.Table", name: str, key: bytes) -> str:
    """A field's metadata ("" where there are none)."""
    return ((data.schema.field(name).metadata or {}).get(key) or b"").decode(errors="replace")


def _as_json(parts: "Iterator[pyarrow.Table]") -> Iterator[str]:
    """Columns with their units and meanings, and the rows, as the text of a JSON object."""
    begin = next(parts)
    columns = [
        {
            "name": name,
            "unit": _meta(begin, name, b"unit"),
            "description": _meta(begin, name, b"description"),
        }
        for name in begin.column_names
    ]
    before = json_text({"columns": columns, "rows": []})[:-2]
    for part in chain([begin], parts):
        for batch in filter(len, part.to_batches(max_chunksize=_JSON_ROWS)):
            yield before + json_text(batch.to_pylist())[1:-1]
            before = ", "
    yield "]}\n" if before == ", " else f"{before}]}}\n"


def _text(value: Any) -> str:
    """One value as it stands in a terminal's table."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.{_DIGITS}g}" if isinstance(value, float) else printable(str(value))


def _listed(data: "pyarrow.Table") -> Iterator[str]:
    """The one row of a table: a line for each column."""
    names = _aligned([printable(name) for name in data.column_names], False)
    values = _aligned([_text(data[name][0].as_py()) for name in data.column_names], True)
    for name, value, column in zip(names, values, data.column_names, strict=True):
        unit, meaning = (printable(_meta(data, column, key)) for key in (b"unit", b"description"))
        yield f"{name}  {value}  {unit:8}  {meaning}".rstrip()


def _blocks(data: "pyarrow.Table", first: int, width: int | None) -> Iterator[str]:
    """The table as lines, in blocks of as many columns as fit the width, rows numbered from 1."""
    number = _aligned(["row", "", *(str(first + 1 + row) for row in range(data.num_rows))], True)
    block: list[list[str]] = [number]
    used = len(number[0])
    for name in data.column_names:
        values = data[name].to_pylist()
        head = (printable(name), printable(_meta(data, name, b"unit")))
        words = any(isinstance(value, str) for value in values)
        column = _aligned([*head, *map(_text, values)], not words)
        needed = len(column[0]) + 2
        if width is not None and used + needed > width and len(block) > 1:
            yield from _joined(block)
            yield ""
            block, used = [number], len(number[0])
        block.append(column)
        used += needed
    yield from _joined(block)


def _aligned(cells: list[str], right: bool) -> list[str]:
    """Cells of one column, all as wide as the widest: numbers end, words begin in one line."""
    width = max(map(len, cells))
    return [cell.rjust(width) if right else cell.ljust(width) for cell in cells]


def _joined(columns: list[list[str]]) -> Iterator[str]:
    return ("  ".join(cells).rstrip() for cells in zip(*columns, strict=True))
