"""What a film of a run on a table shows: the plan with the balls and the paths they leave."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from vibro_cli.figures.film import Frames, Ground, States, trail
from vibro_cli.figures.source import Array
from vibro_cli.systems.table.plan import draw_wall, wall_corners

_ROOM = 0.03
"""Around what is shown, as a share of its size."""


def film_on_table(run: Any, times: Array) -> Frames:
    """Return the places of all balls at the times of frames (s).

    Between events paths are straight, so that frames and events are all that a trail needs.
    """
    bodies, times = run.system.bodies, np.asarray(times)
    sampled = run.sample(times)
    x, y = (np.asarray(sampled[name]).reshape(len(times), len(bodies)) for name in "xy")
    trails = tuple(
        trail(times, math.inf, [(times, x[:, n], y[:, n], 2), *_events(run, n)])
        for n in range(len(bodies))
    )
    span = float(times[-1] - times[0])
    return Frames(_ground(run, x, y), times, x, y, None, x, y, trails, span)


def _events(run: Any, ball: int) -> Iterator[States]:
    """Yield where a ball (from 0) meets others and the wall."""
    bounces = run.table("bounces")
    for table, end in ((run.collisions, "_a"), (run.collisions, "_b"), (bounces, "")):
        rows = np.flatnonzero(np.asarray(table[f"ball{end}"]) == ball + 1)
        time, x, y = (
            np.asarray(table[name], dtype=np.float64)[rows] for name in ("t", f"x{end}", f"y{end}")
        )
        yield time, x, y, 0


def _ground(run: Any, x: Array, y: Array) -> Ground:
    """Return the wall, and without one the part of the table on which the balls are seen."""
    wall, radii = run.system.wall, tuple(body.radius for body in run.system.bodies)
    low = np.array([np.min(x - radii), np.min(y - radii)])
    high = np.array([np.max(x + radii), np.max(y + radii)])
    if wall is not None:
        corners = wall_corners(wall)
        low, high = np.minimum(low, corners[0]), np.maximum(high, corners[1])
    room = _ROOM * float(np.max(high - low))

    def draw(axes: Axes, half: float) -> None:
        if wall is not None:
            draw_wall(axes, wall)

    return Ground(radii, low - room, high + room, draw, "the table from above", None)
