"""The event loop of the table: find the first meeting, carry out its impact, search again.

The row of a ball holds the first of its meetings with the wall and with balls of greater index.
After an event only the affected rows are searched again, and their matches in the tournament are
replayed, log2 n for each row. A bound of the time to contact rejects most pairs, in loops over
plain arrays that the compiler vectorises.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.numerics.constants import EPSILON, NEVER
from vibro_cli.kernels.numerics.double_double import add_to_time, time_between
from vibro_cli.kernels.table.impacts import bounce, collide, collide_jointly, find_group
from vibro_cli.kernels.table.walls import (
    RESOLVED,
    meet_wall,
    time_to_distance,
    touching_distance,
)
from vibro_cli.kernels.table.world import MEETS_BALL, MEETS_WALL, NO_WALL, NOTHING, World
from vibro_cli.kernels.world import (
    END_ACCUMULATION,
    END_BOUNCES,
    END_COLLISIONS,
    END_NO_MORE_COLLISIONS,
    END_TIME,
    LOG_FULL,
    ROWS_OF_EVENT,
    RUNNING,
)


@kernel
def note_motion(world: World, ball: int) -> None:
    """Copy the position and velocity of a ball at its last event to the plain arrays."""
    state = world.balls[ball]
    world.x[ball], world.y[ball] = state.x, state.y
    world.vx[ball], world.vy[ball] = state.vx, state.vy


@kernel
def time_to_pair(world: World, a: int, b: int) -> float:
    """Return the time (s) from now until two balls touch, or NEVER.

    They touch when the horizontal distance of their centres is ``2 sqrt(r_a r_b)`` (C, part 1).
    """
    one = world.balls[a]
    other = world.balls[b]
    distance = touching_distance(world, a, b)
    rounding = RESOLVED * (one.fastest + other.fastest)
    dx = world.x[b] - world.x[a]
    dy = world.y[b] - world.y[a]
    return time_to_distance(dx, dy, other.vx - one.vx, other.vy - one.vy, distance, rounding)


# Bound of the rounding of d^2 - D^2 in `sift`, as a share of d^2 + D^2.
SIFTED = 32.0 * EPSILON
# Squares of speeds (m^2/s^2) below which products with the least lengths, 1e-30 m, lose digits.
SLOW = 1.0e-240


@kernel
def sift(world: World, ball: int, first: int, last: int) -> None:
    """Set a lower bound (s) of ``time_to_pair`` for each of some other balls: NEVER for most.

    Where ``c = d^2 - D^2`` and the approach ``b = -d w`` are positive, the balls touch at
    ``t = c/(root + b)``, ``root^2 = b^2 - w^2 c``: not before ``c/2b``, and never if
    ``w^2 c > b^2``. Since ``time_to_distance`` requires w^2 t <= 2b, all rounding errors, there (of
    ``root`` too) and here, amount to an error of c below 22 EPSILON of d^2 + D^2. For very slow
    balls the bound is 0, since the squares of their speeds have few digits, or none.
    """
    x, y = world.x[ball], world.y[ball]
    vx, vy = world.vx[ball], world.vy[ball]
    four_radii = 4.0 * world.radii[ball]
    for other in range(first, last):
        dx = world.x[other] - x
        dy = world.y[other] - y
        wx = world.vx[other] - vx
        wy = world.vy[other] - vy
        approach = -(dx * wx + dy * wy)
        square = wx * wx + wy * wy
        apart = dx * dx + dy * dy
        touching = four_radii * world.radii[other]
        beyond = (apart - touching) - SIFTED * (apart + touching)
        time = beyond / (2.0 * approach if approach > 0.0 else 1.0)
        time = NEVER if square * beyond > approach * approach else time
        time = time if square > SLOW else 0.0
        world.sifted[other] = NEVER if approach <= 0.0 else time


@kernel
def search_row(world: World, ball: int) -> None:
    """Find the next meeting of a ball with the wall or a ball of greater index."""
    row = world.meetings[ball]
    best = NEVER
    if world.wall[0].kind != NO_WALL:
        row.kind = MEETS_WALL
        x, y = world.x[ball], world.y[ball]
        best = meet_wall(world, world.bodies[ball], world.balls[ball], x, y, row)
    sift(world, ball, ball + 1, len(world.balls))
    for other in range(ball + 1, len(world.balls)):
        if world.sifted[other] >= best:
            continue
        time = time_to_pair(world, ball, other)
        if time < best:
            best = time
            row.kind = MEETS_BALL
            row.other = other
    _set_time(world, ball, best)


@kernel
def _set_time(world: World, ball: int, time: float) -> None:
    row = world.meetings[ball]
    if time >= NEVER:
        row.kind = NOTHING
        row.t = NEVER
        row.t_low = 0.0
    else:
        clock = world.clock[0]
        row.t, row.t_low = add_to_time(clock.t, clock.t_low, time)
    _play(world, ball)


@kernel
def renew(world: World, ball: int) -> None:
    """Search again for all meetings that depend on the motion of one ball."""
    clock = world.clock[0]
    world.stale[0] = ball
    stale = 1
    sift(world, ball, 0, ball)
    for earlier in range(ball):
        if world.partners[earlier] == ball:
            world.stale[stale] = earlier
            stale += 1
        elif world.sifted[earlier] < NEVER:
            row = world.meetings[earlier]
            time = time_to_pair(world, ball, earlier)
            if time < time_between(row.t, row.t_low, clock.t, clock.t_low):
                row.kind = MEETS_BALL
                row.other = ball
                _set_time(world, earlier, time)
    for number in range(stale):
        search_row(world, world.stale[number])


@kernel
def sooner(world: World, one: int, other: int) -> int:
    """Return the ball of two that has the earlier meeting, ``one`` if both are at once."""
    if other >= len(world.balls):
        return one
    a = world.meetings[one]
    b = world.meetings[other]
    if b.t < a.t or (b.t == a.t and b.t_low < a.t_low):
        return other
    return one


@kernel
def _play(world: World, ball: int) -> None:
    """Replay the matches of one ball up to the root, and store the ball that it meets."""
    row = world.meetings[ball]
    world.partners[ball] = row.other if row.kind == MEETS_BALL else -1
    leaves = len(world.tree)
    node = (leaves + ball) // 2
    while node >= 1:
        left = 2 * node
        if left >= leaves:
            world.tree[node] = sooner(world, left - leaves, left + 1 - leaves)
        else:
            world.tree[node] = sooner(world, world.tree[left], world.tree[left + 1])
        node //= 2


# An accumulation is this many successive events per ball that the clock cannot tell apart.
MOST_AT_ONCE = 200


@kernel
def advance(world: World) -> int:
    """Run until the end, or until a log is full; return the cause."""
    clock = world.clock[0]
    settings = world.settings[0]
    # Positions are needed now only at the start, where no ball has moved; an event renews them all.
    for ball in range(len(world.balls)):
        note_motion(world, ball)
    if clock.begun == 0:
        for ball in range(len(world.balls)):
            search_row(world, ball)
        clock.begun = 1
    # The tournament and the partners follow from the meetings alone.
    for ball in range(len(world.balls)):
        _play(world, ball)
    while True:
        if clock.collisions >= settings.stop_collisions:
            return END_COLLISIONS
        if clock.bounces >= settings.stop_bounces:
            return END_BOUNCES
        rows = max(clock.pair_rows, clock.bounce_rows)
        if rows >= settings.capacity:
            # Keep the rows of one instant together as long as there is room.
            meeting = world.meetings[world.tree[1]]
            later = time_between(meeting.t, meeting.t_low, clock.t, clock.t_low) > 0.0
            if later or rows > 2 * settings.capacity - ROWS_OF_EVENT * len(world.balls):
                return LOG_FULL
        cause = _event(world)
        if cause != RUNNING:
            return cause


@kernel
def _event(world: World) -> int:
    """Carry out the next event; return RUNNING or the cause of the end."""
    clock = world.clock[0]
    settings = world.settings[0]
    ball = world.tree[1]
    meeting = world.meetings[ball]
    later = time_between(meeting.t, meeting.t_low, settings.stop_time, 0.0) > 0.0
    if meeting.kind == NOTHING or later:
        return END_TIME if settings.stop_time < NEVER else END_NO_MORE_COLLISIONS
    step = time_between(meeting.t, meeting.t_low, clock.t, clock.t_low)
    clock.t = meeting.t
    clock.t_low = meeting.t_low
    instant = 1 if step == 0.0 and clock.collisions + clock.bounces > 0 else 0
    clock.stalled = clock.stalled + 1 if step <= 1.0e-15 * clock.t else 0
    if clock.stalled > MOST_AT_ONCE * len(world.balls):
        return END_ACCUMULATION
    for number in range(len(world.balls)):
        state = world.balls[number]
        past = time_between(clock.t, clock.t_low, state.t, state.t_low)
        world.x[number] = state.x + state.vx * past
        world.y[number] = state.y + state.vy * past
    if meeting.kind == MEETS_BALL:
        return _meet(world, ball, meeting.other, instant)
    cause = bounce(world, ball)
    if cause == RUNNING:
        note_motion(world, ball)
        renew(world, ball)
    return cause


@kernel
def _meet(world: World, ball: int, other: int, instant: int) -> int:
    """Carry out the impact of two balls, jointly with balls that touch them at this instant."""
    count = find_group(world, ball, other)
    if count == 1:
        cause = collide(world, ball, other, instant)
    else:
        cause = collide_jointly(world, count, instant)
    if cause == RUNNING:
        for place in range(world.clock[0].group):
            note_motion(world, world.group[place])
        for place in range(world.clock[0].group):
            renew(world, world.group[place])
    return cause
