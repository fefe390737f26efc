"""When lasting contact begins, goes on and ends.

Contact is kept where the contact force presses. A pair held before keeps its contact through a
change of piece if the force still presses there; a pair that bounces with k < 1 closes when the
sum of its remaining bounces can be taken in closed form to rounding (accumulation, Zeno).
"""

from __future__ import annotations

from vibro_cli.mechanics.flow import angular_jerk
from vibro_cli.mechanics.laws import NORMAL_IMPULSE, weight_and_response
from vibro_cli.mechanics.records import PARTING, RELEASED, PairData
from vibro_cli.numerics.engine import kernel
from vibro_cli.simulation.across import launch_across
from vibro_cli.simulation.chain import (
    apply_impulses,
    contact_forces,
    free_approach,
    joint_impulses,
    parting_speed,
    set_normals,
    set_speed,
)
from vibro_cli.simulation.flights import begin_flight, log_flight
from vibro_cli.simulation.groups import launch_group
from vibro_cli.simulation.rows import SPEED_ROUNDING, hold
from vibro_cli.simulation.world import CONTACT_CLOSED, CONTACT_OPENED, World

EPSILON = 2.220446049250313e-16
# Bodies in contact have equal normal speeds up to the rounding of a whole flight.
HELD_ROUNDING = 1.0e-9
# A force above -this share of the weights presses or is zero up to rounding.
FORCE_ROUNDING = 1.0e-12
# A bounce must be this small against the bodies before its accumulation is looked at.
SMALL_BOUNCE = 1.0e-4
# A bounce lower than this many units in the last place of the places is lost in rounding.
LOST_BOUNCE = 4.0


@kernel
def held_run(world: World, j: int) -> tuple[int, int]:
    """First body and number of pairs of the run of lasting contacts that contains pair ``j``."""
    settings = world.settings[0]
    first = j
    count = 1
    while count < settings.bodies - 1:
        left = first - 1
        if left < 0:
            if settings.closed == 0:
                break
            left = settings.pairs - 1
        if world.pairs[left].held == 0:
            break
        first = left
        count += 1
    while count < settings.bodies - 1:
        right = first + count
        if right >= settings.pairs:
            if settings.closed == 0:
                break
            right -= settings.pairs
        if world.pairs[right].held == 0:
            break
        count += 1
    return first, count


@kernel
def settle(world: World, first: int, count: int) -> None:
    """Decide for a chain of ``count`` touching pairs which of them stay in contact.

    States, speeds and normals of the bodies must be set. ``held`` then says which pairs roll on in
    contact, ``closing`` keeps how the others part (the ``touching`` to be set after the launch).
    """
    pairs = world.settings[0].pairs
    for step in range(count):
        j = (first + step) % pairs
        pair = world.pairs[j]
        speed_a = abs(pair.normal_a * world.flights[pair.a].speed)
        speed_b = abs(pair.normal_b * world.flights[pair.b].speed)
        share = HELD_ROUNDING if pair.held == 1 else SPEED_ROUNDING
        parting = parting_speed(world, j)
        pair.closing = 0
        held = 1 if abs(parting) <= share * (speed_a + speed_b) else 0
        if held != pair.held:
            hold(world, j, held, 0.0)
        if pair.held == 0 and parting > 0.0:
            pair.closing = PARTING
    while _drop_pulling(world, first, count):
        pass
    _equalise(world, first, count)
    for step in range(count):
        # The common speed of a run may turn a neighbour that just parted into one that closes.
        j = (first + step) % pairs
        pair = world.pairs[j]
        if pair.held == 0 and pair.closing == PARTING and parting_speed(world, j) <= 0.0:
            pair.closing = 0


