"""A finished run of bodies on springs: its tables, its summary, and its state at any time."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from vibro_cli.simulation.drive import TooQuiet
from vibro_cli.systems import impact_columns as columns
from vibro_cli.systems.driving import Driver, Library
from vibro_cli.systems.springs.loop import MOST_STEPS, advance
from vibro_cli.systems.springs.motion import Motion
from vibro_cli.systems.springs.prepare import make_world
from vibro_cli.systems.springs.system import SpringsSystem
from vibro_cli.systems.springs.tables import Table, collision_table, event_table
from vibro_cli.systems.springs.world import END_NAMES, END_QUIET, LOG_FULL, LOGS, RECORDS
from vibro_cli.systems.wanted import Wanted

LIBRARY = Library(advance, RECORDS, LOGS, LOG_FULL)


@dataclass(frozen=True)
class SpringsRun:
    """The result of :func:`simulate_springs`; every table is computed when first asked for."""

    system: SpringsSystem
    engine: str
    end_cause: str
    end_time: float
    wanted: Wanted
    skipped: tuple[str, ...]
    contacts: int
    energy_correction: float
    _logs: dict[str, Any] = field(repr=False)

    @cached_property
    def collisions(self) -> Table:
        """Columns of ``collisions.parquet``, a row for each impact."""
        return collision_table(self.system, self._logs["impacts"])

    @cached_property
    def events(self) -> Table:
        """Columns of ``events.parquet``: where lasting contacts begin and end."""
        return event_table(self._logs["states"], len(self.system.bodies))

    @cached_property
    def paths(self) -> Motion:
        """The motion between the events."""
        return Motion(self.system, self._logs["states"])

    @cached_property
    def motion(self) -> Table | None:
        """Columns of ``motion.parquet``, or None if no sampled motion is asked for."""
        instants = self.wanted.instants(self.end_time)
        return None if instants is None else self.sample(instants)

    def sample(self, times: Any, side: str = "after") -> Table:
        """Return the motion at given times (s); `side` of an event at such an instant."""
        return self.paths.sample(times, side)

    @cached_property
    def _totals(self) -> list[tuple[str, Any]]:
        impacts = self._logs["impacts"]
        final = self.sample([self.end_time])
        start = float(np.sum(self.sample([0.0], "before")["energy"]))
        kept = all(k == 1.0 for k in self.system.restitution) and self.contacts == 0
        if self.system.law == "translational":
            kept = kept and len({body.kappa for body in self.system.bodies}) == 1
        end = float(np.sum(final["energy"]))
        totals: list[tuple[str, Any]] = [
            ("status", "ok"),
            ("reason", None),
            ("end_cause", self.end_cause),
            ("end_time", self.end_time),
            ("collisions", len(impacts)),
            ("contacts", self.contacts),
            *columns.impact_totals(impacts),
            *columns.energy_totals(start, end, kept, self.energy_correction),
            ("max_gap", columns.largest_gap(impacts)),
        ]
        for row in range(len(self.system.bodies)):
            for name in ("x", "displacement", "speed"):
                totals.append((f"{name}_{row + 1}", float(final[name][row])))
        return totals

    @cached_property
    def summary(self) -> Table:
        """Columns of ``summary.parquet``, one row."""
        return columns.summary_columns(self._totals)

    def summary_record(self) -> dict[str, Any]:
        """Return the summary as plain values, None for null."""
        return columns.summary_values(self._totals)


def simulate_springs(
    system: SpringsSystem,
    stop_time: float | None,
    stop_collisions: int | None,
    engine: str = "auto",
    wanted: Wanted | None = None,
) -> SpringsRun:
    """Run bodies on springs until the first of the stops.

    Parameters
    ----------
    system
        What is solved.
    stop_time, stop_collisions
        Whichever comes first, s and a count; at least one.
    engine
        ``"python"``, ``"numba"`` or ``"auto"``; all give the same bits.
    wanted
        What is to be computed beside the impacts.

    Raises
    ------
    ValueError
        For an unknown engine.
    TooQuiet
        If there is no impact for millions of steps.
    """
    driver = Driver(LIBRARY, make_world(system, stop_time, stop_collisions), engine)
    cause = driver.run()
    end = driver.value("t")
    if cause == END_QUIET:
        raise TooQuiet(
            f"no impact in the last {MOST_STEPS:,} steps, until t = {end:.6g} s; expected a "
            "stop.time not far beyond the last impact"
        )
    wanted = wanted or Wanted()
    return SpringsRun(
        system=system,
        engine=driver.engine,
        end_cause=END_NAMES[cause],
        end_time=end,
        wanted=wanted,
        skipped=wanted.skipped(),
        contacts=int(driver.value("contacts")),
        energy_correction=driver.value("energy_correction"),
        _logs={name: log.table() for name, log in driver.logs.items()},
    )
