"""`vibro grid` and `vibro verify` as commands."""

from __future__ import annotations

import json
import shlex
import shutil
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from tests.commands.conftest import Vibro
from tests.grid_folder import product, write_grid
from tests.grids.kill import content
from tests.two_balls import SCENARIO
from vibro_cli.commands.shared.error_handling import Terminated
from vibro_cli.grids import workers

GRID = """
base = "small.toml"
[[axes]]
path = "balls[1].angle"
linspace = [-1.2, -0.4, 3]
[[axes]]
path = "collision.k"
values = [0.9, 2.0]
[keep]
collisions = true
"""

EARLY = """
base = "three_arcs.toml"
[[axes]]
path = "balls[1].speed"
values = [-3.0, -6.0, -9.0]
"""
REFUSED = """
base = "unequal_hedrih.toml"
[[axes]]
path = "collision.k"
values = [0.9, 1.0]
"""


@pytest.fixture
def grid(tmp_path: Path, scenario: Path) -> Path:
    path = tmp_path / "sweep.toml"
    path.write_text(GRID)
    return path


def test_a_grid_is_solved_verified_and_found_finished(vibro: Vibro, grid: Path) -> None:
    first = vibro("grid", grid, "--json")
    assert first.code == 0, first.err
    told = first.lines[0]
    assert (told["points"], told["invalid"], told["complete"]) == (6, 3, True)
    folder = Path("outputs/sweep")
    assert sorted(content(folder)) == [
        "collisions/part-000000.parquet",
        "grid.json",
        "manifest.json",
        "summary/part-000000.parquet",
    ]
    before = content(folder)
    again = vibro("grid", grid, "--json")
    assert again.code == 0
    assert again.lines[0] == told
    assert content(folder) == before
    assert vibro("verify", folder).code == 0
    assert vibro("grid", grid, "-q").err == ""
    strict = vibro("grid", grid, "--strict", "-q")
    assert strict.code == 3
    assert "3 invalid" in strict.err


def test_the_summary_of_a_grid_gives_a_reason_and_the_next_command(
    vibro: Vibro, grid: Path
) -> None:
    outcome = vibro("grid", grid)
    assert outcome.out == b""
    lines = outcome.err.splitlines()
    assert lines[:4] == [
        "sweep: 6 points, 7 impacts",
        "  points     3 invalid; 1 reached an end of the trace",
        "  example    scenario 2 (invalid): collision.k: found 2.0, expected a number",
        "             from 0 to 1",
    ]
    assert lines[4].startswith("  files      outputs/sweep (1 chunk, ")
    assert lines[5] == "  next       vibro report outputs/sweep"


def test_the_summary_of_a_grid_counts_the_runs_that_end_early(vibro: Vibro, tmp_path: Path) -> None:
    """It also gives the hint that such a run gives."""
    for name in ("unequal_hedrih", "three_arcs"):
        assert vibro("new", name).code == 0
    Path("early.toml").write_text(EARLY)
    told = vibro("grid", "early.toml", "--set", "stop.time=2", "--json")
    causes = told.lines[0]["end_causes"]
    assert causes == {"end_of_trace": 2, "time": 1}
    lines = told.err.splitlines()
    assert lines[1] == "  points     all valid and admissible; 2 reached an end of the trace"
    Path("refused.toml").write_text(REFUSED)
    lines = vibro("grid", "refused.toml").err.splitlines()
    assert lines[1] == "  points     1 inadmissible"
    hint = [line for line in lines if line.startswith("  hint ")]
    (alone,) = [
        line
        for line in vibro("run", "unequal_hedrih.toml", "--no-figures").err.splitlines()
        if line.startswith("  hint ")
    ]
    assert hint == [alone]
    shard = vibro("grid", "refused.toml", "--shard", "1/1", "-o", "sharded").err.splitlines()
    assert shard[-1] == "  hint       merge once all shards are finished"
    merged = vibro("grid", "refused.toml", "--merge", "-o", "sharded").err.splitlines()
    assert merged[-1] == "  next       vibro report sharded"  # no --force


