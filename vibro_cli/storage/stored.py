"""A run and a grid as their folders have them: tables and summaries; motion, solved again."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from errno import ENOENT, ESTALE
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.api import NotRecalled, recalled, recalled_motion
from vibro_cli.assemble import build_any
from vibro_cli.errors import VibroError
from vibro_cli.scenario.base import AnyScenario
from vibro_cli.scenario.loading import load_stored
from vibro_cli.storage.files import GRID_NAME, check_files, read_manifest
from vibro_cli.storage.folders import NotContinuable, read_earlier_run
from vibro_cli.storage.tables import (
    PartsTable,
    as_array,
    dataset_of,
    read_column,
    rows_by_group,
    schema_of,
    unit_of,
    units_of_numbers,
)
from vibro_cli.systems import system_named
from vibro_cli.systems.contract import Motion, System, Trajectory
from vibro_cli.systems.run import Run

if TYPE_CHECKING:
    import pyarrow

# Columns of a table that are in memory at once, of a short one as many as have so many values.
_MOST_COLUMNS = 8
_MOST_VALUES = 1 << 20
# Rows of all columns of a table that are kept once some of its first rows are asked for.
_FIRST = 1000

Array = NDArray[np.float64]
Column = NDArray[Any]
Columns = Mapping[str, Column]


@dataclass(frozen=True, eq=False)
class StoredRun:
    """A finished run, from its folder or in memory: what figures, reports and Python need of it."""

    folder: Path | None
    """Where it is stored, None where it is not."""
    scenario: AnyScenario
    manifest: Mapping[str, Any]
    summary: Mapping[str, Any]
    """The columns of the summary table as plain values, None for null."""
    checkpoint: Mapping[str, Any] = field(repr=False)
    """From which it could go on, by which it is known again when it is solved again."""
    _solved: Any = field(default=None, repr=False)
    """The run itself, of one that is not stored, or its motion where that is at hand."""
    _tables: dict[str, Columns] = field(default_factory=dict, init=False, repr=False)
    place: Path | None = field(init=False, repr=False)
    """The folder, found also after the working directory has changed"""

    def __post_init__(self) -> None:
        object.__setattr__(self, "place", self.folder and self.folder.absolute())

    @cached_property
    def motion(self) -> Motion:
        """Its motion: of one that is stored, solved again to the same bits.

        Raises `NotContinuable` when it does not end again as it did.
        """
        if self._solved is not None:
            return self._solved  # type: ignore[no-any-return]
        try:
            return recalled_motion(self.scenario, self.checkpoint)
        except NotRecalled as error:
            raise NotContinuable(f"{self.folder}: {error}") from error

    @cached_property
    def run(self) -> Run:
        """The run with all its logs, however long it is."""
        if isinstance(self.motion, Run):
            return self.motion
        return recalled(self.scenario, self.checkpoint)

    @property
    def kind(self) -> System:
        """What differs from one system to another."""
        return system_named(self.scenario.system)

    @cached_property
    def system(self) -> Any:
        """What was solved."""
        return self.run.system if self.place is None else build_any(self.scenario)

    def table(self, name: str) -> Columns:
        """Return the columns of a table; null is NaN in numbers and None in words."""
        if self.place is None:
            found = self.run.table(name)
            assert found is not None
            return found
        if name not in self._tables:
            file = self.place / f"{name}.parquet"
            self._tables[name] = StoredColumns([file], check=self.check_not_replaced)
        return self._tables[name]

    def check_not_replaced(self) -> None:
        """Raise `OSError` if the folder now holds another run than the one that was opened.

        Asked after each reading: folders are replaced whole, so that what was read is of this run.
        """
        if self.place is None or not self.manifest:  # in memory, or in the making
            return
        if read_manifest(self.place) != self.manifest:
            raise OSError(ESTALE, "the run was replaced", str(self.folder))

    @property
    def collisions(self) -> Columns:
        """The impacts of two bodies."""
        return self.table("collisions")

    @property
    def bounces(self) -> Columns:
        """The impacts on the wall."""
        return self.table("bounces")

    @property
    def events(self) -> Columns:
        """What else happened."""
        return self.table("events")

    @property
    def end_time(self) -> float:
        """When it ended (s)."""
        return float(self.summary["end_time"])

    @property
    def trajectory(self) -> Trajectory:
        """The motion of all bodies, in closed form."""
        return self.motion.trajectory  # type: ignore[attr-defined, no-any-return]

    @property
    def exponents(self) -> Columns | None:
        """How exponents converge, or None if they were not asked for."""
        if self.place is None:
            return self.run.exponents
        there = (self.place / "exponents.parquet").exists()
        return self.table("exponents") if there else None

    @cached_property
    def _flights(self) -> dict[str, Any]:
        return self.motion.flights()

    def flights(self) -> dict[str, Any]:
        """Return every flight of every body: where and when it starts and ends, and why."""
        return self._flights

    def look_at(self, rows: Any) -> None:
        """Take note of the flights, rows of their table, whose curves will be asked for."""
        self.motion.look_at(rows)

    def flight_curve(
        self, index: int, count: int, lasts: float = math.inf
    ) -> tuple[Array, Array, Array]:
        """Return times (s), positions (rad, m) and rates (rad/s, m/s) along one flight, exactly."""
        return self.motion.flight_curve(index, count, lasts)

    def sample(self, times: Any, side: str = "after", extrapolate: bool = False) -> dict[str, Any]:
        """Return the motion of every body at given times (s), exactly, see ``systems.run.Run``."""
        return self.motion.sample(times, side, extrapolate)


def in_memory(run: Run, scenario: AnyScenario) -> StoredRun:
    """Return a run that has no folder; nor has it a manifest."""
    return StoredRun(None, scenario, {}, run.summary_record(), run.checkpoint(), run)


def open_run(folder: Path) -> StoredRun:
    """Read the folder of a run; it is solved again when its motion is asked for.

    Raises `NotContinuable` when it is no run of ours, was written by another version of the program
    or has changed since, and `OSError` when a file is missing or cannot be read.
    """
    earlier = read_earlier_run(folder)
    _check_tables(folder, earlier.manifest)
    summary = json.loads((folder / "summary.json").read_bytes())
    scenario = load_stored(earlier.scenario)
    run = StoredRun(folder, scenario, earlier.manifest, summary, earlier.checkpoint)
    run.check_not_replaced()
    return run


class StoredColumns(Mapping[str, Column]):
    """The columns of parquet files of one schema, each read when asked for.

    The last `most` that were asked for are kept, of short files more. `check` is called after each
    reading, and raises where other files may have been read.
    """

    def __init__(
        self,
        parts: Sequence[Path],
        most: float = _MOST_COLUMNS,
        check: Callable[[], object] = bool,
    ) -> None:
        self.schema = schema_of(parts[0])
        check()
        self._parts, self._most, self._check = parts, most, check
        self._columns: dict[str, Column] = {}
        self._first: dict[str, Column] = {}

    def first(self, rows: int) -> Columns:
        """Return the first rows, of one file."""
        if not self._first:
            found = _columns(next(rows_by_group(self._parts[0], slice(_FIRST))))
            self._check()
            # Copies, so that the whole group of rows does not stay in memory.
            self._first = {name: values.copy() for name, values in found.items()}
        found = {name: values[:rows] for name, values in self._first.items()}
        complete = rows <= len(found["n"]) or len(found["n"]) == len(self["n"])
        return found if complete else {name: values[:rows] for name, values in self.items()}

    def __getitem__(self, name: str) -> Column:
        if name not in self:
            raise KeyError(name)
        values = self._columns.pop(name, None)
        if values is None:
            values = read_column(self._parts, name)
            self._check()
        self._columns[name] = values
        if len(self._columns) > max(self._most, _MOST_VALUES // max(len(values), 1)):
            self._columns.pop(next(iter(self._columns)))
        return self._columns[name]

    def __contains__(self, name: object) -> bool:
        return name in self.schema.names

    def __iter__(self) -> Iterator[str]:
        return iter(self.schema.names)

    def __len__(self) -> int:
        return len(self.schema.names)


def _check_tables(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Raise `NotContinuable` unless the tables and the summary are as they were written."""
    described = manifest["files"].items()
    tables = {n: wanted for n, wanted in described if n.endswith((".parquet", ".json"))}
    for damage in check_files(folder, tables):
        raise NotContinuable(f"{folder}/{damage}")


