"""Files and folders that are written atomically, and their manifests.

A file or folder is written beside its target, flushed to the disk and renamed. An interruption at
any moment therefore leaves either the old or the new content, never a part.

A manifest names the kind of the folder, the program and libraries that made it, and every file with
its size and SHA-256. It contains nothing about the host or the time, so that equal input gives an
equal manifest.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import fcntl
import glob
import hashlib
import io
import itertools
import json
import mmap
import os
import platform
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, BinaryIO

from vibro_cli import __version__
from vibro_cli.errors import VibroError, listing

_AT_FDCWD = -100
_RENAME_EXCHANGE = 2
# Files of at least this size (bytes) are dropped from the page cache once written: many of them
# would crowd out everything else, and fresh pages for each take longer than writing it.
_LARGE = 1 << 22
BLOCK = 4096
"""Size of a block (bytes); memory aligned to blocks can be written without a copy."""
placed = 0
"""Number of files and folders put in their places; after 0 there is nothing to keep.

Each is counted before it is renamed: a signal during a slow renaming is raised when that is done.
"""


def write_file(path: Path, *pieces: bytes | memoryview) -> None:
    """Write a file as :func:`replace_file` does, and remove what killed processes left of it."""
    check_regular(path)
    with _errors_name(path):
        _remove_abandoned(Path(os.path.realpath(path)))
    replace_file(path, *pieces)


def replace_file(path: Path, *pieces: bytes | memoryview) -> None:
    """Write a file atomically: write it beside its target, flush it, rename it, flush the folder.

    Its content may be given in several pieces. A link stays: the file that it names is written.

    Raises `OSError` if it cannot be written, or if the target is not a regular file, such as a
    device, which renaming would remove. Nothing is left behind then. A killed process leaves its
    temporary file (see :func:`write_file` and :func:`remove_partial_files`).
    """
    shown, path = path, Path(os.path.realpath(path))
    check_regular(shown)
    with _errors_name(shown):
        with _partial(path, shown, _new_file) as (partial, handle):
            with open(os.dup(handle), "wb") as file:
                _fill(file, *pieces)
            _count_one()
            os.replace(partial, path)
        flush_folder(path.parent)


def check_regular(path: Path) -> None:
    """Raise `OSError` if the target of :func:`replace_file` exists and is not a regular file."""
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "not a regular file; it is left as it is", str(path))


def _count_one() -> None:
    global placed
    placed += 1


def first_bytes(path: Path, number: int) -> bytes:
    """Return up to `number` bytes of the beginning of a file, none if it is not a regular file.

    Raises `OSError` if it cannot be read.
    """
    if not path.is_file():
        return b""
    with open(path, "rb") as file:
        return file.read(number)


@contextlib.contextmanager
def _errors_name(path: Path) -> Iterator[None]:
    """Make errors of the system name the target file instead of its temporary file or none."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def remove_partial_files(folder: Path) -> None:
    """Remove temporary files of killed processes; no process may be writing to the folder."""
    for partial in folder.glob(".*.partial-*"):
        if partial.is_file():
            partial.unlink(missing_ok=True)


def _fill(file: BinaryIO, *pieces: bytes | memoryview) -> None:
    """Write a new file and flush it to the disk."""
    is_large = sum(map(len, pieces)) >= _LARGE
    for piece in pieces:
        written = _write_directly(file.fileno(), piece) if is_large else 0
        file.write(piece[written:])
        file.flush()
    os.fsync(file.fileno())
    if is_large and hasattr(os, "posix_fadvise"):
        os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def _write_directly(handle: int, content: bytes | memoryview) -> int:
    """Write the complete blocks of a file by direct I/O, without a copy by the system.

    Returns the number of bytes written: 0 if the file system does not support this, or the memory
    is not aligned to blocks.
    """
    direct = getattr(os, "O_DIRECT", 0)
    if not direct or isinstance(content, bytes) or content.readonly or _address(content) % BLOCK:
        return 0
    flags = fcntl.fcntl(handle, fcntl.F_GETFL)
    blocks, written = len(content) // BLOCK * BLOCK, 0
    try:
        fcntl.fcntl(handle, fcntl.F_SETFL, flags | direct)
        while written < blocks and written % BLOCK == 0:
            written += os.write(handle, content[written:blocks])
    except OSError as error:
        if error.errno != errno.EINVAL:  # the file system has no direct I/O
            raise
    finally:
        fcntl.fcntl(handle, fcntl.F_SETFL, flags)
    return written


