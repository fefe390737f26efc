"""Cost of an impact by the numbers of bodies, arcs, scenarios and cores, and by skipped work.

A grid of scenarios, summaries only, is solved on all cores: by our batches in threads, and by
heyoka's in processes, since heyoka calls back into Python at each impact.
"""

from __future__ import annotations

import math
import multiprocessing
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from vibro_cli.benchmark.measurement import (
    BATCH,
    COMPILED,
    WITH,
    WITHOUT,
    Job,
    Plan,
    Row,
    by_turns,
    command,
    done_once,
    shared_out,
    timed,
)
from vibro_cli.benchmark.methods.runner import Lost, Motion
from vibro_cli.benchmark.methods.with_heyoka import NAME, TOLERANCES, Lanes
from vibro_cli.benchmark.methods.with_vibro import DriverRunner, driver_job
from vibro_cli.benchmark.scenes import BY_NAME, VALLEY, Scene, ball, timed_scenes
from vibro_cli.progress import WORK
from vibro_cli.scenario.loading import any_scenario_of
from vibro_cli.storage.files import available_cores, json_bytes
from vibro_cli.systems.contract import Document
from vibro_cli.systems.request import Limits, OutputRequest
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system
from vibro_cli.systems.trace.ensemble import Batch, empty_results, points_of

_IMPACTS = 20_000
_DENSITY = (7800.0, 2700.0)
EACH = 100
"""Impacts of each scenario of a batch."""
_STRETCH = 1000
"""Scenarios that a thread solves at once, which limits its memory."""
_THREADED = 20_000
_FEW = 20
"""Impacts of each scenario of a grid."""


def row_of_bodies(count: int) -> Scene:
    """Return a scene of `count` balls side by side in one valley, with alternating densities."""
    # Even with all their energy, a light ball could not leave the valley.
    span = 0.9 * min(1.0, math.sqrt(20.0 / count))
    step = span / max(count - 1, 1)
    balls = tuple(
        ball(step * (number + 0.2 * math.sin(7.0 * number)) - 0.5 * span, _DENSITY[number % 2])
        | {"radius": 0.004}
        for number in range(count)
    )
    return Scene(f"{count} bodies", f"{count} balls in one valley", VALLEY, balls)


def chain_of_arcs(count: int) -> Scene:
    """Return a chain of `count` arcs, on three of which two balls roll."""
    middle: list[tuple[str, float, int]] = [
        ("valley", 1.0, 50), ("hump", 0.5, -50), ("valley", 1.0, 90),
    ]  # fmt: skip
    right = (count - 3 + 1) // 2
    left = count - 3 - right
    slopes = [-30 if number % 2 == 0 else 30 for number in range(right)]
    after = [("hump" if end < 0 else "valley", 0.5, end) for end in slopes]
    start, before = -90, []
    if left:
        # To the left of the middle: humps and valleys alternate, mirrored.
        ends = [-90] + [30 if number % 2 == 0 else -30 for number in range(left)]
        start = ends[-1]
        before = [
            ("hump" if end < begin else "valley", 0.5, end)
            for begin, end in zip(reversed(ends[1:]), reversed(ends[:-1]), strict=True)
        ]
    arcs = [
        {"shape": shape, "radius": radius, "end_slope": f"{end} deg"}
        for shape, radius, end in [*before, *middle, *after]
    ]
    trace: Document = {"start_slope": f"{start} deg", "arcs": arcs}
    balls = (ball(-1.2, 7800.0, left + 1), ball(0.2, 6000.0, left + 3))
    return Scene(f"{count} arcs", f"{count} arcs, 3 reached", trace, balls, law="normal-impulse")


def measure_growth(plan: Plan) -> Iterator[list[Row]]:
    """Measure how cost and memory grow; yield the rows of each kind."""
    WORK.report("more and more bodies")
    yield _measure_scenes(plan, "bodies", {count: row_of_bodies(count) for count in plan.bodies})
    WORK.report("more and more arcs")
    yield _measure_scenes(plan, "arcs", {count: chain_of_arcs(count) for count in plan.arcs})
    WORK.report("more and more scenarios")
    yield _measure_batches(plan)
    WORK.report("memory")
    yield _measure_memory(plan)


