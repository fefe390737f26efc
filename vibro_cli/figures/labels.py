"""Legends above figures, and the placement of numbers and names beside points."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple, cast

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.cbook import is_math_text
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from vibro_cli.figures import style
from vibro_cli.figures.source import Array, Flags
from vibro_cli.figures.style import MM, Look, panel_size

_MIDDLE = 2.2
"""Distance of the middle of the first row from the top of the figure (mm)."""
_HANDLE = 6.7
"""Width of a legend mark with the room around it (mm)."""
HALO = [patheffects.withStroke(linewidth=1.4, foreground="white")]
"""White outline of texts that are written over lines."""
SMALL_TEXT: Look = {"fontsize": style.SMALL, "color": style.FRAME_GREY}
"""Style of words above and below panels."""
LINE = 3.4
"""Height of a row of a legend (mm)."""
_BAR = (16.0, 1.6)
"""Width and height of the colour bar (mm)."""
_RIGHT = 2.5
"""Room to the right of the colour bar (mm)."""

_PIXELS: Any = cast("Any", RendererAgg)(1, 1, style.DPI)
"""Renderer that measures texts; its methods have no types."""
_SHARES = (0.9, 0.8, 0.7, 0.6)
"""Shares of the width that are tried for the rows of a legend."""

Entry = tuple[str, Look]
"""A legend entry: its text, and the style of its line or mark."""
Rows = Sequence[Sequence[Entry]]
"""The rows of a legend, from the top."""


class Bar(NamedTuple):
    """The texts at both ends of the colour bar: the meaning of its first and its last colour."""

    first: str
    last: str

    @staticmethod
    def of_time(until: float) -> Bar:
        """Return the texts of a bar for the time from 0 to an instant (s)."""
        return Bar("$t$ [s]: 0", short_number(until))

    @property
    def width(self) -> float:
        """Width that the bar takes in the first row of a legend (mm)."""
        return 2.0 * _RIGHT + _BAR[0] + text_width(self.first) + text_width(self.last)


def rows_of(entries: Sequence[Entry], width: float, bar: Bar | None = None) -> list[list[Entry]]:
    """Return entries in as few rows as fit a width (mm), with `bar` beside the first row.

    The rows are made as even in length as possible.
    """
    room = width - (0.0 if bar is None else bar.width)
    rows = _filled(entries, room, width)
    for share in _SHARES:
        narrower = _filled(entries, min(share * width, room), share * width)
        rows = narrower if len(narrower) == len(rows) else rows
    return rows


def room_for(legend: Rows, first: float) -> float:
    """Return the room (mm) above panels for a legend; `first` is the room for one row."""
    return first + LINE * max(len(legend) - 1, 0)


def _filled(entries: Sequence[Entry], first: float, width: float) -> list[list[Entry]]:
    """Fill rows with entries in order; `first` and `width` (mm) limit the first and other rows."""
    rows: list[list[Entry]] = [[]]
    room = first
    for entry in entries:
        needed = _HANDLE + text_width(entry[0])
        if rows[-1] and needed > room:
            rows.append([])
            room = width
        rows[-1].append(entry)
        room -= needed
    return rows


def in_black(*entries: Entry) -> list[Entry]:
    """Return entries in black, for styles that are drawn in the colour of each body."""
    return [(words, look | {"color": style.BLACK}) for words, look in entries]


@cache
def text_width(text: str) -> float:
    """Return the width of a small text (mm) in a PNG, where hinting makes it widest."""
    font = FontProperties(family="STIXGeneral", size=style.SMALL)
    width, _, _ = _PIXELS.get_text_width_height_descent(text, font, is_math_text(text))
    return float(width) * 25.4 / style.DPI


def draw_legend(figure: Figure, rows: Rows, bar: Bar | None = None, scale: bool = False) -> None:
    """Draw the rows of a legend above the panels, and the bar to the right of the first row.

    With `scale`, the first row leaves the same room for a scale that the caller draws.
    """
    width, height = figure.get_size_inches() / MM
    for number, row in enumerate(rows):
        beside = (bar is not None or scale) and number == 0
        middle = _MIDDLE + number * LINE
        figure.legend(
            handles=[Line2D([], [], label=text, **look) for text, look in row],
            loc="center left" if beside else "center",
            bbox_to_anchor=(0.0 if beside else 0.5, 1.0 - middle / height),
            ncols=len(row),
            borderaxespad=0.0,
            borderpad=0.2,
            handlelength=1.6,
            handletextpad=0.4,
            columnspacing=0.7,
        )
    if bar is not None:
        _draw_bar(figure, width, height, bar)


def _draw_bar(figure: Figure, width: float, height: float, words: Bar) -> None:
    """Draw the colour bar at the right edge."""
    left = width - _RIGHT - _BAR[0] - text_width(words.last) - 1.0
    middle = height - _MIDDLE
    bar = figure.add_axes(
        (left / width, (middle - 0.5 * _BAR[1]) / height, _BAR[0] / width, _BAR[1] / height)
    )
    colours = ScalarMappable(cmap=style.time_colours())
    figure.colorbar(colours, cax=bar, orientation="horizontal", ticks=[])
    before: Look = {"ha": "right", "va": "center_baseline", "fontsize": style.SMALL}
    figure.text((left - 0.8) / width, middle / height, words.first, **before)
    after = before | {"ha": "left"}
    figure.text((left + _BAR[0] + 0.8) / width, middle / height, words.last, **after)


def short_number(value: float, digits: int = 4) -> str:
    """Return a number as text with a few significant digits and a true minus sign."""
    plain = f"{value:.{digits}g}"
    if "e" not in plain:
        return plain.replace("-", "−")
    factor, power = plain.split("e")
    return rf"${factor}\times 10^{{{int(power)}}}$"


def in_powers(text: str) -> str:
    """Return a text with numbers such as 1.2e-07 written as powers of ten."""
    return re.sub(
        r"([\d.]+)e([+−-])0*(\d+)",
        lambda number: rf"${number[1]}\times10^{{{number[2].strip('+')}{number[3]}}}$",
        text,
    )


def ring(points: int) -> Array:
    """Return points of the unit circle around the origin, shape (points, 2)."""
    angles = np.linspace(0.0, 2.0 * np.pi, points)
    return np.column_stack([np.cos(angles), np.sin(angles)])


_HIGH = 2.5
"""Height of a digit (mm)."""
LEADER = 3.9
"""Distance of a number from its point (mm) above which a line connects them."""
_CLEAR = 0.5
"""Room between two numbers side by side, and between a number and the frame (mm)."""
_DISTANCES = (1.9, 2.6, 3.4, 4.4, 5.8, 7.4)
"""Distances of a number from its point that are tried (mm)."""
HEIGHT_REACHED = max(_DISTANCES) + 0.5 * _HIGH
"""Greatest height (mm) above or below its point that a number covers."""
_DIRECTIONS = 12
_FAR = 2.0
"""Cost of 1 mm of distance from the point; covering one point of a curve costs 1."""
_OTHER = 15.0
"""Cost of standing beside the next less preferred point."""
_AMBIGUOUS = 40.0
"""Cost of standing as near to the point of another number as to one's own."""
_ONE = 0.5
"""Distance below which two points coincide on paper (mm)."""


