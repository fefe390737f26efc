"""Tangent maps of bodies on springs: against 50 digits, and results that are known exactly."""

from __future__ import annotations

import cmath
import math
from typing import Any

import mpmath
import numpy as np
import pytest

from tests.systems.springs_cases import FIGURE_FIVE, PRESSED, disk, solve, spring, springs
from tests.systems.tangent_cases import check_random_maps, follow
from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.scenario import any_scenario_of
from vibro_cli.stress.oracles.sensitivity import map_error
from vibro_cli.stress.scenes import Document, Plan
from vibro_cli.systems.springs import SYSTEM, stress

Floats = Any


def neighbours(document: Document, size: float = 1e-6) -> Floats:
    """Return the tangent map by differences of runs."""
    columns = []
    for number in range(len(document["balls"])):
        for name in ("position", "speed"):
            ends = []
            for by in (size, -size):
                balls = [dict(one) for one in document["balls"]]
                balls[number][name] += by
                ends.append(end_of(document | {"balls": balls}))
            columns.append((ends[0] - ends[1]) / (2.0 * size))
    return np.stack(columns, axis=1)


def end_of(document: Document) -> Floats:
    motion = solve(document).sample([document["stop"]["time"]])
    return np.stack([motion["x"], motion["speed"]], axis=1).ravel()


