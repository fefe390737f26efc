"""Regime and side of the figure eight in the table of impacts, against dense samples of V."""

from __future__ import annotations

import math
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vibro_cli.analysis.levels import Landscape
from vibro_cli.analysis.singular import FIGURE_EIGHT, Portrait, portrait_of
from vibro_cli.api import Run, simulate
from vibro_cli.scenario import load_any, scenario_of
from vibro_cli.stress.scenes import ball, scene, solve_any

FOLDER = Path(__file__).parents[3] / "scenarios"
RUNS = {
    "three_arcs": (),
    "disk_on_arcs": (),
    "five_balls": ("stop.time=20",),
    "line_between_valleys": (),
    "turning_three_arcs": (),
    "turning_five_arcs": (),
    "turning_circle": (),
    "one_circle": ("balls[1].rate=5", "collision.k=1", "stop.collisions=40"),
    "unequal_hedrih": (),
    "horizontal_line_1_2": (),
}
# A ring like a peanut: two lobes, and between them a hump below and one above.
PIECES = (
    ("hump", 0.5, -80.0),
    ("valley", 1.0, 260.0),
    ("hump", 0.5, -80.0),
    ("valley", 1.0, 260.0),
)
BEGINS = (40.0, -40.0, 220.0, 140.0)
"""Slope (degrees) where each of them begins."""


@cache
def run_of(name: str) -> Run:
    return simulate(load_any(FOLDER / f"{name}.toml", [*RUNS[name], "stop.collisions=60"]))


@cache
def potential_of(name: str, ball: int) -> tuple[Any, Any]:
    """Places (m) and potential (J) close together."""
    hills = Landscape.of(run_of(name).system, ball)
    places, values = [], []
    for piece in hills.trace.pieces:
        at = np.linspace(piece.angle_start, piece.angle_end, 20001)
        along = at if piece.is_line else piece.radius * (at - piece.angle_start)
        places.append(piece.start_s + along)
        values.append(hills.potential(piece, at))
    return np.concatenate(places), np.concatenate(values)


def expected_regime(name: str, ball: int, s: float, energy: float) -> str:
    places, values = potential_of(name, ball)
    if run_of(name).system.trace.closed:
        return "oscillating" if energy < np.max(values) else "progressive"
    left = np.max(values[places <= s], initial=-np.inf)
    right = np.max(values[places >= s], initial=-np.inf)
    return "oscillating" if energy < min(left, right) else "progressive"


def expected_side(portrait: Portrait, s: float, energy: float) -> str:
    """From the triggers of the portrait, which are found from its singular points."""
    eights = [one for one in portrait.triggers if one.orbit == FIGURE_EIGHT]
    for trigger in eights:
        assert trigger.turning_left is not None
        assert trigger.turning_right is not None
        if not trigger.turning_left <= s <= trigger.turning_right:
            continue
        if energy < trigger.saddle.energy:
            return "left loop" if s < trigger.saddle.s else "right loop"
    return "outside" if eights else "none"


@pytest.mark.parametrize("name", RUNS)
def test_columns_follow_from_the_potential(name: str) -> None:
    run = run_of(name)
    table = run.collisions
    bodies = range(1, len(run.system.bodies) + 1)
    portraits = {ball: portrait_of(Landscape.of(run.system, ball)) for ball in bodies}
    assert len(table["n"])
    for row in range(len(table["n"])):
        for end in "ab":
            ball, s = int(table[f"ball_{end}"][row]), float(table[f"s_{end}"][row])
            for when in ("pre", "post"):
                energy = float(table[f"energy_{end}_{when}"][row])
                regime = table[f"regime_{end}_{when}"][row]
                assert regime == expected_regime(name, ball, s, energy)
                side = expected_side(portraits[ball], s, energy)
                assert table[f"eight_{end}_{when}"][row] == side


def test_every_word_occurs() -> None:
    found = {
        str(word)
        for name in RUNS
        for column in ("regime_a_pre", "regime_b_post", "eight_a_post", "eight_b_pre")
        for word in run_of(name).collisions[column]
    }
    words = {"oscillating", "progressive", "left loop", "right loop", "outside", "none"}
    assert found == words


def test_balls_on_a_circle_jump_between_oscillation_and_progression() -> None:
    """B III.3.5: open and closed phase trajectories, and the jumps between them."""
    table = run_of("one_circle").collisions
    jumps = [
        int(n)
        for n, before, after in zip(
            table["n"], table["regime_b_pre"], table["regime_b_post"], strict=True
        )
        if before != after
    ]
    assert jumps[:2] == [1, 3]


def ring(turn: int) -> tuple[Run, dict[int, str]]:
    """Two balls in the ring, its seam before one of its pieces; which ball is in which lobe."""
    order = [(turn + step) % 4 for step in range(4)]
    slope = BEGINS[turn]
    arcs: list[dict[str, Any]] = []
    for index in order:
        shape, radius, turned = PIECES[index]
        slope += turned
        arcs.append({"shape": shape, "radius": radius, "end_slope": math.radians(slope)})
    balls: list[tuple[int, str, dict[str, Any]]] = []
    # from the bottoms of the lobes (rad), towards one another; a whole turn on where slopes are
    for index, angle, speed, density in ((1, 0.2, -2.9, 2700), (3, -0.5, 1.0, 2700)):
        place = order.index(index)
        high = arcs[place]["end_slope"]
        turns = math.floor((high - angle) / math.tau) * math.tau
        ball: dict[str, Any] = {
            "radius": 0.1,
            "density": density,
            "arc": place + 1,
            "angle": angle + turns,
        }
        balls.append((place, "right" if index == 1 else "left", {**ball, "speed": speed}))
    balls.sort(key=lambda one: one[0])
    trace = {"start_slope": math.radians(BEGINS[turn]), "closed": True, "arcs": arcs}
    document = scene(trace, [ball for _, _, ball in balls], 1.0, "hedrih", collisions=6, time=30.0)
    document["collision"]["inadmissible"] = "normal-impulse"
    return solve_any(document), {n: lobe for n, (_, lobe, _) in enumerate(balls, 1)}


