"""Derivatives of instants of impacts with respect to numbers of a scenario, by 50 digits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import mpmath
import numpy as np
import pytest

from tests.highprecision.reference_solver import ReferenceSolver, events_of
from tests.systems.trace.test_tangents import SCENES
from vibro_cli import example, simulate
from vibro_cli.analysis import impact_times as module
from vibro_cli.analysis.impact_times import NoDerivative, impact_times, number_at
from vibro_cli.assemble import build_system
from vibro_cli.scenario import Scenario, scenario_of
from vibro_cli.scenario.problems import parsed_path
from vibro_cli.stress.oracles.oracle import Oracle
from vibro_cli.stress.oracles.scene import Scene, chain, scene_of_system
from vibro_cli.stress.scenes import CIRCLE, THREE_ARCS, VALLEY, ball, scene
from vibro_cli.systems.driver import ENGINES
from vibro_cli.systems.run import begun
from vibro_cli.systems.trace import simulate_system

CHANGE = mpmath.mpf(10) ** -18
LATEST = 1000.0
SHAPES = {1: "valley", -1: "hump", 0: "line"}


def _body(scene: Scene, number: int, **changes: Any) -> Scene:
    bodies = list(scene.bodies)
    bodies[number] = replace(bodies[number], **changes)
    return replace(scene, bodies=tuple(bodies))


def _start(scene: Scene, number: int, part: int, by: Any) -> Scene:
    starts = [list(one) for one in scene.starts]
    starts[number][part] += by
    return replace(scene, starts=tuple((one[0], one[1], one[2]) for one in starts))


def _trace(scene: Scene, number: int, radius: Any = 0, slope: Any = 0) -> Scene:
    """Return the scene with one radius, length or end slope of a piece changed."""
    shapes = []
    for index, piece in enumerate(scene.pieces):
        own = index == number
        shapes.append((
            SHAPES[piece.sign], piece.size + own * radius, piece.slopes[1] + own * slope
        ))  # fmt: skip
    return replace(scene, pieces=chain(scene.pieces[0].slopes[0], shapes))


VARIED: dict[str, Callable[[Scene, Any], Scene]] = {
    "collision.k": lambda one, h: replace(one, restitution=tuple(k + h for k in one.restitution)),
    "gravity": lambda one, h: replace(one, gravity=one.gravity + h),
    "balls[1].mass": lambda one, h: _body(one, 0, mass=one.bodies[0].mass + h),
    "balls[2].mass": lambda one, h: _body(one, 1, mass=one.bodies[1].mass + h),
    "balls[1].radius": lambda one, h: _body(one, 0, radius=one.bodies[0].radius + h),
    "balls[2].radius": lambda one, h: _body(one, 1, radius=one.bodies[1].radius + h),
    "balls[1].angle": lambda one, h: _start(one, 0, 1, h),
    "balls[2].speed": lambda one, h: _start(one, 1, 2, h),
    "trace.arcs[1].radius": lambda one, h: _trace(one, 0, radius=h),
    "trace.arcs[1].end_slope": lambda one, h: _trace(one, 0, slope=h),
    "trace.arcs[2].length": lambda one, h: _trace(one, 1, radius=h),
    "trace.arcs[3].radius": lambda one, h: _trace(one, 2, radius=h),
    "ends.left.wall": lambda one, h: replace(one, walls=(one.walls[0] + h, one.walls[1])),
}
EVERYWHERE = tuple(VARIED)[:7]
OF = {
    "circle": (*EVERYWHERE, "balls[2].speed"),
    "rotation": (*EVERYWHERE, "balls[2].speed"),
    "valley of three": (*EVERYWHERE, "trace.arcs[1].radius"),
    "arcs": (*EVERYWHERE, "trace.arcs[1].end_slope", "trace.arcs[3].radius"),
    "hedrih": tuple(VARIED),
    "normal-impulse": tuple(VARIED),
    "translational": tuple(VARIED),
}

# A sine that is zero changes: that of a body's position at the bottom, or of a level line's slope.
LEVEL = {
    "start_slope": "-120 deg",
    "arcs": [
        {"shape": "valley", "radius": 0.8, "end_slope": 0.0},
        {"shape": "line", "length": 1.5},
        {"shape": "valley", "radius": 1.0, "end_slope": "120 deg"},
    ],
}
AT_ZERO = {
    "bottom": scene(CIRCLE, [ball(0.0), ball(0.7, mass=3.0)], 0.9, collisions=3),
    "level": scene(
        LEVEL, [ball(-1.1), {"radius": 0.1, "mass": 2.0, "arc": 2, "position": 0.9}], 0.9,
        collisions=3,
    ),
}  # fmt: skip
OF |= {
    "bottom": EVERYWHERE,
    "level": (*EVERYWHERE, "trace.arcs[1].end_slope", "trace.arcs[2].length"),
}


@pytest.mark.parametrize(
    ("name", "paths"),
    [
        ("bottom", ["collision.k"]),
        *(pytest.param(name, paths, marks=pytest.mark.long) for name, paths in OF.items()),
    ],
)
def test_they_are_differences_of_motions_in_50_digits(name: str, paths: Sequence[str]) -> None:
    document = (SCENES | AT_ZERO)[name]
    scenario = scenario_of(document)
    system, count = build_system(scenario), document["stop"]["collisions"]
    found = impact_times(scenario, system, list(map(parsed_path, paths)), count, LATEST)
    told, own = events_of(simulate_system(system, None, count)), scene_of_system(system)
    assert len(found.t) == count
    here = ReferenceSolver(own).follow(told)
    columns = []
    for key in paths:  # the difference to one side errs by about CHANGE, far below the bound
        ahead = ReferenceSolver(VARIED[key](own, CHANGE)).follow(told)
        columns.append([(one.t - at.t) / CHANGE for one, at in zip(ahead, here, strict=True)])
    exact = np.array(columns, dtype=float).T
    error = np.abs(found.derivative - exact) / np.max(np.abs(exact))
    assert np.max(error) < 1e-10, dict(zip(paths, np.max(error, axis=0), strict=True))


@pytest.mark.parametrize("name", OF)
def test_both_engines_give_the_same_bits(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = scenario_of((SCENES | AT_ZERO)[name])
    system, paths = build_system(scenario), list(map(parsed_path, OF[name]))
    found = {}
    for engine in ENGINES:
        monkeypatch.setattr(module, "begun", partial(begun, engine=engine))
        found[engine] = impact_times(scenario, system, paths, 8, LATEST)
    one, other = (found[engine] for engine in ENGINES)
    assert (one.word, one.end_cause) == (other.word, other.end_cause)
    for field in ("t", "pairs", "derivative"):
        assert getattr(one, field).tobytes() == getattr(other, field).tobytes()


def test_density_stands_for_mass_and_radius_for_both() -> None:
    """By the chain rule: the mass of a ball is 4/3 pi r^3 times its density."""
    balls = [ball(-0.7, mass=2.0), {"radius": 0.1, "density": 2700.0, "arc": 1, "angle": 0.4}]
    dense = scenario_of(scene(CIRCLE, balls, 0.9, collisions=5))
    mass = 4.0 / 3.0 * np.pi * 0.1**3 * 2700.0
    heavy = scenario_of(scene(CIRCLE, [balls[0], ball(0.4, mass=mass)], 0.9, collisions=5))
    ours = impact_times(
        dense, build_system(dense),
        [parsed_path("balls[2].density"), parsed_path("balls[2].radius")], 5, LATEST,
    ).derivative  # fmt: skip
    theirs = impact_times(
        heavy, build_system(heavy),
        [parsed_path("balls[2].mass"), parsed_path("balls[2].radius")], 5, LATEST,
    ).derivative  # fmt: skip
    np.testing.assert_allclose(ours[:, 0], theirs[:, 0] * mass / 2700.0, rtol=1e-9)
    expected = theirs[:, 1] + theirs[:, 0] * 3.0 * mass / 0.1
    np.testing.assert_allclose(ours[:, 1], expected, rtol=1e-9)


def test_late_impacts_obey_similarity_and_are_differences_of_motions() -> None:
    """From rest ``T^2`` is a length over g, and ratios of masses are what matters of them."""
    count, path = 20_000, "balls[2].angle"
    scenario = scenario_of(scene(VALLEY, [ball(-0.6), ball(0.31)], 1.0, collisions=count))
    lengths = ["trace.arcs[1].radius", "balls[1].radius", "balls[2].radius"]
    masses = ["balls[1].mass", "balls[2].mass"]
    paths = list(map(parsed_path, [*lengths, *masses, "gravity", path]))
    found = impact_times(scenario, build_system(scenario), paths, count, None)
    scale = np.array([number_at(scenario, one) for one in paths])
    changes = found.derivative * scale
    rounding = 1e-9 * np.max(np.abs(changes))
    np.testing.assert_allclose(np.sum(changes[:, :3], axis=1), 0.5 * found.t, atol=rounding)
    np.testing.assert_allclose(np.sum(changes[:, 3:5], axis=1), 0.0, atol=rounding)
    np.testing.assert_allclose(changes[:, 5], -0.5 * found.t, atol=rounding)
    step = 2e-6
    ahead, back, far, behind = (
        np.array(simulate(scenario.replace({path: 0.31 + n * step})).collisions["t"])
        for n in (1, -1, 2, -2)
    )
    differences = (8.0 * (ahead - back) - (far - behind)) / (12.0 * step)
    error = np.max(np.abs(found.derivative[:, 6] - differences))
    assert error < 1e-7 * np.max(np.abs(differences))


def test_two_pairs_may_collide_at_one_instant() -> None:
    """Mirror images collide together, so that k changes both times alike and a mass its own."""
    balls = [ball(-0.7), ball(0.3), ball(-0.3, arc=3), ball(0.7, arc=3)]
    scenario = scenario_of(scene(THREE_ARCS, balls, 0.9, collisions=6))
    paths = list(map(parsed_path, ["collision.k", "balls[1].mass", "balls[4].mass"]))
    found = impact_times(scenario, build_system(scenario), paths, 6, LATEST)
    assert found.word == ("12", "34") * 3
    one, other = found.derivative[::2], found.derivative[1::2]
    assert np.array_equal(found.t[::2], found.t[1::2])
    assert np.all(one[1:, :2] != 0.0)
    np.testing.assert_allclose(one, other[:, [0, 2, 1]], rtol=1e-12, atol=1e-15)


ROLLED = {"left": {"wall": 0.5}, "right": {"wall": 1.0}}
LINE: dict[str, Any] = {"shape": "line", "length": 4.0}
LEVEL_LINE = {"start_slope": 0.0, "arcs": [LINE]}
BESIDE = {
    "line": LINE,
    "valley": {"shape": "valley", "radius": 3.0, "end_slope": "80 deg"},
    "hump": {"shape": "hump", "radius": 3.0, "end_slope": "-20 deg"},
}


def _along(position: float, speed: float, radius: float = 0.125, mass: float = 1.0) -> Any:
    return {"radius": radius, "mass": mass, "arc": 1, "position": position, "speed": speed}


def _chased(law: str, beside: str, radius: float) -> dict[str, Any]:
    """Body 2 is reached at 1 s, as it crosses the junction of a level line."""
    reach = 2.0 * np.sqrt(0.125 * radius)
    trace = {"start_slope": 0.0, "arcs": [LINE, BESIDE[beside]]}
    balls = [_along(2.0 - reach, 2.0), _along(3.0, 1.0, radius, 2.0)]
    document = scene(trace, balls, 0.9, law, time=30.0) | {"ends": ROLLED}
    document["collision"]["inadmissible"] = "normal-impulse"
    return document


VARIED |= {
    "balls[1].position": VARIED["balls[1].angle"],
    "balls[1].speed": lambda one, h: _start(one, 0, 2, h),
    "trace.arcs[1].length": VARIED["trace.arcs[1].radius"],
    "ends.right.wall": lambda one, h: replace(one, walls=(one.walls[0], one.walls[1] + h)),
}


def _sides(system: Any, paths: Sequence[str], count: int) -> list[list[list[float]]]:
    """Differences of the oracle's motions, which are not told the order of events: both sides."""
    own, change = scene_of_system(system), mpmath.mpf(10) ** -15

    def instants(scene: Scene) -> list[Any]:
        return [one.t for one in Oracle.of(system, scene=scene).impacts(count, LATEST)[:count]]

    here, sides = instants(own), []
    for path in paths:
        ahead, back = (instants(VARIED[path](own, sign * change)) for sign in (1, -1))
        steps = zip(here, ahead, back, strict=True)
        sides.append([[float((f - t) / change), float((t - b) / change)] for t, f, b in steps])
    return sides


