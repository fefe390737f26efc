"""The scene of bodies on springs: at the start and at the first impacts (C fig. 5a)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from vibro_cli.figures import style
from vibro_cli.figures.chart import LEFT, body_look
from vibro_cli.figures.numbering import Named, write_names
from vibro_cli.figures.source import Array
from vibro_cli.figures.style import MM, WIDTHS
from vibro_cli.figures.ticks import number_ticks, vertical_ticks
from vibro_cli.systems.run import Run

_IMPACTS = 2
_RIGHT, _TITLE, _BOTTOM, _GAP = 3.0, 5.0, 8.5, 1.5
_HIGHEST = 45.0
_COILS = 9
_APART = 3.6
"""Distance of the heights of springs whose feet are at one place (mm)."""
_LEAST = 0.5
"""Least radius of a body that is drawn (mm)."""
_LINE: dict[str, Any] = {"color": style.BLACK, "linewidth": 0.8}
_FOOT: dict[str, Any] = {"color": style.BLACK, "linewidth": 1.2}
_HEIGHT: dict[str, Any] = {
    "color": style.FRAME_GREY, "linewidth": 0.4, "linestyle": (0, (6, 1.5, 1, 1.5)),
}  # fmt: skip
_ARROW: dict[str, Any] = {
    "arrowstyle": "-|>", "color": style.BLACK, "linewidth": 0.7, "shrinkA": 0.0, "shrinkB": 0.0,
    "mutation_scale": 7.0,
}  # fmt: skip
_RING = np.column_stack([f(np.linspace(0.0, 2.0 * np.pi, 24)) for f in (np.cos, np.sin)])


@dataclass(frozen=True)
class Instant:
    """Where the bodies are, and their speeds after what happens then."""

    title: str
    places: Array
    """Of the centres along the line (m)."""
    speeds: Array
    """m/s"""


def springs_scene(run: Run, width: str = "single") -> Figure:
    """Return bodies, springs and feet to scale, at the start and at the first impacts.

    Raises ValueError for a width that is neither `single` nor `double`.
    """
    if width not in WIDTHS:
        raise ValueError(f"unknown width {width!r}, expected one of {', '.join(WIDTHS)}")
    shown = _instants(run)
    low, high = _extent(run, shown)
    inner = WIDTHS[width] - LEFT - _RIGHT
    scale = min(inner / float(high[0] - low[0]), _HIGHEST / float(high[1] - low[1]))
    tall = scale * float(high[1] - low[1])
    total = len(shown) * (_TITLE + tall + _GAP) + _BOTTOM
    with style.journal():
        figure = Figure(figsize=(WIDTHS[width] * MM, total * MM))
        for number, one in enumerate(shown):
            bottom = total - (number + 1) * (_TITLE + tall) - number * _GAP
            box = (LEFT / WIDTHS[width], bottom / total, inner / WIDTHS[width], tall / total)
            axes = figure.add_axes(box)
            last = number == len(shown) - 1
            _set_axes(axes, low, high, (inner, tall), scale, last)
            axes.set_title(one.title, pad=2.0, color=style.FRAME_GREY)
            _draw(axes, run, one, (inner, tall), scale)
    return figure


def _instants(run: Run) -> list[Instant]:
    """Return the start and the first impacts."""
    times = [0.0, *(float(t) for t in run.collisions["t"][:_IMPACTS])]
    sampled = run.sample(times)
    number = len(run.system.bodies)
    places, speeds = (np.reshape(sampled[name], (-1, number)) for name in ("x", "speed"))
    titles = ["start", *(_title(run, row) for row in range(len(times) - 1))]
    return [Instant(*one) for one in zip(titles, places, speeds, strict=True)]


def _title(run: Run, row: int) -> str:
    """Return what stands over an impact: when it is, and how far apart the centres are."""
    one, other = (int(run.collisions[f"ball_{end}"][row]) for end in "ab")
    radii = [run.system.bodies[number - 1].radius for number in (one, other)]
    apart = 2.0 * np.sqrt(radii[0] * radii[1])
    names = rf"$x_{{{other}}}-x_{{{one}}}=2\sqrt{{r_{{{one}}}r_{{{other}}}}}$"
    time = float(run.collisions["t"][row])
    return f"impact {row + 1}, {time:.4g} s: {names} = {apart:.4g} m"


def _extent(run: Run, shown: list[Instant]) -> tuple[Array, Array]:
    """Return the corners of what is drawn (m); heights are above the line of the centres."""
    radius = max(body.radius for body in run.system.bodies)
    feet = [spring.foot for spring in run.system.springs]
    along = np.concatenate([*(one.places for one in shown), feet])
    top = max(spring.height for spring in run.system.springs)
    size = float(np.ptp(along)) + 2.0 * radius
    room = 0.07 * size
    low = np.array([np.min(along) - radius - room, -radius - room])
    return low, np.array([np.max(along) + radius + room, max(top, radius) + 0.8 * room])


def _set_axes(
    axes: Axes, low: Array, high: Array, size: tuple[float, float], scale: float, labelled: bool
) -> None:
    """Set both axes to one scale (mm per m) around the middle."""
    half = 0.5 * size[0] / scale
    middle = 0.5 * float(low[0] + high[0])
    axes.set_xlim(middle - half, middle + half)
    axes.set_ylim(float(low[1]), float(high[1]))
    across = number_ticks(middle - half, middle + half, size[0])
    along = vertical_ticks(float(low[1]), float(high[1]), size[1])
    axes.set_xticks(across.places, across.labels if labelled else [""] * len(across.labels))
    axes.set_yticks(along.places, along.labels)
    if labelled:
        axes.set_xlabel("$x$ [m]")
    scaled = rf"$10^{{{along.power}}}$ m" if along.power else "m"
    axes.set_ylabel(f"$y$ [{scaled}]", labelpad=1.0)


def _draw(axes: Axes, run: Run, one: Instant, size: tuple[float, float], scale: float) -> None:
    """Draw the trace, the bodies, their springs with feet and heights, and name them."""
    named: list[Named] = []
    drawn = [np.zeros((0, 2))]
    for number, (body, spring) in enumerate(
        zip(run.system.bodies, run.system.springs, strict=True), 1
    ):
        colour = str(body_look(number)["color"])
        place, speed = float(one.places[number - 1]), float(one.speeds[number - 1])
        foot, centre = np.array([spring.foot, spring.height]), np.array([place, 0.0])
        coil = _coil(foot, centre, 1.3 / scale)
        axes.plot(*coil.T, color=colour, linewidth=0.7, zorder=2.2)
        reach = 2.2 / scale
        axes.plot([foot[0] - reach, foot[0] + reach], [foot[1]] * 2, zorder=2.4, **_FOOT)
        upright = np.array([[foot[0] + _aside(run, number - 1) / scale, y] for y in (0.0, foot[1])])
        axes.plot(*upright.T, zorder=1.4, **_HEIGHT)
        shown = max(body.radius, _LEAST / scale)
        look: dict[str, Any] = {"facecolor": colour, "alpha": 0.35, "edgecolor": "none"}
        axes.add_patch(Circle((place, 0.0), shown, zorder=1.8, **look))
        edge: dict[str, Any] = {"facecolor": "none", "edgecolor": style.BLACK, "linewidth": 0.5}
        axes.add_patch(Circle((place, 0.0), shown, zorder=2.1, **edge))
        axes.plot(place, 0.0, marker="o", markersize=1.6, color=style.BLACK, zorder=4.0)
        axes.plot([place - reach, place + reach], [-body.radius] * 2, zorder=2.0, **_LINE)
        if speed:
            tip = (place + np.sign(speed) * (shown + 4.0 / scale), 0.0)
            axes.annotate("", tip, (place, 0.0), arrowprops=_ARROW, zorder=2.6)
            drawn.append(np.linspace([place, 0.0], tip, 20))
        named += [
            Named(rf"$C_{{{number}}}$", (place, 0.0)),
            Named(rf"$A_{{{number}}}$", (float(foot[0]), float(foot[1]))),
            Named(rf"$b_{{{number}}}$", _middle(upright), style.FRAME_GREY),
        ]
        drawn += [coil, centre + shown * _RING, np.linspace(upright[0], upright[1], 30)]
    write_names(axes, named, np.concatenate(drawn), size)


def _aside(run: Run, index: int) -> float:
    """Return how far aside of its foot the height of a spring is drawn (mm): at one place apart."""
    feet = [spring.foot for spring in run.system.springs]
    alike = [number for number, foot in enumerate(feet) if foot == feet[index]]
    return _APART * (alike.index(index) - 0.5 * (len(alike) - 1))


def _middle(ends: Array) -> tuple[float, float]:
    return float(ends[:, 0].mean()), float(ends[:, 1].mean())


def _coil(foot: Array, centre: Array, wide: float) -> Array:
    """Return the points of a spring between its foot and a centre (m)."""
    share = np.linspace(0.14, 0.86, 2 * _COILS + 1)
    along = centre - foot
    length = float(np.hypot(*along)) or 1.0
    side = np.array([-along[1], along[0]]) / length
    swing = np.where(np.arange(len(share)) % 2 == 0, wide, -wide)
    swing[[0, -1]] = 0.0
    points = foot + share[:, None] * along + swing[:, None] * side
    return np.concatenate([[foot], points, [centre]])
