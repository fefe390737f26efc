"""The event loop: advance to the next event and carry it out; the handler of each kind of event."""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.cluster.collocation import SEGMENT_END
from vibro_cli.kernels.cluster.contact_changes import (
    close_accumulated,
    count_corrections,
    launch_chain,
    open_contacts,
    relaunch_run,
    settle_contacts,
)
from vibro_cli.kernels.contact.contact_kinematics import (
    CONTACT_ROUNDING,
    is_bound,
    present_gap,
    set_normals,
    set_speed,
)
from vibro_cli.kernels.contact.first_contact import close_gap
from vibro_cli.kernels.events.event_detection import TO_BE_CONTINUED, first_contact, never_meet
from vibro_cli.kernels.events.simultaneous_impacts import (
    ENDLESS_ROUNDS,
    collide_jointly,
    complete_inadmissible,
    energy_of_chain,
    lifts,
)
from vibro_cli.kernels.flow.flight import (
    LIFT_OFF,
    SLOW,
    arc_energy,
    begin_flight,
    bring_to,
    is_same_instant,
    place_at,
    project,
    refer_to_separatrix,
    specific_energy_of_state,
    state_at,
)
from vibro_cli.kernels.flow.flow import acceleration_at, height_of
from vibro_cli.kernels.impact.chattering import FORCED
from vibro_cli.kernels.impact.impulse_chain import (
    bounce_is_lost,
    last_row_of,
    row_from,
    run_around,
    set_speeds_and_normals,
)
from vibro_cli.kernels.impact.laws import (
    NORMAL_IMPULSE,
    do_part,
    impact_of_pair,
    log_impact,
)
from vibro_cli.kernels.numerics.constants import EPSILON, LATEST, NEVER
from vibro_cli.kernels.numerics.double_double import add_to_time, time_between
from vibro_cli.kernels.world import (
    COLLISION,
    CROSSING,
    END_ACCUMULATION,
    END_COLLISIONS,
    END_INADMISSIBLE,
    END_LIFT_OFF,
    END_NO_MORE_COLLISIONS,
    END_OF_TRACE,
    END_REST,
    END_TIME,
    LOG_FULL,
    PARTING,
    RELEASED,
    RUNNING,
    SEGMENT,
    START,
    WALL,
    Flight,
    PairData,
    TrackData,
    World,
    drop_rows,
    flight_along,
    flights_of,
    is_now,
    number_along,
    track_of,
    track_on,
    tracks_of,
)


@kernel
def collide(world: World, j: int) -> int:
    """Carry out the impact of pair ``j`` at its contact time.

    Returns an end cause, or RUNNING.
    """
    settings = world.settings[0]
    clock = world.clock[0]
    pair = world.pairs[j]
    clock.t = pair.contact_t
    clock.t_low = pair.contact_t_low
    first, count = run_around(world, j, True)
    alone = count == 1 and _is_free(world, pair.a, pair.a_s, pair.a_c)
    if alone and _is_free(world, pair.b, pair.b_s, pair.b_c):
        cause = _collide_alone(world, j)
    else:
        at_once = is_now(world, pair.begin_t, pair.begin_t_low)
        if at_once and (pair.touching == PARTING or pair.touching == RELEASED):
            # Launched in contact, the bodies would overlap at once: the contact must be held.
            pair.pressing = FORCED
        if world.flights[pair.a].impacts > ENDLESS_ROUNDS:
            return END_ACCUMULATION
        cause = collide_jointly(world, first, count)
    if cause == RUNNING and clock.collisions >= settings.stop_collisions:
        return END_COLLISIONS
    return cause


@kernel
def _is_free(world: World, ball: int, s: float, c: float) -> bool:
    """Return whether a body that collides at ``(S, C)`` is free, with no impact at this instant."""
    clock = world.clock[0]
    flight = world.flights[ball]
    again = flight.impacts > 0 and is_same_instant(flight, clock.t, clock.t_low, s, c)
    return not is_bound(flight) and not again


