"""Read grid files, a scenario (by reference or inline) with axes, and make their JSON Schema."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, ValidationError

from vibro_cli.errors import counted
from vibro_cli.grids.axes import GENERATORS, PATHS, Axis, AxisTable, Design, read_axis
from vibro_cli.scenario import fields, loading
from vibro_cli.scenario import quantities as kinds
from vibro_cli.scenario.base import (
    AnyScenario,
    Listed,
    Rule,
    Table,
    Texts,
    exactly_one,
    model_of,
    plain,
    system_of,
)
from vibro_cli.scenario.fields import DIALECT, SCHEMA_KEY, identifier, json_schema, schema_of
from vibro_cli.scenario.loading import Document, apply, load_document, located
from vibro_cli.scenario.models import Data, one_of, rows, section
from vibro_cli.scenario.problems import (
    Fault,
    KeyPath,
    Problem,
    ScenarioError,
    in_order,
    path_text,
    shown,
    suggestion,
)
from vibro_cli.systems import system_named
from vibro_cli.systems.columns import GROWTH, Column

SAMPLED = ("latin-hypercube", "sobol")
"""Modes that draw n points from the axes."""
MODES = ("product", "zip", *SAMPLED)
MOST_DRAWN = 2**30
"""Length of Sobol's sequence."""
_SOURCES = ("base", "scenario")


class Keep(Table):
    """What is stored for each scenario in addition to its summary."""

    collisions: Annotated[bool, kinds.FLAG] = False
    """Whether every impact is stored, in addition to the summaries."""
    columns: Annotated[tuple[str, ...] | None, Texts("columns", 1)] = None
    """Which columns of the tables of impacts are stored; by default all of them."""


class GridFile(Table):
    """A scenario, by reference or inline, and the axes that change it."""

    name: Annotated[str | None, kinds.NAME] = None
    """Name of the grid and of its results folder; by default the file name without its suffix."""
    base: Annotated[str | None, kinds.Text("the name of a scenario file")] = None
    """File of the scenario that the axes change, relative to the folder of the grid file."""
    scenario: dict[str, Any] = Field(default_factory=dict)
    """The scenario itself, inline, instead of base; values that the axes give may be omitted."""
    mode: Annotated[str, kinds.Word(MODES)] = MODES[0]
    """How the values of the axes are combined into points: product (every combination, the last
    axis changing fastest), zip (the first values of all axes, then the second ones, and so on), or
    latin-hypercube or sobol (a design of n points)."""
    n: Annotated[int | None, kinds.Count(most=MOST_DRAWN)] = None
    """Number of points of a latin-hypercube or sobol design."""
    seed: Annotated[int, kinds.Count(least=0)] = 0
    """Seed of the random numbers."""
    axes: Annotated[tuple[AxisTable, ...], Listed("axes", 1)]
    """The axes, at least one."""
    keep: Keep = Field(default_factory=Keep)
    """What is stored for each scenario in addition to its summary."""
    chunk_points: Annotated[int | None, kinds.COUNT] = None
    """Number of points in each file on disk; chosen automatically by default."""

    rules: ClassVar[tuple[Rule, ...]] = (
        exactly_one(*_SOURCES),
        {
            "if": {"properties": {"mode": {"enum": list(SAMPLED)}}, "required": ["mode"]},
            "then": {"required": ["n"]},
            "else": {"not": {"required": ["n"]}},
        },
    )


def _faults_between(data: Data) -> Iterator[Fault]:
    """Check the rules between the keys of a grid file, on its plain data."""
    yield from one_of(data, _SOURCES, (), needed=True)
    mode = data.get("mode", MODES[0])
    if mode in SAMPLED and "n" not in data:
        yield Fault((), "nothing", f"n, the number of points of mode {mode}")
    if mode in MODES and mode not in SAMPLED and "n" in data:
        expected = f"no n in mode {mode}: the axes set the number"
        yield Fault(("n",), shown(data["n"]), expected, on_key=True)
    for i, axis in rows(data, "axes"):
        yield from one_of(axis, GENERATORS, ("axes", i), needed=True)
        yield from one_of(axis, PATHS, ("axes", i), needed="table" not in axis)
    keep = section(data, "keep")
    if "columns" in keep and keep.get("collisions", False) is False:
        loc = ("keep", "columns")
        yield Fault(loc, "columns without collisions", "collisions = true", on_key=True)


