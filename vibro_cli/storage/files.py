"""Files and folders that are written whole or not at all, and the manifests that tell of them.

A file is written beside its place, flushed to the disk and renamed; a folder likewise, so that an
interruption at any moment leaves what was there before or what was to be there, never a part.

A manifest names the kind of the folder, the program and the libraries it was made with, and every
file with its size and SHA-256. Nothing of the host or of the time stands in it, so that equal
input gives an equal manifest.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import fcntl
import glob
import hashlib
import json
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
from vibro_cli.errors import VibroError

_AT_FDCWD = -100
_RENAME_EXCHANGE = 2
# Files from this size on (bytes) are not kept in memory once they are on the disk: many of them
# would crowd out everything else, and fresh memory for each takes longer than writing it.
_LARGE = 1 << 22
BLOCK = 4096
"""Bytes of a block: memory that begins with one can be written without a copy."""


def write_file(path: Path, content: bytes | memoryview) -> None:
    """Write a file whole: beside its place, flushed, then renamed, and the folder flushed.

    Raises `OSError` when it cannot be written, or when what is there is no regular file, as a
    device, which the renaming would remove; then nothing is left behind.
    """
    partial = path.with_name(f".{path.name}.partial-{secrets.token_hex(6)}")
    with _errors_name(path):
        if path.exists() and not path.is_file():
            raise OSError(errno.EINVAL, "no regular file; it is left as it is")
        try:
            _write_new(partial, content)
            os.replace(partial, path)
        except BaseException:
            partial.unlink(missing_ok=True)
            raise
        flush_folder(path.parent)


def first_bytes(path: Path, number: int) -> bytes:
    """Return up to `number` bytes of the beginning of a file; none of what is no regular file.

    Raises `OSError` when it cannot be read.
    """
    if not path.is_file():
        return b""
    with open(path, "rb") as file:
        return file.read(number)


@contextlib.contextmanager
def _errors_name(path: Path) -> Iterator[None]:
    """Have errors of the system name the file that was to be written, not a part of it, or none."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def remove_partial_files(folder: Path) -> None:
    """Remove what killed processes left of files in the making; nobody may be writing there."""
    for partial in folder.glob(".*.partial-*"):
        if partial.is_file():
            partial.unlink(missing_ok=True)


def _write_new(path: Path, content: bytes | memoryview) -> None:
    """Write a file that must not exist yet, and wait until it is on the disk."""
    with open(path, "xb") as file:
        written = _write_directly(file.fileno(), content) if len(content) >= _LARGE else 0
        file.write(content[written:])
        file.flush()
        os.fsync(file.fileno())
        if len(content) >= _LARGE and hasattr(os, "posix_fadvise"):
            os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def _write_directly(handle: int, content: bytes | memoryview) -> int:
    """Write the whole blocks of a file from memory to the disk without a copy by the system.

    Returns how many bytes are written: 0 where the file system cannot, or the memory does not
    begin with a block.
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
        if error.errno != errno.EINVAL:  # which says that this file system has no such way
            raise
    finally:
        fcntl.fcntl(handle, fcntl.F_SETFL, flags)
    return written


def _address(content: memoryview) -> int:
    return ctypes.addressof(ctypes.c_char.from_buffer(content))


def flush_folder(path: Path) -> None:
    """Wait until the entries of a folder are on the disk, if it can be read."""
    with _errors_name(path):
        try:
            handle = os.open(path, os.O_RDONLY)
        except PermissionError:  # a folder that is only written to, where all is written by now
            return
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def make_folder(path: Path) -> None:
    """Make a folder, and those above it, where there is none; raises `OSError` if it cannot be."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:  # said of a file, as if what is to be written were there
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(path)) from error


class NewFolder:
    """A folder in the making; its files come into view together, when it is put in place."""

    def __init__(self, path: Path, target: Path) -> None:
        self.path = path
        self.target = target

    def write(self, name: str, content: bytes | memoryview) -> None:
        """Add a file; raises `OSError` when it cannot be written or is there already."""
        with _errors_name(self.target / name):
            _write_new(self.path / name, content)

    @contextlib.contextmanager
    def growing(self, name: str) -> Iterator[BinaryIO]:
        """Add a file that the block fills little by little; raises `OSError` as :meth:`write`."""
        with open(self.path / name, "xb", buffering=0) as file:
            yield file
            with self.naming(name):
                os.fsync(file.fileno())

    def naming(self, name: str) -> contextlib.AbstractContextManager[None]:
        """Have errors of the system in the block name a file of this folder."""
        return _errors_name(self.target / name)


