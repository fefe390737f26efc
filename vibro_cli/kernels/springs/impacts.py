"""Impacts of neighbours on the line, and the decision which of them stay in contact.

All centres move along the line. The laws are those of `kernels.impact.laws`, with the cosine
``c = 2 sqrt(r_a r_b)/(r_a + r_b)`` between it and the line of centres. Neighbouring pairs that
approach at one instant are solved jointly. Pairs that approach as a result follow at the same
instant, and so on.

Once no pair of a chain of touching bodies approaches, the pairs that the springs press together
stay in contact: their contact forces satisfy ``F >= 0``, and the other pairs ``gap'' >= 0``, with
``F gap'' = 0``.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.impact.laws import (
    NORMAL_IMPULSE,
    balances_mass,
    inclination,
    is_graze,
    law_approach,
    loss_of_impulse,
    rounded_once,
    weight_and_response,
)
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.kernels.numerics.tridiagonal import solve_from_both_ends
from vibro_cli.kernels.springs.series import (
    STEP,
    acceleration_of,
    bounds_of_group,
    change_speed,
    expand_group,
    gap_of,
    is_in_contact,
    log_states,
    mass_of_group,
    renew_energies,
    step_of_group,
    unit_of,
)
from vibro_cli.kernels.springs.world import (
    BODY_ROWS,
    CHANGES,
    COLLIDED,
    COLLISION,
    CONTACT_CLOSED,
    CONTACT_OPENED,
    DECISION,
    IMPACTS,
    MAY,
    ORDER,
    PARTING,
    PLACE,
    RELEASED,
    RESTING,
    SETTLED,
    STAYS,
    ImpactRow,
    SpringBody,
    World,
)
from vibro_cli.kernels.world import END_INADMISSIBLE, RUNNING

# A smaller difference of speeds is rounding, as a share of the greatest speeds at this instant: at
# k = 0 little of these may be left.
ROUNDING = 8.0 * EPSILON
# Bounces that would all be over within this share of 1/w0 are taken as one plastic impact: the
# relative displacement by them is below its square.
NEARLY_OVER = 1.0e-7
# After more rounds of impacts at one instant, those of a chain are taken to continue for ever.
MOST_ROUNDS = 1000


@kernel
def approach_of(world: World, pair: int) -> float:
    """Return the speed (m/s) at which a body and its right neighbour approach, 0 if rounding."""
    one = world.springs[pair]
    other = world.springs[pair + 1]
    speed = one.v - other.v
    size = max(abs(one.v), one.fastest) + max(abs(other.v), other.fastest)
    return speed if abs(speed) > ROUNDING * size else 0.0


@kernel
def collide_approaching(world: World) -> int:
    """Carry out the impacts of the next run of neighbouring pairs that approach now.

    Each run logs the states of all bodies, and the log may not have room for all runs, so that each
    call carries out one. Return COLLIDED, RUNNING if no pair approaches, or the cause of the end.
    """
    last = len(world.bodies) - 1
    first = first_closing(world)
    if first == last:
        _begin_round(world)
        first = first_closing(world)
    count = _closing_from(world, first)
    if count == 0:
        return RUNNING
    for pair in range(first, first + count):
        world.pairs[pair].closing = 0
    if count == 1 and touches_no_other(world, first):
        ended = _collide_alone(world, first)
    else:
        ended = _collide_jointly(world, first, count)
    return COLLIDED if ended == RUNNING else ended


@kernel
def first_closing(world: World) -> int:
    """Return the first pair whose impact in this round is pending, or the number of pairs."""
    last = len(world.bodies) - 1
    for pair in range(last):
        if world.pairs[pair].closing == 1:
            return pair
    return last


@kernel
def _closing_from(world: World, first: int) -> int:
    """Return the number of successive pairs from ``first`` on whose impacts are pending."""
    count = 0
    while first + count < len(world.bodies) - 1 and world.pairs[first + count].closing == 1:
        count += 1
    return count


@kernel
def _begin_round(world: World) -> None:
    """Mark the pairs in contact that approach; in an endless chain, all that its limit needs."""
    for pair in range(len(world.bodies) - 1):
        closing = is_in_contact(world, pair) and approach_of(world, pair) > 0.0
        world.pairs[pair].closing = 1 if closing else 0
    world.clock[0].rounds += 1
    while world.clock[0].rounds > MOST_ROUNDS and _widen(world):
        pass


@kernel
def _widen(world: World) -> bool:
    """Mark further pairs of endless chains that the marked ones would close; return whether any.

    This finds the plastic impact that is the limit of all impacts; no mark has to be undone.
    """
    law = _limit_law(world)
    last = len(world.bodies) - 1
    for pair in range(last):
        world.pairs[pair].solution = 0.0
    first = 0
    while first < last:
        count = _closing_from(world, first)
        if count > 0 and _is_endless(world, first):
            _solve(world, first, count, law)
        first += count + 1
    found = False
    for pair in range(last):
        state = world.pairs[pair]
        if state.closing == 0 and is_in_contact(world, pair) and _is_endless(world, pair):
            approach = _speed_after(world, pair, law, 0, last)
            approach -= _speed_after(world, pair + 1, law, 0, last)
            size = world.springs[pair].fastest + world.springs[pair + 1].fastest
            if approach > ROUNDING * size:
                state.closing = 1
                found = True
    return found


@kernel
def _is_endless(world: World, pair: int) -> bool:
    """Return whether the limit of the impacts of a pair's chain is taken.

    It is taken after many rounds if any k < 1; without loss the impacts end.
    """
    if world.clock[0].rounds <= MOST_ROUNDS:
        return False
    while pair > 0 and is_in_contact(world, pair - 1):
        pair -= 1
    while pair < len(world.bodies) - 1 and is_in_contact(world, pair):
        if world.pairs[pair].restitution < 1.0:
            return True
        pair += 1
    return False


@kernel
def _limit_law(world: World) -> int:
    """Return the law whose plastic impact is the limit of many: it conserves what these do."""
    law = world.settings[0].law
    return law if balances_mass(law) else NORMAL_IMPULSE


@kernel
def touches_no_other(world: World, pair: int) -> bool:
    """Return whether the bodies of a pair touch no other bodies."""
    if pair > 0 and is_in_contact(world, pair - 1):
        return False
    return pair + 2 >= len(world.bodies) or not is_in_contact(world, pair + 1)


@kernel
def _collide_alone(world: World, pair: int) -> int:
    """Carry out the impact of a pair that touches no other body; return RUNNING or the end's cause.

    If the bounces that would follow are nearly over, lasting contact begins.
    """
    clock = world.clock[0]
    row = _new_row(world, pair)
    state = world.pairs[pair]
    apply_law(world, row, world.settings[0].law, state.restitution)
    if not _parts(world, row):
        row.admissible = 0
        if world.settings[0].substitute == 0:
            return END_INADMISSIBLE
        row.substituted = 1
        apply_law(world, row, NORMAL_IMPULSE, state.restitution)
    lasting = _time_of_bounces(world, pair, row.v_b_post - row.v_a_post)
    if lasting >= 0.0:
        row.contact = 1
        _apply_plastic(world, row, lasting)
    state.known = RESTING if row.v_a_post == row.v_b_post else PARTING
    change_speed(world.springs[pair], row.v_a_post)
    change_speed(world.springs[pair + 1], row.v_b_post)
    clock.lost += row.loss
    renew_energies(world)
    if lasting >= 0.0:
        hold(world, pair, lasting)
    else:
        log_states(world, COLLISION, pair, 0.0)
    return RUNNING


@kernel
def hold(world: World, pair: int, lasting: float) -> None:
    """Begin lasting contact of a pair with a common speed."""
    world.pairs[pair].held = 1
    world.pairs[pair].known = RESTING
    world.clock[0].contacts += 1
    renew_energies(world)
    log_states(world, CONTACT_CLOSED, pair, lasting)


@kernel
def _collide_jointly(world: World, first: int, count: int) -> int:
    """Carry out joint impacts of neighbouring pairs; return RUNNING or the cause of the end."""
    clock = world.clock[0]
    start = clock.impact_rows
    for pair in range(first, first + count):
        row = _new_row(world, pair)
        row.simultaneous = 1 if count > 1 else row.simultaneous
    # In the limit no pair approaches: an approach left by rounding is for the next round.
    endless = _is_endless(world, first)
    law = _limit_law(world) if endless else world.settings[0].law
    if not _impulses(world, start, count, law) and not endless:
        for number in range(start, start + count):
            world.impacts[number].admissible = 0
        if world.settings[0].substitute == 0:
            return END_INADMISSIBLE
        for number in range(start, start + count):
            world.impacts[number].substituted = 1
        _impulses(world, start, count, NORMAL_IMPULSE)
    for number in range(start, start + count):
        row = world.impacts[number]
        change_speed(world.springs[row.pair], row.v_a_post)
        change_speed(world.springs[row.pair + 1], row.v_b_post)
        world.pairs[row.pair].known = PARTING
        clock.lost += row.loss
    renew_energies(world)
    log_states(world, COLLISION, first, 0.0)
    return RUNNING


@kernel
def _impulses(world: World, start: int, count: int, law: int) -> bool:
    """Set the speeds after joint impacts, from row ``start`` on; return whether all separate."""
    first = world.impacts[start].pair
    _solve(world, first, count, law)
    for number in range(start, start + count):
        row = world.impacts[number]
        row.law = law
        row.v_a_post = _speed_after(world, row.pair, law, first, count)
        row.v_b_post = _speed_after(world, row.pair + 1, law, first, count)
    fine = True
    for number in range(start, start + count):
        row = world.impacts[number]
        fine = fine and _parts(world, row)
        one = world.bodies[row.pair]
        other = world.bodies[row.pair + 1]
        approach = approach_by_law(world, row.pair, law, row.v_a_pre, row.v_b_pre)
        state = world.pairs[row.pair]
        sum_a = row.v_a_pre + row.v_a_post
        sum_b = row.v_b_pre + row.v_b_post
        k = row.restitution
        row.loss = loss_of_impulse(law, k, one, other, state.solution, approach, sum_a, sum_b)
    return fine


@kernel
def _solve(world: World, first: int, count: int, law: int) -> None:
    """Solve for the impulses of neighbouring pairs that collide jointly, each with its k."""
    for pair in range(first, first + count):
        set_chain_row(world, pair, law, first, count)
        v_a, v_b = world.springs[pair].v, world.springs[pair + 1].v
        approach = approach_by_law(world, pair, law, v_a, v_b)
        world.pairs[pair].right = (1.0 + _restitution_now(world, pair)) * approach
    solve_from_both_ends(world.pairs, len(world.bodies) - 1, first, count)


@kernel
def _restitution_now(world: World, pair: int) -> float:
    """Return k of a pair, 0 if the limit of its chain's impacts is taken."""
    return 0.0 if _is_endless(world, pair) else world.pairs[pair].restitution


