"""The model of scenarios of `system = "trace"`, by which those without this key are read too."""

from vibro_cli.scenario.models import Scenario

MODEL = Scenario
