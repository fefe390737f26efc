"""The event loop: to the next event, carry it out, again."""

from __future__ import annotations

from vibro_cli.mechanics.records import NEVER
from vibro_cli.numerics.double import time_between
from vibro_cli.numerics.engine import kernel
from vibro_cli.simulation.changes import begin_flight, collide, leave_piece
from vibro_cli.simulation.search import first_contact
from vibro_cli.simulation.world import (
    END_NO_MORE_COLLISIONS,
    END_REST,
    END_TIME,
    LOG_FULL,
    RUNNING,
    START,
    World,
)


@kernel
def start(world: World) -> None:
    """Launch the first flight of every body from the initial states."""
    for ball in range(world.settings[0].bodies):
        begin_flight(world, ball, START, 1)


@kernel
def advance(world: World, impact_rows: int, flight_rows: int) -> int:
    """Run until an end cause, or until a log has no room for another event.

    Parameters
    ----------
    world
        The whole run; changed in place.
    impact_rows, flight_rows
        Room in the logs.

    Returns
    -------
    One of the causes of ``simulation.world``.
    """
    settings = world.settings[0]
    clock = world.clock[0]
    room_for_event = 2 * settings.bodies + 2
    while True:
        if clock.impact_rows + room_for_event > impact_rows:
            return LOG_FULL
        if clock.flight_rows + room_for_event > flight_rows:
            return LOG_FULL
        ball = _first_exit(world)
        horizon_t = settings.stop_t
        horizon_low = 0.0
        if ball >= 0 and world.flights[ball].exit_t < NEVER:
            flight = world.flights[ball]
            if time_between(flight.exit_t, flight.exit_t_low, horizon_t, 0.0) <= 0.0:
                horizon_t = flight.exit_t
                horizon_low = flight.exit_t_low
            else:
                ball = -1
        else:
            ball = -1
        pair = first_contact(world, horizon_t, horizon_low)
        if pair >= 0:
            cause = collide(world, pair)
        elif ball >= 0:
            cause = leave_piece(world, ball)
        else:
            return _finish(world)
        if cause != RUNNING:
            return cause


@kernel
def _finish(world: World) -> int:
    """End a run without a further event before its stop time, if it has one."""
    settings = world.settings[0]
    clock = world.clock[0]
    quiet = True
    resting = True
    for ball in range(settings.bodies):
        quiet = quiet and world.flights[ball].exit_t == NEVER
        resting = resting and world.flights[ball].at_rest == 1
    for j in range(settings.pairs):
        quiet = quiet and world.pairs[j].apart == 1
    if quiet:
        clock.quiet_t = clock.t
    if settings.stop_t < NEVER:
        clock.t = settings.stop_t
        clock.t_low = 0.0
        return END_TIME
    return END_REST if resting else END_NO_MORE_COLLISIONS


@kernel
def _first_exit(world: World) -> int:
    """The body whose flight ends first, or -1."""
    first = -1
    t = NEVER
    t_low = 0.0
    for ball in range(world.settings[0].bodies):
        flight = world.flights[ball]
        if time_between(flight.exit_t, flight.exit_t_low, t, t_low) < 0.0:
            first = ball
            t = flight.exit_t
            t_low = flight.exit_t_low
    return first
