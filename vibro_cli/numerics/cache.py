"""Where machine code is kept between runs, and how the processes of a user share it.

Nothing here is needed for a run to succeed: where machine code cannot be kept, or what was kept is
damaged, it is made anew and the user is told.
"""

from __future__ import annotations

import contextlib
import fcntl
import gc
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

_tell: Callable[[str], None] | None = None


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


class FirstCallAlone:
    """A compiled kernel whose first call, if it has to make machine code, does so alone.

    Of several processes with a cold cache one compiles and the others wait for it. Processes that
    only read need no lock: what is ready stays as it is.
    """

    def __init__(self, dispatcher: Any, folder: Path) -> None:
        name = f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__name__}"
        self._dispatcher = dispatcher
        self._ready = folder / f"{name}.ready"
        self._lock = folder / "lock"
        self._called = False

    def __call__(self, *arguments: Any) -> Any:
        """Return what the kernel returns."""
        if self._called:
            return self._dispatcher(*arguments)
        self._called = True
        if _exists(self._ready):
            return self._dispatcher(*arguments)
        with contextlib.ExitStack() as until_then:
            kept = ", and only once"
            try:
                self._lock.parent.mkdir(parents=True, exist_ok=True)
                _wait_for(until_then.enter_context(self._lock.open("w")))
            except OSError:  # then nothing can be kept either, and saving will tell why
                kept = ""
            if not _exists(self._ready):
                tell(f"compiling the kernels; this takes a minute or two{kept}")
            # The compiler makes millions of objects that live until it has done.
            collecting = gc.isenabled()
            gc.disable()
            try:
                result = self._dispatcher(*arguments)
            finally:
                if collecting:
                    gc.enable()
            if self.kept:
                with contextlib.suppress(OSError):
                    self._ready.touch()
        return result

    @property
    def kept(self) -> bool:
        """Whether the machine code is kept for the next process, once the kernel was called."""
        return bool(self._dispatcher._cache.kept)


def _exists(path: Path) -> bool:
    """Whether there is such a file; in a folder that may not be looked into there is none."""
    try:
        return path.exists()
    except OSError:
        return False


def _wait_for(lock: TextIO) -> None:
    """Hold a lock alone until its file is closed; where files cannot be locked, go on without."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        tell("waiting for another process that compiles the kernels")
        fcntl.flock(lock, fcntl.LOCK_EX)
