"""Every method against the references, and the table of timings."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vibro_cli.api import simulate
from vibro_cli.benchmark import end_to_end
from vibro_cli.benchmark.end_to_end import COMMANDS, ROWS, SUMMARIES, measure_command, measure_grid
from vibro_cli.benchmark.measurement import (
    COMMAND,
    EVENT_LOOP,
    GRID,
    KERNEL,
    PLANS,
    TABLE,
    Row,
    parquet,
    shared_out,
)
from vibro_cli.benchmark.methods.runner import Event, LegRunner, Lost, Method, Motion, Setting
from vibro_cli.benchmark.methods.with_heyoka import batches
from vibro_cli.benchmark.methods.with_series import Leg, coefficients
from vibro_cli.benchmark.methods.with_vibro import DriverRunner
from vibro_cli.benchmark.scenes import (
    BY_NAME,
    SCENES,
    ReferenceOutdated,
    Scene,
    errors_of_times,
    reference_times,
)
from vibro_cli.scenario import any_scenario_of
from vibro_cli.storage.files import write_file
from vibro_cli.storage.tables import read_parquet
from vibro_cli.systems.trace import simulate_system

pytestmark = pytest.mark.long

LIBRARY = {"with_heyoka": "heyoka", "cyrk": "CyRK", "scipy": "scipy"}


def methods(name: str) -> list[Method]:
    """Return the methods of a module, or of a function of the module of integrators."""
    module = name if name.startswith("with_") else "with_integrators"
    source = import_module(f"vibro_cli.benchmark.methods.{module}")
    found: list[Method] = getattr(source, "methods" if module == name else name)()
    return found


def worst(method: Method, scene: Scene, setting: Setting, impacts: int) -> float:
    runner = method.prepare(scene, setting)
    runner.ready(impacts)
    runner.go()
    return max(errors_of_times(runner.course().times[:impacts], reference_times(scene)))


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.name)
def test_references_are_of_these_scenes(scene: Scene) -> None:
    times = reference_times(scene)
    assert len(times) == scene.compared
    found = simulate_system(scene.system, None, scene.compared, "python").collisions["t"].tolist()
    assert max(errors_of_times(found, times)) < 1e-14


def test_another_scene_has_no_reference() -> None:
    other = Scene("circle", "", BY_NAME["circle"].trace, BY_NAME["circle"].balls, k=0.5)
    with pytest.raises(ReferenceOutdated, match="--references"):
        reference_times(other)


def test_errors_are_formed_exactly() -> None:
    assert errors_of_times([1.0], ["1.00000000000000000001"]) == [pytest.approx(1e-20)]


def test_the_way_over_the_top_is_met_on_both_sides() -> None:
    run = simulate_system(BY_NAME["wrap_around"].system, None, 10, "python")
    assert set(run.collisions["side"].tolist()) == {-1, 1}


def everything() -> Iterator[tuple[str, str]]:
    for scene in SCENES:
        if scene.name != "dissipative":  # its late impacts are nearly simultaneous: not for all
            yield from ((module, scene.name) for module in LIBRARY)


@pytest.mark.parametrize(("module", "name"), list(everything()))
def test_the_models_of_the_peers_are_the_model(module: str, name: str) -> None:
    if find_spec(LIBRARY[module]) is None:
        pytest.skip(f"{LIBRARY[module]} is not installed")
    method = next(one for one in methods(module) if one.name != "SciPy RK45")
    scene = BY_NAME[name]
    assert worst(method, scene, Setting("1e-10", 1e-10), scene.compared) < 1e-8


def test_a_batch_of_heyoka_has_the_impacts_of_the_scene_in_every_lane() -> None:
    if find_spec("heyoka") is None:
        pytest.skip("heyoka is not installed")
    (method,) = batches()
    assert [scene.name for scene in SCENES if method.suits(scene)] == ["circle"]
    scene = BY_NAME["circle"]
    runner = method.prepare(scene, Setting("1e-10", 1e-10))
    runner.ready(1000)
    runner.go()
    course = runner.course()
    assert abs(course.impacts - 1000) <= 80
    assert max(errors_of_times(course.times[: scene.compared], reference_times(scene))) < 1e-8


def test_a_run_is_counted_and_keeps_its_energy() -> None:
    scene = BY_NAME["three_arcs"]
    method = next(one for one in methods("with_vibro") if one.name == "vibro, interpreted")
    runner = method.prepare(scene, Setting("exact"))
    runner.ready(200)
    runner.go()
    course = runner.course()
    whole = simulate_system(scene.system, None, 200, "python").summary
    assert (course.impacts, course.crossings) == (200, whole["crossings"][0])
    assert course.energy_drift is not None
    assert abs(course.energy_drift) < 1e-14


def test_coefficients_are_those_of_the_root() -> None:
    total = sum(c * 0.3**n for n, c in enumerate(coefficients(60)))
    assert total == pytest.approx(1.0 / math.sqrt(0.7), rel=1e-15)


def test_the_series_converges_inside_a_leg_and_hardly_at_its_end() -> None:
    """A small oscillation is harmonic: its angle is half the amplitude after 1/12 of a period."""
    legs = [Leg(4.0, order, 0.0, 0.0, 1e-3) for order in (100, 400)]
    inside = legs[1].time(0.5 * legs[1].amplitude)
    assert inside == pytest.approx(math.asin(0.5) / 2.0, rel=1e-7)
    short = [0.25 * math.pi - leg.time(leg.amplitude) for leg in legs]
    assert short[0] / short[1] == pytest.approx(2.0, rel=0.01)
    assert short[1] > 0.01


def test_the_papers_series_has_its_honest_error() -> None:
    method = methods("with_series")[0]
    scene = BY_NAME["circle"]
    found = [worst(method, scene, setting, scene.compared) for setting in method.settings]
    assert found[0] > 0.1
    assert found == sorted(found, reverse=True)
    assert found[-1] > 0.01  # at 64 times the papers' order


def test_a_method_that_makes_no_progress_is_lost() -> None:
    motion = Motion(BY_NAME["circle"].system)
    runner = LegRunner(motion, lambda pieces, t, y: (t, y, Event(0)))
    runner.ready(3)
    with pytest.raises(Lost, match="again and again"):
        runner.go()


def test_a_grid_and_its_kernel_alone_do_the_same_work() -> None:
    rows = measure_grid(PLANS["quick"])
    assert {(row.method, row.setting) for row in rows} == {
        (method, setting) for method in (KERNEL, GRID) for setting in (ROWS, SUMMARIES)
    }
    (impacts,) = {row.impacts for row in rows}
    assert impacts > 1000
    assert all(row.per_impact for row in rows)


def read_rows(path: Path) -> tuple[list[Row], dict[str, Any]]:
    """Return the rows of a table that was written, and its details."""
    table = read_parquet(path)
    names = [column.name for column in TABLE.columns]
    columns = {name: table.column(name).to_pylist() for name in names}
    rows = [Row(**{name: columns[name][n] for name in names}) for n in range(table.num_rows)]
    return rows, json.loads(table.schema.metadata[b"vibro:scenario"])


def test_work_that_fails_in_a_thread_is_told() -> None:
    """Otherwise the time of the remaining work would count as the time of all of it."""
    assert shared_out(range(1, 101), [lambda one: one, lambda one: one]) == 5050
    with pytest.raises(ZeroDivisionError):
        shared_out([2, 0, 1], [lambda one: 2 // one])


def test_rows_come_back_from_the_table(tmp_path: Path) -> None:
    one = Row("precision", "circle", "vibro", "exact", None, 10, 0)
    one.take_times([2.0, 1.0, 3.0])
    other = Row("memory", "circle", "grid", size=100, memory=2**30, status="failed", note="x")
    write_file(tmp_path / "t.parquet", parquet([one, other], {"plan": "quick"}))
    assert read_rows(tmp_path / "t.parquet") == ([one, other], {"plan": "quick"})
    assert (one.seconds, one.per_impact, one.repeats) == (2.0, 0.2, 3)
    assert [column.name for column in TABLE.columns] == list(vars(one))


def test_commands_are_measured_beside_their_event_loops(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(end_to_end, "REPEATS", 1)
    names = ("rotating three arcs", "springs")
    monkeypatch.setattr(end_to_end, "COMMANDS", {name: COMMANDS[name] for name in names})
    rows = [row for found in measure_command(PLANS["quick"]) for row in found]
    assert [row.scene for row in rows] == [name for name in names for _ in range(4)]
    for alone, command in zip(rows[::2], rows[1::2], strict=True):
        assert (alone.method, command.method) == (EVENT_LOOP, COMMAND)
        assert alone.impacts == command.impacts
        # The command does more, and starts a process.
        assert alone.seconds is not None
        assert command.seconds is not None
        assert 0.0 < alone.seconds < command.seconds
        assert command.memory is None or command.memory > 2**24


def test_impacts_at_one_instant_are_timed_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """A row of 200 repeats itself after 30: six other pairs act at the same instant as one."""
    monkeypatch.setattr(end_to_end, "REPEATS", 1)
    name = "springs, 200 disks"
    monkeypatch.setattr(end_to_end, "COMMANDS", {name: COMMANDS[name]})
    rows = [row for found in measure_command(PLANS["quick"]) for row in found]
    assert [(row.size, row.impacts) for row in rows] == 2 * [(1, 7)] + 2 * [(10, 14)]
    run = simulate(any_scenario_of(COMMANDS[name].document))
    np.testing.assert_array_equal(np.diff(run.collisions["ball_a"]), [30] * 6)


@pytest.mark.parametrize("name", ["circle", "three_arcs", "five_balls"])
def test_runs_that_drop_the_rows_of_full_logs_are_those_that_keep_them(name: str) -> None:
    flights = []
    for keep in (False, True):
        runner = DriverRunner(BY_NAME[name].system, "compiled", keep)
        runner.ready(300)
        runner.go()
        world: Any = runner.drivers[0].world
        assert (2 * world.settings["capacity"][0] < 300) == (not keep)
        assert world.clock["collisions"][0] == 300
        flights.append(world.flights)
    for one in ("t", "t_low", "piece", "s", "c", "p", "specific_energy"):
        assert np.array_equal(flights[0][one], flights[1][one])
