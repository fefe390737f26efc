"""Impacts of balls, of one pair or of several at one instant, and of a ball on the wall.

A law acts on the velocity components along the horizontal line of centres; the tangential ones do
not change (C, parts 1 and 2). Along that line each ball rolls as on a straight trace. The laws are
those of `kernels.impact.laws`, with the cosine ``c = 2 sqrt(r_a r_b)/(r_a + r_b)`` between it and
the line of centres in space.

If several pairs touch at one instant, the impulse ``I_p`` of each pair turns the law's relative
speed ``u_p`` into ``-k u_p``:

    sum_q A_pq I_q = (1 + k) u_p,

where A_pq is the change of relative speed p per unit impulse q. A is symmetric, and singular if
more pairs touch than there are motions to stop, though the velocities are unique. The system is
solved by conjugate gradients on residuals of 31 digits, so that the resulting doubles do not depend
on the order of the pairs, and symmetric motions stay symmetric. All pairs of a group that approach
at an instant are solved together. Pairs that approach as a result follow at the same instant, as a
group of their own. If this does not end while the relative speeds shrink (k < 1), the limit is
taken: impacts with k = 0, after which the balls roll on side by side.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.impact.laws import (
    NORMAL_IMPULSE,
    inclination,
    is_graze,
    law_approach,
    loss_of_impulse,
    rounded_once,
    weight_and_response,
)
from vibro_cli.kernels.numerics.constants import EPSILON, NEVER
from vibro_cli.kernels.numerics.double_double import dd_add, dd_multiply
from vibro_cli.kernels.table.walls import RESOLVED, bend_at, touching_distance
from vibro_cli.kernels.table.world import BounceRow, PairRow, World
from vibro_cli.kernels.world import END_INADMISSIBLE, END_WALL_CONTACT, RUNNING

# Below this share of the speed a bounce cannot be told from rolling along the wall: the rounding of
# the position turns the normal by about its square root.
ALONG_THE_WALL = 1.0e-6
# A smaller relative difference of energies is rounding.
SMALL_SURPLUS = 1.0e-12


@kernel
def bring(world: World, ball: int) -> None:
    """Move a ball to the present instant."""
    clock = world.clock[0]
    state = world.balls[ball]
    state.x, state.y = world.x[ball], world.y[ball]
    state.t, state.t_low = clock.t, clock.t_low


@kernel
def _set_velocity(world: World, ball: int, vx: float, vy: float) -> None:
    """Set a ball's velocity after an impact, and the greater of both, which sets its rounding."""
    state = world.balls[ball]
    state.fastest = max(abs(state.vx) + abs(state.vy), abs(vx) + abs(vy))
    state.vx, state.vy = vx, vy


@kernel
def collide(world: World, a: int, b: int, instant: int) -> int:
    """Carry out the impact of two balls; return RUNNING or the cause of the end."""
    bring(world, a)
    bring(world, b)
    clock = world.clock[0]
    settings = world.settings[0]
    row = world.pair_log[clock.pair_rows]
    clock.pair_rows += 1
    clock.collisions += 1
    note_before(world, row, a, b)
    row.simultaneous = instant
    apply_law(world, row, settings.law)
    row.event = clock.collisions + clock.bounces
    row.substituted = 0
    row.admissible = 1
    if row.normal_b_post < row.normal_a_post - _rounding(world, row):
        row.admissible = 0
        if settings.substitute == 0:
            _after(row)
            return END_INADMISSIBLE
        row.substituted = 1
        apply_law(world, row, NORMAL_IMPULSE)
    _after(row)
    _part(world, row)
    return RUNNING


@kernel
def note_before(world: World, row: PairRow, a: int, b: int) -> None:
    """Log the state before an impact: positions, velocities, line of centres, gap."""
    clock = world.clock[0]
    one = world.balls[a]
    other = world.balls[b]
    row.t = clock.t
    row.t_low = clock.t_low
    row.a = a
    row.b = b
    row.x_a = one.x
    row.y_a = one.y
    row.x_b = other.x
    row.y_b = other.y
    row.vx_a_pre = one.vx
    row.vy_a_pre = one.vy
    row.vx_b_pre = other.vx
    row.vy_b_pre = other.vy
    dx = other.x - one.x
    dy = other.y - one.y
    apart = math.sqrt(dx * dx + dy * dy)
    row.normal_x = dx / apart
    row.normal_y = dy / apart
    row.gap = apart - touching_distance(world, a, b)
    row.restitution = world.settings[0].restitution
    row.normal_a_pre = one.vx * row.normal_x + one.vy * row.normal_y
    row.normal_b_pre = other.vx * row.normal_x + other.vy * row.normal_y
    across = (other.vx - one.vx) * row.normal_y - (other.vy - one.vy) * row.normal_x
    size = abs(one.x) + abs(one.y) + abs(other.x) + abs(other.y) + apart
    approach = row.normal_a_pre - row.normal_b_pre
    row.grazing = 1 if is_graze(approach, across * across / apart, TOUCHING * size) else 0


