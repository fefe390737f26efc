"""A finished run: its tables, its summary, and its state at any time."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from vibro_cli.mechanics.records import NEVER
from vibro_cli.mechanics.system import System
from vibro_cli.numerics.engine import Variant
from vibro_cli.simulation.continuing import checkpoint_of, earlier_part
from vibro_cli.simulation.drive import Driver
from vibro_cli.simulation.geometry import Floats, Places
from vibro_cli.simulation.happenings import event_table
from vibro_cli.simulation.impacts import collision_table
from vibro_cli.simulation.paths import Paths
from vibro_cli.simulation.prepare import make_world
from vibro_cli.simulation.summary import summary_columns, summary_record, tally_run
from vibro_cli.simulation.turning import variant_of
from vibro_cli.simulation.world import END_NAMES, END_TIME, LOGS, World

Table = dict[str, Any]

_CLOCK_FIELDS = (
    "t", "t_low", "collisions", "crossings", "contacts", "quiet_t", "energy_correction",
    "searches", "evaluations", "skipped_apart", "last_ball",
)  # fmt: skip


@dataclass(frozen=True)
class Wanted:
    """What is to be computed beside the collisions."""

    times: tuple[float, ...] | None = None
    """Instants of the motion table (s)."""
    step: float | None = None
    """Or its step (s), to the end of the run."""
    turning_points: bool = False
    friction: float | None = None
    """Coefficient of friction of the trace; slip events where rolling needs more."""


@dataclass(frozen=True)
class Run:
    """The result of :func:`simulate_system`; every table is computed when first asked for."""

    system: System
    engine: str
    end_cause: str
    wanted: Wanted
    skipped: tuple[str, ...]
    _cause: int = field(repr=False)
    _logs: dict[str, Any] = field(repr=False)
    _clock: dict[str, float] = field(repr=False)
    _state: dict[str, Any] = field(repr=False)

    @cached_property
    def _places(self) -> Places:
        return Places(self.system)

    @property
    def _variant(self) -> Variant | None:
        return variant_of(self.system)

    @cached_property
    def world(self) -> World:
        """The records of the system, interpreted, for what is made of its logs."""
        return make_world(self.system, None, None)

    @cached_property
    def _paths(self) -> Paths:
        logs = self._logs
        return Paths(
            self._places, logs["log"], logs["segments"], self._clock["t"], self._clock["t_low"]
        )

    @cached_property
    def collisions(self) -> Table:
        """Columns of ``collisions.parquet``, a row for each impact."""
        return collision_table(self.system, self.world, self.engine, self._logs["impacts"])

    @cached_property
    def events(self) -> Table:
        """Columns of ``events.parquet``, in order of time."""
        return event_table(
            self._paths,
            self._logs["touches"],
            self._cause,
            int(self._clock["last_ball"]),
            self.wanted.turning_points,
            self.wanted.friction,
        )

    @cached_property
    def motion(self) -> Table | None:
        """Columns of ``motion.parquet``, or None if no sampled motion is asked for."""
        if self.wanted.times is not None:
            return self.sample(self.wanted.times)
        if self.wanted.step is None:
            return None
        count = int(np.floor(self._clock["t"] / self.wanted.step * (1.0 + 1e-12))) + 1
        return self.sample(self.wanted.step * np.arange(count))

    @cached_property
    def summary(self) -> Table:
        """Columns of ``summary.parquet``, one row."""
        end = self._clock["t"], self._clock["t_low"]
        outcome, finals = tally_run(
            self.world,
            self.engine,
            self._logs,
            self._state,
            self._cause,
            end,
            self._variant,
        )
        restitution = np.array([self.system.restitution])
        return summary_columns(self._places, restitution, outcome, finals)

    def summary_record(self) -> dict[str, Any]:
        """Return the summary as plain values, None for null."""
        return summary_record(self.summary)

    def sample(self, times: Any, side: str = "after") -> Table:
        """Return the motion at given times, exactly.

        Parameters
        ----------
        times
            Instants, s, any number, in any order; within the run or after its end as long as the
            last flights go on.
        side
            ``"after"`` or ``"before"`` an event that happens at just such an instant.

        Returns
        -------
        Columns ``t, ball, arc, angle, s, x, y, speed, energy``: for each time a row for each body.

        Raises
        ------
        ValueError
            For another ``side``.
        """
        return self._paths.sample(times, side)

    def flights(self) -> Table:
        """Return every flight of every body: where and when it starts and ends, and why."""
        return self._paths.table()

    def flight_curve(self, index: int, count: int) -> tuple[Floats, Floats, Floats]:
        """Return times (s), angles (rad) and rates (rad/s) at ``count`` points along a flight.

        On a line positions (m) and speeds (m/s).
        """
        return self._paths.curve(index, count)

    def checkpoint(self) -> dict[str, Any]:
        """Return the state after the last event, exact; a run continued from it has the same bits.

        Plain values: floats are written by ``json`` so that they are read back exactly.
        """
        counts = {"collisions": int(self._clock["collisions"])}
        return checkpoint_of(self.end_cause, self._clock["t"], counts, self._state)

    def history(self) -> dict[str, Any]:
        """Return the logs of the whole run, which its tables and figures are made from.

        A run continued from the checkpoint takes them up, so that it is whole too.
        """
        return dict(self._logs)

    def statistics(self) -> dict[str, int]:
        """Return what the solver did: searches, evaluations of flows, searches spared."""
        names = ("searches", "evaluations", "skipped_apart")
        return {name: int(self._clock[name]) for name in names}


def simulate_system(
    system: System,
    stop_time: float | None,
    stop_collisions: int | None,
    engine: str = "auto",
    wanted: Wanted | None = None,
    checkpoint: dict[str, Any] | None = None,
    history: dict[str, Any] | None = None,
) -> Run:
    """Run a system until its stop.

    Parameters
    ----------
    system
        What is solved.
    stop_time, stop_collisions
        Whichever comes first, s and a count; at least one.
    engine
        ``"python"``, ``"numba"`` or ``"auto"`` (interpreted at first, compiled once the run has
        proved long; both give the same bits).
    wanted
        What is to be computed beside the collisions.
    checkpoint
        From :meth:`Run.checkpoint` of the same system: the run goes on from there, as if it had
        never stopped.
    history
        From :meth:`Run.history` of the same run; it comes with the checkpoint.

    Raises
    ------
    ValueError
        For an unknown engine, without a stop, and for a checkpoint of another system.
    CannotContinue
        If the earlier run had ended for good (see ``continuing.FINAL``), or is past the stop.
    TooQuiet
        If millions of crossings follow one another without an impact.
    """
    if engine not in ("auto", "python", "numba"):
        raise ValueError(f"engine must be auto, python or numba, not {engine!r}")
    if stop_time is None and stop_collisions is None:
        raise ValueError("a run needs a stop: a time or a number of collisions")
    earlier = None
    if checkpoint is not None:
        earlier = earlier_part(checkpoint, history, LOGS, stop_time, collisions=stop_collisions)
    driver = Driver(
        make_world(system, stop_time, stop_collisions), engine, earlier, variant_of(system)
    )
    cause = driver.run()
    clock = {name: driver.clock_value(name) for name in _CLOCK_FIELDS}
    if cause == END_TIME and stop_time is not None:
        clock["t"], clock["t_low"] = stop_time, 0.0
    return Run(
        system=system,
        engine=driver.engine,
        end_cause=END_NAMES[cause],
        wanted=wanted or Wanted(),
        skipped=_skipped(clock, wanted or Wanted()),
        _cause=cause,
        _logs={name: log.table() for name, log in driver.logs.items()},
        _clock=clock,
        _state=driver.state(),
    )


def _skipped(clock: dict[str, float], wanted: Wanted) -> tuple[str, ...]:
    """Say what was not computed, and why."""
    notes = []
    apart, searches = int(clock["skipped_apart"]), int(clock["searches"])
    if apart:
        notes.append(f"{apart} of {searches} searches for a contact: the bodies are proved apart")
    if clock["quiet_t"] < NEVER:
        notes.append(f"no search after t = {clock['quiet_t']:.6g} s: no impact is possible")
    if not wanted.turning_points:
        notes.append("turning points: not asked for (output.turning_points)")
    if wanted.friction is None:
        notes.append("slip events: no coefficient of friction given (output.friction)")
    if wanted.times is None and wanted.step is None:
        notes.append("sampled motion: not asked for (output.step or output.times)")
    return tuple(notes)
