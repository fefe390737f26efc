"""Balls on a table: laws of impacts, walls, the order of events, against 50 digits and theorems."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import combinations
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from matplotlib.path import Path
from numpy.typing import NDArray

from tests.effort import calls
from tests.highprecision import table as twin
from tests.systems.table_cases import Document, ball, box, ellipse, particle, solve, table
from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.scenario import ScenarioError, any_scenario_of
from vibro_cli.systems.run import Run
from vibro_cli.systems.table.portrait import focal_product
from vibro_cli.systems.table.system import (
    ELLIPSE,
    Wall,
    distance_to_wall,
    time_scale,
    wrong_with_polygon,
)
from vibro_cli.systems.table.tables import Bounces

EPSILON = 2.0**-52


def events(run: Run) -> list[tuple[float, tuple[int, ...], list[tuple[float, ...]]]]:
    """Return time, balls, and the positions and velocities after every event, in order."""
    found = []
    table = run.collisions
    for row in range(len(table["n"])):
        balls = tuple(int(table[f"ball_{end}"][row]) - 1 for end in "ab")
        states = [
            tuple(
                float(table[name][row])
                for name in (
                    f"x_{end}", f"y_{end}", f"velocity_x_{end}_post", f"velocity_y_{end}_post",
                )
            )
            for end in "ab"
        ]  # fmt: skip
        found.append((float(table["t"][row]), balls, states))
    table = run.bounces
    names = ("x", "y", "velocity_x_post", "velocity_y_post")
    for row in range(len(table["n"])):
        state = tuple(float(table[name][row]) for name in names)
        found.append((float(table["t"][row]), (int(table["ball"][row]) - 1,), [state]))
    return sorted(found, key=lambda event: event[0])


def twins_of(document: Document) -> list[twin.Ball]:
    return [
        twin.ball(
            b["radius"], b["mass"] * (1.0 if b.get("body") == "particle" else 1.4),
            (b["x"], b["y"]), (b["velocity_x"], b["velocity_y"]),
        )
        for b in document["balls"]
    ]  # fmt: skip


L_SHAPE = [[-1.2, -1.0], [1.2, -1.0], [1.2, 0.1], [0.2, 0.1], [0.2, 1.1], [-1.2, 1.1]]
RECTANGLE = [[-1.0, -0.7], [1.0, -0.7], [1.0, 0.7], [-1.0, 0.7]]
KITE = [[-0.9, 0.1], [0.1, -0.7], [0.8, 0.2], [0.0, 0.6]]
"""Corners of a room with one that points at the balls, and of an obstacle."""


SQUARE = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]


def polygon(corners: list[list[float]], k: float, side: str = "inside") -> Document:
    return {"shape": "polygon", "corners": corners, "k": k, "side": side}


def coming(obstacle: Document) -> Document:
    """Return fourteen balls that arrive from all around, and meet an obstacle and one another."""
    angles = [0.449 * n + 0.02 * (n % 3) for n in range(14)]
    balls = []
    for n, f in enumerate(angles):
        away = 2.2 + 0.3 * (n % 4) + 0.01 * n
        motion = -math.cos(f + 0.1), -math.sin(f + 0.1)
        balls.append(ball(away * math.cos(f), away * math.sin(f), *motion, mass=1.0 + 0.3 * n))
    return table(balls, obstacle, k=0.95, collisions=10, bounces=10)


CASES: dict[str, tuple[Document, Any]] = {
    "circle": (
        table([ball(0.3, 0.1, 0.9, 0.7)], {"shape": "circle", "radius": 1.5, "k": 0.9}, bounces=10),
        twin.Circle(1.5, 0.9),
    ),
    "rectangle": (
        table([ball(0.3, 0.1, 0.9, 0.7)], box(2.0, 1.4, 0.9), bounces=10),
        twin.Polygon(RECTANGLE, 0.9),
    ),
    "polygon": (
        table([ball(-0.5, -0.1, 0.9, 0.7)], polygon(L_SHAPE, 0.98), bounces=12),
        twin.Polygon(L_SHAPE, 0.98),
    ),
    "polygon, r = 0": (
        table([particle(-0.5, -0.1, 0.9, 0.7)], polygon(L_SHAPE, 1.0), bounces=10),
        twin.Polygon(L_SHAPE, 1.0),
    ),
    "ellipse, from outside": (
        coming(ellipse(1.0, 0.6, 0.9, side="outside")),
        twin.Ellipse(1.0, 0.6, 0.9, "outside"),
    ),
    "circle, from outside": (
        coming({"shape": "circle", "radius": 0.7, "k": 0.9, "side": "outside"}),
        twin.Circle(0.7, 0.9, "outside"),
    ),
    "rectangle, from outside": (
        coming(box(1.2, 0.8, 0.9, side="outside")),
        twin.Polygon([[-0.6, -0.4], [0.6, -0.4], [0.6, 0.4], [-0.6, 0.4]], 0.9),
    ),
    "polygon, from outside": (
        coming(polygon(KITE, 0.9, "outside")),
        twin.Polygon(KITE, 0.9),
    ),
    "ellipse, r = 0.1": (
        table([ball(0.3, 0.1, 0.9, 0.7)], ellipse(2.0, 1.2, 0.97), bounces=10),
        twin.Ellipse(2.0, 1.2, 0.97),
    ),
    "ellipse, r = 0": (
        table([particle(0.3, -0.2, -0.4, 0.9)], ellipse(1.0, 1.7), bounces=10),
        twin.Ellipse(1.0, 1.7, 1.0),
    ),
    "box, three unequal balls": (
        table(
            [
                ball(-0.6, 0.05, 1.3, 0.2, radius=0.12, mass=2.0),
                ball(0.1, 0.1, 0.0, -0.3, radius=0.11),
                ball(0.55, -0.2, -0.6, 0.5, radius=0.115, mass=1.7),
            ],
            box(2.0, 1.4, 0.9), k=0.95, collisions=10, bounces=10,
        ),
        twin.Polygon(RECTANGLE, 0.9),
    ),
    "ellipse, two balls": (
        table(
            [ball(-0.6, 0.05, 1.3, 0.2), ball(0.4, 0.1, 0.2, -0.3, mass=2.0)],
            ellipse(1.5, 1.0), collisions=10, bounces=10,
        ),
        twin.Ellipse(1.5, 1.0, 1.0),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_the_first_ten_impacts_against_fifty_digits(name: str) -> None:
    document, wall = CASES[name]
    found = events(solve(document))[:10]
    exact = twin.run(twins_of(document), wall, document.get("collision", {}).get("k", 1.0), 10)
    assert len(found) == 10
    for (t, balls, states), event in zip(found, exact, strict=True):
        assert balls == event.balls
        assert abs(t - event.t) <= 1e-12 * event.t
        for state, place, velocity in zip(states, event.places, event.velocities, strict=True):
            # Relative: to the distances of the scene, and to the speed.
            speed = float(twin.mp.sqrt(velocity[0] ** 2 + velocity[1] ** 2))
            for value, known in zip(state, (*place, *velocity), strict=True):
                assert abs(value - known) <= 1e-12 * min(1.0, max(speed, 0.1))


# Of components after an impact, relative to the fastest. Across the line of centres none changes.
# Along it the normal, the impulse and the sums have some fifteen roundings, which an impact that
# turns a ball round doubles: at most 1.7e-15 where the same formulas were evaluated for two million
# scenes of each law. The median of runs is an eighth of it.
TANGENTIAL_ROUNDING = 1e-15
NORMAL_ROUNDING = 2e-15
TYPICAL_ROUNDING = 2.5e-16


@given(
    angle=st.floats(-1.2, 1.2),
    radii=st.tuples(st.floats(0.05, 0.2), st.floats(0.05, 0.2)),
    masses=st.tuples(st.floats(0.1, 10.0), st.floats(0.1, 10.0)),
    k=st.floats(0.0, 1.0),
    law=st.sampled_from(LAW_NAMES),
)
@example(0.0, (0.13262284589506762, 0.1522211404749953), (1.0, 0.25), 0.5, "hedrih")
@settings(deadline=None)
def test_a_law_acts_along_the_line_of_centres(
    angle: float, radii: tuple[float, float], masses: tuple[float, float], k: float, law: str
) -> None:
    normal, tangential = law_errors(angle, radii, masses, k, law)
    assert normal <= NORMAL_ROUNDING
    assert tangential <= TANGENTIAL_ROUNDING


@pytest.mark.parametrize("law", LAW_NAMES)
def test_a_typical_impact_has_a_few_roundings(law: str) -> None:
    rng = np.random.default_rng(20261125)
    normals = [
        law_errors(
            rng.uniform(-0.8, 0.8), tuple(rng.uniform(0.05, 0.2, 2)),
            tuple(rng.uniform(0.1, 10.0, 2)), rng.uniform(), law,
        )[0]
        for _ in range(200)
    ]  # fmt: skip
    assert all(normals)  # all of them meet
    assert np.median(normals) <= TYPICAL_ROUNDING


def law_errors(
    angle: float, radii: tuple[float, ...], masses: tuple[float, ...], k: float, law: str
) -> tuple[float, float]:
    """Largest errors along and across the line of centres, of the fastest; 0 if the balls miss."""
    touch = 2.0 * math.sqrt(radii[0] * radii[1])
    first = ball(0.0, 0.0, 1.0, 0.3, radius=radii[0], mass=masses[0])
    x, y = 1.01 * touch * math.cos(angle), 1.01 * touch * math.sin(angle)
    second = ball(x, y, -0.4, 0.1, radius=radii[1], mass=masses[1])
    document = table([first, second], k=k, collisions=1)
    document["collision"] |= {"law": law, "inadmissible": "normal-impulse"}
    run = solve(document)
    if not len(run.collisions["n"]):
        return 0.0, 0.0
    row = {name: values[0] for name, values in run.collisions.items()}
    fast = fastest(row)
    errors: list[list[float]] = [[], []]
    for end, exact in exact_components(row, radii, masses, k).items():
        for n, name in enumerate(("normal", "tangential")):
            errors[n].append(float(abs(component(row, end, "post", name) - exact[n])) / fast)
        errors[0].append(float(abs(row[f"normal_speed_{end}_post"] - exact[0])) / fast)
        errors[1].append(float(abs(row[f"tangential_speed_{end}"] - exact[1])) / fast)
    return max(errors[0]), max(errors[1])


def component(row: dict[str, Any], end: str, when: str, name: str) -> Any:
    """Return the component of a velocity along or across the line of centres, to 50 digits."""
    d = [twin.number(row[f"{a}_b"]) - twin.number(row[f"{a}_a"]) for a in "xy"]
    size = twin.mp.sqrt(d[0] ** 2 + d[1] ** 2)
    v = [twin.number(row[f"velocity_{a}_{end}_{when}"]) for a in "xy"]
    along = (v[0] * d[0] + v[1] * d[1]) / size
    return along if name == "normal" else (v[1] * d[0] - v[0] * d[1]) / size


def fastest(row: dict[str, Any]) -> float:
    """Return the greatest speed before and after an impact."""
    return max(
        math.hypot(*(row[f"velocity_{a}_{end}_{when}"] for a in "xy"))
        for end in "ab"
        for when in ("pre", "post")
    )


def exact_components(
    row: dict[str, Any], radii: tuple[float, ...], masses: tuple[float, ...], k: float
) -> dict[str, tuple[Any, Any]]:
    """Components along and across the line of centres after the law of a row, to 50 digits."""
    r, m = [twin.number(v) for v in radii], [twin.number(v) * 7 / 5 for v in masses]
    inclined = 2 * twin.mp.sqrt(r[0] * r[1]) / (r[0] + r[1])
    weights = {
        "hedrih": [1 / v for v in r],
        "translational": [twin.mp.one, twin.mp.one],
        "normal-impulse": [inclined, inclined],
    }[row["law"]]
    before = [component(row, end, "pre", "normal") for end in "ab"]
    if row["law"] == "translational":
        m = [v * 5 / 7 for v in m]
    relative = weights[0] * before[0] - weights[1] * before[1]
    impulse = (
        (1 + twin.number(k)) * relative / sum(q * q / v for q, v in zip(weights, m, strict=True))
    )
    signs = (-1, 1)
    return {
        end: (
            before[n] + signs[n] * impulse * weights[n] / m[n],
            component(row, end, "pre", "tangential"),
        )
        for n, end in enumerate("ab")
    }


def test_of_two_equal_balls_the_one_at_rest_leaves_at_a_right_angle() -> None:
    run = solve(table([ball(-1.0, 0.07, 1.0), ball(0.0, 0.0)], collisions=1))
    row = {name: values[0] for name, values in run.collisions.items()}
    product = sum(row[f"velocity_{a}_a_post"] * row[f"velocity_{a}_b_post"] for a in "xy")
    assert abs(product) <= 1e-15
    assert row["energy_loss"] == 0.0


def test_balls_of_unequal_radii_touch_at_twice_the_geometric_mean() -> None:
    first, second = ball(-1.0, 0.0, 1.0, radius=0.2), ball(0.0, 0.0, radius=0.05, mass=3.0)
    document = table([first, second], collisions=1)
    document["collision"]["law"] = "normal-impulse"
    run = solve(document)
    apart = run.collisions["x_b"][0] - run.collisions["x_a"][0]
    assert abs(apart - 2.0 * math.sqrt(0.2 * 0.05)) <= EPSILON
    assert abs(run.collisions["t"][0] - 0.8) <= EPSILON


def test_an_inadmissible_impact_ends_the_run_or_is_substituted() -> None:
    first = ball(-1.0, 0.0, 1.0, radius=0.2)
    second = ball(0.0, 0.0, 0.6, radius=0.08)
    document = table([first, second], k=0.6, time=5.0)
    run = solve(document)
    assert run.end_cause == "inadmissible"
    assert not run.collisions["admissible"][-1]
    last = run.sample([run.end_time])
    assert last["velocity_x"][0] == 1.0  # the impact was not carried out
    document["collision"]["inadmissible"] = "normal-impulse"
    run = solve(document)
    assert run.end_cause == "time"
    assert run.collisions["substituted"][0]
    assert run.collisions["separation_speed"][0] >= 0.0


def _product_about_foci(run: Run, shape: tuple[float, float]) -> NDArray[np.longdouble]:
    """Return the product of the angular momenta about the foci of an ellipse, after each bounce."""
    a, b = (np.longdouble(axis) for axis in shape)
    c = np.sqrt(abs((a - b) * (a + b)))
    focus = (c, 0.0) if a > b else (0.0, c)
    names = ("x", "y", "velocity_x_post", "velocity_y_post")
    x, y, vx, vy = (run.bounces[name].astype(np.longdouble) for name in names)
    product = np.ones(len(x), dtype=np.longdouble)
    for sign in (1.0, -1.0):
        product *= (x - sign * focus[0]) * vy - (y - sign * focus[1]) * vx
    return product


@pytest.mark.parametrize("shape", [(2.0, 1.2), (1.0, 1.6)])
def test_the_foci_of_an_elliptic_wall(shape: tuple[float, float]) -> None:
    """At r = 0 and k = 1 the product of the angular momenta about the foci is conserved."""
    run = solve(table([particle(0.3, 0.1, 0.9, 0.7)], ellipse(*shape), bounces=100_000))
    a, b = shape
    c = math.sqrt(abs(a * a - b * b))
    fx, fy = (c, 0.0) if a > b else (0.0, c)
    start = math.prod((0.3 - s * fx) * 0.7 - (0.1 - s * fy) * 0.9 for s in (1.0, -1.0))
    assert np.max(np.abs(_product_about_foci(run, shape) / start - 1.0)) <= 1e-10
    assert abs(run.summary_record()["energy_drift"]) <= 1e-12


@pytest.mark.parametrize("shape", [(2.0, 1.2), (1.0, 1.6)])
def test_the_levels_of_a_portrait_are_the_products_about_the_foci(
    shape: tuple[float, float],
) -> None:
    run = solve(table([particle(0.3, 0.1, 0.9, 0.7)], ellipse(*shape), bounces=50))
    rows = run.bounces
    nx, ny = np.cos(rows["normal_angle"]), np.sin(rows["normal_angle"])
    speed = np.hypot(rows["velocity_x_post"], rows["velocity_y_post"])
    share = (rows["velocity_y_post"] * nx - rows["velocity_x_post"] * ny) / speed
    levels = focal_product(run.system.wall, rows["normal_angle"], share)
    known = (_product_about_foci(run, shape) / speed**2).astype(np.float64)
    np.testing.assert_allclose(levels, known, rtol=1e-12)


@pytest.mark.parametrize(
    ("wall", "half"),
    [
        (ellipse(1.5, 1.0), 1.5), (ellipse(1.0, 1.7, side="outside"), 1.7), (box(2.0, 1.4), 1.0),
        (box(1.2, 3.0, x=0.2, y=5.0, side="outside"), 1.5), (None, 0.4),
    ],
)  # fmt: skip
def test_exponents_measure_speeds_by_the_time_across_half_the_wall(
    wall: Document | None, half: float
) -> None:
    balls = [ball(-0.4, 0.1, 0.3, 0.4), ball(0.4, -0.1, -0.1, 0.0)]
    if wall is not None and wall.get("side") == "outside":
        balls = [one | {"x": one["x"] + 4.0} for one in balls]
    assert time_scale(solve(table(balls, wall, time=0.1)).system) == pytest.approx(half / 0.5)


def test_the_roundings_of_impacts_do_not_add_up_in_one_direction() -> None:
    """The factors of the law used to cause 1.5e-12 in these."""
    heavy, light = ball(-0.5, 0.1, 1.0, 0.3), ball(0.5, -0.1, -0.7, 0.45, mass=0.3)
    balls = [{**one, "body": "disk", "radius": 0.2} for one in (heavy, light)]
    run = solve(table(balls, box(2.0, 1.5), collisions=300_000))
    assert abs(run.summary_record()["energy_drift"]) <= 3e-13


@pytest.mark.parametrize("k", [0.0, 0.3, 0.5])
def test_bounces_that_take_most_of_the_energy_leave_the_speed_along_the_wall(k: float) -> None:
    """Between parallel walls it is constant: the rounding of the energy taken changed it."""
    for along in (0.03, 0.0123, 0.01):
        run = solve(table([ball(-0.9, 0.1, along, 1.0)], box(1e3, 1.0, k), bounces=20, time=1e3))
        np.testing.assert_allclose(run.bounces["velocity_x_post"], along, rtol=4e-16)


@pytest.mark.parametrize("axes", [(0.8, 1.4), (1.5, 1.5)], ids=["ellipse", "circle"])
def test_the_roundings_of_bounces_do_not_add_up_in_one_direction(
    axes: tuple[float, float],
) -> None:
    """The mean drift is that of independent roundings, one at each bounce."""
    rng, scores = np.random.default_rng(20), []
    for _ in range(24):
        shape = (1.5, float(rng.uniform(*axes)))
        start = particle(*rng.uniform(-0.4, 0.4, 2), *rng.uniform(-1.0, 1.0, 2))
        run = solve(table([start], ellipse(*shape), bounces=30_000))
        change = np.diff(_product_about_foci(run, shape))
        scores.append(abs(change.mean()) / change.std() * math.sqrt(len(change)))
    assert np.median(scores) <= 2.0


@pytest.mark.parametrize(
    "wall",
    [ellipse(2.0, 1.2), box(3.0, 2.0), {"shape": "circle", "radius": 1.5, "k": 1.0}],
    ids=["ellipse", "box", "circle"],
)
def test_no_ball_escapes_in_a_million_bounces(wall: Document) -> None:
    run = solve(table([ball(0.3, 0.1, 0.9, 0.7)], wall, bounces=1_000_000))
    assert run.end_cause == "bounces"
    x, y = np.abs(run.bounces["x"]), np.abs(run.bounces["y"])
    if wall["shape"] == "rectangle":
        assert max(np.max(x) - 1.4, np.max(y) - 0.9) <= 1e-14
    else:
        a, b = wall.get("semi_axis_x", 1.5), wall.get("semi_axis_y", 1.5)
        nx, ny = np.cos(run.bounces["normal_angle"]), np.sin(run.bounces["normal_angle"])
        foot_x = run.bounces["x"] + 0.1 * nx
        foot_y = run.bounces["y"] + 0.1 * ny
        assert np.max(np.abs((foot_x / a) ** 2 + (foot_y / b) ** 2 - 1.0)) <= 1e-14
    assert np.all(np.diff(run.bounces["t"]) > 0.0)


@pytest.mark.parametrize(("body", "share"), [("particle", 0.0), ("ball", 0.2)])
def test_contacts_with_a_narrow_ellipse_are_on_the_path(body: str, share: float) -> None:
    """Even where the normal turns ten thousand times as fast as on a circle."""
    rng, b = np.random.default_rng(1), 1e-4
    for _ in range(10):
        x, y = rng.uniform(-0.5, 0.5, 2) * (1.0, b)
        turn = rng.uniform(0.0, 2.0 * math.pi)
        vx, vy = math.cos(turn), math.sin(turn)
        start = ball(x, y, vx, vy, body=body, radius=share * b * b)
        run = solve(table([start], ellipse(1.0, b), bounces=50))
        names = ("x", "y", "velocity_x_pre", "velocity_y_pre")
        place_x, place_y, u, v = (run.bounces[name] for name in names)
        across = np.diff(place_x, prepend=x) * v - np.diff(place_y, prepend=y) * u
        assert np.max(np.abs(across)) <= EPSILON
        normal = run.bounces["normal_angle"]
        foot_x = place_x + share * b * b * np.cos(normal)
        foot_y = place_y + share * b * b * np.sin(normal)
        assert np.max(np.abs(foot_x**2 + (foot_y / b) ** 2 - 1.0)) <= 8.0 * EPSILON / b


@pytest.mark.parametrize("radius", [0.0, 1e-3, 0.1, 0.4])
@pytest.mark.parametrize("side", ["inside", "outside"])
def test_the_contact_with_an_ellipse_is_the_first(radius: float, side: str) -> None:
    """On the path before it the ball is clear of the wall; at the contact it touches the wall."""
    rng = np.random.default_rng(8)
    hits = 0
    for _ in range(20):
        place = rng.uniform(-0.5, 0.5, 2) if side == "inside" else rng.uniform(2.0, 3.0, 2)
        place *= rng.choice([-1.0, 1.0], 2)
        direction = rng.uniform(0.0, math.tau)
        body = {"body": "particle"} if radius == 0.0 else {}
        one = ball(
            float(place[0]), float(place[1]), math.cos(direction), math.sin(direction),
            radius=radius, **body,
        )  # fmt: skip
        run = solve(table([one], ellipse(1.4, 0.9, side=side), bounces=1, time=10.0))
        end = float(run.bounces["t"][0]) if len(run.bounces["t"]) else 10.0
        times = np.linspace(0.0, end, 200)
        x = one["x"] + one["velocity_x"] * times
        y = one["y"] + one["velocity_y"] * times
        f = np.linspace(0.0, math.tau, 3001)
        distances = np.hypot(x[:, None] - 1.4 * np.cos(f), y[:, None] - 0.9 * np.sin(f)).min(axis=1)
        assert np.all(distances[:-1] >= radius - 1e-5)
        if len(run.bounces["t"]):
            hits += 1
            assert abs(distances[-1] - radius) <= 2e-3
            normal = float(run.bounces["normal_angle"][0])
            foot = run.bounces["x"][0] + radius * math.cos(normal)
            other = run.bounces["y"][0] + radius * math.sin(normal)
            assert abs((foot / 1.4) ** 2 + (other / 0.9) ** 2 - 1.0) <= 1e-14
    assert hits == 20 if side == "inside" else 1 < hits < 19


def test_a_polygon_seen_from_outside_and_its_corners() -> None:
    corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    wall = {"shape": "polygon", "corners": corners, "side": "outside", "k": 1.0}
    run = solve(table([ball(-1.0, 1.05, 1.0)], wall, time=5.0))
    # The centre passes 0.05 above the corner: contact where it is 0.1 away from it.
    x = -math.sqrt(0.1**2 - 0.05**2)
    assert run.bounces["x"][0] == pytest.approx(x, abs=1e-15)
    assert len(run.bounces["t"]) == 1
    run = solve(table([ball(-1.0, 0.5, 1.0)], wall, time=5.0))
    assert run.bounces["x"][0] == pytest.approx(-0.1, abs=1e-15)
    assert run.bounces["edge"][0] == 4


@pytest.mark.parametrize("side", ["inside", "outside"])
def test_sides_of_a_polygon_are_numbered_as_its_corners_are_given(side: str) -> None:
    corners = [[0.0, 0.0], [3.0, 0.2], [2.6, 2.0], [1.4, 2.4], [0.1, 1.7]]
    balls = []
    for turn in np.arange(0.0, 6.0, 0.4):
        x, y = math.cos(turn), math.sin(turn)
        away, way = (0.0, 1.0) if side == "inside" else (9.0, -1.0)
        balls.append(particle(1.3 + away * x, 1.1 + away * y, way * x, way * y))
    for order in (corners, corners[::-1], corners[2:] + corners[:2]):
        met = set()
        for one in balls:
            wall = {"shape": "polygon", "corners": order, "k": 1.0, "side": side}
            run = solve(table([one], wall, bounces=1))
            edge = int(run.bounces["edge"][0])
            (x, y), (ex, ey) = order[edge - 1], order[edge % len(order)]
            place = run.bounces["x"][0], run.bounces["y"][0]
            off = (ex - x) * (place[1] - y) - (ey - y) * (place[0] - x)
            assert abs(off) <= 1e-13
            met.add(edge)
        assert met == {1, 2, 3, 4, 5}


@pytest.mark.parametrize("shape", ["polygon", "reversed", "rectangle"])
def test_a_corner_has_the_number_of_the_side_that_begins_there(shape: str) -> None:
    corners = [[-1.0, -0.5], [1.0, -0.5], [1.0, 0.5], [-1.0, 0.5]]
    wall: dict[str, Any] = {"shape": "rectangle", "width": 2.0, "depth": 1.0}
    if shape != "rectangle":
        corners = corners[::-1] if shape == "reversed" else corners
        wall = {"shape": "polygon", "corners": corners}
    for number, (x, y) in enumerate(corners, 1):
        start = ball(1.5 * x, 1.5 * y, -x, -y)
        run = solve(table([start], wall | {"side": "outside", "k": 1.0}, bounces=1))
        assert run.bounces["edge"].tolist() == [number]
        assert math.hypot(run.bounces["x"][0] - x, run.bounces["y"][0] - y) == pytest.approx(0.1)


@pytest.mark.parametrize("radius", [0.0, 0.1])
def test_a_curved_wall_has_no_sides(radius: float) -> None:
    start = particle(0.3, 0.1, 0.9, 0.7) if radius == 0.0 else ball(0.3, 0.1, 0.9, 0.7)
    for wall in (ellipse(2.0, 1.2), {"shape": "circle", "radius": 1.5, "k": 1.0}):
        assert solve(table([start], wall, bounces=5)).bounces["edge"].tolist() == [None] * 5


def test_curves_have_negative_numbers_in_the_log_and_none_in_the_table() -> None:
    log = np.array([(-1,), (0,), (-2,), (6,)], dtype=[("edge", np.int64)])
    assert Bounces([], log, np.zeros(4, dtype=np.int64)).edge.tolist() == [None, 1, None, 7]


def test_a_small_polygon_far_from_the_origin_is_the_same_wall() -> None:
    corners = [[0.0, 0.0], [1.0, 0.0], [1.25, 1.0], [0.25, 1.0]]

    def bounces(away: float, order: list[list[float]]) -> Any:
        moved = [[x + away, y - away] for x, y in order]
        wall = {"shape": "polygon", "corners": moved, "k": 1.0}
        start = ball(away + 0.5, 0.5 - away, 1.0, 0.25)
        return solve(table([start], wall, time=5.0)).bounces

    for order in (corners, corners[::-1]):
        near, far = bounces(0.0, order), bounces(2.0**36, order)
        assert len(near["t"]) == 9
        assert np.array_equal(near["edge"], far["edge"])
        assert np.allclose(near["t"], far["t"], atol=1e-3)


def test_two_sides_of_a_room_may_lie_in_one_line() -> None:
    room = [[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [2.0, 2.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0]]
    wall = polygon([*room, [0.0, 2.0]], 1.0)
    # Up the left leg of the U, then down and along its floor to the right one.
    up = solve(table([ball(0.5, 1.6, 0.0, 1.0)], wall, bounces=2))
    assert list(up.bounces["edge"]) == [7, 1]
    assert list(up.bounces["t"]) == pytest.approx([0.3, 2.1], abs=1e-15)
    along = solve(table([ball(0.5, 0.5, 1.0)], wall, bounces=2))
    assert list(along.bounces["edge"]) == [2, 8]
    touching = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [2.0, 0.0], [1.0, 1.0]]
    crossing = [[0.0, 0.0], [3.0, 0.0], [2.0, 1.0], [1.0, -1.0]]
    for meeting in (touching, crossing):
        with pytest.raises(ScenarioError, match="that meet"):
            solve(table([ball(0.5, 0.2)], polygon(meeting, 1.0), time=1.0))


def sides_meet(corners: list[complex], one: int, other: int) -> bool:
    """Whether two sides of corners x + iy, whole numbers, have more in common than a corner."""
    count = len(corners)
    p, q, r, s = (corners[n % count] for n in (one, one + 1, other, other + 1))
    if (other - one) % count in (1, count - 1):
        common, before, after = (q, p, s) if q == r else (p, q, r)
        product = (before - common).conjugate() * (after - common)
        return product.imag == 0.0 and product.real > 0.0
    across = ((q - p).conjugate() * (s - r)).imag
    if across != 0.0:
        shares = [((r - p).conjugate() * way).imag for way in (s - r, q - p)]
        return all(0.0 <= share * across <= across * across for share in shares)
    ends = [(end, *side) for side, other in (((p, q), (r, s)), ((r, s), (p, q))) for end in other]
    products = [(start - end).conjugate() * (stop - end) for end, start, stop in ends]
    return any(product.imag == 0.0 and product.real <= 0.0 for product in products)


def test_the_first_two_sides_that_meet_are_told_of() -> None:
    """Compare with all pairs, solved as linear equations in integers."""
    random = np.random.default_rng(7)
    sound = 0
    for _ in range(2000):
        points = random.integers(0, 8, (int(random.integers(3, 8)), 2)).astype(float)
        corners = [complex(x, y) for x, y in points]
        if any(a == b for a, b in zip(corners, corners[1:] + corners[:1], strict=True)):
            continue
        pairs = combinations(range(len(corners)), 2)
        meeting = [f"sides {a + 1} and {b + 1} that meet" for a, b in pairs
                   if sides_meet(corners, a, b)]  # fmt: skip
        told = wrong_with_polygon(tuple((x, y) for x, y in points.tolist()))
        assert told == (meeting[0] if meeting else "")
        sound += not meeting
    assert 200 < sound < 1800


def test_polygons_of_many_corners_are_checked_in_reasonable_time() -> None:
    """Every side is checked only with those near it: twice the work for twice the corners."""

    def check(count: int) -> int:
        turns = [math.tau * (n + 0.3) / count for n in range(count)]
        corners = tuple((math.cos(turn), math.sin(turn)) for turn in turns)
        return calls(lambda: wrong_with_polygon(corners))

    assert check(200) < 2.5 * check(100)


def test_an_angled_room_is_left_by_no_corner() -> None:
    corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]]
    for order in (corners, corners[::-1]):
        wall = {"shape": "polygon", "corners": order, "k": 1.0}
        for one in (ball(0.5, 0.5, 0.77, 0.59), particle(0.5, 0.5, 0.77, 0.59)):
            run = solve(table([one], wall, bounces=20_000))
            r, (x, y) = one["radius"], (run.bounces["x"], run.bounces["y"])
            assert run.end_cause == "bounces"
            assert min(np.min(x), np.min(y)) >= r - 1e-12
            assert max(np.max(x), np.max(y)) <= 2.0 - r + 1e-12
            inner = np.hypot(np.maximum(1.0 - x, 0.0), np.maximum(1.0 - y, 0.0))
            beyond = (x > 1.0) & (y > 1.0)
            assert not np.any(beyond)
            near = (x < 1.0) & (y < 1.0)
            assert np.all(inner[near] >= r - 1e-12)


def test_a_particle_aimed_at_a_corner_does_not_go_through_it() -> None:
    """Of it nothing is left within the triangle: that is where all three cross products agree."""
    draw = np.random.default_rng(12)
    for _ in range(300):
        turn, off = draw.uniform(0.0, math.tau), draw.uniform(-2.0, 2.0, 2)
        angles = turn + np.array([0.0, 2.1, 4.2])
        corners = off + np.column_stack([np.cos(angles), np.sin(angles)])
        aim = turn + draw.uniform(-1.0, 1.0)
        start = corners[0] + 2.0 * np.array([math.cos(aim), math.sin(aim)])
        one = particle(*map(float, start), *map(float, corners[0] - start))
        run = solve(table([one], polygon(corners.tolist(), 1.0, "outside"), time=1.25))
        assert len(run.bounces["t"]) >= 1
        first = run.bounces["x"][0] - corners[0, 0], run.bounces["y"][0] - corners[0, 1]
        assert math.hypot(*first) <= 1e-14
        last = run.sample([1.25])
        way = np.array([last["x"][0], last["y"][0]]) - corners
        sides = np.roll(corners, -1, axis=0) - corners
        assert np.min(sides[:, 0] * way[:, 1] - sides[:, 1] * way[:, 0]) < -1e-2


@pytest.mark.parametrize("away", [1e-9, 1e-10, 1e-13])
def test_a_particle_that_bounces_beside_a_corner_does_not_meet_its_other_side(away: float) -> None:
    """It is in front of the one, and so not in the obstacle, though nearly at the other's line."""
    square = box(2.0, 2.0, side="outside")
    wedge = polygon([[0.0, 0.0], [-1.0, -0.2], [0.0, -1.0]], 1.0, "outside")
    for x, y, obstacle in [
        (2.0 - away, 2.0, square), (2.0, 2.0 - away, square), (1.0, 1.0 - away, wedge),
    ]:  # fmt: skip
        run = solve(table([particle(x, y, -1.0, -1.0)], obstacle, time=5.0))
        assert len(run.bounces["n"]) == 1


