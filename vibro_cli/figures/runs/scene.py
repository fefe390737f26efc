"""The trace to scale: the scene at the start (A fig. 2a) and at the impacts (B fig. 9)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.colors import to_rgba_array
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from vibro_cli.figures import style
from vibro_cli.figures.chart import (
    MOST_COLOURS,
    Cell,
    Sheet,
    body_entries,
    body_look,
    in_rows,
    plane_axes,
)
from vibro_cli.figures.labels import (
    HALO,
    SMALL_TEXT,
    Named,
    draw_legend,
    ring,
    rows_of,
    short_number,
    text_width,
    write_names,
)
from vibro_cli.figures.source import Array, Recorded, kept
from vibro_cli.figures.style import Look, line, mark, panel_size, width_of
from vibro_cli.figures.ticks import round_below
from vibro_cli.mechanics.potential import Turning
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.mechanics.trace import Piece, Trace

_LEFT = 11.0
_RIGHT = 3.0
_TOP = 2.0
_BOTTOM = 8.5
_HIGHEST = 70.0
_LOWEST = 20.0
_WORDS = 7.0
"""Room for numbers around the drawing (mm)."""
_AWAY = 3.2
"""Distance of the number of a piece from the trace (mm)."""
_NARROW = 5.0
"""Pieces shorter than this (mm) have no number, centre and radius, for lack of room."""
_KEEN = 3
"""Weight of lines among the obstacles that names should not cover."""
_WALL = 5.0
"""Height of a wall at an end of the trace (mm)."""
_BESIDE, _UNDER = 1.0, 2.7
"""Room between the rate of rotation and its axis, and from its middle to the frame (mm)."""
_TINY = 0.003
"""Bodies smaller than this share of the trace are shown close up."""
_LEAST = 0.5
"""Least radius with which a body is drawn (mm)."""
_SURFACE = line(style.BLACK, 0.8)
_JUNCTION = mark("o", 2.2, style.BLACK)
_AXIS = line(style.FRAME_GREY, 0.6, (8.0, 2.0, 1.5, 2.0))
ARROW = line(style.BLACK, 0.7) | {"arrowstyle": "-|>", "shrinkA": 0.0, "shrinkB": 0.0}
_RADIUS = line(style.FRAME_GREY, 0.35)
_UPRIGHT = line(style.FRAME_GREY, 0.35, style.AXIS_DASHES)
LETTERED = 3
"""Greatest number of bodies whose centres, contact points and angles are named."""
_RING = ring(24)
Extent = tuple[Array, Array]
"""Lower left and upper right corner (m)."""


def scene(run: Recorded, width: str = "single") -> Figure:
    """Draw the trace to scale with its pieces numbered and the bodies at the start.

    The centres O and radii R of the arcs are drawn and, for a few bodies, the centres C, contact
    points P and angles φ, ψ. Of very short pieces only the junctions are marked.
    """
    surface = trace_points(run.system.trace)
    low, high = _extent(run, surface)
    wide = width_of(width)
    inner = wide - _LEFT - _RIGHT
    scale = float(np.min((np.array([inner, _HIGHEST]) - _WORDS) / (high - low)))
    tall = max(scale * float(high[1] - low[1]) + _WORDS, _LOWEST)
    total = _TOP + tall + _BOTTOM
    with style.journal():
        sheet = Sheet(wide, total)
        axes = sheet.panel(_LEFT, _BOTTOM, inner, tall)
        middle, half = 0.5 * (low + high), 0.5 * np.array([inner, tall]) / scale
        plane_axes(axes, middle - half, middle + half)
        axes.plot(surface[:, 0], surface[:, 1], zorder=2.0, **_SURFACE)
        within = low, high
        pieces = [one for one in run.system.trace.pieces if one.length * scale >= _NARROW]
        numbers = [_number_place(run, piece, scale) for piece in pieces]
        named = [
            name
            for piece, place in zip(pieces, numbers, strict=True)
            for name in _draw_piece(axes, run, piece, place, within)
        ]
        starts = [piece.contact_point(piece.angle_start) for piece in run.system.trace.pieces]
        for junction in (*starts, surface[-1]):
            axes.plot(*junction, zorder=2.2, clip_on=True, **_JUNCTION)
        draw_ends(axes, run.system, _WALL / scale)
        if run.system.turning is not None:
            numbers = [*numbers, *draw_axis(axes, run.system.turning)]
        named = [*_draw_bodies(axes, run, scale, within), *named]
        covered = np.concatenate([_obstacles(run, scale), *_points_of(axes)])
        write_names(axes, named, covered, numbers)
    return sheet.figure


def _points_of(axes: Axes) -> list[Array]:
    """Return points of all lines drawn, 60 of each straight one, as obstacles for names."""
    share = np.linspace(0.0, 1.0, 60)[:, None]
    lines = [_points_along(axes, line) for line in axes.lines]
    points = [one[:1] + share * (one[-1:] - one[:1]) if len(one) == 2 else one for one in lines]
    return points * _KEEN


def _points_along(axes: Axes, line: Line2D) -> Array:
    """Return the points of a line (m); the ends of the axis of rotation are given in shares."""
    points = np.asarray(line.get_xydata())
    if line.get_transform() == axes.transData:
        return points
    shown: Array = axes.transData.inverted().transform(line.get_transform().transform(points))
    return shown


def _obstacles(run: Recorded, scale: float) -> Array:
    """Return points that names should not cover: the trace and the bodies."""
    found = [trace_points(run.system.trace, on_lines=60)]
    for body, centre in zip(run.system.bodies, _centres(run), strict=True):
        radius = max(body.radius, _LEAST / scale)
        found += [centre + radius * share * _RING for share in (0.4, 0.7, 1.0)]
    return np.concatenate(found)


def draw_axis(axes: Axes, turning: Turning, larger: float = 1.0) -> Array:
    """Draw the vertical axis about which the trace rotates, with the rate where there is room.

    `larger` is the magnification of letters. Returns points along the rate (m), 1 mm apart, shape
    (n, 2).
    """
    axes.axvline(turning.x, zorder=1.5, **_AXIS)
    words = rf"$\Omega = {turning.rate:.4g}$ rad/s"
    (low, high), top = axes.get_xlim(), axes.get_ylim()[1]
    each = (high - low) / panel_size(axes)[0]
    wide = larger * text_width(words)
    first = turning.x + _BESIDE * each
    if first + (wide + _BESIDE) * each > high:
        first = turning.x - (_BESIDE + wide) * each
    level = top - larger * _UNDER * each
    look = SMALL_TEXT | {"color": style.BLACK, "path_effects": HALO, "zorder": 3.0}
    look["fontsize"] = larger * style.SMALL
    axes.text(first, level, words, va="center", **look)
    along = first + np.arange(0.0, wide, 1.0) * each
    return np.column_stack([along, np.full(len(along), level)])


def _extent(run: Recorded, surface: Array) -> tuple[Array, Array]:
    turning = run.system.turning
    reach = surface if turning is None else np.append(surface, [[turning.x, surface[0, 1]]], axis=0)
    low, high = reach.min(axis=0), reach.max(axis=0)
    largest = max(body.radius for body in run.system.bodies)
    room = max(2.1 * largest, 0.04 * float(np.max(np.ptp(surface, axis=0))))
    if turning is None and largest < _TINY * float(np.max(high - low)):
        return visited(run.system, _centres(run), low - room, high + room)
    return low - room, high + room


def _centres(run: Recorded) -> Array:
    """Return the centres of the bodies at the start (m), shape (bodies, 2)."""
    pieces = run.system.trace.pieces
    states = zip(run.system.bodies, run.system.initial, strict=True)
    return np.array(
        [pieces[one.piece].body_centre(one.position, body.radius) for body, one in states]
    )


def _number_place(run: Recorded, piece: Piece, scale: float) -> Array:
    """Return the place of the number of a piece (m): below its middle.

    If the axis of rotation passes there, or a body is there, the place is beside the middle.
    """
    turning, middle = run.system.turning, 0.5 * (piece.angle_start + piece.angle_end)
    starts = [one.position for one in run.system.initial if one.piece == piece.index]
    taken = [piece.contact_point(position)[0] for position in starts]
    taken += [] if turning is None else [turning.x]
    if any(abs(piece.contact_point(middle)[0] - x) < 2.0 / scale for x in taken):
        middle += 0.12 * (piece.angle_end - piece.angle_start)
    slope = piece.slope(middle)
    below = np.array([np.sin(slope), -np.cos(slope)]) * _AWAY / scale
    return np.array(piece.contact_point(middle)) + below


def _draw_piece(
    axes: Axes, run: Recorded, piece: Piece, place: Array, within: Extent
) -> list[Named]:
    """Draw the number of a piece, the centre and the radius; return the names of the latter two.

    The centre of an arc and its radius are left out if they are outside the figure.
    """
    look = SMALL_TEXT | {"ha": "center", "va": "center", "fontstyle": "italic"}
    words = str(piece.index + 1)
    if np.all(place > within[0]) and np.all(place < within[1]):
        axes.text(place[0], place[1], words, path_effects=HALO, zorder=3.0, **look)
    centre = np.array(piece.centre)
    if piece.is_line or np.any(centre < within[0]) or np.any(centre > within[1]):
        return []
    # Choose a radius far from the number at the middle, from the vertical and from the bodies.
    taken = [one.position for one in run.system.initial if one.piece == piece.index]
    taken += [0.0, 0.5 * (piece.angle_start + piece.angle_end)]
    shares = np.linspace(0.1, 0.9, 17) * (piece.angle_end - piece.angle_start)
    free = np.min(np.abs(piece.angle_start + shares[:, None] - taken), axis=1)
    aside = piece.angle_start + float(shares[np.argmax(np.round(free, 9))])
    rim = np.array(piece.contact_point(aside))
    axes.plot(*np.transpose([centre, rim]), zorder=1.4, **_RADIUS)
    axes.plot(*centre, zorder=2.2, **style.POINT)
    half = 0.5 * (centre + rim)
    number = piece.index + 1
    named = [Named(rf"$O_{{{number}}}$", centre, style.FRAME_GREY)]
    return [*named, Named(rf"$R_{{{number}}}$", half, style.FRAME_GREY)]


def _draw_bodies(axes: Axes, run: Recorded, scale: float, within: Extent) -> list[Named]:
    """Draw the bodies at the start, their angles and speeds; return the names of points."""
    pieces = run.system.trace.pieces
    named: list[Named] = []
    lettered = len(run.system.bodies) <= LETTERED
    for number, (body, state) in enumerate(
        zip(run.system.bodies, run.system.initial, strict=True), 1
    ):
        piece = pieces[state.piece]
        centre = np.array(piece.body_centre(state.position, body.radius))
        colour = str(body_look(number)["color"])
        radius = max(body.radius, _LEAST / scale)
        look: dict[str, Any] = {"facecolor": colour, "linewidth": 0.5}
        axes.add_patch(Circle(tuple(centre), radius, edgecolor=style.BLACK, zorder=2.5, **look))
        named.append(Named(rf"$C_{{{number}}}$" if lettered else str(number), centre))
        slope = piece.slope(state.position)
        if lettered:
            resting = np.array(piece.contact_point(state.position))
            axes.plot(*resting, zorder=2.7, **style.POINT)
            named.append(Named(rf"$P_{{{number}}}$", resting))
            named += _draw_position(axes, piece, state.position, number, centre, within)
        if state.speed:
            along = np.sign(state.speed) * np.array([np.cos(slope), np.sin(slope)])
            tip = centre + along * (radius + 4.0 / scale)
            axes.annotate("", tuple(tip), tuple(centre), arrowprops=ARROW, zorder=2.6)
            axes.plot(*np.transpose([centre, tip]), linewidth=0.0, zorder=1.0)  # an obstacle
            if lettered and not body.slides:
                around = radius + 1.1 / scale
                _draw_spin(axes, centre, around, slope, state.speed)
                top = centre + around * np.array([-np.sin(slope), np.cos(slope)])
                named.append(Named(rf"$\omega_{{{number}}}$", top))
    return named


def _draw_spin(axes: Axes, centre: Array, radius: float, slope: float, speed: float) -> None:
    """Draw an arc over a body with an arrow in its sense of rotation."""
    turned = np.radians(np.linspace(40.0, -40.0, 40)) * np.sign(speed)  # right is clockwise
    angles = slope + 0.5 * np.pi + turned
    arc = centre + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    axes.plot(*arc[:-3].T, color=style.BLACK, linewidth=0.6, zorder=1.6)
    look = ARROW | {"linewidth": 0.6, "mutation_scale": 6.0}
    axes.annotate("", tuple(arc[-1]), tuple(arc[-6]), arrowprops=look, zorder=2.6)


def _draw_position(
    axes: Axes, piece: Piece, position: float, number: int, centre: Array, within: Extent
) -> list[Named]:
    """Draw the angle φ or ψ of a body at the centre of its arc; return the name of the angle."""
    origin = np.array(piece.centre)
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
    return [Named(rf"${symbol}_{{{number}}}$", arc[len(arc) // 2], colour)]


_COLUMNS = {"single": 2, "double": 4}
_ROWS = 4
_PLAN_TOP = 5.5
_TITLE = 3.6
_GAP = 2.0
_PLAN_BOTTOM = 6.0
"""Room for the scale bar (mm)."""
_TALLEST = 40.0
_SHORTEST = 9.0
_MARGIN = 0.03
_FAINT = 0.35
_CLOSE = 5.0
"""Room around bodies that are shown close up, in radii of the largest body."""
_PART = 0.4
"""Bodies within this share of the trace are shown close up, ..."""
_NEAR = 0.5
"""... with walls that are nearer to them than this share of their extent."""
_PLAN_SURFACE = line(style.BLACK, 0.7)
WALL = line(style.BLACK, 2.0) | {"solid_capstyle": "butt"}


@dataclass(frozen=True)
class Configuration:
    """The places of the bodies at one instant."""

    title: str
    centres: Array
    """Places of the centres (m), shape (bodies, 2)."""
    struck: tuple[int, ...]
    """Indices of the bodies that collide."""


def trace_points(trace: Trace, on_arcs: int = 121, on_lines: int = 2) -> Array:
    """Return points of the trace (m), shape (n, 2): `on_arcs` per arc, `on_lines` per line."""
    points = []
    for piece in trace.pieces:
        count = on_lines if piece.is_line else on_arcs
        positions: Any = np.linspace(piece.angle_start, piece.angle_end, count)
        points.append(piece.contact_point(positions))
    return np.concatenate(points, axis=1).T


def plan(run: Recorded, width: str = "single") -> Figure | None:
    """Draw the trace with the bodies at the start, at the first impacts and at the last one.

    If the bodies stay on a small part of the trace, only that part is drawn. Returns None without
    an impact.
    """
    if not len(run.collisions["n"]):
        return None
    shown = configurations(run, _COLUMNS[width] * _ROWS)
    surface = trace_points(run.system.trace)
    radii = [body.radius for body in run.system.bodies]
    low, high = surface.min(axis=0), surface.max(axis=0)
    room = max(_MARGIN * float(np.max(high - low)), 1.1 * max(radii))
    low, high = low - room, np.maximum(high + room, high + 2.1 * max(radii) * np.array([0.0, 1.0]))
    low, high = visited(run.system, np.concatenate([one.centres for one in shown]), low, high)
    with style.journal():
        sheet, panels, scale = _plan_sheet(width, len(shown), low, high)
        for axes, one in zip(panels, shown, strict=True):
            axes.plot(surface[:, 0], surface[:, 1], zorder=2.0, **_PLAN_SURFACE)
            draw_ends(axes, run.system, 2.5 / scale)
            _draw_discs(axes, one, np.maximum(radii, 0.45 / scale))
            axes.set_title(one.title, pad=1.75, **SMALL_TEXT)
        _draw_bar(sheet, float(high[0] - low[0]), scale)
        if len(radii) > 1:
            named = body_entries(run, MOST_COLOURS)
            entries = [
                (name, mark("o", 4.0, look["color"]) if "color" in look else look)
                for name, look in named
            ]
            draw_legend(sheet.figure, rows_of(entries, width_of(width)))
    return sheet.figure


def draw_ends(axes: Axes, system: TraceSystem, high: float) -> None:
    """Draw the walls at the ends of a trace with a given height (m)."""
    for foot, slope in _walls(system):
        top = foot + high * np.array([-np.sin(slope), np.cos(slope)])
        axes.plot(*np.transpose([foot, top]), zorder=2.1, **WALL)


def _walls(system: TraceSystem) -> list[tuple[Array, float]]:
    """Return the foot (m) of each wall at an end of the trace, and the slope there."""
    first, last = system.trace.pieces[0], system.trace.pieces[-1]
    ends = (first, first.angle_start, system.left_end), (last, last.angle_end, system.right_end)
    return [
        (np.array(piece.contact_point(position)), piece.slope(position))
        for piece, position, wall in ends
        if wall is not None
    ]


def visited(system: TraceSystem, centres: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Return the corners (m) of the part of a trace that is shown, within two given corners.

    It is the whole trace, unless the bodies with these centres stay on a part of it, where they
    are drawn larger. Then it is that part with the walls near it.
    """
    radius = max(body.radius for body in system.bodies)
    first = np.nanmin(centres, axis=0) - _CLOSE * radius
    last = np.nanmax(centres, axis=0) + _CLOSE * radius
    if radius == 0.0 or np.max(last - first) > _PART * np.max(high - low):
        return low, high
    near = _NEAR * np.max(last - first)
    for foot, _ in _walls(system):
        if np.all(foot > first - near) and np.all(foot < last + near):
            first, last = np.minimum(first, foot - radius), np.maximum(last, foot + radius)
    return np.maximum(first, low), np.minimum(last, high)


