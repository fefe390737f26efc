"""Phase planes of the members of a family side by side, each with its title and type above it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import TypeVar

import numpy as np
from matplotlib.figure import Figure

from vibro_cli.figures import style
from vibro_cli.figures.chart import Cell, in_rows
from vibro_cli.figures.labels import (
    HEIGHT_REACHED,
    LINE,
    Entry,
    Named,
    draw_legend,
    rows_of,
    text_width,
    write_names,
)
from vibro_cli.figures.portraits.layers import (
    MARKER,
    Background,
    behind_entries,
    both_halves,
    draw_background,
)
from vibro_cli.figures.portraits.panels import BOTTOM, LEFT, RIGHT, Panel, Symbols, Window, plane
from vibro_cli.figures.source import Array
from vibro_cli.figures.style import width_of

_DARK = 6
"""Weight of separatrices as obstacles for names, relative to level curves."""
_NEVER = 20
"""Weight of marks of points as obstacles for names, relative to level curves."""
_HINDERING = 60
"""Number of separatrices, evenly chosen, that names keep clear of."""
_STEP = 0.4
"""Distance between the obstacle points of a curve (mm)."""
_MARK = 0.6
"""Half the size of a mark (mm)."""
MOST_MEMBERS = 12
"""Greatest number of portraits of a family that are drawn."""
_COLUMNS = {"single": 1, "double": 2}
_HIGH = 27.0
"""Height of a panel (mm)."""
_TITLE = 7.4
_LINE = 3.0

Shown = TypeVar("Shown")


@dataclass(frozen=True)
class Member:
    """The portrait of a member of a family."""

    title: str
    type: str
    """Type in words, without the kinds of points, which are written beside the points."""
    behind: Background
    names: tuple[str, ...]
    """Names of its singular points."""
    window: Window


def shown_of(members: Sequence[Shown]) -> Sequence[Shown]:
    """Return evenly chosen members, at most `MOST_MEMBERS`."""
    return members[:: math.ceil(len(members) / MOST_MEMBERS)]


def draw_family(
    members: Sequence[Member], width: str, symbols: Symbols, others: Sequence[Entry] = ()
) -> tuple[Figure, list[Panel]]:
    """Draw the portraits of some members; return the figure and its panels.

    `others` are further entries of the legend.
    """
    wide = width_of(width)
    entries = [*behind_entries(*(one.behind for one in members)), *others]
    rows = rows_of(entries, wide - RIGHT)
    columns = min(_COLUMNS[width], len(members))
    size = wide / columns - LEFT - RIGHT, _HIGH
    with style.journal():
        cell = Cell(*size, _TITLE, BOTTOM, LEFT + RIGHT)
        sheet, corners = in_rows(cell, len(members), columns, wide, LEFT, LINE * len(rows) + 1.0)
        draw_legend(sheet.figure, rows)
        panels = []
        for member, (left, bottom) in zip(members, corners, strict=True):
            panel = plane(sheet.panel(left, bottom, *size), member.window, symbols)
            draw_background(panel, member.behind)
            name_points(panel, member.names, member.behind)
            over = bottom + _HIGH + 1.0
            sheet.write(left, over, member.type, fontsize=style.SMALL, va="baseline")
            sheet.write(left, over + _LINE, member.title, fontsize=style.TEXT, va="baseline")
            panels.append(panel)
    return sheet.figure, panels


def name_points(panel: Panel, names: Sequence[str], behind: Background) -> None:
    """Write the name of each singular point beside it; of very many every third, fifth, …

    Many names fill no more than half of the width, as most of it is lines.
    """
    named = [
        Named(name, (point.position + 0.5 * point.extent, 0.0))
        for name, point in zip(names, behind.points, strict=True)
        if point.kind in MARKER or point.extent
    ]
    if not named:
        return
    full = sum(text_width(one.text) + _MARK for one in named) / panel.width
    if full > 1.0:
        named = named[:: 1 + 2 * math.ceil(full - 0.5)]  # odd: centres and saddles alternate
    scale = panel.scale
    saddles = (*behind.eights, *behind.separatrices)
    saddles = saddles[:: math.ceil(len(saddles) / _HINDERING) or 1]
    dark, pale = (
        [_near_names(line * scale) for one in curves for line in both_halves(one)]
        for curves in (saddles, behind.levels)
    )
    rest = [(one.position, one.position + one.extent) for one in behind.points if one.extent]
    level = [_near_names(np.column_stack([ends, np.zeros(2)]) * scale) for ends in rest]
    marks = np.array([one.point for one in named]) * scale
    on_marks = [marks + _MARK * np.array(step) for step in product((-1.0, 0.0, 1.0), repeat=2)]
    obstacles = np.concatenate([*dark * _DARK, *pale, *(level + on_marks) * _NEVER])
    write_names(panel.axes, named, obstacles / scale)


def _near_names(line: Array) -> Array:
    """Return evenly spaced points of a line (mm), so that their number measures its length.

    Points that no name beside the axis can cover are left out, as there may be millions.
    """
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
    at = np.arange(0.0, along[-1], _STEP)
    points: Array = np.column_stack([np.interp(at, along, values) for values in line.T])
    return points[np.abs(points[:, 1]) < HEIGHT_REACHED]
