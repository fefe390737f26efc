"""Tables of many balls: pairs that touch late or never are rejected, and no contact is lost."""

from __future__ import annotations

import math
import re
from typing import Any, cast

import mpmath as mp
import numpy as np
import pytest

from tests.systems.table_cases import Document, ball, box, ellipse, table
from vibro_cli.compile.kernel import NO_OVERRIDES, Overrides, kernel
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.table.loop import note_motion, sift, time_to_pair
from vibro_cli.kernels.table.world import World
from vibro_cli.mechanics.system import touching_distance
from vibro_cli.scenario import ScenarioError, any_scenario_of
from vibro_cli.systems.driver import Driver
from vibro_cli.systems.request import NO_LIMITS, Limits
from vibro_cli.systems.table.build import build
from vibro_cli.systems.table.scenario import TableScenario
from vibro_cli.systems.table.system import LOOP, make_world

R = 0.1


@kernel
def sift_nothing(world: World, ball: int, first: int, last: int) -> None:
    """Search every pair."""
    for other in range(first, last):
        world.sifted[other] = 0.0


PLAIN = Overrides("plain", {sift: sift_nothing})


def world_of(document: Document, limits: Limits = NO_LIMITS) -> World:
    return make_world(build(cast(TableScenario, any_scenario_of(document))), limits)


def rows_of(document: Document, engine: str, overrides: Overrides = NO_OVERRIDES) -> list[Any]:
    """Return impacts, bounces and the end of a run, with all their numbers."""
    world = world_of(document, Limits(time=1e6, collisions=60, bounces=60))
    driver = Driver(LOOP, world, engine, overrides=overrides)
    cause = driver.run()
    return [cause, *(rows.tolist() for rows in driver.drain().values())]


def balls_of(draw: np.random.Generator, kind: str) -> list[Document]:
    """Balls on a lattice: they touch, or have room, or differ in size; many rest, some are fast."""
    columns, rows = draw.integers(2, 7, size=2)
    room = 1.0 if kind == "touching" else 1.3
    balls = []
    for place in draw.permutation(columns * rows):
        column, row = divmod(int(place), int(rows))
        radius = R * draw.choice([1.0, 0.6, 1e-3]) if kind == "unequal" else R
        velocity = draw.choice([-1.0, 0.0, 0.5, 1.0], size=2)
        if kind == "unequal":
            velocity *= draw.choice([1.0, 1e3, 1e-28]) * draw.normal(size=2)
        x, y = 2.0 * R * room * (column - 3), 2.0 * R * room * (row - 3)
        balls.append(ball(x, y, *map(float, velocity), radius=float(radius)))
    return balls


WALLS: list[Document | None] = [
    None,
    box(3.0, 3.0),
    box(3.0, 3.0, k=0.0),
    ellipse(2.5, 2.2, k=0.7),
    {"shape": "circle", "radius": 1.0, "x": 2.0, "k": 1.0, "side": "outside"},
    {"shape": "polygon", "k": 1.0, "corners": [[-2, -2], [2, -2], [1.2, 0], [2, 2], [-2, 2]]},
]


@pytest.mark.parametrize("kind", ["touching", "with room", "unequal"])
@pytest.mark.parametrize("number", range(len(WALLS)))
def test_no_contact_is_lost_by_sifting(kind: str, number: int) -> None:
    draw = np.random.default_rng([number, len(kind)])
    for k in (1.0, 0.6, 0.0):
        document = table(balls_of(draw, kind), WALLS[number], k, time=1e6)
        document["collision"]["inadmissible"] = "normal-impulse"
        every_pair = rows_of(document, "python", PLAIN)
        assert rows_of(document, "python") == every_pair
        assert rows_of(document, "compiled") == every_pair


def aimed(draw: np.random.Generator) -> tuple[Document, Document]:
    """A ball at rest, and one that comes to touch it or passes it, by little or much."""
    radii = R * draw.choice([1.0, 1.0, 10.0 ** draw.uniform(-4.0, 4.0)], size=2)
    distance = 2.0 * math.sqrt(radii[0] * radii[1])
    apart = distance * (1.0 + draw.choice([10.0 ** draw.uniform(-17.0, 2.0), 2.0**-52]))
    aside = distance / apart * (1.0 + draw.choice([-1.0, 1.0]) * 10.0 ** draw.uniform(-17.0, -1.0))
    at = draw.uniform(0.0, 2.0 * math.pi)
    towards = at + math.asin(min(aside, 1.0))
    speed = -(10.0 ** draw.uniform(-6.0, 6.0))
    velocity = speed * math.cos(towards), speed * math.sin(towards)
    place = apart * math.cos(at), apart * math.sin(at)
    return ball(0.0, 0.0, radius=radii[0]), ball(*place, *velocity, radius=radii[1])


