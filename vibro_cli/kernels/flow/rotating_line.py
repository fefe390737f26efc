"""Where on a flight of a turning trace a force falls through zero.

On an arc every force is a trigonometric polynomial of degree 2 in the angle from the start of the
flight (``kernels.numerics.trigonometric_polynomial``), on a line it is linear in the place. The
normal force of a body
alone is ``N/(m g) = sign (cos f + tilt sin f + spread sin^2 f + (4/kappa) P^2)`` on an arc.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.flow.flight import LIFT_OFF
from vibro_cli.kernels.flow.rotating_time_of_flight import (
    half_way,
    squared_speed,
    time_on_line,
    time_to,
    turn_on_line,
    turns_before,
)
from vibro_cli.kernels.numerics.trigonometric_polynomial import (
    Harmonics,
    first_fall,
    harmonic_value,
    mirrored,
    turned,
)
from vibro_cli.kernels.numerics.trigonometry import sine_cosine
from vibro_cli.kernels.numerics.weierstrass_motion import squared_rate
from vibro_cli.kernels.structs import NEVER, BodyData, Flight, PieceData, TrackData

# A normal force above -this share of the weight is zero up to rounding.
FORCE_ROUNDING = 1.0e-14


@kernel
def pull_harmonics(flight: Flight) -> Harmonics:
    """The pull of a flight on an arc in the angle from its start."""
    h = 0.0, flight.tilt, -1.0, flight.twist, 0.5 * flight.spread
    s = flight.flow_s
    c = flight.flow_c
    return turned(h, 2.0 * s * c, (c - s) * (c + s))


@kernel
def square_harmonics(flight: Flight, pull: Harmonics) -> Harmonics:
    """``P^2`` of a flight on an arc in the angle from its start: half the integral of the pull."""
    _, b, c, d, e = pull
    start = flight.flow_p * flight.flow_p
    return start + 0.5 * c + 0.25 * e, -0.5 * c, 0.5 * b, -0.25 * e, 0.25 * d


@kernel
def press_harmonics(flight: Flight, tilt: float, spread: float, kappa: float) -> Harmonics:
    """``N/(m g)``, up to the sign of the arc, of a body alone in the angle from its start."""
    a, b, c, d, e = square_harmonics(flight, pull_harmonics(flight))
    h = 0.5 * spread, 1.0, tilt, -0.5 * spread, 0.0
    s = flight.flow_s
    k = flight.flow_c
    ga, gb, gc, gd, ge = turned(h, 2.0 * s * k, (k - s) * (k + s))
    share = 4.0 / kappa
    return ga + share * a, gb + share * b, gc + share * c, gd + share * d, ge + share * e


@kernel
def scaled(weight: float, h: Harmonics) -> Harmonics:
    """A multiple of a function."""
    a, b, c, d, e = h
    return weight * a, weight * b, weight * c, weight * d, weight * e


@kernel
def reach(flight: Flight, side: float, end_s: float, end_c: float) -> float:
    """Angle (rad) that a flight on an arc takes in on one side, which it may leave at an end."""
    if flight.exit_side * side > 0.0 or flight.turns_over == 1:
        sine = end_s * flight.flow_c - end_c * flight.flow_s
        cosine = end_c * flight.flow_c + end_s * flight.flow_s
        half = side * math.atan2(sine, cosine)
        if half < 0.0:
            # The end is ahead: here, or a whole turn, up to rounding.
            return 0.0 if cosine > 0.0 else 2.0 * math.pi
        return 2.0 * half
    return 2.0 * half_way(flight, side)


@kernel
def first_negative(flight: Flight, h: Harmonics, to_left: float, to_right: float) -> float:
    """Time (s) at which a force falls through zero on a flight on an arc, or NEVER.

    Parameters
    ----------
    flight
        Moving.
    h
        The force in the angle from the start.
    to_left, to_right
        Angles (rad) that the flight takes in; a body that turns passes first what is ahead.
    """
    forward = flight.flow_p if flight.flow_p != 0.0 else flight.quartic_3
    for turn in range(2):
        side = 1.0 if (forward > 0.0) == (turn == 0) else -1.0
        ahead = h if side > 0.0 else mirrored(h)
        angle = first_fall(ahead, to_right if side > 0.0 else to_left)
        if angle == 0.0 and turn == 0:
            return 0.0
        if angle >= 0.0:
            sine, cosine = sine_cosine(0.5 * side * angle)
            p = side * math.sqrt(max(squared_rate(flight, sine, cosine), 0.0))
            s = flight.flow_s * cosine + flight.flow_c * sine
            return time_to(flight, s, flight.flow_c * cosine - flight.flow_s * sine, p)
        if flight.exit_side * side > 0.0:
            return NEVER
    return NEVER


@kernel
def limit_by_lift_off(flight: Flight, body: BodyData, piece: PieceData, track: TrackData) -> None:
    """End a flight where a one-sided trace would have to pull."""
    if piece.sign == 0.0:
        after = _lift_off_of_line(flight, track)
    else:
        after = _lift_off_of_arc(flight, body, piece, track)
    if after < flight.exit_after:
        flight.exit_kind = LIFT_OFF
        flight.exit_after = after


@kernel
def _lift_off_of_arc(flight: Flight, body: BodyData, piece: PieceData, track: TrackData) -> float:
    h = press_harmonics(flight, track.tilt, track.spread, body.kappa)
    h = scaled(piece.sign, h)
    if harmonic_value(h, 0.0, 1.0) < -FORCE_ROUNDING * (1.0 + abs(track.tilt) + track.spread):
        return 0.0
    if flight.at_rest == 1:
        return NEVER
    to_left = reach(flight, -1.0, track.left_s, track.left_c)
    to_right = reach(flight, 1.0, track.right_s, track.right_c)
    return first_negative(flight, h, to_left, to_right)


@kernel
def _lift_off_of_line(flight: Flight, track: TrackData) -> float:
    growth = track.line_press_growth
    press = track.line_press + growth * flight.flow_s
    if press < -FORCE_ROUNDING * abs(track.line_press):
        return 0.0
    return fall_on_line(flight, press, growth)


@kernel
def fall_on_line(flight: Flight, force: float, growth: float) -> float:
    """Time (s) at which a force that grows linearly with the way falls through zero, or NEVER.

    From where it is zero or less a body that moves to where it is less still falls at once.
    """
    if growth == 0.0 or flight.at_rest == 1:
        return NEVER
    moved = flight.flow_p if flight.flow_p != 0.0 else flight.line_acceleration
    if force <= 0.0:
        if moved * growth < 0.0:
            return 0.0
        force = 0.0
    return fall_through_zero(flight, force, growth)


@kernel
def fall_through_zero(flight: Flight, force: float, growth: float) -> float:
    """As :func:`fall_on_line`, of a force of any sign at the start; at most once on a flight."""
    if growth == 0.0 or flight.at_rest == 1:
        return NEVER
    way = -force / growth
    squared = squared_speed(flight, way)
    if squared <= 0.0:
        return NEVER
    side = -1.0 if growth > 0.0 else 1.0
    moved = flight.flow_p if flight.flow_p != 0.0 else flight.line_acceleration
    if moved * side > 0.0:
        reached = way * side >= 0.0 and not turns_before(flight, way)
    else:
        # On the way back, from where it turns.
        turn = turn_on_line(flight)
        reached = turn != 0.0 and (way - turn) * side >= 0.0
    return time_on_line(flight, way, side * math.sqrt(squared)) if reached else NEVER
