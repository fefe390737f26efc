"""Velocities at possible contact points of rolling bodies (B figs 2–4, C figs 2a, 3).

All possible contact points have the same height. In a central impact the bodies touch at T₀,
straight ahead; in a skew impact at a point of the horizontal circle through T₀, at an angle α
to either side (T₂, T₃). The velocity there is the sum of that of the centre (translation) and of
the part due to rolling: ω times the distance from the axis of rotation through the centre, in a
vertical plane. Disks and hoops roll upright and touch only at T₀.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle

from vibro_cli.figures import style
from vibro_cli.figures.chart import Cell, body_look, in_rows
from vibro_cli.figures.labels import (
    Named,
    draw_legend,
    in_black,
    ring,
    room_for,
    rows_of,
    short_number,
    write_names,
)
from vibro_cli.figures.runs.velocities import (
    CENTRE,
    ROLLING,
    TOUCHING,
    arrow,
    draw_circle,
    striking,
    touching_point,
    with_unit,
    write_over,
)
from vibro_cli.figures.source import Array, Recorded
from vibro_cli.figures.style import line, width_of
from vibro_cli.mechanics.system import DISK, HOOP, Body

ASIDE = math.radians(35.0)
"""The angle α of T₂ and T₃ in a central impact."""
POINTS_TITLE = "Possible contact points"
POINTS_CAPTION = (
    "The bodies before their first impact, from the side and from above: the contact point T₀ of a "
    "central impact and points at the same height at an angle α to either side, with the velocity "
    "of each as the sum of the velocity of the centre and that due to rolling. Disks and hoops "
    "have T₀ alone, and are shown from the side only."
)
_HIGH = 36.0
_WORDS = 7.4
_GAP, _TOP, _BOTTOM = 2.0, 5.0, 2.0
_ROUNDING = 1e-12
_AROUND = 2.05
"""Half the height of a panel, in radii of its body."""
_LONGEST = 1.15
"""Length of the longest arrow, in the same radii."""
_APART = 0.09
"""Least distance, in the same radii, of points in line of sight that are named separately."""
_KEEN = 3
"""Weight of tangent planes among the obstacles that names should not cover."""
_THIN = line(style.FRAME_GREY, 0.4)
_HIDDEN = line(style.FRAME_GREY, 0.4, (2, 1.5))
_PLANE = line(style.BLACK, 0.8)
_LEGEND = in_black(
    ("centre", CENTRE),
    ("due to rolling", ROLLING),
    ("contact point", TOUCHING),
    ("tangent plane", _PLANE),
)
_RING = ring(120)


@dataclass(frozen=True)
class Rolling:
    """A body that arrives at an impact; lengths are in units of its radius."""

    body: Body
    number: int
    speed: float
    """Speed of the centre (m/s) along its path, positive to the right in the figure."""
    ahead: float
    """Distance of T₀ ahead of the centre; negative if it is behind."""
    above: float
    """Distance of T₀ above the centre."""
    aside: float
    """The angle α (rad) of T₂ and T₃."""

    @property
    def omega(self) -> float:
        """Angular velocity (rad/s); 0 for a particle, which slides."""
        return 0.0 if self.body.slides else self.speed / self.body.radius

    @property
    def is_flat(self) -> bool:
        """Whether the body touches only at T₀."""
        return self.body.kind in (DISK, HOOP)

    def points(self) -> Array:
        """Return T₀, T₂ and T₃, or T₀ of a flat body: (ahead, left, above), shape (n, 3)."""
        angles = np.array([0.0] if self.is_flat else [0.0, self.aside, -self.aside])
        left = abs(self.ahead) * np.sin(angles)
        above = np.full(len(angles), self.above)
        return np.column_stack([self.ahead * np.cos(angles), left, above])

    def rolling_part(self, point: Array) -> Array:
        """Return the part of the velocity at a point due to rolling (m/s): (ahead, left, above)."""
        rate = self.omega * self.body.radius
        return rate * np.array([point[2], 0.0, -point[0]])


def contact_points(run: Recorded, width: str = "single") -> Figure | None:
    """Draw possible contact points of the first impact's bodies with their velocities before it.

    Returns None without an impact, or if neither body moves.
    """
    if not len(run.collisions["n"]):
        return None
    pair = striking(run, 0)
    touch, _ = touching_point(pair)
    bodies = []
    for one in pair:
        reach = (touch - one.centre) / one.body.radius
        upright = np.array([-one.tangent[1], one.tangent[0]])
        ahead, above = float(reach @ one.tangent), float(reach @ upright)
        bodies.append(Rolling(one.body, one.number, one.speed[0], ahead, above, ASIDE))
    return figure_of(bodies, width)


def figure_of(bodies: Sequence[Rolling], width: str) -> Figure | None:
    """Draw possible contact points of bodies with their velocities; return None if none moves."""
    wide = width_of(width)
    fastest = max(
        float(np.hypot(one.speed + one.rolling_part(point)[0], one.rolling_part(point)[2]))
        for one in bodies
        for point in one.points()
    )
    fastest = max(fastest, *(abs(one.speed) for one in bodies))
    if not fastest:
        return None
    with style.journal():
        turning = any(one.omega for one in bodies)
        lines = rows_of(_LEGEND if turning else [_LEGEND[0], _LEGEND[-1]], wide)
        figure, panels = _sheet(width, bodies, room_for(lines, _TOP))
        for one, views in zip(bodies, panels, strict=True):
            for axes, draw in zip(views, (_draw_elevation, _draw_plan), strict=False):
                draw(axes, one, _LONGEST / fastest)
        draw_legend(figure, lines)
    return figure


def _sheet(width: str, bodies: Sequence[Rolling], top: float) -> tuple[Figure, list[list[Axes]]]:
    """Return a figure with panels for each body: an elevation and, unless it is flat, a plan."""
    wide = width_of(width)
    views = 1 if all(one.is_flat for one in bodies) else 2
    beside = min(2 if width == "single" else 4, views * len(bodies))
    inner = (wide - _GAP) / (4 if width == "double" else 2) - _GAP
    edge = 0.5 * (wide + _GAP - beside * (inner + _GAP))
    cell = Cell(inner, _HIGH, _WORDS, _GAP, _GAP)
    sheet, corners = in_rows(cell, views * len(bodies), beside, wide, edge, top, _BOTTOM)
    panels: list[list[Axes]] = [[] for _ in bodies]
    for place, corner in enumerate(corners):
        body, view = divmod(place, views)
        if view == 1 and bodies[body].is_flat:
            continue
        axes = sheet.blank(*corner, inner, _HIGH)
        across = _AROUND * inner / _HIGH
        axes.set_xlim(-across, across)
        axes.set_ylim(-_AROUND, _AROUND)
        panels[body].append(axes)
    return sheet.figure, panels


def _names(one: Rolling) -> list[str]:
    first = "$T_0$" if one.number == 1 else rf"$T_{{0,{one.number}}}$"
    comma = "," if one.number > 9 else ""  # T₁₀₂ would be ambiguous
    return [first, *(rf"$T_{{{one.number}{comma}{point}}}$" for point in (2, 3))]


def _draw_elevation(axes: Axes, one: Rolling, scale: float) -> None:
    """Draw the body from the side, with its path to the right and the velocities at T₀ and T₂."""
    colour = body_look(one.number)["color"]
    axes.plot(axes.get_xlim(), [-1.0, -1.0], zorder=1.9, **_PLANE)
    draw_circle(axes, np.zeros(2), 1.0, colour, 0.16)
    half = abs(one.ahead)
    axes.plot([-half, half], [one.above, one.above], zorder=2.0, **_HIDDEN)
    points = one.points()[:, [0, 2]]
    outward = points[0]
    axes.plot(*np.transpose([[0.0, 0.0], points[0]]), zorder=2.0, **style.AXIS)
    along = 0.75 * np.array([-outward[1], outward[0]])
    plane = np.linspace(points[0] - along, points[0] + along, 60)
    axes.plot(*plane.T, zorder=2.0, **_PLANE)
    drawn = [
        *[plane] * _KEEN,
        arrow(axes, np.zeros(2), scale * np.array([one.speed, 0.0]), colour, CENTRE),
    ]
    for number, point in enumerate(one.points()[:2]):
        drawn += _draw_parts(axes, points[number], one, point, [0, 2], scale)
    first, *beside = _names(one)
    named = [
        Named(rf"$C_{{{one.number}}}$", (0.0, 0.0)),
        Named(rf"$P_{{{one.number}}}$", (0.0, -1.0)),
        Named(first, points[0]),
    ]
    if len(points) > 1 and abs(points[0, 0] - points[1, 0]) > _APART:
        named.append(Named(", ".join(beside), points[1]))
    axes.plot(*np.transpose([name.point for name in named]), zorder=4.0, **style.POINT)
    write_names(axes, named, np.concatenate([*drawn, _RING]))
    number, radius = one.number, with_unit(one.body.radius, "m")
    turning = "" if one.body.slides else rf", $\omega$ = {with_unit(one.omega, 'rad/s')}"
    write_over(axes, 0.0, 1, rf"body {number} from the side, $r_{{{number}}}$ = {radius}")
    write_over(axes, 0.0, 0, rf"$v$ = {with_unit(one.speed, 'm/s')}{turning}")


def _draw_plan(axes: Axes, one: Rolling, scale: float) -> None:
    """Draw the body from above: the horizontal circle of possible contact points, and α."""
    colour = body_look(one.number)["color"]
    draw_circle(axes, np.zeros(2), 1.0, colour, 0.16)
    radius = abs(one.ahead)
    axes.add_patch(Circle((0.0, 0.0), radius, facecolor="none", zorder=2.2, edgecolor=style.BLACK,
                          linewidth=0.5, linestyle=(0, (2, 1.5))))  # fmt: skip
    axes.plot(axes.get_xlim(), [0.0, 0.0], zorder=1.9, **style.AXIS)
    axes.plot([0.0, 0.0], axes.get_ylim(), zorder=1.9, **style.AXIS)
    points = one.points()[:, :2]
    drawn = [_RING, radius * _RING]
    for number, point in enumerate(one.points()):
        place = points[number]
        if number:
            axes.plot(*np.transpose([[0.0, 0.0], place]), zorder=2.0, **_THIN)
            across = 0.55 * np.array([-place[1], place[0]])
            plane = np.linspace(place - across, place + across, 60)
            axes.plot(*plane.T, zorder=2.0, **_PLANE)
            drawn += [plane] * _KEEN
        drawn += _draw_parts(axes, place, one, point, [0, 1], scale)
    turned = 180.0 if one.ahead < 0.0 else 0.0
    aside = math.degrees(one.aside)
    ends = sorted((turned, turned + (aside if one.ahead > 0.0 else -aside)))
    axes.add_patch(Arc((0.0, 0.0), 0.9 * radius, 0.9 * radius, theta1=ends[0], theta2=ends[1],
                       linewidth=0.5, color=style.FRAME_GREY, zorder=2.3))  # fmt: skip
    middle = math.radians(0.5 * (ends[0] + ends[1]))
    named = [
        Named(r"$\alpha$", (0.45 * radius * math.cos(middle), 0.45 * radius * math.sin(middle))),
        *(Named(name, point) for name, point in zip(_names(one), points, strict=True)),
        Named(rf"$C_{{{one.number}}}$", (0.0, 0.0)),
    ]
    axes.plot(*np.transpose([*points, (0.0, 0.0)]), zorder=4.0, **style.POINT)
    write_names(axes, named, np.concatenate(drawn))
    share = math.cos(one.aside)
    share = share if share > _ROUNDING else 0.0  # at 90 degrees
    reach = with_unit(radius * share * one.body.radius, "m")
    write_over(axes, 0.0, 1, "from above")
    write_over(axes, 0.0, 0, rf"$\alpha$ = {short_number(aside, 3)}°, {reach} from the axis")


def _draw_parts(
    axes: Axes, place: Array, one: Rolling, point: Array, seen: Sequence[int], scale: float
) -> list[Array]:
    """Draw the two parts of a point's velocity and their sum; return points along the arrows.

    `seen` are the indices of the components in the plane of the view.
    """
    colour = body_look(one.number)["color"]
    centre = np.array([one.speed, 0.0, 0.0])
    rolling = one.rolling_part(point)
    parts = [(centre, CENTRE), (rolling, ROLLING), (centre + rolling, TOUCHING)]
    if not np.any(rolling[list(seen)]):
        parts = parts[:1]
    return [
        arrow(axes, place, scale * velocity[list(seen)], colour, look) for velocity, look in parts
    ]
