"""A run as its folder has it: tables and summary; its motion, solved again."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.api import NotRecalled, recalled
from vibro_cli.scenario import load_any
from vibro_cli.scenario.systems import AnyScenario
from vibro_cli.storage.checking import check_files
from vibro_cli.storage.provenance import manifest, read_manifest
from vibro_cli.storage.runs import NotContinuable, read_earlier_run
from vibro_cli.storage.tables import read_parquet
from vibro_cli.systems.contract import System
from vibro_cli.systems.run import Run

Array = NDArray[np.float64]
Columns = Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class StoredRun:
    """A finished run, read from its folder; it has what the figures and the report need."""

    folder: Path | None
    """Where it is stored, None where it is not."""
    scenario: AnyScenario
    run: Run
    """Its motion: of one that is stored, solved again to the same bits."""
    manifest: Mapping[str, Any]
    summary: Mapping[str, Any]
    """The columns of the summary table as plain values, None for null."""
    _tables: dict[str, Columns] = field(default_factory=dict, repr=False)

    @property
    def kind(self) -> System:
        """What differs from one system to another."""
        return self.run.kind

    @property
    def system(self) -> Any:
        """What was solved."""
        return self.run.system

    def table(self, name: str) -> Columns:
        """Return the columns of a table; null is NaN in numbers and None in words."""
        if name not in self._tables:
            assert self.folder is not None
            data = read_parquet(self.folder / f"{name}.parquet")
            self._tables[name] = {column: data[column].to_numpy() for column in data.column_names}
        return self._tables[name]

    @property
    def collisions(self) -> Columns:
        """The impacts of two bodies."""
        return self.table("collisions")

    @property
    def events(self) -> Columns:
        """What else happened."""
        return self.table("events")

    @property
    def exponents(self) -> Columns | None:
        """How exponents converge, or None if they were not asked for."""
        return self.run.exponents

    @cached_property
    def _flights(self) -> dict[str, Any]:
        return self.run.flights()

    def flights(self) -> dict[str, Any]:
        """Return every flight of every body: where and when it starts and ends, and why."""
        return self._flights

    def flight_curve(
        self, index: int, count: int, lasts: float = math.inf
    ) -> tuple[Array, Array, Array]:
        """Return times (s), positions (rad, m) and rates (rad/s, m/s) along one flight, exactly."""
        return self.run.flight_curve(index, count, lasts)

    def sample(self, times: Any) -> dict[str, Any]:
        """Return the motion of every body at given times (s), exactly; at an event, after it.

        Raises ValueError for a time outside the run.
        """
        return self.run.sample(times)


def as_if_stored(run: Run, scenario: AnyScenario, tables: Mapping[str, Columns]) -> StoredRun:
    """Return a run that has no folder as the report takes it, with its tables."""
    made = manifest("run", {}, {"engine": run.engine})
    return StoredRun(None, scenario, run, made, run.summary_record(), dict(tables))


def open_run(folder: Path) -> StoredRun:
    """Read the folder of a run, and solve it again.

    Raises `NotContinuable` when it is no run of ours, was written by another version of the program
    or has changed since, or does not end again as it did, and `OSError` when a file is missing or
    cannot be read.
    """
    earlier = read_earlier_run(folder)
    _check_tables(folder)
    scenario = load_any(earlier.scenario)
    try:
        run = recalled(scenario, earlier.checkpoint)
    except NotRecalled as error:
        raise NotContinuable(f"{folder}: {error}") from error
    found = read_manifest(folder)
    assert found is not None
    summary = json.loads((folder / "summary.json").read_bytes())
    return StoredRun(folder, scenario, run, found, summary)


def _check_tables(folder: Path) -> None:
    """Raise `NotContinuable` unless the tables and the summary are as they were written."""
    described = (read_manifest(folder) or {})["files"]
    tables = {n: wanted for n, wanted in described.items() if n.endswith((".parquet", ".json"))}
    for damage in check_files(folder, tables):
        raise NotContinuable(f"{folder}/{damage}")
