"""A body at a wall: whether it touches it, and its rest against it.

A wall is a body of infinite mass at the end of a chain. What decides whether a body stays at it is
what decides on the contact of two bodies (see ``kernels.cluster.contact_changes``).
"""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.contact.contact_kinematics import (
    centre_position,
    free_acceleration,
    set_speed,
)
from vibro_cli.kernels.flow.flight import AT_END, is_at
from vibro_cli.kernels.world import NEVER, FlightRow, World

# Height of a bounce that is lost in rounding, as a share of the size of the places.
BOUNCE_ROUNDING = 16.0 * 2.220446049250313e-16


@kernel
def touched_wall(world: World, ball: int) -> int:
    """The side (-1 left, +1 right) of the wall that a body touches, or 0."""
    settings = world.settings[0]
    if settings.closed == 1:
        return 0
    flight = world.flights[ball]
    track = world.tracks[ball * settings.pieces + flight.piece]
    first = ball == 0 and flight.piece == 0 and settings.left_wall >= 0.0
    last = ball == settings.bodies - 1 and flight.piece == settings.pieces - 1
    last = last and settings.right_wall >= 0.0
    if first and _is_at_end(flight.s, flight.c, track.left_s, track.left_c, track.path_radius):
        return -1
    if last and _is_at_end(flight.s, flight.c, track.right_s, track.right_c, track.path_radius):
        return 1
    return 0


@kernel
def stand_at_wall(world: World, ball: int, side: int) -> None:
    """Put a body that touches a wall where it touches it, so that it meets it at once or not."""
    flight = world.flights[ball]
    track = world.tracks[ball * world.settings[0].pieces + flight.piece]
    flight.s = track.right_s if side > 0 else track.left_s
    flight.c = track.right_c if side > 0 else track.left_c


@kernel
def touches_dissipative_wall(world: World, ball: int) -> bool:
    """Tell whether a body touches a wall that takes energy."""
    side = touched_wall(world, ball)
    settings = world.settings[0]
    restitution = settings.right_wall if side > 0 else settings.left_wall
    return side != 0 and restitution < 1.0


@kernel
def _is_at_end(s: float, c: float, end_s: float, end_c: float, path_radius: float) -> bool:
    """Tell whether a place is an end of its piece, up to rounding."""
    if path_radius == 0.0:
        return abs(s - end_s) <= AT_END * (1.0 + abs(end_s))
    return is_at(s, c, end_s, end_c)


@kernel
def lost_height(world: World, ball: int) -> float:
    """Height (m) of a bounce that is lost in the rounding of the body's place."""
    flight = world.flights[ball]
    track = world.tracks[ball * world.settings[0].pieces + flight.piece]
    x, y = centre_position(world.pieces[flight.piece], track, flight.s, flight.c)
    return BOUNCE_ROUNDING * (abs(x) + abs(y) + world.bodies[ball].radius)


@kernel
def bounce_is_lost(world: World, ball: int, side: int) -> bool:
    """Tell whether a body alone is pressed to a wall and its next bounce is lost in rounding."""
    set_speed(world, ball)
    speed = world.flights[ball].speed
    pull = free_acceleration(world, ball) * side
    return pull > 0.0 and speed * speed <= 2.0 * pull * lost_height(world, ball)


@kernel
def last_row_of(world: World, ball: int) -> FlightRow:
    """Return the row of a flight that has just been logged."""
    last = world.clock[0].flight_rows - 1
    while world.log[last].body != ball:
        last -= 1
    return world.log[last]


@kernel
def rest(world: World, ball: int, side: int) -> None:
    """Let a body that has just been launched rest, pressed to a wall or to a row at one."""
    flight = world.flights[ball]
    flight.at_rest = 1
    flight.wall_side = side
    flight.exit_after = NEVER
    flight.exit_t = NEVER
    flight.exit_t_low = 0.0
    flight.angular_bound = 0.0
    flight.jerk_bound = 0.0
    flight.acceleration_bound = 0.0
    last_row_of(world, ball).at_rest = 1
    for j in range(world.settings[0].pairs):
        pair = world.pairs[j]
        if pair.held == 1 and (pair.a == ball or pair.b == ball):
            pair.release_t = NEVER