@kernel
def approach_by_law(world: World, pair: int, law: int, v_a: float, v_b: float) -> float:
    """Return a law's relative speed of a pair with the given speeds (m/s)."""
    one = world.bodies[pair]
    other = world.bodies[pair + 1]
    c = inclination(one, other)
    return law_approach(law, one, other, c, c, v_a, v_b)


@kernel
def set_chain_row(world: World, pair: int, law: int, first: int, count: int) -> None:
    """Set the matrix row of a pair: the changes of its relative speed per unit impulse."""
    row = world.pairs[pair]
    one = world.bodies[pair]
    other = world.bodies[pair + 1]
    c = inclination(one, other)
    qa, ha = weight_and_response(law, one, c)
    qb, hb = weight_and_response(law, other, c)
    row.part_a = qa * ha
    row.part_b = qb * hb
    if pair > first:
        _, h = weight_and_response(law, one, inclination(world.bodies[pair - 1], one))
        row.lower = -qa * h
    if pair + 1 < first + count:
        _, h = weight_and_response(law, other, inclination(other, world.bodies[pair + 2]))
        row.upper = -qb * h


@kernel
def _speed_after(world: World, body: int, law: int, first: int, count: int) -> float:
    """Return the speed (m/s) of a body after the impulses of the pairs on both of its sides.

    On a light body between heavy ones the two nearly cancel, and the rest keeps their rounding, so
    that their magnitude counts as one of its speeds at this instant.
    """
    own = world.bodies[body]
    spring = world.springs[body]
    left = 0.0
    right = 0.0
    if body > first:
        _, h = weight_and_response(law, own, inclination(world.bodies[body - 1], own))
        left = world.pairs[body - 1].solution * h
    if body < first + count:
        _, h = weight_and_response(law, own, inclination(own, world.bodies[body + 1]))
        right = world.pairs[body].solution * h
    spring.fastest = max(spring.fastest, max(abs(left), abs(right)))
    return spring.v + (left - right)


