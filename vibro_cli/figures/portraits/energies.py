"""Phase plane along the whole trace with the jumps, and below it the energies (A, B III.3.6, D).

Above: speed of the centre over arc length, where a figure eight is one closed curve even across
several arcs. Below, over the same places: the potential energy and the total energy of the body,
which is constant between impacts and jumps with the speed.
"""

from __future__ import annotations

from bisect import bisect
from dataclasses import replace
from operator import attrgetter

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from vibro_cli.analysis.levels import Landscape
from vibro_cli.analysis.singular import Portrait, portrait_of
from vibro_cli.figures import style
from vibro_cli.figures.chart import MOST_VECTOR_POINTS, stacked
from vibro_cli.figures.labels import Rows, draw_legend, room_for
from vibro_cli.figures.portraits import layers
from vibro_cli.figures.portraits.layers import Background, coloured_until, saddle_energies
from vibro_cli.figures.portraits.panels import Panel, Symbols, Window, plane, straight
from vibro_cli.figures.portraits.portrait import (
    draw_motion,
    framed_rate,
    greatest_rate,
    legend_rows,
    seen,
    stays_at_rest,
    walls_of,
)
from vibro_cli.figures.portraits.trace_phase_plane import (
    behind_along,
    draw_junctions,
    highest_energy,
)
from vibro_cli.figures.portraits.trajectory import Branches, Jumps, Trajectory, trajectory
from vibro_cli.figures.source import Array, Recorded
from vibro_cli.figures.style import line
from vibro_cli.figures.ticks import label_axis, limits_apart, vertical_ticks
from vibro_cli.mechanics.trace import Trace

_CLEAR = 0.05
"""Room below the energy 0, as a share of the highest energy, so that level lines are visible."""
_HIGH = (58.0, 36.0)
"""Heights of the portrait and of the energies (mm)."""
_TOP = 4.5
"""Room for the first row of the legend (mm)."""


def panels_over(
    width: str, window: Window, legend: Rows, symbols: Symbols
) -> tuple[Figure, Panel, Panel]:
    """Return a figure, its panel for the portrait and, below, that for the energies."""
    figure, (upper, lower) = stacked(width, _HIGH, room_for(legend, _TOP))
    portrait = plane(upper, window, symbols, labelled=False)
    return figure, portrait, plane(lower, window, symbols)


def limit_energies(lower: Panel, highest: float, lowest: float = 0.0) -> None:
    """Set the axis of the energies (J); one that begins at 0 has room between 0 and the frame."""
    bottom, top = limits_apart(lowest, highest if highest > lowest else lowest + 1.0)
    bottom -= _CLEAR * top if lowest == 0.0 else 0.0
    lower.axes.set_ylim(bottom, top)
    label_axis(lower.axes.yaxis, vertical_ticks(bottom, top, lower.height), "$E$", "J")


def draw_energies(lower: Panel, path: Trajectory, energies: Array, until: float | None) -> None:
    """Draw the total energy of each branch over place; it varies only in lasting contact.

    `until` is the last time (s) of the colour bar, None for a single colour.
    """
    (branches,) = path.branches
    order = np.argsort(branches.time, kind="stable")
    for contact, own in ((False, layers.BRANCH), (True, layers.CONTACT)):
        rows = order[branches.contact[order] == contact]
        if not len(rows):
            continue
        if contact:
            lines = [np.column_stack([branches.position[n], energies[n]]) for n in rows]
        else:
            levels = zip(branches.position[rows], energies[rows, 0], strict=True)
            lines = [np.array([[np.min(s), level], [np.max(s), level]]) for s, level in levels]
        look = own | {"linewidth": layers.thinner(0.7, len(order))}
        if until is not None and not contact:
            look = layers.by_time(look, branches.time[rows], until)
        collection = LineCollection(lines, zorder=2.0, **look)
        collection.set_rasterized(sum(map(len, lines)) > MOST_VECTOR_POINTS)
        lower.axes.add_collection(collection, autolim=False)


_MARGIN = 1.06
_DENSE = 241
_SMALL = 0.2
"""A motion within this share of the trace is shown close up, ..."""
_BESIDE = 0.4
"""... with this share of its extent on both sides."""
_HIGH_UP = 0.7
"""Share of the highest energy above which the least potential sets the lower end of the axis."""
POTENTIAL = line(style.BLACK, 1.0)


def energy_portrait(run: Recorded, ball: int, width: str = "single") -> Figure:
    """Draw speed and energies of a body (from 1) of a run over the arc length of the trace.

    Raises IndexError for a body that does not exist.
    """
    by_pieces = trajectory(run, ball)
    landscape = Landscape.of(run.system, ball)
    path = along_trace(by_pieces, landscape)
    portrait = portrait_of(landscape)
    (branches,) = path.branches
    energies = 0.5 * landscape.body.kappa * landscape.body.mass * branches.rate**2
    below = _potential_at(landscape, branches.position)
    energies += below
    walls = tuple((0, float(piece.arc_length(place))) for piece, place in walls_of(run, ball))
    window, behind = _window(portrait, path)
    behind = seen(replace(behind, walls=walls), [window])
    with style.journal():
        rows, bar = legend_rows(path, behind, width, [("potential energy", POTENTIAL)])
        symbols = Symbols(rf"$s_{{{ball}}}$", rf"$v_{{{ball}}}$")
        figure, upper, lower = panels_over(width, window, rows, symbols)
        draw_motion([upper], path, behind)
        places, values = _potential(landscape, window)
        lower.axes.plot(places, values, zorder=1.5, **POTENTIAL)
        draw_energies(lower, path, energies, coloured_until(path))
        for panel in (upper, lower):
            draw_junctions(panel, landscape.trace)
        layers.draw_walls(lower, behind)
        if stays_at_rest(path):
            limit_energies(lower, highest_energy(portrait))
        else:
            mass = landscape.body.kappa * landscape.body.mass
            saddle = saddle_shown(behind, below, mass, window)
            least = max(1e-3 * float(np.max(values)), saddle)
            limit_energies(lower, *energy_limits(energies, below, least))
        draw_legend(figure, rows, bar)
    return figure


