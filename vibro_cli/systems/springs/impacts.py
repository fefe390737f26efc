"""Impacts of neighbours on the line, and lasting contact.

On the line both centres move along it: the laws are those of `mechanics.laws` with the cosine
``c = 2 sqrt(r_a r_b)/(r_a + r_b)`` between it and the line of centres. Impacts of several pairs at
one instant follow one another, from left to right, until no pair in contact approaches.
"""

from __future__ import annotations

import math

from vibro_cli.mechanics.laws import HEDRIH, NORMAL_IMPULSE, impact_of_pair
from vibro_cli.numerics.engine import kernel
from vibro_cli.systems.springs.search import gap_of, is_in_contact
from vibro_cli.systems.springs.series import acceleration_of, energy_of, energy_of_group, group_size
from vibro_cli.systems.springs.world import (
    COLLISION,
    CONTACT_CLOSED,
    CONTACT_OPENED,
    END_INADMISSIBLE,
    FREE,
    PARTING,
    RELEASED,
    RESTING,
    RUNNING,
    ImpactRow,
    World,
)

# Speeds within so much of each other, as a share of their sum, are equal but for rounding.
ROUNDING = 8.0 * 2.0**-52
# Bounces that would all be over within this share of 1/w0 are taken as one: what they would still
# move the bodies by is below the square of it.
NEARLY_OVER = 1.0e-7


@kernel
def approach_of(world: World, pair: int) -> float:
    """Return the speed (m/s) at which a body and its right neighbour approach; 0 if rounding."""
    one = world.springs[pair].v
    other = world.springs[pair + 1].v
    speed = one - other
    return speed if abs(speed) > ROUNDING * (abs(one) + abs(other)) else 0.0


@kernel
def settle_contacts(world: World) -> int:
    """Carry out what pairs in contact do at the present instant; RUNNING or the run's end."""
    pair = 0
    last = world.settings[0].bodies - 1
    while pair < last:
        if is_in_contact(world, pair):
            approach = approach_of(world, pair)
            if approach > 0.0:
                clock = world.clock[0]
                if clock.collisions >= world.settings[0].stop_collisions:
                    return RUNNING
                cause = collide(world, pair)
                if cause != RUNNING:
                    return cause
                pair = 0
                continue
            _keep_or_part(world, pair, approach)
        pair += 1
    return RUNNING


@kernel
def _keep_or_part(world: World, pair: int, approach: float) -> None:
    """A pair in contact that does not approach: it parts, or is pressed together and stays."""
    state = world.pairs[pair]
    if approach < 0.0:
        if state.held == 1:
            state.held = 0
            renew_energies(world)
            log_states(world, CONTACT_OPENED, pair, 0.0)
        state.known = PARTING
    elif state.held == 0 and state.known <= RESTING:
        state.known = RESTING
        if pressing(world, pair) > 0.0:
            world.springs[pair + 1].v = world.springs[pair].v
            _hold(world, pair, 0.0)


@kernel
def pressing(world: World, pair: int) -> float:
    """Return how much faster the bodies would approach if they were free, m/s^2."""
    return acceleration_of(world.springs[pair]) - acceleration_of(world.springs[pair + 1])


@kernel
def _hold(world: World, pair: int, lasting: float) -> None:
    """Begin lasting contact; the bodies have one speed."""
    world.pairs[pair].held = 1
    world.pairs[pair].known = RESTING
    world.clock[0].contacts += 1
    renew_energies(world)
    log_states(world, CONTACT_CLOSED, pair, lasting)


@kernel
def open_contact(world: World, pair: int) -> None:
    """End a lasting contact whose force has fallen to zero."""
    world.pairs[pair].held = 0
    world.pairs[pair].known = RELEASED
    renew_energies(world)
    log_states(world, CONTACT_OPENED, pair, 0.0)