def test_a_ball_that_has_rolled_along_a_side_leaves_it_straight_on() -> None:
    draw = np.random.default_rng(13)
    for _ in range(40):
        angles = draw.uniform(0.0, math.tau) + np.array([0.0, 1.3, 2.5, 4.4])
        corners = np.column_stack([np.cos(angles), np.sin(angles)])
        along = (corners[1] - corners[0]) / math.hypot(*(corners[1] - corners[0]))
        across = np.array([-along[1], along[0]])  # into the obstacle
        start = 0.5 * (corners[0] + corners[1]) - across
        one = ball(*map(float, start), *map(float, across + 0.3 * along))
        run = solve(table([one], polygon(corners.tolist(), 0.0, "outside"), time=9.0))
        assert len(run.bounces["t"]) == 1
        last = run.sample([9.0])
        velocity = np.array([last["velocity_x"][0], last["velocity_y"][0]])
        assert np.max(np.abs(velocity - 0.3 * along)) <= 1e-15


def test_a_missed_obstacle_is_never_met() -> None:
    circle = {"shape": "circle", "radius": 0.7, "k": 0.9, "side": "outside"}
    for wall in (circle, ellipse(1.0, 0.6, side="outside")):
        run = solve(table([ball(3.0, 3.0, 2.0, 2.0)], wall, bounces=1))
        assert run.end_cause == "no_more_collisions"


