"""When lasting contact begins, goes on and ends.

Contact is kept where the contact force presses. A pair held before keeps its contact through a
change of piece if the force still presses there; a pair that bounces with k < 1 closes when the
sum of its remaining bounces can be taken in closed form to rounding (accumulation, Zeno).
"""

from __future__ import annotations

from vibro_cli.mechanics.laws import NORMAL_IMPULSE
from vibro_cli.mechanics.records import CLOSING, PARTING, RELEASED
from vibro_cli.numerics.engine import apart, kernel
from vibro_cli.simulation.accumulation import (
    EPSILON,
    LOST_BOUNCE,
    NOT_YET,
    accumulates,
    time_to_rest,
)
from vibro_cli.simulation.across import launch_across
from vibro_cli.simulation.chain import (
    apply_impulses,
    contact_forces,
    held_from,
    joint_impulses,
    speed_of_chain,
)
from vibro_cli.simulation.flights import begin_flight, log_flight
from vibro_cli.simulation.groups import launch_group
from vibro_cli.simulation.rows import SPEED_ROUNDING, hold
from vibro_cli.simulation.touching import (
    mobility,
    parting_speed,
    present_gap,
    set_normals,
    set_speed,
    speed_of_pair,
)
from vibro_cli.simulation.world import CONTACT_CLOSED, CONTACT_OPENED, World

# Bodies in contact have equal normal speeds up to the rounding of a whole flight.
HELD_ROUNDING = 1.0e-9
# A force above -this share of the weights presses or is zero up to rounding.
FORCE_ROUNDING = 1.0e-12
# Below this share of the weights a pulling force is one that has just become zero.
JUST_ZERO = 1.0e-6
# Forces equal up to this share pull alike, and their contacts open together.
ALIKE = 1.0e-9


@kernel
def settle(world: World, first: int, count: int) -> None:
    """Decide for a chain of ``count`` touching pairs which of them stay in contact.

    States, speeds and normals of the bodies must be set. ``held`` then says which pairs roll on in
    contact, ``closing`` keeps how the others part (the ``touching`` to be set after the launch),
    and ``closing_loss`` the energy (J) that equalising the speeds of held bodies has taken.
    """
    pairs = world.settings[0].pairs
    fastest = speed_of_chain(world, first, count)
    for step in range(count):
        _propose(world, (first + step) % pairs, fastest)
    while _free_weakest(world, first, count):
        pass
    for step in range(count):
        pair = world.pairs[(first + step) % pairs]
        if pair.held == 1 and pair.closing != 0:
            pair.closing = 0
            pull = pair.solution * _ease(world, (first + step) % pairs)
            if pair.restitution < 1.0 and pull > 0.0:
                u = abs(parting_speed(world, (first + step) % pairs))
                pair.delay = 2.0 * u / (pull * (1.0 - pair.restitution))
    _equalise(world, first, count)


@kernel
def _propose(world: World, j: int, fastest: float) -> None:
    """Hold a pair for now if it has no speed, or one whose bounces may be lost in rounding.

    ``closing`` says which speed it has if it is not zero.
    """
    pair = world.pairs[j]
    parting = parting_speed(world, j)
    rounding = SPEED_ROUNDING * fastest
    if pair.held == 1:
        rounding = max(rounding, HELD_ROUNDING * speed_of_pair(world, j))
    held = 1 if abs(parting) <= rounding else 0
    pair.closing = 0
    if held == 0:
        pair.closing = PARTING if parting > 0.0 else CLOSING
    if held == 0 and accumulates(world, j):
        # Pressed by all bodies together it would bounce lowest.
        pull = world.settings[0].gravity * world.settings[0].bodies
        held = 1 if _bounce_force(world, j, parting) <= pull else 0
    if held != pair.held:
        hold(world, j, held, 0.0)


@kernel
def _bounce_force(world: World, j: int, parting: float) -> float:
    """Acceleration (m/s^2) under which a bounce is lost in the rounding of the places."""
    _, size = present_gap(world, j)
    return parting * parting / (2.0 * LOST_BOUNCE * EPSILON * size)


@kernel
def _ease(world: World, j: int) -> float:
    """Acceleration along the line of centres that one newton between a pair gives (m/s^2)."""
    pair = world.pairs[j]
    ease_a = pair.normal_a * pair.normal_a * mobility(world, pair.a)
    return ease_a + pair.normal_b * pair.normal_b * mobility(world, pair.b)


@kernel
def _surplus(world: World, j: int) -> float:
    """Force that presses a held pair beyond what it needs to stay, as a share of the weights."""
    pair = world.pairs[j]
    weights = world.bodies[pair.a].weight + world.bodies[pair.b].weight
    ease = _ease(world, j)
    if pair.closing == 0 or ease == 0.0:
        return pair.solution / weights + FORCE_ROUNDING
    return (pair.solution - _bounce_force(world, j, parting_speed(world, j)) / ease) / weights


