"""Panels for the pieces of a trace side by side, laid out in mm, in the papers' coordinates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from vibro_cli.figures import style
from vibro_cli.figures.chart import Sheet, number_plane
from vibro_cli.figures.labels import Entry, Rows, room_for
from vibro_cli.figures.source import Array
from vibro_cli.figures.style import panel_size, width_of
from vibro_cli.figures.ticks import (
    angle_ticks,
    label_axis,
    number_ticks,
    vertical_ticks,
    without_overlaps,
)
from vibro_cli.mechanics.trace import HUMP, LINE, VALLEY, Piece

LEFT = 11.0
"""Room for the label and numbers of a vertical axis (mm)."""
RIGHT = 2.5
TOP = 8.5
"""Room for the legend and the titles of the panels (mm)."""
ROW_TOP = 4.0
"""Room for the titles of the panels in further rows (mm)."""
BOTTOM = 8.5
"""Room for the label and numbers of a horizontal axis (mm)."""
GAP = 1.5
LEAST_WIDTH = 16.0
"""Least width of a panel (mm); more pieces are split into rows."""
_PAGE = 290.0
"""Height of a page (mm), which the rows of panels must fit."""
_OVERVIEW = 0.3
"""Share of the width that an overview takes."""
_HEIGHT = {"single": 50.0, "double": 64.0}
_LOWER = 0.75
"""Height of panels in several rows, relative to that in one row."""


@dataclass(frozen=True)
class Window:
    """The part of a piece's phase plane that a panel shows."""

    piece: Piece
    low: float
    """Leftmost position: φ or ψ (rad), distance on a line (m)."""
    high: float
    """Rightmost position."""
    top: float
    """Rates go from −top to top: φ̇ or ψ̇ (rad/s), speed on a line (m/s)."""
    overview: bool = False
    """Whether this is the small panel beside a close-up view of the same piece."""


@dataclass(frozen=True)
class Panel:
    """A window and the axes on which it is drawn."""

    axes: Axes
    window: Window
    width: float
    """Width (mm)."""
    height: float
    """Height (mm)."""
    labelled: bool = True
    """Whether the vertical axis has its numbers and label here."""
    left: float = 0.0
    """Distance of the left edge from that of the figure (mm)."""
    row: int = 0
    """Row, counted from the top and from 0."""

    @property
    def piece(self) -> Piece:
        """The piece of the trace."""
        return self.window.piece

    @property
    def shift(self) -> float:
        """Offset of drawn positions: the arc length of the left end (m) of a line, else 0."""
        return self.piece.start_s if self.piece.is_line else 0.0

    @property
    def span(self) -> tuple[float, float]:
        """Ends of the horizontal axis."""
        return self.window.low + self.shift, self.window.high + self.shift

    @property
    def scale(self) -> Array:
        """Lengths of the units of position and rate (mm)."""
        window = self.window
        return np.array([self.width / (window.high - window.low), 0.5 * self.height / window.top])


def straight(low: float, high: float, top: float) -> Window:
    """Return the window of a phase plane in one panel: range of places (m), greatest speed (m/s).

    The plane is that of a line that begins at 0.
    """
    nowhere = math.nan, math.nan
    line = Piece(
        0, LINE, 0.0, math.inf, 0.0, 0.0, high - low, 0.0, nowhere, nowhere, nowhere, low, high
    )
    return Window(line, low, high, top)


class Symbols(NamedTuple):
    """Symbols on the axes of a phase plane."""

    place: str
    """Symbol of the place (m)."""
    speed: str
    """Symbol of the speed (m/s)."""
    after: str = ""
    """Text after the unit of the place."""


def plane(axes: Axes, window: Window, symbols: Symbols, labelled: bool = True) -> Panel:
    """Return a panel of speed against place, with its limits, numbers and names.

    Without `labelled`, the horizontal axis has neither numbers nor a name.
    """
    axes.set_xlim(window.low, window.high)
    axes.set_ylim(-window.top, window.top)
    number_plane(axes, (symbols.place, "m"), (symbols.speed, "m/s"), labelled, symbols.after)
    return Panel(axes, window, *panel_size(axes))


