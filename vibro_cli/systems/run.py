"""What a finished run of every system besides the trace offers, each table when first asked for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Generic, NamedTuple, Protocol, Self, TypeVar

import numpy as np

from vibro_cli.simulation.continuing import checkpoint_of
from vibro_cli.systems import impact_columns as columns
from vibro_cli.systems.driving import Driver, Library
from vibro_cli.systems.impact_columns import Table
from vibro_cli.systems.system import ImpactSystem
from vibro_cli.systems.wanted import Wanted

# Samples of the motion that are kept.
MOST_SAMPLED = 6

SomeSystem = TypeVar("SomeSystem", bound=ImpactSystem)


class Paths(Protocol):
    """The motion of all bodies between their events."""

    def sample(self, times: Any, side: str = "after") -> Table:
        """Return the columns of the motion table: for each time (s) a row for each body."""


@dataclass(frozen=True)
class ImpactTable(Generic[SomeSystem]):
    """A table of impacts of two bodies, or of a body and a wall."""

    log: str
    columns: Callable[[Sequence[SomeSystem], Any, Any], Table]
    """From the systems of some runs, the rows of their logs and the number of each row's run."""


State = dict[str, list[list[Any]]]
"""Values of the fields of records, by the name of the records."""


class Ending(NamedTuple):
    """How a run of a system ends."""

    names: Mapping[int, str]
    """Causes by their numbers."""
    time: float | None
    """The end in s; None for the instant of the last event."""
    finish: bool = False
    """Whether the loop is to go on from its last step to the stop."""


