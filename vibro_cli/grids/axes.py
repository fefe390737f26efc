"""The axes of a grid: scalars of the scenario and their values."""

from __future__ import annotations

import contextlib
import hashlib
import math
import sys
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic_core import PydanticCustomError

from vibro_cli.errors import listing
from vibro_cli.scenario import fields
from vibro_cli.scenario import quantities as kinds
from vibro_cli.scenario.base import (
    Listed,
    Rule,
    Table,
    at_least_one,
    at_most_one,
    exactly_one,
)
from vibro_cli.scenario.fields import Model, unknown_key
from vibro_cli.scenario.models import Scenario
from vibro_cli.scenario.problems import (
    A_PATH,
    Fault,
    KeyPath,
    parsed_path,
    path_text,
    shown,
)

GENERATORS = ("values", "linspace", "logspace", "uniform", "table")
"""Keys that define the values of an axis."""
PATHS = ("path", "paths")


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
    """Both ends of an axis, which may have a unit, and its number of values.

    The ends are validated later, by the kind of the axis's path.
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
    """One or more values of the scenario that the grid changes, and what they are set to."""

    rules: ClassVar[tuple[Rule, ...]] = (
        exactly_one(*GENERATORS),
        at_most_one(*PATHS),
        at_least_one(*PATHS, "table"),
    )

    path: Annotated[str | None, _Path(A_PATH)] = None
    """Path of the value that the axis changes, such as balls[1].angle; counted from 1."""
    paths: Annotated[tuple[Annotated[str, _Path(A_PATH)], ...] | None, Listed("paths", 1)] = None
    """Paths of several values, which change together; given instead of path."""
    values: Annotated[tuple[Any, ...] | None, Listed("values", 1)] = None
    """The values, numbers or words; with several paths, each entry is one value for all of them or
    a list with one value for each."""
    linspace: Annotated[list[Any] | None, _Ends()] = None
    """[low, high, count]: evenly spaced values, both ends included; the ends may have a unit."""
    logspace: Annotated[list[Any] | None, _Ends()] = None
    """[low, high, count]: values with equal ratios, both ends included."""
    uniform: Annotated[list[Any] | None, _Ends(count_needed=False)] = None
    """[low, high]: the interval that a latin-hypercube or sobol design covers; [low, high, count]:
    that many random values from the interval."""
    table: Annotated[str | None, kinds.Text("the name of a .parquet or .csv file")] = None
    """A .parquet or .csv file whose columns are named by paths; each row is one value of the axis.
    If path or paths is given, only those columns are used."""


# Keys on which the tables of a grid do not depend.
_WITHOUT_EFFECT = ("name", "output")
# Keys that must be the same for all points, as the columns of the tables depend on them.
_IN_COMMON: dict[KeyPath, str] = {
    ("system",): "all points of a grid are of one system",
    ("analysis", "lyapunov"): "exponents are computed for all points or for none",
}


@lru_cache(maxsize=1000)
def kind_of(path: KeyPath, root: Model = Scenario) -> kinds.Kind:
    """Return the kind of the scalar at a path, in scenarios with the model `root`.

    Raises `Fault` if scenarios have no such path, or if it is not a single value.
    """
    if path[0] in _WITHOUT_EFFECT:
        expected = "a value that the tables of a grid depend on"
        raise Fault(path, path_text(path), expected)
    if path in _IN_COMMON:
        raise Fault(path, path_text(path), f"a value of the scenario: {_IN_COMMON[path]}")
    if path[:2] == ("collision", "k") and len(path) in (2, 3):
        return kinds.RESTITUTION
    kind = fields.kind_at(path, root)
    if kind is not None:
        return kind
    if fields.field_at(path, root) is None:
        if isinstance(path[-1], int) or fields.model_at(path[:-1], root) is None:
            parts = (path[:n] for n in range(1, len(path)))
            wrong = next((part for part in parts if fields.field_at(part, root) is None), path)
            meant = fields.hint(wrong[:-1], str(wrong[-1]), root)
            expected = f"a value of a scenario, such as balls[1].angle{meant}"
            raise Fault(path, path_text(path), expected)
        raise unknown_key(path, root)
    expected = "one value: a number, a word, true or false"
    raise Fault(path, f"{path_text(path)} as a whole", expected)


def type_of(kind: kinds.Kind) -> Any:
    """Return the column type for values of a kind, as named in ``storage.tables``."""
    if isinstance(kind, kinds.Quantity):
        return "float64"
    if isinstance(kind, kinds.Count):
        return "int64"
    return "bool" if isinstance(kind, kinds.Flag) else "string"


def read_number(kind: kinds.Kind, value: Any) -> Any:
    """Return a value of an axis in SI units, without checking bounds.

    A value that is out of bounds makes an invalid point, not an invalid axis.

    Raises `PydanticCustomError` if the value is not of this kind.
    """
    if isinstance(kind, kinds.Quantity):
        return kinds.Quantity(kind.dimension).read(value)
    if isinstance(kind, kinds.Count) and isinstance(value, int) and not isinstance(value, bool):
        return value
    return kind.read(value)


Array = np.ndarray[Any, np.dtype[Any]]
DTYPES = {"float64": np.float64, "int64": np.int64, "bool": np.bool_, "string": object}
"""Types of arrays by column type."""

_MOST_VALUES = 100_000_000
# The resolved grid has only a digest of longer lists.
_LISTED = 10_000


@dataclass(frozen=True)
class Axis:
    """Scalars of the scenario and the values that they take together."""

    paths: tuple[KeyPath, ...]
    kinds: tuple[kinds.Kind, ...]
    columns: tuple[Array, ...] | None
    """Values of each path; None for an interval."""
    interval: tuple[float, float] | None
    """Ends of an interval (SI units) from which a design draws."""
    resolved: dict[str, Any]
    """The axis as plain data in SI units."""

    def __len__(self) -> int:
        """Number of values; 0 for an interval."""
        return 0 if self.columns is None else len(self.columns[0])

    def at(self, index: Any) -> tuple[Array, ...]:
        """Return the values of each path at indices (from 0)."""
        assert self.columns is not None
        return tuple(column[index] for column in self.columns)

    def drawn(self, share: Array) -> tuple[Array, ...]:
        """Return the values of each path at fractions of the axis in [0, 1)."""
        if self.interval is not None:
            low, high = self.interval
            return tuple(low + (high - low) * share for _ in self.paths)
        return self.at(np.minimum((share * len(self)).astype(np.int64), len(self) - 1))


def read_axis(given: AxisTable, loc: KeyPath, folder: Path, seed: int, root: Model) -> Axis:
    """Return the axis given by a table of a grid file, for scenarios with the model `root`.

    `loc` is its path in the file; paths of data files are relative to `folder`. Raises `Fault` for
    the first fault found.
    """
    if given.table is not None:
        return _from_table(given, given.table, (*loc, "table"), folder, root)
    paths = tuple(parsed_path(text) for text in _texts(given))
    places: list[KeyPath] = [(*loc, "path")]
    if given.paths is not None:
        places = [(*loc, "paths", i) for i in range(len(paths))]
    of = tuple(_kind(path, where, root) for path, where in zip(paths, places, strict=True))
    key = next(key for key in GENERATORS if getattr(given, key) is not None)
    values, loc = getattr(given, key), (*loc, key)
    if key == "values":
        return _listed(paths, of, values, loc)
    low, high, *count = _numbers(of, values, loc)
    resolved = {"paths": [path_text(path) for path in paths], key: [low, high, *count]}
    if not count:
        return Axis(paths, of, None, (low, high), resolved)
    if key == "uniform":
        # loc[1] is the index of the axis, which gives each axis its own random numbers.
        share = np.random.default_rng([seed, int(loc[1])]).random(count[0])
        column = low + (high - low) * share
    else:
        column = _spaced(low, high, count[0], loc)
    return Axis(paths, of, (column,) * len(paths), None, resolved)


def _texts(given: AxisTable) -> tuple[str, ...]:
    """Return the paths of an axis as written in the file."""
    return given.paths or () if given.path is None else (given.path,)


def _path(name: str, loc: KeyPath, root: Model) -> KeyPath:
    """Return the path given by the name of a table's column."""
    with contextlib.suppress(ValueError):
        path = parsed_path(name)
        if len(path) > 1 or path[0] in root.model_fields:
            return path
    expected = (
        "columns named by paths such as collision.k or balls[1].angle, counted from 1 (path or "
        "paths of the axis choose some of the columns)"
    )
    raise Fault(loc, f"the column {shown(name)}", expected)


