"""Systems that differ in numbers only: which of them are surely sound, and those as one of arrays.

What makes a system is in ``build.assembly``, for numbers and arrays alike; what it must hold to is
checked here with room to spare. Whatever is in doubt goes through the ordinary reader.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import reduce
from itertools import combinations, permutations
from typing import Any

import numpy as np

from vibro_cli.build.assembly import system_of, trace_of
from vibro_cli.build.bodies import body_of
from vibro_cli.build.findings import SIZES
from vibro_cli.grids.axes import Column
from vibro_cli.grids.changing import changed
from vibro_cli.grids.paths import kind_of
from vibro_cli.mechanics.body import Body
from vibro_cli.mechanics.clearance import contact_angle, fits_between, not_neighbours, over_others
from vibro_cli.mechanics.placement import fits_at_wall, wall_position
from vibro_cli.mechanics.separation import Path, Window, surely_clear
from vibro_cli.mechanics.system import System
from vibro_cli.mechanics.trace import Trace
from vibro_cli.numerics.alike import taken
from vibro_cli.scenario import Scenario
from vibro_cli.scenario import quantities as kinds
from vibro_cli.scenario.problems import KeyPath

Values = Mapping[KeyPath, Column]

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
    known: Scenario, like: System, values: Values, count: int
) -> tuple[Column, System]:
    """Return which systems are surely sound, and these as one system of arrays.

    Parameters
    ----------
    known, like
        A valid scenario and its system.
    values
        Numbers of the systems, ``count`` for each path; the others are those of ``known``.
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


def _allowed(values: Values, count: int) -> Column:
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


def _bodies_fit(trace: Trace, bodies: tuple[Body, ...], like: System) -> Any:
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


def _walls_fit(system: System) -> Any:
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
            between = system.bodies[outer].radius
            fit = fit & np.logical_not(fits_at_wall(piece, body.radius, between, outer != 0))
    return fit
