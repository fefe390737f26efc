"""The logs of a run as columns."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from vibro_cli.numerics.engine import dtype


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

    def table(self) -> Any:
        """Return all rows as one structured array."""
        if not self._chunks:
            return np.zeros(0, dtype=self._type)
        if len(self._chunks) > 1:
            self._chunks = [np.concatenate(self._chunks)]
        return self._chunks[0]
