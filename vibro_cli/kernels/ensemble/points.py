"""One run, and many one after another: their summaries, their impacts, their tangent maps.

The many differ in the initial states and masses of the bodies, in the coefficients of restitution
and in the stop. Each has the same bits as a run of ``systems.trace.system``, since the same
kernels work on the same structs.

If the systems differ too, their numbers are arrays (see ``numerics.elementwise``). The functions
that make the structs of a single system then make rows of structs, from which each run takes those
of its system.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import FloatMatrix, kernel
from vibro_cli.kernels.contact.libration_contact_lanes import LONGEST_STAY, TwoBodies, fits
from vibro_cli.kernels.ensemble.libration_fast_path import librate
from vibro_cli.kernels.ensemble.records import (
    Points,
    Stack,
    end_of_point,
    install,
    prepare_point,
    update_point_statistics,
)
from vibro_cli.kernels.events.event_loop import advance, start
from vibro_cli.kernels.impact.impulse_chain import last_number_of
from vibro_cli.kernels.statistics.run_statistics import Results
from vibro_cli.kernels.tangent.follow import follow_tangents
from vibro_cli.kernels.tangent.frame import Tangents
from vibro_cli.kernels.world import END_COLLISIONS, LOG_FULL, RUNNING, World

# Greatest number of full logs of a run; a longer run is left to the driver, which signals can stop.
MOST_LOGS = 1000


@kernel
def proceed(world: World, bodies: TwoBodies) -> int:
    """Do the same as ``kernels.events.event_loop.advance``, on the faster path where it applies.

    It applies to two bodies on an open, two-sided trace, if ``bodies`` has a record.
    """
    settings = world.settings[0]
    free = settings.closed == 0 and settings.one_sided == 0
    if len(bodies.librations) == 0 or settings.bodies != 2 or not free:
        return advance(world)
    clock = world.clock[0]
    most = settings.stop_collisions
    stay = 1
    while True:
        if fits(world, world.flights[0].piece):
            before = clock.collisions
            cause = librate(world, bodies)
            if cause != RUNNING:
                return cause
            stay = 1 if clock.collisions > before else stay
        settings.stop_collisions = min(most, clock.collisions + stay)
        cause = advance(world)
        settings.stop_collisions = most
        if cause != END_COLLISIONS or clock.collisions >= most:
            return cause
        stay = min(2 * stay, LONGEST_STAY)


@kernel
def run_points(
    world: World,
    fresh: World,
    points: Points,
    results: Results,
    stack: Stack,
    bodies: TwoBodies,
    first: int,
    filled: int,
) -> tuple[int, int]:
    """Run the points of a batch from ``first`` on.

    ``stack`` has the systems of the points; it is empty if all share one system. ``fresh`` has the
    structs of ``world`` before a run; ``bodies`` is as in :func:`proceed`; ``filled`` rows of
    impacts are already used. If ``results`` has no room for any impacts, they are not kept. Return
    the first point that was not run, because its impacts had no room, and the number of rows used.
    """
    keep = len(results.impacts) > 0
    installed = -1
    for point in range(first, len(points.own)):
        installed = install(world, stack, point, installed)
        prepare_point(world, fresh, points, point)
        start(world)
        cause = proceed(world, bodies)
        clock = world.clock[0]
        outcome = results.outcomes[point]
        outcome.end_cause = cause
        if cause == LOG_FULL:
            continue
        if keep:
            if filled + clock.impact_rows > len(results.impacts):
                return point, filled
            for row in range(clock.impact_rows):
                results.impacts[filled + row] = world.impacts[row]  # type: ignore[index]
            filled += clock.impact_rows
        update_point_statistics(world, 0, cause, points, results, point)
        outcome.kept = clock.impact_rows if keep else 0
    return len(points.own), filled


@kernel
def follow_points(
    world: World,
    fresh: World,
    points: Points,
    results: Results,
    stack: Stack,
    tangents: Tangents,
    sums: FloatMatrix,
) -> None:
    """Run all points of a batch, with their tangent maps; impacts are not kept.

    ``stack`` is as in :func:`run_points`. ``tangents`` has room for as many impacts as the log of
    the world. Its ``state`` has a first row to work on, then a row for each point with its time
    scale. ``sums`` [point, direction] receives the logarithms of the growth of the frame's vectors.
    """
    installed = -1
    for point in range(len(points.own)):
        installed = install(world, stack, point, installed)
        prepare_point(world, fresh, points, point)
        tangents.state[0].time_scale = tangents.state[point + 1].time_scale
        start(world)
        cause = LOG_FULL
        known = 0
        logs = 0
        while cause == LOG_FULL and logs < MOST_LOGS:
            logs += 1
            cause = advance(world)
            clock = world.clock[0]
            if cause == LOG_FULL and (clock.segment_rows > 0 or clock.flight_rows <= known):
                break  # left to the driver: motion in segments, or a search that does not end
            now = RUNNING if cause == LOG_FULL else cause
            update_point_statistics(world, known, now, points, results, point)
            end_t, end_low = end_of_point(world, now, points, point)
            follow_tangents(world, known, now, end_t, end_low, tangents, results.scratch)
            known = _keep_under_way(world)
        results.outcomes[point].end_cause = cause
        for column in range(len(tangents.frame)):
            sums[point, column] = tangents.sums[0, column]


@kernel
def _keep_under_way(world: World) -> int:
    """Clear the logs except for the present flights of the bodies; return their number.

    A present flight that is already among the first rows is in the row of its body.
    """
    clock = world.clock[0]
    bodies = world.settings[0].bodies
    for ball in range(bodies):
        last = last_number_of(world, ball)
        if last != ball:
            world.log[ball] = world.log[last]  # type: ignore[index]
    clock.flight_rows = bodies
    clock.impact_rows = 0
    clock.contact_rows = 0
    clock.segment_rows = 0
    return bodies
