"""The points of a grid: from axes to columns, and each read alone or like one that is known.

The ordinary reader decides what is a valid scenario, and says what is wrong with one that is not.
Where points differ in numbers only, a good part of its work is the same for all of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vibro_cli.assemble import build_system
from vibro_cli.grids.axes import Array, Axis, kind_of
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.scenario import quantities as kinds
from vibro_cli.scenario.loading import Document, apply, scenario_of
from vibro_cli.scenario.models import Scenario
from vibro_cli.scenario.problems import KeyPath, ScenarioError

Given = Mapping[KeyPath, Any]


def changed(known: Scenario, values: Given) -> Scenario:
    """Return a scenario with other numbers, each of which its key allows, or arrays of numbers."""
    values = dict(values)
    for_all = values.pop(("collision", "k"), None)
    if for_all is not None:
        values |= {("collision", "k", n): for_all for n in range(len(known.collision.k))}
    new: Scenario = _changed(known, values)
    return new


def _changed(known: Any, values: Given) -> Any:
    """A table, list or value with others in some places."""
    if () in values:
        return values[()]
    within: dict[Any, dict[KeyPath, Any]] = {}
    for path, value in values.items():
        within.setdefault(path[0], {})[path[1:]] = value
    if isinstance(known, tuple):
        return tuple(
            _changed(one, within[n]) if n in within else one for n, one in enumerate(known)
        )
    updates = {str(key): _changed(getattr(known, key), given) for key, given in within.items()}
    return known.model_copy(update=updates)


PointValues = Mapping[KeyPath, Any]

# What points of one setting may differ in, and what of a setting another one may differ in.
_OF_A_BALL = ("angle", "position", "rate", "omega", "speed", "density", "mass")
_OF_A_SETTING = ("radius", "thickness", "inertia_ratio")
# Reasons that are kept ready.
_MOST_REASONS = 10_000


def is_quick(path: KeyPath) -> bool:
    """Tell whether points may differ in the value at a path and still share a setting."""
    if path[0] == "balls":
        return len(path) == 3 and path[2] in _OF_A_BALL
    return path[:2] == ("collision", "k") or path in (("stop", "time"), ("stop", "collisions"))


def is_number(path: KeyPath) -> bool:
    """Tell whether another value at a path leaves all else of a scenario as it is."""
    of_ball = path[0] == "balls" and len(path) == 3 and path[2] in _OF_A_SETTING
    return is_quick(path) or of_ball or path == ("gravity",)


def scenario_at(base: Document, values: PointValues) -> Scenario:
    """Return the scenario of one point of a trace, by the ordinary reader.

    Raises
    ------
    ScenarioError
        With everything that is wrong with it.
    """
    return scenario_of(document_at(base, values))


def document_at(base: Document, values: PointValues) -> Document:
    """Return the document of one point."""
    data = base.data
    given: list[KeyPath] = []
    for path, value in values.items():
        data = apply(data, path, _plain(value), given)
        given.append(path)
    return Document(data, base.source, base.name)


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


@dataclass(frozen=True)
class Point:
    """One point that went through the ordinary reader: a scenario, or the reason why not."""

    scenario: Scenario | None
    system: TraceSystem | None
    reason: str | None


class Reader:
    """Reads points of one grid whose scenarios differ in numbers only.

    Parameters
    ----------
    base
        The scenario that the axes change.
    """

    def __init__(self, base: Document) -> None:
        self._base = base
        self._known: Scenario | None = None
        self._reasons: dict[tuple[tuple[KeyPath, Any], ...], str] = {}

    def read(self, values: PointValues) -> Point:
        """Return one point, as the ordinary reader finds it.

        A number that its key does not allow is told before anything else is looked at, so that
        the reason is the same for every point that has it.
        """
        plain = {path: _plain(value) for path, value in values.items()}
        refused: tuple[tuple[KeyPath, Any], ...] = ()
        if self._known is not None:
            refused = tuple(item for item in plain.items() if not _allowed(self._known, *item))
            if refused in self._reasons:
                return Point(None, None, self._reasons[refused])
        try:
            scenario = self._scenario(plain, refused)
            point = Point(scenario, build_system(scenario), None)
        except ScenarioError as error:
            return Point(None, None, reason_of(error))
        if self._known is None and all(map(is_number, plain)):
            self._known = point.scenario
        return point

    def _scenario(self, values: PointValues, refused: tuple[tuple[KeyPath, Any], ...]) -> Scenario:
        if self._known is not None and not refused:
            return changed(self._known, {path: _number(path, values[path]) for path in values})
        try:
            return scenario_at(self._base, values)
        except ScenarioError as error:
            if refused and len(self._reasons) < _MOST_REASONS:
                self._reasons[refused] = reason_of(error)
            raise


def reason_of(error: ScenarioError) -> str:
    """Return what is wrong with a point, on one line."""
    texts = [f"{one.path}: found {one.found}, expected {one.expected}" for one in error.problems]
    return "; ".join(texts)


def _number(path: KeyPath, value: Any) -> Any:
    kind = kind_of(path)
    assert isinstance(kind, kinds.Quantity | kinds.Count)
    return kind.read(value)


def _allowed(known: Scenario, path: KeyPath, value: Any) -> bool:
    """Whether a number is one that the key of a known scenario allows, whatever the others are."""
    kind = kind_of(path)
    assert isinstance(kind, kinds.Quantity | kinds.Count)
    number: float | None = kind.read_or_none(value)
    if number is None:
        return False
    if path[-1] == "radius":
        return number > 0.0
    if path[-1] not in ("angle", "position"):
        return True
    assert isinstance(path[1], int)
    arc = known.trace.arcs[known.balls[path[1]].arc - 1]
    if path[-1] == "position":
        return arc.length is not None and 0.0 < number < arc.length
    return _inside(known, known.balls[path[1]].arc - 1, number)


def _inside(known: Scenario, piece: int, angle: float) -> bool:
    """Whether an angle is within an arc, and not at one of its ends."""
    arcs = known.trace.arcs
    slopes = [known.trace.start_slope]
    for arc in arcs[: piece + 1]:
        slopes.append(slopes[-1] if arc.end_slope is None else arc.end_slope)
    sign = -1.0 if arcs[piece].shape == "hump" else 1.0
    return sign * slopes[piece] < angle < sign * slopes[piece + 1]


SAMPLED = ("latin-hypercube", "sobol")
"""Modes that draw a number of points from the axes."""
MODES = ("product", "zip", *SAMPLED)


@dataclass(frozen=True)
class Design:
    """The points of a grid, numbered from 0; the last axis changes fastest."""

    axes: tuple[Axis, ...]
    mode: str
    points: int
    seed: int

    @property
    def paths(self) -> tuple[KeyPath, ...]:
        """The path of every column."""
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
        """Return the value of every path at some points."""
        found: dict[KeyPath, Array] = {}
        for number, axis in enumerate(self.axes):
            if self.mode in ("product", "zip"):
                values = axis.at(self._index(number, indices))
            else:
                values = axis.drawn(self._shares(indices)[:, number])
            found.update(zip(axis.paths, values, strict=True))
        return found

    def _index(self, number: int, indices: Array) -> Array:
        """Index on one axis of some points."""
        if self.mode == "zip":
            return indices
        inner = 1
        for axis in self.axes[number + 1 :]:
            inner *= len(axis)
        return (indices // inner) % len(self.axes[number])

    def _shares(self, indices: Array) -> Array:
        """Points of the unit cube, a row for each, from scipy's quasi-random designs."""
        if self.mode == "latin-hypercube":
            return np.asarray(self._hypercube[indices])
        from scipy.stats import qmc

        if not len(indices):
            return np.zeros((0, len(self.axes)))
        first, last = int(indices.min()), int(indices.max())
        engine = qmc.Sobol(len(self.axes), scramble=True, rng=np.random.default_rng(self.seed))
        if first:
            engine.fast_forward(first)
        # The first draw is of one point: of any other number it would warn of lost balance.
        stretch: Array = engine.random(1)
        if last > first:
            stretch = np.concatenate([stretch, engine.random(last - first)])
        return np.asarray(stretch[indices - first])

    @cached_property
    def _hypercube(self) -> Array:
        from scipy.stats import qmc

        rng = np.random.default_rng(self.seed)
        return np.asarray(qmc.LatinHypercube(len(self.axes), rng=rng).random(self.points))
