"""Launching a flight on a turning trace: its energy, its end, its bounds.

The kernels stand in for those of ``kernels.flow.flight`` and for the bounds of
``kernels.contact.first_contact``.
The energy is ``m kappa v^2/2 + m g y - m Omega^2 (x_C - x0)^2/2``, kept between impacts.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.flow.flight import at_end
from vibro_cli.kernels.flow.flow import POLYNOMIAL
from vibro_cli.kernels.flow.rotating_flow import TURNING_LINE, angular_jerk, set_motion
from vibro_cli.kernels.flow.rotating_line import limit_by_lift_off
from vibro_cli.kernels.flow.rotating_time_of_flight import (
    squared_speed,
    time_on_line,
    time_to,
    turns_before,
)
from vibro_cli.kernels.numerics.weierstrass_motion import squared_rate
from vibro_cli.kernels.structs import NEVER, BodyData, Flight, PieceData, TrackData
from vibro_cli.kernels.world import FlightRow, World

# Below this share of the whole energy, a speed is kept instead of the energy that is carried.
SLOW = 1.0e-6


@kernel
def potential(track: TrackData, s: float, c: float) -> float:
    """``V = S^2 - tilt S C - spread S^2 C^2`` of an arc."""
    sc = s * c
    return s * s - sc * (track.tilt + track.spread * sc)


@kernel
def potential_head(track: TrackData, gravity: float, kappa: float, s: float, c: float) -> float:
    """Potential energy over weight, m above its least value on the trace."""
    if track.path_radius > 0.0:
        return track.bottom + track.twice_radius * potential(track, s, c)
    b = track.line_growth
    rate = -track.line_acceleration - 0.5 * b * b * s
    return track.bottom + kappa / gravity * rate * s


@kernel
def energy_of_row(world: World, row: FlightRow, s: float, c: float, p: float) -> float:
    """Energy (J) of a body; carried on a free flight, from the state in lasting contact."""
    body = world.bodies[row.body]
    if row.grouped == 0:
        return body.weight * row.head
    gravity = world.settings[0].gravity
    track = world.tracks[row.body * world.settings[0].pieces + row.piece]
    speed = track.speed_factor * p
    kinetic = 0.5 * body.kappa * speed * speed / gravity
    return body.weight * (potential_head(track, gravity, body.kappa, s, c) + kinetic)


@kernel
def head_from_state(flight: Flight, body: BodyData, track: TrackData, gravity: float) -> float:
    """Energy over weight, m above the least potential energy of the body on the trace."""
    speed = track.speed_factor * flight.p
    height = potential_head(track, gravity, body.kappa, flight.s, flight.c)
    return height + 0.5 * body.kappa * speed * speed / gravity


@kernel
def speed_of_head(flight: Flight, body: BodyData, track: TrackData, gravity: float) -> float:
    """``P`` of the energy that is carried, with the sign of the present one; that if it is slow."""
    rise = flight.head - potential_head(track, gravity, body.kappa, flight.s, flight.c)
    if rise <= SLOW * flight.head:
        return flight.p
    p = math.sqrt(2.0 * gravity * rise / body.kappa) / track.speed_factor
    return p if flight.p > 0.0 else -p


@kernel
def anchor_at_crest(flight: Flight, track: TrackData) -> None:
    """Nothing: on a turning trace a state alone tells the energy."""
    flight.anchor = -1


@kernel
def set_arc_energy(flight: Flight, track: TrackData, anchor_track: TrackData) -> None:
    """Nothing: the constants of a flight follow from its start."""
    flight.anchor = -1


@kernel
def set_track(flight: Flight, track: TrackData) -> None:
    """Take from the track what the flow of a flight needs, which starts from the state in it."""
    flight.frequency = track.frequency
    if track.path_radius == 0.0:
        b = track.line_growth
        flight.form = TURNING_LINE
        flight.line_growth = b
        flight.line_acceleration = track.line_acceleration + b * b * flight.s
        return
    flight.line_acceleration = 0.0
    flight.tilt = track.tilt
    flight.spread = track.spread
    flight.twist = 0.0
    flight.crests = track.crests
    energy = flight.p * flight.p + potential(track, flight.s, flight.c)
    flight.turns_over = 1 if energy > track.highest_potential else 0
    set_motion(flight)


@kernel
def launch_on_piece(
    flight: Flight, body: BodyData, piece: PieceData, track: TrackData, one_sided: int
) -> None:
    """Set the form of a flight on its piece, its bounds, and how and after what time it ends."""
    set_track(flight, track)
    if piece.sign == 0.0:
        launch_on_line(flight, track)
    else:
        _launch_on_arc(flight, track)
    if one_sided == 1:
        limit_by_lift_off(flight, body, piece, track)


@kernel
def _launch_on_arc(flight: Flight, track: TrackData) -> None:
    w = track.frequency
    rho = track.path_radius
    if flight.p == 0.0 and flight.quartic_3 == 0.0:
        flight.at_rest = 1
    height = potential(track, flight.s, flight.c) - track.lowest_potential
    most_rate = 2.0 * w * math.sqrt(max(flight.p * flight.p + height, 0.0))
    flight.angular_bound = track.most_angular
    flight.steepest = track.steepest
    flight.jerk_bound = track.most_stiffness * most_rate
    flight.snap_bound = track.most_bending * most_rate * most_rate
    flight.snap_bound += track.most_stiffness * track.most_angular
    flight.most_speed = rho * most_rate
    along = rho * track.most_angular
    central = rho * most_rate * most_rate
    flight.acceleration_bound = math.sqrt(along * along + central * central)
    if flight.at_rest == 0:
        _choose_exit(flight, track)


@kernel
def _choose_exit(flight: Flight, track: TrackData) -> None:
    """Find at which end of its arc a flight ends, and when."""
    right = flight.flow_p > 0.0 or (flight.flow_p == 0.0 and flight.quartic_3 > 0.0)
    end_s = track.right_s if right else track.left_s
    end_c = track.right_c if right else track.left_c
    if at_end(flight, end_s, end_c, 1.0 if right else -1.0):
        flight.exit_side = 1 if right else -1
        flight.exit_p = flight.flow_p
        flight.exit_after = 0.0
        return
    to_right = _rate_at_end(flight, track, 1.0, track.right_s, track.right_c)
    if right and to_right > 0.0:
        _leave(flight, 1, track.right_s, track.right_c, to_right)
        return
    to_left = _rate_at_end(flight, track, -1.0, track.left_s, track.left_c)
    if to_left > 0.0:
        _leave(flight, -1, track.left_s, track.left_c, to_left)
    elif to_right > 0.0:
        _leave(flight, 1, track.right_s, track.right_c, to_right)


@kernel
def _leave(flight: Flight, side: int, s: float, c: float, squared: float) -> None:
    p = side * math.sqrt(squared)
    after = time_to(flight, s, c, p)
    if after < NEVER:
        flight.exit_side = side
        flight.exit_p = p
        flight.exit_after = after


@kernel
def _rate_at_end(flight: Flight, track: TrackData, side: float, s: float, c: float) -> float:
    """``P^2`` at an end of the arc; not positive if a crest or the height of the end is before."""
    s0 = flight.flow_s
    c0 = flight.flow_c
    if track.crests > 0:
        crest_s = track.crest_s
        crest_c = track.crest_c
        for number in range(track.crests):
            if number == 1:
                crest_s = track.other_crest_s
                crest_c = track.other_crest_c
            sine = crest_s * c0 - crest_c * s0
            beyond = s * crest_c - c * crest_s
            if sine * side > 0.0 and beyond * side > 0.0:
                squared = squared_rate(flight, sine, crest_c * c0 + crest_s * s0)
                if squared <= 0.0:
                    return squared
    if s == s0 and c == c0:
        return flight.flow_p * flight.flow_p
    return squared_rate(flight, s * c0 - c * s0, c * c0 + s * s0)


@kernel
def launch_on_line(flight: Flight, track: TrackData) -> None:
    """The motion ``v' = a + b^2 way`` between the ends of a line."""
    v = flight.flow_p
    a = flight.line_acceleration
    b = flight.line_growth
    to_right = track.right_s - flight.s
    to_left = track.left_s - flight.s
    right = squared_speed(flight, to_right)
    left = squared_speed(flight, to_left)
    pull_right = abs(a + b * b * to_right)
    flight.acceleration_bound = max(pull_right, abs(a + b * b * to_left))
    flight.most_speed = math.sqrt(max(max(right, left), v * v))
    flight.angular_bound = 0.0
    flight.jerk_bound = b * b * flight.most_speed
    flight.snap_bound = b * b * flight.acceleration_bound
    if v == 0.0 and a == 0.0:
        flight.at_rest = 1
        return
    moves_right = v > 0.0 or (v == 0.0 and a > 0.0)
    if turns_before(flight, to_right):
        right = 0.0
    if turns_before(flight, to_left):
        left = 0.0
    if right > 0.0 and (moves_right or left <= 0.0):
        flight.exit_side = 1
        flight.exit_p = math.sqrt(right)
        flight.exit_after = time_on_line(flight, to_right, flight.exit_p)
    elif left > 0.0:
        flight.exit_side = -1
        flight.exit_p = -math.sqrt(left)
        flight.exit_after = time_on_line(flight, to_left, flight.exit_p)


