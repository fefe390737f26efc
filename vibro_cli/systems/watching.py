"""How far a run is, told to whoever wants to know while it goes on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

Watcher = Callable[[float, int], None]
"""Called with the simulated time (s) and the number of impacts so far."""

_watcher: ContextVar[Watcher | None] = ContextVar("watcher", default=None)


@contextmanager
def watched_by(watcher: Watcher) -> Iterator[None]:
    """Have the runs of this thread tell a watcher how far they are, each time a log is full."""
    token = _watcher.set(watcher)
    try:
        yield
    finally:
        _watcher.reset(token)


def tell(time: float, impacts: float) -> None:
    """Tell the watcher of this thread, if there is one, how far its run is."""
    watcher = _watcher.get()
    if watcher is not None:
        watcher(time, int(impacts))
