"""Many runs one after another: their summaries, their impacts as columns, their tangent maps.

The runs differ in where the bodies start, in their masses, in the coefficients of restitution and
in the stop. Each is the run that ``systems.trace.event_loop`` would make, to the bit: the same
kernels work on the same records.

The numbers of a system may be arrays (see ``numerics.elementwise``); so are those of its records,
which are made by the same functions as those of a single one. Here they become rows of records,
from which a batch takes what the system of its next run needs.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import FloatMatrix, kernel
from vibro_cli.kernels.ensemble.records import (
    Points,
    Stack,
    end_of_point,
    install,
    prepare_point,
    update_point_statistics,
)
from vibro_cli.kernels.events.event_loop import proceed
from vibro_cli.kernels.impact.impulse_chain import last_number_of
from vibro_cli.kernels.statistics.run_statistics import Results
from vibro_cli.kernels.tangent.follow import follow_tangents
from vibro_cli.kernels.tangent.frame import Tangents
from vibro_cli.kernels.world import LOG_FULL, RUNNING, World

# So many full logs of a run are followed; a longer run is for the driver, which signals can end.
MOST_LOGS = 1000


@kernel
def run_points(
    world: World,
    fresh: World,
    points: Points,
    results: Results,
    stack: Stack,
    first: int,
    last: int,
    filled: int,
) -> tuple[int, int]:
    """Run the points of a batch from ``first`` to before ``last``.

    ``stack`` has the systems of the points; of one alone, no number of a system. ``fresh`` has the
    records of ``world`` as they are before every run; ``filled`` rows of impacts are used. Without
    any room for impacts, they are not kept. Returns the first point that was not run (there was no
    room left for its impacts), and the rows that are used.
    """
    keep = len(results.impacts) > 0
    installed = -1
    for point in range(first, last):
        installed = install(world, stack, point, installed)
        prepare_point(world, fresh, points, point)
        proceed(world, True)
        cause = proceed(world, False)
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
    return last, filled


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

    ``stack`` is as of :func:`run_points`. ``tangents`` has room for as many impacts as the log of
    the world; its ``state`` has a row for each point, with its scale of time, of which the first
    is worked on. ``sums`` [point, direction] is filled in: logarithms of the growth of the frame's
    vectors.
    """
    installed = -1
    for point in range(len(points.own)):
        installed = install(world, stack, point, installed)
        prepare_point(world, fresh, points, point)
        tangents.state[0].time_scale = tangents.state[point + 1].time_scale
        proceed(world, True)
        cause = LOG_FULL
        known = 0
        logs = 0
        while cause == LOG_FULL and logs < MOST_LOGS:
            logs += 1
            cause = proceed(world, False)
            clock = world.clock[0]
            if cause == LOG_FULL and (clock.segment_rows > 0 or clock.flight_rows <= known):
                break  # a run for the driver: its motion in segments, or a search without end
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
    """Empty the logs but for the flights that bodies are in; returns how many they are.

    A flight that is one of the first rows already is its body's own.
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