@kernel
def _new_row(world: World, pair: int) -> ImpactRow:
    """Return a new row of the log with the state before an impact."""
    clock = world.clock[0]
    row = world.impacts[clock.impact_rows]
    clock.impact_rows += 1
    clock.collisions += 1
    clock.steps = 0
    one = world.springs[pair]
    other = world.springs[pair + 1]
    row.t = clock.t
    row.t_low = clock.t_low
    row.pair = pair
    row.x_a = one.foot + one.x
    row.x_b = other.foot + other.x
    row.v_a_pre = one.v
    row.v_b_pre = other.v
    one.fastest = max(one.fastest, abs(one.v))
    other.fastest = max(other.fastest, abs(other.v))
    row.restitution = _restitution_now(world, pair)
    row.gap = gap_of(world, pair)
    row.admissible = 1
    row.substituted = 0
    row.contact = 0
    row.simultaneous = 1 if clock.at_once > 0 else 0
    clock.at_once += 1
    pull = abs(acceleration_of(one)) + abs(acceleration_of(other))
    row.grazing = 1 if is_graze(one.v - other.v, pull, rounding_of_gap(world, pair)) else 0
    return row


@kernel
def _parts(world: World, row: ImpactRow) -> bool:
    """Return whether the bodies separate after the impact, up to the rounding of all speeds."""
    separating = row.v_b_post - row.v_a_post
    speeds = abs(row.v_a_post) + abs(row.v_b_post)
    speeds += world.springs[row.pair].fastest + world.springs[row.pair + 1].fastest
    return separating >= -ROUNDING * speeds


