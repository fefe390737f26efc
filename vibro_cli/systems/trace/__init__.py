"""Bodies that roll on a trace of arcs and lines, at rest or rotating."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from vibro_cli.systems.contract import Imported, System

if TYPE_CHECKING:
    from vibro_cli.compile.kernel import Overrides
    from vibro_cli.mechanics.system import TraceSystem
    from vibro_cli.systems.run import Run
    from vibro_cli.systems.trace.motion import LongMotion
    from vibro_cli.systems.wanted import Limits, Wanted


class Trace(System):
    """Bodies on a trace."""

    name = "trace"
    papers = ("A", "B", "D")
    default_figures = ("portrait",)
    has_families = True
    has_orbits = True
    exponents = 2
    model: Any = Imported("scenario.models.Scenario")
    build: Any = Imported("assemble.build_system")
    loop: Any = Imported("systems.trace.event_loop.LOOP")
    stretches: Any = Imported("systems.trace.event_loop.TraceStretches")
    solver: Any = Imported("systems.trace.grid_solver.TraceSolver")
    tables: Any = Imported("systems.trace.tables.tables")
    summary: Any = Imported("systems.trace.tables.summary")
    table: Any = Imported("systems.trace.tables.table_named")
    teller: Any = Imported("systems.trace.tables.Tables")
    trajectory: Any = Imported("systems.trace.tables.trajectory_of")
    skipped: Any = Imported("systems.trace.tables.skipped")
    figures: Any = Imported("figures.runs.kinds.KINDS")
    film: Any = Imported("figures.runs.scene.film_on_trace")
    report: Any = Imported("report.content.section")
    understood_lines: Any = Imported("systems.trace.describe.understood_lines")
    portrait: Any = Imported("systems.trace.describe.portrait")
    portrait_lines: Any = Imported("systems.trace.describe.portrait_lines")

    def warnings(self, scenario: Any, system: Any) -> tuple[str, ...]:
        from vibro_cli.mechanics.system import mechanics_warnings

        return mechanics_warnings(system, scenario.stop.time)

    def one_sided(self, scenario: Any) -> bool:
        return bool(scenario.trace.surface == "one-sided")

    def world(self, system: Any, limits: Limits) -> Any:
        from vibro_cli.systems.trace.world import make_world

        return make_world(system, limits.time, limits.collisions)

    def overrides(self, system: Any) -> Overrides | None:
        if system.turning is None:
            return None
        from vibro_cli.kernels.rotating import TURNING

        return TURNING

    def long_motion(
        self, system: Any, limits: Limits, rows: Mapping[str, int], interrupted: bool
    ) -> LongMotion | None:
        from vibro_cli.systems.trace import motion

        flights = rows["log"]
        if flights <= motion.MOST_FLIGHTS:
            return None
        return motion.LongMotion(self, system, limits, flights, interrupted)

    def figure_width(self, system: Any) -> str:
        return "double" if len(system.trace.pieces) > 1 else "single"

    def method(self, scenario: Mapping[str, Any]) -> str:
        if scenario["trace"].get("turning") is not None:
            return (
                "Between impacts each body moves in closed form on the trace that turns "
                "(Weierstrass elliptic functions on arcs), impacts are the certified first zeros "
                "of the distance of the surfaces, and there is no time step."
            )
        return (
            "Between impacts each body moves in closed form (Jacobi elliptic functions on arcs), "
            "impacts are the certified first zeros of the distance of the surfaces, and there is "
            "no time step."
        )

    def understood(self, scenario: Any, system: Any) -> dict[str, Any]:
        from vibro_cli.systems.trace.describe import understood

        return understood(scenario, system, self.warnings(scenario, system))


SYSTEM = Trace()


def simulate_system(
    system: TraceSystem,
    stop_time: float | None,
    stop_collisions: int | None,
    engine: str = "compiled",
    wanted: Wanted | None = None,
    checkpoint: dict[str, Any] | None = None,
    history: dict[str, Any] | None = None,
) -> Run:
    """Run bodies on a trace until the first of the stops (s and a count), see ``systems.run``."""
    from vibro_cli.systems.run import simulate
    from vibro_cli.systems.wanted import Limits, Wanted

    limits = Limits(stop_time, stop_collisions)
    return simulate(SYSTEM, system, limits, engine, wanted or Wanted(), checkpoint, history)
