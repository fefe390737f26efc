"""The data of a run that its figures use, and helpers to select and cache them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import wraps
from inspect import signature
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.systems.contract import Flights

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]
Table = Mapping[str, NDArray[Any]]
Run = TypeVar("Run")
Found = TypeVar("Found")
More = ParamSpec("More")
_MOST_KEPT = 8
SPEEDS = ("approach_speed", "separation_speed")
"""Columns of the speeds (m/s) of the bodies of an impact along their line of centres."""
_ROUNDING = 1e-12
"""Share of the approach speed below which a negative separation speed counts as rounding."""


def first_of(table: Table, rows: int) -> Table:
    """Return the first rows of a table; of a stored table only these are read."""
    from vibro_cli.storage.stored import StoredColumns

    if isinstance(table, StoredColumns):
        return table.first(rows)
    return {name: column[:rows] for name, column in table.items()}


def flights_of(flights: Table, ball: int, until: float = math.inf) -> Integers:
    """Return the rows of the flights of a body (from 1) that begin by a time (s)."""
    return np.flatnonzero((flights["ball"] == ball) & (flights["t_start"] <= until))


def goes_through(table: Table) -> Flags:
    """Return after which impacts the bodies would penetrate each other by more than rounding."""
    approach, separation = (np.asarray(table[name]) for name in SPEEDS)
    through: Flags = separation < -_ROUNDING * np.abs(approach)
    return through


def why_not_made(through: Any) -> str:
    """Return a text on why impacts were not made, given the result of `goes_through` for them.

    Impacts without penetration were part of an inadmissible one, or would lift a body off the
    trace.
    """
    return "inadmissible" if np.any(through) else "prevented"


class Recorded(Flights, Protocol):
    """A finished run: the system, its impacts and its flights between events."""

    @property
    def system(self) -> TraceSystem:
        """The system that was solved."""

    @property
    def collisions(self) -> Table:
        """The impacts, with the columns of `collisions.parquet`."""


def kept(
    find: Callable[Concatenate[Run, More], Found],
) -> Callable[Concatenate[Run, More], Found]:
    """Cache the last `_MOST_KEPT` results of a function of a run or grid, for several figures."""
    known: WeakKeyDictionary[Any, dict[Any, Found]] = WeakKeyDictionary()
    takes = signature(find)

    @wraps(find)
    def found(run: Run, /, *args: More.args, **more: More.kwargs) -> Found:
        given = takes.bind(run, *args, **more)
        given.apply_defaults()
        of_run, asked = known.setdefault(run, {}), (given.args[1:], *given.kwargs.items())
        if asked not in of_run:
            of_run[asked] = find(run, *args, **more)
            if len(of_run) > _MOST_KEPT:
                del of_run[next(iter(of_run))]
        return of_run[asked]

    return found
