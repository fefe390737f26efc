"""Chains of touching bodies and walls: their extent, simultaneous impacts and contact forces.

The pair of a body and its right neighbour has the body's number. A chain is a run of such pairs,
across the seam of a closed trace too. A wall is a body of infinite mass at the end of a chain:
whether a body stays at it is decided as for the contact of two bodies (see
``kernels.cluster.contact_changes``).
"""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.contact.contact_kinematics import (
    CONTACT_ROUNDING,
    centre_position,
    free_acceleration,
    free_approach,
    mobility,
    set_normals,
    set_speed,
    speed_of_pair,
    surface_gap,
)
from vibro_cli.kernels.flow.flight import AT_END, LIFT_OFF, is_at, set_exit_time, state_at
from vibro_cli.kernels.impact.laws import law_approach, weight_and_response
from vibro_cli.kernels.numerics.constants import EPSILON, NEVER
from vibro_cli.kernels.numerics.double_double import add_to_time
from vibro_cli.kernels.numerics.tridiagonal import solve_from_both_ends
from vibro_cli.kernels.world import (
    Flight,
    FlightRow,
    PairData,
    TrackData,
    World,
    flight_along,
    is_now,
    number_along,
    pair_along,
    pair_beside,
    track_of,
)

# Height of a bounce that is lost in rounding, as a share of the scale of positions.
BOUNCE_ROUNDING = 16.0 * EPSILON


@kernel
def touched_wall(world: World, ball: int) -> int:
    """Return the side (-1 left, +1 right) of the wall that a body touches, or 0."""
    settings = world.settings[0]
    if settings.closed == 1:
        return 0
    flight = world.flights[ball]
    track = track_of(world, ball)
    first = ball == 0 and flight.piece == 0 and settings.left_wall >= 0.0
    last = ball == settings.bodies - 1 and flight.piece == settings.pieces - 1
    last = last and settings.right_wall >= 0.0
    if first and _is_at_end(flight, track, track.left_s, track.left_c):
        return -1
    if last and _is_at_end(flight, track, track.right_s, track.right_c):
        return 1
    return 0


@kernel
def stand_at_wall(world: World, ball: int, side: int) -> None:
    """Place a body that touches a wall exactly at it, so that it meets it at once or not at all."""
    flight = world.flights[ball]
    track = track_of(world, ball)
    flight.s = track.right_s if side > 0 else track.left_s
    flight.c = track.right_c if side > 0 else track.left_c


@kernel
def touches_dissipative_wall(world: World, ball: int) -> bool:
    """Return whether a body touches a wall that dissipates energy."""
    side = touched_wall(world, ball)
    settings = world.settings[0]
    restitution = settings.right_wall if side > 0 else settings.left_wall
    return side != 0 and restitution < 1.0


@kernel
def _is_at_end(flight: Flight, track: TrackData, end_s: float, end_c: float) -> bool:
    """Return whether a body is at an end of its piece, up to rounding."""
    if track.path_radius == 0.0:
        return abs(flight.s - end_s) <= AT_END * flight.size
    return is_at(flight.s, flight.c, end_s, end_c)


@kernel
def lost_height(world: World, ball: int) -> float:
    """Return the height (m) of a bounce that is lost in the rounding of the body's position."""
    flight = world.flights[ball]
    track = track_of(world, ball)
    x, y = centre_position(world.pieces[flight.piece], track, flight.s, flight.c)
    return BOUNCE_ROUNDING * (abs(x) + abs(y) + world.bodies[ball].radius)


@kernel
def bounce_is_lost(world: World, ball: int, side: int) -> bool:
    """Return whether a body alone is pressed to a wall and its next bounce is lost in rounding."""
    set_speed(world, ball)
    speed = world.flights[ball].speed
    pull = free_acceleration(world, ball) * side
    return pull > 0.0 and speed * speed <= 2.0 * pull * lost_height(world, ball)


@kernel
def last_number_of(world: World, ball: int) -> int:
    """Return the number of the last row of a body in the log of flights."""
    last = world.clock[0].flight_rows - 1
    while world.log[last].body != ball:
        last -= 1
    return last


@kernel
def last_row_of(world: World, ball: int) -> FlightRow:
    """Return the last row of a body in the log of flights."""
    return world.log[last_number_of(world, ball)]


