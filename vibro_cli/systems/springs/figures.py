"""The kinds of figure of a run of bodies on springs, and the frames of its film.

The scene at the start and at the first impacts (C fig. 5a), and charts over time: energies with
their jumps, positions.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibro_cli.figures import style
from vibro_cli.figures.chart import (
    LEFT,
    MANY,
    MOST_VECTOR_POINTS,
    Cell,
    band_entry,
    body_entries,
    body_look,
    draw_contacts,
    in_rows,
    joined,
    plane_axes,
    stacked,
    time_axis,
    value_axis,
)
from vibro_cli.figures.film import Frames, Ground, Link, Panel, trails_of
from vibro_cli.figures.kinds import (
    ENERGY_CAPTION,
    EXPONENTS,
    INTERVALS,
    MET_TWICE,
    PORTRAIT,
    Kind,
)
from vibro_cli.figures.labels import Named, ring, short_number, write_names
from vibro_cli.figures.runs.over_impacts import speed_map
from vibro_cli.figures.runs.over_time import (
    HIGH,
    IMPACT,
    MOST_FLIGHTS,
    MOST_PERIODS,
    draw_impacts,
    energy_chart,
    losses_of,
)
from vibro_cli.figures.runs.scene import ARROW, LETTERED
from vibro_cli.figures.runs.velocities import draw_disc, draw_scale
from vibro_cli.figures.source import Array, kept
from vibro_cli.figures.style import Look, line, width_of
from vibro_cli.mechanics.system import touching_distance
from vibro_cli.systems.run import Run
from vibro_cli.systems.springs.phase_plane import SpringsLandscape
from vibro_cli.systems.springs.portrait import Motions, motions, springs_portrait

_BEAM = 0.02
"""Half the width of a spring's support, and of its coils, as a fraction of half the width."""
_ROOM = 0.04
"""Margin, as a fraction of the width of the scene."""


def film(run: Any, times: Array) -> Frames:
    """Return the states of all bodies at the times of frames (s), each exact at its time."""
    bodies, times = run.system.bodies, np.asarray(times)
    periods = [2.0 * math.pi / frequency for frequency in run.system.frequencies]
    x, speed, trails, span = trails_of(run, times, "x", periods)
    rolls = [0.0 if body.slides else 1.0 / body.radius for body in bodies]
    ground = _ground(run, x)
    return Frames(ground, times, x, np.zeros_like(x), (x - x[0]) * rolls, x, speed, trails, span)


def _ground(run: Any, x: Array) -> Ground:
    """Return the feet, the line of the centres, and the plane of speed against position."""
    radii = tuple(body.radius for body in run.system.bodies)
    springs = run.system.springs
    low = np.array([min(np.min(x - radii), *(one.foot for one in springs)), -max(radii)])
    high = np.array([
        max(np.max(x + radii), *(one.foot for one in springs)),
        max(*radii, *(one.height for one in springs), -low[1]),
    ])  # fmt: skip
    room = _ROOM * float(high[0] - low[0])
    wide = 0.5 * float(high[0] - low[0])

    def draw(axes: Axes, half: float) -> None:
        axes.plot([low[0], high[0]], [0.0, 0.0], color=style.LEVEL_GREY, linewidth=0.5, zorder=0.5)
        for one in springs:
            beam = [one.foot - _BEAM * wide, one.foot + _BEAM * wide]
            axes.plot(beam, [one.height] * 2, color=style.BLACK, linewidth=1.6)

    links = tuple(Link((one.foot, one.height), coil_shape(_BEAM * wide)) for one in springs)
    panel = Panel("x", "speed against position along the line")
    return Ground(radii, low - room, high + room, draw, "the bodies on their springs", panel, links)


_EACH = 64
"""Points per shortest period."""
_AT_ONCE = 1 << 14
"""Number of times that are sampled together."""
FOOT = "foot of the spring"


def springs_energies(run: Run, width: str = "single") -> Figure:
    """Draw the energy of each body and of all against time, and the losses of the impacts."""
    every, lost = motions(run), losses_of(run.collisions)
    times = _calm(run, every), run.end_time
    return energy_chart(run, springs_energy, lost, _contacts(every), times, width)


def springs_impact_map(run: Run, width: str = "single") -> Figure | None:
    """Draw approach speed against position of every impact; None with fewer than two impacts."""
    if len(run.collisions["n"]) < 2:
        return None
    largest = max(body.radius for body in run.system.bodies)
    return speed_map(run.collisions, "x_a", ("$x$ of the left body", "m"), largest, width)


