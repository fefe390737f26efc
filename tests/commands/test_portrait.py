"""`vibro portrait`: tables and figures of singular points, families, misuse."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from tests.commands.conftest import Vibro
from tests.scaling import scaled
from vibro_cli import example
from vibro_cli.storage.files import read_manifest

GALLERY = Path(__file__).parents[2] / "scenarios"
THREE_ARCS = GALLERY / "three_arcs.toml"
STEEP = ("--set", "trace.start_slope=-70 deg", "--set", "balls[1].angle=-1.2")


def test_portraits_and_their_table_are_written(vibro: Vibro) -> None:
    outcome = vibro("portrait", THREE_ARCS)
    assert outcome.code == 0
    assert "C1-S1-C2: figure eight" in outcome.text
    folder = Path("outputs/three_arcs-portrait")
    names = {path.name for path in folder.iterdir()}
    # the balls have the same radius and inertia ratio, hence the same portrait
    figures = {"portrait_1_2.png", "portrait_1_2.pdf"}
    assert names == figures | {"portrait.json", "scenario.json", "manifest.json"}
    manifest = read_manifest(folder)
    assert manifest is not None
    assert set(manifest["files"]) | {"manifest.json"} == names
    assert vibro("portrait", THREE_ARCS).code == 0  # ours: replaced


def test_very_many_equal_bodies_have_a_name_of_a_file(vibro: Vibro, tmp_path: Path) -> None:
    """Their numbers alone would be more than file systems take."""
    ball = "[[balls]]\nbody = 'particle'\nradius = 0.001\nmass = 1.0\narc = 1\nangle = {}\n"
    trace = "arcs = [{shape = 'valley', radius = 1.0, end_slope = '80 deg'}]\n"
    many = "".join(ball.format(-1.0 + 0.01 * number) for number in range(100))
    (tmp_path / "many.toml").write_text(
        f"gravity = 9.81\n[trace]\nstart_slope = '-80 deg'\n{trace}{many}"
        "[collision]\nlaw = 'normal-impulse'\nk = 1.0\n[stop]\ncollisions = 1\n"
    )
    assert vibro("portrait", "many.toml", "-o", "many", "-q").code == 0
    assert (
        sorted(path.stem for path in Path("many").glob("*.p*")) == ["portrait_1_and_99_others"] * 2
    )


@pytest.mark.usefixtures("undrawn")
def test_quiet_prints_nothing_and_json_all_the_same(vibro: Vibro) -> None:
    outcome = vibro("portrait", THREE_ARCS, "-q")
    assert (outcome.code, outcome.text, outcome.err) == (0, "", "")
    assert vibro("portrait", THREE_ARCS, "-q", "--json").lines


def test_json_has_the_singular_points_of_each_body(vibro: Vibro) -> None:
    outcome = vibro("portrait", THREE_ARCS, "--json", "--no-figures")
    found = json.loads(outcome.text)
    assert [body["ball"] for body in found["bodies"]] == [1, 2]
    saddle = found["bodies"][0]["points"][1]
    mass = found["bodies"][0]["mass"]
    height = 1.5 * (1.0 - math.cos(math.radians(50)))
    assert saddle["height"] == pytest.approx(height, rel=1e-14)
    assert saddle["energy"] == pytest.approx(mass * 9.81 * height, rel=1e-14)
    assert not Path("outputs").exists()


def test_a_family_tells_where_the_type_changes(vibro: Vibro) -> None:
    vary = "balls[1].radius=0.05:0.3:6"
    outcome = vibro("portrait", THREE_ARCS, *STEEP, "--vary", vary, "--json", "-o", "family")
    (change,) = json.loads(outcome.text)["family"]["changes"]
    rise = 1.5 * (1.0 - math.cos(math.radians(50)))
    threshold = 1.0 - rise / (1.0 - math.cos(math.radians(70)))
    assert change["high"] == pytest.approx(threshold, rel=1e-13)
    assert Path("family/family.png").read_bytes().startswith(b"\x89PNG")


def test_impossible_members_are_named(vibro: Vibro) -> None:
    outcome = vibro("portrait", THREE_ARCS, "--vary", "balls[1].radius=0.5:2:4", "--no-figures")
    assert outcome.code == 0
    assert "impossible (balls[1].radius: found 1.5, expected less than 1.0" in outcome.text


def test_barriers_between_equal_saddles_are_zero(vibro: Vibro) -> None:
    path = str(GALLERY / "turning_valley.toml")
    outcome = vibro("portrait", path, "--no-figures")
    assert outcome.text.count("+0 m (right) of S1") == 2  # of either ball
    assert outcome.text.count("C3-S3-C4: open; barriers +0 m (left)") == 2


@pytest.mark.parametrize("vary", ["r", "r=1:2", "r=1:1:3", "r=1:2:1", "r=a:b:3", "=1:2:3"])
def test_a_wrong_family_is_refused(vibro: Vibro, vary: str) -> None:
    outcome = vibro("portrait", THREE_ARCS, "--vary", vary)
    assert outcome.code == 2
    assert "PATH=FROM:TO:N" in outcome.err


@pytest.mark.parametrize(
    ("vary", "words"),
    [
        ("ball[1].radius=0.1:0.2:3", "found ball[1].radius, expected a value of a scenario"),
        ("balls[1].body=1:2:3", "found balls[1].body, expected a number"),
        ("stop.collisions=1:3:3", "expected a number of the scenario that need not be whole"),
        ("balls[1].radius=1 kg:2 kg:3", 'found "1 kg", expected a length'),
        ("balls[1].radius=2:3:3", "no portrait is possible: balls[1].radius: found 2.0"),
    ],
)
def test_a_family_that_cannot_be_is_refused(vibro: Vibro, vary: str, words: str) -> None:
    outcome = vibro("portrait", THREE_ARCS, "--no-figures", "--vary", vary)
    assert outcome.code == 2
    assert words in outcome.err


def test_a_family_has_units_and_may_fall(vibro: Vibro) -> None:
    command = ("portrait", THREE_ARCS, *STEEP, "--no-figures", "--json", "--vary")
    falling = json.loads(vibro(*command, "balls[1].radius=30 cm:50 mm:6").text)["family"]
    rising = json.loads(vibro(*command, "balls[1].radius=0.05:0.3:6").text)["family"]
    assert [one["value"] for one in falling["members"]] == pytest.approx(
        [one["value"] for one in reversed(rising["members"])]
    )
    assert falling["changes"][0]["high"] == pytest.approx(rising["changes"][0]["high"], rel=1e-12)


def test_a_family_names_the_unit_of_its_values(vibro: Vibro) -> None:
    command = ("portrait", THREE_ARCS, "--no-figures", "--vary")
    told = vibro(*command, "trace.arcs[1].radius=100 cm:120 cm:2").text
    assert "trace.arcs[1].radius [m], portrait of ball 1:\n  1 " in told


@pytest.mark.parametrize(
    ("name", "column", "key"),
    [("three_arcs", 4, "s"), ("two_disks", 2, "displacement"), ("elliptic_wall", 2, "length")],
)
@pytest.mark.parametrize("length", [-20, 20])
def test_the_list_of_singular_points_has_digits_of_places_at_any_size(
    vibro: Vibro, name: str, column: int, key: str, length: int
) -> None:
    """Those of a trace of micrometres stood there as 0.000002 m and 0.000003 m."""
    document = scaled(example(name).resolved(), length, length // 2)
    Path("small.json").write_text(json.dumps(document))
    told = vibro("portrait", "small.json", "--no-figures").text.splitlines()
    record = json.loads(vibro("portrait", "small.json", "--no-figures", "--json").text)
    points: list[dict[str, Any]] = [one for body in record["bodies"] for one in body["points"]]
    names = {point.get("name", point.get("axis")) for point in points}
    rows = [line.split() for line in told if line.split()[0] in names]
    shown = [float(row[column]) for row in rows]
    assert shown == pytest.approx([point[key] for point in points], rel=1e-6)


def test_a_folder_that_is_not_a_portrait_is_left_alone(vibro: Vibro) -> None:
    Path("mine").mkdir()
    Path("mine/notes.txt").write_text("keep")
    outcome = vibro("portrait", THREE_ARCS, "-o", "mine")
    assert outcome.code == 2
    assert Path("mine/notes.txt").read_text() == "keep"


def test_bodies_are_compared_on_one_trace(vibro: Vibro) -> None:
    compare = "balls[1].body=particle,disk,ball"
    source = GALLERY / "ball_on_arcs.toml"
    outcome = vibro("portrait", source, "--compare", compare, "--json", "-o", "compared")
    assert outcome.code == 0
    found = json.loads(outcome.text)["comparison"]
    assert [member["kappa"] for member in found["members"]] == [1.0, 1.5, 1.4]
    heights = [[point["height"] for point in one["points"]] for one in found["members"]]
    assert heights[0] == pytest.approx(heights[1], abs=1e-14)
    assert heights[0] == pytest.approx(heights[2], abs=1e-14)
    assert Path("compared/comparison.pdf").read_bytes().startswith(b"%PDF-")
    lines = vibro("portrait", source, "--compare", compare, "--no-figures").text.splitlines()
    assert "  disk: κ = 1.5; centre, saddle, centre; figure eight" in lines
    assert "    C1: E/(m g) = 0 m, ω = 2.69568 1/s" in lines


@pytest.mark.parametrize(
    ("compare", "words"),
    [
        ("balls[1].body=ball", "2 to 6 different values"),
        ("balls[1].body=ball,ball", "2 to 6 different values"),
        ("balls[1].body=ball,cube", 'found "cube", expected "ball"'),
        ("trace.arcs[2].radius=0.4,0.5", "changes the trace"),
    ],
)
def test_a_wrong_comparison_is_refused(vibro: Vibro, compare: str, words: str) -> None:
    outcome = vibro("portrait", THREE_ARCS, "--compare", compare, "--no-figures")
    assert outcome.code == 2
    assert words in outcome.err
