"""Beginning and logging flights, and the states of bodies at an instant."""

from __future__ import annotations

from vibro_cli.compile.kernel import SERIES_LENGTH, kernel
from vibro_cli.compile.lanes import choose
from vibro_cli.kernels.flow.flight import (
    energy_of_state,
    energy_on_piece,
    launch,
    measure_energy,
)
from vibro_cli.kernels.flow.flow import flow
from vibro_cli.kernels.numerics.elliptic import set_theta_constants, set_two_theta_constants
from vibro_cli.kernels.numerics.error_free import time_between
from vibro_cli.kernels.structs import NEVER, Flight
from vibro_cli.kernels.world import World

# Where ``P^2 + (SC)^2`` is below this, energy says nothing of where a state on the circle is.
LEAST_SIZE = 1.0e-8
# A way below this share of the places is lost in their rounding.
NOWHERE = 16.0 * 2.220446049250313e-16


@kernel
def begin_flight(world: World, ball: int, cause: int, from_state: int) -> None:
    """Launch and log the flight whose state is set; its energy from the state or as carried."""
    flight = world.flights[ball]
    if world.pieces[flight.piece].sign != 0.0:
        m, root = _arc_energy(world, ball, from_state)
        set_theta_constants(flight, m, root)
    elif from_state == 1:
        take_energy(world, ball)
    launch_and_log(world, ball, cause)


@kernel
def begin_two_flights(
    world: World, ball: int, other: int, cause: int, from_state: int, other_from_state: int
) -> None:
    """Do what :func:`begin_flight` does for two bodies, one after the other."""
    flight = world.flights[ball]
    other_flight = world.flights[other]
    if world.pieces[flight.piece].sign == 0.0 or world.pieces[other_flight.piece].sign == 0.0:
        begin_flight(world, ball, cause, from_state)
        begin_flight(world, other, cause, other_from_state)
        return
    m, root = _arc_energy(world, ball, from_state)
    other_m, other_root = _arc_energy(world, other, other_from_state)
    set_two_theta_constants(flight, m, root, other_flight, other_m, other_root)
    launch_and_log(world, ball, cause)
    launch_and_log(world, other, cause)


@kernel
def take_energy(world: World, ball: int) -> None:
    """Measure the energy of a body in its state."""
    settings = world.settings[0]
    flight = world.flights[ball]
    track = world.tracks[ball * settings.pieces + flight.piece]
    measure_energy(flight, world.bodies[ball], track, settings.gravity)


@kernel
def _arc_energy(world: World, ball: int, from_state: int) -> tuple[float, float]:
    """Parameter and root of its complement of the flight that begins on an arc."""
    flight = world.flights[ball]
    if from_state == 1:
        take_energy(world, ball)
        return energy_of_state(flight.s, flight.c, flight.p)
    pieces = world.settings[0].pieces
    anchor = flight.anchor if flight.anchor >= 0 else flight.piece
    track = world.tracks[ball * pieces + flight.piece]
    return energy_on_piece(flight, track, world.tracks[ball * pieces + anchor])


@kernel
def launch_and_log(world: World, ball: int, cause: int) -> None:
    """Launch the flight whose state and constants are set, and log it."""
    settings = world.settings[0]
    flight = world.flights[ball]
    track = world.tracks[ball * settings.pieces + flight.piece]
    piece = world.pieces[flight.piece]
    launch(flight, world.bodies[ball], piece, track, settings.one_sided)
    log_flight(world, ball, cause)


@kernel
def log_flight(world: World, ball: int, cause: int) -> None:
    """Log the flight of a body and forget what was known of its contacts to come."""
    settings = world.settings[0]
    flight = world.flights[ball]
    clock = world.clock[0]
    row = world.log[clock.flight_rows]
    row.body = ball
    row.piece = flight.piece
    row.lap = flight.lap
    row.t = flight.t
    row.t_low = flight.t_low
    row.s = flight.s
    row.c = flight.c
    row.p = flight.p
    row.before_s = flight.before_s
    row.before_c = flight.before_c
    row.before_p = flight.before_p
    row.parameter = flight.parameter
    row.root_complement = flight.root_complement
    row.head = flight.head
    row.cause = cause
    row.exit_kind = flight.exit_kind
    row.at_rest = flight.at_rest
    row.grouped = flight.grouped
    if flight.grouped != 0:
        _log_group(world, flight)
    clock.flight_rows += 1
    if ball < settings.pairs:
        _forget(world, ball, flight)
    if settings.closed == 1 or ball > 0:
        left = (ball - 1) % settings.bodies
        if left < settings.pairs:
            _forget(world, left, flight)


