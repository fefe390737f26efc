"""The event loop of the springs: a step of the series, cut at the first event within it."""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.numerics.conservative_advancement import NO_ROOT, first_zero_crossing
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.numerics.double_double import add_to_time
from vibro_cli.kernels.springs.impacts import (
    collide_approaching,
    first_closing,
    note_touching,
    open_contact,
    rounding_of_pressing,
    settle_contacts,
)
from vibro_cli.kernels.springs.series import (
    STEP,
    expand,
    gap_of,
    go_on,
    group_size,
    log_states,
    mass_of_group,
    renew_energies,
)
from vibro_cli.kernels.springs.world import (
    BODY_ROWS,
    COLLIDED,
    DECISION,
    FORCE,
    FREE,
    IMPACTS,
    ORDER,
    PARTING,
    PLACE,
    ROW,
    SETTLED,
    START,
    SpringBody,
    World,
)
from vibro_cli.kernels.world import (
    END_COLLISIONS,
    END_NO_MORE_COLLISIONS,
    END_QUIET,
    END_TIME,
    LOG_FULL,
    ROWS_OF_EVENT,
    RUNNING,
)


@kernel
def first_event(world: World, step: float, unit: float) -> tuple[float, int]:
    """Return the time (s from now) and the pair of the first contact change within a step.

    A pair meets or separates; the pair is -1 if there is none. ``unit`` is the unit of time (s) of
    the series.
    """
    best = NEVER
    found = -1
    end = step / unit
    for pair in range(len(world.bodies) - 1):
        if world.pairs[pair].held == 1:
            time = _opening(world, pair, end)
        else:
            time = _meeting(world, pair, end)
        if time != NO_ROOT and time < best:
            best = time
            found = pair
    return best * unit, found


@kernel
def _meeting(world: World, pair: int, end: float) -> float:
    """Return when the gap of a free pair falls to zero, apart from the known root at the start.

    Here and in `_opening` times are in the unit of the series, from now to ``end``; NO_ROOT if
    there is none.
    """
    rows = world.gaps
    known = world.pairs[pair].known
    base = pair * ROW
    left = pair * BODY_ROWS + PLACE
    right = left + BODY_ROWS
    for k in range(ROW):
        rows[base + k] = world.series[right + k] - world.series[left + k]
    if known == FREE:
        rows[base] = gap_of(world, pair)
    elif known == PARTING:
        rows[base + 1] = max(rows[base + 1], 0.0)
    elif rows[base + known] <= 0.0:
        # Contact was not kept, so this term is zero up to rounding; the next step decides.
        return NO_ROOT
    return first_zero_crossing(rows, base + known, base + ORDER, end)


@kernel
def _opening(world: World, pair: int, end: float) -> float:
    """Return when the force of a lasting contact between two groups of bodies falls to zero."""
    rows = world.gaps
    base = pair * ROW
    first = pair
    while first > 0 and world.pairs[first - 1].held == 1:
        first -= 1
    left = pair + 1 - first
    right = group_size(world, first) - left
    for k in range(ORDER - 1):
        rows[base + k] = _common(world, first, left, k) - _common(world, pair + 1, right, k)
    # A contact whose force starts at zero holds if its first term beyond rounding is positive.
    known = 0
    reach = end / STEP
    power = 1.0
    while rows[base + known] <= 0.0:
        rounding = rounding_of_pressing(world, first, left, right)
        if -rows[base + known] * power > rounding * (known + 1) * (known + 2):
            return 0.0
        known += 1
        power *= reach
        if known == ORDER - 2:
            return NO_ROOT
    return first_zero_crossing(rows, base + known, base + ORDER - 2, end)


@kernel
def _common(world: World, first: int, count: int, k: int) -> float:
    """Return coefficient k of the common acceleration (m/s^2) of bodies that move as one."""
    force = 0.0
    for body in range(first, first + count):
        force += world.bodies[body].rolling_mass * world.series[body * BODY_ROWS + FORCE + k]
    return force / mass_of_group(world, first, count)


# A run ends after this many steps without an impact.
MOST_STEPS = 20_000_000


@kernel
def advance(world: World) -> int:
    """Run until the end, or until a log is full; return the cause.

    A run that ends by time stays at the start of its last step until ``finishing`` is set.
    """
    clock = world.clock[0]
    settings = world.settings[0]
    if settings.finishing == 1:
        return _finish(world)
    if clock.begun == 0:
        clock.begun = 1
        clock.unsettled = IMPACTS
        note_touching(world)
        renew_energies(world)
        log_states(world, START, 0, 0.0)
    cause = _run(world)
    clock.work = 0
    return cause


