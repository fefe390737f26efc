"""Beginning and logging flights, and the states of bodies at an instant."""

from __future__ import annotations

from vibro_cli.mechanics.flight import (
    launch,
    measure_energy,
    set_arc_energy,
    set_arc_energy_from_state,
)
from vibro_cli.mechanics.flow import flow
from vibro_cli.mechanics.records import NEVER, Flight
from vibro_cli.numerics.double import time_between
from vibro_cli.numerics.engine import SERIES_LENGTH, kernel
from vibro_cli.simulation.world import World


@kernel
def begin_flight(world: World, ball: int, cause: int, from_state: int) -> None:
    """Launch and log the flight whose state is set; its energy from the state or as carried."""
    settings = world.settings[0]
    flight = world.flights[ball]
    body = world.bodies[ball]
    piece = world.pieces[flight.piece]
    track = world.tracks[ball * settings.pieces + flight.piece]
    if from_state == 1:
        measure_energy(flight, body, track, settings.gravity)
    if piece.sign != 0.0:
        if from_state == 1:
            set_arc_energy_from_state(flight)
        else:
            anchor = flight.anchor if flight.anchor >= 0 else flight.piece
            set_arc_energy(flight, track, world.tracks[ball * settings.pieces + anchor])
    launch(flight, body, piece, track, settings.one_sided)
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
    pair.apart = 0
    pair.touching = 0
    pair.bouncing = 0
    pair.clear_t = flight.t
    pair.clear_t_low = flight.t_low


@kernel
def project(flight: Flight, s: float, c: float, p: float) -> tuple[float, float, float]:
    """Nearest state with ``S^2 + C^2 = 1`` and the flight's own energy (first order)."""
    scale = 1.5 - 0.5 * (s * s + c * c)
    s *= scale
    c *= scale
    sc = s * c
    size = p * p + sc * sc
    if size < 1.0e-8:
        return s, c, p
    if s * s > 0.5:
        root = flight.root_complement
        defect = 0.5 * ((c - p) * (c + p) - root * abs(root)) / size
    else:
        defect = 0.5 * (flight.parameter - s * s - p * p) / size
    turn = sc * defect
    return s + c * turn, c - s * turn, p + p * defect


@kernel
def state_at(world: World, ball: int, t: float, t_low: float) -> tuple[float, float, float]:
    """State ``(S, C, P)`` of a body at an instant of its present flight."""
    flight = world.flights[ball]
    age = time_between(t, t_low, flight.t, flight.t_low)
    if age == 0.0:
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
def place_at(flight: Flight, t: float, t_low: float, s: float, c: float, p: float) -> None:
    """End a flight in a state, from which the next one starts."""
    flight.t = t
    flight.t_low = t_low
    flight.s = s
    flight.c = c
    flight.p = p
    flight.before_s = s
    flight.before_c = c
    flight.before_p = p
