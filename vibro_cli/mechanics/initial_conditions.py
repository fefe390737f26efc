"""Initial states: positions on the trace, speeds of the centres, bodies that start in contact.

Numbers may be arrays (see ``numerics.elementwise``), but not where the place beside another body is
searched for: `beside` takes numbers only, and `reaches_over` has a bound for arrays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.mechanics.reachability import contact_angle
from vibro_cli.mechanics.system import Body, InitialState
from vibro_cli.mechanics.trace import Piece, Trace
from vibro_cli.numerics import elementwise

GAP_ROUNDING = 16.0
"""At the start |gap| ≤ 16 eps of the positions is contact."""


def snap_to_piece(piece: Piece, position: float) -> float:
    """Return a position drawn onto its piece, nan when it lies beyond one of its ends.

    `position` as φ or ψ (rad), on a line as a distance (m). A hair beyond an end (8 eps of the
    piece) is rounding and means the end.
    """
    low, high = piece.angle_start, piece.angle_end
    hair = 8.0 * EPSILON * elementwise.greatest(abs(low), abs(high))
    drawn = elementwise.least(elementwise.greatest(position, low), high)
    beyond = elementwise.outside(position, low - hair, high + hair)
    return elementwise.choose(beyond, math.nan, drawn)  # type: ignore[no-any-return]


def speed_of_rate(piece: Piece, body: Body, rate: float) -> float:
    """Return the speed of the centre v = ρ φ̇ (m/s) of a rate of the angle (rad/s) on an arc.

    Raises ValueError on a line, which has no angle.
    """
    if piece.is_line:
        raise ValueError("a body on a line has no angle and no rate")
    return rate * piece.path_radius(body.radius)


def speed_of_omega(body: Body, omega: float) -> float:
    """Return the speed of the centre v = r ω_P (m/s) of a rate of rolling (rad/s).

    Raises ValueError for a body of radius 0, which does not roll.
    """
    if elementwise.occurs(body.radius == 0.0):
        raise ValueError("a body of radius 0 does not roll")
    return omega * body.radius


def enter_piece(trace: Trace, state: InitialState) -> InitialState:
    """Return the state of a body on a junction on the piece it moves into; at rest it stays.

    The speed of the centre is continuous at a junction. Past an end of an open trace there is no
    piece to move into: the state is returned as it is.
    """
    piece = trace.pieces[state.piece]
    count = len(trace.pieces)
    if state.position == piece.angle_end and state.speed > 0.0:
        step, last = 1, count - 1
    elif state.position == piece.angle_start and state.speed < 0.0:
        step, last = -1, 0
    else:
        return state
    if state.piece == last and not trace.closed:
        return state
    entered = trace.pieces[(state.piece + step) % count]
    position = entered.angle_start if step > 0 else entered.angle_end
    return InitialState(entered.index, position, state.speed)


def out_of_order(left: InitialState, right: InitialState) -> Any:
    """Tell whether of two bodies the right one does not stand to the right of the left one."""
    if left.piece != right.piece:
        return left.piece > right.piece
    return left.position >= right.position


def gap(
    trace: Trace, body_a: Body, state_a: InitialState, body_b: Body, state_b: InitialState
) -> tuple[float, float]:
    """Return the gap of two bodies |C_b − C_a| − r_a − r_b (m) and its rounding at this place (m).

    On one piece from the distance along it, without cancellation:
    |C_b − C_a|² − (r_a + r_b)² = 4 ρ_a ρ_b sin²(Δφ/2) − 4 r_a r_b, on a line Δ² − 4 r_a r_b.
    """
    piece_a, piece_b = trace.pieces[state_a.piece], trace.pieces[state_b.piece]
    centre_a = piece_a.body_centre(state_a.position, body_a.radius)
    centre_b = piece_b.body_centre(state_b.position, body_b.radius)
    contact = body_a.radius + body_b.radius
    scale = elementwise.greatest_of([*map(abs, (*centre_a, *centre_b)), contact])
    if piece_a is not piece_b:
        x, y = centre_b[0] - centre_a[0], centre_b[1] - centre_a[1]
        return elementwise.square_root(x * x + y * y) - contact, GAP_ROUNDING * EPSILON * scale
    along = state_b.position - state_a.position
    farthest = elementwise.greatest(abs(state_a.position), abs(state_b.position))
    product = 4.0 * body_a.radius * body_b.radius
    if piece_a.is_line:
        square = along * along
    else:
        rho_a, rho_b = piece_a.path_radius(body_a.radius), piece_a.path_radius(body_b.radius)
        half_sine = elementwise.sine(0.5 * along)
        square = 4.0 * rho_a * rho_b * (half_sine * half_sine)
        farthest = farthest * elementwise.greatest(rho_a, rho_b)
    unequal = body_a.radius - body_b.radius
    distance = elementwise.square_root(unequal * unequal + square)
    rounding = GAP_ROUNDING * EPSILON * elementwise.greatest(scale, farthest)
    return (square - product) / (distance + contact), rounding


def beside(
    trace: Trace, body_a: Body, state_a: InitialState, body_b: Body
) -> tuple[int, float] | None:
    """Return piece and position of a body that touches another one on its right side, or None.

    The first place to the right of body a where the distance of the centres is r_a + r_b: on its
    own piece `contact_angle` further on, else the first root of the distance on the pieces that
    follow. None when an open trace ends before it (or a closed one comes round).
    """
    own = trace.pieces[state_a.piece]
    place = state_a.position + contact_angle(own, body_a.radius, body_b.radius)
    if place <= own.angle_end:
        return own.index, place
    following = trace.pieces[own.index + 1 :]
    if trace.closed:
        following += trace.pieces[: own.index]
    centre = own.body_centre(state_a.position, body_a.radius)
    for piece in following:
        root = _first_contact(piece, centre, body_a.radius + body_b.radius, body_b.radius)
        if root is not None:
            return piece.index, root
    return None


def _first_contact(
    piece: Piece, centre: tuple[float, float], contact: float, radius: float
) -> float | None:
    """Return the first position on a piece whose centre path leaves a circle, or None.

    The circle of radius `contact` is around `centre`, and the path begins inside it.
    """

    def outside(position: float) -> float:
        x, y = piece.body_centre(position, radius)
        return math.hypot(x - centre[0], y - centre[1]) - contact

    if not piece.path_radius(radius) > 0.0:
        return None  # the body does not fit this valley
    low, high = piece.angle_start, piece.angle_end
    if outside(low) >= 0.0:
        return low
    guess = _circle_meets_path(piece, centre, contact, radius)
    if guess is not None:
        width = 1e-9 * max(1.0, abs(guess))
        if low < guess - width < high and outside(guess - width) < 0.0:
            low = guess - width
        if low < guess + width < high and outside(guess + width) >= 0.0:
            high = guess + width
    if outside(high) < 0.0:
        return None
    while low < (middle := 0.5 * (low + high)) < high:
        if outside(middle) < 0.0:
            low = middle
        else:
            high = middle
    return low if -outside(low) < outside(high) else high


def _circle_meets_path(
    piece: Piece, centre: tuple[float, float], contact: float, radius: float
) -> float | None:
    """Return about where the path of a centre first leaves a circle to the right, or None."""
    if piece.is_line:
        x, y = piece.body_centre(0.0, radius)
        cosine, sine = math.cos(piece.start_slope), math.sin(piece.start_slope)
        along = (centre[0] - x) * cosine + (centre[1] - y) * sine
        across = (centre[1] - y) * cosine - (centre[0] - x) * sine
        if abs(across) > contact:
            return None
        root = along + math.sqrt(contact**2 - across**2)
    else:
        x, y = centre[0] - piece.centre[0], centre[1] - piece.centre[1]
        rho, far = piece.path_radius(radius), math.hypot(x, y)
        cosine = (far**2 + rho**2 - contact**2) / (2.0 * far * rho) if far > 0.0 else math.inf
        if abs(cosine) > 1.0:
            return None
        exit_angle = math.atan2(x, -piece.sign * y) + math.acos(cosine)
        turns = math.ceil((piece.angle_start - exit_angle) / math.tau - 1e-9)
        root = exit_angle + math.tau * turns
    return root if root <= piece.angle_end + 1e-9 else None


def wall_position(piece: Piece, radius: float, right: bool) -> float:
    """Return where on an end piece a body touches the wall across the trace's end.

    `radius` of the body in m. The centre is then at distance r from the plane through the end,
    square to the trace: r along a line, ρ sin Δφ = r on an arc. nan when there is no such place
    on the piece.
    """
    if piece.is_line:
        offset = radius
    else:
        rho = piece.path_radius(radius)
        if not elementwise.occurs(radius < rho):
            return math.nan
        offset = elementwise.choose(radius < rho, elementwise.arcsine(radius / rho), math.inf)
    place = piece.angle_end - offset if right else piece.angle_start + offset
    on_piece = offset <= piece.angle_end - piece.angle_start
    return elementwise.choose(on_piece, place, math.nan)  # type: ignore[no-any-return]


def reaches_into_wall(piece: Piece, position: float, touch: float, right: bool) -> Any:
    """Tell whether a body on an end piece starts beyond where it touches its wall."""
    beyond = position - touch if right else touch - position
    size = piece.angle_end if piece.is_line else elementwise.greatest(1.0, abs(touch))
    return beyond > 1e-15 * size


def reaches_over(trace: Trace, bodies: Sequence[Body], right: bool) -> Any:
    """Return which body is the first to reach a wall over those between it and the wall, or 0.

    All `bodies` from left to right; counted from the one at the wall, which is 0. That one stands
    at the wall, every other one touches the one before it: as near to the wall as it comes. Then it
    has to be farther from the wall's plane than its radius. 0 too where the trace has no room for
    the row.

    These places are searched for. Arrays have a bound instead: true where a body may do so, given
    that only neighbours touch.
    """
    row = bodies[::-1] if right else bodies
    if not all(map(elementwise.is_number, (*trace.pieces[-1].end, *(b.radius for b in row)))):
        end = trace.pieces[-1 if right else 0]
        return sum(_may_reach_over(end, body.radius, row[0].radius) for body in row[1:]) > 0
    trace = trace.mirrored() if right else trace
    first = trace.pieces[0]
    at_wall = wall_position(first, row[0].radius, False)
    if math.isnan(at_wall):
        return 0
    along = math.cos(first.start_slope), math.sin(first.start_slope)
    state = InitialState(0, at_wall, 0.0)
    for number, (body, inner) in enumerate(pairwise(row), 1):
        place = beside(trace, body, state, inner)
        if place is None:
            return 0
        state = InitialState(*place, 0.0)
        centre = trace.pieces[state.piece].body_centre(state.position, inner.radius)
        way = zip(centre, first.start, along, strict=True)
        if sum((here - end) * share for here, end, share in way) <= inner.radius:
            return number
    return 0


def _may_reach_over(piece: Piece, radius: float, between: float) -> Any:
    """Tell whether a body may reach a wall with another one between it and the wall.

    Radii in m. It is the larger one, and both at the wall, in the corner with the trace, do not
    surely overlap; or the piece has no place at the wall for it.
    """
    over = _height_at_wall(piece, radius) - _height_at_wall(piece, between)
    apart, reach = (radius - between) * (radius - between) + over * over, radius + between
    no_place = elementwise.is_nan(wall_position(piece, radius, False))
    return (radius > between) & (no_place | (apart >= reach * reach))


def _height_at_wall(piece: Piece, radius: float) -> float:
    """How far (m) from the trace's tangent at its end the centre of a body at the wall is."""
    if piece.is_line:
        return radius
    rho = piece.path_radius(radius)
    along = elementwise.square_root(elementwise.greatest((rho - radius) * (rho + radius), 0.0))
    return piece.sign * (piece.radius - along)
