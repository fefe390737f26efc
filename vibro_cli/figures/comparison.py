"""Portraits of several bodies on one trace, one over the other: particle, disk and ball (D)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from vibro_cli.analysis.levels import level_curves, speed_curves
from vibro_cli.analysis.portrait_type import Portrait
from vibro_cli.analysis.singular import CENTRE, SADDLE
from vibro_cli.figures import strokes, style
from vibro_cli.figures.along import JUNCTION, highest_energy
from vibro_cli.figures.background import both_halves, saddle_energies
from vibro_cli.figures.chart import body_look
from vibro_cli.figures.frame import label
from vibro_cli.figures.legend import line_of_entries
from vibro_cli.figures.panels import BOTTOM, LEFT, RIGHT, Panel, Window, lay_out
from vibro_cli.figures.source import Array
from vibro_cli.figures.style import MM, WIDTHS
from vibro_cli.figures.ticks import number_ticks, vertical_ticks, with_power

MOST = 6
"""Bodies that can be told apart."""
_MARGIN = 1.08
_HIGH = {"single": 44.0, "double": 50.0}
"""Height of the panel along the trace (mm)."""


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
        figure, panels = lay_out(_windows(members, energies), width, below)
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


def _windows(
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
        if point.piece == piece.index and point.kind in strokes.MARKER:
            marker = strokes.MARKER[point.kind]
            one.axes.plot(point.position, 0.0, marker=marker, zorder=2.5, **strokes.POINT)


def _add(axes: Any, lines: Sequence[Array], number: int) -> None:
    axes.add_collection(LineCollection(lines, zorder=2.0, **body_look(number)), autolim=False)


def _draw_along(
    figure: Figure,
    members: Sequence[tuple[str, Portrait]],
    energies: Sequence[Sequence[float]],
    width: str,
) -> None:
    """Draw speed against arc length under the panels of the arcs."""
    wide, high = figure.get_size_inches() / MM
    size = (WIDTHS[width] - LEFT - RIGHT, _HIGH[width])
    axes = figure.add_axes((LEFT / wide, BOTTOM / high, size[0] / wide, size[1] / high))
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
        both = [np.column_stack([one.s, sign * one.speed]) for one in own for sign in (1, -1)]
        _add(axes, both, number)
    for point in members[0][1].points:
        if point.kind in (CENTRE, SADDLE):
            marker = strokes.MARKER[point.kind]
            axes.plot(point.s, 0.0, marker=marker, zorder=2.5, **strokes.POINT)
    across, along = number_ticks(0.0, trace.length, size[0]), vertical_ticks(-top, top, size[1])
    axes.set_xticks(across.places, across.labels)
    axes.set_yticks(along.places, along.labels)
    axes.set_xlabel(f"$s$ [{with_power('m', across)}]")
    axes.set_ylabel(f"$v$ [{with_power('m/s', along)}]", labelpad=1.0)