@kernel
def _collide_alone(world: World, j: int) -> int:
    """Carry out the impact of two bodies that touch no others; return an end cause or RUNNING."""
    clock = world.clock[0]
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    body_a, body_b = world.bodies[pair.a], world.bodies[pair.b]
    _bring_to_contact(world, j)
    if pair.touching == PARTING:
        close_gap(world, j)
    wa, wb, loss = _apply_law(world, j)
    row = world.impacts[clock.impact_rows - 1]
    if row.admissible == 0 and row.substituted == 0:
        complete_inadmissible(world, row)
        return END_INADMISSIBLE
    if lifts(world, clock.impact_rows - 1):
        complete_inadmissible(world, row)
        return END_LIFT_OFF
    track_a, track_b = tracks_of(world, pair)
    a.p = wa / track_a.speed_factor
    b.p = wb / track_b.speed_factor
    a.speed = wa
    b.speed = wb
    _share_energy(world, pair, loss)
    pair.touching = PARTING
    if close_accumulated(world, j, 1):
        # The row includes the loss of all further bounces, which have no rows of their own.
        before = body_a.weight * a.specific_energy + body_b.weight * b.specific_energy
        row.contact = 1
        row.loss += pair.closing_loss
        after = energy_of_chain(world, j, 1)
        clock.energy_correction += abs(before - pair.closing_loss - after)
    row.specific_energy_a_post = a.specific_energy
    row.specific_energy_b_post = b.specific_energy
    return RUNNING


@kernel
def _bring_to_contact(world: World, j: int) -> None:
    """Move both bodies of a pair to their states of contact; set speeds and normals."""
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    if a.frequency > 0.0:
        pair.a_s, pair.a_c, pair.a_p = project(a, pair.a_s, pair.a_c, pair.a_p)
    if b.frequency > 0.0:
        pair.b_s, pair.b_c, pair.b_p = project(b, pair.b_s, pair.b_c, pair.b_p)
    place_at(a, pair.contact_t, pair.contact_t_low, pair.a_s, pair.a_c, pair.a_p)
    place_at(b, pair.contact_t, pair.contact_t_low, pair.b_s, pair.b_c, pair.b_p)
    set_speeds_and_normals(world, j, 1)


@kernel
def _apply_law(world: World, j: int) -> tuple[float, float, float]:
    """Apply the impact law of a pair, or its substitute, and log it; return speeds and loss."""
    settings = world.settings[0]
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    body_a, body_b = world.bodies[pair.a], world.bodies[pair.b]
    law = settings.law
    wa, wb, loss = impact_of_pair(
        law, pair.restitution, body_a, body_b, pair.normal_a, pair.normal_b, a.speed, b.speed
    )
    substituted = 0
    # Speeds after the impact have the rounding of those before it.
    size = abs(a.speed) + abs(b.speed)
    admissible = do_part(pair.normal_a, pair.normal_b, wa, wb, size)
    if not admissible and settings.substitute == 1:
        law = NORMAL_IMPULSE
        substituted = 1
        wa, wb, loss = impact_of_pair(
            law, pair.restitution, body_a, body_b, pair.normal_a, pair.normal_b, a.speed, b.speed
        )
    row = world.impacts[world.clock[0].impact_rows]
    log_impact(world, j, wa, wb, law, loss)
    row.substituted = substituted
    row.admissible = 1 if admissible else 0
    return wa, wb, loss


