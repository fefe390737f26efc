"""`vibro check`: what was understood of a scenario."""

import json
import math
from pathlib import Path

import pytest

from tests.commands.conftest import Vibro
from tests.gallery import GALLERY
from tests.two_balls import SCENARIO
from vibro_cli import Scenario, simulate

SCENARIOS = Path(__file__).parents[2] / "scenarios"


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
        "          ω² = 2g/κρ = 15.5714286 1/s², elliptic modulus 2.08582964; "
        "period of small oscillations 2.25180426 s, of this motion 2.401176 s",
        "  ball 2  disk, r = 0.1 m, m = 1 kg, κ = 1.5, J_P = 0.015 kg m²; "
        "arc 1, angle 28.6479°, speed 0 m/s",
        "          ω² = 2g/κρ = 14.5333333 1/s², elliptic modulus 4.0419725; "
        "period of small oscillations 2.33083885 s, of this motion 2.36778855 s",
        "  pair 1-2  k = 0.9",
        "          arc 1  β = 0.222682029 rad, λ₁ = R/r₁ = 10, λ₂ = r₂/r₁ = 1",
        "  law hedrih; inadmissible impacts: stop",
        "  stop collisions = 3",
        "  ends left = stop, right = stop",
    ]


def test_a_lone_body_has_no_impact_law(vibro: Vibro) -> None:
    assert vibro("new", "lone_particle").code == 0
    assert "  law " not in vibro("check", "lone_particle.toml").text


def test_json_has_the_resolved_scenario_and_what_follows(vibro: Vibro, scenario: Path) -> None:
    (found,) = vibro("check", scenario, "--json").lines
    order = "name valid scenario trace bodies pairs law inadmissible surface warnings"
    assert [*found] == order.split()
    assert found["scenario"]["collision"]["law"] == "hedrih"
    assert found["trace"]["length"] == pytest.approx(math.pi, rel=1e-15)
    assert [body["kappa"] for body in found["bodies"]] == [1.4, 1.4]
    assert found["bodies"][0]["rolling_inertia"] == pytest.approx(1.4 * 2 * 0.1**2, rel=1e-15)
    (pair,) = found["pairs"]
    (contact,) = pair.pop("contacts")
    assert pair == {"ball_a": 1, "ball_b": 2, "k": 0.9}
    # A (6), B (48)
    cosine = (0.9**2 + 0.9**2 - 0.2**2) / (2.0 * 0.9**2)
    assert contact == {
        "arc": 1, "beta": pytest.approx(math.acos(cosine), rel=1e-13),
        "lambda_1": pytest.approx(10.0), "lambda_2": 1.0,
    }  # fmt: skip
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


@pytest.mark.parametrize(
    ("closed", "end", "shown"),
    [(True, 180.0, "infinite, on the separatrix"), (False, 180.0, "infinite, on the separatrix"),
     (False, 90.0, "none, as it leaves its arc")],
)  # fmt: skip
def test_the_period_on_the_separatrix(
    vibro: Vibro, tmp_path: Path, closed: bool, end: float, shown: str
) -> None:
    """With g = κρ a start from the bottom at 2 rad/s rises as φ = 4 arctan eᵗ − π for ever."""
    arc = {"shape": "valley", "radius": 1.0, "end_slope": math.radians(end)}
    start = -180.0 if closed else -90.0
    scenario = {
        "gravity": 1.4 * 0.9,
        "trace": {"start_slope": math.radians(start), "closed": closed, "arcs": [arc]},
        "balls": [{"radius": 0.1, "mass": 1.0, "arc": 1, "angle": 0.0, "rate": 2.0}],
        "stop": {"time": 12.0},
    }
    path = tmp_path / "separatrix.json"
    path.write_text(json.dumps(scenario))
    assert f", of this motion {shown}" in vibro("check", path).text
    (found,) = vibro("check", path, "--json").lines
    assert found["bodies"][0]["swing"]["period"] is None
    run = simulate(Scenario.from_dict(scenario))
    assert (run.summary["end_cause"] == "time") == found["bodies"][0]["swing"]["stays"]
    t = run.summary["end_time"]
    angle = run.sample([t])["angle"][0]
    assert angle == pytest.approx(4.0 * math.atan(math.exp(t)) - math.pi, abs=1e-9)


@pytest.mark.parametrize(("step", "told"), [("1e-5", False), ("1e-9", True)])
def test_very_many_samples_are_a_warning(vibro: Vibro, step: str, told: bool) -> None:
    """Of two disks in 30 s: 6e6 rows with a step of ten microseconds, 6e10 of a nanosecond."""
    disks = Path(__file__).parents[2] / "scenarios" / "springs" / "two_disks.toml"
    (found,) = vibro("check", disks, "--set", f"output.step={step}", "--json").lines
    words = "output.step = 1e-09 s asks for 6e+10 rows of motion until stop.time"
    assert found["warnings"] == [words] * told


