"""Systems other than the trace: run from end to end, refused where nothing is there for them."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from pyarrow import parquet

from tests.commands.conftest import Vibro
from vibro_cli.systems import NAMES

pytestmark = pytest.mark.long

GALLERY = Path(__file__).parents[2] / "scenarios"
SCENARIOS = sorted(path for name in NAMES[1:] for path in GALLERY.glob(f"{name}/*.toml"))
TABLES = {
    "table": {"collisions", "bounces", "summary"},
    "springs": {"collisions", "events", "summary"},
}
DRAWN = {"table": {"plan"}, "springs": {"portrait_1", "motion", "energy"}}
"""Some figures of every report."""


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_the_gallery_from_end_to_end(path: Path, vibro: Vibro) -> None:
    system = path.parent.name
    assert vibro("check", str(path)).code == 0
    outcome = vibro("run", str(path), "-o", "out", "--set", "output.step=0.5")
    assert outcome.code == 0, outcome.err
    found = {file.name for file in Path("out").glob("*.parquet")}
    assert found == {f"{name}.parquet" for name in (*TABLES[system], "motion")}
    assert list(Path("out").glob("*.png"))
    assert list(Path("out").glob("*.pdf"))
    for name in found:
        schema = parquet.read_schema(Path("out") / name)
        assert schema.metadata[b"vibro:schema"].startswith(system.encode())
        assert all(b"unit" in field.metadata for field in schema)
    assert vibro("verify", "out").code == 0
    assert vibro("show", "out/collisions.parquet").code == 0
    summary = json.loads(Path("out/summary.json").read_text())
    assert summary["status"] == "ok"
    # The resolved scenario gives the same results.
    assert vibro("run", "out/scenario.json", "-o", "again", "--no-figures").code == 0
    for name in found:
        one, other = ((Path(folder) / name).read_bytes() for folder in ("out", "again"))
        assert one == other


def test_a_table_is_streamed(vibro: Vibro) -> None:
    outcome = vibro("run", str(GALLERY / "springs/two_disks.toml"), "--format", "jsonl")
    assert outcome.code == 0
    assert json.loads(outcome.text.splitlines()[0])["n"] == 1


GRIDS = {
    "table/billiards": ("balls[1].velocity_x", "wall.k", ["collisions", "bounces"]),
    "springs/two_disks": ("balls[1].speed", "balls[2].spring.height", ["collisions"]),
}


@pytest.mark.parametrize("base", GRIDS)
def test_a_grid_from_end_to_end(base: str, vibro: Vibro) -> None:
    """The parts are the same from any number of workers, in shards and after a part was lost."""
    *axes, tables = GRIDS[base]
    lines = [f'base = "{GALLERY / base}.toml"', "chunk_points = 3", "keep = {collisions = true}"]
    for path, values in zip(axes, ([7.0, 8.0, 9.0, 5e60], [0.3, 0.7, 0.9, 5e60]), strict=True):
        lines.append(f'[[axes]]\npath = "{path}"\nvalues = {values}')
    Path("grid.toml").write_text("\n".join(lines))
    short = ["--set", "stop={time = 2.0}"]
    assert vibro("grid", "grid.toml", "-o", "one", "--workers", "1", *short).code == 0
    assert vibro("grid", "grid.toml", "-o", "two", "--engine", "compiled", *short).code == 0
    for shard in ("1/2", "2/2"):
        assert vibro("grid", "grid.toml", "-o", "three", "--shard", shard, *short).code == 0
    assert vibro("grid", "grid.toml", "-o", "three", "--merge", *short).code == 0
    Path("one/collisions/part-000002.parquet").unlink()
    assert vibro("verify", "one").code == 1
    assert vibro("grid", "grid.toml", "-o", "one", "--repair", *short).code == 0
    parts = sorted(path.relative_to("one") for path in Path("one").glob("*/part-*.parquet"))
    assert len(parts) == 6 * (1 + len(tables))
    for part in parts:
        contents = {(Path(folder) / part).read_bytes() for folder in ("one", "two", "three")}
        assert len(contents) == 1, part
    assert vibro("verify", "one").code == 0
    outcome = vibro("grid", "grid.toml", "-o", "one", "--json", *short)
    state = json.loads(outcome.text)
    assert state["complete"]
    assert state["invalid"] == 7
    assert state["impacts"] > 0
    assert vibro("report", "one", "--figures", "drawn").code == 0
    assert {"endings", "energy", "impacts"} <= {path.stem for path in Path("drawn").glob("*.png")}
    assert vibro("grid", "grid.toml", "--dry-run", *short).code == 0


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_a_report(path: Path, vibro: Vibro) -> None:
    assert vibro("run", str(path), "-o", "out", "--no-figures").code == 0
    outcome = vibro("report", "out", "-o", "page.html", "--figures", "drawn", "--width", "single")
    assert outcome.code == 0, outcome.err
    page = Path("page.html").read_text(encoding="utf-8")
    summary = json.loads(Path("out/summary.json").read_text())
    system = path.parent.name
    assert f"<dd>{summary['collisions']}</dd>" in page
    assert ("Impacts on the wall" in page) == (system == "table")
    drawn = {figure.stem for figure in Path("drawn").glob("*.pdf")}
    assert drawn >= DRAWN[system]
    assert page.count("<figure>") == len(drawn)


def test_runs_of_one_system_are_compared(vibro: Vibro) -> None:
    base = str(GALLERY / "table/skew_impact.toml")
    for k in ("1.0", "0.5"):
        more = ["--set", f"collision.k={k}", "--no-figures"]
        assert vibro("run", base, "-o", f"k{k}", *more).code == 0
    assert vibro("report", "k1.0", "k0.5", "-o", "both.html").code == 0
    assert "collision.k" in Path("both.html").read_text(encoding="utf-8")
    other = str(GALLERY / "springs/two_disks.toml")
    assert vibro("run", other, "-o", "springs", "--no-figures").code == 0
    outcome = vibro("report", "k1.0", "springs")
    assert outcome.code == 2
    assert "expected one system" in outcome.err


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_a_run_goes_on(path: Path, vibro: Vibro) -> None:
    """The files of a run in two parts are those of an uninterrupted run, byte by byte."""
    short, whole = ["--set", "stop={time = 0.9}"], ["--set", "stop={time = 2.1}"]
    assert vibro("run", str(path), "-o", "part", "--no-figures", *short).code == 0
    assert vibro("run", "--continue", "part", "--no-figures", *whole).code == 0
    assert vibro("run", str(path), "-o", "whole", "--no-figures", *whole).code == 0
    for name in ("collisions.parquet", "summary.parquet", "checkpoint.json"):
        assert (Path("part") / name).read_bytes() == (Path("whole") / name).read_bytes()


def test_a_run_of_thousands_of_balls_goes_on(vibro: Vibro) -> None:
    """Its scenario, written out in full, is longer than the limit for text."""
    wall = "shape = 'rectangle'\nwidth = 0.9\ndepth = 0.9\nk = 1"
    balls = [
        f"[[balls]]\nradius = 4e-3\nmass = 1\nx = {i % 80 / 100 - 0.4}\ny = {i // 80 / 100 - 0.4}"
        for i in range(6400)
    ]
    last = (
        "[[balls]]\nradius = 4e-3\nmass = 1\nx = -0.4\ny = 0.41\nvelocity_x = 0.3\nvelocity_y = -1"
    )
    text = "\n".join([f"system = 'table'\n[wall]\n{wall}\n[collision]\nk = 0.9", *balls, last])
    Path("many.toml").write_text(text, "utf-8")
    short, whole = ["--set", "stop.collisions=10"], ["--set", "stop.collisions=30"]
    assert vibro("run", "many.toml", "-o", "part", "--no-figures", *short).code == 0
    assert len((Path("part") / "scenario.json").read_bytes()) > 1_000_000
    assert vibro("run", "--continue", "part", "--no-figures", *whole).code == 0
    assert vibro("run", "many.toml", "-o", "whole", "--no-figures", *whole).code == 0
    for name in ("collisions.parquet", "checkpoint.json", "scenario.json"):
        assert (Path("part") / name).read_bytes() == (Path("whole") / name).read_bytes()


def test_the_portrait_of_springs(vibro: Vibro) -> None:
    path = str(GALLERY / "springs/two_disks.toml")
    outcome = vibro("portrait", path, "-o", "drawn", "--json")
    assert outcome.code == 0, outcome.err
    first, second = json.loads(outcome.text)["bodies"]
    assert first["type"] == "saddle between two centres (trigger)"
    places = [point["displacement"] for point in first["points"]]
    assert places == pytest.approx([-math.sqrt(24.0), 0.0, math.sqrt(24.0)], abs=1e-15)
    assert [point["stressed"] for point in second["points"]] == [False, True, False]
    assert second["points"][1]["energy"] == pytest.approx(0.5 * 9.0 * 3.5**2, rel=1e-15)
    assert first["separatrix_speed"] == pytest.approx(2.0 * 4.0, rel=1e-15)
    assert {path.name for path in Path("drawn").glob("*.png")} == {
        "portrait_1.png", "portrait_2.png",
    }  # fmt: skip
    outcome = vibro("portrait", path, "--set", "balls[1].spring.height=6", "--no-figures")
    assert "one centre" in outcome.text
    outcome = vibro("portrait", path, "--compare", "balls[1].radius=0.1,0.2")
    assert outcome.code == 2
    assert "--compare is for traces only" in outcome.err


def test_a_family_of_portraits_of_a_spring(vibro: Vibro) -> None:
    """C, part 3, a* and b*: one centre for l <= b, a saddle between two centres beyond."""
    path = str(GALLERY / "springs/two_disks.toml")
    vary = "balls[2].spring.length=1:2:5"
    outcome = vibro("portrait", path, "--vary", vary, "-o", "drawn", "--json")
    assert outcome.code == 0, outcome.err
    family = json.loads(outcome.text)["family"]
    one, three = "one centre", "saddle between two centres (trigger)"
    assert [member["type"] for member in family["members"]] == [one, one, one, three, three]
    (change,) = family["changes"]
    assert (change["low"], change["high"]) == (1.5, math.nextafter(1.5, 2.0))
    assert Path("drawn/family.png").exists()


def test_the_portrait_of_a_wall(vibro: Vibro) -> None:
    path = str(GALLERY / "table/elliptic_wall.toml")
    outcome = vibro("portrait", path, "-o", "drawn", "--json")
    assert outcome.code == 0, outcome.err
    (body,) = json.loads(outcome.text)["bodies"]
    assert [point["kind"] for point in body["points"]] == ["saddle", "centre"]
    assert Path("drawn/portrait_1.pdf").exists()
    for other, words in (("convex_wall", "ellipse among"), ("billiards", "rectangle around")):
        outcome = vibro("portrait", str(GALLERY / f"table/{other}.toml"))
        assert outcome.code == 2
        assert words in outcome.err
