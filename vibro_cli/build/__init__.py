"""From scenarios to the systems that are solved: the only place that knows both."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

from vibro_cli.build.trace import build_trace as build_system
from vibro_cli.systems import system_named

if TYPE_CHECKING:
    from vibro_cli.scenario.systems import AnyScenario

AnySystem: TypeAlias = Any
"""What is solved, of whatever kind."""

__all__ = ["AnySystem", "build_any", "build_system", "warnings_of"]


def build_any(scenario: AnyScenario) -> AnySystem:
    """Return the system of a scenario of whatever kind, checked against its mechanics.

    Raises ScenarioError with everything that is wrong.
    """
    return system_named(scenario.system).build(scenario)


def warnings_of(scenario: AnyScenario, system: AnySystem) -> tuple[str, ...]:
    """Return what a user should know about a sound system before running it, a sentence each."""
    return system_named(scenario.system).warnings(scenario, system)