@kernel
def _share_energy(world: World, pair: PairData, loss: float) -> None:
    """Set the energies of both bodies after an impact, so that their sum follows the law exactly.

    The body with less energy takes it from its state, and the other one gets the rest. The
    correction is added to ``energy_correction``. A tie is shared evenly, so that mirror images stay
    mirror images.
    """
    a, b = flights_of(world, pair)
    body_a, body_b = world.bodies[pair.a], world.bodies[pair.b]
    total = body_a.weight * a.specific_energy + body_b.weight * b.specific_energy - loss
    energy_a = body_a.weight * specific_energy_of_state(world, pair.a)
    energy_b = body_b.weight * specific_energy_of_state(world, pair.b)
    excess = total - (energy_a + energy_b)
    world.clock[0].energy_correction += abs(excess)
    less, more = (pair.b, pair.a) if energy_a > energy_b else (pair.a, pair.b)
    if energy_a == energy_b:
        _carry(world, less, energy_a + 0.5 * excess)
        _carry(world, more, energy_b + 0.5 * excess)
        begin_flight(world, less, COLLISION, 0)
    else:
        _carry(world, more, total - min(energy_a, energy_b))
        begin_flight(world, less, COLLISION, 1)
    begin_flight(world, more, COLLISION, 0)


@kernel
def _carry(world: World, ball: int, energy: float) -> None:
    """Give a body an energy (J) to carry on its next flight."""
    flight = world.flights[ball]
    flight.specific_energy = energy / world.bodies[ball].weight
    refer_to_separatrix(flight, track_of(world, ball))


@kernel
def release(world: World, j: int) -> None:
    """End the lasting contact of a pair whose contact force has changed its sign."""
    clock = world.clock[0]
    pair = world.pairs[j]
    clock.t = pair.release_t
    clock.t_low = pair.release_t_low
    first, count = run_around(world, j, False)
    for step in range(count + 1):
        bring_to(world, number_along(world, first, step), clock.t, clock.t_low)
    open_contacts(world, j, first, count)


@kernel
def leave_piece(world: World, ball: int) -> int:
    """Carry out the end of a flight: a crossing, a wall, the end of the trace or a lift-off."""
    clock = world.clock[0]
    flight = world.flights[ball]
    clock.t = flight.exit_t
    clock.t_low = flight.exit_t_low
    clock.last_ball = ball
    if flight.exit_kind == LIFT_OFF:
        return END_LIFT_OFF
    if flight.grouped == 1:
        return _leave_in_group(world, ball)
    right = flight.exit_side > 0
    if not _enters_next(world, ball, right, flight.exit_p):
        return _hit_wall(world, ball, right)
    track = track_of(world, ball)
    speed = track.speed_factor * flight.p
    kinetic = 0.5 * world.bodies[ball].kappa * speed * speed / world.settings[0].gravity
    if kinetic > SLOW * flight.specific_energy:
        flight.p = rate_by_energy(world, ball, flight, track)
    elif flight.separatrix_piece < 0:
        refer_to_separatrix(flight, track)
    begin_flight(world, ball, CROSSING, 0)
    return RUNNING


@kernel
def _enters_next(world: World, ball: int, right: bool, p: float) -> bool:
    """Move a body to the end of its piece and on to the next one; return whether there is one.

    The position and the speed of its centre are continuous there.
    """
    settings = world.settings[0]
    clock = world.clock[0]
    flight = world.flights[ball]
    track = track_of(world, ball)
    s = track.right_s if right else track.left_s
    c = track.right_c if right else track.left_c
    place_at(flight, clock.t, clock.t_low, s, c, p)
    speed = track.speed_factor * p
    target = flight.piece + (1 if right else -1)
    if settings.closed == 0 and not 0 <= target < settings.pieces:
        return False
    if target < 0:
        target = settings.pieces - 1
        flight.winding_number -= 1
    elif target >= settings.pieces:
        target = 0
        flight.winding_number += 1
    clock.crossings += 1
    flight.piece = target
    track = track_on(world, ball, target)
    flight.s = track.left_s if right else track.right_s
    flight.c = track.left_c if right else track.right_c
    flight.p = speed / track.speed_factor
    return True


@kernel
def rate_by_energy(world: World, ball: int, flight: Flight, track: TrackData) -> float:
    """Return ``P`` at an end of a piece from the carried energy, with its present sign."""
    settings = world.settings[0]
    if track.path_radius == 0.0:
        rise = flight.specific_energy - (track.bottom + track.line_rise * flight.s)
        rate = math.sqrt(max(2.0 * settings.gravity * rise / world.bodies[ball].kappa, 0.0))
    else:
        m, root = arc_energy(world, ball, 0)
        s2 = flight.s * flight.s
        if s2 > 0.5:
            rate = math.sqrt(max(flight.c * flight.c - root * abs(root), 0.0))
        else:
            rate = math.sqrt(max(m - s2, 0.0))
    if rate == 0.0:
        return flight.p
    return rate if flight.p > 0.0 else -rate


