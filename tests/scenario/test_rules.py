"""The models and the rules between their fields."""

from __future__ import annotations

import math
import pickle
from typing import Any

import pytest
from pydantic import ValidationError

from tests.scenario import cases
from tests.scenario.cases import arc, bad, bad_paths, ball, data, good
from tests.scenario.texts import parse_any
from vibro_cli.scenario import Scenario, load_any, scenario_of
from vibro_cli.scenario.gallery import names, text
from vibro_cli.scenario.models import Arc, Ball, Collision, Stop, Trace, Wall


@pytest.mark.parametrize(
    ("name", "accepted"),
    [("x", True), ("x" * 100, True), ("", False), ("x" * 101, False), ("é" * 100, True),
     ("€" * 67, False), ("a/b", False), (" x", False), ("..", False)],
)  # fmt: skip
def test_a_name_has_1_to_100_characters_and_at_most_200_bytes(name: str, accepted: bool) -> None:
    if accepted:
        assert good(data(name=name)).name == name
    else:
        assert bad_paths(data(name=name)) == ["name"]


@pytest.mark.parametrize("key", ["axes", "base", "scenario"])
def test_one_key_of_a_grid_does_not_make_a_grid_of_a_scenario(key: str) -> None:
    assert bad_paths(data() | {key: "x"}) == [key]


def test_defaults_are_those_of_the_interface() -> None:
    scenario = good(data())
    assert scenario.name == "scenario"
    assert scenario.trace.closed is False
    assert scenario.trace.surface == "two-sided"
    assert scenario.trace.turning is None
    assert scenario.balls[0].body == "ball"
    assert scenario.balls[0].rate == 0.0
    assert scenario.collision.law == "hedrih"
    assert scenario.collision.inadmissible == "stop"
    assert scenario.ends.left == scenario.ends.right == "stop"
    assert scenario.output.turning_points is False
    assert scenario.output.step is None
    assert scenario.output.times is None
    assert scenario.output.friction is None


def test_units_are_converted() -> None:
    changed = data(1, gravity="981 cm/s^2")
    changed["balls"] = [ball(radius="12 cm", density="7.8 g/cm^3", angle="60 deg", rate="30 rpm")]
    scenario = good(changed)
    assert scenario.gravity == 9.81
    first = scenario.balls[0]
    assert (first.radius, first.density, first.rate) == (0.12, 7800.0, math.pi)
    assert first.angle == pytest.approx(math.pi / 3, rel=1e-15)


@pytest.mark.parametrize(
    ("source", "pairs"),
    [
        (data(1), 0),
        (data(2), 1),
        (data(5), 4),
        (cases.closed(1), 0),
        (cases.closed(2), 1),
        (cases.closed(3), 3),
        (cases.closed(5), 5),
    ],
)
def test_k_is_one_for_each_pair_of_neighbours(source: dict[str, Any], pairs: int) -> None:
    assert good(source).collision.k == (0.9,) * pairs
    values = [0.1 * (i + 1) for i in range(pairs)]
    assert good({**source, "collision": {"k": values}}).collision.k == tuple(values)
    assert bad_paths({**source, "collision": {"k": [*values, 1.0]}}) == ["collision.k"]


def test_a_lone_body_needs_no_collision() -> None:
    source = data(1)
    del source["collision"]
    assert good(source).collision == Collision()
    source = data(2)
    del source["collision"]
    assert bad_paths(source) == ["collision"]
    assert bad_paths({**source, "collision": {}}) == ["collision.k"]


@pytest.mark.parametrize(
    ("changes", "path"),
    [
        ({"density": None}, "balls[1]"),
        ({"mass": 1.0}, "balls[1].mass"),
        ({"angle": None}, "balls[1]"),
        ({"position": 0.1}, "balls[1].position"),
        ({"angle": None, "position": 0.1}, "balls[1].position"),
        ({"rate": 1.0, "omega": 1.0}, "balls[1].omega"),
        ({"omega": 1.0, "speed": 1.0}, "balls[1].speed"),
        ({"inertia_ratio": 0.5}, "balls[1].density"),
        (
            {"inertia_ratio": 0.5, "density": None, "mass": 1, "body": "hoop"},
            "balls[1].body",
        ),
        ({"body": "disk"}, "balls[1].thickness"),
        ({"body": "hoop"}, "balls[1].thickness"),
        ({"body": "hollow_ball"}, "balls[1].thickness"),
        ({"radius": 0}, "balls[1].radius"),
        ({"radius": -0.0}, "balls[1].radius"),
        ({"radius": 0, "body": "particle"}, "balls[1].density"),
        ({"arc": 2}, "balls[1].arc"),
        ({"arc": 0}, "balls[1].arc"),
        ({"arc": True}, "balls[1].arc"),
        ({"angle": 2.1}, "balls[1].angle"),
        ({"angle": None, "touching": "previous"}, "balls[1].touching"),
        ({"thickness": 0.0}, "balls[1].thickness"),
        ({"mass": None, "density": float("nan")}, "balls[1].density"),
        ({"angle": "1 m"}, "balls[1].angle"),
        ({"color": "red"}, "balls[1].color"),
    ],
)
def test_a_ball_that_cannot_be(changes: dict[str, Any], path: str) -> None:
    source = data(1, balls=[ball(**changes)])
    assert path in bad_paths(source)


