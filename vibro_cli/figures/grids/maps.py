"""Maps of a grid over two of its axes: how runs end, and quantities of their summaries."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from vibro_cli.figures import style
from vibro_cli.figures.dots import draw_dots
from vibro_cli.figures.grids.parameter_map import (
    Categories,
    Endings,
    Lattice,
    Swept,
    lattice,
    set_axis,
)
from vibro_cli.figures.legend import LINE, text_width, wrapped_legend
from vibro_cli.figures.source import Array
from vibro_cli.figures.style import MM, WIDTHS
from vibro_cli.figures.ticks import Ticks, vertical_ticks

_HIGH = {"single": 52.0, "double": 72.0}
_TOP = 3.0
_BOTTOM = 9.0
_RIGHT = 4.0
_BAR = 10.5
"""Room for the bar of colours with its label, beside its numbers (mm)."""
_THICK = 2.5
"""Width of the bar (mm)."""
_LABEL = 6.5
"""Room for the label of the vertical axis and the ticks (mm)."""
_WIDE_RANGE = 50.0
_ROUNDING = 1e-9
"""Numbers that differ by less than this share of them have one colour."""
_LINE = 6.0
"""Least distance of two numbers of the bar (mm)."""


def ending_map(grid: Swept, width: str = "single") -> Figure | None:
    """Return how the runs end, a colour for each cause, over the two axes with the most values.

    None for a grid with fewer than two axes that change, or whose runs all end alike.
    """
    shown = lattice(grid, 2)
    if shown is None:
        return None
    endings = Endings.of(grid, shown.rows)
    if len(np.unique(endings.code)) == 1:
        return None
    return category_map(shown, width, endings)


def category_map(shown: Lattice, width: str, found: Categories) -> Figure:
    """Return a map over two axes with a colour for each category, named above it."""
    with style.journal():
        lines = wrapped_legend(None, found.entries(), WIDTHS[width])
        figure, axes = _panel(shown, width, lines * LINE, _RIGHT)
        _fill(axes, shown, found.code.astype(np.float64), found.colours(), found.norm())
        wrapped_legend(figure, found.entries(), WIDTHS[width])
    return figure


def quantity_map(
    grid: Swept, width: str, values: Array, label: str, least_log: float = _WIDE_RANGE
) -> Figure | None:
    """Return a quantity of the points over two axes, with a bar of its colours.

    `values` holds one number for each point of the grid, NaN where there is none; colours are
    logarithmic where they are positive and more than `least_log` apart. None for a grid with fewer
    than two axes that change, or without any number.
    """
    shown = lattice(grid, 2)
    if shown is None or not np.any(np.isfinite(values[shown.rows])):
        return None
    own = values[shown.rows]
    with style.journal():
        norm = _norm(own, least_log)
        ticks = _bar_ticks(norm, _HIGH[width])
        words = label
        if ticks.power:
            quantity, _, unit = label.partition(" [")
            words = f"{quantity} [$10^{{{ticks.power}}}${' ' + unit if unit else ']'}"
        room = _BAR + max(text_width(text) for text in ticks.labels)
        figure, axes = _panel(shown, width, 0.0, room)
        colours = style.time_colours()
        _fill(axes, shown, own, colours, norm)
        _draw_bar(figure, axes, ScalarMappable(norm, colours), words, ticks)
    return figure


def _norm(values: Array, least_log: float) -> Normalize:
    finite = values[np.isfinite(values)]
    low, high = float(np.min(finite)), float(np.max(finite))
    if high - low <= _ROUNDING * max(abs(low), abs(high)):
        return Normalize(low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(high) or 1.0))
    if low > 0.0 and high > least_log * low:
        return LogNorm(low, high)
    return Normalize(low, high)


def _panel(shown: Lattice, width: str, legend: float, right: float) -> tuple[Figure, Axes]:
    """Return a figure with its one panel, labelled, `right` mm left free beside it."""
    wide, high = WIDTHS[width], _HIGH[width]
    across, along = shown.coordinates
    edges = along.edges()
    ticks = along.ticks(float(edges[0]), float(edges[-1]), high, vertical=True)
    left = _LABEL + along.label_width(ticks)
    inner = wide - left - right
    total = _TOP + legend + high + _BOTTOM
    figure = Figure(figsize=(wide * MM, total * MM))
    axes = figure.add_axes((left / wide, _BOTTOM / total, inner / wide, high / total))
    set_axis(axes, across, inner, vertical=False)
    set_axis(axes, along, high, vertical=True)
    return figure, axes


def _fill(axes: Axes, shown: Lattice, values: Array, colours: Any, norm: Normalize) -> None:
    """Draw cells where every pair of values has its point, else the points."""
    across, along = shown.coordinates
    if not shown.is_full:
        size = float(np.clip(4000.0 / len(values), 0.6, 14.0))
        draw_dots(axes, across.place, along.place, values, colours, norm, size)
        return
    cells = shown.cells(values)
    mesh = axes.pcolormesh(across.edges(), along.edges(), cells, cmap=colours, norm=norm)
    mesh.set_rasterized(True)  # as vectors, seams would show between the cells
    axes.set_axisbelow(False)


def _bar_ticks(norm: Normalize, height: float) -> Ticks:
    """Return the ticks of the bar: round numbers or, of logarithmic colours, powers of ten."""
    low, high = float(norm.vmin or 0.0), float(norm.vmax or 0.0)
    if not isinstance(norm, LogNorm):
        return vertical_ticks(low, high, height)
    powers = range(math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9) + 1)
    if len(powers) < 2:
        return vertical_ticks(low, high, height)
    chosen = powers[:: max(1, math.ceil(len(powers) / (height / _LINE)))]
    return Ticks(tuple(10.0**n for n in chosen), tuple(rf"$10^{{{n}}}$" for n in chosen))


def _draw_bar(
    figure: Figure, axes: Axes, mappable: ScalarMappable, label: str, ticks: Ticks
) -> None:
    """Draw the bar of colours at the right of a panel."""
    box = axes.get_position()
    wide = figure.get_figwidth() / MM
    bar = figure.add_axes((box.x1 + 1.5 / wide, box.y0, _THICK / wide, box.height))
    drawn = figure.colorbar(mappable, cax=bar)
    drawn.set_ticks(ticks.places, labels=list(ticks.labels))
    drawn.set_label(label, labelpad=2.0)
    drawn.ax.tick_params(which="both", direction="out", left=False)
