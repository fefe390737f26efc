"""Two neighbours: their gap, line of centres, and speeds and accelerations along it.

On one arc two bodies touch at a constant angle beta between their centres, seen from the centre of
the arc: ``sin(beta/2) = sqrt(r_a r_b/(rho_a rho_b))`` (A (6), B (48) without the loss of digits of
their arc cosine). On two pieces they touch where the distance of the centres is ``r_a + r_b``.

On one piece the constants of the contact are used instead of the centres: the results then depend
neither on where the trace lies nor on left and right. On two pieces the centres are used.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.flow.flow import POLYNOMIAL, tangential_acceleration
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.kernels.numerics.elliptic import angle_difference, twice_angle
from vibro_cli.kernels.world import (
    Flight,
    PairTrack,
    PieceData,
    States,
    TrackData,
    World,
    contact_of,
    flights_of,
    track_of,
    tracks_of,
)


@kernel
def half_gap_sine(
    contact: PairTrack,
    a_s: float,
    a_c: float,
    b_s: float,
    b_c: float,
    orientation: float,
) -> tuple[float, float]:
    """Return the sine and cosine of half the gap angle of two bodies on one arc.

    ``orientation`` is -1 when b is one lap ahead of a, so that the half-angle is larger by pi.
    """
    sine, cosine = angle_difference(b_s, b_c, a_s, a_c)
    return angle_difference(sine * orientation, cosine * orientation, contact.sine, contact.cosine)


@kernel
def centre_position(piece: PieceData, track: TrackData, s: float, c: float) -> tuple[float, float]:
    """Return the position of a body's centre (m)."""
    if piece.sign == 0.0:
        return track.line_x + piece.tangent_x * s, track.line_y + piece.tangent_y * s
    return (
        piece.x + piece.sign * track.path_radius * (2.0 * s * c),
        piece.y - track.path_radius * ((c - s) * (c + s)),
    )


@kernel
def centre_tangent(piece: PieceData, s: float, c: float) -> tuple[float, float]:
    """Return the unit tangent of the path of a body's centre, pointing to the right."""
    if piece.sign == 0.0:
        return piece.tangent_x, piece.tangent_y
    return piece.sign * ((c - s) * (c + s)), 2.0 * s * c


@kernel
def centre_acceleration(
    piece: PieceData, track: TrackData, s: float, c: float, p: float, tangential: float
) -> tuple[float, float]:
    """Return the acceleration of a body's centre (m/s^2), given its component along the path."""
    if piece.sign == 0.0:
        return piece.tangent_x * tangential, piece.tangent_y * tangential
    sine, cosine = twice_angle(s, c)
    rate = 2.0 * track.frequency * p
    central = track.path_radius * rate * rate
    return (
        piece.sign * (tangential * cosine - central * sine),
        tangential * sine + central * cosine,
    )


@kernel
def distance_gap(
    piece_a: PieceData,
    track_a: TrackData,
    piece_b: PieceData,
    track_b: TrackData,
    states: States,
    accelerations: tuple[float, float],
    contact_distance: float,
) -> tuple[float, float, float]:
    """Return the gap between two bodies as a distance, and its first two time derivatives.

    These are ``d - (r_a + r_b)`` (m), ``d'`` (m/s) and ``d''`` (m/s^2), from the states of both
    bodies and their accelerations along their paths (m/s^2).
    """
    a_s, a_c, a_p, b_s, b_c, b_p = states
    along_a, along_b = accelerations
    ax, ay = centre_position(piece_a, track_a, a_s, a_c)
    bx, by = centre_position(piece_b, track_b, b_s, b_c)
    dx = bx - ax
    dy = by - ay
    distance = math.sqrt(dx * dx + dy * dy)
    inverse = 1.0 / distance
    tax, tay = centre_tangent(piece_a, a_s, a_c)
    tbx, tby = centre_tangent(piece_b, b_s, b_c)
    va = track_a.speed_factor * a_p
    vb = track_b.speed_factor * b_p
    vx = vb * tbx - va * tax
    vy = vb * tby - va * tay
    fax, fay = centre_acceleration(piece_a, track_a, a_s, a_c, a_p, along_a)
    fbx, fby = centre_acceleration(piece_b, track_b, b_s, b_c, b_p, along_b)
    rate = (dx * vx + dy * vy) * inverse
    # |dV|^2 - d'^2 is the square of the transverse velocity, without cancellation.
    across = (dx * vy - dy * vx) * inverse
    second = (across * across + dx * (fbx - fax) + dy * (fby - fay)) * inverse
    return distance - contact_distance, rate, second


# The line of centres is parallel to the trace up to this share.
LIFT_ROUNDING = 1.0e-14
# At one instant a gap below this share of the positions counts as contact.
CONTACT_ROUNDING = 16.0 * EPSILON


