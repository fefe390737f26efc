"""Runs of several scenarios in the lanes of registers: from impact to impact, with their summaries.

Lanes hold the runs in which both bodies librate on one arc, from one impact to the next. For an
impact between librations that are not near a crest or an end of the arc, and whose bounces are not
small, lanes perform without branches the operations of ``kernels.events.event_loop`` and
``kernels.flow.flight``, and the sums of ``kernels.statistics.run_statistics``. All other events,
and those whose lane fails because bounds do not decide there, are left to the kernels of single
runs, after which the run returns to its lane. The bits are those of single runs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from vibro_cli.compile.kernel import LANES, Lanes, any_lane, extract, insert, kernel, struct
from vibro_cli.kernels.contact.libration_contact_lanes import (
    LONGEST_STAY,
    BodyLanes,
    LibrationLanes,
    contact_in_lanes,
    fits,
    project_libration,
)
from vibro_cli.kernels.ensemble.records import Points, prepare_point, update_point_statistics
from vibro_cli.kernels.events.event_loop import advance, start
from vibro_cli.kernels.flow.flight import (
    CREST_NEIGHBOURHOOD,
    angular_bound_of_libration,
    largest_libration,
    launch_and_log,
    size_of_root,
    specific_energy_on_arc,
)
from vibro_cli.kernels.flow.flow import CAUTION
from vibro_cli.kernels.impact.chattering import speeds_after
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.numerics.double_double import add_to_time, time_between
from vibro_cli.kernels.numerics.elliptic import PARAMETER_SPLIT, set_libration, set_theta_constants
from vibro_cli.kernels.statistics.run_statistics import Results, arc_extremes, gap_on_arc
from vibro_cli.kernels.world import (
    COLLISION,
    END_COLLISIONS,
    LOG_FULL,
    PARTING,
    RUNNING,
    TrackData,
    World,
    track_on,
)


@kernel
def range_in_lanes(
    libration: LibrationLanes, duration: Lanes, s: Lanes, p: Lanes
) -> tuple[Lanes, Lanes, bool]:
    """Return the extremes of ``S^2`` over a flight that ends in a state, and where they are unsure.

    The angle of the flow's theta functions grows by pi in half a period.
    """
    start = libration.flow_s * libration.flow_s
    end = s * s
    angle = libration.frequency * duration * libration.argument_scale
    whole = angle > math.pi
    turned = libration.flow_p * p <= 0.0 and abs(libration.flow_p) > 0.0
    high = libration.parameter if whole or turned else max(start, end)
    inward = libration.flow_s * libration.flow_c * libration.flow_p < 0.0
    again = whole or (inward and angle > 0.5 * math.pi)
    low = 0.0 if again or libration.flow_s * s < 0.0 else min(start, end)
    margin = math.pi * CAUTION
    unsure = abs(angle - math.pi) < margin or abs(angle - 0.5 * math.pi) < margin
    return low, high, unsure


@struct
class RunLanes:
    """The run in every lane, with fields as in ``Clock``, ``Settings`` and ``Outcome``."""

    piece: int  # the arc
    t: Lanes  # time of the last impact, at which both flights began
    t_low: Lanes
    restitution: Lanes
    stop_t: Lanes
    stop_collisions: Lanes
    collisions: Lanes
    energy_correction: Lanes
    max_gap: Lanes
    least_force: Lanes
    most_demand: Lanes
    failed: Lanes  # 1: lanes cannot carry out the next impact


@struct
class LaneSlot:
    """The run in a lane."""

    point: int  # -1: none
    collisions: int  # when it was put in, as the next two, which do not change in lanes
    crossings: int
    contacts: int


class LaneGroup(NamedTuple):
    """The structs of a group of lanes."""

    runs: Sequence[RunLanes]  # one
    bodies: Sequence[BodyLanes]  # two
    librations: Sequence[LibrationLanes]  # two
    slots: Sequence[LaneSlot]  # one for each lane


@kernel
def next_impact(world: World, group: LaneGroup) -> bool:
    """Move on to the next impact in every lane; a lane that fails keeps its state.

    Return which lanes have failed or are at their last impact.
    """
    run = group.runs[0]
    a = group.librations[0]
    b = group.librations[1]
    track_a = track_on(world, 0, run.piece)
    track_b = track_on(world, 1, run.piece)
    set_libration(a, a.parameter, a.complementary_modulus)
    set_libration(b, b.parameter, b.complementary_modulus)
    if a.frequency != b.frequency:
        a.angular_bound = angular_bound_of_libration(a.frequency, a.parameter)
        b.angular_bound = angular_bound_of_libration(b.frequency, b.parameter)
    h, failed = contact_in_lanes(a, b, world.contacts[run.piece])
    t, t_low = add_to_time(run.t, run.t_low, h)
    failed = failed or time_between(t, t_low, run.stop_t, 0.0) >= 0.0
    failed = project_libration(a) or failed
    failed = project_libration(b) or failed
    excess, lost = _collide(world, group)
    failed = failed or lost
    failed = failed or _is_other(a, track_a) or _is_other(b, track_b)
    duration = (t - run.t) + (t_low - run.t_low)
    failed = _count(world, group, duration, failed) or failed
    run.t = run.t if failed else t
    run.t_low = run.t_low if failed else t_low
    done = 0.0 if failed else 1.0
    run.failed = 1.0 - done
    run.collisions += done
    run.energy_correction += 0.0 if failed else abs(excess)
    _take(a, failed)
    _take(b, failed)
    return failed or run.collisions >= run.stop_collisions


@kernel
def _collide(world: World, group: LaneGroup) -> tuple[Lanes, bool]:
    """Carry out the impact: set the states, energies and parameters after it.

    Return the energy correction (J), and the lanes that cannot carry out the impact.
    """
    run = group.runs[0]
    a = group.librations[0]
    b = group.librations[1]
    body_a = group.bodies[0]
    body_b = group.bodies[1]
    track_a = track_on(world, 0, run.piece)
    track_b = track_on(world, 1, run.piece)
    speed_a = track_a.speed_factor * a.contact_p
    speed_b = track_b.speed_factor * b.contact_p
    wa, wb, loss, bounces = speeds_after(
        world, body_a, body_b, run.restitution, run.piece, speed_a, speed_b
    )
    a.next_p = wa / track_a.speed_factor
    b.next_p = wb / track_b.speed_factor
    total = body_a.weight * a.specific_energy + body_b.weight * b.specific_energy - loss
    specific_energy_a = specific_energy_on_arc(track_a, a.contact_s, a.contact_c, a.next_p)
    specific_energy_b = specific_energy_on_arc(track_b, b.contact_s, b.contact_c, b.next_p)
    energy_a = body_a.weight * specific_energy_a
    energy_b = body_b.weight * specific_energy_b
    less = energy_a < energy_b
    # The body with less energy gets that of its state, the other one the rest of the total.
    spare = (total - (energy_a if less else energy_b)) / (body_b.weight if less else body_a.weight)
    a.next_specific_energy = specific_energy_a if less else spare
    b.next_specific_energy = spare if less else specific_energy_b
    m, root = _energy_of_state(a, b, less)
    rest, rest_root = _parameter_of_specific_energy(track_a, track_b, less, spare)
    a.next_m = m if less else rest
    b.next_m = rest if less else m
    a.next_root = root if less else rest_root
    b.next_root = rest_root if less else root
    sure = bounces and (less or energy_b < energy_a)
    return total - (energy_a + energy_b), not sure


@kernel
def _energy_of_state(a: LibrationLanes, b: LibrationLanes, of_a: bool) -> tuple[Lanes, Lanes]:
    """Return the parameter of one body's state after the impact, and its complementary modulus."""
    s = a.contact_s if of_a else b.contact_s
    c = a.contact_c if of_a else b.contact_c
    p = a.next_p if of_a else b.next_p
    root = size_of_root(c, p)
    return s * s + p * p, root if abs(p) < abs(c) else -1.0


