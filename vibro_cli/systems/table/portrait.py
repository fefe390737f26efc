"""Phase portrait of a ball's bounces on a curved wall around it: normal and direction of each.

A ball of radius r inside an ellipse with semi-axes a, b can move to and fro along either axis.
Along x, say, its centre moves on a chord of length L = ``2 (a - r)`` whose ends lie on a curve with
the radius of curvature R = ``b^2/a - r``. As both ends are symmetric, the linear map of small
deviations over one bounce has the trace ``2 (L/R - 1)``, so the orbit is a centre for L < 2 R and a
saddle for L > 2 R. At r = 0 and k = 1 the product of the angular momenta about the foci is
conserved.

Every dot is a bounce of one of several motions at k = 1: the direction of the wall's normal, and
the component of the unit velocity along the wall. At r = 0 the dots lie on the level curves of the
product of the angular momenta about the foci, which are drawn behind them.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibro_cli.errors import NoPortrait
from vibro_cli.figures import style
from vibro_cli.figures.chart import Sheet
from vibro_cli.figures.style import mark, width_of
from vibro_cli.figures.ticks import angle_ticks, label_axis, vertical_ticks
from vibro_cli.numerics.elementwise import Floats
from vibro_cli.systems.request import Limits
from vibro_cli.systems.run import simulate
from vibro_cli.systems.table import SYSTEM
from vibro_cli.systems.table.system import CIRCLE, ELLIPSE, InitialState, TableSystem, Wall


class TwoBounce(NamedTuple):
    """A motion to and fro along an axis of the wall."""

    axis: str
    kind: str
    """centre, saddle or degenerate."""
    length: float
    """Length L of the chord of the ball's centre (m)."""
    curvature_radius: float
    """Radius of curvature R of the curve of centres at its ends (m)."""
    trace: float
    """Trace 2 (L/R - 1) of the linear map of one bounce."""
    normal: float
    """Direction of the wall's normal at one end (rad, from the x axis)."""


def has_wall_portrait(wall: Wall | None) -> bool:
    """Return whether a wall has a portrait: an ellipse or a circle around the balls."""
    return wall is not None and wall.inside and wall.shape in (CIRCLE, ELLIPSE)


def two_bounce_orbits(wall: Wall, radius: float) -> tuple[TwoBounce, ...]:
    """Return the motions of a ball (radius in m) along both axes; on a circle they are alike."""
    (a, b), found = wall.semi_axes, []
    for axis, along, across, normal in (("x", a, b, 0.0), ("y", b, a, 0.5 * math.pi)):
        length = 2.0 * (along - radius)
        curvature = across * across / along - radius
        kind = "degenerate" if a == b else "centre" if length < 2.0 * curvature else "saddle"
        trace = 2.0 * (length / curvature - 1.0)
        found.append(TwoBounce(axis, kind, length, curvature, trace, normal))
    return tuple(found)


def multiplier(orbit: TwoBounce) -> float | None:
    """Return the growth factor of small deviations per bounce of a saddle, None for others."""
    if orbit.kind != "saddle":
        return None
    half = 0.5 * abs(orbit.trace)
    return half + math.sqrt(half * half - 1.0)


def _bounce(wall: Wall, normal: Any, share: Any) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
    """Return a point of the wall (m, from its centre) and a unit velocity; see `focal_product`."""
    a, b = wall.semi_axes
    nx, ny = np.cos(normal), np.sin(normal)
    height = np.hypot(a * nx, b * ny)
    inward = np.sqrt(1.0 - np.square(share))
    velocity = (-share * ny - inward * nx, share * nx - inward * ny)
    return (a * a * nx / height, b * b * ny / height), velocity


def focal_product(wall: Wall, normal: Any, share: Any) -> Floats:
    """Return the product of the angular momenta about the foci divided by v^2 (m^2), at r = 0.

    `normal` is the direction of the wall's outer normal (rad), `share` the component of the unit
    velocity along the wall, anticlockwise.
    """
    a, b = wall.semi_axes
    (x, y), (vx, vy) = _bounce(wall, normal, share)
    focus = math.sqrt(abs(a * a - b * b))
    fx, fy = (focus, 0.0) if a >= b else (0.0, focus)
    one = (x - fx) * vy - (y - fy) * vx
    other = (x + fx) * vy - (y + fy) * vx
    product: Floats = one * other
    return product


def wall_record(wall: Wall, radius: float) -> dict[str, Any]:
    """Return the singular points of the bounce map as plain values."""
    orbits = two_bounce_orbits(wall, radius)
    kinds = sorted({orbit.kind for orbit in orbits})
    names = {"degenerate": "diameters, all alike"}
    return {
        "type": " and ".join(names.get(kind, kind) for kind in kinds),
        "points": [{**orbit._asdict(), "multiplier": multiplier(orbit)} for orbit in orbits],
    }


MOTIONS = 26
BOUNCES = 240
"""Bounces of each motion."""
_LEVELS = 13
_HIGH = {"single": 70.0, "double": 95.0}
_LEFT, _RIGHT, _TOP, _BOTTOM = 12.0, 3.0, 5.0, 9.0
"""Margins of the panel (mm)."""


