"""Accumulation of a pair's bounces (Zeno), summed in closed form, and its limit: a common speed.

With the parting speed u and the approach acceleration ``c`` all further bounces last
``T0 = 2 u/(c (1 - k))``, plus the terms of :func:`_changes` for a free pair on one arc. The sum is
used once the terms it omits are smaller than the uncertainty due to the rounding of the gap. If
bodies are held to others or rest against a wall, each bounce is a sequence of impacts of all of
them, which leaves the same share of the speed each time; the share left by the last bounce replaces
k.

The common speed is the limit of a contracting sequence of impacts, at one instant or in an
accumulation. In the metric of the kinetic energy, each impulse changes the speeds at right angles
to the motions in which no contact separates or closes. The component of the speeds along such
motions is therefore unchanged, and is all that remains in the end.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.contact.contact_kinematics import (
    distance_gap,
    free_acceleration,
    is_bound,
    parting_speed,
    present_approach,
    present_gap,
    speed_of_pair,
)
from vibro_cli.kernels.flow.flight import state_at
from vibro_cli.kernels.flow.flow import (
    acceleration_slopes,
    angular_acceleration,
    tangential_acceleration,
)
from vibro_cli.kernels.impact.impulse_chain import (
    apply_impulses,
    held_from,
    joins,
    pushes,
    run_around,
    share_fastest,
    simultaneous_impulses,
    touched_wall,
)
from vibro_cli.kernels.impact.laws import (
    NORMAL_IMPULSE,
    SPEED_ROUNDING,
    balances_mass,
    do_part,
    impact_of_pair,
    separation_speed,
    weight_and_response,
)
from vibro_cli.kernels.numerics.conservative_advancement import safe_step_second_order
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.kernels.world import (
    CLOSING,
    BodyData,
    Flight,
    World,
    flight_along,
    flights_of,
    is_now,
    number_along,
    pair_along,
    pair_beside,
    tracks_of,
)

# Largest bounce, relative to the bodies, whose accumulation is considered.
SMALL_BOUNCE = 1.0e-4
# Greatest height of free bounces replaced by contact, over (distance of centres)/(1 - k).
LOW_BOUNCE = 1.0e-10
# A bounce lower than this many units in the last place of the positions is lost in rounding.
LOST_BOUNCE = 4.0
# Bodies that move less than this share of a rounding from bounce to bounce count as at rest.
NOWHERE = 1.0e-3
# Bounces within which a pair must stop if its law gives it speed at each of them.
SOME_BOUNCES = 64.0
# Accelerations below this share of gravity are due to a force that is zero up to rounding.
NO_PRESSURE = 1.0e-12
NOT_YET = -1.0


@kernel
def _law_is_normal(world: World, j: int, law: int) -> bool:
    """Return whether a law acts on the speed along the line of centres, up to a positive factor."""
    pair = world.pairs[j]
    qa, _ = weight_and_response(law, world.bodies[pair.a], pair.normal_a)
    qb, _ = weight_and_response(law, world.bodies[pair.b], pair.normal_b)
    return abs(qa * pair.normal_b - qb * pair.normal_a) <= 1.0e-12 * qa * pair.normal_b


@kernel
def closing_law(world: World, first: int, count: int) -> int:
    """Return the law whose plastic impact is the limit of all bounces of a run of pairs.

    It is the law of the run if that acts along the lines of centres, since each bounce conserves
    the same sum. ``hedrih`` then conserves the same as ``normal-impulse``.
    """
    law = world.settings[0].law
    if not balances_mass(law):
        return NORMAL_IMPULSE
    for step in range(count):
        if not _law_is_normal(world, number_along(world, first, step), law):
            return NORMAL_IMPULSE
    return law


@kernel
def speeds_after(
    world: World, one: BodyData, other: BodyData, k: float, piece: int, va: float, vb: float
) -> tuple[float, float, float, bool]:
    """Return speeds (m/s) after an impact, energy lost (J), and whether its bounce is not small.

    The last is false also if the bodies do not separate.
    """
    settings = world.settings[0]
    contact = world.contacts[piece]
    normal_a, normal_b = contact.normal_a, contact.normal_b
    wa, wb, loss = impact_of_pair(settings.law, k, one, other, normal_a, normal_b, va, vb)
    u = separation_speed(normal_a, normal_b, wa, wb)
    bounces = u * u > SMALL_BOUNCE * settings.gravity * world.pairs[0].distance
    part = do_part(normal_a, normal_b, wa, wb, abs(va) + abs(vb))
    return wa, wb, loss, part and bounces


@kernel
def share_left(world: World, j: int) -> float:
    """Return the share of a pair's speed left by its bounce at this instant: k for free bodies."""
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    if pair.struck == 0.0 or not (is_bound(a) or is_bound(b)):
        return pair.restitution
    return parting_speed(world, j) / pair.struck


