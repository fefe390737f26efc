"""When lasting contact begins, goes on and ends.

Contact is kept where the contact force presses. A pair held before keeps its contact through a
change of piece if the force still presses there; a pair that bounces with k < 1 closes when the
sum of its remaining bounces can be taken in closed form to rounding (accumulation, Zeno).
"""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.cluster.active_contacts import settle
from vibro_cli.kernels.cluster.clusters import launch_group
from vibro_cli.kernels.cluster.collocation import launch_across
from vibro_cli.kernels.contact.contact_kinematics import set_normals, set_speed
from vibro_cli.kernels.contact.wall_contact import rest
from vibro_cli.kernels.flow.begin_flight import begin_flight, log_flight
from vibro_cli.kernels.impact.chattering import NOT_YET, carry_drift, time_to_rest
from vibro_cli.kernels.impact.event_log import hold
from vibro_cli.kernels.impact.impulse_chain import held_from
from vibro_cli.kernels.impact.plastic_limit import equalise
from vibro_cli.kernels.structs import PARTING, RELEASED
from vibro_cli.kernels.world import CONTACT_CLOSED, CONTACT_OPENED, World


@kernel
def launch_chain(world: World, first: int, count: int, cause: int) -> None:
    """Launch the ``count + 1`` bodies of a chain, each run of held pairs as one group."""
    settings = world.settings[0]
    step = 0
    while step <= count:
        ball = (first + step) % settings.bodies
        length = 0
        while step + length < count and world.pairs[(ball + length) % settings.pairs].held == 1:
            length += 1
        for member in range(length + 1):
            _set_p(world, (ball + member) % settings.bodies)
        side = world.flights[ball].wall_side
        if length == 0:
            begin_flight(world, ball, cause, 1)
        else:
            _launch_together(world, ball, length + 1, cause)
        if side != 0:
            for member in range(length + 1):
                rest(world, (ball + member) % settings.bodies, side)
        step += length + 1
    for step in range(count):
        pair = world.pairs[(first + step) % settings.pairs]
        pair.touching = pair.closing
        pair.closing = 0


@kernel
def _set_p(world: World, ball: int) -> None:
    flight = world.flights[ball]
    track = world.tracks[ball * world.settings[0].pieces + flight.piece]
    flight.p = flight.speed / track.speed_factor


@kernel
def _launch_together(world: World, first: int, count: int, cause: int) -> None:
    bodies = world.settings[0].bodies
    one_piece = True
    for step in range(count - 1):
        pair = world.pairs[(first + step) % bodies]
        a = world.flights[pair.a]
        b = world.flights[pair.b]
        # On one circle they are side by side, or on both sides of its seam.
        one_piece = one_piece and a.piece == b.piece and b.lap - a.lap + pair.seam == 0
    if one_piece:
        launch_group(world, first, count)
    else:
        launch_across(world, first, count)
    for step in range(count):
        flight = world.flights[(first + step) % bodies]
        flight.group_first = first
        flight.group_count = count
        log_flight(world, (first + step) % bodies, cause)


@kernel
def relaunch_run(world: World, first: int, count: int, cause: int) -> None:
    """Launch a run of held pairs anew after a change, as far as their forces still press."""
    _set_speeds_and_normals(world, first, count)
    settle(world, first, count)
    count_corrections(world, first, count)
    _launch_unhit(world, first, count, cause)


@kernel
def _set_speeds_and_normals(world: World, first: int, count: int) -> None:
    settings = world.settings[0]
    for step in range(count + 1):
        set_speed(world, (first + step) % settings.bodies)
    for step in range(count):
        set_normals(world, (first + step) % settings.pairs)


@kernel
def _launch_unhit(world: World, first: int, count: int, cause: int) -> None:
    """Launch a chain whose speeds go on.

    Pairs beside it that part from this very instant on still do so.
    """
    left = _mark_beside(world, first - 1)
    right = _mark_beside(world, first + count)
    launch_chain(world, first, count, cause)
    _set_mark_beside(world, first - 1, left)
    _set_mark_beside(world, first + count, right)


@kernel
def _mark_beside(world: World, number: int) -> int:
    """How a pair beside a chain, if there is one, parts since the present instant (or 0)."""
    settings = world.settings[0]
    clock = world.clock[0]
    if settings.closed == 0 and not 0 <= number < settings.pairs:
        return 0
    pair = world.pairs[number % settings.pairs]
    now = pair.begin_t == clock.t and pair.begin_t_low == clock.t_low
    return pair.touching if now else 0


@kernel
def _set_mark_beside(world: World, number: int, mark: int) -> None:
    if mark != 0:
        pair = world.pairs[number % world.settings[0].pairs]
        if pair.held == 0:
            pair.touching = mark


@kernel
def count_corrections(world: World, first: int, count: int) -> None:
    """Count what equalising the speeds of bodies in contact has changed as corrections."""
    for step in range(count):
        pair = world.pairs[(first + step) % world.settings[0].pairs]
        world.clock[0].energy_correction += abs(pair.closing_loss)


@kernel
def open_contacts(world: World, j: int, first: int, count: int) -> None:
    """Free pair ``j`` of a run whose states are set: its contact force has become zero.

    Others whose forces vanish at the same instant open with it.
    """
    settings = world.settings[0]
    t = world.pairs[j].release_t
    t_low = world.pairs[j].release_t_low
    _set_speeds_and_normals(world, first, count)
    # What the flight has left of speed between them by rounding would be an impact once it is free.
    equalise(world, first, count)
    count_corrections(world, first, count)
    for step in range(count):
        number = (first + step) % settings.pairs
        pair = world.pairs[number]
        pair.closing_loss = 0.0
        if pair.release_t == t and pair.release_t_low == t_low:
            hold(world, number, 0, 0.0)
    start = 0
    while start < count:
        length = held_from(world, first, count, start)
        if length > 0:
            settle(world, (first + start) % settings.pairs, length)
        if start + length < count:
            world.pairs[(first + start + length) % settings.pairs].closing = RELEASED
        start += length + 1
    count_corrections(world, first, count)
    _launch_unhit(world, first, count, CONTACT_OPENED)


@kernel
def close_accumulated(world: World, first: int, count: int) -> bool:
    """Close the contacts of a launched chain whose remaining bounces can be summed up.

    Bodies that touch no others: the sum is that of one pair (see ``chattering.time_to_rest``).
    Returns whether any contact has closed; ``closing_loss`` is then set.
    """
    pairs = world.settings[0].pairs
    closed = False
    if count > 1:
        # A launch across pieces has left the normals of its last node.
        for step in range(count):
            set_normals(world, (first + step) % pairs)
    for step in range(count):
        pair = world.pairs[(first + step) % pairs]
        pair.closing = pair.touching
        pair.solution = NOT_YET
        if pair.held == 0 and pair.touching == PARTING:
            pair.solution = time_to_rest(world, first, count, (first + step) % pairs)
            closed = closed or pair.solution >= 0.0
    if not closed:
        return False
    for step in range(count):
        pair = world.pairs[(first + step) % pairs]
        pair.nodal[0] = 0.0
        if pair.held == 0 and pair.solution >= 0.0:
            pair.closing = 0
            pair.nodal[0] = carry_drift(world, (first + step) % pairs, pair.solution)
            hold(world, (first + step) % pairs, 1, pair.solution)
    equalise(world, first, count)
    for step in range(count):
        pair = world.pairs[(first + step) % pairs]
        pair.closing_loss += pair.nodal[0]
    launch_chain(world, first, count, CONTACT_CLOSED)
    return True
