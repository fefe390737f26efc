"""Singular points of a body's phase portrait, where the trace is level under it (D); triggers.

A trigger couples singular points: a homoclinic figure eight goes through the saddle among them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from vibro_cli.analysis.landscape import Landscape, equilibria, half_turn, level_positions
from vibro_cli.analysis.levels import Reach, connected_reaches, left_s, right_s
from vibro_cli.mechanics.trace import HUMP, VALLEY, Piece
from vibro_cli.numerics.elementwise import EPSILON

_ROUNDING = 64.0 * EPSILON
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


FIGURE_EIGHT = "figure eight"
"""The separatrix closes on both sides: a homoclinic orbit like the number eight."""
HETEROCLINIC = "heteroclinic"
"""The separatrix runs to another saddle of the same energy."""
OPEN = "open"
"""The separatrix leaves the trace, or runs round a closed one."""

_OF_TRIGGERS = 4.0 * EPSILON
_EQUAL = 1e-12
"""Energies closer than this fraction of the saddle's count as equal."""


@dataclass(frozen=True)
class Trigger:
    """A saddle between two centres: a trigger of coupled singular points."""

    left: SingularPoint
    saddle: SingularPoint
    right: SingularPoint
    margin_left: float
    """Energy (J) of the greatest barrier left of the left centre, less that of the saddle.

    On three arcs m g ((R − r)(1 − cos θ_end) − (R + R₀)(1 − cos J)), J the slope at the junction.
    """
    margin_right: float
    """The same (J) at the right."""
    turning_left: float | None
    """Arc length s (m) where the separatrix turns at the left; None if it leaves the trace."""
    turning_right: float | None
    """Arc length s (m) where the separatrix turns at the right; None if it leaves the trace."""
    orbit: str
    """The separatrix: `figure eight`, `heteroclinic` or `open`."""


def triggers(landscape: Landscape) -> tuple[Trigger, ...]:
    """Return every saddle of the trace that has a centre as next singular point on either side.

    The energies are those of the singular points; whether the figure eight exists depends on the
    radius of the body and not on κ. On a closed trace the neighbours are found across the seam, and
    two different centres are needed.
    """
    points = singular_points(landscape)
    found = []
    for place, saddle in enumerate(points):
        left, right = _neighbours(landscape, points, place)
        if saddle.kind != SADDLE or left is None or right is None or left is right:
            continue
        if left.kind == CENTRE and right.kind == CENTRE:
            found.append(_trigger(landscape, points, left, saddle, right))
    return tuple(found)


def _neighbours(
    landscape: Landscape, points: tuple[SingularPoint, ...], place: int
) -> tuple[SingularPoint | None, SingularPoint | None]:
    if landscape.trace.closed:
        return points[place - 1], points[(place + 1) % len(points)]
    left = points[place - 1] if place > 0 else None
    right = points[place + 1] if place + 1 < len(points) else None
    return left, right


def _trigger(
    landscape: Landscape,
    points: tuple[SingularPoint, ...],
    left: SingularPoint,
    saddle: SingularPoint,
    right: SingularPoint,
) -> Trigger:
    margins = _margins(landscape, points, saddle)
    closes = [_is_barrier(landscape, saddle, margin) for margin in margins]
    turning_left, turning_right = (
        (saddle.s if place is None else place) if closed else None
        for place, closed in zip(_turnings(landscape, saddle), closes, strict=True)
    )
    orbit = FIGURE_EIGHT if all(closes) else OPEN
    if _meets_another_saddle(landscape, points, saddle, turning_left, turning_right):
        orbit = HETEROCLINIC
    return Trigger(left, saddle, right, *margins, turning_left, turning_right, orbit)


def _is_barrier(landscape: Landscape, saddle: SingularPoint, margin: float) -> bool:
    """Return whether a margin (J) turns the separatrix: one of rounding just does.

    The margin decides, and not where the separatrix turns: next to a bifurcation, where centres and
    saddle differ by less than rounding, that is lost while the barriers stand as high as before.
    """
    weight = landscape.body.mass * landscape.gravity
    tolerance = _OF_TRIGGERS * (abs(saddle.energy) + weight * landscape.trace.length)
    return margin >= -tolerance


def _meets_another_saddle(
    landscape: Landscape,
    points: tuple[SingularPoint, ...],
    saddle: SingularPoint,
    turning_left: float | None,
    turning_right: float | None,
) -> bool:
    low = -math.inf if turning_left is None or landscape.trace.closed else turning_left
    high = math.inf if turning_right is None or landscape.trace.closed else turning_right
    return any(
        point.kind != CENTRE
        and point is not saddle
        and abs(point.energy - saddle.energy) <= _EQUAL * saddle.energy
        and low <= point.s <= high
        for point in points
    )


def _margins(
    landscape: Landscape, points: tuple[SingularPoint, ...], saddle: SingularPoint
) -> tuple[float, float]:
    """Return the greatest barrier on each side, less the saddle's energy (J)."""
    others = [point for point in points if point.kind != CENTRE and point is not saddle]
    if landscape.trace.closed:
        barrier = max(point.energy for point in others) - saddle.energy
        return barrier, barrier
    first, last = landscape.trace.pieces[0], landscape.trace.pieces[-1]
    end_left = float(landscape.potential(first, first.angle_start))
    end_right = float(landscape.potential(last, last.angle_end))
    lefts = [point.energy for point in others if point.s < saddle.s]
    rights = [point.energy for point in others if point.s > saddle.s]
    return max([end_left, *lefts]) - saddle.energy, max([end_right, *rights]) - saddle.energy


def _turnings(landscape: Landscape, saddle: SingularPoint) -> tuple[float | None, float | None]:
    """Return where the separatrix through a saddle turns (s, m), going left and going right.

    None where it is not found to turn.
    """
    runs = connected_reaches(landscape, saddle.energy)
    if not runs:
        return saddle.s, saddle.s  # all below it is lost in rounding
    # The run through the saddle; where rounding leaves the saddle itself out, the one beside it.
    run = min(
        runs, key=lambda run: max(left_s(run[0]) - saddle.s, saddle.s - right_s(run[-1]), 0.0)
    )
    leftmost, rightmost = run[0], run[-1]
    if not landscape.trace.closed:
        left, right = _turning(leftmost, rightmost)
        return (
            None if left is None else min(left, saddle.s),
            None if right is None else max(right, saddle.s),
        )
    length = landscape.trace.length
    if left_s(leftmost) <= 0.0 and right_s(rightmost) >= length:
        return None, None  # the level runs all the way round
    if left_s(leftmost) <= 0.0:
        leftmost = runs[-1][0]
    elif right_s(rightmost) >= length:
        rightmost = runs[0][-1]
    return _turning(leftmost, rightmost)


def _turning(leftmost: Reach, rightmost: Reach) -> tuple[float | None, float | None]:
    return (
        left_s(leftmost) if leftmost.turns_low else None,
        right_s(rightmost) if rightmost.turns_high else None,
    )
