"""The lines above a figure that say what its marks and colours mean."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.textpath import TextPath

from vibro_cli.figures import style
from vibro_cli.figures.style import MM

_MIDDLE = 2.2
"""Distance of the line from the top of the figure (mm)."""
_CHARACTER = 1.25
"""Mean width of a character of a legend (mm)."""
_HANDLE = 6.7
"""Width of a mark of a legend with the room around it (mm)."""
_WIDELY = 5
"""So many entries stand in one line with room between them."""
LINE = 3.4
"""Height of a line of a legend (mm)."""
_BAR = (16.0, 1.6)
"""Width and height of the bar of colours (mm)."""
_RIGHT = 2.5
"""Room at the right of the bar (mm)."""
_BAR_WORDS = "$t$ [s]: 0"

_SHARES = (0.9, 0.8, 0.7, 0.6)
"""Of the width, that rows of a legend are tried in."""

Entry = tuple[str, dict[str, Any]]
"""What is written, and the looks of its line or mark."""


def rows_of(entries: Sequence[Entry], width: float, bar: float = 0.0) -> list[list[Entry]]:
    """Return entries in as many rows as a width (mm) asks for, `bar` mm of the first taken.

    The rows are as even as can be.
    """
    rows = _filled(entries, width - bar, width)
    for share in _SHARES:
        narrower = _filled(entries, min(share * width, width - bar), share * width)
        rows = narrower if len(narrower) == len(rows) else rows
    return rows


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


def handles_of(entries: Iterable[Entry]) -> list[Line2D]:
    """Return the marks of a legend with their names."""
    return [Line2D([], [], label=text, **look) for text, look in entries]


@cache
def text_width(text: str) -> float:
    """Return the width of a text of a legend (mm)."""
    font = FontProperties(family="STIXGeneral", size=style.SMALL)
    points: float = TextPath((0.0, 0.0), text, prop=font).get_extents().width
    return points * 25.4 / 72.0


def bar_width(until: float) -> float:
    """Return the room that the bar of time, up to an instant (s), takes in the first row (mm)."""
    return 2.0 * _RIGHT + _BAR[0] + text_width(_BAR_WORDS) + text_width(short_number(until))


def draw_legend(
    figure: Figure, rows: Sequence[Sequence[Entry]], until: float | None = None
) -> None:
    """Draw the rows of a legend over the panels.

    At the right of the first is the bar of time from 0 to an instant (s), if there is one.
    """
    width, height = figure.get_size_inches() / MM
    for number, row in enumerate(rows):
        beside = until is not None and number == 0
        middle = _MIDDLE + number * LINE
        figure.legend(
            handles=handles_of(row),
            loc="center left" if beside else "center",
            bbox_to_anchor=(0.0 if beside else 0.5, 1.0 - middle / height),
            ncols=len(row),
            borderaxespad=0.0,
            borderpad=0.2,
            handlelength=1.6,
            handletextpad=0.4,
            columnspacing=0.7,
        )
    if until is not None:
        _draw_time(figure, width, height, until)


def line_of_entries(figure: Figure, entries: Sequence[Entry]) -> None:
    """Draw a legend of names and looks in one line over the panels; of many, closer together."""
    many = len(entries) > _WIDELY
    figure.legend(
        handles=handles_of(entries),
        loc="upper center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=max(len(entries), 1),
        borderaxespad=0.15,
        borderpad=0.15,
        handlelength=1.4 if many else 1.8,
        handletextpad=0.25 if many else 0.4,
        columnspacing=0.6 if many else 1.1,
    )


def wrapped_legend(figure: Figure | None, entries: Sequence[Entry], width: float) -> int:
    """Draw marks and names over the panels in lines of a width (mm); return how many lines.

    Without a figure nothing is drawn, but the lines are counted.
    """
    widest = max(len(text) for text, _ in entries) * _CHARACTER + _HANDLE
    columns = min(len(entries), max(1, int(width / widest)))
    if figure is not None:
        figure.legend(
            handles=handles_of(entries),
            loc="upper center",
            bbox_to_anchor=(0.5, 1.0),
            ncols=columns,
            borderaxespad=0.15,
            borderpad=0.15,
            handlelength=1.0,
            handletextpad=0.4,
            columnspacing=1.0,
            labelspacing=0.25,
        )
    return -(-len(entries) // columns)


def _draw_time(figure: Figure, width: float, height: float, until: float) -> None:
    """Draw the bar of time at the right."""
    end = short_number(until)
    left = width - _RIGHT - _BAR[0] - text_width(end) - 1.0
    middle = height - _MIDDLE
    bar = figure.add_axes(
        (left / width, (middle - 0.5 * _BAR[1]) / height, _BAR[0] / width, _BAR[1] / height)
    )
    bar.imshow(np.arange(256)[None, :], aspect="auto", cmap=style.time_colours())
    bar.set_xticks([])
    bar.set_yticks([])
    before: dict[str, Any] = {"ha": "right", "va": "center_baseline", "fontsize": style.SMALL}
    figure.text((left - 0.8) / width, middle / height, _BAR_WORDS, **before)
    after = before | {"ha": "left"}
    figure.text((left + _BAR[0] + 0.8) / width, middle / height, end, **after)


def short_number(value: float, digits: int = 4) -> str:
    """Return a number with a few digits as text."""
    plain = f"{value:.{digits}g}"
    if "e" not in plain:
        return plain
    factor, power = plain.split("e")
    return rf"${factor}\times 10^{{{int(power)}}}$"
