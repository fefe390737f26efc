"""Phase portrait of a run: rate against angle, branch by branch (A fig. 2, B fig. 8, D fig. 1)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from vibro_cli.analysis.landscape import Landscape
from vibro_cli.figures import style
from vibro_cli.figures.legend import LINE, Entry, bar_width, draw_legend, rows_of
from vibro_cli.figures.portraits import layers
from vibro_cli.figures.portraits.background import Background, background
from vibro_cli.figures.portraits.entries import last_time, legend_of
from vibro_cli.figures.portraits.panels import RIGHT, Panel, label, lay_out
from vibro_cli.figures.portraits.trajectory import MOST_NUMBERS, Trajectory, trajectory
from vibro_cli.figures.portraits.view_limits import seen, windows
from vibro_cli.figures.source import Recorded
from vibro_cli.figures.style import WIDTHS


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
