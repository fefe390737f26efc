"""The tangent map of a run on the table, from the logs of its event loop.

The state has the position and velocity of each ball's centre, two numbers each. Between events the
balls are independent, so the rows of a ball are kept as at its last event. Where a gap g closes,
positions change by ``dx^+ = dx^- + (v^- - v^+) dt``, ``dt = -dg/g'``. Velocities change by the
derivative of the law, in which the normal turns by dn as the place of the contact moves. Joint
impacts give one linear system for the changes dI of all impulses:

    M(sum R n dI) = -(1 + k) M(dv) - k dM(v^-) - dM(v^+) - M(sum R dn I),

where M are the law's relative speeds (positive if pairs separate), dM their change due to dn, and R
the responses (see `impacts`).
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.numerics.double_double import time_between
from vibro_cli.kernels.table.impacts import impulses_for, join, set_weights
from vibro_cli.kernels.table.walls import bend_at
from vibro_cli.kernels.table.world import BounceRow, World
from vibro_cli.kernels.tangent.frame import (
    Tangents,
    begin_frame,
    orthogonalise,
    store_amplification,
    store_growth,
    store_no_impact,
    store_smooth,
)
from vibro_cli.kernels.world import RUNNING

NUMBERS = 4  # of the state of a ball: x, y, tau vx, tau vy

# Columns of the scratch row of a pair: its impulse, and the changes of its normal and its time.
_IMPULSE = 0
_TURN_X, _TURN_Y = 1, 2
_DELAY = 3


@kernel
def follow_balls(
    world: World, known: int, cause: int, end_t: float, end_t_low: float, tangents: Tangents
) -> None:
    """Carry tangent vectors through a part of a run.

    The arguments are those of `kernels.tangent.follow.follow_tangents`, except that ``known`` is 0
    or 1. ``world.balls`` has the times of the last events before the part. Impacts are numbered
    through both logs in the order of their events.
    """
    if known == 0:
        begin_frame(tangents)
    clock = world.clock[0]
    for ball in range(len(world.balls)):
        tangents.current[0, ball] = -1
    pair = 0
    bounce = 0
    while pair < clock.pair_rows or bounce < clock.bounce_rows:
        if _is_pair_next(world, pair, bounce):
            count = _count_of_event(world, pair)
            _meet(world, tangents, pair, count, pair + bounce)
            pair += count
        else:
            _rebound(world, tangents, bounce, pair + bounce)
            bounce += 1
    if cause != RUNNING:
        for ball in range(len(world.balls)):
            _carry(world, tangents, ball, end_t, end_t_low)
        orthogonalise(tangents)
    tangents.state[0].end_t = end_t


@kernel
def _is_pair_next(world: World, pair: int, bounce: int) -> bool:
    """Return whether the next event is an impact of two balls, and not one on the wall."""
    clock = world.clock[0]
    if pair >= clock.pair_rows:
        return False
    return bounce >= clock.bounce_rows or (
        world.pair_log[pair].event < world.bounce_log[bounce].event
    )


@kernel
def _count_of_event(world: World, first: int) -> int:
    """Return the number of impacts, from row ``first`` on, that are solved together."""
    count = 1
    event = world.pair_log[first].event
    while first + count < world.clock[0].pair_rows and world.pair_log[first + count].event == event:
        count += 1
    return count


@kernel
def _carry(world: World, tangents: Tangents, ball: int, t: float, t_low: float) -> float:
    """Carry the tangent vectors of a ball to an instant; return the time (s) of its flight."""
    state = world.balls[ball]
    age = time_between(t, t_low, state.t, state.t_low)
    share = age / tangents.state[0].time_scale
    row = NUMBERS * ball
    for column in range(len(tangents.frame)):
        tangents.frame[row, column] += share * tangents.frame[row + 2, column]
        tangents.frame[row + 1, column] += share * tangents.frame[row + 3, column]
    state.t = t
    state.t_low = t_low
    return age


@kernel
def _arrive(
    world: World, tangents: Tangents, ball: int, t: float, t_low: float, impact: int
) -> None:
    """Carry a ball to its impact; a second one at the same instant makes both not smooth."""
    age = _carry(world, tangents, ball, t, t_low)
    last = tangents.current[0, ball]
    if age == 0.0 and t > 0.0:
        tangents.state[0].rough = 1
        if last >= 0:
            tangents.smooth[0, last] = 0
    tangents.current[0, ball] = impact


@kernel
def _rebound(world: World, tangents: Tangents, bounce: int, impact: int) -> None:
    """Carry the tangent vectors across the impact of a ball on the wall."""
    row = world.bounce_log[bounce]
    tangents.state[0].rough = row.grazing
    _arrive(world, tangents, row.ball, row.t, row.t_low, impact)
    closing = row.normal_x * row.vx_pre + row.normal_y * row.vy_pre
    if world.wall[0].restitution == 0.0:
        tangents.state[0].lost = 1
    if closing > 0.0:
        _reflect(world, tangents, row, closing)
    store_growth(tangents, impact, 1)
    store_smooth(tangents, impact, 1, closing > 0.0)
    store_amplification(tangents, impact, row.ball, row.ball, NUMBERS)


@kernel
def _reflect(world: World, tangents: Tangents, row: BounceRow, closing: float) -> None:
    """Apply the derivative of a bounce at a closing speed (m/s) to the tangent vectors."""
    tau = tangents.state[0].time_scale
    more = 1.0 + world.wall[0].restitution
    nx, ny = row.normal_x, row.normal_y
    bend = bend_at(world, row)
    frame = tangents.frame
    way = NUMBERS * row.ball
    speed = way + 2
    for column in range(len(frame)):
        delay = -(nx * frame[way, column] + ny * frame[way + 1, column]) / closing
        turn_x = bend * (frame[way, column] + row.vx_pre * delay)
        turn_y = bend * (frame[way + 1, column] + row.vy_pre * delay)
        frame[way, column] += more * closing * delay * nx
        frame[way + 1, column] += more * closing * delay * ny
        change = nx * frame[speed, column] + ny * frame[speed + 1, column]
        change += tau * (turn_x * row.vx_pre + turn_y * row.vy_pre)
        frame[speed, column] -= more * (change * nx + tau * closing * turn_x)
        frame[speed + 1, column] -= more * (change * ny + tau * closing * turn_y)


@kernel
def _meet(world: World, tangents: Tangents, first: int, count: int, impact: int) -> None:
    """Carry the tangent vectors across the impacts of an event, solved together."""
    tangents.state[0].rough = 1 if count > 1 else 0
    fine = True
    for number in range(count):
        row = world.pair_log[first + number]
        if row.simultaneous == 1 or row.grazing == 1:
            tangents.state[0].rough = 1
        if row.normal_a_pre <= row.normal_b_pre or (row.admissible == 0 and row.substituted == 0):
            fine = False
        if tangents.current[0, row.a] < impact:
            _arrive(world, tangents, row.a, row.t, row.t_low, impact)
        if tangents.current[0, row.b] < impact:
            _arrive(world, tangents, row.b, row.t, row.t_low, impact)
    if fine:
        _strike(world, tangents, first, count)
    store_growth(tangents, impact, count)
    store_smooth(tangents, impact, count, fine)
    for number in range(count):
        row = world.pair_log[first + number]
        if row.admissible == 0 and row.substituted == 0:
            store_no_impact(tangents, impact + number)
        else:
            store_amplification(tangents, impact + number, row.a, row.b, NUMBERS)


@kernel
def _strike(world: World, tangents: Tangents, first: int, count: int) -> None:
    """Apply the impulses of an event and their changes to the tangent vectors."""
    restitution = world.pair_log[first].restitution
    if restitution == 0.0:
        tangents.state[0].lost = 1
    _gather(world, first, count)
    for number in range(count):
        touch = world.touches[number]
        row = world.pair_log[first + number]
        touch.left = (1.0 + restitution) * (
            touch.weight_a * row.normal_a_pre - touch.weight_b * row.normal_b_pre
        )
    impulses_for(world, count)
    for number in range(count):
        tangents.turning[number, _IMPULSE] = world.touches[number].impulse
    for column in range(len(tangents.frame)):
        for number in range(count):
            _turn(world, tangents, first, number, column)
        for number in range(count):
            world.touches[number].left = _asked(
                world, tangents, first, number, count, column, restitution
            )
        impulses_for(world, count)
        for number in range(count):
            _apply(world, tangents, number, column)


@kernel
def _gather(world: World, first: int, count: int) -> None:
    """Set the pairs of an event and the group of their balls, to solve for their impulses."""
    world.clock[0].group = 0
    for number in range(count):
        row = world.pair_log[first + number]
        world.shares[row.a].place = 0
        world.shares[row.b].place = 0
    for number in range(count):
        row = world.pair_log[first + number]
        touch = world.touches[number]
        touch.a, touch.b = row.a, row.b
        touch.normal_x, touch.normal_y = row.normal_x, row.normal_y
        set_weights(world, number, row.law)
        join(world, row.a)
        join(world, row.b)


@kernel
def _turn(world: World, tangents: Tangents, first: int, number: int, column: int) -> None:
    """Set the changes of a pair's time of impact and normal for one tangent vector."""
    row = world.pair_log[first + number]
    frame = tangents.frame
    a = NUMBERS * row.a
    b = NUMBERS * row.b
    dx = frame[b, column] - frame[a, column]
    dy = frame[b + 1, column] - frame[a + 1, column]
    apart_x = row.x_b - row.x_a
    apart_y = row.y_b - row.y_a
    apart = math.sqrt(apart_x * apart_x + apart_y * apart_y)
    delay = (row.normal_x * dx + row.normal_y * dy) / (row.normal_a_pre - row.normal_b_pre)
    tangents.turning[number, _DELAY] = delay
    tangents.turning[number, _TURN_X] = (dx + (row.vx_b_pre - row.vx_a_pre) * delay) / apart
    tangents.turning[number, _TURN_Y] = (dy + (row.vy_b_pre - row.vy_a_pre) * delay) / apart


