"""Initial data of many grid points at once, computed from the values of the points.

Points that share trace, radii, laws and ends share a template, which the ordinary reader builds
once. The quantities in which they differ (starts, masses, k, stops) are computed as arrays, and so
are systems that differ in numbers only. The checks are those of `assemble`, applied to arrays. A
point that they refuse is read on its own by the ordinary reader: it is invalid and needs a message,
or its check needs a search, or a body starts at a junction. The reader shares its work between
such points that differ in numbers only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from vibro_cli.assemble import (
    Problems,
    bodies_of,
    body_of,
    build_system,
    check_fit,
    check_gaps,
    check_turns,
    check_walls,
    initial_states,
    system_of,
    trace_of,
)
from vibro_cli.grids.axes import Array, kind_of
from vibro_cli.grids.document import document_at, reason_of
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.mechanics.reachability import surely_sound
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.mechanics.trace import bends
from vibro_cli.numerics.elementwise import outside, taken
from vibro_cli.scenario import quantities as kinds
from vibro_cli.scenario.base import plain
from vibro_cli.scenario.loading import Document, scenario_of
from vibro_cli.scenario.models import Scenario
from vibro_cli.scenario.problems import KeyPath, ScenarioError
from vibro_cli.systems.request import UNLIMITED
from vibro_cli.systems.trace.world import initial_flight, pairs_of

_OF_A_BALL = ("radius", "thickness", "inertia_ratio")
_OF_THE_TRACE = ("radius", "length", "end_slope")


def is_of_system(path: KeyPath) -> bool:
    """Return whether a path leads to a number of the system, not of the initial state."""
    if path[0] == "balls":
        return len(path) == 3 and path[2] in _OF_A_BALL
    if path[:2] == ("trace", "arcs"):
        return len(path) == 4 and path[3] in _OF_THE_TRACE
    walls = (("ends", "left", "wall"), ("ends", "right", "wall"))
    return path in (("gravity",), ("trace", "start_slope"), *walls)


def _moves_contacts(path: KeyPath) -> bool:
    """Return whether contacts at the start depend on the number at a path."""
    return path[0] == "trace" or path[-1] in ("radius", "angle", "position")


Values = Mapping[KeyPath, Any]
"""A number or an array of numbers for each path."""


class Validity(Problems):
    """Flags of the valid ones among many scenarios, given as arrays; makes no messages."""

    def __init__(self, scenario: Scenario, count: int) -> None:
        super().__init__(scenario)
        self.sound: Array = np.ones(count, dtype=bool)

    def refuse(self, wrong: Any) -> bool:
        """Clear the flags where something is wrong; return False, as no message is needed."""
        self.sound &= np.logical_not(wrong)
        return False

    def add(self, path: str, found: str, expected: str) -> None:
        """Clear all flags."""
        self.sound[:] = False

    def check_values(self, values: Values) -> None:
        """Check that the key of each value allows it."""
        for path, column in values.items():
            self.refuse(np.logical_not(is_allowed(path, column)))


def is_allowed(path: KeyPath, value: Any) -> Any:
    """Return whether a key allows a number; radii must be positive, as bodies may meet others."""
    kind = kind_of(path)
    assert isinstance(kind, kinds.Quantity | kinds.Count)
    return kind.allows(value) & (path[-1] != "radius" or value > 0.0)


@dataclass(frozen=True)
class Starts:
    """Initial data of some points; rows of points that are not `sure` have no meaning."""

    sure: Array
    """Whether a point is certainly a valid scenario."""
    piece: Array
    """[point, ball]"""
    s: Array
    c: Array
    p: Array
    mass: Array
    restitution: Array
    """[point, pair]"""
    stop_t: Array
    """Time of the stop (s), `NEVER` without one."""
    stop_collisions: Array
    """Number of impacts at the stop, `UNLIMITED` without one."""

    def at(self, rows: Any) -> Starts:
        """Return the initial data of some of the points."""
        return Starts(*(getattr(self, one.name)[rows] for one in fields(self)))


@dataclass(frozen=True)
class Systems:
    """The systems of those points whose system is certainly valid."""

    points: Array
    """Indices of these points among those requested."""
    system: TraceSystem
    """A single system, or several systems with arrays for numbers."""
    of_points: Array | None
    """For several systems: the index of each point's system, from 0."""

    @property
    def count(self) -> int:
        """Number of systems."""
        return 1 if self.of_points is None else int(np.max(self.of_points, initial=-1)) + 1


