"""A finished run on the table: its tables, its summary, and its state at any time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

from vibro_cli.simulation.continuing import earlier_part
from vibro_cli.simulation.record import rows_of
from vibro_cli.systems.driving import Driver, Library
from vibro_cli.systems.impact_columns import Table
from vibro_cli.systems.run import Ending, ImpactTable, SystemRun
from vibro_cli.systems.table.loop import advance
from vibro_cli.systems.table.motion import Motion, states_at
from vibro_cli.systems.table.prepare import make_world
from vibro_cli.systems.table.system import TableSystem
from vibro_cli.systems.table.tables import bounce_table, collision_table
from vibro_cli.systems.table.world import END_NAMES, END_TIME, LOG_FULL, LOGS, RECORDS, STATE, Ball
from vibro_cli.systems.wanted import Wanted

LIBRARY = Library(advance, RECORDS, LOGS, LOG_FULL, STATE)


@dataclass(frozen=True)
class TableRun(SystemRun[TableSystem]):
    """The result of :func:`simulate_table`."""

    LIBRARY = LIBRARY
    IMPACT_LOG = "pair_log"
    IMPACT_TABLES: ClassVar[Mapping[str, ImpactTable[TableSystem]]] = {
        "collisions": ImpactTable("pair_log", collision_table),
        "bounces": ImpactTable("bounce_log", bounce_table),
    }
    FINAL_COLUMNS = ("x", "y", "velocity_x", "velocity_y")

    @property
    def bounces(self) -> Table:
        """Columns of ``bounces.parquet``, a row for each impact of a ball on the wall."""
        return self.impact_table("bounces")

    @cached_property
    def paths(self) -> Motion:
        """The motion of each ball between its events, straight and so exact at any time."""
        return Motion(self.system, self._logs[self.IMPACT_LOG], self._logs["bounce_log"])

    def _initial_states(self) -> Table:
        return states_at(self.system, make_world(self.system, None, None, None).balls, 0.0)

    def _final_states(self) -> Table:
        if self._end_state is None:
            return super()._final_states()
        return states_at(self.system, rows_of(Ball, self._end_state["balls"]), self.end_time)

    @property
    def _counts(self) -> list[tuple[str, int]]:
        return [("bounces", len(self._logs["bounce_log"]))]

    @property
    def _keeps_energy(self) -> bool:
        system = self.system
        kept = system.wall is None or system.wall.restitution == 1.0
        if len(system.bodies) > 1:
            kept = kept and system.restitution == 1.0 and system.law_keeps_energy
        return kept


def simulate_table(
    system: TableSystem,
    stop_time: float | None,
    stop_collisions: int | None,
    stop_bounces: int | None,
    engine: str = "auto",
    wanted: Wanted | None = None,
    checkpoint: dict[str, Any] | None = None,
    history: dict[str, Any] | None = None,
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
    checkpoint, history
        Of an earlier run of this system, which goes on from there.

    Raises
    ------
    ValueError
        For an unknown engine.
    CannotContinue
        If the earlier run had ended for good, or is past a stop.
    """
    earlier = None
    if checkpoint is not None:
        limits = {"collisions": stop_collisions, "bounces": stop_bounces}
        earlier = earlier_part(checkpoint, history, LOGS, stop_time, **limits)
    world = make_world(system, stop_time, stop_collisions, stop_bounces)
    driver = Driver(LIBRARY, world, engine, earlier)
    cause = driver.run()
    ending = Ending(END_NAMES, stop_time if cause == END_TIME else None)
    return TableRun.of(system, driver, cause, ending, wanted)
