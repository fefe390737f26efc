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
from vibro_cli.build.springs import build_springs
from vibro_cli.build.table import build_table
from vibro_cli.mechanics.system import System
from vibro_cli.scenario import Scenario, load_any
from vibro_cli.simulation.geometry import Places
from vibro_cli.simulation.paths import Paths
from vibro_cli.storage.provenance import read_manifest
from vibro_cli.storage.runs import EarlierRun, NotContinuable, read_earlier_run
from vibro_cli.storage.tables import read_parquet

if TYPE_CHECKING:
    import pyarrow

    from vibro_cli.scenario.springs_models import SpringsScenario
    from vibro_cli.scenario.table_models import TableScenario
    from vibro_cli.systems.springs.run import SpringsRun
    from vibro_cli.systems.table.run import TableRun

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


@dataclass(frozen=True)
class StoredSystemRun:
    """A finished run of a system besides the trace, read from its folder."""

    folder: Path
    scenario: "TableScenario | SpringsScenario"
    run: "TableRun | SpringsRun"
    """Its tables and its motion."""
    manifest: Mapping[str, Any]
    summary: Mapping[str, Any]
    """The columns of the summary table as plain values, None for null."""


def open_any_run(folder: Path) -> StoredRun | StoredSystemRun:
    """Read the folder of a run of whatever system.

    Raises `NotContinuable` when it is no run of ours, was written by another version of the program
    or has changed since, and `OSError` when a file is missing or cannot be read.
    """
    earlier = read_earlier_run(folder)
    scenario = load_any(earlier.scenario)
    if scenario.system == "trace":
        return _open_trace(folder, scenario, earlier)
    return _open_system(folder, scenario, earlier)


def open_run(folder: Path) -> StoredRun:
    """Read the folder of a run of a trace; else as :func:`open_any_run`."""
    found = open_any_run(folder)
    if not isinstance(found, StoredRun):
        raise NotContinuable(f"{folder} is of the system {found.scenario.system}, expected a trace")
    return found


def _open_system(
    folder: Path, scenario: "TableScenario | SpringsScenario", earlier: EarlierRun
) -> StoredSystemRun:
    from vibro_cli.systems.springs.run import SpringsRun
    from vibro_cli.systems.table.run import TableRun

    manifest = read_manifest(folder)
    assert manifest is not None
    kept = str(manifest["engine"]), earlier.checkpoint, earlier.history
    run: TableRun | SpringsRun
    if scenario.system == "table":
        run = TableRun.stored(build_table(scenario), *kept)
    else:
        run = SpringsRun.stored(build_springs(scenario), *kept)
    summary = json.loads((folder / "summary.json").read_bytes())
    return StoredSystemRun(folder, scenario, run, manifest, summary)


def _open_trace(folder: Path, scenario: Scenario, earlier: EarlierRun) -> StoredRun:
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
