"""The one way from the interpreter into the compiled kernels.

A compiled function with an entry of its own has all that it calls compiled into it. There is only
one, so that the event loop is compiled once, whatever it is wanted for.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

from vibro_cli.mechanics.records import Flight
from vibro_cli.numerics import engine
from vibro_cli.numerics.engine import kernel
from vibro_cli.numerics.machine_code import compiled
from vibro_cli.simulation.loop import advance
from vibro_cli.simulation.points import (
    PointData,
    Points,
    RestitutionData,
    Results,
    StartData,
    run_points,
)
from vibro_cli.simulation.tally import FinalState, Outcome, tally
from vibro_cli.simulation.world import ImpactRow, World

ADVANCE = 0
TALLY = 1
POINTS = 2


@kernel
def enter(
    task: int,
    world: World,
    fresh: World,
    scratch: Sequence[Flight],
    points: Points,
    results: Results,
    first: int,
    last: int,
    filled: int,
    end_t: float,
    end_t_low: float,
) -> tuple[int, int]:
    """Do one of the tasks; what the numbers mean depends on it (see the functions below)."""
    if task == ADVANCE:
        return advance(world), 0
    if task == TALLY:
        outcome = results.outcomes[0]
        tally(world, first, end_t, end_t_low, outcome, results.finals, 0, scratch[0])
        return 0, 0
    return run_points(world, fresh, scratch, points, results, first, last, filled)


def enter_advance(world: World) -> int:
    """Run on a compiled world (see ``simulation.loop.advance``)."""
    cause, _ = _enter()(ADVANCE, world, world, *_nothing(), 0, 0, 0, 0.0, 0.0)
    return int(cause)


def enter_tally(world: World, cause: int, end: tuple[float, float]) -> Results:
    """Tally a run on a compiled world (see ``simulation.tally``)."""
    results = empty_results(1, len(world.flights), 0)
    scratch, points, _ = _nothing()
    _enter()(TALLY, world, world, scratch, points, results, cause, 0, 0, *end)
    return results


def enter_points(
    world: World,
    fresh: World,
    scratch: Any,
    points: Points,
    results: Results,
    first: int,
    last: int,
    filled: int,
) -> tuple[int, int]:
    """Run some points (see ``simulation.points``)."""
    point, rows = _enter()(
        POINTS, world, fresh, scratch, points, results, first, last, filled, 0.0, 0.0
    )
    return int(point), int(rows)


def _enter() -> Any:
    return compiled(enter)


@cache
def _nothing() -> tuple[Any, Points, Results]:
    """Arguments of the tasks that do not look at them."""
    points = Points(zeros(0, PointData), zeros(0, StartData), zeros(0, RestitutionData))
    return zeros(1, Flight), points, empty_results(0, 0, 0)


def empty_results(points: int, bodies: int, impact_rows: int) -> Results:
    """Return room for the results of some points."""
    return Results(
        outcomes=zeros(points, Outcome),
        finals=zeros(points * bodies, FinalState),
        impacts=zeros(impact_rows, ImpactRow),
    )


def zeros(count: int, cls: type) -> Any:
    """Return an array of records that are zero."""
    import numpy as np

    return np.zeros(count, dtype=engine.dtype(cls))