@dataclass(frozen=True)
class Grid:
    """The content of a grid file."""

    name: str
    base: Document
    """The scenario that the axes change; it may be incomplete without them."""
    design: Design
    keep: Keep
    chunk_points: int | None = None
    """Points per chunk, which is a part on disk; None to let the program choose."""

    @property
    def system(self) -> str:
        """The system of all its scenarios."""
        return system_of(self.base.data)

    @property
    def root(self) -> type[AnyScenario]:
        """The model of its scenarios."""
        return model_of(self.base.data)

    @property
    def counted(self) -> tuple[str, ...]:
        """Columns of the summary that count impacts; each is also the name of a stop."""
        return system_named(self.system).impact_tables

    @property
    def kept_tables(self) -> tuple[str, ...]:
        """Names of the tables of impacts to keep."""
        return system_named(self.system).impact_tables if self.keep.collisions else ()

    def numbers(self, path: KeyPath) -> Iterator[float]:
        """Yield the numbers of the base at a path, or in the list there, and the ends of the axes.

        Numbers of the base that the axes change are left out.
        """
        table, key = path
        given = section(self.base.data, str(table)).get(str(key))
        for one in given if isinstance(given, list) else [given]:
            if path not in self.design.paths and isinstance(one, int | float):
                yield one
        for axis in self.design.axes:
            for i, changed in enumerate(axis.paths):
                if changed[: len(path)] == path:
                    values = axis.interval or axis.at(slice(None))[i]
                    yield from (float(np.min(values)), float(np.max(values)))

    def resolved(self) -> dict[str, Any]:
        """Return the grid as plain data; equal data give equal tables."""
        return {
            "name": self.name,
            "scenario": self.base.data,
            **self.design.resolved(),
            "keep": self.keep.model_dump(mode="json"),
        }

    def stopped_at(self, most: int, counted: Sequence[str]) -> Grid:
        """Return the same grid with a limit `most` for these `counted` impacts of each point."""
        stop = {**self.base.data.get("stop", {}), **dict.fromkeys(counted, most)}
        return replace(self, base=replace(self.base, data={**self.base.data, "stop": stop}))

    def without_collisions(self) -> Grid:
        """Return the same grid with summaries only."""
        return replace(self, keep=Keep())


NO_END = (
    "without stop.time, points whose impacts die out (k < 1) are solved far beyond their last "
    "impact, and may fail: set stop.time, not far beyond the last impact"
)


# Bodies that take fewer impacts usually still collide: no hint then.
_MANY = 100


def may_lack_an_end(grid: Grid) -> bool:
    """Return whether the impacts of some points may die out before their only stop, by impacts.

    Only the values of the base and the axes are read; no point is built.
    """
    stop, k = ("stop", "collisions"), ("collision", "k")
    # On a table, balls go on to bounce on the wall.
    given = section(grid.base.data, "stop")
    if any(n in given or ("stop", n) in grid.design.paths for n in ("time", "bounces")):
        return False
    return any(most >= _MANY for most in grid.numbers(stop)) and any(
        value < 1.0 for value in grid.numbers(k)
    )


def load_grid(source: str | Path, overrides: Sequence[str] = ()) -> Grid:
    """Read a grid file (TOML, JSON or YAML), or a grid from standard input ("-").

    ``overrides`` change values of its scenario, such as "collision.k=0.9".

    Raises `ScenarioError` with all faults of the grid and their places; `OSError` if a file cannot
    be read.
    """
    folder = Path() if str(source) == "-" else Path(source).parent
    return grid_of(load_document(source), folder, overrides)


def grid_of(document: Document, folder: Path, overrides: Sequence[str] = ()) -> Grid:
    """Return the grid of a document, in which paths are relative to a folder.

    Raises `ScenarioError` with all faults of the grid and their places.
    """
    if "balls" in document.data and not {"base", "scenario", "axes"} & set(document.data):
        place = document.source.place((next(iter(document.data)),), on_key=True)
        expected = "a grid: base (or scenario) and axes; vibro run solves a scenario"
        raise ScenarioError([Problem.at(place, "", "a scenario", expected)])
    given = _keys_of(document)
    base, problems = _base(document, folder, overrides)
    faults: list[Fault] = []
    keep = _keep(given.keep, system_of(base.data), faults)
    design = _design(given, folder, base, faults)
    problems += located(faults, document.source)
    if problems:
        raise ScenarioError(in_order(problems))
    return Grid(given.name or document.name, base, design, keep, given.chunk_points)


def _keys_of(document: Document) -> GridFile:
    """Return the validated keys of a grid file, without checks that need its scenario."""
    faults = list(_faults_between(document.data))
    try:
        given = GridFile.model_validate(document.data)
    except ValidationError as error:
        faults += fields.faults(error, GridFile)
    if faults:
        raise ScenarioError(located(faults, document.source))
    return given


def _base(
    document: Document, folder: Path, overrides: Sequence[str]
) -> tuple[Document, list[Problem]]:
    """Return the unchecked scenario that the axes change, with overrides, and their problems."""
    outer = document.source
    if "base" in document.data:
        given = _referred(document, folder)
    else:
        own = replace(outer, within=("scenario",))
        given = Document(document.data["scenario"], own, document.name)
    if loading.is_grid(given.data):
        place = ("base" if "base" in document.data else "scenario",)
        raise ScenarioError(located([Fault(place, "a grid", "a scenario")], outer))
    changed, texts, wrong = loading.overridden(given.data, overrides)
    return Document(changed, replace(given.source, overrides=tuple(texts)), given.name), wrong


def _referred(document: Document, folder: Path) -> Document:
    name = document.data["base"]
    try:
        return load_document(folder / name)
    except OSError as error:
        found = f"{shown(name)}, which cannot be read ({error.strerror or error})"
        fault = Fault(("base",), found, "a scenario file")
        raise ScenarioError(located([fault], document.source)) from error


