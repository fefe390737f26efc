"""`vibro bench` in its quick form, and its references."""

from __future__ import annotations

import json
from pathlib import Path

import pyarrow.parquet as pq

from tests.commands.conftest import Vibro


def test_the_quick_form_writes_table_figures_and_page(vibro: Vibro, tmp_path: Path) -> None:
    target = tmp_path / "bench"
    outcome = vibro("bench", "--quick", "--json", "--scene", "circle", "-o", str(target))
    assert outcome.code == 0, outcome.err
    names = {path.name for path in target.iterdir()}
    assert names == {
        "benchmark.parquet", "benchmark.html", "work_precision.png", "work_precision.pdf",
        "manifest.json",
    }  # fmt: skip
    table = pq.read_table(target / "benchmark.parquet")
    assert table.schema.metadata[b"vibro:schema"] == b"benchmark/1"
    assert table.num_rows == len(outcome.lines)
    ours = next(line for line in outcome.lines if line["method"] == "vibro")
    assert ours["error"] < 1e-15
    assert ours["per_impact"] > 0.0


def test_an_unknown_scene_is_told(vibro: Vibro) -> None:
    outcome = vibro("bench", "--scene", "square")
    assert outcome.code == 2
    assert "'square'" in outcome.err
    assert "three_arcs" in outcome.err


def test_quick_and_full_exclude_one_another(vibro: Vibro) -> None:
    assert vibro("bench", "--quick", "--full").code == 2


def test_a_foreign_folder_is_left_alone(vibro: Vibro, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    outcome = vibro("bench", "--quick", "-o", str(tmp_path))
    assert outcome.code == 2
    assert "mine" in {path.stem for path in tmp_path.iterdir()}


def test_references_are_written(vibro: Vibro, tmp_path: Path) -> None:
    outcome = vibro("bench", "--references", str(tmp_path / "new"), "--scene", "five_balls")
    assert outcome.code == 0, outcome.err
    assert "0.0e+00" in outcome.text
    quiet = vibro("bench", "--references", str(tmp_path / "new"), "--scene", "five_balls", "-q")
    assert (quiet.code, quiet.text, quiet.err) == (0, "", "")
    content = json.loads((tmp_path / "new" / "five_balls.json").read_text())
    assert len(content["times"]) == 10