@kernel
def surface_gap(
    world: World, j: int, a_s: float, a_c: float, b_s: float, b_c: float
) -> tuple[float, float]:
    """Return the gap of a pair (m) at given positions, and the scale (m) of its rounding.

    The positions are on its present pieces. On an arc the gap follows without cancellation from
    ``d^2 - (r_a + r_b)^2 = 4 rho_a rho_b sin((f - beta)/2) sin((f + beta)/2)``, on a line likewise.
    """
    pair = world.pairs[j]
    piece = world.pieces[world.flights[pair.a].piece]
    piece_b = world.pieces[world.flights[pair.b].piece]
    track_a, track_b = tracks_of(world, pair)
    reach = pair.distance
    if world.flights[pair.a].piece != world.flights[pair.b].piece:
        ax, ay = centre_position(piece, track_a, a_s, a_c)
        bx, by = centre_position(piece_b, track_b, b_s, b_c)
        distance = math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
        return distance - reach, abs(ax) + abs(ay) + abs(bx) + abs(by) + reach
    contact = contact_of(world, j)
    if piece.sign == 0.0:
        along = b_s - a_s
        square = (along - contact.sine) * (along + contact.sine)
        size = abs(a_s) + abs(b_s) + reach
    else:
        sine = abs(b_s * a_c - b_c * a_s)
        cosine = abs(b_c * a_c + b_s * a_s)
        less = sine * contact.cosine - cosine * contact.sine
        more = sine * contact.cosine + cosine * contact.sine
        square = 4.0 * (track_a.path_radius * track_b.path_radius) * (less * more)
        size = 2.0 * (track_a.path_radius + track_b.path_radius) + reach
    return square / (reach + math.sqrt(max(reach * reach + square, 0.0))), size


@kernel
def present_gap(world: World, j: int) -> tuple[float, float]:
    """Return the gap of a pair (m) at its present states, and the scale (m) of its rounding."""
    a, b = flights_of(world, world.pairs[j])
    return surface_gap(world, j, a.s, a.c, b.s, b.c)


@kernel
def line_of_centres(world: World, j: int) -> tuple[float, float]:
    """Return the vector (m) from the centre of a pair's left body to that of its right one."""
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    track_a, track_b = tracks_of(world, pair)
    ax, ay = centre_position(world.pieces[a.piece], track_a, a.s, a.c)
    bx, by = centre_position(world.pieces[b.piece], track_b, b.s, b.c)
    return bx - ax, by - ay


@kernel
def tangent(world: World, ball: int) -> tuple[float, float]:
    """Return the unit tangent of the path of a body's centre at its present position."""
    flight = world.flights[ball]
    return centre_tangent(world.pieces[flight.piece], flight.s, flight.c)


@kernel
def centres_along_path(world: World, j: int, ball: int) -> tuple[float, float]:
    """Return the components (m) of :func:`line_of_centres` along and across a body's path."""
    dx, dy = line_of_centres(world, j)
    tx, ty = tangent(world, ball)
    return dx * tx + dy * ty, dy * tx - dx * ty


@kernel
def parts_of_weight(world: World, x: float, sine: float, cosine: float) -> tuple[float, float]:
    """Return gravity (m/s^2) back along a slope and onto it, given the slope's sine and cosine.

    On a rotating trace the centrifugal acceleration at ``x`` (m) of the centre is included.
    """
    settings = world.settings[0]
    away = settings.turning_square * (x - settings.axis_x)
    return settings.gravity * sine - away * cosine, settings.gravity * cosine + away * sine


@kernel
def set_normals(world: World, j: int) -> None:
    """Set ``n t`` of both bodies of a pair in contact from their present positions."""
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    contact = contact_of(world, j)
    if a.piece == b.piece and contact.normal_a > 0.0:
        pair.normal_a = contact.normal_a
        pair.normal_b = contact.normal_b
        return
    dx, dy = line_of_centres(world, j)
    distance = math.sqrt(dx * dx + dy * dy)
    tax, tay = tangent(world, pair.a)
    tbx, tby = tangent(world, pair.b)
    pair.normal_a = (dx * tax + dy * tay) / distance
    pair.normal_b = (dx * tbx + dy * tby) / distance


@kernel
def lifted_body(world: World, j: int) -> int:
    """Return the body of a touching pair that an impact would lift off a one-sided trace, or -1.

    The impulse P along the line of centres n requires impulses ``P n n_a`` and ``-P n n_b`` of the
    trace along its normals; a one-sided trace cannot pull.
    """
    pair = world.pairs[j]
    _, across_a = centres_along_path(world, j, pair.a)
    _, across_b = centres_along_path(world, j, pair.b)
    rounding = LIFT_ROUNDING * pair.distance
    if across_a < -rounding:
        return pair.a
    if across_b > rounding:
        return pair.b
    return -1


@kernel
def set_speed(world: World, ball: int) -> None:
    """Set a body's scratch speed from its state."""
    flight = world.flights[ball]
    track = track_of(world, ball)
    flight.speed = track.speed_factor * flight.p


