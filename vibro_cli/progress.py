"""Progress of long computations, reported to listeners."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any


class ProgressChannel:
    """A channel for one kind of progress, from work in a thread to a listener in its context."""

    def __init__(self, name: str) -> None:
        self._listener: ContextVar[Callable[..., None] | None] = ContextVar(name, default=None)

    @contextmanager
    def to(self, listener: Callable[..., None]) -> Iterator[None]:
        """Call a listener for reports made within the block."""
        token = self._listener.set(listener)
        try:
            yield
        finally:
            self._listener.reset(token)

    def report(self, *news: Any) -> None:
        """Call the listener, if any."""
        listener = self._listener.get()
        if listener is not None:
            listener(*news)


WORK = ProgressChannel("work")
"""Name of what is drawn or measured next."""
RUN = ProgressChannel("run")
"""Progress of a run each time its logs are emptied: simulated time (s) and number of impacts."""