@kernel
def _run(world: World) -> int:
    """Advance step by step; return the cause of the end, or LOG_FULL."""
    clock = world.clock[0]
    settings = world.settings[0]
    while True:
        clock.work += 1
        # Keep the rows of one instant together: the driver makes room for them if it can.
        capacity = settings.capacity
        if clock.at_once > 0:
            capacity = 2 * settings.capacity - ROWS_OF_EVENT * len(world.bodies)
        if clock.impact_rows >= capacity or clock.state_rows >= capacity:
            return LOG_FULL
        if clock.work >= 2 * settings.capacity:  # lets the driver report progress, see interrupts
            return LOG_FULL
        if clock.unsettled != SETTLED:
            cause = _settle(world)
        elif clock.collisions >= settings.stop_collisions:
            return END_COLLISIONS
        else:
            cause = _step(world)
        if cause != RUNNING:
            return cause


@kernel
def _settle(world: World) -> int:
    """Do the next task for bodies in contact now; return RUNNING or the cause of the end."""
    clock = world.clock[0]
    if clock.unsettled == IMPACTS:
        # A round of impacts is completed even beyond the greatest number of collisions.
        begun = first_closing(world) < len(world.bodies) - 1
        if begun or clock.collisions < world.settings[0].stop_collisions:
            cause = collide_approaching(world)
            if cause != RUNNING:
                return RUNNING if cause == COLLIDED else cause
        clock.unsettled = DECISION
    settle_contacts(world)
    return RUNNING


@kernel
def _step(world: World) -> int:
    """Move on by one step, or to the first event within it; return RUNNING or the end's cause."""
    clock = world.clock[0]
    settings = world.settings[0]
    left = settings.stop_time - clock.t - clock.t_low
    if left <= 0.0:
        return END_TIME
    clock.steps += 1
    if clock.steps % 1024 == 1 and settings.stop_time >= NEVER and never_meet(world):
        return END_NO_MORE_COLLISIONS
    if clock.steps > MOST_STEPS:
        return END_QUIET
    step, unit = expand(world)
    # Search the whole step, wherever the run stops: a continued run then has the same bits.
    time, pair = first_event(world, step, unit)
    if pair >= 0:
        step = time
    if step > left or (step == left and pair < 0):
        clock.steps -= 1
        return END_TIME
    _go_on(world, step, unit)
    if pair >= 0:
        if world.pairs[pair].held == 1 and time > 0.0:
            clock.unsettled = DECISION  # decide all: other contacts may depend on this one
        elif world.pairs[pair].held == 1:
            open_contact(world, pair)
        else:
            world.pairs[pair].known = PARTING
            note_touching(world)
            clock.unsettled = IMPACTS
    return RUNNING


@kernel
def _go_on(world: World, step: float, unit: float) -> None:
    """Move all bodies on by a time (s) within the step of their series, conserving energies."""
    clock = world.clock[0]
    go_on(world, step, unit)
    clock.t, clock.t_low = add_to_time(clock.t, clock.t_low, step)
    if step > 0.0:
        # What was known of the gaps no longer holds.
        for pair in range(len(world.bodies) - 1):
            if world.pairs[pair].held == 0:
                world.pairs[pair].known = FREE
        for body in range(len(world.bodies)):
            world.springs[body].fastest = 0.0
        clock.at_once = 0
        clock.rounds = 0


@kernel
def _finish(world: World) -> int:
    """Move all bodies from the end of the last whole step to the end of the run."""
    clock = world.clock[0]
    end = world.settings[0].stop_time
    left = end - clock.t - clock.t_low
    if left > 0.0:
        _, unit = expand(world)
        _go_on(world, left, unit)
    clock.t, clock.t_low = end, 0.0
    return END_TIME


@kernel
def never_meet(world: World) -> bool:
    """Return whether the energies keep all neighbours apart for ever.

    False if any are in lasting contact, since these may still separate.
    """
    for pair in range(len(world.bodies) - 1):
        if world.pairs[pair].held == 1:
            return False
        one = world.springs[pair]
        other = world.springs[pair + 1]
        if one.foot + farthest(one, 1.0) + world.pairs[pair].touch >= other.foot - farthest(
            other, -1.0
        ):
            return False
    return True


@kernel
def farthest(spring: SpringBody, side: float) -> float:
    """Return how far (m from its foot) a body's energy lets it go to a side (+1 right, -1 left).

    The length of its spring stays within l -+ sqrt(2 e)/w; below the energy of the saddle the body
    stays on its side of the foot.
    """
    swing = math.sqrt(2.0 * spring.energy / spring.square) * (1.0 + 1.0e-12)
    longest = spring.length + swing
    outer = math.sqrt(max(longest * longest - spring.height * spring.height, 0.0))
    shortest = spring.length - swing
    if shortest > spring.height and spring.x * side < 0.0:
        return -math.sqrt(shortest * shortest - spring.height * spring.height)
    return outer
