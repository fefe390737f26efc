"""The lines above a figure that say what its marks mean, and numbers beside points."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple, cast

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.cbook import is_math_text
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from vibro_cli.figures import style
from vibro_cli.figures.source import Array, Flags
from vibro_cli.figures.style import MM, Look, panel_size

_MIDDLE = 2.2
"""Distance of the line from the top of the figure (mm)."""
_CHARACTER = 1.25
"""Mean width of a character of a legend (mm)."""
_HANDLE = 6.7
"""Width of a mark of a legend with the room around it (mm)."""
HALO = [patheffects.withStroke(linewidth=1.4, foreground="white")]
"""Around what is written over lines."""
SAY: Look = {"fontsize": style.SMALL, "color": style.FRAME_GREY}
"""The look of words over and under panels."""
LINE = 3.4
"""Height of a line of a legend (mm)."""
_BAR = (16.0, 1.6)
"""Width and height of the bar of colours (mm)."""
_RIGHT = 2.5
"""Room at the right of the bar (mm)."""

_PIXELS: Any = cast("Any", RendererAgg)(1, 1, style.DPI)
"""What measures texts; its methods have no types."""
_SHARES = (0.9, 0.8, 0.7, 0.6)
"""Of the width, that rows of a legend are tried in."""

Entry = tuple[str, Look]
"""What is written, and the looks of its line or mark."""
Rows = Sequence[Sequence[Entry]]
"""The rows of a legend, from above."""


class Bar(NamedTuple):
    """What the bar of colours says: what is drawn in the first of them, and in the last."""

    first: str
    last: str

    @staticmethod
    def of_time(until: float) -> Bar:
        """Return that of the time from 0 to an instant (s)."""
        return Bar("$t$ [s]: 0", short_number(until))

    @property
    def width(self) -> float:
        """The room that it takes in the first row of a legend (mm)."""
        return 2.0 * _RIGHT + _BAR[0] + text_width(self.first) + text_width(self.last)


def rows_of(entries: Sequence[Entry], width: float, bar: Bar | None = None) -> list[list[Entry]]:
    """Return entries in as many rows as a width (mm) asks for, with `bar` beside the first.

    The rows are as even as can be.
    """
    room = width - (0.0 if bar is None else bar.width)
    rows = _filled(entries, room, width)
    for share in _SHARES:
        narrower = _filled(entries, min(share * width, room), share * width)
        rows = narrower if len(narrower) == len(rows) else rows
    return rows


def room_for(legend: Rows, first: float) -> float:
    """Return the room (mm) over panels for a legend; `first` is that for one row."""
    return first + LINE * max(len(legend) - 1, 0)


def _filled(entries: Sequence[Entry], first: float, width: float) -> list[list[Entry]]:
    """Return entries in rows, the first and all others of a width (mm), filled in order."""
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
    """Return entries whose looks have a colour of each body, in black."""
    return [(words, look | {"color": style.BLACK}) for words, look in entries]


@cache
def text_width(text: str) -> float:
    """Return the width of a text of a legend (mm) as a PNG has it, the widest for its hinting."""
    font = FontProperties(family="STIXGeneral", size=style.SMALL)
    width, _, _ = _PIXELS.get_text_width_height_descent(text, font, is_math_text(text))
    return float(width) * 25.4 / style.DPI


def draw_legend(figure: Figure, rows: Rows, bar: Bar | None = None) -> None:
    """Draw the rows of a legend over the panels, and at the right of the first one the bar."""
    width, height = figure.get_size_inches() / MM
    for number, row in enumerate(rows):
        beside = bar is not None and number == 0
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
    """Draw the bar of colours at the right."""
    left = width - _RIGHT - _BAR[0] - text_width(words.last) - 1.0
    middle = height - _MIDDLE
    bar = figure.add_axes(
        (left / width, (middle - 0.5 * _BAR[1]) / height, _BAR[0] / width, _BAR[1] / height)
    )
    bar.imshow(np.arange(256)[None, :], aspect="auto", cmap=style.time_colours())
    bar.set_xticks([])
    bar.set_yticks([])
    before: Look = {"ha": "right", "va": "center_baseline", "fontsize": style.SMALL}
    figure.text((left - 0.8) / width, middle / height, words.first, **before)
    after = before | {"ha": "left"}
    figure.text((left + _BAR[0] + 0.8) / width, middle / height, words.last, **after)


def short_number(value: float, digits: int = 4) -> str:
    """Return a number with a few digits as text, the minus sign a minus."""
    plain = f"{value:.{digits}g}"
    if "e" not in plain:
        return plain.replace("-", "−")
    factor, power = plain.split("e")
    return rf"${factor}\times 10^{{{int(power)}}}$"


def in_powers(text: str) -> str:
    """Return words whose numbers such as 1.2e-07 have powers of ten, as figures write them."""
    return re.sub(
        r"([\d.]+)e([+−-])0*(\d+)",
        lambda number: rf"${number[1]}\times10^{{{number[2].strip('+')}{number[3]}}}$",
        text,
    )


def ring(points: int) -> Array:
    """Return points of the circle of radius 1 around the origin, shape (points, 2)."""
    angles = np.linspace(0.0, 2.0 * np.pi, points)
    return np.column_stack([np.cos(angles), np.sin(angles)])


_HIGH = 2.5
"""Height of a figure (mm)."""
LEADER = 3.9
"""A number further than this from its point (mm) wants a line to it."""
_CLEAR = 0.5
"""Room between two numbers side by side, and between a number and the frame (mm)."""
_DISTANCES = (1.9, 2.6, 3.4, 4.4, 5.8, 7.4)
"""Distances of a number from its point that are tried (mm)."""
_DIRECTIONS = 12
_FAR = 2.0
"""Points of curves that may be covered to come 1 mm nearer."""
_OTHER = 15.0
"""Points of curves that may be covered to stand beside the preferred point."""
_AMBIGUOUS = 40.0
"""Points of curves that may be covered not to stand nearer to another point than to one's own."""
_ONE = 0.5
"""Points nearer to one another than this (mm) are one on paper."""