@kernel
def speed_and_jerk(flight: Flight, track: TrackData, until: float) -> tuple[float, float]:
    """Bounds on the speed (m/s) and the jerk (m/s^3) of a body's centre on its flight."""
    if flight.at_rest == 1:
        return 0.0, 0.0
    speed = flight.most_speed
    if flight.form == POLYNOMIAL:
        speed = abs(flight.flow_p) + flight.acceleration_bound * flight.segment
    rho = track.path_radius
    if rho == 0.0:
        return speed, flight.jerk_bound
    bend = speed / rho
    return speed, rho * flight.jerk_bound + bend * (3.0 * flight.acceleration_bound + bend * speed)


@kernel
def released_step(
    a: Flight,
    b: Flight,
    a_s: float,
    a_c: float,
    a_p: float,
    b_s: float,
    b_c: float,
    b_p: float,
    rate: float,
) -> float:
    """Step up to which a pair whose contact force has just vanished stays apart.

    As ``arc_contact.released_step``, with the flights' own bounds on the fourth derivative.
    """
    wa = a.own_frequency
    wb = b.own_frequency
    third = angular_jerk(b, b_s, b_c, b_p) - angular_jerk(a, a_s, a_c, a_p)
    if a.form == POLYNOMIAL or b.form == POLYNOMIAL:
        third = 0.0
    if third <= 0.0 or rate < -1.0e-9 * (abs(wa * a_p) + abs(wb * b_p)):
        return 1.0e-9 / (wa + wb)
    return 3.0 * third / (a.snap_bound + b.snap_bound)
