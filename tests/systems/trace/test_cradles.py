"""Several pairs at one instant: Newton's cradle, hits from both sides, small k."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from vibro_cli.stress.scenes import VALLEY, ball, scene, solve_any
from vibro_cli.systems.run import Run

pytestmark = pytest.mark.usefixtures("no_hang")
EPSILON = 2.0**-52
RADIUS, REACH = 0.1, 1.0
BETA = 2.0 * math.asin(RADIUS / (REACH - RADIUS))
COEFFICIENTS = [1.0, 0.7, 0.3, 0.05, 0.0]
STOP = 4.0


def touching(masses: list[float]) -> list[dict[str, Any]]:
    """Balls at rest in contact, about the bottom of the valley."""
    balls = [ball(-0.5 * BETA * (len(masses) - 1), mass=masses[0])]
    others = [{"radius": RADIUS, "mass": m, "arc": 1, "touching": "previous"} for m in masses[1:]]
    return balls + others


def run_of(balls: list[dict[str, Any]], k: float) -> Run:
    return solve_any(scene(VALLEY, balls, k, time=STOP))


def after_instant(masses: Any, speeds: Any, k: float) -> Any:
    """Simultaneous impacts of a row of equal radii: all closing pairs at once, and so on.

    Each pair's relative speed after the impulses of all closing pairs is -k times the one before;
    where the sequence contracts instead of ending, a common speed is its limit.
    """
    speeds = np.array(speeds)
    noise = 1e-14 * np.max(np.abs(speeds))
    while True:
        closing = np.flatnonzero(speeds[:-1] - speeds[1:] > noise)
        if len(closing) == 0:
            return speeds
        effect = np.zeros((len(speeds), len(closing)))
        for column, pair in enumerate(closing):
            effect[pair, column] = -1.0 / masses[pair]
            effect[pair + 1, column] = 1.0 / masses[pair + 1]
        approach = speeds[closing] - speeds[closing + 1]
        rows = effect[closing + 1] - effect[closing]
        speeds = speeds + effect @ np.linalg.solve(rows, (1.0 + k) * approach)


def check_accounts(run: Run) -> None:
    """Check that the run reaches its stop, and that every joule lost is in a row."""
    record = run.summary_record()
    assert run.end_cause == "time"
    lost = math.fsum(run.collisions["energy_loss"])
    assert np.all(run.collisions["energy_loss"] >= -1e-14 * record["energy_start"])
    error = record["energy_start"] - lost - record["energy_end"]
    assert abs(error) <= 1e-12 * record["energy_start"]
    assert record["energy_correction"] <= 1e-11 * record["energy_start"]
    if run.system.restitution[0] == 1.0:
        assert abs(record["energy_drift"]) <= 1e-13


def check_first_instant(run: Run, masses: list[float], k: float) -> None:
    """Speeds just after the first impacts are those of the joint solution."""
    first = float(run.collisions["t"][0])
    before, after = (run.sample([first], side)["speed"] for side in ("before", "after"))
    expected = after_instant(masses, before, k)
    fastest = float(np.max(np.abs(before)))
    # Bounces lost in rounding, some 1e-7 m/s, are contact.
    assert np.max(np.abs(after - expected)) <= 1e-7 + 1e-12 * fastest
    total = np.dot(masses, before)
    assert abs(np.dot(masses, after) - total) <= 64 * EPSILON * fastest * sum(masses)


@pytest.mark.parametrize("k", COEFFICIENTS)
@pytest.mark.parametrize("count", range(3, 9))
def test_one_ball_against_a_row(count: int, k: float) -> None:
    run = run_of([ball(-1.9), *touching([1.0] * (count - 1))], k)
    check_accounts(run)
    check_first_instant(run, [1.0] * count, k)
    if k == 1.0:
        first = float(run.collisions["t"][0])
        incident = float(run.collisions["speed_a_pre"][0])
        speeds = run.sample([first])["speed"]
        assert abs(speeds[-1] - incident) <= 16 * EPSILON * incident
        assert np.max(np.abs(speeds[:-1])) <= 16 * EPSILON * incident
        # A pass to each neighbour, on each of the hits before the stop: no impacts of rounding.
        assert len(run.collisions["n"]) <= 8 * count


@pytest.mark.parametrize("k", COEFFICIENTS)
@pytest.mark.parametrize("count", [2, 3, 4])
def test_two_balls_against_a_row(count: int, k: float) -> None:
    balls = [ball(-1.2 - BETA), {**ball(-1.2), "touching": "previous"}]
    del balls[1]["angle"]
    run = run_of([*balls, *touching([1.0] * count)], k)
    check_accounts(run)
    check_first_instant(run, [1.0] * (count + 2), k)


@pytest.mark.parametrize("k", COEFFICIENTS)
@pytest.mark.parametrize("middle", [[0.5], [1.0], [2.0], [1.0, 1.0], [3.0, 1.0, 3.0], [1.0] * 4])
def test_struck_from_both_sides(middle: list[float], k: float) -> None:
    """Masses 1:m:1 and rows: symmetric scenes stay symmetric, to the bit with one in the middle."""
    row = touching(middle) if len(middle) > 1 else [ball(0.0, mass=middle[0])]
    run = run_of([ball(-1.3), *row, ball(1.3)], k)
    check_accounts(run)
    check_first_instant(run, [1.0, *middle, 1.0], k)
    angles = run.sample(np.linspace(0.0, STOP, 50))["angle"].reshape(50, -1)
    lopsided = np.max(np.abs(angles + angles[:, ::-1]))
    assert lopsided == 0.0 if len(middle) == 1 else lopsided <= 1e-13


@pytest.mark.parametrize("k", [0.0, 0.05, 0.07])
def test_three_balls_at_small_k_come_out_with_one_speed(k: float) -> None:
    """Below 7 - 4 sqrt(3) the impacts of the instant contract to a common speed."""
    run = run_of([ball(-1.9), *touching([1.0, 1.0])], k)
    first = float(run.collisions["t"][0])
    incident = float(run.collisions["speed_a_pre"][0])
    speeds = run.sample([first])["speed"]
    assert np.max(np.abs(speeds - incident / 3.0)) <= 1e-7
    assert set(run.events["event"][run.events["t"] > 0.0]) >= {"contact_closed"}
    assert len(run.collisions["n"]) < 200


def test_beyond_that_k_they_part() -> None:
    run = run_of([ball(-1.9), *touching([1.0, 1.0])], 0.1)
    first = float(run.collisions["t"][0])
    speeds = run.sample([first])["speed"]
    assert all(b - a > 1e-5 for a, b in pairwise(speeds))


def test_impacts_handed_on_at_one_instant_are_marked() -> None:
    """On a line, where all is known: the first ball stops, the last one goes on."""
    balls: list[dict[str, Any]] = [
        {"radius": 0.1, "mass": 1.0, "arc": 1, "position": 0.1, "speed": 1.0},
        {"radius": 0.1, "mass": 1.0, "arc": 1, "position": 2.0, "speed": 0.0},
        {"radius": 0.1, "mass": 1.0, "arc": 1, "touching": "previous"},
    ]
    line = {"start_slope": 0.0, "arcs": [{"shape": "line", "length": 10.0}]}
    document = scene(line, balls, 1.0, "hedrih", time=STOP) | {"analysis": {"lyapunov": True}}
    for engine in ("compiled", "python"):
        rows = solve_any(document, engine).collisions
        np.testing.assert_allclose(rows["t"], [1.7, 1.7], rtol=1e-15)
        assert rows["simultaneous"].tolist() == [False, True]
        assert rows["smooth"].tolist() == [False, False]