def words_of(turn: int) -> list[dict[str, list[str]]]:
    """Return the words of both balls for each impact, by their lobes."""
    run, lobes = ring(turn)
    table = run.collisions
    return [
        {
            lobes[int(table[f"ball_{end}"][row])]: [
                str(table[f"{prefix}_{end}_{when}"][row])
                for prefix in ("regime", "eight")
                for when in ("pre", "post")
            ]
            for end in "ab"
        }
        for row in range(len(table["n"]))
    ]


def test_the_seam_of_a_closed_trace_changes_no_word() -> None:
    first = words_of(0)  # its seam is within the figure eight
    assert {word for impact in first for words in impact.values() for word in words} >= {
        "left loop", "right loop", "outside", "oscillating",
    }  # fmt: skip
    for turn in (1, 2, 3):
        assert words_of(turn) == first


BALLS = ((-1.0, 0.6), (0.5, -0.3))
"""Angles (rad) and speeds (m/s): outside the figure eight, and within its right loop."""


def turning_words(start: float, cuts: list[float], closed: bool) -> list[tuple[str, ...]]:
    """Regimes and sides of two balls in a valley that turns on its axis, cut at some angles."""
    ends = [*cuts, start + math.tau if closed else -start]
    arcs = [{"shape": "valley", "radius": 1.0, "end_slope": end} for end in ends]
    balls = []
    for place, speed in BALLS:
        angle = place + (math.tau if place < start else 0.0)
        arc = 1 + sum(cut <= angle for cut in cuts)
        balls.append({"radius": 0.05, "mass": 1.0, "arc": arc, "angle": angle, "speed": speed})
    turning = {"through_arc": 1, "rate": 3.6}
    trace = {"start_slope": start, "closed": closed, "arcs": arcs, "turning": turning}
    balls.sort(key=lambda ball: ball["angle"])
    run = solve_any(scene(trace, balls, 0.9, "hedrih", collisions=8, time=20.0))
    table = run.collisions
    columns = [f"{name}_{end}_pre" for name in ("regime", "eight") for end in "ab"]
    order = -1 if closed and start > BALLS[0][0] else 1  # the first ball is the second one there
    return [
        tuple(
            str(table[column][row])
            for pair in (columns[:2], columns[2:])
            for column in pair[::order]
        )
        for row in range(len(table["n"]))
    ]


@pytest.mark.parametrize("cut", [0.0, 1e-13, -1e-11, 1e-9, 1e-7, 0.3, -0.648843])
def test_a_cut_changes_no_word(cut: float) -> None:
    whole = turning_words(math.radians(-80.0), [], closed=False)
    assert {word for row in whole for word in row} >= {"outside", "left loop", "right loop"}
    assert turning_words(math.radians(-80.0), [cut], closed=False) == whole


@pytest.mark.parametrize(("start", "cuts"), [(0.0, []), (0.0, [math.pi]), (-1.0, [0.0, 2.0])])
def test_the_seam_of_a_turning_circle_changes_no_word(start: float, cuts: list[float]) -> None:
    whole = turning_words(-math.pi, [], closed=True)
    assert {word for row in whole for word in row} >= {"outside", "left loop", "right loop"}
    assert turning_words(start, cuts, closed=True) == whole


@pytest.mark.parametrize("cut", [0.0, 1e-13, -1e-10, 1e-8, 0.2])
def test_a_cut_beside_a_crest_at_rest_changes_no_word(cut: float) -> None:
    path = FOLDER / "three_arcs.toml"
    crest = tomllib.loads(path.read_text())
    (left, hump, right) = crest["trace"]["arcs"]
    crest["trace"]["arcs"] = [left, hump | {"end_slope": cut}, hump, right]
    crest["balls"][1]["arc"] = 4
    crest["name"] = "cut"
    short = {"time": 60.0, "collisions": 60}
    table = simulate(scenario_of(crest | {"stop": short})).collisions
    whole = run_of("three_arcs").collisions
    for column in ("eight_a_pre", "eight_a_post", "eight_b_pre", "eight_b_post"):
        assert list(table[column]) == list(whole[column])


@pytest.mark.parametrize(
    ("radius", "rate"), [(1.0, 0.4), (0.9, 0.4), (1.7, 0.2), (1.2, 0.2), (1.5, 0.3)]
)
def test_a_line_that_balances_where_it_meets_a_valley_makes_no_eight(
    radius: float, rate: float
) -> None:
    """The potential falls along the line and rises in the valley: one centre, and one at the top.

    The place where the line balances is its end, but for rounding, which put it within.
    """
    ends = (math.pi, math.tau)
    arcs: list[dict[str, Any]] = []
    for end in ends:
        arcs += [
            {"shape": "valley", "radius": radius, "end_slope": end},
            {"shape": "line", "length": 1.9},
        ]
    turning = {"through_arc": 1, "rate": rate}
    trace = {"start_slope": 0.0, "closed": True, "arcs": arcs, "turning": turning}
    run = solve_any(scene(trace, [ball(1.0), ball(2.5)], 1.0, collisions=2))
    kinds = [point.kind for point in portrait_of(Landscape.of(run.system, 1)).points]
    assert kinds == ["degenerate", "saddle", "centre"]
    assert {str(word) for word in run.collisions["eight_a_pre"]} == {"none"}
