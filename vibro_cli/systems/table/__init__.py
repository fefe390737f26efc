"""Balls on a table, with a wall or without."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from itertools import combinations
from typing import TYPE_CHECKING, Any

from vibro_cli.systems.contract import ImpactLog, ShownOfPapers, Sink, System, TimedScene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vibro_cli.compile.kernel import Kernel
    from vibro_cli.figures.film import Frames
    from vibro_cli.figures.kinds import Kind, KindOfBody
    from vibro_cli.scenario.base import AnyScenario
    from vibro_cli.systems.columns import Table
    from vibro_cli.systems.driver import EventLoop
    from vibro_cli.systems.run import Stretch
    from vibro_cli.systems.table.tables import Motion
    from vibro_cli.systems.tables import SystemTables
    from vibro_cli.systems.tangents import LoggedMap
    from vibro_cli.systems.wanted import Limits, Wanted


_WALL = ("Impacts on the wall", "impacts on the wall", "was none on the wall")


class BallsOnTable(System):
    """Balls on a table."""

    name = "table"
    impact_tables = ("collisions", "bounces")
    papers = ("A", "B", "C")
    exponents = 4
    default_figures = ("plan", "energy")

    @property
    def model(self) -> type[AnyScenario]:
        from vibro_cli.systems.table.scenario import TableScenario

        return TableScenario

    def build(self, scenario: Any) -> Any:
        from vibro_cli.systems.table.build import build_table

        return build_table(scenario)

    def warnings(self, scenario: Any, system: Any) -> tuple[str, ...]:
        from vibro_cli.mechanics.system import law_warnings

        return tuple(
            law_warnings(system.law, system.inadmissible, [*combinations(system.bodies, 2)])
        )

    @property
    def loop(self) -> EventLoop:
        from vibro_cli.systems.table.system import LOOP

        return LOOP

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        from vibro_cli.kernels.table.loop import advance
        from vibro_cli.kernels.table.tangent import follow_balls

        return advance, follow_balls

    def world(self, system: Any, limits: Limits) -> Any:
        from vibro_cli.systems.table.system import make_world

        return make_world(system, limits)

    @property
    def timed_scenes(self) -> dict[str, TimedScene]:
        from vibro_cli.systems.table.timed_scenes import TIMED_SCENES

        return TIMED_SCENES

    def tables(self) -> tuple[Table, ...]:
        from vibro_cli.systems.columns import converging, with_growth
        from vibro_cli.systems.table.tables import BOUNCES, COLLISIONS, MOTION, summary

        impacts = with_growth(COLLISIONS), with_growth(BOUNCES)
        return (*impacts, MOTION, summary("i", "i"), converging("i"))

    def summary(self, bodies: int, grown: bool = False) -> Table:
        from vibro_cli.systems.table.tables import summary

        return summary(range(1, bodies + 1), self.exponents * bodies if grown else 0)

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

    @property
    def figures(self) -> dict[str, Kind[Any] | KindOfBody]:
        from vibro_cli.systems.table.figures import FIGURES

        return FIGURES

    def film(self, run: Any, times: Any) -> Frames:
        """Return what a film shows of a run."""
        from vibro_cli.systems.table.figures import film_on_table

        return film_on_table(run, times)

    @property
    def shown_of_papers(self) -> ShownOfPapers:
        from vibro_cli.systems.table.papers import SHOWN

        return SHOWN

    def method(self, scenario: Mapping[str, Any]) -> str:
        return (
            "Between impacts each ball moves straight on; impacts on one another and on the wall "
            "are certified first contacts in closed form, in the order of an event queue, and "
            "there is no time step."
        )

    def portrait(
        self, system: Any, width: str, drawn: bool
    ) -> tuple[dict[str, Any], dict[str, Figure]]:
        from vibro_cli.systems.table.wall_portrait import portrait

        return portrait(system, width, drawn)

    def portrait_lines(self, found: dict[str, Any]) -> Iterator[str]:
        from vibro_cli.systems.table.wall_portrait import portrait_lines

        return portrait_lines(found)


SYSTEM = BallsOnTable()
