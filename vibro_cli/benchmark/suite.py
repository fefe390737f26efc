"""The whole benchmark in order, beginning with run time against error on every scene."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from functools import partial

from vibro_cli.benchmark.cost import (
    measure_growth,
    measure_on_all_cores,
    measure_other_systems,
    measure_skips,
)
from vibro_cli.benchmark.end_to_end import measure_command, measure_grid
from vibro_cli.benchmark.measurement import SERIES, Job, Plan, Row, by_turns
from vibro_cli.benchmark.methods import methods
from vibro_cli.benchmark.methods.runner import Lost, Method, Runner, Setting
from vibro_cli.benchmark.scenes import SCENES, Scene, errors_of_times, reference_times
from vibro_cli.progress import WORK

_QUICK_SCENES = ("circle",)
_ASTRAY = 1e-2
"""Relative error above which a time must be that of another impact, except for series."""


def run(plan: Plan, scenes: Sequence[str] = ()) -> Iterator[list[Row]]:
    """Measure the named scenes or, if none is named, all scenes and all other parts."""
    yield from _measure_precision(plan, scenes)
    if not scenes:
        yield from measure_growth(plan)
        WORK.report("a grid on all cores")
        yield measure_on_all_cores(plan)
        WORK.report("a grid")
        yield measure_grid(plan)
        WORK.report("what is skipped")
        yield measure_skips(plan)
        WORK.report("other systems")
        yield measure_other_systems(plan)
        yield from measure_command(plan)


def _measure_precision(plan: Plan, names: Sequence[str]) -> Iterator[list[Row]]:
    """Measure the named scenes (all if empty); yield the rows of each scene."""
    found = methods(plan.form == "quick")
    if not names and plan.form == "quick":
        names = _QUICK_SCENES
    for scene in SCENES:
        if not names or scene.name in names:
            yield _measure_scene(plan, scene, found)


def _measure_scene(plan: Plan, scene: Scene, found: list[Method]) -> list[Row]:
    exact = reference_times(scene)
    rows, timed = [], []
    for method in found:
        if not method.suits(scene):
            continue
        for setting in method.settings:
            WORK.report(f"{scene.name}, {method.name} {setting.name}".rstrip())
            row = Row("precision", scene.name, method.name, setting.name)
            rows.append(row)
            runner = _compared(row, scene, method, setting, exact)
            if runner is not None and row.status == "ok":
                timed.append((row, runner, method))
    chosen = [
        (row, runner) for row, runner, method in timed if _fitted(plan, scene, row, runner, method)
    ]
    WORK.report(f"{scene.name}, all by turns")
    jobs = [Job(runner.go, partial(runner.ready, row.impacts)) for row, runner in chosen]
    for (row, runner), times in zip(chosen, by_turns(jobs, plan), strict=True):
        try:
            course = runner.course()
        except Lost as lost:
            row.lose(lost)
            continue
        row.crossings, row.energy_drift = course.crossings, course.energy_drift
        row.take_times(times)
    return rows


def _compared(
    row: Row, scene: Scene, method: Method, setting: Setting, exact: list[str]
) -> Runner | None:
    """Run the impacts of the reference and set their error; return the runner unless it is lost."""
    try:
        runner = method.prepare(scene, setting)
        runner.ready(scene.compared)
        runner.go()
        times = runner.course().times[: scene.compared]
    except Lost as lost:
        row.lose(lost)
        return None
    row.compared = len(times)
    found = errors_of_times(times, exact)
    row.error = max(found)
    astray = next((n for n, error in enumerate(found, 1) if error > _ASTRAY), None)
    if astray is not None and method.name != SERIES:
        row.lose(f"impact {astray} is not that of the reference")
    return runner


def _timed(runner: Runner, impacts: int) -> float:
    runner.ready(impacts)
    start = time.perf_counter()
    runner.go()
    return time.perf_counter() - start


def _fitted(plan: Plan, scene: Scene, row: Row, runner: Runner, method: Method) -> bool:
    """Choose how many impacts are timed; return whether the method computes them all."""
    row.impacts = scene.compared
    most = method.impacts if scene.most is None or method.repeats else scene.compared
    try:
        while True:
            taken = min(_timed(runner, row.impacts) for _ in range(2))
            if taken > 0.5 * plan.target or 2 * row.impacts > most:
                return True
            more = min(2.0, 0.9 * plan.target / taken) if taken > 0.2 * plan.target else 4.0
            # Time whole motions of a scene that ends, or more impacts of one that continues.
            row.impacts = max(1, int(more * row.impacts / scene.compared)) * scene.compared
            row.impacts = min(row.impacts, most // scene.compared * scene.compared)
    except Lost as lost:
        row.lose(lost)
        return False
