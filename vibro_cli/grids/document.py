"""Reading grid files: a scenario, by reference or inline, and axes; their JSON Schema."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from vibro_cli.grids.axes import (
    AXIS,
    COUNT,
    GENERATORS,
    MODES,
    SAMPLED,
    Axis,
    Design,
    Wrong,
    read_axis,
)
from vibro_cli.scenario import loading
from vibro_cli.scenario.base import (
    AnyScenario,
    at_least_one,
    exactly_one,
    model_of,
    plain,
    system_of,
)
from vibro_cli.scenario.fields import DIALECT, SCHEMA_KEY, identifier, json_schema
from vibro_cli.scenario.forms import Source
from vibro_cli.scenario.loading import Document, OverrideError, apply, load_document, located
from vibro_cli.scenario.problems import (
    Fault,
    KeyPath,
    Problem,
    ScenarioError,
    listing,
    path_text,
    shown,
    suggestion,
)
from vibro_cli.storage.tables import table_named
from vibro_cli.systems import system_named
from vibro_cli.systems.columns import Column


@dataclass(frozen=True)
class Keep:
    """What of each scenario is written beside its summary."""

    collisions: bool = False
    columns: tuple[str, ...] | None = None
    """Columns of the tables of impacts, all of them for None."""


@dataclass(frozen=True)
class Grid:
    """A grid file, understood."""

    name: str
    base: Document
    """The scenario that the axes change; it need not be complete without them."""
    design: Design
    keep: Keep
    chunk_points: int | None = None
    """Points of a chunk, which is a part on the disk; chosen by the program for None."""

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
        """The columns of the summary that count impacts, each with a stop of its name."""
        return system_named(self.system).impact_tables

    @property
    def kept_tables(self) -> tuple[str, ...]:
        """Names of the tables of impacts that are kept."""
        return system_named(self.system).impact_tables if self.keep.collisions else ()

    def resolved(self) -> dict[str, Any]:
        """Return the grid as plain data: two grids with equal data give equal tables."""
        columns = None if self.keep.columns is None else list(self.keep.columns)
        return {
            "name": self.name,
            "scenario": self.base.data,
            **self.design.resolved(),
            "keep": {"collisions": self.keep.collisions, "columns": columns},
        }

    def stopped_at(self, most: int, counted: Sequence[str]) -> Grid:
        """Return the same grid with a limit to what each point has of the counted impacts."""
        stop = {**self.base.data.get("stop", {}), **dict.fromkeys(counted, most)}
        return replace(self, base=replace(self.base, data={**self.base.data, "stop": stop}))

    def without_collisions(self) -> Grid:
        """Return the same grid with summaries only."""
        return replace(self, keep=Keep())


def load_grid(source: str | Path, overrides: Sequence[str] = ()) -> Grid:
    """Read a grid file (TOML, JSON or YAML), or a grid from standard input ("-").

    ``overrides`` change values of its scenario, such as "collision.k=0.9".

    Raises
    ------
    ScenarioError
        With everything that is wrong with the grid, each with its place.
    OSError
        If a file cannot be read.
    """
    folder = Path() if str(source) == "-" else Path(source).parent
    return grid_of(load_document(source), folder, overrides)


def grid_of(document: Document, folder: Path, overrides: Sequence[str] = ()) -> Grid:
    """Return the grid of a document; paths in it start from a folder.

    Raises
    ------
    ScenarioError
        With everything that is wrong with the grid, each with its place.
    """
    if _is_scenario(document.data):
        place = document.source.place((next(iter(document.data)),), on_key=True)
        expected = "a grid: base (or scenario) and axes; vibro run solves a scenario"
        raise ScenarioError([Problem.at(place, "", "a scenario", expected)])
    problems: list[Problem] = []

    def collect(error: Wrong) -> None:
        problems.extend(located([error.fault], document.source))

    _check_keys(document.data, _PROPERTIES, (), collect)
    base = _base(document, folder, overrides, problems)
    keep = Keep()
    try:
        keep = _keep(document.data.get("keep", {}), base, collect)
    except Wrong as error:
        collect(error)
    try:
        _check_chunk_points(document.data)
        design = _design(document, folder, base, collect)
    except Wrong as error:
        collect(error)
    if problems:
        raise ScenarioError(sorted(problems, key=lambda one: (one.line or 0, one.column or 0)))
    assert base is not None
    name = document.data.get("name", document.name)
    return Grid(name, base, design, keep, document.data.get("chunk_points"))


def _is_scenario(data: dict[str, Any]) -> bool:
    """Whether the data of a file are those of a scenario, with nothing of a grid."""
    return bool(data) and "balls" in data and not {"base", "scenario", "axes"} & set(data)


def _check_keys(table: dict[str, Any], known: Collection[str], loc: KeyPath, collect: Any) -> None:
    for key in table:
        if key not in known:
            expected = listing(known) + suggestion(str(key), known)
            collect(Wrong((*loc, key), f"the unknown key {shown(key)}", expected, on_key=True))


def _base(
    document: Document, folder: Path, overrides: Sequence[str], problems: list[Problem]
) -> Document | None:
    """The scenario that the axes change, with overrides, as it is before any rule is checked."""
    data = document.data
    if ("base" in data) == ("scenario" in data):
        both = "base" in data
        found = "base and scenario" if both else "neither"
        fault = Fault(("scenario",) if both else (), found, "one of base or scenario", both)
        problems.extend(located([fault], document.source))
        return None
    try:
        given = _referred(document, folder) if "base" in data else _inline(document)
    except ScenarioError as error:
        problems.extend(error.problems)
        return None
    changed, texts, wrong = loading.overridden(given.data, overrides)
    problems.extend(wrong)
    return Document(changed, replace(given.source, overrides=tuple(texts)), given.name)


def _referred(document: Document, folder: Path) -> Document:
    name = document.data["base"]
    if isinstance(name, str):
        try:
            return load_document(folder / name)
        except OSError as error:
            found = f"{shown(name)}, which cannot be read ({error.strerror or error})"
            raise _error(document.source, Fault(("base",), found, "a scenario file")) from error
    raise _error(document.source, Fault(("base",), shown(name), "the name of a scenario file"))


def _inline(document: Document) -> Document:
    given = document.data["scenario"]
    if not isinstance(given, dict):
        raise _error(document.source, Fault(("scenario",), shown(given), "a table: the scenario"))
    outer = document.source
    return Document(given, _Within(outer.file, outer.form, outer.text), document.name)


class _Within(Source):
    """The source of the scenario that stands in a grid file: its places are further in."""

    def place(self, key_path: str | KeyPath, on_key: bool = False) -> Any:
        from vibro_cli.scenario.problems import parsed_path

        loc = parsed_path(key_path) if isinstance(key_path, str) else key_path
        for path, _ in self.overrides:
            if loc[: len(path)] == path:
                return super().place(loc, on_key)
        return super().place(("scenario", *loc), on_key)


def _error(source: Source, fault: Fault) -> ScenarioError:
    return ScenarioError(located([fault], source))


def impact_columns_of(system: str) -> tuple[Column, ...]:
    """Return all columns of the tables of a system's impacts, each once."""
    tables = [table_named(name, ("side",), system) for name in system_named(system).impact_tables]
    return tuple({column.name: column for table in tables for column in table.columns}.values())


