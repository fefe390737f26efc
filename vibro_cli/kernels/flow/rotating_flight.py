"""Flights on a rotating trace: energy, exit and bounds, and where a force falls through zero.

On an arc every force is a trigonometric polynomial of degree 2 in the angle from the start of the
flight (``kernels.numerics.conservative_advancement``); on a line it is linear in position. The
normal force of a body alone on an arc is
``N/(m g) = sign (cos f + tilt sin f + spread sin^2 f + (4/kappa) P^2)``. The energy is
``m kappa v^2/2 + m g y - m Omega^2 (x_C - x0)^2/2``, conserved between impacts. The kernels
override those of ``kernels.flow.flight`` and the bounds of ``kernels.contact.first_contact``.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.flow.flight import (
    LIFT_OFF,
    leaves_at_once,
    root_of_state,
)
from vibro_cli.kernels.flow.flow import angle_from_start, place_from_start
from vibro_cli.kernels.flow.rotating_flow import (
    TURNING_LINE,
    half_way,
    heading,
    quartic_about,
    rate_at,
    set_motion,
    squared_rate_ahead,
    squared_speed,
    time_of_flight,
    time_on_line,
    turn_on_line,
    turns_before,
)
from vibro_cli.kernels.numerics.conservative_advancement import (
    Harmonics,
    combined,
    first_zero_crossing_of_harmonics,
    harmonic_value,
    mirrored,
    scaled,
    turned,
)
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.numerics.elliptic import angle_difference, sine_cosine, twice_angle
from vibro_cli.kernels.world import (
    BodyData,
    Flight,
    PieceData,
    TrackData,
    World,
    track_of,
)

# The energy is also taken relative to a saddle where the state is at least this near it, as a share
# of the curvature there.
SADDLE_NEIGHBOURHOOD = 1.0e-4
# A normal force that is negative by less than this share of the weight is zero up to rounding.
FORCE_ROUNDING = 1.0e-14


@kernel
def torque_harmonics(flight: Flight) -> Harmonics:
    """Return the torque of a flight on an arc as a function of the angle from its start."""
    h = 0.0, flight.tilt, -1.0, flight.twist, 0.5 * flight.spread
    return harmonics_from_start(flight, h)


@kernel
def harmonics_from_start(flight: Flight, h: Harmonics) -> Harmonics:
    """Return a function of the angle of a flight as one of the angle from its start."""
    sine, cosine = twice_angle(flight.flow_s, flight.flow_c)
    return turned(h, sine, cosine)


@kernel
def square_harmonics(flight: Flight) -> Harmonics:
    """Return ``P^2`` on an arc in the angle from the start: half the integral of the torque."""
    _, b, c, d, e = torque_harmonics(flight)
    start = flight.flow_p * flight.flow_p
    return start + 0.5 * c + 0.25 * e, -0.5 * c, 0.5 * b, -0.25 * e, 0.25 * d


@kernel
def normal_harmonics_of_one(flight: Flight, track: TrackData, kappa: float) -> Harmonics:
    """Return ``N/(m g)`` of a body alone, up to the arc's sign, in the angle from its start."""
    square = square_harmonics(flight)
    h = 0.5 * track.spread, 1.0, track.tilt, -0.5 * track.spread, 0.0
    return combined(harmonics_from_start(flight, h), 4.0 / kappa, square)


@kernel
def reach(flight: Flight, side: float, end_s: float, end_c: float) -> float:
    """Return the angle (rad) that a flight on an arc covers on one side, up to its exit or turn."""
    if flight.exit_side * side > 0.0 or flight.turns_over == 1:
        sine, cosine = angle_from_start(flight, end_s, end_c)
        half = side * math.atan2(sine, cosine)
        if half < 0.0:
            # The end is ahead: up to rounding, at the start or a whole turn away.
            return 0.0 if cosine > 0.0 else 2.0 * math.pi
        return 2.0 * half
    return 2.0 * half_way(flight, side)


@kernel
def first_negative(flight: Flight, h: Harmonics, to_left: float, to_right: float) -> float:
    """Return the time (s) at which a force falls through zero on a moving flight, or NEVER.

    The flight is on an arc. ``h`` is the force in the angle from the start; ``to_left`` and
    ``to_right`` are the angles (rad) that the flight covers. A body that turns first passes what is
    ahead of it.
    """
    forward = heading(flight)
    for turn in range(2):
        side = 1.0 if (forward > 0.0) == (turn == 0) else -1.0
        ahead = h if side > 0.0 else mirrored(h)
        angle = first_zero_crossing_of_harmonics(ahead, to_right if side > 0.0 else to_left)
        if angle == 0.0 and turn == 0:
            return 0.0
        if angle >= 0.0:
            sine, cosine = sine_cosine(0.5 * side * angle)
            p = side * math.sqrt(max(squared_rate_ahead(flight, sine, cosine), 0.0))
            s, c = place_from_start(flight, sine, cosine)
            return time_of_flight(flight, s, c, p)
        if flight.exit_side * side > 0.0:
            return NEVER
    return NEVER