@kernel
def _leave_in_group(world: World, ball: int) -> int:
    """Move a body of a group across a junction, or start the next segment of its motion."""
    settings = world.settings[0]
    clock = world.clock[0]
    flight = world.flights[ball]
    segment_only = flight.exit_kind == SEGMENT_END
    right = flight.exit_side > 0
    exit_p = flight.exit_p
    j = ball if ball < settings.pairs and world.pairs[ball].held == 1 else ball - 1
    first, count = run_around(world, j % settings.bodies, False)
    for step in range(count + 1):
        bring_to(world, number_along(world, first, step), clock.t, clock.t_low)
    if not segment_only and not _enters_next(world, ball, right, exit_p):
        return _hit_wall(world, ball, right)
    relaunch_run(world, first, count, SEGMENT if segment_only else CROSSING)
    return RUNNING


@kernel
def _hit_wall(world: World, ball: int, right: bool) -> int:
    """Carry out the impact of a body that is at a wall at the end of its flight.

    If the body is in a group, has already had an impact at this instant or makes a bounce that is
    lost in rounding, it depends on what touches it: the contacts of the whole row at the wall are
    settled.
    """
    settings = world.settings[0]
    flight = world.flights[ball]
    restitution = settings.right_wall if right else settings.left_wall
    if restitution < 0.0:
        return END_OF_TRACE
    side = 1 if right else -1
    if flight.impacts == 0 and _turns_at_wall(world, ball, side):
        return RUNNING
    arriving = flight.p
    flight.p = -restitution * flight.p
    bound = flight.grouped == 1 or flight.impacts > 0 or bounce_is_lost(world, ball, side)
    flight.impacts += 1
    if not bound:
        begin_flight(world, ball, WALL, 1 if restitution < 1.0 else 0)
        return RUNNING
    count = row_from(world, ball, right)
    first = ball - count if right else ball
    for step in range(count + 1):
        member = first + step
        if member != ball:
            bring_to(world, member, flight.t, flight.t_low)
    set_speeds_and_normals(world, first, count)
    if arriving == 0.0:
        # Launched at the wall without speed, it would pass through at once: it must be held.
        flight.pressing = FORCED
    settle_contacts(world, first, count)
    count_corrections(world, first, count)
    # Only this body hits the wall; the others continue.
    launch_chain(world, first, count, SEGMENT)
    last_row_of(world, ball).cause = WALL
    return RUNNING


# Rounding of the height to which a body alone comes back, as a share of it.
HEIGHT_ROUNDING = 4.0 * EPSILON
# ... of bodies in contact, whose energy is not carried, over that of one alone.
GROUP_ROUNDING = 64.0
# A flight that arrives with more than this share of the speed it has lost does not turn there.
TURNED = 1.0e-4


@kernel
def _turns_at_wall(world: World, ball: int, side: int) -> bool:
    """Return whether a body turns at a wall, up to the rounding of its height: let it roll off.

    A body that has rolled off a wall from rest comes back as high as that. Rounding alone would
    decide whether it hits the wall.
    """
    flight = world.flights[ball]
    track = track_of(world, ball)
    speed = abs(track.speed_factor * flight.p)
    age = flight.exit_after
    pull = -side * acceleration_at(flight, track.path_radius, age, flight.s, flight.c)
    gravity, kappa = world.settings[0].gravity, world.bodies[ball].kappa
    # Not of the trace's length, which on a long trace would hide impacts that are well resolved.
    rounding = HEIGHT_ROUNDING * height_of(track, gravity, kappa, flight.s, flight.c)
    if flight.grouped == 1:
        rounding *= GROUP_ROUNDING
    kinetic = 0.5 * kappa * speed * speed / gravity
    if not 0.0 < speed <= TURNED * pull * age or kinetic > rounding:
        return False
    first, count = ball, 0
    if flight.grouped == 1:
        first, count = run_around(world, ball if side < 0 else ball - 1, False)
    for step in range(count + 1):
        flight_along(world, first, step).p = 0.0
    relaunch_run(world, first, count, SEGMENT)
    return True