@pytest.mark.parametrize(
    "changes",
    [
        {"body": "disk", "thickness": 0.02},
        {"body": "hoop", "density": None, "mass": 1},
        {"body": "particle", "radius": 0, "density": None, "mass": 1.0},
        {"inertia_ratio": 0, "density": None, "mass": 1},
        {"omega": "30 rpm"},
        {"speed": -1},
        {"angle": 2.0},
    ],
)
def test_a_ball_that_can_be(changes: dict[str, Any]) -> None:
    assert good(data(1, balls=[ball(**changes)])).balls[0].arc == 1


def test_inertia_ratio_takes_the_place_of_the_body() -> None:
    source = data(1, balls=[ball(inertia_ratio=0.6, density=None, mass=2)])
    first = good(source).balls[0]
    assert (first.body, first.inertia_ratio) == (None, 0.6)


def test_a_body_on_a_line_has_a_position_and_a_speed() -> None:
    trace = {"start_slope": 0.1, "arcs": [{"shape": "line", "length": 2}, arc("valley", 1)]}
    on_line = ball(angle=None, position=0)
    scenario = good(data(2, trace=trace, balls=[on_line, ball(arc=2, angle=0.1)]))
    assert scenario.balls[0].speed == 0.0
    assert scenario.balls[0].rate is None
    assert scenario.trace.arcs[0].end_slope is None
    assert good(data(1, trace=trace, balls=[{**on_line, "position": 2.0}])).balls[0].position == 2
    for changes in ({"position": 2.1}, {"position": -0.1}, {"rate": 0.0}, {"angle": 0.0}):
        (key,) = changes
        assert bad_paths(data(1, trace=trace, balls=[on_line | changes])) == [f"balls[1].{key}"] * (
            2 if key == "angle" else 1  # beside the position, and on a line
        )


@pytest.mark.parametrize(
    ("shape", "end", "is_good"),
    [
        ("valley", 0.3, True),
        ("valley", 0.2, False),
        ("valley", 0.1, False),
        ("hump", 0.1, True),
        ("hump", 0.2, False),
        ("hump", 0.3, False),
    ],
)
def test_slopes_turn_the_way_the_shape_says(shape: str, end: float, is_good: bool) -> None:
    arcs = [{"shape": "line", "length": 1.0}, arc(shape, end)]
    source = data(1, trace={"start_slope": 0.2, "arcs": arcs}, balls=[ball(angle=None, position=0)])
    if is_good:
        assert good(source).trace.arcs[1].end_slope == end
    else:
        assert bad_paths(source) == ["trace.arcs[2].end_slope"]


def test_angles_on_a_hump_are_the_negative_slopes() -> None:
    trace = {"start_slope": "30 deg", "arcs": [arc("hump", "-50 deg")]}
    for angle in ("-30 deg", "50 deg", 0.0):
        good(data(1, trace=trace, balls=[ball(angle=angle)]))
    for angle in ("-31 deg", "51 deg"):
        assert bad_paths(data(1, trace=trace, balls=[ball(angle=angle)])) == ["balls[1].angle"]


@pytest.mark.parametrize(
    ("turning", "path"),
    [
        ({"rate": 3.0}, "trace.turning"),
        ({"rate": 3.0, "x": 1.0, "through_arc": 1}, "trace.turning.through_arc"),
        ({"through_arc": 1}, "trace.turning.rate"),
        ({"through_arc": 2, "rate": 1.0}, "trace.turning.through_arc"),
        (None, "trace.turning"),
        (3.0, "trace.turning"),
    ],
)
def test_turning_that_cannot_be(turning: Any, path: str) -> None:
    source = data(1)
    source["trace"] = {**source["trace"], "turning": turning}
    assert bad_paths(source) == [path]


def test_turning_about_an_arc_or_a_place() -> None:
    for turning in ({"through_arc": 1, "rate": 3.0}, {"x": "-10 cm", "rate": "30 rpm"}):
        source = data(1)
        source["trace"] = {**source["trace"], "turning": turning}
        assert good(source).resolved()["trace"]["turning"].keys() == turning.keys()


