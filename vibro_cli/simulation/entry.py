"""The ways from the interpreter into the compiled kernels.

The event loop and the tally have machine code of their own, made once; whatever else is compiled
calls it (see ``numerics.engine.apart``).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from vibro_cli.mechanics.records import Flight
from vibro_cli.mechanics.two_swings import TwoBodies, TwoSwings, TwoTracks
from vibro_cli.numerics import engine
from vibro_cli.numerics.engine import Variant, interpreted
from vibro_cli.numerics.machine_code import compiled, prepare_together
from vibro_cli.simulation.contact_changes import launch_chain
from vibro_cli.simulation.joint import collide_jointly
from vibro_cli.simulation.lane_impact import LaneGroup
from vibro_cli.simulation.lanes import run_points_in_lanes
from vibro_cli.simulation.loop import proceed
from vibro_cli.simulation.points import Points, Results, run_points
from vibro_cli.simulation.settling import settle
from vibro_cli.simulation.stacks import Stack, run_stacked
from vibro_cli.simulation.swinging import proceed_swinging
from vibro_cli.simulation.tally import FinalState, Outcome, tally
from vibro_cli.simulation.world import ImpactRow, World

Calls = list[tuple[Callable[..., Any], Any]]
"""Kernels with the arguments of a call."""


def prepare_event_loop(world: World, variant: Variant | None = None) -> None:
    """Make or load the machine code of the event loop and of the tally.

    What is missing is made by two processes, which takes two thirds of the time; that of a variant
    by one.
    """
    loop = interpreted(proceed, variant)
    if not compiled(loop).is_loaded:
        calls = [(loop, (world, False)), *_beside(world, variant)]
        beside = "" if variant else f"{__name__}:{make_beside.__name__}"
        prepare_together(calls, beside)


def prepare_batches(calls: Calls, beside: str) -> None:
    """Make or load the machine code of batches: that of the event loop, and what calls it.

    Parameters
    ----------
    calls
        Kernels that call it, with the arguments of a call.
    beside
        See ``machine_code.prepare_together``.
    """
    world = smallest_world()
    prepare_together([(proceed, (world, False)), *_beside(world, None), *calls], beside)


def make_beside() -> None:
    """Make the machine code that the event loop calls, and that of the tally."""
    for kernel, arguments in _beside(smallest_world(), None):
        compiled(kernel).code(arguments)


def smallest_world() -> World:
    """Return compiled records: the machine code is the same for those of all systems."""
    from vibro_cli.simulation.drive import compiled_world
    from vibro_cli.simulation.prepare import make_world, smallest_system

    return compiled_world(make_world(smallest_system(), None, None))


def _beside(world: World, variant: Variant | None) -> Calls:
    results = empty_results(1, 1, 0)
    of_tally = (world, 0, 0, 0.0, 0.0, results.outcomes, 0, results.finals, zeros(1, Flight))
    calls: Calls = [
        (interpreted(collide_jointly, variant), (world, 0, 0)),
        (interpreted(settle, variant), (world, 0, 0)),
        (interpreted(launch_chain, variant), (world, 0, 0, 0)),
        (interpreted(tally, variant), of_tally),
    ]
    return calls if variant else [*calls, (proceed_swinging, (world, two_bodies()))]


def two_bodies() -> TwoBodies:
    """Return lanes for two bodies."""
    return TwoBodies(zeros(1, TwoSwings), zeros(1, TwoTracks))


def enter_advance(world: World, variant: Variant | None) -> int:
    """Run on a compiled world (see ``simulation.loop.advance``)."""
    prepare_event_loop(world, variant)
    settings: Any = world.settings[0]
    open_ends = settings["closed"] == 0 and settings["one_sided"] == 0
    if variant is None and settings["bodies"] == 2 and open_ends:
        return int(compiled(proceed_swinging)(world, two_bodies()))
    return int(compiled(interpreted(proceed, variant))(world, False))


def enter_tally(
    world: World, cause: int, end: tuple[float, float], variant: Variant | None
) -> Results:
    """Tally a run on a compiled world (see ``simulation.tally``)."""
    results = empty_results(1, len(world.flights), 0)
    count = compiled(interpreted(tally, variant))
    count(world, 0, cause, *end, results.outcomes, 0, results.finals, zeros(1, Flight))
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
    variant: Variant | None,
    stack: Stack | None = None,
) -> tuple[int, int]:
    """Run some points (see ``simulation.points``), perhaps of a stack of systems."""
    prepare_event_loop(world, variant)
    if stack is not None:
        several = compiled(interpreted(run_stacked, variant))
        point, rows = several(world, fresh, scratch, points, results, stack, first, last, filled)
        return int(point), int(rows)
    run = compiled(interpreted(run_points, variant))
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
    """Run some points in lanes (see ``simulation.lanes``)."""
    prepare_event_loop(world)
    run = compiled(run_points_in_lanes)
    return int(run(world, fresh, scratch, points, results, first, last, group))


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