def _address(content: memoryview) -> int:
    return ctypes.addressof(ctypes.c_char.from_buffer(content))


class MemoryFile(io.RawIOBase):
    """A growing file in memory, in blocks that later files use again.

    Fresh memory takes the system longer than what is written to it. `spare` holds the blocks that
    no file uses; any thread may take one.
    """

    def __init__(self, spare: list[mmap.mmap]) -> None:
        self._spare = spare
        self._blocks: list[mmap.mmap] = []

    def writable(self) -> bool:
        """Return true."""
        return True

    def write(self, content: Any) -> int:
        """Append bytes; return their number."""
        left = memoryview(content)
        while left:
            if self.tell() % _LARGE == 0:
                self._blocks.append(self._empty_block())
            block = self._blocks[-1]
            left = left[block.write(left[: _LARGE - block.tell()]) :]
        return len(content)

    def _empty_block(self) -> mmap.mmap:
        try:
            block = self._spare.pop()
        except IndexError:
            return mmap.mmap(-1, _LARGE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        block.seek(0)
        return block

    def tell(self) -> int:
        """Return the number of bytes written."""
        return sum(block.tell() for block in self._blocks)

    __len__ = tell

    def pieces(self) -> list[memoryview]:
        """Return the content, block by block."""
        return [memoryview(block)[: block.tell()] for block in self._blocks]

    def __bytes__(self) -> bytes:
        return b"".join(self.pieces())

    def release(self) -> None:
        """Give the blocks back: nobody may look at the content any more."""
        self._spare += self._blocks
        self._blocks = []


def flush_folder(path: Path) -> None:
    """Flush the entries of a folder to the disk, if it can be read."""
    with _errors_name(path):
        try:
            handle = os.open(path, os.O_RDONLY)
        except PermissionError:  # a write-only folder; its files are written by now
            return
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def make_folder(path: Path) -> None:
    """Create a folder, where a link leads, and its parents unless they exist; raises `OSError`."""
    with _errors_name(path):
        try:
            os.makedirs(os.path.realpath(path), exist_ok=True)
        except FileExistsError as error:  # a file is in the way; the error would be misleading
            raise OSError(errno.ENOTDIR, os.strerror(errno.ENOTDIR)) from error


class NewFolder:
    """An unfinished folder, whose files become visible together when it is put in place."""

    def __init__(self, path: Path, target: Path) -> None:
        self.path = path
        self.target = target

    def write(self, name: str, content: bytes | memoryview) -> None:
        """Add a file; raises `OSError` if it cannot be written or exists already."""
        with _errors_name(self.target / name), open(self.path / name, "xb") as file:
            _fill(file, content)

    @contextlib.contextmanager
    def growing(self, name: str) -> Iterator[BinaryIO]:
        """Add a file that the block fills incrementally; raises `OSError` as :meth:`write`."""
        with open(self.path / name, "xb", buffering=0) as file:
            yield file
            with self.naming(name):
                os.fsync(file.fileno())

    def naming(self, name: str) -> contextlib.AbstractContextManager[None]:
        """Make errors of the system in the block name a file of this folder."""
        return _errors_name(self.target / name)


@contextlib.contextmanager
def new_folder(
    target: Path, check: Callable[[Path], None], first: Mapping[str, bytes] | None = None
) -> Iterator[NewFolder]:
    """Create a folder atomically: the block fills it, then it replaces `target`.

    `check(target)` raises if an existing `target` must not be replaced; it is called again at the
    end. If it raises `FolderRefused` then, or `target` cannot be moved, the finished folder is kept
    under another name, which the error tells. If the block or the replacement fails, `target` is
    unchanged and nothing is left behind. A process whose working directory is `target` is in the
    new folder then. A killed process leaves its unfinished folder (see :func:`abandoned_parts`),
    which the next call removes after writing the files of `first`, names and contents.
    """
    shown, target = target, Path(os.path.realpath(target))
    check(target)
    with _errors_name(shown):
        make_folder(target.parent)
    with _partial(target, shown, _new_directory) as (partial, _):
        made = NewFolder(partial, shown)
        for name, content in (first or {}).items():
            made.write(name, content)
        _remove_abandoned(target)
        yield made
        with _errors_name(shown):
            flush_folder(partial)
        try:
            check(target)
            with _errors_name(shown):
                _count_one()
                _put_in_place(partial, target)
        except FolderRefused as error:  # filled in the meantime, or it cannot be moved
            kept = _free_name(target)
            os.rename(partial, kept)
            raise FolderRefused(*error.lines, f"the new results are kept in {kept}") from error
    flush_folder(target.parent)


def write_folder(
    kind: str, target: Path, files: Mapping[str, bytes], details: Mapping[str, Any]
) -> None:
    """Write a folder of results of a kind with its manifest atomically.

    Raises `FolderRefused` if `target` exists and is not such a folder of vibro, `OSError` if it
    cannot be written.
    """
    with new_folder(target, lambda there: check_replaceable(there, kind)) as folder:
        for name, content in files.items():
            folder.write(name, content)
        entries = {name: entry(content) for name, content in files.items()}
        folder.write(MANIFEST_NAME, json_bytes(manifest_of(kind, entries, details)))


@contextlib.contextmanager
def _partial(
    target: Path, shown: Path, locked: Callable[[Path], int]
) -> Iterator[tuple[Path, int]]:
    """Create a file or folder beside `target`, with a locked handle; remove what is left of it."""
    while True:
        partial = target.with_name(f".{target.name}.partial-{secrets.token_hex(6)}")
        handle = None
        try:
            with _errors_name(shown):
                handle = locked(partial)
            if partial.exists():  # not removed by another process before the lock
                yield partial, handle
                return
        finally:
            try:
                _remove(partial)
            finally:  # again, as a signal may have ended it
                _remove(partial)
                if handle is not None:
                    os.close(handle)


def _new_file(path: Path) -> int:
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    with contextlib.suppress(OSError):  # where the file system has no locks, none is abandoned
        fcntl.flock(handle, fcntl.LOCK_EX)
    return handle


def _new_directory(path: Path) -> int:
    while True:
        path.mkdir()
        with contextlib.suppress(FileNotFoundError):  # removed by another process before the lock
            handle = os.open(path, os.O_RDONLY)
            break
    try:
        lock(handle, fcntl.LOCK_EX)
    except BaseException:
        os.close(handle)
        raise
    return handle


def _remove(partial: Path) -> None:
    """Remove an unfinished file or folder, if it is there and can be removed."""
    if os.path.isdir(partial):
        shutil.rmtree(partial, ignore_errors=True)
    with contextlib.suppress(OSError):
        partial.unlink()


def lock(handle: int, operation: int) -> None:
    """Lock an open file or folder; raises `OSError`, also where the file system has no locks."""
    try:
        fcntl.flock(handle, operation)
    except OSError as error:
        if error.errno not in (errno.ENOSYS, errno.ENOTSUP, errno.ENOLCK):
            raise
        why = f"the file system has no locks ({error.strerror}); expected a folder on another one"
        raise OSError(error.errno, why) from error


def abandoned_parts(target: Path) -> list[Path]:
    """Return what killed processes left unfinished of `target`, the latest last."""
    found = [(changed, part) for part, changed in _abandoned(Path(os.path.realpath(target)))]
    return [part for _, part in sorted(found)]


def _remove_abandoned(target: Path) -> None:
    for partial, _ in _abandoned(target):
        _remove(partial)


def _abandoned(target: Path) -> Iterator[tuple[Path, int]]:
    """Yield unlocked partial files and folders of `target`, and when they last changed (ns).

    Each is locked until the next one is requested.
    """
    for partial in target.parent.glob(f".{glob.escape(target.name)}.partial-{'[0-9a-f]' * 12}"):
        with contextlib.suppress(OSError):
            handle = os.open(partial, os.O_RDONLY)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                yield partial, os.fstat(handle).st_mtime_ns
            finally:
                os.close(handle)


def _put_in_place(partial: Path, target: Path) -> None:
    """Rename a finished folder to `target`; an old folder there is moved to `partial`.

    Raises `FolderRefused` if the old folder cannot be moved.
    """
    if not target.exists():
        try:
            os.rename(partial, target)
            return
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):  # put there in the meantime
                raise
    try:
        is_working_directory = target.samefile(".")
    except PermissionError:  # it may not be entered, as after a change of the user
        is_working_directory = False
    if not _exchange(partial, target):
        _exchange_by_turns(partial, target)
    if is_working_directory:  # the process would be left in the old folder, which is removed
        os.chdir(target)