def _keep(given: Any, base: Document | None, collect: Any) -> Keep:
    if not isinstance(given, dict):
        raise Wrong(("keep",), shown(given), "a table with collisions and columns")
    _check_keys(given, _KEEP_SCHEMA, ("keep",), collect)
    kept, columns = given.get("collisions", False), given.get("columns")
    if not isinstance(kept, bool):
        raise Wrong(("keep", "collisions"), shown(kept), "true or false")
    if columns is None:
        return Keep(kept)
    system = system_of({} if base is None else base.data)
    known = [column.name for column in impact_columns_of(system)]
    if not isinstance(columns, list) or not columns:
        raise Wrong(("keep", "columns"), shown(columns), "a list of columns")
    for i, name in enumerate(columns):
        if name not in known:
            close = suggestion(name, known) if isinstance(name, str) else ""
            raise Wrong(("keep", "columns", i), shown(name), f"a column of collisions{close}")
    if not kept:
        raise Wrong(("keep", "columns"), "columns without collisions", "collisions = true", True)
    return Keep(True, tuple(name for name in known if name in columns))


def _check_chunk_points(data: dict[str, Any]) -> None:
    size = data.get("chunk_points")
    whole = isinstance(size, int) and not isinstance(size, bool) and size >= 1
    if "chunk_points" in data and not whole:
        raise Wrong(("chunk_points",), shown(size), "a whole number of at least 1")


