"""Scenarios from texts."""

from collections.abc import Sequence

from vibro_cli.scenario import Scenario, any_scenario_of, loading, scenario_of
from vibro_cli.scenario.base import AnyScenario


def parse_any(
    text: str, form: str = "toml", overrides: Sequence[str] = (), file: str = "<text>"
) -> AnyScenario:
    """Return the scenario, of any system, that a text contains."""
    return any_scenario_of(loading.parse_document(text, form, file), overrides)


def parse_scenario(
    text: str, form: str = "toml", overrides: Sequence[str] = (), file: str = "<text>"
) -> Scenario:
    """Return the scenario of a trace that a text contains."""
    return scenario_of(loading.parse_document(text, form, file), overrides)
