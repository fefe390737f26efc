from __future__ import annotations

import math
from typing import Any

import pytest

from tests.scenario.cases import bad, ball, closed, data, good
from vibro_cli.scenario import loading
from vibro_cli.scenario.loading import parse_value


def value_at(source: dict[str, Any], override: str) -> Any:
    value: Any = good(source, [override]).resolved()
    for part in override.partition("=")[0].strip().replace("]", "").replace("[", ".").split("."):
        value = value[int(part) - 1] if part.isdecimal() else value[part]
    return value


@pytest.mark.parametrize(
    ("override", "value"),
    [
        ("balls[1].angle=-1.2", -1.2),
        ("balls[1].angle = -1.2 ", -1.2),
        ("balls[1].angle=-60 deg", -math.pi / 3),
        ("balls[1].angle='-60 deg'", -math.pi / 3),
        ('trace.arcs[1].radius="0.9 m"', 0.9),
        ("collision.k=0.8", [0.8]),
        ("collision.k=[0.7]", [0.7]),
        ("collision.k[1]=0.6", 0.6),
        ("collision.law=normal-impulse", "normal-impulse"),
        ("ends.left={wall = 0.5}", {"wall": 0.5}),
        ("ends.left.wall=0.4", 0.4),
        ("output.times=[0, 1e-3]", [0.0, 0.001]),
        ("stop.collisions=1_000", 1000),
        ("balls[2].mass=2", 2.0),
        ("balls[2].omega=2", 2.0),
        ("name=2024-01-01", "2024-01-01"),
        ("name=a = b", "a = b"),
        ("trace.closed=false", False),
    ],
)
def test_an_override_sets_its_value(override: str, value: Any) -> None:
    set_value = value_at(data(), override)
    if isinstance(value, float):
        assert set_value == pytest.approx(value, rel=1e-15)
    else:
        assert set_value == value


def test_the_source_is_left_alone() -> None:
    source = data()
    good(source, ["balls[1].angle=-0.9", "output.step=1"])
    assert source == data()


def test_of_two_bodies_that_are_one_in_memory_one_is_changed() -> None:
    """As an alias of YAML and a list of Python make them."""
    one = ball()
    changed = loading.apply(data(balls=[one, one]), ("balls", 0, "angle"), -0.9)
    assert [body["angle"] for body in changed["balls"]] == [-0.9, -0.5]
    assert one == ball()


def test_one_coefficient_of_a_list_can_be_set() -> None:
    assert good(closed(3), ["collision.k[3]=0.5"]).collision.k == (0.9, 0.9, 0.5)


def test_the_last_of_equal_overrides_counts() -> None:
    assert good(data(), ["gravity=1", "gravity=2"]).gravity == 2.0


def test_an_override_replaces_the_files_alternative_but_not_another_override() -> None:
    source = data(1, balls=[ball(rate=1.0)])
    first = good(source, ["balls[1].omega=2"]).balls[0]
    assert (first.rate, first.omega) == (None, 2.0)
    problems = bad(source, ["balls[1].rate=1", "balls[1].omega=2"])
    assert [str(problem) for problem in problems] == [
        "--set balls[1].omega=2: balls[1].omega: found rate and omega, "
        "expected at most one of rate, omega or speed"
    ]


@pytest.mark.parametrize(
    ("override", "path", "expected"),
    [
        ("balls[1].angle", "", "path=value"),
        ("=3", "", "a path such as"),
        ("balls[0].mass=2", "", "counted from 1"),
        ("balls[-1].mass=2", "", "a path such as"),
        ("balls[1.mass=2", "", "a path such as"),
        ("ball[1].mass=2", "ball", 'did you mean "balls"?'),
        ("balls[1].agnle=2", "balls[1].agnle", 'did you mean "angle"?'),
        ("k=0.5", "k", 'did you mean "collision.k"?'),
        ("balls[3].mass=2", "balls[3]", "a number from 1 to 2"),
        ("collision.k[2]=0.5", "collision.k[2]", "a number from 1 to 1"),
        ("balls.mass=2", "balls", "balls[1].mass"),
        ("gravity.x=2", "gravity", "a single value"),
        ("gravity[1]=2", "gravity", "as a whole"),
        ("balls[1].angle[1]=2", "balls[1].angle", "as a whole"),
        ("output.times[1]=2", "output.times", "as a whole"),
        ("balls[1][2]=3", "balls[1]", "as a whole"),
        ("collision.k=2", "collision.k", "a number from 0 to 1"),
        ("balls[1].angle=3 kg", "balls[1].angle", "an angle"),
        ("balls[1].angle=nan", "balls[1].angle", "a finite number"),
        ("trace.closed=True", "trace.closed", "true or false"),
        ("stop=3", "stop", "a table"),
        ("name=1\ngravity=2", "name", "printable"),
        ("collision.k=", "collision.k", "a value (keys are changed here, not removed)"),
        ("balls[1].density = null", "balls[1].density", "a value (keys are changed here"),
        ("name=null", "name", "a value (keys are changed here, not removed)"),
        ("collision.kk=", "collision.kk", 'did you mean "k"?'),
    ],
)
def test_an_override_that_cannot_be(override: str, path: str, expected: str) -> None:
    (problem,) = bad(data(), [override])
    assert problem.file == "--set " + override.replace("\n", "�")
    assert problem.line is None
    assert problem.path == path
    assert expected in problem.expected


def test_problems_of_overrides_and_of_the_file_come_together() -> None:
    problems = bad(data(gravity=-1), ["ball=1", "collision.k=2"])
    assert sorted(problem.path for problem in problems) == ["ball", "collision.k", "gravity"]


@pytest.mark.parametrize("text", ["[" * 1000, ".".join("a" * 1000), '"', "1\nx = 2", "{a.b.c"])
def test_what_is_no_value_of_toml_is_a_text(text: str) -> None:
    assert parse_value(text) == text


@pytest.mark.parametrize("text", [".84", "-.5", "+.5e-1", "2.", "1.E3"])
def test_a_number_may_lack_a_digit_beside_its_point(text: str) -> None:
    assert value_at(data(), f"balls[1].speed={text}") == float(text)


def test_a_value_may_be_as_long_as_that_of_a_file() -> None:
    times = [float(n) for n in range(30_000)]
    assert value_at(data(), f"output.times={times}") == times
    (problem,) = bad(data(), [f"balls[1].angle={'a' * 200_000}"])
    assert (problem.path, len(problem.found)) == ("balls[1].angle", 62)
