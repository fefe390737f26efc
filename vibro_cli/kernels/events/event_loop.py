"""The event loop: to the next event, carry it out, again."""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.cluster.contact_changes import count_corrections, launch_chain, settle
from vibro_cli.kernels.contact.contact_kinematics import (
    CONTACT_ROUNDING,
    present_gap,
    set_normals,
    set_speed,
)
from vibro_cli.kernels.events.event_detection import first_contact
from vibro_cli.kernels.events.event_handlers import collide, leave_piece, release
from vibro_cli.kernels.impact.event_log import log_contacts
from vibro_cli.kernels.numerics.double_double import time_between
from vibro_cli.kernels.world import (
    END_NO_MORE_COLLISIONS,
    END_REST,
    END_TIME,
    LOG_FULL,
    NEVER,
    RUNNING,
    START,
    Clock,
    World,
)


@kernel
def start(world: World) -> None:
    """Launch the first flight of every body; bodies that touch and press start in contact."""
    settings = world.settings[0]
    for ball in range(settings.bodies):
        flight = world.flights[ball]
        flight.before_s = flight.s
        flight.before_c = flight.c
        flight.before_p = flight.p
        set_speed(world, ball)
    first = 0
    while first < settings.bodies:
        count = 0
        while first + count < settings.bodies - 1 and _in_contact(world, first + count):
            count += 1
        settle(world, first, count)
        count_corrections(world, first, count)
        launch_chain(world, first, count, START)
        first += count + 1


@kernel
def _in_contact(world: World, j: int) -> bool:
    """Tell whether a pair starts in contact, up to the rounding of the positions."""
    set_normals(world, j)
    gap, size = present_gap(world, j)
    return abs(gap) <= CONTACT_ROUNDING * size


@kernel
def proceed(world: World, starting: bool) -> int:
    """Launch the first flights, or go on with a run; one machine code for both."""
    if starting:
        start(world)
        return RUNNING
    return advance(world)


@kernel
def advance(world: World) -> int:
    """Run until an end cause, or until a log has no room for another event.

    Returns
    -------
    One of the causes of ``kernels.world``.
    """
    settings = world.settings[0]
    clock = world.clock[0]
    while True:
        impacts = max(clock.impact_rows, clock.contact_rows)
        flights = max(clock.flight_rows, clock.segment_rows)
        if max(impacts, flights) > settings.room:
            if settings.keep == 1:
                return LOG_FULL
            drop_rows(clock)
        ball = _first_exit(world)
        pair = _first_release(world) if clock.held_pairs > 0 else -1
        horizon_t = settings.stop_t
        horizon_low = 0.0
        if ball >= 0:
            flight = world.flights[ball]
            if time_between(flight.exit_t, flight.exit_t_low, horizon_t, 0.0) <= 0.0:
                horizon_t = flight.exit_t
                horizon_low = flight.exit_t_low
            else:
                ball = -1
        if pair >= 0:
            held = world.pairs[pair]
            if time_between(held.release_t, held.release_t_low, horizon_t, horizon_low) < 0.0:
                horizon_t = held.release_t
                horizon_low = held.release_t_low
            else:
                pair = -1
        meeting = first_contact(world, horizon_t, horizon_low)
        if meeting >= 0:
            horizon_t = world.pairs[meeting].contact_t
            horizon_low = world.pairs[meeting].contact_t_low
        if clock.unlogged == 1:
            log_contacts(world, horizon_t, horizon_low)
        if meeting >= 0:
            cause = collide(world, meeting)
        elif pair >= 0:
            cause = release(world, pair)
        elif ball >= 0:
            cause = leave_piece(world, ball)
        else:
            return _finish(world)
        if cause != RUNNING:
            return cause


@kernel
def drop_rows(clock: Clock) -> None:
    """Make room in logs that nobody keeps."""
    clock.flights_before += clock.flight_rows
    clock.impact_rows = 0
    clock.flight_rows = 0
    clock.contact_rows = 0
    clock.segment_rows = 0


@kernel
def _first_release(world: World) -> int:
    """The pair in lasting contact that parts first, or -1."""
    first = -1
    t = NEVER
    t_low = 0.0
    for j in range(world.settings[0].pairs):
        pair = world.pairs[j]
        if pair.held == 1 and time_between(pair.release_t, pair.release_t_low, t, t_low) < 0.0:
            first = j
            t = pair.release_t
            t_low = pair.release_t_low
    return first


@kernel
def _finish(world: World) -> int:
    """End a run without a further event before its stop time, if it has one.

    The clock stays at the last event, for a run that is continued from there.
    """
    settings = world.settings[0]
    clock = world.clock[0]
    quiet = True
    resting = True
    for ball in range(settings.bodies):
        quiet = quiet and world.flights[ball].exit_t == NEVER
        resting = resting and world.flights[ball].at_rest == 1
    for j in range(settings.pairs):
        pair = world.pairs[j]
        quiet = quiet and (pair.apart == 1 or (pair.held == 1 and pair.release_t == NEVER))
    if quiet:
        clock.quiet_t = clock.t
    if settings.stop_t < NEVER:
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
