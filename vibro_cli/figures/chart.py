"""Charts: stacked panels, axes, line styles of bodies, dots for very many points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from vibro_cli.figures import style
from vibro_cli.figures.labels import Entry, draw_legend, room_for, rows_of, short_number
from vibro_cli.figures.source import Array, Integers, Recorded
from vibro_cli.figures.style import MM, Look, line, panel_size, width_of
from vibro_cli.figures.ticks import (
    CHARACTER,
    Ticks,
    angle_ticks,
    in_one_unit,
    label_axis,
    limits_apart,
    log_ticks,
    number_ticks,
    vertical_ticks,
)
from vibro_cli.kernels.numerics.constants import EPSILON

LEFT = 13.0
"""Room for the label and numbers of a vertical axis (mm)."""
RIGHT = 3.0
_BETWEEN = 3.0
_BOTTOM = 8.5
MOST_VECTOR_POINTS = 20000
"""Curves with more points than this are rasterised in PDF and SVG."""
_MOST_LOOKS = 12
"""Number of bodies with distinct line styles in the legend."""
WIDE_RANGE = 50.0
"""Ratio of greatest to least value above which axes and colours are logarithmic."""
_BELOW = 1.3
"""Room below the lowest number of a logarithmic axis (mm), clear of those of the other axis."""
_DASHES: tuple[Any, ...] = ("solid", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1.5, 1, 1.5)))
_COLOURS = (
    style.BLUE, style.VERMILLION, style.GREEN, style.PURPLE, style.ORANGE, style.SKY,
)  # fmt: skip
MOST_COLOURS = len(_COLOURS)
TOTAL = line(style.BLACK, 0.9)
BAND: Look = {"color": style.BAND_GREY, "linewidth": 0.0, "zorder": 0.5}
BAND_KEY = line(style.BAND_GREY, 4.0) | {"solid_capstyle": "butt"}
"""Legend style of the band."""
CONTACT_LABEL = "lasting contact"


def body_look(ball: int) -> Look:
    """Return the line style of a body (from 1): colour and dashes, distinguishable in grey."""
    return {
        "color": _COLOURS[(ball - 1) % len(_COLOURS)],
        "linestyle": _DASHES[(ball - 1) % len(_DASHES)],
        "linewidth": 0.8,
    }


class Sheet:
    """An empty figure of a given size (mm), on which panels are placed."""

    def __init__(self, wide: float, high: float) -> None:
        self.size = wide, high
        self.figure = Figure(figsize=(wide * MM, high * MM))

    def panel(self, left: float, bottom: float, wide: float, high: float) -> Axes:
        """Return a new panel; position of its lower left corner and size in mm."""
        width, height = self.size
        box = (left / width, bottom / height, wide / width, high / height)
        return self.figure.add_axes(box)

    def blank(self, left: float, bottom: float, wide: float, high: float) -> Axes:
        """Return a new panel without ticks and their numbers."""
        axes = self.panel(left, bottom, wide, high)
        axes.xaxis.set_visible(False)
        axes.yaxis.set_visible(False)
        return axes

    def write(self, left: float, bottom: float, text: str, **look: Any) -> None:
        """Write a text that begins at a point (mm from the lower left corner of the figure)."""
        width, height = self.size
        self.figure.text(left / width, bottom / height, text, **look)


class Cell(NamedTuple):
    """Size of a panel in a row of panels, and the room around it (mm)."""

    wide: float
    high: float
    over: float
    """Room above it, for words."""
    under: float
    beside: float
    """Room between it and the next panel."""


def in_rows(
    cell: Cell,
    number: int,
    columns: int,
    wide: float,
    left: float,
    above: float,
    below: float = 0.0,
) -> tuple[Sheet, list[tuple[float, float]]]:
    """Return a sheet for `number` panels in rows, and their lower left corners (mm).

    `wide` is the width of the sheet, `left` the room at its left edge, `above` and `below` the
    room over and under all panels.
    """
    row = cell.over + cell.high + cell.under
    total = above + math.ceil(number / columns) * row + below
    corners = []
    for place in range(number):
        line, column = divmod(place, columns)
        bottom = total - above - line * row - cell.over - cell.high
        corners.append((left + column * (cell.wide + cell.beside), bottom))
    return Sheet(wide, total), corners


def stacked(
    width: str, heights: Sequence[float], above: float = 5.5, entries: Sequence[Entry] = ()
) -> tuple[Figure, list[Axes]]:
    """Return a figure with panels of the given heights (mm), top to bottom.

    `above` is the room for one row of a legend (mm). The legend of `entries` is drawn and may take
    more rows.
    """
    wide = width_of(width)
    rows = rows_of(entries, wide - RIGHT) if entries else []
    above = room_for(rows, above)
    total = above + sum(heights) + _BETWEEN * (len(heights) - 1) + _BOTTOM
    sheet = Sheet(wide, total)
    panels = []
    top = total - above
    for high in heights:
        panels.append(sheet.panel(LEFT, top - high, wide - LEFT - RIGHT, high))
        top -= high + _BETWEEN
    draw_legend(sheet.figure, rows)
    return sheet.figure, panels


def time_axis(axes: Axes, end: float, labelled: bool = True, whole: float | None = None) -> None:
    """Set up a horizontal time axis from 0 to `end` (s) for a run of `whole` seconds.

    The label states which part is shown if that is not the whole run.
    """
    end = end if end > 0.0 else 1.0
    axes.set_xlim(0.0, end)
    ticks = _clear_of_edge(axes)
    part = "" if whole is None else first_part(end, whole)
    label_axis(axes.xaxis, ticks, "$t$", "s", labelled, part)


def first_part(end: float, whole: float) -> str:
    """Return words for a label if only the first `end` of `whole` seconds are shown, else ""."""
    if end >= whole:
        return ""
    return f", the first {short_number(end, 3)} s of {short_number(whole, 4)} s"


def _clear_of_edge(axes: Axes, whole: bool = False) -> Ticks:
    """Return ticks of a horizontal axis without labels that would extend beyond the figure."""
    (low, high), (width, _) = axes.get_xlim(), panel_size(axes)
    ticks, labels = number_ticks(low, high, width, whole), []
    for place, text in zip(ticks.places, ticks.labels, strict=True):
        room = (high - place) / (high - low) * width + RIGHT
        labels.append(text if room > 0.6 * CHARACTER * len(text) else "")
    return replace(ticks, labels=tuple(labels))


def count_axis(axes: Axes, numbers: Any, labelled: bool = True) -> None:
    """Set up a horizontal axis of impact numbers."""
    low, high = (0.5, float(np.max(numbers)) + 0.5) if len(numbers) else (0.5, 1.5)
    axes.set_xlim(low, high)
    if high - low < 8.0:
        numbers = range(1, int(high + 0.5))
        ticks = Ticks(tuple(map(float, numbers)), tuple(map(str, numbers)))
    else:
        ticks = _clear_of_edge(axes, whole=True)
    label_axis(axes.xaxis, ticks, "impact $n$", "", labelled)


def value_axis(axes: Axes, values: ArrayLike, symbol: str, unit: str, whole: bool = False) -> None:
    """Set up a vertical axis for values, of which those that are not finite are ignored.

    Ticks are round numbers, scaled by a power of ten if they are long; parts of π for angles
    (rad), and whole numbers for counts (`whole`).
    """
    low, high = limits_around(values)
    axes.set_ylim(low, high)
    height = panel_size(axes)[1]
    if unit == "rad":
        ticks = angle_ticks(low, high, height, vertical=True)
    else:
        ticks = vertical_ticks(low, high, height, whole)
    label_axis(axes.yaxis, ticks, symbol, unit)


def limits_around(values: ArrayLike) -> tuple[float, float]:
    """Return limits, with a margin, of an axis for values; ignore those that are not finite.

    Values that are equal up to rounding lie in the middle.
    """
    finite = np.asarray(values, dtype=np.float64)
    finite = finite[np.isfinite(finite)]
    low, high = (float(np.min(finite)), float(np.max(finite))) if len(finite) else (0.0, 1.0)
    if not high - low > 4.0 * EPSILON * max(abs(low), abs(high)):
        low, high = low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(high) or 1.0)
    low, high = limits_apart(low, high)
    room = 0.06 * (high - low)
    return low - room, high + room


def plane_axes(axes: Axes, low: Array, high: Array, labelled: bool = True, after: str = "") -> None:
    """Set up both axes of a plane in m, from the corner `low` to the corner `high`.

    Without `labelled`, the horizontal axis has ticks but neither numbers nor a name; `after` is
    appended to the name.
    """
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    number_plane(axes, ("$x$", "m"), ("$y$", "m"), labelled, after)


def number_plane(
    axes: Axes,
    across: tuple[str, str],
    along: tuple[str, str],
    labelled: bool = True,
    after: str = "",
    larger: float = 1.0,
) -> None:
    """Label both axes of a plane whose limits are set.

    `across` and `along` are symbols and units; `after` is appended to the horizontal label. Two
    axes with the same unit share a power of ten. `larger` is the magnification of letters.
    """
    wide, high = panel_size(axes)
    across_ticks = number_ticks(*axes.get_xlim(), wide / larger)
    along_ticks = vertical_ticks(*axes.get_ylim(), high / larger)
    if across[1] == along[1]:
        across_ticks, along_ticks = in_one_unit(across_ticks, along_ticks)
    label_axis(axes.xaxis, across_ticks, *across, labelled, after)
    label_axis(axes.yaxis, along_ticks, *along)


def positive_axis(axes: Axes, values: Array, symbol: str, unit: str) -> None:
    """Set up a vertical axis of non-negative values: logarithmic for a wide range, else from 0."""
    positive = values[np.isfinite(values) & (values > 0.0)]
    if len(positive) and is_wide(positive):
        log_axis(axes, positive, symbol, unit)
    else:
        value_axis(axes, np.append(positive, 0.0), symbol, unit)


def is_wide(values: Array) -> bool:
    """Return whether values are positive and their range is wide enough for a logarithmic axis."""
    return bool(0.0 < WIDE_RANGE * np.min(values) < np.max(values))


def log_axis(axes: Axes, values: Array, symbol: str, unit: str) -> None:
    """Set up a logarithmic vertical axis for positive values, between two powers of ten."""
    positive = values[np.isfinite(values) & (values > 0.0)]
    low, high = (float(np.min(positive)), float(np.max(positive))) if len(positive) else (0.1, 1.0)
    bottom, top = np.floor(np.log10(low) - 0.05), np.ceil(np.log10(high) + 0.05)
    _, height = panel_size(axes)
    below = _BELOW / (height - _BELOW) * (top - bottom)
    limits = float(10.0 ** (bottom - below)), float(10.0**top)
    axes.set_yscale("log")
    axes.set_ylim(limits)
    label_axis(axes.yaxis, log_ticks(*limits, height, vertical=True), symbol, unit)


def contact_times(run: Recorded) -> list[tuple[float, float]]:
    """Return the time spans (s) of lasting contact of any bodies; join adjacent spans."""
    flights = run.flights()
    rows = np.flatnonzero(flights["contact"])
    return joined(
        zip(flights["t_start"][rows].tolist(), flights["t_end"][rows].tolist(), strict=True)
    )


def joined(spans: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return time spans in order, with those that touch or overlap merged."""
    found: list[tuple[float, float]] = []
    for start, end in sorted(spans):
        if found and start <= found[-1][1]:
            found[-1] = (found[-1][0], max(end, found[-1][1]))
        else:
            found.append((start, end))
    return found


