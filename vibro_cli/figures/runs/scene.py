"""The scene: the trace to scale with its bodies (A fig. 2a), and the film of a run on it.

The states at the times of the frames are in closed form.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from vibro_cli.figures import style
from vibro_cli.figures.chart import body_look, plane_axes
from vibro_cli.figures.film import Frames, Ground, Panel, States, struck, times_between, trail
from vibro_cli.figures.labels import Named, write_names
from vibro_cli.figures.runs.plan import draw_ends, trace_points, visited
from vibro_cli.figures.source import Array, Recorded
from vibro_cli.figures.style import MM, WIDTHS
from vibro_cli.mechanics.potential import Turning
from vibro_cli.mechanics.system import PARTICLE, Body, TraceSystem
from vibro_cli.mechanics.trace import Piece, Trace

_LEFT = 11.0
_RIGHT = 3.0
_TOP = 2.0
_BOTTOM = 8.5
_HIGHEST = 70.0
_LOWEST = 20.0
_WORDS = 7.0
"""Room for numbers around what is drawn (mm)."""
_AWAY = 3.2
"""Distance of the number of a piece from the trace (mm)."""
_KEEN = 3
"""How much rather names cover something else than a line."""
_WALL = 5.0
"""Height of a wall at an end of the trace (mm)."""
_TINY = 0.003
"""Bodies smaller than this share of the trace are shown close."""
_LEAST = 0.5
"""Least radius of a body that is drawn (mm)."""
_SURFACE: dict[str, Any] = {"color": style.BLACK, "linewidth": 0.8}
_JUNCTION: dict[str, Any] = {"color": style.BLACK, "marker": "o", "markersize": 2.2}
_AXIS: dict[str, Any] = {
    "color": style.FRAME_GREY,
    "linewidth": 0.6,
    "linestyle": (0, (8.0, 2.0, 1.5, 2.0)),
}
_ARROW: dict[str, Any] = {
    "arrowstyle": "-|>",
    "color": style.BLACK,
    "linewidth": 0.7,
    "shrinkA": 0.0,
    "shrinkB": 0.0,
}
_POINT: dict[str, Any] = {"color": style.BLACK, "marker": "o", "markersize": 1.6}
_RADIUS: dict[str, Any] = {"color": style.FRAME_GREY, "linewidth": 0.35}
_UPRIGHT: dict[str, Any] = _RADIUS | {"linestyle": (0, (6.0, 1.5, 1.0, 1.5))}
_LETTERED = 3
"""Bodies up to which centres, contact points and angles are named."""
_RING = np.column_stack([f(np.linspace(0.0, 2.0 * np.pi, 24)) for f in (np.cos, np.sin)])
Extent = tuple[Array, Array]
"""Lower left and upper right corner (m)."""
_SAY: dict[str, Any] = {"fontsize": style.SMALL, "ha": "center", "va": "center"}


def scene(run: Recorded, width: str = "single") -> Figure:
    """Return the trace to scale with its pieces numbered and the bodies at the start.

    The centres O and radii R of the arcs are drawn, of a few bodies the centres C, contact points
    P and angles φ, ψ too.

    Raises ValueError for a width that is neither `single` nor `double`.
    """
    if width not in WIDTHS:
        raise ValueError(f"unknown width {width!r}, expected one of {', '.join(WIDTHS)}")
    surface = trace_points(run.system.trace)
    low, high = _extent(run, surface)
    inner = WIDTHS[width] - _LEFT - _RIGHT
    scale = float(np.min((np.array([inner, _HIGHEST]) - _WORDS) / (high - low)))
    tall = max(scale * float(high[1] - low[1]) + _WORDS, _LOWEST)
    total = _TOP + tall + _BOTTOM
    with style.journal():
        figure = Figure(figsize=(WIDTHS[width] * MM, total * MM))
        box = (_LEFT / WIDTHS[width], _BOTTOM / total, inner / WIDTHS[width], tall / total)
        axes = figure.add_axes(box)
        _set_axes(axes, 0.5 * (low + high), np.array([inner, tall]), scale)
        axes.plot(surface[:, 0], surface[:, 1], zorder=2.0, **_SURFACE)
        within = low, high
        numbers = [_number_place(run, piece, scale) for piece in run.system.trace.pieces]
        named = [
            name
            for piece, place in zip(run.system.trace.pieces, numbers, strict=True)
            for name in _draw_piece(axes, run, piece, place, within)
        ]
        axes.plot(*surface[-1], zorder=2.2, linestyle="none", clip_on=True, **_JUNCTION)
        draw_ends(axes, run.system, _WALL / scale)
        if run.system.turning is not None:
            _draw_axis(axes, run.system.turning)
        named = [*_draw_bodies(axes, run, scale, within), *named]
        covered = np.concatenate([_obstacles(run, surface, scale), *_points_of(axes)])
        write_names(axes, named, covered, (inner, tall), numbers)
    return figure


def _points_of(axes: Axes) -> list[Array]:
    """Return points of all lines that are drawn, 60 of each straight one, to be kept clear of."""
    share = np.linspace(0.0, 1.0, 60)[:, None]
    lines = [np.asarray(line.get_xydata()) for line in axes.lines]
    points = [one[:1] + share * (one[-1:] - one[:1]) if len(one) == 2 else one for one in lines]
    return points * _KEEN


def _obstacles(run: Recorded, surface: Array, scale: float) -> Array:
    """Return points that names should not cover: the trace and the bodies."""
    found = [surface]
    for piece in run.system.trace.pieces:
        line = np.linspace(0.0, 1.0, 60)[:, None]
        start, end = np.array(piece.start), np.array(piece.end)
        found += [start + line * (end - start)] if piece.is_line else []
    for body, state in zip(run.system.bodies, run.system.initial, strict=True):
        centre = run.system.trace.pieces[state.piece].body_center(state.position, body.radius)
        radius = max(body.radius, _LEAST / scale)
        found += [np.array(centre) + radius * share * _RING for share in (0.4, 0.7, 1.0)]
    return np.concatenate(found)


def _draw_axis(axes: Axes, turning: Turning) -> None:
    """Draw the vertical about which the trace turns, with its rate."""
    axes.axvline(turning.x, zorder=1.5, **_AXIS)
    words = rf"$\Omega = {turning.rate:.4g}$ rad/s"
    halo = [patheffects.withStroke(linewidth=1.4, foreground="white")]
    axes.annotate(
        words, (turning.x, 1.0), (3.0, -4.0), xycoords=("data", "axes fraction"),
        textcoords="offset points", va="top", fontsize=style.SMALL, path_effects=halo, zorder=3.0,
    )  # fmt: skip


def _extent(run: Recorded, surface: Array) -> tuple[Array, Array]:
    turning = run.system.turning
    reach = surface if turning is None else np.append(surface, [[turning.x, surface[0, 1]]], axis=0)
    low, high = reach.min(axis=0), reach.max(axis=0)
    largest = max(body.radius for body in run.system.bodies)
    room = max(2.1 * largest, 0.04 * float(np.max(np.ptp(surface, axis=0))))
    if turning is None and largest < _TINY * float(np.max(high - low)):
        return visited(_centres(run), largest, low - room, high + room)
    return low - room, high + room


def _centres(run: Recorded) -> Array:
    """Return the centres of the bodies at the start (m), shape (bodies, 2)."""
    pieces = run.system.trace.pieces
    states = zip(run.system.bodies, run.system.initial, strict=True)
    return np.array(
        [pieces[one.piece].body_center(one.position, body.radius) for body, one in states]
    )


def _set_axes(axes: Axes, middle: Array, size: Array, scale: float) -> None:
    """Set both axes to one scale (mm per m) around the middle."""
    half = 0.5 * size / scale
    plane_axes(axes, middle - half, middle + half, size)


def _number_place(run: Recorded, piece: Piece, scale: float) -> tuple[float, float]:
    """Return where the number of a piece stands (m): below the trace at its middle.

    Beside the middle where the axis about which the trace turns goes through there.
    """
    turning, middle = run.system.turning, 0.5 * (piece.angle_start + piece.angle_end)
    if turning is not None and abs(piece.contact_point(middle)[0] - turning.x) < 2.0 / scale:
        middle += 0.12 * (piece.angle_end - piece.angle_start)
    slope = piece.slope(middle)
    below = np.array([np.sin(slope), -np.cos(slope)]) * _AWAY / scale
    return pair(np.array(piece.contact_point(middle)) + below)


def _draw_piece(
    axes: Axes, run: Recorded, piece: Piece, place: tuple[float, float], within: Extent
) -> list[Named]:
    """Mark where a piece begins, write its number below it; return centre and radius to be named.

    The centre of an arc and its radius are left out where they are off the figure.
    """
    begins = piece.contact_point(piece.angle_start)
    axes.plot(*begins, zorder=2.2, linestyle="none", **_JUNCTION)
    halo = [patheffects.withStroke(linewidth=1.4, foreground="white")]
    look = _SAY | {"color": style.FRAME_GREY, "fontstyle": "italic"}
    words = str(piece.index + 1)
    if np.all(np.array(place) > within[0]) and np.all(np.array(place) < within[1]):
        axes.text(*place, words, path_effects=halo, zorder=3.0, **look)
    centre = np.array(piece.center)
    if piece.is_line or np.any(centre < within[0]) or np.any(centre > within[1]):
        return []
    # Far from the number at the middle, the upright from which angles count, and the bodies.
    taken = [one.position for one in run.system.initial if one.piece == piece.index]
    taken += [0.0, 0.5 * (piece.angle_start + piece.angle_end)]
    shares = np.linspace(0.1, 0.9, 17) * (piece.angle_end - piece.angle_start)
    free = np.min(np.abs(piece.angle_start + shares[:, None] - taken), axis=1)
    aside = piece.angle_start + float(shares[np.argmax(np.round(free, 9))])
    rim = np.array(piece.contact_point(aside))
    axes.plot(*np.transpose([centre, rim]), zorder=1.4, **_RADIUS)
    axes.plot(*centre, zorder=2.2, linestyle="none", **_POINT)
    half = 0.5 * (centre + rim)
    number = piece.index + 1
    named = [Named(rf"$O_{{{number}}}$", pair(centre), style.FRAME_GREY)]
    return [*named, Named(rf"$R_{{{number}}}$", pair(half), style.FRAME_GREY)]


def _draw_bodies(axes: Axes, run: Recorded, scale: float, within: Extent) -> list[Named]:
    """Draw the bodies at the start, their angles and speeds; return points to be named."""
    pieces = run.system.trace.pieces
    named: list[Named] = []
    lettered = len(run.system.bodies) <= _LETTERED
    for number, (body, state) in enumerate(
        zip(run.system.bodies, run.system.initial, strict=True), 1
    ):
        piece = pieces[state.piece]
        centre = np.array(piece.body_center(state.position, body.radius))
        colour = str(body_look(number)["color"])
        radius = max(body.radius, _LEAST / scale)
        look: dict[str, Any] = {"facecolor": colour, "linewidth": 0.5}
        axes.add_patch(Circle(pair(centre), radius, edgecolor=style.BLACK, zorder=2.5, **look))
        named.append(Named(rf"$C_{{{number}}}$" if lettered else str(number), pair(centre)))
        slope = piece.slope(state.position)
        if lettered:
            resting = np.array(piece.contact_point(state.position))
            axes.plot(*resting, zorder=2.7, linestyle="none", **_POINT)
            named.append(Named(rf"$P_{{{number}}}$", pair(resting)))
            named += _draw_position(axes, piece, state.position, number, centre, within)
        if state.speed:
            along = np.sign(state.speed) * np.array([np.cos(slope), np.sin(slope)])
            tip = centre + along * (radius + 4.0 / scale)
            axes.annotate("", pair(tip), pair(centre), arrowprops=_ARROW, zorder=2.6)
            axes.plot(*np.transpose([centre, tip]), linewidth=0.0, zorder=1.0)  # keeps names away
            if body.kind != PARTICLE:
                _draw_spin(axes, centre, radius + 1.1 / scale, slope, state.speed, lettered)
                top = centre + (radius + 1.1 / scale) * np.array([-np.sin(slope), np.cos(slope)])
                named += [Named(rf"$\omega_{{{number}}}$", pair(top))] if lettered else []
    return named


def _draw_spin(
    axes: Axes, centre: Array, radius: float, slope: float, speed: float, lettered: bool
) -> None:
    """Draw an arc over a body with an arrow in the sense in which it turns."""
    if not lettered:
        return
    turned = np.radians(np.linspace(40.0, -40.0, 40)) * np.sign(speed)  # right is clockwise
    angles = slope + 0.5 * np.pi + turned
    arc = centre + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    axes.plot(*arc[:-3].T, color=style.BLACK, linewidth=0.6, zorder=1.6)
    look = _ARROW | {"linewidth": 0.6, "mutation_scale": 6.0}
    axes.annotate("", pair(arc[-1]), pair(arc[-6]), arrowprops=look, zorder=2.6)


def _draw_position(
    axes: Axes, piece: Piece, position: float, number: int, centre: Array, within: Extent
) -> list[Named]:
    """Draw the angle φ or ψ of a body at the centre of its arc; return its name."""
    origin = np.array(piece.center)
    if piece.is_line or np.any(origin < within[0]) or np.any(origin > within[1]):
        return []
    axes.plot(*np.transpose([origin, centre]), zorder=1.4, **_RADIUS)
    upright = np.array([0.0, -piece.sign])
    reach = (0.3 + 0.08 * (number % 3)) * piece.path_radius(0.0)
    axes.plot(*np.transpose([origin, origin + 1.1 * reach * upright]), zorder=1.4, **_UPRIGHT)
    angles = np.linspace(0.0, position, 60)
    arc = origin + reach * np.column_stack([np.sin(angles), -piece.sign * np.cos(angles)])
    colour = str(body_look(number)["color"])
    axes.plot(*arc.T, color=colour, linewidth=0.6, zorder=1.6)
    symbol = r"\varphi" if piece.sign > 0.0 else r"\psi"
    return [Named(rf"${symbol}_{{{number}}}$", pair(arc[len(arc) // 2]), colour)]


def pair(point: Array) -> tuple[float, float]:
    """Return a point as two numbers."""
    return float(point[0]), float(point[1])


_PER_PERIOD = 64
"""Points of a trail in a period."""
_FILM_WALL = 0.06
"""Height of a wall at an end of the trace, as a share of half the width."""


class Moving(Recorded, Protocol):
    """A finished run whose motion can be had at any time."""

    def sample(self, times: Any) -> dict[str, Any]:
        """The motion of every body at given times (s)."""


def film_on_trace(run: Moving, times: Array) -> Frames:
    """Return the states of all bodies at the times of frames (s).

    Nothing is interpolated: each state is that of its flight in closed form. On a closed trace the
    bodies must not run half of it from frame to frame, or their turning is not right.
    """
    bodies, times = run.system.bodies, np.asarray(times)
    sampled = run.sample(times)

    def table(name: str) -> Array:
        return np.asarray(sampled[name], dtype=np.float64).reshape(len(times), len(bodies))

    arc = np.asarray(sampled["arc"]).reshape(len(times), len(bodies)) - 1
    s, speed = table("s"), table("speed")
    turn = np.column_stack(
        [_turned(run.system.trace, body, arc[:, n], s[:, n]) for n, body in enumerate(bodies)]
    )
    periods = small_periods(run.system)
    more, span = times_between(times, min(periods) / _PER_PERIOD, max(periods)), max(periods)
    between = _states(run, more)
    trails = tuple(
        trail(
            times, span,
            [
                (times, s[:, n], speed[:, n], 2),
                (more, between[0][:, n], between[1][:, n], 2),
                *struck(run, n, "s"),
                *_at_walls(run, n),
            ],
            0.5 * run.system.trace.length,
        )
        for n in range(len(bodies))
    )  # fmt: skip
    return Frames(_ground(run), times, table("x"), table("y"), turn, s, speed, trails, span)


def _ground(run: Recorded) -> Ground:
    """Return the trace with its walls, and the plane of speed against arc length."""
    surface = trace_points(run.system.trace)
    radii = tuple(body.radius for body in run.system.bodies)
    room = 1.1 * max(radii) + 0.01 * float(np.max(np.ptp(surface, axis=0)))

    def draw(axes: Axes, half: float) -> None:
        axes.plot(surface[:, 0], surface[:, 1], color=style.BLACK, linewidth=1.0)
        draw_ends(axes, run.system, _FILM_WALL * half)

    junctions = tuple(piece.start_s for piece in run.system.trace.pieces[1:])
    panel = Panel("s", "speed against arc length", junctions)
    low, high = surface.min(axis=0) - room, surface.max(axis=0) + room
    return Ground(radii, low, high, draw, "the trace", panel)


def _states(run: Moving, times: Array) -> tuple[Array, Array]:
    """Return arc lengths (m) and speeds (m/s) at some times, shape (times, bodies)."""
    shape = len(times), len(run.system.bodies)
    if not len(times):
        return np.empty(shape), np.empty(shape)
    sampled = run.sample(times)
    s, speed = (np.asarray(sampled[name], dtype=np.float64) for name in ("s", "speed"))
    return s.reshape(shape), speed.reshape(shape)


def small_periods(system: TraceSystem) -> list[float]:
    """Return the periods (s) of small oscillations on the arcs, shorter where the trace turns.

    Without an arc or gravity that of a pendulum as long as the trace, or 1 s.
    """
    turning = 0.0 if system.turning is None else system.turning.square
    rates = [
        math.sqrt(turning + system.gravity / (body.kappa * piece.path_radius(body.radius)))
        for piece in system.trace.pieces
        for body in system.bodies
        if not piece.is_line
    ] or [math.sqrt(turning + system.gravity / system.trace.length)]
    return [2.0 * math.pi / rate if rate > 0.0 else 1.0 for rate in rates]


def _turned(trace: Trace, body: Body, arc: Any, s: Array) -> Array:
    """Return how far a body has turned (rad): the way of its centre through its radius."""
    if body.kind == PARTICLE:
        return np.zeros(len(s))
    scales = np.array(
        [1.0 if p.is_line else p.path_radius(body.radius) / p.radius for p in trace.pieces]
    )
    lengths = scales * [piece.length for piece in trace.pieces]
    before = np.concatenate([[0.0], np.cumsum(lengths)])
    starts = np.array([piece.start_s for piece in trace.pieces])
    way = before[arc] + scales[arc] * (s - starts[arc])
    if trace.closed:
        way = np.unwrap(way, period=before[-1])
    turned: Array = (way - way[0]) / body.radius
    return turned


def _at_walls(run: Recorded, body: int) -> Iterator[States]:
    """Yield the states of a body before and after its impacts on walls."""
    flights, pieces = run.flights(), run.system.trace.pieces
    scales = np.array(
        [1.0 if p.is_line else p.path_radius(run.system.bodies[body].radius) for p in pieces]
    )
    mine = np.asarray(flights["ball"]) == body + 1
    for order, end in enumerate(("end", "start")):
        rows = np.flatnonzero(mine & (np.asarray(flights[f"cause_{end}"], dtype=object) == "wall"))
        arc = np.asarray(flights["arc"])[rows] - 1
        places = flights[f"angle_{end}"][rows]
        along = [pieces[n].arc_length(place) for n, place in zip(arc, places, strict=True)]
        speed = scales[arc] * flights[f"rate_{end}"][rows]
        yield np.asarray(flights[f"t_{end}"])[rows], np.array(along, dtype=np.float64), speed, order
