"""Stored runs and grids: tables and summaries from their folders, motion by solving again."""

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
from vibro_cli.errors import NoTable, VibroError
from vibro_cli.scenario.base import AnyScenario
from vibro_cli.scenario.loading import load_stored
from vibro_cli.storage.files import GRID_NAME, check_files, read_manifest
from vibro_cli.storage.folders import NotContinuable, check_intact, read_earlier_run
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

# Columns of a table in memory at once; of a short table, as many as have this many values.
_MOST_COLUMNS = 8
_MOST_VALUES = 1 << 20
# Rows of all columns of a table that are kept once some of its first rows are asked for.
_FIRST = 1000

Array = NDArray[np.float64]
Column = NDArray[Any]
Columns = Mapping[str, Column]


@dataclass(frozen=True, eq=False)
class StoredRun:
    """A finished run, from its folder or in memory, for figures, reports and Python."""

    folder: Path | None
    """Folder of the run, None if it is not stored."""
    scenario: AnyScenario
    manifest: Mapping[str, Any]
    summary: Mapping[str, Any]
    """Columns of the summary table as plain values, None for null."""
    checkpoint: Mapping[str, Any] = field(repr=False)
    """Checkpoint for a continuation; it also verifies that solving again gives the same run."""
    _solved: Any = field(default=None, repr=False)
    """The run itself if it is not stored, or its motion if available."""
    _tables: dict[str, Columns] = field(default_factory=dict, init=False, repr=False)
    place: Path | None = field(init=False, repr=False)
    """Absolute path of the folder."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "place", self.folder and self.folder.absolute())

    @cached_property
    def motion(self) -> Motion:
        """Motion of the run; a stored run is solved again to the same bits.

        Raises `NotContinuable` if it does not end in the stored state.
        """
        if self._solved is not None:
            return self._solved  # type: ignore[no-any-return]
        try:
            return recalled_motion(self.scenario, self.checkpoint)
        except NotRecalled as error:
            raise NotContinuable(f"{self.folder}: {error}") from error

    @cached_property
    def run(self) -> Run:
        """The run with all its logs, of any length."""
        if isinstance(self.motion, Run):
            return self.motion
        return recalled(self.scenario, self.checkpoint)

    @property
    def kind(self) -> System:
        """The object of its system."""
        return system_named(self.scenario.system)

    @cached_property
    def system(self) -> Any:
        """The system that was solved."""
        return self.run.system if self.place is None else build_any(self.scenario)

    def table(self, name: str) -> Columns:
        """Return the columns of a table; null becomes NaN in numbers and None in words."""
        if self.place is None:
            found = self.run.table(name)
            assert found is not None
            return found
        if name not in self._tables:
            file = self.place / f"{name}.parquet"
            self._tables[name] = StoredColumns([file], check=self.check_not_replaced)
        return self._tables[name]

    def check_not_replaced(self) -> None:
        """Raise `OSError` if the folder no longer holds the run that was opened.

        As folders are replaced atomically, a check after each reading proves that the data belong
        to this run.
        """
        if self.place is None or not self.manifest:  # in memory, or unfinished
            return
        if read_manifest(self.place) != self.manifest:
            raise OSError(ESTALE, "the run was replaced", str(self.folder))

    @property
    def collisions(self) -> Columns:
        """Impacts of two bodies."""
        return self.table("collisions")

    @property
    def bounces(self) -> Columns:
        """Impacts on the wall."""
        return self.table("bounces")

    @property
    def events(self) -> Columns:
        """Other events."""
        return self.table("events")

    @property
    def end_time(self) -> float:
        """Time of the end (s)."""
        return float(self.summary["end_time"])

    @property
    def trajectory(self) -> Trajectory:
        """The motion of all bodies, in closed form."""
        return self.motion.trajectory  # type: ignore[attr-defined, no-any-return]

    @property
    def exponents(self) -> Columns | None:
        """Table of converging exponents, or None if they were not requested."""
        if self.place is None:
            return self.run.exponents
        there = (self.place / "exponents.parquet").exists()
        return self.table("exponents") if there else None

    @cached_property
    def _flights(self) -> dict[str, Any]:
        return self.motion.flights()

    def flights(self) -> dict[str, Any]:
        """Return all flights of all bodies: start, end and why each one ended."""
        return self._flights

    def look_at(self, rows: Any) -> None:
        """Announce the flights, as rows of their table, whose curves will be requested."""
        self.motion.look_at(rows)

    def flight_curve(
        self, index: Any, count: Any, lasts: float = math.inf
    ) -> tuple[Array, Array, Array]:
        """Return times, positions and rates along flights, see ``systems.run.Run``."""
        return self.motion.flight_curve(index, count, lasts)

    def sample(self, times: Any, side: str = "after", extrapolate: bool = False) -> dict[str, Any]:
        """Return the exact columns of the motion table at times (s), see ``systems.run.Run``."""
        return self.motion.sample(times, side, extrapolate)


def in_memory(run: Run, scenario: AnyScenario) -> StoredRun:
    """Return a stored run without folder and manifest."""
    return StoredRun(None, scenario, {}, run.summary_record(), run.checkpoint(), run)


def open_run(folder: Path) -> StoredRun:
    """Read the folder of a run; the run is solved again when its motion is requested.

    Raises `NotContinuable` if it is not a run of vibro, was written by another version of the
    program or has changed since, and `OSError` if a file is missing or cannot be read.
    """
    earlier = read_earlier_run(folder)
    described = earlier.manifest["files"].items()
    tables = {n: wanted for n, wanted in described if n.endswith((".parquet", ".json"))}
    check_intact(folder, tables)
    summary = json.loads((folder / "summary.json").read_bytes())
    scenario = load_stored(earlier.scenario)
    run = StoredRun(folder, scenario, earlier.manifest, summary, earlier.checkpoint)
    run.check_not_replaced()
    return run


class StoredColumns(Mapping[str, Column]):
    """The columns of Parquet files with a common schema, each read on demand.

    The last `most` columns read are kept, and more of short files. `check` is called after each
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
        """Return the first rows of a table in a single file."""
        if not self._first:
            found = _columns(next(rows_by_group(self._parts[0], slice(_FIRST))))
            self._check()
            # Copies, as views would keep the whole group of rows in memory.
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


