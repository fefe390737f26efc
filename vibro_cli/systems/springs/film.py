"""What a film of a run of bodies on springs shows: bodies and springs, and their phase plane."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from vibro_cli.figures import style
from vibro_cli.figures.film import Frames, Ground, Link, Panel, States, times_between, trail
from vibro_cli.figures.source import Array
from vibro_cli.mechanics.system import PARTICLE
from vibro_cli.systems.springs.figures import coil_shape

_PER_PERIOD = 64
"""Points of a trail in a period of the fastest body."""
_BEAM = 0.02
"""Half of what a spring hangs from, and how far its coils swing, as shares of half the width."""
_ROOM = 0.04
"""Around what is shown, as a share of its width."""


def film_on_springs(run: Any, times: Array) -> Frames:
    """Return the states of all bodies at the times of frames (s), each exact at its time."""
    bodies, times = run.system.bodies, np.asarray(times)
    periods = [2.0 * math.pi / run.system.frequency(body) for body in range(len(bodies))]
    span = max(periods)
    more = times_between(times, min(periods) / _PER_PERIOD, span)
    x, speed = _states(run, times)
    between = _states(run, more)
    trails = tuple(
        trail(
            times, span,
            [
                (times, x[:, n], speed[:, n], 2),
                (more, between[0][:, n], between[1][:, n], 2),
                *_struck(run, n),
            ],
        )
        for n in range(len(bodies))
    )  # fmt: skip
    rolls = [0.0 if body.kind == PARTICLE else 1.0 / body.radius for body in bodies]
    ground = _ground(run, x)
    return Frames(ground, times, x, np.zeros_like(x), (x - x[0]) * rolls, x, speed, trails, span)


def _states(run: Any, times: Array) -> tuple[Array, Array]:
    """Return places along the line (m) and speeds (m/s), shape (times, bodies)."""
    shape = len(times), len(run.system.bodies)
    if not len(times):
        return np.empty(shape), np.empty(shape)
    sampled = run.sample(times)
    return np.reshape(sampled["x"], shape), np.reshape(sampled["speed"], shape)


def _struck(run: Any, body: int) -> Iterator[States]:
    """Yield the states of a body (from 0) before and after its impacts on others."""
    table = run.collisions
    made = np.asarray(table["admissible"], dtype=np.bool_) | np.asarray(
        table["substituted"], dtype=np.bool_
    )
    for side in "ab":
        rows = np.flatnonzero((np.asarray(table[f"ball_{side}"]) == body + 1) & made)
        for order, when in enumerate(("pre", "post")):
            names = ("t", f"x_{side}", f"speed_{side}_{when}")
            time, x, speed = (np.asarray(table[name], dtype=np.float64)[rows] for name in names)
            yield time, x, speed, order


def _ground(run: Any, x: Array) -> Ground:
    """Return the feet, the line on which the centres move, and the plane of speed against place."""
    radii = tuple(body.radius for body in run.system.bodies)
    springs = run.system.springs
    low = np.array([min(np.min(x - radii), *(one.foot for one in springs)), -max(radii)])
    high = np.array([
        max(np.max(x + radii), *(one.foot for one in springs)),
        max(*radii, *(one.height for one in springs), -low[1]),
    ])  # fmt: skip
    room = _ROOM * float(high[0] - low[0])
    wide = 0.5 * float(high[0] - low[0])

    def draw(axes: Axes, half: float) -> None:
        axes.plot([low[0], high[0]], [0.0, 0.0], color=style.LEVEL_GREY, linewidth=0.5, zorder=0.5)
        for one in springs:
            beam = [one.foot - _BEAM * wide, one.foot + _BEAM * wide]
            axes.plot(beam, [one.height] * 2, color=style.BLACK, linewidth=1.6)

    links = tuple(Link((one.foot, one.height), coil_shape(_BEAM * wide)) for one in springs)
    panel = Panel("x", "speed against place along the line")
    return Ground(radii, low - room, high + room, draw, "the bodies on their springs", panel, links)
