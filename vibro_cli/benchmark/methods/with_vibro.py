"""This package's solver: compiled, compiled with all rows kept, interpreted, and in a batch."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from vibro_cli.assemble import build_any
from vibro_cli.benchmark.measurement import BATCH, COMPILED, INTERPRETED, KEPT, Job
from vibro_cli.benchmark.methods.runner import (
    Course,
    Lost,
    Method,
    Motion,
    Runner,
    Setting,
)
from vibro_cli.benchmark.scenes import Scene
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.systems import system_named
from vibro_cli.systems.driver import Driver
from vibro_cli.systems.request import Limits
from vibro_cli.systems.trace import SYSTEM, simulate_system
from vibro_cli.systems.trace.ensemble import Batch, empty_results, points_of
from vibro_cli.systems.trace.world import make_world


def driver_job(scenario: Any, limits: Limits | None = None) -> Job:
    """Return a job that runs a scenario of any system, compiled; the rows of a trace are dropped.

    It returns the number of impacts.
    """
    kind, system = system_named(scenario.system), build_any(scenario)
    drivers: list[Driver] = []

    def ready() -> None:
        world = kind.world(system, limits or kind.limits(scenario))
        if hasattr(world.settings[0], "keep_rows"):
            world.settings[0].keep_rows = 0
        drivers[:] = [Driver(kind.loop, world, "compiled", overrides=kind.overrides(system))]

    def go() -> int:
        drivers[0].run()
        return int(drivers[0].clock_value("collisions"))

    return Job(go, ready)


_FIRST = 64
"""Number of first impacts whose times are returned."""


class DriverRunner(Runner):
    """Single runs through the driver.

    With `keep`, rows of impacts and flights are kept. A motion that ends restarts after `most`
    impacts.
    """

    def __init__(
        self, system: TraceSystem, engine: str, keep: bool = False, most: int | None = None
    ) -> None:
        self._system, self._engine, self._keep, self._most = system, engine, keep, most
        self._motion = Motion(system)

    def ready(self, impacts: int) -> None:
        """Make the records of the runs."""
        each = impacts if self._most is None else min(impacts, self._most)
        self._each = each
        self.drivers = []
        for _ in range(impacts // each):
            world = make_world(self._system, Limits(collisions=each))
            world.settings[0].keep_rows = int(self._keep)
            self.drivers.append(Driver(SYSTEM.loop, world, self._engine))

    def go(self) -> None:
        """Run."""
        for driver in self.drivers:
            driver.run()

    def course(self) -> Course:
        """Return the results of the last of the runs."""
        driver = self.drivers[-1]
        pieces, y = self._state(driver)
        times = []
        if len(self.drivers) == 1:  # times are from a run that keeps them
            run = simulate_system(self._system, None, _FIRST, self._engine)
            times = run.collisions["t"].tolist()
        crossings = int(driver.clock_value("crossings"))
        course = self._motion.course(times, crossings, pieces, y)
        course.impacts = int(driver.clock_value("collisions"))
        if course.impacts < self._each:
            raise Lost(f"the run ended after {course.impacts} impacts")
        return course

    def _state(self, driver: Driver) -> tuple[list[int], list[float]]:
        """Return pieces, angles and rates of the bodies at the start of their last flights."""
        pieces, y = [], []
        for ball in range(len(self._system.bodies)):
            flight: Any = driver.world.flights[ball]
            read = flight.__getitem__ if driver.engine == "compiled" else flight.__getattribute__
            piece = int(read("piece"))
            s, c, p = (float(read(name)) for name in "scp")
            on_valley = self._motion.arcs[piece].sign > 0.0
            angle = 2.0 * (np.arctan2(s, c) if on_valley else np.arctan2(-c, s))
            w2 = abs(self._motion.w2[ball][piece])
            pieces.append(piece)
            y += [float(angle), 2.0 * float(np.sqrt(w2)) * p]
        return pieces, y


EXACT = (Setting("exact"),)
_EACH = 60
"""Impacts of each run of a batch; all runs start as the scene does."""


class _BatchRunner(Runner):
    """Many runs of one scene with the kernel of grids, in one thread.

    A motion that ends restarts after `most` impacts.
    """

    def __init__(self, system: TraceSystem, most: int | None) -> None:
        self._system, self._most = system, most
        self._batch = Batch(system)

    def ready(self, impacts: int) -> None:
        """Prepare the points, each with its share of the impacts."""
        each = min(impacts, _EACH, self._most or _EACH)
        self._count = impacts // each
        self._points = points_of(self._system, self._count, each)

    def go(self) -> None:
        """Run all points, keeping only their summaries."""
        room = empty_results(self._count, len(self._system.bodies), 0)
        self._results = self._batch.run_all(self._points, room)

    def course(self) -> Course:
        """Return the times of the first run, which is repeated with its impacts kept."""
        own: Any = self._points.own
        one = points_of(self._system, 1, int(own["stop_collisions"][0]))
        kept = self._batch.run_all(one, empty_results(1, len(self._system.bodies), 1024))
        outcomes, rows = (np.asarray(part) for part in (kept.outcomes, kept.impacts))
        every: Any = self._results.outcomes
        times = rows["t"][: int(outcomes["kept"][0])].tolist()
        return Course(times, int(every["collisions"].sum()), int(every["crossings"].sum()))


def _driver(engine: str, keep: bool, scene: Scene, setting: Setting) -> Runner:
    return DriverRunner(scene.system, engine, keep, scene.most)


def methods() -> list[Method]:
    """Return the modes in which this solver is measured."""
    return [
        Method(COMPILED, EXACT, partial(_driver, "compiled", False), 20_000, repeats=True),
        Method(KEPT, EXACT, partial(_driver, "compiled", True), 20_000),
        Method(BATCH, EXACT, lambda s, _: _BatchRunner(s.system, s.most), 20_000, repeats=True),
        Method(INTERPRETED, EXACT, partial(_driver, "python", False), 300, repeats=True),
    ]