def test_a_grid_of_an_earlier_version_is_counted_anew(vibro: Vibro, grid: Path) -> None:
    assert vibro("grid", grid).code == 0
    folder = Path("outputs/sweep")
    before = content(folder)
    manifest = json.loads(before["manifest.json"])
    for counts in manifest["chunks"]:
        counts["inadmissible"] = 0
        del counts["end_causes"]
    (folder / "manifest.json").write_text(json.dumps(manifest))
    assert "already complete" in vibro("grid", grid).err
    assert content(folder) == before


def test_another_grid_is_refused_with_the_difference(vibro: Vibro, grid: Path) -> None:
    assert vibro("grid", grid).code == 0
    before = content(Path("outputs/sweep"))
    refused = vibro("grid", grid, "--set", "stop.collisions=2")
    assert refused.code == 2
    assert "scenario.stop.collisions: 3 -> 2" in refused.err
    assert content(Path("outputs/sweep")) == before
    anew = vibro("grid", grid, "--set", "stop.collisions=2", "--force", "--json")
    assert anew.code == 0
    assert 0 < anew.lines[0]["impacts"] <= 3 * 2


def test_damage_is_found_and_repaired(vibro: Vibro, grid: Path) -> None:
    assert vibro("grid", grid).code == 0
    folder = Path("outputs/sweep")
    before = content(folder)
    part = folder / "collisions" / "part-000000.parquet"
    damaged = bytearray(part.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    part.write_bytes(damaged)
    found = vibro("verify", folder, "--json")
    assert found.code == 1
    assert found.lines[0]["findings"][0]["file"] == "collisions/part-000000.parquet"
    assert vibro("grid", grid, "--repair").code == 0
    assert content(folder) == before
    part.unlink()
    assert vibro("verify", folder).code == 1
    assert vibro("grid", grid).code == 0
    assert content(folder) == before


def test_an_interrupted_repair_does_not_keep_what_is_damaged(
    vibro: Vibro, grid: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert vibro("grid", in_three_chunks(grid)).code == 0
    folder = Path("outputs/sweep")
    before = content(folder)
    part = folder / "summary" / "part-000001.parquet"
    damaged = bytearray(part.read_bytes())
    damaged[50] ^= 1  # a value; the table can still be read
    part.write_bytes(damaged)

    def interrupted(*_: Any) -> Iterator[Any]:
        yield from ()
        raise Terminated(15)

    with monkeypatch.context() as patch:
        patch.setattr(workers, "solve_in_threads", interrupted)
        assert vibro("grid", grid, "--repair").code == 143
    assert vibro("grid", grid).code == 0
    assert content(folder) == before


def in_three_chunks(grid: Path) -> Path:
    grid.write_text("chunk_points = 2\n" + GRID)
    return grid


@pytest.mark.parametrize("chunks", [0, 1])
def test_a_grid_says_whether_something_is_kept_of_it(
    vibro: Vibro, grid: Path, monkeypatch: pytest.MonkeyPatch, chunks: int
) -> None:
    grid.write_text(f"chunk_points = 2\n{GRID}")
    solve = workers.solve_in_threads

    def interrupted(*given: Any) -> Iterator[Any]:
        yield from islice(solve(*given), chunks)
        raise Terminated(15)

    monkeypatch.setattr(workers, "solve_in_threads", interrupted)
    outcome = vibro("grid", grid)
    assert outcome.code == 143
    kept = "finished results are kept" if chunks else "no chunk was finished"
    goes_on = ["vibro: the same command continues from here"][:chunks]
    assert outcome.err.splitlines() == [*goes_on, f"vibro: terminated; {kept}"]
    monkeypatch.undo()
    whole = vibro("grid", grid, "-o", grid.parent / "whole")
    assert (vibro("grid", grid, "-o", grid.parent / "outputs/sweep").code, whole.code) == (0, 0)
    assert content(grid.parent / "outputs/sweep") == content(grid.parent / "whole")


def test_a_chunk_is_finished_when_its_files_are(
    vibro: Vibro, grid: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    solve = workers.solve_in_threads

    def interrupted(*given: Any) -> Iterator[Any]:
        for _ in solve(*given):
            raise Terminated(15)
        yield

    vibro("grid", grid, "-o", "whole")
    monkeypatch.setattr(workers, "solve_in_threads", interrupted)
    outcome = vibro("grid", grid, "-o", "one")
    assert outcome.code == 143
    goes_on = "vibro: the same command continues from here"
    assert outcome.err.splitlines() == [goes_on, "vibro: terminated; finished results are kept"]
    assert content(Path("one")) == content(Path("whole"))


def test_a_grid_is_written_to_where_a_link_leads(vibro: Vibro, grid: Path) -> None:
    Path("link").symlink_to("there/sweep")
    outcome = vibro("grid", grid, "-o", "link")
    assert outcome.code == 0, outcome.err
    assert vibro("verify", "there/sweep").code == 0
    assert Path("link").is_symlink()


def test_a_finished_grid_says_so(vibro: Vibro, grid: Path) -> None:
    assert "nothing to solve" not in vibro("grid", grid).err
    assert "already complete; nothing to solve" in vibro("grid", grid).err


def test_a_shard_of_a_finished_grid_solves_nothing(vibro: Vibro, grid: Path) -> None:
    assert vibro("grid", in_three_chunks(grid)).code == 0
    folder = Path("outputs/sweep")
    before = content(folder)
    outcome = vibro("grid", grid, "--shard", "1/2", "--json")
    assert (outcome.code, outcome.lines[0]["points"], outcome.lines[0]["complete"]) == (0, 0, True)
    assert "outputs/sweep already has all chunks of this shard; nothing to solve" in outcome.err
    assert content(folder) == before
    assert vibro("verify", folder).code == 0


def test_more_shards_than_chunks_are_warned_of(vibro: Vibro, grid: Path) -> None:
    first = vibro("grid", grid, "--shard", "1/2")
    assert first.code == 0
    assert "warning: 1 chunk for 2 shards; a lower chunk_points" in first.err
    second = vibro("grid", grid, "--shard", "2/2")
    assert second.code == 0
    assert "this shard has no chunks; nothing to solve" in second.err


def test_a_shard_names_the_merge_as_the_next_step(vibro: Vibro, grid: Path) -> None:
    words = vibro("grid", in_three_chunks(grid), "--shard", "1/2").err
    command = f"vibro grid {grid} --merge"
    assert words.splitlines()[-2:] == [
        f"  next       {command}",
        "  hint       merge once all shards are finished",
    ]
    assert vibro("grid", grid, "--shard", "2/2").code == 0
    merged = vibro(*shlex.split(command)[1:]).err
    assert merged.splitlines()[-1] == "  next       vibro report outputs/sweep"


def test_many_outcomes_are_listed_up_to_the_rarest(vibro: Vibro, tmp_path: Path) -> None:
    """Those that are not listed have the share that is left to one."""
    values = [number / 40 for number in range(40)]
    write_grid(tmp_path / "grid", product({"balls[1].angle": values, "collision.k": values}))
    both = ("--outcome", "end_cause", "--outcome", "collisions")
    outcome = vibro("basins", "grid", *both, "--no-figures")
    found = json.loads(Path("grid-basins/basins.json").read_text())["outcomes"]
    assert len(found) == 28
    lines = outcome.text.splitlines()[1:]
    for line, one in zip(lines[:20], found, strict=False):
        assert line == f"  {100 * one['share']:6.2f} %  {one['outcome']}"
    left = 100 * (1 - sum(one["share"] for one in found[:20]))
    assert lines[20] == f"  {left:6.2f} %  {len(found) - 20} others, see basins.json"
    assert lines[21].startswith("  basin entropy")


def test_shards_solve_what_the_folder_of_their_grid_lacks(vibro: Vibro, grid: Path) -> None:
    assert vibro("grid", in_three_chunks(grid)).code == 0
    folder = Path("outputs/sweep")
    before = content(folder)
    (folder / "summary/part-000002.parquet").unlink()
    (shard,) = vibro("grid", grid, "--shard", "1/2", "--json").lines
    assert (shard["chunks"], shard["points"]) == (1, 2)  # of the chunks 0 and 2 of this shard
    assert vibro("verify", folder / "shard-1-of-2").code == 0
    (again,) = vibro("grid", grid, "--shard", "1/2", "--json").lines
    assert again == shard
    found = vibro("verify", folder, "--json").lines[0]["findings"]
    assert [one["file"] for one in found] == ["summary/part-000002.parquet"]
    assert vibro("grid", grid, "--merge").code == 0
    assert content(folder) == before
    assert vibro("verify", folder).code == 0


def test_a_shard_of_another_grid_is_refused(vibro: Vibro, grid: Path) -> None:
    assert vibro("grid", grid).code == 0
    before = content(Path("outputs/sweep"))
    refused = vibro("grid", grid, "--set", "stop.collisions=2", "--shard", "1/2", "--force")
    assert refused.code == 2
    assert "scenario.stop.collisions: 3 -> 2" in refused.err
    assert content(Path("outputs/sweep")) == before


@pytest.mark.parametrize("table", ["summary", "collisions"])
def test_a_damaged_grid_is_not_reported(vibro: Vibro, grid: Path, table: str) -> None:
    assert vibro("grid", in_three_chunks(grid)).code == 0
    part = Path(f"outputs/sweep/{table}/part-000000.parquet")
    sound = part.read_bytes()
    for place in (len(sound) // 3, len(sound) // 2, len(sound) - 3):
        part.write_bytes(sound[:place] + bytes([sound[place] ^ 1]) + sound[place + 1 :])
        refused = vibro("report", "outputs/sweep")
        assert refused.code == 2
        assert f"vibro: {part} has changed since it was written (SHA-256" in refused.err
        assert refused.err.endswith("; vibro grid GRID --repair solves it again\n")
    part.unlink()
    assert f"vibro: {part} is missing; vibro grid" in vibro("report", "outputs/sweep").err
    assert not Path("outputs/sweep-report.html").exists()


def test_too_many_failures_end_it(vibro: Vibro, grid: Path) -> None:
    ended = vibro("grid", grid, "--max-failures", 2)
    assert ended.code == 1
    assert "--max-failures" in ended.err
    assert vibro("grid", grid, "--max-failures", 3).code == 0


def test_a_dry_run_writes_nothing(vibro: Vibro, grid: Path, tmp_path: Path) -> None:
    before = sorted(tmp_path.iterdir())
    told = vibro("grid", grid, "--dry-run", "--json", "-q")
    assert told.code == 0
    assert told.err == ""
    line = json.loads(told.text)
    assert (line["points"], line["chunks"]) == (6, 1)
    assert line["bytes"] > 0
    assert line["seconds"] > 0
    assert sorted(tmp_path.iterdir()) == before
    # The sample contains all points, so the estimates of impacts and bytes are exact.
    solved = vibro("grid", grid, "--json").lines[0]
    assert (line["impacts"], line["bytes"]) == (solved["impacts"], solved["bytes"])


def test_a_dry_run_warns_of_invalid_points(vibro: Vibro, grid: Path) -> None:
    """With every point invalid it foretold some bytes and no impacts, and no more."""
    told = vibro("grid", grid, "--dry-run", "--json")
    assert told.lines[0]["sampled_invalid"] == 3
    assert "warning    3 of 6 points" in told.err
    grid.write_text(GRID.replace("2.0", "1.0"))
    told = vibro("grid", grid, "--dry-run", "--json")
    assert told.lines[0]["sampled_invalid"] == 0
    assert "warning" not in told.err


def test_a_dry_run_promises_the_time_it_takes(
    vibro: Vibro, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To an order of magnitude: solving alone, without the start, takes a fortieth of it.

    Time of the processor: that of the clock depends on other work on the machine.
    """
    monkeypatch.setattr("time.perf_counter", time.process_time)
    text = SCENARIO.replace("collisions = 3", "collisions = 300")
    (tmp_path / "small.toml").write_text(
        text + "[ends]\nleft = {wall = 1.0}\nright = {wall = 1.0}\n"
    )
    (tmp_path / "k.toml").write_text(
        'base = "small.toml"\n[[axes]]\npath = "collision.k"\nlinspace = [0.9, 1.0, 50]\n'
    )
    assert vibro("grid", "k.toml", "-o", "first").code == 0  # and loads the libraries
    promised = vibro("grid", "k.toml", "--dry-run", "--json").lines[0]["seconds"]
    begin = time.perf_counter()
    assert vibro("grid", "k.toml", "-o", "second").code == 0
    taken = time.perf_counter() - begin
    assert taken / 10 < promised < taken * 10


def test_a_folder_of_something_else_is_left_alone(vibro: Vibro, grid: Path) -> None:
    foreign = Path("mine")
    foreign.mkdir()
    (foreign / "notes.txt").write_text("kept")
    refused = vibro("grid", grid, "-o", foreign)
    assert refused.code == 2
    assert sorted(content(foreign)) == ["notes.txt"]
    assert vibro("verify", foreign).code == 2


def test_wrong_axes_are_told_with_their_place(vibro: Vibro, grid: Path) -> None:
    grid.write_text(GRID.replace("angle", "angel"))
    refused = vibro("grid", grid)
    assert refused.code == 2
    assert f"{grid}:4:8: axes[1].path: " in refused.err
    assert "Traceback" not in refused.err


def test_runs_are_verified_too(vibro: Vibro, scenario: Path) -> None:
    assert vibro("run", scenario, "-o", "one", "--no-figures").code == 0
    assert vibro("verify", "one").code == 0
    Path("one/summary.json").write_text("{}")
    assert vibro("verify", "one").code == 1
    Path("other").mkdir()
    told = vibro("verify", "one", "other", "none", "--json")
    assert told.code == 2
    assert [(line["folder"], line["sound"]) for line in told.lines] == [
        ("one", False), ("other", False), ("none", False)
    ]  # fmt: skip
    assert told.lines[2]["reason"] == "none: no such folder"


def test_a_file_beside_the_folders_is_no_folder_of_results(vibro: Vibro) -> None:
    """As a report in `vibro verify outputs/*`, of which it was said that it has no manifest."""
    Path("one-report.html").touch()
    told = vibro("verify", "one-report.html")
    words = "vibro: one-report.html is a file; expected a folder of results\n"
    assert (told.code, told.err) == (2, words)


def test_files_whose_folder_is_a_file_are_missing(vibro: Vibro, grid: Path) -> None:
    for folder in ("one", "other"):
        assert vibro("grid", grid, "-o", folder).code == 0
    shutil.rmtree("one/summary")
    Path("one/summary").touch()
    told = vibro("verify", "one", "other", "--json")
    assert told.code == 1
    assert [line["sound"] for line in told.lines] == [False, True]
    states = {found["file"]: found["state"] for found in told.lines[0]["findings"]}
    parts = sorted(path.name for path in Path("other/summary").iterdir())
    assert states == {"summary": "unknown"} | {f"summary/{part}": "missing" for part in parts}


def test_what_was_asked_wrong_and_what_failed_have_exit_codes_of_their_own(
    vibro: Vibro, grid: Path
) -> None:
    unsafe = vibro("grid", in_three_chunks(grid), "--dask", "tcp://example.org:1")
    assert (unsafe.code, "expected tls://" in unsafe.err) == (2, True)
    assert vibro("grid", grid, "--shard", "1/2", "-o", "parts").code == 0
    unfinished = vibro("grid", grid, "--merge", "-o", "parts")
    assert (unfinished.code, "expected all shards to be finished" in unfinished.err) == (1, True)


def test_a_grid_without_a_stop_by_time_gives_a_hint_before_it_is_solved(
    vibro: Vibro, grid: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: Any) -> None:
        raise Terminated(15)

    monkeypatch.setattr(workers, "solve_in_threads", interrupted)
    first = vibro("grid", grid, "--set", "stop.collisions=1000").err.splitlines()[0]
    assert first.startswith("sweep: hint: without stop.time, points whose impacts die out (k < 1) ")
    assert "hint" not in vibro("grid", grid, "-o", "other").err


@pytest.mark.parametrize("shard", ["3/2", "0/2", "a/b", "1"])
def test_a_shard_that_is_none_is_refused_like_other_options(
    vibro: Vibro, grid: Path, shard: str
) -> None:
    outcome = vibro("grid", grid, "--shard", shard)
    assert outcome.code == 2
    assert outcome.err == (
        f"vibro: --shard: found {shard!r}, expected I/N such as 3/16, with I from 1 to N "
        "(see vibro grid --help)\n"
    )