@kernel
def _asked(
    world: World,
    tangents: Tangents,
    first: int,
    number: int,
    count: int,
    column: int,
    restitution: float,
) -> float:
    """Return the right-hand side of a pair for the change of its impulse, for a tangent vector."""
    row = world.pair_log[first + number]
    touch = world.touches[number]
    turn_x = tangents.turning[number, _TURN_X]
    turn_y = tangents.turning[number, _TURN_Y]
    tau = tangents.state[0].time_scale
    found: float = 0.0
    for other in range(count):
        found -= _shared(world, tangents, number, other, touch.a, -touch.weight_a)
        found -= _shared(world, tangents, number, other, touch.b, touch.weight_b)
    speed_a = _along(tangents, row.a, touch.normal_x, touch.normal_y, column)
    speed_b = _along(tangents, row.b, touch.normal_x, touch.normal_y, column)
    parting = (touch.weight_b * speed_b - touch.weight_a * speed_a) / tau
    before_a = turn_x * row.vx_a_pre + turn_y * row.vy_a_pre
    before_b = turn_x * row.vx_b_pre + turn_y * row.vy_b_pre
    before = touch.weight_b * before_b - touch.weight_a * before_a
    after_a = turn_x * row.vx_a_post + turn_y * row.vy_a_post
    after_b = turn_x * row.vx_b_post + turn_y * row.vy_b_post
    after = touch.weight_b * after_b - touch.weight_a * after_a
    found -= (1.0 + restitution) * parting + restitution * before + after
    return found


