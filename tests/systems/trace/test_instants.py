"""Impacts at one instant: their limit, walls as bodies of infinite mass, what follows it."""

from __future__ import annotations

import itertools
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vibro_cli.api import simulate
from vibro_cli.assemble import build_any, build_system
from vibro_cli.kernels.contact.contact_kinematics import set_normals
from vibro_cli.kernels.events import event_loop
from vibro_cli.kernels.events.simultaneous_impacts import MOST_ROUNDS, _is_endless
from vibro_cli.kernels.impact.chattering import half_approach, press_speeds
from vibro_cli.kernels.impact.impulse_chain import apply_impulses, simultaneous_impulses
from vibro_cli.kernels.impact.laws import NORMAL_IMPULSE, TRANSLATIONAL
from vibro_cli.kernels.world import World
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.scenario import ScenarioError, load_any, scenario_of
from vibro_cli.stress.oracles.oracle import Oracle
from vibro_cli.stress.oracles.scene import mp
from vibro_cli.stress.physics import distance_from_image
from vibro_cli.stress.scenes import scene, system_of
from vibro_cli.systems.request import Limits
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system
from vibro_cli.systems.trace.world import make_world

CASES = Path(__file__).parents[2] / "hard_cases"
RADIUS = 0.1


def row_at_a_wall(masses: list[float], left: bool) -> World:
    """Bodies of one radius that touch, and of which one touches a wall of a level line."""
    length = 3.0
    begin = RADIUS if left else length - RADIUS * (2 * len(masses) - 1)
    balls = [
        {"radius": RADIUS, "mass": mass, "arc": 1, "position": begin + 2.0 * RADIUS * number}
        for number, mass in enumerate(masses)
    ]
    line = {"start_slope": 0.0, "arcs": [{"shape": "line", "length": length}]}
    document = scene(line, balls, 0.5, time=1.0)
    document["ends"] = {"left": {"wall": 0.5}, "right": {"wall": 0.5}}
    return make_world(system_of(document), Limits(1.0))


def nearest_motion(
    masses: list[float], speeds: list[float], left: bool
) -> tuple[list[float], float]:
    """Motion without closing contacts nearest to one given, by every set of contacts in turn."""
    count = len(masses)
    rows = np.zeros((count, count))
    for pair in range(count - 1):
        rows[pair, pair : pair + 2] = -1.0, 1.0
    rows[-1, 0 if left else -1] = 1.0 if left else -1.0
    inverse = np.diag(1.0 / np.array(masses))
    best, least = speeds, np.inf
    for size in range(count + 1):
        for chosen in itertools.combinations(range(count), size):
            some = rows[list(chosen)]
            impulses = np.zeros(0)
            if size:
                impulses = np.linalg.solve(some @ inverse @ some.T, -some @ np.array(speeds))
            after = np.array(speeds) + inverse @ some.T @ impulses
            if (rows @ after < -1e-9).any():
                continue
            distance = float(np.sum(masses * (after - speeds) ** 2))
            if distance < least:
                best, least = after.tolist(), distance
    return best, least


@pytest.mark.parametrize("left", [True, False])
@pytest.mark.parametrize("seed", range(40))
def test_limit_is_the_nearest_motion_that_does_not_close(seed: int, left: bool) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    masses = (10.0 ** rng.uniform(-1.0, 1.0, count)).tolist()
    speeds = rng.uniform(-1.0, 1.0, count).tolist()
    world = row_at_a_wall(masses, left)
    for j in range(count - 1):
        set_normals(world, j)
    for flight, speed in zip(world.flights, speeds, strict=True):
        flight.speed = speed
    press_speeds(world, 0, count - 1, NORMAL_IMPULSE)
    apply_impulses(world, 0, count - 1, NORMAL_IMPULSE)
    expected, _ = nearest_motion(masses, speeds, left)
    found = [flight.speed for flight in world.flights]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("law", [TRANSLATIONAL, NORMAL_IMPULSE])
