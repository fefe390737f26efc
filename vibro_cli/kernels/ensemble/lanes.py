"""Batches of two bodies with several scenarios in lanes: all go from impact to impact at once.

In lanes are the runs whose bodies both swing on one arc, from one impact to the next (see
``kernels.ensemble.impact_in_lanes``). All else, and each event that fails there, is done by the
kernels of
single runs, after which the run goes back into its lane. The bits are those of single runs.
"""

from __future__ import annotations

from collections.abc import Sequence

from vibro_cli.compile.kernel import kernel
from vibro_cli.compile.lanes import LANES, any_lane, in_lane, with_lane
from vibro_cli.kernels.ensemble.impact_in_lanes import LaneGroup, next_impact
from vibro_cli.kernels.ensemble.libration_fast_path import LONGEST_STAY, fits
from vibro_cli.kernels.ensemble.points import Points, Results, prepare_point, tally_point
from vibro_cli.kernels.events.event_loop import proceed
from vibro_cli.kernels.flow.begin_flight import launch_and_log
from vibro_cli.kernels.numerics.elliptic import set_theta_constants
from vibro_cli.kernels.structs import NEVER, PARTING, Flight
from vibro_cli.kernels.world import COLLISION, END_COLLISIONS, LOG_FULL, RUNNING, World


@kernel
def run_points_in_lanes(
    world: World,
    fresh: World,
    scratch: Sequence[Flight],
    points: Points,
    results: Results,
    first: int,
    last: int,
    group: LaneGroup,
) -> int:
    """Run some of the points, whose impacts are not kept; see
    ``kernels.ensemble.points.run_points``.

    The arc is the one that ``group`` is set up for. Returns the number of impacts made in lanes.
    """
    upcoming = first
    made = 0
    working = 0
    for lane in range(LANES):
        upcoming = _fill(world, fresh, scratch, points, results, group, lane, upcoming, last)
        working += 1 if group.slots[lane].point >= 0 else 0
    run = group.runs[0]
    while working > 0:
        called = next_impact(world, group)
        made += working
        if any_lane(called):
            working = 0
            for lane in range(LANES):
                point = group.slots[lane].point
                failed = in_lane(run.failed, lane) > 0.0
                ended = in_lane(run.collisions, lane) >= in_lane(run.stop_collisions, lane)
                if point >= 0 and (failed or ended):
                    made -= 1 if failed else 0
                    _take_out(world, fresh, points, results, group, lane)
                    if ended or not _alone(world, scratch, points, results, group, lane, 2):
                        if ended:
                            tally_point(world, 2, END_COLLISIONS, points, results, point, scratch)
                        upcoming = _fill(
                            world, fresh, scratch, points, results, group, lane, upcoming, last
                        )
                working += 1 if group.slots[lane].point >= 0 else 0
    return made


@kernel
def _fill(
    world: World,
    fresh: World,
    scratch: Sequence[Flight],
    points: Points,
    results: Results,
    group: LaneGroup,
    lane: int,
    upcoming: int,
    last: int,
) -> int:
    """Take the next run that comes to a state for lanes into a lane; return the one after it."""
    while upcoming < last:
        group.slots[lane].point = upcoming
        prepare_point(world, fresh, points, upcoming)
        proceed(world, True)
        upcoming += 1
        if _alone(world, scratch, points, results, group, lane, 0):
            return upcoming
    group.slots[lane].point = -1
    return upcoming


@kernel
def _alone(
    world: World,
    scratch: Sequence[Flight],
    points: Points,
    results: Results,
    group: LaneGroup,
    lane: int,
    known: int,
) -> bool:
    """Run on by the kernels of single runs; tell whether that came to a state for lanes.

    The logs of ``world`` begin with ``known`` flights that were told of before.
    """
    point = group.slots[lane].point
    clock = world.clock[0]
    most = points.own[point].stop_collisions
    stay = 1
    cause = RUNNING
    while cause == RUNNING:
        world.settings[0].stop_collisions = min(most, clock.collisions + stay)
        cause = proceed(world, False)
        if cause == END_COLLISIONS and clock.collisions < most:
            cause = RUNNING
            if fits(world, group.runs[0].piece):
                tally_point(world, known, RUNNING, points, results, point, scratch)
                _put_in(world, points, group, lane)
                return True
            stay = min(2 * stay, LONGEST_STAY)
    results.outcomes[point].end_cause = cause
    if cause != LOG_FULL:
        tally_point(world, known, cause, points, results, point, scratch)
    return False


