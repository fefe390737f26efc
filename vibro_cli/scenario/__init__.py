"""Scenarios: their models, readers for TOML, JSON and YAML, and their faults."""

from vibro_cli.scenario.loading import any_scenario_of, load_any, scenario_of
from vibro_cli.scenario.models import Scenario
from vibro_cli.scenario.problems import Problem, ScenarioError

__all__ = [
    "Problem",
    "Scenario",
    "ScenarioError",
    "any_scenario_of",
    "load_any",
    "scenario_of",
]
