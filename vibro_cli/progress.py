"""Progress of long work, reported to whoever waits for it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any


class ProgressChannel:
    """One kind of progress: of what is done in a thread, for a listener of the same thread."""

    def __init__(self, name: str) -> None:
        self._listener: ContextVar[Callable[..., None] | None] = ContextVar(name, default=None)

    @contextmanager
    def to(self, listener: Callable[..., None]) -> Iterator[None]:
        """Have a listener called in the block."""
        token = self._listener.set(listener)
        try:
            yield
        finally:
            self._listener.reset(token)

    def report(self, *news: Any) -> None:
        """Call the listener, if there is one."""
        listener = self._listener.get()
        if listener is not None:
            listener(*news)


WORK = ProgressChannel("work")
"""What is drawn or measured next, in words."""
RUN = ProgressChannel("run")
"""How far a run is, each time a log is full: simulated time (s) and the number of impacts."""