@kernel
def repeats(world: World, first: int, count: int, j: int) -> bool:
    """Return whether only pair ``j`` of a chain moves: the others are held or at rest at a wall."""
    for step in range(count):
        other = number_along(world, first, step)
        if other != j and world.pairs[other].held == 0:
            return False
    for end in range(2):
        ball = first if end == 0 else number_along(world, first, count)
        flight = world.flights[ball]
        if touched_wall(world, ball) != 0 and flight.speed != 0.0:
            return False
    return True


@kernel
def time_to_rest(world: World, first: int, count: int, j: int) -> float:
    """Return the duration (s) of all further bounces of a pair just launched.

    Returns ``NOT_YET`` if they cannot be summed. ``first`` and ``count`` give the chain that it has
    been launched with.
    """
    pair = world.pairs[j]
    u = parting_speed(world, j)
    if u * u > SMALL_BOUNCE * world.settings[0].gravity * pair.distance:
        return NOT_YET
    c = -present_approach(world, j)
    still = u <= SPEED_ROUNDING * speed_of_pair(world, j)
    if still and abs(c) <= NO_PRESSURE * world.settings[0].gravity:
        return 0.0  # on one line nothing separates them either
    if c <= 0.0:
        return NOT_YET
    normal = _law_is_normal(world, j, pair.law)
    # Just launched, the pair approaches by rounding only.
    if normal and still:
        return 0.0
    _, size = present_gap(world, j)
    rounding = EPSILON * size
    lost = u * u <= 2.0 * c * LOST_BOUNCE * rounding
    if not normal and world.flights[pair.a].grouped + world.flights[pair.b].grouped == 0:
        # There is no sum. Free bodies bounce, timed by displacements, until they no longer move, or
        # until most of the bounce is the speed that the law gives each time.
        nowhere = 2.0 * u * speed_of_pair(world, j) <= NOWHERE * c * rounding
        lasting = 2.0 * _speed_given(world, j) >= (1.0 - pair.restitution) * u
        lasting = lasting and not _is_stopped(world, j, 2.0 * u / c)
        return 0.0 if still or (lost and (nowhere or lasting)) else NOT_YET
    share = share_left(world, j)
    a, b = flights_of(world, pair)
    once = is_bound(a) or is_bound(b)
    once = once and (pair.struck == 0.0 or not repeats(world, first, count, j))
    if not normal or share >= 1.0 or once:
        # Nothing accumulates, but a bounce lower than the rounding of the positions is contact.
        return 0.0 if lost else NOT_YET
    return _summed(world, j, u, c, share, rounding, lost)


@kernel
def _summed(
    world: World, j: int, u: float, c: float, share: float, rounding: float, lost: bool
) -> float:
    """Return the sum of bounces that leave a share of the speed each; ``NOT_YET`` if uncertain.

    The sum of bounces lost in rounding needs no such test.
    """
    pair = world.pairs[j]
    delay = 2.0 * u / (c * (1.0 - share))
    if not lost and 0.5 * abs(_drift(world, j)) * delay * delay > rounding:
        return NOT_YET
    if not lost:
        delay = _refined(world, j, u, c, share, rounding, delay)
        if delay < 0.0 or not _undisturbed(world, j, delay):
            return NOT_YET
    if delay >= world.flights[pair.a].exit_after or delay >= world.flights[pair.b].exit_after:
        return NOT_YET
    return delay


