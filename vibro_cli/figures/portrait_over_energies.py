"""Two panels over the same places: a phase portrait, and below it energies."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from vibro_cli.figures import strokes
from vibro_cli.figures.chart import LEFT, stacked
from vibro_cli.figures.legend import LINE
from vibro_cli.figures.panels import Panel, Window
from vibro_cli.figures.source import Array
from vibro_cli.figures.ticks import number_ticks, vertical_ticks, with_power
from vibro_cli.figures.trajectory import Trajectory

_HIGH = (58.0, 36.0)
"""Heights of the portrait and of the energies (mm)."""
_TOP = 4.5
"""Room for the first line of the legend (mm)."""


def panels_over(width: str, window: Window, lines: int) -> tuple[Figure, Panel, Panel]:
    """Return a figure with the portrait and, below it, the energies."""
    above = _TOP + LINE * (lines - 1)
    figure, (upper, lower), across = stacked(width, _HIGH, above)
    panels = [
        Panel(axes, window, True, wide, high, LEFT, row)
        for row, (axes, wide, high) in enumerate(zip((upper, lower), across, _HIGH, strict=True))
    ]
    upper.set_ylim(-window.top, window.top)
    for axes, wide, labelled in zip((upper, lower), across, (False, True), strict=True):
        axes.set_xlim(window.low, window.high)
        ticks = number_ticks(window.low, window.high, wide)
        axes.set_xticks(ticks.places, ticks.labels if labelled else ("",) * len(ticks.labels))
    return figure, panels[0], panels[1]


def limit_energies(lower: Panel, highest: float, lowest: float = 0.0) -> None:
    """Set the axis of the energies (J)."""
    top = highest if highest > lowest else lowest + 1.0
    lower.axes.set_ylim(lowest, top)
    ticks = vertical_ticks(lowest, top, lower.height)
    lower.axes.set_yticks(ticks.places, ticks.labels)
    scaled = with_power("J", ticks)
    lower.axes.set_ylabel(f"$E$ [{scaled}]", labelpad=1.0)


def draw_energies(lower: Panel, path: Trajectory, energies: Array, until: float | None) -> None:
    """Draw the total energy of each branch over the place; it changes in lasting contact alone.

    `until` is the time (s) with which the colours of time end, None for one colour.
    """
    (branches,) = path.branches
    order = np.argsort(branches.time, kind="stable")
    for contact, own in ((False, strokes.BRANCH), (True, strokes.CONTACT)):
        rows = order[branches.contact[order] == contact]
        if not len(rows):
            continue
        if contact:
            lines = [np.column_stack([branches.position[n], energies[n]]) for n in rows]
        else:
            spans = [(np.min(branches.position[n]), np.max(branches.position[n])) for n in rows]
            lines = [
                np.column_stack([span, [energies[n, 0]] * 2])
                for n, span in zip(rows, spans, strict=True)
            ]
        look: dict[str, Any] = own | {"linewidth": strokes.thinner(0.7, len(order))}
        if until is not None and not contact:
            look = strokes.by_time(look, branches.time[rows], until)
        collection = LineCollection(lines, zorder=2.0, **look)
        collection.set_rasterized(sum(map(len, lines)) > strokes.MOST_VECTOR_POINTS)
        lower.axes.add_collection(collection, autolim=False)