def along_trace(path: Trajectory, landscape: Landscape) -> Trajectory:
    """Convert a trajectory by pieces to one along the whole trace: arc length (m), speed (m/s)."""
    pieces = landscape.trace.pieces
    scales = [landscape.path_scale(piece) for piece in pieces]
    parts = [
        (piece.arc_length(one.position), scale * one.rate, one.time, one.contact)
        for piece, scale, one in zip(pieces, scales, path.branches, strict=True)
        if len(one.time)
    ]
    index, position, rate = path.start
    return replace(
        path,
        branches=(Branches(*map(np.concatenate, zip(*parts, strict=True))),),
        jumps=_jumps_along(path.jumps, landscape),
        first=_jumps_along(path.first, landscape),
        start=(0, pieces[index].arc_length(position), scales[index] * rate),
    )


def _jumps_along(jumps: Jumps, landscape: Landscape) -> Jumps:
    pieces = landscape.trace.pieces
    scales = np.array([landscape.path_scale(piece) for piece in pieces])[jumps.piece]
    places = [
        pieces[index].arc_length(position)
        for index, position in zip(jumps.piece.tolist(), jumps.position.tolist(), strict=True)
    ]
    return replace(
        jumps,
        piece=np.zeros_like(jumps.piece),
        position=np.array(places, dtype=np.float64),
        before=jumps.before * scales,
        after=jumps.after * scales,
    )


def _potential(landscape: Landscape, window: Window) -> tuple[Array, Array]:
    """Return arc lengths (m) along the trace and the potential energies there (J).

    Points are dense on the whole trace, and denser around the window, which may be very small.
    """
    beside = window.high - window.low
    places = [np.linspace(window.low - beside, window.high + beside, 3 * _DENSE)]
    for piece in landscape.trace.pieces:
        position = np.linspace(piece.angle_start, piece.angle_end, _DENSE)
        places.append(piece.arc_length(position))
    along = np.sort(np.clip(np.concatenate(places), 0.0, landscape.trace.length))
    return along, _potential_at(landscape, along)


def _potential_at(landscape: Landscape, s: Array) -> Array:
    """Return the potential energy (J) at arc lengths (m)."""
    pieces = landscape.trace.pieces
    # By left ends: the length of the trace may be rounded to beyond the end of the last piece.
    on = np.searchsorted([piece.start_s for piece in pieces[1:]], s, side="right")
    found = np.empty(s.shape)
    for piece in pieces:
        here = on == piece.index
        along = s[here] - piece.start_s
        position = along if piece.is_line else piece.angle_start + along / piece.radius
        found[here] = landscape.potential(piece, position)
    return found


def saddle_shown(behind: Background, potential: Array, mass: float, window: Window) -> float:
    """Return the energy (J) of the highest saddle within the energies of a window, else 0.

    `potential` (J) is that along the motion, `mass` (kg) the factor of half the squared speed.
    """
    highest = float(np.min(potential)) + 0.5 * mass * window.top**2
    return max((one for one in saddle_energies(behind.points) if one <= highest), default=0.0)


def energy_limits(energies: Array, potential: Array, least: float = 0.0) -> tuple[float, float]:
    """Return the upper and the lower end of the axis of energies (J) of a motion.

    The axis begins at 0 and reaches `least` or higher. For a motion whose potential energy is
    always large, it begins just below the least of it.
    """
    low, high = float(np.min(potential)), max(float(np.max(energies)), least)
    if low > _HIGH_UP * high:
        room = 0.25 * (high - low) or 1e-3 * high
        return high + room, low - room
    return 1.15 * high, 0.0


def _window(portrait: Portrait, path: Trajectory) -> tuple[Window, Background]:
    """Return the window and the curves in it: the whole trace, as high as motion and separatrices.

    If the motion takes a small part of the trace, it is that part with room on both sides. For a
    body at rest, it is as high as the level curves.
    """
    (branches,), trace = path.branches, portrait.landscape.trace
    low, high, extent = 0.0, trace.length, float(np.ptp(branches.position))
    is_close = 0.0 < extent < _SMALL * trace.length
    if is_close:
        close = close_up(branches.position)
        low, high = max(low, close[0]), min(high, close[1])
    low, high = limits_apart(low, high)
    behind = behind_along(portrait, shown=_between(trace, low, high))
    saddles = () if is_close else (*behind.separatrices, *behind.eights)
    through = max((float(np.max(curve.rate)) for curve in saddles), default=0.0)
    levels = max((float(np.max(curve.rate)) for curve in behind.levels), default=1.0)
    top = _MARGIN * framed_rate(greatest_rate(path, [0]), through, levels)
    return straight(low, high, top), behind


def _between(trace: Trace, low: float, high: float) -> range:
    """Return the indices of the pieces between two arc lengths (m)."""
    first, last = (bisect(trace.pieces, s, key=attrgetter("start_s")) for s in (low, high))
    return range(max(first - 1, 0), last)


def close_up(position: Array) -> tuple[float, float]:
    """Return the ends of an axis (m) that shows a motion close up, with room on both sides."""
    room = _BESIDE * float(np.ptp(position))
    return float(np.min(position)) - room, float(np.max(position)) + room
