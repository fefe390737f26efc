"""The event loop on a trace that turns about a vertical axis: which kernels are replaced by which.

Everything else - events, laws, rows, contacts, walls, tables - is what it is on a trace at rest.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import Overrides, kernel
from vibro_cli.kernels.cluster import cluster_forces as group_forces
from vibro_cli.kernels.cluster import clusters as groups
from vibro_cli.kernels.cluster import rotating_clusters as turning_groups
from vibro_cli.kernels.cluster import rotating_forces, trace_forces
from vibro_cli.kernels.cluster.rotating_clusters import recall_group_motion
from vibro_cli.kernels.contact import arc_contact, bounce
from vibro_cli.kernels.contact import contact_kinematics as touching
from vibro_cli.kernels.contact import first_contact as contact
from vibro_cli.kernels.contact import libration_contact as swing_contact
from vibro_cli.kernels.contact import rotating_contact as turning_contact
from vibro_cli.kernels.contact.contact_kinematics import supported
from vibro_cli.kernels.contact.gap import centre_position
from vibro_cli.kernels.events import event_detection as search
from vibro_cli.kernels.events import event_handlers as changes
from vibro_cli.kernels.events import liftoff_slip, rotating_passages
from vibro_cli.kernels.events.event_detection import CAUTION
from vibro_cli.kernels.flow import begin_flight as flights
from vibro_cli.kernels.flow import flight as launching
from vibro_cli.kernels.flow import flow as flowing
from vibro_cli.kernels.flow import replay as recall
from vibro_cli.kernels.flow import rotating_flight as turning_flight
from vibro_cli.kernels.flow import rotating_flow as turning_flow
from vibro_cli.kernels.flow import rotating_time_of_flight as turning_passage
from vibro_cli.kernels.flow import time_of_flight as passage
from vibro_cli.kernels.flow.begin_flight import launch_and_log, take_energy
from vibro_cli.kernels.flow.rotating_flight import set_track, speed_of_head
from vibro_cli.kernels.flow.rotating_flow import pull
from vibro_cli.kernels.flow.rotating_time_of_flight import half_way
from vibro_cli.kernels.numerics.weierstrass_motion import squared_rate
from vibro_cli.kernels.statistics import cluster_statistics as tally_contact
from vibro_cli.kernels.statistics import rotating_statistics as turning_tally
from vibro_cli.kernels.statistics import run_statistics as tally
from vibro_cli.kernels.structs import NEVER, Flight, PairTrack, PieceData, TrackData
from vibro_cli.kernels.tangent import flight_jacobian as changes_of_flight
from vibro_cli.kernels.tangent import follow as following
from vibro_cli.kernels.tangent import rotating_jacobian as turning_changes
from vibro_cli.kernels.world import FlightRow, World


@kernel
def project(flight: Flight, s: float, c: float, p: float) -> tuple[float, float, float]:
    """Nearest state with ``S^2 + C^2 = 1`` and the flight's own energy (first order)."""
    scale = 1.5 - 0.5 * (s * s + c * c)
    s *= scale
    c *= scale
    along = -0.5 * pull(flight.tilt, flight.spread, s, c)
    size = p * p + along * along
    if size < 1.0e-8:
        return s, c, p
    sine = s * flight.flow_c - c * flight.flow_s
    cosine = c * flight.flow_c + s * flight.flow_s
    defect = 0.5 * (squared_rate(flight, sine, cosine) - p * p) / size
    turn = along * defect
    return s + c * turn, c - s * turn, p + p * defect


@kernel
def never_swings(flight: Flight) -> bool:
    """Tell that a flight is no swing of a pendulum."""
    return False


@kernel
def begin_flight(world: World, ball: int, cause: int, from_state: int) -> None:
    """Launch and log the flight whose state is set; its constants follow from its start."""
    world.flights[ball].anchor = -1
    if from_state == 1:
        take_energy(world, ball)
    launch_and_log(world, ball, cause)


@kernel
def begin_two_flights(
    world: World, ball: int, other: int, cause: int, from_state: int, other_from_state: int
) -> None:
    """Do what :func:`begin_flight` does for two bodies, one after the other."""
    begin_flight(world, ball, cause, from_state)
    begin_flight(world, other, cause, other_from_state)


@kernel
def rate_by_energy(world: World, ball: int, flight: Flight, track: TrackData) -> float:
    """``P`` at the end of a piece from the carried energy, with the sign of the present ``P``."""
    return speed_of_head(flight, world.bodies[ball], track, world.settings[0].gravity)


@kernel
def free_acceleration(world: World, ball: int) -> float:
    """Tangential acceleration (m/s^2) of a body under gravity and the turning of the trace."""
    flight = world.flights[ball]
    track = world.tracks[ball * world.settings[0].pieces + flight.piece]
    if supported(flight):
        return 0.0
    if track.path_radius == 0.0:
        return track.line_acceleration + track.line_growth * track.line_growth * flight.s
    force = pull(track.tilt, track.spread, flight.s, flight.c)
    return 0.5 * track.speed_factor * track.frequency * force