class NotAGrid(VibroError):
    """A folder does not hold a readable grid of vibro; the message says why."""


@dataclass(frozen=True, eq=False)
class StoredGrid:
    """A grid of scenarios, complete or with the points solved so far."""

    folder: Path
    definition: Mapping[str, Any]
    """Definition of the grid, the content of `grid.json`."""
    manifest: Mapping[str, Any]
    axes: tuple[str, ...]
    """Key paths of the axes, which are the names of their columns."""
    units: Mapping[str, str]
    """Units of the columns of the summary."""
    summary: Mapping[str, Column]
    """One row per point: values of the axes, then the columns of the summary table."""
    owner: object = None
    """Object that removes a temporary folder when it is no longer used."""
    place: Path = field(init=False, repr=False)
    """Absolute path of the folder."""

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
        """Shapes of the pieces of the trace, empty for other systems."""
        trace = self.definition["scenario"].get("trace", {})
        return tuple(str(piece["shape"]) for piece in trace.get("arcs", ()))

    @property
    def logarithmic(self) -> frozenset[str]:
        """Key paths of the axes with logarithmic spacing."""
        axes = (axis for axis in self.definition["axes"] if "logspace" in axis)
        return frozenset(path for axis in axes for path in axis["paths"])

    @property
    def points(self) -> int:
        """Number of points solved."""
        return len(self.summary["scenario"])

    @property
    def unsolved(self) -> str:
        """Message that some points are not solved yet, empty if the grid is complete."""
        total = int(self.manifest["points"])
        return "" if self.points == total else f"{self.points} of {total} points are solved so far"

    def table(self, name: str) -> PartsTable:
        """Return a table of all points, such as ``collisions``, which is read on demand.

        Raises ``KeyError`` if the grid has no such table, ``OSError`` if its files are gone.
        """
        parts = self._parts(name)
        if not parts:
            how = " (collisions=True of sweep, or [keep] collisions = true, keeps the impacts)"
            kept = self._parts("collisions")
            raise NoTable(f"the grid {self.name} has no table {name}{'' if kept else how}")
        return PartsTable(parts, self.owner)

    def impact_columns(self) -> tuple[str, ...]:
        """Return the names of the columns of the table of impacts, none if it was not kept."""
        parts = self._parts("collisions")
        return tuple(schema_of(parts[0]).names) if parts else ()

    def impact_units(self) -> dict[str, str]:
        """Return the units of the impacts' columns of numbers, by name."""
        parts = self._parts("collisions")
        return units_of_numbers(schema_of(parts[0])) if parts else {}

    def impacts(self, columns: Sequence[str], scenarios: Column) -> Iterator[dict[str, Column]]:
        """Yield some columns of the impacts of some scenarios, in the order of the table.

        Each part holds all impacts of its scenarios.
        """
        import pyarrow.compute as compute

        wanted = compute.field("scenario").isin(scenarios.tolist())
        for part in self._parts("collisions"):
            yield _columns(dataset_of([part]).to_table(list(columns), filter=wanted))

    def _parts(self, name: str) -> list[Path]:
        """Return the files of a table, none if the grid did not keep it."""
        parts = _parts(self.place, self.manifest, name)
        if not all(part.exists() for part in parts):
            raise FileNotFoundError(ENOENT, "the table no longer exists", str(self.folder / name))
        return parts


def is_grid(folder: Path) -> bool:
    """Return whether a folder has the file of a grid."""
    return (folder / GRID_NAME).is_file()


def open_grid(folder: Path, owner: object = None) -> StoredGrid:
    """Read the folder of a grid with all points finished so far; `owner` keeps the folder alive.

    Raises `NotAGrid` if it is not a grid of vibro, has no finished point, or if a file is missing
    or has changed.
    """
    try:
        definition = json.loads((folder / GRID_NAME).read_bytes())
    except (FileNotFoundError, NotADirectoryError) as error:
        lacking = "holds no grid" if folder.exists() else "does not exist"
        raise NotAGrid(f"{folder} {lacking}; expected a folder that `vibro grid` wrote") from error
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
    """Return the files of a table in finished chunks; other files do not belong to the grid."""
    return [folder / file for file in manifest["files"] if file.startswith(f"{name}/")]


def _columns(data: pyarrow.Table) -> dict[str, Column]:
    """Return the columns as arrays; null becomes NaN in numbers and None in words."""
    return {name: as_array(data[name]) for name in data.column_names}
