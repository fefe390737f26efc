"""The folder of a run: its contents, and what it may replace."""

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import pytest

from tests.fake_run import FakeRun, FakeScenario, columns_of
from vibro_cli import __version__
from vibro_cli.storage.files import FolderRefused, json_bytes, read_manifest
from vibro_cli.storage.folders import write_run
from vibro_cli.storage.tables import read_parquet
from vibro_cli.systems.trace import tables as of_trace

FILES = {
    "collisions.parquet",
    "events.parquet",
    "summary.parquet",
    "summary.json",
    "checkpoint.json",
    "scenario.json",
    "manifest.json",
}


def write(
    target: Path, run: FakeRun | None = None, figures: dict[str, bytes] | None = None
) -> None:
    scenario: Any = FakeScenario()
    result: Any = run or FakeRun()
    write_run(result, scenario, target, figures or {})


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_run_holds_tables_summary_checkpoint_scenario_and_figures(tmp_path: Path) -> None:
    write(tmp_path / "run", figures={"portrait_1.png": b"image"})
    assert set(contents(tmp_path / "run")) == FILES | {"portrait_1.png"}
    assert json.loads((tmp_path / "run" / "summary.json").read_bytes())["end_time"] == 60.0
    assert json.loads((tmp_path / "run" / "checkpoint.json").read_bytes())["t"] == 0.1 + 0.2
    assert json.loads((tmp_path / "run" / "scenario.json").read_bytes())["name"] == "by-hand"
    assert read_parquet(tmp_path / "run" / "collisions.parquet").num_rows == 3


def test_a_run_protected_from_writing_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was replaced, and left under the name of an unfinished folder: nobody could empty it."""
    folder = tmp_path / "run"
    write(folder)
    before = contents(folder)
    folder.chmod(0o555)
    # As the system answers anyone but the superuser, who may run this.
    monkeypatch.setattr(os, "access", lambda path, mode: path.stat().st_mode >> 6 & mode == mode)
    with pytest.raises(FolderRefused, match="run is read-only; it is left as it is"):
        write(folder)
    assert contents(folder) == before
    assert os.listdir(tmp_path) == ["run"]
    folder.chmod(0o755)
    write(folder)
    assert contents(folder) == before


def test_motion_is_written_where_it_was_sampled(tmp_path: Path) -> None:
    write(tmp_path / "run", FakeRun(motion=columns_of(of_trace.MOTION, 7)))
    assert read_parquet(tmp_path / "run" / "motion.parquet").num_rows == 7


def test_the_manifest_names_program_engine_and_every_file(tmp_path: Path) -> None:
    write(tmp_path / "run")
    manifest = read_manifest(tmp_path / "run")
    assert manifest is not None
    assert manifest["schema"] == "vibro-run/1"
    assert manifest["program"] == {"name": "vibro", "version": __version__}
    assert manifest["engine"] == "python"
    found = contents(tmp_path / "run")
    del found["manifest.json"]
    assert manifest["files"] == {
        name: {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}
        for name, content in found.items()
    }


def test_equal_runs_give_equal_folders(tmp_path: Path) -> None:
    write(tmp_path / "one")
    write(tmp_path / "two")
    assert contents(tmp_path / "one") == contents(tmp_path / "two")


def test_a_run_replaces_a_run_and_nothing_of_the_old_stays(tmp_path: Path) -> None:
    write(tmp_path / "run", figures={"portrait_1.png": b"image"})
    write(tmp_path / "run")
    assert set(contents(tmp_path / "run")) == FILES
    assert os.listdir(tmp_path) == ["run"]


def test_an_empty_folder_is_filled(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    write(tmp_path / "run")
    assert set(contents(tmp_path / "run")) == FILES


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("thesis.tex", b"years of work", "is not a vibro run"),
        (".git", b"gitdir: elsewhere", "is not a vibro run"),
        ("manifest.json", b"{}", "is not a vibro run"),
        ("manifest.json", b"[" * 100_000, "is not a vibro run"),
        ("manifest.json", b'{"schema": "vibro-grid/1", "files": {}}', "is not a vibro run"),
        (
            "manifest.json",
            b'{"schema": "vibro-run/1", "program": 1, "files": {}}',
            "not a vibro run",
        ),
        ("summary.json", b"{}", "is not a vibro run"),
    ],
)
def test_a_folder_that_is_not_ours_is_left_as_it_is(
    tmp_path: Path, name: str, content: bytes, message: str
) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / name).write_bytes(content)
    with pytest.raises(FolderRefused, match=message):
        write(tmp_path / "run")
    assert contents(tmp_path / "run") == {name: content}
    assert os.listdir(tmp_path) == ["run"]


def test_a_run_with_somebodys_notes_in_it_is_left_as_it_is(tmp_path: Path) -> None:
    write(tmp_path / "run")
    (tmp_path / "run" / "notes.txt").write_text("keep me")
    with pytest.raises(FolderRefused, match=r"notes\.txt"):
        write(tmp_path / "run")
    assert (tmp_path / "run" / "notes.txt").read_text() == "keep me"


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run").write_text("mine")
    with pytest.raises(FolderRefused, match="is a file"):
        write(tmp_path / "run")
    assert (tmp_path / "run").read_text() == "mine"


def test_json_refuses_what_json_has_not() -> None:
    with pytest.raises(ValueError, match="JSON"):
        json_bytes({"x": float("nan")})
