"""The motion of a run that is too long to be kept: what is asked of it is solved again.

Of every flight only where and when it begins and ends is at hand. The rows of the log, which the
states on a flight are made from, are gathered in one more pass, of the flights that are asked for.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from vibro_cli.kernels.world import CAUSE_NAMES, RUNNING, World
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.systems import contract
from vibro_cli.systems.driver import with_logs
from vibro_cli.systems.stream import Stretch, ahead, begun
from vibro_cli.systems.trace import SYSTEM
from vibro_cli.systems.trace.event_loop import last_of_each
from vibro_cli.systems.trace.flights import (
    CAUSES,
    Floats,
    InWords,
    Paths,
    Places,
    places_and_rates,
    states_at,
)
from vibro_cli.systems.trace.world import make_world
from vibro_cli.systems.wanted import Limits, within_run

MOST_FLIGHTS = 200_000
"""Of a run with more flights than this no log is kept for figures and reports."""


# Columns that are gathered with those of the flights.
_NUMBER, _LASTS = "number", "lasts"


class LongMotion:
    """The motion of a run on a trace, of which no log is kept.

    Parameters
    ----------
    kind, system, limits
        Of the run, which is solved by machine code.
    flights
        How many it has.
    interrupted
        Whether it ended when so many had begun.
    """

    def __init__(
        self,
        kind: contract.System,
        system: TraceSystem,
        limits: Limits,
        flights: int,
        interrupted: bool = False,
    ) -> None:
        self.system = system
        self._kind = kind
        self._limits = limits
        self._most = flights if interrupted else math.inf
        self._places = Places(system)
        self._overrides = SYSTEM.overrides(system)
        self._world = make_world(system, None, None)
        self.state: dict[str, Any] = {}
        """All that changes in the run, after its last event."""
        self._table, self._numbers, self._durations = self._gathered(flights)
        self._asked: Any = np.zeros(0, dtype=np.int64)
        self._near: World | None = None

    def flights(self) -> dict[str, Any]:
        """Return every flight of every body: where and when it starts and ends, and why."""
        return self._table

    def look_at(self, rows: Any) -> None:
        """Gather what the motion on some flights, rows of the table, is made from."""
        numbers = np.unique(self._numbers[np.asarray(rows, dtype=np.int64)])
        if np.all(np.isin(numbers, self._asked)):
            return
        logs, clock = self._rows_of(numbers)
        self._near = with_logs(SYSTEM.loop, self._world, "compiled", logs, clock)
        self._asked = numbers

    def flight_curve(
        self, index: int, count: int, lasts: float = math.inf
    ) -> tuple[Floats, Floats, Floats]:
        """Return times, angles (places) and rates along a flight, see ``systems.run.Run``."""
        if self._numbers[index] not in self._asked:
            self.look_at([index])
        assert self._near is not None
        row = int(np.searchsorted(self._asked, self._numbers[index]))
        after = np.linspace(0.0, min(float(self._durations[index]), lasts), count)
        states = states_at(self._near, np.full(count, row), after, self._overrides)
        body, piece = (int(self._table[name][index]) - 1 for name in ("ball", "arc"))
        start = float(self._table["t_start"][index])
        return start + after, *places_and_rates(self._places, body, piece, states)

    def sample(self, times: Any, side: str = "after", extrapolate: bool = False) -> dict[str, Any]:
        """Return the motion of every body at given times, see ``systems.run.Run``."""
        end = float(np.max(self._table["t_end"]))
        instants = within_run(times, end, extrapolate)
        order = np.argsort(instants, kind="stable")
        waiting = instants[order]
        parts = []
        for stretch in self._stretches():
            until = stretch.end[0]
            told = len(waiting)
            if stretch.cause == RUNNING:
                told = int(np.searchsorted(waiting, until, "left" if side == "after" else "right"))
            if told:
                parts.append(self._paths(stretch).sample(waiting[:told], side, extrapolate=True))
            waiting = waiting[told:]
            if not len(waiting):
                break
        return self._in_order(parts, order)

    def _in_order(self, parts: list[dict[str, Any]], order: Any) -> dict[str, Any]:
        """Put the rows of samples, those of all bodies at each time, into an order of the times."""
        bodies = np.arange(len(self.system.bodies))
        rows = np.empty(len(order) * len(bodies), dtype=np.int64)
        rows[(order[:, None] * len(bodies) + bodies).ravel()] = np.arange(len(rows))
        return {name: np.concatenate([part[name] for part in parts])[rows] for name in parts[0]}

    def _stretches(self) -> Iterator[Stretch]:
        driver = begun(self._kind, self.system, self._limits)
        self._solved = self._kind.stretches(driver, self._limits.time)
        return ahead(self._solved.until(lambda: driver.rows["log"] >= self._most))

    def _paths(self, stretch: Stretch) -> Paths:
        logs = stretch.logs
        self._world = with_logs(SYSTEM.loop, self._world, stretch.engine, logs, stretch.clock)
        return Paths(self._places, self._world, logs["log"], *stretch.end, self._overrides)

    def _gathered(self, flights: int) -> tuple[dict[str, Any], Any, Any]:
        """Go through the run: the table of flights, their rows in the log, how long they last."""
        columns: dict[str, Any] = {}
        bodies, edges, told = np.arange(len(self.system.bodies) + 1), [], 0
        for stretch, own in _numbered(self._stretches()):
            paths = self._paths(stretch)
            over = np.flatnonzero(~paths.last if stretch.cause == RUNNING else paths.last)
            over = over[: flights - told]  # another run may have more: its state tells it
            table = paths.columns() | {_NUMBER: own[paths.number], _LASTS: paths.duration}
            columns = columns or self._room(table, flights)
            for name, values in table.items():
                columns[name][told : told + len(over)] = values[over]
            edges.append((told + np.searchsorted(paths.body[over], bodies)).tolist())
            told += len(over)
        self.state = self._solved.state
        # Every stretch has its flights body by body.
        order = [slice(*each[body : body + 2]) for body in bodies[:-1] for each in edges]
        for name in list(columns):
            columns[name] = np.concatenate([columns[name][rows] for rows in order])
        numbers, durations = columns.pop(_NUMBER), columns.pop(_LASTS)
        return columns | {name: InWords(columns[name]) for name in CAUSES}, numbers, durations

    def _room(self, table: dict[str, Any], flights: int) -> dict[str, Any]:
        """Return columns for so many flights, those of small numbers in few bytes."""
        greatest = {
            "ball": len(self.system.bodies),
            "arc": len(self.system.trace.pieces),
            **dict.fromkeys(CAUSES, len(CAUSE_NAMES)),
            _NUMBER: flights,
        }
        types = {name: np.min_scalar_type(number) for name, number in greatest.items()}
        return {n: np.empty(flights, types.get(n, values.dtype)) for n, values in table.items()}

    def _rows_of(self, wanted: Any) -> tuple[dict[str, Any], Any]:
        """The rows of some flights, by their ascending numbers, as logs of their own."""
        flights, segments = [], []
        for stretch, own in _numbered(self._stretches()):
            rows = np.flatnonzero(np.isin(own, wanted) & (np.arange(len(own)) >= stretch.known))
            flights.append(stretch.logs["log"][rows])
            found = stretch.logs["segments"]
            found = found[np.isin(found["flight"], rows)]
            found["flight"] = np.searchsorted(wanted, own[found["flight"]])
            segments.append(found)
            if np.max(own) >= wanted[-1]:
                break
        rows_of = {"log": np.concatenate(flights), "segments": np.concatenate(segments)}
        return {**stretch.logs, **rows_of}, stretch.clock


def _numbered(stretches: Iterator[Stretch]) -> Iterator[tuple[Stretch, Any]]:
    """Yield stretches, each with the numbers of its flights in the log of the whole run."""
    told, carried = 0, np.zeros(0, dtype=np.int64)
    for stretch in stretches:
        log = stretch.logs["log"]
        new = len(log) - stretch.known
        own = np.concatenate([carried, np.arange(told, told + new)])
        told += new
        carried = own[last_of_each(log)]
        yield stretch, own
