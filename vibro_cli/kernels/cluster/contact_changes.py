"""The beginning, continuation and end of lasting contacts, in a chain and at walls.

A contact may last if its relative speed is zero, or so small that its bounces are lost in rounding.
It does last if the contact force presses. A wall is a body of infinite mass: a body pressed to it
rests.

A held pair keeps its contact through a change of piece if the force still presses there. A pair
that bounces with k < 1 closes once the sum of its remaining bounces has a closed form to rounding
(accumulation, Zeno).
"""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.cluster.clusters import launch_group
from vibro_cli.kernels.cluster.collocation import FORCE_ROUNDING, launch_across
from vibro_cli.kernels.cluster.trace_forces import normal_force_now
from vibro_cli.kernels.contact.contact_kinematics import (
    free_acceleration,
    free_approach,
    mobility,
    on_one_line,
    parting_speed,
    present_gap,
    set_normals,
    speed_of_pair,
)
from vibro_cli.kernels.flow.flight import begin_flight, log_flight
from vibro_cli.kernels.flow.flow import POLYNOMIAL
from vibro_cli.kernels.impact.chattering import (
    FORCED,
    FREE,
    LOST_BOUNCE,
    NOT_YET,
    PRESSING,
    PROPOSED,
    carry_drift,
    equalise,
    lean,
    pressing_from,
    time_to_rest,
)
from vibro_cli.kernels.impact.impulse_chain import (
    contact_forces,
    held_from,
    lost_height,
    rest,
    set_speeds_and_normals,
    share_fastest,
    stand_at_wall,
    touched_wall,
)
from vibro_cli.kernels.impact.laws import SPEED_ROUNDING, balances_mass, hold
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.kernels.world import (
    CLOSING,
    CONTACT_CLOSED,
    CONTACT_OPENED,
    PARTING,
    RELEASED,
    Flight,
    PairData,
    World,
    flight_along,
    flights_of,
    is_now,
    number_along,
    pair_along,
    pair_beside,
    track_of,
)

# Relative rounding of the normal speeds of bodies in contact over a whole flight.
HELD_ROUNDING = 1.0e-9
# Impacts slower than this share of the greatest speeds at an instant are rounding, which grows if
# a law increases speeds.
SLOWEST = 1.0e-11
# A pulling force below this share of the weights has only just become zero.
JUST_ZERO = 1.0e-6


@kernel
def settle_contacts(world: World, first: int, count: int) -> None:
    """Decide which of the ``count`` touching pairs of a chain stay in contact.

    States, speeds and normals of the bodies must be set. This sets ``held`` of the pairs that stay
    in contact, ``wall_side`` of the bodies that rest at a wall, ``closing`` to how the other pairs
    separate (their ``touching`` after the launch), and ``closing_loss`` to the energy (J) lost by
    equalising the speeds of held bodies. Pairs and walls whose ``pressing`` is ``FORCED`` are held
    regardless of the rounding of their forces.
    """
    fastest = share_fastest(world, first, count)
    for step in range(count + 1):
        flight_along(world, first, step).wall_side = 0
    _propose_wall(world, first, fastest)
    if count > 0:
        _propose_wall(world, number_along(world, first, count), fastest)
    for step in range(count):
        _propose(world, number_along(world, first, step), fastest)
    while _press(world, first, count):
        pass
    for step in range(count):
        _decide(world, first, count, step)
    equalise(world, first, count)


@kernel
def _propose(world: World, j: int, fastest: float) -> None:
    """Propose to hold a pair at rest, or with a speed whose bounces may be lost in rounding.

    ``closing`` becomes the direction of its relative speed if that is not zero.
    """
    pair = world.pairs[j]
    pair.closing = 0
    if pair.pressing == FORCED:
        pair.pressing = PRESSING
        return
    parting = parting_speed(world, j)
    rounding = SPEED_ROUNDING * fastest
    if pair.held == 1:
        rounding = max(rounding, held_rounding(world, j))
    pair.pressing = PROPOSED
    if abs(parting) <= rounding:
        if _is_released(world, pair):
            pair.pressing = FREE
            pair.closing = RELEASED
        return
    pair.closing = PARTING if parting > 0.0 else CLOSING
    if parting < -SLOWEST * fastest and _keeps_small_impacts(world, world.flights[pair.a]):
        pair.pressing = FREE
        return
    # Its bounces would be lowest if the weight of all bodies pressed it.
    pull = world.settings[0].gravity * world.settings[0].bodies
    if _bounce_force(world, j, parting) > pull:
        pair.pressing = FREE
    again = world.flights[pair.a].impacts > 0 and world.flights[pair.b].impacts > 0
    if again and parting > 0.0 and pair.struck > 0.0:
        pair.pressing = FREE  # its bounces are summed once the others are launched


