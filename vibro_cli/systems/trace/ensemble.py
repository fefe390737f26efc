"""Many compiled runs of one system in sequence, for grids."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vibro_cli.compile.kernel import LANES, dtype
from vibro_cli.compile.native import compiled
from vibro_cli.kernels.contact.libration_contact_lanes import BodyLanes, LibrationLanes
from vibro_cli.kernels.ensemble.lanes import LaneGroup, LaneSlot, RunLanes, run_points_in_lanes
from vibro_cli.kernels.ensemble.points import follow_points, run_points
from vibro_cli.kernels.ensemble.records import PointData, Points, Stack, StartData
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.statistics.run_statistics import FinalState, Outcome, Results
from vibro_cli.kernels.tangent.frame import TangentState
from vibro_cli.kernels.world import Flight, ImpactRow, World
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.systems.driver import compiled_world, records_of, zeros
from vibro_cli.systems.tangents import room_for
from vibro_cli.systems.trace import SYSTEM
from vibro_cli.systems.trace.world import initial_flight, make_world, pairs_of, two_bodies

_STACKED = records_of(Stack)
"""The structs of those records of a world that a stack holds for each system."""
_NO_STACK = Stack(
    **{name: zeros(0, cls) for name, cls in _STACKED.items()},
    of_runs=np.zeros(0, dtype=np.int64),  # type: ignore[arg-type]
)


class Batch:
    """Runs of one system in one thread; they may differ in masses and initial states.

    The batch shares the logs of `beside`, a batch with as many bodies in the same thread. With
    `in_lanes`, SIMD lanes are used where possible, which is faster and gives the same bits: a lane
    for each run if impacts are not kept (``kernels.ensemble.lanes``), else one for each of two
    bodies (``kernels.ensemble.libration_fast_path``).
    """

    def __init__(
        self, system: TraceSystem, beside: Batch | None = None, in_lanes: bool = True
    ) -> None:
        self._overrides = SYSTEM.overrides(system)
        logs_of = None if beside is None else beside.world
        self.world: World = compiled_world(SYSTEM.loop, make_world(system), logs_of)
        """Records of the system; bodies, pairs, flights and clock belong to the last run."""
        copies: Any = {name: np.array(getattr(self.world, name)) for name in SYSTEM.loop.state}
        self._fresh = self.world._replace(**copies)
        two = len(system.bodies) == 2 and not system.trace.closed
        free = system.turning is None and system.surface == "two-sided"
        self._bodies = two_bodies(in_lanes and not self._overrides.replaced)
        self._group = lane_group() if in_lanes and two and free else None
        self.impacts_in_lanes = 0
        """Number of impacts computed in lanes, over all runs so far."""

    def _suits_lanes(self, points: Points) -> bool:
        """Set up lanes for the arc where the first point starts; return whether they apply."""
        starts: Any = points.starts
        world: Any = self.world
        group = self._group
        if group is None or not len(starts):
            return False
        runs, bodies, librations = map(np.asarray, (group.runs, group.bodies, group.librations))
        piece = int(starts["piece"][0])
        tracks = world.tracks[[piece, len(world.pieces) + piece]]
        runs["piece"] = piece
        for name in same_in_every_lane(BodyLanes):
            bodies[name] = world.bodies[name]
        librations["frequency"] = librations["own_frequency"] = tracks["frequency"]
        valley = world.pieces[piece]["sign"] > 0.0 and (tracks["lowest_s2"] == 0.0).all()
        return bool(valley and world.contacts[piece]["normal_a"] > 0.0)

    def run_all(self, points: Points, results: Results, stack: Stack | None = None) -> Results:
        """Run all points; return the results, enlarged if the impacts needed more room.

        With a ``stack`` each point has its own system, with equal shapes, bodies and laws.
        """
        point, count, rows = 0, len(points.own), 0
        given = self.world, self._fresh, points
        if stack is not None:
            self.world.meeting[:] = 1  # type: ignore[call-overload]
        elif len(results.impacts) == 0 and self._suits_lanes(points):
            in_lanes = compiled(run_points_in_lanes)
            self.impacts_in_lanes += int(in_lanes(*given, results, self._group))
            return results
        run: Any = compiled(run_points, self._overrides)
        used = stack or _NO_STACK, self._bodies
        while True:
            point, rows = map(int, run(*given, results, *used, point, rows))
            if point == count:
                return results
            more: Any = np.concatenate([results.impacts, results.impacts])
            results = results._replace(impacts=more)

    def follow(
        self, points: Points, results: Results, scales: Any, stack: Stack | None = None
    ) -> Any:
        """Run all points and follow their tangent maps; impacts are not kept.

        `scales` [point] are the time scales (s), see ``systems.trace.system.time_scale``. Returns
        the logarithms [point, direction] of the growth of a frame's vectors.
        """
        size = 2 * len(self.world.bodies)
        states = zeros(len(points.own) + 1, TangentState)
        states["time_scale"][1:] = scales
        tangents = room_for(size, len(self.world.impacts), False, states, from_start=False)
        sums = np.zeros((len(points.own), size))
        if stack is not None:
            self.world.meeting[:] = 1  # type: ignore[call-overload]
        given = self.world, self._fresh, points, results, stack or _NO_STACK, tangents, sums
        compiled(follow_points, self._overrides)(*given)
        return sums


def lane_group() -> LaneGroup:
    """Return a group of lanes without runs."""
    return LaneGroup(
        zeros(1, RunLanes),
        zeros(2, BodyLanes),
        zeros(2, LibrationLanes),
        zeros(LANES, LaneSlot),
    )


def same_in_every_lane(cls: type) -> list[str]:
    """Return the fields of a record of lanes that hold one number for all lanes."""
    return [name for name in dtype(cls).names or () if dtype(cls)[name].shape == ()]


def make_points(
    stop_t: Any, stop_collisions: Any, piece: Any, s: Any, c: Any, p: Any, mass: Any, k: Any
) -> Points:
    """Return the points of a batch from arrays indexed [point], [point, ball] and [point, pair]."""
    own = zeros(len(stop_t), PointData)
    own["stop_t"], own["stop_collisions"] = stop_t, stop_collisions
    starts = zeros(piece.size, StartData)
    for name, values in (("piece", piece), ("s", s), ("c", c), ("p", p), ("mass", mass)):
        starts[name] = values.reshape(-1)
    restitutions: Any = np.array(k, dtype=np.float64).reshape(-1)
    return Points(own, starts, restitutions)


def empty_results(points: int, bodies: int, impact_rows: int) -> Results:
    """Allocate the results of a number of points."""
    return Results(
        outcomes=zeros(points, Outcome),
        finals=zeros(points * bodies, FinalState),
        impacts=zeros(impact_rows, ImpactRow),
        scratch=zeros(1, Flight),
    )


def stack_of(system: TraceSystem, count: int, of_runs: Any) -> Stack:
    """Return the records of ``count`` systems, given as one system with arrays for numbers.

    ``of_runs`` is the index of each run's system.
    """
    world = make_world(system, far_apart=False)
    records = {name: _rows(getattr(world, name), cls, count) for name, cls in _STACKED.items()}
    numbers: Any = np.array(of_runs, dtype=np.int64)
    return Stack(**records, of_runs=numbers)


def own_records(world: World) -> World:
    """Return a compiled world with copies of the records that a stack overwrites."""
    changed: Any = {name: getattr(world, name).copy() for name in _STACKED}
    return world._replace(**changed)


def _rows(records: Sequence[Any], cls: type, count: int) -> Any:
    """Convert records with arrays of ``count`` numbers to rows of plain records, by system."""
    rows = np.zeros((count, len(records)), dtype=dtype(cls))
    for place, one in enumerate(records):
        for name in rows.dtype.names or ():
            rows[name][:, place] = getattr(one, name)
    return rows.reshape(-1)


def points_of(system: TraceSystem, count: int, impacts: int) -> Points:
    """Return ``count`` equal points with the initial states of a system and a stop by impacts."""
    flights = [initial_flight(system, number) for number in range(len(system.bodies))]
    pairs = [system.restitution_of(number) for number in range(len(pairs_of(system)))] or [1.0]

    def tiled(values: Any, kind: type = float) -> Any:
        return np.tile(np.array(values, dtype=kind), (count, 1))

    s, c, p = (tiled([getattr(flight, name) for flight in flights]) for name in "scp")
    return make_points(
        np.full(count, NEVER), np.full(count, impacts),
        tiled([flight.piece for flight in flights], np.int64), s, c, p,
        tiled([body.mass for body in system.bodies]), tiled(pairs),
    )  # fmt: skip
