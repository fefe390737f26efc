"""Overrides of kernels for a trace that rotates about a vertical axis.

Everything else (events, laws, log rows, contacts, walls, tables) is the same as on a trace at rest.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import Overrides, kernel
from vibro_cli.kernels.cluster import clusters, rotating_clusters, trace_forces
from vibro_cli.kernels.cluster.rotating_clusters import replay_group_motion
from vibro_cli.kernels.contact import arc_contact, contact_kinematics, first_contact
from vibro_cli.kernels.contact.contact_kinematics import centre_position, supported
from vibro_cli.kernels.events import event_detection, event_loop, liftoff_slip
from vibro_cli.kernels.events.event_detection import CAUTION, ahead
from vibro_cli.kernels.flow import flight, flow, rotating_flight, rotating_flow
from vibro_cli.kernels.flow.flight import (
    LEAST_SIZE,
    SLOW,
    launch_and_log,
    start_from_state,
    take_energy,
)
from vibro_cli.kernels.flow.flow import POLYNOMIAL, angle_from_start
from vibro_cli.kernels.flow.rotating_flight import (
    potential,
    rise_on_line,
    saddle_beside,
    saddle_height,
    set_track,
    specific_potential,
)
from vibro_cli.kernels.flow.rotating_flow import (
    fall_from_saddle,
    half_way,
    squared_rate_ahead,
    torque,
)
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.statistics import rotating_forces, run_statistics
from vibro_cli.kernels.tangent import flight_jacobian, rotating_jacobian
from vibro_cli.kernels.world import (
    Flight,
    FlightRow,
    PairTrack,
    TrackData,
    World,
    track_of,
    track_on,
)


@kernel
def project(flight: Flight, s: float, c: float, p: float) -> tuple[float, float, float]:
    """Return the nearest state with ``S^2 + C^2 = 1`` and the flight's energy (first order)."""
    scale = 1.5 - 0.5 * (s * s + c * c)
    s *= scale
    c *= scale
    along = -0.5 * torque(flight.tilt, flight.spread, s, c)
    size = p * p + along * along
    if size < LEAST_SIZE:
        return s, c, p
    sine, cosine = angle_from_start(flight, s, c)
    defect = 0.5 * (squared_rate_ahead(flight, sine, cosine) - p * p) / size
    turn = along * defect
    return s + c * turn, c - s * turn, p + p * defect


@kernel
def begin_rotating_flight(world: World, ball: int, cause: int, from_state: int) -> None:
    """Set the constants of a flight from its start, then launch and log it.

    With ``from_state`` 1 the energy follows from the state. Otherwise ``P`` follows from the
    carried energy: the energy of the state differs from it by a rounding that would add up from
    flight to flight.
    """
    flight = world.flights[ball]
    track = track_of(world, ball)
    if from_state == 1:
        take_energy(world, ball)
    else:
        flight.p = rate_by_energy(world, ball, flight, track)
    start_from_state(flight)
    flight.saddle_root = root_on_piece(world, ball)
    set_track(flight, track)
    launch_and_log(world, ball, cause)


@kernel
def root_on_piece(world: World, ball: int) -> float:
    """Return the energy relative to the piece's saddle, as ``saddle_root``; NEVER if not carried.

    It is carried to a saddle of another piece only if both are equally high: a difference of
    heights has the rounding that the energy of the state has.
    """
    flight = world.flights[ball]
    track = track_of(world, ball)
    if flight.separatrix_piece < 0:
        return NEVER
    if flight.separatrix_piece == flight.piece:
        return flight.separatrix_root
    other = track_on(world, ball, flight.separatrix_piece)
    if track.path_radius * other.path_radius == 0.0:
        return NEVER  # one is a line
    energy = flight.specific_energy
    if saddle_height(track, energy) != saddle_height(other, energy):
        return NEVER
    return flight.separatrix_root * math.sqrt(other.twice_radius / track.twice_radius)


@kernel
def rate_by_energy(world: World, ball: int, flight: Flight, track: TrackData) -> float:
    """Return ``P`` from the carried energy, with its present sign; a slow body keeps its ``P``.

    The energy relative to a saddle determines ``P`` beside it, where the whole energy does not.
    """
    gravity = world.settings[0].gravity
    kappa = world.bodies[ball].kappa
    root = root_on_piece(world, ball)
    if root < NEVER and track.path_radius == 0.0:
        along = rise_on_line(track, flight.s)
        size = 0.5 * kappa / gravity * along * along
        rise = size - 0.5 * kappa / gravity * root * abs(root)
    elif root < NEVER:
        energy = flight.p * flight.p + potential(track, flight.s, flight.c)
        s, c = saddle_beside(track, energy)
        fall = fall_from_saddle(track.tilt, track.spread, s, c, flight.s, flight.c)
        size = track.twice_radius * fall
        rise = size - track.twice_radius * root * abs(root)
    else:
        size = flight.specific_energy
        rise = size - specific_potential(track, gravity, kappa, flight.s, flight.c)
    if rise <= SLOW * abs(size):
        return flight.p
    p = math.sqrt(2.0 * gravity * rise / kappa) / track.speed_factor
    return p if flight.p > 0.0 else -p


