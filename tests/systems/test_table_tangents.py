"""Tangent maps of balls on a table: against 50 digits, and results that are known exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.systems.table_cases import Document, ball, box, ellipse, particle, table
from tests.systems.tangent_cases import check_random_maps, follow
from vibro_cli.api import simulate
from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.scenario import any_scenario_of
from vibro_cli.stress.oracles.sensitivity import map_error
from vibro_cli.stress.scenes import Plan
from vibro_cli.systems.table import stress

ELLIPSE = ellipse(1.0, 0.8)
TWO = [ball(0.3, 0.1, 1.0, 0.3), ball(-0.3, 0.1, 0.5, 0.7, mass=2.0)]


@pytest.mark.parametrize("seed", [1, 2])
def test_scenes_drawn_at_random_agree_with_50_digits(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    check_random_maps(stress, Plan(seed=seed, full=False, cases=12), 1e-11, monkeypatch)


@pytest.mark.parametrize("shape", ["convex_outside", "circle_outside", "corner"])
def test_walls_met_from_outside_and_corners_agree_with_50_digits(shape: str) -> None:
    walls: dict[str, Document] = {
        "convex_outside": ELLIPSE | {"side": "outside", "k": 0.7},
        "circle_outside": {"shape": "circle", "radius": 0.9, "side": "outside", "k": 0.4},
        "corner": box(2.0, 1.6, 0.6, side="outside"),
    }
    start = ball(-3.0, 0.2, 1.0, 0.05) if shape != "corner" else ball(-3.0, -0.85, 1.0, 0.0)
    document = table([start], walls[shape], bounces=1, time=9.0)
    error = map_error(document, stress.neighbours)
    assert error is not None
    assert error < 1e-13


@pytest.mark.parametrize("law", LAW_NAMES)
@pytest.mark.parametrize("k", [1.0, 0.999, 0.9])
def test_volumes_shrink_by_the_restitution_at_each_impact(law: str, k: float) -> None:
    small = ball(-0.3, 0.1, 0.5, 0.7, radius=0.08, mass=2.0)
    wall = ELLIPSE | {"k": k}
    document = table([TWO[0], small], wall, k, collisions=12)
    document["collision"] |= {"law": law, "inadmissible": "normal-impulse"}
    found, _, whole = follow(document)
    rows, bounces = whole.logs["pair_log"], len(whole.logs["bounce_log"])
    parting = rows["normal_b_post"] - rows["normal_a_post"]
    closing = rows["normal_a_pre"] - rows["normal_b_pre"]
    expected = 2.0 * bounces * math.log(k) + np.sum(np.log(k * parting / closing))
    if law != "hedrih":
        total = 2.0 * (bounces + len(rows)) * math.log(k)
        assert expected == pytest.approx(total, abs=1e-12 * (bounces + len(rows)))
    assert len(rows) > 3
    assert bounces > 12
    assert np.sum(found.sums) == pytest.approx(expected, abs=1e-12 * (bounces + len(rows)))


def test_exponents_come_in_pairs_and_a_chaotic_run_has_one_above_zero() -> None:
    found, _, _ = follow(table(TWO, ELLIPSE, collisions=4000))
    exponents, error = found.growth.exponents()
    assert exponents[0] > 10.0 * error[0]
    assert exponents[0] > 0.4
    np.testing.assert_allclose(exponents[:4], -exponents[:3:-1], atol=0.002)
    assert np.sum(exponents) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    "wall",
    [
        {"shape": "circle", "radius": 1.0, "k": 1.0},
        ELLIPSE,
        box(2.0, 1.6),
    ],
    ids=["circle", "ellipse", "rectangle"],
)
def test_exponents_of_a_regular_motion_tend_to_zero(wall: Document) -> None:
    for bounces in (1000, 10000):
        run = table([particle(0.3, 0.1, 1.0, 0.4)], wall, bounces=bounces)
        found, _, _ = follow(run)
        exponents, _ = found.growth.exponents(per_impact=True)
        assert abs(exponents[0]) < 1.5 * math.log(bounces) / bounces
        assert np.sum(found.sums) == pytest.approx(0.0, abs=1e-12 * bounces)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("radius", [0.0, 0.15])
def test_a_bounce_along_an_axis_has_the_trace_of_its_chord(axis: int, radius: float) -> None:
    """Directions across the path turn round at a bounce: the trace is that of the mirror image."""
    a, b = (1.0, 0.8) if axis == 0 else (0.8, 1.0)
    chord, curvature = 2.0 * (a - radius), b * b / a - radius
    speeds = (1.0, 0.0) if axis == 0 else (0.0, 1.0)
    one = ball(0.0, 0.0, *speeds, radius=radius) if radius else particle(0.0, 0.0, *speeds)
    found, _, whole = follow(table([one], ELLIPSE, time=chord, bounces=9))
    assert len(whole.logs["bounce_log"]) == 1
    across = np.ix_([1 - axis, 3 - axis], [1 - axis, 3 - axis])
    trace = -float(np.trace(found.matrix()[across]))
    assert trace == pytest.approx(2.0 * (chord / curvature - 1.0), abs=1e-13)


def test_joint_impacts_have_the_derivative_of_those_that_stay_joint() -> None:
    """Changes that are their own mirror image keep the impact of three balls joint."""
    still = [ball(0.0, 0.12), ball(0.0, -0.12)]
    document = table([ball(-1.0, 0.0, 1.0, mass=2.0), *still], k=0.7, time=2.0)
    found, columns, _ = follow(document)
    assert columns["collisions"]["smooth"].tolist() == [False, False]
    assert np.isfinite(columns["collisions"]["amplification"]).all()
    changes: list[dict[tuple[int, str], float]] = [
        {(0, "velocity_x"): 1.0},
        {(1, "y"): 1.0, (2, "y"): -1.0},
        {(1, "velocity_y"): -1.0, (2, "velocity_y"): 1.0},
    ]
    names = ("x", "y", "velocity_x", "velocity_y")
    for change in changes:
        ends = []
        for size in (1e-6, -1e-6):
            balls = [dict(one) for one in document["balls"]]
            for (number, name), by in change.items():
                balls[number][name] += size * by
            motion = simulate(any_scenario_of(document | {"balls": balls})).sample([2.0])
            ends.append(np.stack([motion[name] for name in names], axis=1).ravel())
        vector = np.zeros(12)
        for (number, name), by in change.items():
            vector[4 * number + names.index(name)] = by
        np.testing.assert_allclose(
            found.matrix() @ vector, (ends[0] - ends[1]) / 2e-6, rtol=0.0, atol=2e-9
        )


def test_an_impact_without_restitution_takes_a_direction() -> None:
    """Balls touch without parting, at any time: seven of eight numbers are free."""
    found, columns, _ = follow(table(TWO, ELLIPSE, 0.0, collisions=1))
    assert columns["collisions"]["smooth"].tolist() == [True]
    assert np.isneginf(found.sums).sum() == 1
    values = np.linalg.svd(found.matrix(), compute_uv=False)
    assert values[6] > 0.1
    assert values[7] < 1e-14


def test_nothing_goes_on_from_an_impact_that_is_not_carried_out() -> None:
    balls = [ball(-1.0, 0.0, 1.0, radius=0.2), ball(0.0, 0.0, 0.6, radius=0.08)]
    document = table(balls, k=0.6, collisions=3)
    run = simulate(any_scenario_of(document | {"analysis": {"lyapunov": True}}))
    assert run.end_cause == "inadmissible"
    assert np.isnan(run.collisions["amplification"]).all()
    assert not run.collisions["smooth"].any()


def test_the_second_of_two_impacts_of_a_ball_at_one_instant_has_no_derivative() -> None:
    corner = table([ball(0.0, 0.0, 1.0, 1.0, radius=0.125)], box(2.0, 2.0), bounces=3)
    _, columns, whole = follow(corner)
    assert whole.logs["bounce_log"]["t"][0] == whole.logs["bounce_log"]["t"][1]
    assert columns["bounces"]["smooth"].tolist() == [False, False, True]


@pytest.mark.parametrize("speed", [0.83, 1.0, 1.3])
def test_a_wall_that_holds_what_comes_takes_two_directions(speed: float) -> None:
    """After it neither the place across it nor that speed tells of the start: rank 2 of 4."""
    document = table([ball(0.37, 0.2, speed, -0.45)], box(4.0, 3.0, 0.0), time=3.0)
    run = simulate(any_scenario_of(document | {"analysis": {"lyapunov": True}}))
    record = run.summary_record()
    assert record["bounces"] == 1
    found = [record[f"lyapunov_{number}"] for number in (1, 2, 3, 4)]
    assert found[:2] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert found[2:] == [None, None]  # -inf