class NotAGrid(VibroError):
    """A folder holds no grid of ours that can be read; the message says why."""


@dataclass(frozen=True)
class StoredGrid:
    """A grid of scenarios, or what there is of it so far."""

    folder: Path
    definition: Mapping[str, Any]
    """What was asked for, as `grid.json` has it."""
    manifest: Mapping[str, Any]
    axes: tuple[str, ...]
    """Key paths of the axes: the names of their columns."""
    units: Mapping[str, str]
    """Units of the columns of the summary."""
    summary: Mapping[str, Column]
    """A row for each point: the axes' values, then the columns of the summary table."""
    owner: object = None
    """What removes the folder once it is not used any more, if it is temporary."""
    place: Path = field(init=False, repr=False)
    """The folder, found also after the working directory has changed"""
    maps: dict[tuple[int, bool], Any] = field(
        init=False, default_factory=dict, repr=False, compare=False
    )
    """The points that figures over so many axes show, once one has been drawn."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "place", self.folder.absolute())

    @property
    def name(self) -> str:
        """The name of the grid."""
        return str(self.definition["name"])

    @property
    def system(self) -> str:
        """The system of its scenarios."""
        return str(self.definition["scenario"].get("system", "trace"))

    @property
    def shapes(self) -> tuple[str, ...]:
        """Shapes of the pieces of the trace, none for another system."""
        trace = self.definition["scenario"].get("trace", {})
        return tuple(str(piece["shape"]) for piece in trace.get("arcs", ()))

    @property
    def logarithmic(self) -> frozenset[str]:
        """Key paths of the axes whose values are at even ratios, of one sign."""
        axes = (axis for axis in self.definition["axes"] if "logspace" in axis)
        return frozenset(path for axis in axes for path in axis["paths"])

    @property
    def points(self) -> int:
        """Number of points that are there."""
        return len(self.summary["scenario"])

    @property
    def unsolved(self) -> str:
        """Says that points are still to be solved, empty where none is."""
        total = int(self.manifest["points"])
        return "" if self.points == total else f"{self.points} of {total} points are solved so far"

    def table(self, name: str) -> PartsTable:
        """Return a table of all points, such as ``collisions``, which is read as it is asked for.

        Raises ``KeyError`` where the grid has none of that name, ``OSError`` where it is gone.
        """
        parts = self._parts(name)
        if not parts:
            raise KeyError(f"the grid {self.name} kept no table {name}")
        return PartsTable(parts, self.owner)

    def impact_columns(self) -> tuple[str, ...]:
        """Return the columns of the table of impacts, none where none was kept."""
        parts = self._parts("collisions")
        return tuple(schema_of(parts[0]).names) if parts else ()

    def impact_units(self) -> dict[str, str]:
        """Return the units of the columns of numbers of the impacts, by name."""
        parts = self._parts("collisions")
        return units_of_numbers(schema_of(parts[0])) if parts else {}

    def impacts(self, columns: Sequence[str], scenarios: Column) -> dict[str, Column]:
        """Return some columns of the impacts of some scenarios, in their order."""
        import pyarrow.compute as compute

        wanted = compute.field("scenario").isin(scenarios.tolist())
        data = dataset_of(self._parts("collisions"))
        return _columns(data.to_table(list(columns), filter=wanted))

    def _parts(self, name: str) -> list[Path]:
        """The files of a table, none where the grid did not keep it."""
        parts = _parts(self.place, self.manifest, name)
        if not all(part.exists() for part in parts):
            raise FileNotFoundError(ENOENT, "the table is gone", str(self.folder / name))
        return parts


def is_grid(folder: Path) -> bool:
    """Return whether a folder says that it holds a grid."""
    return (folder / GRID_NAME).is_file()


def open_grid(folder: Path, owner: object = None) -> StoredGrid:
    """Read the folder of a grid, all its points or those that are finished; it has an `owner`.

    Raises `NotAGrid` when it is none of ours, holds no finished point, or when a file of it is
    missing or not as it was written.
    """
    try:
        definition = json.loads((folder / GRID_NAME).read_bytes())
    except (FileNotFoundError, NotADirectoryError) as error:
        raise NotAGrid(
            f"{folder} holds no grid; expected a folder that `vibro grid` wrote"
        ) from error
    except (OSError, ValueError) as error:
        raise NotAGrid(f"{folder} holds no grid: {error}") from error
    manifest = read_manifest(folder)
    if manifest is None or not str(manifest["schema"]).startswith("vibro-grid/"):
        raise NotAGrid(f"{folder} holds no grid of vibro; expected its manifest")
    parts = _parts(folder.absolute(), manifest, "summary")
    if not any(part.exists() for part in parts):
        raise NotAGrid(f"{folder} holds no finished point of its grid")
    for damage in check_files(folder, manifest["files"]):
        raise NotAGrid(f"{folder}/{damage}; vibro grid GRID --repair solves it again")
    summary = StoredColumns(parts, math.inf)
    names = summary.schema.names
    return StoredGrid(
        folder=folder,
        definition=definition,
        manifest=manifest,
        axes=tuple(names[names.index("scenario") + 1 : names.index("status")]),
        units={field.name: unit_of(field) for field in summary.schema},
        summary=summary,
        owner=owner,
    )


def _parts(folder: Path, manifest: Mapping[str, Any], name: str) -> list[Path]:
    """The files of a table, of finished chunks: what else is there is not of the grid."""
    return [folder / file for file in manifest["files"] if file.startswith(f"{name}/")]


def _columns(data: pyarrow.Table) -> dict[str, Column]:
    """The columns as arrays; null is NaN in numbers and None in words."""
    return {name: as_array(data[name]) for name in data.column_names}
