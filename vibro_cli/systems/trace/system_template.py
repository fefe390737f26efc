"""From the values of a point to what the solver starts with, for many points at once.

Points that share trace, radii, laws and ends make one setting: it is built once by the ordinary
reader, and what its points differ in (starts, masses, k, stops) is worked out for all of them at
once, as are systems that differ in numbers only. Only what is sure to be a valid scenario is taken
so, checked here with room to spare: every other point goes through the ordinary reader alone, which
also says what is wrong with it. Where these differ in numbers only, a good part of its work is the
same for all of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, reduce
from itertools import combinations, permutations
from typing import Any

import numpy as np

from vibro_cli.assemble import SIZES, body_of, build_system, speed_of, system_of, trace_of
from vibro_cli.grids.axes import Array, kind_of
from vibro_cli.grids.document import document_at, plain_value, reason_of
from vibro_cli.mechanics.initial_conditions import clear_of_wall, wall_position
from vibro_cli.mechanics.reachability import (
    Path,
    Window,
    contact_angle,
    fits_between,
    not_neighbours,
    over_others,
    surely_clear,
)
from vibro_cli.mechanics.system import Body, InitialState, TraceSystem, neighbours
from vibro_cli.mechanics.trace import Piece, Trace
from vibro_cli.numerics.elementwise import taken
from vibro_cli.scenario import quantities as kinds
from vibro_cli.scenario.loading import Document, scenario_of
from vibro_cli.scenario.models import Scenario
from vibro_cli.scenario.problems import KeyPath, ScenarioError
from vibro_cli.systems.trace.motion import centres
from vibro_cli.systems.trace.world import initial_flight, pairs_of

SURE = 1.0e-9
"""Closer than this share to the edge of what is possible, the ordinary reader decides."""
_OF_A_BALL = ("radius", "thickness", "inertia_ratio")
_OF_THE_TRACE = ("radius", "length", "end_slope")
_MOST_SLOPE = 999.0


def is_of_system(path: KeyPath) -> bool:
    """Tell whether a path leads to a number of the system that belongs to no start of a run."""
    if path[0] == "balls":
        return len(path) == 3 and path[2] in _OF_A_BALL
    if path[:2] == ("trace", "arcs"):
        return len(path) == 4 and path[3] in _OF_THE_TRACE
    walls = (("ends", "left", "wall"), ("ends", "right", "wall"))
    return path in (("gravity",), ("trace", "start_slope"), *walls)


def sound_systems(
    known: Scenario, like: TraceSystem, values: Values, count: int
) -> tuple[Array, TraceSystem]:
    """Return which systems are surely sound, and these as one system of arrays.

    `values` are their numbers, ``count`` for each path; the others are those of a known valid
    scenario and its system.
    """
    sound = _allowed(values, count)
    if like.turning is not None:
        sound[:] = False
    sound &= _is_chain(changed(known, values), values)
    at = np.flatnonzero(sound)
    scenario = changed(known, {path: column[at] for path, column in values.items()})
    on_new_trace = any(path[0] == "trace" for path in values)
    trace = trace_of(scenario) if on_new_trace and len(at) else like.trace
    bodies = tuple(map(body_of, scenario.balls))
    system = system_of(scenario, trace, bodies, like.initial, None)
    resized = any(path[0] == "balls" and path[2] == "radius" for path in values)
    fit = np.ones(len(at), dtype=bool)
    if (on_new_trace or resized) and len(at):
        if any(ball.touching for ball in known.balls):
            fit[:] = False
        with np.errstate(all="ignore"):
            fit &= _bodies_fit(trace, bodies, like)
            at_once = trace.closed and len(trace.pieces) == 1
            fit &= at_once or _touch_nothing_else(trace, bodies, len(at))
            fit &= _only_neighbours_touch(trace, bodies, len(at))
            fit &= _walls_fit(system)
    sound[at[~fit]] = False
    return sound, taken(system, fit)


def _allowed(values: Values, count: int) -> Array:
    """Which systems have numbers that their keys allow, and that doubles can compute with."""
    allowed = np.ones(count, dtype=bool)
    low, high = SIZES[0] * (1.0 + SURE), SIZES[1] * (1.0 - SURE)
    for path, column in values.items():
        kind = kind_of(path)
        assert isinstance(kind, kinds.Quantity)
        if kind.above is not None:
            allowed &= column > kind.above
        if kind.at_least is not None:
            allowed &= column >= kind.at_least
        if kind.at_most is not None:
            allowed &= column <= kind.at_most
        if path[-1] in ("radius", "thickness", "length", "gravity"):
            allowed &= (column > low) & (column < high)
        allowed &= np.abs(column) < (_MOST_SLOPE if "slope" in str(path[-1]) else high)
    return allowed


def _is_chain(scenario: Scenario, values: Values) -> Any:
    """Where the slopes of a changed trace, which is open, are those of its shapes."""
    if not any(path[0] == "trace" for path in values):
        return True
    slope: Any = scenario.trace.start_slope
    sound: Any = not scenario.trace.closed
    for arc in scenario.trace.arcs:
        if arc.end_slope is None:
            continue
        sound = sound & ((arc.end_slope > slope) == (arc.shape == "valley"))
        sound = sound & (arc.end_slope != slope)
        slope = arc.end_slope
    return sound


def _bodies_fit(trace: Trace, bodies: tuple[Body, ...], like: TraceSystem) -> Any:
    """Where bodies fit every valley, alone and beside another as those of a known system do."""
    fit: Any = True
    for piece in trace.pieces:
        if piece.sign > 0.0:
            for body in bodies:
                fit = fit & (body.radius < piece.radius * (1.0 - SURE))
    for a, b in combinations(range(len(bodies)), 2):
        for piece, old in zip(trace.pieces, like.trace.pieces, strict=True):
            if piece.is_line:
                continue
            angle = contact_angle(piece, bodies[a].radius, bodies[b].radius)
            before = contact_angle(old, like.bodies[a].radius, like.bodies[b].radius)
            fit = fit & (np.isfinite(angle) == math.isfinite(before))
            sweep = piece.angle_end - piece.angle_start
            behind = np.isfinite(angle) & (sweep > math.tau - angle * (1.0 + SURE) - SURE)
            if not (trace.closed and len(trace.pieces) == 1):
                fit = fit & ~behind
    return fit


def _touch_nothing_else(trace: Trace, bodies: tuple[Body, ...], count: int) -> Any:
    """Where bodies on a trace touch only the piece they roll on, and so the trace nowhere itself.

    The largest body encloses, where it touches the trace, all the others there.
    """
    largest = reduce(np.maximum, [body.radius for body in bodies])
    clear: Any = True
    for piece in trace.pieces:
        if not piece.is_line:
            clear = clear & (piece.angle_end - piece.angle_start < math.tau * (1.0 - SURE))
    for i, j in permutations(range(len(trace.pieces)), 2):
        path, other = Path.of(trace.pieces[i], largest), Path.of(trace.pieces[j], 0.0)
        clear = clear & surely_clear(path, other, Window.of(trace, i, j), largest, count)
    return clear


def _only_neighbours_touch(trace: Trace, bodies: tuple[Body, ...], count: int) -> Any:
    """Where bodies never touch but as neighbours, over those between them or else."""
    fit: Any = True
    for (left, right), between in over_others(len(bodies), trace.closed):
        outer = bodies[left].radius, bodies[right].radius
        row = tuple(bodies[n].radius for n in between)
        fit = fit & np.logical_not(fits_between(trace, outer, row))
    for first, second in not_neighbours(len(bodies), trace.closed):
        a, b = bodies[first].radius, bodies[second].radius
        for i, j in permutations(range(len(trace.pieces)), 2):
            if i < j or trace.closed:
                path, other = Path.of(trace.pieces[i], a), Path.of(trace.pieces[j], b)
                fit = fit & surely_clear(path, other, Window.of(trace, i, j), a + b, count)
    return fit


def _walls_fit(system: TraceSystem) -> Any:
    """Where the outer bodies can meet the walls, and no other."""
    fit: Any = True
    pieces = system.trace.pieces
    ends = (system.left_end, pieces[0], 0), (system.right_end, pieces[-1], -1)
    for wall, piece, outer in ends:
        if wall is None:
            continue
        touch = wall_position(piece, system.bodies[outer].radius, outer != 0)
        if touch is None:
            return False
        room = SURE * (1.0 + np.abs(touch))
        fit = fit & (touch > piece.angle_start + room) & (touch < piece.angle_end - room)
        for body in system.bodies[1:] if outer == 0 else system.bodies[:-1]:
            fit = fit & clear_of_wall(piece, body.radius, system.bodies[outer].radius)
    return fit


Values = Mapping[KeyPath, Any]
"""A number, or an array of numbers, for each path."""

_LEAST_MASS, _MOST_MASS, _MOST_SPEED = 1.0e-99, 1.0e99, 1.0e29


@dataclass(frozen=True)
class Starts:
    """What the solver starts some points with; rows of points that are not sure mean nothing."""

    sure: Array
    """Whether a point is known to be a valid scenario."""
    piece: Array
    """[point, ball]"""
    s: Array
    c: Array
    p: Array
    mass: Array
    restitution: Array
    """[point, pair]"""
    stop_t: Array
    """s; nan without a stop."""
    stop_collisions: Array
    """0 without a stop."""

    def at(self, rows: Any) -> Starts:
        """Return the starts of some of the points."""
        return Starts(*(getattr(self, one.name)[rows] for one in fields(self)))


@dataclass(frozen=True)
class Systems:
    """The systems of some points, as far as they are surely sound."""

    points: Array
    """Which points these are, of those that were asked for."""
    system: TraceSystem
    """One system, or several as one of arrays."""
    of_points: Array | None
    """Then the number of the system of each of these points, from 0."""

    @property
    def count(self) -> int:
        """Number of systems."""
        return 1 if self.of_points is None else int(np.max(self.of_points, initial=-1)) + 1


@dataclass(frozen=True)
class Setting:
    """A setting, known from one valid point of it."""

    scenario: Scenario
    system: TraceSystem

    @cached_property
    def pairs(self) -> int:
        """Number of pairs of neighbours that the solver looks at."""
        return len(pairs_of(self.system))

    def systems(self, values: Values, count: int) -> Systems:
        """Return the systems of points with these values (a column for each path of an axis)."""
        own = {path: column for path, column in values.items() if is_of_system(path)}
        if not own:
            return Systems(np.arange(count), self.system, None)
        rows = np.stack(list(own.values()), axis=1)
        distinct, of_points = np.unique(rows, axis=0, return_inverse=True)
        numbers = dict(zip(own, distinct.T, strict=True))
        sound, system = sound_systems(self.scenario, self.system, numbers, len(distinct))
        points = np.flatnonzero(sound[of_points.reshape(-1)])
        renumbered = np.cumsum(sound) - 1
        return Systems(points, system, renumbered[of_points.reshape(-1)[points]])

    def starts(self, values: Values, systems: Systems) -> Starts:
        """Return the starts of the points of some systems, whose values these are."""
        count = len(systems.points)
        sure = np.ones(count, dtype=bool)
        scenario = changed(self.scenario, values)
        system = systems.system
        if systems.of_points is not None:
            system = taken(system, systems.of_points)
        system = replace(system, bodies=tuple(map(body_of, scenario.balls)))
        with np.errstate(invalid="ignore"):
            states = [_state(scenario, system, n, values, sure) for n in range(len(system.bodies))]
            _check_order(system, states, sure)
            _check_walls(system, states, sure)
        for body in system.bodies:
            sure &= (body.mass > _LEAST_MASS) & (body.mass < _MOST_MASS)
        for one in scenario.collision.k:
            sure &= (one >= 0.0) & (one <= 1.0)
        system = replace(system, initial=tuple(states), restitution=scenario.collision.k)
        return self._starts(scenario, system, sure)

    def starts_of(self, points: Sequence[Point]) -> Starts:
        """Return the starts of valid points of this setting that were read alone."""
        each = []
        for point in points:
            assert point.scenario is not None
            assert point.system is not None
            sure = np.ones(1, dtype=bool)
            each.append(self._starts(point.scenario, point.system, sure))
        names = [one.name for one in fields(Starts)]
        return Starts(*(np.concatenate([getattr(one, name) for one in each]) for name in names))

    def _starts(self, scenario: Scenario, system: TraceSystem, sure: Array) -> Starts:
        """The starts of as many points as there are flags, from a system with initial states."""
        count, k = len(sure), system.restitution
        flights = [initial_flight(system, n) for n in range(len(system.bodies))]
        stop_t, stop_collisions = _stops(scenario, sure)
        state = {
            name: _table([getattr(flight, name) for flight in flights], count)
            for name in ("piece", "s", "c", "p")
        }
        return Starts(
            sure=sure,
            **state,
            mass=_table([body.mass for body in system.bodies], count),
            restitution=_table([k[min(n, len(k) - 1)] for n in range(self.pairs)], count),
            stop_t=stop_t,
            stop_collisions=stop_collisions,
        )


def _table(columns: Sequence[Any], count: int) -> Array:
    """Numbers and arrays as the columns of one table."""
    if not columns:
        return np.zeros((count, 0))
    return np.stack([np.broadcast_to(column, count) for column in columns], axis=1)


def _state(
    scenario: Scenario, system: TraceSystem, number: int, values: Values, sure: Array
) -> InitialState:
    """Position and speed of the centre of one body; where they are in doubt, not sure."""
    given, body = scenario.balls[number], system.bodies[number]
    piece = system.trace.pieces[given.arc - 1]
    position: Any = given.position if piece.is_line else given.angle
    if position is None:
        # The place of a body in contact with another one is known if it is the same for all.
        if any(path[0] == "balls" and path[-1] in ("angle", "position") for path in values):
            sure[:] = False
        piece = system.trace.pieces[system.initial[number].piece]
        position = system.initial[number].position
    sure &= (piece.angle_start < position) & (position < piece.angle_end) & np.isfinite(position)
    for motion in (given.speed, given.omega, given.rate):
        if motion is not None:
            sure &= np.abs(motion) < _MOST_SPEED
    return InitialState(piece.index, position, speed_of(given, body, piece))


def _stops(scenario: Scenario, sure: Array) -> tuple[Array, Array]:
    count, time, most = len(sure), scenario.stop.time, scenario.stop.collisions
    if time is not None:
        sure &= (time > 0.0) & np.isfinite(time)
    if most is not None:
        sure &= most >= 1
    return (
        np.array(np.broadcast_to(np.nan if time is None else time, count), dtype=np.float64),
        np.array(np.broadcast_to(0 if most is None else most, count), dtype=np.int64),
    )


def _check_order(system: TraceSystem, states: list[InitialState], sure: Array) -> None:
    """Leave sure only points whose neighbours are in order and clear of one another."""
    for a, b in neighbours(len(states), system.trace.closed):
        one, other = states[a], states[b]
        radius_a, radius_b = (system.bodies[n].radius for n in (a, b))
        piece = system.trace.pieces[one.piece]
        if one.piece != other.piece:
            if b > a and other.piece < one.piece:
                sure[:] = False
            beside = system.trace.pieces[other.piece]
            sure &= _clear(piece, one.position, radius_a, beside, other.position, radius_b)
            continue
        along = other.position - one.position if b > a else one.position - other.position
        needed = contact_angle(piece, radius_a, radius_b) * (1.0 + SURE)
        sure &= along > needed + SURE
        if not piece.is_line:
            sure &= along < math.tau - needed - SURE


def _check_walls(system: TraceSystem, states: list[InitialState], sure: Array) -> None:
    pieces = system.trace.pieces
    for wall, ball, piece, side in (
        (system.left_end, 0, pieces[0], 1.0),
        (system.right_end, len(states) - 1, pieces[-1], -1.0),
    ):
        if wall is None or states[ball].piece != piece.index:
            continue
        touch = wall_position(piece, system.bodies[ball].radius, side < 0.0)
        if touch is None:
            sure[:] = False
        else:
            away = side * (states[ball].position - touch)
            sure &= away > SURE * np.maximum(1.0, np.abs(touch))


def _clear(
    piece_a: Piece,
    place_a: Any,
    radius_a: float,
    piece_b: Piece,
    place_b: Any,
    radius_b: float,
) -> Array:
    """Whether bodies on two pieces are surely apart."""
    ax, ay = centres(piece_a, place_a, radius_a)
    bx, by = centres(piece_b, place_b, radius_b)
    contact = radius_a + radius_b
    size = np.abs(ax) + np.abs(ay) + np.abs(bx) + np.abs(by) + contact
    clear: Array = np.hypot(bx - ax, by - ay) > contact + SURE * size
    return clear


def changed(known: Scenario, values: Values) -> Scenario:
    """Return a scenario with other numbers, each of which its key allows, or arrays of numbers."""
    values = dict(values)
    for_all = values.pop(("collision", "k"), None)
    if for_all is not None:
        values |= {("collision", "k", n): for_all for n in range(len(known.collision.k))}
    new: Scenario = _changed(known, values)
    return new


def _changed(known: Any, values: Values) -> Any:
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


# What points of one setting may differ in.
_OF_A_START = ("angle", "position", "rate", "omega", "speed", "density", "mass")
# Reasons that are kept ready.
_MOST_REASONS = 10_000


def is_quick(path: KeyPath) -> bool:
    """Tell whether points may differ in the value at a path and still share a setting."""
    if path[0] == "balls":
        return len(path) == 3 and path[2] in _OF_A_START
    return path[:2] == ("collision", "k") or path in (("stop", "time"), ("stop", "collisions"))


def is_number(path: KeyPath) -> bool:
    """Tell whether another value at a path leaves all else of a scenario as it is."""
    of_ball = path[0] == "balls" and len(path) == 3 and path[2] in _OF_A_BALL
    return is_quick(path) or of_ball or path == ("gravity",)


def scenario_at(base: Document, values: Values) -> Scenario:
    """Return the scenario of one point of a trace, by the ordinary reader.

    Raises
    ------
    ScenarioError
        With everything that is wrong with it.
    """
    return scenario_of(document_at(base, values))


@dataclass(frozen=True)
class Point:
    """One point that went through the ordinary reader: a scenario, or the reason why not."""

    scenario: Scenario | None
    system: TraceSystem | None
    reason: str | None


class Reader:
    """Reads points of one grid, scenarios that differ from its base in numbers only."""

    def __init__(self, base: Document) -> None:
        self._base = base
        self._known: Scenario | None = None
        self._reasons: dict[tuple[tuple[KeyPath, Any], ...], str] = {}

    def read(self, values: Values) -> Point:
        """Return one point, as the ordinary reader finds it.

        A number that its key does not allow is told before anything else is looked at, so that
        the reason is the same for every point that has it.
        """
        plain = {path: plain_value(value) for path, value in values.items()}
        refused: tuple[tuple[KeyPath, Any], ...] = ()
        if self._known is not None:
            refused = tuple(item for item in plain.items() if not _is_allowed(self._known, *item))
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

    def _scenario(self, values: Values, refused: tuple[tuple[KeyPath, Any], ...]) -> Scenario:
        if self._known is not None and not refused:
            return changed(self._known, {path: _number(path, values[path]) for path in values})
        try:
            return scenario_at(self._base, values)
        except ScenarioError as error:
            if refused and len(self._reasons) < _MOST_REASONS:
                self._reasons[refused] = reason_of(error)
            raise


def _number(path: KeyPath, value: Any) -> Any:
    kind = kind_of(path)
    assert isinstance(kind, kinds.Quantity | kinds.Count)
    return kind.read(value)


def _is_allowed(known: Scenario, path: KeyPath, value: Any) -> bool:
    """Whether a number is one that the key of a known scenario allows, whatever the others are."""
    kind = kind_of(path)
    assert isinstance(kind, kinds.Quantity | kinds.Count)
    number = kind.read_or_none(value)
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
