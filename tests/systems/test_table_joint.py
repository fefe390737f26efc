"""Several pairs of balls that close at one instant: solved jointly, in no order."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tests.systems.table_cases import Document, ball, solve, table

R = 0.1
HEXAGON = [
    (2.0 * R * math.cos(n * math.pi / 3), 2.0 * R * math.sin(n * math.pi / 3)) for n in range(6)
]


def triangle(rows: int) -> list[tuple[int, int]]:
    """Rows along x of touching balls: number of the row, radii from the axis."""
    return [(row, 2 * n - row) for row in range(rows) for n in range(row + 1)]


def racked(rows: int, radius: float = R, mass: float = 1.0) -> list[Document]:
    """Return the balls of a triangle at rest, with its corner at the origin."""
    return [
        ball(row * math.sqrt(3.0) * radius, across * radius, radius=radius, mass=mass)
        for row, across in triangle(rows)
    ]


def rack(rows: int, k: float = 1.0, law: str = "hedrih", **stop: Any) -> Document:
    """Return a ball moving along x towards the corner of a triangle of touching balls."""
    balls = [ball(-1.0, 0.0, 2.0), *racked(rows)]
    document = table(balls, k=k, **(stop or {"time": 3.0}))
    document["collision"]["law"] = law
    return document


def jointly(document: Document, impulses_of: Any) -> Any:
    """Return velocities after all touching, closing pairs are solved by least squares."""
    balls = document["balls"]
    place = np.array([[b["x"], b["y"]] for b in balls])
    velocity = np.array([[b["velocity_x"], b["velocity_y"]] for b in balls])
    mass = np.array([1.4 * b["mass"] for b in balls])
    rows = []
    for a in range(len(balls)):
        for b in range(a + 1, len(balls)):
            d = place[b] - place[a]
            size = float(np.hypot(*d))
            touch = 2.0 * math.sqrt(balls[a]["radius"] * balls[b]["radius"])
            row = np.zeros((len(balls), 2))
            row[a], row[b] = d / size, -d / size
            if abs(size - touch) < 1e-12 and np.sum(row * velocity) > 1e-12:
                rows.append(row.ravel())
    matrix = np.array(rows)
    closing = (1.0 + document["collision"]["k"]) * (matrix @ velocity.ravel())
    # The least change, measured by its energy; the squares of this matrix would lose digits.
    root = np.sqrt(np.repeat(1.0 / mass, 2))
    change = root * np.linalg.lstsq(root * matrix, closing, rcond=1e-12)[0]
    impulses_of(len(rows))
    return velocity - change.reshape(-1, 2)


RACKS = {
    "a rounded approach has a mirror image": (
        5,
        0.16272936192574217,
        0.6387442614861839,
        1.513383447658014,
        0.08388403479664386,
    ),
    "a pair passes by within rounding": (
        5,
        0.13096954338186415,
        0.19365661453091446,
        0.4737256326868028,
        0.371842847474254,
    ),
    "another pair passes by": (
        4,
        0.09424348319470706,
        0.28612377609323625,
        1.395723434214892,
        0.09850361438808708,
    ),
    "a pair parts already when it grazes": (
        4,
        0.1496467084816438,
        1.8461379954527986,
        1.478648489719417,
        0.12305101139215036,
    ),
}
"""Rows, radius, masses of the balls at rest and of the one that comes, k."""


@pytest.mark.parametrize("case", RACKS)
def test_the_break_of_a_rack_with_little_bounce_stays_symmetric_and_admissible(case: str) -> None:
    rows, radius, mass, coming, k = RACKS[case]
    balls = [ball(-1.0, 0.0, 1.0, radius=radius, mass=coming), *racked(rows, radius, mass)]
    run = solve(table(balls, k=k, time=5.0))
    assert run.end_cause == "time"
    # Simultaneous impacts take in what is as near as 16 units in the last place, of places to 2 m.
    assert np.max(np.abs(run.collisions["gap"])) <= 1e-14
    final = run.sample([5.0])
    places = triangle(rows)
    mirror = [0, *(1 + places.index((row, -across)) for row, across in places)]
    for name, sign in (("x", 1.0), ("y", -1.0), ("velocity_x", 1.0), ("velocity_y", -1.0)):
        assert np.array_equal(final[name], sign * final[name][mirror])


@pytest.mark.parametrize(
    ("x", "speed", "radius", "across"),
    [
        (1.8590624786635572, 3.7597679680147422, 0.17237803311822986, 0.3447560662364597),
        (0.8377412625560281, 2.9695068587181024, 0.1, 0.19999999999999998),
        (1.4057698762114228, 1.8445580151562055, 0.1312114975445247, 0.2624229950890494),
    ],
)
def test_a_ball_that_just_touches_two_on_its_way_between_them_hits_both(
    x: float, speed: float, radius: float, across: float
) -> None:
    # The approach of both pairs is below rounding, but the same: neither is left out.
    places = [(0.0, 0.0, speed), (x, across), (x, -across)]
    run = solve(table([ball(*place, radius=radius) for place in places], k=0.5, time=10.0))
    hits = run.collisions
    assert len(hits["t"]) == 2
    assert hits["t"][0] == hits["t"][1]
    assert hits["simultaneous"].all()
    final = run.sample([10.0])
    assert final["velocity_y"][0] == 0.0
    assert final["velocity_y"][1] == -final["velocity_y"][2] != 0.0


@pytest.mark.parametrize("k", [1.0, 0.7, 0.0])
def test_a_ball_hits_two_that_touch(k: float) -> None:
    """From the middle: v' = (1 - 6 (1 + k)/10), the others (1 + k) 3/10 along x each."""
    balls = [ball(-1.0, 0.0, 1.0), ball(0.0, R), ball(0.0, -R)]
    run = solve(table(balls, k=k, time=5.0))
    final = run.sample([5.0])
    x, y = final["velocity_x"], final["velocity_y"]
    assert list(run.collisions["simultaneous"]) == [True, True]
    assert abs(x[0] - (1.0 - 0.6 * (1.0 + k))) <= 2e-16
    assert abs(x[1] - 0.3 * (1.0 + k)) <= 2e-16
    assert (x[1], y[0], y[1]) == (x[2], 0.0, -y[2])
    if k == 1.0:
        assert abs(run.summary_record()["energy_drift"]) <= 4e-16
        assert np.all(run.collisions["energy_loss"] == 0.0)
    lost = run.summary_record()["energy_start"] - run.summary_record()["energy_end"]
    assert abs(float(np.sum(run.collisions["energy_loss"])) - lost) <= 4e-16


