"""The gap between two neighbours: on one arc as an angle, elsewhere as a distance of the centres.

On one arc two bodies touch at a constant angle beta between their centres seen from the centre of
the arc, ``sin(beta/2) = sqrt(r_a r_b/(rho_a rho_b))`` (A (6), B (48) without the loss of digits of
their arc cosine). On two pieces they touch where the distance of the centres is ``r_a + r_b``.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.structs import PairTrack, PieceData, TrackData


@kernel
def half_gap_sine(
    contact: PairTrack,
    a_s: float,
    a_c: float,
    b_s: float,
    b_c: float,
    orientation: float,
) -> tuple[float, float]:
    """Sine and cosine of half the gap angle of two bodies on one arc.

    ``orientation`` is -1 when b is one lap ahead of a, so that the half angle is larger by pi.
    """
    sine = (b_s * a_c - b_c * a_s) * orientation
    cosine = (b_c * a_c + b_s * a_s) * orientation
    return (
        sine * contact.cosine - cosine * contact.sine,
        cosine * contact.cosine + sine * contact.sine,
    )


@kernel
def centre_position(piece: PieceData, track: TrackData, s: float, c: float) -> tuple[float, float]:
    """Position of a body's centre (m)."""
    if piece.sign == 0.0:
        return track.line_x + piece.tangent_x * s, track.line_y + piece.tangent_y * s
    return (
        piece.x + piece.sign * track.path_radius * (2.0 * s * c),
        piece.y - track.path_radius * ((c - s) * (c + s)),
    )


@kernel
def centre_tangent(piece: PieceData, s: float, c: float) -> tuple[float, float]:
    """Unit tangent of the path of a body's centre, to the right."""
    if piece.sign == 0.0:
        return piece.tangent_x, piece.tangent_y
    return piece.sign * ((c - s) * (c + s)), 2.0 * s * c


@kernel
def centre_acceleration(
    piece: PieceData, track: TrackData, s: float, c: float, p: float, tangential: float
) -> tuple[float, float]:
    """Acceleration of a body's centre (m/s^2), given its part along the path."""
    if piece.sign == 0.0:
        return piece.tangent_x * tangential, piece.tangent_y * tangential
    sine = 2.0 * s * c
    cosine = (c - s) * (c + s)
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
    a_s: float,
    a_c: float,
    a_p: float,
    a_tangential: float,
    piece_b: PieceData,
    track_b: TrackData,
    b_s: float,
    b_c: float,
    b_p: float,
    b_tangential: float,
    contact_distance: float,
) -> tuple[float, float, float]:
    """Gap between two bodies as a distance, and its first two time derivatives.

    Returns
    -------
    ``d - (r_a + r_b)`` (m), ``d'`` (m/s), ``d''`` (m/s^2).
    """
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
    fax, fay = centre_acceleration(piece_a, track_a, a_s, a_c, a_p, a_tangential)
    fbx, fby = centre_acceleration(piece_b, track_b, b_s, b_c, b_p, b_tangential)
    rate = (dx * vx + dy * vy) * inverse
    # |dV|^2 - d'^2 is the square of the transverse velocity, without cancellation.
    across = (dx * vy - dy * vx) * inverse
    second = (across * across + dx * (fbx - fax) + dy * (fby - fay)) * inverse
    return distance - contact_distance, rate, second
