"""A run as its folder has it: tables, summary and motion, without solving anything again."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.build import build_system
from vibro_cli.mechanics.system import System
from vibro_cli.scenario import Scenario, load_any
from vibro_cli.simulation.geometry import Places
from vibro_cli.simulation.paths import Paths
from vibro_cli.storage.provenance import read_manifest
from vibro_cli.storage.runs import NotContinuable, read_earlier_run
from vibro_cli.storage.tables import read_parquet

if TYPE_CHECKING:
    import pyarrow

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StoredRun:
    """A finished run, read from its folder; it has what the figures and the report need."""

    folder: Path
    scenario: Scenario
    system: System
    manifest: Mapping[str, Any]
    summary: Mapping[str, Any]
    """The columns of the summary table as plain values, None for null."""
    collisions: Mapping[str, NDArray[Any]]
    events: Mapping[str, NDArray[Any]]
    _paths: Paths = field(repr=False)

    @cached_property
    def _flights(self) -> dict[str, Any]:
        return self._paths.table()

    def flights(self) -> dict[str, Any]:
        """Return every flight of every body: where and when it starts and ends, and why."""
        return self._flights

    def flight_curve(self, index: int, count: int) -> tuple[Array, Array, Array]:
        """Return times (s), positions (rad, m) and rates (rad/s, m/s) along one flight, exactly."""
        return self._paths.curve(index, count)

    def sample(self, times: Any) -> dict[str, Any]:
        """Return the motion of every body at given times (s), exactly; at an event, after it."""
        return self._paths.sample(times)


def open_run(folder: Path) -> StoredRun:
    """Read the folder of a run.

    Raises `NotContinuable` when it is no run of ours, was written by another version of the program
    or has changed since, and `OSError` when a file is missing or cannot be read.
    """
    earlier = read_earlier_run(folder)
    scenario = load_any(earlier.scenario)
    if scenario.system != "trace":
        raise NotContinuable(f"{folder} is of the system {scenario.system}; expected a trace")
    system = build_system(scenario)
    logs = earlier.history
    end = earlier.checkpoint["end_time"]
    manifest = read_manifest(folder)
    assert manifest is not None
    return StoredRun(
        folder=folder,
        scenario=scenario,
        system=system,
        manifest=manifest,
        summary=json.loads((folder / "summary.json").read_bytes()),
        collisions=_columns(read_parquet(folder / "collisions.parquet")),
        events=_columns(read_parquet(folder / "events.parquet")),
        _paths=Paths(Places(system), logs["log"], logs["segments"], end, 0.0),
    )


def _columns(data: "pyarrow.Table") -> dict[str, NDArray[Any]]:
    """The columns as arrays; null is NaN in numbers and None in words."""
    return {name: data[name].to_numpy() for name in data.column_names}