@dataclass(frozen=True)
class SystemRun(ABC, Generic[SomeSystem]):
    """The result of a run; every table is computed when first asked for."""

    LIBRARY: ClassVar[Library]
    """What its kernels are called by."""
    IMPACT_LOG: ClassVar[str]
    """The log of the impacts of two bodies."""
    IMPACT_TABLES: ClassVar[Mapping[str, ImpactTable[Any]]]
    """The tables of impacts by their names."""
    FINAL_COLUMNS: ClassVar[tuple[str, ...]]
    """Columns of the motion table of which the summary has the last value of each body."""

    system: SomeSystem
    engine: str
    end_cause: str
    end_time: float
    wanted: Wanted
    _clock: dict[str, float] = field(repr=False)
    _logs: dict[str, Any] = field(repr=False)
    _state: State = field(repr=False)
    _end_state: State | None = field(repr=False)
    """The state at the end, where the run has brought the bodies there."""

    @classmethod
    def of(
        cls, system: SomeSystem, driver: Driver, cause: int, end: Ending, wanted: Wanted | None
    ) -> Self:
        """Return the run that a driver has brought to its end."""
        state = driver.state()
        if end.finish:
            driver.finish()
        return cls(
            system=system,
            engine=driver.engine,
            end_cause=end.names[cause],
            end_time=driver.value("t") if end.time is None else end.time,
            wanted=wanted or Wanted(),
            _clock=driver.clock(),
            _logs={name: log.table() for name, log in driver.logs.items()},
            _state=state,
            _end_state=driver.state() if end.finish else state,
        )

    @classmethod
    def stored(
        cls, system: SomeSystem, engine: str, checkpoint: Mapping[str, Any], history: dict[str, Any]
    ) -> Self:
        """Return a run as it was stored, for its tables, motion and figures."""
        names = cls.LIBRARY.records["clock"].fields  # type: ignore[attr-defined]
        clock = dict(zip(names, checkpoint["state"]["clock"][0], strict=True))
        return cls(
            system=system,
            engine=engine,
            end_cause=checkpoint["end_cause"],
            end_time=checkpoint["end_time"],
            wanted=Wanted(),
            _clock=clock,
            _logs=history,
            _state=checkpoint["state"],
            _end_state=None,
        )

    def checkpoint(self) -> dict[str, Any]:
        """Return the state after the last event, exact; a run continued from it has the same bits.

        Plain values: floats are written by ``json`` so that they are read back exactly.
        """
        counts = {"collisions": len(self._logs[self.IMPACT_LOG]), **dict(self._counts)}
        return checkpoint_of(self.end_cause, self.end_time, counts, self._state)

    def history(self) -> dict[str, Any]:
        """Return the logs of the whole run, which a run continued from the checkpoint takes up."""
        return dict(self._logs)

    @property
    def skipped(self) -> tuple[str, ...]:
        """What is not computed, and why."""
        return self.wanted.skipped()

    @property
    def energy_correction(self) -> float:
        """Sum of the corrections that keep the energy, absolute, J."""
        return self._clock["energy_correction"]

    @property
    @abstractmethod
    def paths(self) -> Paths:
        """The motion between the events."""

    @abstractmethod
    def _initial_states(self) -> Table:
        """Columns of the motion table at the start, a row for each body."""

    def _final_states(self) -> Table:
        """The same at the end."""
        return self.sample([self.end_time])

    @property
    @abstractmethod
    def _counts(self) -> list[tuple[str, int]]:
        """What the summary counts beside the impacts of two bodies."""

    @property
    @abstractmethod
    def _keeps_energy(self) -> bool:
        """Whether nothing in the run takes energy."""

    @property
    def collisions(self) -> Table:
        """Columns of ``collisions.parquet``, a row for each impact of two bodies."""
        return self.impact_table("collisions")

    def impact_count(self, name: str) -> int:
        """Return how many rows a table of impacts has."""
        return len(self._logs[self.IMPACT_TABLES[name].log])

    def impact_table(self, name: str) -> Table:
        """Return the columns of a table of impacts."""
        if name not in self._tables:
            self._tables[name], _ = tables_of_runs([self], name)
        return self._tables[name]

    @cached_property
    def _tables(self) -> dict[str, Table]:
        return {}

    @cached_property
    def motion(self) -> Table | None:
        """Columns of ``motion.parquet``, or None if no sampled motion is asked for."""
        instants = self.wanted.instants(self.end_time)
        return None if instants is None else self.sample(instants)

    def sample(self, times: Any, side: str = "after") -> Table:
        """Return the motion at given times (s); `side` of an event at such an instant."""
        key = np.asarray(times, dtype=np.float64).tobytes(), side
        if key not in self._sampled:
            self._sampled[key] = self.paths.sample(times, side)
            while len(self._sampled) > MOST_SAMPLED:
                del self._sampled[next(iter(self._sampled))]
        return dict(self._sampled[key])

    @cached_property
    def _sampled(self) -> dict[tuple[bytes, str], Table]:
        """What was asked for lately: the figures of a run ask for the same again and again."""
        return {}

    @cached_property
    def summary(self) -> Table:
        """Columns of ``summary.parquet``, one row."""
        return columns.summary_columns(self._totals)

    def summary_record(self) -> dict[str, Any]:
        """Return the summary as plain values, None for null."""
        return columns.summary_values(self._totals)

    @cached_property
    def _totals(self) -> list[tuple[str, Any]]:
        impacts = self._logs[self.IMPACT_LOG]
        first, last = self._initial_states(), self._final_states()
        start, end = (float(np.sum(states["energy"])) for states in (first, last))
        return [
            ("status", "ok"),
            ("reason", None),
            ("end_cause", self.end_cause),
            ("end_time", self.end_time),
            ("collisions", len(impacts)),
            *self._counts,
            *columns.impact_totals(impacts),
            *columns.energy_totals(start, end, self._keeps_energy, self.energy_correction),
            ("max_gap", columns.largest_gap(impacts)),
            *(
                (f"{name}_{row + 1}", float(last[name][row]))
                for row in range(len(self.system.bodies))
                for name in self.FINAL_COLUMNS
            ),
        ]


def tables_of_runs(runs: Sequence[SystemRun[Any]], name: str) -> tuple[Table, Any]:
    """Return the columns of a table of impacts of some runs, and the number of each row's run."""
    table = type(runs[0]).IMPACT_TABLES[name]
    logs = [run._logs[table.log] for run in runs]
    number = np.repeat(np.arange(len(runs)), [len(log) for log in logs])
    rows = logs[0] if len(logs) == 1 else np.concatenate(logs)
    return table.columns([run.system for run in runs], rows, number), number