@kernel
def apply_law(world: World, row: PairRow, law: int) -> None:
    """Set the components after the impact by a law, and the energy loss."""
    one = world.bodies[row.a]
    other = world.bodies[row.b]
    inclined = inclination(one, other)
    row.law = law
    if row.normal_a_pre <= row.normal_b_pre:  # a graze: by rounding the balls already separate
        row.normal_a_post, row.normal_b_post, row.loss = row.normal_a_pre, row.normal_b_pre, 0.0
        return
    row.normal_a_post, row.normal_b_post, row.loss = rounded_once(
        law, row.restitution, one, other, inclined, row.normal_a_pre, row.normal_b_pre
    )


@kernel
def _rounding(world: World, row: PairRow) -> float:
    """Return a bound (m/s) of the rounding of the components along the line of centres."""
    before = math.sqrt(world.balls[row.a].square) + math.sqrt(world.balls[row.b].square)
    return RESOLVED * (before + abs(row.normal_a_post) + abs(row.normal_b_post))


@kernel
def _after(row: PairRow) -> None:
    """Set the velocities after the impact: only the components along the line change."""
    change_a = row.normal_a_post - row.normal_a_pre
    change_b = row.normal_b_post - row.normal_b_pre
    row.vx_a_post = row.vx_a_pre + change_a * row.normal_x
    row.vy_a_post = row.vy_a_pre + change_a * row.normal_y
    row.vx_b_post = row.vx_b_pre + change_b * row.normal_x
    row.vy_b_post = row.vy_b_pre + change_b * row.normal_y


@kernel
def _part(world: World, row: PairRow) -> None:
    """Set both velocities after an impact; if nothing is lost, conserve the energy exactly."""
    one = world.balls[row.a]
    other = world.balls[row.b]
    mass_a = world.bodies[row.a].rolling_mass
    mass_b = world.bodies[row.b].rolling_mass
    twice = mass_a * one.square + mass_b * other.square
    one.square = row.vx_a_post * row.vx_a_post + row.vy_a_post * row.vy_a_post
    other.square = row.vx_b_post * row.vx_b_post + row.vy_b_post * row.vy_b_post
    found = mass_a * one.square + mass_b * other.square
    surplus = (found - twice) / found if found > 0.0 else 1.0
    if row.loss == 0.0 and abs(surplus) <= SMALL_SURPLUS:
        world.clock[0].energy_correction += 0.5 * abs(found - twice)
        one.square -= surplus * one.square
        other.square -= surplus * other.square
        row.vx_a_post -= 0.5 * surplus * row.vx_a_post
        row.vy_a_post -= 0.5 * surplus * row.vy_a_post
        row.vx_b_post -= 0.5 * surplus * row.vx_b_post
        row.vy_b_post -= 0.5 * surplus * row.vy_b_post
    _set_velocity(world, row.a, row.vx_a_post, row.vy_a_post)
    _set_velocity(world, row.b, row.vx_b_post, row.vy_b_post)


