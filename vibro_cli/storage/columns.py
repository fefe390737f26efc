"""Columns of numbers and words from parquet and CSV files of the user."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from vibro_cli.errors import VibroError


class UnreadableTable(VibroError):
    """A file that is no table, or cannot be read; the message says why."""


def read_columns(path: Path) -> dict[str, "np.ndarray[Any, np.dtype[Any]]"]:
    """The columns of a parquet or CSV file as arrays; words are objects.

    Raises `UnreadableTable`, also for missing values.
    """
    try:
        if path.suffix.lower() == ".parquet":
            from vibro_cli.storage.tables import read_parquet

            table = read_parquet(path)
        elif path.suffix.lower() == ".csv":
            from pyarrow import csv

            table = csv.read_csv(path)
        else:
            raise UnreadableTable(f"whose name ends with {path.suffix or 'nothing'}")
    except (OSError, pa.ArrowException) as error:
        text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise UnreadableTable(f"which cannot be read ({' '.join(text.split())[:100]})") from error
    empty = [name for name in table.column_names if table[name].null_count]
    if empty:
        raise UnreadableTable(f"which lacks a value in column {empty[0]}")
    return {name: _array(table[name]) for name in table.column_names}


def _array(column: pa.ChunkedArray) -> "np.ndarray[Any, np.dtype[Any]]":
    if pa.types.is_integer(column.type) or pa.types.is_floating(column.type):
        return np.asarray(column.to_numpy())
    return np.array(column.to_pylist(), dtype=object)
