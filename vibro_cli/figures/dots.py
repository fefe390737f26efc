"""Dots of points: marks where there are few, pixels where there are very many."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, Normalize, to_rgba
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from vibro_cli.figures.chart import MOST_VECTOR_POINTS
from vibro_cli.figures.source import Array, Integers
from vibro_cli.figures.style import MM

MANY = " Of very many impacts those that fall on one spot are one dot."
"""What a caption says of marks that are drawn by :func:`draw_marks`."""
MOST_MARKS = 200_000
"""Of more points than this each is a pixel."""
_PIXEL = 0.06
"""Size of such a pixel (mm)."""
_POINT = 25.4 / 72.0
"""A typographic point (mm)."""
_CELLS = (5120, 1024)
"""Halves of such pixels across and along the widest chart over time."""
_AT_ONCE = 1 << 18
_EDGE = 1e-9
"""Share of the axes by which rounding may move a point over their edge."""


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
    pixels = _pixels(axes, across, along, values)
    _show(axes, pixels, cmap=colours, norm=norm)


def draw_marks(
    axes: Axes, across: Array, along: Array, diameter: float, colour: str | Colormap
) -> None:
    """Draw round marks of very many points: those that fall in one pixel are drawn once.

    Parameters
    ----------
    axes
        With its limits, on whatever scales.
    across, along
        Coordinates, shape (points,); those that are not finite are left out.
    diameter
        Of a mark, in points.
    colour
        Of all, or the colours of their numbers, in which later ones lie over earlier ones.
    """
    numbers = np.arange(1.0, len(across) + 1.0)
    pixels = _spread(_pixels(axes, across, along, numbers), 0.5 * diameter * _POINT / _PIXEL)
    there = np.isfinite(pixels)
    shown = np.zeros((*pixels.shape, 4), dtype=np.uint8)
    if isinstance(colour, Colormap):
        # As bytes: values would be resampled as doubles, and masked.
        share = (pixels[there] - 1.0) / max(len(across) - 1, 1)
        shown[there] = colour(share, bytes=True)
    else:
        shown[there] = np.round(255.0 * np.array(to_rgba(colour)))
    _show(axes, shown)


def told_apart(across: Array, values: Array) -> Integers:
    """Return the rows of points that a chart can tell apart, with its values on a logarithmic axis.

    Of those within half a pixel the last one. Values are not negative; 0 is apart from all others.
    """
    columns, rows = _CELLS
    positive = (values > 0.0) & np.isfinite(values)
    low = math.log10(np.min(values, where=positive, initial=np.inf))
    high = math.log10(np.max(values, where=positive, initial=0.0))
    start, end = float(np.min(across)), float(np.max(across))
    last = np.full(columns * rows, -1, dtype=np.int64)
    for first in range(0, len(values), _AT_ONCE):
        some = np.arange(first, min(first + _AT_ONCE, len(values)))
        column = (across[some] - start) * ((columns - 1) / ((end - start) or 1.0))
        height = np.log10(values[some], where=positive[some], out=np.full(len(some), low))
        row = 1.0 + (height - low) * ((rows - 2) / ((high - low) or 1.0))
        row[~positive[some]] = 0.0
        last[column.astype(np.int64) * rows + row.astype(np.int64)] = some
    return last[last >= 0]


def _pixels(axes: Axes, across: Array, along: Array, values: Array) -> Array:
    """Return the pixels of axes, rows from below: the value of the last point in each, or nan."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    box = axes.get_position()
    wide, tall = np.array([box.width, box.height]) * figure.get_size_inches() / MM
    columns, rows = max(1, round(wide / _PIXEL)), max(1, round(tall / _PIXEL))
    pixels = np.full((rows, columns), np.nan)
    to_axes = axes.transData + axes.transAxes.inverted()
    for first in range(0, len(values), _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        with np.errstate(invalid="ignore", divide="ignore"):
            place = to_axes.transform(np.column_stack([across[some], along[some]]))
            inside = np.all((place >= -_EDGE) & (place <= 1.0 + _EDGE), axis=1)
        column, row = np.floor(place[inside] * (columns, rows)).astype(np.int64).T
        pixels[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)] = values[some][inside]
    return pixels


def _spread(pixels: Array, radius: float) -> Array:
    """Return pixels each spread over a disc, of a radius in pixels; the greatest value stays."""
    reach = int(radius)
    rows, columns = pixels.shape
    room = np.full((rows + 2 * reach, columns + 2 * reach), -np.inf)
    room[reach : reach + rows, reach : reach + columns] = np.nan_to_num(pixels, nan=-np.inf)
    spread = np.full_like(pixels, -np.inf)
    for up in range(-reach, reach + 1):
        for right in range(-reach, reach + 1):
            if up * up + right * right <= radius * radius:
                moved = room[reach + up :, reach + right :][:rows, :columns]
                np.maximum(spread, moved, out=spread)
    spread[spread == -np.inf] = np.nan
    return spread


def _show(axes: Axes, pixels: NDArray[Any], **look: Any) -> None:
    """Draw pixels that fill axes: values with their colours, or red, green, blue and opacity."""
    image = AxesImage(
        axes, extent=(0.0, 1.0, 0.0, 1.0), origin="lower", interpolation="nearest",
        transform=axes.transAxes, zorder=2.0, **look,
    )  # fmt: skip
    image.set_data(pixels)
    image.set_rasterized(True)
    axes.add_artist(image)
