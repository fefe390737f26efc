"""Figures of impacts: inadmissible ones, those that gain energy, those of many bodies."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from tests.figures.layout import texts
from tests.systems.table_cases import ball, table
from tests.systems.trace.test_energy import not_made
from vibro_cli import example, simulate, sweep
from vibro_cli.figures.kinds import draw_one
from vibro_cli.figures.runs.over_time import GAIN, LOSS
from vibro_cli.figures.runs.scene import plan
from vibro_cli.scenario import Scenario
from vibro_cli.stress.scenes import scene, solve_any
from vibro_cli.systems.table.plan import table_plan

TRACE = example("unequal_hedrih")
TABLE = Scenario.from_dict(
    table([ball(-1.0, 0.0, 1.0), ball(-2.0, 0.1, 2.0, radius=0.15)], k=0.9, time=10.0)
)
SPRINGS = example("two_disks").replace({"balls[1].radius": 0.8, "balls[2].radius": 0.1})


def marks(figure: Any, look: dict[str, Any]) -> np.ndarray:
    """Return the points of one style in the lower panel of energies, of shape (n, 2)."""
    face = look.get("markerfacecolor", look["color"])
    drawn = [line for line in figure.axes[1].lines if line.get_markerfacecolor() == face]
    return np.concatenate([np.column_stack(line.get_data()) for line in drawn])


@pytest.mark.parametrize("scenario", [TRACE, TABLE, SPRINGS], ids=["trace", "table", "springs"])
def test_an_impact_that_was_not_made_takes_no_energy(scenario: Scenario) -> None:
    run = simulate(scenario).solved
    rows = run.collisions
    assert run.summary["end_cause"] == "inadmissible"
    assert rows["energy_loss"][-1] != 0.0
    one = draw_one(run, "energy", 1, "single")
    assert one is not None
    figure = one.figure
    drawn = marks(figure, LOSS)[:, 0] if len(figure.axes) > 1 else np.zeros(0)
    np.testing.assert_array_equal(drawn, rows["t"][:-1])


def test_the_law_s_speeds_after_an_inadmissible_impact_are_no_velocities_on_a_table() -> None:
    run = simulate(TABLE).solved
    assert len(run.collisions["n"]) == 1
    named = {text.get_text() for text in texts(table_plan(run))}
    assert {"velocity before", "velocity at the start"} <= named
    assert "velocity after" not in named
    velocities = draw_one(run, "velocities", 1, "single")
    assert velocities is not None
    assert "after (inadmissible)" in {text.get_text() for text in texts(velocities.figure)}


@pytest.mark.parametrize(("k", "angle"), [(0.5, -0.3), (0.0, -0.23230769230769233)])
def test_an_impact_that_would_lift_a_body_off_is_named_not_made(k: float, angle: float) -> None:
    """With k = 0 the bodies still approach at 6e-17 m/s, which is rounding."""
    document = not_made("lift_off")
    document["collision"]["k"], document["balls"][0]["angle"] = k, angle
    run = solve_any(document)
    assert run.summary_record()["end_cause"] == "lift_off"
    assert np.all(
        np.abs(run.collisions["separation_speed"] - k * run.collisions["approach_speed"]) < 1e-15
    )
    told = {
        "portrait": "prevented",
        "energy_portrait": "prevented",
        "velocities": "after (prevented)",
    }
    for kind, words in told.items():
        one = draw_one(run, kind, 1, "single")
        assert one is not None
        assert words in {text.get_text() for text in texts(one.figure)}


def test_what_impacts_gain_is_drawn_as_what_they_lose_is() -> None:
    """Some impacts of a ball and a hoop under the law of translation gain energy of rolling."""
    changed = {"balls[2].body": "hoop", "balls[2].thickness": 0.01}
    scenario = example("three_arcs").replace({"collision.law": "translational"} | changed)
    run = simulate(scenario).solved
    lost = run.collisions["energy_loss"]
    assert np.any(lost < 0.0)
    one = draw_one(run, "energy", 1, "single")
    assert one is not None
    figure = one.figure
    for look, own in ((LOSS, lost > 0.0), (GAIN, lost < 0.0)):
        drawn = marks(figure, look)
        np.testing.assert_array_equal(drawn[:, 0], run.collisions["t"][own])
        np.testing.assert_array_equal(drawn[:, 1], np.abs(lost[own]))
    assert "gain" in {text.get_text() for text in texts(figure)}


def test_a_plan_names_six_bodies_and_writes_powers_of_ten() -> None:
    bodies = [
        {"radius": 0.05, "mass": 1.0, "arc": 1, "angle": f"{angle} deg"}
        for angle in range(-60, 60, 20)
    ]
    shape = {"shape": "valley", "radius": 2e9, "end_slope": "80 deg"}
    trace = {"start_slope": "-80 deg", "arcs": [shape]}
    figure = plan(solve_any(scene(trace, bodies, 0.5, "hedrih", collisions=1)))
    assert figure is not None
    shown = {text.get_text() for text in texts(figure)}
    assert {"body 1", "2", "3", "4", "5", "6"} <= shown
    titles = [text for text in shown if text.startswith("impact")]
    assert titles
    for title in titles:
        assert re.fullmatch(r"impact \d, \$\d\.\d+\\times 10\^\{4\}\$ s", title)


def test_the_bodies_of_a_plan_are_one_artist() -> None:
    """Places are those of the table, those that collide are darker."""
    run = simulate(example("five_balls").replace({"stop.collisions": 3})).solved
    figure = plan(run)
    assert figure is not None
    radii = np.repeat([body.radius for body in run.system.bodies], 2)
    for row, axes in enumerate(figure.axes[1:4]):
        assert not axes.patches
        (discs,) = axes.collections
        boxes: list[Any] = [path.get_extents() for path in discs.get_paths()]
        np.testing.assert_allclose([box.width for box in boxes], 2.0 * radii, rtol=1e-12)
        opacity = np.asarray(discs.get_facecolor())[::2, 3]
        pair = [int(run.collisions[f"ball_{side}"][row]) - 1 for side in "ab"]
        assert sorted(np.flatnonzero(opacity == opacity.max())) == sorted(pair)
        for side, index in zip("ab", pair, strict=True):
            place = [run.collisions[f"{axis}_{side}"][row] for axis in "xy"]
            for box in boxes[2 * index : 2 * index + 2]:
                np.testing.assert_allclose(0.5 * (box.min + box.max), place, rtol=1e-12)


def test_the_bar_of_a_plan_has_a_power_of_ten() -> None:
    small = {f"balls[{n}].radius": 1e-6 for n in (1, 2)} | {"trace.arcs[1].radius": 1e-5}
    run = simulate(example("one_circle").replace(small | {"stop.collisions": 3}))
    said = [text.get_text() for text in texts(run.figure("plan").figure)]
    assert r"$5\times 10^{-6}$ m" in said


def test_maps_and_curves_of_a_table_say_which_impacts_they_count() -> None:
    axes = {"wall.k": np.linspace(0.5, 1.0, 6), "balls[1].y": np.linspace(0.0, 0.05, 3)}
    grid = sweep(example("billiards"), axes)
    for kind, words in (("bounces", "impacts on the wall"), ("curves", "impacts on the wall")):
        drawn = grid.figure(kind).figure
        assert any(words in (one.get_ylabel(), one.get_title()) for one in drawn.axes), kind