@kernel
def bounce(world: World, ball: int) -> int:
    """Carry out the impact of a ball on the wall: the normal component is multiplied by -k.

    Return RUNNING or the cause of the end.
    """
    clock = world.clock[0]
    wall = world.wall[0]
    state = world.balls[ball]
    to = world.meetings[ball]
    state.x, state.y = to.x, to.y
    state.t, state.t_low = clock.t, clock.t_low
    row = world.bounce_log[clock.bounce_rows]
    clock.bounce_rows += 1
    clock.bounces += 1
    row.t, row.t_low = clock.t, clock.t_low
    row.event = clock.collisions + clock.bounces
    row.ball, row.edge = ball, to.other
    row.x, row.y = to.x, to.y
    row.normal_x, row.normal_y = to.normal_x, to.normal_y
    row.vx_pre, row.vy_pre = state.vx, state.vy
    closing = max(state.vx * to.normal_x + state.vy * to.normal_y, 0.0)
    speed = math.sqrt(state.square)
    concave = to.other < 0 and wall.side > 0.0  # inside a curve
    row.grazing = 1 if _grazes(world, row, closing, concave) else 0
    k = wall.restitution
    # The normal's length is 1 only up to rounding, which would add up over the bounces. So would
    # the rounding of its square, since doubles are twice as dense below 1 as above.
    excess = (to.normal_x * to.normal_x - 0.5) + (to.normal_y * to.normal_y - 0.5)
    share = closing - closing * excess
    taken = (1.0 - k) * (1.0 + k) * closing * share
    row.loss = 0.5 * world.bodies[ball].rolling_mass * taken
    vx = state.vx - (1.0 + k) * share * to.normal_x
    vy = state.vy - (1.0 + k) * share * to.normal_y
    state.square = max(state.square - taken, 0.0)
    row.vx_post, row.vy_post = _kept(world, ball, vx, vy, taken)
    _set_velocity(world, ball, row.vx_post, row.vy_post)
    # With k < 1, bounces along a concave wall accumulate until the ball stays in contact.
    if concave and k * closing <= ALONG_THE_WALL * speed:
        return END_WALL_CONTACT
    return RUNNING


@kernel
def _grazes(world: World, row: BounceRow, closing: float, concave: bool) -> bool:
    """Return whether a bounce cannot be told from a passing touch.

    Only a convex wall or a corner curves away from a ball that touches it.
    """
    pull = 0.0
    if not concave:
        along = row.vx_pre * row.normal_y - row.vy_pre * row.normal_x
        pull = max(-bend_at(world, row), 0.0) * along * along
    size = abs(row.x) + abs(row.y) + world.bodies[row.ball].radius
    return is_graze(closing, pull, TOUCHING * size)


@kernel
def _kept(world: World, ball: int, vx: float, vy: float, taken: float) -> tuple[float, float]:
    """Return a velocity scaled to the speed that the law gives; add up the energy correction.

    If a bounce has taken more of the square of the speed than it left, the remaining square is a
    difference of large terms, and the velocity is more accurate: it is kept, and gives the square.
    """
    state = world.balls[ball]
    found = vx * vx + vy * vy
    if found == 0.0 or taken > state.square:
        state.square = found
        return vx, vy
    surplus = (found - state.square) / found
    if abs(surplus) > SMALL_SURPLUS:
        return vx, vy
    half_mass = 0.5 * world.bodies[ball].rolling_mass
    world.clock[0].energy_correction += half_mass * abs(found - state.square)
    return vx - 0.5 * surplus * vx, vy - 0.5 * surplus * vy


# Balls touch if their distance exceeds that of contact by at most this share of their positions.
TOUCHING = 16.0 * EPSILON


@kernel
def find_group(world: World, a: int, b: int) -> int:
    """Find the touching pairs that are connected to two balls now; return their number.

    ``world.group`` receives the balls of the group, a and b first.
    """
    clock = world.clock[0]
    for place in range(clock.group):  # the group of the previous event
        world.shares[world.group[place]].place = 0
    clock.group = 0
    join(world, a)
    join(world, b)
    count = 1
    world.touches[0].a, world.touches[0].b = a, b
    done = 0
    while done < clock.group and count < len(world.touches):
        ball = world.group[done]
        sift_touching(world, ball)
        for other in range(len(world.balls)):
            if world.sifted[other] > 0.0:
                continue
            place = world.shares[other].place
            # Add each pair once, from the ball that comes first; the event's own pair is present.
            if other == ball or 0 < place <= done or (done == 0 and place == 2):
                continue
            if count < len(world.touches):
                world.touches[count].a = min(ball, other)
                world.touches[count].b = max(ball, other)
                count += 1
                join(world, other)
        done += 1
    return count


@kernel
def join(world: World, ball: int) -> None:
    """Add a ball to the group that collides now, once."""
    clock = world.clock[0]
    if world.shares[ball].place == 0:
        world.group[clock.group] = ball
        clock.group += 1
        world.shares[ball].place = clock.group


@kernel
def sift_touching(world: World, ball: int) -> None:
    """Set ``sifted`` to 0 for the balls that touch a ball now, up to rounding of the positions."""
    x, y = world.x[ball], world.y[ball]
    radius = world.radii[ball]
    for other in range(len(world.balls)):
        dx = world.x[other] - x
        dy = world.y[other] - y
        distance = 2.0 * math.sqrt(radius * world.radii[other])
        size = abs(x) + abs(y) + abs(dx) + abs(dy) + distance
        touches = dx * dx + dy * dy <= distance * (distance + 2.0 * TOUCHING * size)
        world.sifted[other] = 0.0 if touches else 1.0


