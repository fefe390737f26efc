"""Motion gathered while a run is solved is that of the run with all its logs, to the bit."""

from itertools import chain, repeat
from typing import Any

import numpy as np
import pytest

from vibro_cli.api import recalled, recalled_motion, simulate_streamed
from vibro_cli.scenario import any_scenario_of
from vibro_cli.systems.run import Gathered, Run
from vibro_cli.systems.springs import timed_scenes as springs_scenes
from vibro_cli.systems.table import timed_scenes as table_scenes

SCENES = {
    "30 balls in a box": {"collisions": 4000},
    "wall: ellipse, r = 0.1": {"bounces": 3000},
    "springs": {"collisions": 2000},
}


@pytest.mark.parametrize("interrupted", [False, True])
@pytest.mark.parametrize("scene", SCENES)
def test_the_motion_is_that_of_the_run(
    scene: str, interrupted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vibro_cli.systems.run.MOST_ROWS", 20)
    monkeypatch.setattr("vibro_cli.systems.driver.COMPILED_ROWS", 256)
    monkeypatch.setattr("vibro_cli.systems.run.LEAST_ROWS", 500)
    timed = {**table_scenes.TIMED_SCENES, **springs_scenes.TIMED_SCENES}[scene].document
    scenario = any_scenario_of({**timed, "name": "long", "stop": SCENES[scene]})
    asked = chain([False, False], repeat(interrupted))
    streamed = simulate_streamed(
        scenario, lambda *_: None, figures=True, interrupted=lambda: next(asked)
    )
    checkpoint = streamed.checkpoint()
    assert (checkpoint["end_cause"] == "interrupted") == interrupted
    run, again = recalled(scenario, checkpoint), recalled_motion(scenario, checkpoint)
    assert isinstance(run, Run)
    assert isinstance(again, Gathered)
    assert streamed.motion is not None
    draw = np.random.default_rng(1)
    events = run.collisions["t"][:50]
    times = np.concatenate([draw.uniform(0.0, run.end_time, 500), events, [run.end_time]])
    for found in (again, streamed.motion):
        for side in ("after", "before"):
            assert_same(run.sample(times, side), found.sample(times, side))
        outside = [-1.0, run.end_time + 1.0]
        assert_same(run.sample(outside, "after", True), found.sample(outside, "after", True))
        with pytest.raises(ValueError, match="outside the run"):
            found.sample(outside)


def assert_same(one: dict[str, Any], other: dict[str, Any]) -> None:
    assert list(one) == list(other)
    for name in one:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)
