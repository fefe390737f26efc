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
    found = {file.name for file in Path("out").glob("*.parquet")} - {"history.parquet"}
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
    """The same parts from any number of workers, in shards and after a part was lost."""
    *axes, tables = GRIDS[base]
    lines = [f'base = "{GALLERY / base}.toml"', "chunk_points = 3", "keep = {collisions = true}"]
    for path, values in zip(axes, ([7.0, 8.0, 9.0, 5e60], [0.3, 0.7, 0.9, 5e60]), strict=True):
        lines.append(f'[[axes]]\npath = "{path}"\nvalues = {values}')
    Path("grid.toml").write_text("\n".join(lines))
    short = ["--set", "stop={time = 2.0}"]
    assert vibro("grid", "grid.toml", "-o", "one", "--workers", "1", *short).code == 0
    assert vibro("grid", "grid.toml", "-o", "two", "--engine", "numba", *short).code == 0
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