@kernel
def apply_law(world: World, row: ImpactRow, law: int, restitution: float) -> None:
    """Set the speeds after the impact of a pair by a law, and the energy loss."""
    one = world.bodies[row.pair]
    other = world.bodies[row.pair + 1]
    c = inclination(one, other)
    row.law = law
    row.restitution = restitution
    row.v_a_post, row.v_b_post, row.loss = rounded_once(
        law, restitution, one, other, c, row.v_a_pre, row.v_b_pre
    )


@kernel
def _time_of_bounces(world: World, pair: int, separating: float) -> float:
    """Return the time (s) that all further bounces would last, or -1 if contact does not begin.

    A bounce of speed u lasts ``2 u/A``, and the next one starts with k u. Contact begins if they
    are nearly over.
    """
    k = world.pairs[pair].restitution
    pressed = acceleration_of(world.springs[pair]) - acceleration_of(world.springs[pair + 1])
    if k == 1.0 or pressed <= 0.0:
        return -1.0
    lasting = 2.0 * max(separating, 0.0) / (pressed * (1.0 - k))
    return lasting if lasting * frequency(world, pair) <= NEARLY_OVER else -1.0


@kernel
def frequency(world: World, pair: int) -> float:
    """Return the greater frequency w0 (rad/s) of the two springs of a pair."""
    return math.sqrt(max(world.springs[pair].square, world.springs[pair + 1].square))


