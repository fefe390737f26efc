"""Phase portraits of a run and without one: rate against angle (A fig. 2, B fig. 8, D fig. 1).

Of one body, or of several on one trace, one over the other: particle, disk and ball.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from vibro_cli.analysis.levels import Landscape, LevelCurve, level_curves, speed_curves
from vibro_cli.analysis.singular import FIGURE_EIGHT, SADDLE, Portrait, condition
from vibro_cli.figures import style
from vibro_cli.figures.chart import body_look, number_plane
from vibro_cli.figures.labels import LINE, Entry, bar_width, draw_legend, line_of_entries, rows_of
from vibro_cli.figures.portraits import layers
from vibro_cli.figures.portraits.layers import (
    Background,
    background,
    both_halves,
    last_time,
    legend_of,
    saddle_energies,
)
from vibro_cli.figures.portraits.panels import BOTTOM, LEFT, RIGHT, Panel, Window, label, lay_out
from vibro_cli.figures.portraits.trace_phase_plane import (
    EIGHT,
    JUNCTION,
    REST,
    SPEED_AGAINST_PLACE,
    both_ways,
    curves_of,
    draw_along,
    highest_energy,
    name_points,
)
from vibro_cli.figures.portraits.trajectory import MOST_NUMBERS, Trajectory, trajectory
from vibro_cli.figures.source import Array, Recorded
from vibro_cli.figures.style import MM, WIDTHS
from vibro_cli.mechanics.trace import Piece

FOCUSES = ("auto", "trace", "run")

_FAR = 3.0
"""A separatrix higher than this multiple of the trajectory is cut off by the frame."""
_SMALL = 0.13
"""A motion within this share of its arc's phase plane is too small to be read on it."""
_MARGIN = 1.08
_ROOM = 0.15
"""Room left and right of the motion, as a share of its extent."""


def windows(
    pieces: Sequence[Piece], path: Trajectory, behind: Background, focus: str = "auto"
) -> tuple[Window, ...]:
    """Return the windows of a portrait: on the whole trace, or only on where the body went.

    With `auto` a motion that would be small on its arc is shown close, the whole arc beside it.
    Raises ValueError for a focus that is not one of `FOCUSES`.
    """
    if focus not in FOCUSES:
        raise ValueError(f"unknown focus {focus!r}, expected one of {', '.join(FOCUSES)}")
    tops = {lines: _top(pieces, path, behind, lines) for lines in (False, True)}
    whole = [
        Window(piece, piece.angle_start, piece.angle_end, tops[piece.is_line]) for piece in pieces
    ]
    visited = [piece for piece in pieces if path.branches[piece.index].position.size]
    if len(visited) == 1 and (focus == "run" or _is_small(visited[0], path, behind)):
        close = _around(visited[0], path)
        if focus == "run":
            return (close,)
        if focus == "auto":
            overview = replace(whole[visited[0].index], overview=True)
            return (close, replace(overview, top=max(overview.top, _full_circle(close, behind))))
    if focus == "run":
        return tuple(window for window in whole if window.piece in visited)
    return tuple(whole)


def seen(behind: Background, shown: Sequence[Window]) -> Background:
    """Return what of a background is within some windows."""

    def within(curve: LevelCurve) -> bool:
        return any(
            one.piece.index == curve.piece
            and np.any(
                (curve.position > one.low) & (curve.position < one.high) & (curve.rate < one.top)
            )
            for one in shown
        )

    return Background(
        separatrices=tuple(filter(within, behind.separatrices)),
        arc_separatrices=tuple(filter(within, behind.arc_separatrices)),
        levels=tuple(filter(within, behind.levels)),
        points=tuple(
            point
            for point in behind.points
            for one in shown
            if one.piece.index == point.piece and one.low <= point.position <= one.high
        ),
    )