# Square of the relative residual below which residuals are only rounding.
SOLVED = 1.0e-50
# Impulses that change relative speeds by a smaller share than this balance each other up to the
# rounding of the normals: the descent ends there.
BALANCED = 1.0e-12


@kernel
def solve_impulses(world: World, closing: int, law: int, restitution: float) -> None:
    """Set the impulses of the closing pairs, and the resulting velocity changes in the shares."""
    _set_up(world, closing, law, restitution)
    _descend(world, closing)
    for number in range(closing):
        touch = world.touches[number]
        touch.direction = touch.impulse
    _apply(world, closing)


@kernel
def impulses_for(world: World, pairs: int) -> None:
    """Set the impulses of pairs for the right-hand sides in ``left``, each a single double."""
    if pairs == 1:
        world.touches[0].impulse = world.touches[0].left / world.touches[0].diagonal
        return
    for number in range(pairs):
        touch = world.touches[number]
        touch.left_low = 0.0
    _descend(world, pairs)


@kernel
def _descend(world: World, closing: int) -> None:
    """Set the impulses by conjugate gradients, from the right-hand sides.

    If contacts are redundant up to the rounding of their normals, the residuals fall to that
    rounding and may grow again before this is detected. So the impulses with the smallest residual
    are taken.
    """
    target = 0.0
    for number in range(closing):
        touch = world.touches[number]
        touch.impulse, touch.impulse_low, touch.best = 0.0, 0.0, 0.0
        touch.direction = touch.left / touch.diagonal
        target += touch.left * touch.left / touch.diagonal
    rho = target
    least = target
    for _ in range(20 + 10 * closing):
        if rho <= SOLVED * target:
            break
        along = _apply(world, closing)
        size = 0.0
        for number in range(closing):
            touch = world.touches[number]
            size += touch.diagonal * touch.direction * touch.direction
        if along <= BALANCED * size:
            break
        rho = _step(world, closing, rho, rho / along)
        if rho < least:
            least = rho
            for number in range(closing):
                touch = world.touches[number]
                touch.best = touch.impulse + touch.impulse_low
    for number in range(closing):
        touch = world.touches[number]
        touch.impulse = touch.best


@kernel
def set_weights(world: World, number: int, law: int) -> None:
    """Set the weights and responses of a pair of touching balls."""
    touch = world.touches[number]
    one = world.bodies[touch.a]
    other = world.bodies[touch.b]
    inclined = inclination(one, other)
    touch.weight_a, touch.response_a = weight_and_response(law, one, inclined)
    touch.weight_b, touch.response_b = weight_and_response(law, other, inclined)
    touch.diagonal = touch.weight_a * touch.response_a + touch.weight_b * touch.response_b


@kernel
def _set_up(world: World, closing: int, law: int, restitution: float) -> None:
    """Set the weights, responses and right-hand sides of the closing pairs."""
    first = world.clock[0].pair_rows - closing
    for number in range(closing):
        touch = world.touches[number]
        row = world.pair_log[first + number]
        one = world.bodies[touch.a]
        other = world.bodies[touch.b]
        inclined = inclination(one, other)
        set_weights(world, number, law)
        touch.approach = law_approach(
            law, one, other, inclined, inclined, row.normal_a_pre, row.normal_b_pre
        )
    # Compute the relative speeds with the same weights as the effect of the impulses: for redundant
    # pairs, differently rounded speeds could make the system inconsistent.
    for place in range(world.clock[0].group):
        ball = world.group[place]
        share = world.shares[ball]
        share.x, share.x_low = world.balls[ball].vx, 0.0
        share.y, share.y_low = world.balls[ball].vy, 0.0
    _measure(world, closing)
    for number in range(closing):
        touch = world.touches[number]
        factor = -(1.0 + restitution)
        touch.left, touch.left_low = dd_multiply(touch.change, touch.change_low, factor)