def _design(document: Document, folder: Path, base: Document | None, collect: Any) -> Design:
    data = document.data
    mode = data.get("mode", "product")
    if mode not in MODES:
        words = listing(f'"{word}"' for word in MODES)
        hint = suggestion(mode, MODES) if isinstance(mode, str) else ""
        raise Wrong(("mode",), shown(mode), words + hint)
    count, seed = data.get("n"), data.get("seed", 0)
    if not isinstance(seed, int) or isinstance(seed, bool) or not 0 <= seed < 2**63:
        raise Wrong(("seed",), shown(seed), "a whole number from 0 below 2^63")
    _check_count(mode, count)
    given = data.get("axes")
    if not isinstance(given, list) or not given:
        where: KeyPath = ("axes",) if "axes" in data else ()
        found = shown(given) if "axes" in data else "no axes"
        raise Wrong(where, found, "at least one [[axes]] with a path and its values")
    axes = []
    for i, table in enumerate(given):
        try:
            root = model_of({} if base is None else base.data)
            axes.append(read_axis(table, ("axes", i), folder, seed, root))
            _check_paths(axes, base)
        except Wrong as error:
            collect(error)
    return Design(tuple(axes), mode, _points(mode, count, axes), seed)


def _check_count(mode: str, count: Any) -> None:
    sampled = mode in SAMPLED
    if sampled and (not isinstance(count, int) or isinstance(count, bool) or count < 1):
        found = "nothing" if count is None else shown(count)
        where: KeyPath = ("n",) if count is not None else ()
        raise Wrong(where, found, f"n, the number of points of mode {mode}, at least 1")
    if not sampled and count is not None:
        raise Wrong(("n",), shown(count), f"no n in mode {mode}: the axes tell", on_key=True)


def _check_paths(axes: list[Axis], base: Document | None) -> None:
    """Check that the paths of the last axis lead somewhere, and that no axis before has them."""
    number = len(axes) - 1
    loc: KeyPath = ("axes", number)
    before = [path for axis in axes[:-1] for path in axis.paths]
    for i, path in enumerate(axes[-1].paths):
        if path in before or path in axes[-1].paths[:i]:
            raise Wrong(loc, f"{path_text(path)} twice", "each path on one axis only")
        if base is None:
            continue
        try:
            apply(base.data, path, None)
        except OverrideError as error:
            raise Wrong(loc, error.fault.found, error.fault.expected) from None
        except (TypeError, AttributeError, KeyError, IndexError):
            raise Wrong(loc, path_text(path), "a path into the scenario") from None


def _points(mode: str, count: int | None, axes: list[Axis]) -> int:
    if count is not None:
        return count
    for i, axis in enumerate(axes):
        if axis.interval is not None:
            where: KeyPath = ("axes", i, "uniform")
            raise Wrong(where, "[low, high]", f"[low, high, count] in mode {mode}")
    lengths = [len(axis) for axis in axes]
    if mode == "zip":
        for i, length in enumerate(lengths):
            if length != lengths[0]:
                expected = f"{lengths[0]} values, as many as the first axis has (mode zip)"
                raise Wrong(("axes", i), f"{length} values", expected)
        return lengths[0] if lengths else 0
    total = math.prod(lengths)
    if total >= 2**53:
        raise Wrong(("axes",), f"{total} points", "fewer than 2^53")
    return total