def _is_small(piece: Piece, path: Trajectory, behind: Background) -> bool:
    """Return whether a motion on one arc is too small to be read on the whole arc."""
    extent = float(np.ptp(path.branches[piece.index].position))
    if extent == 0.0:
        return False
    reached, separatrix = _reached(path, [piece.index]), _separatrix(behind, [piece.index])
    across = extent / (piece.angle_end - piece.angle_start)
    return across * min(1.0, reached / separatrix if separatrix else 1.0) < _SMALL


def _full_circle(close: Window, behind: Background) -> float:
    """Return how high the separatrix of the full circle of an arc makes the whole arc."""
    curves = [one.rate for one in behind.arc_separatrices if one.piece == close.piece.index]
    return _MARGIN * _highest(curves)


def _around(piece: Piece, path: Trajectory) -> Window:
    """Return the window on a piece around where the body went; all of it for a body at rest."""
    position = path.branches[piece.index].position
    room = _ROOM * float(np.ptp(position))
    low, high = float(np.min(position)) - room, float(np.max(position)) + room
    if room == 0.0:
        low, high = piece.angle_start, piece.angle_end
    top = _MARGIN * (_reached(path, [piece.index]) or 1.0)
    return Window(piece, max(low, piece.angle_start), min(high, piece.angle_end), top)


def _top(pieces: Sequence[Piece], path: Trajectory, behind: Background, lines: bool) -> float:
    """Return the greatest rate to show on the arcs, or the greatest speed on the lines."""
    members = [piece.index for piece in pieces if piece.is_line == lines]
    reached = _reached(path, members)
    separatrix = _separatrix(behind, members)
    return _MARGIN * (max(reached, min(separatrix, _FAR * reached)) or separatrix or 1.0)


def _reached(path: Trajectory, members: Sequence[int]) -> float:
    """Return the greatest rate of the body on some pieces."""
    there = np.isin(path.jumps.piece, members)
    jumps = [path.jumps.before[there], path.jumps.after[there & path.jumps.made]]
    return _highest([*(path.branches[n].rate for n in members), *jumps])


def _separatrix(behind: Background, members: Sequence[int]) -> float:
    """Return the greatest rate of the trace's separatrices on some pieces."""
    return _highest([curve.rate for curve in behind.separatrices if curve.piece in members])


def _highest(rates: Sequence[Array]) -> float:
    return max((float(np.max(np.abs(rate))) for rate in rates if rate.size), default=0.0)


def phase_portrait(run: Recorded, ball: int, width: str = "single", focus: str = "auto") -> Figure:
    """Return the phase portrait of a body (from 1) of a run, a panel for each piece of the trace.

    Rate against angle, φ̇ (φ) in valleys and ψ̇ (ψ) on humps, speed against arc length on lines,
    with one vertical axis for all arcs. Behind the branches run through: separatrices, level curves
    of energy, centres and saddles. `width` is `single` (85 mm) or `double` (170 mm); `focus` is
    `trace` (all of it), `run` (only where the body went), or `auto`: the trace, but a motion that
    would be too small on it is shown close and once more on the whole piece.
    Raises ValueError for another width or focus and IndexError for a body that is not there.
    """
    if not 1 <= ball <= len(run.system.bodies):
        raise IndexError(f"no body {ball}: the run has {len(run.system.bodies)}")
    path = trajectory(run, ball)
    behind = _behind(run, ball, path)
    shown = windows(run.system.trace.pieces, path, behind, focus)
    with style.journal():
        rows = legend_rows(path, seen(behind, shown), width)
        figure, panels = lay_out(shown, width, legend=LINE * (len(rows) - 1))
        draw_motion(panels, path, behind)
        label(panels, ball)
        draw_legend(figure, rows, None if few(path) else last_time(path))
    return figure


def legend_rows(
    path: Trajectory, behind: Background, width: str, others: Sequence[Entry] = ()
) -> list[list[Entry]]:
    """Return the rows of the legend of a portrait; the first has room for the bar of time."""
    entries = legend_of(path, behind, few(path), others)
    return rows_of(
        entries, WIDTHS.get(width, 0.0) - RIGHT, 0.0 if few(path) else bar_width(last_time(path))
    )


