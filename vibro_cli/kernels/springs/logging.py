"""The log of states after events, and the energies that are kept until the next one."""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.springs.series import energy_of, energy_of_group, group_size
from vibro_cli.kernels.springs.world import World


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
            # Between impacts of one instant bodies that were in contact may have other speeds.
            same = world.springs[body + 1].v == spring.v
            row.held = 1 if world.pairs[body].held == 1 and same else 0
        row.value = value
