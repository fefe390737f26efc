"""Charts of a run over time: energies with their jumps, and the space-time diagram."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vibro_cli.figures import style
from vibro_cli.figures.chart import (
    MOST_VECTOR_POINTS,
    TOTAL,
    band_entry,
    body_entries,
    body_look,
    contact_times,
    draw_contacts,
    legend,
    log_axis,
    stacked,
    time_axis,
    value_axis,
)
from vibro_cli.figures.source import Array, Recorded
from vibro_cli.figures.timeline import energy_course, shown_until, timeline

_HIGH = {"single": (34.0, 20.0), "double": (44.0, 24.0)}
MOST_STEMS = 2000
"""Of more losses than this only the points are drawn."""
LOSS: dict[str, Any] = {"color": style.VERMILLION, "marker": "o", "markersize": 1.8}
IMPACT: dict[str, Any] = {
    "marker": "o",
    "markersize": 2.4,
    "markerfacecolor": "white",
    "markeredgecolor": style.BLACK,
    "markeredgewidth": 0.5,
    "linestyle": "none",
}


def energies(run: Recorded, width: str = "single") -> Figure | None:
    """Return the energy of each body and of all against time, and what impacts lose, if they do.

    None for a trace that turns about a vertical: its energy is another one.
    """
    if run.system.turning is not None:
        return None
    table = run.collisions
    losses = np.asarray(table["energy_loss"], dtype=np.float64)
    with style.journal():
        lossy = bool(np.any(losses > 0.0))
        figure, panels, across = stacked(width, _HIGH[width][: 2 if lossy else 1])
        end = float(np.max(run.flights()["t_end"]))
        spans = contact_times(run)
        for axes in panels:
            draw_contacts(axes, spans)
        highest = _draw_energies(panels[0], run)
        time_axis(panels[0], end, across[0], labelled=len(panels) == 1)
        value_axis(panels[0], 0.0, highest, _HIGH[width][0], "$E$", "J")
        if lossy:
            _draw_losses(panels[1], np.asarray(table["t"]), losses)
            time_axis(panels[1], end, across[1], labelled=True)
        total = [("sum", TOTAL)] if len(run.system.bodies) > 1 else []
        legend(figure, [*body_entries(run), *total, *band_entry(spans)])
    return figure


def _draw_energies(axes: Any, run: Recorded) -> float:
    """Draw the steps of each body and of the sum; return the highest energy (J)."""
    courses = [energy_course(run, ball) for ball in range(1, len(run.system.bodies) + 1)]
    for ball, (time, energy) in enumerate(courses, 1):
        axes.plot(time, energy, zorder=2.0, **body_look(ball))
    highest = max(float(np.max(energy)) for _, energy in courses)
    if len(courses) > 1:
        times = np.unique(np.concatenate([time for time, _ in courses]))
        sides = np.sort(np.concatenate([np.nextafter(times, side) for side in (-np.inf, np.inf)]))
        total = np.sum([np.interp(sides, time, energy) for time, energy in courses], axis=0)
        axes.plot(sides, total, zorder=2.1, **TOTAL)
        highest = max(highest, float(np.max(total)))
    for line in axes.lines:
        line.set_rasterized(len(line.get_xdata()) > MOST_VECTOR_POINTS)
    return highest


def _draw_losses(axes: Any, times: Array, losses: Array) -> None:
    """Draw the losses at the impacts on a logarithmic axis, where none has no place."""
    shown = losses > 0.0
    log_axis(axes, losses, r"$\Delta E$", "J")
    bottom = axes.get_ylim()[0]
    if len(times) <= MOST_STEMS:
        axes.vlines(times[shown], bottom, losses[shown], linewidth=0.4, color=style.LEVEL_GREY)
    axes.plot(times[shown], losses[shown], linestyle="none", **LOSS)
    for artist in (*axes.lines, *axes.collections):
        artist.set_rasterized(len(times) > MOST_VECTOR_POINTS)


def space_time(run: Recorded, width: str = "single") -> Figure | None:
    """Return the arc length of every body against time, with impacts and lasting contacts.

    Of a long run, the first part only.
    """
    until = shown_until(run)
    high = 1.5 * _HIGH[width][0]
    low, high_s = run.system.trace.length, 0.0
    with style.journal():
        figure, (axes,), across = stacked(width, [high])
        spans = contact_times(run)
        draw_contacts(axes, [span for span in spans if span[0] < until])
        for piece in run.system.trace.pieces[1:]:
            axes.axhline(piece.start_s, color=style.LEVEL_GREY, linewidth=0.4, zorder=0.8)
        for ball in range(1, len(run.system.bodies) + 1):
            line = timeline(run, ball, until)
            (drawn,) = axes.plot(line.time, line.s, zorder=2.0, **body_look(ball))
            drawn.set_rasterized(len(line.time) > MOST_VECTOR_POINTS)
            low, high_s = min(low, float(np.nanmin(line.s))), max(high_s, float(np.nanmax(line.s)))
        struck = _draw_impacts(axes, run, until)
        time_axis(axes, until, across[0], labelled=True)
        value_axis(axes, low, high_s, high, "$s$", "m")
        marks = [("impact", IMPACT)] if struck else []
        legend(figure, [*body_entries(run), *marks, *band_entry(spans)])
    return figure


def _draw_impacts(axes: Any, run: Recorded, until: float) -> bool:
    """Mark both bodies at each impact, as long as the marks can be told apart."""
    table = run.collisions
    times = np.asarray(table["t"], dtype=np.float64)
    shown = times <= until
    size = float(np.clip(30.0 / max(np.sqrt(np.sum(shown)), 1.0), 1.0, IMPACT["markersize"]))
    look = IMPACT | {"markersize": size, "markeredgewidth": 0.5 * size / IMPACT["markersize"]}
    for side in "ab":
        places = np.asarray(table[f"s_{side}"], dtype=np.float64)
        axes.plot(times[shown], places[shown], zorder=2.3, **look)
    return bool(np.any(shown))
