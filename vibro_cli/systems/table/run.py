"""A finished run on the table: its tables, its summary, and its state at any time."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from vibro_cli.systems import impact_columns as columns
from vibro_cli.systems.driving import Driver, Library
from vibro_cli.systems.table.loop import advance
from vibro_cli.systems.table.motion import Motion
from vibro_cli.systems.table.prepare import make_world
from vibro_cli.systems.table.system import TableSystem
from vibro_cli.systems.table.tables import Table, bounce_table, collision_table
from vibro_cli.systems.table.world import END_NAMES, END_TIME, LOG_FULL, LOGS, RECORDS
from vibro_cli.systems.wanted import Wanted

LIBRARY = Library(advance, RECORDS, LOGS, LOG_FULL)


@dataclass(frozen=True)
class TableRun:
    """The result of :func:`simulate_table`; every table is computed when first asked for."""

    system: TableSystem
    engine: str
    end_cause: str
    end_time: float
    wanted: Wanted
    skipped: tuple[str, ...]
    energy_correction: float
    _logs: dict[str, Any] = field(repr=False)

    @cached_property
    def collisions(self) -> Table:
        """Columns of ``collisions.parquet``, a row for each impact of two balls."""
        return collision_table(self.system, self._logs["pair_log"])

    @cached_property
    def bounces(self) -> Table:
        """Columns of ``bounces.parquet``, a row for each impact of a ball on the wall."""
        return bounce_table(self.system, self._logs["bounce_log"])

    @cached_property
    def paths(self) -> Motion:
        """The motion of each ball between its events."""
        return Motion(self.system, self._logs["pair_log"], self._logs["bounce_log"])

    @cached_property
    def motion(self) -> Table | None:
        """Columns of ``motion.parquet``, or None if no sampled motion is asked for."""
        instants = self.wanted.instants(self.end_time)
        return None if instants is None else self.sample(instants)

    def sample(self, times: Any, side: str = "after") -> Table:
        """Return the motion at given times (s), exactly; `side` of an event at such an instant."""
        return self.paths.sample(times, side)

    @cached_property
    def summary(self) -> Table:
        """Columns of ``summary.parquet``, one row."""
        return columns.summary_columns(self._totals)

    def summary_record(self) -> dict[str, Any]:
        """Return the summary as plain values, None for null."""
        return columns.summary_values(self._totals)

    @cached_property
    def _totals(self) -> list[tuple[str, Any]]:
        pairs = self._logs["pair_log"]
        last = self.sample([self.end_time])
        start = float(np.sum(self.sample([0.0], "before")["energy"]))
        end = float(np.sum(last["energy"]))
        totals: list[tuple[str, Any]] = [
            ("status", "ok"),
            ("reason", None),
            ("end_cause", self.end_cause),
            ("end_time", self.end_time),
            ("collisions", len(pairs)),
            ("bounces", len(self._logs["bounce_log"])),
            *columns.impact_totals(pairs),
            *columns.energy_totals(start, end, self._keeps_energy(), self.energy_correction),
            ("max_gap", columns.largest_gap(pairs)),
        ]
        for row in range(len(self.system.bodies)):
            for name in ("x", "y", "velocity_x", "velocity_y"):
                totals.append((f"{name}_{row + 1}", float(last[name][row])))
        return totals

    def _keeps_energy(self) -> bool:
        """Whether neither the impacts nor the wall take energy."""
        system = self.system
        kept = system.wall is None or system.wall.restitution == 1.0
        if len(system.bodies) > 1:
            equal = len({body.kappa for body in system.bodies}) == 1
            kept = kept and system.restitution == 1.0 and (system.law != "translational" or equal)
        return kept


def simulate_table(
    system: TableSystem,
    stop_time: float | None,
    stop_collisions: int | None,
    stop_bounces: int | None,
    engine: str = "auto",
    wanted: Wanted | None = None,
) -> TableRun:
    """Run balls on a table until the first of the stops.

    Parameters
    ----------
    system
        What is solved.
    stop_time, stop_collisions, stop_bounces
        Whichever comes first, s and counts; at least one.
    engine
        ``"python"``, ``"numba"`` or ``"auto"``; all give the same bits.
    wanted
        What is to be computed beside the impacts.

    Raises
    ------
    ValueError
        For an unknown engine.
    """
    world = make_world(system, stop_time, stop_collisions, stop_bounces)
    driver = Driver(LIBRARY, world, engine)
    cause = driver.run()
    end = stop_time if cause == END_TIME and stop_time is not None else driver.value("t")
    wanted = wanted or Wanted()
    return TableRun(
        system=system,
        engine=driver.engine,
        end_cause=END_NAMES[cause],
        end_time=end,
        wanted=wanted,
        skipped=wanted.skipped(),
        energy_correction=driver.value("energy_correction"),
        _logs={name: log.table() for name, log in driver.logs.items()},
    )