@kernel
def _speed_given(world: World, j: int) -> float:
    """Return the normal speed (m/s) that the law of a pair gives to it if it has none.

    Bounces under the law tend to this over ``1 - k``, not to zero.
    """
    pair = world.pairs[j]
    scale = world.flights[pair.a].speed + world.flights[pair.b].speed
    scale /= pair.normal_a + pair.normal_b
    after_a, after_b, _ = impact_of_pair(
        pair.law, pair.restitution, world.bodies[pair.a], world.bodies[pair.b],
        pair.normal_a, pair.normal_b, pair.normal_b * scale, pair.normal_a * scale,
    )  # fmt: skip
    return separation_speed(pair.normal_a, pair.normal_b, after_a, after_b)


@kernel
def _is_stopped(world: World, j: int, lasts: float) -> bool:
    """Return whether the forces on a pair stop it within ``SOME_BOUNCES`` bounces of ``lasts`` (s).

    What a law gives at each bounce then vanishes with the speed of the pair.
    """
    pair = world.pairs[j]
    speed = world.flights[pair.a].speed + world.flights[pair.b].speed
    pull = free_acceleration(world, pair.a) + free_acceleration(world, pair.b)
    return speed * pull < 0.0 and SOME_BOUNCES * lasts * abs(pull) >= abs(speed)


@kernel
def _drift(world: World, j: int) -> float:
    """Return what the bounces of a pair add to its acceleration in contact (m/s^2).

    ``translational`` conserves the momentum ``sum m v``. In free flight this grows by the mean of
    the accelerations weighted with m; in contact the mean weighted with ``kappa m`` applies.
    """
    pair = world.pairs[j]
    body_a, body_b = world.bodies[pair.a], world.bodies[pair.b]
    a, b = flights_of(world, pair)
    if not balances_mass(pair.law) or body_a.kappa == body_b.kappa or a.grouped + b.grouped > 0:
        return 0.0
    pull_a = free_acceleration(world, pair.a)
    pull_b = free_acceleration(world, pair.b)
    by_mass = (body_a.mass * pull_a + body_b.mass * pull_b) / (body_a.mass + body_b.mass)
    rolling = body_a.rolling_mass + body_b.rolling_mass
    return by_mass - (body_a.rolling_mass * pull_a + body_b.rolling_mass * pull_b) / rolling


@kernel
def carry_drift(world: World, j: int, delay: float) -> float:
    """Add to the speed of a pair in contact what its bounces will have added to it in the end.

    Returns the energy lost (J). Must be called before the contact is closed.
    """
    pair = world.pairs[j]
    added = _drift(world, j) * delay
    if added == 0.0 or not _undisturbed(world, j, delay):
        return 0.0
    taken = 0.0
    for end in range(2):
        ball = pair.a if end == 0 else pair.b
        speed = world.flights[ball].speed
        taken -= world.bodies[ball].rolling_mass * added * (speed + 0.5 * added)
        world.flights[ball].speed = speed + added
    return taken


@kernel
def _refined(
    world: World, j: int, u: float, c: float, share: float, rounding: float, first_term: float
) -> float:
    """Return the sum of bounces with the changes of ``c``; ``NOT_YET`` while that is inaccurate.

    It is not used either while the bounces are so high that contact does not represent them.
    """
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    free = a.piece == b.piece and a.grouped == 0 and b.grouped == 0 and a.own_frequency > 0.0
    rate = _jerk(a, pair.distance) + _jerk(b, pair.distance)
    if not free:
        # Greater than the rates (1/s) at which the geometry of the pair changes.
        fastest = (abs(a.speed) + abs(b.speed)) / pair.distance + a.frequency + b.frequency
        rate += (a.acceleration_bound + b.acceleration_bound) * fastest
        missing = first_term * first_term * rate / c
        return first_term if missing * u <= rounding else NOT_YET
    # The uncertainty of the speed left by the bounces before is a series of squares.
    left = 1.0 - share
    uncertain = rounding / (u * left * math.sqrt(left * (1.0 + share)))
    missing = first_term * rate / c
    if first_term * missing * missing * missing > uncertain:
        return NOT_YET
    if u * u * left > 2.0 * c * LOW_BOUNCE * pair.distance:
        return NOT_YET
    return first_term * (1.0 + _changes(world, j, c, share, first_term))