@kernel
def _log_group(world: World, flight: Flight) -> None:
    """Log what a flight in lasting contact needs beyond its own state."""
    clock = world.clock[0]
    row = world.log[clock.flight_rows]
    row.group_first = flight.group_first
    row.group_count = flight.group_count
    row.flow_s = flight.flow_s
    row.flow_c = flight.flow_c
    row.flow_p = flight.flow_p
    row.shift_s = flight.shift_s
    row.shift_c = flight.shift_c
    row.rate_ratio = flight.rate_ratio
    row.frequency = flight.frequency
    row.line_acceleration = flight.line_acceleration
    row.segment = flight.segment
    if flight.segment > 0.0:
        segment = world.segments[clock.segment_rows]
        segment.flight = clock.flights_before + clock.flight_rows
        for k in range(SERIES_LENGTH):
            segment.series[k] = flight.series[k]
        clock.segment_rows += 1


@kernel
def _forget(world: World, j: int, flight: Flight) -> None:
    pair = world.pairs[j]
    pair.contact_t = NEVER
    pair.contact_t_low = 0.0
    pair.apart = 0
    pair.touching = 0
    pair.searched = 0.0
    pair.begin_t = flight.t
    pair.begin_t_low = flight.t_low


@kernel
def project(flight: Flight, s: float, c: float, p: float) -> tuple[float, float, float]:
    """Nearest state with ``S^2 + C^2 = 1`` and the flight's own energy (first order)."""
    scale = 1.5 - 0.5 * (s * s + c * c)
    s *= scale
    c *= scale
    sc = s * c
    size = p * p + sc * sc
    if size < LEAST_SIZE:
        return s, c, p
    return projected(flight, s, c, p, sc, size)


@kernel
def projected(
    flight: Flight, s: float, c: float, p: float, sc: float, size: float
) -> tuple[float, float, float]:
    """Do what :func:`project` does for a state on the circle, given ``SC`` and ``P^2 + (SC)^2``."""
    root = flight.root_complement
    lack = choose(
        s * s > 0.5, (c - p) * (c + p) - root * abs(root), flight.parameter - s * s - p * p
    )
    defect = 0.5 * lack / size
    turn = sc * defect
    return s + c * turn, c - s * turn, p + p * defect


@kernel
def state_at(world: World, ball: int, t: float, t_low: float) -> tuple[float, float, float]:
    """State ``(S, C, P)`` of a body at an instant of its present flight."""
    flight = world.flights[ball]
    age = time_between(t, t_low, flight.t, flight.t_low)
    if age == 0.0 or flight.at_rest == 1:
        return flight.s, flight.c, flight.p
    s, c, p = flow(flight, age)
    if flight.own_frequency > 0.0 and flight.grouped == 0:
        return project(flight, s, c, p)
    return s, c, p


@kernel
def bring_to(world: World, ball: int, t: float, t_low: float) -> None:
    """Put a body into its state at an instant; its flight must be launched anew after that."""
    flight = world.flights[ball]
    s, c, p = state_at(world, ball, t, t_low)
    place_at(flight, t, t_low, s, c, p)


@kernel
def is_same_instant(flight: Flight, t: float, t_low: float, s: float, c: float) -> bool:
    """Tell whether a flight that ends at a place has gone nowhere: all its motion is rounding.

    Its end is of the instant of its start, then. A light body between a wall and a heavy one that
    is pressed to it goes to and fro like that, and the gaps it leaves close no more.
    """
    age = time_between(t, t_low, flight.t, flight.t_low)
    if age == 0.0:
        return True
    if age > flight.brief:
        return False
    if flight.own_frequency > 0.0:
        return abs(s * flight.c - c * flight.s) <= NOWHERE
    return abs(s - flight.s) <= NOWHERE * (1.0 + abs(s))


@kernel
def place_at(flight: Flight, t: float, t_low: float, s: float, c: float, p: float) -> None:
    """End a flight in a state, from which the next one starts."""
    if (flight.impacts > 0 or flight.fastest > 0.0) and not is_same_instant(flight, t, t_low, s, c):
        flight.impacts = 0
        flight.fastest = 0.0
    flight.t = t
    flight.t_low = t_low
    flight.s = s
    flight.c = c
    flight.p = p
    flight.before_s = s
    flight.before_c = c
    flight.before_p = p
