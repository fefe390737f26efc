"""The tables of a run on a trace: their columns, impacts from the log, and the summary."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from vibro_cli.compile.kernel import NO_OVERRIDES
from vibro_cli.compile.native import compiled
from vibro_cli.kernels.ensemble.records import Stack, fill_stacked
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.statistics.impact_columns import (
    EIGHTS,
    FLAGS,
    INTEGERS,
    NUMBERS,
    REGIMES,
    ROWS,
    Columns,
    Runs,
    fill_columns,
)
from vibro_cli.kernels.statistics.run_statistics import (
    FinalState,
    Outcome,
    Results,
    update_statistics,
)
from vibro_cli.kernels.world import END_NAMES, RUNNING, Flight, ImpactRow, World
from vibro_cli.mechanics.system import TraceSystem, law_keeps_energy
from vibro_cli.numerics.elementwise import Floats
from vibro_cli.systems.columns import (
    KINETIC,
    Column,
    Table,
    before_and_after,
    count,
    flag,
    impact_head,
    impact_tail,
    impulse,
    number,
    summary_balance,
    summary_head,
    word,
)
from vibro_cli.systems.contract import ImpactLog, Sink
from vibro_cli.systems.driver import called, with_logs, zeros
from vibro_cli.systems.request import OutputRequest, Sampling
from vibro_cli.systems.run import Gathered, Stretch
from vibro_cli.systems.tangents import TangentMap, exponent_table, grown_columns
from vibro_cli.systems.trace import SYSTEM
from vibro_cli.systems.trace.events import NAMES, Events, event_columns
from vibro_cli.systems.trace.motion import Paths, Places
from vibro_cli.systems.trace.world import make_world

# A greater coefficient means a normal force of zero up to rounding: no coefficient suffices.
_MOST_FRICTION = 1.0e12


def _pair(name: str, unit: str, text: str, nullable: bool = False) -> list[Column]:
    """Return the columns of a quantity of both bodies of an impact; `text` has a field for them."""
    return [number(f"{name}_{end}", unit, text.format(f"body {end}"), nullable) for end in "ab"]


_ANGLE = "angle of {} on its arc (φ in a valley, ψ on a hump; null on a line)"
_RATE = "rate φ̇ or ψ̇ of the angle of {} (null on a line)"
_ARC_LENGTH = "arc length from the trace's left end to the contact point of {}"
_ENERGY = (
    "kinetic plus potential energy of {} (potential energy from the lowest position that the "
    "centre can have on the trace)"
)
_VALUE = (
    "turning: the angle in rad (on a line, the position in m); wall: the speed before the impact "
    "in m/s; contact_closed: the duration of the preceding bounces in s; slip: the coefficient of "
    "friction; lift_off: the normal force in N, null if it ends the run; otherwise null"
)
_ITS = " (for a lasting contact, the piece of the other body)"
_REGIME = (
    "regime of {}: oscillating, or progressive (without impacts it would reach an end of the "
    "trace, or go round a closed one)"
)
_EIGHT = (
    "position of {} relative to the first figure eight from the left that encloses it: left loop, "
    "right loop, on it, or outside all of them (none: there is no figure eight)"
)
_OMEGA = "angular velocity of {}, about its contact point (null for a particle, which slides)"
SIDE = count(
    "side",
    "side of body 1 on which the bodies meet: 1 ahead of it, towards greater s, −1 behind it",
)


def collisions(sided: bool = False) -> Table:
    """Return the table of impacts; `sided` for two bodies on a closed trace."""
    columns = [
        *impact_head(),
        count("ball_a", "left body of the pair, from 1"),
        count("ball_b", "right body of the pair, from 1 (1 across the seam of a closed trace)"),
        *([SIDE] if sided else []),
        count("arc_a", "piece of the trace that body a is on, from 1"),
        count("arc_b", "piece of the trace that body b is on, from 1"),
        *_pair("angle", "rad", _ANGLE, nullable=True),
        *_pair("s", "m", _ARC_LENGTH),
        number("x_a", "m", "horizontal position of the centre of body a"),
        number("y_a", "m", "height of the centre of body a"),
        number("x_b", "m", "horizontal position of the centre of body b"),
        number("y_b", "m", "height of the centre of body b"),
        *before_and_after("rate", "rad/s", _RATE, nullable=True),
        *before_and_after("omega", "rad/s", _OMEGA, nullable=True),
        *before_and_after("speed", "m/s", "signed speed of the centre of {}"),
        *before_and_after("energy", "J", _ENERGY),
        *impact_tail(
            "energy lost in the impact; where lasting contact begins, also in all further bounces",
            "distance left between the surfaces at the time t + t_low",
            "whether other impacts were solved jointly with it, one preceded it at the same "
            "instant, or the row stands for all impacts that would follow",
        ),
        flag(
            "contact",
            "whether the bodies are in contact after it; contact may have begun before, or may be "
            "broken again at the same instant",
        ),
        *before_and_after("kinetic_energy", "J", KINETIC),
        impulse(),
        *before_and_after("regime", "", _REGIME, words=REGIMES),
        *before_and_after("eight", "", _EIGHT, words=EIGHTS),
    ]
    return Table("collisions", "one impact of one pair", tuple(columns))


EVENTS = Table(
    "events",
    "one event other than an impact",
    (
        number("t", "s", "time of the event"),
        word(
            "event",
            "crossing, turning, contact_closed, contact_opened, wall, end, lift_off or slip",
            NAMES,
        ),
        count("ball", "body concerned, from 1", nullable=True),
        count("other", "other body of the pair, from 1", nullable=True),
        count("arc_from", "piece of the trace before the event, from 1", nullable=True),
        count("arc_to", f"piece of the trace after the event, from 1{_ITS}", nullable=True),
        number("s", "m", _ARC_LENGTH.format("the body"), True),
        number("speed", "m/s", "signed speed of the centre after the event", True),
        number("value", "", _VALUE, True),
    ),
)
MOTION = Table(
    "motion",
    "the state of one body at one sampled time",
    (
        number("t", "s", "time"),
        count("ball", "body, from 1"),
        count("arc", "piece of the trace that the body is on, from 1"),
        number("angle", "rad", _ANGLE.format("the body"), nullable=True),
        number("s", "m", _ARC_LENGTH.format("the body")),
        number("x", "m", "horizontal position of the centre"),
        number("y", "m", "height of the centre"),
        number("speed", "m/s", "signed speed of the centre"),
        number("energy", "J", _ENERGY.format("the body")),
    ),
)
OTHER_TABLES = (EVENTS, MOTION)
IMPACT_LOGS: Mapping[str, ImpactLog] = {}  # a kernel makes the columns of the impacts
SUMMARY = Table(
    "summary",
    "one run",
    (
        *summary_head(
            "time, collisions, no_more_collisions, inadmissible, end_of_trace, lift_off, rest or "
            "accumulation (infinitely many impacts at one instant, which are not solved)"
        ),
        number("quiet_from", "s", "time from which no further impact was possible", True),
        count("collisions", "number of impacts", True),
        count(
            "crossings",
            "number of junctions crossed (the seam of a closed trace counts as one)",
            True,
        ),
        count("contacts", "number of lasting contacts begun", True),
        *summary_balance(
            "impact",
            gap="largest distance left between the surfaces at an impact",
        ),
        number("min_normal_force", "N", "smallest normal force of the trace on any body", True),
        number(
            "max_friction_demand",
            "",
            "largest coefficient of friction that rolling requires (null if none suffices, or if "
            "no body rolls)",
            True,
        ),
    ),
)


def final_state(ball: int | str) -> tuple[Column, ...]:
    """Return the columns of a body's final state; `ball` counts from 1."""
    return (
        count(f"arc_{ball}", f"piece of the trace that body {ball} ends on, from 1", True),
        number(f"angle_{ball}", "rad", f"final angle of body {ball} (null on a line)", True),
        number(f"s_{ball}", "m", f"final arc length of the contact point of body {ball}", True),
        number(f"speed_{ball}", "m/s", f"final signed speed of the centre of body {ball}", True),
    )