@pytest.mark.parametrize("k", [1.0, 0.6, 0.0])
@pytest.mark.parametrize("masses", ["equal", "unequal"])
def test_against_least_squares(k: float, masses: str) -> None:
    """Six balls close in on one, and a ring that closes around it: redundant contacts."""
    rng = np.random.default_rng(3)
    balls = [ball(0.0, 0.0)]
    for n, (x, y) in enumerate(HEXAGON):
        speed = 0.3 if n % 2 else 1.0
        balls.append(ball(x, y, -speed * x / R + 0.1 * y, -speed * y / R - 0.1 * x))
    for one in balls:
        one["mass"] = 1.0 if masses == "equal" else float(rng.uniform(0.2, 5.0))
    document = table(balls, k=k, collisions=1)
    pairs: list[int] = []
    expected = jointly(document, pairs.append)
    run = solve(document)
    assert len(run.collisions["n"]) == pairs[0] > 6
    assert np.all(run.collisions["t"] == 0.0)
    final = run.sample([0.0])
    found = np.column_stack([final["velocity_x"], final["velocity_y"]])
    assert np.max(np.abs(found - expected)) <= 1e-14


@pytest.mark.parametrize("k", [1.0, 0.9, 0.2])
@pytest.mark.parametrize("law", ["hedrih", "normal-impulse"])
def test_the_break_of_a_rack_is_its_own_mirror_image(k: float, law: str) -> None:
    run = solve(rack(5, k, law))
    state = run.sample(np.linspace(0.0, 3.0, 61))
    table = {name: state[name].reshape(61, -1) for name in ("x", "y", "velocity_x", "velocity_y")}
    assert np.all(table["y"][:, 0] == 0.0)
    first = 1
    for row in range(5):
        own = np.arange(first, first + row + 1)
        assert np.array_equal(table["x"][:, own], table["x"][:, own[::-1]])
        assert np.array_equal(table["y"][:, own], -table["y"][:, own[::-1]])
        assert np.array_equal(table["velocity_y"][:, own], -table["velocity_y"][:, own[::-1]])
        first += row + 1
    assert run.end_cause == "time"
    assert abs(float(np.sum(table["velocity_x"][-1])) - 2.0) <= 2e-15
    record = run.summary_record()
    if k == 1.0:
        assert abs(record["energy_drift"]) <= 1e-15
    else:
        lost = record["energy_start"] - record["energy_end"]
        assert abs(float(np.sum(run.collisions["energy_loss"])) - lost) <= 1e-13