def place_numbers(
    texts: Sequence[str],
    anchors: Sequence[Array],
    obstacles: Array,
    size: tuple[float, float],
    reserved: Sequence[tuple[float, float, float]] = (),
) -> list[tuple[float, float] | None]:
    """Return where to centre each text so that it covers as little as possible.

    All in mm from the lower left corner of a panel of the given size: `anchors` holds for each text
    the points it may stand beside, shape (k, 2), the preferred one first; `obstacles` are points of
    everything drawn, shape (n, 2); `reserved` are the middles and half widths of texts that stand
    already. Greedy, in the order of the texts; None where texts and the frame leave no room.
    """
    taken = [*reserved]
    obstacles = obstacles[np.argsort(obstacles[:, 0])]
    places: list[tuple[float, float] | None] = []
    for number, (text, points) in enumerate(zip(texts, anchors, strict=True)):
        half = 0.5 * _CHARACTER * len(text) + 0.15
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


def tied(
    places: Sequence[tuple[float, float] | None], anchors: Sequence[Array]
) -> Iterator[tuple[int, tuple[float, float], Array | None]]:
    """Yield the index and the place of each number that has one, and the line to its nearest point.

    The line, shape (2, 2), is there for a number that is far, or stands nearer to a point of
    another number.
    """
    for number, (place, points) in enumerate(zip(places, anchors, strict=True)):
        if place is None:
            continue
        at = np.array([place])
        nearest = points[np.argmin(np.hypot(*(points - at).T))]
        reach = nearest - place
        length = float(np.hypot(*reach))
        others = _others(anchors, number)
        others = others[np.hypot(*(others - nearest).T) > _ONE]
        wanted = length > LEADER or _nearest(at, others)[0] < length
        tie = np.stack([place + reach * (0.6 * _HIGH / length), nearest])
        yield number, place, tie if wanted else None


