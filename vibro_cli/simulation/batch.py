"""Many runs of one system one after another, compiled: what grids are solved with."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vibro_cli.mechanics.records import Flight
from vibro_cli.mechanics.system import System
from vibro_cli.numerics import engine
from vibro_cli.simulation.drive import STATE, compiled_world
from vibro_cli.simulation.entry import empty_results, enter_points, zeros
from vibro_cli.simulation.impacts import ImpactTable, runs_of
from vibro_cli.simulation.points import PointData, Points, RestitutionData, Results, StartData
from vibro_cli.simulation.prepare import make_world, smallest_system
from vibro_cli.simulation.turning import variant_of
from vibro_cli.simulation.world import World


class Progress(NamedTuple):
    """How far a batch has come: the next run, and the rows of impacts that are filled."""

    point: int
    rows: int


class Batch:
    """Runs of one system in one thread.

    Parameters
    ----------
    system
        Trace, bodies (but for their masses), laws and ends of every run; its initial states are
        not used.
    beside
        Another batch of as many bodies, in the same thread, to share its logs.
    """

    def __init__(self, system: System, beside: Batch | None = None) -> None:
        self._variant = variant_of(system)
        logs_of = None if beside is None else beside.world
        self.world: World = compiled_world(make_world(system, None, None), logs_of)
        """The records of the system; bodies, pairs, flights and clock are those of the last run."""
        copies: Any = {name: np.array(getattr(self.world, name)) for name in STATE}
        self._fresh = self.world._replace(**copies)
        self._scratch: Any = np.zeros(1, dtype=engine.dtype(Flight))

    @staticmethod
    def compile() -> None:
        """Make or load the machine code now, also that for the table of impacts."""
        system = smallest_system()
        none = np.zeros((0, 1))
        points = make_points(none[:, 0], none[:, 0], none, none, none, none, none, none)
        batch, results = Batch(system), empty_results(0, 1, 0)
        batch.run(points, results, Progress(0, 0), 0)
        runs = runs_of(system, [], [], [], none)
        ImpactTable(0, ()).fill(batch.world, "numba", results.impacts, runs, 0.0)

    def run_all(self, points: Points, results: Results) -> Results:
        """Run all points; return the results, with more room for impacts if they needed it."""
        done = Progress(0, 0)
        while True:
            done = self.run(points, results, done, len(points.own))
            if done.point == len(points.own):
                return results
            more: Any = np.concatenate([results.impacts, results.impacts])
            results = results._replace(impacts=more)

    def run(self, points: Points, results: Results, done: Progress, last: int) -> Progress:
        """Go on to before point ``last``, or until there is no room for the impacts of a point."""
        return Progress(
            *enter_points(
                self.world, self._fresh, self._scratch, points, results,
                done.point, last, done.rows, self._variant,
            )
        )  # fmt: skip


def make_points(
    stop_t: Any, stop_collisions: Any, piece: Any, s: Any, c: Any, p: Any, mass: Any, k: Any
) -> Points:
    """Return the points of a batch from arrays: [point], then [point, ball], then [point, pair]."""
    own = zeros(len(stop_t), PointData)
    own["stop_t"], own["stop_collisions"] = stop_t, stop_collisions
    starts = zeros(piece.size, StartData)
    for name, values in (("piece", piece), ("s", s), ("c", c), ("p", p), ("mass", mass)):
        starts[name] = values.reshape(-1)
    restitutions = zeros(k.size, RestitutionData)
    restitutions["k"] = k.reshape(-1)
    return Points(own, starts, restitutions)