@kernel
def _drop_pulling(world: World, first: int, count: int) -> bool:
    """Free the held pair of a chain whose force pulls most; False if all press."""
    pairs = world.settings[0].pairs
    worst = -1
    least = 0.0
    start = 0
    while start < count:
        if world.pairs[(first + start) % pairs].held == 0:
            start += 1
            continue
        length = 1
        while start + length < count and world.pairs[(first + start + length) % pairs].held == 1:
            length += 1
        contact_forces(world, (first + start) % pairs, length)
        for step in range(start, start + length):
            pair = world.pairs[(first + step) % pairs]
            weights = world.bodies[pair.a].weight + world.bodies[pair.b].weight
            share = pair.solution / weights
            if share < -FORCE_ROUNDING and share < least:
                worst = (first + step) % pairs
                least = share
        start += length
    if worst < 0:
        return False
    pair = world.pairs[worst]
    hold(world, worst, 0, 0.0)
    pair.closing = RELEASED if least > -1.0e-6 else PARTING
    return True


@kernel
def _equalise(world: World, first: int, count: int) -> None:
    """Give the bodies of each run of held pairs one common normal speed (plastic impulses)."""
    pairs = world.settings[0].pairs
    start = 0
    while start < count:
        if world.pairs[(first + start) % pairs].held == 0:
            start += 1
            continue
        length = 1
        while start + length < count and world.pairs[(first + start + length) % pairs].held == 1:
            length += 1
        begin = (first + start) % pairs
        joint_impulses(world, begin, length, NORMAL_IMPULSE, 1)
        apply_impulses(world, begin, length, NORMAL_IMPULSE)
        start += length


@kernel
def launch_chain(world: World, first: int, count: int, cause: int) -> None:
    """Launch the ``count + 1`` bodies of a chain, each run of held pairs as one group."""
    settings = world.settings[0]
    step = 0
    while step <= count:
        ball = (first + step) % settings.bodies
        length = 0
        while step + length < count and world.pairs[(ball + length) % settings.pairs].held == 1:
            length += 1
        for member in range(length + 1):
            _set_p(world, (ball + member) % settings.bodies)
        if length == 0:
            begin_flight(world, ball, cause, 1)
        else:
            _launch_together(world, ball, length + 1, cause)
        step += length + 1
    for step in range(count):
        pair = world.pairs[(first + step) % settings.pairs]
        pair.touching = pair.closing
        pair.closing = 0


@kernel
def _set_p(world: World, ball: int) -> None:
    flight = world.flights[ball]
    track = world.tracks[ball * world.settings[0].pieces + flight.piece]
    flight.p = flight.speed / track.speed_factor


@kernel
def _launch_together(world: World, first: int, count: int, cause: int) -> None:
    bodies = world.settings[0].bodies
    one_piece = True
    for step in range(1, count):
        flight = world.flights[(first + step) % bodies]
        one_piece = one_piece and flight.piece == world.flights[first].piece
        one_piece = one_piece and flight.lap == world.flights[first].lap
    if one_piece:
        launch_group(world, first, count)
    else:
        launch_across(world, first, count)
    for step in range(count):
        flight = world.flights[(first + step) % bodies]
        flight.group_first = first
        flight.group_count = count
        log_flight(world, (first + step) % bodies, cause)


@kernel
def relaunch_run(world: World, first: int, count: int, cause: int) -> None:
    """Launch a run of held pairs anew after a change, as far as their forces still press."""
    settings = world.settings[0]
    for step in range(count + 1):
        set_speed(world, (first + step) % settings.bodies)
    for step in range(count):
        set_normals(world, (first + step) % settings.pairs)
    settle(world, first, count)
    launch_chain(world, first, count, cause)


@kernel
def open_contact(world: World, j: int, first: int, count: int) -> None:
    """Free pair ``j`` of a run whose states are set: its contact force has become zero."""
    settings = world.settings[0]
    for step in range(count + 1):
        set_speed(world, (first + step) % settings.bodies)
    for step in range(count):
        set_normals(world, (first + step) % settings.pairs)
    pair = world.pairs[j]
    hold(world, j, 0, 0.0)
    left = (j - first) % settings.pairs
    if left > 0:
        settle(world, first, left)
    if count - left - 1 > 0:
        settle(world, (j + 1) % settings.pairs, count - left - 1)
    pair.closing = RELEASED
    launch_chain(world, first, count, CONTACT_OPENED)


