"""A run made by hand, in the form that every run has, for tests of storage and display."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vibro_cli.systems import system_named
from vibro_cli.systems.columns import Column, Table
from vibro_cli.systems.contract import System
from vibro_cli.systems.trace import SYSTEM
from vibro_cli.systems.trace import tables as of_trace

_ROWS = 3


def _column(column: Column, position: int, rows: int) -> Any:
    """Return distinct, recognisable values of a column; nullable columns lack their first value."""
    numbers = np.arange(rows) + 100 * position
    if column.type == "string":
        words = np.array([f"{column.name}-{row}" for row in range(rows)], dtype=object)
        if column.nullable:
            words[:1] = None
        return words
    if column.type == "bool":
        return numbers % 2 == 0
    if column.type == "int64":
        return (
            np.ma.MaskedArray(numbers, mask=numbers == 100 * position)
            if column.nullable
            else numbers
        )
    values = numbers + 1 / 3
    if column.nullable:
        values[:1] = np.nan
    return values


def columns_of(table: Table, rows: int = _ROWS) -> dict[str, Any]:
    """Return columns that fit a table."""
    return {
        column.name: _column(column, position, rows)
        for position, column in enumerate(table.columns)
    }


@dataclass
class FakeRun:
    """A run of two bodies with three impacts."""

    collisions: dict[str, Any] = field(default_factory=lambda: columns_of(of_trace.collisions()))
    events: dict[str, Any] = field(default_factory=lambda: columns_of(of_trace.EVENTS))
    summary: dict[str, Any] = field(default_factory=lambda: columns_of(SYSTEM.summary(2), 1))
    motion: dict[str, Any] | None = None
    exponents: dict[str, Any] | None = None
    engine: str = "python"
    kind: System = field(default_factory=lambda: system_named("trace"))
    not_made: int = 0
    exponent_error: float = math.nan
    unsampled_from: float | None = None
    skipped: list[str] = field(default_factory=lambda: ["normal forces: nothing asked for them"])

    def summary_record(self) -> dict[str, Any]:
        return {
            "status": "ok",
            "reason": None,
            "end_cause": "time",
            "end_time": 60.0,
            "quiet_from": None,
            "collisions": _ROWS,
            "crossings": 1,
            "contacts": 0,
            "first_collision_time": 0.25,
            "last_collision_time": 59.5,
            "energy_start": 12.5,
            "energy_end": 11.25,
            "energy_drift": None,
            "energy_correction": 0.0,
            "max_gap": 1.0e-16,
            "min_normal_force": 3.5,
            "max_friction_demand": 0.25,
        }

    def table(self, name: str) -> dict[str, Any] | None:
        found: dict[str, Any] | None = getattr(self, name)
        return found

    def told_to(self, sink: Callable[[str, Any], None]) -> "FakeRun":
        """Pass on the rows of the tables, words by their numbers, as a run in progress does."""
        rows = np.arange(_ROWS)
        sink("collisions", self.collisions | {"law": rows})
        sink("events", self.events | {"event": rows})
        return self

    def checkpoint(self) -> dict[str, Any]:
        return {"t": 0.1 + 0.2}


@dataclass
class FakeScenario:
    """A scenario by name only."""

    name: str = "by-hand"
    system: str = "trace"

    def resolved(self) -> dict[str, Any]:
        return {"name": self.name, "gravity": 9.81}