@kernel
def rest(world: World, ball: int, side: int, pulled: bool) -> None:
    """Set a body that has just been launched at rest, pressed to a wall or to a row at one.

    A body that a one-sided trace would have to pull (``pulled``) leaves the trace at once.
    """
    flight = world.flights[ball]
    flight.at_rest = 1
    flight.wall_side = side
    flight.exit_after = NEVER
    if pulled:
        flight.exit_kind = LIFT_OFF
        flight.exit_after = 0.0
    set_exit_time(flight)
    flight.angular_bound = 0.0
    flight.jerk_bound = 0.0
    flight.acceleration_bound = 0.0
    last_row_of(world, ball).at_rest = 1
    for j in range(world.settings[0].pairs):
        pair = world.pairs[j]
        if pair.held == 1 and (pair.a == ball or pair.b == ball):
            pair.release_t = NEVER


@kernel
def row_from(world: World, ball: int, right: bool) -> int:
    """Return the number of pairs in the chain from a body at a wall inwards."""
    count = 0
    beside = pair_beside(world, ball, -1 if right else 0)
    while beside >= 0 and joins(world, beside, True):
        count += 1
        beside = pair_beside(world, beside, -1 if right else 1)
    return count


@kernel
def set_speeds_and_normals(world: World, first: int, count: int) -> None:
    """Set the scratch speeds of the bodies of a chain and the normals of its pairs."""
    for step in range(count + 1):
        set_speed(world, number_along(world, first, step))
    for step in range(count):
        set_normals(world, number_along(world, first, step))


@kernel
def run_around(world: World, j: int, touching: bool) -> tuple[int, int]:
    """Return the first pair and the number of pairs of the run of held pairs around pair ``j``.

    With ``touching`` the run includes the pairs that are in contact at the present instant.
    """
    most = world.settings[0].bodies - 1
    first = j
    count = 1
    left = pair_beside(world, first, -1)
    while count < most and left >= 0 and joins(world, left, touching):
        first = left
        count += 1
        left = pair_beside(world, first, -1)
    right = pair_beside(world, first, count)
    while count < most and right >= 0 and joins(world, right, touching):
        count += 1
        right = pair_beside(world, first, count)
    return first, count


@kernel
def joins(world: World, j: int, touching: bool) -> bool:
    """Return whether a pair is held or, with ``touching``, in contact now up to rounding."""
    clock = world.clock[0]
    pair = world.pairs[j]
    if pair.held == 1:
        return True
    if not touching or pair.apart == 1:
        return False
    if is_now(world, pair.contact_t, pair.contact_t_low):
        return True  # whatever the rounding of its positions
    if pair.touching != 0 and is_now(world, pair.begin_t, pair.begin_t_low):
        return True  # launched in contact at this instant
    a_s, a_c, _ = state_at(world, pair.a, clock.t, clock.t_low)
    b_s, b_c, _ = state_at(world, pair.b, clock.t, clock.t_low)
    gap, size = surface_gap(world, j, a_s, a_c, b_s, b_c)
    return gap <= CONTACT_ROUNDING * size


@kernel
def held_from(world: World, first: int, count: int, start: int) -> int:
    """Return the number of consecutive held pairs from position ``start`` of a chain."""
    length = 0
    while start + length < count:
        if pair_along(world, first, start + length).held == 0:
            break
        length += 1
    return length


@kernel
def share_fastest(world: World, first: int, count: int) -> float:
    """Return the scale (m/s) of a chain's greatest speeds at this instant; set it in its bodies.

    A sequence of simultaneous impacts may contract to rest. What remains of its speeds is compared
    with those at its beginning.
    """
    fastest = 0.0 if count > 0 else abs(world.flights[first].speed)
    for step in range(count):
        fastest = max(fastest, speed_of_pair(world, number_along(world, first, step)))
    for step in range(count + 1):
        fastest = max(fastest, flight_along(world, first, step).fastest)
    for step in range(count + 1):
        flight_along(world, first, step).fastest = fastest
    return fastest


