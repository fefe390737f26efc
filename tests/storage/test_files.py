"""Files and folders written whole or not at all, also when interrupted at any moment."""

import errno
import hashlib
import mmap
import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vibro_cli.storage import files
from vibro_cli.storage.files import FolderRefused, new_folder, write_file

WRITER = """
import sys
from pathlib import Path
from typing import Any
from vibro_cli.storage.files import new_folder

target, round_ = Path(sys.argv[1]), 0
print("ready", flush=True)
while True:
    round_ += 1
    with new_folder(target, lambda folder: None) as folder:
        for name in "abcd":
            folder.write(name, str(round_).encode() * 2000)
"""


def allow(folder: Path) -> None:
    """Allow every folder to be replaced."""


def entries(folder: Path) -> list[str]:
    return sorted(os.listdir(folder))


def test_a_file_is_written_whole_and_alone(tmp_path: Path) -> None:
    write_file(tmp_path / "a.txt", b"one")
    write_file(tmp_path / "a.txt", b"two")
    assert (tmp_path / "a.txt").read_bytes() == b"two"
    assert entries(tmp_path) == ["a.txt"]


KILLED = """
import os, signal, sys
from pathlib import Path
from vibro_cli.storage.files import write_file

os.fsync = lambda handle: os.kill(os.getpid(), signal.SIGKILL)
write_file(Path(sys.argv[1]), b"never finished")
"""


def test_what_a_killed_writer_of_a_file_left_is_removed_by_the_next(tmp_path: Path) -> None:
    target = tmp_path / "balls[1].html"
    write_file(target, b"one")
    killed = subprocess.run([sys.executable, "-c", KILLED, str(target)], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert target.read_bytes() == b"one"
    assert len(entries(tmp_path)) == 2
    write_file(tmp_path / "another.html", b"")
    assert len(entries(tmp_path)) == 3, "it belongs to the file that was to be written"
    write_file(target, b"two")
    assert target.read_bytes() == b"two"
    assert entries(tmp_path) == ["another.html", "balls[1].html"]


@pytest.mark.parametrize("step", ["os.open", "fcntl.flock", "os.fsync", "os.replace"])
def test_two_writers_of_one_file_do_not_disturb_each_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    module, name = step.split(".")
    real, target = getattr(sys.modules[module], name), tmp_path / "a"

    def after_another(*arguments: Any) -> Any:
        monkeypatch.undo()
        write_file(target, b"quick")
        assert target.read_bytes() == b"quick"
        return real(*arguments)

    monkeypatch.setattr(step, after_another)
    write_file(target, b"slow")
    assert target.read_bytes() == b"slow"
    assert entries(tmp_path) == ["a"]


def test_a_file_needs_no_locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("fcntl.flock", refuse)
    write_file(tmp_path / "a", b"one")
    write_file(tmp_path / "a", b"two")
    assert (tmp_path / "a").read_bytes() == b"two"
    assert entries(tmp_path) == ["a"]


@pytest.mark.parametrize("shift", [0, 16])
def test_large_contents_are_written_whole(tmp_path: Path, shift: int) -> None:
    """Blocks go straight from memory to the disk; an incomplete or unaligned block does not."""
    rng = np.random.default_rng(1)
    room: Any = rng.integers(0, 256, 3 * files.BLOCK + (1 << 22), dtype=np.uint8)
    begin = -room.ctypes.data % files.BLOCK + shift
    for size in (1 << 22, (1 << 22) + 1, (1 << 22) + files.BLOCK - 1):
        content = memoryview(room)[begin : begin + size]
        write_file(tmp_path / "a", content)
        assert (tmp_path / "a").read_bytes() == content
    assert files._address(memoryview(room)) == room.ctypes.data


def test_memory_of_a_file_is_used_again(tmp_path: Path) -> None:
    """Files in turn hold their own bytes only, in no more memory than the largest of them needs."""
    rng, spare = np.random.default_rng(2), list[mmap.mmap]()
    for size, length in ((9_000_000, 700_001), (0, 1), (4 << 20, 1 << 20), (5_000_000, 5_000_000)):
        content, file = rng.bytes(size), files.MemoryFile(spare)
        for begin in range(0, size, length):
            file.write(content[begin : begin + length])
        assert bytes(file) == content
        assert len(file) == size
        write_file(tmp_path / "a", *file.pieces())
        assert (tmp_path / "a").read_bytes() == content
        described = {"bytes": size, "sha256": hashlib.sha256(content).hexdigest()}
        assert files.entry(*file.pieces()) == described
        file.release()
        assert sum(map(len, spare)) == 3 * 4 << 20


def test_a_file_that_fails_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_file(tmp_path / "a.txt", b"one")

    def full_disk(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match="No space"):
        write_file(tmp_path / "a.txt", b"two")
    assert (tmp_path / "a.txt").read_bytes() == b"one"
    assert entries(tmp_path) == ["a.txt"]


@pytest.mark.parametrize("last", [1, 2, 3], ids=["file", "folder", "the one above"])
def test_what_cannot_be_flushed_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, last: int
) -> None:
    left = iter(range(last, 0, -1))

    def refuse(handle: int) -> None:
        if next(left) == 1:
            raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "fsync", refuse)
    with (
        pytest.raises(OSError, match="Input/output error") as failure,
        new_folder(tmp_path / "made", allow) as folder,
    ):
        folder.write("a", b"1")
    assert str(failure.value.filename).startswith(str(tmp_path))


