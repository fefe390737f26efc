"""The ways from the interpreter into the compiled kernels of a trace."""

from __future__ import annotations

from typing import Any

from vibro_cli.compile.kernel import Overrides, dtype
from vibro_cli.compile.native import compiled
from vibro_cli.kernels.contact.two_librations import TwoBodies, TwoSwings, TwoTracks
from vibro_cli.kernels.ensemble.followed import follow_points
from vibro_cli.kernels.ensemble.impact_in_lanes import LaneGroup
from vibro_cli.kernels.ensemble.lanes import run_points_in_lanes
from vibro_cli.kernels.ensemble.libration_fast_path import proceed_swinging
from vibro_cli.kernels.ensemble.points import Points, Results, run_points
from vibro_cli.kernels.ensemble.stacks import Stack, run_stacked
from vibro_cli.kernels.events.event_loop import proceed
from vibro_cli.kernels.statistics.run_statistics import FinalState, Outcome
from vibro_cli.kernels.tangent.world import Tangents
from vibro_cli.kernels.world import ImpactRow, World


def enter_advance(world: World, overrides: Overrides | None) -> int:
    """Run on a compiled world (see ``kernels.events.event_loop.advance``)."""
    settings: Any = world.settings[0]
    open_ends = settings["closed"] == 0 and settings["one_sided"] == 0
    if overrides is None and settings["bodies"] == 2 and open_ends:
        lanes = TwoBodies(zeros(1, TwoSwings), zeros(1, TwoTracks))
        return int(compiled(proceed_swinging)(world, lanes))
    return int(compiled(proceed, overrides)(world, False))


def enter_points(
    world: World,
    fresh: World,
    scratch: Any,
    points: Points,
    results: Results,
    first: int,
    last: int,
    filled: int,
    overrides: Overrides | None,
    stack: Stack | None = None,
) -> tuple[int, int]:
    """Run some points (see ``kernels.ensemble.points``), perhaps of a stack of systems."""
    if stack is not None:
        several = compiled(run_stacked, overrides)
        point, rows = several(world, fresh, scratch, points, results, stack, first, last, filled)
        return int(point), int(rows)
    run = compiled(run_points, overrides)
    point, rows = run(world, fresh, scratch, points, results, first, last, filled)
    return int(point), int(rows)


def enter_lanes(
    world: World,
    fresh: World,
    scratch: Any,
    points: Points,
    results: Results,
    first: int,
    last: int,
    group: LaneGroup,
) -> int:
    """Run some points in lanes (see ``kernels.ensemble.lanes``)."""
    run = compiled(run_points_in_lanes)
    return int(run(world, fresh, scratch, points, results, first, last, group))


def enter_followed(
    world: World,
    fresh: World,
    scratch: Any,
    points: Points,
    results: Results,
    stack: Stack,
    tangents: Tangents,
    sums: Any,
) -> None:
    """Run some points with their tangent maps (see ``kernels.ensemble.followed``)."""
    run = compiled(follow_points)
    run(world, fresh, scratch, points, results, stack, tangents, sums)


def empty_results(points: int, bodies: int, impact_rows: int) -> Results:
    """Return room for the results of some points."""
    return Results(
        outcomes=zeros(points, Outcome),
        finals=zeros(points * bodies, FinalState),
        impacts=zeros(impact_rows, ImpactRow),
    )


def zeros(count: int, cls: type) -> Any:
    """Return an array of structs that are zero."""
    import numpy as np

    return np.zeros(count, dtype=dtype(cls))