@kernel
def simultaneous_impulses(world: World, first: int, count: int, law: int, plastic: int) -> None:
    """Set the impulses (``solution``) of pairs that close at one instant, each with its own k.

    Equation of a pair: its law's relative speed after all impulses is ``-k`` times that before;
    ``plastic`` sets k = 0 for all. A body that rests against a wall does not yield.
    """
    pairs = world.settings[0].pairs
    for step in range(count):
        j = number_along(world, first, step)
        pair = world.pairs[j]
        qa, ha = _weight_and_response(world, law, pair.a, pair.normal_a)
        qb, hb = _weight_and_response(world, law, pair.b, pair.normal_b)
        approach = law_approach(
            law, world.bodies[pair.a], world.bodies[pair.b], pair.normal_a, pair.normal_b,
            world.flights[pair.a].speed, world.flights[pair.b].speed,
        )  # fmt: skip
        k = 0.0 if plastic == 1 else pair.restitution
        pair.part_a = qa * ha
        pair.part_b = qb * hb
        pair.right = (1.0 + k) * approach
        if step > 0:
            before = pair_along(world, first, step - 1)
            _, h = _weight_and_response(world, law, pair.a, before.normal_b)
            pair.lower = -qa * h
        if step < count - 1:
            after = pair_along(world, first, step + 1)
            _, h = _weight_and_response(world, law, pair.b, after.normal_a)
            pair.upper = -qb * h
    solve_from_both_ends(world.pairs, pairs, first, count)


@kernel
def _weight_and_response(world: World, law: int, ball: int, normal: float) -> tuple[float, float]:
    """Return the weight and response of a body; the response is 0 at rest against a wall."""
    q, h = weight_and_response(law, world.bodies[ball], normal)
    return q, 0.0 if world.flights[ball].wall_side != 0 else h


@kernel
def apply_impulses(world: World, first: int, count: int, law: int) -> None:
    """Change the speeds of a run of bodies by the impulses of their pairs, both of a body at once.

    A light body between heavy ones gets two large impulses that nearly cancel. The result has their
    rounding, so that their size counts as one of its speeds at this instant.
    """
    for step in range(count + 1):
        left, right = pushes(world, first, count, step, law)
        flight = flight_along(world, first, step)
        flight.speed += left - right
        flight.fastest = max(flight.fastest, max(abs(left), abs(right)))


@kernel
def pushes(world: World, first: int, count: int, step: int, law: int) -> tuple[float, float]:
    """Return the changes of speed (m/s) by the impulses to the left and right of a body.

    The first is forward and the second backward.
    """
    ball = number_along(world, first, step)
    left = 0.0
    right = 0.0
    if step > 0:
        pair = pair_along(world, first, step - 1)
        _, h = _weight_and_response(world, law, ball, pair.normal_b)
        left = pair.solution * h
    if step < count:
        pair = pair_along(world, first, step)
        _, h = _weight_and_response(world, law, ball, pair.normal_a)
        right = pair.solution * h
    return left, right


@kernel
def contact_forces(world: World, first: int, count: int) -> None:
    """Set the forces (``solution``, N) that keep a run of pairs in contact.

    Its normals and speeds must be set.
    """
    pairs = world.settings[0].pairs
    for step in range(count):
        j = number_along(world, first, step)
        pair = world.pairs[j]
        ease_a = mobility(world, pair.a)
        ease_b = mobility(world, pair.b)
        pair.right = -free_approach(world, j)
        pair.part_a = pair.normal_a * pair.normal_a * ease_a
        pair.part_b = pair.normal_b * pair.normal_b * ease_b
        if pair.part_a + pair.part_b == 0.0:
            # Both rest at walls: there is neither motion nor force.
            pair.part_a = 0.5
            pair.part_b = 0.5
        if step > 0:
            before = pair_along(world, first, step - 1)
            pair.lower = -pair.normal_a * before.normal_b * ease_a
        if step < count - 1:
            after = pair_along(world, first, step + 1)
            pair.upper = -pair.normal_b * after.normal_a * ease_b
    solve_from_both_ends(world.pairs, pairs, first, count)


@kernel
def keep_release(flight: Flight, pair: PairData, after: float) -> None:
    """Keep when a contact force falls through zero, ``after`` (s) the flight's start, or NEVER."""
    pair.release_t = NEVER
    pair.release_t_low = 0.0
    if after < NEVER:
        pair.release_t, pair.release_t_low = add_to_time(flight.t, flight.t_low, after)
