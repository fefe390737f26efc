"""The bifurcation diagram of a grid: where and how fast the last impacts of each run are."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure

from vibro_cli.figures import style
from vibro_cli.figures.chart import stacked, value_axis
from vibro_cli.figures.dots import draw_dots
from vibro_cli.figures.grid_curves import place_column
from vibro_cli.figures.lattice import Swept, lattice, set_axis

LAST = 20
"""Impacts of each run that are shown."""
_SPEED = ("speed_a_pre", r"$v_a$ before", "m/s")
_HIGH = {"single": 40.0, "double": 52.0}


def bifurcation(grid: Swept, width: str = "single") -> Figure | None:
    """Return place and speed of the last impacts of each run over the axis with most values.

    None where no run kept more impacts than the last ones, or no axis of numbers changes.
    """
    kept = grid.impact_columns()
    place = place_column(grid)
    panels = [one for one in (place, _SPEED) if one is not None and one[0] in kept]
    shown = lattice(grid, 1, numbers_first=True)
    if not panels or shown is None or "n" not in kept:
        return None
    scenarios = grid.summary["scenario"][shown.rows]
    impacts = grid.impacts(["scenario", "n", *(name for name, _, _ in panels)], scenarios)
    order = np.argsort(scenarios)
    row = order[np.searchsorted(scenarios, impacts["scenario"], sorter=order)]
    number = np.asarray(impacts["n"], dtype=np.float64)
    most = np.zeros(len(scenarios))
    np.maximum.at(most, row, number)
    if not np.any(most > LAST):
        return None
    last = number > most[row] - LAST
    across = shown.coordinates[0]
    with style.journal():
        figure, drawn, wide = stacked(width, [_HIGH[width]] * len(panels), 2.0)
        for axes, (name, symbol, unit), inner in zip(drawn, panels, wide, strict=True):
            values = np.asarray(impacts[name], dtype=np.float64)[last]
            finite = values[np.isfinite(values)]
            low, high = (float(np.min(finite)), float(np.max(finite))) if len(finite) else (0, 1)
            value_axis(axes, low, high, _HIGH[width], symbol, unit)
            set_axis(axes, across, inner, vertical=False)
            black, size = ListedColormap([style.BLACK]), float(np.clip(6000 / len(values), 0.15, 4))
            ones = np.ones(len(values))
            draw_dots(axes, across.place[row][last], values, ones, black, Normalize(0, 1), size)
            if axes is not drawn[-1]:
                axes.set_xlabel("")
                axes.set_xticklabels([])
    return figure