@kernel
def _jerk(flight: Flight, distance: float) -> float:
    """Return a bound (m/s^3) on the jerk of a body at a ``distance`` (m) from another.

    The derivatives of a flight are those of an angle on an arc and of a distance on a line.
    """
    return flight.jerk_bound * (distance if flight.own_frequency > 0.0 else 1.0)


@kernel
def _changes(world: World, j: int, c: float, k: float, time: float) -> float:
    """Return what changes of ``c`` add to the sum T of a free pair's bounces on one arc, over T.

    This is ``-c' T/3c`` and, divided by ``9 (1 + k + k^2)``: ``(2 + 3k + 2k^2) (c' T/c)^2``, three
    quarters of ``-(1 + k)^2 c'' T^2/c`` and three quarters of ``-(1 - k)^2 w^2 T^2``. The
    derivatives of ``c`` are along the motion in contact; ``w^2`` is that with respect to the gap.
    """
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    track_a, track_b = tracks_of(world, pair)
    _, gives_a = weight_and_response(pair.law, world.bodies[pair.a], pair.normal_a)
    _, gives_b = weight_and_response(pair.law, world.bodies[pair.b], pair.normal_b)
    # Shares of both bodies in a change of the difference of their angles.
    share_a = gives_a * track_b.path_radius
    share_a /= share_a + gives_b * track_a.path_radius
    share_b = 1.0 - share_a
    slope_a, bend_a = acceleration_slopes(a, a.s, a.c)
    slope_b, bend_b = acceleration_slopes(b, b.s, b.c)
    rate = 2.0 * (share_b * a.own_frequency * a.p + share_a * b.own_frequency * b.p)
    acceleration = share_b * angular_acceleration(a, a.s, a.c)
    acceleration += share_a * angular_acceleration(b, b.s, b.c)
    # On one arc the distance grows with the angle by n t_a rho_a.
    scale = track_a.path_radius * pair.normal_a * time / c
    slope = scale * (slope_b - slope_a)
    first = slope * rate
    second = (scale * (bend_b - bend_a) * rate * rate + slope * acceleration) * time
    own = (slope_a * share_a + slope_b * share_b) * (time * time)
    terms = 0.75 * ((1.0 + k) * (1.0 + k) * second + (1.0 - k) * (1.0 - k) * own)
    terms += (2.0 + 3.0 * k + 2.0 * k * k) * first * first
    return first * (1.0 / 3.0) + terms / (9.0 * (1.0 + k + k * k))


@kernel
def _undisturbed(world: World, j: int, delay: float) -> bool:
    """Return whether no other body can hit a pair, or those held to it, before a delay (s)."""
    first, count = run_around(world, j, False)
    for side in range(2):
        outer = pair_beside(world, first, -1 if side == 0 else count)
        other = world.settings[0].bodies > count + 1 and outer >= 0
        if other and (_is_hit_now(world, outer, side) or _earliest_contact(world, outer) <= delay):
            return False
    return True


@kernel
def _is_hit_now(world: World, outer: int, side: int) -> bool:
    """Return whether the far body of an outer pair is in another impact at this instant.

    The order of the two impacts must not matter: the motion of that body after its impact is not
    known yet, or was not known when the other pair was handled.
    """
    pair = world.pairs[outer]
    if pair.touching != 0:
        return False  # it is the same impact
    flight = world.flights[pair.a if side == 0 else pair.b]
    if is_now(world, flight.t, flight.t_low):
        return True
    beyond = outer
    for _ in range(world.settings[0].pairs):
        beyond = pair_beside(world, beyond, 1 if side == 1 else -1)
        if beyond < 0:
            return False
        other = world.pairs[beyond]
        if is_now(world, other.contact_t, other.contact_t_low) or other.touching == CLOSING:
            return True
        if not joins(world, beyond, True):
            return False
    return False


