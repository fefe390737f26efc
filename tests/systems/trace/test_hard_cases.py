"""Scenes that once failed, each a file with one line on the fault it revealed."""

from __future__ import annotations

import tomllib
from functools import lru_cache
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest

from tests.strategies import mirrored
from tests.systems.trace.test_continuing import assert_same_results
from tests.systems.trace.test_properties import assert_bodies_touch, assert_mirrored_to_the_bit
from vibro_cli.api import simulate
from vibro_cli.scenario import load_any, scenario_of
from vibro_cli.stress.physics import motion_of, standing, walls
from vibro_cli.systems.run import Run

pytestmark = pytest.mark.long

CASES = sorted((Path(__file__).parents[2] / "hard_cases").glob("*.toml"))
# Scenes that end before their stop; all others reach it.
ENDS = {
    "one_sided_overhanging_line": "lift_off",
    "turning_last_flight_at_the_bottom": "collisions",
    "turning_last_flights": "collisions",
}
OVERLAP = 1e-12  # m: overlap of bodies at any sampled time
MIRRORED = [path for path in CASES if path.stem.startswith("mirror_")]


@pytest.fixture(scope="module", params=CASES, ids=lambda path: path.stem)
def path(request: pytest.FixtureRequest) -> Path:
    """Each file in turn, with all tests of it one after another: they share its runs."""
    found: Path = request.param
    return found


@lru_cache(maxsize=1)
def run_of(path: Path) -> Run:
    """Return the run of a file; called in a test, which stops one that hangs."""
    return simulate(load_any(path))


def test_every_file_says_what_it_caught(path: Path) -> None:
    assert path.read_text().startswith("# ")


@pytest.mark.usefixtures("no_hang")
def test_runs_to_its_stop_in_order_and_without_gaining_energy(path: Path) -> None:
    scenario, run = load_any(path), run_of(path)
    summary = run.summary_record()
    assert summary["end_cause"] == ENDS.get(path.stem, "time")
    if path.stem not in ENDS:
        assert summary["end_time"] == scenario.stop.time
    assert summary["energy_end"] <= summary["energy_start"] * (1.0 + 1e-12)
    times = np.linspace(0.0, summary["end_time"], 2001)
    motion = run.sample(times)
    bodies = len(run.system.bodies)
    places = np.stack([motion["x"], motion["y"]]).reshape(2, len(times), bodies)
    size = np.abs(places).max()
    for a, b in pairwise(range(bodies)):
        distance = np.hypot(*(places[:, :, b] - places[:, :, a]))
        reach = run.system.bodies[a].radius + run.system.bodies[b].radius
        # Bounces summed up in closed form leave a gap of the rounding of a whole accumulation.
        assert distance.min() >= reach - 1e-9 * size
    energy = motion["energy"].reshape(len(times), bodies).sum(axis=1)
    # The translational law keeps m v^2, not the energy of rolling.
    if scenario.collision.law != "translational":
        assert (np.diff(energy) <= 1e-9 * energy[0]).all()


def test_energy_is_lost_in_the_rows_of_impacts_and_at_walls_only(path: Path) -> None:
    run = run_of(path)
    summary, events = run.summary_record(), run.events
    lost = float(np.sum(run.collisions["energy_loss"]))
    hits = events["event"] == "wall"
    for ball, before, after in zip(
        events["ball"][hits], events["value"][hits], events["speed"][hits], strict=True
    ):
        body = run.system.bodies[ball - 1]
        lost += 0.5 * body.kappa * body.mass * (before**2 - after**2)
    balance = summary["energy_start"] - summary["energy_end"] - lost
    assert abs(balance) <= 2e-12 * summary["energy_start"]


@pytest.mark.usefixtures("no_hang")
def test_no_two_bodies_are_in_one_another_and_all_keep_their_order(path: Path) -> None:
    run = run_of(path)
    times = np.linspace(0.0, run.summary_record()["end_time"], 10_000)
    motion = run.sample(times)
    bodies = len(run.system.bodies)
    x, y, s = (motion[name].reshape(len(times), bodies) for name in ("x", "y", "s"))
    for a, b in combinations(range(bodies), 2):
        distance = np.hypot(x[:, b] - x[:, a], y[:, b] - y[:, a])
        depth = run.system.bodies[a].radius + run.system.bodies[b].radius - distance.min()
        assert depth <= OVERLAP, (a, b)
    if not run.system.trace.closed:
        assert (np.diff(s, axis=1) > -OVERLAP).all()


@pytest.mark.usefixtures("no_hang")
def test_no_body_is_beyond_a_wall_or_stands_where_nothing_keeps_it(path: Path) -> None:
    run = run_of(path)
    motion = motion_of(run, 500)
    assert list(walls(run, motion)) == []
    assert list(standing(run, motion)) == []


@pytest.mark.usefixtures("no_hang")
def test_taken_up_again_it_is_the_same_run(path: Path) -> None:
    scenario = load_any(path)
    whole = run_of(path)
    for share, first, second in ((0.3, "python", "compiled"), (0.7, "compiled", "python")):
        part = load_any(path, [f"stop.time={share * (scenario.stop.time or 0.0)!r}"])
        begun = simulate(part, first)
        assert_same_results(whole, simulate(scenario, second, begun.checkpoint(), begun.history()))


@pytest.mark.usefixtures("no_hang")
def test_bodies_touch_at_every_impact(path: Path) -> None:
    assert_bodies_touch(run_of(path))


@pytest.mark.usefixtures("no_hang")
@pytest.mark.parametrize("path", MIRRORED, ids=lambda path: path.stem)
def test_the_mirror_image_is_the_same_run(path: Path) -> None:
    document = tomllib.loads(path.read_text(encoding="utf-8"))
    run, image = (simulate(scenario_of(one)) for one in (document, mirrored(document)))
    assert_mirrored_to_the_bit(run, image)


@pytest.mark.usefixtures("no_hang")
def test_both_engines_give_the_same_tables(path: Path) -> None:
    interpreted, compiled = simulate(load_any(path), "python"), run_of(path)
    assert (interpreted.engine, compiled.engine) == ("python", "compiled")
    times = np.linspace(0.0, compiled.end_time, 50)
    for ours, theirs in (
        (interpreted.collisions, compiled.collisions),
        (interpreted.events, compiled.events),
        (interpreted.summary, compiled.summary),
        (interpreted.sample(times), compiled.sample(times)),
    ):
        assert list(ours) == list(theirs)
        for name in ours:
            np.testing.assert_array_equal(ours[name], theirs[name], err_msg=name)