@kernel
def limit_by_lift_off(flight: Flight, body: BodyData, piece: PieceData, track: TrackData) -> None:
    """End a flight where a one-sided trace would have to pull."""
    if piece.sign == 0.0:
        normal = track.line_normal + track.line_normal_growth * flight.flow_s
        after = 0.0
        if normal >= -FORCE_ROUNDING * abs(track.line_normal):
            after = zero_crossing_on_line(flight, normal, track.line_normal_growth)
    else:
        after = _lift_off_of_arc(flight, body, piece, track)
    if after < flight.exit_after:
        flight.exit_kind = LIFT_OFF
        flight.exit_after = after


@kernel
def _lift_off_of_arc(flight: Flight, body: BodyData, piece: PieceData, track: TrackData) -> float:
    h = scaled(piece.sign, normal_harmonics_of_one(flight, track, body.kappa))
    if harmonic_value(h, 0.0, 1.0) < -FORCE_ROUNDING * (1.0 + abs(track.tilt) + track.spread):
        return 0.0
    if flight.at_rest == 1:
        return NEVER
    to_left = reach(flight, -1.0, track.left_s, track.left_c)
    to_right = reach(flight, 1.0, track.right_s, track.right_c)
    return first_negative(flight, h, to_left, to_right)


@kernel
def zero_crossing_on_line(flight: Flight, force: float, growth: float) -> float:
    """Return the time (s) at which a force linear in position falls through zero, or NEVER.

    The time is 0 if the force is zero or less and falls in the direction of motion.
    """
    moved = flight.flow_p if flight.flow_p != 0.0 else flight.line_acceleration
    if force <= 0.0 and moved * growth < 0.0 and flight.at_rest == 0:
        return 0.0
    return next_zero_crossing_on_line(flight, max(force, 0.0), growth)


@kernel
def next_zero_crossing_on_line(flight: Flight, force: float, growth: float) -> float:
    """Return the crossing of :func:`zero_crossing_on_line` for any sign of the force at the start.

    A flight has at most one.
    """
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
        # On the way back, after the turn.
        turn = turn_on_line(flight)
        reached = turn != 0.0 and (way - turn) * side >= 0.0
    return time_on_line(flight, way, side * math.sqrt(squared)) if reached else NEVER


@kernel
def potential(track: TrackData, s: float, c: float) -> float:
    """Return ``V = S^2 - tilt S C - spread S^2 C^2`` of an arc."""
    sc = s * c
    return s * s - sc * (track.tilt + track.spread * sc)


@kernel
def specific_potential(track: TrackData, gravity: float, kappa: float, s: float, c: float) -> float:
    """Return potential energy over weight, m above its least value on the trace."""
    if track.path_radius > 0.0:
        return track.bottom + track.twice_radius * potential(track, s, c)
    b = track.line_growth
    rate = -track.line_acceleration - 0.5 * b * b * s
    return track.bottom + kappa / gravity * rate * s


@kernel
def specific_energy_of_state(world: World, ball: int) -> float:
    """Return energy over weight, m above the body's least potential energy on the trace."""
    flight = world.flights[ball]
    track = track_of(world, ball)
    gravity = world.settings[0].gravity
    kappa = world.bodies[ball].kappa
    speed = track.speed_factor * flight.p
    height = specific_potential(track, gravity, kappa, flight.s, flight.c)
    return height + 0.5 * kappa * speed * speed / gravity