def draw_contacts(axes: Axes, spans: Sequence[tuple[float, float]]) -> None:
    """Draw the bands of lasting contact behind a chart over time."""
    for start, end in spans:
        axes.axvspan(start, end, **BAND)


def band_entry(spans: Sequence[tuple[float, float]]) -> list[Entry]:
    """Return the legend entry of the bands, if there are any."""
    return [(CONTACT_LABEL, BAND_KEY)] if spans else []


def body_entries(run: Any, most: int = _MOST_LOOKS) -> list[Entry]:
    """Return the legend entries of the bodies, or of the first `most` if there are more."""
    number = len(run.system.bodies)
    shown = range(1, min(number, most) + 1)
    entries = [
        (f"body {ball}" if number <= 3 or ball == 1 else str(ball), body_look(ball))
        for ball in shown
    ]
    return entries if number <= most else [*entries, ("…", {"linestyle": "none"})]


_MERGED = 1.0
"""Lines closer than this (mm) would merge into a grey surface."""


def distinct_lines(
    places: Iterable[float], limits: tuple[float, float], length: float
) -> list[float]:
    """Return the places within limits of an axis of a length (mm), none if lines would merge."""
    seen = [place for place in places if limits[0] <= place <= limits[1]]
    return seen if len(seen) * _MERGED <= length else []


