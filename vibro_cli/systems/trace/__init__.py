"""Bodies that roll on a trace of arcs and lines, at rest or rotating."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from vibro_cli.systems.contract import Sink, System

if TYPE_CHECKING:
    from pathlib import Path

    from vibro_cli.compile.kernel import Overrides
    from vibro_cli.grids.document import Grid
    from vibro_cli.mechanics.system import TraceSystem
    from vibro_cli.storage.stored import StoredRun
    from vibro_cli.systems.columns import Table
    from vibro_cli.systems.driver import Driver
    from vibro_cli.systems.request import Limits, OutputRequest
    from vibro_cli.systems.run import Run, Stretch
    from vibro_cli.systems.trace.grid_solver import TraceSolver
    from vibro_cli.systems.trace.motion import LongMotion, Paths
    from vibro_cli.systems.trace.system import TraceStretches
    from vibro_cli.systems.trace.tables import Tables


class Trace(System):
    """Bodies on a trace."""

    name = "trace"
    papers = ("A", "B", "D")
    default_figures = ("portrait",)
    has_comparisons = True
    has_families = True
    has_orbits = True
    exponents = 2

    def build(self, scenario: Any) -> Any:
        from vibro_cli.assemble import build_system

        return build_system(scenario)

    def mechanics_warnings(self, scenario: Any, system: Any) -> tuple[str, ...]:
        from vibro_cli.mechanics.system import mechanics_warnings

        return mechanics_warnings(system, scenario.stop.time)

    def one_sided(self, scenario: Any) -> bool:
        return bool(scenario.trace.surface == "one-sided")

    def overrides(self, system: Any) -> Overrides:
        if system.turning is None:
            return super().overrides(system)
        from vibro_cli.kernels.rotating import TURNING

        return TURNING

    def stretches(self, driver: Driver, stop_time: float | None) -> TraceStretches:
        from vibro_cli.systems.trace.system import TraceStretches

        return TraceStretches(driver, stop_time)

    def skipped(
        self, clock: Mapping[str, Any], wanted: OutputRequest, end: float
    ) -> tuple[str, ...]:
        from vibro_cli.systems.trace.tables import skipped

        return skipped(clock, wanted, end)

    def solver(self, grid: Grid, engine: str) -> TraceSolver:
        from vibro_cli.systems.trace.grid_solver import TraceSolver

        return TraceSolver(grid, engine)

    def impact_table(self, name: str, column_names: Collection[str] | None = None) -> Table:
        from vibro_cli.systems.trace.tables import SIDE, collisions

        return collisions(sided=column_names is None or SIDE.name in column_names)

    def table_maker(
        self, system: Any, wanted: OutputRequest, names: Collection[str], sink: Sink
    ) -> Tables:
        from vibro_cli.systems.trace.tables import Tables

        return Tables(system, wanted, names, sink)

    def impact_log(self, table: str) -> str:
        return "impacts"

    def trajectory(self, system: Any, stretch: Stretch, before: Any = None) -> Paths:
        from vibro_cli.systems.trace.tables import trajectory_of

        return trajectory_of(system, stretch)

    def long_motion(
        self, system: Any, limits: Limits, rows: Mapping[str, int], interrupted: bool
    ) -> LongMotion | None:
        from vibro_cli.systems.trace import motion

        flights = rows["log"]
        if flights <= motion.MOST_FLIGHTS:
            return None
        return motion.LongMotion(system, limits, flights, interrupted)

    def figure_width(self, system: Any) -> str:
        return "double" if len(system.trace.pieces) > 1 else "single"

    def method(self, scenario: Mapping[str, Any]) -> str:
        way = "(Jacobi elliptic functions on arcs)"
        if scenario["trace"].get("turning") is not None:
            way = "on the rotating trace (Weierstrass elliptic functions on arcs)"
        return (
            f"Between impacts the motion of each body is known in closed form {way}; impacts are "
            "certified first zeros of the distance between the surfaces. There is no time step."
        )

    def report(self, run: StoredRun, name: str, beside: Path) -> dict[str, Any]:
        from vibro_cli.report.content import section_of_trace

        return section_of_trace(run, name, beside)

    def understood(self, scenario: Any, system: Any) -> dict[str, Any]:
        from vibro_cli.systems.trace.describe import quantities_of

        found = super().understood(scenario, system) | quantities_of(system)
        order = (
            "name", "valid", "scenario", "trace", "bodies", "pairs",
            "law", "inadmissible", "surface", "warnings",
        )  # fmt: skip
        return {name: found[name] for name in order}

    def understood_lines(self, found: dict[str, Any]) -> Iterator[str]:
        from vibro_cli.systems.trace.describe import understood_lines

        return understood_lines(found)


SYSTEM = Trace()


def simulate_system(
    system: TraceSystem,
    stop_time: float | None,
    stop_collisions: int | None,
    engine: str = "compiled",
    wanted: OutputRequest | None = None,
    checkpoint: dict[str, Any] | None = None,
    history: dict[str, Any] | None = None,
) -> Run:
    """Run bodies on a trace until a time (s) or a number of impacts, see ``systems.run``."""
    from vibro_cli.systems.request import Limits, OutputRequest
    from vibro_cli.systems.run import simulate

    limits = Limits(stop_time, stop_collisions)
    return simulate(SYSTEM, system, limits, engine, wanted or OutputRequest(), checkpoint, history)
