"""Tables for Python: columns as numpy arrays, Arrow interface, and reading of users' files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from vibro_cli.errors import counted, exhausted

if TYPE_CHECKING:
    import pandas
    import polars

    from vibro_cli.storage.tables import AnyTable


def read_table(path: Path) -> pa.Table:
    """Read a user's table from a Parquet or CSV file, distinguished by its suffix.

    Raises `OSError` if the file cannot be read, `pyarrow.ArrowException` if it is not a table.
    """
    from vibro_cli.storage.tables import once_each, read_parquet

    suffix = path.suffix.lower()
    if suffix not in (".parquet", ".csv"):
        raise pa.ArrowInvalid(f"found the suffix {path.suffix!r}, expected .csv or .parquet")
    with path.open("rb") as stream:  # errors of Arrow's own open do not name the file
        if suffix == ".parquet":
            found = read_parquet(stream)
            found.validate(full=True)  # words may not be in UTF-8
            return found
        from pyarrow import csv

        table = csv.read_csv(stream)
        # In a header such as `n, t` or `"n", "t"` the blank would belong to the name.
        names = once_each(table).column_names
        return once_each(table.rename_columns([*map(_bare, names)]))


def _bare(name: str) -> str:
    """Return a name in the header of a CSV file without blanks and quotes around it."""
    bare = name.strip()
    return bare[1:-1] if bare != name and bare[:1] == bare[-1:] == '"' else bare


def read_columns(path: Path) -> dict[str, np.ndarray[Any, np.dtype[Any]]]:
    """Read the columns of a Parquet or CSV file as arrays; words are objects.

    Raises `ValueError`, with the reason, if it cannot be read or has missing values.
    """
    try:
        table = read_table(path)
    except (OSError, pa.ArrowException) as error:
        if exhausted(error):
            raise
        text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise ValueError(f"which cannot be read ({' '.join(text.split())[:100]})") from error
    for name in table.column_names:
        if table[name].null_count:
            row = table[name].is_null().index(True).as_py() + 1
            raise ValueError(f"which lacks a value in row {row} of column {name}")
    from_csv = path.suffix.lower() == ".csv"
    return {name: _array(table[name], from_csv) for name in table.column_names}


def _array(column: pa.ChunkedArray, from_csv: bool) -> np.ndarray[Any, np.dtype[Any]]:
    if pa.types.is_integer(column.type) or pa.types.is_floating(column.type):
        return np.asarray(column.to_numpy())
    values = column.to_pylist()
    return np.array([*map(cell, values)] if from_csv else values, dtype=object)


def cell(value: Any) -> Any:
    """Convert a field of a CSV file to a number if possible.

    Arrow reads a column with any word as words.
    """
    for number in (int, float) if isinstance(value, str) else ():
        with suppress(ValueError):
            return number(value)
    return value


_SHOWN = 5
"""Number of rows shown in notebooks."""


class Table:
    """The columns of a table by name, each a numpy array of shape ``(rows,)``.

    Units and meanings are in ``units`` and ``descriptions``. Missing values are NaN in numbers and
    None in words; a column of integers or booleans with missing values is a masked array. Arrays
    are read-only; ``.copy()`` returns a writable one.

    The table can be used like a dictionary (``table["t"]``, ``"t" in table``, ``dict(table)``). It
    has the Arrow PyCapsule interface, so that polars, pyarrow and duckdb accept it directly, for
    instance ``polars.DataFrame(run.collisions)``.

    Parameters
    ----------
    name
        Name of its file, without the suffix.
    data
        A pyarrow table, with units and descriptions in the metadata of its fields, or a table in a
        file, whose columns are read on demand.
    """

    def __init__(self, name: str, data: AnyTable) -> None:
        self.name = name
        self._data = data

    @property
    def rows(self) -> int:
        """Number of rows."""
        return int(self._data.num_rows)

    @property
    def _rows_text(self) -> str:
        return counted(self.rows, "row")

    @property
    def units(self) -> dict[str, str]:
        """Unit of every column: "" for dimensionless numbers and for words."""
        return self._field_metadata(b"unit")

    @property
    def descriptions(self) -> dict[str, str]:
        """Meaning of every column."""
        return self._field_metadata(b"description")

    def _field_metadata(self, key: bytes) -> dict[str, str]:
        return {one.name: (one.metadata or {}).get(key, b"").decode() for one in self._data.schema}

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a column; raises ``KeyError`` with the known names."""
        if name not in self:
            names = ", ".join(self)
            raise KeyError(f"{self.name} has no column {name!r}, only {names}")
        return _as_array(self._data.select([name])[name])

    # Not a collections.abc.Mapping: polars would use its arrays, which lose missing values.

    def keys(self) -> list[str]:
        """Return the names of the columns."""
        return list(self._data.schema.names)

    def values(self) -> list[NDArray[Any]]:
        """Return the columns."""
        return [self[name] for name in self]

    def items(self) -> list[tuple[str, NDArray[Any]]]:
        """Return names and columns."""
        return [(name, self[name]) for name in self]

    def __contains__(self, name: object) -> bool:
        return name in self._data.schema.names

    def __iter__(self) -> Iterator[str]:
        return iter(self.keys())

    def __array__(self, *_: object, **__: object) -> NDArray[Any]:
        # Otherwise pandas and numpy would read it as the sequence of its column names.
        raise TypeError(f"{self.name} is not an array: expected a column, or to_pandas()")

    def __len__(self) -> int:
        """Return the number of columns, as for a dictionary; ``rows`` is the number of rows."""
        return len(self._data.schema)

    def to_arrow(self) -> pa.Table:
        """Return the table as a pyarrow table."""
        return self._data.select(self._data.schema.names)

    def __arrow_c_schema__(self) -> object:
        return self._data.schema.__arrow_c_schema__()

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        return self.to_arrow().__arrow_c_stream__(requested_schema)

    def to_pandas(self) -> pandas.DataFrame:
        """Return a pandas data frame; raises ``ImportError`` if pandas is not installed."""
        _check_installed("pandas")
        return self.to_arrow().to_pandas()

    def to_polars(self) -> polars.DataFrame:
        """Return a polars data frame; raises ``ImportError`` if polars is not installed."""
        _check_installed("polars")
        import polars

        return polars.DataFrame(self.to_arrow())

    def _ipython_key_completions_(self) -> list[str]:
        """Return what IPython and notebooks complete within ``table["``."""
        return self.keys()

    def __repr__(self) -> str:
        return f"<Table {self.name}: {self._rows_text}, {counted(len(self), 'column')}>"

    def _repr_html_(self) -> str:
        """Return the first rows as HTML, for notebooks."""
        heads = "".join(
            f"<th>{escape(f'{name} [{unit}]' if unit else name)}</th>"
            for name, unit in self.units.items()
        )
        rows = "".join(
            f"<tr>{''.join(f'<td>{escape(_shown(value))}</td>' for value in row.values())}</tr>"
            for row in self._data.slice(0, _SHOWN).to_pylist()
        )
        first = f", the first {_SHOWN}" if self.rows > _SHOWN else ""
        caption = f"{escape(self.name)}: {self._rows_text}{first}"
        # A wide table scrolls on its own, with its caption in view.
        begin = f'<table><caption style="text-align: left">{caption}</caption>'
        return f'<div style="overflow-x: auto">{begin}<tr>{heads}</tr>{rows}</table></div>'


def _as_array(column: pa.ChunkedArray) -> NDArray[Any]:
    numbers = pa.types.is_floating(column.type)
    if column.null_count == 0 or numbers or pa.types.is_string(column.type):
        return np.asarray(column.to_numpy())
    missing = column.is_null().to_numpy()
    empty = False if pa.types.is_boolean(column.type) else 0
    return np.ma.MaskedArray(column.fill_null(empty).to_numpy(), missing)


def _shown(value: Any) -> str:
    if value is None:
        return "–"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _check_installed(library: str) -> None:
    if find_spec(library) is None:
        raise ImportError(
            f"to_{library}() needs {library}, which is not installed: pip install {library}"
        )
