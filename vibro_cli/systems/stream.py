"""A run that is told of while it goes on: stretches of its logs become rows of its tables.

Nothing is kept but what the rest of the run needs, so that memory does not grow with it. The
solver goes on in one thread while another makes the columns, and a third one writes them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from vibro_cli.kernels.world import END_INTERRUPTED, END_NAMES, END_TIME, LOG_FULL, RUNNING
from vibro_cli.systems.contract import Rows, Sink, System, Tables
from vibro_cli.systems.driver import Driver, EventLoop, checkpoint_of
from vibro_cli.systems.rows import record_array
from vibro_cli.systems.wanted import NOTHING_MORE, Limits, Wanted

# Less is handed over at the end only: a short run is one stretch.
LEAST_ROWS = 8192
# Stretches that may wait to be told of, before the solver waits for them.
_AHEAD = 2
# And rows of tables that may wait to be written.
_ROWS_AHEAD = 4


class Stretch(NamedTuple):
    """Rows of the logs that belong together."""

    engine: str
    """That solved it, ``"python"`` or ``"compiled"``."""
    logs: Mapping[str, Any]
    """Structured arrays by name."""
    clock: Mapping[str, Any]
    """The fields of the clock at its end."""
    end: tuple[float, float]
    """When it ends, in two doubles (s)."""
    cause: int
    """``RUNNING``, or why the run has ended."""
    records: Mapping[str, Any] = {}
    """At the end of the run: the records that change in it, as structured arrays."""
    known: int = 0
    """Of a trace: rows of ``log`` in front that are known already, one for each body or none."""
    settled: float = 0.0
    """Of a trace: no lasting contact from before this time (s) is still to be logged."""


class Stretches:
    """The stretches of a run in progress.

    Parameters
    ----------
    loop, driver
        The driver before its first round.
    stop_time
        Of the run, s.
    """

    def __init__(self, loop: EventLoop, driver: Driver, stop_time: float | None) -> None:
        self._loop = loop
        self._driver = driver
        self._stop_time = stop_time
        self.cause = RUNNING
        self.state: dict[str, Any] = {}
        """At the end: all that changes in the run, after its last event."""

    def __iter__(self) -> Iterator[Stretch]:
        return self.until(lambda: False)

    def until(self, interrupted: Callable[[], bool]) -> Iterator[Stretch]:
        """Yield stretch after stretch, at last one that only ends; sooner when interrupted."""
        driver = self._driver
        for cause in driver.rounds():
            full = cause == LOG_FULL
            stopped = full and interrupted()
            if full and max(map(len, driver.logs.values())) < LEAST_ROWS and not stopped:
                continue
            yield self._framed({name: log.drain() for name, log in driver.logs.items()})
            if stopped or not full:
                yield self._last(END_INTERRUPTED if stopped else cause)
                return

    def whole(self) -> tuple[Stretch, dict[str, Any]]:
        """Return the run to its end as one stretch, and the state then."""
        driver = self._driver
        cause = driver.run()
        logs = {name: log.drain() for name, log in driver.logs.items()}
        return self._last(cause)._replace(logs=logs, known=0), self.state

    def _framed(self, logs: dict[str, Any]) -> Stretch:
        """The rows since the stretch before as a stretch."""
        return self._stretch(logs)

    def _last(self, cause: int) -> Stretch:
        """The end of a run, without rows."""
        driver, loop = self._driver, self._loop
        self.cause = cause
        self.state = driver.state()
        end = None
        if cause == END_TIME and self._stop_time is not None:
            end = self._stop_time, 0.0
            if loop.finishes:
                driver.finish()
        records = {
            name: record_array(getattr(driver.world, name), loop.records[name])
            for name in loop.state
        }
        last = self._ended()
        return last._replace(end=end or last.end, cause=cause, records=records)

    def _ended(self) -> Stretch:
        """What is left to be told at the end."""
        return self._stretch({name: log.drain() for name, log in self._driver.logs.items()})

    def _stretch(self, logs: Mapping[str, Any]) -> Stretch:
        clock = self._driver.clock()
        return Stretch(self._driver.engine, logs, clock, (clock["t"], clock["t_low"]), RUNNING)


@dataclass(frozen=True)
class Streamed:
    """A run that has been told of; its tables are where they were handed to."""

    system: Any
    engine: str
    end_cause: str
    skipped: tuple[str, ...]
    summary: dict[str, Any]
    """Columns of ``summary.parquet``, one row."""
    _checkpoint: dict[str, Any] = field(repr=False)

    def summary_record(self) -> dict[str, Any]:
        """Return the summary as plain values, None for null."""
        return record_of(self.summary)

    def checkpoint(self) -> dict[str, Any]:
        """Return the state after the last event, see ``systems.run.Run.checkpoint``."""
        return self._checkpoint


def record_of(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Return the one row of summary columns as plain values, None for null."""
    record = {name: values.tolist()[0] for name, values in summary.items()}
    return {
        name: None if isinstance(value, float) and value != value else value
        for name, value in record.items()
    }