def place_numbers(
    texts: Sequence[str],
    anchors: Sequence[Array],
    obstacles: Array,
    size: tuple[float, float],
    reserved: Sequence[tuple[float, float, float]] = (),
) -> list[tuple[float, float] | None]:
    """Return the centre of each text, placed so that it covers as little as possible.

    All lengths are in mm from the lower left corner of a panel of the given size. `anchors` holds,
    for each text, the points beside which it may stand, shape (k, 2), the preferred one first.
    `obstacles` are points of everything drawn, shape (n, 2). `reserved` are the centres and half
    widths of texts already placed. The placement is greedy, in the order of the texts; a text for
    which there is no room gets None.
    """
    taken = [*reserved]
    obstacles = obstacles[np.argsort(obstacles[:, 0])]
    places: list[tuple[float, float] | None] = []
    for number, (text, points) in enumerate(zip(texts, anchors, strict=True)):
        half = 0.5 * text_width(text) + 0.15
        candidates, costs = _candidates(points, half)
        free = _inside(candidates, half, size) & ~_on_texts(candidates, half, taken)
        if not free.any():
            places.append(None)
            continue
        candidates, costs = candidates[free], costs[free]
        costs += _covered(candidates, half, obstacles)
        costs += _AMBIGUOUS * _ambiguity(candidates, _others(anchors, number), points)
        x, y = candidates[int(np.argmin(costs))].tolist()
        places.append((x, y))
        taken.append((x, y, half))
    return places


def _tie(number: int, place: tuple[float, float], anchors: Sequence[Array]) -> Array | None:
    """Return a line from a placed text to its nearest point, shape (2, 2), if it needs one.

    It does if it is far from its point, or nearer to the point of another text.
    """
    points, at = anchors[number], np.array([place])
    nearest = points[np.argmin(np.hypot(*(points - at).T))]
    reach = nearest - place
    length = float(np.hypot(*reach))
    others = _others(anchors, number)
    others = others[np.hypot(*(others - nearest).T) > _ONE]
    if length <= LEADER and length <= _nearest(at, others)[0]:
        return None
    return np.stack([place + reach * (0.6 * _HIGH / length), nearest])


