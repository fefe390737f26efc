"""What changes no bit of a motion: other units, and bodies that are never met."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tests.gallery import hard_case
from tests.scaling import scaled
from vibro_cli import Scenario, ScenarioError, simulate
from vibro_cli.stress.drawing import draw

# On lines, at walls, in contact across pieces, one after another at one instant, in accumulations.
SCENES = (
    "body_rolls_off_the_wall_at_the_end_of_a_row",
    "contracting_to_rest_across",
    "end_below_the_resolution_of_time",
    "row_of_three_rests_and_one_comes",
    "row_of_three_rests_at_a_wall",
    "row_struck_again_and_again_at_a_wall",
    "unequal_body_returns_to_a_row_at_a_wall",
)


# Micrometres and thousands of kilometres, with all times as they were and with gravity.
@pytest.mark.parametrize(("length", "time"), [(-20, 0), (20, 0), (-20, -10), (20, 10)])
@pytest.mark.parametrize("name", SCENES)
def test_any_size_moves_alike_to_the_bit(name: str, length: int, time: int) -> None:
    data = hard_case(name)
    assert_alike(data, length, time)


# A body far from its wall; one that lifts off a line of a rotating trace; impacts at a wall.
@pytest.mark.parametrize(
    ("seed", "number", "length", "time"), [(5, 487, 60, 27), (6, 313, 60, 27), (5, 244, 0, 40)]
)
def test_drawn_scenes_of_any_size_and_pace_move_alike(
    seed: int, number: int, length: int, time: int
) -> None:
    assert_alike(draw(seed, number), length, time)


@pytest.mark.parametrize("rate", [0.0, 0.7])
@pytest.mark.parametrize("seed", range(12))
def test_bodies_in_another_valley_change_nothing(seed: int, rate: float) -> None:
    rng = np.random.default_rng(seed)
    radii = (10.0 ** rng.uniform(-0.5, 0.5, 3)).tolist()
    slopes = ("80 deg", "-80 deg", "100 deg")
    shapes = ("valley", "hump", "valley")

    def body(arc: int, angle: float) -> dict[str, Any]:
        radius = float(rng.uniform(0.03, 0.1)) * radii[arc - 1]
        moving = {"angle": angle, "rate": float(rng.uniform(-0.5, 0.5))}
        return {"radius": radius, "density": 7800, "arc": arc, **moving}

    scenario: dict[str, Any] = {
        "gravity": 9.81,
        "trace": {
            "start_slope": "-100 deg",
            "arcs": [
                {"shape": shape, "radius": radius, "end_slope": slope}
                for shape, radius, slope in zip(shapes, radii, slopes, strict=True)
            ],
        },
        "balls": [body(1, -0.5), body(1, 0.4)],
        "collision": {"law": "normal-impulse", "k": [1.0, 0.9, 0.5][seed % 3]},
        "stop": {"time": 20.0},
    }
    if rate:
        scenario["trace"]["turning"] = {"through_arc": 2, "rate": rate}
    alone = simulate(Scenario.from_dict(scenario)).collisions
    scenario["balls"] += [body(3, -0.4), body(3, 0.3)]
    together = simulate(Scenario.from_dict(scenario)).collisions
    mine = np.asarray(together["ball_a"]) == 1
    assert 0 < np.sum(mine) == len(alone["t"]) < len(mine)
    for column in sorted(set(alone) - {"n", "dt"}):
        np.testing.assert_array_equal(np.asarray(together[column])[mine], alone[column])


def assert_alike(data: dict[str, Any], length: int, time: int) -> None:
    run = simulate(Scenario.from_dict(data))
    other = simulate(Scenario.from_dict(scaled(data, length, time)))
    assert other.summary["end_cause"] == run.summary["end_cause"]
    assert other.summary["s_1"] == math.ldexp(run.summary["s_1"], length)
    powers = {"t": time, "dt": time, "s_a": length, "s_b": length, "speed_b_post": length - time}
    for column, power in powers.items():
        expected = np.ldexp(run.collisions[column], power)
        np.testing.assert_array_equal(other.collisions[column], expected)
    events, of_other = run.tables["events"], other.tables["events"]
    assert list(of_other["event"]) == list(events["event"])
    np.testing.assert_array_equal(of_other["t"], np.ldexp(events["t"], time))


# A body with half of its radius in the wall, on a line of 2 m and of 4e-16 m.
@pytest.mark.parametrize("length", [0, -52])
def test_a_body_in_a_wall_is_refused_at_any_size(length: int) -> None:
    data = {
        "gravity": 9.81,
        "trace": {"start_slope": 0.0, "arcs": [{"shape": "line", "length": 2.0}]},
        "ends": {"left": {"wall": 0.9}},
        "balls": [{"arc": 1, "position": 0.05, "radius": 0.1, "mass": 1.0, "speed": 0.1}],
        "stop": {"time": 1.0},
    }
    with pytest.raises(ScenarioError, match="reaching into the left wall"):
        simulate(Scenario.from_dict(scaled(data, length, 0)))