@pytest.mark.parametrize("stop", ["time", "collisions"])
def test_a_step_whose_multiples_are_not_exact_is_refused_by_name(
    vibro: Vibro, scenario: Path, stop: str
) -> None:
    """The instants of doubles are whole multiples of the step only up to 2^53 of them."""
    step = 2.0**-54 * 20.0 if stop == "time" else 1e-17
    text = SCENARIO.partition("[stop]")[0]
    scenario.write_text(f"{text}[stop]\n{stop} = 20\n\n[output]\nstep = {step!r}\n")
    outcome = vibro("run", scenario, "--no-figures")
    assert outcome.code == 2
    assert f"output.step: found {step!r}" in outcome.err
    assert outcome.err.startswith(f"{scenario}:" if stop == "time" else "vibro: small: output.step")
    longer = ["--set", f"output.step={4.0 * step!r}"] if stop == "time" else []
    assert vibro("check", scenario, "-q", *longer).code == 0


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


GRID = """
base = "small.toml"
[[axes]]
path = "balls[1].angle"
linspace = ["-60 deg", -0.4, 3]
[[axes]]
path = "collision.law"
values = ["hedrih", "normal-impulse"]
"""


@pytest.fixture
def grid(tmp_path: Path, scenario: Path) -> Path:
    path = tmp_path / "sweep.toml"
    path.write_text(GRID)
    return path


def test_a_grid_is_checked_as_one(vibro: Vibro, grid: Path) -> None:
    outcome = vibro("check", grid)
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.text.splitlines() == [
        "sweep: valid grid of 6 points",
        "  mode product",
        "  axis balls[1].angle: 3 values, -1.0472 to -0.4 rad",
        "  axis collision.law: 2 values, hedrih to normal-impulse",
        "  kept: summaries",
    ]
    (found,) = vibro("check", grid, "--json").lines
    assert (found["points"], found["first_point"]) == (6, None)
    assert found["grid"]["axes"][1]["values"] == [["hedrih"], ["normal-impulse"]]
    grid.write_text(GRID.replace(', "normal-impulse"', ""))
    assert "  axis collision.law: 1 value, hedrih to hedrih" in vibro("check", grid).text
    outcome = vibro("check", grid, "--set", "balls[1].mass=-1")
    assert outcome.code == 0
    assert "warning: the first point is invalid: balls[1].mass: found -1" in outcome.text
    grid.write_text(GRID.replace("angle", "angel"))
    refused = vibro("check", grid)
    assert (refused.code, refused.out) == (2, b"")
    assert f"{grid}:4:8: axes[1].path: " in refused.err


@pytest.mark.parametrize("command", ["run", "portrait"])
def test_a_grid_in_the_place_of_a_scenario_is_recognised(
    vibro: Vibro, grid: Path, command: str
) -> None:
    refused = vibro(command, grid)
    assert refused.code == 2
    assert refused.err == (
        f"{grid}:3:3: found a grid (axes over a scenario), "
        "expected a scenario; vibro grid solves a grid\n"
    )


def test_a_scenario_in_the_place_of_a_grid_is_recognised(vibro: Vibro, scenario: Path) -> None:
    refused = vibro("grid", scenario)
    assert refused.code == 2
    assert refused.err == (
        f"{scenario}:2:1: found a scenario, "
        "expected a grid: base (or scenario) and axes; vibro run solves a scenario\n"
    )


def test_names_that_are_no_files_are_helped_with(vibro: Vibro, scenario: Path) -> None:
    assert vibro("check", "smal.toml").err == (
        "smal.toml: cannot be read: No such file or directory (did you mean 'small.toml'?)\n"
    )
    Path("gone.toml").symlink_to("nowhere.toml")
    assert (
        vibro("check", "gone.toml").err == "gone.toml: cannot be read: No such file or directory\n"
    )
    assert "(vibro new three_arcs writes the three_arcs of the gallery)" in (
        vibro("run", "three_arcs").err
    )
    assert "(to choose your own name: vibro new TEMPLATE -o FILE)" in vibro("new", "mine").err


@pytest.mark.parametrize(
    ("name", "lines"),
    [
        ("turning_circle", [
            "  turns about a vertical axis: through_arc = 1, rate = 3.6 rad/s",
            "  ends left (wall = 0.9), right (wall = 0.9)",
        ]),
        ("table/elliptic_wall", [
            "  wall shape = ellipse, side = inside, k = 0.95, x = 0 m, y = 0 m, "
            "semi_axis_x = 1.5 m, semi_axis_y = 1 m",
        ]),
        ("springs/common_origin", ["  k = 0.9", "  stop time = 20 s"]),
    ],
)  # fmt: skip
def test_settings_have_their_units(vibro: Vibro, name: str, lines: list[str]) -> None:
    told = vibro("check", SCENARIOS / f"{name}.toml").text.splitlines()
    assert set(lines) <= set(told)
    assert not any("{" in line for line in told)


