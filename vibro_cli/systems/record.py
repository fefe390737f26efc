"""The logs of a run as columns."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from vibro_cli.compile.kernel import compiled_rows, dtype, interpreted_rows


class Log:
    """Rows of one record type, gathered chunk by chunk from either engine."""

    def __init__(self, cls: type) -> None:
        self._type = dtype(cls)
        self._names = tuple(cls.fields)  # type: ignore[attr-defined]
        self._chunks: list[Any] = []

    def take(self, rows: Any, count: int) -> None:
        """Take the first ``count`` rows; those of an array are not copied, and stay as they are."""
        if count == 0:
            return
        if isinstance(rows, np.ndarray):
            self._chunks.append(rows[:count])
            return
        values: Iterable[Any] = (
            tuple([getattr(row, name) for name in self._names]) for row in rows[:count]
        )
        self._chunks.append(np.array(list(values), dtype=self._type))

    def __len__(self) -> int:
        return sum(len(chunk) for chunk in self._chunks)

    def drain(self) -> Any:
        """Return all rows as :meth:`table` does, and keep none."""
        rows = self.table()
        self._chunks = []
        return rows

    def table(self) -> Any:
        """Return all rows as one structured array."""
        if not self._chunks:
            return np.zeros(0, dtype=self._type)
        if len(self._chunks) > 1:
            self._chunks = [joined(self._chunks)]
        return self._chunks[0]


# numpy copies records field by field: as bytes it takes a third of the time, and with `take` a
# twentieth of what an index takes.


def joined(parts: Sequence[Any]) -> Any:
    """Return arrays of records of one type as one array."""
    return np.concatenate([part.view(np.uint8) for part in parts]).view(parts[0].dtype)


def chosen(rows: Any, flags: Any) -> Any:
    """Return the records that are flagged."""
    return rows.take(np.flatnonzero(flags))


def record_array(rows: Any, cls: type) -> Any:
    """Return a structured array of its own with the contents of records of either engine."""
    if isinstance(rows, np.ndarray):
        return rows.copy()
    return compiled_rows(rows, cls)


def plain_rows(rows: Any, cls: type) -> list[list[Any]]:
    """Return records of either engine as plain values, which `set_rows` takes back exactly."""
    if isinstance(rows, np.ndarray):
        return [[_plain(value) for value in row.tolist()] for row in rows]
    names = tuple(cls.fields)  # type: ignore[attr-defined]
    return [[_plain(getattr(row, name)) for name in names] for row in rows]


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    return list(value) if isinstance(value, list) else value


def rows_of(cls: type, values: Sequence[Sequence[Any]]) -> list[Any]:
    """Return interpreted records with the values that `plain_rows` has returned."""
    rows = interpreted_rows(cls, len(values))
    set_rows(rows, cls, values)
    return rows


def set_rows(rows: Sequence[Any], cls: type, values: Sequence[Sequence[Any]]) -> None:
    """Give interpreted records the values that `plain_rows` has returned.

    Raises
    ------
    ValueError
        If there are others than these records have.
    """
    names = tuple(cls.fields)  # type: ignore[attr-defined]
    if len(rows) != len(values) or any(len(value) != len(names) for value in values):
        raise ValueError(f"the state of {cls.__name__} does not belong to this scenario")
    for row, value in zip(rows, values, strict=True):
        for field, number in zip(names, value, strict=True):
            setattr(row, field, _plain(number))