@kernel
def collide(world: World, pair: int) -> int:
    """Carry out the impact of a pair; return RUNNING or the end that it brings."""
    clock = world.clock[0]
    row = world.impacts[clock.impact_rows]
    clock.impact_rows += 1
    clock.collisions += 1
    clock.steps = 0
    state = world.pairs[pair]
    _before(world, pair, row)
    row.simultaneous = 1 if clock.at_once > 0 else 0
    clock.at_once += 1
    apply_law(world, row, world.settings[0].law, state.restitution)
    separating = row.v_b_post - row.v_a_post
    if separating < -ROUNDING * (abs(row.v_a_post) + abs(row.v_b_post)):
        row.admissible = 0
        if world.settings[0].substitute == 0:
            return END_INADMISSIBLE
        row.substituted = 1
        apply_law(world, row, NORMAL_IMPULSE, state.restitution)
        separating = row.v_b_post - row.v_a_post
    lasting = _time_of_bounces(world, pair, separating)
    if lasting >= 0.0:
        row.contact = 1
        _apply_plastic(world, row)
    state.held = 0
    state.known = RESTING if row.v_a_post == row.v_b_post else PARTING
    one = world.springs[pair]
    other = world.springs[pair + 1]
    one.v = row.v_a_post
    other.v = row.v_b_post
    clock.lost += row.loss
    renew_energies(world)
    if lasting >= 0.0:
        _hold(world, pair, lasting)
    else:
        log_states(world, COLLISION, pair, 0.0)
    return RUNNING


@kernel
def _before(world: World, pair: int, row: ImpactRow) -> None:
    clock = world.clock[0]
    one = world.springs[pair]
    other = world.springs[pair + 1]
    row.t = clock.t
    row.t_low = clock.t_low
    row.pair = pair
    row.x_a = one.foot + one.x
    row.x_b = other.foot + other.x
    row.v_a_pre = one.v
    row.v_b_pre = other.v
    row.gap = gap_of(world, pair)
    row.admissible = 1
    row.substituted = 0
    row.contact = 0
    speeds = abs(one.v) + abs(other.v)
    row.grazing = 1 if one.v - other.v <= 64.0 * ROUNDING * speeds else 0


@kernel
def apply_law(world: World, row: ImpactRow, law: int, restitution: float) -> None:
    """Set the speeds after the impact by a law, and the energy it takes."""
    one = world.bodies[row.pair]
    other = world.bodies[row.pair + 1]
    inclined = 1.0
    if one.radius != other.radius:
        inclined = 2.0 * math.sqrt(one.radius * other.radius) / (one.radius + other.radius)
    row.law = law
    row.v_a_post, row.v_b_post, row.loss = impact_of_pair(
        law, restitution, one, other, inclined, inclined, row.v_a_pre, row.v_b_pre
    )


@kernel
def _time_of_bounces(world: World, pair: int, separating: float) -> float:
    """How long all further bounces would last (s), if so short that contact begins; else -1.

    Each lasts ``2 u/A`` and begins with k times the speed u of the one before.
    """
    k = world.pairs[pair].restitution
    pressed = pressing(world, pair)
    if k == 1.0 or pressed <= 0.0:
        return -1.0
    lasting = 2.0 * max(separating, 0.0) / (pressed * (1.0 - k))
    square = max(world.springs[pair].square, world.springs[pair + 1].square)
    return lasting if lasting * lasting * square <= NEARLY_OVER * NEARLY_OVER else -1.0


@kernel
def _apply_plastic(world: World, row: ImpactRow) -> None:
    """Give both bodies the speed that the bounces tend to: the law at k = 0."""
    law = row.law
    if law == HEDRIH and world.bodies[row.pair].radius != world.bodies[row.pair + 1].radius:
        law = NORMAL_IMPULSE  # equal omega would not be one speed
    apply_law(world, row, law, 0.0)
    row.v_b_post = row.v_a_post


@kernel
def renew_energies(world: World) -> None:
    """Set the energy that each group keeps from now on."""
    first = 0
    while first < world.settings[0].bodies:
        count = group_size(world, first)
        world.springs[first].energy = energy_of_group(world, first, count)
        first += count


@kernel
def log_states(world: World, cause: int, pair: int, value: float) -> None:
    """Log the state of every body after an event."""
    clock = world.clock[0]
    for body in range(world.settings[0].bodies):
        row = world.states[clock.state_rows]
        clock.state_rows += 1
        spring = world.springs[body]
        row.t = clock.t
        row.t_low = clock.t_low
        row.event = clock.collisions
        row.cause = cause
        row.pair = pair
        row.body = body
        row.x = spring.x
        row.v = spring.v
        row.energy = energy_of(spring)
        row.held = 0
        if body < world.settings[0].bodies - 1:
            row.held = world.pairs[body].held
        row.value = value


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
