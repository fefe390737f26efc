"""From scenarios to the systems that are solved: the only place that knows both."""

from __future__ import annotations

from itertools import combinations, pairwise
from typing import TYPE_CHECKING, TypeAlias

from vibro_cli.build.trace import build_trace as build_system
from vibro_cli.mechanics.caveats import law_warnings, mechanics_warnings
from vibro_cli.mechanics.system import System

if TYPE_CHECKING:
    from vibro_cli.scenario.systems import AnyScenario
    from vibro_cli.systems.springs.system import SpringsSystem
    from vibro_cli.systems.table.system import TableSystem

    AnySystem: TypeAlias = System | TableSystem | SpringsSystem

__all__ = ["build_any", "build_system", "warnings_of"]


def build_any(scenario: AnyScenario) -> AnySystem:
    """Return the system of a scenario of whatever kind, checked against its mechanics.

    Raises ScenarioError with everything that is wrong.
    """
    if scenario.system == "table":
        from vibro_cli.build.table import build_table

        return build_table(scenario)
    if scenario.system == "springs":
        from vibro_cli.build.springs import build_springs

        return build_springs(scenario)
    return build_system(scenario)


def warnings_of(scenario: AnyScenario, system: AnySystem) -> tuple[str, ...]:
    """Return what a user should know about a sound system before running it, a sentence each."""
    if isinstance(system, System):
        return mechanics_warnings(system, scenario.stop.time)
    on_table = scenario.system == "table"
    pairs = list(combinations(system.bodies, 2) if on_table else pairwise(system.bodies))
    return tuple(law_warnings(system.law, system.inadmissible, pairs))
