"""Structs of many runs: their initial states and stops, and the numbers of several systems."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from vibro_cli.compile.kernel import kernel, struct
from vibro_cli.kernels.numerics.constants import LATEST, NEVER
from vibro_cli.kernels.statistics.impact_columns import Columns, Runs, fill_run
from vibro_cli.kernels.statistics.run_statistics import Results, update_statistics
from vibro_cli.kernels.world import (
    END_TIME,
    BodyData,
    ImpactRow,
    PairTrack,
    PieceData,
    TrackData,
    World,
    track_of,
)


@struct
class PointData:
    """The stop of a run."""

    stop_t: float  # s
    stop_collisions: int


@struct
class StartData:
    """Initial state of a body in a run."""

    piece: int
    s: float  # (S, C, P) as in kernels.world
    c: float
    p: float
    mass: float  # kg


class Points(NamedTuple):
    """The runs of a batch."""

    own: Sequence[PointData]  # one for each run
    starts: Sequence[StartData]  # one for each body, run by run
    restitutions: Sequence[float]  # k of each pair, run by run


@kernel
def end_of_point(world: World, cause: int, points: Points, point: int) -> tuple[float, float]:
    """Return the end time of a run, or of a part of one (two doubles, s)."""
    if cause == END_TIME:
        stop_t = points.own[point].stop_t
        return stop_t if stop_t < NEVER else LATEST, 0.0
    return world.clock[0].t, world.clock[0].t_low


@kernel
def update_point_statistics(
    world: World, known: int, cause: int, points: Points, results: Results, point: int
) -> None:
    """Tally a run, or a part of one (see ``kernels.statistics.run_statistics``)."""
    end_t, end_low = end_of_point(world, cause, points, point)
    update_statistics(world, known, cause, end_t, end_low, results, point)


@kernel
def prepare_point(world: World, fresh: World, points: Points, point: int) -> None:
    """Set the structs of the world to the start of a run."""
    settings = world.settings[0]
    world.clock[0] = fresh.clock[0]  # type: ignore[index]
    settings.stop_t = points.own[point].stop_t
    settings.stop_collisions = points.own[point].stop_collisions
    for j in range(settings.pairs):
        distance = world.pairs[j].distance  # of the installed system
        world.pairs[j] = fresh.pairs[j]  # type: ignore[index]
        world.pairs[j].distance = distance
        world.pairs[j].restitution = points.restitutions[point * settings.pairs + j]
    for ball in range(settings.bodies):
        given = points.starts[point * settings.bodies + ball]
        body = world.bodies[ball]
        body.mass = given.mass
        body.rolling_mass = body.kappa * given.mass
        body.weight = given.mass * settings.gravity
        flight = world.flights[ball]
        brief, size = flight.brief, flight.size  # of the installed system too
        world.flights[ball] = fresh.flights[ball]  # type: ignore[index]
        flight.brief = brief
        flight.size = size
        flight.piece = given.piece
        flight.s = given.s
        flight.c = given.c
        flight.p = given.p
        flight.own_frequency = track_of(world, ball).frequency


@struct
class SettingNumbers:
    """Settings that differ between systems."""

    gravity: float
    closing_error: float
    left_wall: float
    right_wall: float


@struct
class PairNumbers:
    """Numbers of a pair that differ between systems."""

    distance: float  # r_a + r_b, m


@struct
class FlightNumbers:
    """Numbers of a body's flights that differ between systems."""

    brief: float  # a shorter flight counts as part of an instant, s
    size: float  # of the trace, m


class Stack(NamedTuple):
    """The structs of several systems, system by system; ``of_runs`` has the system of each run."""

    settings: Sequence[SettingNumbers]
    bodies: Sequence[BodyData]
    pieces: Sequence[PieceData]
    tracks: Sequence[TrackData]
    contacts: Sequence[PairTrack]
    pairs: Sequence[PairNumbers]
    flights: Sequence[FlightNumbers]
    of_runs: list[int]


@kernel
def install(world: World, stack: Stack, run: int, installed: int) -> int:
    """Install the structs of a run's system in the world if needed; return the system's number.

    ``installed`` is the number of the present system, at first -1. An empty stack leaves the world
    unchanged.
    """
    if len(stack.of_runs) == 0 or stack.of_runs[run] == installed:
        return installed
    system = stack.of_runs[run]
    numbers = stack.settings[system]
    settings = world.settings[0]
    settings.gravity = numbers.gravity
    settings.closing_error = numbers.closing_error
    settings.left_wall = numbers.left_wall
    settings.right_wall = numbers.right_wall
    for j in range(len(world.bodies)):
        world.bodies[j] = stack.bodies[system * len(world.bodies) + j]  # type: ignore[index]
        of_flight = stack.flights[system * len(world.bodies) + j]
        world.flights[j].brief = of_flight.brief
        world.flights[j].size = of_flight.size
    for j in range(len(world.pieces)):
        world.pieces[j] = stack.pieces[system * len(world.pieces) + j]  # type: ignore[index]
    for j in range(len(world.tracks)):
        world.tracks[j] = stack.tracks[system * len(world.tracks) + j]  # type: ignore[index]
    for j in range(len(world.contacts)):
        world.contacts[j] = stack.contacts[system * len(world.contacts) + j]  # type: ignore[index]
    for j in range(len(world.pairs)):
        world.pairs[j].distance = stack.pairs[system * len(world.pairs) + j].distance
    return system


@kernel
def fill_stacked(
    world: World,
    log: Sequence[ImpactRow],
    runs: Runs,
    columns: Columns,
    around: float,
    stack: Stack,
) -> int:
    """Fill the columns of runs of several systems; see ``impact_columns.fill_columns``."""
    row = 0
    installed = -1
    for run in range(len(runs.counts)):
        if runs.counts[run] > 0:
            installed = install(world, stack, run, installed)
        row = fill_run(world, log, row, runs, run, columns, around)
    return row
