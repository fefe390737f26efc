"""Maps of a grid over two of its axes: how runs end, quantities of their summaries.

Each end cause has a colour, distinguishable in grey, too.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis, YAxis
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vibro_cli.analysis.basins import Codes, codes_of, combined
from vibro_cli.figures import style
from vibro_cli.figures.chart import WIDE_RANGE, Sheet, draw_dots
from vibro_cli.figures.labels import LINE, Entry, draw_legend, rows_of, short_number, text_width
from vibro_cli.figures.source import Array, Integers, kept
from vibro_cli.figures.style import MM, mark, panel_size, width_of
from vibro_cli.figures.ticks import (
    LEAST,
    Ticks,
    angle_ticks,
    axis_words,
    decimals,
    label_axis,
    log_ticks,
    number_ticks,
    vertical_ticks,
)
from vibro_cli.scenario.fields import written

if TYPE_CHECKING:
    from vibro_cli.storage.stored import StoredGrid

_MOST_WORDS = 20
_EVEN = 1.0e-6
_FEW = 8
"""Range of whole numbers below which each number has its own colour."""
_SHADES = 256
"""Number of colours from which these are chosen."""


_ENTRY = re.compile(r"(balls|bodies|arcs|pairs)\[(\d+)\]")
_ENTRIES = {"balls": "body", "bodies": "body", "arcs": "arc", "pairs": "pair"}
_WORDS = {
    "k": "coefficient of restitution $k$",
    "gravity": "gravity $g$",
    "angle": "initial angle",
    "position": "initial position",
    "speed": "initial speed",
    "omega": "initial angular velocity",
    "end_slope": "end slope",
    "start_slope": "slope at the left end",
    "rate": "initial angular rate",
    "turning": "rotation",
}
_WHOLE = {
    "trace.turning.rate": "rate of rotation",
    "stop.time": "stop time",
    "stop.collisions": "number of impacts at the stop",
    "stop.bounces": "number of impacts on the wall at the stop",
}
_LEFT_OUT = ("collision", "trace")


def words_of(path: str) -> str:
    """Return a key path in words: "initial angle of body 1" for `balls[1].angle`."""
    if path in _WHOLE:
        return _WHOLE[path]
    names = []
    for part in reversed(path.split(".")):
        entry = _ENTRY.fullmatch(part)
        if entry is not None:
            names.append(f"{_ENTRIES[entry[1]]} {entry[2]}")
        elif part not in _LEFT_OUT or not names:
            names.append(_WORDS.get(part, part.replace("_", " ")))
    return " of ".join(names)


@dataclass(frozen=True)
class Coordinate:
    """An axis of a grid as an axis of a figure, of numbers or of words."""

    path: str
    unit: str
    place: Array
    """Coordinate of each point; shape (points,)."""
    words: tuple[str, ...]
    """The words at places 0, 1, …; empty for numbers."""
    symbol: str = ""
    """Label of the axis; if empty, the path in words."""
    logarithmic: bool = False
    """Whether the axis of the figure is logarithmic; all numbers then have the same sign."""
    decimal: bool = False
    """Whether angles are labelled by decimal numbers even where parts of π would do."""

    @cached_property
    def different(self) -> Array:
        """The distinct places, ascending."""
        return np.unique(self.place)

    @property
    def is_even(self) -> bool:
        """Whether the axis has evenly spaced numbers."""
        steps = np.diff(self.different)
        even = np.allclose(steps, np.mean(steps), rtol=_EVEN, atol=0.0)
        return not self.words and bool(even)

    def edges(self) -> Array:
        """Return the edges of the cells around the distinct places, halfway to the neighbours.

        On a logarithmic axis, halfway is meant on that scale.
        """
        places = self.different
        if len(places) == 1:
            around: Array = places[0] + np.array([-0.5, 0.5]) * (abs(float(places[0])) or 1.0)
            return around
        if self.logarithmic:
            exponents = replace(self, place=np.log(np.abs(places)), logarithmic=False).edges()
            return np.sort(np.sign(places[0]) * np.exp(exponents))
        middles = 0.5 * (places[1:] + places[:-1])
        first, last = 2.0 * places[0] - middles[0], 2.0 * places[-1] - middles[-1]
        return np.concatenate([[first], middles, [last]])

    @property
    def limits(self) -> tuple[float, float]:
        """The outer edges of the first and the last cell."""
        edges = self.edges()
        return float(edges[0]), float(edges[-1])

    def ticks(self, low: float, high: float, length: float, vertical: bool) -> Ticks:
        """Return the ticks of an axis of a given length (mm)."""
        if self.words:
            return Ticks(tuple(map(float, range(len(self.words)))), self.words)
        if self.logarithmic:
            return log_ticks(low, high, length, vertical)
        numbers = (vertical_ticks if vertical else number_ticks)(low, high, length)
        if self.unit != "rad" or self.decimal:
            return numbers
        parts = angle_ticks(low, high, length, vertical)
        return parts if len(parts.places) >= LEAST else numbers


@dataclass(frozen=True)
class ParameterMap:
    """The points of a grid that a figure shows."""

    rows: Integers
    """Rows of the points in the summary."""
    coordinates: tuple[Coordinate, ...]
    """One or two axes."""
    fixed: tuple[tuple[str, str], ...]
    """Paths of the other axes, and the value at which each is held."""

    @property
    def is_full(self) -> bool:
        """Whether there is exactly one point for every combination of values of the axes."""
        count = len(self.rows)
        if count != math.prod(len(one.different) for one in self.coordinates):
            return False  # of a sample, every value of an axis is different: too many cells
        return not np.any(np.isnan(self.cells(np.zeros(count))))

    def cells(self, values: Array) -> Array:
        """Return one value per point as an array of cells, NaN where there is no point.

        The first coordinate runs along the last axis of the array.
        """
        cells = np.full([len(one.different) for one in reversed(self.coordinates)], np.nan)
        at = [np.searchsorted(one.different, one.place) for one in reversed(self.coordinates)]
        cells[tuple(at)] = values
        return cells

    @property
    def held(self) -> str:
        """The values at which the other axes are held, as text."""
        return ", ".join(f"{path} = {value}" for path, value in self.fixed)


@kept
def parameter_map(
    grid: StoredGrid, dimensions: int, numbers_first: bool = False
) -> ParameterMap | None:
    """Return the points over the axes with the most values; hold others at their first value.

    Of the chosen axes, the one that comes first in the grid is horizontal. Axes that change
    together count as one: the first that determines the others. With `numbers_first`, only axes of
    numbers are chosen. Returns None if too few axes change.
    """
    columns = {path: grid.summary[path] for path in grid.axes}
    found = {path: codes_of(values) for path, values in columns.items()}
    independent = _independent(found)
    changing = [path for path in independent if found[path].max() > 0]
    if numbers_first:
        changing = [path for path in changing if columns[path].dtype != object]
    if len(changing) < dimensions:
        return None
    chosen = sorted(changing, key=lambda path: -found[path].max())[:dimensions]
    # An axis that the chosen ones determine is not held, so that all points of a sample are shown.
    place = combined([found[path] for path in chosen])
    rest = [
        path for path in independent if path not in chosen and not _determines(place, found[path])
    ]
    first = {path: columns[path][0] for path in rest}
    mask = np.ones(len(place), dtype=np.bool_)
    for path in rest:
        mask &= columns[path] == first[path]
    rows = np.flatnonzero(mask)
    fixed = tuple(
        (path, f"{_shown(first[path])} {written(grid.units.get(path, ''))}".rstrip())
        for path in rest
    )
    coordinates = tuple(_coordinate(grid, path, rows) for path in changing if path in chosen)
    return ParameterMap(rows, coordinates, fixed)


def _independent(columns: Mapping[str, Codes]) -> list[str]:
    """Return the axes that no other axis determines; of two equivalent axes, the first.

    An axis with a different value at each point, such as that of a sample, determines no other.
    """
    kept = dict(columns)
    for path, one in reversed(list(columns.items())):
        others = [columns[other] for other in kept if other != path]
        if any(other.max() + 1 < len(other) and _determines(other, one) for other in others):
            del kept[path]
    return list(kept)


def _determines(one: Codes, other: Codes) -> bool:
    """Return whether `one` determines `other`, which must not be constant."""
    partner = np.empty(one.max() + 1, dtype=np.int64)
    partner[one] = other
    return bool(other.max() > 0) and np.array_equal(partner[one], other)


def _shown(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float | np.floating) else str(value)


def _coordinate(grid: StoredGrid, path: str, rows: Integers) -> Coordinate:
    values, unit = grid.summary[path][rows], grid.units[path]
    if values.dtype != object:
        logarithmic = path in grid.logarithmic
        return Coordinate(path, unit, values.astype(np.float64), (), logarithmic=logarithmic)
    words, first, code = np.unique(values.astype(str), return_index=True, return_inverse=True)
    order = np.argsort(first)  # the order in the grid
    place = np.argsort(order)[code].astype(np.float64)
    return Coordinate(path, unit, place, tuple(map(str, words[order][:_MOST_WORDS])))


def set_axis(
    axis: Axis,
    one: Coordinate,
    labelled: bool = True,
    limits: tuple[float, float] | None = None,
) -> None:
    """Set limits, ticks and, if `labelled`, the label of an axis of a figure.

    The default limits are those of the cells around the places.
    """
    low, high = one.limits if limits is None else limits
    vertical = isinstance(axis, YAxis)
    (axis.axes.set_ylim if vertical else axis.axes.set_xlim)(low, high)
    if one.logarithmic:
        scale = axis.axes.set_yscale if vertical else axis.axes.set_xscale
        if low > 0.0:
            scale("log")
        else:
            scale("symlog", linthresh=-high)  # linear only beyond the axis
    ticks = one.ticks(low, high, panel_size(axis.axes)[vertical], vertical)
    label_axis(axis, ticks, one.symbol or words_of(one.path), one.unit, labelled)


COLOURS = {
    "time": "#F0E442",
    "collisions": "#7CC7F0",
    "bounces": "#9FD9B4",
    "no_more_collisions": "#00579A",
    "rest": "#f0f0f0",
    "end_of_trace": style.ORANGE,
    "inadmissible": "#C04A00",
    "lift_off": style.PURPLE,
    "wall_contact": "#3A1466",
    "accumulation": "#00463A",
    "invalid": "#7a7a7a",
    "failed": "#000000",
}
"""Colours of end causes and statuses: similar to Okabe and Ito's, each with its own grey."""
WORDS = {
    "time": "stop time reached",
    "collisions": "number of impacts reached",
    "bounces": "number of impacts on the wall reached",
    "no_more_collisions": "no more impacts",
    "inadmissible": "inadmissible impact",
}
"""Names of end causes that are not self-explanatory."""


