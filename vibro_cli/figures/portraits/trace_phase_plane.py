"""The phase plane along the whole trace: speed of the centre against arc length.

A family has such portraits side by side, for values of a parameter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from vibro_cli.analysis.levels import SpeedCurve, speed_curves, through_saddles
from vibro_cli.analysis.singular import FIGURE_EIGHT, Portrait
from vibro_cli.figures import style
from vibro_cli.figures.chart import number_plane
from vibro_cli.figures.labels import LINE, Entry, Named, draw_legend, rows_of, write_names
from vibro_cli.figures.portraits import layers
from vibro_cli.figures.portraits.layers import level_energies, saddle_energies, saddles_of
from vibro_cli.figures.portraits.panels import BOTTOM, LEFT, RIGHT
from vibro_cli.figures.source import Array
from vibro_cli.figures.style import MM, WIDTHS

_ABOVE = 1.35
"""Level curves go up to this multiple of the highest saddle or end of the trace."""
_MARGIN = 1.04
_DARK = 6
"""How much rather a name covers a level curve than a separatrix."""
_NEVER = 20
"""How much rather a name covers a level curve than the mark of a point."""
_STEP = 0.4
"""Distance of the points of a curve that names keep clear of (mm)."""
_MARK = 0.6
"""Half the size of such a mark (mm)."""
SPEED_AGAINST_PLACE = ("$s$", "m"), ("$v$", "m/s")
EIGHT: dict[str, Any] = {"color": style.VERMILLION, "linewidth": 1.0, "linestyle": "solid"}
JUNCTION: dict[str, Any] = {"color": style.LEVEL_GREY, "linewidth": 0.4, "linestyle": (0, (1, 2))}
REST: dict[str, Any] = {"color": style.SEPARATRIX_GREY, "linewidth": 1.6, "linestyle": "solid"}
"""A level line: the body stays at rest anywhere on it."""


@dataclass(frozen=True)
class Curves:
    """Level curves along the trace."""

    levels: tuple[SpeedCurve, ...]
    separatrices: tuple[SpeedCurve, ...]
    eights: tuple[SpeedCurve, ...]
    """The separatrices that are a figure eight."""

    @property
    def top(self) -> float:
        """The greatest speed on any of them (m/s)."""
        curves = (*self.levels, *self.separatrices, *self.eights)
        return max((float(np.max(curve.speed)) for curve in curves), default=1.0) or 1.0


def highest_energy(portrait: Portrait) -> float:
    """Return the energy (J) up to which level curves are drawn."""
    landscape = portrait.landscape
    pieces = landscape.trace.pieces
    ends = (pieces[0], pieces[0].angle_start), (pieces[-1], pieces[-1].angle_end)
    barriers = [float(landscape.potential(piece, position)) for piece, position in ends]
    barriers += [point.energy for point in portrait.points]
    scale = landscape.body.mass * landscape.gravity * landscape.trace.length
    return _ABOVE * max(barriers) or 0.1 * scale or landscape.body.mass


def curves_of(portrait: Portrait, count: int = 97) -> Curves:
    """Return level curves, separatrices and figure eights of a portrait, `count` points a piece."""
    landscape = portrait.landscape

    def all_of(energies: Sequence[float]) -> tuple[SpeedCurve, ...]:
        return tuple(
            curve for energy in energies for curve in speed_curves(landscape, energy, count)
        )

    eights = {one.saddle.energy: one for one in portrait.triggers if one.orbit == FIGURE_EIGHT}
    on_eight = tuple(
        curve
        for energy, trigger in eights.items()
        for curve in speed_curves(landscape, energy, count)
        if curve.s[0] <= trigger.saddle.s <= curve.s[-1]
    )
    singular = tuple(
        curve
        for energy in saddle_energies(portrait.points)
        for curve in _separatrices(portrait, energy, count)
    )
    others = tuple(
        curve for curve in singular if not any(_same(curve, eight) for eight in on_eight)
    )
    levels = all_of(level_energies(portrait.points, highest_energy(portrait)))
    return Curves(levels, others, on_eight)


def _separatrices(portrait: Portrait, energy: float, count: int) -> list[SpeedCurve]:
    """Return the curves of an energy (J) that go through a saddle of it."""
    curves = speed_curves(portrait.landscape, energy, count)
    spans = [(float(curve.s[0]), float(curve.s[-1])) for curve in curves]
    saddles = saddles_of(portrait.points, energy)
    kept = through_saddles(portrait.landscape, spans, saddles)
    return [curve for curve, is_one in zip(curves, kept, strict=True) if is_one]


def _same(one: SpeedCurve, other: SpeedCurve) -> bool:
    return np.array_equal(one.s, other.s) and np.allclose(one.speed, other.speed, rtol=1e-6)


def draw_along(axes: Axes, portrait: Portrait, curves: Curves, size: tuple[float, float]) -> None:
    """Draw a portrait along the trace on axes of a size (mm), with its singular points named."""
    length = portrait.landscape.trace.length
    axes.set_xlim(0.0, length)
    axes.set_ylim(-_MARGIN * curves.top, _MARGIN * curves.top)
    for piece in portrait.landscape.trace.pieces[1:]:
        axes.axvline(piece.start_s, zorder=0.9, **JUNCTION)
    for group, look, order in (
        (curves.levels, layers.LEVEL, 1.0),
        (curves.separatrices, layers.SEPARATRIX, 1.2),
        (curves.eights, EIGHT, 1.25),
    ):
        axes.add_collection(LineCollection(both_ways(group), zorder=order, **look), autolim=False)
    for point in portrait.points:
        if point.kind in layers.MARKER:
            axes.plot(point.s, 0.0, marker=layers.MARKER[point.kind], zorder=1.3, **layers.POINT)
        elif point.extent:
            axes.plot([point.s, point.s + point.extent], [0.0, 0.0], zorder=1.3, **REST)
    number_plane(axes, size, *SPEED_AGAINST_PLACE)


def both_ways(curves: Sequence[SpeedCurve]) -> list[Array]:
    """Return curves along the trace to the right and to the left, each of shape (n, 2)."""
    return [np.column_stack([one.s, way * one.speed]) for one in curves for way in (1, -1)]


def name_points(axes: Axes, portrait: Portrait, curves: Curves, size: tuple[float, float]) -> None:
    """Write the name of each singular point beside it."""
    scale = np.array([size[0], size[1]]) / [np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())]
    points = zip(portrait.names, portrait.points, strict=True)
    named = [Named(name, (point.s, 0.0)) for name, point in points if point.kind in layers.MARKER]
    if not named:
        return
    dark = (*curves.eights, *curves.separatrices) * _DARK
    lines = [line * scale for line in both_ways((*dark, *curves.levels))]
    marks = np.array([one.point for one in named]) * scale
    on_marks = [marks + _MARK * np.array(step) for step in product((-1.0, 0.0, 1.0), repeat=2)]
    obstacles = np.concatenate([*map(_evenly, lines), *on_marks * _NEVER])
    write_names(axes, named, obstacles / scale, size)


def _evenly(line: Array) -> Array:
    """Return points of a line (mm) at even distances: how many it has is to say how long it is."""
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
    at = np.arange(0.0, along[-1], _STEP)
    return np.column_stack([np.interp(at, along, values) for values in line.T])


MOST_MEMBERS = 12
_COLUMNS = {"single": 1, "double": 2}
_HIGH = 27.0
"""Height of a panel (mm)."""
_TITLE = 7.4
_LINE = 3.0


def family(members: Sequence[tuple[str, Portrait]], width: str = "single") -> Figure:
    """Return the portraits along the trace of a family, each under its title and its type.

    `members` are titles (`r = 0.05`) and portraits; of more than `MOST_MEMBERS` an even choice is
    drawn. Raises ValueError for no member.
    """
    if not members:
        raise ValueError("a family needs at least one portrait")
    step = math.ceil(len(members) / MOST_MEMBERS)
    shown = members[::step]
    drawn = [curves_of(portrait, 65) for _, portrait in shown]
    legend = rows_of(_entries([portrait for _, portrait in shown], drawn), WIDTHS[width] - RIGHT)
    columns = min(_COLUMNS[width], len(shown))
    rows = math.ceil(len(shown) / columns)
    cell = _TITLE + _HIGH + BOTTOM
    above_all = LINE * len(legend) + 1.0
    wide, high = WIDTHS[width], above_all + rows * cell
    size = (wide / columns - LEFT - RIGHT, _HIGH)
    with style.journal():
        figure = Figure(figsize=(wide * MM, high * MM))
        draw_legend(figure, legend)
        for number, ((title, portrait), curves) in enumerate(zip(shown, drawn, strict=True)):
            row, column = divmod(number, columns)
            left = column * wide / columns + LEFT
            bottom = high - above_all - row * cell - _TITLE - _HIGH
            axes = figure.add_axes((left / wide, bottom / high, size[0] / wide, size[1] / high))
            draw_along(axes, portrait, curves, size)
            name_points(axes, portrait, curves, size)
            over = (bottom + _HIGH + 1.0) / high
            words = _named_points(portrait)
            figure.text(left / wide, over, words, fontsize=style.SMALL, va="baseline")
            above = over + _LINE / high
            figure.text(left / wide, above, title, fontsize=style.TEXT, va="baseline")
    return figure


def _entries(portraits: Sequence[Portrait], drawn: Sequence[Curves]) -> list[Entry]:
    """Return the legend of what is drawn in some panel."""
    points = [point for portrait in portraits for point in portrait.points]
    entries = [
        (any(curves.eights for curves in drawn), ("figure eight", EIGHT)),
        (any(curves.separatrices for curves in drawn), ("separatrix", layers.SEPARATRIX)),
        (any(curves.levels for curves in drawn), ("level", layers.LEVEL)),
        *((True, entry) for entry in layers.point_entries(points)),
        (any(point.extent for point in points), ("level line", REST)),
    ]
    return [entry for is_drawn, entry in entries if is_drawn]


def _named_points(portrait: Portrait) -> str:
    """Return the type with names for kinds of points, which are written beside them."""
    return "; ".join([", ".join(portrait.names), *portrait.type.split("; ")[1:]])
