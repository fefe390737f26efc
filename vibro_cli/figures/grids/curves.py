"""Curves of a grid over one of its axes, and the diagram of the places of all impacts."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from vibro_cli.figures import style
from vibro_cli.figures.chart import MOST_VECTOR_POINTS, log_axis, number_bar, stacked, value_axis
from vibro_cli.figures.dots import draw_dots
from vibro_cli.figures.grids.maps import Endings, Lattice, Swept, ended, lattice, set_axis
from vibro_cli.figures.labels import LINE, wrapped_legend
from vibro_cli.figures.source import Array
from vibro_cli.figures.style import WIDTHS
from vibro_cli.mechanics.trace import HUMP, VALLEY
from vibro_cli.systems.wanted import FINAL

_HIGH = {"single": (26.0,) * 4, "double": (34.0,) * 4}
_DIAGRAM = {"single": 58.0, "double": 80.0}
_WIDE_RANGE = 50.0
FIRST = 20
"""Impacts of each run whose times are shown."""
ENDED: dict[str, Any] = {
    "marker": "x",
    "markersize": 3.0,
    "markeredgewidth": 0.7,
    "color": style.VERMILLION,
    "linestyle": "none",
    "zorder": 2.5,
}
PLACES = (
    ("s_a", "$s$ of the left body", "m"),
    ("x_a", "$x$ of the left body", "m"),
)
"""Columns of the place of an impact, on whatever arc it is."""
_ANGLES = {VALLEY: r"$\varphi$ of the left body", HUMP: r"$\psi$ of the left body"}


def curves(grid: Swept, width: str = "single") -> Figure | None:
    """Return impacts, energy left and time of the first impact over the axis with most values.

    On a table the impacts on the wall too.

    Dots in the colours of the ending. None where no axis of numbers changes.
    """
    shown = lattice(grid, 1, numbers_first=True)
    if shown is None:
        return None
    endings = Endings.of(grid, shown.rows)
    table = {name: np.asarray(grid.summary[name][shown.rows], dtype=np.float64) for name in _NEEDED}
    kept = table["energy_end"] / np.where(table["energy_start"] > 0.0, table["energy_start"], 1.0)
    counts = [
        (np.asarray(grid.summary[name][shown.rows], dtype=np.float64), symbol, "")
        for name, symbol in (("collisions", "impacts"), ("bounces", "on the wall"))
        if name in grid.summary
    ]
    panels = [
        *([one for one in counts if np.nansum(one[0]) > 0.0] or counts[:1]),
        (kept, r"$E_\mathrm{end}/E_0$", ""),
        (table["first_collision_time"], "first impact", "s"),
    ]
    panels = [one for one in panels if np.any(np.isfinite(one[0]))]
    panels = [one for one in panels if np.nanmin(one[0]) < np.nanmax(one[0])] or panels[:1]
    with style.journal():
        lines = wrapped_legend(None, endings.entries(), WIDTHS[width])
        heights = _HIGH[width][: len(panels)]
        figure, drawn, across = stacked(width, heights, 2.0 + lines * LINE)
        for axes, (values, symbol, unit), wide, high in zip(
            drawn, panels, across, _HIGH[width], strict=False
        ):
            _dots(axes, shown, values, endings)
            _value(axes, values, high, symbol, unit)
            set_axis(axes, shown.coordinates[0], wide, vertical=False)
            if axes is not drawn[-1]:
                axes.set_xlabel("")
                axes.set_xticklabels([])
        wrapped_legend(figure, endings.entries(), WIDTHS[width])
    return figure


_NEEDED = ("energy_start", "energy_end", "first_collision_time")


def _dots(axes: Axes, shown: Lattice, values: Array, endings: Endings) -> None:
    size = float(np.clip(1500.0 / len(values), 0.5, 7.0))
    look: dict[str, Any] = {
        "edgecolors": style.FRAME_GREY,
        "linewidths": 0.2 if size > 2.0 else 0.0,
    }
    dots = axes.scatter(
        shown.coordinates[0].place,
        values,
        c=endings.code,
        cmap=endings.colours(),
        norm=endings.norm(),
        s=size,
        zorder=2.0,
        **look,
    )
    dots.set_rasterized(len(values) > MOST_VECTOR_POINTS)


def _value(axes: Axes, values: Array, high: float, symbol: str, unit: str) -> None:
    finite = values[np.isfinite(values)]
    low, top = float(np.min(finite)), float(np.max(finite))
    if low > 0.0 and top > _WIDE_RANGE * low:
        log_axis(axes, finite, symbol, unit)
    else:
        value_axis(axes, low if unit else min(low, 0.0), top, high, symbol, unit)


def place_column(grid: Swept) -> tuple[str, str, str] | None:
    """Return column, symbol and unit of the place of the impacts that were kept, if one was.

    The angle on a trace that is one arc; those of several arcs are not of one axis.
    """
    kept = grid.impact_columns()
    if len(grid.shapes) == 1 and grid.shapes[0] in _ANGLES and "angle_a" in kept:
        return "angle_a", _ANGLES[grid.shapes[0]], "rad"
    return next((one for one in PLACES if one[0] in kept), None)


def diagram(grid: Swept, width: str = "single") -> Figure | None:
    """Return the places of all impacts over the axis with most values, coloured by their number.

    None where no impact was kept with its number and place, or no axis of numbers changes.
    """
    return _impacts_over(grid, width, place_column(grid), None)


def first_times(grid: Swept, width: str = "single") -> Figure | None:
    """Return the times of the first impacts of each run over the axis with most values.

    With the ends of runs that were cut short before. None where no impact was kept with its number
    and time, or no axis of numbers changes.
    """
    time = ("t", "$t$ of the impact", "s") if "t" in grid.impact_columns() else None
    return _impacts_over(grid, width, time, FIRST)


def _impacts_over(
    grid: Swept, width: str, shown_column: tuple[str, str, str] | None, most: int | None
) -> Figure | None:
    """Return a column (name, symbol, unit) of the first impacts, or of all, over one axis."""
    shown = lattice(grid, 1, numbers_first=True)
    if shown_column is None or shown is None or "n" not in grid.impact_columns():
        return None
    name, symbol, unit = shown_column
    scenarios = grid.summary["scenario"][shown.rows]
    impacts = grid.impacts(["scenario", "n", name], scenarios)
    number = np.asarray(impacts["n"], dtype=np.float64)
    values = np.asarray(impacts[name], dtype=np.float64)
    kept = np.isfinite(values) & (number <= (np.inf if most is None else most))
    if not np.any(kept):
        return None
    order = np.argsort(scenarios)
    row = order[np.searchsorted(scenarios, impacts["scenario"][kept], sorter=order)]
    number, values = number[kept], values[kept]
    places, ends = _early_ends(grid, shown, most) if name == "t" else (np.empty(0), np.empty(0))
    every = np.concatenate([values, ends])
    with style.journal():
        figure, (axes,), across = stacked(width, [_DIAGRAM[width]])
        value_axis(axes, float(np.min(every)), float(np.max(every)), _DIAGRAM[width], symbol, unit)
        set_axis(axes, shown.coordinates[0], across[0], vertical=False)
        size = float(np.clip(6000.0 / len(values), 0.15, 4.0))
        norm = Normalize(float(np.min(number)), float(np.max(number)))
        along = shown.coordinates[0].place[row]
        draw_dots(axes, along, values, number, style.time_colours(), norm, size)
        if len(ends):
            axes.plot(places, ends, **ENDED)
        number_bar(figure, int(np.max(number)), [("run ended", ENDED)] if len(ends) else [])
    return figure


def _early_ends(grid: Swept, shown: Lattice, most: int | None) -> tuple[Array, Array]:
    """Return places and times (s) of the ends of runs that were cut short, with few impacts."""
    early = np.isin(ended(grid)[shown.rows].astype(str), FINAL)
    if most is not None:
        early &= np.asarray(grid.summary["collisions"])[shown.rows] < most
    times = np.asarray(grid.summary["end_time"], dtype=np.float64)[shown.rows]
    early &= np.isfinite(times)
    return shown.coordinates[0].place[early], times[early]