@pytest.mark.parametrize(("seed", "cases"), [(1, 4), pytest.param(2, 16, marks=pytest.mark.long)])
def test_scenes_drawn_at_random_agree_with_50_digits(
    seed: int, cases: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    check_random_maps(stress, Plan(seed=seed, full=False, cases=cases), 1e-12, monkeypatch)


def test_lasting_contact_that_opens_by_its_force_agrees_with_50_digits() -> None:
    balls = [
        disk(-0.5, 3.0, spring(5.0, 0.5, 1.0, 0.0)),
        disk(0.4, 1.0, spring(3.0, 0.5, 1.0, -0.2), mass=2.0),
    ]
    document = springs(balls, 0.0, time=6.0)
    found, columns, whole = follow(document)
    assert whole.logs["states"]["cause"][::2].tolist().count(3) >= 1
    assert columns["collisions"]["smooth"].all()
    assert np.isneginf(found.sums).sum() == 2
    error = map_error(document, stress.neighbours)
    assert error is not None
    assert error <= 1e-13


def test_lasting_contact_that_an_impact_ends_agrees_with_50_digits() -> None:
    balls = [disk(-1.5, 0.0, spring(5.0, 0.5, 1.0, 0.3)), *PRESSED[1:]]
    document = springs(balls, [1.0, 0.0], collisions=2, time=20.0)
    states = follow(document)[2].logs["states"][::3]
    assert states["cause"].tolist() == [0, 2, 1, 3]
    assert states["t"][2] == states["t"][3]
    error = map_error(document, stress.neighbours)
    assert error is not None
    assert error <= 1e-13


@pytest.mark.parametrize("k", [1.0, 0.9, 0.0])
def test_both_engines_give_the_same_bits(k: float) -> None:
    document = springs(FIGURE_FIVE, k, collisions=12, time=60.0)
    one, columns, _ = follow(document, "python")
    other, same, _ = follow(document)
    np.testing.assert_array_equal(one.matrix(), other.matrix())
    np.testing.assert_array_equal(one.sums, other.sums)
    for name, values in columns["collisions"].items():
        np.testing.assert_array_equal(values, same["collisions"][name])


@pytest.mark.parametrize("law", LAW_NAMES)
@pytest.mark.parametrize("k", [1.0, 0.999, 0.9])
def test_volumes_shrink_by_the_restitution_at_each_impact(law: str, k: float) -> None:
    balls = [FIGURE_FIVE[0], FIGURE_FIVE[1] | {"radius": 0.35}]
    document = springs(balls, collisions=40)
    document["collision"] = {"k": k, "law": law, "inadmissible": "normal-impulse"}
    found, _, whole = follow(document)
    rows = whole.logs["impacts"]
    parting = rows["v_b_post"] - rows["v_a_post"]
    closing = rows["v_a_pre"] - rows["v_b_pre"]
    expected = np.sum(np.log(k * parting / closing))
    if law != "hedrih":
        assert expected == pytest.approx(2.0 * len(rows) * math.log(k), abs=1e-12 * len(rows))
    assert len(rows) == 40
    assert np.sum(found.sums) == pytest.approx(expected, abs=1e-12 * len(rows))


def test_exponents_come_in_pairs_and_a_chaotic_run_has_one_above_zero() -> None:
    found, _, _ = follow(springs(FIGURE_FIVE, collisions=2000))
    exponents, error = found.growth.exponents()
    assert exponents[0] > 10.0 * error[0]
    np.testing.assert_allclose(exponents[:2], -exponents[:1:-1], atol=0.001)
    assert np.sum(found.sums) == pytest.approx(0.0, abs=1e-11)


def test_equal_bodies_on_equal_springs_only_exchange_their_motions() -> None:
    """At k = 1: exponents tend to zero as those of a body alone, whose map keeps the volume."""
    held = spring(6.0, 0.5, 1.0, 0.0)
    alone, _, _ = follow(springs([disk(0.9, 0.7, held)], time=4.0))
    assert np.linalg.det(alone.matrix()) == pytest.approx(1.0, abs=1e-14)
    wide = [
        disk(-1.3, 0.7, spring(6.0, 0.5, 1.0, -0.4)),
        disk(0.9, -0.4, spring(6.0, 0.5, 1.0, 0.4)),
    ]
    for impacts in (300, 3000):
        found, _, _ = follow(springs(wide, collisions=impacts))
        exponents, _ = found.growth.exponents(per_impact=True)
        assert abs(exponents[0]) < 1.5 * math.log(impacts) / impacts


@pytest.mark.parametrize(("k", "count"), [(0.5, 2), (0.0, 2), (0.0, 3)])
def test_lasting_contact_takes_the_gap_and_its_rate(k: float, count: int) -> None:
    """Also where bounces end in it, and where a body joins two in contact."""
    document = springs(PRESSED[:count], k, time=6.0)
    found, columns, whole = follow(document)
    assert whole.clock["contacts"] == count - 1
    assert not columns["collisions"]["smooth"].all() or (k, count) == (0.0, 2)
    matrix = found.matrix()
    np.testing.assert_allclose(matrix, neighbours(document), rtol=0.0, atol=1e-8)
    np.testing.assert_array_equal(matrix[2:], np.tile(matrix[:2], (count - 1, 1)))
    assert np.isneginf(found.sums).sum() == 2 * (count - 1)


@pytest.mark.parametrize("k", [[1.0, 0.0], [0.5, 0.0], [0.0, 0.0]])
@pytest.mark.parametrize("law", ["hedrih", "translational"])
def test_a_blow_on_bodies_in_contact_has_the_derivative_of_neighbouring_runs(
    k: list[float], law: str
) -> None:
    """Forces jump where contact is broken and closed again, at the instant of the blow."""
    balls = [disk(-2.5, 4.0, spring(5.0, 0.5, 1.0, -1.0)), *PRESSED[:2]]
    balls[1] = balls[1] | {"body": "ball"}
    document = springs(balls, time=1.5)
    document["collision"] = {"k": k, "law": law}
    found, columns, _ = follow(document)
    assert not columns["collisions"]["smooth"].all()
    np.testing.assert_allclose(found.matrix(), neighbours(document), rtol=0.0, atol=1e-8)


def test_joint_impacts_have_the_derivative_of_those_that_stay_joint() -> None:
    """Changes that are their own mirror image keep the impact of three bodies joint."""
    held = [spring(6.0, 0.5, 1.0, foot) for foot in (-1.5, 0.0, 1.5)]
    sides = [disk(-1.5, 2.0, held[0]), disk(0.0, 0.0, held[1]), disk(1.5, -2.0, held[2])]
    document = springs(sides, 0.7, time=1.0)
    found, columns, _ = follow(document)
    assert columns["collisions"]["smooth"].tolist()[:2] == [False, False]
    assert np.isfinite(columns["collisions"]["amplification"]).all()
    for name, vector in (("position", [1, 0, 0, 0, -1, 0]), ("speed", [0, 1, 0, 0, 0, -1])):
        ends = []
        for by in (1e-6, -1e-6):
            balls = [dict(one) for one in sides]
            balls[0][name] += by
            balls[2][name] -= by
            ends.append(end_of(document | {"balls": balls}))
        expected = (ends[0] - ends[1]) / 2e-6
        np.testing.assert_allclose(found.matrix() @ vector, expected, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize(
    ("length", "place"), [(0.6, 0.0), (5.0, 0.0), (5.0, math.sqrt(24.0))], ids=str
)
def test_at_a_singular_point_the_map_is_that_of_a_linear_oscillator(
    length: float, place: float
) -> None:
    """At the saddle (l > b, in the middle) vectors grow by 10^8, and volume is conserved."""
    held = spring(6.0, length, 1.0, 0.0)
    found, _, _ = follow(springs([disk(place, 0.0, held)], time=5.0))
    size = math.hypot(place, 1.0)
    square = 4.0 * (length / size**3 - 1.0)  # w0^2 = c/(kappa m) = 4
    rate = cmath.sqrt(square)
    cosh, sinh = cmath.cosh(5.0 * rate), cmath.sinh(5.0 * rate)
    exact = np.array([[cosh, sinh / rate], [sinh * rate, cosh]]).real
    assert (square > 0.0) == (np.max(np.abs(exact)) > 1e8)
    tolerance = 1e-13 * np.max(np.abs(exact))
    np.testing.assert_allclose(found.matrix(), exact, rtol=0.0, atol=tolerance)
    assert np.sum(found.sums) == pytest.approx(0.0, abs=1e-13)


def test_over_the_foot_of_a_spring_without_stress_the_map_agrees_with_30_digits() -> None:
    """There l = b and x = 0: the pull and its first two derivatives vanish."""
    held, speed, end = spring(6.0, 1.5, 1.5, 0.25), 0.8, 0.7
    with mpmath.workdps(30):
        square = mpmath.mpf(6) / mpmath.mpf("1.5")  # c/(kappa m) of a disk of 1 kg

        def flow(_: Any, y: Any) -> Any:
            length = mpmath.sqrt(y[0] ** 2 + mpmath.mpf("2.25"))
            slope = -square * (1 - mpmath.mpf("1.5") * mpmath.mpf("2.25") / length**3)
            pull = -square * y[0] * (length - mpmath.mpf("1.5")) / length
            return [y[1], pull, y[3], slope * y[2], y[5], slope * y[4]]

        found = mpmath.odefun(flow, 0, [0, mpmath.mpf(speed), 1, 0, 0, 1], tol=1e-22)(end)
        exact = np.array([[found[2], found[4]], [found[3], found[5]]], dtype=np.float64)
    ours, _, _ = follow(springs([disk(0.25, speed, held)], time=end))
    np.testing.assert_allclose(ours.matrix(), exact, rtol=0, atol=1e-14)


@pytest.mark.parametrize(("length", "time"), [(5.0, 3.0), (0.5, 20.0)], ids=["saddle", "centre"])
def test_a_motion_beside_a_singular_point_is_as_exact_as_its_map_says(
    length: float, time: float
) -> None:
    """The rounding of the energy, which is that of the spring, would show there."""
    document = springs([disk(1e-6, 0.0, spring(6.0, length, 1.0, 0.0))], time=time)
    found, _, whole = follow(document)
    start, leads = stress.neighbours(SYSTEM.build(any_scenario_of(document)), whole)
    error = end_of(document) - np.array([float(number) for number in leads(start)])
    most = np.max(np.abs(found.matrix())) * 2.0**-53 * 1e-6
    assert np.max(np.abs(error)) < 100.0 * most


def test_nothing_goes_on_from_an_impact_that_is_not_carried_out() -> None:
    balls = [
        disk(-1.0, 2.0, spring(5.0, 2.0, 1.0, 0.0)),
        disk(1.0, 1.2, spring(5.0, 2.0, 1.0, 0.0), radius=0.1),
    ]
    document = springs(balls, 0.3, collisions=3)
    run = solve(document | {"analysis": {"lyapunov": True}})
    assert run.end_cause == "inadmissible"
    assert np.isnan(run.collisions["amplification"][-1])
    assert not run.collisions["smooth"][-1]


def test_contact_from_the_start_has_no_derivative() -> None:
    """A gap, however small, would be bounces. The blow of another body then ends the contact."""
    balls = [
        disk(-0.4, 0.0, spring(5.0, 0.5, 1.0, 0.3)),
        disk(0.4, 0.0, spring(5.0, 0.5, 1.0, -0.3)),
    ]
    far = disk(2.5, -3.0, spring(5.0, 0.5, 1.0, 2.0))
    found, columns, whole = follow(springs([*balls, far], 1.0, time=3.0, collisions=1))
    assert whole.logs["states"]["cause"][::3].tolist() == [0, 2, 1, 3]
    assert columns["collisions"]["smooth"].tolist() == [False]
    assert np.isneginf(found.sums).sum() == 2