@kernel
def _apply_plastic(world: World, row: ImpactRow, lasting: float) -> None:
    """Set the common speed that the bounces of a pair, lasting ``lasting`` (s), tend to.

    This is the law at k = 0. It is computed from the momentum, since each body's own speed keeps
    the rounding of before, which may be large for the heavier one. If the law conserves
    ``sum m v``, the springs change that sum in the time, as for separate bodies, not
    ``sum kappa m v``.
    """
    law = row.law
    qa, _ = weight_and_response(law, world.bodies[row.pair], 1.0)
    qb, _ = weight_and_response(law, world.bodies[row.pair + 1], 1.0)
    if qa != qb:
        law = NORMAL_IMPULSE  # equal omega would not mean equal speeds
    apply_law(world, row, law, 0.0)
    _equalise(world, row.pair, row.pair + 1)
    row.v_a_post = world.springs[row.pair].v
    one = world.bodies[row.pair]
    other = world.bodies[row.pair + 1]
    if balances_mass(law) and one.kappa != other.kappa:
        pull = one.mass * acceleration_of(world.springs[row.pair])
        pull += other.mass * acceleration_of(world.springs[row.pair + 1])
        change = pull / (one.mass + other.mass) - common_acceleration(world, row.pair, 2)
        change *= lasting
        row.loss -= mass_of_group(world, row.pair, 2) * change * (row.v_a_post + 0.5 * change)
        row.v_a_post += change
    row.v_b_post = row.v_a_post


@kernel
def settle_contacts(world: World) -> None:
    """Decide which pairs stay in contact; later calls carry this out, one pair at a time."""
    clock = world.clock[0]
    last = len(world.bodies) - 1
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
                    clock.unsettled = IMPACTS  # equalised speeds made other pairs approach
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
    """Mark a pair that may stay: at relative rest, or with bounces that would soon be over."""
    state = world.pairs[pair]
    state.stays = 0
    state.needed = 0.0
    if not is_in_contact(world, pair):
        return
    approach = approach_of(world, pair)
    if approach == 0.0:
        state.stays = MAY
        state.known = RESTING
    elif approach < 0.0:
        state.known = PARTING
        if state.restitution < 1.0:
            state.stays = MAY
            over = NEARLY_OVER / frequency(world, pair)
            state.needed = -2.0 * approach / ((1.0 - state.restitution) * over)
    else:
        world.clock[0].hurried = 1


@kernel
def _press(world: World) -> bool:
    """Let pairs that may stay do so if they are pressed together; return whether any do.

    Bodies that stay together push their other neighbours harder, so that a pair once pressed stays
    pressed (Chandrasekaran's method for a matrix without positive off-diagonal elements).
    """
    found = False
    first = 0
    count = _staying(world, 0)
    while first + count < len(world.bodies):
        pair = world.pairs[first + count - 1]
        more = _staying(world, first + count)
        if pair.stays == MAY and _pressing(world, first, count, more) > pair.needed:
            pair.stays = STAYS
            found = True
        first += count
        count = more
    return found


@kernel
def _pressing(world: World, first: int, count: int, more: int) -> float:
    """Return a measure of how ``count`` bodies that move as one and the next ``more`` are pressed.

    This is the relative acceleration (m/s^2) if some is needed. Otherwise it is the first term of
    the gap's series that exceeds rounding within its reach, with the sign of pressing; ``known``
    becomes its order.
    """
    other = first + count
    pair = world.pairs[other - 1]
    pressing = common_acceleration(world, first, count) - common_acceleration(world, other, more)
    if pair.needed > 0.0:
        return pressing
    steps = min(step_of_group(world, first, count), step_of_group(world, other, more))
    unit = unit_of(steps)
    reach = steps / STEP / unit
    expand_group(world, first, count, unit)
    expand_group(world, other, more, unit)
    rounding = rounding_of_pressing(world, first, count, more) * (unit * unit)
    power = 1.0
    for k in range(RESTING, ORDER):
        term = world.series[first * BODY_ROWS + PLACE + k]
        term -= world.series[other * BODY_ROWS + PLACE + k]
        if abs(term) * power > rounding:
            pair.known = k
            return term
        power *= reach
    return pressing


@kernel
def _staying(world: World, first: int) -> int:
    """Return the number of bodies from ``first`` on that stay together."""
    count = 1
    while first + count < len(world.bodies) and world.pairs[first + count - 1].stays == STAYS:
        count += 1
    return count


@kernel
def common_acceleration(world: World, first: int, count: int) -> float:
    """Return the acceleration (m/s^2) of bodies that move as one."""
    force = 0.0
    for body in range(first, first + count):
        force += world.bodies[body].rolling_mass * acceleration_of(world.springs[body])
    return force / mass_of_group(world, first, count)


