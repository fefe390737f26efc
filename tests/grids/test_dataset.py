"""The dataset on disk: the same bytes whatever its history, and nothing lost on the way."""

from __future__ import annotations

import errno
import itertools
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from tests.commands.processes import ROOT, START, call
from tests.grids.conftest import Write
from tests.grids.kill import content, kill_and_go_on
from vibro_cli.grids.chunks import Chunks
from vibro_cli.grids.dataset import (
    FolderInUse,
    GridChanged,
    MergeRefused,
    NoManifest,
    Shard,
    merge,
    opened,
    verify,
)
from vibro_cli.grids.document import Grid, load_grid
from vibro_cli.grids.workers import chunks_of, solve_in_threads
from vibro_cli.storage import files
from vibro_cli.storage.files import FolderRefused
from vibro_cli.storage.stored import open_grid

pytestmark = pytest.mark.long

SIZE = 5  # points of a chunk: three chunks, the last one short


def solve(
    grid: Grid,
    folder: Path,
    threads: int = 1,
    stretch: int = SIZE,
    shard: Shard | None = None,
    backwards: bool = False,
) -> None:
    """Solve the missing points of a grid, interpreted."""
    chunks = Chunks(grid.design.points, SIZE, stretch)
    wanted = None if shard is None else shard.chunks_of(chunks)
    with opened(folder, grid, chunks, wanted=wanted) as data:
        missing = data.missing[::-1] if backwards else data.missing
        tell = lambda points, impacts: None  # noqa: E731
        for receipt in solve_in_threads(grid, chunks, missing, folder, threads, "python", tell):
            data.add(receipt)
        data.write_manifest()


@pytest.fixture
def grid(small: Write) -> Grid:
    return load_grid(small(), ["stop.collisions=4"])


@pytest.fixture
def undisturbed(grid: Grid, tmp_path: Path) -> dict[str, bytes]:
    solve(grid, tmp_path / "undisturbed")
    return content(tmp_path / "undisturbed")


@pytest.mark.parametrize(
    "how",
    [{"threads": 3}, {"threads": 2, "stretch": 2}, {"backwards": True}, {"stretch": 1}],
    ids=["threads", "stretches", "backwards", "one by one"],
)
def test_the_bytes_do_not_depend_on_how_it_is_solved(
    grid: Grid, tmp_path: Path, undisturbed: dict[str, bytes], how: dict[str, Any]
) -> None:
    solve(grid, tmp_path / "other", **how)
    assert content(tmp_path / "other") == undisturbed
    assert len(undisturbed) == 2 * 3 + 2


def test_shards_are_put_together(grid: Grid, tmp_path: Path, undisturbed: dict[str, bytes]) -> None:
    folder = tmp_path / "sharded"
    chunks = Chunks(grid.design.points, SIZE, SIZE)
    for number, unfinished in ((2, "to be finished$"), (1, "to be finished, also 1/2$")):
        with opened(folder, grid, chunks) as data, pytest.raises(MergeRefused, match=unfinished):
            merge(data)
        shard = Shard(number, 2)
        solve(grid, shard.folder_in(folder), shard=shard)
        assert verify(shard.folder_in(folder)).sound
    with opened(folder, grid, chunks) as data:
        merge(data)
        assert len(data.receipts) == 3
    assert content(folder) == undisturbed
    assert not list(folder.glob("shard-*"))


