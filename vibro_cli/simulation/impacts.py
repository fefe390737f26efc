"""The table of collisions from the log of impacts."""

from __future__ import annotations

from collections.abc import Callable, Collection
from itertools import product
from typing import Any

import numpy as np

from vibro_cli.mechanics.laws import LAW_NAMES
from vibro_cli.mechanics.system import System
from vibro_cli.numerics import engine
from vibro_cli.numerics.machine_code import compiled
from vibro_cli.simulation.drive import compiled_world
from vibro_cli.simulation.impact_columns import (
    ENDS,
    FLAGS,
    INTEGERS,
    MOTIONS,
    NUMBERS,
    Columns,
    Runs,
    fill_columns,
)
from vibro_cli.simulation.stacks import Stack, fill_stacked
from vibro_cli.simulation.world import ImpactRow, World

# Fewer rows are interpreted before the machine code for them would be loaded.
_MANY = 2048

IN_ORDER = (
    *("n", "t", "t_low", "dt", "ball_a", "ball_b", "side", "arc_a", "arc_b"),
    *(f"{name}_{end}" for name, end in product(("angle", "s"), ENDS)),
    *(f"{name}_{end}" for end, name in product(ENDS, ("x", "y"))),
    *(f"{name}_{end}_{when}" for name, when, end in product(MOTIONS, ("pre", "post"), ENDS)),
    *("energy_loss", "impulse_moment", "approach_speed", "separation_speed", "gap", "law"),
    *FLAGS,
)


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
            ``"python"`` or ``"numba"``, of interpreted records; both give the same bits.
        log, runs, around
            See ``simulation.impact_columns``.
        stack
            The systems of the runs, if there are several; the records are then of arrays, and
            change.
        """
        if stack is not None:
            compiled(fill_stacked)(world, log, runs, self._columns, around, stack)
            return
        arrays = isinstance(world.bodies, np.ndarray)
        if not arrays and engine_name == "numba" and len(log) >= _MANY:
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
    columns = [np.asarray(one, dtype=np.int64) for one in (numbers, counts, firsts)]
    return Runs(columns[0], columns[1], columns[2], masses)


def collision_table(system: System, world: World, engine_name: str, log: Any) -> dict[str, Any]:
    """Return the columns of ``collisions.parquet`` of one run.

    Parameters
    ----------
    system, world
        What was solved, and its records, interpreted.
    engine_name
        ``"python"`` or ``"numba"``; both give the same bits.
    log
        Its impacts.
    """
    around = sidedness(system)
    names = [name for name in IN_ORDER if name != "side" or around > 0.0]
    table = ImpactTable(len(log), names)
    table.fill(world, engine_name, log, runs_of(system, [0], [len(log)], [0]), around)
    columns = table.columns()
    return columns | {"law": np.array(LAW_NAMES, dtype=object)[columns["law"]]}