@kernel
def _free_weakest(world: World, first: int, count: int) -> bool:
    """Free the held pair of a chain that lacks most force, or all alike; False if none does."""
    pairs = world.settings[0].pairs
    least = 0.0
    start = 0
    while start < count:
        length = held_from(world, first, count, start)
        if length > 0:
            contact_forces(world, (first + start) % pairs, length)
        for step in range(start, start + length):
            least = min(least, _surplus(world, (first + step) % pairs))
        start += length + 1
    if least == 0.0:
        return False
    for step in range(count):
        j = (first + step) % pairs
        pair = world.pairs[j]
        if pair.held == 1 and _surplus(world, j) <= least * (1.0 - ALIKE):
            weights = world.bodies[pair.a].weight + world.bodies[pair.b].weight
            if pair.closing == 0:
                just_zero = pair.solution > -JUST_ZERO * weights
                pair.closing = RELEASED if just_zero else PARTING
            hold(world, j, 0, 0.0)
    return True


@kernel
def _equalise(world: World, first: int, count: int) -> None:
    """Give the bodies of each run of held pairs one common normal speed (plastic impulses).

    What that takes is kept in ``closing_loss``. Pairs that close then, which may just have parted,
    are marked as ``CLOSING``.
    """
    pairs = world.settings[0].pairs
    rounding = SPEED_ROUNDING * speed_of_chain(world, first, count)
    start = 0
    while start < count:
        length = held_from(world, first, count, start)
        begin = (first + start) % pairs
        if length > 0:
            for step in range(length):
                j = (begin + step) % pairs
                world.pairs[j].closing_loss = -0.5 * parting_speed(world, j)
            joint_impulses(world, begin, length, NORMAL_IMPULSE, 1)
            apply_impulses(world, begin, length, NORMAL_IMPULSE)
            for step in range(length):
                pair = world.pairs[(begin + step) % pairs]
                pair.closing_loss *= pair.solution
        start += length + 1
    for step in range(count):
        pair = world.pairs[(first + step) % pairs]
        if pair.held == 0:
            pair.closing_loss = 0.0
            parting = parting_speed(world, (first + step) % pairs)
            if parting < -rounding:
                pair.closing = CLOSING


@apart
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
    count_corrections(world, first, count)
    launch_chain(world, first, count, cause)


@kernel
def count_corrections(world: World, first: int, count: int) -> None:
    """Count what equalising the speeds of bodies in contact has changed as corrections."""
    for step in range(count):
        pair = world.pairs[(first + step) % world.settings[0].pairs]
        world.clock[0].energy_correction += abs(pair.closing_loss)


@kernel
def open_contacts(world: World, j: int, first: int, count: int) -> None:
    """Free pair ``j`` of a run whose states are set: its contact force has become zero.

    Others whose forces vanish at the same instant open with it.
    """
    settings = world.settings[0]
    t = world.pairs[j].release_t
    t_low = world.pairs[j].release_t_low
    for step in range(count + 1):
        set_speed(world, (first + step) % settings.bodies)
    for step in range(count):
        number = (first + step) % settings.pairs
        pair = world.pairs[number]
        set_normals(world, number)
        pair.closing_loss = 0.0
        if pair.release_t == t and pair.release_t_low == t_low:
            hold(world, number, 0, 0.0)
    start = 0
    while start < count:
        length = held_from(world, first, count, start)
        if length > 0:
            settle(world, (first + start) % settings.pairs, length)
        if start + length < count:
            world.pairs[(first + start + length) % settings.pairs].closing = RELEASED
        start += length + 1
    count_corrections(world, first, count)
    launch_chain(world, first, count, CONTACT_OPENED)


@kernel
def close_accumulated(world: World, first: int, count: int, law: int) -> bool:
    """Close the contacts of a launched chain whose remaining bounces can be summed up.

    Bodies that touch no others: the sum is that of one pair (see ``accumulation.time_to_rest``).
    Returns whether any contact has closed; ``closing_loss`` is then set.
    """
    pairs = world.settings[0].pairs
    closed = False
    if count > 1:
        # A launch across pieces has left the normals of its last node.
        for step in range(count):
            set_normals(world, (first + step) % pairs)
    for step in range(count):
        pair = world.pairs[(first + step) % pairs]
        pair.closing = pair.touching
        pair.solution = NOT_YET
        if pair.held == 0 and pair.touching == PARTING:
            pair.solution = time_to_rest(world, (first + step) % pairs, law)
            closed = closed or pair.solution >= 0.0
    if not closed:
        return False
    for step in range(count):
        pair = world.pairs[(first + step) % pairs]
        if pair.held == 0 and pair.solution >= 0.0:
            pair.closing = 0
            hold(world, (first + step) % pairs, 1, pair.solution)
    _equalise(world, first, count)
    launch_chain(world, first, count, CONTACT_CLOSED)
    return True
