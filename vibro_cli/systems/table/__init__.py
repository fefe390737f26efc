"""Balls on a table, with a wall or without."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from itertools import combinations
from typing import TYPE_CHECKING, Any

from vibro_cli.systems.contract import ImpactLog, Sink, System

if TYPE_CHECKING:
    from vibro_cli.compile.kernel import Kernel
    from vibro_cli.systems.columns import Table
    from vibro_cli.systems.run import Stretch
    from vibro_cli.systems.table.tables import Motion
    from vibro_cli.systems.tables import SystemTables
    from vibro_cli.systems.tangents import LoggedMap
    from vibro_cli.systems.wanted import Wanted


_WALL = ("Impacts on the wall", "impacts on the wall", "was none on the wall")


class BallsOnTable(System):
    """Balls on a table."""

    name = "table"
    impact_tables = ("collisions", "bounces")
    papers = ("A", "B", "C")
    exponents = 4
    default_figures = ("plan", "energy")

    def warnings(self, scenario: Any, system: Any) -> tuple[str, ...]:
        from vibro_cli.mechanics.system import law_warnings

        return tuple(
            law_warnings(system.law, system.inadmissible, [*combinations(system.bodies, 2)])
        )

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        from vibro_cli.kernels.table.loop import advance
        from vibro_cli.kernels.table.tangent import follow_balls

        return advance, follow_balls

    def tables(self) -> tuple[Table, ...]:
        from vibro_cli.systems.columns import converging, with_growth
        from vibro_cli.systems.table.tables import BOUNCES, COLLISIONS, MOTION, summary

        impacts = with_growth(COLLISIONS), with_growth(BOUNCES)
        return (*impacts, MOTION, summary("i", "i"), converging("i"))

    @property
    def impact_logs(self) -> dict[str, ImpactLog]:
        from vibro_cli.systems.table.tables import BOUNCES, COLLISIONS, Bounces, Collisions
        from vibro_cli.systems.tables import Bodies

        return {
            "collisions": ImpactLog("pair_log", COLLISIONS, Collisions, Bodies),
            "bounces": ImpactLog("bounce_log", BOUNCES, Bounces, Bodies, *_WALL),
        }

    def teller(
        self, system: Any, wanted: Wanted, names: Collection[str], sink: Sink
    ) -> SystemTables:
        from vibro_cli.systems.table.tables import states_at
        from vibro_cli.systems.tables import SystemTables

        def states(records: Any, time: float) -> dict[str, Any]:
            return states_at(system, records["balls"], time)

        return SystemTables(self, system, wanted, names, sink, states)

    def tangents(self, system: Any) -> LoggedMap:
        from vibro_cli.kernels.table.tangent import follow_balls
        from vibro_cli.systems.table.system import most_touches, time_scale
        from vibro_cli.systems.tangents import LoggedMap

        pairs = most_touches(len(system.bodies))
        return LoggedMap(self, system, follow_balls, time_scale(system), pairs)

    def trajectory(self, system: Any, stretch: Stretch, before: Any = None) -> Motion:
        from vibro_cli.systems.table.tables import Motion

        return Motion(system, stretch.logs["pair_log"], stretch.logs["bounce_log"], before)

    def method(self, scenario: Mapping[str, Any]) -> str:
        return (
            "Between impacts each ball moves straight on; impacts on one another and on the wall "
            "are certified first contacts in closed form, in the order of an event queue, and "
            "there is no time step."
        )


SYSTEM = BallsOnTable()