@kernel
def _along(tangents: Tangents, ball: int, nx: float, ny: float, column: int) -> float:
    """Return the component along a unit vector of a ball's velocity in one tangent vector."""
    row = NUMBERS * ball + 2
    along: float = nx * tangents.frame[row, column] + ny * tangents.frame[row + 1, column]
    return along


@kernel
def _shared(
    world: World, tangents: Tangents, number: int, other: int, ball: int, weight: float
) -> float:
    """Return the relative speed of pair ``number`` due to the turn of another pair's normal.

    That turn changes the velocity of a ball that both pairs share.
    """
    touch = world.touches[number]
    source = world.touches[other]
    if ball == source.a:
        response = -source.response_a
    elif ball == source.b:
        response = source.response_b
    else:
        return 0.0
    along: float = touch.normal_x * tangents.turning[other, _TURN_X]
    along += touch.normal_y * tangents.turning[other, _TURN_Y]
    along *= weight * response * tangents.turning[other, _IMPULSE]
    return along


@kernel
def _apply(world: World, tangents: Tangents, number: int, column: int) -> None:
    """Apply a pair's impulse and delay to the positions and velocities of one tangent vector."""
    touch = world.touches[number]
    frame = tangents.frame
    impulse = tangents.turning[number, _IMPULSE]
    way = impulse * tangents.turning[number, _DELAY]
    tau = tangents.state[0].time_scale
    change_x = tau * (touch.impulse * touch.normal_x + impulse * tangents.turning[number, _TURN_X])
    change_y = tau * (touch.impulse * touch.normal_y + impulse * tangents.turning[number, _TURN_Y])
    a = NUMBERS * touch.a
    b = NUMBERS * touch.b
    frame[a, column] += touch.response_a * way * touch.normal_x
    frame[a + 1, column] += touch.response_a * way * touch.normal_y
    frame[b, column] -= touch.response_b * way * touch.normal_x
    frame[b + 1, column] -= touch.response_b * way * touch.normal_y
    frame[a + 2, column] -= touch.response_a * change_x
    frame[a + 3, column] -= touch.response_a * change_y
    frame[b + 2, column] += touch.response_b * change_x
    frame[b + 3, column] += touch.response_b * change_y
