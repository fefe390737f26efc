"""End-to-end cost compared with the kernels alone: planning, encoding, writing and starting.

A grid and its kernel both run in threads of this process, on all cores. The kernel gets the points
of the grid already planned, and returns the kept rows as columns, or only the summaries. A single
run is measured as a command, from the shell to the tables, and compared with its event loop.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vibro_cli.assemble import build_system
from vibro_cli.benchmark.measurement import (
    COMMAND,
    COMMAND_PART,
    EVENT_LOOP,
    GRID,
    GRID_PART,
    KERNEL,
    Job,
    Plan,
    Row,
    by_turns,
    command,
    done_once,
    shared_out,
    timed,
)
from vibro_cli.benchmark.methods.with_vibro import driver_job
from vibro_cli.benchmark.scenes import BY_NAME, ball, timed_scenes
from vibro_cli.grids.axes import Array
from vibro_cli.grids.chunks import Chunks
from vibro_cli.grids.document import Grid, grid_of
from vibro_cli.grids.solving import impact_table_of
from vibro_cli.grids.workers import chunks_of, solve_in_threads
from vibro_cli.kernels.world import ImpactRow
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.progress import WORK
from vibro_cli.scenario import loading
from vibro_cli.storage.files import available_cores, json_bytes
from vibro_cli.stress.scenes import three_arcs
from vibro_cli.systems.columns import Table
from vibro_cli.systems.contract import Document, TimedScene
from vibro_cli.systems.driver import zeros
from vibro_cli.systems.trace.ensemble import Batch, empty_results
from vibro_cli.systems.trace.grid_solver import Logged, Task, first_rows, impact_columns
from vibro_cli.systems.trace.system_template import SystemTemplate

ROWS, SUMMARIES = "every impact", "summaries only"
_SCENE = "three_arcs"
_SIDE = {"quick": 12, "default": 700, "full": 1000}
_MOST = 50
"""Greatest number of impacts of a point."""


def measure_grid(plan: Plan) -> list[Row]:
    """Measure one grid, with every impact and with summaries only, and its kernel, interleaved."""
    grid, jobs = _grid(_SIDE[plan.form]), list[tuple[Row, Job]]()
    with tempfile.TemporaryDirectory(prefix="vibro-bench-") as folder:
        for setting, one in ((ROWS, grid), (SUMMARIES, grid.without_collisions())):
            chunks = chunks_of(one, None, "compiled")
            whole = _whole(one, chunks, Path(folder) / setting)
            for method, job in ((KERNEL, _kernel_alone(one, chunks)), (GRID, whole)):
                row = Row(GRID_PART, _SCENE, method, setting, size=chunks.points)
                jobs.append((row, job))
        return timed(jobs, plan)


def _grid(side: int) -> Grid:
    """Return a grid of `side` starts of either ball."""
    axes = [
        {"path": "balls[1].angle", "linspace": [-1.4, -0.2, side]},
        {"path": "balls[2].angle", "linspace": [-0.4, 1.4, side]},
    ]
    scene = replace(BY_NAME[_SCENE], law="hedrih", k=0.95).document | {
        "stop": {"time": 60.0, "collisions": _MOST}
    }
    document = {"scenario": scene, "axes": axes, "keep": {"collisions": True}}
    return grid_of(loading.Document(document), Path())


def _whole(grid: Grid, chunks: Chunks, folder: Path) -> Job:
    """Return the whole grid as a job: planned, solved, encoded, written, with its checksums."""

    def go() -> int:
        for name in ("summary", *grid.kept_tables):
            (folder / name).mkdir(parents=True)
        receipts = solve_in_threads(
            grid, chunks, range(chunks.count), folder, available_cores(), "compiled",
            lambda points, impacts: None,
        )  # fmt: skip
        return sum(receipt.impacts for receipt in receipts)

    return Job(go, lambda: shutil.rmtree(folder, ignore_errors=True))  # of the last run


def _kernel_alone(grid: Grid, chunks: Chunks) -> Job:
    """Return the kernel of the grid as a job, with a batch for each thread, on planned points."""
    scenario = loading.scenario_of(grid.base.data)
    template = SystemTemplate(scenario, build_system(scenario))
    work = []
    for stretch in (one for n in range(chunks.count) for one in chunks.stretches(n)):
        points = np.arange(*stretch)
        values = grid.design.columns(points)
        systems = template.systems(values, len(points))
        work.append((points, Task.of(template.starts(values, systems), systems, points)))
    table = impact_table_of(grid) if grid.keep.collisions else None
    solvers = [_Solver(template.system, table) for _ in range(available_cores())]
    return Job(lambda: shared_out(work, [solver.solve for solver in solvers]))


class _Solver:
    """The batch of one thread."""

    def __init__(self, system: TraceSystem, kept: Table | None) -> None:
        self._batch = Batch(system)
        self._kept = kept
        self._most = 0.0

    def solve(self, work: tuple[Array, Task]) -> int:
        """Solve a stretch; return the number of impacts."""
        points, task = work
        count = len(task.points)
        results = empty_results(count, task.starts.piece.shape[1], 0)
        if self._kept is not None:
            rows = int(1.1 * self._most * count) + 4096
            results = results._replace(impacts=zeros(rows, ImpactRow))
        results = self._batch.run_all(task.entries(), results)
        outcomes: Any = results.outcomes
        impacts = int(outcomes["collisions"].sum())
        self._most = max(self._most, impacts / max(count, 1))
        if self._kept is not None:
            counts = outcomes["kept"].copy()
            log = first_rows(results.impacts, int(counts.sum()))
            given = Logged(
                task.system, self._batch.world, task.points, counts, log, task.starts.mass
            )
            impact_columns(self._kept, [given], points)
        return impacts


SIZES = {
    "quick": (100, 1000),
    "default": (1000, 100_000),
    "full": (1000, 10_000, 100_000, 1_000_000),
}
REPEATS = 3


def _rotating() -> Document:
    """Return three arcs between walls that rotate about the vertical through the hump."""
    turning = {"through_arc": 2, "rate": 0.8}
    return BY_NAME["three_arcs"].document | {
        "trace": three_arcs(90) | {"turning": turning},
        "balls": [ball("-80 deg", 7800.0), ball("60 deg", 6000.0, 3, rate=3.5)],
        "ends": {"left": {"wall": 1.0}, "right": {"wall": 1.0}},
    }


_WANTED: dict[str, Document] = {
    "": {},
    ", friction": {"output": {"friction": 0.3}},
    ", turning points": {"output": {"turning_points": True}},
    ", exponents": {"analysis": {"lyapunov": True}},
}
COMMANDS: dict[str, TimedScene] = {
    **{
        name + wanted: TimedScene(BY_NAME[name].document | output)
        for name in ("circle", "three_arcs")
        for wanted, output in _WANTED.items()
    },
    "rotating three arcs": TimedScene(_rotating()),
    "rotating three arcs, exponents": TimedScene(_rotating() | _WANTED[", exponents"]),
    **timed_scenes(COMMAND_PART),
}


def measure_command(plan: Plan) -> Iterator[list[Row]]:
    """Measure scene by scene, without figures, the command interleaved with the event loop."""
    for name, scene in COMMANDS.items():
        WORK.report(f"commands, {name}")
        rows = []
        for size in SIZES[plan.form]:
            impacts = size // scene.share
            document = scene.document | {"stop": {"collisions": impacts}}
            rows += _measured(name, document, impacts, plan)
        yield rows


def _measured(name: str, document: Document, impacts: int, plan: Plan) -> list[Row]:
    scenario = loading.any_scenario_of(document)
    alone = driver_job(scenario)
    (found,) = done_once([alone])  # loads or compiles machine code
    if found is None or found < impacts:  # more may happen at the instant of the stop
        raise RuntimeError(f"{scenario.name}: found {found} impacts, expected {impacts}")
    rows = [
        Row(COMMAND_PART, name, method, size=impacts, impacts=found)
        for method in (EVENT_LOOP, COMMAND)
    ]
    with tempfile.TemporaryDirectory(prefix="vibro-bench-") as folder:
        source = Path(folder) / "scene.json"
        source.write_bytes(json_bytes(document))

        def run() -> None:
            target = str(source.with_name("out"))
            memory = command("run", str(source), "--no-figures", "-o", target, "--force")
            rows[1].memory = max(memory or 0, rows[1].memory or 0) or None

        times = by_turns([alone, Job(run)], replace(plan, repeats=REPEATS))
    for row, taken in zip(rows, times, strict=True):
        row.take_times(taken)
    return rows