def _compare(document: dict[str, Any], paths: Sequence[str], count: int) -> None:
    scenario = scenario_of(document)
    system = build_system(scenario)
    found = impact_times(scenario, system, list(map(parsed_path, paths)), count, LATEST)
    for column, own in zip(found.derivative.T, _sides(system, paths, count), strict=True):
        sides = np.array(own).T
        for side in sides:
            np.testing.assert_allclose(column, side, atol=1e-10 * np.max(np.abs(sides)) + 1e-25)


@pytest.mark.parametrize(
    ("law", "beside", "radius"),
    [
        ("hedrih", "line", 0.125), ("hedrih", "valley", 0.125), ("hedrih", "hump", 0.5),
        ("translational", "valley", 0.5), ("normal-impulse", "line", 0.5),
        ("normal-impulse", "valley", 0.125),
    ],
)  # fmt: skip
def test_an_impact_of_a_body_at_a_junction_has_derivatives(
    law: str, beside: str, radius: float
) -> None:
    """Slopes are continuous, so that times and speeds are smooth even if the curvature jumps."""
    paths = [
        "balls[1].speed", "balls[2].speed", "balls[2].mass", "balls[1].radius", "collision.k",
        "gravity", "trace.arcs[1].length",
    ]  # fmt: skip
    _compare(_chased(law, beside, radius), paths, 3)