@pytest.mark.parametrize(
    ("part", "value", "path"),
    [
        ("stop", {}, "stop"),
        ("stop", {"time": 0}, "stop.time"),
        ("stop", {"collisions": 0}, "stop.collisions"),
        ("stop", {"collisions": 2**63}, "stop.collisions"),
        ("stop", None, "stop"),
        ("ends", {"left": {"wall": 1.1}}, "ends.left.wall"),
        ("ends", {"left": {}}, "ends.left.wall"),
        ("ends", {"left": {"wall": 1, "k": 1}}, "ends.left.k"),
        ("ends", {"right": "wall"}, "ends.right"),
        ("ends", {"right": 0.8}, "ends.right"),
        ("ends", {"right": None}, "ends.right"),
        ("output", {"times": [1.0, 0.5]}, "output.times[2]"),
        ("output", {"times": [-1.0]}, "output.times[1]"),
        ("output", {"times": None}, "output.times"),
        ("output", {"times": 3.0}, "output.times"),
        ("output", {"step": 0}, "output.step"),
        ("output", {"step": 1, "times": [1]}, "output.times"),
        ("output", {"step": "1e-17 ns"}, "output.step"),
        ("output", {"friction": -1}, "output.friction"),
        ("output", {"turning_points": 1}, "output.turning_points"),
        ("balls", [], "balls"),
        ("balls", {}, "balls"),
        ("balls", [3], "balls[1]"),
        ("gravity", 0, "gravity"),
        ("gravity", None, "gravity"),
        ("name", "a/b", "name"),
        ("name", "..", "name"),
        ("name", "", "name"),
        ("colour", 1, "colour"),
    ],
)
def test_what_cannot_be(part: str, value: Any, path: str) -> None:
    assert path in bad_paths(data(**{part: value}))


def test_all_problems_come_at_once_with_a_suggestion() -> None:
    source = data(2, gravity="9.81 kg")
    source["balls"][1] = {"radius": -1, "desnity": 1.0, "arc": 3, "angle": 0}
    source["trace"]["arcs"].append(arc("valley", 1.0))
    problems = {problem.path: problem for problem in bad(source)}
    assert set(problems) == {
        "gravity",
        "balls[2].radius",
        "balls[2].desnity",
        "balls[2].arc",
        "balls[2]",
        "trace.arcs[2].end_slope",
    }
    assert problems["gravity"].found == '"9.81 kg"'
    assert problems["gravity"].expected.startswith("an acceleration (m/s^2")
    assert problems["balls[2].radius"].found == "-1"
    assert 'did you mean "density"?' in problems["balls[2].desnity"].expected


@pytest.mark.parametrize("name", names())
def test_the_resolved_scenario_reads_back_equal(name: str) -> None:
    import json

    scenario = parse_any(text(name), overrides=[f"name={name}"])
    resolved = scenario.resolved()
    again = parse_any(json.dumps(resolved), "json")
    assert again == scenario
    assert again.resolved() == resolved
    assert pickle.loads(pickle.dumps(scenario)) == scenario
    assert hash(again) == hash(scenario)


def test_scenarios_differ_when_a_value_does() -> None:
    assert good(data(gravity=9.81)) != good(data(gravity=9.82))


def test_a_scenario_is_frozen() -> None:
    scenario = good(data())
    with pytest.raises(ValidationError):
        scenario.gravity = 1.0  # type: ignore[misc]


def test_a_scenario_can_be_made_of_models() -> None:
    scenario = Scenario(
        gravity=9.81,
        trace=Trace(start_slope=-1.0, arcs=(Arc(shape="valley", radius=1.0, end_slope=1.0),)),
        balls=(Ball(radius=0.1, mass=1.0, arc=1, angle=0.0),),
        stop=Stop(time=1.0),
        ends={"left": Wall(wall=0.5)},  # type: ignore[arg-type]
    )
    assert scenario.balls[0].body == "ball"
    assert scenario_of(scenario.resolved()) == scenario
    with pytest.raises(ValidationError, match="at least one of time or collisions"):
        Scenario(gravity=1.0, trace=scenario.trace, balls=scenario.balls, stop=Stop())


def test_places_of_keys(tmp_path: Any) -> None:
    path = tmp_path / "arcs.toml"
    path.write_text(text("three_arcs"), encoding="utf-8")
    scenario = load_any(path, ["collision.k=0.5"])
    lines = text("three_arcs").splitlines()
    place = scenario.place("balls[2].radius")
    assert (place.file, place.column) == (str(path), 10)
    assert place.line is not None
    assert lines[place.line - 1].startswith("radius = 0.10")
    assert scenario.place("balls[2].omega").line == place.line - 1
    assert str(scenario.place("collision.k")) == "--set collision.k=0.5"
    assert str(good(data()).place("balls[1]")) == "<scenario>"