def test_the_last_point_of_a_grid_is_tried(vibro: Vibro, grid: Path) -> None:
    grid.write_text(
        f'base = "{SCENARIOS / "one_circle.toml"}"\n[[axes]]\npath = "collision.k"\n'
        "linspace = [0.5, 1.5, 5]\n"
    )
    found = "the last point is invalid: collision.k: found 1.5, expected a number from 0 to 1"
    assert vibro("check", grid).text.splitlines()[-1] == f"  warning: {found}"


@pytest.mark.parametrize(
    ("stop", "axis", "hinted"),
    [
        ("collisions = 1000", "path = 'collision.k'\nlinspace = [0.7, 1.0, 4]", True),
        ("collisions = 1000", "path = 'collision.k'\nvalues = [1.0]", False),
        ("collisions = 1000", "path = 'collision.k[1]'\nvalues = [0.5]", True),
        ("collisions = 1000\ntime = 60", "path = 'collision.k'\nvalues = [0.9]", False),
        ("collisions = 1000", "path = 'stop.time'\nvalues = [9.0]", False),
        ("collisions = 3", "path = 'gravity'\nvalues = [9.0]", False),
        ("collisions = 3", "path = 'stop.collisions'\nvalues = [9, 900]", True),
        ("time = 60", "path = 'gravity'\nvalues = [9.0]", False),
        ("collisions = 1000", "path = 'gravity'\nvalues = [9.0]", True),
    ],
)
def test_a_grid_whose_impacts_may_die_out_before_its_stop_is_told_of(
    vibro: Vibro, tmp_path: Path, stop: str, axis: str, hinted: bool
) -> None:
    """Each such point is solved for two million flights after its last impact, and then fails."""
    (tmp_path / "small.toml").write_text(SCENARIO.replace("collisions = 3", stop))
    grid = tmp_path / "sweep.toml"
    grid.write_text(f"base = 'small.toml'\n[[axes]]\n{axis}\n")
    hint = (
        "without stop.time, points whose impacts die out (k < 1) are solved far beyond their last "
        "impact, and may fail: set stop.time, not far beyond the last impact"
    )
    outcome = vibro("check", grid)
    assert (outcome.code, outcome.err) == (0, "")
    assert (outcome.text.splitlines()[-1] == f"  hint: {hint}") == hinted
    assert vibro("check", grid, "--json").lines[0]["hint"] == (hint if hinted else None)


@pytest.mark.parametrize(
    ("stop", "axis", "hinted"),
    [
        ("collisions = 1000", "path = 'collision.k'\nvalues = [0.5]", True),
        ("collisions = 1000\nbounces = 20", "path = 'collision.k'\nvalues = [0.5]", False),
        ("collisions = 1000", "path = 'stop.bounces'\nvalues = [20, 30]", False),
    ],
)
def test_a_grid_of_balls_on_a_table_may_end_by_bounces(
    vibro: Vibro, tmp_path: Path, stop: str, axis: str, hinted: bool
) -> None:
    """Balls go on to bounce on the wall, so that no point is solved far beyond its stop."""
    text = (GALLERY / "table/billiards.toml").read_text(encoding="utf-8")
    (tmp_path / "small.toml").write_text(text.replace("time = 3.0", stop))
    grid = tmp_path / "sweep.toml"
    grid.write_text(f"base = 'small.toml'\n[[axes]]\n{axis}\n")
    found = vibro("check", grid, "--json").lines[0]
    assert (found["points"] > 0, found["hint"] is not None) == (True, hinted)


def test_of_several_scenarios_each_is_answered_unless_the_first_bad_one_ends_the_check(
    vibro: Vibro, scenario: Path
) -> None:
    bad = scenario.with_name("bad.toml")
    bad.write_text(scenario.read_text() + "\n[stop]\ntime = -1.0\n")
    names = bad, scenario
    outcome = vibro("check", *names, "--json")
    refused, accepted = outcome.lines
    assert outcome.code == 2
    assert (refused["source"], refused["valid"], accepted["valid"]) == (str(bad), False, True)
    assert refused["problems"]
    assert vibro("check", *names, "--json", "--fail-fast").lines == [refused]
    told = vibro("check", *names)
    assert (told.code, accepted["name"] in told.text, "bad.toml" in told.err) == (2, True, True)
    first = vibro("check", *names, "--fail-fast")
    assert (first.code, first.text) == (2, "")
    assert vibro("check", bad, "--json").lines == [refused]