def _measure_scenes(plan: Plan, part: str, scenes: dict[int, Scene]) -> list[Row]:
    """Measure single compiled runs of scenes of different sizes."""
    impacts = _IMPACTS if plan.form != "quick" else 500
    rows = [
        Row(part, scene.name, COMPILED, size=size, impacts=impacts)
        for size, scene in scenes.items()
    ]
    runners = [DriverRunner(scene.system, "compiled") for scene in scenes.values()]
    jobs = [Job(runner.go, partial(runner.ready, impacts)) for runner in runners]
    done_once(jobs)
    for row, runner, times in zip(rows, runners, by_turns(jobs, plan), strict=True):
        try:
            row.crossings = runner.course().crossings
            row.take_times(times)
        except Lost as lost:
            row.lose(lost)
    return rows


def first_halves(numbers: Any, count: int) -> Any:
    """Return half the initial angles (rad) of the first ball, for some of `count` scenarios."""
    return -0.36 - 0.05 * numbers / count


def crew(threads: int, count: int) -> Job:
    """Return a job: threads solve a number of scenarios, `_STRETCH` at a time.

    The scenarios are circles that differ in the initial angle of the first ball.
    """
    system = BY_NAME["circle"].system

    def solve(batch: Batch, first: int) -> int:
        some = min(_STRETCH, count - first)
        points = points_of(system, some, EACH)
        starts: Any = points.starts
        half = first_halves(np.arange(first, first + some), count)
        starts["s"][::2], starts["c"][::2] = np.sin(half), np.cos(half)
        outcomes: Any = batch.run_all(points, empty_results(some, 2, 0)).outcomes
        return int(outcomes["collisions"].sum())

    solvers = [partial(solve, Batch(system)) for _ in range(threads)]
    return Job(lambda: shared_out(range(0, count, _STRETCH), solvers))


def _measure_batches(plan: Plan) -> list[Row]:
    """Measure batches of increasing size in one thread, then one size on increasing threads."""
    cores = available_cores()
    size = _THREADED if plan.form != "quick" else 1000
    jobs = [
        (Row("scenarios", "circle", BATCH, size=count), crew(1, count)) for count in plan.scenarios
    ]
    for threads in sorted({1, min(2, cores), cores}):
        jobs.append((Row("cores", "circle", BATCH, size=threads), crew(threads, size)))
    return timed(jobs, plan)


_GRID = """
name = "memory"
base = "scene.json"
[[axes]]
path = "balls[1].angle"
linspace = [-0.72, -0.8, {count}]
[keep]
collisions = true
"""


def _measure_memory(plan: Plan) -> list[Row]:
    """Measure the peak memory of `vibro grid` with every impact kept, in a separate process."""
    counts = {"quick": (100,), "default": (1000, 30_000), "full": (1000, 30_000, 1_000_000)}
    rows = []
    for count in counts[plan.form]:
        with tempfile.TemporaryDirectory(prefix="vibro-bench-") as folder:
            document = BY_NAME["circle"].document | {"stop": {"collisions": _FEW}}
            (Path(folder) / "scene.json").write_bytes(json_bytes(document))
            source = Path(folder) / "grid.toml"
            source.write_text(_GRID.format(count=count), encoding="utf-8")
            row = Row("memory", "circle", "vibro grid", "impacts kept", count, _FEW * count)
            rows.append(row)
            try:
                target = str(Path(folder) / "out")
                row.memory = command("grid", str(source), "-o", target, "--engine", "compiled")
            except subprocess.CalledProcessError as error:
                row.status, row.note = "failed", f"exit code {error.returncode}"
    return rows


PART = "grid"
_SCENE = "circle"
_SCENARIOS = {"quick": 64, "default": 10_000, "full": 10_000}


class Processes:
    """Waiting processes that solve the scenarios of a `crew` with heyoka's batches."""

    def __init__(self, processes: int, count: int, tolerance: float) -> None:
        context = multiprocessing.get_context("spawn")
        self._ends: list[Any] = []
        for number in range(processes):
            here, there = context.Pipe()
            share = range(number, count, processes)
            work = context.Process(target=_serve, args=(there, share, count, tolerance))
            work.daemon = True
            work.start()
            self._ends.append(here)

    def go(self) -> int:
        """Solve all scenarios; return the number of impacts."""
        for end in self._ends:
            end.send(True)
        return sum(end.recv() for end in self._ends)

    def close(self) -> None:
        """End the processes."""
        for end in self._ends:
            end.send(False)


def _serve(end: Connection, share: range, count: int, tolerance: float) -> None:
    """Solve a share of the scenarios at each request; answer with the number of impacts."""
    motion = Motion(BY_NAME[_SCENE].system)
    lanes = Lanes(motion, tolerance)
    angles = 2.0 * first_halves(np.array(share), count)
    while end.recv():
        total = 0
        for first in range(0, len(angles), lanes.count):
            starts = np.tile(np.array(motion.start)[:, None], lanes.count)
            # Lanes that would be empty repeat the last start.
            own = angles[first : first + lanes.count]
            starts[0] = own[np.minimum(np.arange(lanes.count), len(own) - 1)]
            total += lanes.go(starts, EACH)
        end.send(total)