@kernel
def _put_in(world: World, points: Points, group: LaneGroup, lane: int) -> None:
    """Put a run that fits into a lane."""
    clock = world.clock[0]
    run = group.runs[0]
    slot = group.slots[lane]
    own = points.own[slot.point]
    slot.crossings = clock.crossings
    slot.contacts = clock.contacts
    run.t = with_lane(run.t, lane, clock.t)
    run.t_low = with_lane(run.t_low, lane, clock.t_low)
    run.restitution = with_lane(run.restitution, lane, world.pairs[0].restitution)
    run.stop_t = with_lane(run.stop_t, lane, own.stop_t)
    run.stop_collisions = with_lane(run.stop_collisions, lane, float(own.stop_collisions))
    run.collisions = with_lane(run.collisions, lane, float(clock.collisions))
    run.impacts = with_lane(run.impacts, lane, 0.0)
    run.energy_correction = with_lane(run.energy_correction, lane, clock.energy_correction)
    run.max_gap = with_lane(run.max_gap, lane, 0.0)
    run.least_force = with_lane(run.least_force, lane, NEVER)
    run.most_demand = with_lane(run.most_demand, lane, 0.0)
    for ball in range(2):
        swing = group.swings[ball]
        body = group.bodies[ball]
        own_body = world.bodies[ball]
        flight = world.flights[ball]
        body.mass = with_lane(body.mass, lane, own_body.mass)
        body.rolling_mass = with_lane(body.rolling_mass, lane, own_body.rolling_mass)
        body.weight = with_lane(body.weight, lane, own_body.weight)
        swing.flow_s = with_lane(swing.flow_s, lane, flight.s)
        swing.flow_c = with_lane(swing.flow_c, lane, flight.c)
        swing.flow_p = with_lane(swing.flow_p, lane, flight.p)
        swing.head = with_lane(swing.head, lane, flight.head)
        swing.parameter = with_lane(swing.parameter, lane, flight.parameter)
        swing.root_complement = with_lane(swing.root_complement, lane, flight.root_complement)


@kernel
def _take_out(
    world: World, fresh: World, points: Points, results: Results, group: LaneGroup, lane: int
) -> None:
    """Take a run out of its lane: the records are as after its last impact there."""
    run = group.runs[0]
    slot = group.slots[lane]
    prepare_point(world, fresh, points, slot.point)
    clock = world.clock[0]
    clock.t = in_lane(run.t, lane)
    clock.t_low = in_lane(run.t_low, lane)
    clock.collisions = int(in_lane(run.collisions, lane))
    clock.crossings = slot.crossings
    clock.contacts = slot.contacts
    clock.energy_correction = in_lane(run.energy_correction, lane)
    for ball in range(2):
        swing = group.swings[ball]
        flight = world.flights[ball]
        flight.piece = run.piece
        flight.t = clock.t
        flight.t_low = clock.t_low
        flight.s = in_lane(swing.flow_s, lane)
        flight.c = in_lane(swing.flow_c, lane)
        flight.p = in_lane(swing.flow_p, lane)
        flight.head = in_lane(swing.head, lane)
        flight.anchor = -1
        parameter = in_lane(swing.parameter, lane)
        set_theta_constants(flight, parameter, in_lane(swing.root_complement, lane))
        launch_and_log(world, ball, COLLISION)
    world.pairs[0].touching = PARTING
    impacts = int(in_lane(run.impacts, lane))
    outcome = results.outcomes[slot.point]
    if impacts > 0:
        outcome.impacts += impacts
        outcome.last_t = clock.t
        outcome.max_gap = max(outcome.max_gap, in_lane(run.max_gap, lane))
        outcome.least_force = min(outcome.least_force, in_lane(run.least_force, lane))
        outcome.most_demand = max(outcome.most_demand, in_lane(run.most_demand, lane))