def few(path: Trajectory) -> bool:
    """Return whether there are so few impacts that they are numbered and marked one by one."""
    return len(path.jumps.number) <= MOST_NUMBERS


def _behind(run: Recorded, ball: int, path: Trajectory) -> Background:
    """Return the background: level curves, separatrices and singular points."""
    landscape = Landscape.of(run.system, ball)
    highest = max(
        float(np.max(landscape.energy(piece, branches.position[:, 0], branches.rate[:, 0])))
        for piece, branches in zip(run.system.trace.pieces, path.branches, strict=True)
        if len(branches.time)
    )
    return background(landscape, highest)


def draw_motion(panels: Sequence[Panel], path: Trajectory, behind: Background) -> None:
    """Draw what a body ran through on the panels of a portrait, over what stands behind it."""
    marked = few(path)
    until = None if marked else last_time(path)
    start_piece, position, rate = path.start
    for one in panels:
        layers.draw_background(one, behind)
        layers.draw_branches(one, path, until)
        close = not one.window.overview
        if not (marked and close):
            layers.draw_jumps(one, path.jumps, marked=False)
        if close:
            layers.draw_jumps(one, path.first, marked=True)
        start = np.empty((0, 2))
        if one.piece.index == start_piece:
            layers.draw_start(one, position, rate)
            start = one.millimetres(np.array([position]), np.array([rate]))
        if one.window.overview:
            layers.draw_window(one, panels[0].window)
        else:
            layers.draw_numbers(one, path.branches[one.piece.index], path.first, start)


_HIGH = {"single": 44.0, "double": 50.0}
"""Height of the panel along the trace (mm)."""
_LINE = 3.1
"""Height of a line of words (mm)."""
_CHARACTER = 1.03
"""Mean width of a character of the words (mm)."""
_MOST_LINES = 6


def structure(portrait: Portrait, width: str = "single", bodies: str = "") -> Figure:
    """Return the phase portrait of a body on the whole trace, in both coordinates.

    Above, branch by branch as in the papers: φ̇ against φ, ψ̇ against ψ, speed against arc length on
    lines. Below, speed against arc length along the trace, over it the values E/(m g) of centres
    and saddles. `bodies` stands as index of the symbols. Raises ValueError for an unknown width.
    """
    behind = background(portrait.landscape, highest_energy(portrait))
    words = _words(portrait, WIDTHS.get(width, 0.0) - LEFT - RIGHT)
    below = _HIGH.get(width, 0.0) + BOTTOM + _LINE * len(words) + 1.0
    with style.journal():
        figure, panels = lay_out(_windows(portrait, behind), width, below)
        for one in panels:
            layers.draw_background(one, behind)
            _draw_eights(one, portrait)
        label(panels, bodies)
        _draw_below(figure, portrait, width, words)
        _draw_legend(figure, behind, portrait)
    return figure


def _windows(portrait: Portrait, behind: Background) -> list[Window]:
    tops = {}
    for lines in (False, True):
        curves = (*behind.levels, *behind.separatrices)
        rates = [
            float(np.max(curve.rate))
            for curve in curves
            if portrait.landscape.trace.pieces[curve.piece].is_line == lines
        ]
        tops[lines] = _MARGIN * max(rates, default=1.0) or 1.0
    return [
        Window(piece, piece.angle_start, piece.angle_end, tops[piece.is_line])
        for piece in portrait.landscape.trace.pieces
    ]


def _draw_eights(one: Panel, portrait: Portrait) -> None:
    """Draw over the separatrices those parts that belong to a figure eight."""
    lines = []
    for trigger in portrait.triggers:
        if trigger.orbit != FIGURE_EIGHT:
            continue
        assert trigger.turning_left is not None
        assert trigger.turning_right is not None
        for curve in level_curves(portrait.landscape, one.piece, trigger.saddle.energy):
            middle = one.piece.arc_length(0.5 * float(curve.position[0] + curve.position[-1]))
            if trigger.turning_left <= middle <= trigger.turning_right:
                lines += [line + np.array([one.shift, 0.0]) for line in both_halves(curve)]
    one.axes.add_collection(LineCollection(lines, zorder=1.25, **EIGHT), autolim=False)


