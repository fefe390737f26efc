"""Runs on a trace that rotates about a vertical axis."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.highprecision.reference_solver import Impact, ReferenceSolver, events_of
from tests.references import check_impacts
from tests.systems.trace.turning_scenes import (
    on_circle,
    on_lines,
    on_three_arcs,
    over_the_hump,
)
from vibro_cli.api import simulate
from vibro_cli.compile.kernel import NO_OVERRIDES
from vibro_cli.kernels.rotating import TURNING
from vibro_cli.scenario import load_any
from vibro_cli.stress.oracles.oracle import Oracle
from vibro_cli.stress.oracles.scene import mp, scene_of_system
from vibro_cli.stress.scenes import WALLS, Document, scene, solve, solve_any, system_of
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system

SCENES = {"circle": on_circle(), "three arcs": on_three_arcs(), "lines": on_lines()}


def run(scenario: dict[str, Any], engine: str = "compiled") -> Run:
    return solve_any(scenario, engine)


@cache
def impacts_of(name: str) -> list[Impact]:
    found = run(SCENES[name])
    return ReferenceSolver(scene_of_system(found.system)).follow(events_of(found))


@pytest.mark.parametrize("name", SCENES)
def test_first_ten_impacts_are_those_of_fifty_digits(name: str, engine: str) -> None:
    found, impacts = run(SCENES[name], engine), impacts_of(name)
    assert len(impacts) == 10
    check_impacts(found, impacts, 1e-12)


@pytest.mark.parametrize("name", SCENES)
def test_both_engines_give_the_same_bits(name: str) -> None:
    one, other = run(SCENES[name], "python"), run(SCENES[name], "compiled")
    for table in ("collisions", "events", "summary"):
        columns, others = getattr(one, table), getattr(other, table)
        for column, values in columns.items():
            assert np.array_equal(values, others[column], equal_nan=values.dtype == float), column


@pytest.mark.parametrize("scene", [on_circle, on_three_arcs])
def test_rate_zero_is_the_trace_at_rest(scene: Any) -> None:
    turning, resting = scene(rate=0.0), scene()
    del resting["trace"]["turning"]
    one, other = run(turning), run(resting)
    for column, values in one.collisions.items():
        assert np.array_equal(values, other.collisions[column], equal_nan=values.dtype == float)


def test_slow_turning_is_nearly_rest() -> None:
    resting = on_circle()
    del resting["trace"]["turning"]
    slow, rest = run(on_circle(rate=1e-5)), run(resting)
    assert slow.collisions["t"] == pytest.approx(rest.collisions["t"], rel=1e-9)


def test_bodies_in_wells_of_their_own_never_meet() -> None:
    # Above the pitchfork, Omega^2 > g/rho, each ball stays on its side of the bottom.
    found = run(on_circle(rate=4.0, stop={"collisions": 5}))
    assert found.end_cause == "no_more_collisions"
    assert len(found.collisions["t"]) == 0


@pytest.mark.parametrize("scene", [on_circle, on_three_arcs])
def test_elastic_impacts_keep_the_energy(scene: Any) -> None:
    stop = {"collisions": 2000, "time": 3000.0}
    found = run(scene(collision={"k": 1.0}, stop=stop), "compiled")
    assert len(found.collisions["t"]) > 100
    assert abs(found.summary_record()["energy_drift"]) < 1e-12


@pytest.mark.parametrize("scene", [on_circle, over_the_hump])
def test_lasting_contact_closes_and_keeps_the_energy(scene: Any) -> None:
    law = {"law": "normal-impulse", "k": 0.4}
    found = run(scene(collision=law, stop={"time": 14.0}))
    record = found.summary_record()
    assert record["contacts"] == 1
    lost = record["energy_start"] - float(np.sum(found.collisions["energy_loss"]))
    assert record["energy_end"] == pytest.approx(lost, rel=1e-11)
    apart = found.sample([13.0, 14.0])
    x, y = apart["x"].reshape(2, 2), apart["y"].reshape(2, 2)
    assert np.hypot(np.diff(x), np.diff(y)) == pytest.approx(0.2, rel=1e-12)


def test_motion_between_events_keeps_the_energy_and_obeys_the_equation() -> None:
    found = run(on_lines())
    end = float(found.summary_record()["end_time"])
    h = 1e-4
    times = np.linspace(0.05, end - 0.05, 40)
    before, now, after = (found.sample(times + step) for step in (-h, 0.0, h))
    turning, gravity = found.system.turning, found.system.gravity
    assert turning is not None
    smooth = (before["arc"] == after["arc"]) & (abs(after["energy"] - before["energy"]) < 1e-9)
    kappa = np.array([body.kappa for body in found.system.bodies])[now["ball"] - 1]
    # The tangent from the places, the acceleration from the speeds.
    tx, ty = (after["x"] - before["x"]), (after["y"] - before["y"])
    length = np.hypot(tx, ty)
    moving = smooth & (length > 1e-6) & (now["speed"] * before["speed"] > 0.0)
    side = np.sign(now["speed"])
    pull = -gravity * side * ty / length
    pull += turning.square * (now["x"] - turning.x) * side * tx / length
    acceleration = (after["speed"] - before["speed"]) / (2.0 * h)
    good = moving & (np.abs(acceleration) < 50.0)
    assert np.sum(good) > 60
    assert (kappa * acceleration)[good] == pytest.approx(pull[good], abs=2e-3)


def test_turning_points_are_where_the_speed_vanishes() -> None:
    found = run(on_circle(output={"turning_points": True}))
    events = found.events
    rows = events["event"] == "turning"
    assert np.sum(rows) > 5
    for t, number, angle in zip(events["t"], events["ball"], events["value"], strict=True):
        state = found.sample([t])
        assert abs(state["speed"][int(number) - 1]) < 1e-13
        assert state["angle"][int(number) - 1] == pytest.approx(angle, abs=1e-14)


@pytest.mark.parametrize("speed", [0.0, 1e-200, 1e-9, -1e-8, 1e-6])
def test_turning_points_beside_the_start_come_again_with_every_period(
    speed: float, engine: str
) -> None:
    scenario = on_circle(output={"turning_points": True})
    scenario["balls"] = [{"radius": 0.1, "mass": 1.0, "arc": 1, "angle": 0.4, "speed": speed}]
    found = run({**scenario, "stop": {"time": 10.0}}, engine)
    events = found.events
    assert set(events["event"]) == {"turning"}
    times = events["t"]
    # Every half of a period; where it starts towards the near one, that comes first.
    gaps = np.diff(times[times > 1e-6])
    assert len(gaps) > 3
    assert gaps == pytest.approx(gaps[0], rel=1e-12)
    speeds = np.abs(found.sample(np.linspace(0.0, 10.0, 101))["speed"])
    assert np.max(np.abs(found.sample(times)["speed"])) < 1e-13 * np.max(speeds)


def test_lift_off_is_where_the_normal_force_vanishes() -> None:
    found = run(over_the_hump())
    turning, gravity = found.system.turning, found.system.gravity
    assert turning is not None
    rows = np.flatnonzero(found.events["event"] == "lift_off")
    assert len(rows) > 1
    for row in rows:
        number = int(found.events["ball"][row]) - 1
        state = {
            name: column[number] for name, column in found.sample([found.events["t"][row]]).items()
        }
        piece = found.system.trace.pieces[int(state["arc"]) - 1]
        slope = piece.slope(state["angle"])
        force = gravity * np.cos(slope) + turning.square * (state["x"] - turning.x) * np.sin(slope)
        force += piece.sign * state["speed"] ** 2 / piece.path_radius(0.1)
        value = found.events["value"][row] / found.system.bodies[number].mass
        assert force == pytest.approx(value, abs=1e-10)
        # At a junction or an impact the force jumps, elsewhere it falls through zero.
        jumps = found.events["t"][np.isin(found.events["event"], ["crossing", "wall"])]
        jumps = [*jumps, *found.collisions["t"]]
        assert abs(value) < 1e-10 or (value < 0.0 and state["t"] in jumps)
    assert found.summary_record()["min_normal_force"] < 0.0


def test_a_run_continued_is_the_run_without_a_break() -> None:
    scene = system_of(on_three_arcs())
    whole = simulate_system(scene, None, 10, "python")
    part = simulate_system(scene, None, 4, "python")
    rest = simulate_system(
        scene, None, 10, "python", checkpoint=part.checkpoint(), history=part.history()
    )
    for column, values in whole.collisions.items():
        assert np.array_equal(values, rest.collisions[column], equal_nan=values.dtype == float)


@pytest.mark.parametrize(
    "replaced",
    [pytest.param(function, id=NO_OVERRIDES.symbol(function)) for function in TURNING.replaced],
)
def test_a_kernel_is_replaced_by_one_that_is_called_alike(replaced: Callable[..., Any]) -> None:
    here, there = (signature(function) for function in (replaced, TURNING.replaced[replaced]))
    assert [one.annotation for one in here.parameters.values()] == [
        one.annotation for one in there.parameters.values()
    ]
    assert here.return_annotation == there.return_annotation


def test_contacts_on_a_turning_line_leave_no_gap() -> None:
    path = Path(__file__).parents[2] / "hard_cases" / "contact_on_a_turning_line.toml"
    run = simulate(load_any(path), "python")
    on_line = run.collisions["arc_a"] == 2
    assert on_line.any()
    assert np.max(np.abs(run.collisions["gap"][on_line])) <= 1e-14


@pytest.mark.parametrize("number", [1, 3])
def test_a_body_at_rest_at_the_end_of_a_line_leaves_it(number: int) -> None:
    """It moved on along the line, beyond its end. Compared with Taylor series in 40 digits."""
    line = {"shape": "line", "length": 1.0}
    arcs = [line, {"shape": "valley", "radius": 0.5, "end_slope": "60 deg"}, line]
    axis = {"x": 0.2 if number == 1 else 1.6, "rate": 20.0}
    trace: Document = {"start_slope": "-60 deg", "arcs": arcs, "turning": axis}
    one = {"arc": number, "position": 1.0 if number == 1 else 0.0, "radius": 0.05, "mass": 1.0}
    run = solve({**scene(trace, [{**one, "speed": 0.0}], time=0.05), **WALLS}, "compiled")
    place = run.sample([0.05])
    history = Oracle.of(run.system).run(mp.mpf(0.05), [mp.mpf(0.05)])
    ((state, *_),) = history.samples[0]
    assert (place["arc"][0], state.piece) == (2, 1)
    assert place["angle"][0] == pytest.approx(float(state.place), abs=1e-14)
    assert place["speed"][0] == pytest.approx(float(state.speed), abs=1e-13)
