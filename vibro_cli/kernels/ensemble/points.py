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
from typing import NamedTuple

from vibro_cli.compile.kernel import FloatMatrix, kernel, struct
from vibro_cli.kernels.events.event_loop import proceed
from vibro_cli.kernels.statistics.impact_columns import Columns, Runs, fill_run
from vibro_cli.kernels.statistics.run_statistics import FinalState, Outcome, tally
from vibro_cli.kernels.tangent.follow import follow_tangents
from vibro_cli.kernels.tangent.frame import Tangents
from vibro_cli.kernels.world import (
    END_TIME,
    LOG_FULL,
    NEVER,
    RUNNING,
    BodyData,
    Flight,
    ImpactRow,
    PairTrack,
    PieceData,
    TrackData,
    World,
)


@struct
class PointData:
    """What is a run's own, besides its bodies and pairs."""

    stop_t: float  # s
    stop_collisions: int


@struct
class StartData:
    """One body at the start of one run."""

    piece: int
    s: float  # (S, C, P) as in kernels.structs
    c: float
    p: float
    mass: float  # kg


@struct
class RestitutionData:
    """One pair of one run."""

    k: float


class Points(NamedTuple):
    """The runs of a batch: a row for each, and one for each of its bodies and pairs."""

    own: Sequence[PointData]
    starts: Sequence[StartData]  # run by run
    restitutions: Sequence[RestitutionData]  # run by run


class Results(NamedTuple):
    """What the runs of a batch gave."""

    outcomes: Sequence[Outcome]  # one for each run
    finals: Sequence[FinalState]  # run by run
    impacts: Sequence[ImpactRow]  # of all runs, if they are kept


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
def tally_point(
    world: World,
    known: int,
    cause: int,
    points: Points,
    results: Results,
    point: int,
    scratch: Sequence[Flight],
) -> None:
    """Tally a run, or a part of one (see ``kernels.statistics.run_statistics``)."""
    end_t = world.clock[0].t
    end_low = world.clock[0].t_low
    if cause == END_TIME and points.own[point].stop_t < NEVER:
        end_t = points.own[point].stop_t
        end_low = 0.0
    tally(world, known, cause, end_t, end_low, results.outcomes, point, results.finals, scratch)


@kernel
def prepare_point(world: World, fresh: World, points: Points, point: int) -> None:
    """Put the records into the state before the start of a run."""
    settings = world.settings[0]
    world.clock[0] = fresh.clock[0]  # type: ignore[index]
    settings.stop_t = points.own[point].stop_t
    settings.stop_collisions = points.own[point].stop_collisions
    for j in range(settings.pairs):
        world.pairs[j] = fresh.pairs[j]  # type: ignore[index]
        world.pairs[j].restitution = points.restitutions[point * settings.pairs + j].k
    for ball in range(settings.bodies):
        given = points.starts[point * settings.bodies + ball]
        body = world.bodies[ball]
        body.mass = given.mass
        body.rolling_mass = body.kappa * given.mass
        body.weight = given.mass * settings.gravity
        world.flights[ball] = fresh.flights[ball]  # type: ignore[index]
        flight = world.flights[ball]
        flight.piece = given.piece
        flight.s = given.s
        flight.c = given.c
        flight.p = given.p


@struct
class SettingNumbers:
    """What of the settings of a run differs from system to system."""

    gravity: float
    left_wall: float
    right_wall: float


@struct
class PairNumbers:
    """And of two neighbours."""

    distance: float  # r_a + r_b, m


@struct
class SystemNumber:
    """Which of the systems a run is of, from 0."""

    number: int


class Stack(NamedTuple):
    """The records of the systems, system by system, and which system each run is of."""

    settings: Sequence[SettingNumbers]
    bodies: Sequence[BodyData]
    pieces: Sequence[PieceData]
    tracks: Sequence[TrackData]
    contacts: Sequence[PairTrack]
    pairs: Sequence[PairNumbers]
    of_runs: Sequence[SystemNumber]


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
def install(world: World, stack: Stack, system: int) -> None:
    """Put the records of a system in place."""
    numbers = stack.settings[system]
    settings = world.settings[0]
    settings.gravity = numbers.gravity
    settings.left_wall = numbers.left_wall
    settings.right_wall = numbers.right_wall
    for j in range(len(world.bodies)):
        world.bodies[j] = stack.bodies[system * len(world.bodies) + j]  # type: ignore[index]
    for j in range(len(world.pieces)):
        world.pieces[j] = stack.pieces[system * len(world.pieces) + j]  # type: ignore[index]
    for j in range(len(world.tracks)):
        world.tracks[j] = stack.tracks[system * len(world.tracks) + j]  # type: ignore[index]
    for j in range(len(world.contacts)):
        world.contacts[j] = stack.contacts[system * len(world.contacts) + j]  # type: ignore[index]
    for j in range(len(world.pairs)):
        world.pairs[j].distance = stack.pairs[system * len(world.pairs) + j].distance


@kernel
def fill_stacked(
    world: World,
    log: Sequence[ImpactRow],
    runs: Runs,
    columns: Columns,
    around: float,
    stack: Stack,
) -> int:
    """Fill the columns of runs, each of its own system; see ``impact_columns.fill_columns``."""
    row = 0
    installed = -1
    for run in range(len(runs.counts)):
        system = stack.of_runs[run].number
        if system != installed and runs.counts[run] > 0:
            install(world, stack, system)
            installed = system
        row = fill_run(world, log, row, runs, run, columns, around)
    return row


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
