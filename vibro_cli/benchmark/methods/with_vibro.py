"""This package's solver: compiled, compiled with all rows kept, interpreted, and in a batch."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibro_cli.benchmark.measurement import BATCH, COMPILED, INTERPRETED, KEPT
from vibro_cli.benchmark.methods.runner import (
    Course,
    DriverRunner,
    Method,
    Runner,
    Setting,
)
from vibro_cli.benchmark.scenes import Scene
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.systems.trace.ensemble import Batch, empty_results, points_of

EXACT = (Setting("exact"),)
_EACH = 60
"""Impacts of each run of a batch; it starts as the scene does."""


class BatchRunner(Runner):
    """Many runs of one scene by the kernel of grids, in one thread.

    Parameters
    ----------
    system
        What moves.
    most
        Impacts after which the motion is begun again, if it ends.
    """

    def __init__(self, system: TraceSystem, most: int | None) -> None:
        self._system, self._most = system, most
        self._batch = Batch(system)

    def ready(self, impacts: int) -> None:
        """Lay out the points, each with its part of the impacts."""
        each = min(impacts, _EACH, self._most or _EACH)
        self._count = impacts // each
        self._points = points_of(self._system, self._count, each)

    def go(self) -> None:
        """Run all points, their summaries alone kept."""
        room = empty_results(self._count, len(self._system.bodies), 0)
        self._results = self._batch.run_all(self._points, room)

    def course(self) -> Course:
        """Return the times of the first run, with its impacts kept this once."""
        own: Any = self._points.own
        one = points_of(self._system, 1, int(own["stop_collisions"][0]))
        kept = self._batch.run_all(one, empty_results(1, len(self._system.bodies), 1024))
        outcomes, rows = (np.asarray(part) for part in (kept.outcomes, kept.impacts))
        every: Any = self._results.outcomes
        times = rows["t"][: int(outcomes["kept"][0])].tolist()
        return Course(times, int(every["collisions"].sum()), int(every["crossings"].sum()))


def _driver(engine: str, keep: bool, scene: Scene) -> Runner:
    return DriverRunner(scene.system, engine, keep, scene.most)


def methods() -> list[Method]:
    """Return the ways to run this solver."""

    def anywhere(scene: Scene) -> bool:
        return True

    return [
        Method(COMPILED, EXACT, anywhere, lambda s, _: _driver("compiled", False, s), 20_000, True),
        Method(KEPT, EXACT, anywhere, lambda s, _: _driver("compiled", True, s), 20_000),
        Method(BATCH, EXACT, anywhere, lambda s, _: BatchRunner(s.system, s.most), 20_000, True),
        Method(INTERPRETED, EXACT, anywhere, lambda s, _: _driver("python", False, s), 300, True),
    ]