@dataclass(frozen=True)
class SystemTemplate:
    """A template, built from one of its valid points."""

    scenario: Scenario
    system: TraceSystem

    @cached_property
    def _placed(self) -> Scenario:
        """The scenario with explicit positions for the bodies that start in contact."""
        places: dict[KeyPath, Any] = {}
        for number, state in enumerate(self.system.initial):
            if self.scenario.balls[number].touching:
                key = "position" if self.system.trace.pieces[state.piece].is_line else "angle"
                place = {"touching": None, "arc": state.piece + 1, key: state.position}
                places |= {("balls", number, key): value for key, value in place.items()}
        return changed(self.scenario, places)

    def systems(self, values: Values, count: int) -> Systems:
        """Return the systems of points with these values (one column per path of an axis)."""
        touching = any(ball.touching for ball in self.scenario.balls)
        if touching and any(map(_moves_contacts, values)):
            return Systems(np.arange(0), self.system, None)
        own = {path: column for path, column in values.items() if is_of_system(path)}
        if not own:
            return Systems(np.arange(count), self.system, None)
        rows = np.stack(list(own.values()), axis=1)
        distinct, of_points = np.unique(rows, axis=0, return_inverse=True)
        numbers = dict(zip(own, distinct.T, strict=True))
        sound, system = self._sound_systems(numbers, len(distinct))
        points = np.flatnonzero(sound[of_points.reshape(-1)])
        renumbered = np.cumsum(sound) - 1
        return Systems(points, system, renumbered[of_points.reshape(-1)[points]])

    def _sound_systems(self, values: Values, count: int) -> tuple[Array, TraceSystem]:
        """Return flags of the valid systems with these numbers, and those as a system of arrays."""
        scenario, on_new_trace = changed(self._placed, values), any(p[0] == "trace" for p in values)
        numbers = Validity(scenario, count)
        numbers.check_values(values)
        if on_new_trace:
            _check_slopes(scenario, numbers)
        if self.system.turning is not None or (on_new_trace and scenario.trace.closed):
            numbers.sound[:] = False  # arrays do not support these
        at = np.flatnonzero(numbers.sound)
        if not len(at):
            return numbers.sound, self.system
        scenario = changed(self._placed, {path: column[at] for path, column in values.items()})
        trace = trace_of(scenario) if on_new_trace else self.system.trace
        bodies = tuple(map(body_of, scenario.balls))
        shapes = Validity(scenario, len(at))
        with np.errstate(all="ignore"):
            check_turns(trace, shapes)
            check_fit(trace, bodies, shapes, trace_is_sound=False)
            check_gaps(trace, bodies, shapes)
            check_walls(scenario, trace, bodies, [None] * len(bodies), shapes)
            if any(map(_moves_contacts, values)):
                radii = [body.radius for body in bodies]
                shapes.sound &= surely_sound(trace, radii, len(at))
        numbers.sound[at] = shapes.sound
        system = system_of(scenario, trace, bodies, self.system.initial, None)
        return numbers.sound, taken(system, shapes.sound)

    def starts(self, values: Values, systems: Systems) -> Starts:
        """Return the initial data of the points of some systems, from their values."""
        scenario, system = changed(self._placed, values), systems.system
        if systems.of_points is not None:
            system = taken(system, systems.of_points)
        problems = Validity(scenario, len(systems.points))
        with np.errstate(all="ignore"):
            problems.check_values(values)
            bodies = bodies_of(scenario.balls, problems)
            initial = initial_states(scenario, system.trace, bodies, problems)
            check_walls(scenario, system.trace, bodies, initial, problems)
            states = tuple(state for state in initial if state is not None)
            for state in states:
                # The first piece of a body at a junction depends on its speed.
                piece = system.trace.pieces[state.piece]
                problems.refuse(state.position == piece.angle_start)
                problems.refuse(state.position == piece.angle_end)
            k = scenario.collision.k
            system = replace(system, bodies=bodies, initial=states, restitution=k)
            return self._starts(scenario, system, problems.sound)

    def allows(self, path: KeyPath, value: Any) -> bool:
        """Return whether the key at a path allows a number, regardless of the other values."""
        allowed: bool = is_allowed(path, value)
        if path[-1] not in ("angle", "position"):
            return allowed
        assert isinstance(path[1], int)
        piece = self.system.trace.pieces[self.scenario.balls[path[1]].arc - 1]
        return allowed and not outside(value, piece.angle_start, piece.angle_end)

    def starts_of(self, points: Sequence[SystemTemplate]) -> Starts:
        """Return the initial data of valid points of this template that were read one by one."""
        sure = np.ones(1, dtype=bool)
        each = [self._starts(point.scenario, point.system, sure) for point in points]
        names = [one.name for one in fields(Starts)]
        return Starts(*(np.concatenate([getattr(one, name) for one in each]) for name in names))

    def _starts(self, scenario: Scenario, system: TraceSystem, sure: Array) -> Starts:
        """Return the initial data of the flagged points, from a system with initial states."""
        count, pairs = len(sure), len(pairs_of(system))
        flights = [initial_flight(system, n) for n in range(len(system.bodies))]
        time, most = scenario.stop.time, scenario.stop.collisions
        state = {
            name: _table([getattr(flight, name) for flight in flights], count)
            for name in ("piece", "s", "c", "p")
        }
        return Starts(
            sure=sure,
            **state,
            mass=_table([body.mass for body in system.bodies], count),
            restitution=_table([system.restitution_of(n) for n in range(pairs)], count),
            stop_t=np.broadcast_to(NEVER if time is None else time, count),
            stop_collisions=np.broadcast_to(UNLIMITED if most is None else most, count),
        )


