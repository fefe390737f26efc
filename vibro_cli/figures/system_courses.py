"""Charts over time of the systems besides the trace: energies with their jumps, places."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vibro_cli.figures import style
from vibro_cli.figures.chart import (
    MOST_VECTOR_POINTS,
    TOTAL,
    body_entries,
    body_look,
    legend,
    log_axis,
    stacked,
    time_axis,
    value_axis,
)
from vibro_cli.figures.over_time import IMPACT, LOSS
from vibro_cli.figures.source import Array
from vibro_cli.systems.springs.run import SpringsRun
from vibro_cli.systems.table.run import TableRun

SAMPLES = 800
"""Instants at which the motion is drawn, beside those of the impacts."""
MOST_IMPACTS = 2000
"""Impacts that are drawn: of more only the first part of the run."""
_HIGH = {"single": (34.0, 20.0), "double": (44.0, 24.0)}


def course(run: TableRun | SpringsRun, name: str) -> tuple[Array, Array]:
    """Return times (s) and a column of the motion then, [time, body]; impacts stand twice."""
    logs = [run.impact_table(table)["t"] for table in run.IMPACT_TABLES]
    impacts = np.unique(np.concatenate(logs))[:MOST_IMPACTS]
    end = run.end_time if len(impacts) < MOST_IMPACTS else float(impacts[-1])
    parts = [(np.linspace(0.0, end, SAMPLES), "after"), (impacts, "before"), (impacts, "after")]
    values = [run.sample(t, side)[name].reshape(len(t), -1) for t, side in parts]
    times = np.concatenate([t for t, _ in parts])
    rank = np.concatenate([np.full(len(t), n % 3) for n, (t, _) in enumerate(parts, 2)])
    order = np.lexsort((rank, times))
    return times[order], np.concatenate(values)[order]


def system_energies(run: TableRun | SpringsRun, width: str = "single") -> Figure | None:
    """Return the energy of each body and of all against time, and what the impacts lose.

    None for a table where no energy changes.
    """
    losses = [run.impact_table(table) for table in run.IMPACT_TABLES]
    t, lost = (np.concatenate([table[name] for table in losses]) for name in ("t", "energy_loss"))
    if isinstance(run, TableRun) and len(run.system.bodies) == 1 and not np.any(lost > 0.0):
        return None
    with style.journal():
        lossy = bool(np.any(lost > 0.0))
        figure, panels, across = stacked(width, _HIGH[width][: 2 if lossy else 1])
        times, energies = course(run, "energy")
        _curves(panels[0], times, energies)
        top = energies
        if energies.shape[1] > 1:
            top = energies.sum(axis=1)
            panels[0].plot(times, top, zorder=2.1, **TOTAL)
        end = float(times[-1])
        time_axis(panels[0], end, across[0], labelled=not lossy)
        value_axis(panels[0], 0.0, float(np.max(top)), _HIGH[width][0], "$E$", "J")
        if lossy:
            shown = (lost > 0.0) & (t <= end)
            log_axis(panels[1], lost, r"$\Delta E$", "J")
            panels[1].plot(t[shown], lost[shown], linestyle="none", **LOSS)
            time_axis(panels[1], end, across[1], labelled=True)
        total = [("sum", TOTAL)] if energies.shape[1] > 1 else []
        legend(figure, [*body_entries(run), *total])
    return figure


def springs_places(run: SpringsRun, width: str = "single") -> Figure:
    """Return the place of every body along the line against time, with the impacts and the feet."""
    high = 1.5 * _HIGH[width][0]
    with style.journal():
        figure, (axes,), across = stacked(width, [high])
        times, places = course(run, "x")
        _curves(axes, times, places)
        for ball, spring in enumerate(run.system.springs, 1):
            look = body_look(ball) | {"linewidth": 0.5, "alpha": 0.6}
            axes.axhline(spring.foot, zorder=0.9, **look)
        rows = run.collisions
        shown = rows["t"] <= times[-1]
        size = float(np.clip(30.0 / max(np.sqrt(np.sum(shown)), 1.0), 1.0, IMPACT["markersize"]))
        for end in "ab":
            look = IMPACT | {"markersize": size}
            axes.plot(rows["t"][shown], rows[f"x_{end}"][shown], zorder=2.3, **look)
        time_axis(axes, float(times[-1]), across[0], labelled=True)
        feet = [spring.foot for spring in run.system.springs]
        low, top = min(float(np.min(places)), *feet), max(float(np.max(places)), *feet)
        value_axis(axes, low, top, high, "$x$", "m")
        marks = [("impact", IMPACT)] if np.any(shown) else []
        legend(figure, [*body_entries(run), *marks])
    return figure


def _curves(axes: Any, times: Array, values: Array) -> None:
    """Draw a column of every body."""
    for ball in range(1, values.shape[1] + 1):
        (line,) = axes.plot(times, values[:, ball - 1], zorder=2.0, **body_look(ball))
        line.set_rasterized(len(times) > MOST_VECTOR_POINTS)
