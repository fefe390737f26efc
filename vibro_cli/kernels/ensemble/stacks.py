"""Many systems that differ in numbers only, one after another on the same records.

The numbers of a system may be arrays (see ``numerics.elementwise``); so are those of its records,
which are made by the same functions as those of a single one. Here they become rows of records,
from which a batch takes what the system of its next run needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from vibro_cli.compile.kernel import kernel, struct
from vibro_cli.kernels.ensemble.points import Points, Results, run_points
from vibro_cli.kernels.statistics.impact_columns import Columns, Runs, fill_run
from vibro_cli.kernels.structs import BodyData, Flight, PairTrack, PieceData, TrackData
from vibro_cli.kernels.world import ImpactRow, World


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
