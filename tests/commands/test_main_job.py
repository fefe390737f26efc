"""The main job as a user does it: from a scenario of the gallery to tables and portraits."""

import csv
import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.commands.conftest import Vibro
from vibro_cli.storage import schema
from vibro_cli.storage.provenance import read_manifest
from vibro_cli.storage.tables import read_parquet

GALLERY = Path(__file__).parents[2] / "scenarios"
THREE_ARCS = GALLERY / "three_arcs.toml"
FEW = ("--set", "stop.collisions=5")


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_three_arcs_give_tables_and_a_portrait_of_each_ball(vibro: Vibro) -> None:
    outcome = vibro("run", THREE_ARCS, *FEW)
    assert outcome.code == 0
    folder = Path("outputs/three_arcs")
    portraits = {f"portrait_{ball}.{form}" for ball in (1, 2) for form in ("png", "pdf")}
    assert portraits <= set(contents(folder))
    assert (folder / "portrait_1.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "portrait_2.pdf").read_bytes().startswith(b"%PDF")
    manifest = read_manifest(folder)
    assert manifest is not None
    assert set(manifest["files"]) | {"manifest.json"} == set(contents(folder))
    assert "three_arcs: ended at t = " in outcome.err


def test_tables_are_as_described_and_agree_with_the_summary(vibro: Vibro) -> None:
    vibro("run", THREE_ARCS, *FEW, "--no-figures", "--set", "output.step=0.5")
    folder = Path("outputs/three_arcs")
    for name in ("collisions", "events", "motion", "summary"):
        data = read_parquet(folder / f"{name}.parquet")
        expected = schema.table_named(name, data.column_names)
        assert data.column_names == [column.name for column in expected.columns]
    summary = json.loads((folder / "summary.json").read_bytes())
    (row,) = read_parquet(folder / "summary.parquet").to_pylist()
    assert summary == row
    impacts = read_parquet(folder / "collisions.parquet")
    assert impacts.num_rows == summary["collisions"] == 5
    assert summary["last_collision_time"] == impacts["t"][-1].as_py()
    assert summary["end_cause"] == "collisions"


def test_the_same_run_gives_the_same_bytes(vibro: Vibro) -> None:
    for folder in ("one", "two"):
        assert vibro("run", THREE_ARCS, *FEW, "-o", folder).code == 0
    assert contents(Path("one")) == contents(Path("two"))


def test_the_resolved_scenario_gives_the_same_run(vibro: Vibro) -> None:
    vibro("run", THREE_ARCS, *FEW, "-o", "one", "--no-figures")
    assert vibro("run", "one/scenario.json", "-o", "two", "--no-figures").code == 0
    assert contents(Path("one")) == contents(Path("two"))


def test_the_stream_has_the_numbers_of_the_table(vibro: Vibro) -> None:
    outcome = vibro("run", THREE_ARCS, *FEW, "--format", "csv", "-o", "both", "--no-figures")
    rows = list(csv.DictReader(outcome.text.splitlines()))
    data = read_parquet(Path("both/collisions.parquet"))
    for name in ("t", "t_low", "angle_a", "rate_b_post", "energy_loss"):
        assert [float(row[name]) for row in rows] == data[name].to_pylist()


def test_a_single_body_has_no_impacts_and_a_portrait(vibro: Vibro) -> None:
    assert vibro("run", GALLERY / "lone_particle.toml", "--set", "stop.time=2").code == 0
    folder = Path("outputs/lone_particle")
    assert read_parquet(folder / "collisions.parquet").num_rows == 0
    assert "portrait_1.png" in contents(folder)


@pytest.mark.parametrize("path", sorted(GALLERY.glob("*.toml")), ids=lambda path: path.stem)
def test_the_gallery_runs(vibro: Vibro, path: Path) -> None:
    outcome = vibro("run", path, "--json", "--no-figures", "-q")
    assert outcome.code == 0, outcome.err
    assert outcome.lines[0]["status"] == "ok"


@pytest.mark.parametrize(("options", "limit"), [(("--no-figures",), 1.0), ((), 2.5)])
def test_the_main_job_is_quick(tmp_path: Path, options: tuple[str, ...], limit: float) -> None:
    command = [sys.executable, "-m", "vibro_cli", "run", str(THREE_ARCS), *options, "-q"]
    times = []
    for _ in range(3):
        begin = time.perf_counter()
        subprocess.run([*command, "-o", str(tmp_path / "run")], check=True)
        times.append(time.perf_counter() - begin)
    assert min(times) <= limit
