"""A faster path from impact to impact for two bodies that librate on one arc, with the same bits.

It leaves out all lookups, searches and bounds that such a flight does not need, and treats both
bodies at once, in the two lanes of a register. Other events are left to the event loop
(see ``kernels.ensemble.points.proceed``), after which the run returns to this path.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import Two, any_lane, extract, kernel, pack
from vibro_cli.kernels.contact.libration_contact_lanes import (
    TwoBodies,
    TwoLibrations,
    TwoTracks,
    contact_of_two,
    project_libration,
)
from vibro_cli.kernels.flow.flight import (
    CREST_NEIGHBOURHOOD,
    angular_bound_of_libration,
    energy_on_piece,
    largest_libration,
    launch,
    log_flight,
    place_at,
    size_of_root,
    specific_energy_on_arc,
)
from vibro_cli.kernels.impact.chattering import speeds_after
from vibro_cli.kernels.impact.laws import log_impact
from vibro_cli.kernels.numerics.double_double import add_to_time, time_between
from vibro_cli.kernels.numerics.elliptic import (
    PARAMETER_SPLIT,
    set_libration,
    set_theta_constants,
)
from vibro_cli.kernels.world import (
    COLLISION,
    END_COLLISIONS,
    LOG_FULL,
    PARTING,
    RUNNING,
    World,
    drop_rows,
    track_of,
    track_on,
)


@kernel
def librate(world: World, bodies: TwoBodies) -> int:
    """Go from impact to impact; return why the run stopped, or ``RUNNING`` before another event.

    Both flights are as ``libration_contact_lanes.fits`` demands.
    """
    settings = world.settings[0]
    clock = world.clock[0]
    a = world.flights[0]
    b = world.flights[1]
    two = bodies.librations[0]
    _gather(world, two, bodies.tracks[0])
    cause = RUNNING
    while True:
        if max(clock.impact_rows, clock.flight_rows) > settings.capacity:
            if settings.keep_rows == 1:
                cause = LOG_FULL
                break
            drop_rows(clock)
        set_libration(two, two.parameter, two.complementary_modulus)
        if a.frequency != b.frequency:
            a.angular_bound = angular_bound_of_libration(a.frequency, a.parameter)
            b.angular_bound = angular_bound_of_libration(b.frequency, b.parameter)
        # Count as the event loop does, whose first evaluation is that of the initial states.
        evaluations = clock.evaluations
        clock.searches += 1
        clock.evaluations += 1
        if not _next_impact(world, two, bodies.tracks[0]):
            clock.searches -= 1
            clock.evaluations = evaluations
            break
        if clock.collisions >= settings.stop_collisions:
            cause = END_COLLISIONS
            break
    _launch(world)
    return cause


@kernel
def _gather(world: World, two: TwoLibrations, tracks: TwoTracks) -> None:
    """Put both flights into lanes."""
    a = world.flights[0]
    b = world.flights[1]
    track_a = track_of(world, 0)
    track_b = track_of(world, 1)
    two.frequency = pack(a.frequency, b.frequency)
    two.flow_s = pack(a.s, b.s)
    two.flow_c = pack(a.c, b.c)
    two.flow_p = pack(a.p, b.p)
    two.specific_energy = pack(a.specific_energy, b.specific_energy)
    two.parameter = pack(a.parameter, b.parameter)
    two.complementary_modulus = pack(a.complementary_modulus, b.complementary_modulus)
    most = min(PARAMETER_SPLIT, min(largest_libration(track_a), largest_libration(track_b)))
    two.most_parameter = pack(most, most)
    two.weight = pack(world.bodies[0].weight, world.bodies[1].weight)
    tracks.speed_factor = pack(track_a.speed_factor, track_b.speed_factor)
    tracks.top = pack(track_a.top, track_b.top)
    tracks.bottom = pack(track_a.bottom, track_b.bottom)
    tracks.twice_radius = pack(track_a.twice_radius, track_b.twice_radius)


@kernel
def _launch(world: World) -> None:
    """Set up both flights for the event loop."""
    for ball in range(2):
        flight = world.flights[ball]
        set_theta_constants(flight, flight.parameter, flight.complementary_modulus)
        track = track_of(world, ball)
        launch(flight, world.bodies[ball], world.pieces[flight.piece], track, 0)


@kernel
def _next_impact(world: World, two: TwoLibrations, tracks: TwoTracks) -> bool:
    """Carry out the next impact; return False if it is not one for this path."""
    settings = world.settings[0]
    clock = world.clock[0]
    a = world.flights[0]
    b = world.flights[1]
    h = contact_of_two(two, a, b, world.contacts[a.piece], clock)
    if h <= 0.0:
        return False
    t, t_low = add_to_time(clock.t, clock.t_low, h)
    if time_between(t, t_low, settings.stop_t, 0.0) >= 0.0 or any_lane(project_libration(two)):
        return False
    before = tracks.speed_factor * two.contact_p
    wa, wb, loss, bounces = speeds_after(
        world, world.bodies[0], world.bodies[1], world.pairs[0].restitution, a.piece,
        extract(before, 0), extract(before, 1),
    )  # fmt: skip
    if not bounces:
        return False
    specific_energy_a = a.specific_energy
    specific_energy_b = b.specific_energy
    after = pack(wa, wb) / tracks.speed_factor
    more = _share_energy(world, two, tracks, after, loss)
    if more < 0:
        return False
    clock.t = t
    clock.t_low = t_low
    _arrive(world, two, before)
    row = world.impacts[clock.impact_rows]
    log_impact(world, 0, wa, wb, settings.law, loss)
    row.specific_energy_a_pre = specific_energy_a
    row.specific_energy_b_pre = specific_energy_b
    row.specific_energy_a_post = a.specific_energy
    row.specific_energy_b_post = b.specific_energy
    _depart(world, two, after, wa, wb, more)
    return True


@kernel
def _arrive(world: World, two: TwoLibrations, speed: Two) -> None:
    """Move both bodies to their contact, with their speeds (m/s) before the impact."""
    clock = world.clock[0]
    pair = world.pairs[0]
    contact = world.contacts[world.flights[0].piece]
    for ball in range(2):
        flight = world.flights[ball]
        s = extract(two.contact_s, ball)
        c = extract(two.contact_c, ball)
        place_at(flight, clock.t, clock.t_low, s, c, extract(two.contact_p, ball))
        flight.speed = extract(speed, ball)
    pair.normal_a = contact.normal_a
    pair.normal_b = contact.normal_b


@kernel
def _depart(
    world: World, two: TwoLibrations, p: Two, speed_a: float, speed_b: float, more: int
) -> None:
    """Begin and log the flights after an impact, with P and speeds (m/s).

    The body with less energy is logged first.
    """
    a = world.flights[0]
    b = world.flights[1]
    two.flow_s = two.contact_s
    two.flow_c = two.contact_c
    two.flow_p = p
    a.p = extract(p, 0)
    b.p = extract(p, 1)
    a.speed = speed_a
    b.speed = speed_b
    log_flight(world, 1 - more, COLLISION)
    log_flight(world, more, COLLISION)
    world.pairs[0].touching = PARTING


@kernel
def _share_energy(world: World, two: TwoLibrations, tracks: TwoTracks, p: Two, loss: float) -> int:
    """Set the energies and parameters of both bodies after an impact (see ``event_loop``).

    Return the body with more energy, or -1 if the energies are equal or the next flights are not
    librations far from a crest and the ends of the arc.
    """
    a, b = world.flights[0], world.flights[1]
    s, c = two.contact_s, two.contact_c
    if any_lane(c * c + p * p < CREST_NEIGHBOURHOOD) or any_lane(abs(p) >= abs(c)):
        return -1
    specific_energy = specific_energy_on_arc(tracks, s, c, p)
    energy = two.weight * specific_energy
    energy_a = extract(energy, 0)
    energy_b = extract(energy, 1)
    before = world.bodies[0].weight * a.specific_energy + world.bodies[1].weight * b.specific_energy
    total = before - loss
    if energy_a == energy_b:
        return -1
    m = s * s + p * p
    root = size_of_root(c, p)
    more = 0 if energy_a > energy_b else 1
    other = world.flights[more]
    kept = other.specific_energy
    track = track_on(world, more, a.piece)
    other.specific_energy = (total - min(energy_a, energy_b)) / world.bodies[more].weight
    rest, rest_root = energy_on_piece(other, track, track)
    if more == 0:
        m = pack(rest, extract(m, 1))
        root = pack(rest_root, extract(root, 1))
    else:
        m = pack(extract(m, 0), rest)
        root = pack(extract(root, 0), rest_root)
    if any_lane(m <= 0.0 or m >= two.most_parameter or root <= 0.0):
        other.specific_energy = kept
        return -1
    less = world.flights[1 - more]
    less.specific_energy = extract(specific_energy, 1) if more == 0 else extract(specific_energy, 0)
    world.clock[0].energy_correction += abs(total - (energy_a + energy_b))
    two.parameter = m
    two.complementary_modulus = root
    a.parameter = extract(m, 0)
    b.parameter = extract(m, 1)
    a.complementary_modulus = extract(root, 0)
    b.complementary_modulus = extract(root, 1)
    return more
