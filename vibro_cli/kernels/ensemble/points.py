"""Many runs one after another: their summaries, their impacts as columns, their tangent maps.

The runs differ in where the bodies start, in their masses, in the coefficients of restitution and
in the stop. Each is the run that ``systems.trace.event_loop`` would make, to the bit: the same
kernels work on the same records.

The numbers of a system may be arrays (see ``numerics.elementwise``); so are those of its records,
which are made by the same functions as those of a single one. Here they become rows of records,
from which a batch takes what the system of its next run needs.
"""

from __future__ import annotations

from collections.abc import Sequence

from vibro_cli.compile.kernel import FloatMatrix, kernel
from vibro_cli.kernels.ensemble.records import (
    Points,
    Results,
    Stack,
    install,
    prepare_point,
    tally_point,
)
from vibro_cli.kernels.events.event_loop import proceed
from vibro_cli.kernels.tangent.follow import follow_tangents
from vibro_cli.kernels.tangent.frame import Tangents
from vibro_cli.kernels.world import END_TIME, LOG_FULL, NEVER, RUNNING, Flight, World


@kernel
def run_points(
    world: World,
    fresh: World,
    scratch: Sequence[Flight],
    points: Points,
    results: Results,
    first: int,
    last: int,
    filled: int,
) -> tuple[int, int]:
    """Run some of the points, from ``first`` to before ``last``.

    Parameters
    ----------
    world, fresh
        The records to work on, and what they are before the start of every run.
    scratch
        One flight to work with.
    points, results
        All points of the batch, and where their results go.
    filled
        Rows of impacts that are used; without any room for impacts, they are not kept.

    Returns
    -------
    The first point that was not run (there was no room left for its impacts), and the rows of
    impacts that are used.
    """
    keep = len(results.impacts) > 0
    for point in range(first, last):
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
        tally_point(world, 0, cause, points, results, point, scratch)
        outcome.kept = clock.impact_rows if keep else 0
    return last, filled


@kernel
def run_stacked(
    world: World,
    fresh: World,
    scratch: Sequence[Flight],
    points: Points,
    results: Results,
    stack: Stack,
    first: int,
    last: int,
    filled: int,
) -> tuple[int, int]:
    """Run some of the points, each with its own system; see
    ``kernels.ensemble.points.run_points``."""
    at = first
    while at < last:
        system = stack.of_runs[at].number
        until = at + 1
        while until < last and stack.of_runs[until].number == system:
            until += 1
        install(world, stack, system)
        for j in range(len(world.pairs)):
            fresh.pairs[j].distance = world.pairs[j].distance
        reached, filled = run_points(world, fresh, scratch, points, results, at, until, filled)
        if reached < until:
            return reached, filled
        at = until
    return last, filled


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
