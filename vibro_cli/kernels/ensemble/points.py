"""The kernel of batches: many runs of one system one after another.

The runs differ in where the bodies start, in their masses, in the coefficients of restitution and
in the stop. Each is the run that ``systems.trace.run`` would make, to the bit: the same kernels
work on the same records.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from vibro_cli.compile.kernel import kernel, struct
from vibro_cli.kernels.events.event_loop import proceed
from vibro_cli.kernels.statistics.run_statistics import FinalState, Outcome, tally
from vibro_cli.kernels.structs import NEVER, Flight
from vibro_cli.kernels.world import END_TIME, LOG_FULL, ImpactRow, World


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