@kernel
def _earliest_contact(world: World, j: int) -> float:
    """Return a time (s) for which a pair certainly stays apart, from gap, rate and bounds."""
    clock = world.clock[0]
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    track_a, track_b = tracks_of(world, pair)
    a_s, a_c, a_p = state_at(world, pair.a, clock.t, clock.t_low)
    b_s, b_c, b_p = state_at(world, pair.b, clock.t, clock.t_low)
    along_a = tangential_acceleration(a, track_a.path_radius, a_s, a_c)
    along_b = tangential_acceleration(b, track_b.path_radius, b_s, b_c)
    gap, rate, _ = distance_gap(
        world.pieces[a.piece], track_a, world.pieces[b.piece], track_b,
        (a_s, a_c, a_p, b_s, b_c, b_p), (along_a, along_b), pair.distance,
    )  # fmt: skip
    if pair.touching != 0:
        gap = 0.0  # whatever the rounding of their positions
    bound = a.acceleration_bound + b.acceleration_bound
    return safe_step_second_order(max(gap, 0.0), rate, bound)


# ``pressing`` of a pair, or of a body at a wall: separates or closes, may be held, is held.
FREE = 0
PROPOSED = 1
PRESSING = 2
FORCED = 3  # held, as the motion itself proves: without the contact the bodies would overlap


@kernel
def equalise(world: World, first: int, count: int) -> None:
    """Give the bodies of each run of held pairs one common normal speed (plastic impulses).

    The energy lost is kept in ``closing_loss``. Other pairs that close as a result, even if they
    have just separated, are marked as ``CLOSING``.
    """
    # Twice the rounding of speeds in an impact: a pair marked as closing closes there too.
    rounding = 2.0 * SPEED_ROUNDING * share_fastest(world, first, count)
    start = 0
    while start < count:
        length = held_from(world, first, count, start)
        if length > 0:
            _equalise_run(world, number_along(world, first, start), length, rounding)
        start += length + 1
    for step in range(count):
        pair = pair_along(world, first, step)
        if pair.held == 0:
            pair.closing_loss = 0.0
            parting = parting_speed(world, number_along(world, first, step))
            if parting < -rounding:
                pair.closing = CLOSING


@kernel
def _equalise_run(world: World, begin: int, length: int, rounding: float) -> None:
    """Give the bodies of one run of held pairs a common normal speed, zero at a wall."""
    left = world.flights[begin].wall_side
    right = flight_along(world, begin, length).wall_side
    if left != 0 or right != 0:
        _stop_run(world, begin, length, left if left != 0 else right)
        return
    law = closing_law(world, begin, length)
    for step in range(length):
        j = number_along(world, begin, step)
        world.pairs[j].closing_loss = half_approach(world, j, law)
    simultaneous_impulses(world, begin, length, law, 1)
    apply_impulses(world, begin, length, law)
    for step in range(length):
        j = number_along(world, begin, step)
        pair = world.pairs[j]
        if balances_mass(law):
            pair.closing_loss += half_approach(world, j, law)
        pair.closing_loss *= pair.solution
    end = number_along(world, begin, length)
    if _is_held_by_wall(world, begin, rounding) or _is_held_by_wall(world, end, rounding):
        for step in range(length + 1):
            flight_along(world, begin, step).speed = 0.0


@kernel
def _is_held_by_wall(world: World, ball: int, rounding: float) -> bool:
    """Return whether a body moves only by rounding towards a wall that it touches."""
    towards = world.flights[ball].speed * touched_wall(world, ball)
    return 0.0 < towards <= rounding


@kernel
def half_approach(world: World, j: int, law: int) -> float:
    """Return half the approach speed (m/s) on which a pair's impulse does work.

    The loss is the impulse times the sum of this before and after.
    """
    pair = world.pairs[j]
    if balances_mass(law):
        # The law conserves m v, so q = m h, but the energy is kappa m v^2/2.
        qa, _ = weight_and_response(law, world.bodies[pair.a], pair.normal_a)
        qb, _ = weight_and_response(law, world.bodies[pair.b], pair.normal_b)
        a = world.bodies[pair.a].kappa * qa * world.flights[pair.a].speed
        return 0.5 * (a - world.bodies[pair.b].kappa * qb * world.flights[pair.b].speed)
    return -0.5 * parting_speed(world, j)


