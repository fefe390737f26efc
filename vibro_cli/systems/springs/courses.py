"""Charts over time of bodies on springs: energies with their jumps, places."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibro_cli.figures import style
from vibro_cli.figures.chart import (
    MOST_LOOKS,
    MOST_VECTOR_POINTS,
    band_entry,
    body_entries,
    body_look,
    draw_contacts,
    joined,
    stacked,
    time_axis,
    value_axis,
)
from vibro_cli.figures.over_impacts import speed_map
from vibro_cli.figures.over_time import HIGH, IMPACT, EnergyLines, energy_chart, energy_lines
from vibro_cli.figures.source import Array, kept
from vibro_cli.figures.ticks import number_ticks
from vibro_cli.figures.timeline import MOST_FLIGHTS, MOST_PERIODS
from vibro_cli.systems.run import Run
from vibro_cli.systems.springs.landscape import SpringsLandscape
from vibro_cli.systems.springs.trajectory import Motions, motions

_EACH = 64
"""Points of a period."""
FOOT = "foot of the spring"


def springs_energies(run: Run, width: str = "single") -> Figure:
    """Return the energy of each body and of all against time, and what the impacts lose."""
    rows = run.collisions
    until, lines = _courses(run)
    lost = rows["t"], rows["energy_loss"]
    every = [motions(run, body) for body in range(len(run.system.bodies))]
    return energy_chart(run, lines, lost, _contacts(every), until, width)


@kept
def _courses(run: Run) -> tuple[float, EnergyLines]:
    """Return until when energies are drawn (s), and their lines."""
    bodies = range(1, len(run.system.bodies) + 1)
    until = _calm(run, [motions(run, ball - 1) for ball in bodies])
    return until, energy_lines([springs_energy(run, ball, until) for ball in bodies])


def springs_impact_map(run: Run, width: str = "single") -> Figure | None:
    """Return approach speed against place of every impact, None without one."""
    table = run.collisions
    if not len(table["n"]):
        return None

    def places(axes: Axes, place: Array, across: float) -> None:
        room = 0.08 * float(np.ptp(place)) or 0.5
        low, high = float(np.min(place)) - room, float(np.max(place)) + room
        axes.set_xlim(low, high)
        ticks = number_ticks(low, high, across)
        axes.set_xticks(ticks.places, ticks.labels)
        axes.set_xlabel("$x$ of the left body [m]")

    return speed_map(table, np.asarray(table["x_a"], dtype=np.float64), width, places)


def springs_energy(run: Run, ball: int, until: float) -> tuple[Array, Array]:
    """Return times (s) up to one and the energy (J) of a body (from 1) then.

    Constant between impacts, but for lasting contact; at a jump a time stands twice.
    """
    found, hills = motions(run, ball - 1), SpringsLandscape.of(run.system, ball - 1, ball - 1)
    times, energies = [], []
    for row in np.flatnonzero(found.start <= until).tolist():
        if found.contact[row]:
            time, place, speed = springs_course(run, ball, found, row, until)
        else:
            time = np.array([found.start[row], min(found.end[row], until)])
            place, speed = (column[[row, row]] for column in found.states[:2])
        times.append(time)
        energies.append(hills.mass * hills.energy(place, speed))
    return np.concatenate(times), np.concatenate(energies)


def springs_course(
    run: Run, ball: int, found: Motions, row: int, until: float
) -> tuple[Array, Array, Array]:
    """Return times (s) up to one, displacements (m) and speeds (m/s) of a body in one motion."""
    first = int(found.first[row])
    hills = SpringsLandscape.of(run.system, first, int(found.last[row]))
    shift = hills.offsets[ball - 1 - first]
    x, v, x_end, v_end = (float(column[row]) for column in found.states)
    start, lasts = float(found.start[row]), float(found.end[row] - found.start[row])
    period = float(hills.period(np.array([x - shift]), np.array([v]))[0])
    if lasts > until - start + period:  # the rest is not drawn
        x_end, v_end, lasts = math.nan, math.nan, until - start + period
    time, place, speed = hills.course((x - shift, v), (x_end - shift, v_end), lasts, _EACH)
    shown = time <= until - start
    return start + time[shown], place[shown] + shift, speed[shown]


def _calm(run: Run, every: list[Motions]) -> float:
    """Return until when (s) energies are drawn: lasting contact at the end for some periods."""
    contacts = [float(each.start[-1]) for each in every if each.contact[-1]]
    last = max(float(each.start[-1]) for each in every)
    return min(run.end_time, last + _periods(run)) if contacts else run.end_time


def _periods(run: Run) -> float:
    """Return the time (s) of as many small oscillations as can be told apart."""
    slowest: float = min(run.system.frequency(body) for body in range(len(run.system.bodies)))
    return MOST_PERIODS * 2.0 * math.pi / slowest


def _contacts(every: list[Motions]) -> list[tuple[float, float]]:
    """Return from when to when (s) bodies are in lasting contact."""
    spans = [
        span
        for each in every
        for span in zip(
            each.start[each.contact].tolist(), each.end[each.contact].tolist(), strict=True
        )
    ]
    return joined(spans)


def springs_places(run: Run, width: str = "single") -> Figure:
    """Return the place of every body along the line against time, with the impacts and the feet.

    Of a long run, the first part only.
    """
    high = 1.5 * HIGH[width][0]
    every = [motions(run, body) for body in range(len(run.system.bodies))]
    starts = np.sort(np.concatenate([each.start for each in every]))
    drawn = float(starts[MOST_FLIGHTS]) if len(starts) > MOST_FLIGHTS else run.end_time
    until = min(drawn, run.end_time, _periods(run))
    spans = [span for span in _contacts(every) if span[0] < until]
    marks = [("impact", IMPACT)] if np.any(run.collisions["t"] <= until) else []
    feet = [(FOOT, _foot(1) | {"color": style.FRAME_GREY})]
    entries = [*body_entries(run, MOST_LOOKS), *marks, *feet, *band_entry(spans)]
    with style.journal():
        figure, (axes,), across = stacked(width, [high], entries=entries)
        draw_contacts(axes, spans)
        low, top = math.inf, -math.inf
        for ball, spring in enumerate(run.system.springs, 1):
            time, place = springs_place(run, ball, every[ball - 1], until)
            (line,) = axes.plot(time, place, zorder=2.0, **body_look(ball))
            line.set_rasterized(len(time) > MOST_VECTOR_POINTS)
            axes.axhline(spring.foot, zorder=0.9, **_foot(ball))
            low = min(low, float(np.min(place)), spring.foot)
            top = max(top, float(np.max(place)), spring.foot)
        _draw_impacts(axes, run, until)
        time_axis(axes, until, across[0], labelled=True)
        value_axis(axes, low, top, high, "$x$", "m")
    return figure


def _foot(ball: int) -> dict[str, Any]:
    return body_look(ball) | {"linewidth": 0.5, "alpha": 0.6}


def springs_place(run: Run, ball: int, found: Motions, until: float) -> tuple[Array, Array]:
    """Return times (s) up to one, and where a body (from 1) is along the line then (m)."""
    rows = np.flatnonzero(found.start <= until).tolist()
    parts = [springs_course(run, ball, found, row, until) for row in rows]
    times, places = (np.concatenate([part[n] for part in parts]) for n in range(2))
    return times, places + run.system.springs[ball - 1].foot


def _draw_impacts(axes: Any, run: Run, until: float) -> None:
    """Mark both bodies at each impact, as long as the marks can be told apart."""
    rows = run.collisions
    shown = rows["t"] <= until
    size = float(np.clip(30.0 / max(np.sqrt(np.sum(shown)), 1.0), 1.0, IMPACT["markersize"]))
    for end in "ab":
        look = IMPACT | {"markersize": size}
        axes.plot(rows["t"][shown], rows[f"x_{end}"][shown], zorder=2.3, **look)
