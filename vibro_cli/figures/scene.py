"""The scene: the trace to scale with its pieces, and the bodies where they start (A fig. 2a)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from vibro_cli.figures import style
from vibro_cli.figures.chart import body_look
from vibro_cli.figures.plan import trace_points
from vibro_cli.figures.source import Array, Recorded
from vibro_cli.figures.style import MM, WIDTHS
from vibro_cli.figures.ticks import number_ticks, vertical_ticks
from vibro_cli.mechanics.trace import Piece

_LEFT = 11.0
_RIGHT = 3.0
_TOP = 2.0
_BOTTOM = 8.5
_HIGHEST = 70.0
_LOWEST = 20.0
_WORDS = 7.0
"""Room for numbers around what is drawn (mm)."""
_AWAY = 3.2
"""Distance of the number of a piece from the trace (mm)."""
_LEAST = 0.5
"""Least radius of a body that is drawn (mm)."""
_SURFACE: dict[str, Any] = {"color": style.BLACK, "linewidth": 0.8}
_JUNCTION: dict[str, Any] = {"color": style.BLACK, "marker": "o", "markersize": 2.2}
_ARROW: dict[str, Any] = {
    "arrowstyle": "-|>",
    "color": style.BLACK,
    "linewidth": 0.7,
    "shrinkA": 0.0,
    "shrinkB": 0.0,
}
_SAY: dict[str, Any] = {"fontsize": style.SMALL, "ha": "center", "va": "center"}


def scene(run: Recorded, width: str = "single") -> Figure:
    """Return the trace to scale, its pieces and bodies numbered, the bodies at the start.

    Raises ValueError for a width that is neither `single` nor `double`.
    """
    if width not in WIDTHS:
        raise ValueError(f"unknown width {width!r}, expected one of {', '.join(WIDTHS)}")
    surface = trace_points(run.system.trace)
    low, high = _extent(run, surface)
    inner = WIDTHS[width] - _LEFT - _RIGHT
    scale = float(np.min((np.array([inner, _HIGHEST]) - _WORDS) / (high - low)))
    tall = max(scale * float(high[1] - low[1]) + _WORDS, _LOWEST)
    total = _TOP + tall + _BOTTOM
    with style.journal():
        figure = Figure(figsize=(WIDTHS[width] * MM, total * MM))
        box = (_LEFT / WIDTHS[width], _BOTTOM / total, inner / WIDTHS[width], tall / total)
        axes = figure.add_axes(box)
        _set_axes(axes, 0.5 * (low + high), np.array([inner, tall]), scale)
        axes.plot(surface[:, 0], surface[:, 1], zorder=2.0, **_SURFACE)
        for piece in run.system.trace.pieces:
            _draw_piece(axes, piece, scale)
        axes.plot(*surface[-1], zorder=2.2, linestyle="none", **_JUNCTION)
        _draw_bodies(axes, run, scale)
    return figure


def _extent(run: Recorded, surface: Array) -> tuple[Array, Array]:
    room = 2.1 * max(body.radius for body in run.system.bodies)
    room = max(room, 0.04 * float(np.max(np.ptp(surface, axis=0))))
    return surface.min(axis=0) - room, surface.max(axis=0) + room


def _set_axes(axes: Axes, middle: Array, size: Array, scale: float) -> None:
    """Set both axes to one scale (mm per m) around the middle."""
    half = 0.5 * size / scale
    low, high = middle - half, middle + half
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    across = number_ticks(float(low[0]), float(high[0]), float(size[0]))
    along = vertical_ticks(float(low[1]), float(high[1]), float(size[1]))
    axes.set_xticks(across.places, across.labels)
    axes.set_yticks(along.places, along.labels)
    axes.set_xlabel("$x$ [m]")
    scaled = rf"$10^{{{along.power}}}$ m" if along.power else "m"
    axes.set_ylabel(f"$y$ [{scaled}]", labelpad=1.0)


def _draw_piece(axes: Axes, piece: Piece, scale: float) -> None:
    """Mark where a piece begins, and write its number below the trace at its middle."""
    begins = piece.contact_point(piece.angle_start)
    axes.plot(*begins, zorder=2.2, linestyle="none", **_JUNCTION)
    middle = 0.5 * (piece.angle_start + piece.angle_end)
    slope = piece.slope(middle)
    below = np.array([np.sin(slope), -np.cos(slope)]) * _AWAY / scale
    place = np.array(piece.contact_point(middle)) + below
    halo = [patheffects.withStroke(linewidth=1.4, foreground="white")]
    look = _SAY | {"color": style.FRAME_GREY, "fontstyle": "italic"}
    words = str(piece.index + 1)
    axes.text(float(place[0]), float(place[1]), words, path_effects=halo, zorder=3.0, **look)


def _draw_bodies(axes: Axes, run: Recorded, scale: float) -> None:
    pieces = run.system.trace.pieces
    for number, (body, state) in enumerate(
        zip(run.system.bodies, run.system.initial, strict=True), 1
    ):
        piece = pieces[state.piece]
        centre = np.array(piece.body_center(state.position, body.radius))
        radius = max(body.radius, _LEAST / scale)
        look: dict[str, Any] = {"facecolor": body_look(number)["color"], "linewidth": 0.5}
        axes.add_patch(Circle(tuple(centre), radius, edgecolor=style.BLACK, zorder=2.5, **look))
        slope = piece.slope(state.position)
        inside = np.array([-np.sin(slope), np.cos(slope)])
        place = centre + inside * (radius + 2.0 / scale)
        halo = [patheffects.withStroke(linewidth=1.4, foreground="white")]
        where = float(place[0]), float(place[1])
        axes.text(*where, str(number), path_effects=halo, zorder=3.0, **_SAY)
        if state.speed:
            along = np.sign(state.speed) * np.array([np.cos(slope), np.sin(slope)])
            tip = centre + along * (radius + 4.0 / scale)
            axes.annotate("", tuple(tip), tuple(centre), arrowprops=_ARROW, zorder=2.6)
