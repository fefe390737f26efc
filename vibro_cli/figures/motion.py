"""The states of all bodies at the times of a film's frames, each in closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from vibro_cli.figures.source import Array, Recorded
from vibro_cli.mechanics.body import PARTICLE, Body
from vibro_cli.mechanics.trace import Trace


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
    return Frames(np.asarray(times), table("x"), table("y"), s, table("speed"), turn)


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
    """Arc length (m); NaN where the trail breaks, at the seam of a closed trace."""
    speed: Array
    """Signed speed of the centre (m/s)."""


def trail(run: Recorded, shown: Frames, body: int) -> Trail:
    """Return the trail of a body (from 0) through all frames; its impacts are vertical jumps."""
    table = run.collisions
    made = np.asarray(table["admissible"], dtype=np.bool_) | np.asarray(
        table["substituted"], dtype=np.bool_
    )
    within = (np.asarray(table["t"]) >= shown.time[0]) & (np.asarray(table["t"]) <= shown.time[-1])
    time, s, speed = [shown.time], [shown.s[:, body]], [shown.speed[:, body]]
    rank = [np.full(len(shown.time), 2)]  # at one time: before the impact, after it, the frame
    for side in "ab":
        rows = np.flatnonzero((np.asarray(table[f"ball_{side}"]) == body + 1) & made & within)
        for order, when in enumerate(("pre", "post")):
            time.append(np.asarray(table["t"], dtype=np.float64)[rows])
            s.append(np.asarray(table[f"s_{side}"], dtype=np.float64)[rows])
            speed.append(np.asarray(table[f"speed_{side}_{when}"], dtype=np.float64)[rows])
            rank.append(np.full(len(rows), order))
    times, places, speeds = map(np.concatenate, (time, s, speed))
    order_of = np.lexsort((np.concatenate(rank), times))
    times, places, speeds = times[order_of], places[order_of], speeds[order_of]
    seams = np.flatnonzero(np.abs(np.diff(places)) > 0.5 * run.system.trace.length) + 1
    return Trail(
        np.insert(times, seams, times[seams]),
        np.insert(places, seams, math.nan),
        np.insert(speeds, seams, math.nan),
    )
