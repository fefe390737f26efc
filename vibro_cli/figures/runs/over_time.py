"""Charts of a run over time: energies with their jumps, and the space-time diagram."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from vibro_cli.analysis.levels import Landscape
from vibro_cli.figures import style
from vibro_cli.figures.chart import (
    MOST_VECTOR_POINTS,
    TOTAL,
    band_entry,
    body_entries,
    body_look,
    contact_times,
    distinct_lines,
    draw_contacts,
    positive_axis,
    stacked,
    time_axis,
    value_axis,
)
from vibro_cli.figures.labels import short_number
from vibro_cli.figures.portraits.trajectory import pace
from vibro_cli.figures.source import Array, Integers, Recorded, Table, flights_of, kept
from vibro_cli.figures.style import mark, panel_size
from vibro_cli.figures.ticks import round_below
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.mechanics.trace import Piece
from vibro_cli.systems.columns import made

MOST_FLIGHTS = 3000
"""Number of flights, of all bodies together, that are drawn over time; later ones are left out."""
MOST_PERIODS = 60
"""Number of small oscillations that are drawn over time; later ones are left out."""
_POINTS = 4000
"""Points of a line over time, besides those at events."""
_MOST_POINTS = 200 * 2500
"""Most points of an energy in lasting contact: 200 for each strip narrower than a pixel."""


def shown_until(run: Recorded) -> float:
    """Return the time (s) up to which the motion is drawn, before lines become too dense."""
    flights = run.flights()
    starts = np.sort(flights["t_start"])
    end = _end(run)
    # On lines each flight is a parabola of its own; on circle arcs the periods set the limit.
    most = 4 * MOST_PERIODS if math.isinf(_periods(run)) else MOST_FLIGHTS
    if len(starts) > most:
        end = float(starts[most])
    return min(end, _periods(run))


def _end(run: Recorded) -> float:
    return float(np.max(run.flights()["t_end"]))


@kept
def _places(run: Any, until: float) -> tuple[Array, Array]:
    """Return times (s) up to `until`, with those of all events, and the arc lengths (m) then.

    Arc lengths have the shape (times, bodies).
    """
    starts = run.flights()["t_start"]
    times = np.unique(np.append(np.linspace(0.0, until, _POINTS), starts[starts <= until]))
    bodies = len(run.system.bodies)
    parts = np.array_split(times, 1 + len(times) * bodies // _AT_ONCE)  # to save memory
    s = np.concatenate([np.asarray(run.sample(part)["s"]) for part in parts])
    return times, s.reshape(-1, bodies)


def timeline(run: Any, ball: int, until: float) -> tuple[Array, Array]:
    """Return non-decreasing times (s) up to `until`, and the arc length (m) of a body (from 1).

    NaN marks the breaks of the line at the seam of a closed trace.
    """
    times, places = _places(run, until)
    s = places[:, ball - 1]
    seams = np.flatnonzero(np.abs(np.diff(s)) > 0.5 * run.system.trace.length) + 1
    return np.insert(times, seams, times[seams]), np.insert(s, seams, math.nan)


def calm_until(run: Recorded) -> float:
    """Return the time (s) up to which energies are drawn.

    It is the end of the run, or, in lasting contact without impacts at the end, the time after as
    many periods as a chart can distinguish.
    """
    flights = run.flights()
    end = _end(run)
    struck = np.asarray(run.collisions["t"], dtype=np.float64)
    contact = flights["contact"]
    begun = flights["t_start"][contact & (flights["t_end"] == end)]
    if not len(begun):
        return end
    joined = flights["cause_start"] == "contact_closed"
    closed = flights["t_start"][joined]
    return min(end, float(np.max(np.concatenate([struck, closed, [0.0]]))) + _periods(run))


def _periods(run: Recorded) -> float:
    """Return the duration (s) of `MOST_PERIODS` of the slowest oscillation; infinite on lines."""
    arcs = [piece for piece in run.system.trace.pieces if not piece.is_line]
    if not arcs or run.system.gravity <= 0.0:
        return math.inf
    slowest = max(math.sqrt(arc.radius / run.system.drive(arc)) for arc in arcs)
    return MOST_PERIODS * 2.0 * math.pi * slowest


def energy_course(run: Recorded, ball: int, until: float = math.inf) -> tuple[Array, Array]:
    """Return times (s) up to `until` and the energy (J) of a body (from 1) at each.

    The energy is constant during a free flight. In lasting contact, where bodies exchange energy,
    it is sampled. Times of jumps appear twice.
    """
    flights = run.flights()
    hills = Landscape.of(run.system, ball)
    mine = flights_of(flights, ball, until)
    mine, last = _kept_levels(flights, mine)
    contact = flights["contact"][mine]
    starts, ends = flights["t_start"][mine], np.minimum(flights["t_end"][last], until)
    most = _MOST_POINTS / (min(until, _end(run)) or 1.0)
    level = np.empty(len(mine))
    rows, times, energies = [], [], []
    for piece in run.system.trace.pieces:
        here = flights["arc"][mine] == piece.index + 1
        begun = flights["angle_start"][mine[here]], flights["rate_start"][mine[here]]
        level[here] = hills.energy(piece, *begun)
        bound = mine[here & contact]
        if len(bound):
            run.look_at(bound)
        for row in bound.tolist():
            start, end = float(flights["t_start"][row]), float(flights["t_end"][row])
            lasts = min(end, until) - start
            count = max(2, math.ceil(lasts * min(pace(run, ball, piece), most)) + 1)
            time, position, rate = run.flight_curve(row, count, lasts)
            rows.append(np.full(count, row))
            times.append(time)
            energies.append(hills.energy(piece, position, rate))
    free = np.column_stack([starts, ends])[~contact].ravel()
    levels = np.repeat(level[~contact], 2)
    if not rows:
        return np.maximum.accumulate(free), levels
    time, energy = np.concatenate([free, *times]), np.concatenate([levels, *energies])
    order = np.lexsort((time, np.concatenate([np.repeat(mine[~contact], 2), *rows])))
    return np.maximum.accumulate(time[order]), energy[order]


def _kept_levels(flights: Table, mine: Integers) -> tuple[Integers, Integers]:
    """Return the first and the last flight of each sequence in which a body keeps its energy.

    Such a sequence consists of free flights with crossings between them.
    """
    free = ~flights["contact"][mine]
    crossed = flights["cause_start"][mine] == "crossing"
    goes_on = crossed[1:] & free[1:] & free[:-1]
    return mine[np.append(True, ~goes_on)], mine[np.append(~goes_on, True)]


def energy_residuals(run: Recorded) -> Iterator[tuple[Array, Array]]:
    """Yield the ends (s) of free flights and the change of energy along each, piece by piece.

    The change is relative to the energy of all bodies at the start. It is computed from the states
    alone, so that it measures the error of the motion.
    """
    flights, pieces = run.flights(), run.system.trace.pieces
    hills = [Landscape.of(run.system, ball) for ball in range(1, len(run.system.bodies) + 1)]

    def energy(body: int, piece: Piece, rows: Integers, end: str) -> Array:
        return hills[body].energy(piece, *(flights[f"{x}_{end}"][rows] for x in ("angle", "rate")))

    # Flights are sorted by body, then by time.
    firsts = np.searchsorted(flights["ball"], np.arange(1, len(hills) + 1))[:, None]
    whole = sum(
        float(energy(body, pieces[int(flights["arc"][row[0]]) - 1], row, "start")[0])
        for body, row in enumerate(firsts)
    )
    # the last flight of an accumulation represents all remaining impacts
    free = flights["cause_end"] != "contact_closed"
    free &= ~flights["contact"]
    for body in range(len(hills)):
        mine = free & (flights["ball"] == body + 1)
        for piece in pieces:
            rows = np.flatnonzero(mine & (flights["arc"] == piece.index + 1))
            change = energy(body, piece, rows, "end") - energy(body, piece, rows, "start")
            yield flights["t_end"][rows], change / (whole or 1.0)


HIGH = {"single": (34.0, 20.0), "double": (44.0, 24.0)}
_ROOM = 0.01
"""Room after an impact that ends the run, as a share of the time axis."""
_FAINT = {"alpha": 0.25, "linewidth": 0.3, "linestyle": "-"}
"""Style of steps that hide one another."""
_LEAST_SHARE = 0.01
"""Share of the axis height (about a line width) below which energies coincide with the axis."""
_LEAST_MEANS = 40
_MOST_JUMPS = 8
"""Median number of jumps per window above which the steps of bodies hide one another."""
_VERY_MANY = 100_000
"""Number of points of a line above which only the visible ones are drawn, ..."""
_STRIPS = 2500
"""... in each of this many strips across the chart."""
_AT_ONCE = 1 << 19
MOST_STEMS = 2000
"""Number of losses above which they are drawn as points without stems."""
LOSS = mark("o", 1.8, style.VERMILLION)
GAIN = LOSS | {"color": style.BLUE, "markerfacecolor": "white"}
IMPACT = mark("o", 2.4, "white", style.BLACK, 0.5)


def energies(run: Recorded, width: str = "single") -> Figure:
    """Draw the energy of each body and of all against time, and the losses at impacts, if any."""
    times, lost = (calm_until(run), _end(run)), losses_of(run.collisions)
    return energy_chart(run, energy_course, lost, contact_times(run), times, width)


def losses_of(*tables: Table) -> tuple[Array, Array]:
    """Return times (s) and energy losses (J) of the impacts in tables that took place."""
    rows = [made(table) if "admissible" in table else slice(None) for table in tables]
    times, losses = (
        [np.asarray(table[name])[own] for table, own in zip(tables, rows, strict=True)]
        for name in ("t", "energy_loss")
    )
    return np.concatenate(times), np.concatenate(losses)


class EnergyLines(NamedTuple):
    """Lines of energies against time: the visible points, as times (s) and energies (J)."""

    bodies: list[tuple[Array, Array]]
    """Line of each body; empty if all are invisibly small beside the total."""
    window: float
    """The time (s) over which means are taken; 0 if the steps can be distinguished."""
    means: list[tuple[Array, Array]]
    """Means of each body; empty if `window` is 0."""
    total: tuple[Array, Array] | None
    """Line of the total energy, None for a single body."""
    highest: float
    """The greatest of all energies (J)."""
    start: float
    """The energy of all bodies at the start (J)."""


def energy_lines(courses: Sequence[tuple[Array, Array]]) -> EnergyLines:
    """Return lines of the energies of bodies; `courses` are times (s) and energies (J) of each.

    If there are several bodies and one jumps too often to distinguish its steps, means are added.
    """
    spans = -(-sum(len(time) for time, _ in courses) // _AT_ONCE)
    total = seen(_sums(courses, spans), spans) if len(courses) > 1 else None
    most = max(float(np.max(energy)) for _, energy in courses)
    highest = max(most, float(np.max(total[1]))) if total else most
    drawn = courses if most >= _LEAST_SHARE * highest else []
    window = _window(drawn) if len(drawn) > 1 else 0.0
    return EnergyLines(
        [seen([course]) for course in drawn],
        window,
        [means(course, window) for course in drawn] if window else [],
        total,
        highest,
        sum(float(energy[0]) for _, energy in courses),
    )


def _window(courses: Sequence[tuple[Array, Array]]) -> float:
    """Return the time (s) over which to average energies; 0 if the steps can be distinguished."""
    end = max(float(time[-1]) for time, _ in courses)
    if end <= 0.0:
        return 0.0
    window = round_below(end / _LEAST_MEANS)
    return window if max(_jumps(course, window) for course in courses) > _MOST_JUMPS else 0.0


def _edges(time: Array, window: float) -> Array:
    """Return the edges (s) of the complete windows between the first and the last time."""
    return np.asarray(time[0] + window * np.arange(math.floor((time[-1] - time[0]) / window) + 1))


def _jumps(course: tuple[Array, Array], window: float) -> float:
    """Return the median number of jumps of an energy per window; times of jumps appear twice."""
    time, energy = course
    jumps = time[1:][(np.diff(time) == 0.0) & (np.diff(energy) != 0.0)]
    return float(np.median(np.histogram(jumps, _edges(time, window))[0]))


def means(course: tuple[Array, Array], window: float) -> tuple[Array, Array]:
    """Return, as steps, the mean of a piecewise linear function over each window (s).

    `course` are non-decreasing times (s) and values. An incomplete window at the end is left out.
    """
    time, values = course
    area = np.append(0.0, np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time)))
    edges = _edges(time, window)
    steps = np.diff(np.interp(edges, time, area)) / window
    return np.repeat(edges, 2)[1:-1], np.repeat(steps, 2)


Course = Callable[[Any, int, float], tuple[Array, Array]]
"""Function of a run, a body (from 1) and a time (s): times up to it, and the energies (J) then."""


@kept
def _lines_of(run: Any, course: Course, until: float) -> EnergyLines:
    """Return lines of the energies of all bodies up to a time (s)."""
    bodies = range(1, len(run.system.bodies) + 1)
    return energy_lines([course(run, ball, until) for ball in bodies])


def energy_chart(
    run: Any,
    course: Course,
    losses: tuple[Array, Array],
    contacts: Sequence[tuple[float, float]],
    times: tuple[float, float],
    width: str,
) -> Figure:
    """Draw the energies of bodies and their sum against time, and the losses, if any, below.

    `course` gives the energies of a body; `losses` are times (s) and losses (J) of the impacts,
    negative for gains; `contacts` are the time spans (s) of lasting contact; `times` are the time
    up to which energies are drawn and the end of the run (s).
    """
    until, whole = times
    lines = _lines_of(run, course, until)
    contacts = [span for span in contacts if span[0] < until]
    within, rounding = losses[0] <= until, EPSILON * lines.start
    shown = within & (np.abs(losses[1]) >= rounding)
    lossy, hidden = bool(np.any(shown)), int(np.sum(within & (losses[1] > 0.0) & ~shown))
    total = [("sum", TOTAL)] if lines.total is not None else []
    words = f"loss ({hidden} below rounding error not shown)" if hidden else "loss"
    lost = [
        (name, look)
        for name, look, there in ((words, LOSS, losses[1] > 0.0), ("gain", GAIN, losses[1] < 0.0))
        if np.any(there & shown)
    ]
    mean = f"means over {short_number(lines.window, 3)} s:"
    means_of = [(mean, {"linestyle": "none"})] if lines.window else []
    bodies = body_entries(run) if lines.bodies else []
    entries = [*means_of, *bodies, *total, *lost, *band_entry(contacts)]
    with style.journal():
        heights = HIGH.get(width, HIGH["single"])[: 1 + lossy]
        figure, panels = stacked(width, heights, entries=entries)
        for axes in panels:
            draw_contacts(axes, contacts)
        _draw_energies(panels[0], lines)
        end = room_after(until, losses[0])
        time_axis(panels[0], end, labelled=not lossy, whole=whole)
        value_axis(panels[0], [0.0, lines.highest], "$E$", "J")
        if lossy:
            _draw_losses(panels[1], losses[0][shown], losses[1][shown])
            time_axis(panels[1], end, whole=whole)
    return figure


def room_after(until: float, impacts: Array) -> float:
    """Return the end (s) of the time axis, with room for the mark of an impact at the end."""
    return until * (1.0 + _ROOM) if len(impacts) and np.max(impacts) == until else until


def _draw_energies(axes: Any, lines: EnergyLines) -> None:
    """Draw the steps and means of each body, and the sum."""
    for ball, line in enumerate(lines.bodies, 1):
        axes.plot(*line, zorder=2.0, **(body_look(ball) | (_FAINT if lines.window else {})))
    for ball, line in enumerate(lines.means, 1):
        axes.plot(*line, zorder=2.1, **body_look(ball))
    if lines.total is not None:
        axes.plot(*lines.total, zorder=2.2, **TOTAL)
    for line in axes.lines:
        line.set_rasterized(len(line.get_xdata()) > MOST_VECTOR_POINTS)


def _sums(courses: Sequence[tuple[Array, Array]], count: int) -> Iterator[tuple[Array, Array]]:
    """Yield the sum of the energies before and after every jump, in `count` spans of time."""
    end = max(float(time[-1]) for time, _ in courses)
    edges = [*np.linspace(0.0, end, count + 1)[:-1].tolist(), np.nextafter(end, np.inf)]
    for span in pairwise(edges):
        parts = [time[slice(*np.searchsorted(time, span))] for time, _ in courses]
        times = np.sort(np.concatenate(parts), kind="stable")  # merges sorted parts
        times = times[np.diff(times, prepend=-np.inf) > 0.0]
        sides = np.stack([np.nextafter(times, side) for side in (-np.inf, np.inf)], axis=1).ravel()
        total = np.zeros(len(sides))
        for time, energy in courses:
            total += np.interp(sides, time, energy)
        yield sides, total


def seen(parts: Iterable[tuple[Array, Array]], count: int = 1) -> tuple[Array, Array]:
    """Return the visible points of a line over time that is given in `count` parts.

    If there are very many, keep the first, last, least and greatest point in each strip of a part:
    in a strip narrower than a pixel, the line through them covers the same area.
    """
    shown, strips = [], -(-_STRIPS // count)
    for time, values in parts:
        if len(time) * count > _VERY_MANY:
            edges = np.searchsorted(time, np.linspace(time[0], time[-1], strips + 1)[1:-1])
            kept = []
            for first, beyond in pairwise([0, *edges.tolist(), len(time)]):
                if first < beyond:
                    within = values[first:beyond]
                    extremes = first + int(within.argmin()), first + int(within.argmax())
                    kept += sorted({first, *extremes, beyond - 1})
            time, values = time[kept], values[kept]
        shown.append((time, values))
    times, lines = zip(*shown, strict=True)
    return np.concatenate(times), np.concatenate(lines)


def _draw_losses(axes: Any, times: Array, losses: Array) -> None:
    """Draw the losses or gains at the impacts."""
    gained, sizes = losses < 0.0, np.abs(losses)
    symbol = r"$|\Delta E|$" if np.any(gained) else r"$\Delta E$"
    positive_axis(axes, sizes, symbol, "J")
    bottom = axes.get_ylim()[0]
    if len(times) <= MOST_STEMS:
        axes.vlines(times, bottom, sizes, linewidth=0.4, color=style.LEVEL_GREY)
    for rows, look in ((~gained, LOSS), (gained, GAIN)):
        axes.plot(times[rows], sizes[rows], **look)
    for artist in (*axes.lines, *axes.collections):
        artist.set_rasterized(len(times) > MOST_VECTOR_POINTS)


def space_time(run: Recorded, width: str = "single") -> Figure | None:
    """Draw the arc length of every body against time, with impacts and lasting contacts.

    Of a long run, only the first part is drawn.
    """
    until = shown_until(run)
    spans = [span for span in contact_times(run) if span[0] < until]
    struck = bool(np.any(np.asarray(run.collisions["t"]) <= until))
    marks = [("impact", IMPACT)] if struck else []
    entries = [*body_entries(run), *marks, *band_entry(spans)]
    with style.journal():
        figure, (axes,) = stacked(width, [1.5 * HIGH[width][0]], entries=entries)
        bodies = range(1, len(run.system.bodies) + 1)
        courses = [timeline(run, ball, until) for ball in bodies]
        time_axis(axes, until, whole=_end(run))
        value_axis(axes, np.concatenate([s for _, s in courses]), "$s$", "m")
        draw_contacts(axes, spans)
        starts = (piece.start_s for piece in run.system.trace.pieces[1:])
        for place in distinct_lines(starts, axes.get_ylim(), panel_size(axes)[1]):
            axes.axhline(place, color=style.LEVEL_GREY, linewidth=0.4, zorder=0.8)
        for ball, (time, s) in zip(bodies, courses, strict=True):
            (drawn,) = axes.plot(time, s, zorder=2.0, **body_look(ball))
            drawn.set_rasterized(len(time) > MOST_VECTOR_POINTS)
        draw_impacts(axes, run, "s", until)
    return figure


def draw_impacts(axes: Any, run: Any, column: str, until: float) -> None:
    """Mark both bodies at each impact up to a time (s); more impacts have smaller marks.

    `column` is the name of the column of places, without the suffix `_a` or `_b`.
    """
    table = run.collisions
    times = np.asarray(table["t"], dtype=np.float64)
    shown = times <= until
    size = float(np.clip(30.0 / max(np.sqrt(np.sum(shown)), 1.0), 1.0, IMPACT["markersize"]))
    look = IMPACT | {"markersize": size, "markeredgewidth": 0.5 * size / IMPACT["markersize"]}
    for side in "ab":
        places = np.asarray(table[f"{column}_{side}"], dtype=np.float64)
        axes.plot(times[shown], places[shown], zorder=2.3, clip_on=False, **look)