@pytest.mark.parametrize(("impact", "touching"), [(0, 18 + 1), (-1, 1)])
def test_no_pair_closes_after_the_break(impact: int, touching: int) -> None:
    """Neither of the triangle and the ball that breaks it, nor of the last two that collide."""
    run = solve(rack(4, 0.2))
    state = run.sample([float(run.collisions["t"][impact]) + 1e-9], extrapolate=True)
    place = np.column_stack([state["x"], state["y"]])
    velocity = np.column_stack([state["velocity_x"], state["velocity_y"]])
    rates = []
    for a in range(len(place)):
        for b in range(a + 1, len(place)):
            d = place[b] - place[a]
            if np.hypot(*d) < 2.0 * R + 1e-8:
                rates.append(float(d @ (velocity[b] - velocity[a])) / np.hypot(*d))
    assert len(rates) == touching
    assert min(rates) >= -1e-14


def test_the_order_of_the_balls_does_not_matter() -> None:
    document = rack(3)
    order = np.random.default_rng(1).permutation(len(document["balls"]))
    other = {**document, "balls": [document["balls"][n] for n in order]}
    one, two = (solve(each).sample([3.0]) for each in (document, other))
    for name in ("x", "y", "velocity_x", "velocity_y"):
        assert np.array_equal(one[name][order], two[name])


def test_both_engines_give_the_same_bits() -> None:
    document = rack(5, 0.3)
    one, two = solve(document, "python"), solve(document)
    for column, values in one.collisions.items():
        np.testing.assert_array_equal(values, two.collisions[column], column)


def test_a_cradle_on_a_table_hands_on_what_comes() -> None:
    balls = [ball(-1.0 - 0.2 * n, 0.0, 1.0) for n in (1, 0)]
    balls += [ball(0.2 * n, 0.0) for n in range(4)]
    run = solve(table(balls, time=5.0))
    assert np.allclose(run.sample([5.0])["velocity_x"], [0, 0, 0, 0, 1, 1], atol=1e-15)


def test_an_inadmissible_group_stops_or_is_substituted() -> None:
    """A large ball overtakes two small ones that it hits together."""
    small = 0.05
    apart = 2.0 * math.sqrt(0.2 * small)
    x = -math.sqrt(apart**2 - small**2)
    balls = [ball(x - 1.0, 0.0, 1.0, radius=0.2)]
    balls += [ball(0.0, sign * small, 0.7, radius=small, mass=0.1) for sign in (1, -1)]
    document = table(balls, k=0.5, time=10.0)
    run = solve(document)
    assert run.end_cause == "inadmissible"
    assert list(run.collisions["admissible"]) == [False, False]
    assert run.sample([run.end_time])["velocity_x"][0] == 1.0  # nothing was carried out
    document["collision"]["inadmissible"] = "normal-impulse"
    run = solve(document)
    assert list(run.collisions["substituted"][:2]) == [True, True]
    assert set(run.collisions["law"][:2]) == {"normal-impulse"}
    assert np.all(run.collisions["separation_speed"][:2] >= 0.0)
    final = run.sample([run.end_time])
    assert final["velocity_x"][1] == final["velocity_x"][2]


@pytest.mark.parametrize(("rings", "seed"), [(3, 2), (4, 3), (5, 1)])
def test_a_pack_that_collapses_plastically_against_a_projection(rings: int, seed: int) -> None:
    """Contacts are redundant there: the velocities are those before, projected by numpy."""
    span = range(-rings, rings + 1)
    cells = [(q, r) for q in span for r in span if abs(q + r) <= rings]
    places = [(2.0 * R * (q + r / 2.0), math.sqrt(3.0) * R * r) for q, r in cells]
    shaken = np.random.default_rng(seed).normal(0.0, 0.1, (len(places), 2))
    before = shaken - np.array(places)
    balls = [ball(*place, *speed) for place, speed in zip(places, before.tolist(), strict=True)]
    document = table(balls, k=0.0, collisions=1)
    rows = solve(document).collisions
    assert rows["admissible"].all()
    gaps = np.zeros((len(rows["n"]), 2 * len(balls)))
    for row, (a, b) in enumerate(zip(rows["ball_a"] - 1, rows["ball_b"] - 1, strict=True)):
        normal = np.array(
            [math.cos(rows["normal_angle"][row]), math.sin(rows["normal_angle"][row])]
        )
        gaps[row, 2 * a : 2 * a + 2], gaps[row, 2 * b : 2 * b + 2] = -normal, normal
    speeds = before.ravel()
    assert ((gaps @ speeds) < 0.0).all()
    impulses = np.linalg.lstsq(gaps @ gaps.T, -gaps @ speeds, rcond=1e-10)[0]
    after = (speeds + gaps.T @ impulses).reshape(-1, 2)
    for end in "ab":
        for axis, name in enumerate("xy"):
            found = rows[f"velocity_{name}_{end}_post"]
            assert found == pytest.approx(after[rows[f"ball_{end}"] - 1, axis], abs=2e-14)