def test_a_folder_that_can_only_be_written_to_takes_files_and_folders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder of mode 733 is write-only for users other than its owner."""
    opened = os.open

    def refuse(path: Path, *more: Any) -> int:
        if Path(path) == tmp_path:
            raise PermissionError(13, "Permission denied")
        return opened(path, *more)

    monkeypatch.setattr(os, "open", refuse)
    write_file(tmp_path / "file", b"whole")
    with new_folder(tmp_path / "folder", allow) as folder:
        folder.write("inner", b"whole")
    assert (tmp_path / "file").read_bytes() == b"whole"
    assert entries(tmp_path / "folder") == ["inner"]


def test_a_name_that_is_too_long_is_named_itself(tmp_path: Path) -> None:
    """That of its temporary file is longer."""
    target = tmp_path / ("x" * 250)
    with pytest.raises(OSError, match="File name too long") as of_file:
        write_file(target, b"one")
    with pytest.raises(OSError, match="File name too long") as of_folder, new_folder(target, allow):
        pass
    assert of_file.value.filename == of_folder.value.filename == str(target)


def test_what_is_no_regular_file_is_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a")
    (tmp_path / "b").symlink_to("a")
    for name in "ab":
        with pytest.raises(OSError, match=f"not a regular file.*{name}'"):
            write_file(tmp_path / name, b"one")
        assert (tmp_path / name).is_fifo()
        assert files.first_bytes(tmp_path / name, 9) == b""
    assert entries(tmp_path) == ["a", "b"]


def test_a_pipe_behind_a_link_is_not_replaced(tmp_path: Path) -> None:
    """As behind /dev/stdout; where such a link leads is not the name of a file."""
    if not Path("/proc/self/fd").exists():
        pytest.skip("the system does not show the open files of a process")
    reading, writing = os.pipe()
    (tmp_path / "link").symlink_to(f"/proc/self/fd/{writing}")
    with pytest.raises(OSError, match="not a regular file"):
        write_file(tmp_path / "link", b"one")
    os.close(reading)
    os.close(writing)
    assert entries(tmp_path) == ["link"]


@pytest.mark.parametrize("inner", ["folder", "one/folder"])
def test_a_folder_within_a_file_is_told_of(tmp_path: Path, inner: str) -> None:
    (tmp_path / "file").write_text("kept")
    target = tmp_path / "file" / inner
    with pytest.raises(OSError, match="Not a directory") as caught:  # noqa: SIM117
        with new_folder(target, lambda path: None):
            pass
    assert caught.value.filename == str(target)
    assert (tmp_path / "file").read_text() == "kept"


def test_files_and_folders_follow_the_umask(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        with new_folder(tmp_path / "run", allow) as folder:
            folder.write("a", b"")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "run").stat().st_mode) == 0o750
    assert stat.S_IMODE((tmp_path / "run" / "a").stat().st_mode) == 0o640


def test_a_folder_appears_only_when_it_is_complete(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "run"
    with new_folder(target, allow) as folder:
        folder.write("a", b"1")
        assert not target.exists()
    assert entries(target) == ["a"]
    assert entries(tmp_path / "deep") == ["run"]


@pytest.mark.parametrize("exchange", [True, False], ids=["one-step", "two-renames"])
def test_a_folder_takes_the_place_of_an_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, exchange: bool
) -> None:
    if not exchange:
        monkeypatch.setattr(files, "_exchange", lambda one, other: False)
    for name in ("old", "new"):
        with new_folder(tmp_path / "run", allow) as folder:
            folder.write(name, b"")
    assert entries(tmp_path / "run") == ["new"]
    assert entries(tmp_path) == ["run"]


@pytest.mark.parametrize("error", [OSError("disk"), KeyboardInterrupt(), SystemExit(143)])
def test_a_failure_leaves_the_old_folder_and_nothing_else(
    tmp_path: Path, error: BaseException
) -> None:
    with new_folder(tmp_path / "run", allow) as folder:
        folder.write("old", b"")
    with pytest.raises(type(error)), new_folder(tmp_path / "run", allow) as folder:
        folder.write("new", b"")
        raise error
    assert entries(tmp_path / "run") == ["old"]
    assert entries(tmp_path) == ["run"]


def test_a_signal_during_the_removal_of_the_old_folder_leaves_nothing_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with new_folder(tmp_path / "run", allow) as folder:
        for name in ("old", "older"):
            folder.write(name, b"")
    unlink = os.unlink

    def struck(*arguments: Any, **more: Any) -> None:
        unlink(*arguments, **more)
        monkeypatch.undo()
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "unlink", struck)
    with (
        pytest.raises(KeyboardInterrupt),
        new_folder(tmp_path / "run", allow) as folder,
    ):
        folder.write("new", b"")
    assert entries(tmp_path / "run") == ["new"]
    assert entries(tmp_path) == ["run"]


def test_a_folder_refused_at_the_end_is_left_as_it_is_and_the_new_one_kept(tmp_path: Path) -> None:
    def check(folder: Path) -> None:
        if folder.exists():
            raise FolderRefused(str(folder), "(move it)")

    for kept in ("run-2", "run-3"):
        with pytest.raises(FolderRefused) as refused, new_folder(tmp_path / "run", check) as folder:
            folder.write("new", b"")
            (tmp_path / "run").mkdir()
            (tmp_path / "run" / "foreign").touch()
        assert refused.value.lines == [
            str(tmp_path / "run"), "(move it)", f"the new results are kept in {tmp_path / kept}"
        ]  # fmt: skip
        assert entries(tmp_path / "run") == ["foreign"]
        assert entries(tmp_path / kept) == ["new"]
        (tmp_path / "run" / "foreign").unlink()
        (tmp_path / "run").rmdir()
    assert entries(tmp_path) == ["run-2", "run-3"]


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(errno.EXDEV, "another device")])
def test_without_an_exchange_neither_folder_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    """A signal comes when the old folder has been moved, or it is in an image's layer."""
    target, rename = tmp_path / "run", os.rename

    def moved(one: Path, other: Path) -> None:
        if one == target and isinstance(error, OSError):
            raise error
        rename(one, other)
        if one == target:
            raise error

    target.mkdir()
    (target / "old").touch()
    monkeypatch.setattr(files, "_exchange", lambda one, other: False)
    monkeypatch.setattr(os, "rename", moved)
    expected = FolderRefused if isinstance(error, OSError) else KeyboardInterrupt
    with pytest.raises(expected) as raised, new_folder(target, allow) as folder:
        folder.write("new", b"")
    assert entries(target) == ["old"]
    if isinstance(raised.value, FolderRefused):
        kept = f"the new results are kept in {tmp_path / 'run-2'}"
        assert raised.value.lines == [f"{target} cannot be replaced: another device", kept]
        assert entries(tmp_path / "run-2") == ["new"]
        (tmp_path / "run-2" / "new").unlink()
        (tmp_path / "run-2").rmdir()
    assert entries(tmp_path) == ["run"]