@kernel
def free_acceleration(world: World, ball: int) -> float:
    """Return the tangential acceleration (m/s^2) of a body due to gravity and rotation."""
    flight = world.flights[ball]
    track = track_of(world, ball)
    if supported(flight):
        return 0.0
    if track.path_radius == 0.0:
        return track.line_acceleration + track.line_growth * track.line_growth * flight.s
    force = torque(track.tilt, track.spread, flight.s, flight.c)
    return 0.5 * track.speed_factor * track.frequency * force


@kernel
def kept_apart(a: Flight, b: Flight, contact: PairTrack, laps: int) -> bool:
    """Return whether two oscillations on one arc turn back before the bodies can touch."""
    if a.crests == 0 or a.form == POLYNOMIAL or b.form == POLYNOMIAL:
        return False
    if a.exit_after < NEVER or b.exit_after < NEVER or a.turns_over + b.turns_over != 0:
        return False
    # Half the angle from a to b. A body of a group turns back after the same angle as its pendulum.
    half = math.atan2(a.c * b.s - a.s * b.c, a.c * b.c + a.s * b.s) + laps * math.pi
    between = half - half_way(a, 1.0) - half_way(b, -1.0)
    return between > 0.5 * (math.pi - contact.far_gap) + CAUTION


@kernel
def horizontal_extent(world: World, ball: int) -> tuple[float, float]:
    """Return the least and greatest x (m) of a body's centre on its flight.

    A flight that turns back has the extent of its piece. The extent is infinite in contact, and
    unless x grows along the path.
    """
    flight = world.flights[ball]
    piece = world.pieces[flight.piece]
    track = track_of(world, ball)
    if flight.grouped == 1:
        return -NEVER, NEVER
    if piece.sign == 0.0:
        if piece.tangent_x <= 0.0:
            return -NEVER, NEVER
    elif piece.sign * (0.5 - track.lowest_s2) < 0.0 or piece.sign * (0.5 - track.highest_s2) < 0.0:
        return -NEVER, NEVER
    low, _ = centre_position(piece, track, track.left_s, track.left_c)
    high, _ = centre_position(piece, track, track.right_s, track.right_c)
    return ahead(world, ball, low, high)


@kernel
def replay_flow(track: TrackData, row: FlightRow, flight: Flight) -> None:
    """Set the form and the constants of a flow from its start."""
    flight.saddle_root = row.saddle_root
    if row.grouped == 0:
        set_track(flight, track)
    else:
        replay_group_motion(flight, track)


TURNING = Overrides(
    "turning",
    {
        flow.flow: rotating_flow.flow,
        flow.angular_acceleration: rotating_flow.angular_acceleration,
        flow.acceleration_slopes: rotating_flow.acceleration_slopes,
        flow.angular_jerk: rotating_flow.angular_jerk,
        flow.tangential_acceleration: rotating_flow.tangential_acceleration,
        flow.small_step: rotating_flow.small_step,
        flow.quickness: rotating_flow.quickness,
        flow.flow_of_two: rotating_flow.flow_of_two,
        flow.time_of_flight: rotating_flow.time_of_flight,
        first_contact.displacement: rotating_flow.displacement,
        flight.launch_on_piece: rotating_flight.launch_on_piece,
        flight.specific_energy_of_state: rotating_flight.specific_energy_of_state,
        flight.refer_to_separatrix: rotating_flight.refer_to_separatrix,
        first_contact.most_speed: rotating_flight.most_speed,
        arc_contact.fastest_return: arc_contact.rotating_fastest_return,
        arc_contact.guessed_frequency: arc_contact.rotating_guessed_frequency,
        arc_contact.uneven_torque: arc_contact.rotating_uneven_torque,
        flight.begin_flight: begin_rotating_flight,
        flight.project: project,
        event_loop.rate_by_energy: rate_by_energy,
        contact_kinematics.free_acceleration: free_acceleration,
        clusters.launch_group_on_line: rotating_clusters.launch_group_on_line,
        clusters.set_group_flow: rotating_clusters.set_group_flow,
        clusters.set_release: rotating_clusters.set_release,
        clusters.limit_by_lift_off: rotating_clusters.limit_by_lift_off,
        event_detection.kept_apart: kept_apart,
        event_detection.horizontal_extent: horizontal_extent,
        flow.replay_flow: replay_flow,
        flow.height_of: rotating_flight.specific_potential,
        trace_forces.pendulum_at: rotating_clusters.pendulum_at,
        trace_forces.fit_forces: rotating_clusters.fit_forces,
        liftoff_slip.rotates: rotating_forces.rotates,
        liftoff_slip.orbit_period: rotating_forces.orbit_period,
        liftoff_slip.turning_courses: rotating_forces.turning_courses,
        liftoff_slip.look_at_one: rotating_forces.look_at_one,
        liftoff_slip.normal_of_one: rotating_forces.normal_of_one,
        liftoff_slip.limit_courses: rotating_forces.limit_courses,
        run_statistics.update_statistics_alone: rotating_forces.update_statistics_alone,
        run_statistics.pendulum_range: rotating_forces.pendulum_range,
        run_statistics.extremes_on_arc: rotating_forces.extremes_on_arc,
        flight_jacobian.flight_jacobian: rotating_jacobian.flight_jacobian,
    },
)