@kernel
def _close(world: World, pair: int) -> None:
    """Begin lasting contact of a pair whose speeds have been equalised."""
    state = world.pairs[pair]
    lasting = 0.0
    if state.needed > 0.0:
        lasting = NEARLY_OVER / frequency(world, pair)
    number = _last_impact(world, pair, pair + 1)
    if number >= 0:
        world.impacts[number].contact = 1
    hold(world, pair, lasting)


@kernel
def _equalise_all(world: World) -> bool:
    """Equalise the speeds of bodies that stay together or at rest; return whether any changed."""
    changed = False
    first = 0
    bodies = len(world.bodies)
    while first < bodies:
        end = first
        same = True
        while end < bodies - 1 and _has_one_speed(world, end):
            end += 1
            same = same and world.springs[end].v == world.springs[first].v
        if not same:
            loss = _equalise(world, first, end)
            number = _last_impact(world, first, end)
            if number >= 0:
                world.impacts[number].loss += loss
                world.clock[0].lost += loss
            else:
                world.clock[0].energy_correction += abs(loss)
            changed = True
        first = end + 1
    return changed


@kernel
def _has_one_speed(world: World, pair: int) -> bool:
    """Return whether a pair stays, or approaches only by the rounding of far greater speeds."""
    state = world.pairs[pair]
    v_a, v_b = world.springs[pair].v, world.springs[pair + 1].v
    rests = state.known >= RESTING and approach_of(world, pair) == 0.0
    return state.stays == STAYS or (rests and v_a - v_b > ROUNDING * (abs(v_a) + abs(v_b)))


@kernel
def _equalise(world: World, first: int, end: int) -> float:
    """Set a common speed of bodies ``first`` to ``end``, conserving the law's momentum.

    Return the energy lost (J).
    """
    moving = 0.0
    total = 0.0
    for body in range(first, end + 1):
        mass = world.bodies[body].rolling_mass
        if balances_mass(world.settings[0].law):
            mass = world.bodies[body].mass
        moving += mass * world.springs[body].v
        total += mass
    common = moving / total
    loss = 0.0
    for body in range(first, end + 1):
        v = world.springs[body].v
        loss += 0.5 * world.bodies[body].rolling_mass * (v - common) * (v + common)
        change_speed(world.springs[body], common)
    return loss


@kernel
def _last_impact(world: World, first: int, end: int) -> int:
    """Return the row of the last impact now among bodies ``first`` to ``end``, or -1."""
    clock = world.clock[0]
    for number in range(clock.impact_rows - 1, -1, -1):
        row = world.impacts[number]
        if row.t != clock.t or row.t_low != clock.t_low:
            break
        if first <= row.pair < end:
            return number
    return -1


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
def rounding_of_gap(world: World, pair: int) -> float:
    """Return a bound (m) of the rounding of the gap of a pair in contact."""
    size = _coordinate(world.springs[pair]) + _coordinate(world.springs[pair + 1])
    return 2.0 * ROUNDING * (size + world.pairs[pair].touch)


@kernel
def rounding_of_pressing(world: World, first: int, count: int, more: int) -> float:
    """Return half the change (m/s^2) by rounding of the acceleration that presses two groups.

    From relative rest, an acceleration of this size moves the groups by the rounding of their gap
    within the time for which their series hold.
    """
    reach, one = bounds_of_group(world, first, count)
    way, other = bounds_of_group(world, first + count, more)
    return 0.5 * rounding_of_gap(world, first + count - 1) * max(one / reach, other / way)


@kernel
def _coordinate(spring: SpringBody) -> float:
    """Return the greater of a body's distances (m) from the origin and from its foot.

    Its initial position is measured from the origin, its motion from the foot; both are rounded.
    """
    return max(abs(spring.foot + spring.x), abs(spring.x))


@kernel
def note_touching(world: World) -> None:
    """Mark the pairs that are in contact at the present instant, up to rounding."""
    for pair in range(len(world.bodies) - 1):
        if is_in_contact(world, pair):
            continue
        if abs(gap_of(world, pair)) <= rounding_of_gap(world, pair):
            world.pairs[pair].known = RESTING if approach_of(world, pair) == 0.0 else PARTING
