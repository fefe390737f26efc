"""Dots of points: marks where there are few, pixels where there are very many."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize

from vibro_cli.figures.chart import MOST_VECTOR_POINTS
from vibro_cli.figures.source import Array
from vibro_cli.figures.style import MM

MOST_MARKS = 200_000
"""Of more points than this each is a pixel."""
_PIXEL = 0.06
"""Size of such a pixel (mm)."""


def draw_dots(
    axes: Axes, across: Array, along: Array, values: Array, colours: Any, norm: Normalize,
    size: float,
) -> None:  # fmt: skip
    """Draw a dot for each point in the colour of its value, later ones over earlier ones.

    The limits of the axes, which are linear, have to be set.
    """
    if len(values) <= MOST_MARKS:
        dots = axes.scatter(
            across, along, c=values, cmap=colours, norm=norm, s=size, linewidths=0.0, zorder=2.0
        )
        dots.set_rasterized(len(values) > MOST_VECTOR_POINTS)
        return
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    figure = axes.get_figure(root=True)
    assert figure is not None
    box = axes.get_position()
    wide, tall = np.array([box.width, box.height]) * figure.get_size_inches() / MM
    columns, rows = max(1, round(wide / _PIXEL)), max(1, round(tall / _PIXEL))
    with np.errstate(invalid="ignore"):
        column = np.floor((across - left) / (right - left) * columns)
        row = np.floor((along - low) / (high - low) * rows)
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    pixels = np.full((rows, columns), np.nan)
    pixels[row[inside].astype(np.int64), column[inside].astype(np.int64)] = values[inside]
    image = axes.imshow(
        pixels, cmap=colours, norm=norm, extent=(left, right, low, high), origin="lower",
        aspect="auto", interpolation="nearest", zorder=2.0,
    )  # fmt: skip
    image.set_rasterized(True)
    axes.set_xlim(left, right)
    axes.set_ylim(low, high)
