"""What is not computed because nobody needs it: the time with and without each skip."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from vibro_cli.benchmark.measurement import Plan, Row, Task, by_turns, warmed
from vibro_cli.benchmark.methods.with_vibro import DriverRunner
from vibro_cli.benchmark.scenes import BY_NAME, Scene
from vibro_cli.systems.trace.run import Run, Wanted, simulate_system

WITH, WITHOUT = "skipped", "not skipped"
APART = "searches of pairs out of reach"
ROWS = "rows that nobody keeps"
TABLES = "tables that nobody asks for"
FIGURES = "figures that nobody asks for"


class _Searching(DriverRunner):
    """Single runs in which no pair is taken for apart because its pieces are out of reach."""

    def ready(self, impacts: int) -> None:
        """Make the records of the runs."""
        super().ready(impacts)
        for driver in self.drivers:
            far: Any = driver.world.far
            far[:] = 0


def measure_skips(plan: Plan) -> list[Row]:
    """Measure each skip on a scene where it matters, with and without it by turns."""
    impacts = 500 if plan.form == "quick" else 20_000
    rows, tasks = [], []
    for skip, scene, with_it, without in _kernel_skips(impacts):
        for setting, task in ((WITH, with_it), (WITHOUT, without)):
            rows.append(Row("skips", scene.name, skip, setting, impacts=impacts))
            tasks.append(task)
    for setting, task in ((WITH, _tables(False)), (WITHOUT, _tables(True))):
        rows.append(Row("skips", "three_arcs", TABLES, setting, impacts=_FEW))
        tasks.append(task)
    for row, times in zip(rows, by_turns(warmed(tasks), plan), strict=True):
        row.take_times(times)
    return rows + _measure_figures(plan)


_FEW = 300


def _kernel_skips(impacts: int) -> list[tuple[str, Scene, Task, Task]]:
    three, circle = BY_NAME["three_arcs"], BY_NAME["circle"]

    def task(runner: DriverRunner) -> Task:
        return lambda: runner.ready(impacts), runner.go

    return [
        (APART, three, task(DriverRunner(three.system, "compiled")),
         task(_Searching(three.system, "compiled"))),
        (ROWS, circle, task(DriverRunner(circle.system, "compiled")),
         task(DriverRunner(circle.system, "compiled", keep=True))),
    ]  # fmt: skip


def _tables(all_of_them: bool) -> Task:
    """A short interpreted run and its impacts, or all its tables."""
    system = BY_NAME["three_arcs"].system

    def go() -> None:
        wanted = Wanted(step=0.01, turning_points=True, friction=0.3) if all_of_them else None
        run: Run = simulate_system(system, None, _FEW, "python", wanted)
        assert len(run.collisions["n"]) == _FEW
        if all_of_them:
            assert run.motion is not None
            assert run.events
            assert run.summary

    return _nothing, go


def _nothing() -> None:
    """Nothing has to be made ready."""


def _measure_figures(plan: Plan) -> list[Row]:
    """Whole processes of `vibro run` with and without figures."""
    rows, tasks = [], []
    with tempfile.TemporaryDirectory(prefix="vibro-bench-") as folder:
        for setting, option in ((WITH, "--no-figures"), (WITHOUT, "--figures=default")):
            rows.append(Row("skips", "three_arcs", FIGURES, setting, impacts=_FEW))
            tasks.append((_nothing, _process(Path(folder), option)))
        few = Plan(plan.form, 3, plan.target, (), (), ())
        for row, times in zip(rows, by_turns(warmed(tasks), few), strict=True):
            row.take_times(times)
    return rows


def _process(folder: Path, option: str) -> Callable[[], None]:
    from vibro_cli.storage.provenance import json_bytes

    document = BY_NAME["three_arcs"].document | {"stop": {"collisions": _FEW}}
    source = folder / "scene.json"
    source.write_bytes(json_bytes(document))
    command = [sys.executable, "-m", "vibro_cli", "run", str(source), "-q", option]
    command += ["-o", str(folder / option.strip("-"))]

    def go() -> None:
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=dict(os.environ))

    return go