@kernel
def parting_speed(world: World, j: int) -> float:
    """Return the speed (m/s) at which a pair separates along its line of centres."""
    pair = world.pairs[j]
    speed_a = world.flights[pair.a].speed
    speed_b = world.flights[pair.b].speed
    return pair.normal_b * speed_b - pair.normal_a * speed_a


@kernel
def speed_of_pair(world: World, j: int) -> float:
    """Return the scale (m/s) of the speeds of a pair along its line of centres, for rounding."""
    pair = world.pairs[j]
    speed_a = abs(pair.normal_a * world.flights[pair.a].speed)
    return speed_a + abs(pair.normal_b * world.flights[pair.b].speed)


@kernel
def supported(flight: Flight) -> bool:
    """Return whether a body is at rest against a wall that keeps it from moving."""
    return flight.wall_side != 0 and flight.speed * flight.wall_side >= 0.0


@kernel
def is_bound(flight: Flight) -> bool:
    """Return whether a body is held to another one or rests against a wall."""
    return flight.grouped == 1 or flight.wall_side != 0


@kernel
def mobility(world: World, ball: int) -> float:
    """Return the acceleration of a body per newton along its path; 0 if a wall supports it."""
    flight = world.flights[ball]
    return 0.0 if supported(flight) else 1.0 / world.bodies[ball].rolling_mass


@kernel
def on_one_line(world: World, a: Flight, b: Flight) -> bool:
    """Return whether two bodies are on one straight line, of one piece or several in a row."""
    for piece in range(a.piece, b.piece + 1):
        if world.pieces[piece].sign != 0.0:
            return False
    return a.piece <= b.piece


@kernel
def free_acceleration(world: World, ball: int) -> float:
    """Return the tangential acceleration (m/s^2) of a body under gravity alone."""
    flight = world.flights[ball]
    track = track_of(world, ball)
    if supported(flight):
        return 0.0
    if track.path_radius == 0.0:
        return track.line_acceleration
    return -track.gravity_rate * (2.0 * flight.s * flight.c)


@kernel
def present_acceleration(world: World, ball: int) -> float:
    """Return the tangential acceleration (m/s^2) of a body at the start of its flight."""
    flight = world.flights[ball]
    if flight.grouped == 0:
        return free_acceleration(world, ball)
    if flight.form == POLYNOMIAL:
        return flight.series[0]
    track = track_of(world, ball)
    return tangential_acceleration(flight, track.path_radius, flight.s, flight.c)


@kernel
def free_approach(world: World, j: int) -> float:
    """Return ``d''`` (m/s^2) of a pair's distance without contact forces; normals must be set."""
    pair = world.pairs[j]
    drive_b = pair.normal_b * free_acceleration(world, pair.b)
    return drive_b - pair.normal_a * free_acceleration(world, pair.a) + _curve(world, j)


@kernel
def present_approach(world: World, j: int) -> float:
    """Return ``d''`` (m/s^2) of a pair's distance on its present flights; normals must be set."""
    pair = world.pairs[j]
    drive_b = pair.normal_b * present_acceleration(world, pair.b)
    return drive_b - pair.normal_a * present_acceleration(world, pair.a) + _curve(world, j)


@kernel
def _curve(world: World, j: int) -> float:
    """Return the part of ``d''`` (m/s^2) of a pair's distance that is due to its speeds."""
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    if a.piece == b.piece:
        # On one piece only a change of the angle or distance between the bodies contributes.
        track_a, track_b = tracks_of(world, pair)
        rho_a = track_a.path_radius
        rho_b = track_b.path_radius
        along = parting_speed(world, j)
        if rho_a == 0.0:
            rate = b.speed - a.speed
            return (rate - along) * (rate + along) / pair.distance
        rate = b.speed / rho_b - a.speed / rho_a
        cosine = b.c * a.c + b.s * a.s
        turned = (rho_a * rho_b) * (2.0 * cosine * cosine - 1.0) * rate * rate
        return (turned - along * along) / pair.distance
    dx, dy = line_of_centres(world, j)
    tax, tay = tangent(world, pair.a)
    tbx, tby = tangent(world, pair.b)
    across = dx * (b.speed * tby - a.speed * tay) - dy * (b.speed * tbx - a.speed * tax)
    cax, cay = _centripetal(world, pair.a)
    cbx, cby = _centripetal(world, pair.b)
    across /= pair.distance
    return (dx * (cbx - cax) + dy * (cby - cay) + across * across) / pair.distance


@kernel
def _centripetal(world: World, ball: int) -> tuple[float, float]:
    """Return the centripetal acceleration (m/s^2) of a body's centre."""
    flight = world.flights[ball]
    piece = world.pieces[flight.piece]
    track = track_of(world, ball)
    if piece.sign == 0.0:
        return 0.0, 0.0
    central = piece.sign * (flight.speed * flight.speed / track.path_radius)
    tx, ty = tangent(world, ball)
    return -ty * central, tx * central