def _kind(path: KeyPath, loc: KeyPath, root: Model) -> kinds.Kind:
    try:
        return kind_of(path, root)
    except Fault as error:
        raise Fault(loc, error.found, error.expected) from None


def _value(kind: kinds.Kind, value: Any, loc: KeyPath) -> Any:
    try:
        return read_number(kind, value)
    except PydanticCustomError as error:
        context = error.context or {}
        raise Fault(loc, str(context["found"]), str(context["expected"])) from None


def _column(kind: kinds.Kind, values: list[Any]) -> Array:
    return np.array(values, dtype=DTYPES[type_of(kind)])


def _listed(
    paths: tuple[KeyPath, ...], of: tuple[kinds.Kind, ...], given: Any, loc: KeyPath
) -> Axis:
    """Return the axis of ``values``, each one value for all paths or a list with one per path."""
    rows = []
    for i, value in enumerate(given):
        row = value if isinstance(value, list) else [value] * len(paths)
        if len(row) != len(paths):
            expected = f"a value, or a list of {len(paths)}: one for each of the paths"
            raise Fault((*loc, i), shown(value), expected)
        rows.append([_value(kind, one, (*loc, i)) for kind, one in zip(of, row, strict=True)])
    columns = [_column(kind, [row[j] for row in rows]) for j, kind in enumerate(of)]
    return _with_columns(paths, of, columns)