def measure_on_all_cores(plan: Plan) -> list[Row]:
    """Measure one grid with our batches and, if installed, heyoka's, interleaved."""
    count, cores = _SCENARIOS[plan.form], available_cores()
    jobs = [(Row(PART, _SCENE, BATCH, "exact", size=count), crew(cores, count))]
    others: list[Processes] = []
    if find_spec("heyoka"):
        for tolerance in TOLERANCES:
            row = Row(PART, _SCENE, NAME, f"{tolerance:g}", size=count)
            others.append(Processes(cores, count, tolerance))
            jobs.append((row, Job(others[-1].go)))
    try:
        return timed(jobs, plan)
    finally:
        for processes in others:
            processes.close()


def measure_other_systems(plan: Plan) -> list[Row]:
    """Measure the scenes of all systems, interleaved; bounces of a single ball are its impacts."""
    long = 5_000 if plan.form == "quick" else 200_000
    jobs = []
    for name, scene in timed_scenes("systems").items():
        impacts = long // scene.share
        lone = len(scene.document["balls"]) == 1
        limits = Limits(bounces=impacts) if lone else Limits(collisions=impacts)
        row = Row("systems", name, COMPILED, impacts=impacts)
        jobs.append((row, driver_job(any_scenario_of(scene.document), limits)))
    return timed(jobs, plan)


APART = "searches of pairs out of reach"
ROWS = "rows that nobody keeps"
TABLES = "tables that nobody asks for"
FIGURES = "figures that nobody asks for"
_SHORT_RUN = 300


class _Searching(DriverRunner):
    """Single runs without the skip of pairs whose pieces are out of reach of each other."""

    def ready(self, impacts: int) -> None:
        super().ready(impacts)
        for driver in self.drivers:
            meeting: Any = driver.world.meeting
            meeting[:] = 1


def measure_skips(plan: Plan) -> list[Row]:
    """Measure each skip on a scene where it matters, with and without it, interleaved."""
    impacts = 500 if plan.form == "quick" else _IMPACTS
    jobs = []
    for skip, name, without in (
        (APART, "three_arcs", _Searching),
        (ROWS, "circle", partial(DriverRunner, keep=True)),
    ):
        for setting, kind in ((WITH, DriverRunner), (WITHOUT, without)):
            runner = kind(BY_NAME[name].system, "compiled")
            row = Row("skips", name, skip, setting, impacts=impacts)
            jobs.append((row, Job(runner.go, partial(runner.ready, impacts))))
    for setting, all_of_them in ((WITH, False), (WITHOUT, True)):
        row = Row("skips", "three_arcs", TABLES, setting, impacts=_SHORT_RUN)
        jobs.append((row, Job(partial(_make_tables, all_of_them))))
    return timed(jobs, plan) + _measure_figures(plan)


def _make_tables(all_of_them: bool) -> None:
    """Make a short interpreted run with its impacts only, or with all its tables."""
    wanted = OutputRequest(step=0.01, turning_points=True, friction=0.3) if all_of_them else None
    system = BY_NAME["three_arcs"].system
    run: Run = simulate_system(system, None, _SHORT_RUN, "python", wanted)
    assert len(run.collisions["n"]) == _SHORT_RUN
    if all_of_them:
        assert run.motion is not None
        assert run.events
        assert run.summary


def _measure_figures(plan: Plan) -> list[Row]:
    """Measure whole processes of `vibro run` with and without figures."""
    document = BY_NAME["three_arcs"].document | {"stop": {"collisions": _SHORT_RUN}}
    jobs = []
    with tempfile.TemporaryDirectory(prefix="vibro-bench-") as folder:
        source = Path(folder) / "scene.json"
        source.write_bytes(json_bytes(document))
        for setting, option in ((WITH, "--no-figures"), (WITHOUT, "--figures=default")):
            row = Row("skips", "three_arcs", FIGURES, setting, impacts=_SHORT_RUN)
            target = str(Path(folder) / option.strip("-"))
            jobs.append((row, Job(partial(_run, str(source), option, "-o", target))))
        return timed(jobs, replace(plan, repeats=3))


def _run(*arguments: str) -> None:
    command("run", *arguments)