def begun(
    kind: System, system: Any, limits: Limits, engine: str = "compiled", earlier: Any = None
) -> Driver:
    """Return the driver of a run of a system before its first round.

    Raises
    ------
    ValueError
        For an unknown engine, and without a limit.
    """
    if (limits.time, limits.collisions, limits.bounces) == (None, None, None):
        raise ValueError("a run needs a stop: a time or a number of impacts")
    world, overrides = kind.world(system, limits), kind.overrides(system)
    return Driver(kind.loop, world, engine, earlier, overrides)


def stream(
    kind: System,
    system: Any,
    limits: Limits,
    sink: Sink,
    engine: str = "compiled",
    wanted: Wanted = NOTHING_MORE,
    names: Collection[str] | None = None,
    interrupted: Callable[[], bool] = lambda: False,
    in_background: bool = True,
) -> Streamed:
    """Run a system until its stop, and hand over the rows of its tables as they come.

    Parameters
    ----------
    kind, system, limits, engine, wanted
        As for ``systems.run.simulate``.
    sink
        Takes rows, one call after another.
    names
        The tables that are wanted, all by default; nothing is computed for others.
    interrupted
        Asked again and again: whether the run is to end after its last event.
    in_background
        Whether the sink is called in a thread of its own, while the solver and the tables go on.

    Raises
    ------
    TooQuiet
        If there is no impact for very long.
    """
    driver = begun(kind, system, limits, engine)
    stretches = kind.stretches(driver, limits.time)
    if names is None:
        names = [table.file for table in kind.tables()]
    tell = _tell_in_background if in_background else _tell
    with _in_background(sink) if in_background else nullcontext(sink) as handed:
        tables = kind.teller(system, wanted, names, handed)
        last = tell(tables, stretches.until(interrupted))
    end, cause = last.end[0], END_NAMES[stretches.cause]
    return Streamed(
        system=system,
        engine=driver.engine,
        end_cause=cause,
        skipped=kind.skipped(last.clock, wanted, end),
        summary=tables.summary(),
        _checkpoint=checkpoint_of(cause, end, last.clock, driver.rows, stretches.state),
    )


def ahead(stretches: Iterator[Stretch]) -> Iterator[Stretch]:
    """Yield stretches, while the next one is solved in a thread of its own."""
    with ThreadPoolExecutor(1) as solver:
        coming = solver.submit(next, stretches, None)
        while (stretch := coming.result()) is not None:
            coming = solver.submit(next, stretches, None)
            yield stretch


def _tell(tables: Tables, stretches: Iterator[Stretch]) -> Stretch:
    """Tell of stretches one by one; return the last one."""
    for stretch in stretches:
        tables.take(stretch)
    return stretch


@contextmanager
def _in_background(sink: Sink) -> Iterator[Sink]:
    """Hand rows over in a thread of its own, while the next ones are made: writing takes long."""
    with ThreadPoolExecutor(1) as writer:
        under_way: list[Future[None]] = []

        def hand_over(name: str, rows: Rows) -> None:
            under_way.append(writer.submit(sink, name, rows))
            while len(under_way) > _ROWS_AHEAD:
                under_way.pop(0).result()

        yield hand_over
        for future in under_way:
            future.result()


def _tell_in_background(tables: Tables, stretches: Iterator[Stretch]) -> Stretch:
    """Tell of stretches while the next ones are solved; return the last one."""
    with ThreadPoolExecutor(1) as teller:
        under_way: list[Future[None]] = []
        for stretch in stretches:
            under_way.append(teller.submit(tables.take, stretch))
            while len(under_way) > _AHEAD:
                under_way.pop(0).result()
        for future in under_way:
            future.result()
    return stretch