def _with_columns(
    paths: tuple[KeyPath, ...], of: tuple[kinds.Kind, ...], columns: list[Array]
) -> Axis:
    resolved: dict[str, Any] = {"paths": [path_text(path) for path in paths]}
    if len(columns[0]) <= _LISTED:
        resolved["values"] = [list(row) for row in zip(*(c.tolist() for c in columns), strict=True)]
    else:
        resolved |= {"count": len(columns[0]), "sha256": _digest(columns)}
    return Axis(paths, of, tuple(columns), None, resolved)


def _digest(columns: list[Array]) -> str:
    digest = hashlib.sha256()
    for column in columns:
        text = "\n".join(column) if column.dtype == object else ""
        digest.update(text.encode() if text else np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()


def _numbers(of: tuple[kinds.Kind, ...], given: Any, loc: KeyPath) -> list[Any]:
    """Return two ends in SI units and, if given, a count."""
    if not all(isinstance(kind, kinds.Quantity) for kind in of):
        raise Fault(loc, str(loc[-1]), "values, as this path takes no real numbers", on_key=True)
    if len({kind.dimension for kind in of if isinstance(kind, kinds.Quantity)}) > 1:
        raise Fault(loc, "paths of different dimensions", "paths of one dimension, or values")
    numbers = [_value(of[0], value, (*loc, i)) for i, value in enumerate(given[:2])]
    if len(given) == 3:
        count = given[2]
        if not isinstance(count, int) or isinstance(count, bool) or not 1 <= count <= _MOST_VALUES:
            expected = f"a whole number from 1 to {_MOST_VALUES}"
            raise Fault((*loc, 2), shown(count), expected)
        numbers.append(count)
    return numbers


def _spaced(low: float, high: float, count: int, loc: KeyPath) -> Array:
    """Return the values of ``linspace`` or ``logspace``, including both ends."""
    if loc[-1] == "linspace":
        return np.linspace(low, high, count)
    if not (low != 0.0 and high != 0.0 and (low > 0.0) == (high > 0.0)):
        raise Fault(loc, f"{low!r} to {high!r}", "two ends of the same sign, neither of them 0")
    # numpy's logarithms differ in the last bit between processors.
    if sys.float_info.min <= high / low < math.inf:
        unit, first, ratio = low, 0.0, math.log(high / low)
    else:  # a ratio that no double holds
        unit, first = math.copysign(1.0, low), math.log(abs(low))
        ratio = math.log(abs(high)) - first
    steps = [unit * math.exp(first + ratio * i / (count - 1)) for i in range(1, count - 1)]
    return np.array([low, *steps, high][:count] if count > 1 else [low])


def _from_table(given: AxisTable, name: str, where: KeyPath, folder: Path, root: Model) -> Axis:
    """Return the axis of a Parquet or CSV file: columns are named by paths, rows are values."""
    from vibro_cli.storage.frame import read_columns

    try:
        table = read_columns(folder / name)
    except ValueError as error:
        expected = "a .parquet or .csv file with a value in every cell"
        raise Fault(where, f"{shown(name)}, {error}", expected) from None
    if wanted := [path_text(parsed_path(text)) for text in _texts(given)]:
        missing = [name for name in wanted if name not in table]
        if missing:
            raise Fault(where, f"columns {listing(table, 'and')}", f"a column {missing[0]}")
        table = {name: table[name] for name in wanted}
    paths = tuple(_path(name, where, root) for name in table)
    of = tuple(_kind(path, where, root) for path in paths)
    columns = [
        _table_column(kind, values, name, where)
        for (name, values), kind in zip(table.items(), of, strict=True)
    ]
    if not columns or not len(columns[0]):
        raise Fault(where, "a table without rows", "a table with a row for each scenario")
    return _with_columns(paths, of, columns)


def _table_column(kind: kinds.Kind, values: Array, name: str, loc: KeyPath) -> Array:
    """Return a column of a table as values of its path."""
    if isinstance(kind, kinds.Quantity) and values.dtype.kind in "iuf":
        numbers = values.astype(np.float64)
        if not np.isfinite(numbers).all():
            row = int(np.argmin(np.isfinite(numbers)))
            found = f"{numbers[row]} in row {row + 1} of column {name}"
            raise Fault(loc, found, "a finite number")
        return numbers
    if isinstance(kind, kinds.Count) and values.dtype.kind in "iu":
        return values.astype(np.int64)
    read = []
    for row, value in enumerate(values.tolist()):
        try:
            read.append(_value(kind, value, loc))
        except Fault as error:
            found = f"{error.found} in row {row + 1} of column {name}"
            raise Fault(loc, found, error.expected) from None
    return _column(kind, read)


@dataclass(frozen=True)
class Design:
    """The points of a grid, numbered from 0; the last axis changes fastest."""

    axes: tuple[Axis, ...]
    mode: str
    points: int
    seed: int

    @property
    def paths(self) -> tuple[KeyPath, ...]:
        """Paths of all columns."""
        return tuple(path for axis in self.axes for path in axis.paths)

    def resolved(self) -> dict[str, Any]:
        """Return the design as plain data."""
        return {
            "mode": self.mode,
            "n": self.points,
            "seed": self.seed,
            "axes": [axis.resolved for axis in self.axes],
        }

    def columns(self, indices: Array) -> dict[KeyPath, Array]:
        """Return the values of every path at some points."""
        if self.mode == "product":
            places = np.unravel_index(indices, [len(axis) for axis in self.axes])
            values = [axis.at(place) for axis, place in zip(self.axes, places, strict=True)]
        elif self.mode == "zip":
            values = [axis.at(indices) for axis in self.axes]
        else:
            shares = self._shares(indices).T
            values = [axis.drawn(share) for axis, share in zip(self.axes, shares, strict=True)]
        return dict(zip(self.paths, (one for some in values for one in some), strict=True))

    def _shares(self, indices: Array) -> Array:
        """Return points in the unit cube, one per row, from scipy's quasi-random designs."""
        if self.mode == "latin-hypercube":
            return np.asarray(self._hypercube[indices])
        from scipy.stats import qmc

        if not len(indices):
            return np.zeros((0, len(self.axes)))
        first, last = int(indices.min()), int(indices.max())
        engine = qmc.Sobol(len(self.axes), scramble=True, rng=np.random.default_rng(self.seed))
        if first:
            engine.fast_forward(first)
        # Draw a single point first: scipy warns about other first draws that are no power of 2.
        stretch: Array = engine.random(1)
        if last > first:
            stretch = np.concatenate([stretch, engine.random(last - first)])
        return np.asarray(stretch[indices - first])

    @cached_property
    def _hypercube(self) -> Array:
        from scipy.stats import qmc

        rng = np.random.default_rng(self.seed)
        return np.asarray(qmc.LatinHypercube(len(self.axes), rng=rng).random(self.points))
