"""What happens first within a step: two bodies touch, or a lasting contact opens."""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.numerics.conservative_advancement import NO_ROOT, first_fall
from vibro_cli.kernels.springs.world import (
    BODY_ROWS,
    FORCE,
    FREE,
    NEVER,
    ORDER,
    PARTING,
    PLACE,
    ROW,
    World,
)


@kernel
def gap_of(world: World, pair: int) -> float:
    """Return the distance (m) between a body and its right neighbour along the line."""
    one = world.springs[pair]
    other = world.springs[pair + 1]
    return (other.foot - one.foot) + (other.x - one.x) - world.pairs[pair].touch


@kernel
def first_event(world: World, step: float) -> tuple[float, int]:
    """Return when (s from now) within a step the first pair meets or parts, and which; else -1."""
    best = NEVER
    found = -1
    for pair in range(world.settings[0].bodies - 1):
        if world.pairs[pair].held == 1:
            time = _opening(world, pair, step)
        else:
            time = _meeting(world, pair, step)
        if time != NO_ROOT and time < best:
            best = time
            found = pair
    return best, found


@kernel
def _meeting(world: World, pair: int, step: float) -> float:
    """When the gap of a free pair falls to zero, without the root that is known at the start."""
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
        # Decided to part or to stay, it is zero up to rounding; the next step will tell.
        return NO_ROOT
    return first_fall(rows, base + known, base + ORDER, step)


@kernel
def _opening(world: World, pair: int, step: float) -> float:
    """When the force in a lasting contact falls to zero."""
    rows = world.gaps
    base = pair * ROW
    first = pair
    while first > 0 and world.pairs[first - 1].held == 1:
        first -= 1
    for k in range(ORDER - 1):
        common = world.series[first * BODY_ROWS + PLACE + k + 2] * (k + 1) * (k + 2)
        force = 0.0
        for body in range(first, pair + 1):
            own = world.series[body * BODY_ROWS + FORCE + k]
            force += world.bodies[body].rolling_mass * (own - common)
        rows[base + k] = force
    if rows[base] <= 0.0:
        return 0.0
    return first_fall(rows, base, base + ORDER - 2, step)


@kernel
def forget(world: World) -> None:
    """Time has passed: what was known of gaps at its start no longer holds."""
    for pair in range(world.settings[0].bodies - 1):
        if world.pairs[pair].held == 0:
            world.pairs[pair].known = FREE


@kernel
def is_in_contact(world: World, pair: int) -> bool:
    """Whether a pair is known to be in contact at the present instant."""
    state = world.pairs[pair]
    return state.held == 1 or state.known >= PARTING
