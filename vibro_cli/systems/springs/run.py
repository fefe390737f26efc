"""A finished run of bodies on springs: its tables, its summary, and its state at any time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

from vibro_cli.simulation.continuing import earlier_part
from vibro_cli.simulation.drive import TooQuiet
from vibro_cli.simulation.record import rows_of
from vibro_cli.systems.driving import Driver, Library
from vibro_cli.systems.impact_columns import Table
from vibro_cli.systems.run import Ending, ImpactTable, SystemRun
from vibro_cli.systems.springs.loop import MOST_STEPS, advance
from vibro_cli.systems.springs.motion import Motion, states_at
from vibro_cli.systems.springs.prepare import make_world
from vibro_cli.systems.springs.system import SpringsSystem
from vibro_cli.systems.springs.tables import collision_table, event_table
from vibro_cli.systems.springs.world import (
    END_NAMES,
    END_QUIET,
    END_TIME,
    LOG_FULL,
    LOGS,
    RECORDS,
    STATE,
    SpringBody,
)
from vibro_cli.systems.wanted import Wanted

LIBRARY = Library(advance, RECORDS, LOGS, LOG_FULL, STATE)


@dataclass(frozen=True)
class SpringsRun(SystemRun[SpringsSystem]):
    """The result of :func:`simulate_springs`."""

    LIBRARY = LIBRARY
    IMPACT_LOG = "impacts"
    IMPACT_TABLES: ClassVar[Mapping[str, ImpactTable[SpringsSystem]]] = {
        "collisions": ImpactTable("impacts", collision_table)
    }
    FINAL_COLUMNS = ("x", "displacement", "speed")

    @property
    def contacts(self) -> int:
        """How many lasting contacts began."""
        return int(self._clock["contacts"])

    @cached_property
    def events(self) -> Table:
        """Columns of ``events.parquet``: where lasting contacts begin and end."""
        return event_table(self._logs["states"], len(self.system.bodies))

    @cached_property
    def paths(self) -> Motion:
        """The motion between the events."""
        return Motion(self.system, self._logs["states"])

    def _initial_states(self) -> Table:
        return states_at(self.system, make_world(self.system).springs, 0.0)

    def _final_states(self) -> Table:
        if self._end_state is None:
            return super()._final_states()
        springs = rows_of(SpringBody, self._end_state["springs"])
        return states_at(self.system, springs, self.end_time)

    @property
    def _counts(self) -> list[tuple[str, int]]:
        return [("contacts", self.contacts)]

    @property
    def _keeps_energy(self) -> bool:
        elastic = all(k == 1.0 for k in self.system.restitution)
        return elastic and self.contacts == 0 and self.system.law_keeps_energy


def simulate_springs(
    system: SpringsSystem,
    stop_time: float | None,
    stop_collisions: int | None,
    engine: str = "auto",
    wanted: Wanted | None = None,
    checkpoint: dict[str, Any] | None = None,
    history: dict[str, Any] | None = None,
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
    checkpoint, history
        Of an earlier run of this system, which goes on from there.

    Raises
    ------
    ValueError
        For an unknown engine.
    CannotContinue
        If the earlier run had ended for good, or is past a stop.
    TooQuiet
        If there is no impact for millions of steps.
    """
    earlier = None
    if checkpoint is not None:
        earlier = earlier_part(checkpoint, history, LOGS, stop_time, collisions=stop_collisions)
    driver = Driver(LIBRARY, make_world(system, stop_time, stop_collisions), engine, earlier)
    cause = driver.run()
    if cause == END_QUIET:
        raise TooQuiet(
            f"no impact in the last {MOST_STEPS:,} steps, until t = {driver.value('t'):.6g} s; "
            "expected a stop.time not far beyond the last impact"
        )
    ending = Ending(END_NAMES, None, finish=cause == END_TIME)
    return SpringsRun.of(system, driver, cause, ending, wanted)
