"""The event loop on a trace that turns about a vertical axis: which kernels are replaced by which.

Everything else - events, laws, rows, contacts, walls, tables - is what it is on a trace at rest. A
group in lasting contact is integrated segment by segment (``simulation.across``) on one piece too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

from vibro_cli.mechanics import (
    arc_contact,
    bounce,
    contact,
    passage,
    turning_flight,
    turning_flow,
)
from vibro_cli.mechanics import flight as launching
from vibro_cli.mechanics import flow as flowing
from vibro_cli.mechanics.gap import centre_position
from vibro_cli.mechanics.records import NEVER, Flight, PairTrack, PieceData, TrackData
from vibro_cli.mechanics.system import System
from vibro_cli.mechanics.turning_flight import half_way, potential_head, set_track, speed_of_head
from vibro_cli.mechanics.turning_flow import pull
from vibro_cli.numerics import engine
from vibro_cli.numerics.engine import Variant, kernel
from vibro_cli.numerics.quartic import period_of, squared_rate
from vibro_cli.numerics.trigonometry import sine_cosine
from vibro_cli.simulation import changes, flights, groups, recall, search, tally, touching
from vibro_cli.simulation.across import launch_across
from vibro_cli.simulation.flights import launch_and_log, take_energy
from vibro_cli.simulation.recall import recall_flight
from vibro_cli.simulation.search import CAUTION
from vibro_cli.simulation.tally import Outcome
from vibro_cli.simulation.touching import supported
from vibro_cli.simulation.world import FlightRow, World

Function = TypeVar("Function", bound=Callable[..., Any])


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
    set_track(flight, track)


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
def tally_forces(
    world: World,
    number: int,
    last: int,
    duration: float,
    end: tuple[float, float, float],
    outcome: Outcome,
    scratch: Flight,
) -> None:
    """Count in the normal forces of one flight; the demand of friction is not known.

    On an arc they are least at an end, where the body turns, or at a place of the arc that does
    not depend on the energy. With lasting contact they are not known either.
    """
    outcome.most_demand = math.inf
    row = world.log[number]
    if row.grouped != 0:
        # Nothing is less than this, nor compares with it: the least force stays unknown.
        outcome.least_force = math.nan
        return
    body = world.bodies[row.body]
    piece = world.pieces[row.piece]
    track = world.tracks[row.body * world.settings[0].pieces + row.piece]
    recall_flight(world, row, number, scratch)
    end_s, _, _ = end
    if track.path_radius == 0.0:
        force = min(line_force(world, row, row.s), line_force(world, row, end_s))
        if force < outcome.least_force:
            outcome.least_force = force
        return
    low, high = _half_range(scratch, end, duration)
    sign = body.weight * piece.sign
    for place in range(track.extreme_count + 2):
        half = low if place == 0 else high
        if place > 1:
            s = track.extremes[2 * place - 4]
            c = track.extremes[2 * place - 3]
            half = math.atan2(s * row.c - c * row.s, c * row.c + s * row.s)
        if low <= half <= high:
            s, c = sine_cosine(half)
            rate = squared_rate(scratch, s, c)
            s, c = row.s * c + row.c * s, row.c * c - row.s * s
            force = sign * arc_share(track, body.kappa, s, c, rate)
            if force < outcome.least_force:
                outcome.least_force = force


@kernel
def arc_share(track: TrackData, kappa: float, s: float, c: float, squared: float) -> float:
    """``N/(m g)``, up to the sign of the arc, of a body at ``(S, C)`` with ``P^2 = squared``."""
    sine = 2.0 * s * c
    cosine = (c - s) * (c + s)
    return cosine + sine * (track.tilt + track.spread * sine) + 4.0 / kappa * squared


@kernel
def line_force(world: World, row: FlightRow, s: float) -> float:
    """Normal force (N) on a line at a distance (m) from its left end."""
    settings = world.settings[0]
    piece = world.pieces[row.piece]
    track = world.tracks[row.body * settings.pieces + row.piece]
    away = track.line_x + piece.tangent_x * s - settings.axis_x
    body = world.bodies[row.body]
    return body.weight * piece.tangent_x + body.mass * settings.turning_square * away * (
        piece.tangent_y
    )


@kernel
def _half_range(
    flight: Flight, end: tuple[float, float, float], duration: float
) -> tuple[float, float]:
    """Half the angles (rad) from its start that a flight on an arc takes in."""
    end_s, end_c, end_p = end
    half = math.atan2(
        end_s * flight.flow_c - end_c * flight.flow_s, end_c * flight.flow_c + end_s * flight.flow_s
    )
    low = min(half, 0.0)
    high = max(half, 0.0)
    if flight.at_rest == 1 or flight.turns_over == 1:
        return low, high
    start_p = flight.flow_p if flight.flow_p != 0.0 else flight.quartic_3
    whole = flight.frequency * duration >= period_of(flight)
    # With equal directions at both ends it has turned twice, or gone straight on.
    twice = whole or (start_p * end_p > 0.0 and half * start_p <= 0.0)
    if twice or (start_p > 0.0 and end_p <= 0.0):
        high = max(high, half_way(flight, 1.0))
    if twice or (start_p < 0.0 and end_p >= 0.0):
        low = min(low, -half_way(flight, -1.0))
    return low, high


TURNING = Variant(
    "turning",
    {
        flowing.flow: turning_flow.flow,
        flowing.angular_acceleration: turning_flow.angular_acceleration,
        flowing.angular_jerk: turning_flow.angular_jerk,
        flowing.tangential_acceleration: turning_flow.tangential_acceleration,
        flowing.nudge: turning_flow.nudge,
        flowing.swings: never_swings,
        passage.time_to: turning_flight.time_to,
        bounce.displacement: turning_flow.displacement,
        launching.launch_on_piece: turning_flight.launch_on_piece,
        launching.head_from_state: turning_flight.head_from_state,
        launching.anchor_at_crest: turning_flight.anchor_at_crest,
        launching.set_arc_energy: turning_flight.set_arc_energy,
        contact._speed_and_jerk: turning_flight.speed_and_jerk,
        arc_contact._released_step: turning_flight.released_step,
        flights.begin_flight: begin_flight,
        flights.begin_two_flights: begin_two_flights,
        flights.project: project,
        changes._rate_by_energy: rate_by_energy,
        touching.free_acceleration: free_acceleration,
        groups.launch_group: launch_across,
        search.kept_apart: kept_apart,
        search._horizontal_extent: horizontal_extent,
        recall.recall_flow: recall_flow,
        tally._energy: energy_of_row,
        tally._tally_forces: tally_forces,
    },
)


def variant_of(system: System) -> Variant | None:
    """Return the variant of the kernels that solves a system; None for a trace at rest."""
    return TURNING if system.turning else None


def kernel_of(system: System, function: Function) -> Function:
    """Return a kernel as the interpreter calls it for a system."""
    return engine.interpreted(function, variant_of(system))
