"""Phase portraits of the bodies of a run: rate against angle (A fig. 2, B fig. 8, D fig. 1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from vibro_cli.analysis.levels import Landscape, LevelCurve
from vibro_cli.analysis.singular import portrait_of
from vibro_cli.figures import style
from vibro_cli.figures.labels import Bar, Entry, draw_legend, rows_of
from vibro_cli.figures.portraits import layers
from vibro_cli.figures.portraits.layers import Background, background, coloured_until, legend_of
from vibro_cli.figures.portraits.panels import RIGHT, Panel, Window, label, lay_out, on_a_page
from vibro_cli.figures.portraits.trace_phase_plane import highest_energy, highest_place
from vibro_cli.figures.portraits.trajectory import Trajectory, trajectory
from vibro_cli.figures.source import Array, Recorded, flights_of
from vibro_cli.figures.style import width_of
from vibro_cli.mechanics.initial_conditions import wall_position
from vibro_cli.mechanics.trace import Piece

FAR = 3.0
"""Multiple of the greatest rate of a motion at which the frame cuts off separatrices."""
_SMALL = 0.13
"""Share of the arc's phase plane below which a motion is too small to be read on it."""
_MARGIN = 1.08
_NEAR = 1e-6
"""Distance from a wall's position, as a share of the piece, at which a flight begins there."""
_ROOM = 0.15
"""Room left and right of the motion, as a share of its extent."""


def windows(pieces: Sequence[Piece], path: Trajectory, behind: Background) -> tuple[Window, ...]:
    """Return the windows of a portrait, one for each of some pieces of the trace.

    A motion that would be small on its arc is shown close up, with the whole arc beside it.
    """
    tops = {lines: _top(pieces, path, behind, lines) for lines in (False, True)}
    whole = [
        Window(piece, piece.angle_start, piece.angle_end, tops[piece.is_line]) for piece in pieces
    ]
    visited = [one for one in whole if path.branches[one.piece.index].position.size]
    elsewhere = sum(branches.position.size > 0 for branches in path.branches) - len(visited)
    if len(visited) != 1 or elsewhere or not _is_small(visited[0].piece, path, behind):
        return tuple(whole)
    close = _around(visited[0].piece, path)
    circle = _highest(
        [one.rate for one in behind.arc_separatrices if one.piece == close.piece.index]
    )
    top = max(visited[0].top, _MARGIN * circle)
    return close, replace(visited[0], overview=True, top=top)


def seen(behind: Background, shown: Sequence[Window]) -> Background:
    """Return the part of a background that is visible in some windows."""

    def within(curve: LevelCurve) -> bool:
        return any(
            one.piece.index == curve.piece
            and np.any(
                (curve.position > one.low) & (curve.position < one.high) & (curve.rate < one.top)
            )
            for one in shown
        )

    points = tuple(
        point
        for point in behind.points
        for one in shown
        if one.piece.index == point.piece and one.low <= point.position <= one.high
    )
    walls = tuple(
        (piece, position)
        for piece, position in behind.walls
        for one in shown
        if one.piece.index == piece and one.low <= position <= one.high
    )
    curves = {name: tuple(filter(within, getattr(behind, name))) for name, *_ in layers.CURVES}
    return Background(points=points, walls=walls, **curves)


def walls_of(run: Recorded, ball: int) -> tuple[tuple[Piece, float], ...]:
    """Return pieces and positions at which a body (from 1) meets walls in a run."""
    flights, pieces = run.flights(), run.system.trace.pieces
    mine = flights_of(flights, ball)
    met = mine[flights["cause_start"][mine] == "wall"]
    starts = flights["angle_start"][met]
    found = []
    for piece, right in ((pieces[0], False), (pieces[-1], True)):
        place = wall_position(piece, run.system.bodies[ball - 1].radius, right)
        away = np.abs(starts[flights["arc"][met] == piece.index + 1] - place)
        if np.any(away < _NEAR * (piece.angle_end - piece.angle_start)):
            found.append((piece, place))
    return tuple(found)


def _is_small(piece: Piece, path: Trajectory, behind: Background) -> bool:
    """Return whether a motion on one arc is too small to be read on the whole arc."""
    extent = float(np.ptp(path.branches[piece.index].position))
    if extent == 0.0:
        return False
    reached, separatrix = greatest_rate(path, [piece.index]), _separatrix(behind, [piece.index])
    across = extent / (piece.angle_end - piece.angle_start)
    return across * min(1.0, reached / separatrix if separatrix else 1.0) < _SMALL


def _around(piece: Piece, path: Trajectory) -> Window:
    """Return the window around the motion on a piece."""
    position = path.branches[piece.index].position
    room = _ROOM * float(np.ptp(position))
    low, high = float(np.min(position)) - room, float(np.max(position)) + room
    top = _MARGIN * (greatest_rate(path, [piece.index]) or 1.0)
    return Window(piece, max(low, piece.angle_start), min(high, piece.angle_end), top)


