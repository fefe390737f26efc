"""A line on the terminal that tells how far a run or a grid is; silent where nobody looks."""

import sys
import threading
import time

from vibro_cli.commands.streams import is_said, printable
from vibro_cli.commands.words import COLUMNS, duration

_EVERY = 0.5


class _Line:
    """A line that is renewed now and then while something goes on, and removed at its end."""

    def __init__(self) -> None:
        self._begin = time.monotonic()
        self._told = self._begin
        self._shown = sys.stderr.isatty() and is_said("info", as_text=True)
        self._drawn = False

    def end(self) -> None:
        """Remove the line, if there was time for one."""
        if self._drawn:
            self._write("")

    def _due(self) -> float | None:
        """The time since the beginning (s) if the line is to be renewed, else None."""
        now = time.monotonic()
        if not self._shown or now - self._told <= _EVERY:
            return None
        self._told = now
        return now - self._begin

    def _write(self, text: str) -> None:
        self._drawn = True
        try:
            print(f"\r\033[K{text[:COLUMNS]}", end="", file=sys.stderr, flush=True)
        except OSError:  # the terminal is gone; nobody can be told
            return


class Progress(_Line):
    """Points of a grid that are done, impacts per second and time left.

    Parameters
    ----------
    points
        Points there are to solve.
    """

    def __init__(self, points: int) -> None:
        super().__init__()
        self._points = points
        self._done = 0
        self._impacts = 0
        self._lock = threading.Lock()

    def add(self, points: int, impacts: int) -> None:
        """Count in what was solved, in any thread; now and then the line is renewed."""
        with self._lock:
            self._done += points
            self._impacts += impacts
            elapsed = self._due()
            if elapsed is not None:
                self._write(self._line(elapsed))

    def _line(self, elapsed: float) -> str:
        left = elapsed * (self._points - self._done) / self._done
        share = self._done / self._points
        return (
            f"{share:6.1%}  {self._done:,} of {self._points:,} points  "
            f"{self._impacts / elapsed:,.0f} impacts/s  {duration(left)} left"
        )


class RunProgress(_Line):
    """Simulated time of a run, its impacts, their rate and the time left.

    Parameters
    ----------
    name
        The scenario's name.
    stop_time, stop_impacts
        Where the run stops, s and a number; None without such a stop.
    """

    def __init__(self, name: str, stop_time: float | None, stop_impacts: int | None) -> None:
        super().__init__()
        self._name = printable(name)[:20]
        self._stops = stop_time, stop_impacts
        self._first: tuple[float, int] | None = None

    def tell(self, simulated: float, impacts: int) -> None:
        """Take down how far the run is; now and then the line is renewed."""
        if self._first is None:  # not 0 where a run is continued
            self._first = simulated, impacts
        elapsed = self._due()
        if elapsed is not None:
            self._write(self._line(simulated, impacts, elapsed))

    def _line(self, simulated: float, impacts: int, elapsed: float) -> str:
        assert self._first is not None
        rate = (impacts - self._first[1]) / elapsed
        share = self._share(simulated, impacts)
        left = f"  {duration(elapsed * (1.0 - share) / share)} left" if share > 0.0 else ""
        return (
            f"{self._name}: t = {simulated:.6g} s  {impacts:,} impacts  {rate:,.0f} impacts/s{left}"
        )

    def _share(self, simulated: float, impacts: int) -> float:
        """The part of the way to the nearer stop that is done; 0 where that is not known."""
        assert self._first is not None
        shares = [
            (now - first) / (stop - first)
            for now, first, stop in zip((simulated, impacts), self._first, self._stops, strict=True)
            if stop is not None and stop > first
        ]
        return max(shares, default=0.0)