@kernel
def close_if_accumulated(world: World, j: int, law: int) -> int:
    """Close the contact of a pair that has just bounced, if its remaining bounces can be summed.

    With the parting speed u, the approach acceleration ``c`` and its rate ``c'`` they last
    ``T = T0 - c' T0^2/(3 c)``, ``T0 = 2 u/(c (1 - k))``. Taken when what this leaves out is smaller
    than the rounding of the gap makes the time of the next bounce uncertain. Returns 1 if closed.
    """
    pair = world.pairs[j]
    gravity = world.settings[0].gravity
    u = parting_speed(world, j)
    if u * u > SMALL_BOUNCE * gravity * pair.distance:
        return 0
    if _law_is_normal(world, pair, law) == 0:
        return 0
    c = -free_approach(world, j)
    if c <= 0.0:
        return 0
    a = world.flights[pair.a]
    b = world.flights[pair.b]
    speed_a = abs(pair.normal_a * a.speed)
    speed_b = abs(pair.normal_b * b.speed)
    delay = 0.0
    if abs(u) > SPEED_ROUNDING * (speed_a + speed_b):
        delay = _remaining_bounces(world, j, u, c)
        if delay < 0.0 or delay >= a.exit_after or delay >= b.exit_after:
            return 0
    hold(world, j, 1, delay)
    first, count = held_run(world, j)
    for step in range(count):
        set_normals(world, (first + step) % world.settings[0].pairs)
        world.pairs[(first + step) % world.settings[0].pairs].closing = 0
    _equalise(world, first, count)
    launch_chain(world, first, count, CONTACT_CLOSED)
    return 1


@kernel
def _law_is_normal(world: World, pair: PairData, law: int) -> int:
    """1 if the law acts on the speed along the line of centres (up to a factor)."""
    qa, _ = weight_and_response(law, world.bodies[pair.a], pair.normal_a)
    qb, _ = weight_and_response(law, world.bodies[pair.b], pair.normal_b)
    return 1 if abs(qa * pair.normal_b - qb * pair.normal_a) <= 1.0e-12 * qa * pair.normal_b else 0


@kernel
def _remaining_bounces(world: World, j: int, u: float, c: float) -> float:
    """Duration (s) of all further bounces of a pair, or -1 while it is not known to rounding."""
    pair = world.pairs[j]
    a = world.flights[pair.a]
    b = world.flights[pair.b]
    size = pair.distance
    for ball in range(2):
        flight = a if ball == 0 else b
        size += abs(world.pieces[flight.piece].x) + abs(world.pieces[flight.piece].y)
    rounding = EPSILON * size
    if pair.restitution == 1.0:
        # Nothing accumulates; but a bounce lower than the rounding of the places is contact.
        return 0.0 if u * u <= 2.0 * c * LOST_BOUNCE * rounding else -1.0
    first_term = 2.0 * u / (c * (1.0 - pair.restitution))
    if u * u <= 2.0 * c * LOST_BOUNCE * rounding:
        return first_term
    free = a.piece == b.piece and a.grouped == 0 and b.grouped == 0 and a.own_frequency > 0.0
    rate = (a.jerk_bound + b.jerk_bound) * pair.distance
    if not free:
        rate += (a.acceleration_bound + b.acceleration_bound) * _fastest(world, j)
        missing = first_term * first_term * rate / c
        return first_term if missing * u <= rounding else -1.0
    jerk = angular_jerk(b, b.s, b.c, b.p) - angular_jerk(a, a.s, a.c, a.p)
    # On one arc the distance grows with the angle by n t_a rho_a.
    track = world.tracks[pair.a * world.settings[0].pieces + a.piece]
    relative = jerk * track.path_radius * pair.normal_a / c
    missing = first_term * first_term * first_term * (rate / c) * (rate / c)
    if missing * u > rounding:
        return -1.0
    return first_term * (1.0 + relative * first_term * (1.0 / 3.0))


@kernel
def _fastest(world: World, j: int) -> float:
    """A rate (1/s) above those at which the geometry of a pair changes."""
    pair = world.pairs[j]
    a = world.flights[pair.a]
    b = world.flights[pair.b]
    return (abs(a.speed) + abs(b.speed)) / pair.distance + a.frequency + b.frequency