def _exchange_by_turns(partial: Path, target: Path) -> None:
    """Exchange two folders; after a signal or an error `target` is one of them."""
    aside = target.with_name(f".{target.name}.partial-{secrets.token_hex(6)}")
    try:
        try:
            os.rename(target, aside)
        except OSError as error:  # in a layer of a container's image, or mounted there
            raise FolderRefused(f"{target} cannot be replaced: {error.strerror}") from error
        os.rename(partial, target)
    finally:
        if aside.exists():
            os.rename(aside, partial if target.exists() else target)


def _free_name(target: Path) -> Path:
    """Return the first path beside `target` that does not exist: `run-2`, `run-3`, …"""
    paths = (target.with_name(f"{target.name}-{number}") for number in itertools.count(2))
    return next(path for path in paths if not os.path.lexists(path))


def _exchange(one: Path, other: Path) -> bool:
    """Exchange two folders atomically; return False if the system cannot (Linux: renameat2)."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        return False
    arguments = (_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(other), _RENAME_EXCHANGE)
    return bool(rename(*arguments) == 0)


MANIFEST_NAME = "manifest.json"
GRID_NAME = "grid.json"
LACKING = {"undrawn", "unsampled_from"}
"""Entries of a run's manifest for what a signal left out of it."""
_MANIFEST_VERSION = "1"
_OWN = "sha256"
"""Last entry of a manifest: the checksum of the manifest without it."""
_LIBRARIES = ("matplotlib", "numpy", "pyarrow", "scipy")


