"""Balls that touch one another at one instant, and so may collide together."""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.numerics.error_free import time_between
from vibro_cli.kernels.table.queue import touching_distance
from vibro_cli.kernels.table.walls import EPSILON
from vibro_cli.kernels.table.world import World

# Centres whose distance is within so much of that of touching, as a share of their places, touch.
TOUCHING = 16.0 * EPSILON


@kernel
def find_group(world: World, a: int, b: int) -> int:
    """Note the pairs that touch at this instant and hang together with two balls; their number.

    The balls of the group stand in ``world.group``, first of them a and b.
    """
    clock = world.clock[0]
    for ball in range(len(world.balls)):
        world.shares[ball].place = 0
    world.group[0], world.group[1] = a, b
    world.shares[a].place, world.shares[b].place = 1, 2
    clock.group = 2
    count = 1
    world.touches[0].a, world.touches[0].b = a, b
    done = 0
    while done < clock.group:
        ball = world.group[done]
        for other in range(len(world.balls)):
            place = world.shares[other].place
            # Each pair once, by whichever of the two comes first; the pair of the event is there.
            if other == ball or 0 < place <= done or (done == 0 and place == 2):
                continue
            if count < len(world.touches) and are_touching(world, ball, other):
                world.touches[count].a = min(ball, other)
                world.touches[count].b = max(ball, other)
                count += 1
                if place == 0:
                    world.group[clock.group] = other
                    clock.group += 1
                    world.shares[other].place = clock.group
        done += 1
    return count


@kernel
def are_touching(world: World, a: int, b: int) -> bool:
    """Whether two balls touch at this instant, but for the rounding of their places."""
    clock = world.clock[0]
    one = world.balls[a]
    other = world.balls[b]
    past_one = time_between(clock.t, clock.t_low, one.t, one.t_low)
    past_other = time_between(clock.t, clock.t_low, other.t, other.t_low)
    x = one.x + one.vx * past_one
    y = one.y + one.vy * past_one
    dx = (other.x + other.vx * past_other) - x
    dy = (other.y + other.vy * past_other) - y
    distance = touching_distance(world, a, b)
    size = abs(x) + abs(y) + abs(dx) + abs(dy) + distance
    return dx * dx + dy * dy <= distance * (distance + 2.0 * TOUCHING * size)
