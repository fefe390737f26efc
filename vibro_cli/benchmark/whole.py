"""The whole command beside its event loop: what an impact costs from the shell to the tables."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from vibro_cli.benchmark.growth import greatest_memory
from vibro_cli.benchmark.measurement import Plan, Row
from vibro_cli.benchmark.other_systems import SCENES as OTHERS
from vibro_cli.benchmark.other_systems import SLOW
from vibro_cli.benchmark.scenes import BY_NAME, Document, ball
from vibro_cli.build import build_any
from vibro_cli.scenario import any_scenario_of
from vibro_cli.storage.provenance import json_bytes
from vibro_cli.stress.scenes import three_arcs
from vibro_cli.systems import system_named
from vibro_cli.systems.driver import Driver

PART = "command"
KERNEL, COMMAND = "event loop alone", "vibro run"
SIZES = {
    "quick": (100, 1000),
    "default": (1000, 100_000),
    "full": (1000, 10_000, 100_000, 1_000_000),
}
REPEATS = 3


def _rotating() -> Document:
    """Three arcs between walls, which turn about the vertical through the hump."""
    turning = {"through_arc": 2, "rate": 0.8}
    return BY_NAME["three_arcs"].document | {
        "trace": three_arcs(90) | {"turning": turning},
        "balls": [ball("-80 deg", 7800.0), ball("60 deg", 6000.0, 3, rate=3.5)],
        "ends": {"left": {"wall": 1.0}, "right": {"wall": 1.0}},
    }


_ARCS = BY_NAME["three_arcs"].document
DOCUMENTS: dict[str, Document] = {
    "circle": BY_NAME["circle"].document,
    "three_arcs": _ARCS,
    "three_arcs, friction": _ARCS | {"output": {"friction": 0.3}},
    "three_arcs, turning points": _ARCS | {"output": {"turning_points": True}},
    "rotating three arcs": _rotating(),
    **{name: OTHERS[name] for name in ("30 balls in a box", *SLOW)},
}


def measure(plan: Plan) -> Iterator[list[Row]]:
    """Measure scene by scene, without figures; the event loop by turns with the command."""
    for name, document in DOCUMENTS.items():
        rows = []
        for size in SIZES[plan.form]:
            # Springs are solved by series, and an impact takes as long as many elsewhere.
            impacts = size // 100 if name in SLOW else size
            rows += _measured(name, document | {"stop": {"collisions": impacts}}, impacts)
        yield rows


def _measured(name: str, document: Document, impacts: int) -> list[Row]:
    rows = [Row(PART, name, method, size=impacts, impacts=impacts) for method in (KERNEL, COMMAND)]
    times: list[list[float]] = [[], []]
    with tempfile.TemporaryDirectory(prefix="vibro-bench-") as folder:
        source = Path(folder) / "scene.json"
        source.write_bytes(json_bytes(document))
        _event_loop(document, impacts)  # machine code is loaded, or made anew
        for _ in range(REPEATS):
            times[0].append(_event_loop(document, impacts))
            taken, memory = _command(source)
            times[1].append(taken)
            rows[1].memory = max(memory or 0, rows[1].memory or 0) or None
    for row, taken_each in zip(rows, times, strict=True):
        row.take_times(taken_each)
    return rows


def _event_loop(document: Document, impacts: int) -> float:
    """Time (s) of a run; the rows of a trace are dropped."""
    scenario: Any = any_scenario_of(document)
    kind, system = system_named(scenario.system), build_any(scenario)
    world = kind.world(system, kind.limits(scenario))
    if hasattr(world.settings[0], "keep"):
        world.settings[0].keep = 0
    driver = Driver(kind.loop, world, "compiled", overrides=kind.overrides(system))
    start = time.perf_counter()
    driver.run()
    taken = time.perf_counter() - start
    found = int(driver.clock_value("collisions"))
    if found != impacts:
        raise RuntimeError(f"{scenario.name}: found {found} impacts, expected {impacts}")
    return taken


def _command(source: Path) -> tuple[float, int | None]:
    """Time (s) and greatest memory (B) of a process that writes its tables."""
    command = [sys.executable, "-m", "vibro_cli", "run", str(source), "-q", "--no-figures"]
    command += ["-o", str(source.with_name("out")), "--force"]
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    memory = greatest_memory(process)
    taken = time.perf_counter() - start
    if process.returncode:
        raise RuntimeError(f"{' '.join(command)}: exit code {process.returncode}")
    return taken, memory