def springs_energy(run: Run, ball: int, until: float) -> tuple[Array, Array]:
    """Return times (s) up to `until` and the energies (J) of a body (from 1) at these times.

    Energy is constant between impacts except in lasting contact; jumps have two equal times.
    """
    found, hills = motions(run)[ball - 1], SpringsLandscape.of(run.system, ball - 1, ball - 1)
    shown = found.some(found.start <= until)
    ends, level = np.minimum(shown.end, until), hills.mass * hills.energy(*shown.states[:2])
    instants, before, after = _in_contact(run, until)
    times, energies = [], []
    changes = np.flatnonzero(np.diff(shown.contact)) + 1
    for rows in np.split(np.arange(len(ends)), changes):
        if not shown.contact[rows[0]]:
            times.append(np.column_stack([shown.start[rows], ends[rows]]).ravel())
            energies.append(np.repeat(level[rows], 2))
            continue
        for start, end in zip(shown.start[rows], ends[rows], strict=True):
            part = slice(np.searchsorted(instants, start), np.searchsorted(instants, end, "right"))
            times.append(instants[part])
            own = after[part, ball - 1].copy()
            own[-1] = before[part, ball - 1][-1]
            energies.append(own)
    return np.concatenate(times), np.concatenate(energies)


@kept
def _in_contact(run: Run, until: float) -> tuple[Array, Array, Array]:
    """Return times (s) in lasting contacts up to `until`, and energies (J) before and after events.

    Energies have the shape (times, bodies).
    """
    spans = [(start, min(end, until)) for start, end in _contacts(motions(run)) if start <= until]
    times = _instants_in(run, spans, until)
    return times, _column(run, times, "energy", "before"), _column(run, times, "energy")


def _instants_in(run: Run, spans: list[tuple[float, float]], until: float) -> Array:
    """Return times (s) in `spans` of a chart up to `until`: events, and points in every period."""
    fastest = max(run.system.frequencies)
    # Closer points would fall within the width of a line.
    step = max(2.0 * math.pi / (_EACH * fastest), until / MOST_VECTOR_POINTS)
    events: Any = run.trajectory.times  # type: ignore[attr-defined]
    parts = [np.zeros(0)]
    for start, end in spans:
        within = events[(events > start) & (events < end)]
        parts.append(np.unique(np.concatenate([np.arange(start, end, step), within, [end]])))
    return np.concatenate(parts)


