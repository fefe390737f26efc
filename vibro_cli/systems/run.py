"""A run of a system, streamed in stretches or kept whole with its motion at any time.

A streamed run turns stretches of its logs into rows of its tables. It keeps only what the rest of
the run needs, so memory does not grow with its length. One thread solves, a second one makes the
columns and a third one writes them. The motion of any system but the trace is gathered in the same
way, so that no log is kept whole.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from threading import Event
from typing import Any, NamedTuple

import numpy as np

from vibro_cli.kernels.numerics.constants import LATEST
from vibro_cli.kernels.world import END_INTERRUPTED, END_NAMES, END_TIME, LOG_FULL, RUNNING
from vibro_cli.systems.columns import made
from vibro_cli.systems.contract import Columns, Sink, System, Trajectory
from vibro_cli.systems.driver import (
    Driver,
    EventLoop,
    TooQuiet,
    checkpoint_of,
    earlier_part,
    joined,
    record_array,
    rows_of,
)
from vibro_cli.systems.request import NO_LIMITS, NOTHING_MORE, Limits, OutputRequest, within_run

# Shortest stretch before the end of a run, in rows: a short run is one stretch.
LEAST_ROWS = 8192
# Stretches that may await their columns before the solver pauses.
_AHEAD = 2
# Blocks of columns that may await writing.
_ROWS_AHEAD = 4


class Stretch(NamedTuple):
    """Consecutive rows of the logs of a run."""

    engine: str
    """Engine that solved it, ``"python"`` or ``"compiled"``."""
    logs: Mapping[str, Any]
    """Structured arrays by name."""
    clock: Mapping[str, Any]
    """The fields of the clock at the end of the stretch."""
    end: tuple[float, float]
    """Time of its end, in two doubles (s)."""
    cause: int
    """``RUNNING``, or the cause of the run's end."""
    records: Mapping[str, Any] = {}
    """State records at the end of the run, as structured arrays; empty before."""
    known: int = 0
    """Trace only: leading rows of ``log`` repeated from before, one per body or none."""
    settled: float = 0.0
    """Trace only: lasting contacts that began or ended before this time (s) are all logged."""


class Stretches:
    """The stretches of a run whose driver has not begun its first round; times in s."""

    def __init__(self, loop: EventLoop, driver: Driver, stop_time: float | None) -> None:
        self._loop = loop
        self.driver = driver
        self._stop_time = stop_time
        self.cause = RUNNING
        self.state: dict[str, Any] = {}
        """At the end: the complete state after the last event."""

    def until(self, interrupted: Callable[[], bool]) -> Iterator[Stretch]:
        """Yield the stretches, finally one with the end of the run, early if `interrupted`.

        Raises ``TooQuiet`` as ``Driver.rounds``, once the stretches so far have been yielded.
        """
        driver = self.driver
        try:
            for cause in driver.rounds():
                full = cause == LOG_FULL
                stopped = full and interrupted()
                if full and driver.waiting < LEAST_ROWS and not stopped:
                    continue
                yield self._framed(driver.drain())
                if stopped or not full:
                    yield self._last(END_INTERRUPTED if stopped else cause)
                    return
        except TooQuiet:
            yield self._framed(driver.drain())
            yield self._last(END_INTERRUPTED)
            if not interrupted():
                raise

    def whole(self, cut: bool = False) -> tuple[Stretch, dict[str, Any]]:
        """Return the whole run as one stretch, and its state at the end.

        Raises ``TooQuiet`` as ``Driver.rounds``; if `cut`, the run ends there instead.
        """
        driver = self.driver
        try:
            cause = driver.run()
        except TooQuiet:
            if not cut:
                raise
            cause = END_INTERRUPTED
        logs = driver.drain()
        return self._last(cause)._replace(logs=logs, known=0), self.state

    def _framed(self, logs: dict[str, Any]) -> Stretch:
        """Return the rows since the previous stretch as a stretch."""
        return self._stretch(logs)

    def _last(self, cause: int) -> Stretch:
        driver, loop = self.driver, self._loop
        self.cause = cause
        self.state = driver.state()
        end = None
        if cause == END_TIME:
            end = LATEST if self._stop_time is None else self._stop_time, 0.0
            if loop.finishes:
                driver.finish()
        records = {
            name: record_array(getattr(driver.world, name), loop.records[name])
            for name in loop.state
        }
        last = self._ended()
        return last._replace(end=end or last.end, cause=cause, records=records)

    def _ended(self) -> Stretch:
        """Return the rows that remain at the end."""
        return self._stretch(self.driver.drain())

    def _stretch(self, logs: Mapping[str, Any]) -> Stretch:
        clock = self.driver.clock()
        return Stretch(self.driver.engine, logs, clock, (clock["t"], clock["t_low"]), RUNNING)


