"""The states of all bodies at the times of a film's frames, each in closed form."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vibro_cli.figures.source import Array, Recorded
from vibro_cli.mechanics.system import PARTICLE, Body, System
from vibro_cli.mechanics.trace import Trace

_PER_PERIOD = 64
"""Points of a trail in a period."""


class Moving(Recorded, Protocol):
    """A finished run whose motion can be had at any time."""

    def sample(self, times: Any) -> dict[str, Any]:
        """The motion of every body at given times (s)."""


@dataclass(frozen=True)
class Frames:
    """States at the times of frames; arrays of shape (frames, bodies) but for the times."""

    time: Array
    """Times (s), shape (frames,)."""
    x: Array
    """Horizontal place of the centre (m)."""
    y: Array
    """Height of the centre (m)."""
    s: Array
    """Arc length of the contact point (m)."""
    speed: Array
    """Signed speed of the centre (m/s)."""
    turn: Array
    """Angle (rad) by which the body has turned since the first frame, clockwise."""
    between: Between
    """What the trails have more than the frames."""


@dataclass(frozen=True)
class Between:
    """States between frames that lie too far apart for a line through them to be the motion."""

    time: Array
    """Times (s), shape (instants,), rising."""
    s: Array
    """Arc length of the contact points (m), shape (instants, bodies)."""
    speed: Array
    """Signed speeds of the centres (m/s), the same shape."""
    span: float
    """How far back a trail goes (s): longer ones would cover one another."""


def frame_times(start: float, end: float, pace: float, rate: int) -> Array:
    """Return the times (s) of frames from `start` to `end`.

    `pace` is the motion's time per film's time, `rate` the frames of a film's second.
    """
    step = pace / rate
    number = math.floor((end - start) / step * (1.0 + 1e-12)) + 1
    times: Array = np.minimum(start + step * np.arange(number), end)
    return times


def frames(run: Moving, times: Array) -> Frames:
    """Return the states of all bodies at the times of frames.

    Nothing is interpolated: each state is that of its flight in closed form. On a closed trace the
    bodies must not run half of it from frame to frame, or their turning is not right.
    """
    bodies = run.system.bodies
    sampled = run.sample(times)

    def table(name: str) -> Array:
        return np.asarray(sampled[name], dtype=np.float64).reshape(len(times), len(bodies))

    arc = np.asarray(sampled["arc"]).reshape(len(times), len(bodies)) - 1
    s = table("s")
    turn = np.column_stack(
        [_turned(run.system.trace, body, arc[:, n], s[:, n]) for n, body in enumerate(bodies)]
    )
    between = _between(run, np.asarray(times))
    return Frames(np.asarray(times), table("x"), table("y"), s, table("speed"), turn, between)


def _between(run: Moving, times: Array) -> Between:
    """Return states before each frame as far back as a period, where frames are too far apart."""
    periods = small_periods(run.system)
    step, span = min(periods) / _PER_PERIOD, max(periods)
    added = [
        np.arange(now - step, max(before, now - span), -step)[::-1]
        for before, now in pairwise(times.tolist())
        if now - before > step
    ]
    instants = np.concatenate([np.empty(0), *added])
    shape = len(instants), len(run.system.bodies)
    if not len(instants):
        return Between(instants, np.empty(shape), np.empty(shape), span)
    sampled = run.sample(instants)
    s, speed = (np.asarray(sampled[name], dtype=np.float64) for name in ("s", "speed"))
    return Between(instants, s.reshape(shape), speed.reshape(shape), span)


def small_periods(system: System) -> list[float]:
    """Return the periods (s) of small oscillations on the arcs, shorter where the trace turns.

    Without an arc or gravity that of a pendulum as long as the trace, or 1 s.
    """
    turning = 0.0 if system.turning is None else system.turning.square
    rates = [
        math.sqrt(turning + system.gravity / (body.kappa * piece.path_radius(body.radius)))
        for piece in system.trace.pieces
        for body in system.bodies
        if not piece.is_line
    ] or [math.sqrt(turning + system.gravity / system.trace.length)]
    return [2.0 * math.pi / rate if rate > 0.0 else 1.0 for rate in rates]


def _turned(trace: Trace, body: Body, arc: Any, s: Array) -> Array:
    """Return how far a body has turned (rad): the way of its centre through its radius."""
    if body.kind == PARTICLE:
        return np.zeros(len(s))
    scales = np.array(
        [1.0 if p.is_line else p.path_radius(body.radius) / p.radius for p in trace.pieces]
    )
    lengths = scales * [piece.length for piece in trace.pieces]
    before = np.concatenate([[0.0], np.cumsum(lengths)])
    starts = np.array([piece.start_s for piece in trace.pieces])
    way = before[arc] + scales[arc] * (s - starts[arc])
    if trace.closed:
        way = np.unwrap(way, period=before[-1])
    turned: Array = (way - way[0]) / body.radius
    return turned


@dataclass(frozen=True)
class Trail:
    """What a point in the phase plane runs through: states at frames, and jumps where they are."""

    time: Array
    """Times (s), not falling; shape (points,)."""
    s: Array
    """Arc length (m); NaN where the trail breaks: at the seam of a closed trace, and before what it
    has not of the time between two frames."""
    speed: Array
    """Signed speed of the centre (m/s)."""


def trail(run: Recorded, shown: Frames, body: int) -> Trail:
    """Return the trail of a body (from 0) through all frames; its impacts are vertical jumps.

    Where frames are further apart than a trail is long there is nothing between.
    """
    more = shown.between
    jumps = [*_struck(run, body), *_at_walls(run, body)]
    # at one time: before the impact, after it, the frame
    parts = [
        (shown.time, shown.s[:, body], shown.speed[:, body], 2),
        (more.time, more.s[:, body], more.speed[:, body], 2),
        *(_within(shown, jump) for jump in jumps),
    ]
    times, places, speeds = (np.concatenate([part[n] for part in parts]) for n in range(3))
    rank = np.concatenate([np.full(len(part[0]), part[3]) for part in parts])
    order = np.lexsort((rank, times))
    times, places, speeds = times[order], places[order], speeds[order]
    leaps = np.abs(np.diff(places)) > 0.5 * run.system.trace.length
    seams = np.flatnonzero(leaps | _after_gaps(shown, times)) + 1
    return Trail(
        np.insert(times, seams, times[seams]),
        np.insert(places, seams, math.nan),
        np.insert(speeds, seams, math.nan),
    )


_States = tuple[Array, Array, Array, int]
"""Times (s), arc lengths (m), speeds (m/s), and 0 before an impact, 1 after it."""


def _struck(run: Recorded, body: int) -> Iterator[_States]:
    """Yield the states of a body before and after its impacts on others."""
    table = run.collisions
    made = np.asarray(table["admissible"], dtype=np.bool_) | np.asarray(
        table["substituted"], dtype=np.bool_
    )
    for side in "ab":
        rows = np.flatnonzero((np.asarray(table[f"ball_{side}"]) == body + 1) & made)
        for order, when in enumerate(("pre", "post")):
            names = ("t", f"s_{side}", f"speed_{side}_{when}")
            time, s, speed = (np.asarray(table[name], dtype=np.float64)[rows] for name in names)
            yield time, s, speed, order


def _at_walls(run: Recorded, body: int) -> Iterator[_States]:
    """Yield the states of a body before and after its impacts on walls."""
    flights, pieces = run.flights(), run.system.trace.pieces
    scales = np.array(
        [1.0 if p.is_line else p.path_radius(run.system.bodies[body].radius) for p in pieces]
    )
    mine = np.asarray(flights["ball"]) == body + 1
    for order, end in enumerate(("end", "start")):
        rows = np.flatnonzero(mine & (np.asarray(flights[f"cause_{end}"], dtype=object) == "wall"))
        arc = np.asarray(flights["arc"])[rows] - 1
        places = flights[f"angle_{end}"][rows]
        along = [pieces[n].arc_length(place) for n, place in zip(arc, places, strict=True)]
        speed = scales[arc] * flights[f"rate_{end}"][rows]
        yield np.asarray(flights[f"t_{end}"])[rows], np.array(along, dtype=np.float64), speed, order


def _within(shown: Frames, jump: _States) -> _States:
    """Return those states that are not before all frames, after them or in a gap of the trail."""
    time, s, speed, order = jump
    following = np.searchsorted(shown.time, time, side="left")
    ahead = shown.time[np.minimum(following, len(shown.time) - 1)] - time
    here = (time >= shown.time[0]) & (time <= shown.time[-1]) & (ahead <= shown.between.span)
    return time[here], s[here], speed[here], order


def _after_gaps(shown: Frames, times: Array) -> NDArray[np.bool_]:
    """Return between which of the times of a trail there is time that it leaves out."""
    before = shown.time[:-1][np.diff(shown.time) > shown.between.span]
    gaps = np.zeros(len(times) - 1, dtype=np.bool_)
    gaps[np.searchsorted(times, before, side="right") - 1] = True
    return gaps
