"""A finished run: its tables, its summary, and its state at any time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from vibro_cli.kernels.world import END_INTERRUPTED, END_NAMES
from vibro_cli.systems.contract import Rows, System, Trajectory
from vibro_cli.systems.driver import checkpoint_of, earlier_part
from vibro_cli.systems.rows import record_array, rows_of
from vibro_cli.systems.stream import Stretch, begun, record_of
from vibro_cli.systems.wanted import NOTHING_MORE, Limits, Wanted, within_run


@dataclass(frozen=True, eq=False)
class Run:
    """The result of :func:`simulate`; every table is computed when first asked for."""

    kind: System
    """What differs from one system to another."""
    system: Any
    """What was solved."""
    engine: str
    wanted: Wanted
    _whole: Stretch = field(repr=False)
    """All of it, as one stretch."""
    _state: dict[str, Any] = field(repr=False)
    _tables: dict[str, Rows | None] = field(default_factory=dict, repr=False)

    @property
    def end_cause(self) -> str:
        """Why it ended."""
        return END_NAMES[self._whole.cause]

    @property
    def end_time(self) -> float:
        """When it ended (s)."""
        return self._whole.end[0]

    @property
    def skipped(self) -> tuple[str, ...]:
        """What was not computed, and why."""
        return self.kind.skipped(self._whole.clock, self.wanted, self.end_time)

    def table(self, name: str) -> Rows | None:
        """Return the columns of a table, None for one that was not asked for (motion)."""
        if name not in self._tables:
            self._tables[name] = self._made(name)
        return self._tables[name]

    def _made(self, name: str) -> Rows | None:
        parts: list[Rows] = []
        tables = self.kind.teller(
            self.system, self.wanted, () if name == "summary" else (name,),
            lambda _, rows: parts.append(rows),
        )  # fmt: skip
        tables.take(self._whole)
        if name == "summary":
            return tables.summary()
        if not parts:
            return None
        join: Any = np.ma.concatenate if len(parts) > 1 else lambda one: one[0]
        rows = {column: join([part[column] for part in parts]) for column in parts[0]}
        declared = {table.file: table for table in self.kind.tables()}
        return declared[name].in_words(rows)

    def _present(self, name: str) -> Rows:
        found = self.table(name)
        assert found is not None
        return found

    @property
    def collisions(self) -> Rows:
        """Columns of ``collisions.parquet``, a row for each impact of two bodies."""
        return self._present("collisions")

    @property
    def bounces(self) -> Rows:
        """Columns of ``bounces.parquet`` of a table, a row for each impact on the wall."""
        return self._present("bounces")

    @property
    def events(self) -> Rows:
        """Columns of ``events.parquet``, in order of time."""
        return self._present("events")

    @property
    def motion(self) -> Rows | None:
        """Columns of ``motion.parquet``, or None if no sampled motion is asked for."""
        return self.table("motion")

    @property
    def exponents(self) -> Rows | None:
        """Columns of ``exponents.parquet``, or None if they are not asked for."""
        return self.table("exponents")

    @property
    def summary(self) -> Rows:
        """Columns of ``summary.parquet``, one row."""
        return self._present("summary")

    def summary_record(self) -> dict[str, Any]:
        """Return the summary as plain values, None for null."""
        return record_of(self.summary)

    def clock_value(self, name: str) -> float:
        """Return a field of the run's clock at its end."""
        return float(self._whole.clock[name])

    @cached_property
    def world(self) -> Any:
        """The records of the system at the start, interpreted, for what is made of its logs."""
        return self.kind.world(self.system, Limits())

    @cached_property
    def trajectory(self) -> Trajectory:
        """The motion of all bodies, in closed form."""
        return self.kind.trajectory(self.system, self._whole)

    def sample(self, times: Any, side: str = "after", extrapolate: bool = False) -> Rows:
        """Return the motion at given times, exactly.

        Parameters
        ----------
        times
            Instants, s, any number, in any order, from the start of the run to its end.
        side
            ``"after"`` or ``"before"`` an event that happens at just such an instant.
        extrapolate
            Whether times outside the run are answered too: with the first and the last motion, as
            if nothing met it.

        Returns
        -------
        The columns of the motion table: for each time a row for each body.

        Raises
        ------
        ValueError
            For another ``side``, and for a time outside the run that is not to be extrapolated.
        """
        instants = within_run(times, self.end_time, extrapolate)
        return self.trajectory.sample(instants, side, extrapolate)

    def flights(self) -> Rows:
        """Return every flight of every body on a trace: where and when it starts and ends, why."""
        return self.trajectory.table()  # type: ignore[attr-defined, no-any-return]

    def look_at(self, rows: Any) -> None:
        """Take note of flights that will be asked for: every one is at hand."""

    def flight_curve(self, index: int, count: int, lasts: float = math.inf) -> tuple[Any, Any, Any]:
        """Return times (s), angles (rad) and rates (rad/s) at ``count`` points along a flight.

        On a line positions (m) and speeds (m/s). ``lasts`` is how much of the flight is wanted, s.
        """
        return self.trajectory.curve(index, count, lasts)  # type: ignore[attr-defined, no-any-return]

    def checkpoint(self) -> dict[str, Any]:
        """Return the state after the last event, exact; a run continued from it has the same bits.

        Plain values: floats are written by ``json`` so that they are read back exactly.
        """
        whole = self._whole
        rows = {name: len(log) for name, log in whole.logs.items()}
        return checkpoint_of(self.end_cause, self.end_time, whole.clock, rows, self._state)

    def history(self) -> dict[str, Any]:
        """Return the logs of the whole run, which its tables and figures are made from.

        A run continued from the checkpoint takes them up, so that it is whole too.
        """
        return dict(self._whole.logs)

    def cut_back(self, checkpoint: Mapping[str, Any]) -> Run:
        """Return the run as it was when it was interrupted, and its checkpoint written."""
        loop, state = self.kind.loop, checkpoint["state"]
        records = {
            name: record_array(rows_of(loop.records[name], rows), loop.records[name])
            for name, rows in state.items()
        }
        names = loop.records["clock"].fields  # type: ignore[attr-defined]
        clock = dict(zip(names, state["clock"][0], strict=True))
        whole = self._whole._replace(
            logs={name: log[: checkpoint["rows"][name]] for name, log in self._whole.logs.items()},
            clock=clock,
            end=(clock["t"], clock["t_low"]),
            cause=END_INTERRUPTED,
            records=records,
        )
        return replace(self, _whole=whole, _state=state, _tables={})

    def statistics(self) -> dict[str, int]:
        """Return what the solver of a trace did: searches, evaluations, searches spared."""
        names = ("searches", "evaluations", "skipped_apart")
        return {name: int(self._whole.clock[name]) for name in names}


def simulate(
    kind: System,
    system: Any,
    limits: Limits,
    engine: str = "compiled",
    wanted: Wanted = NOTHING_MORE,
    checkpoint: dict[str, Any] | None = None,
    history: dict[str, Any] | None = None,
) -> Run:
    """Run a system until its stop.

    Parameters
    ----------
    kind, system
        What is solved, and the object of its kind.
    limits
        At least one.
    engine
        ``"compiled"``, or ``"python"`` (interpreted); both give the same bits.
    checkpoint
        From :meth:`Run.checkpoint` of the same system: the run goes on from there, as if it had
        never stopped.
    history
        From :meth:`Run.history` of the same run; it comes with the checkpoint.

    Raises
    ------
    ValueError
        For an unknown engine, without a limit, and for a checkpoint of another system.
    CannotContinue
        If the earlier run had ended for good (see ``systems.wanted.FINAL``), or is past the stop.
    TooQuiet
        If there is no impact for very long.
    """
    earlier = None
    if checkpoint is not None:
        earlier = earlier_part(checkpoint, history, kind.loop.logs, limits)
    driver = begun(kind, system, limits, engine, earlier)
    stretches = kind.stretches(driver, limits.time)
    return Run(kind, system, driver.engine, wanted, *stretches.whole())
