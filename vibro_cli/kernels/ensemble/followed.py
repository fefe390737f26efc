"""The kernel of batches whose tangent maps are followed: runs one after another, in parts."""

from __future__ import annotations

from collections.abc import Sequence

from vibro_cli.compile.kernel import FloatMatrix, kernel
from vibro_cli.kernels.ensemble.points import Points, Results, prepare_point, tally_point
from vibro_cli.kernels.ensemble.stacks import Stack, install
from vibro_cli.kernels.events.event_loop import proceed
from vibro_cli.kernels.structs import NEVER, Flight
from vibro_cli.kernels.tangent.follow import follow_tangents
from vibro_cli.kernels.tangent.world import Tangents
from vibro_cli.kernels.world import END_TIME, LOG_FULL, RUNNING, World


@kernel
def follow_points(
    world: World,
    fresh: World,
    scratch: Sequence[Flight],
    points: Points,
    results: Results,
    stack: Stack,
    tangents: Tangents,
    sums: FloatMatrix,
) -> None:
    """Run all points of a batch; impacts are not kept.

    Parameters
    ----------
    world, fresh, scratch, points, results
        As of ``kernels.ensemble.points.run_points``.
    stack
        The systems of the points; of a single one, no number of a system.
    tangents
        With room for as many impacts as the log of the world; ``state`` has a row for each point,
        with its scale of time, of which the first is worked on.
    sums
        [point, direction] filled in: logarithms of the growth of the frame's vectors.
    """
    installed = -1
    for point in range(len(points.own)):
        if len(stack.of_runs) > 0 and stack.of_runs[point].number != installed:
            installed = stack.of_runs[point].number
            install(world, stack, installed)
            for j in range(len(world.pairs)):
                fresh.pairs[j].distance = world.pairs[j].distance
        prepare_point(world, fresh, points, point)
        tangents.state[0].time_scale = tangents.state[point + 1].time_scale
        proceed(world, True)
        cause = LOG_FULL
        known = 0
        while cause == LOG_FULL:
            cause = proceed(world, False)
            if cause == LOG_FULL and world.clock[0].segment_rows > 0:
                break
            now = RUNNING if cause == LOG_FULL else cause
            tally_point(world, known, now, points, results, point, scratch)
            _follow_point(world, known, now, points, point, tangents, scratch)
            known = _keep_under_way(world)
        results.outcomes[point].end_cause = cause
        for column in range(len(tangents.frame)):
            sums[point, column] = tangents.sums[0, column]


@kernel
def _follow_point(
    world: World,
    known: int,
    cause: int,
    points: Points,
    point: int,
    tangents: Tangents,
    scratch: Sequence[Flight],
) -> None:
    """Follow the tangent map through a part of a run, or to its end."""
    end_t = world.clock[0].t
    end_low = world.clock[0].t_low
    if cause == END_TIME and points.own[point].stop_t < NEVER:
        end_t = points.own[point].stop_t
        end_low = 0.0
    follow_tangents(world, known, cause, end_t, end_low, tangents, scratch)


@kernel
def _keep_under_way(world: World) -> int:
    """Empty the logs but for the flights that bodies are in; returns how many they are.

    A flight that is one of the first rows already is its body's own.
    """
    clock = world.clock[0]
    bodies = world.settings[0].bodies
    for ball in range(bodies):
        last = clock.flight_rows - 1
        while world.log[last].body != ball:
            last -= 1
        if last != ball:
            world.log[ball] = world.log[last]  # type: ignore[index]
    clock.flight_rows = bodies
    clock.impact_rows = 0
    clock.contact_rows = 0
    clock.segment_rows = 0
    return bodies