@kernel
def start(world: World) -> None:
    """Launch the first flight of every body; bodies that touch and press start in contact."""
    settings = world.settings[0]
    for ball in range(settings.bodies):
        flight = world.flights[ball]
        flight.before_s = flight.s
        flight.before_c = flight.c
        flight.before_p = flight.p
        set_speed(world, ball)
    first = 0
    while first < settings.bodies:
        count = 0
        while first + count < settings.bodies - 1 and _in_contact(world, first + count):
            count += 1
        settle_contacts(world, first, count)
        count_corrections(world, first, count)
        launch_chain(world, first, count, START)
        first += count + 1


@kernel
def _in_contact(world: World, j: int) -> bool:
    """Return whether a pair starts in contact, up to the rounding of its positions."""
    set_normals(world, j)
    gap, size = present_gap(world, j)
    return abs(gap) <= CONTACT_ROUNDING * size


@kernel
def advance(world: World) -> int:
    """Advance a run until it ends or a log has no room for another event; return the cause.

    A search that takes very long returns ``LOG_FULL`` too; the next call continues it.
    """
    settings = world.settings[0]
    clock = world.clock[0]
    while True:
        impacts = max(clock.impact_rows, clock.contact_rows)
        flights = max(clock.flight_rows, clock.segment_rows)
        if max(impacts, flights) > settings.capacity:
            if settings.keep_rows == 1:
                return LOG_FULL
            drop_rows(clock)
        horizon_t, horizon_low, ball, pair = _horizon(world)
        meeting = first_contact(world, horizon_t, horizon_low)
        if meeting == TO_BE_CONTINUED:
            return LOG_FULL
        if meeting >= 0:
            horizon_t = world.pairs[meeting].contact_t
            horizon_low = world.pairs[meeting].contact_t_low
        if clock.unlogged == 1:
            log_contacts(world, horizon_t, horizon_low)
        if meeting >= 0:
            cause = collide(world, meeting)
        elif pair >= 0:
            release(world, pair)
            cause = RUNNING
        elif ball >= 0:
            crossings = clock.crossings
            cause = leave_piece(world, ball)
            at_wall = clock.crossings == crossings
            if cause == RUNNING and settings.stop_t >= NEVER:
                cause = _end_if_over(world, at_wall)
        else:
            return _finish(world)
        if cause != RUNNING:
            return cause


# A time (s) that is negligible but not zero.
LEAST_TIME = 1.0e-300


@kernel
def _horizon(world: World) -> tuple[float, float, int, int]:
    """Return the latest possible instant of the next event: the stop, end of a flight or release.

    Returns the instant (two doubles, s), the body whose flight ends first up to the stop, and the
    pair released before that; -1 if there is none. Events at the stop itself still happen: the run
    ends ``LEAST_TIME`` after it.
    """
    settings = world.settings[0]
    t = settings.stop_t if settings.stop_t < NEVER else LATEST
    low = LEAST_TIME
    ball = -1
    for number in range(settings.bodies):
        flight = world.flights[number]
        later = time_between(flight.exit_t, flight.exit_t_low, t, low)
        if later < 0.0 or (later == 0.0 and ball < 0 and flight.exit_t < NEVER):
            ball = number
            t = flight.exit_t
            low = flight.exit_t_low
    pair = -1
    if world.clock[0].held_pairs > 0:
        for j in range(settings.pairs):
            one = world.pairs[j]
            if one.held == 1 and time_between(one.release_t, one.release_t_low, t, low) < 0.0:
                pair = j
                t = one.release_t
                low = one.release_t_low
    return t, low, ball, pair


