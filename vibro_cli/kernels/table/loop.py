"""The event loop of the table: the first meeting of all, its impact, the search anew."""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.numerics.double_double import time_between
from vibro_cli.kernels.table.impacts import bounce, collide
from vibro_cli.kernels.table.queue import play_all, renew, search_all
from vibro_cli.kernels.table.simultaneous_impacts import collide_jointly, find_group
from vibro_cli.kernels.table.world import (
    END_ACCUMULATION,
    END_BOUNCES,
    END_COLLISIONS,
    END_NO_MORE,
    END_TIME,
    LOG_FULL,
    MEETS_BALL,
    NEVER,
    NOTHING,
    RUNNING,
    World,
)

# So many events in a row, of each ball, at what the clock shows as one instant are an accumulation.
MOST_AT_ONCE = 200


@kernel
def advance(world: World) -> int:
    """Run until the end, or until a log is full; return the cause."""
    clock = world.clock[0]
    settings = world.settings[0]
    if clock.begun == 0:
        search_all(world)
        clock.begun = 1
    play_all(world)
    while True:
        if clock.collisions >= settings.stop_collisions:
            return END_COLLISIONS
        if clock.bounces >= settings.stop_bounces:
            return END_BOUNCES
        if clock.pair_rows >= settings.room or clock.bounce_rows >= settings.room:
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
    if meeting.kind == NOTHING or meeting.t > settings.stop_time:
        return END_TIME if settings.stop_time < NEVER else END_NO_MORE
    step = time_between(meeting.t, meeting.t_low, clock.t, clock.t_low)
    clock.t = meeting.t
    clock.t_low = meeting.t_low
    instant = 1 if step == 0.0 and clock.collisions + clock.bounces > 0 else 0
    clock.stalled = clock.stalled + 1 if step <= 1.0e-15 * clock.t else 0
    if clock.stalled > MOST_AT_ONCE * len(world.balls):
        return END_ACCUMULATION
    if meeting.kind == MEETS_BALL:
        return _meet(world, ball, meeting.other, instant)
    cause = bounce(world, ball)
    if cause == RUNNING:
        renew(world, ball)
    return cause


@kernel
def _meet(world: World, ball: int, other: int, instant: int) -> int:
    """Carry out the impact of two balls, with those of others that touch them at this instant."""
    count = find_group(world, ball, other)
    if count == 1:
        cause = collide(world, ball, other, instant)
    else:
        cause = collide_jointly(world, count, instant)
    if cause == RUNNING:
        for place in range(world.clock[0].group):
            renew(world, world.group[place])
    return cause