def _others(anchors: Sequence[Array], number: int) -> Array:
    """Return the points of all numbers but one, shape (n, 2)."""
    return np.concatenate([np.empty((0, 2)), *anchors[:number], *anchors[number + 1 :]])


def _candidates(points: Array, half: float) -> tuple[Array, Array]:
    """Return places around points, and the cost of their distance and of the point's rank."""
    around = ring(_DIRECTIONS + 1)[:-1]
    places, costs = [], []
    for rank, point in enumerate(points):
        for distance in _DISTANCES:
            reach = np.array([distance + half - 0.5, distance])
            places.append(point + around * reach)
            costs.append(np.full(_DIRECTIONS, _FAR * distance + _OTHER * rank))
    return np.concatenate(places), np.concatenate(costs)


def _ambiguity(candidates: Array, others: Array, own: Array) -> Array:
    """Return 1 for each place as near to another text's points as to its own, 0 where far from."""
    return np.clip(6.0 - 5.0 * _nearest(candidates, others) / _nearest(candidates, own), 0.0, 1.0)


def _nearest(places: Array, points: Array) -> Array:
    between = places[:, None, :] - points[None, :, :]
    nearest: Array = np.hypot(between[..., 0], between[..., 1]).min(axis=1, initial=np.inf)
    return nearest


def _covered(candidates: Array, half: float, obstacles: Array) -> Array:
    """Return how many obstacles a text covers at each place; those in order of x."""
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
    """Return which places of a text are on one of the others, given by middles and half widths."""
    x, y, halves = np.reshape(texts, (-1, 3)).T
    across = np.abs(candidates[:, 0, None] - x) < half + halves + _CLEAR
    on: Flags = (across & (np.abs(candidates[:, 1, None] - y) < _HIGH)).any(axis=1)
    return on


@dataclass(frozen=True)
class Named:
    """A point of a drawing with its name."""

    text: str
    """As it is written, perhaps a formula."""
    point: ArrayLike
    """In the panel's units."""
    colour: str = style.BLACK


def write_names(
    axes: Axes,
    names: Sequence[Named],
    obstacles: Array,
    figures: Sequence[Array] = (),
) -> None:
    """Write names beside their points, where they cover least of `obstacles`, shape (n, 2).

    Points in the units of the axes. Names that stand far get lines, those without room are left
    out. `figures` are the middles of single figures that are written already.
    """
    size = panel_size(axes)
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    corner = np.array([left, low])
    scale = np.array([size[0] / (right - left), size[1] / (high - low)])
    anchors = [((np.array([name.point]) - corner) * scale) for name in names]
    covered = np.concatenate([(np.reshape(obstacles, (-1, 2)) - corner) * scale, *anchors * 3])
    plain = [_plain(name.text) for name in names]
    written = (np.reshape(figures, (-1, 2)) - corner) * scale
    reserved = [(float(x), float(y), _CHARACTER) for x, y in written]
    places = place_numbers(plain, anchors, covered, size, reserved)
    for number, place, line in tied(places, anchors):
        name = names[number]
        if line is not None:
            ends = line / scale + corner
            axes.plot(ends[:, 0], ends[:, 1], color=name.colour, linewidth=0.35, zorder=4.5)
        at = np.array(place) / scale + corner
        axes.text(
            float(at[0]), float(at[1]), name.text, color=name.colour, path_effects=HALO,
            fontsize=style.SMALL, ha="center", va="center", zorder=5.0,
        )  # fmt: skip


def _plain(text: str) -> str:
    """Return about as many characters as a formula is wide."""
    bare = re.sub(r"\\(?:mathrm|dot|,|;)|[${}_^']", "", text)
    return re.sub(r"\\[a-zA-Z]+", "w", bare)
