"""Initial states: positions on the trace, speeds of the centres, bodies that start in contact.

Numbers may be arrays (see ``numerics.elementwise``), with two exceptions: `beside` takes numbers
only, and `reaches_over` evaluates a bound for arrays.
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
"""Bodies start in contact if |gap| ≤ 16 eps times the size of their positions."""


def snap_to_piece(piece: Piece, position: float) -> float:
    """Return a position on its piece, or nan if it lies beyond one of the ends.

    `position` is φ or ψ (rad), on a line a distance (m). A position beyond an end by no more than
    rounding (8 eps of the piece) is moved to the end.
    """
    low, high = piece.angle_start, piece.angle_end
    hair = 8.0 * EPSILON * elementwise.greatest(abs(low), abs(high))
    drawn = elementwise.least(elementwise.greatest(position, low), high)
    beyond = elementwise.outside(position, low - hair, high + hair)
    return elementwise.choose(beyond, math.nan, drawn)  # type: ignore[no-any-return]


def speed_of_rate(piece: Piece, body: Body, rate: float) -> float:
    """Return the speed of the centre v = ρ φ̇ (m/s) for a rate of the angle (rad/s) on an arc.

    Raises ValueError on a line, which has no angle.
    """
    if piece.is_line:
        raise ValueError("a body on a line has no angle and no rate")
    return rate * piece.path_radius(body.radius)


def speed_of_omega(body: Body, omega: float) -> float:
    """Return the speed of the centre v = r ω_P (m/s) for an angular velocity (rad/s).

    Raises ValueError for a body of radius 0, which does not roll.
    """
    if elementwise.occurs(body.radius == 0.0):
        raise ValueError("a body of radius 0 does not roll")
    return omega * body.radius


def enter_piece(trace: Trace, state: InitialState) -> InitialState:
    """Return the state of a body at a junction on the piece that it moves into.

    The speed of the centre is continuous at a junction. A state at rest, inside a piece or at an
    end of an open trace is returned unchanged.
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
    """Return whether the right body is not to the right of the left one."""
    if left.piece != right.piece:
        return left.piece > right.piece
    return left.position >= right.position


def gap(
    trace: Trace, body_a: Body, state_a: InitialState, body_b: Body, state_b: InitialState
) -> tuple[float, float]:
    """Return the gap of two bodies |C_b − C_a| − r_a − r_b (m) and its rounding error (m).

    On one piece it is computed from the distance along the piece, without cancellation:
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
    """Return piece and position of body b where it touches body a on the right, or None.

    This is the first place to the right of body a where the centres are r_a + r_b apart: further by
    `contact_angle` on the same piece, else the first root on the following pieces. None if there is
    no such place before the end of an open trace (or one turn of a closed trace).
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
    """Return the first position on a piece where the path of a centre leaves a circle, or None.

    The circle has radius `contact` and centre `centre`. If the path starts outside it, the start is
    returned.
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
    """Return approximately where the path of a centre first leaves a circle, or None.

    Needed on arcs only, where the path may come back to the circle.
    """
    if piece.is_line:
        return None
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
    """Return the position on an end piece at which a body touches the wall, or nan.

    `radius` of the body in m. The wall is the plane through the end of the trace and normal to it.
    The centre is at distance r from it: r along a line, ρ sin Δφ = r on an arc. nan if there is no
    such position on the piece.
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
    """Return whether a body on an end piece starts beyond the position `touch` at its wall."""
    beyond = position - touch if right else touch - position
    size = piece.angle_end if piece.is_line else elementwise.greatest(1.0, abs(touch))
    return beyond > 1e-15 * size


def reaches_over(trace: Trace, bodies: Sequence[Body], right: bool) -> Any:
    """Return the first body that can reach a wall over the bodies between, or 0 if there is none.

    `bodies` are all bodies from left to right; the result is counted from 0 at the wall. The body
    at the wall touches it, and each other body touches the one before it, so that it is as near to
    the wall as it can come. If its distance from the wall's plane is then at most its radius, it
    reaches the wall. The result is also 0 if the trace has no room for the row.

    For numbers these positions are searched for. Arrays are tested with a bound: true where some
    body may reach the wall, provided that only neighbours touch.
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
    """Return whether a body may reach a wall over another one of radius `between`.

    Radii in m. It may if it is the larger one and either both fit at the wall, on the trace,
    without a certain overlap, or the piece has no position where it touches the wall.
    """
    over = _height_at_wall(piece, radius) - _height_at_wall(piece, between)
    apart, reach = (radius - between) * (radius - between) + over * over, radius + between
    no_place = elementwise.is_nan(wall_position(piece, radius, False))
    return (radius > between) & (no_place | (apart >= reach * reach))


def _height_at_wall(piece: Piece, radius: float) -> float:
    """Return the distance (m) from the end tangent to the centre of a body at the wall."""
    if piece.is_line:
        return radius
    rho = piece.path_radius(radius)
    along = elementwise.square_root(elementwise.greatest((rho - radius) * (rho + radius), 0.0))
    return piece.sign * (piece.radius - along)
