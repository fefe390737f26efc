"""How much of the phase plane a portrait shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vibro_cli.analysis.levels import LevelCurve
from vibro_cli.figures.portraits.layers import Background
from vibro_cli.figures.portraits.panels import Window
from vibro_cli.figures.portraits.trajectory import Trajectory
from vibro_cli.figures.source import Array
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
