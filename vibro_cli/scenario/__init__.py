"""Scenarios: their models, reading them from TOML, JSON and YAML, and what is wrong with them."""

from vibro_cli.scenario.loading import (
    any_scenario_of,
    load_any,
    load_scenario,
    parse_any,
    parse_scenario,
    scenario_of,
)
from vibro_cli.scenario.models import (
    Arc,
    Ball,
    Collision,
    Ends,
    Output,
    Scenario,
    Stop,
    Trace,
    Turning,
    Wall,
)
from vibro_cli.scenario.problems import Place, Problem, ScenarioError

__all__ = [
    "Arc",
    "Ball",
    "Collision",
    "Ends",
    "Output",
    "Place",
    "Problem",
    "Scenario",
    "ScenarioError",
    "Stop",
    "Trace",
    "Turning",
    "Wall",
    "any_scenario_of",
    "load_any",
    "load_scenario",
    "parse_any",
    "parse_scenario",
    "scenario_of",
]
