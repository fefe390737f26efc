"""Rows of the table of measurements, plans, interleaved timing, and the machine."""

from __future__ import annotations

import contextlib
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from statistics import median
from typing import Annotated, Any, NamedTuple, TypeVar, get_args, get_type_hints

import numpy as np

from vibro_cli import __version__
from vibro_cli.grids.solving import columns_of_records
from vibro_cli.storage.files import available_cores
from vibro_cli.storage.tables import parquet_bytes, to_arrow
from vibro_cli.systems.columns import Column, Table

# Names in the table: methods, settings, and parts with their methods.
COMPILED = "vibro"
KEPT = "vibro, all rows kept"
INTERPRETED = "vibro, interpreted"
BATCH = "vibro, batch"
SERIES = "series of the papers"
WITH, WITHOUT = "skipped", "not skipped"
GRID_PART = "kept"
KERNEL, GRID = "kernel alone", "grid on the disk"
COMMAND_PART = "command"
EVENT_LOOP, COMMAND = "event loop alone", "vibro run"


@dataclass
class Row:
    """One row of the table; its fields declare the columns, with their meaning and unit."""

    part: Annotated[
        str,
        "precision, bodies, arcs, scenarios, cores, grid, kept, memory, skips, systems or command",
    ]
    scene: Annotated[str, "name of the scene"]
    method: Annotated[str, "what was measured"]
    setting: Annotated[str, "tolerance, order of a series, or whether skipped"] = ""
    size: Annotated[int | None, "bodies, arcs, scenarios or threads, where varied"] = None
    impacts: Annotated[int, "impacts of a timed run, of all its scenarios"] = 0
    crossings: Annotated[int | None, "junctions crossed in it"] = None
    repeats: Annotated[int, "runs that were timed, alternating with the others"] = 0
    seconds: Annotated[float | None, "median time of a run", "s"] = None
    spread: Annotated[float | None, "interquartile range of the times over their median"] = None
    per_impact: Annotated[float | None, "median time for each impact", "s"] = None
    compared: Annotated[int | None, "impacts whose times were compared"] = None
    error: Annotated[float | None, "greatest relative error of their times"] = None
    energy_drift: Annotated[float | None, "relative change in energy, at k = 1"] = None
    memory: Annotated[int | None, "peak memory of the process", "B"] = None
    status: Annotated[str, "ok, lost (not the impacts of the motion) or failed"] = "ok"
    note: Annotated[str | None, "what happened, if the status is not ok"] = None

    def lose(self, why: object) -> None:
        """Mark the row as lost, with the reason why its impacts are not those of the motion."""
        self.status, self.note = "lost", str(why)

    def take_times(self, times: Sequence[float]) -> None:
        """Set the statistics of the times (s) of the runs."""
        self.repeats, self.seconds = len(times), median(times)
        quarters = np.quantile(times, (0.25, 0.75))
        self.spread = float(quarters[1] - quarters[0]) / self.seconds
        if self.impacts:
            self.per_impact = self.seconds / self.impacts


def _column(name: str, hint: Any) -> Column:
    """Return the column that a field of a row declares."""
    kind, text, *unit = get_args(hint)
    plain, *null = get_args(kind) or (kind,)
    types: dict[type, Any] = {str: "string", int: "int64", float: "float64"}
    return Column(name, types[plain], "".join(unit), text, nullable=bool(null))


TABLE = Table(
    "benchmark",
    "one method with one setting on one task",
    tuple(_column(*field) for field in get_type_hints(Row, include_extras=True).items()),
)


@dataclass(frozen=True)
class Plan:
    """The extent of the measurements."""

    form: str
    """quick, default or full."""
    repeats: int
    target: float
    """Time (s) that a timed run should take, as far as its method allows."""
    scenarios: tuple[int, ...]
    arcs: tuple[int, ...]
    bodies: tuple[int, ...]


PLANS = {
    "quick": Plan("quick", 3, 0.008, (100, 1000), (3, 30), (2, 5)),
    "default": Plan("default", 7, 0.06, (1000, 10_000, 100_000), (3, 5, 10, 30), (2, 3, 5, 10, 20)),
    "full": Plan(
        "full", 11, 0.2, (1, 10, 100, 1000, 10_000, 100_000, 1_000_000), (3, 5, 10, 20, 30),
        (2, 3, 5, 10, 20, 40),
    ),
}  # fmt: skip