def wall_portrait(system: TableSystem, ball: int, width: str = "single") -> Figure:
    """Draw the portrait of the bounces of a ball (from 1), alone on the table.

    The wall must be an ellipse or a circle around the balls.
    """
    wall, radius = system.wall, system.bodies[ball - 1].radius
    assert wall is not None
    wide, high = width_of(width), _HIGH[width]
    inner, tall = wide - _LEFT - _RIGHT, high - _BOTTOM - _TOP
    with style.journal():
        sheet = Sheet(wide, high)
        axes = sheet.panel(_LEFT, _BOTTOM, inner, tall)
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
        across = angle_ticks(-math.pi, math.pi, inner)
        along = vertical_ticks(-1.0, 1.0, tall)
        label_axis(axes.xaxis, across, "direction of the wall's normal", "rad")
        label_axis(axes.yaxis, along, "component of the unit velocity along the wall", "")
        words = f"bounces of ball {ball}, r = {radius:g} m, at k = 1{named}"
        axes.set_title(words, pad=2.0, color=style.FRAME_GREY)
    return sheet.figure


def _motions(system: TableSystem, index: int) -> list[tuple[Floats, Floats]]:
    """Return the normals (rad) and components along the wall at the bounces of each motion."""
    found = []
    for number in range(MOTIONS):
        # Cover the regions around both axes of the wall, and both directions of rotation.
        share = -0.97 + 1.94 * number / (MOTIONS - 1)
        start = _start(system, index, 0.5 * math.pi * (number % 2) + 0.013, share)
        rows = simulate(SYSTEM, start, Limits(bounces=BOUNCES), "python").bounces
        found.append((rows["normal_angle"], rows["tangential_speed"]))
    return found


def _start(system: TableSystem, index: int, normal: float, share: float) -> TableSystem:
    """Return a system of the ball alone, at the wall, with a unit velocity."""
    wall, body = system.wall, system.bodies[index]
    assert wall is not None
    (x, y), velocity = _bounce(wall, normal, share)
    # Slightly off the wall, so that rounding cannot make the ball overlap it.
    away = body.radius + 1e-9 * min(wall.semi_axes)
    place = (
        wall.centre[0] + x - away * math.cos(normal),
        wall.centre[1] + y - away * math.sin(normal),
    )
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
    """Mark the bounces of the motions to and fro along the axes; return a legend of the marks."""
    kinds = {orbit.kind for orbit in two_bounce_orbits(wall, radius)}
    for orbit in two_bounce_orbits(wall, radius):
        if orbit.kind == "degenerate":
            continue
        shape = {"centre": "+", "saddle": "x"}[orbit.kind]
        look = mark(shape, 4.5, style.BLACK) | {"markeredgewidth": 0.6}
        for turn in (-1.0, 0.0, 1.0):
            place = orbit.normal + turn * math.pi
            axes.plot(place, 0.0, zorder=5.0, clip_on=False, **look)
    marks = {"centre": "+ centre", "saddle": "× saddle"}
    return "".join(f"; {words}" for kind, words in marks.items() if kind in kinds)


def portrait(
    system: TableSystem, width: str, drawn: Collection[int]
) -> tuple[dict[str, Any], dict[str, Figure]]:
    """Return the orbits to and fro of all balls, and a figure per radius of the balls `drawn`.

    Raises `NoPortrait` if the wall has no portrait.
    """
    wall = system.wall
    if wall is None or not has_wall_portrait(wall):
        raise NoPortrait(
            f"found {_described(system)}, expected an ellipse or a circle around "
            "the balls: only impacts on these have singular points and a portrait"
        )
    bodies: list[dict[str, Any]] = []
    figures: dict[str, Figure] = {}
    radii: dict[float, int] = {}
    for ball, body in enumerate(system.bodies, 1):
        record = {"ball": ball, "body": body.kind, "radius": body.radius}
        bodies.append(record | wall_record(wall, body.radius))
        first = radii.setdefault(body.radius, ball)
        if ball in drawn and f"portrait_{first}" not in figures:
            figures[f"portrait_{first}"] = wall_portrait(system, first, width)
    return {"system": "table", "bodies": bodies}, figures


def _described(system: TableSystem) -> str:
    wall = system.wall
    if wall is None:
        return "no wall"
    side = "around" if wall.inside else "among"
    return f"a wall of shape {wall.named or wall.shape} {side} the balls"


def point_lines(body: dict[str, Any]) -> Iterator[str]:
    """Return the orbits of a ball to and fro between two bounces as lines of text."""
    yield "  to and fro along  kind           chord [m]  radius of curvature [m]  grows by"
    for point in body["points"]:
        grows = "-" if point["multiplier"] is None else f"{point['multiplier']:.6g}"
        yield (
            f"  {point['axis']:16}  {point['kind']:10}  {point['length']:12.7g}  "
            f"{point['curvature_radius']:23.7g}  {grows}"
        )