def on_a_page(
    pieces: Sequence[Piece], width: str, start: int = 0, below: float = 0.0
) -> tuple[Sequence[Piece], list[Entry]]:
    """Return as many pieces around that of index `start` as fit a page, and a legend entry.

    There is an entry only if some pieces are left out. `below` mm are needed under the panels.
    """
    across, row = width_of(width), _LOWER * _HEIGHT[width] + BOTTOM + ROW_TOP
    most = int((_PAGE - below - TOP + ROW_TOP) / row) * _most_in_row(pieces, across)
    if len(pieces) <= most:
        return pieces, []
    first = min(max(0, start - most // 2), len(pieces) - most)
    words = f"arcs {first + 1}–{first + most} of {len(pieces)}"
    return pieces[first : first + most], [(words, {"linestyle": "none"})]


def lay_out(
    windows: Sequence[Window], width: str, legend: Rows, below: float = 0.0
) -> tuple[Sheet, tuple[Panel, ...]]:
    """Return an empty sheet with a panel for each window, in the order given.

    The widths of panels are in proportion to the angles of their arcs. Neighbours are close
    together unless their vertical axes differ (arc and line). Room is left for `legend` above the
    panels, and `below` mm under them.
    """
    across = width_of(width)
    rows = _rows(windows, across)
    high = _HEIGHT[width] if len(rows) == 1 else _LOWER * _HEIGHT[width]
    above = room_for(legend, TOP)
    total = above + len(rows) * (high + BOTTOM) + (len(rows) - 1) * ROW_TOP + below
    sheet = Sheet(across, total)
    panels: list[Panel] = []
    for row, members in enumerate(rows):
        bottom = total - above - high - row * (high + BOTTOM + ROW_TOP)
        for window, left, wide, labelled in _across(members, windows, across):
            axes = sheet.panel(left, bottom, wide, high)
            panel = Panel(axes, window, wide, high, labelled, left, row)
            axes.set_xlim(panel.span)
            axes.set_ylim(-window.top, window.top)
            panels.append(panel)
    return sheet, tuple(panels)


def _rows(windows: Sequence[Window], width: float) -> list[Sequence[Window]]:
    """Return the windows in as few rows as the least width of a panel allows, evenly filled."""
    room = width - RIGHT - sum(map(_margin, [None, *windows], windows))
    if len(windows) == 1 or room / len(windows) >= LEAST_WIDTH:
        return [windows]
    number = math.ceil(len(windows) / _most_in_row([window.piece for window in windows], width))
    each = math.ceil(len(windows) / number)
    return [windows[first : first + each] for first in range(0, len(windows), each)]


def _most_in_row(pieces: Sequence[Piece], width: float) -> int:
    """Return how many pieces a row holds if there are several rows."""
    if any(piece.is_line for piece in pieces):
        return max(1, int((width - RIGHT) / (LEAST_WIDTH + GAP + LEFT)))
    return max(1, int((width - RIGHT - LEFT + GAP) / (LEAST_WIDTH + GAP)))


def _margin(before: Window | None, window: Window) -> float:
    """Return the room left of a panel (mm): room for numbers if its vertical axis differs."""
    if before is None:
        return LEFT
    alike = before.piece.is_line == window.piece.is_line and before.top == window.top
    return GAP if alike else LEFT


def _across(
    members: Sequence[Window], windows: Sequence[Window], width: float
) -> list[tuple[Window, float, float, bool]]:
    """Return window, left edge (mm), width (mm) and whether it is labelled, for a row's panels."""
    room = width - RIGHT - sum(map(_margin, [None, *members], members))
    widths = _shared(room, [_extent(window, windows) for window in members])
    left = 0.0
    placed = []
    for before, window, wide in zip([None, *members], members, widths, strict=False):
        margin = _margin(before, window)
        left += margin
        placed.append((window, left, wide, margin == LEFT))
        left += wide
    return placed


def _extent(window: Window, windows: Sequence[Window]) -> float:
    """Return the extent of a window in angle; on a line, in mean radii of the arcs."""
    if any(other.overview for other in windows):
        return _OVERVIEW if window.overview else 1.0 - _OVERVIEW
    shown = window.high - window.low
    if not window.piece.is_line:
        return shown
    radii = [other.piece.radius for other in windows if not other.piece.is_line]
    return shown * len(radii) / sum(radii) if radii else shown


def _shared(room: float, extents: Sequence[float]) -> list[float]:
    """Return widths (mm) in proportion to the extents, but none below the least width."""
    least = min(LEAST_WIDTH, room / len(extents))
    spare = room - least * len(extents)
    wanted = [max(0.0, room * extent / sum(extents) - least) for extent in extents]
    total = sum(wanted)
    return [least + (spare * want / total if total else 0.0) for want in wanted]


_SYMBOL = {VALLEY: r"\varphi", HUMP: r"\psi"}
_TITLE_CHARACTER = 1.25
"""Mean width of a character of a title (mm)."""


def label(panels: Sequence[Panel], ball: int | str) -> None:
    """Set ticks, axis labels and titles of all panels, for a body (from 1) or several (`1,2`)."""
    for _, members in groupby(panels, key=lambda one: one.row):
        row = list(members)
        _horizontal(row, ball)
        _vertical(row, ball)
    _titles(panels)


def _horizontal(row: Sequence[Panel], ball: int | str) -> None:
    proposed = [
        (number_ticks if one.piece.is_line else angle_ticks)(*one.span, one.width) for one in row
    ]
    places = [(one.left, one.width, ticks) for one, ticks in zip(row, proposed, strict=True)]
    spans = [one.span for one in row]
    for one, ticks in zip(row, without_overlaps(places, spans), strict=True):
        symbol, unit = (_SYMBOL[one.piece.shape], "rad") if not one.piece.is_line else ("s", "m")
        label_axis(one.axes.xaxis, ticks, rf"${symbol}_{{{ball}}}$", unit)


def _vertical(row: Sequence[Panel], ball: int | str) -> None:
    for one in row:
        ticks = vertical_ticks(-one.window.top, one.window.top, one.height)
        unit = "m/s" if one.piece.is_line else "rad/s"
        label_axis(one.axes.yaxis, ticks, _rate_symbol(row, one, ball), unit, one.labelled)


def _rate_symbol(row: Sequence[Panel], one: Panel, ball: int | str) -> str:
    """Return the symbol of a vertical axis that the panels of the same unit in a row share."""
    if one.piece.is_line:
        return rf"$v_{{{ball}}}$"
    shapes = {other.piece.shape for other in row if not other.piece.is_line}
    symbols = [_SYMBOL[shape] for shape in (VALLEY, HUMP) if shape in shapes]
    rates = ",\\ ".join(rf"\dot{{{symbol}}}_{{{ball}}}" for symbol in symbols)
    return f"${rates}$"


def _titles(panels: Sequence[Panel]) -> None:
    """Write the titles, all in the longest form that fits every panel."""
    numbers = [str(one.piece.index + 1) for one in panels]
    short = [f"{number}, {one.piece.shape}" for number, one in zip(numbers, panels, strict=True)]
    for titles in ([_full_title(one) for one in panels], short, numbers):
        both = list(zip(panels, titles, strict=True))
        if all(len(text) * _TITLE_CHARACTER <= one.width for one, text in both):
            break
    for one, text in both:
        one.axes.set_title(text, pad=2.0, color=style.FRAME_GREY)


def _full_title(one: Panel) -> str:
    if one.window.overview:
        return "whole line" if one.piece.is_line else "whole arc"
    return f"arc {one.piece.index + 1}, {one.piece.shape}"