@kernel
def _apply(world: World, closing: int) -> float:
    """Set the changes of velocities and relative speeds due to the impulses ``direction``.

    Return the product of the impulses with the changes of the relative speeds.
    """
    for place in range(world.clock[0].group):
        share = world.shares[world.group[place]]
        share.x, share.x_low, share.y, share.y_low = 0.0, 0.0, 0.0, 0.0
    for number in range(closing):
        touch = world.touches[number]
        x, y = touch.normal_x, touch.normal_y
        _give(world, touch.a, -touch.response_a * x, -touch.response_a * y, touch.direction)
        _give(world, touch.b, touch.response_b * x, touch.response_b * y, touch.direction)
    return _measure(world, closing)


@kernel
def _measure(world: World, closing: int) -> float:
    """Set the relative speeds for the velocities in the shares, positive if pairs separate.

    Return the product of the impulses ``direction`` with them.
    """
    product = 0.0
    for number in range(closing):
        touch = world.touches[number]
        x, y = touch.normal_x, touch.normal_y
        high, low = _along(world, touch.b, touch.weight_b * x, touch.weight_b * y)
        more, more_low = _along(world, touch.a, -touch.weight_a * x, -touch.weight_a * y)
        touch.change, touch.change_low = dd_add(high, low, more, more_low)
        product += touch.direction * touch.change
    return product


@kernel
def _give(world: World, ball: int, x: float, y: float, impulse: float) -> None:
    share = world.shares[ball]
    high, low = dd_multiply(x, 0.0, impulse)
    share.x, share.x_low = dd_add(share.x, share.x_low, high, low)
    high, low = dd_multiply(y, 0.0, impulse)
    share.y, share.y_low = dd_add(share.y, share.y_low, high, low)


@kernel
def _along(world: World, ball: int, x: float, y: float) -> tuple[float, float]:
    share = world.shares[ball]
    high, low = dd_multiply(share.x, share.x_low, x)
    more, more_low = dd_multiply(share.y, share.y_low, y)
    return dd_add(high, low, more, more_low)


@kernel
def _step(world: World, closing: int, rho: float, length: float) -> float:
    """Take a step along the direction; set the next direction and return the new residual measure.

    The residuals are updated in two doubles, so that a rounded step length does no harm.
    """
    measure = 0.0
    for number in range(closing):
        touch = world.touches[number]
        high, low = dd_multiply(touch.direction, 0.0, length)
        touch.impulse, touch.impulse_low = dd_add(touch.impulse, touch.impulse_low, high, low)
        high, low = dd_multiply(touch.change, touch.change_low, -length)
        touch.left, touch.left_low = dd_add(touch.left, touch.left_low, high, low)
        measure += touch.left * touch.left / touch.diagonal
    for number in range(closing):
        touch = world.touches[number]
        touch.direction = touch.left / touch.diagonal + measure / rho * touch.direction
    return measure


# After this many successive events without time between them, the limit is taken: k = 0.
SETTLING = 60


@kernel
def collide_jointly(world: World, count: int, instant: int) -> int:
    """Carry out the impacts of the touching pairs that close; return RUNNING or the end's cause."""
    clock = world.clock[0]
    settings = world.settings[0]
    for place in range(clock.group):
        bring(world, world.group[place])
    first = clock.pair_rows
    closing = _closing(world, count)
    if closing <= 1:
        clock.pair_rows -= closing
        clock.collisions -= closing
        return collide(world, world.touches[0].a, world.touches[0].b, instant)
    restitution = settings.restitution
    if clock.stalled > SETTLING and restitution < 1.0:
        restitution = 0.0
    law = settings.law
    solve_impulses(world, closing, law, restitution)
    admissible = _separate(world, first, closing)
    if not admissible:
        if settings.substitute == 0:
            _complete(world, first, closing, law, restitution, 0)
            return END_INADMISSIBLE
        law = NORMAL_IMPULSE
        solve_impulses(world, closing, law, restitution)
        for row in range(first, clock.pair_rows):
            world.pair_log[row].substituted = 1
    _complete(world, first, closing, law, restitution, 1 if admissible else 0)
    _part_jointly(world, first, closing)
    return RUNNING