def first_touch(one: Document, other: Document) -> Any:
    """Return the time at which they touch, in 40 digits; infinite if they part or miss."""
    d = mp.matrix([other["x"], other["y"]])
    w = mp.matrix([other["velocity_x"], other["velocity_y"]])
    b = -(d.T * w)[0]
    square = (w.T * w)[0]
    c = (d.T * d)[0] - 4 * mp.mpf(one["radius"]) * other["radius"]
    inside = b * b - square * c
    return c / (b + mp.sqrt(inside)) if b > 0 and inside >= 0 else mp.inf


def test_no_pair_touches_before_the_time_that_it_is_sifted_by() -> None:
    draw = np.random.default_rng(3)
    world = world_of(table([ball(0.0, 0.0), ball(1.0, 0.0)], time=1.0))
    touching = 0
    for _ in range(4000):
        pair = aimed(draw)
        for number, given in enumerate(pair):
            state = world.balls[number]
            state.x, state.y = given["x"], given["y"]
            state.vx, state.vy = given["velocity_x"], given["velocity_y"]
            state.fastest = abs(state.vx) + abs(state.vy)
            world.bodies[number].radius = world.radii[number] = given["radius"]
            note_motion(world, number)
        sift(world, 0, 1, 2)
        found = time_to_pair(world, 0, 1)
        assert world.sifted[1] <= found
        if found < NEVER:  # where the touch is not one but for rounding
            touching += 1
            with mp.workdps(40):
                assert world.sifted[1] <= max(first_touch(*pair), 0)
    assert 1000 < touching < 3000


def test_most_pairs_are_sifted_out() -> None:
    draw = np.random.default_rng(4)
    balls = [
        ball(4.0 * R * (n % 16), 4.0 * R * (n // 16), *map(float, draw.normal(size=2)))
        for n in range(256)
    ]
    world = world_of(table(balls, time=1.0))
    for number in range(256):
        note_motion(world, number)
    kept, meeting = 0, 0
    for number in range(256):
        sift(world, number, 0, number)
        for other in range(number):
            kept += world.sifted[other] < NEVER
            meeting += time_to_pair(world, number, other) < NEVER
    # Kept are those that would meet if they were alone, and no more, but for rounding.
    assert kept == meeting < 0.1 * (256 * 255 / 2)


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Return the first balls of pairs whose distance is computed."""
    first: list[Any] = []

    def distance(one: Any, other: Any) -> float:
        first.append(one)
        return touching_distance(one, other)

    monkeypatch.setattr("vibro_cli.systems.table.build.touching_distance", distance)
    return first


def test_overlaps_are_those_of_all_pairs_and_few_are_measured(measured: list[Any]) -> None:
    draw = np.random.default_rng(6)
    for overlapping in (0.0, 0.9):
        x, y = (3.0 * R * number for number in np.divmod(draw.permutation(400), 20))
        x = x + overlapping * R * draw.normal(size=400)
        radii = R * draw.uniform(0.5, 1.0, size=400)
        balls = [ball(float(x[n]), float(y[n]), radius=float(radii[n])) for n in range(400)]
        touch = 2.0 * np.sqrt(np.outer(radii, radii))
        apart = np.hypot(np.subtract.outer(x, x), np.subtract.outer(y, y))
        pairs = np.argwhere(np.tril(apart < touch, -1))
        measured.clear()
        found: list[tuple[str, ...]] = []
        try:
            world_of(table(balls, time=1.0))
        except ScenarioError as error:
            found = re.findall(r"balls (\d+) and (\d+) that overlap", str(error))
        assert [[int(n) - 1 for n in names] for names in found] == pairs[:, ::-1].tolist()
        assert len(measured) <= 400 * 5 * 20  # of its own column of 20, and of two at each side
        assert (len(pairs) > 20) == (overlapping > 0.0)


def test_of_balls_in_a_column_only_neighbours_are_measured(measured: list[Any]) -> None:
    """One and a half diameters apart, none is within a diameter of another."""
    world_of(table([ball(0.0, 3.0 * R * number, radius=R) for number in range(200)], time=1.0))
    assert not measured
    with pytest.raises(ScenarioError, match="balls 7 and 200 that overlap by"):
        column = [ball(0.0, 3.0 * R * number, radius=R) for number in range(199)]
        world_of(table([*column, ball(0.0, 18.5 * R, radius=R)], time=1.0))
    assert len(measured) == 1