def test_an_interrupted_merge_goes_on(
    grid: Grid, tmp_path: Path, undisturbed: dict[str, bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is ended after the move of each of the six parts in turn."""
    chunks, replace = Chunks(grid.design.points, SIZE, SIZE), os.replace
    for shard in (Shard(1, 2), Shard(2, 2)):
        solve(grid, shard.folder_in(tmp_path / "solved"), shard=shard)
    for moved in range(1, 7):
        folder, moves = tmp_path / f"merged-{moved}", itertools.count(1)
        shutil.copytree(tmp_path / "solved", folder)

        def struck(*paths: Any, moved: int = moved, moves: Iterator[int] = moves) -> None:
            replace(*paths)
            if "shard-" in str(paths[0]) and next(moves) == moved:
                raise KeyboardInterrupt

        with opened(folder, grid, chunks) as data, monkeypatch.context() as patch:
            patch.setattr(os, "replace", struck)
            with pytest.raises(KeyboardInterrupt):
                merge(data)
        with opened(folder, grid, chunks) as data:
            merge(data)
        assert content(folder) == undisturbed


def test_a_damaged_shard_is_not_merged(grid: Grid, tmp_path: Path) -> None:
    chunks = Chunks(grid.design.points, SIZE, SIZE)
    shard = Shard(1, 1)
    solve(grid, shard.folder_in(tmp_path / "s"), shard=shard)
    part = shard.folder_in(tmp_path / "s") / "summary" / "part-000001.parquet"
    part.write_bytes(part.read_bytes()[:-1] + b"!")
    with opened(tmp_path / "s", grid, chunks) as data, pytest.raises(MergeRefused, match="SHA-256"):
        merge(data)
    assert not list((tmp_path / "s" / "summary").iterdir())


def test_two_cannot_write_into_one_folder(grid: Grid, tmp_path: Path) -> None:
    chunks = Chunks(grid.design.points, SIZE, SIZE)
    with (
        opened(tmp_path / "one", grid, chunks),
        pytest.raises(FolderInUse),
        opened(tmp_path / "one", grid, chunks),
    ):
        pass
    with opened(tmp_path / "one", grid, chunks):
        pass


def test_parts_that_no_manifest_tells_of_are_taken_up(
    grid: Grid, tmp_path: Path, undisturbed: dict[str, bytes]
) -> None:
    folder = tmp_path / "undisturbed"
    (folder / "manifest.json").unlink()
    (folder / "summary" / ".part-000000.parquet.partial-ab").write_bytes(b"half")
    before = {path: path.stat().st_ino for path in folder.rglob("part-*")}
    solve(grid, folder)
    assert content(folder) == undisturbed
    assert {path: path.stat().st_ino for path in folder.rglob("part-*")} == before


def test_parts_are_not_searched_for_what_killed_writers_left(
    grid: Grid, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Opening the folder has removed it; a search for each part takes quadratic time."""
    listed, glob = [], Path.glob

    def counted(folder: Path, pattern: str) -> Iterator[Path]:
        listed.append(pattern)
        return glob(folder, pattern)

    monkeypatch.setattr(Path, "glob", counted)
    solve(grid, tmp_path / "searched")
    assert listed
    assert not [pattern for pattern in listed if "part-" in pattern]


@pytest.mark.parametrize(
    "edit",
    [
        lambda found: found.update(program=None),
        lambda found: found["files"].update({"grid.json": []}),
        lambda found: found["files"]["grid.json"].pop("sha256"),
        lambda found: found["files"]["summary/part-000000.parquet"].update(bytes="12"),
        lambda found: found.update(chunks=None),
        lambda found: found["chunks"].append([]),
        lambda found: found["chunks"][0].update(chunk="0"),
        lambda found: found["chunks"][0].pop("impacts"),
        lambda found: found["chunks"][0]["end_causes"].update(time=None),
        lambda found: found.update(wanted="3"),
    ],
)
def test_a_manifest_in_another_form_is_written_anew(
    grid: Grid, tmp_path: Path, undisturbed: dict[str, bytes], edit: Callable[[Any], None]
) -> None:
    folder = tmp_path / "undisturbed"
    found = json.loads(undisturbed["manifest.json"])
    edit(found)
    (folder / "manifest.json").write_text(json.dumps(found))
    solve(grid, folder)
    assert content(folder) == undisturbed


@pytest.mark.parametrize("content_left", [None, "{}", "half"])
def test_a_grid_whose_description_is_gone_is_described_anew(
    grid: Grid, tmp_path: Path, undisturbed: dict[str, bytes], content_left: str | None
) -> None:
    folder = tmp_path / "undisturbed"
    before = {path: path.stat().st_ino for path in folder.rglob("part-*")}
    (folder / "grid.json").unlink()
    if content_left is not None:
        (folder / "grid.json").write_text(content_left)
    solve(grid, folder)
    assert content(folder) == undisturbed
    assert {path: path.stat().st_ino for path in folder.rglob("part-*")} == before


def test_no_part_is_taken_for_one_of_another_grid(
    small: Write, tmp_path: Path, undisturbed: dict[str, bytes]
) -> None:
    """This holds even if the description of the earlier grid is missing."""
    folder = tmp_path / "undisturbed"
    (folder / "grid.json").unlink()
    other = load_grid(small(), ["stop.collisions=3"])
    solve(other, folder)
    solve(other, tmp_path / "other")
    assert content(folder) == content(tmp_path / "other") != undisturbed


def test_a_manifest_without_chunks_is_not_complete(grid: Grid, tmp_path: Path) -> None:
    folder = tmp_path / "edited"
    solve(grid, folder)
    found = json.loads((folder / "manifest.json").read_bytes())
    del found["chunks"]
    (folder / "manifest.json").write_text(json.dumps(found))
    assert verify(folder).missing_chunks == 3


def test_no_point_is_there_twice_where_the_division_was_changed(grid: Grid, tmp_path: Path) -> None:
    folder = tmp_path / "edited"
    solve(grid, folder)
    told = json.loads((folder / "grid.json").read_bytes())
    (folder / "grid.json").write_text(json.dumps({**told, "chunk_points": 3}))
    chunks = Chunks(grid.design.points, 3, 3)
    with opened(folder, grid, chunks) as data:
        tell = lambda points, impacts: None  # noqa: E731
        for receipt in solve_in_threads(grid, chunks, data.missing, folder, 1, "python", tell):
            data.add(receipt)
        data.write_manifest()
    assert sorted(_scenarios(folder)) == list(range(1, grid.design.points + 1))


def test_a_division_of_other_points_is_not_gone_on_with(grid: Grid) -> None:
    assert sum(chunks_of(grid, (5, 5), "python").sizes) == grid.design.points
    assert chunks_of(grid, (5, 5, 2), "python").sizes == [5, 5, 2]


def test_parts_of_another_grid_are_not_read(grid: Grid, tmp_path: Path) -> None:
    folder = tmp_path / "with more"
    solve(grid, folder)
    for table in ("summary", "collisions"):
        shutil.copy(folder / table / "part-000000.parquet", folder / table / "part-000007.parquet")
    stored = open_grid(folder)
    assert stored.points == grid.design.points
    impacts = stored.table("collisions").select(["scenario"])["scenario"]
    once = [pq.read_table(folder / f"collisions/part-00000{n}.parquet") for n in range(3)]
    assert len(impacts) == sum(one.num_rows for one in once)


def _scenarios(folder: Path) -> list[int]:
    """Return the numbers of the points of all summaries on disk."""
    parts = sorted((folder / "summary").glob("part-*.parquet"))
    return [n for part in parts for n in pq.read_table(part)["scenario"].to_pylist()]


def test_another_version_does_not_go_on(
    grid: Grid, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    solve(grid, tmp_path / "old")
    monkeypatch.setattr("vibro_cli.grids.dataset.__version__", "99.0")
    with pytest.raises(GridChanged, match=r'version: "[^"]*" -> "99.0"'):
        solve(grid, tmp_path / "old")


class Failing:
    """Lets the n-th call of a function of the system fail, and only that one."""

    def __init__(self, real: Callable[..., Any], at: int, error: int) -> None:
        self._real, self._at, self._error = real, at, error
        self._lock = threading.Lock()
        self.calls = 0

    def __call__(self, *arguments: Any, **more: Any) -> Any:
        with self._lock:
            self.calls += 1
            fails = self.calls == self._at
        if fails:
            raise OSError(self._error, os.strerror(self._error))
        return self._real(*arguments, **more)


def _failing_calls() -> Iterator[tuple[str, int]]:
    yield from (("fsync", error) for error in (errno.EIO, errno.ENOSPC))
    yield from (("replace", error) for error in (errno.EIO, errno.ENOSPC, errno.EROFS))
    yield from (("open", error) for error in (errno.ENOSPC, errno.EACCES))
    yield from (("write", error) for error in (errno.EIO, errno.ENOSPC))


@pytest.mark.parametrize(("call", "error"), list(_failing_calls()))
def test_every_call_of_the_system_may_fail_once(
    grid: Grid, tmp_path: Path, undisturbed: dict[str, bytes], call: str, error: int
) -> None:
    at = 0
    while True:
        at += 1
        folder = tmp_path / f"{call}-{error}-{at}"
        with pytest.MonkeyPatch.context() as patch:
            failing = _fail(patch, call, at, error)
            try:
                solve(grid, folder, threads=2)
            except OSError as raised:
                assert raised.errno == error  # noqa: PT017 (it may also succeed)
        for name, whole in (content(folder) if folder.exists() else {}).items():
            if "part-" in name:
                assert whole == undisturbed[name], "a part is there whole or not at all"
        solve(grid, folder)
        assert content(folder) == undisturbed
        if failing.calls < at:
            break
    assert at > 8


def _fail(patch: pytest.MonkeyPatch, call: str, at: int, error: int) -> Failing:
    if call in ("fsync", "replace"):
        failing = Failing(getattr(os, call), at, error)
        patch.setattr(f"vibro_cli.storage.files.os.{call}", failing)
        return failing
    if call == "open":
        failing = Failing(open, at, error)
        patch.setattr(files, "open", failing, raising=False)
        return failing
    failing = Failing(lambda: None, at, error)

    def opened_for_writing(path: Any, mode: str) -> Any:
        file: Any = _real_open(path, mode)
        real = file.write
        wrapped = _Wrapped(
            file,
            lambda data: (real(data[: len(data) // 2]), failing(), real(data[len(data) // 2 :]))[2],
        )
        return wrapped

    patch.setattr(files, "open", opened_for_writing, raising=False)
    return failing


_real_open = open


class _Wrapped:
    """A file whose writing goes through another function."""

    def __init__(self, file: Any, write: Callable[[bytes], Any]) -> None:
        self._file, self.write = file, write

    def __enter__(self) -> _Wrapped:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


def test_every_flipped_bit_is_found(grid: Grid, tmp_path: Path) -> None:
    folder = tmp_path / "flipped"
    solve(grid, folder)
    assert verify(folder).sound
    parts = sorted(folder.rglob("part-*.parquet"))
    draw = random.Random(5)
    for _ in range(500):
        part = draw.choice(parts)
        whole = part.read_bytes()
        damaged = bytearray(whole)
        bit = draw.randrange(8 * len(whole))
        damaged[bit // 8] ^= 1 << bit % 8
        part.write_bytes(damaged)
        findings = verify(folder).findings
        assert [(one.file, one.state) for one in findings] == [
            (str(part.relative_to(folder)), "damaged")
        ]
        part.write_bytes(whole)


def test_every_flipped_bit_of_the_manifest_is_found_and_mended(grid: Grid, tmp_path: Path) -> None:
    folder = tmp_path / "flipped"
    solve(grid, folder)
    manifest = folder / "manifest.json"
    whole = manifest.read_bytes()
    for bit in random.Random(5).sample(range(8 * len(whole)), 500):
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        manifest.write_bytes(damaged)
        try:
            findings = verify(folder).findings
        except NoManifest:
            continue
        assert ("manifest.json", "damaged") in [(one.file, one.state) for one in findings]
    manifest.write_bytes(whole.replace(b'"impacts": ', b'"impacts": 1'))
    assert [one.file for one in verify(folder).findings] == ["manifest.json"]
    solve(grid, folder)
    assert manifest.read_bytes() == whole
    manifest.write_bytes(whole.replace(b'"impacts": ', b'"impacts": NaN, "": '))
    with pytest.raises(NoManifest):
        verify(folder)


def test_a_manifest_of_an_earlier_version_has_no_checksum(grid: Grid, tmp_path: Path) -> None:
    folder = tmp_path / "earlier"
    solve(grid, folder)
    found = json.loads((folder / "manifest.json").read_bytes())
    del found["sha256"]
    (folder / "manifest.json").write_text(json.dumps(found))
    assert verify(folder).sound
    assert open_grid(folder).points == grid.design.points


def test_a_folder_that_cannot_be_written_is_told(grid: Grid, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FolderRefused):
        solve(grid, tmp_path / "file")


def arguments(grid: Path, folder: Path) -> list[str]:
    """Return the command line for a grid, to be solved in a process of its own."""
    more = ["--engine", "python", "--workers", "2", "--set", "stop.collisions=4"]
    return ["grid", str(grid), "-o", str(folder), *more]


def test_a_grid_that_was_killed_while_its_description_was_written_goes_on(
    small: Write, tmp_path: Path
) -> None:
    path = small()
    call(ROOT, *arguments(path, tmp_path / "whole")).check_returncode()
    killed = "import os, signal; os.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL); "
    begun = [sys.executable, "-c", killed + START, *arguments(path, tmp_path / "cut")]
    assert subprocess.run(begun, cwd=ROOT, check=False).returncode == -signal.SIGKILL
    assert [name for name in os.listdir(tmp_path / "cut") if name.startswith(".grid.json.partial-")]
    again = call(ROOT, *arguments(path, tmp_path / "cut"))
    assert again.returncode == 0, again.stderr
    assert content(tmp_path / "cut") == content(tmp_path / "whole")


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_whatever_ends_the_process_the_same_command_goes_on(
    small: Write, tmp_path: Path, end: signal.Signals
) -> None:
    path = small()
    grid = load_grid(path, ["stop.collisions=4"])
    reference = call(ROOT, *arguments(path, tmp_path / "whole"))
    reference.check_returncode()
    assert b"12 points" in reference.stderr
    killed = kill_and_go_on(
        lambda folder: arguments(path, folder), tmp_path / "cut", end, random.Random(3), times=2
    )
    assert content(tmp_path / "cut") == content(tmp_path / "whole")
    assert killed >= 0
    assert grid.design.points == 12
