"""`vibro check`: what was understood of a scenario."""

import math
from pathlib import Path

import pytest

from tests.commands.conftest import Vibro
from tests.two_balls import SCENARIO


def test_trace_bodies_pairs_and_law_are_shown(vibro: Vibro, scenario: Path) -> None:
    outcome = vibro("check", scenario, "--set", "balls[2].body=disk")
    assert outcome.code == 0
    assert outcome.err == ""
    assert outcome.text.splitlines() == [
        "small: valid",
        "  gravity 9.81 m/s²; open two-sided trace of length 3.14159 m",
        "  arc 1  valley  R = 1 m, slope -90° to 90°, length 3.14159 m, ends at (2, 0) m",
        "  ball 1  ball, r = 0.1 m, m = 2 kg, κ = 1.4, J_P = 0.028 kg m²; "
        "arc 1, angle -57.2958°, speed 0 m/s",
        "  ball 2  disk, r = 0.1 m, m = 1 kg, κ = 1.5, J_P = 0.015 kg m²; "
        "arc 1, angle 28.6479°, speed 0 m/s",
        "  pair 1-2  k = 0.9",
        "  law hedrih; inadmissible impacts: stop",
        "  stop collisions = 3",
        "  ends left = stop, right = stop",
    ]


def test_json_has_the_resolved_scenario_and_what_follows(vibro: Vibro, scenario: Path) -> None:
    (found,) = vibro("check", scenario, "--json").lines
    assert found["scenario"]["collision"]["law"] == "hedrih"
    assert found["trace"]["length"] == pytest.approx(math.pi, rel=1e-15)
    assert [body["kappa"] for body in found["bodies"]] == [1.4, 1.4]
    assert found["bodies"][0]["rolling_inertia"] == pytest.approx(1.4 * 2 * 0.1**2, rel=1e-15)
    assert found["pairs"] == [{"ball_a": 1, "ball_b": 2, "k": 0.9}]
    assert found["warnings"] == []


def test_a_line_has_positions_and_no_radius(vibro: Vibro, tmp_path: Path) -> None:
    path = tmp_path / "line.toml"
    path.write_text(
        """
gravity = 9.81
trace = {start_slope = 0.0, arcs = [{shape = "line", length = 2.0}]}
balls = [{radius = 0.1, mass = 1.0, arc = 1, position = 0.5, speed = 0.25}]
stop = {time = 1.0}
"""
    )
    (found,) = vibro("check", path, "--json").lines
    assert found["trace"]["pieces"][0]["radius"] is None
    assert found["bodies"][0]["position"] == 0.5
    assert "angle" not in found["bodies"][0]
    assert "position 0.5 m, speed 0.25 m/s" in vibro("check", path).text


def test_what_is_doubtful_is_a_warning(vibro: Vibro, scenario: Path) -> None:
    overrides = ("--set", "collision.law=translational", "--set", "balls[2].body=disk")
    (found,) = vibro("check", scenario, "--json", *overrides).lines
    assert len(found["warnings"]) == 1
    assert "translational" in found["warnings"][0]
    assert f"  warning: {found['warnings'][0]}" in vibro("check", scenario, *overrides).text


def test_quiet_only_says_what_is_wrong(vibro: Vibro, scenario: Path) -> None:
    outcome = vibro("check", scenario, "-q")
    assert (outcome.code, outcome.out, outcome.err) == (0, b"", "")


def test_mechanical_problems_are_placed_too(vibro: Vibro, scenario: Path) -> None:
    scenario.write_text(SCENARIO.replace("radius = 0.1\nmass = 2.0", "radius = 1.1\nmass = 2.0"))
    outcome = vibro("check", scenario)
    assert outcome.code == 2
    assert outcome.out == b""
    assert "small.toml:7:" in outcome.err
    assert "balls[1].radius: found 1.1, expected" in outcome.err