MANY = " If there are very many impacts, those at the same spot are drawn as one dot."
"""Sentence for the captions of figures whose marks are `last_in_each_pixel`."""
MOST_MARKS = 200_000
"""Number of points above which each is drawn as a pixel."""


def draw_dots(
    axes: Axes, across: Array, along: Array, values: Array, colours: Any, norm: Normalize,
    size: float, edge: float = 0.0,
) -> None:  # fmt: skip
    """Draw a dot for each point in the colour of its value, later ones over earlier ones.

    The limits and scales of the axes must be set. `edge` is the width (pt) of the edges of dots.
    """
    if len(values) <= MOST_MARKS:
        dots = axes.scatter(
            across, along, c=values, cmap=colours, norm=norm, s=size, zorder=2.0,
            linewidths=edge, edgecolors=style.FRAME_GREY,
        )  # fmt: skip
        dots.set_rasterized(len(values) > MOST_VECTOR_POINTS)
    else:
        draw_by_colour(axes, across, along, values, ScalarMappable(norm, colours), marker=",")


def draw_by_colour(
    axes: Axes, across: Array, along: Array, values: Array, colours: ScalarMappable, **look: Any
) -> None:
    """Draw very many marks in the colours of their values, later ones over those in their pixel.

    All marks of one colour are one line, since matplotlib draws these several times as fast as
    marks that each have a colour. The limits and scales of the axes must be set.
    """
    rows = last_in_each_pixel(axes, across, along)
    across, along, values = across[rows], along[rows], values[rows]
    shades = colours.to_rgba(values, bytes=True)
    codes = shades.view(np.uint32).ravel()
    _, first, code = np.unique(codes, return_index=True, return_inverse=True)
    for number in np.argsort(values[first]).tolist():
        own, colour = code == number, shades[first[number]] / 255.0
        axes.plot(across[own], along[own], linestyle="none", color=colour, rasterized=True, **look)


def last_in_each_pixel(axes: Axes, across: Array, along: Array) -> Integers:
    """Return the rows of the points that are the last in their pixel of the figure.

    Without those that are not finite. The limits and scales of the axes must be set.
    """
    places = axes.transData.transform(np.column_stack([across, along]))
    finite = np.flatnonzero(np.isfinite(places).all(axis=1))
    column, row = np.floor(places[finite]).astype(np.int64).T
    _, last = np.unique((column * (1 << 20) + row)[::-1], return_index=True)
    return finite[np.sort(len(finite) - 1 - last)]