def _draw_below(figure: Figure, portrait: Portrait, width: str, words: Sequence[str]) -> None:
    """Draw the panel along the trace, under its words."""
    axes, size = _panel_below(figure, width)
    wide, high = figure.get_size_inches() / MM
    curves = curves_of(portrait)
    draw_along(axes, portrait, curves, size)
    name_points(axes, portrait, curves, size)
    look: dict[str, Any] = {"fontsize": style.SMALL, "color": style.FRAME_GREY, "va": "baseline"}
    for number, line in enumerate(reversed(words)):
        height = BOTTOM + size[1] + 1.2 + number * _LINE
        figure.text(LEFT / wide, height / high, line, **look)


def _panel_below(figure: Figure, width: str) -> tuple[Axes, tuple[float, float]]:
    """Return a panel under those of the pieces, and its size (mm)."""
    wide, high = figure.get_size_inches() / MM
    size = WIDTHS[width] - LEFT - RIGHT, _HIGH[width]
    box = (LEFT / wide, BOTTOM / high, size[0] / wide, size[1] / high)
    return figure.add_axes(box), size


def _words(portrait: Portrait, width: float) -> list[str]:
    """Return what is said of the triggers, in lines of a width (mm)."""
    said = []
    for trigger in portrait.triggers:
        names = "–".join(portrait.name(p) for p in (trigger.left, trigger.saddle, trigger.right))
        said.append(f"{names}: trigger of coupled singular points, {_named(trigger.orbit)}")
        said.append(condition(portrait, trigger))
    said = said or ["no trigger of coupled singular points"]
    named = zip(portrait.names, portrait.points, strict=True)
    heights = ", ".join(f"{name} {portrait.height(point.energy):.4g} m" for name, point in named)
    meant = "height above the lowest place"
    if portrait.landscape.turning is not None:
        meant = "effective potential above its least value"
    values = [f"E/(m g), {meant}: {heights}"] if heights else []
    return [*_wrapped(said, width), *_wrapped(values, width)]


def _wrapped(said: Sequence[str], width: float) -> list[str]:
    """Return sentences in lines of a width (mm), not too many."""
    characters = max(20, int(width / _CHARACTER))
    lines = [line for one in said for line in textwrap.wrap(one, characters)]
    return lines if len(lines) <= _MOST_LINES else [*lines[: _MOST_LINES - 1], "…"]


def _named(orbit: str) -> str:
    return {FIGURE_EIGHT: "homoclinic figure eight"}.get(orbit, f"{orbit} separatrix")


def _draw_legend(figure: Figure, behind: Background, portrait: Portrait) -> None:
    entries: list[tuple[str, dict[str, Any]]] = []
    eights = [trigger for trigger in portrait.triggers if trigger.orbit == FIGURE_EIGHT]
    if eights:
        entries.append(("figure eight", EIGHT))
    if any(p.kind == SADDLE and all(p != one.saddle for one in eights) for p in behind.points):
        entries.append(("separatrix", layers.SEPARATRIX))
    elif behind.arc_separatrices:
        entries.append(("separatrix of the full circle", layers.ARC_SEPARATRIX))
    entries.append(("level", layers.LEVEL))
    entries += layers.point_entries(portrait.points)
    if any(point.extent for point in portrait.points):
        entries.append(("level line", REST))
    line_of_entries(figure, entries)


MOST = 6
"""Bodies that can be told apart."""


