"""Exact results of the literature, row by row as docs/validation.md lists them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tests.systems.tangent_cases import follow_system
from vibro_cli.kernels.impact.laws import TRANSLATIONAL, impact_of_pair
from vibro_cli.kernels.world import BodyData
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.stress.scenes import ball, scene, system_of, valley
from vibro_cli.systems.trace import simulate_system

Rows = list[tuple[float, float, float]]  # mass, position, speed


def _on_line(
    bodies: Rows, k: float = 1.0, wall: float | None = None, slope: str = "0 deg"
) -> TraceSystem:
    """Return particles on one long line, with or without a wall at its left end."""
    balls = [
        {"body": "particle", "radius": 0.05, "mass": mass, "arc": 1, "position": x, "speed": v}
        for mass, x, v in bodies
    ]
    trace = {"start_slope": slope, "arcs": [{"shape": "line", "length": 1.0e10}]}
    document: dict[str, Any] = scene(trace, balls, k, "translational", time=1.0)
    if wall is not None:
        document["ends"] = {"left": {"wall": wall}}
    return system_of(document)


def _count(system: TraceSystem, time: float = 1.0e5) -> int:
    """Return the numbers of impacts of bodies, and with walls."""
    run = simulate_system(system, time, None)
    return len(run.collisions["n"]) + int(np.sum(run.events["event"] == "wall"))


@pytest.mark.parametrize(("power", "expected"), [(0, 3), (1, 31), (2, 314), (3, 3141), (4, 31415)])
def test_two_balls_and_a_wall_count_the_digits_of_pi(power: int, expected: int) -> None:
    light, heavy = (1.0, 1.0, 0.0), (100.0**power, 2.0, -1.0)
    assert _count(_on_line([light, heavy], wall=1.0), 1.0e6) == expected


def test_three_balls_on_a_line_collide_at_most_as_galperin_says() -> None:
    rng, reached = np.random.default_rng(3), 0
    for _ in range(40):
        m = np.exp(rng.uniform(-4.0, 4.0, 3))
        angle = math.acos(math.sqrt(m[0] * m[2] / ((m[0] + m[1]) * (m[1] + m[2]))))
        most = math.ceil(math.pi / angle)
        speeds = np.sort(rng.normal(0.0, 1.0, 3))[::-1]
        bodies = [
            (float(m[n]), 100.0 + (n + rng.uniform(0.1, 0.9)), float(speeds[n])) for n in range(3)
        ]
        system = _on_line(bodies)
        found = len(simulate_system(system, 1.0e4, None).collisions["n"])
        assert found <= most
        reached += found == most
    assert reached >= 5


@pytest.mark.parametrize(("beside", "expected"), [(-1.0e-9, 4), (1.0e-9, 3)])
def test_three_equal_balls_collide_a_fourth_time_below_a_bound(
    beside: float, expected: int
) -> None:
    """The fourth comes below 3 - 2 sqrt 2, and after it the bound for more is lower."""
    k = 3.0 - 2.0 * math.sqrt(2.0) + beside
    system = _on_line([(1.0, 1.0, 1.0), (1.0, 2.0, 0.0), (1.0, 3.0, 0.0)], k)
    assert len(simulate_system(system, 1.0e12, None).collisions["n"]) == expected


@pytest.mark.parametrize(("beside", "real"), [(-1.0e-6, True), (1.0e-6, False)])
def test_three_equal_balls_collapse_below_a_bound(beside: float, real: bool) -> None:
    """Real multipliers of the two impacts that are repeated, of the two relative speeds."""
    k = 7.0 - 4.0 * math.sqrt(3.0) + beside
    body = BodyData()
    body.radius, body.kappa, body.mass, body.rolling_mass = 0.05, 1.0, 1.0, 1.0
    columns = []
    for speeds in ([1.0, 0.0, 0.0], [0.0, 0.0, -1.0]):
        for left in (0, 1):
            one, other = speeds[left : left + 2]
            one, other, _ = impact_of_pair(TRANSLATIONAL, k, body, body, 1.0, 1.0, one, other)
            speeds[left : left + 2] = one, other
        columns.append([speeds[0] - speeds[1], speeds[1] - speeds[2]])
    matrix = np.array(columns).T
    assert bool(np.trace(matrix) ** 2 >= 4.0 * np.linalg.det(matrix)) is real


def _falling(lower: float, upper: float, start: float = 0.4) -> TraceSystem:
    bodies = [(lower, start, 0.3), (upper, 1.3, -0.2)]
    return _on_line(bodies, 1.0, 1.0, "30 deg")


@pytest.mark.parametrize(("ratio", "expected"), [(2.0, 1.04), (4.0, 1.33)])
def test_falling_balls_have_a_positive_exponent(ratio: float, expected: float) -> None:
    found = follow_system(_falling(ratio, 1.0), None, 20_000)
    exponents, errors = found.growth.exponents(per_impact=True)
    assert errors[0] < 0.02
    assert abs(exponents[0] - expected) < 4.0 * errors[0] + 0.005
    np.testing.assert_allclose(exponents, -exponents[::-1], atol=2e-3)
    assert abs(np.sum(found.sums)) < 1e-12 * found.sums[0]
    other, error = follow_system(_falling(ratio, 1.0, 0.55), None, 20_000).growth.exponents(True)
    # One orbit fills the energy surface: another one has the same exponent.
    assert abs(other[0] - exponents[0]) < 4.0 * math.hypot(error[0], errors[0])


def test_equal_falling_balls_have_none() -> None:
    exponents, _ = follow_system(_falling(1.0, 1.0), None, 20_000).growth.exponents(True)
    assert np.max(np.abs(exponents)) < 1.5 * math.log(20_000) / 20_000


def test_equal_bodies_in_one_valley_only_exchange_their_states() -> None:
    places, speeds = (-0.8, 0.5), (0.0, 0.7)
    both = [ball(place, speed=speed) for place, speed in zip(places, speeds, strict=True)]
    for body in both:
        body["body"] = "particle"
        body["radius"] = 1.0e-9
    system = system_of(scene(valley(90), both, 1.0, time=20.0))
    alone = [system_of(scene(valley(90), [body], time=20.0)) for body in both]
    times = [5.0, 20.0]
    found = simulate_system(system, 20.0, None).sample(times)
    # Points have no size: their union moves as free pendulums.
    free = [simulate_system(one, 20.0, None).sample(times) for one in alone]
    for number, t in enumerate(times):
        mine = np.sort(found["angle"][found["t"] == t])
        theirs = np.sort([float(one["angle"][number]) for one in free])
        np.testing.assert_allclose(mine, theirs, atol=1e-7)
    equal = system_of(scene(valley(90), [ball(-0.8), ball(0.5)], 1.0, time=20.0))
    exponents, _ = follow_system(equal, None, 3000).growth.exponents(True)
    assert np.max(np.abs(exponents)) < 1.5 * math.log(3000) / 3000


@pytest.mark.parametrize("k", [0.999, 0.99])
def test_exponents_sum_to_what_impacts_take(k: float) -> None:
    bodies = [(2.0, 0.4, 0.3), (1.0, 1.3, -0.2)]
    system = _on_line(bodies, k, k, "30 deg")
    found = follow_system(system, None, 100)
    run = simulate_system(system, None, 100)
    impacts = len(run.collisions["n"]) + int(np.sum(run.events["event"] == "wall"))
    assert np.sum(found.sums) / (2.0 * impacts * math.log(k)) == pytest.approx(1.0, abs=1e-12)


def test_a_gradient_through_an_elastic_impact_is_exact() -> None:
    """Two equal balls on a line exchange: x2(1 s) goes with x1 and v1 of the start."""
    system = _on_line([(1.0, 1.0, 1.0), (1.0, 1.5, 0.0)])
    found = follow_system(system, 1.0, None)
    assert len(found.times) == 1
    np.testing.assert_allclose(found.matrix[2], [1.0, 1.0, 0.0, 0.0], atol=1e-14)
