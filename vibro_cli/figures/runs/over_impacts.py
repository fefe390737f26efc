"""Charts of a run over its impacts: impact map, intervals, gaps, energy error, exponents."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from vibro_cli.figures import style
from vibro_cli.figures.chart import (
    BAND,
    BAND_KEY,
    MOST_VECTOR_POINTS,
    body_look,
    count_axis,
    distinct_lines,
    draw_by_colour,
    last_in_each_pixel,
    log_axis,
    positive_axis,
    stacked,
    time_axis,
    value_axis,
)
from vibro_cli.figures.labels import Bar, Entry, draw_legend
from vibro_cli.figures.portraits import layers
from vibro_cli.figures.runs.over_time import energy_residuals, room_after
from vibro_cli.figures.source import Array, Recorded, Table, goes_through, kept, why_not_made
from vibro_cli.figures.style import Look, line, mark, panel_size
from vibro_cli.figures.ticks import angle_ticks, label_axis, limits_apart, number_ticks
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.mechanics.trace import VALLEY, Piece
from vibro_cli.systems.columns import made

_HIGH = {"single": 46.0, "double": 56.0}
_SMALL = {"single": 26.0, "double": 30.0}
DOT = mark("o", 2.2, style.BLUE)
REFUSED = layers.NOT_MADE
_EQUAL = 1e-9
"""Range of places, as a share of the margin around equal ones, that counts as rounding."""
ROUNDING = line(style.VERMILLION, 0.6, (4.0, 2.0))


def impact_map(run: Recorded, width: str = "single") -> Figure | None:
    """Draw approach speed against place of every impact, coloured by its number.

    The place is the arc length of the left body's contact point or, if all impacts are on one arc,
    its angle there. Returns None if there are fewer than two impacts.
    """
    if len(run.collisions["n"]) < 2:
        return None
    arc, trace = _only_arc(run), run.system.trace
    if arc is None:
        junctions = [piece.start_s for piece in trace.pieces[1:]]
        named = "$s$ of the left body", "m"
        return speed_map(run.collisions, "s_a", named, 0.05 * trace.length, width, junctions)
    symbol = r"$\varphi$" if arc.shape == VALLEY else r"$\psi$"
    extent = arc.angle_end - arc.angle_start
    named = f"{symbol} of the left body", "rad"
    return speed_map(run.collisions, "angle_a", named, 0.05 * extent, width)


def speed_map(
    table: Table,
    column: str,
    named: tuple[str, str],
    room: float,
    width: str,
    lines: Sequence[float] = (),
) -> Figure:
    """Draw approach speed against the places of impacts, of which there is at least one.

    They are coloured by their numbers. `column` has the places; `named` are their name, in words or
    as a symbol, and their unit. `room` is the margin on both sides if all places are equal up to
    rounding; `lines` are places of vertical lines.
    """
    number = np.asarray(table["n"])
    place = np.asarray(table[column], dtype=np.float64)
    speed = np.asarray(table["approach_speed"], dtype=np.float64)
    happened = made(table)
    with style.journal():
        figure, (axes,) = stacked(width, [_HIGH[width]])
        size = _dot(len(number))
        if len(number) <= MOST_VECTOR_POINTS:
            axes.scatter(place, speed, c=number, cmap=style.time_colours(), s=size, zorder=2.0)
        if not np.all(happened):
            why = why_not_made(goes_through(table)[~happened])
            axes.plot(place[~happened], speed[~happened], zorder=2.2, label=why, **REFUSED)
            axes.legend(loc="best", borderpad=0.2, handletextpad=0.2)
        positive_axis(axes, speed, "approach speed", "m/s")
        low, high = float(np.min(place)), float(np.max(place))
        room = 0.08 * (high - low) if high - low > _EQUAL * room else room
        low, high = limits_apart(low - room, high + room)
        axes.set_xlim(low, high)
        ticked = angle_ticks if named[1] == "rad" else number_ticks
        ticks = ticked(low, high, panel_size(axes)[0])
        label_axis(axes.xaxis, ticks, *named)
        for at in distinct_lines(lines, (low, high), panel_size(axes)[0]):
            axes.axvline(at, color=style.LEVEL_GREY, linewidth=0.4, zorder=0.8)
        if len(number) > MOST_VECTOR_POINTS:
            shades = ScalarMappable(Normalize(1.0, len(number)), style.time_colours())
            draw_by_colour(axes, place, speed, number, shades, zorder=2.0, **_small(size))
        draw_legend(figure, [], Bar("impact 1", str(len(number))))
    return figure


def _only_arc(run: Recorded) -> Piece | None:
    """Return the arc on which the left body of every impact is, None if there is no such arc."""
    pieces = np.unique(run.collisions["arc_a"])
    piece = run.system.trace.pieces[int(pieces[0]) - 1]
    return None if len(pieces) > 1 or piece.is_line else piece


def _dot(number: int) -> float:
    """Return the area of a dot (pt²), the smaller the more dots there are."""
    return float(np.clip(1200.0 / number, 1.0, 9.0))


def _small(size: float) -> Look:
    """Return the style of one of very many dots, without an edge, of an area (pt²)."""
    return {"marker": "o", "markersize": math.sqrt(size), "markeredgewidth": 0.0}


def intervals(run: Recorded, width: str = "single") -> Figure | None:
    """Draw the intervals between impacts against their number: a straight line if they accumulate.

    Simultaneous impacts, whose interval is 0, are not shown. Returns None if there are no others.
    """
    table = run.collisions
    number = np.asarray(table["n"])
    between = np.array(table["dt"], dtype=np.float64)
    if not np.any(between > 0.0):
        return None
    together = int(np.sum(between == 0.0))
    without = f" ({together} of length 0 not shown)" if together else ""
    entries: list[Entry] = [(f"time since the previous impact{without}", DOT)]
    with style.journal():
        figure, (axes,) = stacked(width, [_HIGH[width]], entries=entries)
        positive_axis(axes, between, r"$\Delta t$", "s")
        count_axis(axes, number)
        _draw_dots(axes, number, np.where(between > 0.0, between, math.nan))
    return figure


def accuracy(run: Recorded, width: str = "single") -> Figure | None:
    """Draw the residual gap of each impact and the energy error of each free flight.

    Returns None if there are neither impacts nor free flights.
    """
    table = run.collisions
    gap = np.abs(np.asarray(table["gap"], dtype=np.float64))
    time, error = _errors(run)
    end = float(np.max(run.flights()["t_end"]))
    if not len(gap) + len(time):
        return None
    entries = [("error (0: at the lower edge)", DOT), (r"$2^{-52}$", ROUNDING)]
    with style.journal():
        heights = [_SMALL[width]] * (bool(len(gap)) + bool(len(time)))
        figure, panels = stacked(width, heights, entries=entries[: 1 + bool(len(time))])
        for axes in panels:
            time_axis(axes, end, labelled=axes is panels[-1])
        if len(gap):
            least = EPSILON * max(body.radius for body in run.system.bodies)
            _residuals(panels[0], (np.asarray(table["t"]), gap), least, "gap", "m")
        if len(time):
            _residuals(panels[-1], (time, error), EPSILON, r"$|\delta E|/E_0$", "")
            panels[-1].axhline(EPSILON, zorder=1.0, **ROUNDING)
    return figure


@kept
def _errors(run: Recorded) -> tuple[Array, Array]:
    """Return the ends (s) of free flights and their energy errors."""
    times, changes = zip(*energy_residuals(run), strict=True)
    return np.concatenate(times), np.abs(np.concatenate(changes))


def _residuals(axes: Axes, over: tuple[Array, Array], least: float, symbol: str, unit: str) -> None:
    """Draw residuals on a logarithmic axis; those that are exactly 0 lie on its lower edge.

    `over` are times (s) and residuals, `least` is one that the axis has in any case.
    """
    time, values = over
    log_axis(axes, np.append(values, least), symbol, unit)
    bottom = axes.get_ylim()[0]
    shown = np.where(values > 0.0, values, bottom)
    _draw_dots(axes, time, shown, clip_on=False)


def _draw_dots(axes: Axes, across: Array, along: Array, **look: Any) -> None:
    """Draw a dot for each point; the limits of the axes must be set."""
    size = _dot(len(along))
    if len(along) > MOST_VECTOR_POINTS:
        rows = last_in_each_pixel(axes, across, along)
        axes.plot(across[rows], along[rows], rasterized=True, **(DOT | look | _small(size)))
    else:
        axes.plot(across, along, **(DOT | look | {"markersize": math.sqrt(size)}))


_ERRORS = 2.0
_SETTLED = 0.1
"""Share of the time span of the impacts that is left out at the start, where curves jump."""


def exponents(run: Any, width: str = "single") -> Figure | None:
    """Draw the exponents of the run up to each of its impacts, and the error of the greatest.

    The transient at the beginning is left out. Returns None if the run has no exponents or fewer
    than two impacts.
    """
    table = run.exponents
    if table is None or len(table["t"]) < 2:
        return None
    t = np.asarray(table["t"], dtype=np.float64)
    first = min(int(np.searchsorted(t, t[0] + _SETTLED * (t[-1] - t[0]))), len(t) - 2)
    t = t[first:]
    names = [name for name in table if name.startswith("lyapunov_") and name != "lyapunov_error"]
    rates = [np.asarray(table[name], dtype=np.float64)[first:] for name in names]
    error = _ERRORS * np.asarray(table["lyapunov_error"], dtype=np.float64)[first:]
    band_edges = rates[0] - error, rates[0] + error
    band: Entry = (r"$\lambda_1\pm 2$ standard errors", BAND_KEY)
    entries = [
        (rf"$\lambda_{{{n}}}$", body_look(n))
        for n, rate in enumerate(rates, 1)
        if np.isfinite(rate).any()
    ]
    with style.journal():
        figure, (axes,) = stacked(width, [_HIGH[width]], entries=[*entries, band])
        axes.fill_between(t, *band_edges, **BAND)
        axes.axhline(0.0, color=style.FRAME_GREY, linewidth=0.4)
        for n, rate in enumerate(rates, 1):
            axes.plot(t, rate, **body_look(n))
        value_axis(axes, np.concatenate([*rates, *band_edges, [0.0]]), r"$\lambda$", "1/s")
        time_axis(axes, room_after(float(t[-1]), t))
    return figure
