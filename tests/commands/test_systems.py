"""Systems other than the trace: run from end to end, refused where nothing is there for them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from pyarrow import parquet

from tests.commands.conftest import Vibro

GALLERY = Path(__file__).parents[2] / "scenarios"
SCENARIOS = sorted([*GALLERY.glob("table/*.toml"), *GALLERY.glob("springs/*.toml")])
TABLES = {
    "table": {"collisions", "bounces", "summary"},
    "springs": {"collisions", "events", "summary"},
}


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


@pytest.mark.parametrize("path", SCENARIOS[:1] + SCENARIOS[-1:], ids=lambda path: path.stem)
def test_what_is_not_there_for_a_system_is_refused(path: Path, vibro: Vibro) -> None:
    system = path.parent.name
    outcome = vibro("portrait", str(path))
    assert outcome.code == 2
    assert f'system: found "{system}", expected "trace"' in outcome.err
    grid = f'base = "{path}"\n[[axes]]\npath = "stop.time"\nvalues = [1.0, 2.0]\n'
    Path("grid.toml").write_text(grid)
    outcome = vibro("grid", "grid.toml")
    assert outcome.code == 2
    assert f'found "{system}"' in outcome.err
    assert vibro("run", str(path), "-o", "out", "--no-figures").code == 0
    outcome = vibro("report", "out")
    assert outcome.code == 2
    assert "cannot be continued nor reported" in outcome.err
    outcome = vibro("run", "--continue", "out", "--set", "stop.time=9.0")
    assert outcome.code == 2
    assert "cannot be continued" in outcome.err
