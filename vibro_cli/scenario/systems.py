"""The systems there are: which model reads a scenario is told by its key `system`."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeAlias

from vibro_cli.scenario.base import ScenarioTable
from vibro_cli.scenario.models import SYSTEMS, Scenario

if TYPE_CHECKING:
    from vibro_cli.scenario.springs_models import SpringsScenario
    from vibro_cli.scenario.table_models import TableScenario

    AnyScenario: TypeAlias = Scenario | TableScenario | SpringsScenario

# A module is read when a scenario of its system is: most are of the trace.
_MODELS = {
    "springs": ("vibro_cli.scenario.springs_models", "SpringsScenario"),
    "table": ("vibro_cli.scenario.table_models", "TableScenario"),
}


def model_named(system: str) -> type[ScenarioTable]:
    """Return the model of the scenarios of a system, one of `SYSTEMS`."""
    assert system in SYSTEMS
    if system not in _MODELS:
        return Scenario
    module, name = _MODELS[system]
    model: type[ScenarioTable] = getattr(import_module(module), name)
    return model


def system_of(data: Any) -> str:
    """Return the system of the data of a scenario; without one that there is, `trace`."""
    system = data.get("system") if isinstance(data, Mapping) else None
    return system if isinstance(system, str) and system in SYSTEMS else "trace"


def model_of(data: Any) -> type[ScenarioTable]:
    """Return the model for the data of a scenario; without a system it knows, that of a trace."""
    return model_named(system_of(data))