@dataclass(frozen=True)
class Streamed:
    """A run that has been streamed; the sink has its tables."""

    system: Any
    engine: str
    end_cause: str
    skipped: tuple[str, ...]
    summary: dict[str, Any]
    """Columns of ``summary.parquet``, one row."""
    _checkpoint: dict[str, Any] = field(repr=False)
    motion: Gathered | None = field(default=None, repr=False)
    """Set if figures need the motion and do not solve the run again."""
    not_made: int = 0
    """Number of impacts in the tables that were not carried out, at the end of the run."""
    exponent_error: float = math.nan
    """Standard error of the greatest exponent (1/s), NaN if it is unknown."""
    unsampled_from: float | None = None
    """Time (s) from which an interruption left the motion without its samples."""

    def summary_record(self) -> dict[str, Any]:
        """Return the summary as plain values, None for null."""
        return record_of(self.summary)

    def checkpoint(self) -> dict[str, Any]:
        """Return the checkpoint after the last event, see ``systems.run.Run.checkpoint``."""
        return self._checkpoint


def record_of(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Return the single row of the summary as plain values, None for null."""
    record = {name: values.tolist()[0] for name, values in summary.items()}
    return {
        name: None if isinstance(value, float) and value != value else value
        for name, value in record.items()
    }


def begun(
    kind: System, system: Any, limits: Limits, engine: str = "compiled", earlier: Any = None
) -> Stretches:
    """Return a run of a system that is ready to start; its stretches can be iterated once.

    Raises `ValueError` for an unknown engine, and without a limit.
    """
    if limits == NO_LIMITS:
        raise ValueError("a run needs a stop: a time or a number of impacts")
    world, overrides = kind.world(system, limits), kind.overrides(system)
    return kind.stretches(Driver(kind.loop, world, engine, earlier, overrides), limits.time)


def stream(
    kind: System,
    system: Any,
    stretches: Stretches,
    sink: Sink,
    wanted: OutputRequest = NOTHING_MORE,
    names: Collection[str] | None = None,
    in_background: bool = True,
) -> Streamed:
    """Run a system from `begun` to its stop, and pass the rows of its tables to a sink.

    The sink receives the tables in `names`, by default all, one call at a time; `in_background`,
    it runs in its own thread while the solver and the tables continue. Raises ``TooQuiet`` as
    :func:`simulate`, with the run so far.
    """
    if names is None:
        names = [table.file for table in kind.tables()]
    calls = partial(aside, given_up=Event()) if in_background else _at_once
    refusal, not_made = None, 0
    with calls(_ROWS_AHEAD) as write, calls(_AHEAD) as make:
        tables = kind.table_maker(system, wanted, names, partial(write, sink))
        try:
            for last in stretches.until(wanted.interrupted):
                make(tables.take, last)
                not_made += int(np.sum(~made(last.logs[kind.impact_log("collisions")])))
        except TooQuiet as error:
            refusal = error
    end, cause = last.end[0], END_NAMES[stretches.cause]
    streamed = Streamed(
        system=system,
        engine=stretches.driver.engine,
        end_cause=cause,
        skipped=kind.skipped(last.clock, wanted, end),
        summary=tables.summary(),
        _checkpoint=checkpoint_of(cause, end, last.clock, stretches.driver.rows, stretches.state),
        motion=tables.motion,
        not_made=not_made,
        exponent_error=math.nan if tables.tangents is None else tables.tangents.error,
        unsampled_from=None if tables.sampling is None else tables.sampling.missing_from,
    )
    if refusal is not None:
        refusal.streamed = streamed
        raise refusal
    return streamed


def summed_up(
    kind: System,
    system: Any,
    limits: Limits,
    engine: str,
    wanted: OutputRequest,
    logs: Collection[str],
    interrupted: Callable[[], bool],
) -> tuple[Columns, dict[str, Any]]:
    """Run a system and return its summary and these logs; nothing else is kept.

    It ends early, with unusable results, when `interrupted`. Raises as :func:`simulate`.
    """
    tables = kind.table_maker(system, wanted, (), lambda name, rows: None)
    kept: dict[str, list[Any]] = {name: [] for name in logs}
    for stretch in begun(kind, system, limits, engine).until(interrupted):
        tables.take(stretch)
        for name, parts in kept.items():
            parts.append(stretch.logs[name])
    return tables.summary(), {name: joined(parts) for name, parts in kept.items()}


def ahead(stretches: Iterator[Stretch]) -> Iterator[Stretch]:
    """Yield stretches while a separate thread solves the next one."""
    with ThreadPoolExecutor(1) as solver:
        coming = solver.submit(next, stretches, None)
        while (stretch := coming.result()) is not None:
            coming = solver.submit(next, stretches, None)
            yield stretch


@contextmanager
def aside(waiting: int, given_up: Event) -> Iterator[Callable[..., None]]:
    """Make calls one after another in a separate thread; at most `waiting` calls are queued.

    Threads that call one another share the event `given_up`. A call in progress may take hours (a
    stretch with very many samples); once the event is set, its next nested call cancels it.
    """
    with ThreadPoolExecutor(1) as thread:
        under_way: list[Future[None]] = []

        def call(function: Callable[..., None], *arguments: Any) -> None:
            if given_up.is_set():
                raise CancelledError
            under_way.append(thread.submit(function, *arguments))
            while len(under_way) > waiting:
                under_way.pop(0).result()

        try:
            yield call
            for future in under_way:
                future.result()
        except BaseException:
            given_up.set()
            raise


@contextmanager
def _at_once(waiting: int) -> Iterator[Callable[..., None]]:
    """Make calls in this thread."""
    yield lambda function, *arguments: function(*arguments)


@dataclass(frozen=True, eq=False)
class Run:
    """The result of :func:`simulate`; each table is computed on first use."""

    kind: System
    """Everything that differs between systems."""
    system: Any
    """The system that was solved."""
    engine: str
    wanted: OutputRequest
    whole: Stretch = field(repr=False)
    """The whole run as one stretch."""
    state: dict[str, Any] = field(repr=False)
    """The complete state after the last event."""
    _tables: dict[str, Columns | None] = field(default_factory=dict, repr=False)

    @property
    def end_cause(self) -> str:
        """Cause of the end."""
        return END_NAMES[self.whole.cause]

    @property
    def end_time(self) -> float:
        """Time of the end (s)."""
        return self.whole.end[0]

    @property
    def skipped(self) -> tuple[str, ...]:
        """Outputs that were not computed, and why."""
        return self.kind.skipped(self.clock, self.wanted, self.end_time)

    def table(self, name: str) -> Columns | None:
        """Return the columns of a table, or None if it was not requested (motion)."""
        if name not in self._tables:
            self._tables[name] = self._made(name)
        return self._tables[name]

    def _made(self, name: str) -> Columns | None:
        parts: list[Columns] = []
        tables = self.kind.table_maker(
            self.system, self.wanted, () if name == "summary" else (name,),
            lambda _, rows: parts.append(rows),
        )  # fmt: skip
        tables.take(self.whole)
        if name == "summary":
            return tables.summary()
        if not parts:
            return None
        join: Any = np.ma.concatenate if len(parts) > 1 else lambda one: one[0]
        rows = {column: join([part[column] for part in parts]) for column in parts[0]}
        declared = {table.file: table for table in self.kind.tables()}
        return declared[name].in_words(rows)

    def _present(self, name: str) -> Columns:
        found = self.table(name)
        assert found is not None
        return found

    @property
    def collisions(self) -> Columns:
        """Columns of ``collisions.parquet``, one row per impact of two bodies."""
        return self._present("collisions")

    @property
    def bounces(self) -> Columns:
        """Columns of ``bounces.parquet`` of a table, one row per impact on the wall."""
        return self._present("bounces")

    @property
    def events(self) -> Columns:
        """Columns of ``events.parquet``, in order of time."""
        return self._present("events")

    @property
    def motion(self) -> Columns | None:
        """Columns of ``motion.parquet``, or None if sampled motion was not requested."""
        return self.table("motion")

    @property
    def exponents(self) -> Columns | None:
        """Columns of ``exponents.parquet``, or None if they were not requested."""
        return self.table("exponents")

    @property
    def summary(self) -> Columns:
        """Columns of ``summary.parquet``, one row."""
        return self._present("summary")

    def summary_record(self) -> dict[str, Any]:
        """Return the summary as plain values, None for null."""
        return record_of(self.summary)

    @property
    def clock(self) -> Mapping[str, Any]:
        """Fields of the clock at the end, with counts of the solver's work."""
        return self.whole.clock

    @cached_property
    def trajectory(self) -> Trajectory:
        """The motion of all bodies, in closed form."""
        return self.kind.trajectory(self.system, self.whole)

    def sample(self, times: Any, side: str = "after", extrapolate: bool = False) -> Columns:
        """Return the columns of the motion table at times (s), exact: one row per body and time.

        `side`, ``"after"`` or ``"before"``, selects the state at the very instant of an event. With
        `extrapolate`, times outside the run are allowed too: the first and the last flights are
        extended as if nothing happened. Raises `ValueError` for other times and another ``side``.
        """
        instants = within_run(times, self.end_time, extrapolate)
        return self.trajectory.sample(instants, side)

    def flights(self) -> Columns:
        """Return all flights of all bodies on a trace: start, end and why each one ended."""
        return self.trajectory.table()  # type: ignore[attr-defined, no-any-return]

    def look_at(self, rows: Any) -> None:
        """Do nothing: all flights are at hand."""

    def flight_curve(self, index: Any, count: Any, lasts: float = math.inf) -> tuple[Any, Any, Any]:
        """Return times (s), angles (rad) and rates (rad/s) at ``count`` points along a flight.

        On a line: positions (m) and speeds (m/s). ``lasts`` limits the curve's duration (s). For
        several flights of a body on one piece, `index` and `count` are arrays of shape (n,), and
        the points of all flights follow one another.
        """
        return self.trajectory.curve(index, count, lasts)  # type: ignore[attr-defined, no-any-return]

    def checkpoint(self) -> dict[str, Any]:
        """Return the exact state after the last event; a continued run has the same bits.

        It consists of plain values, whose floats ``json`` writes and reads back exactly.
        """
        whole = self.whole
        rows = {name: len(log) for name, log in whole.logs.items()}
        return checkpoint_of(self.end_cause, self.end_time, whole.clock, rows, self.state)

    def history(self) -> dict[str, Any]:
        """Return the logs of the whole run, from which its tables and figures are made.

        A run continued from the checkpoint needs them to be whole too.
        """
        return dict(self.whole.logs)

    def cut_back(self, checkpoint: Mapping[str, Any]) -> Run:
        """Return the run as it was when it was interrupted and this checkpoint was written."""
        loop, state = self.kind.loop, checkpoint["state"]
        records = {
            name: record_array(rows_of(loop.records[name], rows), loop.records[name])
            for name, rows in state.items()
        }
        names = loop.records["clock"].fields  # type: ignore[attr-defined]
        clock = dict(zip(names, state["clock"][0], strict=True))
        whole = self.whole._replace(
            logs={name: log[: checkpoint["rows"][name]] for name, log in self.whole.logs.items()},
            clock=clock,
            end=(clock["t"], clock["t_low"]),
            cause=END_INTERRUPTED,
            records=records,
        )
        return replace(self, whole=whole, state=state, _tables={})


def simulate(
    kind: System,
    system: Any,
    limits: Limits,
    engine: str = "compiled",
    wanted: OutputRequest = NOTHING_MORE,
    checkpoint: dict[str, Any] | None = None,
    history: dict[str, Any] | None = None,
    cut: bool = False,
) -> Run:
    """Run a system until its stop; both engines (see ``driver.ENGINES``) give the same bits.

    Given the checkpoint and the history of an earlier run of the same system, the run continues as
    if it had never stopped. If `cut`, it ends when there is no impact for very long.

    Raises `ValueError` for an unknown engine, without a limit, and for a checkpoint of another
    system; `CannotContinue` if the earlier run had ended for good (see ``systems.request.FINAL``)
    or is past the stop; `TooQuiet` if there is no impact for very long, unless `cut`.
    """
    earlier = None
    if checkpoint is not None:
        earlier = earlier_part(checkpoint, history, kind.loop, limits)
    stretches = begun(kind, system, limits, engine, earlier)
    return Run(kind, system, engine, wanted, *stretches.whole(cut))


MOST_ROWS = 200_000
"""Logs with more rows in total than this are not kept for figures and reports."""


class Gathered:
    """The motion of a run, gathered stretch by stretch."""

    state: dict[str, Any]
    """The complete state after the last event; set by `solved_again` only."""

    def __init__(self, system: Any) -> None:
        self.system = system
        self._parts: list[Any] = []
        self._end = 0.0

    def take(self, trajectory: Any, end: float) -> None:
        """Append the motion in the next stretch, which ends at the time `end` (s)."""
        self._parts.append(trajectory)
        self._end = end

    @cached_property
    def trajectory(self) -> Any:
        """The motion of all bodies in closed form, see `contract.Trajectory`."""
        whole, self._parts = self._parts, []
        whole[0].go_on(whole[1:])
        return whole[0]

    def sample(self, times: Any, side: str = "after", extrapolate: bool = False) -> Columns:
        """Return the columns of the motion table at times (s), see ``systems.run.Run``."""
        return self.trajectory.sample(within_run(times, self._end, extrapolate), side)  # type: ignore[no-any-return]


def solved_again(
    kind: System, system: Any, limits: Limits, rows: Mapping[str, int], interrupted: bool
) -> Any:
    """Solve a run again for its motion; `rows` are the lengths of its logs (`long_motion`)."""
    motion, run, most = Gathered(system), begun(kind, system, limits), sum(rows.values())
    before = None
    for stretch in ahead(run.until(lambda: interrupted and sum(run.driver.rows.values()) >= most)):
        trajectory = kind.trajectory(system, stretch, before)
        motion.take(trajectory, stretch.end[0])
        before = trajectory.last
    motion.state = run.state
    return motion