@dataclass(frozen=True)
class Categories:
    """The categories of some points, each with a colour and a name."""

    code: Integers
    """Index of the category of each point."""
    names: tuple[str, ...]
    """Names in the legend, with the numbers or shares of points."""
    palette: tuple[str, ...]
    """Colour of each category."""

    def colours(self) -> ListedColormap:
        """Return the map from codes to colours."""
        return ListedColormap(self.palette)

    def norm(self) -> BoundaryNorm:
        """Return the bounds of the codes."""
        number = len(self.palette)
        return BoundaryNorm(np.arange(number + 1) - 0.5, number)

    def entries(self) -> list[Entry]:
        """Return the entries of the legend."""
        patches = [mark("s", 4.5, colour, style.FRAME_GREY, 0.3) for colour in self.palette]
        return list(zip(self.names, patches, strict=True))


def ended(grid: StoredGrid) -> NDArray[Any]:
    """Return the end cause of each point's run, or its status if that is not "ok"."""
    summary = grid.summary
    return np.where(summary["status"] == "ok", summary["end_cause"], summary["status"])


def endings(grid: StoredGrid, rows: Integers) -> Categories:
    """Return the end causes of the points in the given rows of the summary, as categories."""
    found = ended(grid)[rows]
    causes = [name for name in COLOURS if np.any(found == name)]
    each = np.array([found == name for name in causes])
    known = np.any(each, axis=0)
    if not np.all(known):
        raise ValueError(f"there is no colour for the ending {found[~known][0]!r}")
    names = [
        f"{WORDS.get(cause, cause.replace('_', ' '))} ({grouped(int(np.sum(here)))})"
        for cause, here in zip(causes, each, strict=True)
    ]
    palette = tuple(COLOURS[cause] for cause in causes)
    return Categories(np.argmax(each, axis=0), tuple(names), palette)