def _others(anchors: Sequence[Array], number: int) -> Array:
    """Return the points of all numbers except one, shape (n, 2)."""
    return np.concatenate([np.empty((0, 2)), *anchors[:number], *anchors[number + 1 :]])


def _candidates(points: Array, half: float) -> tuple[Array, Array]:
    """Return places around points, and their costs from the distance and the rank of the point."""
    around = ring(_DIRECTIONS + 1)[:-1]
    places, costs = [], []
    for rank, point in enumerate(points):
        for distance in _DISTANCES:
            reach = np.array([distance + half - 0.5, distance])
            places.append(point + around * reach)
            costs.append(np.full(_DIRECTIONS, _FAR * distance + _OTHER * rank))
    return np.concatenate(places), np.concatenate(costs)


def _ambiguity(candidates: Array, others: Array, own: Array) -> Array:
    """Return 1 for places as near to the points of other texts as to its own, 0 for clear ones."""
    return np.clip(6.0 - 5.0 * _nearest(candidates, others) / _nearest(candidates, own), 0.0, 1.0)


def _nearest(places: Array, points: Array) -> Array:
    between = places[:, None, :] - points[None, :, :]
    nearest: Array = np.hypot(between[..., 0], between[..., 1]).min(axis=1, initial=np.inf)
    return nearest


def _covered(candidates: Array, half: float, obstacles: Array) -> Array:
    """Return how many obstacles a text covers at each place; obstacles are sorted by x."""
    x, y = obstacles.T
    first = np.searchsorted(x, candidates[:, 0] - half, "left")
    last = np.searchsorted(x, candidates[:, 0] + half, "right")
    covered = [
        np.count_nonzero(
            (np.abs(x[low:high] - place[0]) < half) & (np.abs(y[low:high] - place[1]) < 0.5 * _HIGH)
        )
        for low, high, place in zip(first, last, candidates, strict=True)
    ]
    return np.array(covered, dtype=np.float64)


def _inside(candidates: Array, half: float, size: tuple[float, float]) -> Flags:
    margin = np.array([half + _CLEAR, 0.5 * _HIGH + _CLEAR])
    inside: Flags = ((candidates >= margin) & (candidates <= np.array(size) - margin)).all(axis=1)
    return inside


def _on_texts(candidates: Array, half: float, texts: Sequence[tuple[float, float, float]]) -> Flags:
    """Return which places of a text overlap others, given by their centres and half widths."""
    x, y, halves = np.reshape(texts, (-1, 3)).T
    across = np.abs(candidates[:, 0, None] - x) < half + halves + _CLEAR
    on: Flags = (across & (np.abs(candidates[:, 1, None] - y) < _HIGH)).any(axis=1)
    return on


@dataclass(frozen=True)
class Named:
    """A point of a drawing with its name."""

    text: str
    """The name as written; may be a formula."""
    point: ArrayLike
    """Place in the units of the panel; of several, shape (k, 2), the preferred one first."""
    colour: str = style.BLACK


def write_names(
    axes: Axes,
    names: Sequence[Named],
    obstacles: Array,
    figures: Sequence[Array] = (),
    order: float = 5.0,
) -> None:
    """Write names beside their points, where they cover least of `obstacles`, shape (n, 2).

    Points are in the units of the axes. Names far from their points get lines; names without room
    are left out. `figures` are points of texts that are already written, each taken as one
    character. `order` is the drawing order of the names; their lines are half a unit below it.
    """
    size = panel_size(axes)
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    corner = np.array([left, low])
    scale = np.array([size[0] / (right - left), size[1] / (high - low)])
    anchors = [(np.reshape(name.point, (-1, 2)) - corner) * scale for name in names]
    covered = np.concatenate([(np.reshape(obstacles, (-1, 2)) - corner) * scale, *anchors * 3])
    written = (np.reshape(figures, (-1, 2)) - corner) * scale
    reserved = [(float(x), float(y), 0.5 * _HIGH) for x, y in written]
    places = place_numbers([name.text for name in names], anchors, covered, size, reserved)
    for number, (name, place) in enumerate(zip(names, places, strict=True)):
        if place is None:
            continue
        line = _tie(number, place, anchors)
        if line is not None:
            ends = line / scale + corner
            axes.plot(*ends.T, color=name.colour, linewidth=0.35, zorder=order - 0.5)
        at = np.array(place) / scale + corner
        axes.text(
            float(at[0]), float(at[1]), name.text, color=name.colour, path_effects=HALO,
            fontsize=style.SMALL, ha="center", va="center", zorder=order,
        )  # fmt: skip
