"""Which pairs of a chain of touching bodies stay in contact.

Those that have no speed, or one whose bounces are lost in rounding, may; those of them that the
contact forces press do.
"""

from __future__ import annotations

from vibro_cli.mechanics.laws import NORMAL_IMPULSE
from vibro_cli.mechanics.records import CLOSING, PARTING, RELEASED
from vibro_cli.numerics.engine import apart, kernel
from vibro_cli.simulation.accumulation import EPSILON, LOST_BOUNCE, accumulates
from vibro_cli.simulation.chain import (
    apply_impulses,
    contact_forces,
    held_from,
    joint_impulses,
    speed_of_chain,
)
from vibro_cli.simulation.rows import SPEED_ROUNDING, hold
from vibro_cli.simulation.touching import (
    free_approach,
    mobility,
    parting_speed,
    present_gap,
    speed_of_pair,
)
from vibro_cli.simulation.world import World

# Bodies in contact have equal normal speeds up to the rounding of a whole flight.
HELD_ROUNDING = 1.0e-9
# A force above -this share of the weights presses or is zero up to rounding.
FORCE_ROUNDING = 1.0e-12
# Below this share of the weights a pulling force is one that has just become zero.
JUST_ZERO = 1.0e-6
# ``pressing`` of a pair: parts or closes, may be held, is held.
FREE = 0
PROPOSED = 1
PRESSING = 2


@apart
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
    while _press(world, first, count):
        pass
    for step in range(count):
        _decide(world, first, count, step)
    equalise(world, first, count)


@kernel
def _propose(world: World, j: int, fastest: float) -> None:
    """Propose a pair to be held if it has no speed, or one whose bounces may be lost in rounding.

    ``closing`` says which speed it has if it is not zero.
    """
    pair = world.pairs[j]
    parting = parting_speed(world, j)
    rounding = SPEED_ROUNDING * fastest
    if pair.held == 1:
        rounding = max(rounding, HELD_ROUNDING * speed_of_pair(world, j))
    pair.closing = 0
    pair.pressing = PROPOSED
    if abs(parting) <= rounding:
        return
    pair.closing = PARTING if parting > 0.0 else CLOSING
    # Pressed by all bodies together it would bounce lowest.
    pull = world.settings[0].gravity * world.settings[0].bodies
    if not accumulates(world, j) or _bounce_force(world, j, parting) > pull:
        pair.pressing = FREE


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
def _press(world: World, first: int, count: int) -> bool:
    """Add to the pressing pairs of a chain those that their forces press too; False if none.

    A force between two bodies presses each of them more against its other neighbour: what presses
    once does so in the end, and no pair has to be taken away again (a linear complementarity
    problem whose matrix has no positive element beside its diagonal, Chandrasekaran 1970).
    """
    pairs = world.settings[0].pairs
    start = 0
    while start < count:
        length = 0
        while start + length < count:
            pair = world.pairs[(first + start + length) % pairs]
            if pair.pressing != PRESSING:
                pair.solution = 0.0
                break
            length += 1
        if length > 0:
            contact_forces(world, (first + start) % pairs, length)
        start += length + 1
    found = False
    for step in range(count):
        pair = world.pairs[(first + step) % pairs]
        if pair.pressing == PROPOSED and _surplus(world, first, count, step) >= 0.0:
            pair.pressing = PRESSING
            found = True
    return found


@kernel
def _surplus(world: World, first: int, count: int, step: int) -> float:
    """What presses a free pair of a chain beyond what it needs to stay, as a share of the weights.

    The forces between its neighbours and theirs are their ``solution``.
    """
    pairs = world.settings[0].pairs
    j = (first + step) % pairs
    pair = world.pairs[j]
    ease = _ease(world, j)
    if ease == 0.0:
        return FORCE_ROUNDING
    from_left = 0.0
    from_right = 0.0
    if step > 0:
        left = world.pairs[(j - 1) % pairs]
        from_left = pair.normal_a * left.normal_b * mobility(world, pair.a) * left.solution
    if step < count - 1:
        right = world.pairs[(j + 1) % pairs]
        from_right = pair.normal_b * right.normal_a * mobility(world, pair.b) * right.solution
    approach = (from_left + from_right) - free_approach(world, j)
    weights = world.bodies[pair.a].weight + world.bodies[pair.b].weight
    if pair.closing == 0:
        return approach / (ease * weights) + FORCE_ROUNDING
    return (approach - _bounce_force(world, j, parting_speed(world, j))) / (ease * weights)


@kernel
def _decide(world: World, first: int, count: int, step: int) -> None:
    """Hold a pair of a chain if it presses; else ``closing`` says how it parts."""
    j = (first + step) % world.settings[0].pairs
    pair = world.pairs[j]
    held = 1 if pair.pressing == PRESSING else 0
    if pair.pressing == PROPOSED and pair.closing == 0:
        just_zero = _surplus(world, first, count, step) > -JUST_ZERO
        pair.closing = RELEASED if just_zero else PARTING
    if held != pair.held:
        hold(world, j, held, 0.0)
    if held == 1 and pair.closing != 0:
        pair.closing = 0
        pull = pair.solution * _ease(world, j)
        if pair.restitution < 1.0 and pull > 0.0:
            u = abs(parting_speed(world, j))
            pair.delay = 2.0 * u / (pull * (1.0 - pair.restitution))


@kernel
def equalise(world: World, first: int, count: int) -> None:
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
