"""Make the tables and the summary of a run, stretch by stretch, for any system but the trace."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Mapping, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np

from vibro_cli.kernels.impact.laws import TRANSLATIONAL
from vibro_cli.kernels.world import END_NAMES, RUNNING
from vibro_cli.mechanics.system import ImpactSystem
from vibro_cli.systems.contract import Columns, ImpactLog, Sink, System
from vibro_cli.systems.driver import record_array
from vibro_cli.systems.request import OutputRequest, Sampling
from vibro_cli.systems.run import Gathered, Stretch
from vibro_cli.systems.tangents import TangentMap, exponent_table, grown_columns


class SystemTables:
    """Makes the tables of a run, stretch by stretch, see ``System.table_maker``.

    ``states_at`` in the system's ``tables.py`` gives the states of the bodies at the start and at
    the end, from ``initial_records`` in its ``system.py`` and from the state records of the run.
    """

    def __init__(
        self, kind: System, system: Any, wanted: OutputRequest, names: Collection[str], sink: Sink
    ) -> None:
        self._kind, self._system, self._sink = kind, system, sink
        self._states = partial(kind.part("tables").states_at, system)
        self._wants_events = "events" in names
        logs = kind.impact_logs
        self._counted = logs["collisions"].log
        self._impacts = {name: _Impacts(one, system) for name, one in logs.items() if name in names}
        self.sampling = Sampling(wanted) if "motion" in names and wanted.motion else None
        self.motion = Gathered(system) if wanted.figures else None
        self._before: Any = None
        self._begun = False
        self.tangents = TangentMap(kind, system) if wanted.lyapunov else None
        self._converging = "exponents" in names
        start = kind.part("system").initial_records(system)
        records = {
            name: record_array(rows, kind.loop.records[name]) for name, rows in start.items()
        }
        self._totals = Totals(float(np.sum(self._states(records, 0.0)["energy"])))

    def take(self, stretch: Stretch) -> None:
        """Pass the rows of a stretch to the sink."""
        ended = stretch.cause != RUNNING
        more = not ended or any(map(len, stretch.logs.values())) or not self._begun
        grown = {} if self.tangents is None else self.tangents.take(stretch)
        for name, impacts in self._impacts.items() if more else ():
            columns = impacts.take(stretch.logs)
            if name in grown:
                columns |= grown_columns(grown[name], columns["grazing"])
            self._sink(name, columns)
        if self.tangents is not None and self._converging and ended:
            self._sink("exponents", exponent_table(self.tangents))
        events = None
        if self._wants_events and more:
            events = self._kind.events(self._system, stretch.logs)
        if events is not None:
            self._sink("events", events)
        self._begun = True
        if self.sampling is not None or self.motion is not None:
            self._take_motion(stretch, ended)
        self._totals.take(stretch.logs[self._counted])
        if ended:
            cause, end = END_NAMES[stretch.cause], stretch.end[0]
            last = self._states(stretch.records, end)
            self._totals.finish(self._system, cause, end, stretch.clock, last)

    def _take_motion(self, stretch: Stretch, ended: bool) -> None:
        trajectory = self._kind.trajectory(self._system, stretch, self._before)
        if self.sampling is not None:
            for instants in self.sampling.until(stretch.end[0], ended):
                self._sink("motion", trajectory.sample(instants))
        if self.motion is not None:
            self.motion.take(trajectory, stretch.end[0])
        self._before = trajectory.last

    def summary(self) -> Columns:
        """Return the columns of ``summary.parquet``, once the run has ended."""
        values = self._kind.summary(len(self._system.bodies)).filled(self._totals)
        found = {name: _one(value) for name, value in values.items()}
        return found if self.tangents is None else found | self.tangents.summary()


def _one(value: Any) -> Any:
    """Return a value as a column of one row."""
    words = value is None or isinstance(value, str)
    return np.array([value], dtype=object if words else None)


class _Impacts:
    """The columns of a table of impacts of one run, stretch by stretch."""

    def __init__(self, kept: ImpactLog, system: Any) -> None:
        self._kept = kept
        self._systems = [system]
        self._earlier = 0
        self._before: Any = None

    def take(self, logs: Any) -> Columns:
        log, kept = logs[self._kept.log], self._kept
        run = np.zeros(len(log), dtype=np.int64)
        columns = kept.table.filled(kept.rows(self._systems, log, run, self._earlier, self._before))
        self._earlier += len(log)
        self._before = log[-1] if len(log) else self._before
        return columns


def impacts_of_runs(
    kept: ImpactLog, systems: Sequence[Any], logs: Sequence[Any]
) -> tuple[Columns, Any]:
    """Return the columns of a table of impacts of several runs, and the run index of each row.

    Words are given as integer codes.
    """
    run = np.repeat(np.arange(len(logs)), [len(log) for log in logs])
    return kept.table.filled(kept.rows(systems, np.concatenate(list(logs)), run)), run


class ImpactRows:
    """Rows of a log of impacts, from which the columns of its table are made.

    The runs of some systems are stored one after another; `run` is the run index of each row, from
    0. The first run has `earlier` rows before these, the last of which is `before`.
    """

    def __init__(
        self, systems: Sequence[Any], log: Any, run: Any, earlier: int = 0, before: Any = None
    ) -> None:
        self.run = run
        self._systems, self._log, self._earlier, self._before = systems, log, earlier, before
        self._known: dict[tuple[str, str], Any] = {}

    def __getitem__(self, name: str) -> Any:
        return self._log[name]

    def __len__(self) -> int:
        return len(self._log)

    @cached_property
    def number(self) -> Any:
        """Number of each row within its run, from 1."""
        return np.arange(1, len(self) + 1) - np.searchsorted(self.run, self.run) + self._earlier

    @property
    def between(self) -> Any:
        """Time (s) since the previous row; nan in the first row of a run."""
        rows = self._log
        between = np.full(len(rows), np.nan)
        between[1:] = np.diff(rows["t"]) + np.diff(rows["t_low"])
        between[self.number == 1] = np.nan
        if len(rows) and self._before is not None:
            before = self._before
            between[0] = (rows["t"][0] - before["t"]) + (rows["t_low"][0] - before["t_low"])
        return between

    def of_body(self, name: str, body: Any, of: str = "bodies") -> Any:
        """Return for each row a property of its body (from 0), such as ``radius``.

        With `of` it is a property of the body's entry in another sequence of the system.
        """
        if (of, name) not in self._known:
            entries = (getattr(system, of) for system in self._systems)
            self._known[of, name] = np.array([[getattr(e, name) for e in own] for own in entries])
        return self._known[of, name][self.run, body]

    def inclination(self, one: Any, other: Any) -> Any:
        """Return the cosine between the line of centres of two bodies and the plane."""
        a, b = (self.of_body("radius", body) for body in (one, other))
        return np.where(a == b, 1.0, 2.0 * np.sqrt(a * b) / np.maximum(a + b, 1e-300))


class PairRows(ImpactRows):
    """Impacts of two bodies whose line of centres lies above the line along which the law acts."""

    @abstractmethod
    def body(self, end: str) -> Any:
        """Body `a` or `b` of each row, from 0."""

    @abstractmethod
    def along(self, end: str, when: str) -> Any:
        """Speed of that body along that line (m/s), `pre` or `post` impact."""

    @cached_property
    def inclined(self) -> Any:
        """Cosine between the line of centres and the plane."""
        return self.inclination(self.body("a"), self.body("b"))

    @property
    def approach_speed(self) -> Any:
        """Approach speed along the line of centres (m/s)."""
        return self.inclined * (self.along("a", "pre") - self.along("b", "pre"))

    @property
    def separation_speed(self) -> Any:
        """Separation speed along the line of centres (m/s)."""
        return self.inclined * (self.along("b", "post") - self.along("a", "post"))

    @property
    def impulse_moment(self) -> Any:
        """J_Pb (ω_b⁺ - ω_b⁻), N m s; 0 for a point."""
        change = self.along("b", "post") - self.along("b", "pre")
        values = self.of_body("rolling_inertia", self.body("b")) * change
        radii = self.of_body("radius", self.body("b"))
        return np.divide(values, radii, out=np.zeros_like(values), where=radii > 0.0)

    @property
    def impulse(self) -> Any:
        """Impulse on body b (N s) under the translational law, B (6); nan under other laws."""
        change = self.along("b", "post") - self.along("b", "pre")
        impulses = self.of_body("mass", self.body("b")) * change
        return np.where(self["law"] == TRANSLATIONAL, impulses, np.nan)


def events_until(times: Any, instants: Any, side: str) -> Any:
    """Count the events, at ascending `times` (s), up to each instant (s).

    `side` "after" includes an event at the very instant, "before" excludes it. Raises ValueError
    for another side.
    """
    if side not in ("after", "before"):
        raise ValueError(f"side: found {side!r}, expected 'after' or 'before'")
    return np.searchsorted(times, instants, side="right" if side == "after" else "left")


def bodies_at(system: ImpactSystem, instants: Any) -> dict[str, Any]:
    """Return `t` (s), `ball` and `mass` (κ m, kg) for one row per body at each instant."""
    number = len(system.bodies)
    masses = [body.rolling_mass for body in system.bodies]
    return {
        "t": np.repeat(instants, number),
        "ball": np.tile(np.arange(1, number + 1), len(instants)),
        "mass": np.tile(masses, len(instants)),
    }


class Totals:
    """Quantities of the summary of a run, accumulated stretch by stretch."""

    def __init__(self, energy_start: float) -> None:
        self.energy_start = energy_start
        self.first_time = self.last_time = self.largest_gap = float("nan")

    def take(self, log: Any) -> None:
        """Add further impacts of two bodies."""
        if not len(log):
            return
        times = log["t"]
        if self.first_time != self.first_time:
            self.first_time = float(times[0])
        self.last_time = float(times[-1])
        self.largest_gap = float(np.nanmax([self.largest_gap, np.max(np.abs(log["gap"]))]))

    def finish(
        self,
        system: ImpactSystem,
        end_cause: str,
        end_time: float,
        clock: Mapping[str, Any],
        last: Mapping[str, Any],
    ) -> None:
        """Add the end of the run; `last` has the columns of the motion table at that time."""
        self.system, self.end_cause, self.end_time = system, end_cause, end_time
        self.clock, self.last = clock, last
        self.energy_end = float(np.sum(last["energy"]))

    @property
    def energy_drift(self) -> float:
        """Relative change of the energy if it should be conserved, else nan."""
        scale = max(self.energy_start, self.system.least_energy)
        if not (scale > 0.0 and self.system.keeps_energy(self.clock)):
            return float("nan")
        return (self.energy_end - self.energy_start) / scale
