"""Which bodies that touch stay in contact, and which part.

Where no pair of a chain of touching bodies approaches, those stay in contact which the springs
press together: the forces F of the contacts satisfy ``F >= 0``, the pairs that part ``gap'' >= 0``,
never both.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.impact.laws import TRANSLATIONAL
from vibro_cli.kernels.springs.impacts import NEARLY_OVER, ROUNDING, approach_of, frequency, hold
from vibro_cli.kernels.springs.search import gap_of, is_in_contact
from vibro_cli.kernels.springs.series import acceleration_of, log_states, renew_energies
from vibro_cli.kernels.springs.world import (
    CHANGES,
    COLLISION,
    CONTACT_OPENED,
    DECISION,
    FREE,
    IMPACTS,
    MAY,
    PARTING,
    RELEASED,
    RESTING,
    SETTLED,
    STAYS,
    World,
)


@kernel
def settle_contacts(world: World) -> None:
    """Decide which pairs stay in contact, then carry it out, with each call for one pair."""
    clock = world.clock[0]
    last = world.settings[0].bodies - 1
    if clock.unsettled == DECISION:
        for pair in range(last):
            _propose(world, pair)
        while _press(world):
            pass
        for pair in range(last):
            if world.pairs[pair].stays == MAY:
                world.pairs[pair].stays = 0
        clock.unsettled = CHANGES
        if _equalise_all(world):
            renew_energies(world)
            log_states(world, COLLISION, 0, 0.0)
            for pair in range(last):
                if is_in_contact(world, pair) and approach_of(world, pair) > 0.0:
                    clock.unsettled = IMPACTS  # one speed of some made others approach
            return
    for pair in range(last):
        state = world.pairs[pair]
        if is_in_contact(world, pair) and state.stays != state.held:
            if state.stays == STAYS:
                _close(world, pair)
            else:
                _open(world, pair)
            return
    clock.unsettled = SETTLED


@kernel
def _propose(world: World, pair: int) -> None:
    """Propose a pair to stay: one without relative speed, or whose bounces would soon be over."""
    state = world.pairs[pair]
    state.stays = 0
    state.needed = 0.0
    if not is_in_contact(world, pair):
        return
    approach = approach_of(world, pair)
    if approach == 0.0:
        state.stays = MAY
        if state.known < RESTING:
            state.known = RESTING
    elif approach < 0.0:
        state.known = PARTING
        if state.restitution < 1.0:
            state.stays = MAY
            over = NEARLY_OVER / frequency(world, pair)
            state.needed = -2.0 * approach / ((1.0 - state.restitution) * over)


@kernel
def _press(world: World) -> bool:
    """Let those that may stay do so which are pressed together; False if there are none.

    Bodies that stay together push their other neighbours more: what is pressed once stays so
    (Chandrasekaran's method for a matrix with no positive element beside its diagonal).
    """
    found = False
    bodies = world.settings[0].bodies
    first = 0
    count = _staying(world, 0)
    left = common_acceleration(world, first, count)
    while first + count < bodies:
        pair = world.pairs[first + count - 1]
        first += count
        count = _staying(world, first)
        right = common_acceleration(world, first, count)
        if pair.stays == MAY and left - right > pair.needed:
            pair.stays = STAYS
            found = True
        left = right
    return found


@kernel
def _staying(world: World, first: int) -> int:
    """How many bodies from one on stay together."""
    count = 1
    bodies = world.settings[0].bodies
    while first + count < bodies and world.pairs[first + count - 1].stays == STAYS:
        count += 1
    return count


@kernel
def common_acceleration(world: World, first: int, count: int) -> float:
    """Return the acceleration (m/s^2) of bodies that move as one."""
    force = 0.0
    mass = 0.0
    for body in range(first, first + count):
        force += world.bodies[body].rolling_mass * acceleration_of(world.springs[body])
        mass += world.bodies[body].rolling_mass
    return force / mass


@kernel
def _close(world: World, pair: int) -> None:
    """Begin lasting contact of a pair, whose bodies have been given one speed."""
    state = world.pairs[pair]
    lasting = 0.0
    if state.needed > 0.0:
        lasting = NEARLY_OVER / frequency(world, pair)
    _note_closing(world, pair)
    hold(world, pair, lasting)


@kernel
def _equalise_all(world: World) -> bool:
    """Give all bodies that stay together one speed; whether that changed any."""
    changed = False
    first = 0
    bodies = world.settings[0].bodies
    while first < bodies:
        end = first
        same = True
        while end < bodies - 1 and world.pairs[end].stays == STAYS:
            end += 1
            same = same and world.springs[end].v == world.springs[first].v
        if not same:
            _account(world, first, end, _equalise(world, first, end))
            changed = True
        first = end + 1
    return changed


@kernel
def _equalise(world: World, first: int, end: int) -> float:
    """Give bodies ``first`` to ``end`` one speed, at the law's momentum; the energy lost (J)."""
    moving = 0.0
    total = 0.0
    for body in range(first, end + 1):
        mass = world.bodies[body].rolling_mass
        if world.settings[0].law == TRANSLATIONAL:
            mass = world.bodies[body].mass
        moving += mass * world.springs[body].v
        total += mass
    common = moving / total
    loss = 0.0
    for body in range(first, end + 1):
        v = world.springs[body].v
        loss += 0.5 * world.bodies[body].rolling_mass * (v - common) * (v + common)
        world.springs[body].v = common
    return loss


@kernel
def _account(world: World, first: int, end: int, loss: float) -> None:
    """Add what one speed took to the last impact of these bodies, if it is of this instant."""
    clock = world.clock[0]
    number = clock.impact_rows - 1
    while number >= 0 and _is_now(world, number):
        row = world.impacts[number]
        if first <= row.pair < end:
            row.loss += loss
            clock.lost += loss
            return
        number -= 1
    clock.energy_correction += abs(loss)


@kernel
def _note_closing(world: World, pair: int) -> None:
    """Mark the last impact of a pair, if it is of this instant, as the beginning of contact."""
    number = world.clock[0].impact_rows - 1
    while number >= 0 and _is_now(world, number):
        row = world.impacts[number]
        if row.pair == pair:
            row.contact = 1
            return
        number -= 1


@kernel
def _is_now(world: World, number: int) -> bool:
    """Whether an impact is one of the present instant."""
    row = world.impacts[number]
    return row.t == world.clock[0].t and row.t_low == world.clock[0].t_low


@kernel
def _open(world: World, pair: int) -> None:
    """End a lasting contact that an impact has broken."""
    world.pairs[pair].held = 0
    renew_energies(world)
    log_states(world, CONTACT_OPENED, pair, 0.0)


@kernel
def open_contact(world: World, pair: int) -> None:
    """End a lasting contact whose force has fallen to zero."""
    _open(world, pair)
    world.pairs[pair].known = RELEASED


@kernel
def touches_at_start(world: World) -> None:
    """Note the pairs that start in contact, as far as rounding can tell."""
    for pair in range(world.settings[0].bodies - 1):
        one = world.springs[pair]
        other = world.springs[pair + 1]
        size = abs(one.foot + one.x) + abs(other.foot + other.x) + world.pairs[pair].touch
        state = world.pairs[pair]
        state.known = FREE
        if abs(gap_of(world, pair)) <= 2.0 * ROUNDING * size:
            state.known = RESTING if approach_of(world, pair) == 0.0 else PARTING
