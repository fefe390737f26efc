"""The tables of a run on a table or of springs, stretch by stretch, and its summary."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any

import numpy as np

from vibro_cli.kernels.world import END_NAMES, RUNNING
from vibro_cli.systems.contract import ImpactLog, Rows, Sink, System
from vibro_cli.systems.rows import Totals, record_array
from vibro_cli.systems.stream import Stretch
from vibro_cli.systems.tangents import exponent_table, grown_columns
from vibro_cli.systems.wanted import Limits, Sampling, Wanted

States = Callable[[Any, float], Rows]
"""From the records that change in a run and a time (s): the columns of the motion table then."""


class SystemTables:
    """What the tables of a run say, stretch by stretch.

    Parameters
    ----------
    kind, system, wanted, names, sink
        See ``systems.contract.System.teller``.
    states
        Where the bodies are at the start and at the end.
    events
        The columns of ``events.parquet`` from the logs of a stretch, where there is such a table.
    """

    def __init__(
        self,
        kind: System,
        system: Any,
        wanted: Wanted,
        names: Collection[str],
        sink: Sink,
        states: States,
        events: Callable[[Any], Rows] | None = None,
    ) -> None:
        self._kind, self._system, self._sink = kind, system, sink
        self._states = states
        self._events = events if "events" in names else None
        logs = kind.impact_logs
        self._counted = logs["collisions"].log
        self._impacts = {name: _Impacts(one, system) for name, one in logs.items() if name in names}
        self._sampling = Sampling(wanted) if "motion" in names and wanted.motion else None
        self._before: Any = None
        self._begun = False
        self._tangents = kind.tangents(system) if wanted.lyapunov else None
        self._converging = "exponents" in names
        world, records = kind.world(system, Limits()), kind.loop.records
        started = {
            name: record_array(getattr(world, name), records[name]) for name in kind.loop.state
        }
        self._totals = Totals(float(np.sum(states(started, 0.0)["energy"])))

    def take(self, stretch: Stretch) -> None:
        """Tell of a stretch."""
        ended = stretch.cause != RUNNING
        more = not ended or any(map(len, stretch.logs.values())) or not self._begun
        grown = {} if self._tangents is None else self._tangents.take(stretch)
        for name, impacts in self._impacts.items() if more else ():
            columns = impacts.take(stretch.logs)
            if name in grown:
                columns |= grown_columns(grown[name], columns["grazing"])
            self._sink(name, columns)
        if self._tangents is not None and self._converging and ended:
            self._sink("exponents", exponent_table(self._tangents))
        if self._events is not None and more:
            self._sink("events", self._events(stretch.logs))
        self._begun = True
        if self._sampling is not None:
            trajectory = self._kind.trajectory(self._system, stretch, self._before)
            for instants in self._sampling.until(stretch.end[0], ended):
                self._sink("motion", trajectory.sample(instants))
            self._before = trajectory.last
        self._totals.take(stretch.logs[self._counted])
        if ended:
            cause, end = END_NAMES[stretch.cause], stretch.end[0]
            last = self._states(stretch.records, end)
            self._totals.finish(self._system, cause, end, stretch.clock, last)

    def summary(self) -> Rows:
        """Return the columns of ``summary.parquet``, once the run has ended."""
        values = self._kind.summary(len(self._system.bodies)).filled(self._totals)
        found = {name: _one(value) for name, value in values.items()}
        return found if self._tangents is None else found | self._tangents.summary()


def _one(value: Any) -> Any:
    """A value as a column of one row."""
    words = value is None or isinstance(value, str)
    return np.array([value], dtype=object if words else None)


class _Impacts:
    """The columns of a table of impacts of one run, stretch by stretch."""

    def __init__(self, kept: ImpactLog, system: Any) -> None:
        self._kept = kept
        self._bodies = kept.bodies([system])
        self._told = 0
        self._before: Any = None

    def take(self, logs: Any) -> Rows:
        log, kept = logs[self._kept.log], self._kept
        run = np.zeros(len(log), dtype=np.int64)
        columns = kept.table.filled(kept.rows(self._bodies, log, run, self._told, self._before))
        self._told += len(log)
        self._before = log[-1] if len(log) else self._before
        return columns


def impacts_of_runs(
    kept: ImpactLog, systems: Sequence[Any], logs: Sequence[Any]
) -> tuple[Rows, Any]:
    """Return the columns of a table of impacts of some runs, and the number of each row's run.

    Parameters
    ----------
    kept
        Which table.
    systems, logs
        Of each run.
    """
    run = np.repeat(np.arange(len(logs)), [len(log) for log in logs])
    rows = kept.rows(kept.bodies(systems), np.concatenate(list(logs)), run)
    return kept.table.in_words(kept.table.filled(rows)), run