class FolderRefused(VibroError):
    """An existing folder must not be replaced; the message says which and why."""


def json_bytes(values: Any) -> bytes:
    """Return plain values as an indented JSON file; numbers read back to the same doubles.

    Raises `ValueError` for numbers that are not finite.
    """
    return (json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()


def entry(*pieces: bytes | memoryview) -> dict[str, Any]:
    """Return the entry in a manifest of a file, given in one or more pieces."""
    found = hashlib.sha256()
    for piece in pieces:
        found.update(piece)
    return {"bytes": sum(map(len, pieces)), "sha256": found.hexdigest()}


def manifest_of(
    kind: str, entries: Mapping[str, Mapping[str, Any]], details: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the manifest of a folder of results, which ends with its own checksum.

    `kind` is the content of the folder ("run"), `entries` are those of its files by name, and
    `details` is further information on its origin.
    """
    values = {
        "schema": f"vibro-{kind}/{_MANIFEST_VERSION}",
        "program": {"name": "vibro", "version": __version__},
        "environment": {
            "python": platform.python_version(),
            **{name: _version(name) for name in _LIBRARIES},
        },
        **details,
        "files": dict(sorted(entries.items())),
    }
    return {**values, _OWN: entry(json_bytes(values))["sha256"]}


def is_changed(manifest: Mapping[str, Any]) -> bool:
    """Return whether a manifest differs from its own checksum; earlier versions had none."""
    *names, last = manifest
    values = {name: manifest[name] for name in names}
    return last != "files" and manifest.get(_OWN) != entry(json_bytes(values))["sha256"]


def _version(library: str) -> str:
    """Return the version of an installed library without parsing all its metadata."""
    described = metadata.distribution(library).read_text("METADATA") or ""
    return described.partition("\nVersion: ")[2].partition("\n")[0]


def json_of(path: Path) -> Any:
    """Return the content of a JSON file, or None if it cannot be read."""
    try:
        return json.loads(path.read_bytes(), parse_constant=int)  # which refuses NaN
    except (OSError, ValueError, RecursionError):
        return None


def read_manifest(folder: Path) -> dict[str, Any] | None:
    """Return the manifest of a folder, or None if there is none or it is not valid."""
    found = json_of(folder / MANIFEST_NAME)
    match found:
        case {"schema": str(), "program": {"name": str(), "version": str()}, "files": dict(files)}:
            lists = [found.get("undrawn", []), found.get("chunks", [])]
            numbers = [found.get(name, 0) for name in ("points", "wanted")]
            whole = (
                found["schema"].startswith("vibro-")
                and all(map(_is_entry, files.values()))
                and all(isinstance(one, list) for one in lists)
                and all(isinstance(one, int) for one in numbers)
                and isinstance(found.get("unsampled_from", 0.0), int | float)
                and isinstance(found.get("environment", {}), dict)
            )
            return found if whole else None
    return None


def results_within(folder: Path) -> str:
    """Return the end of a message on a folder without results: the folders in it with results."""
    found = [str(path) for path in sorted(folder.glob("*")) if read_manifest(path)]
    shown = found if len(found) <= 3 else [*found[:2], f"{len(found) - 2} more"]
    return f" (results are in {listing(shown, 'and')})" if found else ""


def _is_entry(described: Any) -> bool:
    """Return whether a value has the form of :func:`entry`."""
    match described:
        case {"bytes": int(), "sha256": str()}:
            return True
    return False


def differences(before: Any, now: Any, path: str = "") -> list[str]:
    """Return the differences of two pieces of plain data, one line each: `path: before -> now`."""
    if isinstance(before, dict) and isinstance(now, dict):
        keys = [*before, *(key for key in now if key not in before)]
        parts = [(before.get(k), now.get(k), f"{path}.{k}" if path else str(k)) for k in keys]
    elif isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        parts = [
            (a, b, f"{path}[{n}]") for n, (a, b) in enumerate(zip(before, now, strict=True), 1)
        ]
    else:
        place = f"{path}: " if path else ""
        return [] if before == now else [f"{place}{_short(before)} -> {_short(now)}"]
    return [line for part in parts for line in differences(*part)]


def refusal(holds: str, found: Sequence[str], hint: str) -> list[str]:
    """Return the message about a folder with other content: `differences`, and a `hint`."""
    return [f"{holds} (found -> requested):", *(f"  {line}" for line in found), f"({hint})"]


def _short(value: Any) -> str:
    text = "nothing" if value is None else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else f"{text[:57]}..."


_OF_THE_SYSTEM = (".DS_Store", ".nfs")
"""Beginnings of the names of files that no user misses: of macOS, and of NFS."""


def check_replaceable(folder: Path, kind: str) -> None:
    """Raise `FolderRefused` unless `folder` does not exist, is empty, or is vibro's of this kind.

    A folder of vibro is refused too if it has other files in it, which would be lost, or is
    protected from writing.
    """
    if not folder.exists():
        return
    if not folder.is_dir():
        raise FolderRefused(f"{folder} is a file; expected a folder name")
    if os.path.ismount(folder):
        raise FolderRefused(
            f"{folder} is a mount point, which cannot be replaced; expected a folder within it"
        )
    names = {one.name for one in folder.iterdir() if not one.name.startswith(_OF_THE_SYSTEM)}
    if not names:
        return
    found = read_manifest(folder)
    if found is None or not found["schema"].startswith(f"vibro-{kind}/"):
        raise FolderRefused(
            f"{folder} exists and is not a vibro {kind} folder; it is left as it is "
            "(choose another folder)"
        )
    foreign = sorted(names - set(found["files"]) - {MANIFEST_NAME})
    if foreign:
        raise FolderRefused(
            f"{folder} holds {foreign[0]}, which vibro did not write; it is left as it is "
            "(move that file, or choose another folder)"
        )
    if not os.access(folder, os.W_OK | os.X_OK):  # its files could not be removed
        raise FolderRefused(
            f"{folder} is read-only; it is left as it is (allow writing, or choose another folder)"
        )


@dataclass(frozen=True)
class Finding:
    """A file that is missing, changed or unknown."""

    file: str
    state: str
    """missing, damaged or unknown."""
    detail: str

    def __str__(self) -> str:
        if self.state == "missing":
            return f"{self.file} is missing"
        return f"{self.file} has changed since it was written ({self.detail})"


def check_files(folder: Path, described: Mapping[str, Mapping[str, Any]]) -> Iterator[Finding]:
    """Yield all files that are missing or have changed.

    `described` has the entries of the manifest, with `bytes` and `sha256`. Raises `OSError` if a
    file cannot be read.
    """
    for name, wanted in described.items():
        try:
            size = (folder / name).stat().st_size
        except (FileNotFoundError, NotADirectoryError):
            yield Finding(name, "missing", "no such file")
            continue
        if size != wanted["bytes"]:
            yield Finding(name, "damaged", f"{size} bytes, expected {wanted['bytes']}")
            continue
        with open(folder / name, "rb") as file:
            found = hashlib.file_digest(file, "sha256").hexdigest()
        if found != wanted["sha256"]:
            detail = f"SHA-256 {found[:12]}…, expected {wanted['sha256'][:12]}…"
            yield Finding(name, "damaged", detail)


def available_cores() -> int:
    """Return the number of processors available to this process."""
    if hasattr(os, "sched_getaffinity"):  # Linux
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
