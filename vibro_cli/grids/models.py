"""The keys of a grid file as pydantic models, and the rules between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from pydantic import Field

from vibro_cli.scenario import quantities as kinds
from vibro_cli.scenario.base import (
    Listed,
    Rule,
    Table,
    Texts,
    at_least_one,
    at_most_one,
    exactly_one,
)
from vibro_cli.scenario.models import Data, one_of, rows, section
from vibro_cli.scenario.problems import A_PATH, Fault, listing, parsed_path, shown

GENERATORS = ("values", "linspace", "logspace", "uniform", "table")
"""Keys of an axis of which each gives its values in a way of its own."""
SAMPLED = ("latin-hypercube", "sobol")
"""Modes that draw a number of points from the axes."""
MODES = ("product", "zip", *SAMPLED)
_SOURCES = ("base", "scenario")
_PATHS = ("path", "paths")


class _Path(kinds.Text):
    """A path of the scenario, such as balls[1].angle."""

    def read(self, value: object) -> str:
        text = super().read(value)
        try:
            parsed_path(text)
        except ValueError:
            raise kinds.fault(shown(text), self.meaning) from None
        return text


@dataclass(frozen=True)
class _Ends(kinds.Kind):
    """Both ends of an axis, which may carry a unit, and how many values it has.

    The numbers are those of a path, and are read with it.
    """

    count_needed: bool = True

    def read(self, value: object) -> list[Any]:
        forms = {2: "[low, high]", 3: "[low, high, count]"}
        if self.count_needed:
            del forms[2]
        if isinstance(value, list) and len(value) in forms:
            return value
        raise kinds.fault(shown(value), listing(forms.values()))

    def schema(self) -> dict[str, Any]:
        end = {"type": ["number", "string"]}
        return {
            "type": "array",
            "prefixItems": [end, end, kinds.COUNT.schema()],
            "minItems": 3 if self.count_needed else 2,
            "items": False,
        }


class AxisTable(Table):
    """Some scalars of the scenario, and the values they go through."""

    rules: ClassVar[tuple[Rule, ...]] = (
        exactly_one(*GENERATORS),
        at_most_one(*_PATHS),
        at_least_one(*_PATHS, "table"),
    )

    path: Annotated[str | None, _Path(A_PATH)] = None
    """The scalar of the scenario that the axis changes, such as balls[1].angle; counted from 1."""
    paths: Annotated[tuple[Annotated[str, _Path(A_PATH)], ...] | None, Listed("paths", 1)] = None
    """Or several scalars, which go through their values together."""
    values: Annotated[tuple[Any, ...] | None, Listed("values", 1)] = None
    """The values, numbers or words; of several paths one for all, or a list with one for each."""
    linspace: Annotated[list[Any] | None, _Ends()] = None
    """[low, high, count]: equal steps, both ends included; the ends may carry a unit."""
    logspace: Annotated[list[Any] | None, _Ends()] = None
    """[low, high, count]: equal ratios, both ends included."""
    uniform: Annotated[list[Any] | None, _Ends(count_needed=False)] = None
    """[low, high]: the interval that a mode with n draws from; [low, high, count]: random
    values."""
    table: Annotated[str | None, kinds.Text("the name of a .parquet or .csv file")] = None
    """A .parquet or .csv file, whose columns are named by paths: a row is one value of the axis;
    with path or paths only those columns."""


class Keep(Table):
    """What is kept of each scenario beside its summary."""

    collisions: Annotated[bool, kinds.FLAG] = False
    """Whether every impact is kept, beside the summaries."""
    columns: Annotated[tuple[str, ...] | None, Texts("columns", 1)] = None
    """Columns of the tables of impacts; all of them if not given."""


class GridFile(Table):
    """A scenario, by reference or inline, and the axes that change it."""

    name: Annotated[str | None, kinds.NAME] = None
    """Name of the grid and of its folder; the file's stem if not given."""
    base: Annotated[str | None, kinds.Text("the name of a scenario file")] = None
    """File of the scenario that the axes change, from this file's folder."""
    scenario: dict[str, Any] = Field(default_factory=dict)
    """Or that scenario itself, inline; what the axes give may be left out."""
    mode: Annotated[str, kinds.Word(MODES)] = MODES[0]
    """How the axes make points: product (each value with each, the last axis changing fastest),
    zip (one after the other), or a design of n points."""
    n: Annotated[int | None, kinds.COUNT] = None
    """Number of points of a latin-hypercube or sobol design."""
    seed: Annotated[int, kinds.Count(least=0)] = 0
    """Seed of whatever is random."""
    axes: Annotated[tuple[AxisTable, ...], Listed("axes", 1)]
    """The axes, at least one."""
    keep: Keep = Field(default_factory=Keep)
    """What is kept of each scenario beside its summary."""
    chunk_points: Annotated[int | None, kinds.COUNT] = None
    """Points of a part on the disk; as many as make a good file if not given."""

    rules: ClassVar[tuple[Rule, ...]] = (
        exactly_one(*_SOURCES),
        {
            "if": {"properties": {"mode": {"enum": list(SAMPLED)}}, "required": ["mode"]},
            "then": {"required": ["n"]},
            "else": {"not": {"required": ["n"]}},
        },
    )


def faults_between(data: Data) -> Iterator[Fault]:
    """Check the rules between the keys of a grid file, of its data as they are."""
    yield from one_of(data, _SOURCES, (), needed=True)
    mode = data.get("mode", MODES[0])
    if mode in SAMPLED and "n" not in data:
        yield Fault((), "nothing", f"n, the number of points of mode {mode}")
    if mode in MODES and mode not in SAMPLED and "n" in data:
        expected = f"no n in mode {mode}: the axes tell"
        yield Fault(("n",), shown(data["n"]), expected, on_key=True)
    for i, axis in rows(data, "axes"):
        yield from one_of(axis, GENERATORS, ("axes", i), needed=True)
        yield from one_of(axis, _PATHS, ("axes", i), needed="table" not in axis)
    keep = section(data, "keep")
    if "columns" in keep and keep.get("collisions", False) is False:
        loc = ("keep", "columns")
        yield Fault(loc, "columns without collisions", "collisions = true", on_key=True)