def grouped(count: int) -> str:
    """Return a whole number as text, in groups of three digits from 10 000 on."""
    return f"{count:,}".replace(",", "\u2009") if count >= 10_000 else str(count)


_HIGH = {"single": 52.0, "double": 72.0}
_TOP = 3.0
_BOTTOM = 9.0
_RIGHT = 4.0
_BAR = 10.5
"""Room for the colour bar with its label, without its numbers (mm)."""
_THICK = 2.5
"""Width of the bar (mm)."""
_LABEL = 6.5
"""Room for the label of the vertical axis and the ticks (mm)."""
_ROUNDING = 1e-9
"""Relative range of numbers below which all have the same colour."""


def ending_map(grid: StoredGrid, width: str = "single") -> Figure | None:
    """Draw how the runs end, a colour for each cause, over the two axes with the most values.

    Returns None if fewer than two axes change, or if all runs end in the same way.
    """
    shown = parameter_map(grid, 2)
    if shown is None:
        return None
    found = endings(grid, shown.rows)
    return None if len(found.names) == 1 else category_map(shown, width, found)


def category_map(shown: ParameterMap, width: str, found: Categories) -> Figure:
    """Draw a map over two axes with a colour for each category, and its legend."""
    with style.journal():
        rows = rows_of(found.entries(), width_of(width))
        figure, axes = _panel(shown, width, len(rows) * LINE, _RIGHT)
        _fill(axes, shown, found.code.astype(np.float64), found.colours(), found.norm())
        draw_legend(figure, rows)
    return figure