@kernel
def parts_of_weight(world: World, x: float, sine: float, cosine: float) -> tuple[float, float]:
    """Gravity and what turning adds at a place ``x`` (m), back along a slope and onto it."""
    settings = world.settings[0]
    away = settings.turning_square * (x - settings.axis_x)
    return settings.gravity * sine - away * cosine, settings.gravity * cosine + away * sine


@kernel
def kept_apart(a: Flight, b: Flight, contact: PairTrack, laps: int) -> bool:
    """Tell whether two oscillations on one arc, each in a well of its own, never meet."""
    if laps != 0 or a.grouped + b.grouped != 0:
        return False
    if a.exit_after < NEVER or b.exit_after < NEVER or a.turns_over + b.turns_over != 0:
        return False
    if a.crests == 0:
        return False
    sine = b.flow_s * a.flow_c - b.flow_c * a.flow_s
    cosine = b.flow_c * a.flow_c + b.flow_s * a.flow_s
    between = math.atan2(sine, cosine) - half_way(a, 1.0) - half_way(b, -1.0)
    return between > 0.5 * (math.pi - contact.far_gap) + CAUTION


@kernel
def horizontal_extent(flight: Flight, piece: PieceData, track: TrackData) -> tuple[float, float]:
    """Least and greatest x of the centre on a flight, where x grows along its path.

    Of a flight that turns, those of its piece. Else infinite.
    """
    if flight.grouped == 1:
        return -NEVER, NEVER
    if piece.sign == 0.0:
        if piece.tangent_x <= 0.0:
            return -NEVER, NEVER
    elif piece.sign * (0.5 - track.lowest_s2) < 0.0 or piece.sign * (0.5 - track.highest_s2) < 0.0:
        return -NEVER, NEVER
    low, _ = centre_position(piece, track, track.left_s, track.left_c)
    high, _ = centre_position(piece, track, track.right_s, track.right_c)
    here, _ = centre_position(piece, track, flight.s, flight.c)
    if flight.exit_side * flight.flow_p > 0.0:
        if flight.exit_side == 1:
            low = here
        else:
            high = here
    return low, high


@kernel
def recall_flow(track: TrackData, row: FlightRow, flight: Flight) -> None:
    """Set the form and the constants of a flow, which follow from its start."""
    if row.grouped == 0:
        set_track(flight, track)
    else:
        recall_group_motion(flight, track)


TURNING = Overrides(
    "turning",
    {
        flowing.flow: turning_flow.flow,
        flowing.angular_acceleration: turning_flow.angular_acceleration,
        flowing.angular_jerk: turning_flow.angular_jerk,
        flowing.tangential_acceleration: turning_flow.tangential_acceleration,
        flowing.nudge: turning_flow.nudge,
        flowing.swings: never_swings,
        passage.time_to: turning_passage.time_to,
        bounce.displacement: turning_flow.displacement,
        launching.launch_on_piece: turning_flight.launch_on_piece,
        launching.head_from_state: turning_flight.head_from_state,
        launching.anchor_at_crest: turning_flight.anchor_at_crest,
        launching.set_arc_energy: turning_flight.set_arc_energy,
        contact.speed_and_jerk: turning_flight.speed_and_jerk,
        arc_contact.both_swing: turning_contact.are_alone,
        swing_contact.fastest_return: turning_contact.fastest_return,
        swing_contact.guessed_frequency: turning_contact.guessed_frequency,
        swing_contact.uneven_pull: turning_contact.uneven_pull,
        arc_contact.released_step: turning_flight.released_step,
        flights.begin_flight: begin_flight,
        flights.begin_two_flights: begin_two_flights,
        flights.project: project,
        changes.rate_by_energy: rate_by_energy,
        touching.free_acceleration: free_acceleration,
        touching.parts_of_weight: parts_of_weight,
        groups.launch_group_on_line: turning_groups.launch_group_on_line,
        groups.set_group_flow: turning_groups.set_group_flow,
        group_forces.set_release: turning_groups.set_release,
        group_forces.limit_by_lift_off: turning_groups.limit_by_lift_off,
        search.kept_apart: kept_apart,
        search.horizontal_extent: horizontal_extent,
        recall.recall_flow: recall_flow,
        recall.energy_of_row: turning_flight.energy_of_row,
        trace_forces.pendulum_at: rotating_forces.pendulum_at,
        trace_forces.fit_forces: rotating_forces.fit_forces,
        liftoff_slip.rotates: rotating_passages.rotates,
        liftoff_slip.orbit_period: rotating_passages.orbit_period,
        liftoff_slip.turning_courses: rotating_passages.turning_courses,
        liftoff_slip.look_at_one: rotating_passages.look_at_one,
        liftoff_slip.normal_of_one: rotating_passages.normal_of_one,
        liftoff_slip.limit_courses: rotating_passages.limit_courses,
        tally.tally_alone: turning_tally.tally_alone,
        tally_contact.turning_time: turning_tally.turning_time_on_line,
        tally_contact.pendulum_range: turning_tally.pendulum_range,
        tally_contact.extremes_on_arc: turning_tally.extremes_on_arc,
        changes_of_flight.flight_jacobian: turning_changes.flight_jacobian,
        following.leans: turning_changes.leans,
    },
)