def _column(run: Run, times: Array, name: str, side: str = "after") -> Array:
    """Return a column of the motion at times (s), of shape (times, bodies)."""
    parts = np.array_split(times, 1 + len(times) // _AT_ONCE)  # to save memory
    found = np.concatenate([run.trajectory.sample(part, side)[name] for part in parts])
    return found.reshape(len(times), len(run.system.bodies))


def _calm(run: Run, every: list[Motions]) -> float:
    """Return the time (s) up to which energies are drawn, `MOST_PERIODS` into a final contact."""
    contacts = [float(each.start[-1]) for each in every if each.contact[-1]]
    last = max(float(each.start[-1]) for each in every)
    return min(run.end_time, last + _periods(run)) if contacts else run.end_time


def _periods(run: Run) -> float:
    """Return the duration (s) of the most oscillations that can be distinguished in a chart."""
    slowest: float = min(run.system.frequencies)
    return MOST_PERIODS * 2.0 * math.pi / slowest


def _contacts(every: list[Motions]) -> list[tuple[float, float]]:
    """Return the time spans (s) in which bodies are in lasting contact."""
    spans = [
        span
        for each in every
        for span in zip(
            each.start[each.contact].tolist(), each.end[each.contact].tolist(), strict=True
        )
    ]
    return joined(spans)


def springs_places(run: Run, width: str = "single") -> Figure:
    """Draw the position of every body along the line against time, with impacts and feet.

    For a long run only the first part is drawn.
    """
    every = motions(run)
    starts = np.sort(np.concatenate([each.start for each in every]))
    many = float(starts[MOST_FLIGHTS]) if len(starts) > MOST_FLIGHTS else run.end_time
    until = min(many, run.end_time, _periods(run))
    spans = [span for span in _contacts(every) if span[0] < until]
    marks = [("impact", IMPACT)] if np.any(run.collisions["t"] <= until) else []
    foot = (FOOT, _foot(1) | {"color": style.FRAME_GREY})
    entries = [*body_entries(run), *marks, foot, *band_entry(spans)]
    times = _instants_in(run, [(0.0, until)], until)
    places = _column(run, times, "x")
    with style.journal():
        figure, (axes,) = stacked(width, [1.5 * HIGH[width][0]], entries=entries)
        draw_contacts(axes, spans)
        for ball, spring in enumerate(run.system.springs, 1):
            (drawn,) = axes.plot(times, places[:, ball - 1], zorder=2.0, **body_look(ball))
            drawn.set_rasterized(len(times) > MOST_VECTOR_POINTS)
            axes.axhline(spring.foot, zorder=0.9, **_foot(ball))
        draw_impacts(axes, run, "x", until)
        time_axis(axes, until, whole=run.end_time)
        feet = [spring.foot for spring in run.system.springs]
        value_axis(axes, np.append(places, feet), "$x$", "m")
    return figure


def _foot(ball: int) -> Look:
    return body_look(ball) | {"linewidth": 0.5, "alpha": 0.6}


_IMPACTS = 2
_RIGHT, _TITLE, _BOTTOM, _GAP = 3.0, 5.0, 8.5, 1.5
_HIGHEST = 45.0
_COILS = 9
_APART = 3.6
"""Distance between the height lines of springs with the same foot (mm)."""
_LEAST = 0.5
"""Least radius of a body in the drawing (mm)."""
_LINE = line(style.BLACK, 0.8)
_FOOT = line(style.BLACK, 1.2)
_LONGEST = 4.0
"""Length of the longest arrow outside a body (mm)."""
_HEAD, _HEADED = 7.0, 4.0
"""Size of an arrow's head: maximum, and per mm of its length."""
_RING = ring(90)


def springs_scene(run: Run, width: str = "single") -> Figure:
    """Draw bodies, springs and feet to scale, at the start and at the first impacts."""
    wide = width_of(width)
    titles, states = _instants(run)
    low, high = _extent(run, states[..., 0])
    inner = wide - LEFT - _RIGHT
    scale = min(inner / float(high[0] - low[0]), _HIGHEST / float(high[1] - low[1]))
    tall = scale * float(high[1] - low[1])
    middle, half = 0.5 * float(low[0] + high[0]), 0.5 * inner / scale
    low[0], high[0] = middle - half, middle + half
    fastest = float(np.max(np.abs(states[..., 1])))
    each = (_LONGEST / scale + max(body.radius for body in run.system.bodies)) / (fastest or 1.0)
    with style.journal():
        cell = Cell(inner, tall, _TITLE, _GAP, 0.0)
        sheet, corners = in_rows(cell, len(titles), 1, wide, LEFT, 0.0, _BOTTOM)
        for number, (corner, title) in enumerate(zip(corners, titles, strict=True), 1):
            axes = sheet.panel(*corner, inner, tall)
            plane_axes(axes, low, high, labelled=number == len(titles))
            axes.set_title(title, pad=2.0, color=style.FRAME_GREY)
            _draw(axes, run, states[number - 1], scale, each)
            if fastest and number == 1:
                draw_scale(axes, each, 0)
    return sheet.figure


def _instants(run: Run) -> tuple[list[str], Array]:
    """Return the titles of the start and of the first impacts, and the states of the bodies then.

    States are positions of the centres along the line (m) and speeds after the events of the
    instant (m/s), shape (instants, bodies, 2).
    """
    times = [0.0, *(float(t) for t in run.collisions["t"][:_IMPACTS])]
    sampled = run.sample(times)
    states = np.column_stack([sampled["x"], sampled["speed"]])
    titles = ["start", *(_title(run, row) for row in range(len(times) - 1))]
    return titles, states.reshape(len(times), -1, 2)


def _title(run: Run, row: int) -> str:
    """Return the title of an impact: its time, and the distance of the centres."""
    one, other = (int(run.collisions[f"ball_{end}"][row]) for end in "ab")
    apart = touching_distance(*(run.system.bodies[number - 1] for number in (one, other)))
    names = rf"$x_{{{other}}}-x_{{{one}}}=2\sqrt{{r_{{{one}}}r_{{{other}}}}}$"
    time = float(run.collisions["t"][row])
    return f"impact {row + 1}, {short_number(time)} s: {names} = {short_number(apart)} m"


def _extent(run: Run, places: Array) -> tuple[Array, Array]:
    """Return the corners of the drawing (m) for places of the centres (m).

    Heights are measured from the line of centres.
    """
    radius = max(body.radius for body in run.system.bodies)
    feet = [spring.foot for spring in run.system.springs]
    along = np.append(places, feet)
    top = max(spring.height for spring in run.system.springs)
    size = float(np.ptp(along)) + 2.0 * radius
    room = 0.07 * size
    low = np.array([np.min(along) - radius - room, -radius - room])
    return low, np.array([np.max(along) + radius + room, max(top, radius) + 0.8 * room])


def _draw(axes: Axes, run: Run, states: Array, scale: float, each: float) -> None:
    """Draw and label the bodies, the line, and the springs with their feet and heights.

    `states` are positions (m) and speeds (m/s) of the bodies, shape (bodies, 2),
    `scale` is the length of 1 m (mm), `each` the length of the arrow of 1 m/s (m).
    """
    named: list[Named] = []
    drawn = [np.zeros((0, 2))]
    lettered = len(run.system.bodies) <= LETTERED
    for number, (body, spring) in enumerate(
        zip(run.system.bodies, run.system.springs, strict=True), 1
    ):
        colour = str(body_look(number)["color"])
        place, speed = states[number - 1].tolist()
        foot, centre = np.array([spring.foot, spring.height]), np.array([place, 0.0])
        coil = Link((spring.foot, spring.height), coil_shape(1.3 / scale)).points(place, 0.0)
        axes.plot(*coil.T, color=colour, linewidth=0.7, zorder=2.2)
        reach = 2.2 / scale
        axes.plot([foot[0] - reach, foot[0] + reach], [foot[1]] * 2, zorder=2.4, **_FOOT)
        upright = np.array([[foot[0] + _aside(run, number - 1) / scale, y] for y in (0.0, foot[1])])
        axes.plot(*upright.T, zorder=1.4, **style.AXIS)
        shown = max(body.radius, _LEAST / scale)
        draw_disc(axes, centre, shown, colour, 0.35)
        axes.plot([place - reach, place + reach], [-body.radius] * 2, zorder=2.0, **_LINE)
        if speed:
            level = 0.5 * shown * (-1.0) ** number  # beside the arrows of its neighbours
            tip = (place + each * speed, level)
            head = {"mutation_scale": min(_HEAD, _HEADED * scale * each * abs(speed))}
            axes.annotate("", tip, (place, level), arrowprops=ARROW | head, zorder=2.6)
            drawn.append(np.linspace([place, level], tip, 20))
        named.append(Named(rf"$C_{{{number}}}$" if lettered else str(number), centre))
        if lettered:
            middle = upright.mean(axis=0)
            named.append(Named(rf"$A_{{{number}}}$", foot))
            named.append(Named(rf"$b_{{{number}}}$", middle, style.FRAME_GREY))
        ends = np.array([[-reach, 0.0], [reach, 0.0]])
        beam = np.linspace(foot + ends[0], foot + ends[1], 20)
        drawn += [
            *np.linspace(coil[:-1], coil[1:], 8),
            beam,
            centre + shown * _RING,
            np.linspace(upright[0], upright[1], 30),
        ]
    write_names(axes, named, np.concatenate(drawn))


def _aside(run: Run, index: int) -> float:
    """Return the offset (mm) of a spring's height line, which separates springs of equal feet."""
    feet = [spring.foot for spring in run.system.springs]
    alike = [number for number, foot in enumerate(feet) if foot == feet[index]]
    return _APART * (alike.index(index) - 0.5 * (len(alike) - 1))


def coil_shape(wide: float) -> Array:
    """Return the shape of a coil spring: fractions of its length, and lateral offsets (m)."""
    share = np.linspace(0.14, 0.86, 2 * _COILS + 1)
    swing = np.where(np.arange(len(share)) % 2 == 0, wide, -wide)
    swing[[0, -1]] = 0.0
    return np.concatenate([[[0.0, 0.0]], np.column_stack([share, swing]), [[1.0, 0.0]]])


_PORTRAIT_CAPTION = (
    "Above, the speed against the displacement from the foot of the spring: the branches that the "
    "body follows and its jumps at the impacts; lasting contact has its own colour, and branches "
    "are coloured by time up to the last impact if there are many. Behind them are level curves of "
    "energy, the separatrix, centres (+) and saddles (×). Below, the energy of the spring and the "
    "total energy. As C fig. 5b."
)
FIGURES = {
    "scene": Kind(
        springs_scene,
        "The bodies with their springs",
        "To scale, at the start and at the first impacts: centres C, feet A of the springs at "
        "heights b above the line of the centres, and the line on which each body rolls; of many "
        "bodies, only their numbers; the "
        "lengths of the arrows are proportional to the speeds. For each impact, the distance "
        "between the centres is given. As C fig. 5a.",
    ),
    PORTRAIT: Kind(
        springs_portrait, "Phase portrait and energies of body", _PORTRAIT_CAPTION, of_bodies=True
    ),
    "motion": Kind(
        springs_places,
        "Motion along the line",
        "Positions of the centres against time, with the impacts; thin horizontal lines are the "
        "feet of the springs. Only the first part of a long run is shown.",
    ),
    "energy": Kind(springs_energies, "Energies", ENERGY_CAPTION),
    "impact_map": Kind(
        springs_impact_map,
        "Impact map",
        f"Approach speed against the position of the centre of the left body at the impact.{MANY}",
        needs=MET_TWICE,
    ),
    "intervals": INTERVALS,
    "exponents": EXPONENTS,
}
