"""Singular points of a body's phase portrait: where the trace is level under it (D)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vibro_cli.analysis.landscape import Landscape, equilibria, half_turn, level_positions
from vibro_cli.mechanics.trace import HUMP, VALLEY, Piece

_ROUNDING = 64.0 * float(np.finfo(np.float64).eps)
CENTRE = "centre"
SADDLE = "saddle"
DEGENERATE = "degenerate"
"""A level line, or a level junction with a rise on one side and a fall on the other."""


@dataclass(frozen=True)
class SingularPoint:
    """A place where the body can stay at rest."""

    kind: str
    """`centre`, `saddle` or `degenerate`."""
    piece: int
    """Index of its piece, from 0; at a junction that of the left piece."""
    position: float
    """φ or ψ (rad); on a level line the distance of its left end, 0."""
    extent: float
    """Length of a level line (m), else 0."""
    s: float
    """Arc length of the contact point from the left end of the trace (m)."""
    slope: float
    """Slope angle of the trace there (rad), a multiple of π."""
    energy: float
    """Energy of the body at rest there (J), from its lowest place on the trace."""


def singular_points(landscape: Landscape) -> tuple[SingularPoint, ...]:
    """Return the singular points of a body from left to right along the trace.

    Bottoms of valleys and undersides of humps are centres; crests and tops of loops (φ = ±π) are
    saddles; a level line is degenerate as a whole. A level junction, or a level end of the trace,
    is what its sides make it. On a closed trace the seam belongs to the left end. On a trace that
    turns they are where gravity and turning balance, centres where the potential is least.
    """
    if landscape.turning is not None:
        return _of_turning(landscape)
    found: list[SingularPoint] = []
    pieces = landscape.trace.pieces
    for piece in pieces:
        left = _piece_before(landscape, piece)
        found += _at_left_end(landscape, left, piece)
        found += _within(landscape, piece)
    if not landscape.trace.closed:
        found += _at_right_end(landscape, pieces[-1])
    return tuple(found)


def _of_turning(landscape: Landscape) -> tuple[SingularPoint, ...]:
    """Singular points within the pieces of a trace that turns."""
    found = []
    for piece in landscape.trace.pieces:
        for place in equilibria(landscape, piece):
            kind = SADDLE  # on a line turning drives a body away from where it balances
            if not piece.is_line:
                offset = 0.0 if piece.sign > 0.0 else math.pi
                stiff = landscape.pull(piece).stiffness(place + offset)
                kind = SADDLE if stiff > 0.0 else CENTRE if stiff < 0.0 else DEGENERATE
            found.append(_point(landscape, kind, piece, place))
    return tuple(found)


def _piece_before(landscape: Landscape, piece: Piece) -> Piece | None:
    if piece.index == 0 and not landscape.trace.closed:
        return None
    return landscape.trace.pieces[piece.index - 1]


def _within(landscape: Landscape, piece: Piece) -> list[SingularPoint]:
    if piece.is_line:
        if half_turn(piece.start_slope) is None:
            return []
        return [_point(landscape, DEGENERATE, piece, 0.0, piece.length)]
    return [
        _point(landscape, _KIND[_trend(piece, angle)], piece, angle)
        for angle in level_positions(piece)
    ]


def _at_left_end(landscape: Landscape, left: Piece | None, piece: Piece) -> list[SingularPoint]:
    if half_turn(piece.start_slope) is None:
        return []
    sides = [_trend(piece, piece.angle_start)]
    if left is not None:
        sides.append(_trend(left, left.angle_end))
    if 0 in sides:
        return []  # part of the level line beside it
    kind = _KIND[sides[0]] if sides[0] == sides[-1] else DEGENERATE
    if left is None or piece.index == 0:
        return [_point(landscape, kind, piece, piece.angle_start)]
    return [_point(landscape, kind, left, left.angle_end)]


def _at_right_end(landscape: Landscape, piece: Piece) -> list[SingularPoint]:
    trend = _trend(piece, piece.angle_end)
    if half_turn(piece.end_slope) is None or trend == 0:
        return []
    return [_point(landscape, _KIND[trend], piece, piece.angle_end)]


_KIND = {1: CENTRE, -1: SADDLE}


def _trend(piece: Piece, position: float) -> int:
    """+1 if the piece rises away from a level place on it, −1 if it falls, 0 on a line."""
    turn = half_turn(piece.slope(position))
    upright = 1 if turn is not None and turn % 2 == 0 else -1
    return {VALLEY: upright, HUMP: -upright}.get(piece.shape, 0)


def _point(
    landscape: Landscape, kind: str, piece: Piece, position: float, extent: float = 0.0
) -> SingularPoint:
    height = landscape.height(piece, position)
    y = piece.body_center(position, landscape.body.radius)[1]
    if abs(height) <= _ROUNDING * (abs(y) + abs(y - height) + abs(landscape.lowest)):
        height = 0.0  # the lowest place, or one just as low
    return SingularPoint(
        kind=kind,
        piece=piece.index,
        position=position,
        extent=extent,
        s=piece.arc_length(position),
        slope=piece.slope(position),
        energy=landscape.body.mass * landscape.gravity * height,
    )
