"""Rest against a wall: where the bounces of a body, or of a group, are lost in rounding.

Bounces at a wall accumulate like those of two bodies, and those of a row of bodies against a wall
accumulate together. What is left out here is lower than the rounding of the places.
"""

from __future__ import annotations

from vibro_cli.mechanics.gap import centre_position
from vibro_cli.mechanics.records import NEVER
from vibro_cli.numerics.engine import kernel
from vibro_cli.simulation.accumulation import EPSILON
from vibro_cli.simulation.contact_changes import launch_chain, relaunch_run
from vibro_cli.simulation.flights import begin_flight, bring_to, state_at
from vibro_cli.simulation.rows import hold
from vibro_cli.simulation.touching import (
    free_acceleration,
    present_acceleration,
    present_gap,
    set_normals,
    set_speed,
)
from vibro_cli.simulation.world import WALL, World

# Height of a bounce that is lost in rounding, as a share of the size of the places.
BOUNCE_ROUNDING = 16.0 * EPSILON
# Speeds and gaps of a neighbour count as lost up to this many times as large.
NEIGHBOUR = 16.0


@kernel
def rests_at_wall(world: World, ball: int, right: bool) -> bool:
    """Tell whether a body is pressed to a wall and its next bounce is lost in rounding."""
    set_speed(world, ball)
    speed = world.flights[ball].speed
    pull = _pull(world, ball, right)
    return pull > 0.0 and speed * speed <= 2.0 * pull * _lost_height(world, ball)


@kernel
def _pull(world: World, ball: int, right: bool) -> float:
    """Acceleration (m/s^2) of a body towards the wall."""
    pull = free_acceleration(world, ball)
    return pull if right else -pull


@kernel
def _lost_height(world: World, ball: int) -> float:
    """Height (m) of a bounce that is lost in the rounding of the body's place."""
    flight = world.flights[ball]
    track = world.tracks[ball * world.settings[0].pieces + flight.piece]
    x, y = centre_position(world.pieces[flight.piece], track, flight.s, flight.c)
    return BOUNCE_ROUNDING * (abs(x) + abs(y) + world.bodies[ball].radius)


@kernel
def rest_at_wall(world: World, ball: int, right: bool) -> None:
    """Let a body rest at a wall, with the neighbours that have come to rest against it."""
    settings = world.settings[0]
    flight = world.flights[ball]
    flight.p = 0.0
    flight.speed = 0.0
    height = _lost_height(world, ball)
    count = 0
    while count < settings.bodies - 1:
        inner = ball - count - 1 if right else ball + count + 1
        j = inner if right else inner - 1
        if inner < 0 or inner >= settings.bodies:
            break
        if not _neighbour_rests(world, inner, right, flight.t, flight.t_low, height):
            break
        bring_to(world, inner, flight.t, flight.t_low)
        gap, _ = present_gap(world, j)
        if gap > NEIGHBOUR * height:
            break
        set_normals(world, j)
        hold(world, j, 1, 0.0)
        world.flights[inner].p = 0.0
        world.flights[inner].speed = 0.0
        count += 1
    if count == 0:
        begin_flight(world, ball, WALL, 1)
        _rest(world, ball, right)
        return
    first = ball - count if right else ball
    launch_chain(world, first, count, WALL)
    for step in range(count + 1):
        _rest(world, first + step, right)


@kernel
def _neighbour_rests(
    world: World, ball: int, right: bool, t: float, t_low: float, height: float
) -> bool:
    """Tell whether a body is pressed towards the wall with a speed lost in rounding."""
    flight = world.flights[ball]
    track = world.tracks[ball * world.settings[0].pieces + flight.piece]
    if flight.grouped == 1:
        return False
    _, _, p = state_at(world, ball, t, t_low)
    speed = track.speed_factor * p
    pull = _pull(world, ball, right)
    return pull > 0.0 and speed * speed <= 2.0 * NEIGHBOUR * pull * height


@kernel
def group_stops(world: World, first: int, count: int) -> bool:
    """Tell whether every motion of a group at a wall is lost in rounding."""
    settings = world.settings[0]
    fastest = 0.0
    least_height = NEVER
    force = 0.0
    greatest = 0.0
    for step in range(count + 1):
        member = (first + step) % settings.bodies
        set_speed(world, member)
        fastest = max(fastest, abs(world.flights[member].speed))
        least_height = min(least_height, _lost_height(world, member))
        pull = free_acceleration(world, member)
        force += world.bodies[member].rolling_mass * pull
        greatest = max(greatest, abs(pull))
    mass = 0.0
    for step in range(count + 1):
        mass += world.bodies[(first + step) % settings.bodies].rolling_mass
    # Where the bodies balance, what is left of their pull is rounding.
    pull = max(abs(force) / mass, EPSILON * greatest)
    return fastest * fastest <= 2.0 * pull * NEIGHBOUR * least_height


@kernel
def stop_group(world: World, first: int, count: int, ball: int, right: bool) -> None:
    """Stop a group whose body ``ball`` is at a wall; pressed to it, it comes to rest there."""
    bodies = world.settings[0].bodies
    for step in range(count + 1):
        world.flights[(first + step) % bodies].p = 0.0
    relaunch_run(world, first, count, WALL)
    pull = present_acceleration(world, ball)
    if (pull if right else -pull) <= 0.0:
        return
    flight = world.flights[ball]
    if flight.grouped == 0:
        _rest(world, ball, right)
        return
    start = flight.group_first
    for step in range(flight.group_count):
        _rest(world, (start + step) % bodies, right)


@kernel
def _rest(world: World, ball: int, right: bool) -> None:
    flight = world.flights[ball]
    flight.at_rest = 1
    flight.wall_side = 1 if right else -1
    flight.exit_after = NEVER
    flight.exit_t = NEVER
    flight.exit_t_low = 0.0
    flight.angular_bound = 0.0
    flight.jerk_bound = 0.0
    flight.acceleration_bound = 0.0
    last = world.clock[0].flight_rows - 1
    while world.log[last].body != ball:
        last -= 1
    world.log[last].at_rest = 1
    for j in range(world.settings[0].pairs):
        pair = world.pairs[j]
        if pair.held == 1 and (pair.a == ball or pair.b == ball):
            pair.release_t = NEVER
