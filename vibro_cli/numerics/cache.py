"""Where machine code is kept between runs, and how the processes of a user share it.

Nothing here is needed for a run to succeed: where machine code cannot be kept, or what was kept is
damaged, it is made anew and the user is told.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TextIO

_DIGEST = hashlib.sha256
_LENGTH = _DIGEST().digest_size

_tell: Callable[[str], None] | None = None
_told = False


def on_compiling(tell: Callable[[str], None] | None) -> None:
    """Choose what is called with a line for the user about machine code: made, awaited, damaged.

    ``None``, as at first, for nobody to be told.
    """
    global _tell
    _tell = tell


def tell(text: str) -> None:
    """Tell the user something about machine code, if anybody is to be told."""
    if _tell is not None:
        _tell(text)


def tell_once(text: str) -> None:
    """Tell the user what this process does about missing machine code, if it was not said yet."""
    global _told
    if not _told:
        tell(text)
    _told = True


def is_there(path: Path) -> bool:
    """Tell whether there is such a file; in a folder that may not be looked into there is none."""
    try:
        return path.exists()
    except OSError:
        return False


def cache_folder() -> Path:
    """Return the folder of the machine code.

    ``VIBRO_CACHE_DIR``, else the platform's cache folder.
    """
    named = os.environ.get("VIBRO_CACHE_DIR")
    if named:
        return Path(named)
    import platformdirs

    return Path(platformdirs.user_cache_dir("vibro"))


def code_folder(name: str) -> Path:
    """Return the folder for one collection of machine code; it need not be there yet."""
    return cache_folder() / name


@contextlib.contextmanager
def alone_with(path: Path) -> Iterator[bool]:
    """Be the only process that makes a file of machine code, waiting for another one if need be.

    Gives whether that could be had; where no lock can be made nothing can be kept either, and
    saving will tell why.
    """
    with contextlib.ExitStack() as until_then:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            _wait_for(until_then.enter_context(path.with_suffix(".lock").open("w")))
        except OSError:
            locked = False
        else:
            locked = True
        yield locked


def _wait_for(lock: TextIO) -> None:
    """Hold a lock alone until its file is closed; where files cannot be locked, go on without."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        tell_once("waiting for another process that compiles the kernels")
        fcntl.flock(lock, fcntl.LOCK_EX)


def read_checked(path: Path) -> bytes | None:
    """Return what was written to a file, None if there is none, or not as it was written.

    A damaged one (by a full disk, a broken network file system) is told about and removed: machine
    code that is not as it was made could end a run with a crash.
    """
    try:
        content = path.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        tell(f"compiled kernels cannot be read: {path} ({error.strerror}); they are made anew")
        return None
    if _DIGEST(content[:-_LENGTH]).digest() == content[-_LENGTH:]:
        return content[:-_LENGTH]
    tell(f"compiled kernels are damaged: {path}; they are made anew")
    with contextlib.suppress(OSError):
        path.unlink()
    return None


def write_checked(path: Path, content: bytes) -> None:
    """Write a file with a digest of its content at its end, whole or not at all.

    Where that is not possible it is told: nothing depends on it.
    """
    unfinished = path.with_name(f"{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished.write_bytes(content + _DIGEST(content).digest())
        unfinished.replace(path)
    except OSError as error:
        tell(f"compiled kernels cannot be kept in {path.parent} ({error.strerror})")
        with contextlib.suppress(OSError):
            unfinished.unlink()