@kernel
def _parameter_of_specific_energy(
    track_a: TrackData, track_b: TrackData, of_b: bool, specific_energy: Lanes
) -> tuple[Lanes, Lanes]:
    """Return the parameter of one body with a specific energy, and its complementary modulus."""
    twice = track_b.twice_radius if of_b else track_a.twice_radius
    complement = ((track_b.top if of_b else track_a.top) - specific_energy) / twice
    m = max((specific_energy - (track_b.bottom if of_b else track_a.bottom)) / twice, 0.0)
    root = math.sqrt(abs(complement))
    return 1.0 - complement if complement < 0.5 else m, root if complement > 0.0 else -1.0


@kernel
def _is_other(libration: LibrationLanes, track: TrackData) -> bool:
    """Return where the next flight is not a libration far from a crest and the arc's ends."""
    crest = (
        libration.contact_c * libration.contact_c + libration.next_p * libration.next_p
        < CREST_NEIGHBOURHOOD
    )
    most = min(PARAMETER_SPLIT, largest_libration(track))
    librates = libration.next_m > 0.0 and libration.next_m < most and libration.next_root > 0.0
    return crest or not librates


@kernel
def _count(world: World, group: LaneGroup, duration: Lanes, failed: bool) -> bool:
    """Tally the flights that end and the gap of the impact; return where that fails."""
    run = group.runs[0]
    a = group.librations[0]
    b = group.librations[1]
    body_a = group.bodies[0]
    body_b = group.bodies[1]
    piece = world.pieces[run.piece]
    low_a, high_a, open_a = range_in_lanes(a, duration, a.contact_s, a.contact_p)
    low_b, high_b, open_b = range_in_lanes(b, duration, b.contact_s, b.contact_p)
    failed = failed or open_a or open_b
    least, most = run.least_force, run.most_demand
    least, most = arc_extremes(body_a, piece, a.parameter, low_a, high_a, least, most)
    least, most = arc_extremes(body_b, piece, b.parameter, low_b, high_b, least, most)
    run.least_force = run.least_force if failed else least
    run.most_demand = run.most_demand if failed else most
    rho_a = track_on(world, 0, run.piece).path_radius
    rho_b = track_on(world, 1, run.piece).path_radius
    gap = gap_on_arc(
        rho_a * rho_b, body_a.radius, body_b.radius,
        a.contact_s, a.contact_c, b.contact_s, b.contact_c,
    )  # fmt: skip
    run.max_gap = run.max_gap if failed else max(run.max_gap, abs(gap))
    return failed