@kernel
def _keeps_small_impacts(world: World, flight: Flight) -> bool:
    """Return whether to carry out slow impacts too, of a body that has just had other impacts.

    ``translational`` does not conserve the same momentum as equalising the normal speeds.
    """
    return balances_mass(world.settings[0].law) and flight.impacts > 1


@kernel
def held_rounding(world: World, j: int) -> float:
    """Return a bound (m/s) of the relative speed that rounding leaves after a flight in contact.

    It has the rounding of the speed itself, and that of cancelling forces on a segment.
    """
    flight = world.flights[world.pairs[j].a]
    if _keeps_small_impacts(world, flight):
        return SLOWEST * flight.fastest  # no flight yet since the speeds were equalised
    given = 0.0
    if flight.form == POLYNOMIAL:
        given = SPEED_ROUNDING * world.settings[0].gravity * flight.segment
    return max(HELD_ROUNDING * speed_of_pair(world, j), given)


@kernel
def _is_released(world: World, pair: PairData) -> bool:
    """Return whether a contact has opened at this instant; ``touching`` is 0 after an impact."""
    now = is_now(world, pair.begin_t, pair.begin_t_low)
    return now and pair.held == 0 and pair.touching == RELEASED


@kernel
def _propose_wall(world: World, ball: int, fastest: float) -> None:
    """Propose that an end of a chain rests at the wall it touches, as ``_propose`` does."""
    flight = world.flights[ball]
    side = touched_wall(world, ball)
    if side == 0:
        flight.pressing = FREE
        return
    stand_at_wall(world, ball, side)
    if abs(flight.speed) <= SPEED_ROUNDING * fastest:
        flight.speed = 0.0
    if flight.pressing == FORCED:
        lean(flight, side)
        return
    pull = world.settings[0].gravity * world.settings[0].bodies
    lost = flight.speed * flight.speed <= 2.0 * pull * lost_height(world, ball)
    flight.pressing = PROPOSED if lost else FREE


@kernel
def _bounce_force(world: World, j: int, parting: float) -> float:
    """Return the acceleration (m/s^2) above which a bounce is lost in rounding of the positions."""
    _, size = present_gap(world, j)
    return parting * parting / (2.0 * LOST_BOUNCE * EPSILON * size)


@kernel
def _press(world: World, first: int, count: int) -> bool:
    """Add the contacts that the forces of the pressing ones press too; return whether any.

    A force between two bodies presses each of them more strongly against its other neighbour, or
    its wall. So a contact that presses once does so in the end, and none has to be removed again (a
    linear complementarity problem whose matrix has no positive off-diagonal element, Chandrasekaran
    1970).
    """
    start = 0
    while start < count:
        length = pressing_from(world, first, count, start)
        if length > 0:
            contact_forces(world, number_along(world, first, start), length)
        start += length + 1
    found = False
    for step in range(count):
        pair = pair_along(world, first, step)
        if pair.pressing == PROPOSED and _surplus(world, first, count, step) >= 0.0:
            pair.pressing = PRESSING
            found = True
    return _press_walls(world, first, count) or found


@kernel
def _press_walls(world: World, first: int, count: int) -> bool:
    """Let the ends of a chain lean on walls that they are pressed to; return whether any do."""
    found = False
    for end in range(2):
        ball = first if end == 0 else number_along(world, first, count)
        flight = world.flights[ball]
        side = touched_wall(world, ball)
        if side == 0 or flight.pressing != PROPOSED:
            continue
        pull = free_acceleration(world, ball) * side
        if count > 0:
            pull += _push(world, ball if side < 0 else ball - 1, ball)
        need = -FORCE_ROUNDING * world.settings[0].gravity
        if flight.speed != 0.0:
            need = 0.5 * flight.speed * flight.speed / lost_height(world, ball)
        if pull >= need:
            lean(flight, side)
            found = True
    return found


