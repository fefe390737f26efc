"""Files and folders that are written whole or not at all.

A file is written beside its place, flushed to the disk and renamed; a folder likewise, so that an
interruption at any moment leaves what was there before or what was to be there, never a part.
"""

import contextlib
import ctypes
import errno
import fcntl
import glob
import os
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

_AT_FDCWD = -100
_RENAME_EXCHANGE = 2
# Files from this size on (bytes) are not kept in memory once they are on the disk: many of them
# would crowd out everything else, and fresh memory for each takes longer than writing it.
_LARGE = 1 << 22
BLOCK = 4096
"""Bytes of a block: memory that begins with one can be written without a copy."""


def write_file(path: Path, content: bytes | memoryview) -> None:
    """Write a file whole: beside its place, flushed, then renamed, and the folder flushed.

    Raises `OSError` when it cannot be written; then nothing is left behind.
    """
    partial = path.with_name(f".{path.name}.partial-{secrets.token_hex(6)}")
    with _errors_name(path):
        try:
            _write_new(partial, content)
            os.replace(partial, path)
        except BaseException:
            partial.unlink(missing_ok=True)
            raise
        flush_folder(path.parent)


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
    """Wait until the entries of a folder are on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


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
        target.parent.mkdir(parents=True, exist_ok=True)
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
