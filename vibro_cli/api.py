"""The Python interface: from a scenario to a finished run."""

from __future__ import annotations

from vibro_cli.build import build_system
from vibro_cli.scenario import Scenario, load_scenario
from vibro_cli.simulation.run import Run, Wanted, simulate_system

__all__ = ["Run", "load_scenario", "simulate"]


def simulate(scenario: Scenario, engine: str = "auto") -> Run:
    """Run a scenario to its end.

    Parameters
    ----------
    scenario
        From :func:`load_scenario`.
    engine
        ``"python"`` (interpreted), ``"numba"`` (compiled) or ``"auto"``, which starts interpreted
        and compiles once the run has proved long. All give the same bits.

    Returns
    -------
    The run: ``collisions``, ``events``, ``summary``, ``motion`` as columns, ``sample(times)``.

    Raises
    ------
    ScenarioError
        If the scenario is mechanically impossible; every problem with its place.
    """
    output = scenario.output
    wanted = Wanted(
        times=output.times,
        step=output.step,
        turning_points=output.turning_points,
        friction=output.friction,
    )
    system = build_system(scenario)
    return simulate_system(system, scenario.stop.time, scenario.stop.collisions, engine, wanted)