@kernel
def _closing(world: World, count: int) -> int:
    """Move the closing pairs to the front of ``world.touches`` and log them; return their number.

    If none closes, the pair of the event, a graze, stays first.
    """
    clock = world.clock[0]
    closing = 0
    least = NEVER
    for number in range(count):
        touch = world.touches[number]
        row = world.pair_log[clock.pair_rows]
        a, b = touch.a, touch.b
        note_before(world, row, a, b)
        one = world.balls[a]
        other = world.balls[b]
        speeds = one.fastest + other.fastest
        approach = row.normal_a_pre - row.normal_b_pre
        # The pair of the event closes, however slowly, and so do pairs that close as fast, such as
        # its mirror image.
        if number == 0 and approach > 0.0:
            least = approach
        if approach <= RESOLVED * speeds and approach < least:
            continue
        kept = world.touches[closing]
        kept.a, kept.b = a, b
        kept.normal_x, kept.normal_y = row.normal_x, row.normal_y
        row.simultaneous = 1
        row.substituted = 0
        clock.pair_rows += 1
        clock.collisions += 1
        closing += 1
    for number in range(closing):
        event = clock.collisions + clock.bounces
        world.pair_log[clock.pair_rows - closing + number].event = event
    return closing


@kernel
def _separate(world: World, first: int, closing: int) -> bool:
    """Set the components after the impacts in the rows; return whether all the pairs separate.

    Impulses of one pair change the speeds of others, so the greatest speed sets the rounding of
    all.
    """
    greatest = 0.0
    for number in range(closing):
        row = world.pair_log[first + number]
        _set_after(world, row)
        speeds = abs(row.vx_a_pre) + abs(row.vy_a_pre) + abs(row.vx_b_pre) + abs(row.vy_b_pre)
        speeds += abs(row.vx_a_post) + abs(row.vy_a_post) + abs(row.vx_b_post) + abs(row.vy_b_post)
        greatest = max(greatest, speeds)
    for number in range(closing):
        row = world.pair_log[first + number]
        if row.normal_b_post < row.normal_a_post - RESOLVED * greatest:
            return False
    return True


@kernel
def _set_after(world: World, row: PairRow) -> None:
    """Set the velocities and components of both balls of a row after all impulses."""
    one = world.shares[row.a]
    other = world.shares[row.b]
    row.vx_a_post = row.vx_a_pre + one.x
    row.vy_a_post = row.vy_a_pre + one.y
    row.vx_b_post = row.vx_b_pre + other.x
    row.vy_b_post = row.vy_b_pre + other.y
    row.normal_a_post = row.normal_a_pre + (one.x * row.normal_x + one.y * row.normal_y)
    row.normal_b_post = row.normal_b_pre + (other.x * row.normal_x + other.y * row.normal_y)


@kernel
def _complete(
    world: World, first: int, closing: int, law: int, restitution: float, admissible: int
) -> None:
    """Set the law, loss and velocities in the rows."""
    for number in range(closing):
        touch = world.touches[number]
        row = world.pair_log[first + number]
        _set_after(world, row)
        row.restitution = restitution
        row.law = law
        row.admissible = admissible
        row.loss = loss_of_impulse(
            law,
            restitution,
            world.bodies[row.a],
            world.bodies[row.b],
            touch.impulse,
            touch.approach,
            row.normal_a_pre + row.normal_a_post,
            row.normal_b_pre + row.normal_b_post,
        )


@kernel
def _part_jointly(world: World, first: int, closing: int) -> None:
    """Set all velocities after joint impacts; if nothing is lost, conserve the energy exactly."""
    loss = 0.0
    for number in range(closing):
        loss += abs(world.pair_log[first + number].loss)
    before, before_low = 0.0, 0.0
    after, after_low = 0.0, 0.0
    for place in range(world.clock[0].group):
        ball = world.group[place]
        state = world.balls[ball]
        mass = world.bodies[ball].rolling_mass
        before, before_low = dd_add(before, before_low, mass * state.square, 0.0)
        share = world.shares[ball]
        _set_velocity(world, ball, state.vx + share.x, state.vy + share.y)
        state.square = state.vx * state.vx + state.vy * state.vy
        after, after_low = dd_add(after, after_low, mass * state.square, 0.0)
    gained = (after - before) + (after_low - before_low)
    surplus = gained / after if after > 0.0 else 0.0
    if loss == 0.0 and abs(surplus) <= SMALL_SURPLUS:
        world.clock[0].energy_correction += 0.5 * abs(gained)
        for place in range(world.clock[0].group):
            state = world.balls[world.group[place]]
            state.square -= surplus * state.square
            state.vx -= 0.5 * surplus * state.vx
            state.vy -= 0.5 * surplus * state.vy
    for number in range(closing):
        row = world.pair_log[first + number]
        row.vx_a_post, row.vy_a_post = world.balls[row.a].vx, world.balls[row.a].vy
        row.vx_b_post, row.vy_b_post = world.balls[row.b].vx, world.balls[row.b].vy
