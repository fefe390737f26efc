"""Impacts of several pairs of touching balls at one instant.

All pairs of a group of touching balls that close at an instant are solved together (see
`impulses`). Pairs that close because of it follow at the same instant, as a group of their own.
Where that goes on and on, the relative speeds shrinking (k < 1), the limit is taken: impacts with
k = 0, after which the balls roll on side by side.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.impact.laws import NORMAL_IMPULSE, loss_of_impulse
from vibro_cli.kernels.numerics.double_double import pair_plus
from vibro_cli.kernels.table.impacts import SMALL_SURPLUS, bring, collide, note_before
from vibro_cli.kernels.table.impulses import solve_impulses
from vibro_cli.kernels.table.walls import RESOLVED
from vibro_cli.kernels.table.world import END_INADMISSIBLE, RUNNING, World

# After so many events in a row without time between them what is left of them is taken as k = 0.
SETTLING = 60


@kernel
def collide_jointly(world: World, count: int, instant: int) -> int:
    """Carry out the impacts of those touching pairs that close; RUNNING or the run's end."""
    clock = world.clock[0]
    settings = world.settings[0]
    for place in range(clock.group):
        bring(world, world.group[place])
    first = clock.pair_rows
    closing = _closing(world, count)
    if closing == 1:
        clock.pair_rows -= 1
        clock.collisions -= 1
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
    _part(world, first, closing)
    return RUNNING


@kernel
def _closing(world: World, count: int) -> int:
    """Note the pairs that close, first in ``world.touches`` and as rows; return their number."""
    clock = world.clock[0]
    closing = 0
    for number in range(count):
        touch = world.touches[number]
        row = world.pair_log[clock.pair_rows]
        a, b = touch.a, touch.b
        note_before(world, row, a, b)
        one = world.balls[a]
        other = world.balls[b]
        speeds = abs(one.vx) + abs(one.vy) + abs(other.vx) + abs(other.vy)
        # The pair of the event closes by its time, whatever its speeds are rounded to.
        if number > 0 and row.normal_a_pre - row.normal_b_pre <= RESOLVED * speeds:
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
    """Set the components after the impacts in the rows; whether all the pairs separate then."""
    admissible = True
    for number in range(closing):
        row = world.pair_log[first + number]
        _set_after(world, row.a, row.b, first + number)
        speeds = abs(row.vx_a_pre) + abs(row.vy_a_pre) + abs(row.vx_b_pre) + abs(row.vy_b_pre)
        speeds += abs(row.vx_a_post) + abs(row.vy_a_post) + abs(row.vx_b_post) + abs(row.vy_b_post)
        if row.normal_b_post < row.normal_a_post - RESOLVED * speeds:
            admissible = False
    return admissible


@kernel
def _set_after(world: World, a: int, b: int, number: int) -> None:
    """Set velocities and components of both balls of a row after all impulses."""
    row = world.pair_log[number]
    one = world.shares[a]
    other = world.shares[b]
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
    """Set law, loss and velocities of the rows."""
    for number in range(closing):
        touch = world.touches[number]
        row = world.pair_log[first + number]
        _set_after(world, row.a, row.b, first + number)
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
def _part(world: World, first: int, closing: int) -> None:
    """Give the balls their velocities; where nothing is lost, the energy that all had stays."""
    loss = 0.0
    for number in range(closing):
        loss += abs(world.pair_log[first + number].loss)
    before, before_low = 0.0, 0.0
    after, after_low = 0.0, 0.0
    for place in range(world.clock[0].group):
        ball = world.group[place]
        state = world.balls[ball]
        mass = world.bodies[ball].rolling_mass
        before, before_low = pair_plus(before, before_low, mass * state.square, 0.0)
        state.vx += world.shares[ball].x
        state.vy += world.shares[ball].y
        state.square = state.vx * state.vx + state.vy * state.vy
        after, after_low = pair_plus(after, after_low, mass * state.square, 0.0)
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
