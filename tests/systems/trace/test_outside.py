"""States at times outside a run, and the rolling of bodies that slide."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.systems import springs_cases, table_cases
from vibro_cli.api import simulate
from vibro_cli.scenario import load_any
from vibro_cli.stress.scenes import ball, scene, solve_any

GALLERY = Path(__file__).parents[3] / "scenarios"


def on_a_trace() -> Any:
    # Ended by its last impact.
    return simulate(load_any(GALLERY / "three_arcs.toml", ["stop.collisions=3"]), "python")


def on_a_table() -> Any:
    ball = table_cases.ball(0.0, 0.0, 0.5, 0.25)
    return table_cases.solve(table_cases.table([ball], table_cases.box(2.0, 2.0), time=3.0))


def on_springs() -> Any:
    return springs_cases.solve(springs_cases.springs(springs_cases.FIGURE_FIVE, time=2.0))


RUNS = [on_a_trace, on_a_table, on_springs]


@pytest.mark.parametrize("run_of", RUNS)
def test_a_time_outside_the_run_is_refused_with_its_range(run_of: Any) -> None:
    run = run_of()
    end = float(run.summary_record()["end_time"])
    for wrong in (-1e-9, end + 1e-6, 100.0, math.nan, math.inf):
        with pytest.raises(ValueError, match=rf"t = {wrong!r} s is outside .* from 0 to {end!r} s"):
            run.sample([0.5 * end, wrong])
    # Its end is within it, though a sum of steps be beyond it by rounding.
    assert len(run.sample([0.0, end, end * (1.0 + 1e-15)])["t"]) == 3 * len(run.system.bodies)


def test_a_ball_leaves_its_table_only_where_that_is_asked_for() -> None:
    run = on_a_table()
    end = run.sample([3.0])
    later = run.sample([10.0], extrapolate=True)
    for axis in "xy":
        straight = end[axis] + 7.0 * end[f"velocity_{axis}"]
        assert later[axis] == pytest.approx(straight, rel=1e-14)
    assert run.sample([-2.0], extrapolate=True)["x"] == pytest.approx([-1.0], rel=1e-14)


@pytest.mark.parametrize("run_of", RUNS)
def test_extrapolated_motion_goes_on_smoothly(run_of: Any) -> None:
    """The first and last flights continue: positions and energies are continuous."""
    run = run_of()
    end, step = float(run.summary_record()["end_time"]), 1e-4
    for edge, way in ((0.0, -1.0), (end, 1.0)):
        times = edge + way * step * np.arange(5)
        motion = run.sample(times, extrapolate=True)
        x = motion["x"].reshape(5, -1)
        first, energy = x[:3], motion["energy"].reshape(5, -1)
        # Without a jump second differences are of the order of step squared.
        assert np.abs(np.diff(x, 2, axis=0)).max() <= 1e3 * step * step
        assert energy == pytest.approx(np.broadcast_to(energy[0], energy.shape), rel=1e-12)
        if "velocity_x" in motion:
            rate = motion["velocity_x"].reshape(5, -1)[1]
            assert (first[2] - first[0]) / (2 * way * step) == pytest.approx(rate, abs=1e-6)


def test_the_motion_table_has_the_times_that_the_run_has_come_to() -> None:
    changes = ["stop.collisions=3", "output.times=[0.1, 0.2, 1000.0]"]
    run = simulate(load_any(GALLERY / "three_arcs.toml", changes), "python")
    assert run.motion is not None
    assert sorted(set(run.motion["t"])) == [0.1, 0.2]
    assert any("1 of 3 times after the end" in note for note in run.skipped)


def test_of_a_particle_neither_rolling_nor_friction_is_told() -> None:
    path = GALLERY / "particle_on_arcs.toml"
    run = simulate(load_any(path, ["stop.collisions=5"]), "python")
    names = [f"omega_{end}_{when}" for end in "ab" for when in ("pre", "post")]
    assert all(np.isnan(run.collisions[name]).all() for name in names)
    assert run.summary_record()["max_friction_demand"] is None
    changes = ["stop.collisions=5", "balls[2].body=ball"]
    mixed = simulate(load_any(path, changes), "python")
    assert len(mixed.collisions["t"]) == 5
    assert np.isnan(mixed.collisions["omega_a_pre"]).all()
    speeds = mixed.collisions["speed_b_pre"]
    assert mixed.collisions["omega_b_pre"] == pytest.approx(speeds / 0.1, rel=1e-15)
    calm = simulate(load_any(path, [*changes, "balls[1].angle=0.5"]), "python")
    assert calm.summary_record()["max_friction_demand"] > 0.0


def test_no_angular_velocity_of_a_particle_on_a_spring() -> None:
    one, two = springs_cases.FIGURE_FIVE
    towards = {**one, "body": "particle", "position": 1.0, "speed": 20.0}
    document = springs_cases.springs([towards, two], time=2.0)
    rows = springs_cases.solve(document).collisions
    assert len(rows["t"])
    assert np.isnan(rows["omega_a_pre"]).all()
    assert np.isfinite(rows["omega_b_pre"]).all()
    change = 1.5 * 2.0 * 0.4 * (rows["speed_b_post"] - rows["speed_b_pre"])
    assert rows["impulse_moment"] == pytest.approx(change, rel=1e-12)


def test_a_lone_particle_has_a_summary() -> None:
    run = simulate(load_any(GALLERY / "lone_particle.toml"), "python")
    assert run.summary_record()["max_friction_demand"] is None


def test_a_flight_backwards_is_the_flight_of_reversed_speed() -> None:
    trace = {"start_slope": -1.5, "arcs": [{"shape": "valley", "radius": 1.0, "end_slope": 1.5}]}

    def of(speed: float) -> Any:
        return solve_any(scene(trace, [ball(0.3, speed=speed)], time=1.0), "python")

    back = of(0.7).sample([-0.4], extrapolate=True)
    forth = of(-0.7).sample([0.4])
    assert back["angle"] == pytest.approx(forth["angle"], rel=1e-14)
    assert back["speed"] == pytest.approx(-forth["speed"], rel=1e-14)