@kernel
def _take(libration: LibrationLanes, failed: bool) -> None:
    """Begin the next flight in all lanes that have not failed."""
    libration.flow_s = libration.flow_s if failed else libration.contact_s
    libration.flow_c = libration.flow_c if failed else libration.contact_c
    libration.flow_p = libration.flow_p if failed else libration.next_p
    libration.specific_energy = (
        libration.specific_energy if failed else libration.next_specific_energy
    )
    libration.parameter = libration.parameter if failed else libration.next_m
    libration.complementary_modulus = (
        libration.complementary_modulus if failed else libration.next_root
    )


@kernel
def run_points_in_lanes(
    world: World, fresh: World, points: Points, results: Results, group: LaneGroup
) -> int:
    """Run the points of a batch, as ``kernels.ensemble.points.run_points``.

    No impacts are kept. ``group`` must be set up for the arc. Return the number of impacts carried
    out in lanes.
    """
    upcoming = 0
    made = 0
    working = 0
    for lane in range(LANES):
        upcoming = _fill(world, fresh, points, results, group, lane, upcoming)
        working += 1 if group.slots[lane].point >= 0 else 0
    run = group.runs[0]
    while working > 0:
        called = next_impact(world, group)
        made += working
        if any_lane(called):
            working = 0
            for lane in range(LANES):
                point = group.slots[lane].point
                failed = extract(run.failed, lane) > 0.0
                ended = extract(run.collisions, lane) >= extract(run.stop_collisions, lane)
                if point >= 0 and (failed or ended):
                    made -= 1 if failed else 0
                    _take_out(world, fresh, points, results, group, lane)
                    if ended or not _alone(world, points, results, group, lane, 2):
                        if ended:
                            update_point_statistics(
                                world, 2, END_COLLISIONS, points, results, point
                            )
                        upcoming = _fill(world, fresh, points, results, group, lane, upcoming)
                working += 1 if group.slots[lane].point >= 0 else 0
    return made


@kernel
def _fill(
    world: World,
    fresh: World,
    points: Points,
    results: Results,
    group: LaneGroup,
    lane: int,
    upcoming: int,
) -> int:
    """Put the next run that reaches a state for lanes into a lane; return the run after it."""
    while upcoming < len(points.own):
        group.slots[lane].point = upcoming
        prepare_point(world, fresh, points, upcoming)
        start(world)
        upcoming += 1
        if _alone(world, points, results, group, lane, 0):
            return upcoming
    group.slots[lane].point = -1
    return upcoming