@kernel
def _finish(world: World) -> int:
    """End a run that has no further event before its stop time, or `LATEST` without one.

    The clock stays at the last event, so that the run can be continued from there; bounces that are
    summed are events until they end.
    """
    settings = world.settings[0]
    clock = world.clock[0]
    quiet = True
    resting = True
    for ball in range(settings.bodies):
        quiet = quiet and world.flights[ball].exit_t == NEVER
        resting = resting and world.flights[ball].at_rest == 1
    for j in range(settings.pairs):
        pair = world.pairs[j]
        quiet = quiet and (pair.apart == 1 or (pair.held == 1 and pair.release_t == NEVER))
    end_t, end_low = _end_of_bounces(world)
    if quiet and end_t <= settings.stop_t:
        clock.t = end_t
        clock.t_low = end_low
        clock.quiet_from = end_t
    if settings.stop_t < NEVER or not quiet:
        return END_TIME
    return END_REST if resting else END_NO_MORE_COLLISIONS


@kernel
def _end_of_bounces(world: World) -> tuple[float, float]:
    """Return when the last summed bounces end (two doubles, s), or the present instant.

    The end is rounded as in the row of its event, which must not be later than that of the run.
    """
    t, low = world.clock[0].t, world.clock[0].t_low
    for j in range(world.settings[0].pairs):
        pair = world.pairs[j]
        end_t = pair.change_t + pair.delay
        if pair.held == 1 and time_between(end_t, pair.change_t_low, t, low) > 0.0:
            t, low = end_t, pair.change_t_low
    return t, low


# Without a stop time the loop looks whether any pair can still meet: after each impact on a wall,
# and after each crossing of a junction whose number is divisible by this.
LOOKS = 16


@kernel
def _end_if_over(world: World, at_wall: bool) -> int:
    """End a run without a stop time if no pair can meet again, after the end of a flight.

    Returns an end cause, or RUNNING.
    """
    clock = world.clock[0]
    if clock.unlogged == 1 or (clock.crossings % LOOKS != 0 and not at_wall):
        return RUNNING
    if not never_meet(world):
        return RUNNING
    clock.quiet_from = clock.t
    return END_NO_MORE_COLLISIONS


# Times that differ by less than this share of themselves are one instant.
SAME_INSTANT = 64.0 * EPSILON


@kernel
def log_contacts(world: World, t: float, t_low: float) -> None:
    """Log the contacts that have closed or opened for good before the next event at ``t``.

    Within one instant or one accumulation a contact may open and close many times.
    """
    clock = world.clock[0]
    clock.unlogged = 0
    for j in range(world.settings[0].pairs):
        pair = world.pairs[j]
        if pair.held == pair.logged:
            continue
        later = time_between(t, t_low, pair.change_t, pair.change_t_low)
        if later > pair.delay + SAME_INSTANT * abs(t):
            _log_contact(world, pair)
            pair.logged = pair.held
        else:
            clock.unlogged = 1


@kernel
def _log_contact(world: World, pair: PairData) -> None:
    clock = world.clock[0]
    row = world.touches[clock.contact_rows]
    a, b = flights_of(world, pair)
    # A relaunch at the same instant came first, even where rounding puts it later.
    late_a = time_between(a.t, a.t_low, pair.change_t, pair.change_t_low) - pair.delay
    late_b = time_between(b.t, b.t_low, pair.change_t, pair.change_t_low) - pair.delay
    late = max(0.0, max(late_a, late_b))
    row.t, row.t_low = add_to_time(pair.change_t, pair.change_t_low, late)
    row.delay = pair.delay
    row.a = pair.a
    row.b = pair.b
    row.opened = 1 - pair.held
    row.piece_a = a.piece
    row.piece_b = b.piece
    row.s, row.c, row.p = state_at(world, pair.a, row.t + pair.delay, row.t_low)
    clock.contact_rows += 1
    clock.contacts += pair.held