@contextlib.contextmanager
def new_folder(
    target: Path, check: Callable[[Path], None], first: Mapping[str, bytes] | None = None
) -> Iterator[NewFolder]:
    """Make a folder whole: the block fills it, then it takes the place of `target`.

    `check(target)` raises when an existing `target` must not be replaced; it is asked again at the
    end. When the block or the replacement fails, `target` is as it was and nothing is left behind.
    A killed process leaves the part that it has made, until the next one here has its files of
    `first`, names and contents (see :func:`abandoned_parts`).
    """
    shown, target = target, Path(os.path.realpath(target))
    check(target)
    with _errors_name(shown):
        make_folder(target.parent)
        partial, handle = _open_partial(target)
    try:
        made = NewFolder(partial, shown)
        for name, content in (first or {}).items():
            made.write(name, content)
        for part, _ in _abandoned(target):
            shutil.rmtree(part, ignore_errors=True)
        yield made
        with _errors_name(shown):
            flush_folder(partial)
        check(target)
        with _errors_name(shown):
            _put_in_place(partial, target)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
        os.close(handle)
    flush_folder(target.parent)


def write_folder(
    kind: str, target: Path, files: Mapping[str, bytes], details: Mapping[str, Any]
) -> None:
    """Write a folder of results of a kind with its manifest, whole or not at all.

    Raises `FolderRefused` when `target` is there and is none of ours, `OSError` when it cannot be
    written.
    """
    with new_folder(target, lambda there: check_replaceable(there, kind)) as folder:
        for name, content in files.items():
            folder.write(name, content)
        entries = {name: entry(content) for name, content in files.items()}
        folder.write(MANIFEST_NAME, json_bytes(manifest_of(kind, entries, details)))


def _open_partial(target: Path) -> tuple[Path, int]:
    """A new folder beside `target`, and a handle that holds a lock on it while we live."""
    while True:
        partial = target.with_name(f".{target.name}.partial-{secrets.token_hex(6)}")
        partial.mkdir()
        handle = os.open(partial, os.O_RDONLY)
        fcntl.flock(handle, fcntl.LOCK_EX)
        if partial.exists():  # else another process took it for abandoned before the lock
            return partial, handle
        os.close(handle)


def abandoned_parts(target: Path) -> list[Path]:
    """What killed processes left beside `target` of folders in the making, the latest one last."""
    found = [(changed, part) for part, changed in _abandoned(Path(os.path.realpath(target)))]
    return [part for _, part in sorted(found)]


def _abandoned(target: Path) -> Iterator[tuple[Path, int]]:
    """Partial folders beside `target` that nobody locks, and when they changed (ns).

    The lock is held until the next one is asked for.
    """
    for partial in target.parent.glob(f".{glob.escape(target.name)}.partial-{'[0-9a-f]' * 12}"):
        with contextlib.suppress(OSError):
            handle = os.open(partial, os.O_RDONLY | os.O_DIRECTORY)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                yield partial, os.fstat(handle).st_mtime_ns
            finally:
                os.close(handle)


def _put_in_place(partial: Path, target: Path) -> None:
    """Rename a finished folder to `target`; what was there is afterwards at `partial`."""
    if not target.exists():
        os.rename(partial, target)
    elif not _exchange(partial, target):
        aside = target.with_name(f".{target.name}.partial-{secrets.token_hex(6)}")
        os.rename(target, aside)
        os.rename(partial, target)
        os.rename(aside, partial)


