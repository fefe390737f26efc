"""Which model reads a scenario: its key `system` tells, and the object of that system has it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, Self

from vibro_cli.scenario.base import ScenarioTable
from vibro_cli.scenario.problems import Place
from vibro_cli.systems import NAMES, system_named


class AnyScenario(Protocol):
    """What the scenarios of every system have."""

    @property
    def name(self) -> str:
        """Of the scenario."""

    @property
    def system(self) -> str:
        """Of which system it is."""

    @property
    def balls(self) -> tuple[Any, ...]:
        """The bodies."""

    @property
    def collision(self) -> Any:
        """The impact law."""

    @property
    def stop(self) -> Any:
        """When the run ends."""

    @property
    def output(self) -> Any:
        """What is wanted beside the impacts."""

    def given(self) -> dict[str, Any]:
        """What a user wrote of it."""

    def replace(self, changes: Mapping[str, Any]) -> Self:
        """Return the scenario with other values, by their paths."""

    def _repr_html_(self) -> str:
        """Show it in a notebook."""

    def place(self, key_path: str) -> Place:
        """Return where a key stands in its file."""

    def resolved(self) -> dict[str, Any]:
        """Return every key with its value, as plain values."""


def model_named(system: str) -> type[ScenarioTable]:
    """Return the model of the scenarios of a system."""
    return system_named(system).model


def system_of(data: Any) -> str:
    """Return the system of the data of a scenario; without one that there is, `trace`."""
    system = data.get("system") if isinstance(data, Mapping) else None
    return system if isinstance(system, str) and system in NAMES else "trace"


def model_of(data: Any) -> type[ScenarioTable]:
    """Return the model for the data of a scenario; without a system it knows, that of a trace."""
    return model_named(system_of(data))
