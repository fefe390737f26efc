"""A grid of scenarios on all cores, summaries only: our batches in threads, heyoka's in processes.

heyoka calls back into Python for each impact, so that its batches need a process for each core.
"""

from __future__ import annotations

import multiprocessing
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from vibro_cli.benchmark.growth import EACH, Crew, first_halves
from vibro_cli.benchmark.measurement import Plan, Row, by_turns, warmed
from vibro_cli.benchmark.motion import Motion
from vibro_cli.benchmark.precision import installed_peers
from vibro_cli.benchmark.scenes import BY_NAME
from vibro_cli.benchmark.with_heyoka_batch import NAME, TOLERANCES, Lanes
from vibro_cli.grids.threads import available_cores

PART = "grid"
_SCENE = "circle"
_SCENARIOS = {"quick": 64, "default": 10_000, "full": 10_000}


class Processes:
    """heyoka's batches of the scenarios of a `Crew`, in processes.

    Parameters
    ----------
    processes
        How many; each waits for its work from the start on.
    count
        How many scenarios.
    tolerance
        Of the integrator.
    """

    def __init__(self, processes: int, count: int, tolerance: float) -> None:
        self.impacts = 0
        context = multiprocessing.get_context("spawn")
        self._ends: list[Any] = []
        for number in range(processes):
            here, there = context.Pipe()
            share = range(number, count, processes)
            work = context.Process(target=_serve, args=(there, share, count, tolerance))
            work.daemon = True
            work.start()
            self._ends.append(here)

    def ready(self) -> None:
        """Nothing is kept from run to run."""

    def go(self) -> None:
        """Solve all scenarios."""
        for end in self._ends:
            end.send(True)
        self.impacts = sum(end.recv() for end in self._ends)

    def close(self) -> None:
        """End the processes."""
        for end in self._ends:
            end.send(False)


def _serve(end: Connection, share: range, count: int, tolerance: float) -> None:
    """Solve a share of the scenarios whenever told to; answer with the impacts there were."""
    motion = Motion(BY_NAME[_SCENE].system)
    lanes = Lanes(motion, tolerance)
    angles = 2.0 * first_halves(np.array(share), count)
    while end.recv():
        total = 0
        for first in range(0, len(angles), lanes.count):
            starts = np.tile(np.array(motion.start)[:, None], lanes.count)
            # The last ones again in lanes that would be empty.
            own = angles[first : first + lanes.count]
            starts[0] = own[np.minimum(np.arange(lanes.count), len(own) - 1)]
            total += lanes.go(starts, EACH)
        end.send(total)


def measure(plan: Plan) -> list[Row]:
    """Measure one grid by every way there is, by turns."""
    count, cores = _SCENARIOS[plan.form], available_cores()
    rows = [Row(PART, _SCENE, "vibro, batch", "exact", size=count)]
    crews: list[Crew | Processes] = [Crew(cores, count)]
    if "heyoka" in installed_peers():
        for tolerance in TOLERANCES:
            rows.append(Row(PART, _SCENE, NAME, f"{tolerance:g}", size=count))
            crews.append(Processes(cores, count, tolerance))
    try:
        taken = by_turns(warmed([(crew.ready, crew.go) for crew in crews]), plan)
    finally:
        for crew in crews:
            if isinstance(crew, Processes):
                crew.close()
    for row, crew, times in zip(rows, crews, taken, strict=True):
        row.impacts = crew.impacts
        row.take_times(times)
    return rows
