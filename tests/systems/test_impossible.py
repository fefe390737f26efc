"""Impossible tables and springs are refused, each with its place."""

from __future__ import annotations

from typing import Any

import pytest

from tests.systems import springs_cases
from tests.systems.springs_cases import disk, spring, springs
from tests.systems.table_cases import Document, ball, box, ellipse, particle, solve, table
from vibro_cli.api import simulate
from vibro_cli.kernels.springs import loop
from vibro_cli.scenario import ScenarioError
from vibro_cli.scenario.loading import any_scenario_of
from vibro_cli.systems import driver

BOW = {"shape": "polygon", "corners": [[0, 0], [1, 1], [1, 0], [0, 1]], "k": 1.0}
HELD = spring(6.0, 5.0, 1.0, 0.0)

CASES: dict[str, tuple[Document, str, str]] = {
    "into the ellipse": (
        table([ball(1.95, 0.0)], ellipse(2.0, 1.2), time=1.0), "balls[1].x", "into",
    ),
    "on the wrong side": (
        table([ball(0.0, 0.0)], ellipse(2.0, 1.2, side="outside"), time=1.0), "balls[1].x", "into",
    ),
    "too large for the ends": (
        table([ball(0.0, 0.0, radius=0.8)], ellipse(2.0, 1.2), time=1.0), "balls[1].radius", "0.8",
    ),
    "into a side": (table([ball(1.0, 0.95)], box(3.0, 2.0), time=1.0), "balls[1].x", "into"),
    "overlapping": (
        table([ball(0.0, 0.0), ball(0.1, 0.0)], time=1.0), "balls[2].x", "that overlap by 0.1",
    ),
    "a bow": (table([particle(0.5, 0.1, 0.0, 0.0)], BOW, time=1.0), "wall.corners", "meet"),
    "out of order": (
        springs([disk(1.0, 0.0, HELD), disk(0.0, 0.0, HELD)], time=1.0),
        "balls[2].position", "left",
    ),
    "over a small one": (
        springs(
            [
                disk(0.0, 0.0, HELD),
                disk(1.0, 0.0, HELD, radius=0.01),
                disk(2.0, 0.0, HELD),
            ],
            time=1.0,
        ),
        "balls[2].radius", "0.01",
    ),
    "beyond doubles": (
        springs([disk(0.0, 1e200, HELD)], time=1.0), "balls[1].speed", "1e+200",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_what_is_impossible_is_refused_with_its_place(name: str) -> None:
    document, path, found = CASES[name]
    run: Any = springs_cases.solve if document["system"] == "springs" else solve
    with pytest.raises(ScenarioError) as caught:
        run(document)
    assert [problem.path for problem in caught.value.problems] == [path]
    assert found in caught.value.problems[0].found


@pytest.mark.parametrize(
    ("corners", "path", "expected"),
    [
        ([[0, 0], [1, 0]], "wall.corners", "a list of at least 3"),
        ([[0, 0, 1], [1, 0], [1, 1]], "wall.corners[1]", "a list of at most 2"),
        ([[0, 0], [1], [1, 1]], "wall.corners[2]", "a list of at least 2"),
    ],
)
def test_a_polygon_has_three_corners_of_two_coordinates(
    corners: list[list[float]], path: str, expected: str
) -> None:
    with pytest.raises(ScenarioError) as caught:
        solve(table([particle(0.5, 0.1, 0.0, 0.0)], {**BOW, "corners": corners}, time=1.0))
    (problem,) = caught.value.problems
    assert (problem.path, problem.expected) == (path, expected)


def test_nothing_to_meet() -> None:
    assert solve(table([ball(0.0, 0.0, 1.0)], time=3.0)).sample([3.0])["x"][0] == 3.0
    assert solve(table([ball(0.0, 0.0, 1.0)], collisions=3)).end_cause == "no_more_collisions"
    assert (
        solve(table([ball(0.0, 0.0)], box(3.0, 2.0), bounces=3)).end_cause == "no_more_collisions"
    )
    lone = springs_cases.solve(springs([disk(5.0, 1.0, HELD)], time=3.0))
    assert lone.end_cause == "time"
    assert lone.sample([0.0, 3.0])["energy"] == pytest.approx([lone.summary["energy_start"][0]] * 2)


def test_touching_balls_start_in_contact() -> None:
    balls = [
        disk(-0.8, 1.0, spring(6.0, 0.5, 1.0, 0.0)),
        disk(0.0, 0.0, spring(6.0, 0.5, 1.0, 0.1)),
    ]
    del balls[1]["position"]
    balls[1]["touching"] = "previous"
    run = springs_cases.solve(springs(balls, 1.0, collisions=1))
    assert run.collisions["t"][0] == 0.0


@pytest.mark.parametrize(("stop", "told"), [({"time": 9.0}, "9 s"), ({}, "not given")])
def test_steps_without_end_are_refused_with_the_period_of_the_fastest_spring(
    monkeypatch: pytest.MonkeyPatch, stop: Document, told: str
) -> None:
    """Of a disk of 1e-20 kg on 6 N/m: ω₀ = √(c/(1.5 m)) = 2e10 1/s."""
    monkeypatch.setattr(loop, "MOST_STEPS", 3)
    balls = [disk(-4.0, 8.5e10, HELD, mass=1e-20), disk(7.0, -2.0, spring(9.0, 5.0, 1.5, 3.0))]
    words = f"fastest spring has the period 2 π/ω₀ = 3.14e-10 s, stop.time is {told}"
    with pytest.raises(driver.TooQuiet, match=words):
        springs_cases.solve(springs(balls, collisions=5, **stop), "python")


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_a_ball_that_meets_no_other_is_not_followed_for_ever(
    monkeypatch: pytest.MonkeyPatch, engine: str
) -> None:
    monkeypatch.setattr(driver, "QUIET_ROWS", 4000)
    lone = [ball(0.3, 0.1, 0.9, 0.7)]
    with pytest.raises(driver.TooQuiet, match="among the last 4,000 impacts on the wall"):
        simulate(any_scenario_of(table(lone, box(3.0, 2.0), collisions=1)), engine)
    bounded = simulate(any_scenario_of(table(lone, box(3.0, 2.0), bounces=40_000)), engine)
    assert bounded.end_cause == "bounces"