def impact_columns_of(system: str) -> tuple[Column, ...]:
    """Return all columns of a system's tables of impacts, each once."""
    kind = system_named(system)
    tables = [kind.table(name, ("side",)) for name in kind.impact_tables]
    return tuple({column.name: column for table in tables for column in table.columns}.values())


def _keep(given: Keep, system: str, faults: list[Fault]) -> Keep:
    """Check the columns to keep, and return them in the order of the tables."""
    known = [column.name for column in impact_columns_of(system)]
    for i, name in enumerate(given.columns or ()):
        if name not in known:
            expected = f"a column of collisions{suggestion(name, known)}"
            if name in [column.name for column in GROWTH]:
                expected = "a column that grids have: of growth they keep only the exponents"
            faults.append(Fault(("keep", "columns", i), shown(name), expected))
    if given.columns is None:
        return given
    columns = tuple(name for name in known if name in given.columns)
    return given.model_copy(update={"columns": columns})


def _design(given: GridFile, folder: Path, base: Document, faults: list[Fault]) -> Design:
    axes: list[Axis] = []
    points = 0
    for i, table in enumerate(given.axes):
        try:
            axes.append(read_axis(table, ("axes", i), folder, given.seed, model_of(base.data)))
            _check_paths(axes, base)
        except Fault as error:
            faults.append(error)
    try:
        points = _points(given.mode, given.n, axes)
    except Fault as error:
        faults.append(error)
    return Design(tuple(axes), given.mode, points, given.seed)


def _check_paths(axes: list[Axis], base: Document) -> None:
    """Check that the paths of the last axis exist, and that only this axis gives their values."""
    number = len(axes) - 1
    loc: KeyPath = ("axes", number)
    before = [path for axis in axes[:-1] for path in axis.paths]
    for i, path in enumerate(axes[-1].paths):
        if path in before or path in axes[-1].paths[:i]:
            raise Fault(loc, f"{path_text(path)} twice", "each path on one axis only")
        for changed, called in base.source.overrides:
            if changed[: len(path)] == path:
                found = f"{path_text(path)}, which {called} sets too, in vain"
                raise Fault(loc, found, "its values from the axis alone")
        try:
            apply(base.data, path, None)
        except Fault as error:
            raise Fault(loc, error.found, error.expected) from None
        except (TypeError, AttributeError, KeyError, IndexError):
            raise Fault(loc, path_text(path), "a path into the scenario") from None


def _points(mode: str, count: int | None, axes: list[Axis]) -> int:
    if count is not None:
        return count
    for i, axis in enumerate(axes):
        if axis.interval is not None:
            where: KeyPath = ("axes", i, "uniform")
            raise Fault(where, "[low, high]", f"[low, high, count] in mode {mode}")
    lengths = [len(axis) for axis in axes]
    if mode == "zip":
        for i, length in enumerate(lengths):
            if length != lengths[0]:
                wanted = counted(lengths[0], "value")
                expected = f"{wanted}, as many as the first axis has (mode zip)"
                raise Fault(("axes", i), counted(length, "value"), expected)
        return lengths[0] if lengths else 0
    total = math.prod(lengths)
    if total >= 2**53:
        raise Fault(("axes",), f"{total} points", "fewer than 2^53")
    return total


def grid_schema(system: str = "trace") -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of grids over a system's scenarios as plain data."""
    within = _incomplete(json_schema(system))
    tables = within.pop("$defs")
    del within["$schema"], within["$id"], within["patternProperties"]
    schema = schema_of(GridFile)
    words = schema["properties"]["scenario"]["description"]
    schema["properties"]["scenario"] = {"description": words, "$ref": "#/$defs/Scenario"}
    names = [column.name for column in impact_columns_of(system)]
    schema["$defs"]["Keep"]["properties"]["columns"]["items"] = {"enum": names}
    tables["Scenario"] = {
        **within,
        "description": "A scenario; values that the axes give may be missing.",
    }
    return {
        "$schema": DIALECT,
        "$id": identifier(f"grid-{system}"),
        **schema,
        **SCHEMA_KEY,
        "title": "vibro grid",
        "$defs": {**tables, **schema["$defs"]},
    }


def _incomplete(value: Any) -> Any:
    """Return a schema of scenarios without rules on required keys."""
    if isinstance(value, list):
        return [_incomplete(item) for item in value]
    if not isinstance(value, dict):
        return value
    left = {key: item for key, item in value.items() if key not in ("required", "allOf")}
    return {key: _incomplete(item) for key, item in left.items()}


PointValues = Mapping[KeyPath, Any]


def document_at(base: Document, values: PointValues) -> Document:
    """Return the document of the scenario at a point."""
    data = base.data
    given: list[KeyPath] = []
    for path, value in values.items():
        data = apply(data, path, plain(value), given)
        given.append(path)
    return Document(data, base.source, base.name)


def reason_of(error: ScenarioError) -> str:
    """Return the faults of a point on one line."""
    texts = [f"{one.path}: found {one.found}, expected {one.expected}" for one in error.problems]
    return "; ".join(texts)
