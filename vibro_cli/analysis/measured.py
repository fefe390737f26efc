"""Measured instants of impacts, from a table of a file or of Python."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.errors import VibroError

Floats = NDArray[np.float64]

COLUMNS = ("t", "n", "error", "ball_a", "ball_b")


class NotMeasured(VibroError, ValueError):
    """A table that does not tell of instants of impacts; the message says which row and why."""


@dataclass(frozen=True)
class Measured:
    """Measured instants of impacts."""

    number: NDArray[np.int64]
    """Which impact of the motion each is, from 1"""
    t: Floats
    """s"""
    error: Floats | None = None
    """Standard deviation of each, s"""
    pairs: NDArray[np.int64] | None = None
    """[row, 2] numbers of the bodies, from 1, if they are known"""


def read_measured(file: str | Path) -> Measured:
    """Return the measured instants in a CSV or parquet file, told by its suffix.

    Columns as of :func:`measured_of`; a run's own ``collisions.parquet`` is such a file.

    Raises
    ------
    NotMeasured
        With the file, the row and what was expected.
    OSError
        If the file cannot be read.
    """
    import pyarrow as pa

    from vibro_cli.storage.tables import read_parquet

    path = Path(file)
    try:
        if path.suffix == ".csv":
            from pyarrow import csv

            with path.open("rb") as stream:
                table = csv.read_csv(stream)
        elif path.suffix == ".parquet":
            table = read_parquet(path)
        else:
            raise NotMeasured(
                f"{path}: found the suffix {path.suffix!r}, expected .csv or .parquet"
            )
    except pa.ArrowException as error:
        raise NotMeasured(f"{path}: cannot be read as a table: {error}") from error
    columns = {
        name: table.column(name).to_pylist() for name in COLUMNS if name in table.column_names
    }
    try:
        return measured_of(columns)
    except NotMeasured as error:
        raise NotMeasured(f"{path}: {error}") from error


def measured_of(columns: Mapping[str, Any]) -> Measured:
    """Return the measured instants of a table.

    Parameters
    ----------
    columns
        ``t`` (s), growing; if not every impact was measured ``n``, which one each is, from 1; if
        their errors differ ``error``, the standard deviation (s); if the bodies are known
        ``ball_a`` and ``ball_b``, their numbers from 1.

    Raises
    ------
    NotMeasured
        With the row and what was expected.
    """
    if "t" not in columns:
        raise NotMeasured("found no column 't', expected the instants of impacts (s)")
    t = _numbers(columns, "t")
    if not len(t):
        raise NotMeasured("found no row, expected the instants of impacts (s)")
    _check(t > 0.0, t, "t", "an instant after the start, greater than 0")
    _check_growing(t, "t")
    number = np.arange(1, len(t) + 1)
    if "n" in columns:
        number = _counts(columns, "n")
        _check_growing(number, "n")
    error = None
    if "error" in columns:
        error = _numbers(columns, "error")
        _check(error > 0.0, error, "error", "a standard deviation (s), greater than 0")
    pairs = None
    if "ball_a" in columns and "ball_b" in columns:
        pairs = np.stack([_counts(columns, name) for name in ("ball_a", "ball_b")], axis=1)
    if any(len(column) != len(t) for column in columns.values()):
        raise NotMeasured("found columns of unequal lengths, expected a row for each impact")
    return Measured(number, t, error, pairs)


def _numbers(columns: Mapping[str, Any], name: str) -> Floats:
    found = []
    for row, value in enumerate(columns[name], 1):
        numeric = isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
        if not numeric or not math.isfinite(value):
            raise NotMeasured(f"row {row}: {name}: found {value!r}, expected a number")
        found.append(float(value))
    return np.array(found, dtype=np.float64)


def _counts(columns: Mapping[str, Any], name: str) -> NDArray[np.int64]:
    values = _numbers(columns, name)
    whole = (values >= 1.0) & (values == np.round(values))
    _check(whole, values, name, "a whole number from 1")
    return values.astype(np.int64)


def _check(right: Any, values: Any, name: str, expected: str) -> None:
    wrong = np.flatnonzero(~right)
    if len(wrong):
        row = int(wrong[0])
        raise NotMeasured(f"row {row + 1}: {name}: found {values[row]:g}, expected {expected}")


def _check_growing(values: Any, name: str) -> None:
    right = np.concatenate([[True], values[1:] > values[:-1]])
    _check(right, values, name, "one greater than in the row before")