def test_an_impact_between_two_lines_has_derivatives() -> None:
    trace = {"start_slope": 0.0, "arcs": [LINE, LINE]}
    balls = [_along(1.75, 2.0), _along(3.0, 1.0, 0.125)]
    _compare(scene(trace, balls, 0.5, time=9.0), ["balls[1].speed"], 1)


@pytest.mark.parametrize("beside", ["valley", "hump"])
def test_normals_of_an_impact_at_a_jump_of_curvature_are_differentiable_on_one_side(
    beside: str,
) -> None:
    document = _chased("normal-impulse", beside, 0.5)
    _refused(document, "balls[1].speed", "balls.1..speed: derivatives differ .* body 2 is at 1 s")
    (sides,) = _sides(build_system(scenario_of(document)), ["balls[1].speed"], 2)
    left, right = sides[1]
    assert abs(left - right) > 0.05 * max(abs(left), abs(right))
    _compare(document, ["collision.k"], 3)  # moves no body before the impact


def test_a_body_that_rests_at_a_jump_of_curvature_is_differentiable_on_one_side() -> None:
    trace = {"start_slope": 0.0, "arcs": [LINE, BESIDE["valley"]]}
    document = scene(trace, [_along(1.0, 2.0), _along(4.0, 0.0)], 0.9, time=30.0)
    _refused(document, "balls[2].speed", "derivatives differ .* body 2 is at 0 s", 2)
    (sides,) = _sides(build_system(scenario_of(document)), ["balls[2].speed"], 2)
    left, right = sides[0]
    assert abs(left - right) > 0.05 * max(abs(left), abs(right))
    _compare(document, ["balls[1].speed", "gravity", "collision.k"], 2)


