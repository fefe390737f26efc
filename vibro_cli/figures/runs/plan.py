"""The plan: configurations at the successive impacts on the trace as it is drawn (B fig. 9)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from vibro_cli.figures import style
from vibro_cli.figures.chart import body_look
from vibro_cli.figures.labels import line_of_entries
from vibro_cli.figures.source import Array, Recorded
from vibro_cli.figures.style import MM, WIDTHS
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.mechanics.trace import Trace

_COLUMNS = {"single": 2, "double": 4}
_ROWS = 4
_TOP = 5.5
_TITLE = 3.6
_GAP = 2.0
_BOTTOM = 6.0
"""Room for the bar of length (mm)."""
_TALLEST = 40.0
_SHORTEST = 9.0
_MARGIN = 0.03
_FAINT = 0.35
_CLOSE = 5.0
"""Room around bodies that are shown close, in radii of the greatest."""
_PART = 0.4
"""Bodies within this share of the trace are shown close."""
_SURFACE: dict[str, Any] = {"color": style.BLACK, "linewidth": 0.7, "linestyle": "solid"}
WALL: dict[str, Any] = {"color": style.BLACK, "linewidth": 2.0, "solid_capstyle": "butt"}
_SAY: dict[str, Any] = {"fontsize": style.SMALL, "color": style.FRAME_GREY}


@dataclass(frozen=True)
class Configuration:
    """Where the bodies are at one instant."""

    title: str
    centres: Array
    """Places of the centres (m), shape (bodies, 2)."""
    struck: tuple[int, ...]
    """Indices of the bodies that collide."""


def trace_points(trace: Trace, count: int = 121) -> Array:
    """Return points of the trace (m), shape (n, 2), `count` on each arc."""
    points = [
        piece.contact_point(float(position))
        for piece in trace.pieces
        for position in np.linspace(
            piece.angle_start, piece.angle_end, 2 if piece.is_line else count
        )
    ]
    return np.array(points)


def plan(run: Recorded, width: str = "single") -> Figure | None:
    """Return the trace with the bodies at the start, at the first impacts and at the last one.

    Of a trace on which the bodies keep to a small part, that part. None without an impact.
    Raises ValueError for a width that is neither `single` nor `double`.
    """
    if width not in WIDTHS:
        raise ValueError(f"unknown width {width!r}, expected one of {', '.join(WIDTHS)}")
    if not len(run.collisions["n"]):
        return None
    shown = configurations(run, _COLUMNS[width] * _ROWS)
    surface = trace_points(run.system.trace)
    radii = [body.radius for body in run.system.bodies]
    low, high = surface.min(axis=0), surface.max(axis=0)
    room = max(_MARGIN * float(np.max(high - low)), 1.1 * max(radii))
    low, high = low - room, np.maximum(high + room, high + 2.1 * max(radii) * np.array([0.0, 1.0]))
    low, high = visited(np.concatenate([one.centres for one in shown]), max(radii), low, high)
    with style.journal():
        figure, panels, scale = _sheet(width, len(shown), low, high)
        for axes, one in zip(panels, shown, strict=True):
            axes.plot(surface[:, 0], surface[:, 1], zorder=2.0, **_SURFACE)
            draw_ends(axes, run.system, 2.5 / scale)
            for index, radius in enumerate(radii):
                _draw_body(axes, one, index, radius, 0.45 / scale)
            axes.set_title(one.title, pad=1.5, **_SAY)
        _draw_bar(figure, float(high[0] - low[0]), scale)
        number = len(radii)
        if number > 1:
            entries = [(f"body {n}", _dot(n)) for n in range(1, min(number, 5) + 1)]
            line_of_entries(figure, entries)
    return figure


def draw_ends(axes: Axes, system: TraceSystem, high: float) -> None:
    """Draw the walls at the ends of a trace, of a height (m)."""
    first, last = system.trace.pieces[0], system.trace.pieces[-1]
    ends = (first, first.angle_start, system.left_end), (last, last.angle_end, system.right_end)
    for piece, position, wall in ends:
        if wall is not None:
            foot, slope = np.array(piece.contact_point(position)), piece.slope(position)
            top = foot + high * np.array([-np.sin(slope), np.cos(slope)])
            axes.plot(*np.transpose([foot, top]), zorder=2.1, **WALL)


def visited(centres: Array, radius: float, low: Array, high: Array) -> tuple[Array, Array]:
    """Return the corners (m) of what is shown of a trace between two corners.

    That is all of it, unless bodies with these centres and a greatest radius would be too small to
    be seen there and keep to a part of it.
    """
    first = np.nanmin(centres, axis=0) - _CLOSE * radius
    last = np.nanmax(centres, axis=0) + _CLOSE * radius
    if radius == 0.0 or np.max(last - first) > _PART * np.max(high - low):
        return low, high
    return np.maximum(first, low), np.minimum(last, high)


def configurations(run: Recorded, most: int) -> list[Configuration]:
    """Return the start, the first impacts and, if there are more than `most` in all, the last."""
    pieces = run.system.trace.pieces
    states = zip(run.system.bodies, run.system.initial, strict=True)
    start = [pieces[state.piece].body_center(state.position, body.radius) for body, state in states]
    found = [Configuration("start", np.array(start), ())]
    times = np.asarray(run.collisions["t"], dtype=np.float64)
    rows = list(range(min(len(times), most - 1)))
    if len(times) > most - 1:
        rows = [*rows[:-1], len(times) - 1]
    for row in rows:
        title = f"impact {int(run.collisions['n'][row])}, {float(times[row]):.4g} s"
        pair = tuple(int(run.collisions[f"ball_{side}"][row]) - 1 for side in "ab")
        found.append(Configuration(title, _centres(run, float(times[row]), row, pair), pair))
    return found


def _centres(run: Recorded, time: float, row: int, pair: tuple[int, ...]) -> Array:
    """Return the places of all bodies at an impact (m): of the pair from the table."""
    centres = np.full((len(run.system.bodies), 2), math.nan)
    flights = run.flights()
    for ball, body in enumerate(run.system.bodies, 1):
        if ball - 1 in pair:
            continue
        mine = np.flatnonzero(
            (np.asarray(flights["ball"]) == ball) & (np.asarray(flights["t_start"]) <= time)
        )
        last = int(mine[-1])
        piece = run.system.trace.pieces[int(flights["arc"][last]) - 1]
        times, position, _ = run.flight_curve(last, 257)
        place = float(np.interp(time, times, position))
        centres[ball - 1] = piece.body_center(place, body.radius)
    for index, side in zip(pair, "ab", strict=True):
        centres[index] = run.collisions[f"x_{side}"][row], run.collisions[f"y_{side}"][row]
    return centres


def _sheet(width: str, number: int, low: Array, high: Array) -> tuple[Figure, list[Axes], float]:
    """Return a figure with empty panels of equal scale, and the scale (mm per m)."""
    extent = high - low
    columns = min(_COLUMNS[width], number)
    cell = (WIDTHS[width] - _GAP) / columns - _GAP
    scale = min(cell / extent[0], _TALLEST / extent[1])
    across, along = scale * extent
    along = max(along, _SHORTEST)
    rows = math.ceil(number / columns)
    total = _TOP + rows * (_TITLE + along + _GAP) + _BOTTOM
    figure = Figure(figsize=(WIDTHS[width] * MM, total * MM))
    panels = []
    middle = 0.5 * (low[1] + high[1])
    for place in range(number):
        row, column = divmod(place, columns)
        left = _GAP + column * (cell + _GAP) + 0.5 * (cell - across)
        bottom = total - _TOP - (row + 1) * (_TITLE + along) - row * _GAP
        wide = WIDTHS[width]
        axes = figure.add_axes((left / wide, bottom / total, across / wide, along / total))
        axes.set_axis_off()
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(middle - 0.5 * along / scale, middle + 0.5 * along / scale)
        panels.append(axes)
    return figure, panels, float(scale)


def _dot(ball: int) -> dict[str, Any]:
    colour = body_look(ball)["color"]
    return {"marker": "o", "color": colour, "markersize": 4.0, "linestyle": "none"}


def _draw_body(axes: Axes, one: Configuration, index: int, radius: float, least: float) -> None:
    """Draw a body, faint unless it collides; a small one as large as can be seen."""
    colour = body_look(index + 1)["color"]
    x, y = float(one.centres[index, 0]), float(one.centres[index, 1])
    struck = index in one.struck or not one.struck
    for face, alpha in ((colour, 0.9 if struck else _FAINT), ("none", 1.0)):
        look: dict[str, Any] = {"facecolor": face, "alpha": alpha, "linewidth": 0.5}
        look["edgecolor"] = style.BLACK if face == "none" else "none"
        axes.add_patch(Circle((x, y), max(radius, least), zorder=2.5, **look))


def _draw_bar(figure: Figure, extent: float, scale: float) -> None:
    """Draw a bar of round length below the panels, with its length."""
    wide, high = figure.get_size_inches() / MM
    power = 10.0 ** math.floor(math.log10(0.45 * extent))
    length = next(f * power for f in (5.0, 2.0, 1.0) if f * power <= 0.45 * extent)
    left, bottom = _GAP + 1.0, 3.0
    axes = figure.add_axes((left / wide, bottom / high, length * scale / wide, 1.0 / high))
    axes.set_axis_off()
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(-1.0, 1.0)
    axes.plot([0, 0, 0, 1, 1, 1], [-1, 1, 0, 0, 1, -1], clip_on=False, **_SURFACE)
    after = (left + length * scale + 1.5) / wide
    figure.text(after, (bottom + 0.5) / high, f"{length:g} m", va="center", **_SAY)
