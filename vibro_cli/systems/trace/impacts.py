"""The table of collisions from the log of impacts."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

import numpy as np

from vibro_cli.compile import kernel as engine
from vibro_cli.compile.native import compiled
from vibro_cli.kernels.ensemble.points import Stack, fill_stacked
from vibro_cli.kernels.statistics.impact_columns import (
    FLAGS,
    INTEGERS,
    NUMBERS,
    Columns,
    Runs,
    fill_columns,
)
from vibro_cli.kernels.statistics.regimes import ROWS
from vibro_cli.kernels.world import ImpactRow, World
from vibro_cli.mechanics.system import System
from vibro_cli.systems.trace.event_loop import compiled_world
from vibro_cli.systems.trace.tables import collisions

IN_ORDER = tuple(column.name for column in collisions(sided=True).columns)


Room = Callable[[tuple[int, int], type], Any]


class ImpactTable:
    """Room for the impacts of some runs, which are filled in in any order.

    Parameters
    ----------
    rows
        Number of impacts.
    wanted
        Names of the columns that are kept.
    room
        Gives an array of a shape and a type.
    """

    def __init__(self, rows: int, wanted: Collection[str], room: Room = np.empty) -> None:
        self._rows = rows
        self._wanted = wanted
        self._memory = room
        numbers, numbers_at = self._room(NUMBERS, np.float64)
        integers, integers_at = self._room(INTEGERS, np.int64)
        flags, flags_at = self._room(FLAGS, np.bool_)
        self._columns = Columns(numbers, integers, flags, numbers_at, integers_at, flags_at)

    def _room(self, names: tuple[str, ...], kind: type) -> tuple[Any, Any]:
        """An array with a row for each wanted column, and one for all others; which has which."""
        kept = [name for name in names if name in self._wanted]
        places = [kept.index(name) if name in kept else len(kept) for name in names]
        # An odd number of cache lines apart: else all columns would share the same few of them.
        lines = -(-self._rows * np.dtype(kind).itemsize // 64) | 1
        shape = len(kept) + 1, lines * 64 // np.dtype(kind).itemsize
        room = self._memory(shape, kind)
        return room, np.array(places)

    def fill(
        self,
        world: World,
        engine_name: str,
        log: Any,
        runs: Runs,
        around: float,
        stack: Stack | None = None,
    ) -> None:
        """Fill in some runs of one system, or of a stack of them.

        Parameters
        ----------
        world
            Its records, interpreted or compiled.
        engine_name
            ``"python"`` or ``"compiled"``, of interpreted records; both give the same bits.
        log, runs, around
            See ``kernels.statistics.impact_columns``.
        stack
            The systems of the runs, if there are several; the records are then of arrays, and
            change.
        """
        if stack is not None:
            compiled(fill_stacked)(world, log, runs, self._columns, around, stack)
            return
        arrays = isinstance(world.bodies, np.ndarray)
        if not arrays and engine_name == "compiled":
            world, arrays = compiled_world(world), True
        if arrays:
            compiled(fill_columns)(world, log, runs, self._columns, around)
        else:
            rows = engine.interpreted_copies(log, ImpactRow)
            fill_columns(world, rows, runs, self._columns, around)

    def columns(self) -> dict[str, Any]:
        """Return the columns that are wanted, in order; laws are numbers, a side of 0 is none."""
        found: dict[str, Any] = {}
        columns = self._columns
        for names, room, places in (
            (NUMBERS, columns.numbers, columns.numbers_at),
            (INTEGERS, columns.integers, columns.integers_at),
            (FLAGS, columns.flags, columns.flags_at),
        ):
            found |= {
                name: room[place, : self._rows] for name, place in zip(names, places, strict=True)
            }
        return {name: found[name] for name in ("scenario", *IN_ORDER) if name in self._wanted}


def sidedness(system: System) -> float:
    """Length (m) of a closed trace with two bodies, which may meet on two sides; else 0."""
    two_ways = system.trace.closed and len(system.bodies) == 2
    return system.trace.length if two_ways else 0.0


def runs_of(system: System, numbers: Any, counts: Any, firsts: Any, masses: Any = None) -> Runs:
    """Return the runs of a log; those of a single one have the masses of the system."""
    if masses is None:
        masses = np.array([[body.mass for body in system.bodies]])
    columns: list[Any] = [np.asarray(one, dtype=np.int64) for one in (numbers, counts, firsts)]
    hills = np.empty((ROWS * len(system.bodies), 3 * len(system.trace.pieces) + 2))
    return Runs(columns[0], columns[1], columns[2], masses, hills)


class Impacts:
    """The columns of ``collisions.parquet`` of one run, stretch by stretch; laws are numbers.

    Parameters
    ----------
    system
        What is solved.
    """

    def __init__(self, system: System) -> None:
        self._system = system
        self._around = sidedness(system)
        self._names = [name for name in IN_ORDER if name != "side" or self._around > 0.0]
        self._told = 0
        self._before: tuple[float, float] | None = None

    def take(self, world: World, engine_name: str, log: Any) -> dict[str, Any]:
        """Return the columns of some more impacts (see :meth:`ImpactTable.fill`)."""
        table = ImpactTable(len(log), self._names)
        runs = runs_of(self._system, [0], [len(log)], [0])
        table.fill(world, engine_name, log, runs, self._around)
        columns = table.columns()
        if len(log) and self._before is not None:
            t, t_low = self._before
            columns["n"] += self._told
            columns["dt"][0] = (log["t"][0] - t) + (log["t_low"][0] - t_low)
        if len(log):
            self._before = float(log["t"][-1]), float(log["t_low"][-1])
        self._told += len(log)
        return columns