IN_ORDER = tuple(column.name for column in collisions(sided=True).columns)


class ImpactTable:
    """The `wanted` columns of a number of impacts of several runs, filled in in any order."""

    def __init__(self, rows: int, wanted: Collection[str]) -> None:
        self._rows = rows
        self._wanted = wanted
        numbers, numbers_at = self._room(NUMBERS, np.float64)
        integers, integers_at = self._room(INTEGERS, np.int64)
        flags, flags_at = self._room(FLAGS, np.bool_)
        self._columns = Columns(numbers, integers, flags, numbers_at, integers_at, flags_at)

    def _room(self, names: tuple[str, ...], kind: type) -> tuple[Any, Any]:
        """Return an array with a row per wanted column and one for all others, and row indices."""
        kept = [name for name in names if name in self._wanted]
        places = [kept.index(name) if name in kept else len(kept) for name in names]
        # An odd stride in cache lines: otherwise all columns would compete for the same few lines.
        lines = -(-self._rows * np.dtype(kind).itemsize // 64) | 1
        shape = len(kept) + 1, lines * 64 // np.dtype(kind).itemsize
        return np.empty(shape, kind), np.array(places)

    def fill(
        self,
        world: World,
        log: Any,
        runs: Runs,
        around: float,
        stack: Stack | None = None,
    ) -> None:
        """Fill in some runs of one system, whose records `world` has, of either engine.

        With a stack of systems, `world` must be compiled and is modified. For the other arguments
        see ``kernels.statistics.impact_columns``.
        """
        if stack is not None:
            compiled(fill_stacked)(world, log, runs, self._columns, around, stack)
        else:
            called(fill_columns, NO_OVERRIDES, world, log, runs, self._columns, around)

    def columns(self) -> dict[str, Any]:
        """Return the wanted columns in order; words are integer codes, and a side of 0 is null."""
        found: dict[str, Any] = {}
        columns = self._columns
        for names, room, places in (
            (NUMBERS, columns.numbers, columns.numbers_at),
            (INTEGERS, columns.integers, columns.integers_at),
            (FLAGS, columns.flags, columns.flags_at),
        ):
            found |= {
                name: room[place, : self._rows] for name, place in zip(names, places, strict=True)
            }
        return {name: found[name] for name in ("scenario", *IN_ORDER) if name in self._wanted}


def sidedness(system: TraceSystem) -> float:
    """Return the length (m) of a closed trace whose two bodies can meet on both sides, else 0."""
    two_ways = system.trace.closed and len(system.bodies) == 2
    return system.trace.length if two_ways else 0.0


def runs_of(
    system: TraceSystem, numbers: Any, counts: Any, firsts: Any, masses: Any = None
) -> Runs:
    """Return the runs of a log; without `masses`, each has the masses of the system."""
    if masses is None:
        masses = np.array([[body.mass for body in system.bodies]])
    columns: list[Any] = [np.asarray(one, dtype=np.int64) for one in (numbers, counts, firsts)]
    hills = np.empty((ROWS * len(system.bodies), 3 * len(system.trace.pieces) + 2))
    return Runs(columns[0], columns[1], columns[2], masses, hills)


class Impacts:
    """Makes the columns of ``collisions.parquet`` of a run, stretch by stretch."""

    def __init__(self, system: TraceSystem) -> None:
        self._system = system
        self._around = sidedness(system)
        self._names = [name for name in IN_ORDER if name != "side" or self._around > 0.0]
        self._count = 0
        self._before: tuple[float, float] | None = None

    def take(self, world: World, log: Any) -> dict[str, Any]:
        """Return the columns of further impacts (see :meth:`ImpactTable.fill`)."""
        table = ImpactTable(len(log), self._names)
        runs = runs_of(self._system, [0], [len(log)], [0])
        table.fill(world, log, runs, self._around)
        columns = table.columns()
        if len(log) and self._before is not None:
            t, t_low = self._before
            columns["n"] += self._count
            columns["dt"][0] = (log["t"][0] - t) + (log["t_low"][0] - t_low)
        if len(log):
            self._before = float(log["t"][-1]), float(log["t_low"][-1])
        self._count += len(log)
        return columns


class Tables:
    """Makes the tables of a run, stretch by stretch, see ``System.table_maker``."""

    motion: Gathered | None = None  # solving a million impacts again takes a second

    def __init__(
        self, system: TraceSystem, wanted: OutputRequest, names: Collection[str], sink: Sink
    ) -> None:
        self._world = make_world(system, far_apart=False)
        self._places = Places(system)
        self._system = system
        self._sink = sink
        bodies = len(system.bodies)
        self._impacts = Impacts(system) if "collisions" in names else None
        self._events = Events(bodies, wanted) if "events" in names else None
        self.sampling = Sampling(wanted) if "motion" in names and wanted.motion else None
        self._overrides = SYSTEM.overrides(system)
        self._results = Results(
            zeros(1, Outcome), zeros(bodies, FinalState), zeros(0, ImpactRow), zeros(1, Flight)
        )
        self.tangents = TangentMap(SYSTEM, system) if wanted.lyapunov else None
        self._wants_exponents = "exponents" in names
        self._waiting: dict[str, Any] = {}

    def take(self, stretch: Stretch) -> None:
        """Pass the rows of a stretch to the sink."""
        logs, known = stretch.logs, stretch.known
        loop = SYSTEM.loop
        self._world = world = with_logs(loop, self._world, stretch.engine, logs, stretch.clock)
        ended = stretch.cause != RUNNING
        grown = None
        if self.tangents is not None:
            grown = self.tangents.take(stretch)["collisions"]
            if self._wants_exponents and ended:
                self._sink("exponents", exponent_table(self.tangents))
        if self._impacts is not None and not (ended and known):
            columns = self._impacts.take(world, logs["impacts"])
            if grown is None:
                self._sink("collisions", columns)
            else:
                self._pass_impacts(columns | grown_columns(grown, columns["grazing"]))
        if ended and self._waiting:
            self._sink("collisions", self._waiting)
        of_run = known, stretch.cause, *stretch.end, self._results, 0
        called(update_statistics, self._overrides, world, *of_run)
        if self._events is None and self.sampling is None:
            return
        paths = Paths(self._places, world, stretch)
        if self._events is not None:
            self._sink("events", event_columns(self._events.take(paths)))
        if self.sampling is not None:
            for instants in self.sampling.until(stretch.end[0], ended):
                self._sink("motion", paths.sample(instants))

    def _pass_impacts(self, columns: dict[str, Any]) -> None:
        """Pass on the previous impacts, now that simultaneous ones (not smooth) are known."""
        before, self._waiting = self._waiting, columns
        if not before:
            return
        if len(columns["t"]) and columns["simultaneous"][0]:
            same = (before["t"] == columns["t"][0]) & (before["t_low"] == columns["t_low"][0])
            before["smooth"] &= ~same
        self._sink("collisions", before)

    def summary(self) -> dict[str, Any]:
        """Return the columns of ``summary.parquet``, once the run has ended."""
        restitution = np.array([self._system.restitution])
        outcomes, finals, _, _ = self._results
        columns = summary_columns(self._places, restitution, outcomes, finals)
        return columns if self.tangents is None else columns | self.tangents.summary()


def trajectory_of(system: TraceSystem, stretch: Stretch) -> Paths:
    """Return the motion in a stretch of a run, which begins with the flights in progress."""
    recorded = stretch.engine, stretch.logs, stretch.clock
    return Paths(Places(system), with_logs(SYSTEM.loop, make_world(system), *recorded), stretch)


def conserves_energy(
    places: Places, restitution: Floats, outcomes: Any
) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Return whether the impacts of each run conserve the energy of rolling.

    ``restitution`` has one row per run, with the k of each pair.
    """
    system = places.system
    ends = (system.left_end, system.right_end)
    walls = [places.of_rows(end.restitution) for end in ends if end is not None]
    lossy = sum((wall < 1.0 for wall in walls), start=np.False_)
    keeps = law_keeps_energy(system.law, places.kappa) & np.all(restitution == 1.0, axis=1)
    kept: np.ndarray[Any, np.dtype[np.bool_]] = np.where(outcomes["impacts"] > 0, keeps, True)
    kept &= ~(lossy & (outcomes["walls"] > 0))
    return kept


def summary_columns(
    places: Places, restitution: Floats, outcomes: Any, finals: Any
) -> dict[str, Any]:
    """Return the columns of ``summary.parquet`` for runs of one system.

    Initial states and masses may differ between runs. `restitution` has one row per run, with the k
    of each pair. `outcomes` (one row per run) and `finals` (one row per run and body) come from
    ``kernels.statistics.run_statistics``.
    """
    count = len(outcomes)
    finals = finals.reshape(count, -1)
    start, end = _total(finals["start_energy"]), _total(finals["end_energy"])
    kept = conserves_energy(places, restitution, outcomes) & (start > 0.0)
    demand = outcomes["most_demand"]
    # A particle slides: it needs no friction.
    rolls = np.any(places.kappa > 1.0, axis=0)
    some = outcomes["collisions"] > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        drift = np.where(kept, (end - start) / start, np.nan)
    names = np.empty(max(END_NAMES) + 1, dtype=object)
    names[list(END_NAMES)] = list(END_NAMES.values())
    columns: dict[str, Any] = {
        "status": np.full(count, "ok", dtype=object),
        "reason": np.full(count, None, dtype=object),
        "end_cause": names[outcomes["end_cause"]],
        "end_time": outcomes["end_t"].copy(),
        "quiet_from": np.where(outcomes["quiet_from"] < NEVER, outcomes["quiet_from"], np.nan),
        "collisions": outcomes["collisions"].copy(),
        "crossings": outcomes["crossings"].copy(),
        "contacts": outcomes["contacts"].copy(),
        "first_collision_time": np.where(some, outcomes["first_t"], np.nan),
        "last_collision_time": np.where(some, outcomes["last_t"], np.nan),
        "energy_start": start,
        "energy_end": end,
        "energy_drift": drift,
        "energy_correction": outcomes["correction"].copy(),
        "max_gap": np.where(some, outcomes["max_gap"], np.nan),
        "min_normal_force": np.where(
            outcomes["least_force"] < NEVER, outcomes["least_force"], np.nan
        ),
        "max_friction_demand": np.where((demand < _MOST_FRICTION) & rolls, demand, np.nan),
    }
    columns.update(_final_states(places, finals))
    return columns


def skipped(clock: Mapping[str, Any], wanted: OutputRequest, end: float) -> tuple[str, ...]:
    """Return which outputs a run with this clock and end (s) lacks, and why."""
    notes = []
    apart, searches = int(clock["skipped_apart"]), int(clock["searches"])
    if apart:
        notes.append(f"{apart} of {searches} searches for a contact: the bodies are proved apart")
    if not searches:
        notes.append("every search for a contact: none was needed")
    if clock["quiet_from"] < NEVER:
        notes.append(f"no search after t = {clock['quiet_from']:.6g} s: no impact is possible")
    if not wanted.turning_points:
        notes.append("turning points: not requested (output.turning_points)")
    if wanted.friction is None:
        notes.append("slip events: no coefficient of friction given (output.friction)")
    return (*notes, *wanted.left_out(end))


def _total(energies: Floats) -> Floats:
    """Sum energies over the bodies of each run, with a single rounding."""
    if energies.shape[1] <= 2:
        total: Floats = np.sum(energies, axis=1)
        return total
    return np.array([math.fsum(row) for row in energies.tolist()])


def _final_states(places: Places, finals: Any) -> dict[str, Any]:
    """Return ``arc_i, angle_i, s_i, speed_i`` of every body at the end."""
    columns: dict[str, Any] = {}
    for body in range(finals.shape[1]):
        state = finals[:, body]
        piece, s, c, p = (state[name].copy() for name in ("piece", "s", "c", "p"))
        number = body + 1
        columns[f"arc_{number}"] = piece + 1
        position = places.position(piece, s, c)
        columns[f"angle_{number}"] = places.angle(piece, position)
        columns[f"s_{number}"] = places.arc_length(piece, position)
        columns[f"speed_{number}"] = places.speed_factor(body, piece) * p
    return columns