def configurations(run: Any, most: int) -> list[Configuration]:
    """Return the start, the first impacts and the last one; at most `most` configurations."""
    times = np.asarray(run.collisions["t"], dtype=np.float64)
    rows = list(range(min(len(times), most - 1)))
    if len(times) > most - 1:
        rows = [*rows[:-1], len(times) - 1]
    centres = _at_impacts(run)
    found = [Configuration("start", _centres(run), ())]
    for row in rows:
        title = f"impact {int(run.collisions['n'][row])}, {short_number(float(times[row]))} s"
        pair = tuple(int(run.collisions[f"ball_{side}"][row]) - 1 for side in "ab")
        found.append(Configuration(title, centres[min(row, len(centres) - 1)], pair))
    return found


@kept
def _at_impacts(run: Any) -> Array:
    """Return the places of all centres (m) at the first impacts and at the last one, of any plan.

    The shape is (impacts, bodies, 2). A long run is solved again to its end, once for all widths.
    """
    times = np.asarray(run.collisions["t"], dtype=np.float64)
    first = times[: max(_COLUMNS.values()) * _ROWS - 1]
    motion = run.sample(np.append(first, times[-1:]))
    return np.column_stack([motion["x"], motion["y"]]).reshape(len(first) + 1, -1, 2)