@pytest.mark.parametrize("seed", range(10))
def test_losses_of_plastic_impulses_add_up_to_the_energy_lost(seed: int, law: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    world = row_at_a_wall((10.0 ** rng.uniform(-1.0, 1.0, count)).tolist(), True)
    for ball in range(count):
        body = world.bodies[ball]
        if law == TRANSLATIONAL:  # conserves m v, but loses energy of rolling
            body.kappa = rng.uniform(1.0, 2.0)
            body.rolling_mass = body.kappa * body.mass
        world.flights[ball].speed = rng.uniform(-1.0, 1.0)
    for j in range(count - 1):
        set_normals(world, j)

    def energy() -> float:
        balls = zip(world.bodies, world.flights, strict=True)
        return sum(0.5 * body.rolling_mass * flight.speed**2 for body, flight in balls)

    before = energy()
    halves = [half_approach(world, j, law) for j in range(count - 1)]
    simultaneous_impulses(world, 0, count - 1, law, 1)
    apply_impulses(world, 0, count - 1, law)
    losses = [
        world.pairs[j].solution * (half + half_approach(world, j, law))
        for j, half in enumerate(halves)
    ]
    assert sum(losses) == pytest.approx(before - energy(), abs=1e-13)


@pytest.mark.parametrize("lossy", [None, "left", "right", 0, 1, 2])
def test_limit_is_taken_if_any_contact_of_a_row_takes_energy(lossy: str | int | None) -> None:
    world = row_at_a_wall([1.0, 2.0, 3.0, 4.0], lossy != "right")
    settings = world.settings[0]
    settings.left_wall = 0.5 if lossy == "left" else 1.0
    settings.right_wall = 0.5 if lossy == "right" else 1.0
    for j in range(3):
        set_normals(world, j)
        world.pairs[j].restitution = 0.5 if lossy == j else 1.0
    world.flights[2].speed = 1.0
    world.flights[0].impacts = MOST_ROUNDS + 1
    assert _is_endless(world, 0, 3) == (lossy is not None)
    world.flights[0].impacts = MOST_ROUNDS
    assert not _is_endless(world, 0, 3)
    world.flights[0].impacts = MOST_ROUNDS + 1
    world.flights[2].speed = 0.0  # no pair closes
    assert not _is_endless(world, 0, 3)


def test_sequence_that_contracts_slowly_is_taken_to_its_limit() -> None:
    run = simulate(load_any(CASES / "heavy_ball_contracts_slowly.toml"))
    table = run.collisions
    at_one_instant = max(np.count_nonzero(table["t"] == t) for t in set(table["t"].tolist()))
    # Each round is an impact of the pair and one with the wall.
    assert 0.4 * MOST_ROUNDS < at_one_instant <= MOST_ROUNDS
    begin = float(max(set(table["t"].tolist()), key=table["t"].tolist().count))
    # Both stand at the wall then, whatever is left of a row of 3e5 impacts.
    assert np.abs(run.sample([begin])["speed"]).max() <= 1e-14


def test_light_balls_between_a_wall_and_a_heavy_one_bounce_as_often_as_they_have_to() -> None:
    # Elastic impacts at one instant are finitely many: pi 10^d of them for masses 1 and 100^d.
    document = tomllib.loads((CASES / "heavy_ball_contracts_slowly.toml").read_text())
    document["trace"] = {"start_slope": 0.0, "arcs": [{"shape": "line", "length": 3.0}]}
    document["ends"] = {"left": {"wall": 1.0}, "right": {"wall": 1.0}}
    document["collision"] = {"k": 1.0}
    document["balls"] = [
        {"radius": RADIUS, "mass": 1.0, "arc": 1, "position": RADIUS},
        {"radius": RADIUS, "mass": 1e4, "arc": 1, "position": 1.0, "speed": -1.0},
    ]
    run = simulate(scenario_of({**document, "stop": {"time": 2.5}}))
    walls = int(np.count_nonzero(run.events["event"] == "wall"))
    assert len(run.collisions["t"]) + walls == 314
    assert run.summary_record()["energy_drift"] < 1e-10


@pytest.mark.usefixtures("no_hang")
@pytest.mark.parametrize("masses", [[1.0, 1.0], [1.0, 3.0, 2.0]])
def test_row_that_fills_the_room_between_two_walls_has_impacts_without_end(
    monkeypatch: pytest.MonkeyPatch, masses: list[float]
) -> None:
    monkeypatch.setattr(event_loop, "ENDLESS_ROUNDS", 4 * MOST_ROUNDS)
    line = {"start_slope": 0.0, "arcs": [{"shape": "line", "length": 0.2 * len(masses)}]}
    balls = [
        {"radius": RADIUS, "mass": mass, "arc": 1, "position": RADIUS + 0.2 * number}
        for number, mass in enumerate(masses)
    ]
    document = scene(line, balls, 1.0, "hedrih", time=1.0)
    document["ends"] = {"left": {"wall": 1.0}, "right": {"wall": 1.0}}
    document["balls"][0]["speed"] = 1.0
    run = simulate(scenario_of(document), "python")
    assert (run.end_cause, run.end_time) == ("accumulation", 0.0)
    assert len(run.collisions["t"]) > MOST_ROUNDS
    assert run.summary_record()["energy_drift"] < 1e-12
    damped = {**document, "collision": {"k": 0.9}}
    assert simulate(scenario_of(damped), "python").end_cause == "time"


def circle_with_room(share: float, k: float) -> dict[str, Any]:
    """Six bodies of a third of a circle's radius, which fill it, but for this share of theirs."""
    radius = 0.1 * (1.0 - share)
    ball = {"radius": radius, "mass": 1.0, "arc": 1}
    arc = {"shape": "valley", "radius": 0.3, "end_slope": "180 deg"}
    balls = [{**ball, "angle": f"{angle} deg"} for angle in range(-150, 180, 60)]
    trace = {"start_slope": "-180 deg", "closed": True, "arcs": [arc]}
    document = scene(trace, balls, k, "hedrih", time=0.05, collisions=300)
    document["balls"][0]["rate"] = 3.0
    return document


@pytest.mark.usefixtures("no_hang")
@pytest.mark.parametrize("share", [1e-13, 1e-10])
@pytest.mark.parametrize("k", [0.5, 1.0])
def test_bodies_that_nearly_fill_a_circle_do_not_overlap(share: float, k: float) -> None:
    run = simulate(scenario_of(circle_with_room(share, k)))
    assert run.summary_record()["collisions"] > 20
    radius = run.system.bodies[0].radius
    times = np.linspace(0.0, run.end_time, 100)
    angle = run.sample(times)["angle"].reshape(len(times), 6)
    angle = np.column_stack([angle, angle[:, 0] + 2.0 * np.pi])
    apart = 2.0 * (0.3 - radius) * np.sin(0.5 * np.diff(angle, axis=1))
    assert apart.min() >= 2.0 * radius * (1.0 - 1e-14)


@pytest.mark.parametrize("share", [0.0, 3e-16, 1e-15, 3e-15])
def test_bodies_that_fill_a_circle_up_to_rounding_are_refused(share: float) -> None:
    with pytest.raises(ScenarioError, match="touch one another all around the closed trace"):
        build_system(scenario_of(circle_with_room(share, 1.0)))


@pytest.mark.parametrize(("radius", "fills"), [(0.7, True), (0.7 - 1e-15, True), (0.69, False)])
def test_two_bodies_as_wide_as_their_circle_are_refused(radius: float, fills: bool) -> None:
    document = circle_with_room(0.0, 1.0)
    document["trace"]["arcs"][0]["radius"] = 1.0
    document["balls"] = [
        {"radius": 0.3, "mass": 1.0, "arc": 1, "angle": -1.5, "rate": 0.3},
        {"radius": radius, "mass": 2.0, "arc": 1, "angle": np.pi - 1.5},
    ]
    if not fills:
        assert len(build_system(scenario_of(document)).bodies) == 2
        return
    with pytest.raises(ScenarioError, match="touch one another all around the closed trace"):
        build_system(scenario_of(document))


@pytest.mark.usefixtures("no_hang")
def test_translational_closes_where_its_impacts_end() -> None:
    path = CASES / "translational_closes_by_its_momentum.toml"
    run = simulate(load_any(path))
    row = list(run.events["event"]).index("contact_closed")
    oracle = Oracle.of(run.system)
    end = oracle.run(mp.mpf(10), last=("contact_closed",)).events[-1].t
    exact = oracle.now.states[0]
    closed = float(run.events["t"][row])
    assert abs(closed - float(end)) <= 1e-10 * closed
    motion = run.sample([float(end)])
    assert abs(float(motion["speed"][0]) - float(exact.speed)) <= 1e-10
    assert abs(float(motion["angle"][0]) - float(exact.place)) <= 1e-10


@pytest.mark.usefixtures("no_hang")
@pytest.mark.parametrize("name", ["row_at_a_wall_is_hit", "held_pair_is_hit"])
def test_mirror_image_of_a_row_that_is_hit(name: str) -> None:
    scenario = load_any(CASES / f"{name}.toml")
    system = build_any(scenario)
    stop = scenario.stop.time

    def solve(one: TraceSystem) -> Run:
        return simulate_system(one, stop, None)

    assert distance_from_image(solve(system), solve) == (0.0, 0.0)


@pytest.mark.usefixtures("no_hang")
def test_light_body_that_goes_nowhere_comes_to_rest() -> None:
    # Between a wall and a heavy body it went to and fro for ever, in 1e-9 s and 5e-16 m.
    path = Path(__file__).parent / "turning_light_body_shuttles_at_a_wall.toml"
    run = simulate(load_any(path, ["stop.time=0.46"]))
    assert run.end_cause == "time"
    assert run.summary_record()["end_time"] == 0.46
    # It gives way at once to where the heavy body brings it, and each impact takes energy.
    energy = run.sample(np.linspace(0.0, 0.46, 1001))["energy"].reshape(1001, -1).sum(axis=1)
    assert (np.diff(energy) <= 1e-12 * energy[0]).all()


@pytest.mark.usefixtures("no_hang")
@pytest.mark.parametrize(("count", "rate"), [(1, 0.0), (1, 0.7), (3, 0.0)])
def test_bodies_that_roll_off_a_wall_come_back_to_it_without_an_impact(
    count: int, rate: float
) -> None:
    arcs = [
        {"shape": "line", "length": 0.7},
        {"shape": "valley", "radius": 0.87, "end_slope": 0.05},
        {"shape": "valley", "radius": 1.37, "end_slope": 1.5},
    ]
    balls: list[dict[str, Any]] = [{"radius": 0.05, "mass": 1.0, "arc": 1, "position": 0.05}]
    balls += [{"radius": 0.05, "mass": 1.0, "arc": 1, "touching": "previous"}] * (count - 1)
    document = scene({"start_slope": -0.94, "arcs": arcs}, balls, 0.0, time=20.0)
    document["trace"]["turning"] = {"x": 1.0, "rate": rate}
    document["ends"] = {"left": {"wall": 0.5}, "right": {"wall": 0.5}}
    run = simulate(scenario_of(document))
    # They come back to rest every 3 s. In 40 digits too there is no impact then.
    oracle = Oracle.of(run.system)
    assert not oracle.run(mp.mpf("3.2")).bounces
    assert not np.any(run.events["event"] == "wall")
    assert len(run.collisions["t"]) == 0
    s = run.sample(np.arange(0.0, 20.0, 0.01))["s"][::count]
    assert np.count_nonzero(np.diff(np.sign(np.diff(s))) > 0) == 6


@pytest.mark.parametrize(("length", "arriving"), [(1e6, 1e-4), (10.0, 4e-7)])
def test_slow_impacts_on_a_wall_are_carried_out(length: float, arriving: float) -> None:
    # A share of the trace's length counted as rounding of the height of a body in its valley.
    valley = {"shape": "valley", "radius": 1.0, "end_slope": 0.5}
    arcs = [valley, {"shape": "line", "length": length}]
    wall = mp.asin(mp.mpf(0.1) / (1 - mp.mpf(0.1))) - mp.mpf(0.9)
    rise = (1 - mp.mpf(0.1)) * (mp.cos(0.5) - mp.cos(wall))
    speed = mp.sqrt(2 * mp.mpf(9.81) * rise / mp.mpf("1.4") + mp.mpf(arriving) ** 2)
    ball = {"radius": 0.1, "mass": 1.0, "arc": 1, "angle": -0.5, "speed": -float(speed)}
    document = scene({"start_slope": -0.9, "arcs": arcs}, [ball], time=2.0)
    document["ends"] = {"left": {"wall": 1.0}, "right": "stop"}
    run = simulate(scenario_of(document))
    oracle = Oracle.of(run.system)
    oracle.run(mp.mpf(2))
    impact = oracle.history.bounces[0]
    assert float(-impact.before) == pytest.approx(arriving, rel=1e-2)
    walls = run.events["t"][run.events["event"] == "wall"]
    # A unit in the last place of the speed moves the instant by it, over the speed at the wall.
    assert walls == pytest.approx([float(impact.t)], abs=1e-15 / arriving)
    last = float(oracle.now.states[0].speed)
    assert run.sample(2.0)["speed"][0] == pytest.approx(last, abs=1e-14 / arriving)
    assert abs(run.summary_record()["energy_drift"]) < 1e-15