@kernel
def _push(world: World, j: int, ball: int) -> float:
    """Return the acceleration (m/s^2) of a body due to the force of its pair (``solution``)."""
    pair = world.pairs[j]
    normal = pair.normal_a if pair.a == ball else pair.normal_b
    return normal * pair.solution * mobility(world, ball)


@kernel
def _surplus(world: World, first: int, count: int, step: int) -> float:
    """Return the force on a free pair beyond what it needs to stay, as a share of the weights.

    The forces of the neighbouring pairs are their ``solution``.
    """
    j = number_along(world, first, step)
    pair = world.pairs[j]
    ease_a = mobility(world, pair.a)
    ease_b = mobility(world, pair.b)
    # Relative acceleration along the line of centres, per newton.
    ease = pair.normal_a * pair.normal_a * ease_a + pair.normal_b * pair.normal_b * ease_b
    if ease == 0.0:
        return FORCE_ROUNDING
    from_left = 0.0
    from_right = 0.0
    if step > 0:
        left = pair_along(world, first, step - 1)
        from_left = pair.normal_a * left.normal_b * ease_a * left.solution
    if step < count - 1:
        right = pair_along(world, first, step + 1)
        from_right = pair.normal_b * right.normal_a * ease_b * right.solution
    approach = (from_left + from_right) - free_approach(world, j)
    weights = world.bodies[pair.a].weight + world.bodies[pair.b].weight
    if pair.closing == 0:
        return approach / (ease * weights) + FORCE_ROUNDING
    return (approach - _bounce_force(world, j, parting_speed(world, j))) / (ease * weights)


@kernel
def _decide(world: World, first: int, count: int, step: int) -> None:
    """Hold a pair of a chain if it presses; otherwise set ``closing`` to how it separates."""
    j = number_along(world, first, step)
    pair = world.pairs[j]
    held = 1 if pair.pressing == PRESSING else 0
    if pair.pressing == PROPOSED and pair.closing == 0:
        just_zero = _surplus(world, first, count, step) > -JUST_ZERO
        pair.closing = RELEASED if just_zero else PARTING
    if held != pair.held:
        hold(world, j, held, 0.0)
    if held == 1:
        pair.closing = 0


@kernel
def launch_chain(world: World, first: int, count: int, cause: int) -> None:
    """Launch the ``count + 1`` bodies of a chain, with each run of held pairs as one group."""
    step = 0
    while step <= count:
        ball = number_along(world, first, step)
        length = held_from(world, first, count, step)
        side = world.flights[ball].wall_side
        for member in range(length + 1):
            number = number_along(world, ball, member)
            flight = world.flights[number]
            flight.p = flight.speed / track_of(world, number).speed_factor
            if side != 0:  # before the launch, which sets other forces
                world.forces[member].normal = normal_force_now(world, ball, length + 1, member)
        if length == 0:
            begin_flight(world, ball, cause, 1)
        else:
            _launch_together(world, ball, length + 1, cause)
        if side != 0:
            for member in range(length + 1):
                number = number_along(world, ball, member)
                pulled = world.forces[member].normal < -FORCE_ROUNDING * world.bodies[number].weight
                rest(world, number, side, pulled and world.settings[0].one_sided == 1)
        step += length + 1
    for step in range(count):
        pair = pair_along(world, first, step)
        pair.touching = pair.closing
        pair.closing = 0


@kernel
def _launch_together(world: World, first: int, count: int, cause: int) -> None:
    one_path = True
    for step in range(count - 1):
        pair = pair_along(world, first, step)
        a, b = flights_of(world, pair)
        # On a single circle they must be side by side, or on both sides of its seam.
        one_path = (
            one_path
            and (a.piece == b.piece or on_one_line(world, a, b))
            and b.winding_number - a.winding_number + pair.seam == 0
        )
    if one_path:
        launch_group(world, first, count)
    else:
        launch_across(world, first, count)
    for step in range(count):
        flight = flight_along(world, first, step)
        flight.group_first = first
        flight.group_count = count
        log_flight(world, number_along(world, first, step), cause)