_LONG = 5.0
"""Ratio to the planned time above which a run is repeated only three times."""


class Job(NamedTuple):
    """Work that is timed repeatedly; its preparation is not timed."""

    go: Callable[[], int | None]
    """Does the work; returns the number of impacts if it is not known before."""
    ready: Callable[[], object] = lambda: None


def by_turns(jobs: Sequence[Job], plan: Plan) -> list[list[float]]:
    """Return the times (s) of interleaved repeats of jobs, a list for each job."""
    times: list[list[float]] = [[] for _ in jobs]
    for turn in range(plan.repeats):
        for job, taken in zip(jobs, times, strict=True):
            if turn >= 3 and min(taken) > _LONG * plan.target:
                continue
            job.ready()
            start = time.perf_counter()
            job.go()
            taken.append(time.perf_counter() - start)
    return times


def done_once(jobs: Sequence[Job]) -> list[int | None]:
    """Do all jobs once, to load machine code and allocate memory; return their impacts."""
    impacts = []
    for job in jobs:
        job.ready()
        impacts.append(job.go())
    return impacts


def timed(jobs: Sequence[tuple[Row, Job]], plan: Plan) -> list[Row]:
    """Do jobs once, then interleaved; set times and impacts of the rows and return them."""
    rows, work = [row for row, _ in jobs], [job for _, job in jobs]
    for row, impacts in zip(rows, done_once(work), strict=True):
        row.impacts = impacts or row.impacts
    for row, taken in zip(rows, by_turns(work, plan), strict=True):
        row.take_times(taken)
    return rows


def parquet(rows: Sequence[Row], details: dict[str, Any]) -> bytes:
    """Return the rows as a parquet file, with the details in its metadata."""
    columns = columns_of_records([vars(row) for row in rows], TABLE)
    return parquet_bytes(to_arrow(TABLE, columns, details))


_LIBRARIES = ("numpy", "scipy", "heyoka", "diffrax", "jax", "CyRK")


def describe_machine() -> dict[str, str]:
    """Return processor, cores, load, system and versions, as text."""
    found = {
        "Processor": _processor(),
        "Cores that may be used": str(available_cores()),
        "Load when it began (1, 5, 15 minutes)": ", ".join(f"{v:.1f}" for v in os.getloadavg()),
        "System": f"{platform.system()} {platform.release()} {platform.machine()}",
        "Python": platform.python_version(),
        "vibro": __version__,
    }
    for name in _LIBRARIES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown"
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else "unknown"


Work = TypeVar("Work")


def shared_out(work: Iterable[Work], solvers: Sequence[Callable[[Work], int]]) -> int:
    """Let solvers, each in its own thread, share the work; return the sum of their results."""
    left = iter(list(work))  # threads may share the iterator of a list
    with ThreadPoolExecutor(len(solvers)) as crew:
        return sum(crew.map(lambda solve: sum(map(solve, left)), solvers))


def _peak_memory(process: int) -> int | None:
    """Return the peak memory (B) of a process, None if the system does not provide it."""
    with contextlib.suppress(OSError):
        status = Path(f"/proc/{process}/status").read_text(encoding="utf-8")
        for line in status.splitlines():
            if line.startswith("VmHWM"):
                return int(line.split()[1]) * 1024
    return None


def command(*arguments: str) -> int | None:
    """Run a command of this program; return its peak memory (B).

    The memory is read while the command runs, because the value that the system gives afterwards
    includes this process. It is None if the system does not provide it. Raises
    ``subprocess.CalledProcessError`` if the command fails.
    """
    greatest = None
    words = [sys.executable, "-m", "vibro_cli", *arguments, "-q"]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL) as process:
        try:
            while process.poll() is None:
                greatest = _peak_memory(process.pid) or greatest
                time.sleep(0.01)
        finally:
            process.kill()  # only if a signal ends the measurement
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, words)
    return greatest