@kernel
def refer_to_separatrix(flight: Flight, track: TrackData) -> None:
    """Measure the energy also relative to a saddle of the piece if the state is near it."""
    flight.separatrix_piece = -1
    square = flight.p * flight.p
    if track.path_radius == 0.0:
        along = rise_on_line(track, flight.s)
        longest = track.line_growth * (track.right_s - track.left_s)
        if along * along + square < SADDLE_NEIGHBOURHOOD * (longest * longest):
            flight.separatrix_piece = flight.piece
            flight.separatrix_root = root_of_state(along, flight.p)
        return
    # Most bodies are faster than the condition below allows with any a0 and a2.
    most = SADDLE_NEIGHBOURHOOD * (1.0 + abs(track.tilt) + track.spread)
    if square > most:
        return
    energy = square + potential(track, flight.s, flight.c)
    s, c = saddle_beside(track, energy)
    a0, a1, a2, _ = quartic_about(track.tilt, track.spread, 0.0, s, c, 0.0)
    sine, cosine = angle_difference(flight.s, flight.c, s, c)
    fall = a0 * sine * sine + (4.0 * a1 * sine + 6.0 * a2 * cosine) * cosine
    along = sine * math.sqrt(max(fall, 0.0))
    share = (along * along + square) * (abs(a0) + abs(a2))
    if fall > 0.0 and a2 > 0.0 and share < SADDLE_NEIGHBOURHOOD * (a2 * a2):
        flight.separatrix_piece = flight.piece
        flight.separatrix_root = root_of_state(along, flight.p)


@kernel
def saddle_beside(track: TrackData, energy: float) -> tuple[float, float]:
    """Return ``(S, C)`` of the saddle of an arc's full circle that is nearest in energy."""
    lower = potential(track, track.pass_s, track.pass_c)
    if abs(energy - lower) < abs(energy - track.highest_potential):
        return track.pass_s, track.pass_c
    return track.top_s, track.top_c


@kernel
def rise_on_line(track: TrackData, s: float) -> float:
    """Return the speed (m/s) that a body on a line loses from a position to the saddle."""
    b = track.line_growth
    return track.line_acceleration / b + b * s if b > 0.0 else 0.0


@kernel
def saddle_height(track: TrackData, specific_energy: float) -> float:
    """Return the potential energy over weight (m) of the saddle that is nearest in energy."""
    s, c = saddle_beside(track, (specific_energy - track.bottom) / track.twice_radius)
    return track.bottom + track.twice_radius * potential(track, s, c)


@kernel
def set_track(flight: Flight, track: TrackData) -> None:
    """Set the constants of a flight's flow from its track and its state."""
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
    if flight.saddle_root < NEVER:
        flight.saddle_s, flight.saddle_c = saddle_beside(track, energy)
        if flight.saddle_s == track.top_s and flight.saddle_c == track.top_c:
            flight.turns_over = 1 if flight.saddle_root < 0.0 else 0
    set_motion(flight)


@kernel
def launch_on_piece(
    flight: Flight, body: BodyData, piece: PieceData, track: TrackData, one_sided: int
) -> None:
    """Set the bounds and the exit of a flight whose flow is set (:func:`set_track`)."""
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
    if heading(flight) == 0.0:
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
    """Find at which end of its arc a flight leaves, and when."""
    right = heading(flight) > 0.0
    end_s = track.right_s if right else track.left_s
    end_c = track.right_c if right else track.left_c
    if leaves_at_once(flight, right, end_s, end_c):
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
def _leave(flight: Flight, side: int, s: float, c: float, rate: float) -> None:
    after = time_of_flight(flight, s, c, side * rate)
    if after < NEVER:
        flight.exit_side = side
        flight.exit_p = side * rate
        flight.exit_after = after


@kernel
def _rate_at_end(flight: Flight, track: TrackData, side: float, s: float, c: float) -> float:
    """Return ``|P|`` at an end of the arc; not positive if it or a crest before is too high."""
    crest_s = track.crest_s
    crest_c = track.crest_c
    for number in range(track.crests):
        if number == 1:
            crest_s = track.other_crest_s
            crest_c = track.other_crest_c
        sine, _ = angle_from_start(flight, crest_s, crest_c)
        beyond = s * crest_c - c * crest_s
        if sine * side > 0.0 and beyond * side > 0.0 and rate_at(flight, crest_s, crest_c) <= 0.0:
            return -1.0
    if s == flight.flow_s and c == flight.flow_c:
        return abs(flight.flow_p)
    return rate_at(flight, s, c)


@kernel
def launch_on_line(flight: Flight, track: TrackData) -> None:
    """Set the bounds and the exit of the motion ``v' = a + b^2 way`` on a line."""
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
    if (to_right if moves_right else -to_left) <= 0.0:
        # It starts at the end ahead, maybe from rest.
        flight.exit_side = 1 if moves_right else -1
        flight.exit_p = v
        flight.exit_after = 0.0
        return
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
def most_speed(flight: Flight, track: TrackData, until: float) -> float:
    """Return a bound on the speed (m/s) of a body's centre on a flight that is not a segment."""
    return flight.most_speed