@kernel
def relaunch_run(world: World, first: int, count: int, cause: int) -> None:
    """Launch a run of held pairs again after a change; pairs no longer pressed open."""
    set_speeds_and_normals(world, first, count)
    settle_contacts(world, first, count)
    count_corrections(world, first, count)
    _launch_unhit(world, first, count, cause)


@kernel
def _launch_unhit(world: World, first: int, count: int, cause: int) -> None:
    """Launch a chain whose speeds do not change.

    Adjacent pairs that separate from the present instant on keep that mark.
    """
    left = pair_beside(world, first, -1)
    right = pair_beside(world, first, count)
    left_mark = _parting_now(world, left)
    right_mark = _parting_now(world, right)
    launch_chain(world, first, count, cause)
    if left_mark != 0:
        world.pairs[left].touching = left_mark
    if right_mark != 0:
        world.pairs[right].touching = right_mark


@kernel
def _parting_now(world: World, number: int) -> int:
    """Return how a pair beside a chain separates since the present instant, or 0 if it does not."""
    if number < 0:
        return 0
    pair = world.pairs[number]
    now = is_now(world, pair.begin_t, pair.begin_t_low)
    return pair.touching if now and pair.held == 0 else 0


@kernel
def count_corrections(world: World, first: int, count: int) -> None:
    """Add the energy changed by equalising the speeds of bodies in contact to the corrections."""
    for step in range(count):
        pair = pair_along(world, first, step)
        world.clock[0].energy_correction += abs(pair.closing_loss)


@kernel
def open_contacts(world: World, j: int, first: int, count: int) -> None:
    """Open pair ``j`` of a run whose states are set: its contact force has become zero.

    Other pairs whose forces vanish at the same instant open too.
    """
    t = world.pairs[j].release_t
    t_low = world.pairs[j].release_t_low
    set_speeds_and_normals(world, first, count)
    # Relative speed left by rounding of the flight would cause an impact once the pair is free.
    equalise(world, first, count)
    count_corrections(world, first, count)
    for step in range(count):
        number = number_along(world, first, step)
        pair = world.pairs[number]
        pair.closing_loss = 0.0
        if pair.release_t == t and pair.release_t_low == t_low:
            hold(world, number, 0, 0.0)
    start = 0
    while start < count:
        length = held_from(world, first, count, start)
        if length > 0:
            settle_contacts(world, number_along(world, first, start), length)
        if start + length < count:
            pair_along(world, first, start + length).closing = RELEASED
        start += length + 1
    count_corrections(world, first, count)
    _launch_unhit(world, first, count, CONTACT_OPENED)


@kernel
def close_accumulated(world: World, first: int, count: int) -> bool:
    """Close the contacts of a launched chain whose remaining bounces can be summed.

    The sum is that of a single pair of bodies (see ``chattering.time_to_rest``). Return whether any
    contact has closed; ``closing_loss`` is then set.
    """
    closed = False
    if count > 1:
        # A launch across pieces leaves the normals at its last node.
        for step in range(count):
            set_normals(world, number_along(world, first, step))
    for step in range(count):
        pair = pair_along(world, first, step)
        pair.closing = pair.touching
        pair.solution = NOT_YET
        if pair.held == 0 and pair.touching == PARTING:
            pair.solution = time_to_rest(world, first, count, number_along(world, first, step))
            closed = closed or pair.solution >= 0.0
    if not closed:
        return False
    for step in range(count):
        pair = pair_along(world, first, step)
        pair.nodal[0] = 0.0
        if pair.held == 0 and pair.solution >= 0.0:
            pair.closing = 0
            pair.nodal[0] = carry_drift(world, number_along(world, first, step), pair.solution)
            hold(world, number_along(world, first, step), 1, pair.solution)
    equalise(world, first, count)
    for step in range(count):
        pair = pair_along(world, first, step)
        pair.closing_loss += pair.nodal[0]
    launch_chain(world, first, count, CONTACT_CLOSED)
    return True