def _top(pieces: Sequence[Piece], path: Trajectory, behind: Background, lines: bool) -> float:
    """Return the greatest rate to show on the arcs, or the greatest speed on the lines."""
    members = [piece.index for piece in pieces if piece.is_line == lines]
    reached = greatest_rate(path, members)
    separatrix = _separatrix(behind, members)
    levels = _highest([curve.rate for curve in behind.levels if curve.piece in members])
    return _MARGIN * framed_rate(reached, separatrix, levels)


def framed_rate(reached: float, separatrix: float, levels: float) -> float:
    """Return the greatest rate that a frame holds: of the motion and of any nearby separatrix.

    For a body at rest, it is that of the separatrices, else of the level curves.
    """
    return max(reached, min(separatrix, FAR * reached)) or separatrix or levels or 1.0


def greatest_rate(path: Trajectory, members: Sequence[int]) -> float:
    """Return the greatest rate of the body on some pieces."""
    there = np.isin(path.jumps.piece, members)
    jumps = [path.jumps.before[there], path.jumps.after[there & path.jumps.made]]
    return _highest([*(path.branches[n].rate for n in members), *jumps])


def stays_at_rest(path: Trajectory) -> bool:
    """Return whether the body never moves, so that its motion gives the axes no range."""
    return greatest_rate(path, range(len(path.branches))) == 0.0


def _separatrix(behind: Background, members: Sequence[int]) -> float:
    """Return the greatest rate of the trace's separatrices on some pieces."""
    return _highest([curve.rate for curve in behind.separatrices if curve.piece in members])


def _highest(rates: Sequence[Array]) -> float:
    return max((float(np.max(np.abs(rate))) for rate in rates if rate.size), default=0.0)


def phase_portrait(run: Recorded, ball: int, width: str = "single") -> Figure:
    """Draw the phase portrait of a body (from 1) of a run, with a panel for each piece.

    The panels show rate against angle, φ̇ (φ) in valleys and ψ̇ (ψ) on humps, and speed against arc
    length on lines; of very many pieces only those around the start. All arcs share one vertical
    axis. Separatrices, level curves of energy, centres and saddles are drawn behind the branches. A
    motion that would be too small is shown close up beside the whole piece. Raises IndexError for a
    body that does not exist.
    """
    path = trajectory(run, ball)
    pieces, others = on_a_page(run.system.trace.pieces, width, path.start[0])
    behind = _behind(run, ball, path, pieces)
    shown = windows(pieces, path, behind)
    others = [] if any(one.overview for one in shown) else others
    with style.journal():
        rows, bar = legend_rows(path, seen(behind, shown), width, others)
        sheet, panels = lay_out(shown, width, rows)
        draw_motion(panels, path, behind)
        label(panels, ball)
        draw_legend(sheet.figure, rows, bar)
    return sheet.figure


def legend_rows(
    path: Trajectory, behind: Background, width: str, others: Sequence[Entry] = ()
) -> tuple[list[list[Entry]], Bar | None]:
    """Return the rows of the legend of a portrait, and its colour bar of time or None."""
    until = coloured_until(path)
    bar = None if until is None else Bar.of_time(until)
    return rows_of(legend_of(path, behind, others), width_of(width) - RIGHT, bar), bar


def _behind(run: Recorded, ball: int, path: Trajectory, pieces: Sequence[Piece]) -> Background:
    """Return the background on some pieces: level curves, separatrices and singular points.

    For a body at rest, whose energy has no level curve, it is that of the portrait without a run.
    """
    landscape = Landscape.of(run.system, ball)
    walls = tuple((piece.index, position) for piece, position in walls_of(run, ball))
    if stays_at_rest(path):
        whole = portrait_of(landscape)
        found = background(landscape, pieces, highest_energy(whole), highest_place(whole))
        return replace(found, walls=walls)
    highest = max(
        float(np.max(landscape.energy(piece, branches.position[:, 0], branches.rate[:, 0])))
        for piece, branches in zip(run.system.trace.pieces, path.branches, strict=True)
        if len(branches.time)
    )
    return replace(background(landscape, pieces, highest), walls=walls)


def draw_motion(panels: Sequence[Panel], path: Trajectory, behind: Background) -> None:
    """Draw the background and the motion of a body on the panels of a portrait."""
    until = coloured_until(path)
    start_piece, position, rate = path.start
    for one in panels:
        layers.draw_background(one, behind)
        layers.draw_branches(one, path, until)
        close = not one.window.overview
        if until is not None or not close:
            layers.draw_jumps(one, path.jumps, marked=False)
        if close:
            layers.draw_jumps(one, path.first, marked=True)
        marks = [(point.position, 0.0) for point in behind.points if point.piece == one.piece.index]
        if one.piece.index == start_piece:
            layers.draw_start(one, position, rate)
            marks.append((position, rate))
        if one.window.overview:
            layers.draw_window(one, panels[0].window)
        else:
            branches = path.branches[one.piece.index]
            layers.draw_numbers(one, branches, path.first, np.reshape(marks, (-1, 2)))
