"""The motion of a run without a log is that of the run with its logs, to the bit."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.systems.test_gathered import assert_same
from vibro_cli.api import recalled, recalled_motion, simulate_streamed
from vibro_cli.assemble import build_any
from vibro_cli.figures.runs.scene import configurations
from vibro_cli.scenario import load_any
from vibro_cli.systems import system_named
from vibro_cli.systems.run import Run, simulate
from vibro_cli.systems.trace import motion
from vibro_cli.systems.trace.motion import LongMotion

ROOT = Path(__file__).parents[3]
SCENES = (
    (ROOT / "tests" / "scenes" / "three_arcs.toml", "stop.collisions=20000"),
    (ROOT / "tests" / "scenes" / "rotating_three_arcs.toml", "stop.collisions=5000"),
    (ROOT / "scenarios" / "five_balls.toml", "stop.time=20"),
    (ROOT / "scenarios" / "disk_on_arcs.toml", "stop.time=20"),
)


@pytest.fixture(params=SCENES, ids=lambda scene: scene[0].stem, scope="module")
def both(request: pytest.FixtureRequest) -> tuple[Run, LongMotion]:
    scene, stop = request.param
    scenario = load_any(scene, [stop])
    kind, system = system_named(scenario.system), build_any(scenario)
    limits = kind.limits(scenario)
    run = simulate(kind, system, limits)
    return run, LongMotion(system, limits, len(run.flights()["ball"]))


def test_flights_and_the_state_at_the_end(both: tuple[Run, LongMotion]) -> None:
    run, long = both
    assert_same(run.flights(), long.flights())
    assert long.state == run.checkpoint()["state"]


def test_curves_of_flights(both: tuple[Run, LongMotion]) -> None:
    run, long = both
    count = len(run.flights()["ball"])
    contact = np.flatnonzero(run.flights()["contact"])
    rows = [0, count // 3, count // 2, count - 1, *contact[:20].tolist()]
    long.look_at(rows)
    for row in [*rows, count // 5]:
        for mine, theirs in zip(long.flight_curve(row, 9), run.flight_curve(row, 9), strict=True):
            np.testing.assert_array_equal(mine, theirs)


@pytest.mark.parametrize("side", ["after", "before"])
def test_samples(both: tuple[Run, LongMotion], side: str) -> None:
    run, long = both
    draw = np.random.default_rng(1)
    starts = run.flights()["t_start"]
    times = np.concatenate(
        [draw.uniform(0.0, run.end_time, 500), starts[:: len(starts) // 200 + 1], [run.end_time]]
    )
    for instants in (times, times[:0], times[-1:]):
        assert_same(run.sample(instants, side), long.sample(instants, side))


def test_a_run_that_was_interrupted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion, "MOST_FLIGHTS", 1000)
    scenario = load_any(SCENES[0][0], [SCENES[0][1]])
    asked = iter([False, True])
    part = simulate_streamed(scenario, lambda *_: None, interrupted=lambda: next(asked))
    checkpoint = part.checkpoint()
    assert checkpoint["end_cause"] == "interrupted"
    long, run = recalled_motion(scenario, checkpoint), recalled(scenario, checkpoint)
    assert isinstance(long, LongMotion)
    assert_same(run.flights(), long.flights())
    times = np.linspace(0.0, run.end_time, 100)
    assert_same(run.sample(times), long.sample(times))


@dataclass(eq=False)
class Shown:
    """What a plan takes of a run."""

    system: Any
    collisions: Any
    flights: Any
    sample: Any


def test_a_plan_solves_a_long_run_again_once(
    both: tuple[Run, LongMotion], monkeypatch: pytest.MonkeyPatch
) -> None:
    run, long = both
    shown = Shown(run.system, run.collisions, long.flights, long.sample)
    solved: list[int] = []
    stretches = long._stretches

    def counted() -> Any:
        solved.append(1)
        return stretches()

    monkeypatch.setattr(long, "_stretches", counted)
    for most in (16, 8):  # of both widths
        found = configurations(shown, most)
        assert len(solved) <= 1
        for one, other in zip(found, configurations(run, most), strict=True):
            assert one.title == other.title
            np.testing.assert_array_equal(one.centres, other.centres)
