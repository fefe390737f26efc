"""The motion between the events, from the states after them: by the very steps of the solver."""

from __future__ import annotations

from collections.abc import Sequence

from vibro_cli.compile.kernel import kernel, struct
from vibro_cli.kernels.numerics.error_free import add_to_time
from vibro_cli.kernels.springs.logging import renew_energies
from vibro_cli.kernels.springs.series import energy_of, expand, go_on
from vibro_cli.kernels.springs.world import SpringBody, World


@struct
class Sample:
    """An instant at which the motion is asked for."""

    row: int  # of the first body's state in the log, after the event before the instant
    way: float  # -1: the motion from there with all speeds reversed
    t: float  # from the start of the run that way, s


@struct
class Found:
    """A body at one instant."""

    x: float  # from the foot's place, m
    v: float  # m/s
    energy: float  # over the rolling mass, m^2/s^2


@kernel
def sample_states(
    world: World,
    samples: Sequence[Sample],
    count: int,
    states: Sequence[Found],
    scratch: Sequence[SpringBody],
) -> None:
    """Fill in the states of all bodies at some instants: ``states[sample * bodies + body]``.

    Those after one event stand together, and do not fall. ``world`` has the log and is changed,
    ``scratch`` has a body for each.
    """
    bodies = world.settings[0].bodies
    clock = world.clock[0]
    row = -1
    way = 0.0
    step = 0.0
    for number in range(count):
        sample = samples[number]
        if sample.row != row or sample.way != way:
            row = sample.row
            way = sample.way
            restore(world, row, way)
            step = expand(world)
        left = sample.t - clock.t - clock.t_low
        while step <= left:
            go_on(world, step)
            clock.t, clock.t_low = add_to_time(clock.t, clock.t_low, step)
            step = expand(world)
            left = sample.t - clock.t - clock.t_low
        for body in range(bodies):
            scratch[body].x = world.springs[body].x
            scratch[body].v = world.springs[body].v
        if left > 0.0:
            go_on(world, left)
        for body in range(bodies):
            spring = world.springs[body]
            at = states[number * bodies + body]
            at.x = spring.x
            at.v = way * spring.v
            at.energy = energy_of(spring)
            spring.x = scratch[body].x
            spring.v = scratch[body].v


@kernel
def restore(world: World, row: int, way: float) -> None:
    """Put the bodies into the state after an event, with speeds times ``way``."""
    bodies = world.settings[0].bodies
    for body in range(bodies):
        state = world.states[row + body]
        world.springs[body].x = state.x
        world.springs[body].v = way * state.v
        if body < bodies - 1:
            world.pairs[body].held = state.held
    world.clock[0].t = world.states[row].t
    world.clock[0].t_low = world.states[row].t_low
    renew_energies(world)
