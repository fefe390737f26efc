"""The Python interface: from a scenario to a finished run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias, overload

from vibro_cli.build import build_system
from vibro_cli.scenario import Scenario, load_scenario
from vibro_cli.simulation.continuing import CannotContinue
from vibro_cli.simulation.drive import TooQuiet
from vibro_cli.simulation.run import Run, Wanted, simulate_system

if TYPE_CHECKING:
    from vibro_cli.scenario.springs_models import SpringsScenario
    from vibro_cli.scenario.systems import AnyScenario
    from vibro_cli.scenario.table_models import TableScenario
    from vibro_cli.systems.springs.run import SpringsRun
    from vibro_cli.systems.table.run import TableRun

    Values: TypeAlias = dict[str, Any]
    AnyRun: TypeAlias = Run | TableRun | SpringsRun

__all__ = ["CannotContinue", "Run", "TooQuiet", "load_scenario", "simulate"]


@overload
def simulate(
    scenario: Scenario,
    engine: str = "auto",
    checkpoint: dict[str, Any] | None = None,
    history: dict[str, Any] | None = None,
) -> Run: ...


@overload
def simulate(
    scenario: TableScenario,
    engine: str = "auto",
    checkpoint: dict[str, Any] | None = None,
    history: dict[str, Any] | None = None,
) -> TableRun: ...


@overload
def simulate(
    scenario: SpringsScenario,
    engine: str = "auto",
    checkpoint: dict[str, Any] | None = None,
    history: dict[str, Any] | None = None,
) -> SpringsRun: ...


def simulate(
    scenario: AnyScenario,
    engine: str = "auto",
    checkpoint: dict[str, Any] | None = None,
    history: dict[str, Any] | None = None,
) -> AnyRun:
    """Run a scenario to its end.

    Parameters
    ----------
    scenario
        From :func:`load_scenario`.
    engine
        ``"python"`` (interpreted), ``"numba"`` (compiled) or ``"auto"``, which starts interpreted
        and compiles once the run has proved long. All give the same bits.
    checkpoint, history
        From ``run.checkpoint()`` and ``run.history()`` of an earlier run of this scenario with a
        nearer stop: it goes on from there, and the result is that of one run without a break.

    Returns
    -------
    The run: ``collisions``, ``events``, ``summary``, ``motion`` as columns, ``sample(times)``.

    Raises
    ------
    ScenarioError
        If the scenario is mechanically impossible; every problem with its place.
    TooQuiet
        If millions of crossings follow one another without an impact.
    CannotContinue
        If the earlier run had ended for good, or is past the stop.
    """
    if scenario.system == "table":
        return _simulate_table(scenario, engine, checkpoint, history)
    if scenario.system == "springs":
        return _simulate_springs(scenario, engine, checkpoint, history)
    output = scenario.output
    wanted = Wanted(
        times=output.times,
        step=output.step,
        turning_points=output.turning_points,
        friction=output.friction,
    )
    system = build_system(scenario)
    stop = scenario.stop
    return simulate_system(system, stop.time, stop.collisions, engine, wanted, checkpoint, history)


def _simulate_table(
    scenario: TableScenario, engine: str, checkpoint: Values | None, history: Values | None
) -> TableRun:
    from vibro_cli.build.table import build_table
    from vibro_cli.systems.table.run import simulate_table
    from vibro_cli.systems.wanted import Wanted

    wanted = Wanted(scenario.output.times, scenario.output.step)
    stop = scenario.stop
    limits = stop.time, stop.collisions, stop.bounces
    return simulate_table(build_table(scenario), *limits, engine, wanted, checkpoint, history)


def _simulate_springs(
    scenario: SpringsScenario, engine: str, checkpoint: Values | None, history: Values | None
) -> SpringsRun:
    from vibro_cli.build.springs import build_springs
    from vibro_cli.systems.springs.run import simulate_springs
    from vibro_cli.systems.wanted import Wanted

    wanted = Wanted(scenario.output.times, scenario.output.step)
    stop = scenario.stop
    limits = stop.time, stop.collisions
    return simulate_springs(build_springs(scenario), *limits, engine, wanted, checkpoint, history)
