"""Plastic impacts: a common normal speed for bodies that stay together, with the walls they touch.

They are where a sequence of impacts that contracts ends, at one instant or in an accumulation: each
impulse of it changes the speeds at right angles, measured by the kinetic energy, to the motions in
which none of its contacts parts or closes, so that the part of the speeds which is such a motion
stays as it was, and is all that is left in the end.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.contact.contact_kinematics import parting_speed
from vibro_cli.kernels.contact.wall_contact import touched_wall
from vibro_cli.kernels.impact.chattering import closing_law
from vibro_cli.kernels.impact.event_log import SPEED_ROUNDING
from vibro_cli.kernels.impact.impulse_chain import (
    apply_impulses,
    held_from,
    joint_impulses,
    share_fastest,
)
from vibro_cli.kernels.impact.laws import TRANSLATIONAL, weight_and_response
from vibro_cli.kernels.structs import CLOSING, Flight
from vibro_cli.kernels.world import World

# ``pressing`` of a pair, or of a body at a wall: parts or closes, may be held, is held.
FREE = 0
PROPOSED = 1
PRESSING = 2
FORCED = 3  # proved by the motion itself: without the contact they would be in one another


@kernel
def equalise(world: World, first: int, count: int) -> None:
    """Give the bodies of each run of held pairs one common normal speed (plastic impulses).

    What that takes is kept in ``closing_loss``. Pairs that close then, which may just have parted,
    are marked as ``CLOSING``.
    """
    pairs = world.settings[0].pairs
    # Twice what counts as no speed in an impact: what is marked as closing closes there too.
    rounding = 2.0 * SPEED_ROUNDING * share_fastest(world, first, count)
    start = 0
    while start < count:
        length = held_from(world, first, count, start)
        if length > 0:
            _equalise_run(world, (first + start) % pairs, length, rounding)
        start += length + 1
    for step in range(count):
        pair = world.pairs[(first + step) % pairs]
        if pair.held == 0:
            pair.closing_loss = 0.0
            parting = parting_speed(world, (first + step) % pairs)
            if parting < -rounding:
                pair.closing = CLOSING


@kernel
def _equalise_run(world: World, begin: int, length: int, rounding: float) -> None:
    """Give the bodies of one run of held pairs a common normal speed, none at a wall."""
    settings = world.settings[0]
    left = world.flights[begin].wall_side
    right = world.flights[(begin + length) % settings.bodies].wall_side
    if left != 0 or right != 0:
        _stop_run(world, begin, length, left if left != 0 else right)
        return
    law = closing_law(world, begin, length)
    for step in range(length):
        j = (begin + step) % settings.pairs
        world.pairs[j].closing_loss = half_approach(world, j, law)
    joint_impulses(world, begin, length, law, 1)
    apply_impulses(world, begin, length, law)
    for step in range(length):
        j = (begin + step) % settings.pairs
        pair = world.pairs[j]
        if law == TRANSLATIONAL:
            pair.closing_loss += half_approach(world, j, law)
        pair.closing_loss *= pair.solution
    end = (begin + length) % settings.bodies
    if _is_stopped(world, begin, rounding) or _is_stopped(world, end, rounding):
        for step in range(length + 1):
            world.flights[(begin + step) % settings.bodies].speed = 0.0


@kernel
def _is_stopped(world: World, ball: int, rounding: float) -> bool:
    """Tell whether a body moves towards a wall that it touches, by rounding only."""
    towards = world.flights[ball].speed * touched_wall(world, ball)
    return 0.0 < towards <= rounding


@kernel
def half_approach(world: World, j: int, law: int) -> float:
    """Half the speed whose sum before and after, times the impulse of a pair, is its work (m/s)."""
    pair = world.pairs[j]
    if law == TRANSLATIONAL:
        # The law balances m v, the bodies carry kappa m v^2/2.
        a = world.bodies[pair.a].kappa * world.flights[pair.a].speed
        return 0.5 * (a - world.bodies[pair.b].kappa * world.flights[pair.b].speed)
    return -0.5 * parting_speed(world, j)


@kernel
def _stop_run(world: World, begin: int, length: int, side: int) -> None:
    """Stop a run of held pairs that leans on a wall; each pair takes its share of the energy."""
    settings = world.settings[0]
    for step in range(length):
        pair = world.pairs[(begin + step) % settings.pairs]
        loss_a = _energy_of_motion(world, pair.a)
        loss_b = _energy_of_motion(world, pair.b)
        if step > 0:
            loss_a *= 0.5
        if step < length - 1:
            loss_b *= 0.5
        pair.closing_loss = loss_a + loss_b
    for step in range(length + 1):
        flight = world.flights[(begin + step) % settings.bodies]
        flight.speed = 0.0
        flight.wall_side = side


@kernel
def _energy_of_motion(world: World, ball: int) -> float:
    speed = world.flights[ball].speed
    return 0.5 * world.bodies[ball].rolling_mass * speed * speed


@kernel
def lean(flight: Flight, side: int) -> None:
    """Let a body lean on a wall, without speed."""
    flight.pressing = PRESSING
    flight.wall_side = side
    flight.speed = 0.0


@kernel
def press_speeds(world: World, first: int, count: int, law: int) -> float:
    """Set the impulses (``solution``) of the plastic impact of a chain with the walls it touches.

    They are positive only where speeds would close without them (``pressing`` is ``PRESSING``), and
    none closes with them: of all motions that do not close it is the one nearest to that before,
    measured by the kinetic energy of the difference. Contacts are added as in ``_press``. Returns
    the energy (J) that walls take at once.
    """
    settings = world.settings[0]
    rounding = SPEED_ROUNDING * share_fastest(world, first, count)
    taken = 0.0
    for step in range(count):
        world.pairs[(first + step) % settings.pairs].pressing = FREE
    found = True
    while found:
        found = False
        _solve_speeds(world, first, count, law)
        for step in range(count + 1):
            world.flights[(first + step) % settings.bodies].nodal[0] = _speed_after(
                world, first, count, step, law
            )
        for step in range(count):
            pair = world.pairs[(first + step) % settings.pairs]
            after_a = world.flights[pair.a].nodal[0]
            after_b = world.flights[pair.b].nodal[0]
            parting = pair.normal_b * after_b - pair.normal_a * after_a
            if pair.pressing == FREE and parting < -rounding:
                pair.pressing = PRESSING
                found = True
        for end in range(2):
            ball = first if end == 0 else (first + count) % settings.bodies
            flight = world.flights[ball]
            side = touched_wall(world, ball)
            if flight.wall_side == 0 and flight.nodal[0] * side > rounding:
                taken += _energy_of_motion(world, ball)
                lean(flight, side)
                found = True
    return taken


@kernel
def _solve_speeds(world: World, first: int, count: int, law: int) -> None:
    """Find the impulses of each run of pressing pairs of a chain; the others have none."""
    pairs = world.settings[0].pairs
    start = 0
    while start < count:
        length = pressing_from(world, first, count, start)
        if length > 0:
            joint_impulses(world, (first + start) % pairs, length, law, 1)
        start += length + 1


@kernel
def pressing_from(world: World, first: int, count: int, start: int) -> int:
    """Number of pressing pairs in a row from place ``start`` of a chain on.

    The pair after them, if there is one, is left without a ``solution``.
    """
    length = 0
    while start + length < count:
        pair = world.pairs[(first + start + length) % world.settings[0].pairs]
        if pair.pressing != PRESSING:
            pair.solution = 0.0
            break
        length += 1
    return length


@kernel
def _speed_after(world: World, first: int, count: int, step: int, law: int) -> float:
    """Speed (m/s) of a body of a chain after the impulses (``solution``) of its pairs."""
    settings = world.settings[0]
    ball = (first + step) % settings.bodies
    flight = world.flights[ball]
    if flight.wall_side != 0:
        return 0.0
    left = 0.0
    right = 0.0
    if step > 0:
        pair = world.pairs[(first + step - 1) % settings.pairs]
        _, h = weight_and_response(law, world.bodies[ball], pair.normal_b)
        left = pair.solution * h
    if step < count:
        pair = world.pairs[(first + step) % settings.pairs]
        _, h = weight_and_response(law, world.bodies[ball], pair.normal_a)
        right = pair.solution * h
    return flight.speed + (left - right)