def _plan_sheet(
    width: str, number: int, low: Array, high: Array
) -> tuple[Sheet, list[Axes], float]:
    """Return a figure with empty panels of equal scale, and the scale (mm per m)."""
    extent = high - low
    columns = min(_COLUMNS[width], number)
    wide = width_of(width)
    room = (wide - _GAP) / columns - _GAP
    scale = min(room / extent[0], _TALLEST / extent[1])
    across, along = scale * extent
    along = max(along, _SHORTEST)
    cell = Cell(room, along, _TITLE, _GAP, _GAP)
    left = _GAP + 0.5 * (room - across)
    sheet, corners = in_rows(cell, number, columns, wide, left, _PLAN_TOP, _PLAN_BOTTOM)
    panels = []
    middle = 0.5 * (low[1] + high[1])
    for corner in corners:
        axes = sheet.blank(*corner, across, along)
        axes.set_axis_off()
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(middle - 0.5 * along / scale, middle + 0.5 * along / scale)
        panels.append(axes)
    return sheet, panels, float(scale)


def _draw_discs(axes: Axes, one: Configuration, radii: Array) -> None:
    """Draw the bodies in order as discs with the given radii (m), faint unless they collide."""
    numbers = range(len(radii))
    colours = [body_look(number + 1)["color"] for number in numbers]
    struck = [number in one.struck or not one.struck for number in numbers]
    faces = to_rgba_array(colours, np.where(struck, 0.9, _FAINT))
    discs = [Circle(tuple(one.centres[number]), radii[number]) for number in numbers]
    # The edge of a body covers its face, and the next body covers both.
    look: Look = {"facecolors": [colour for face in faces for colour in (face, "none")]}
    look |= {"edgecolors": ["none", style.BLACK], "linewidths": [0.0, 0.5], "zorder": 2.5}
    twice = [disc for disc in discs for _ in range(2)]
    axes.add_collection(PatchCollection(twice, **look), autolim=False)


def _draw_bar(sheet: Sheet, extent: float, scale: float) -> None:
    """Draw a scale bar of a round length below the panels."""
    length = round_below(0.45 * extent)
    left, bottom = _GAP + 1.0, 3.0
    axes = sheet.blank(left, bottom, length * scale, 1.0)
    axes.set_axis_off()
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(-1.0, 1.0)
    axes.plot([0, 0, 0, 1, 1, 1], [-1, 1, 0, 0, 1, -1], clip_on=False, **_PLAN_SURFACE)
    after = left + length * scale + 1.5
    sheet.write(after, bottom + 0.5, f"{short_number(length)} m", va="center", **SMALL_TEXT)
