"""Impacts of two balls, and of a ball on the wall.

A law acts on the components along the horizontal line of centres; the tangential ones stay (C,
parts 1 and 2). Along that line each ball rolls as on a straight trace: the laws are those of
`kernels.impact.laws`, with ``c = 2 sqrt(r_a r_b)/(r_a + r_b)`` between it and the line of centres.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.impact.laws import NORMAL_IMPULSE, impact_of_pair
from vibro_cli.kernels.numerics.double_double import time_between
from vibro_cli.kernels.table.queue import touching_distance
from vibro_cli.kernels.table.walls import RESOLVED
from vibro_cli.kernels.table.world import (
    CONIC,
    END_INADMISSIBLE,
    END_WALL_CONTACT,
    RUNNING,
    PairRow,
    World,
)
from vibro_cli.kernels.world import BodyData

# Below this share of the speed a bounce cannot be told from rolling along: the rounding of the
# place turns the normal by about the root of it.
ALONG_THE_WALL = 1.0e-6
# Energies that differ by less, relatively, differ by rounding.
SMALL_SURPLUS = 1.0e-12


@kernel
def bring(world: World, ball: int) -> None:
    """Move a ball to the present instant."""
    clock = world.clock[0]
    state = world.balls[ball]
    past = time_between(clock.t, clock.t_low, state.t, state.t_low)
    state.x += state.vx * past
    state.y += state.vy * past
    state.t = clock.t
    state.t_low = clock.t_low


@kernel
def collide(world: World, a: int, b: int, instant: int) -> int:
    """Carry out the impact of two balls; return RUNNING or the end that it brings."""
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
    """Note an impact as it comes: places, velocities, line of centres."""
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
    row.normal_a_pre = one.vx * row.normal_x + one.vy * row.normal_y
    row.normal_b_pre = other.vx * row.normal_x + other.vy * row.normal_y
    speeds = math.sqrt(one.square) + math.sqrt(other.square)
    row.grazing = 1 if row.normal_a_pre - row.normal_b_pre <= 64.0 * RESOLVED * speeds else 0


@kernel
def apply_law(world: World, row: PairRow, law: int) -> None:
    """Set the components after the impact by a law, and the energy it takes."""
    one = world.bodies[row.a]
    other = world.bodies[row.b]
    inclined = inclination(one, other)
    row.law = law
    row.normal_a_post, row.normal_b_post, row.loss = impact_of_pair(
        law,
        world.settings[0].restitution,
        one,
        other,
        inclined,
        inclined,
        row.normal_a_pre,
        row.normal_b_pre,
    )


@kernel
def inclination(one: BodyData, other: BodyData) -> float:
    """Cosine between the line of centres of touching balls and the plane."""
    if one.radius == other.radius:
        return 1.0
    return 2.0 * math.sqrt(one.radius * other.radius) / (one.radius + other.radius)


@kernel
def _rounding(world: World, row: PairRow) -> float:
    """What of the components along the line of centres may be rounding, of all components."""
    before = math.sqrt(world.balls[row.a].square) + math.sqrt(world.balls[row.b].square)
    return RESOLVED * (before + abs(row.normal_a_post) + abs(row.normal_b_post))


@kernel
def _after(row: PairRow) -> None:
    """Set the velocities after the impact: only the components along the line have changed."""
    change_a = row.normal_a_post - row.normal_a_pre
    change_b = row.normal_b_post - row.normal_b_pre
    row.vx_a_post = row.vx_a_pre + change_a * row.normal_x
    row.vy_a_post = row.vy_a_pre + change_a * row.normal_y
    row.vx_b_post = row.vx_b_pre + change_b * row.normal_x
    row.vy_b_post = row.vy_b_pre + change_b * row.normal_y


@kernel
def _part(world: World, row: PairRow) -> None:
    """Give the balls their velocities; where nothing is lost, the energy that both had stays."""
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
    one.vx, one.vy = row.vx_a_post, row.vy_a_post
    other.vx, other.vy = row.vx_b_post, row.vy_b_post


@kernel
def bounce(world: World, ball: int) -> int:
    """Carry out the impact of a ball on the wall: the component across it becomes -k times it."""
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
    row.grazing = 1 if closing <= 64.0 * RESOLVED * speed else 0
    k = wall.restitution
    # The normal is of length 1 but for rounding, which would add up bounce after bounce.
    share = closing / (to.normal_x * to.normal_x + to.normal_y * to.normal_y)
    taken = (1.0 - k) * (1.0 + k) * closing * share
    row.loss = 0.5 * world.bodies[ball].rolling_mass * taken
    vx = state.vx - (1.0 + k) * share * to.normal_x
    vy = state.vy - (1.0 + k) * share * to.normal_y
    state.square = max(state.square - taken, 0.0)
    state.vx, state.vy = _kept(world, ball, vx, vy)
    row.vx_post, row.vy_post = state.vx, state.vy
    # Bounces along a concave wall follow one another ever faster, until the ball stays there.
    concave = wall.kind == CONIC and wall.side > 0.0
    if concave and k < 1.0 and k * closing <= ALONG_THE_WALL * speed:
        return END_WALL_CONTACT
    return RUNNING


@kernel
def _kept(world: World, ball: int, vx: float, vy: float) -> tuple[float, float]:
    """Give a velocity the speed that it has by the law; what that takes or gives is added up."""
    state = world.balls[ball]
    found = vx * vx + vy * vy
    if found == 0.0 or state.square == 0.0:
        return vx, vy
    surplus = (found - state.square) / found
    if abs(surplus) > SMALL_SURPLUS:
        return vx, vy  # the difference of large terms, k near 0: not to be told from the loss
    half_mass = 0.5 * world.bodies[ball].rolling_mass
    world.clock[0].energy_correction += half_mass * abs(found - state.square)
    return vx - 0.5 * surplus * vx, vy - 0.5 * surplus * vy