DOWNHILL = {
    "stops at a junction": (
        scene(
            {"start_slope": "-10 deg", "arcs": [LINE, BESIDE["valley"]]},
            [_along(4.0, 0.0), {"radius": 0.125, "mass": 1.0, "arc": 2, "angle": 0.9}],
            0.9, time=30.0,
        ) | {"ends": ROLLED},
        ["gravity", "balls[1].speed", "balls[1].radius", "collision.k"],
        3,
    ),
    "held by a wall": (
        scene(
            {"start_slope": "-10 deg", "arcs": [LINE | {"length": 6.0}]},
            [_along(1.0, 0.0, 0.1), _along(5.0, 0.0, 0.1)], 0.5, time=30.0,
        ) | {"ends": {"right": {"wall": 0.0}}},
        ["gravity", "balls[1].position", "balls[2].radius"],
        1,
    ),
    "leans on a wall": (
        scene(
            {"start_slope": "10 deg", "arcs": [LINE]},
            [_along(0.125, 0.0), _along(3.375, -3.0)], 0.5, time=30.0,
        ) | {"ends": {"left": {"wall": 0.5}}},
        ["gravity", "balls[2].speed"],
        1,
    ),
    "a steeper valley": (
        scene(
            {
                "start_slope": "-10 deg",
                "arcs": [
                    LINE | {"length": 6.0},
                    {"shape": "valley", "radius": 1.0, "end_slope": "70 deg"},
                ],
            },
            [_along(6.0, 0.0, 0.1), ball(0.9, arc=2)], 0.9, time=9.0,
        ),
        ["gravity"],
        3,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", DOWNHILL)
def test_a_body_without_speed_at_an_end_of_its_piece_has_derivatives(name: str) -> None:
    _compare(*DOWNHILL[name])


@pytest.mark.parametrize(
    "start",
    [{"arc": 1, "position": 4.0, "speed": 1.0}, {"arc": 2, "angle": 0.0, "speed": -1.0}],
)
def test_a_body_may_begin_on_the_piece_beside_its_own(start: dict[str, Any]) -> None:
    """On a longer line it is before the junction, or moves with it."""
    trace = {"start_slope": 0.0, "arcs": [LINE, BESIDE["valley"]]}
    balls = [_along(1.0, 2.0), {"radius": 0.125, "mass": 1.0} | start]
    document = scene(trace, balls, 0.9, time=30.0, collisions=2) | {"ends": {"left": {"wall": 1.0}}}
    _compare(document, ["balls[1].speed", "balls[2].speed", "gravity", "balls[2].radius"], 2)
    scenario, path, change = scenario_of(document), "trace.arcs[1].length", 1e-7
    found = impact_times(scenario, build_system(scenario), [parsed_path(path)], 2, LATEST)
    longer = simulate(scenario.replace({path: 4.0 + change})).collisions["t"]
    expected = (np.array(longer) - found.t) / change
    np.testing.assert_allclose(found.derivative[:, 0], expected, rtol=1e-5)


def _refused(document: dict[str, Any], path: str, words: str, count: int = 50) -> None:
    scenario = scenario_of(document)
    with pytest.raises(NoDerivative, match=words):
        impact_times(scenario, build_system(scenario), [parsed_path(path)], count, 20.0)


def test_where_there_is_no_derivative_the_reason_is_told() -> None:
    three = [ball(-0.6), ball(0.0), ball(0.6)]
    _refused(
        scene(VALLEY, [ball(-0.5), ball(0.3)], 0.3, time=9.0), "collision.k", "lasting contact"
    )
    _refused(scene(VALLEY, three, 1.0, collisions=2), "balls[1].mass", "several impacts", 2)
    _refused(scene(CIRCLE, [ball(0.1), ball(0.4)], collisions=2), "balls[1].density", "no number")
    _refused(scene(CIRCLE, [ball(0.1), ball(0.4)], collisions=2), "balls[1].body", "no number")
    struck = DOWNHILL["held by a wall"][0]
    _refused(struck, "gravity", "several impacts at one instant or lasting contact at 2.77944654 s")
    against = scene(
        LEVEL_LINE, [_along(x, v) for x, v in ((1.125, -1.0), (3.375, -3.0))], 0.5, time=9.0
    )
    against |= {"ends": ROLLED}
    _refused(against, "balls[1].mass", "several impacts at one instant or lasting contact at 1 s")
    turning = THREE_ARCS | {"turning": {"x": 1.0, "rate": 1.0}}
    _refused(scene(turning, [ball(-1.3), ball(0.9, arc=3)], time=9.0), "collision.k", "turns")


def test_of_unequal_numbers_of_a_list_one_has_to_be_named() -> None:
    scenario = example("closed_three_balls").replace({"collision.k": [0.9, 0.8, 0.9]})
    assert isinstance(scenario, Scenario)
    words = r"^collision\.k: found 3 unequal numbers, expected one, such as collision\.k\[1\]$"
    with pytest.raises(NoDerivative, match=words):
        number_at(scenario, parsed_path("collision.k"))
    assert number_at(scenario, parsed_path("collision.k[2]")) == 0.8
    same = scenario.replace({"collision.k[2]": 0.9})
    assert number_at(same, parsed_path("collision.k")) == 0.9