def test_into_a_corner_both_components_turn_round() -> None:
    run = solve(table([particle(0.0, 0.0, 1.0, 1.0)], box(2.0, 2.0), time=2.5))
    assert list(run.bounces["t"]) == [1.0, 1.0]
    last = run.sample([2.5])
    assert (last["velocity_x"][0], last["velocity_y"][0]) == (-1.0, -1.0)
    assert (last["x"][0], last["y"][0]) == (-0.5, -0.5)


def test_a_row_of_balls_hands_its_speed_on() -> None:
    balls = [ball(-1.0, 0.0, 1.0), *(ball(0.2 * n, 0.0) for n in range(4))]
    run = solve(table(balls, time=5.0))
    assert len(run.collisions["n"]) == 4
    final = run.sample([5.0])["velocity_x"]
    assert np.array_equal(final, [0.0, 0.0, 0.0, 0.0, 1.0])


@pytest.mark.parametrize("count", [2, 3, 17, 40])
def test_many_balls_in_order_by_both_engines(count: int) -> None:
    """A gas in a box: energy and order of events, and every event as if all were searched anew."""
    rng = np.random.default_rng(count)
    places = [(0.3 * (n % 8) - 1.05, 0.3 * (n // 8) - 0.75) for n in range(count)]
    balls = [
        ball(x, y, *map(float, rng.normal(size=2)), radius=float(rng.uniform(0.06, 0.12)))
        for x, y in places
    ]
    document = table(balls, box(2.6, 2.0), collisions=300, time=50.0)
    document["collision"]["law"] = "normal-impulse"
    run = solve(document)
    other = solve(document, "python")
    for name in ("collisions", "bounces"):
        for column, values in getattr(run, name).items():
            np.testing.assert_array_equal(values, getattr(other, name)[column], column)
    summary = run.summary_record()
    assert abs(summary["energy_drift"]) <= 1e-13
    assert summary["max_gap"] <= 1e-14
    for instant in np.linspace(0.0, run.end_time, 200):
        state = run.sample([instant])
        x, y = state["x"], state["y"]
        radii = np.array([b["radius"] for b in balls])
        touch = 2.0 * np.sqrt(radii[:, None] * radii[None, :])
        apart = np.hypot(x[:, None] - x, y[:, None] - y)
        np.fill_diagonal(apart, np.inf)
        assert np.all(apart >= touch - 1e-13)
        assert np.all(np.abs(x) <= 1.3 - radii + 1e-13)
        assert np.all(np.abs(y) <= 1.0 - radii + 1e-13)


def test_a_plastic_ball_stays_at_a_curved_wall_and_the_run_says_so() -> None:
    run = solve(table([ball(0.0, 0.0, 1.0, 0.4)], ellipse(2.0, 1.2, 0.5), time=100.0))
    assert run.end_cause == "wall_contact"
    gaps = np.diff(run.bounces["t"])
    assert gaps[-1] < 1e-5 * gaps[0]


@pytest.mark.parametrize("place", [0.0, 0.1, 2.0])
@pytest.mark.parametrize("skim", [0.0, 3e-8])
def test_a_ball_that_moves_along_a_curved_wall_stays_at_it(place: float, skim: float) -> None:
    x, y = 0.9 * np.cos(place), 0.9 * np.sin(place)
    along = place + 0.5 * np.pi - skim
    rolling = ball(x, y, np.cos(along), np.sin(along), radius=0.1)
    run = solve(table([rolling], {"shape": "circle", "radius": 1.0, "k": 1.0}, time=1.0))
    assert run.end_cause == "wall_contact"
    assert run.end_time <= 2e-7


def test_a_ball_that_skims_along_a_circle_goes_from_chord_to_chord() -> None:
    skim = 1e-3
    rolling = ball(0.9, 0.0, np.sin(skim), np.cos(skim), radius=0.1)
    run = solve(table([rolling], {"shape": "circle", "radius": 1.0, "k": 1.0}, bounces=1000))
    chord = 2.0 * 0.9 * np.sin(skim)
    np.testing.assert_allclose(run.bounces["t"], chord * np.arange(1000), rtol=1e-6, atol=1e-12)


def test_a_ball_hit_from_both_sides_at_once() -> None:
    balls = [ball(-1.0, 0.0, 1.0), ball(0.0, 0.0), ball(1.0, 0.0, -1.0)]
    run = solve(table(balls, k=0.25, time=100.0))
    assert list(run.collisions["simultaneous"]) == [True, True]
    assert list(run.sample([100.0])["velocity_x"]) == [-0.25, 0.0, 0.25]


def test_a_ball_caught_between_others_comes_to_roll_with_them() -> None:
    """Infinitely many impacts in finite time end where the balls touch and no longer approach."""
    balls = [ball(-1.0, 0.03, 1.0), ball(0.0, 0.0), ball(1.02, 0.0, -1.3)]
    run = solve(table(balls, k=0.05, time=10.0))
    assert run.end_cause == "time"
    assert len(run.collisions["n"]) > 10
    times = run.collisions["t"]
    assert times[-1] - times[2] < 0.1
    state = run.sample(np.linspace(float(times[-1]), 10.0, 50))
    x, y = state["x"].reshape(-1, 3), state["y"].reshape(-1, 3)
    apart = np.hypot(np.diff(x, axis=1), np.diff(y, axis=1))
    assert np.all(apart >= 0.2 - 1e-14)


def test_plastic_balls_roll_on_side_by_side() -> None:
    run = solve(table([ball(-1.0, 0.05, 1.0), ball(0.0, 0.0)], k=0.0, time=100.0))
    assert len(run.collisions["n"]) == 1
    assert run.end_cause == "time"


def test_what_is_left_of_a_speed_by_underflow_moves_no_ball() -> None:
    """Plastic bounces between a wall and another ball: the squares of the speeds underflow."""
    balls = [
        ball(0.001, 0.0, 1.0, 0.0, radius=0.05, mass=1.0),
        ball(0.101, 0.0, 0.0, 0.0, radius=0.05, mass=6.208077755265798),
    ]
    wall = ellipse(1.2, 1.0, 0.05)
    document = table(balls, wall, k=1e-300, time=10.0, collisions=200, bounces=300)
    document["collision"]["law"] = "normal-impulse"
    assert solve(document).summary_record()["max_gap"] <= 1e-14


def test_a_scenario_with_a_polygon_is_read_again() -> None:
    corners = [[0, 0], [3, 0], [3, 2]]
    ball = {"radius": 0.1, "density": 7800, "x": 2.0, "y": 0.5}
    wall = {"shape": "polygon", "corners": corners, "k": 0.9}
    data = {"system": "table", "wall": wall, "balls": [ball], "stop": {"time": 1}}
    scenario = any_scenario_of(data)
    assert any_scenario_of(scenario.resolved()) == scenario


@pytest.mark.parametrize("law", LAW_NAMES)
def test_balls_that_nearly_stop_one_another_at_k_0_collide_once(law: str) -> None:
    """The remaining speeds are small, and follow from the momentum."""
    draw = np.random.default_rng(5)
    for left in (0.0, 1e-3, -1e-2):
        for _ in range(8):
            mass, turn = draw.uniform(0.3, 3.0), draw.uniform(0.0, 2.0 * math.pi)
            x, y, speed = math.cos(turn), math.sin(turn), -(1.0 + left) / mass
            one = ball(0.0, 0.0, x, y)
            other = ball(0.5 * x, 0.5 * y, speed * x, speed * y, mass=mass)
            document = table([one, other], None, 0.0, time=20.0)
            run = solve({**document, "collision": {"k": 0.0, "law": law}})
            assert len(run.collisions["t"]) == 1
            for end in "ab":
                common = run.collisions[f"normal_speed_{end}_post"][0]
                assert abs(common + left / (1.0 + mass)) <= 1e-15


@pytest.mark.parametrize("shape", ["square", "square outside", "circle", "ellipse"])
def test_a_ball_that_a_wall_nearly_stops_at_k_0_meets_it_once(shape: str) -> None:
    draw = np.random.default_rng(6)
    for along in (1e-4, 1e-3, 1e-2):
        for _ in range(12):
            turn = draw.uniform(0.0, 2.0 * math.pi)
            x, y = math.cos(turn), math.sin(turn)
            square = [[a * x - b * y, a * y + b * x] for a, b in SQUARE]
            wall = {
                "square": polygon(square, 0.0),
                "square outside": polygon(square, 0.0, "outside"),
                "circle": {"shape": "circle", "radius": 1.0, "k": 0.0, "side": "outside"},
                "ellipse": ellipse(1.0, 0.7, 0.0, side="outside"),
            }[shape]
            start = (0.0, 0.0) if shape == "square" else (-2.0 * x, -2.0 * y)
            one = ball(*start, x - along * y, y + along * x)
            # Until it would come to the next side; without a corner it never meets the wall again.
            run = solve(table([one], wall, time=50.0))
            assert run.end_cause == "time"
            assert len(run.bounces["t"]) == 1
            if shape.startswith("square"):
                assert abs(run.bounces["velocity_x_post"][0] + along * y) <= 1e-15
                assert abs(run.bounces["velocity_y_post"][0] - along * x) <= 1e-15


@pytest.mark.parametrize("turned", [False, True])
def test_distances_from_an_ellipse_on_its_long_axis_are_the_closed_form(turned: bool) -> None:
    """Between its two nearest points: b sqrt(1 - x^2/(a^2 - b^2)), whatever the rounding of b^2."""
    for b in (12.457, *np.linspace(0.1, 3.0, 300).tolist()):
        for share in (0.0, 1e-9, 0.05, 0.7):
            x, axes, place = share * b, (2.0 * b, b), (share * b, 0.0)
            wall = Wall(ELLIPSE, True, 1.0, semi_axes=axes[::-1] if turned else axes)
            exact = b * math.sqrt(1.0 - x * x / (3.0 * b * b))
            found = distance_to_wall(wall, place[::-1] if turned else place)
            assert found == pytest.approx(exact, rel=1e-15, abs=0.0)


@pytest.mark.parametrize("turned", [False, True])
def test_distances_from_an_ellipse_beside_its_centre_are_the_closed_form(turned: bool) -> None:
    """On the short axis the nearest point is its end, at b - y, however close to the centre."""
    for a in (1.0 + 1e-9, 1.2, 20.0):
        for y in (1e-300, 1e-16, 1e-14, 2e-13, 1e-12, 3e-12, 1e-9, 1e-4, 0.9):
            axes, place = (a, 1.0), (0.0, y)
            wall = Wall(ELLIPSE, True, 1.0, semi_axes=axes[::-1] if turned else axes)
            found = distance_to_wall(wall, place[::-1] if turned else place)
            assert found == pytest.approx(1.0 - y, rel=0.0, abs=5e-16)


@pytest.mark.parametrize("inside", [True, False])
def test_distances_from_a_polygon_are_negative_on_the_side_without_balls(inside: bool) -> None:
    corners = np.array(L_SHAPE)
    wall = Wall("polygon", inside, 1.0, corners=tuple((x, y) for x, y in L_SHAPE))
    share = np.linspace(0.0, 1.0, 5001)[:, None]
    sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    along = np.concatenate([start + share * (end - start) for start, end in sides])
    for place in np.random.default_rng(1).uniform(-1.6, 1.6, (60, 2)):
        within = bool(Path(corners).contains_point(place))
        nearest = float(np.min(np.hypot(*(along - place).T)))
        found = distance_to_wall(wall, (float(place[0]), float(place[1])))
        assert found == pytest.approx(nearest if within == inside else -nearest, abs=1e-5)


def test_a_side_without_length_is_told_by_its_corners() -> None:
    corners = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (1.0, 1.0), (0.0, 1.0))
    assert wrong_with_polygon(corners) == "corners 3 and 4 at the same point"
    assert wrong_with_polygon((*corners[:3], *corners[4:], corners[0])) == (
        "corners 5 and 1 at the same point"
    )


def last_that_meets(scene: Callable[[float], Document], low: float, high: float) -> float:
    """The last double from one with a contact to one without, by bisection; the next has none."""
    while low < (middle := 0.5 * (low + high)) < high:
        if len(contacts_of(solve(scene(middle)))["t"]):
            low = middle
        else:
            high = middle
    return low


def contacts_of(run: Run) -> dict[str, Any]:
    """Return the impacts of balls, or those on the wall if there is one ball."""
    return run.collisions if len(run.system.bodies) > 1 else cast(Any, run).bounces


TOUCHES: dict[str, tuple[Callable[[float], Document], float, float]] = {
    "balls": (lambda y: table([ball(-1.0, 0.0, 1.0), ball(0.0, y)], time=3.0), 0.1, 0.3),
    "round obstacle": (
        lambda y: table([ball(-2.0, y, 1.0)], ellipse(0.7, 0.5, side="outside"), time=5.0),
        0.3,
        0.9,
    ),
    "corner": (
        lambda y: table(
            [ball(-2.0, y, 1.0)],
            polygon([[0, -1], [1, 0], [0, 1], [-1, 0]], 1.0, "outside"),
            time=5.0,
        ),
        1.05,
        1.2,
    ),
}
"""Scenes of one number that ends contacts, and one below and one above the end."""


@pytest.mark.parametrize("name", TOUCHES)
def test_a_contact_that_the_next_double_does_not_have_is_grazing(name: str) -> None:
    scene, low, high = TOUCHES[name]
    last = last_that_meets(scene, low, high)
    assert contacts_of(solve(scene(last)))["grazing"].tolist() == [True]
    # 1e-12 m deeper is thousands of units in the last place of the places.
    assert not contacts_of(solve(scene(last - 1e-12)))["grazing"].any()


def test_energy_is_kept_until_something_takes_it() -> None:
    balls = [ball(-0.5, 0.1, 0.3), ball(0.5, 0.1, 0.3)]
    document = table(balls, box(4.0, 3.0, 0.5), k=0.5, time=1.0)
    assert solve(document).summary_record()["energy_drift"] == 0.0
    document["stop"] = {"time": 9.0}
    assert solve(document).summary_record()["energy_drift"] is None


WALLS_1_AWAY = [box(2.0, 3.0), ellipse(1.0, 1.5), {"shape": "circle", "radius": 1.0, "k": 1.0}]
"""Walls that the x axis meets at right angles 1 m from the origin."""


@pytest.mark.parametrize("engine", ["python", "compiled"])
@pytest.mark.parametrize("wall", WALLS_1_AWAY, ids=["rectangle", "ellipse", "circle"])
def test_a_ball_moves_at_any_speed_whose_square_has_all_its_digits(
    wall: Document, engine: str
) -> None:
    """Slower ones count as at rest: before squares lose digits, at 1e-154 m/s."""
    for speed in (1e-140, 1.1e-145):
        run = solve(table([ball(0.25, 0.0, speed, 0.0)], wall, bounces=1), engine)
        assert run.end_cause == "bounces"
        assert float(run.bounces["t"][0]) == pytest.approx(0.65 / speed, rel=1e-14)
    run = solve(table([ball(0.25, 0.0, 0.9e-145, 0.0)], wall, bounces=1), engine)
    assert run.end_cause == "no_more_collisions"