@kernel
def _stop_run(world: World, begin: int, length: int, side: int) -> None:
    """Stop a run of held pairs that rests against a wall; each pair gets its share of the loss."""
    for step in range(length):
        pair = pair_along(world, begin, step)
        loss_a = energy_of_motion(world, pair.a)
        loss_b = energy_of_motion(world, pair.b)
        if step > 0:
            loss_a *= 0.5
        if step < length - 1:
            loss_b *= 0.5
        pair.closing_loss = loss_a + loss_b
    for step in range(length + 1):
        flight = flight_along(world, begin, step)
        flight.speed = 0.0
        flight.wall_side = side


@kernel
def energy_of_motion(world: World, ball: int) -> float:
    """Return the kinetic energy (J) of a body with its scratch speed."""
    speed = world.flights[ball].speed
    return 0.5 * world.bodies[ball].rolling_mass * speed * speed


@kernel
def lean(flight: Flight, side: int) -> None:
    """Set a body at rest against a wall."""
    flight.pressing = PRESSING
    flight.wall_side = side
    flight.speed = 0.0


@kernel
def press_speeds(world: World, first: int, count: int, law: int) -> float:
    """Set the impulses (``solution``) of the plastic impact of a chain with the walls it touches.

    Impulses are positive only where speeds would close without them (``pressing`` is ``PRESSING``),
    and none closes with them. Of all motions that do not close, the result is the one nearest to
    the motion before, measured by the kinetic energy of the difference. Contacts are added as in
    ``contact_changes._press``. Returns the energy (J) lost at once at walls.
    """
    rounding = SPEED_ROUNDING * share_fastest(world, first, count)
    taken = 0.0
    for step in range(count):
        pair_along(world, first, step).pressing = FREE
    found = True
    while found:
        found = False
        _solve_speeds(world, first, count, law)
        for step in range(count + 1):
            flight_along(world, first, step).nodal[0] = _speed_after(world, first, count, step, law)
        for step in range(count):
            pair = pair_along(world, first, step)
            after_a = world.flights[pair.a].nodal[0]
            after_b = world.flights[pair.b].nodal[0]
            parting = separation_speed(pair.normal_a, pair.normal_b, after_a, after_b)
            if pair.pressing == FREE and parting < -rounding:
                pair.pressing = PRESSING
                found = True
        for end in range(2):
            ball = first if end == 0 else number_along(world, first, count)
            flight = world.flights[ball]
            side = touched_wall(world, ball)
            if flight.wall_side == 0 and flight.nodal[0] * side > rounding:
                energy = energy_of_motion(world, ball)
                taken += energy
                flight.specific_energy -= energy / world.bodies[ball].weight
                lean(flight, side)
                found = True
    return taken


@kernel
def _solve_speeds(world: World, first: int, count: int, law: int) -> None:
    """Solve for the impulses of each run of pressing pairs of a chain; the others have none."""
    start = 0
    while start < count:
        length = pressing_from(world, first, count, start)
        if length > 0:
            simultaneous_impulses(world, number_along(world, first, start), length, law, 1)
        start += length + 1


@kernel
def pressing_from(world: World, first: int, count: int, start: int) -> int:
    """Return the number of consecutive pressing pairs from position ``start`` of a chain.

    The pair after them, if there is one, gets a zero ``solution``.
    """
    length = 0
    while start + length < count:
        pair = pair_along(world, first, start + length)
        if pair.pressing != PRESSING:
            pair.solution = 0.0
            break
        length += 1
    return length


@kernel
def _speed_after(world: World, first: int, count: int, step: int, law: int) -> float:
    """Return the speed (m/s) of a body in a chain after impulses (``solution``) of its pairs."""
    flight = flight_along(world, first, step)
    if flight.wall_side != 0:
        return 0.0
    left, right = pushes(world, first, count, step, law)
    return flight.speed + (left - right)
