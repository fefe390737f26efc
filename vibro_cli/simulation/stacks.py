"""Many systems that differ in numbers only, one after another on the same records.

The numbers of a system may be arrays (see ``numerics.alike``); so are those of its records, which
are made by the same functions as those of a single one. Here they become rows of records, from
which a batch takes what the system of its next run needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from vibro_cli.mechanics.records import BodyData, Flight, PairTrack, PieceData, TrackData
from vibro_cli.mechanics.system import System
from vibro_cli.numerics import engine
from vibro_cli.numerics.engine import kernel, record
from vibro_cli.simulation.impact_columns import Columns, Runs, fill_run
from vibro_cli.simulation.points import Points, Results, run_points
from vibro_cli.simulation.prepare import make_world
from vibro_cli.simulation.world import ImpactRow, World


@record
class SettingNumbers:
    """What of the settings of a run differs from system to system."""

    gravity: float
    left_wall: float
    right_wall: float


@record
class PairNumbers:
    """And of two neighbours."""

    distance: float  # r_a + r_b, m


@record
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


def stack_of(system: System, count: int, of_runs: Any) -> Stack:
    """Return the records of ``count`` systems, whose numbers are arrays.

    ``of_runs`` tells the number of the system of each run.
    """
    import numpy as np

    world = make_world(system, None, None, far_apart=False)
    numbers = np.zeros(len(of_runs), dtype=engine.dtype(SystemNumber))
    numbers["number"] = of_runs
    return Stack(
        settings=_rows(world.settings, SettingNumbers, count),
        bodies=_rows(world.bodies, BodyData, count),
        pieces=_rows(world.pieces, PieceData, count),
        tracks=_rows(world.tracks, TrackData, count),
        contacts=_rows(world.contacts, PairTrack, count),
        pairs=_rows(world.pairs, PairNumbers, count),
        of_runs=numbers,  # type: ignore[arg-type]
    )


def own_records(world: World) -> World:
    """Return a compiled world whose records are its own where those of a stack are installed."""
    changed: Any = {
        name: getattr(world, name).copy()
        for name in ("settings", "bodies", "pieces", "tracks", "contacts", "pairs")
    }
    return world._replace(**changed)


def _rows(records: Sequence[Any], cls: type, count: int) -> Any:
    """Records with arrays of ``count`` numbers as rows of plain records, system by system."""
    import numpy as np

    rows = np.zeros((count, len(records)), dtype=engine.dtype(cls))
    for place, one in enumerate(records):
        for name in rows.dtype.names or ():
            rows[name][:, place] = getattr(one, name)
    return rows.reshape(-1)


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
    """Run some of the points, each with its own system; see ``simulation.points.run_points``."""
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