@kernel
def _alone(
    world: World,
    points: Points,
    results: Results,
    group: LaneGroup,
    lane: int,
    known: int,
) -> bool:
    """Run on with the kernels of single runs; return whether that reached a state for lanes.

    The logs of ``world`` begin with ``known`` flights that have been tallied before.
    """
    point = group.slots[lane].point
    clock = world.clock[0]
    most = points.own[point].stop_collisions
    stay = 1
    cause = RUNNING
    while cause == RUNNING:
        world.settings[0].stop_collisions = min(most, clock.collisions + stay)
        cause = advance(world)
        if cause == END_COLLISIONS and clock.collisions < most:
            cause = RUNNING
            if fits(world, group.runs[0].piece):
                update_point_statistics(world, known, RUNNING, points, results, point)
                _put_in(world, points, group, lane)
                return True
            stay = min(2 * stay, LONGEST_STAY)
    results.outcomes[point].end_cause = cause
    if cause != LOG_FULL:
        update_point_statistics(world, known, cause, points, results, point)
    return False


@kernel
def _put_in(world: World, points: Points, group: LaneGroup, lane: int) -> None:
    """Put a run into a lane."""
    clock = world.clock[0]
    run = group.runs[0]
    slot = group.slots[lane]
    own = points.own[slot.point]
    slot.collisions = clock.collisions
    slot.crossings = clock.crossings
    slot.contacts = clock.contacts
    run.t = insert(run.t, lane, clock.t)
    run.t_low = insert(run.t_low, lane, clock.t_low)
    run.restitution = insert(run.restitution, lane, world.pairs[0].restitution)
    run.stop_t = insert(run.stop_t, lane, own.stop_t)
    run.stop_collisions = insert(run.stop_collisions, lane, float(own.stop_collisions))
    run.collisions = insert(run.collisions, lane, float(clock.collisions))
    run.energy_correction = insert(run.energy_correction, lane, clock.energy_correction)
    run.max_gap = insert(run.max_gap, lane, 0.0)
    run.least_force = insert(run.least_force, lane, NEVER)
    run.most_demand = insert(run.most_demand, lane, 0.0)
    for ball in range(2):
        libration = group.librations[ball]
        body = group.bodies[ball]
        own_body = world.bodies[ball]
        flight = world.flights[ball]
        body.mass = insert(body.mass, lane, own_body.mass)
        body.rolling_mass = insert(body.rolling_mass, lane, own_body.rolling_mass)
        body.weight = insert(body.weight, lane, own_body.weight)
        libration.flow_s = insert(libration.flow_s, lane, flight.s)
        libration.flow_c = insert(libration.flow_c, lane, flight.c)
        libration.flow_p = insert(libration.flow_p, lane, flight.p)
        libration.specific_energy = insert(libration.specific_energy, lane, flight.specific_energy)
        libration.parameter = insert(libration.parameter, lane, flight.parameter)
        libration.complementary_modulus = insert(
            libration.complementary_modulus, lane, flight.complementary_modulus
        )


@kernel
def _take_out(
    world: World, fresh: World, points: Points, results: Results, group: LaneGroup, lane: int
) -> None:
    """Take a run out of its lane: set the world to its state after the last impact there."""
    run = group.runs[0]
    slot = group.slots[lane]
    prepare_point(world, fresh, points, slot.point)
    clock = world.clock[0]
    clock.t = extract(run.t, lane)
    clock.t_low = extract(run.t_low, lane)
    clock.collisions = int(extract(run.collisions, lane))
    clock.crossings = slot.crossings
    clock.contacts = slot.contacts
    clock.energy_correction = extract(run.energy_correction, lane)
    for ball in range(2):
        libration = group.librations[ball]
        flight = world.flights[ball]
        flight.piece = run.piece
        flight.t = clock.t
        flight.t_low = clock.t_low
        flight.s = extract(libration.flow_s, lane)
        flight.c = extract(libration.flow_c, lane)
        flight.p = extract(libration.flow_p, lane)
        flight.specific_energy = extract(libration.specific_energy, lane)
        flight.separatrix_piece = -1
        parameter = extract(libration.parameter, lane)
        set_theta_constants(flight, parameter, extract(libration.complementary_modulus, lane))
        launch_and_log(world, ball, COLLISION)
    world.pairs[0].touching = PARTING
    impacts = clock.collisions - slot.collisions
    outcome = results.outcomes[slot.point]
    if impacts > 0:
        outcome.impacts += impacts
        outcome.last_t = clock.t
        outcome.max_gap = max(outcome.max_gap, extract(run.max_gap, lane))
        outcome.least_force = min(outcome.least_force, extract(run.least_force, lane))
        outcome.most_demand = max(outcome.most_demand, extract(run.most_demand, lane))