def quantity_map(
    grid: StoredGrid,
    width: str,
    values: Array,
    label: str,
    least_log: float = WIDE_RANGE,
    whole: bool = False,
) -> Figure | None:
    """Draw a quantity of the points over two axes, with a colour bar.

    `values` holds one number for each point of the grid, NaN where there is none. Colours are
    logarithmic if all numbers are positive and their ratio exceeds `least_log`; a few `whole`
    numbers have one colour each. Returns None if fewer than two axes change or no value is finite.
    """
    shown = parameter_map(grid, 2)
    if shown is None or not np.any(np.isfinite(values[shown.rows])):
        return None
    own = values[shown.rows]
    with style.journal():
        norm = _norm(own, least_log, whole)
        ticks = _bar_ticks(norm, own[np.isfinite(own)], _HIGH[width], whole)
        quantity, _, unit = label.partition(" [")
        words = axis_words(quantity, unit.removesuffix("]"), ticks)
        room = _BAR + max(map(text_width, ticks.labels))
        figure, axes = _panel(shown, width, 0.0, room)
        colours = style.time_colours()
        _fill(axes, shown, own, colours, norm)
        _draw_bar(figure, axes, ScalarMappable(norm, colours), words, ticks)
    return figure


def _norm(values: Array, least_log: float, whole: bool) -> Normalize:
    finite = values[np.isfinite(values)]
    low, high = float(np.min(finite)), float(np.max(finite))
    if whole and high - low < _FEW:
        return BoundaryNorm(np.arange(low - 0.5, high + 1.0), _SHADES)
    if high - low <= _ROUNDING * max(abs(low), abs(high)):
        beside = 0.5 * (max(abs(low), abs(high)) or 1.0)
        return BoundaryNorm([low - beside, high + beside], _SHADES)
    if low > 0.0 and high > least_log * low:
        return LogNorm(low, high)
    return Normalize(low, high)


def _panel(shown: ParameterMap, width: str, legend: float, right: float) -> tuple[Figure, Axes]:
    """Return a figure with one labelled panel, and `right` mm of free room beside it."""
    wide, high = width_of(width), _HIGH[width]
    across, along = shown.coordinates

    def ticks() -> tuple[float, Ticks, Ticks]:
        beside = along.ticks(*along.limits, high, vertical=True)
        left = _LABEL + max(map(text_width, beside.labels), default=0.0)
        return left, beside, across.ticks(*across.limits, wide - left - right, vertical=False)

    left, *both = ticks()
    in_parts = [any("π" in label for label in found.labels) for found in both]
    if across.unit == along.unit and any(in_parts) and not all(in_parts):
        across, along = replace(across, decimal=True), replace(along, decimal=True)
        left, *_ = ticks()
    total = _TOP + legend + high + _BOTTOM
    sheet = Sheet(wide, total)
    axes = sheet.panel(left, _BOTTOM, wide - left - right, high)
    set_axis(axes.xaxis, across)
    set_axis(axes.yaxis, along)
    return sheet.figure, axes


def _fill(axes: Axes, shown: ParameterMap, values: Array, colours: Any, norm: Normalize) -> None:
    """Draw cells if every pair of values has a point, else the points."""
    across, along = shown.coordinates
    if not shown.is_full:
        size = float(np.clip(4000.0 / len(values), 0.6, 14.0))
        draw_dots(axes, across.place, along.place, values, colours, norm, size)
        return
    cells = shown.cells(values)
    mesh = axes.pcolormesh(across.edges(), along.edges(), cells, cmap=colours, norm=norm)
    mesh.set_rasterized(True)  # vector cells would show seams between them
    axes.set_axisbelow(False)


def _bar_ticks(norm: Normalize, shown: Array, height: float, whole: bool) -> Ticks:
    """Return the ticks of the bar: those of an axis, or one at the value of equal numbers."""
    low, high = float(norm.vmin or 0.0), float(norm.vmax or 0.0)
    if isinstance(norm, BoundaryNorm):
        if not whole:
            return Ticks((0.5 * (low + high),), (short_number(float(shown[0])),))
        numbers = range(round(low + 0.5), round(high + 0.5))
        return Ticks(tuple(map(float, numbers)), decimals(numbers))
    if isinstance(norm, LogNorm):
        return log_ticks(low, high, height, vertical=True, edge=0.0)
    return vertical_ticks(low, high, height, whole)


def _draw_bar(
    figure: Figure, axes: Axes, mappable: ScalarMappable, label: str, ticks: Ticks
) -> None:
    """Draw the colour bar to the right of a panel."""
    box = axes.get_position()
    wide = figure.get_figwidth() / MM
    bar = figure.add_axes((box.x1 + 1.5 / wide, box.y0, _THICK / wide, box.height))
    drawn = figure.colorbar(mappable, cax=bar)
    drawn.set_ticks(ticks.places, labels=list(ticks.labels))
    drawn.set_label(label, labelpad=2.0)
    drawn.ax.tick_params(which="both", direction="out", left=False)
