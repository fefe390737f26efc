"""Simultaneous impacts of several touching pairs, solved jointly.

All pairs of a chain that approach at one instant are solved together, each with its own k. Pairs
that approach as a result have further impacts at the same instant, and so on.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.cluster.contact_changes import (
    close_accumulated,
    held_rounding,
    launch_chain,
    settle_contacts,
)
from vibro_cli.kernels.contact.contact_kinematics import (
    lifted_body,
    parting_speed,
    set_speed,
)
from vibro_cli.kernels.flow.flight import bring_to, specific_energy_of_state
from vibro_cli.kernels.impact.chattering import (
    FREE,
    PRESSING,
    closing_law,
    energy_of_motion,
    half_approach,
    press_speeds,
    repeats,
)
from vibro_cli.kernels.impact.impulse_chain import (
    apply_impulses,
    last_row_of,
    set_speeds_and_normals,
    share_fastest,
    simultaneous_impulses,
    touched_wall,
    touches_dissipative_wall,
)
from vibro_cli.kernels.impact.laws import (
    NORMAL_IMPULSE,
    SPEED_ROUNDING,
    do_part,
    law_approach,
    log_impact,
    loss_of_impulse,
)
from vibro_cli.kernels.world import (
    COLLISION,
    END_INADMISSIBLE,
    END_LIFT_OFF,
    RUNNING,
    WALL,
    ImpactRow,
    PairData,
    World,
    flight_along,
    is_now,
    number_along,
    pair_along,
)

# After this many rounds of impacts at one instant, a dissipative chain is taken to its limit.
MOST_ROUNDS = 1000
# After this many without dissipation the run ends: mass ratios of 1e11 lead to as many.
ENDLESS_ROUNDS = 1_000_000


@kernel
def collide_jointly(world: World, first: int, count: int) -> int:
    """Carry out the impacts of a chain of touching pairs at the present instant."""
    clock = world.clock[0]
    struck = _bring_chain(world, first, count)
    before = energy_of_chain(world, first, count)
    start_row = clock.impact_rows
    loss = 0.0
    left = 0
    right = 0
    admissible = True
    if _is_endless(world, first, count):
        loss = _limit(world, first, count)
    else:
        left = _comes_back(world, first, count, 0)
        right = _comes_back(world, first, count, count)
        loss, admissible = _impulses(world, first, count)
        loss += _from_wall(world, first, left) + _from_wall(world, first + count, right)
    if not admissible:
        _complete_as_law_says(world, start_row)
        return END_INADMISSIBLE
    if lifts(world, start_row):
        _complete_as_law_says(world, start_row)
        return END_LIFT_OFF
    if clock.impact_rows > start_row:
        _free_pairs(world, first, count)
    settle_contacts(world, first, count)
    launch_chain(world, first, count, COLLISION)
    # Only open traces have walls: numbers do not wrap around.
    if left != 0:
        last_row_of(world, first).cause = WALL
    if right != 0:
        last_row_of(world, first + count).cause = WALL
    loss += _take_closing_losses(world, first, count, start_row)
    if close_accumulated(world, first, count):
        loss += _take_closing_losses(world, first, count, start_row)
    after = energy_of_chain(world, first, count)
    clock.energy_correction += abs(before - loss - after)
    several = struck or clock.impact_rows - start_row > 1
    for row in range(start_row, clock.impact_rows):
        _complete(world, world.impacts[row], several)
    return RUNNING


@kernel
def _free_pairs(world: World, first: int, count: int) -> None:
    """Reset ``pressing`` and ``touching`` of the pairs of a chain whose speeds have changed."""
    for step in range(count):
        pair = pair_along(world, first, step)
        pair.pressing = FREE
        pair.touching = 0


@kernel
def lifts(world: World, start_row: int) -> bool:
    """Return whether an impact lifts a body off a one-sided trace; keep it as ``last_ball``."""
    clock = world.clock[0]
    if world.settings[0].one_sided == 0:
        return False
    for row in range(start_row, clock.impact_rows):
        lifted = lifted_body(world, world.impacts[row].pair)
        if lifted >= 0:
            clock.last_ball = lifted
            return True
    return False


@kernel
def _comes_back(world: World, first: int, count: int, end: int) -> int:
    """Return the side of the wall off which an end of a chain bounces in this round, or 0."""
    settings = world.settings[0]
    ball = number_along(world, first, end)
    side = touched_wall(world, ball)
    rounding = SPEED_ROUNDING * share_fastest(world, first, count)
    beside = (first if end == 0 else first + count - 1) % settings.pairs
    if side == 0 or world.flights[ball].speed * side <= rounding:
        return 0
    return 0 if parting_speed(world, beside) < -rounding else side


@kernel
def _from_wall(world: World, ball: int, side: int) -> float:
    """Reflect a body at a wall; return the energy lost (J)."""
    if side == 0:
        return 0.0
    settings = world.settings[0]
    restitution = settings.right_wall if side > 0 else settings.left_wall
    flight = world.flights[ball]
    loss = energy_of_motion(world, ball)
    flight.speed = -restitution * flight.speed
    return loss * (1.0 - restitution) * (1.0 + restitution)


@kernel
def _take_closing_losses(world: World, first: int, count: int, start_row: int) -> float:
    """Add the losses (J) of closing contacts to the rows of their impacts; return their sum.

    The loss of a contact without a row of its own is shared by all rows of the impact.
    """
    clock = world.clock[0]
    total = 0.0
    shared = 0.0
    # Summed from both ends at once, so that a mirror image has the same sum.
    for step in range((count + 1) // 2):
        opposite = count - 1 - step
        left = _closing_loss_left(world, number_along(world, first, step), start_row)
        right = 0.0
        if opposite > step:
            right = _closing_loss_left(world, number_along(world, first, opposite), start_row)
        shared += left + right
    for step in range(count):
        total += pair_along(world, first, step).closing_loss
    rows = clock.impact_rows - start_row
    if rows == 0:
        clock.energy_correction += abs(shared)
    elif shared != 0.0:
        for row in range(start_row, clock.impact_rows):
            world.impacts[row].loss += shared / rows
    return total


@kernel
def _closing_loss_left(world: World, j: int, start_row: int) -> float:
    """Add the loss (J) of a closing contact to its row; return the loss if it has none."""
    pair = world.pairs[j]
    left = pair.closing_loss
    for row in range(start_row, world.clock[0].impact_rows):
        impact = world.impacts[row]
        if impact.pair == j and pair.held == 1:
            impact.contact = 1
            impact.loss += left
            left = 0.0
    return left


@kernel
def _bring_chain(world: World, first: int, count: int) -> bool:
    """Move the bodies of a chain to their present states; set speeds and normals.

    Returns whether one of them has already had an impact at this instant.
    """
    clock = world.clock[0]
    struck = False
    for step in range(count + 1):
        flight = flight_along(world, first, step)
        if flight.impacts > 0 and is_now(world, flight.t, flight.t_low):
            struck = True
        bring_to(world, number_along(world, first, step), clock.t, clock.t_low)
    set_speeds_and_normals(world, first, count)
    most = 0
    for step in range(count + 1):
        most = max(most, flight_along(world, first, step).impacts)
    _note_bounces(world, first, count, most == 0)
    for step in range(count + 1):
        flight_along(world, first, step).impacts = most + 1
        flight_along(world, first, step).wall_side = 0
    return struck


@kernel
def _note_bounces(world: World, first: int, count: int, begins: bool) -> None:
    """Keep the approach speed (``struck``) of a pair that alone moves in its chain.

    ``begins`` marks the first round of impacts of an instant.
    """
    for step in range(count):
        number = number_along(world, first, step)
        pair = world.pairs[number]
        if world.flights[pair.a].impacts == 0 or world.flights[pair.b].impacts == 0:
            pair.struck = 0.0
        if begins and pair.held == 0 and repeats(world, first, count, number):
            pair.struck = -parting_speed(world, number)
        if pair.held == 1 and is_now(world, pair.change_t, pair.change_t_low):
            pair.delay = 0.0  # hit again within the instant, it has no bounces left


@kernel
def energy_of_chain(world: World, first: int, count: int) -> float:
    """Set the energies of the bodies of a chain from their states; return their sum (J)."""
    total = 0.0
    for step in range(count + 1):
        ball = number_along(world, first, step)
        flight = world.flights[ball]
        flight.specific_energy = specific_energy_of_state(world, ball)
        total += world.bodies[ball].weight * flight.specific_energy
    return total


@kernel
def _impulses(world: World, first: int, count: int) -> tuple[float, bool]:
    """Apply the joint impulses of all approaching pairs and log them.

    Returns the energy lost (J), and whether every impact is admissible, by the law or its
    substitute.
    """
    rounding = SPEED_ROUNDING * share_fastest(world, first, count)
    for step in range(count):
        number = number_along(world, first, step)
        pair = world.pairs[number]
        least = rounding
        if pair.held == 1:
            # A relative speed left by rounding on a flight in contact is no impact.
            least = max(least, held_rounding(world, number))
        pair.closing = 1 if parting_speed(world, number) < -least else 0
    loss = 0.0
    admissible = True
    start = 0
    while start < count:
        length = 0
        while start + length < count and pair_along(world, first, start + length).closing == 1:
            length += 1
        if length > 0:
            begin = number_along(world, first, start)
            start_row = world.clock[0].impact_rows
            lost, fine = _impulses_of_run(world, begin, length, world.settings[0].law)
            if not fine and world.settings[0].substitute == 1:
                lost = _substitute(world, begin, length, start_row)
                fine = True
            loss += lost
            admissible = admissible and fine
        start += length + 1
    return loss, admissible


@kernel
def _is_endless(world: World, first: int, count: int) -> bool:
    """Return whether a sequence of simultaneous impacts is taken to its limit.

    A dissipative sequence that lasts this long contracts. One without dissipation ends, or it has
    no limit because the bodies fill the space between two walls or a closed trace. A round in which
    only walls are hit is carried out: the limit begins with the impact of a pair, whose row has the
    losses of all others.
    """
    if world.flights[first].impacts <= MOST_ROUNDS:
        return False
    rounding = SPEED_ROUNDING * share_fastest(world, first, count)
    dissipates = touches_dissipative_wall(world, first)
    dissipates = dissipates or touches_dissipative_wall(world, number_along(world, first, count))
    closes = False
    for step in range(count):
        number = number_along(world, first, step)
        dissipates = dissipates or world.pairs[number].restitution < 1.0
        closes = closes or parting_speed(world, number) < -rounding
    return dissipates and closes


@kernel
def _limit(world: World, first: int, count: int) -> float:
    """Take a chain to the limit of its sequence of impacts; return the energy lost (J).

    The limit is the plastic impact of the chain with the walls it touches, see
    ``chattering.press_speeds``.
    """
    clock = world.clock[0]
    law = closing_law(world, first, count)
    taken = press_speeds(world, first, count, law)
    start_row = clock.impact_rows
    for step in range(count):
        pair = pair_along(world, first, step)
        if pair.pressing == PRESSING:
            log_impact(world, number_along(world, first, step), 0.0, 0.0, law, 0.0)
            row = world.impacts[clock.impact_rows - 1]
            row.simultaneous = 1  # it stands for all further impacts, those on walls too
            row.loss = half_approach(world, number_along(world, first, step), law)
    apply_impulses(world, first, count, law)
    rows = clock.impact_rows - start_row
    loss = 0.0
    for number in range(start_row, clock.impact_rows):
        row = world.impacts[number]
        pair = world.pairs[row.pair]
        row.speed_a_post = world.flights[pair.a].speed
        row.speed_b_post = world.flights[pair.b].speed
        row.loss = pair.solution * (row.loss + half_approach(world, row.pair, law)) + taken / rows
        loss += row.loss
    return loss


@kernel
def _impulses_of_run(world: World, begin: int, length: int, law: int) -> tuple[float, bool]:
    clock = world.clock[0]
    simultaneous_impulses(world, begin, length, law, 0)
    start_row = clock.impact_rows
    for step in range(length):
        log_impact(world, number_along(world, begin, step), 0.0, 0.0, law, 0.0)
        row = world.impacts[clock.impact_rows - 1]
        pair = pair_along(world, begin, step)
        row.simultaneous = 1 if length > 1 else 0
    apply_impulses(world, begin, length, law)
    loss = 0.0
    fine = True
    for step in range(length):
        pair = pair_along(world, begin, step)
        row = world.impacts[start_row + step]
        row.speed_a_post = world.flights[pair.a].speed
        row.speed_b_post = world.flights[pair.b].speed
        size = max(world.flights[pair.a].fastest, world.flights[pair.b].fastest)
        part = do_part(pair.normal_a, pair.normal_b, row.speed_a_post, row.speed_b_post, size)
        row.admissible = 1 if part else 0
        row.loss = _loss_of_pair(world, pair, row, law)
        loss += row.loss
        fine = fine and part
    return loss, fine


@kernel
def _substitute(world: World, begin: int, length: int, start_row: int) -> float:
    """Redo the inadmissible impact of a run of pairs by ``normal-impulse``; return its loss (J).

    Other runs are left as they are: they share no bodies with it.
    """
    clock = world.clock[0]
    clock.collisions -= clock.impact_rows - start_row
    clock.impact_rows = start_row
    for step in range(length + 1):
        set_speed(world, number_along(world, begin, step))
    loss, _ = _impulses_of_run(world, begin, length, NORMAL_IMPULSE)
    for row in range(start_row, clock.impact_rows):
        world.impacts[row].substituted = 1
        world.impacts[row].admissible = 0
    return loss


@kernel
def _loss_of_pair(world: World, pair: PairData, row: ImpactRow, law: int) -> float:
    """Return the rolling energy (J) lost by the impulse of one pair."""
    body_a = world.bodies[row.a]
    body_b = world.bodies[row.b]
    before_a = row.speed_a_pre
    before_b = row.speed_b_pre
    approach = law_approach(law, body_a, body_b, row.normal_a, row.normal_b, before_a, before_b)
    sum_a = before_a + row.speed_a_post
    sum_b = before_b + row.speed_b_post
    k = pair.restitution
    return loss_of_impulse(law, k, body_a, body_b, pair.solution, approach, sum_a, sum_b)


@kernel
def _complete(world: World, row: ImpactRow, several: bool) -> None:
    """Fill in the fields of a row that are known only after the whole instant."""
    row.specific_energy_a_post = world.flights[row.a].specific_energy
    row.specific_energy_b_post = world.flights[row.b].specific_energy
    if several:
        row.simultaneous = 1


@kernel
def _complete_as_law_says(world: World, start_row: int) -> None:
    for row in range(start_row, world.clock[0].impact_rows):
        complete_inadmissible(world, world.impacts[row])


@kernel
def complete_inadmissible(world: World, row: ImpactRow) -> None:
    """Complete the row of an impact that is not carried out, as its law would have it.

    It is inadmissible itself, is solved with one that is, or lifts a body off the trace. The states
    stay those before it.
    """
    row.admissible = 0
    row.substituted = 0
    gravity = world.settings[0].gravity
    kappa_a = world.bodies[row.a].kappa
    kappa_b = world.bodies[row.b].kappa
    va = row.speed_a_pre
    vb = row.speed_b_pre
    wa = row.speed_a_post
    wb = row.speed_b_post
    row.specific_energy_a_post = (
        row.specific_energy_a_pre + 0.5 * kappa_a * (wa - va) * (wa + va) / gravity
    )
    row.specific_energy_b_post = (
        row.specific_energy_b_pre + 0.5 * kappa_b * (wb - vb) * (wb + vb) / gravity
    )
