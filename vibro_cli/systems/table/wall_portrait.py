"""Phase portrait of a ball's bounces on a curved wall around it: place and direction of each.

Every dot is a bounce of one of a number of motions at k = 1: the direction of the wall's normal
there, and the component of the unit velocity along the wall. At r = 0 the dots lie on the level
curves of the product of the angular momenta about the foci, which are drawn behind them.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vibro_cli.figures import style
from vibro_cli.figures.portraits import layers
from vibro_cli.figures.ticks import angle_ticks, vertical_ticks
from vibro_cli.systems.run import simulate
from vibro_cli.systems.table import SYSTEM
from vibro_cli.systems.table.system import InitialState, TableSystem, Wall
from vibro_cli.systems.table.wall_orbits import focal_product, two_bounce_orbits
from vibro_cli.systems.wanted import Limits

MOTIONS = 26
BOUNCES = 240
"""Bounces of each motion."""
_LEVELS = 13
_LEFT, _RIGHT, _TOP, _BOTTOM = 12.0, 3.0, 5.0, 9.0
"""Room around the panel (mm)."""

Floats = NDArray[np.float64]


def wall_portrait(system: TableSystem, ball: int, width: str = "single") -> Figure:
    """Return the portrait of the bounces of a ball (from 1), alone on the table.

    `width` is `single` (85 mm) or `double` (170 mm). The wall must be an ellipse or a circle around
    the balls.
    """
    wall, radius = system.wall, system.bodies[ball - 1].radius
    assert wall is not None
    millimetres = style.WIDTHS[width]
    high = 70.0 if width == "single" else 95.0
    with style.journal():
        figure = Figure(figsize=(millimetres * style.MM, high * style.MM))
        left, low = _LEFT / millimetres, _BOTTOM / high
        box = (left, low, 1.0 - left - _RIGHT / millimetres, 1.0 - low - _TOP / high)
        axes = figure.add_axes(box)
        if radius == 0.0:
            _draw_levels(axes, wall)
        for normals, shares in _motions(system, ball - 1):
            axes.plot(
                normals, shares, ".", color=style.BLUE, markersize=1.1, markeredgewidth=0.0,
                rasterized=True, zorder=2.0,
            )  # fmt: skip
        named = _draw_singular(axes, wall, radius)
        axes.set_xlim(-math.pi, math.pi)
        axes.set_ylim(-1.0, 1.0)
        across = angle_ticks(-math.pi, math.pi, millimetres - _LEFT - _RIGHT)
        along = vertical_ticks(-1.0, 1.0, high - _BOTTOM - _TOP)
        axes.set_xticks(across.places, across.labels)
        axes.set_yticks(along.places, along.labels)
        axes.set_xlabel("direction of the wall's normal [rad]")
        axes.set_ylabel("component of the unit velocity along the wall")
        words = f"bounces of ball {ball}, r = {radius:g} m, at k = 1{named}"
        axes.set_title(words, pad=2.0, color=style.FRAME_GREY)
    return figure


def _motions(system: TableSystem, index: int) -> list[tuple[Floats, Floats]]:
    """Normals (rad) and components along the wall at the bounces of each motion."""
    found = []
    for number in range(MOTIONS):
        # Across the regions around the axes of the wall, and on both senses of going round.
        share = -0.97 + 1.94 * number / (MOTIONS - 1)
        start = _start(system, index, 0.5 * math.pi * (number % 2) + 0.013, share)
        rows = simulate(SYSTEM, start, Limits(bounces=BOUNCES), "python").bounces
        found.append((rows["normal_angle"], rows["tangential_speed"]))
    return found


def _start(system: TableSystem, index: int, normal: float, share: float) -> TableSystem:
    """The ball alone, at the wall, with a unit velocity."""
    wall, body = system.wall, system.bodies[index]
    assert wall is not None
    nx, ny = math.cos(normal), math.sin(normal)
    a, b = wall.semi_axes
    height = math.hypot(a * nx, b * ny)
    # A little inside, so that rounding does not put the ball into the wall.
    away = body.radius + 1e-9 * min(a, b)
    place = (
        wall.center[0] + a * a * nx / height - away * nx,
        wall.center[1] + b * b * ny / height - away * ny,
    )
    inward = math.sqrt(1.0 - share * share)
    velocity = (-share * ny - inward * nx, share * nx - inward * ny)
    state = InitialState(place, velocity)
    lossless = replace(wall, restitution=1.0)
    return replace(system, bodies=(body,), initial=(state,), wall=lossless)


def _draw_levels(axes: Axes, wall: Wall) -> None:
    normal, share = np.linspace(-math.pi, math.pi, 400), np.linspace(-0.9999, 0.9999, 300)
    product = focal_product(wall, normal[None, :], share[:, None])
    levels = np.linspace(float(np.min(product)), float(np.max(product)), _LEVELS + 2)[1:-1]
    look: dict[str, Any] = {"linewidths": 0.4, "zorder": 1.0}
    axes.contour(normal, share, product, levels=levels, colors=style.LEVEL_GREY, **look)
    if wall.semi_axes[0] != wall.semi_axes[1]:
        axes.contour(
            normal, share, product, levels=[0.0], colors=style.SEPARATRIX_GREY, linewidths=0.8,
            linestyles="dashed", zorder=1.5,
        )  # fmt: skip


def _draw_singular(axes: Axes, wall: Wall, radius: float) -> str:
    """Mark the bounces of the motions to and fro along the axes; return what the marks mean."""
    kinds = {orbit.kind for orbit in two_bounce_orbits(wall, radius)}
    for orbit in two_bounce_orbits(wall, radius):
        if orbit.kind == "degenerate":
            continue
        mark = {"centre": "+", "saddle": "x"}[orbit.kind]
        for turn in (-1.0, 0.0, 1.0):
            place = orbit.normal + turn * math.pi
            axes.plot(
                place, 0.0, marker=mark, zorder=5.0, clip_on=False,
                **(layers.POINT | {"color": style.BLACK, "markersize": 4.5}),
            )  # fmt: skip
    marks = {"centre": "+ centre", "saddle": "× saddle"}
    return "".join(f"; {words}" for kind, words in marks.items() if kind in kinds)