def _exchange(one: Path, other: Path) -> bool:
    """Exchange two folders in one step; false where the system cannot (Linux: renameat2)."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        return False
    arguments = (_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(other), _RENAME_EXCHANGE)
    return bool(rename(*arguments) == 0)


MANIFEST_NAME = "manifest.json"
GRID_NAME = "grid.json"
_MANIFEST_VERSION = "1"
_LIBRARIES = ("matplotlib", "numpy", "pyarrow", "scipy")


class FolderRefused(VibroError):
    """An existing folder must not be replaced; the message says which and why."""


def json_bytes(values: Any) -> bytes:
    """Plain values as an indented JSON file; numbers read back to the same doubles.

    Raises `ValueError` for numbers that are not finite.
    """
    return (json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()


def entry(content: bytes | memoryview) -> dict[str, Any]:
    """What a manifest says of a file."""
    return {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}


def manifest_of(
    kind: str, entries: Mapping[str, Mapping[str, Any]], details: Mapping[str, Any]
) -> dict[str, Any]:
    """The manifest of a folder of results.

    `kind` is what the folder holds ("run"), `entries` are those of its files by their names,
    `details` what else belongs to the folder's origin.
    """
    return {
        "schema": f"vibro-{kind}/{_MANIFEST_VERSION}",
        "program": {"name": "vibro", "version": __version__},
        "environment": {
            "python": platform.python_version(),
            **{name: _version(name) for name in _LIBRARIES},
        },
        **details,
        "files": dict(sorted(entries.items())),
    }


def _version(library: str) -> str:
    """The version of an installed library, without reading the whole of its description."""
    described = metadata.distribution(library).read_text("METADATA") or ""
    return described.partition("\nVersion: ")[2].partition("\n")[0]


def json_of(path: Path) -> Any:
    """What a JSON file says, None where it cannot be read."""
    try:
        return json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None


def read_manifest(folder: Path) -> dict[str, Any] | None:
    """The manifest of a folder, or None where there is none of ours, or one in another form."""
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
                and isinstance(found.get("environment", {}), dict)
            )
            return found if whole else None
    return None


def _is_entry(described: Any) -> bool:
    """Whether it says of a file what :func:`entry` does."""
    match described:
        case {"bytes": int(), "sha256": str()}:
            return True
    return False


def differences(before: Any, now: Any, path: str = "") -> list[str]:
    """Where two pieces of plain data differ, a line each: `path: before -> now`."""
    if isinstance(before, dict) and isinstance(now, dict):
        keys = [*before, *(key for key in now if key not in before)]
        parts = [(before.get(k), now.get(k), f"{path}.{k}" if path else str(k)) for k in keys]
    elif isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        parts = [
            (a, b, f"{path}[{n}]") for n, (a, b) in enumerate(zip(before, now, strict=True), 1)
        ]
    else:
        return [] if before == now else [f"{path}: {_short(before)} -> {_short(now)}"]
    return [line for part in parts for line in differences(*part)]


def refusal(holds: str, found: Sequence[str], hint: str) -> list[str]:
    """What is said of a folder that holds something else, with the `differences` that were found.

    The `hint` says how to go on.
    """
    return [f"{holds}; found there and wanted now:", *(f"  {line}" for line in found), f"({hint})"]


def _short(value: Any) -> str:
    text = "nothing" if value is None else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else f"{text[:57]}..."


def check_replaceable(folder: Path, kind: str) -> None:
    """Raise `FolderRefused` unless `folder` is free, empty, or a folder of this kind of ours.

    A folder of ours into which somebody has put other files is refused too: they would be lost.
    """
    if not folder.exists():
        return
    if not folder.is_dir():
        raise FolderRefused(f"{folder} is a file; expected a folder or nothing")
    names = {entry.name for entry in folder.iterdir() if not entry.name.startswith(".")}
    if not names:
        return
    found = read_manifest(folder)
    if found is None or not found["schema"].startswith(f"vibro-{kind}/"):
        raise FolderRefused(
            f"{folder} exists and is no vibro {kind}; it is left as it is (choose another folder)"
        )
    foreign = sorted(names - set(found["files"]) - {MANIFEST_NAME})
    if foreign:
        raise FolderRefused(
            f"{folder} holds {foreign[0]}, which vibro did not write; it is left as it is "
            "(move that file, or choose another folder)"
        )


@dataclass(frozen=True)
class Finding:
    """One file that is not as it was written."""

    file: str
    state: str
    """missing, damaged or unknown."""
    detail: str

    def __str__(self) -> str:
        what = "missing" if self.state == "missing" else f"not as it was written ({self.detail})"
        return f"{self.file} is {what}"


def check_files(folder: Path, described: Mapping[str, Mapping[str, Any]]) -> Iterator[Finding]:
    """Every file that is missing or not as it was written.

    `described` has what the manifest says of each: its `bytes` and its `sha256`. Raises `OSError`
    when a file cannot be read.
    """
    for name, wanted in described.items():
        try:
            size = (folder / name).stat().st_size
        except FileNotFoundError:
            yield Finding(name, "missing", "not there")
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
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):  # Linux
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