def _table(columns: Sequence[Any], count: int) -> Array:
    """Stack numbers and arrays as columns."""
    if not columns:
        return np.zeros((count, 0))
    return np.stack([np.broadcast_to(column, count) for column in columns], axis=1)


def _check_slopes(scenario: Scenario, problems: Validity) -> None:
    """Check that the slope of each arc rises or falls as its shape demands."""
    slope = scenario.trace.start_slope
    for arc in scenario.trace.arcs:
        if arc.end_slope is not None:
            problems.refuse(np.logical_not(bends(arc.shape, slope, arc.end_slope)))
            slope = arc.end_slope


def changed(known: Scenario, values: Values) -> Scenario:
    """Return a scenario with other numbers, or arrays of numbers, which are not checked."""
    for path, value in values.items():
        of_all_pairs = path == ("collision", "k")
        given = (value,) * len(known.collision.k) if of_all_pairs else value
        known = _with(known, path, given)
    return known


def _with(known: Any, path: KeyPath, value: Any) -> Any:
    """Return a table, list or value with another value at a path."""
    if not path:
        return value
    key: Any = path[0]
    if isinstance(known, tuple):
        return (*known[:key], _with(known[key], path[1:], value), *known[key + 1 :])
    return known.model_copy(update={key: _with(getattr(known, key), path[1:], value)})


# Keys of a body whose values may differ within a template.
_OF_A_START = ("angle", "position", "rate", "omega", "speed", "density", "mass")
# Size of the cache of reasons.
_MOST_REASONS = 10_000


def is_quick(path: KeyPath) -> bool:
    """Return whether points with different values at a path may share a template."""
    if path[0] == "balls":
        return len(path) == 3 and path[2] in _OF_A_START
    return path[:2] == ("collision", "k") or path in (("stop", "time"), ("stop", "collisions"))


def is_number(path: KeyPath) -> bool:
    """Return whether the value at a path can be replaced in a scenario that has been read."""
    return is_quick(path) or (path[0] in ("balls", "gravity") and is_of_system(path))


class Reader:
    """Reads single points of a grid; reuses a valid point where only numbers differ."""

    def __init__(self, base: Document) -> None:
        self._base = base
        self._known: SystemTemplate | None = None
        self._reasons: dict[tuple[tuple[KeyPath, Any], ...], str] = {}

    def read(self, values: Values) -> SystemTemplate | str:
        """Read a point as the ordinary reader does; return its template, or the reason of refusal.

        Numbers that their keys do not allow are reported before any other fault, so all points with
        the same such numbers have the same reason.
        """
        given = {path: plain(value) for path, value in values.items()}
        known = self._known
        refused: tuple[tuple[KeyPath, Any], ...] = ()
        if known is not None:
            refused = tuple(item for item in given.items() if not known.allows(*item))
            if refused in self._reasons:
                return self._reasons[refused]
        try:
            if known is None or refused:
                scenario = scenario_of(document_at(self._base, given))
            else:
                numbers = {path: kind_of(path).read(value) for path, value in given.items()}
                scenario = changed(known.scenario, numbers)
        except ScenarioError as error:
            reason = reason_of(error)
            if refused and len(self._reasons) < _MOST_REASONS:
                self._reasons[refused] = reason
            return reason
        try:
            # Points share a known trace: none of its numbers is that of an axis.
            trace = None if known is None else known.system.trace
            point = SystemTemplate(scenario, build_system(scenario, trace))
        except ScenarioError as error:
            return reason_of(error)
        if known is None and all(map(is_number, given)):
            self._known = point
        return point