def test_a_file_system_without_locks_is_told_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))

    monkeypatch.setattr("fcntl.flock", refuse)
    with (
        pytest.raises(OSError, match=r"has no locks \(Function not implemented\).*run'$"),
        new_folder(tmp_path / "run", allow),
    ):
        pass
    assert entries(tmp_path) == []


def test_the_name_of_a_dangling_link_is_not_free(tmp_path: Path) -> None:
    def check(folder: Path) -> None:
        if folder.exists():
            raise FolderRefused(str(folder))

    (tmp_path / "run-2").symlink_to("nowhere")
    with pytest.raises(FolderRefused) as refused, new_folder(tmp_path / "run", check) as folder:
        folder.write("new", b"")
        (tmp_path / "run").mkdir()
    assert refused.value.lines[-1] == f"the new results are kept in {tmp_path / 'run-3'}"
    assert entries(tmp_path) == ["run", "run-2", "run-3"]
    assert entries(tmp_path / "run-3") == ["new"]


def test_a_folder_is_replaced_from_a_working_directory_that_may_not_be_entered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As after `sudo -u`; the system refuses to say what the directory `.` is."""
    stat_of = os.stat

    def refusing(path: Any, *arguments: Any, **options: Any) -> os.stat_result:
        if str(path) == ".":
            raise PermissionError(13, "Permission denied", ".")
        return stat_of(path, *arguments, **options)

    monkeypatch.setattr(os, "stat", refusing)
    for name in ("first", "second"):
        with new_folder(tmp_path / "run", allow) as folder:
            folder.write(name, b"")
        assert entries(tmp_path / "run") == [name]


@pytest.mark.parametrize("exchange", [True, False], ids=["one-step", "two-renames"])
def test_a_process_stays_in_the_folder_that_it_replaces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, exchange: bool
) -> None:
    if not exchange:
        monkeypatch.setattr(files, "_exchange", lambda one, other: False)
    (tmp_path / "run").mkdir()
    monkeypatch.chdir(tmp_path / "run")
    for name in ("first", "second"):
        with new_folder(Path(), allow) as folder:
            folder.write(name, b"")
        assert os.getcwd() == str(tmp_path / "run")
        assert entries(Path()) == [name]
    assert entries(tmp_path) == ["run"]


def test_a_link_to_a_folder_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    with new_folder(tmp_path / "link", allow) as folder:
        folder.write("a", b"")
    assert (tmp_path / "link").is_symlink()
    assert entries(tmp_path / "real") == ["a"]


@pytest.mark.parametrize("before", [None, b"old"])
def test_a_link_to_a_file_stays_a_link(tmp_path: Path, before: bytes | None) -> None:
    (tmp_path / "inner").mkdir()
    if before is not None:
        (tmp_path / "inner" / "real").write_bytes(before)
    (tmp_path / "link").symlink_to("inner/real")
    write_file(tmp_path / "link", b"new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "inner" / "real").read_bytes() == b"new"
    assert (entries(tmp_path), entries(tmp_path / "inner")) == (["inner", "link"], ["real"])


def test_two_writers_of_one_folder_do_not_disturb_each_other(tmp_path: Path) -> None:
    with new_folder(tmp_path / "run", allow) as slow:
        slow.write("slow", b"")
        with new_folder(tmp_path / "run", allow) as quick:
            quick.write("quick", b"")
        assert entries(tmp_path / "run") == ["quick"]
    assert entries(tmp_path / "run") == ["slow"]
    assert entries(tmp_path) == ["run"]


@pytest.mark.parametrize("call", ["open", "rename"])
def test_another_writer_comes_between_any_two_steps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    """It removes the unfinished folder before this is locked, or puts its own in place first."""
    real = getattr(os, call)

    def after_another(*arguments: Any) -> Any:
        monkeypatch.undo()
        with new_folder(tmp_path / "run", allow) as quick:
            quick.write("quick", b"")
        return real(*arguments)

    monkeypatch.setattr(os, call, after_another)
    with new_folder(tmp_path / "run", allow) as slow:
        slow.write("slow", b"")
    assert entries(tmp_path / "run") == ["slow"]
    assert entries(tmp_path) == ["run"]


def test_killed_at_any_moment_the_folder_is_one_of_the_complete_ones(tmp_path: Path) -> None:
    target = tmp_path / "balls[1]"
    for delay in (0.0, 0.003, 0.011, 0.02, 0.031, 0.047):
        writer = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(target)], stdout=subprocess.PIPE
        )
        assert writer.stdout is not None
        writer.stdout.readline()
        while not target.exists():
            time.sleep(0.001)
        time.sleep(delay)
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        writer.stdout.close()
        assert entries(target) == ["a", "b", "c", "d"]
        assert len({(target / name).read_bytes() for name in "abcd"}) == 1
    with new_folder(target, allow) as folder:
        folder.write("last", b"")
    assert entries(tmp_path) == ["balls[1]"], "what killed writers left is removed by the next"


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="Linux")
def test_only_the_processors_of_this_process_count() -> None:
    own = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {min(own)})
        assert files.available_cores() == 1
    finally:
        os.sched_setaffinity(0, own)
    assert files.available_cores() == len(own)
