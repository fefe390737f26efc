"""The line above a portrait that says what its marks and colours mean."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from vibro_cli.figures import strokes, style
from vibro_cli.figures.background import Background
from vibro_cli.figures.panels import RIGHT
from vibro_cli.figures.style import MM
from vibro_cli.figures.trajectory import Trajectory

_MIDDLE = 2.2
"""Distance of the line from the top of the figure (mm)."""
_CHARACTER = 1.25
"""Mean width of a character of a legend (mm)."""
_HANDLE = 6.5
"""Width of a mark of a legend with the room around it (mm)."""
LINE = 3.4
"""Height of a line of a legend (mm)."""
_CROWDED = 5
"""Entries from which they stand closer."""
_BAR = (16.0, 1.6)
"""Width and height of the bar of colours (mm)."""


def draw_legend(figure: Figure, path: Trajectory, behind: Background, marked: bool) -> None:
    """Draw the legend: marks as they occur and, where branches are not marked, the bar of time."""
    handles = [Line2D([], [], label=text, **look) for text, look in _entries(path, behind, marked)]
    width, height = figure.get_size_inches() / MM
    figure.legend(
        handles=handles,
        loc="center" if marked else "center left",
        bbox_to_anchor=(0.5 if marked else 0.0, 1.0 - _MIDDLE / height),
        ncols=len(handles),
        borderaxespad=0.0,
        borderpad=0.2,
        handlelength=1.8,
        handletextpad=0.4,
        columnspacing=1.2 if len(handles) < _CROWDED else 0.7,
    )
    if not marked:
        _draw_time(figure, width, height, path.end)


def line_of_entries(figure: Figure, entries: Sequence[tuple[str, dict[str, Any]]]) -> None:
    """Draw a legend of names and looks in one line over the panels."""
    figure.legend(
        handles=[Line2D([], [], label=text, **look) for text, look in entries],
        loc="upper center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=len(entries),
        borderaxespad=0.2,
        borderpad=0.2,
        handlelength=1.6,
        handletextpad=0.4,
        columnspacing=1.0,
    )


def wrapped_legend(
    figure: Figure | None, entries: Sequence[tuple[str, dict[str, Any]]], width: float
) -> int:
    """Draw marks and names over the panels in lines of a width (mm); return how many lines.

    Without a figure nothing is drawn, but the lines are counted.
    """
    widest = max(len(text) for text, _ in entries) * _CHARACTER + _HANDLE
    columns = min(len(entries), max(1, int(width / widest)))
    if figure is not None:
        figure.legend(
            handles=[Line2D([], [], label=text, **look) for text, look in entries],
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


def _entries(
    path: Trajectory, behind: Background, marked: bool
) -> list[tuple[str, dict[str, Any]]]:
    jumps = path.jumps
    refused = not np.all(jumps.made)
    entries = [("start", strokes.START)]
    if marked and np.any(jumps.made):
        after = "after" if refused else "after impact"
        entries += [("before", strokes.BEFORE), (after, strokes.AFTER)]
    elif np.any(jumps.made):
        share = f" (1 in {path.every})" if path.every > 1 else ""
        entries.append((f"jump{share}", strokes.JUMP | {"linestyle": "solid"}))
    if refused:
        entries.append(("inadmissible", strokes.NOT_MADE))
    if behind.separatrices:
        entries.append(("separatrix", strokes.SEPARATRIX))
    elif behind.arc_separatrices:
        entries.append(("separatrix", strokes.ARC_SEPARATRIX))  # of the full circles
    return entries


def _draw_time(figure: Figure, width: float, height: float, end: float) -> None:
    """Draw the bar of time, from 0 to the end of the run, at the right."""
    until, length = _number(end)
    left = width - RIGHT - _BAR[0] - 1.3 * length - 1.0
    middle = height - _MIDDLE
    bar = figure.add_axes(
        (left / width, (middle - 0.5 * _BAR[1]) / height, _BAR[0] / width, _BAR[1] / height)
    )
    bar.imshow(np.arange(256)[None, :], aspect="auto", cmap=strokes.time_colours())
    bar.set_xticks([])
    bar.set_yticks([])
    before: dict[str, Any] = {"ha": "right", "va": "center_baseline", "fontsize": style.SMALL}
    figure.text((left - 0.8) / width, middle / height, "$t$ [s]: 0", **before)
    after = before | {"ha": "left"}
    figure.text((left + _BAR[0] + 0.8) / width, middle / height, until, **after)


def _number(value: float) -> tuple[str, int]:
    """Return a number with four digits as text, and the length of the text in characters."""
    plain = f"{value:.4g}"
    if "e" not in plain:
        return plain, len(plain)
    digits, power = plain.split("e")
    return rf"${digits}\times 10^{{{int(power)}}}$", len(digits) + 4