def comparison(members: Sequence[tuple[str, Portrait]], width: str = "single") -> Figure:
    """Return curves of equal height E/(m g) of several bodies, in both coordinates.

    For each body the separatrices, and a level curve below and one above them, in one line each.
    Bodies that differ by κ alone have the same curves with rates as 1/√κ. `members` are names and
    portraits on one trace. Raises ValueError for no member, for more than `MOST` and for an unknown
    width.
    """
    if not 1 <= len(members) <= MOST:
        raise ValueError(f"a comparison has 1 to {MOST} members, found {len(members)}")
    energies = [_energies(portrait, members[0][1]) for _, portrait in members]
    with style.journal():
        below = _HIGH.get(width, 0.0) + BOTTOM + 1.0
        figure, panels = lay_out(_common_windows(members, energies), width, below)
        for one in panels:
            for number, (_, portrait) in enumerate(members, 1):
                _draw(one, portrait, energies[number - 1], number)
        label(panels, "")
        _draw_along(figure, members, energies, width)
        entries = [
            (f"{name}, $\\kappa = {portrait.landscape.body.kappa:.4g}$", body_look(number))
            for number, (name, portrait) in enumerate(members, 1)
        ]
        line_of_entries(figure, entries)
    return figure


def _energies(portrait: Portrait, first: Portrait) -> list[float]:
    """Return the energies (J) of a body's curves: at the heights of the first body's, its own."""
    saddles = saddle_energies(portrait.points)
    tops = [first.height(energy) for energy in saddle_energies(first.points)]
    highest = first.height(highest_energy(first))
    heights = [0.5 * min(tops, default=highest), highest]
    weight = portrait.landscape.body.mass * portrait.landscape.gravity
    return [*saddles, *(weight * height for height in heights)]


def _common_windows(
    members: Sequence[tuple[str, Portrait]], energies: Sequence[Sequence[float]]
) -> list[Window]:
    tops = {False: 0.0, True: 0.0}
    pieces = members[0][1].landscape.trace.pieces
    for (_, portrait), own in zip(members, energies, strict=True):
        for piece in portrait.landscape.trace.pieces:
            for energy in own:
                for curve in level_curves(portrait.landscape, piece, energy):
                    highest = float(np.max(curve.rate))
                    tops[piece.is_line] = max(tops[piece.is_line], highest)
    return [
        Window(piece, piece.angle_start, piece.angle_end, _MARGIN * (tops[piece.is_line] or 1.0))
        for piece in pieces
    ]


def _draw(one: Panel, portrait: Portrait, energies: Sequence[float], number: int) -> None:
    piece = portrait.landscape.trace.pieces[one.piece.index]
    shift = np.array([one.shift, 0.0])
    lines = [
        line + shift
        for energy in energies
        for curve in level_curves(portrait.landscape, piece, energy)
        for line in both_halves(curve)
    ]
    _add(one.axes, lines, number)
    for point in portrait.points:
        if point.piece == piece.index and point.kind in layers.MARKER:
            marker = layers.MARKER[point.kind]
            one.axes.plot(point.position, 0.0, marker=marker, zorder=2.5, **layers.POINT)


def _add(axes: Any, lines: Sequence[Array], number: int) -> None:
    axes.add_collection(LineCollection(lines, zorder=2.0, **body_look(number)), autolim=False)


def _draw_along(
    figure: Figure,
    members: Sequence[tuple[str, Portrait]],
    energies: Sequence[Sequence[float]],
    width: str,
) -> None:
    """Draw speed against arc length under the panels of the arcs."""
    axes, size = _panel_below(figure, width)
    curves = [
        [curve for energy in own for curve in speed_curves(portrait.landscape, energy)]
        for (_, portrait), own in zip(members, energies, strict=True)
    ]
    trace = members[0][1].landscape.trace
    speeds = [float(np.max(curve.speed)) for own in curves for curve in own]
    top = _MARGIN * (max(speeds, default=0.0) or 1.0)
    axes.set_xlim(0.0, trace.length)
    axes.set_ylim(-top, top)
    for piece in trace.pieces[1:]:
        axes.axvline(piece.start_s, zorder=0.9, **JUNCTION)
    for number, own in enumerate(curves, 1):
        _add(axes, both_ways(own), number)
    for point in members[0][1].points:
        if point.kind in layers.MARKER:
            marker = layers.MARKER[point.kind]
            axes.plot(point.s, 0.0, marker=marker, zorder=2.5, **layers.POINT)
    number_plane(axes, size, *SPEED_AGAINST_PLACE)