_KEEP_SCHEMA: dict[str, dict[str, Any]] = {
    "collisions": {
        "description": "Whether every impact is kept, beside the summaries.",
        "type": "boolean",
        "default": False,
    },
    "columns": {
        "description": "Columns of the tables of impacts; all of them if not given.",
        "type": "array",
        "minItems": 1,
    },
}
_PROPERTIES: dict[str, dict[str, Any]] = {
    "name": {
        "description": "Name of the grid and of its folder; the file's stem if not given.",
        "type": "string",
    },
    "base": {
        "description": "File of the scenario that the axes change, from this file's folder.",
        "type": "string",
    },
    "scenario": {
        "description": "Or that scenario itself, inline; what the axes give may be left out.",
        "$ref": "#/$defs/Scenario",
    },
    "mode": {
        "description": "How the axes make points: product (each value with each, the last "
        "axis changing fastest), zip (one after the other), or a design of n points.",
        "enum": list(MODES),
        "default": MODES[0],
    },
    "n": {"description": "Number of points of a latin-hypercube or sobol design.", **COUNT},
    "seed": {
        "description": "Seed of whatever is random.",
        "type": "integer",
        "minimum": 0,
        "default": 0,
    },
    "axes": {
        "description": "The axes, at least one.",
        "type": "array",
        "minItems": 1,
        "items": {"$ref": "#/$defs/Axis"},
    },
    "keep": {
        "description": "What is kept of each scenario beside its summary.",
        "$ref": "#/$defs/Keep",
    },
    "chunk_points": {
        "description": "Points of a part on the disk; as many as make a good file if not given.",
        **COUNT,
    },
}


def grid_schema(system: str = "trace") -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of grids over a system's scenarios as plain data."""
    within = _incomplete(json_schema(system))
    tables = within.pop("$defs")
    del within["$schema"], within["$id"], within["patternProperties"]
    names = [column.name for column in impact_columns_of(system)]
    keep = {**_KEEP_SCHEMA, "columns": {**_KEEP_SCHEMA["columns"], "items": {"enum": names}}}
    return {
        "$schema": DIALECT,
        "$id": identifier(f"grid-{system}"),
        "title": "vibro grid",
        "description": "A scenario, by reference or inline, and the axes that change it.",
        "type": "object",
        "additionalProperties": False,
        "properties": _PROPERTIES,
        **SCHEMA_KEY,
        "required": ["axes"],
        "allOf": [exactly_one("base", "scenario"), _count_of_samples()],
        "$defs": {
            **tables,
            "Scenario": {**within, "description": "A scenario, not complete without the axes."},
            "Axis": _axis(),
            "Keep": _table("What is kept of each scenario beside its summary.", keep),
        },
    }


def _table(description: str, properties: dict[str, Any]) -> dict[str, Any]:
    return {
        "description": description,
        "type": "object",
        "additionalProperties": False,
        "properties": properties,
    }


def _axis() -> dict[str, Any]:
    rules: list[dict[str, Any]] = [
        exactly_one(*GENERATORS),
        {"not": {"required": ["path", "paths"]}},
        at_least_one("path", "paths", "table"),
    ]
    axis = _table("Some scalars of the scenario, and the values they go through.", AXIS)
    return {**axis, "allOf": rules}


def _count_of_samples() -> dict[str, Any]:
    sampled = {"properties": {"mode": {"enum": list(SAMPLED)}}, "required": ["mode"]}
    return {"if": sampled, "then": {"required": ["n"]}, "else": {"not": {"required": ["n"]}}}


def _incomplete(value: Any) -> Any:
    """A schema of scenarios without the rules about what must be there."""
    if isinstance(value, list):
        return [_incomplete(item) for item in value]
    if not isinstance(value, dict):
        return value
    left = {key: item for key, item in value.items() if key not in ("required", "allOf")}
    return {key: _incomplete(item) for key, item in left.items()}


PointValues = Mapping[KeyPath, Any]


def document_at(base: Document, values: PointValues) -> Document:
    """Return the document of one point."""
    data = base.data
    given: list[KeyPath] = []
    for path, value in values.items():
        data = apply(data, path, plain(value), given)
        given.append(path)
    return Document(data, base.source, base.name)


def reason_of(error: ScenarioError) -> str:
    """Return what is wrong with a point, on one line."""
    texts = [f"{one.path}: found {one.found}, expected {one.expected}" for one in error.problems]
    return "; ".join(texts)
