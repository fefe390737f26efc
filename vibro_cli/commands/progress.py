"""A line on the terminal that tells how far a grid is."""

import sys
import threading
import time

from vibro_cli.commands.streams import is_said
from vibro_cli.commands.words import duration

_EVERY = 0.5


class Progress:
    """Points done, impacts per second and time left; silent where nobody looks.

    Parameters
    ----------
    points
        Points there are to solve.
    """

    def __init__(self, points: int) -> None:
        self._points = points
        self._done = 0
        self._impacts = 0
        self._begin = time.monotonic()
        self._told = self._begin
        self._lock = threading.Lock()
        self._shown = sys.stderr.isatty() and is_said("info", as_text=True)

    def add(self, points: int, impacts: int) -> None:
        """Count in what was solved, in any thread; now and then the line is renewed."""
        with self._lock:
            self._done += points
            self._impacts += impacts
            now = time.monotonic()
            if self._shown and now - self._told > _EVERY:
                self._told = now
                self._write(self._line(now - self._begin))

    def end(self) -> None:
        """Remove the line."""
        if self._shown:
            self._write("")

    def _line(self, elapsed: float) -> str:
        left = elapsed * (self._points - self._done) / self._done
        share = self._done / self._points
        return (
            f"{share:6.1%}  {self._done:,} of {self._points:,} points  "
            f"{self._impacts / elapsed:,.0f} impacts/s  {duration(left)} left"
        )

    @staticmethod
    def _write(text: str) -> None:
        try:
            print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)
        except OSError:  # the terminal is gone; nobody can be told
            return
