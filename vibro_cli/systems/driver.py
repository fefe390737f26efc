"""Run the event loop of a system with either engine, and empty its logs between calls.

Checkpoints are made and checked here too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from operator import attrgetter
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

from vibro_cli.compile.kernel import NO_OVERRIDES, Overrides, dtype
from vibro_cli.compile.native import compiled
from vibro_cli.errors import VibroError
from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.kernels.numerics.elliptic import fill_angles
from vibro_cli.kernels.world import LOG_FULL, ROWS_OF_EVENT, BodyData
from vibro_cli.mechanics.system import Body
from vibro_cli.progress import RUN
from vibro_cli.systems.columns import COUNTED
from vibro_cli.systems.request import FINAL, UNLIMITED, Limits

# The interpreted kernels are the bit-for-bit reference; the compiled ones are faster.
ENGINES = ("compiled", "python")
# Capacity of the logs in rows; interpreted rows are objects, which take longer than short runs.
INTERPRETED_ROWS = 32
COMPILED_ROWS = 16384
# Initial capacity of the logs of a run without a larger limit of impacts, and the factor by which
# full logs grow, up to the full capacity.
FIRST_ROWS = 256
GROWTH = 4
# Where rows are dropped, the logs stay in the processor's cache.
DROPPED_ROWS = 64
# Greatest capacity of logs that are enlarged to hold all impacts of one instant.
ROWS_AT_ONCE = 500_000
# A run is abandoned after this many rows of a log without an impact ...
QUIET_ROWS = 2_000_000
# ... or after this many steps of the search for one.
QUIET_STEPS = 50_000_000


class TooQuiet(VibroError, RuntimeError):
    """No impact for very long; the message says for how long, and until when."""

    streamed: Any = None
    """The run so far, if its tables are streamed (see ``systems.run.Streamed``)."""


class Earlier(NamedTuple):
    """The part of a run before its continuation: its state at the end, and its logs."""

    state: dict[str, Any]
    logs: dict[str, Any]


@dataclass(frozen=True)
class EventLoop:
    """The kernels of a system's event loop, and the records that they work on."""

    advance: Callable[[Any], int]
    """The event loop, a kernel; it returns ``LOG_FULL`` if it must be called again."""
    records: Mapping[str, type]
    logs: Mapping[str, str]
    """Logs, each with the field of the clock that counts its rows."""
    state: tuple[str, ...]
    """The records that change during a run, which form its state."""
    follow: Callable[..., None] | None = None
    """Kernel that carries tangent vectors through the logs. Arguments: a world with the logs of a
    stretch, how much of it is known already, the cause and the time (two doubles, s) of the end,
    the tangents (modified in place), a record of each type in ``scratch``."""
    scratch: tuple[type, ...] = ()
    start: Callable[[Any], None] | None = None
    """Kernel that is called once, before the loop."""
    enter: Callable[[Any, Overrides], int] | None = None
    """Calls the compiled loop, if more than a plain call is needed."""
    counted: Mapping[str, str] | None = None
    """Logs whose rows are also counted over the whole run, each with the clock's field for it."""
    work_done: tuple[str, ...] = ()
    """Fields of the clock that count the solver's work. A continued run counts from zero, since it
    repeats searches that a stop cut short."""
    quiet_log: tuple[str, str] | None = None
    """Log that must not grow for very long without an impact, and a noun for its rows."""
    other_stops: Mapping[str, float] | None = None
    """Settings of stops that need no impact, with their values if unset; such a stop lets
    ``quiet_log`` grow."""
    steps_at_once: int = 0
    """Number of search steps after which the loop returns even without a row."""
    quiet_cause: tuple[int, str] | None = None
    """Cause with which the loop gives up for lack of impacts, and what it counted, in words."""
    quiet_details: Callable[[Any], str] | None = None
    """Describes what in the world may be the reason for it."""
    at_once: str | None = None
    """Field of the clock that counts the impacts at the present instant. One log must hold all of
    them, unless they need more than ``ROWS_AT_ONCE`` rows."""
    hurried: str | None = None
    """Field of the clock that says that the stop changed the further course of the run."""
    finishes: bool = False
    """Whether the loop must advance from its last step to a stop by time, as
    ``settings.finishing`` requests."""


def records_of(world: type) -> dict[str, type]:
    """Return the struct of each array of records in a world; its arrays of numbers are lists."""
    hints = get_type_hints(world).items()
    return {name: get_args(hint)[0] for name, hint in hints if get_origin(hint) is Sequence}


class Driver:
    """A run in progress; ``world`` is initially a named tuple of interpreted records."""

    def __init__(
        self,
        loop: EventLoop,
        world: Any,
        engine_name: str,
        earlier: Earlier | None = None,
        overrides: Overrides = NO_OVERRIDES,
    ) -> None:
        if engine_name not in ENGINES:
            raise ValueError(f"engine: found {engine_name!r}, expected one of {', '.join(ENGINES)}")
        self._loop = loop
        self._overrides = overrides
        self._logged: dict[str, list[Any]] = {name: [] for name in loop.logs}
        self.rows = dict.fromkeys(loop.logs, 0)
        """Number of rows of each log so far."""
        self.engine = "python"
        self.world = world
        compiles = engine_name == "compiled"
        self._most_rows = _most_rows(world.settings[0]) if compiles else INTERPRETED_ROWS
        if not compiles:
            self.world = _interpreted_logs(loop, world, INTERPRETED_ROWS)
        elif earlier is None and loop.start is not None:
            # A compiled run starts interpreted, with one event at most: room for its rows.
            self.world = _interpreted_logs(loop, world, 0)
        if earlier is not None:
            for name in loop.state:
                set_rows(getattr(self.world, name), loop.records[name], earlier.state[name])
            for name, rows in earlier.logs.items():
                self._take(name, rows, len(rows))
        elif loop.start is not None:
            overrides.interpreted(loop.start)(self.world)
            self._collect()
        if compiles:
            self.engine = "compiled"
            self.world = compiled_world(loop, self.world, rows=_first_rows(world.settings[0]))

    def run(self) -> int:
        """Run to the end and return its cause; raises as :meth:`rounds`."""
        *_, cause = self.rounds()
        return cause

    def rounds(self) -> Iterator[int]:
        """Run on until the logs are full, again and again; yield ``LOG_FULL``, finally the end.

        Raises `TooQuiet` after ``QUIET_ROWS`` rows of ``quiet_log`` without an impact, after
        ``QUIET_STEPS`` steps of a search, or when the loop itself gives up.
        """
        loop = self._loop
        quiet_log = loop.quiet_log if self._needs_impacts() else None
        collisions, quiet, steps = -1.0, 0, 0
        while True:
            before = dict(self.rows)
            cause = self._advance()
            self._collect()
            RUN.report(self.clock_value("t"), int(self.clock_value("collisions")))
            if loop.quiet_cause is not None and cause == loop.quiet_cause[0]:
                raise self._too_quiet(loop.quiet_cause[1])
            if cause != LOG_FULL:
                yield cause
                return
            if quiet_log is not None:
                log, words = quiet_log
                if self.clock_value("collisions") != collisions:
                    collisions, quiet = self.clock_value("collisions"), self.rows[log]
                if self.rows[log] > quiet + QUIET_ROWS:
                    raise self._too_quiet(f"{QUIET_ROWS:,} {words}")
                steps = steps + loop.steps_at_once if self.rows == before else 0
                if steps >= QUIET_STEPS:
                    raise self._too_quiet(f"{QUIET_STEPS:,} steps of the search for one")
            yield cause
            self._enlarge()

    def _needs_impacts(self) -> bool:
        """Return whether only a stop by impacts can end the run."""
        stops = (self._loop.other_stops or {}).items()
        return all(_get(self.world.settings, name) == no_stop for name, no_stop in stops)

    def _too_quiet(self, words: str) -> TooQuiet:
        details = self._loop.quiet_details
        more = "" if details is None else f" ({details(self.world)})"
        return TooQuiet(
            f"no impact among the last {words}, until t = {self.clock_value('t'):.6g} s{more}; "
            "expected a stop.time not far beyond the last impact"
        )

    def finish(self) -> None:
        """Advance from the last step of the loop to the stop."""
        _set(self.world.settings, "finishing", 1)
        self._advance()

    def _advance(self) -> int:
        name, cause = self._loop.at_once, self._called()
        while cause == LOG_FULL and name and self.clock_value(name):
            if self._capacity() >= ROWS_AT_ONCE:
                break
            self._grow()
            cause = self._called()
        return cause

    def _capacity(self) -> int:
        return int(_get(self.world.settings, "capacity"))

    def _grow(self) -> None:
        """Double the length of the logs; their rows are kept."""
        world, loop = self.world, self._loop
        _set(world.settings, "capacity", 2 * self._capacity())
        for name in loop.logs:
            rows, record = getattr(world, name), loop.records[name]
            if self.engine == "compiled":
                grown = np.concatenate([rows, zeros(len(rows), record)])
                self.world = self.world._replace(**{name: grown})
            else:
                rows.extend([record() for _ in rows])

    def _called(self) -> int:
        loop = self._loop
        if self.engine != "compiled":
            return self._overrides.interpreted(loop.advance)(self.world)
        if loop.enter is not None:
            return loop.enter(self.world, self._overrides)
        return int(compiled(loop.advance, self._overrides)(self.world))

    def _collect(self) -> None:
        for name, used in self._loop.logs.items():
            count = int(self.clock_value(used))
            rows: Any = getattr(self.world, name)
            if count > 0 and self.engine == "compiled":
                rows = self._emptied(name, rows, count)
            self._take(name, rows, count)
            _set(self.world.clock, used, 0)
        for name, field in (self._loop.counted or {}).items():
            _set(self.world.clock, field, self.rows[name])

    def _emptied(self, name: str, rows: Any, count: int) -> Any:
        """Return the rows of a log and zero it, as the loop relies on zeros."""
        if 16 * count > len(rows):  # hand the array over without a copy
            # Fresh zero pages; zeros_like would write every field.
            self.world = self.world._replace(**{name: zeros(len(rows), self._loop.records[name])})
            return rows
        few = rows[:count].copy()  # a view would keep the whole log in memory
        rows[:count].view("u1").fill(0)
        return few

    def _enlarge(self) -> None:
        """Enlarge the logs, which are empty, to their greatest capacity."""
        settings, loop = self.world.settings, self._loop
        capacity, most = int(_get(settings, "capacity")), _capacity_for(self._most_rows, self.world)
        if capacity < most:
            capacity = min(GROWTH * capacity, most)
            _set(settings, "capacity", capacity)
            logs = {name: zeros(2 * capacity, loop.records[name]) for name in loop.logs}
            self.world = self.world._replace(**logs)

    def _take(self, name: str, rows: Any, count: int) -> None:
        """Append the first rows of a log; rows of an array are taken over without a copy."""
        if count:
            own = isinstance(rows, np.ndarray)
            taken = rows[:count] if own else record_array(rows[:count], self._loop.records[name])
            self._logged[name].append(taken)
            self.rows[name] += count

    def drain(self) -> dict[str, Any]:
        """Return and forget the rows of all logs since the last call."""
        found = {}
        for name, parts in self._logged.items():
            found[name] = joined(parts) if parts else zeros(0, self._loop.records[name])
            parts.clear()
        return found

    @property
    def waiting(self) -> int:
        """Number of rows of the longest log since the last :meth:`drain`."""
        return max(sum(map(len, parts)) for parts in self._logged.values())

    def clock_value(self, name: str) -> float:
        """Return a field of the run's clock, with either engine."""
        return float(_get(self.world.clock, name))

    def clock(self) -> dict[str, Any]:
        """Return all fields of the run's clock."""
        record = self._loop.records["clock"]
        values = plain_rows(self.world.clock, record)[0]
        return dict(zip(record.fields, values, strict=True))  # type: ignore[attr-defined]

    def state(self) -> dict[str, Any]:
        """Return the exact state of the run as plain values, see :class:`Earlier`."""
        records = self._loop.records
        values = {n: plain_rows(getattr(self.world, n), records[n]) for n in self._loop.state}
        for name in self._loop.work_done:
            values["clock"][0][tuple(records["clock"].fields).index(name)] = 0  # type: ignore[attr-defined]
        return values


def _interpreted_logs(loop: EventLoop, world: Any, rows: int) -> Any:
    capacity = _capacity_for(rows, world)
    world.settings[0].capacity = capacity
    logs = {name: [loop.records[name]() for _ in range(2 * capacity)] for name in loop.logs}
    return world._replace(**logs)


def compiled_world(
    loop: EventLoop, world: Any, logs_of: Any = None, rows: int = COMPILED_ROWS
) -> Any:
    """Return a world of arrays with the contents of a world of interpreted records.

    Its logs are new, with room for `rows` rows, or those of `logs_of`, a compiled world with as
    many bodies.
    """
    settings = world.settings[0]
    capacity = _capacity_for(min(rows, _most_rows(settings)), world)
    settings.capacity = capacity
    arrays: dict[str, Any] = {}
    for name, values in world._asdict().items():
        cls = loop.records.get(name)
        if name in loop.logs and logs_of is not None:
            arrays[name] = getattr(logs_of, name)
        elif name in loop.logs:
            arrays[name] = zeros(2 * capacity, loop.records[name])
        elif cls is not None:
            arrays[name] = record_array(values, cls)
        else:  # plain numbers
            kind = np.float64 if len(values) and isinstance(values[0], float) else np.int64
            arrays[name] = np.asarray(values, dtype=kind)
    return type(world)(**arrays)


def _capacity_for(rows: int, world: Any) -> int:
    """Return a capacity for `rows` rows and those that one event may add."""
    return rows + ROWS_OF_EVENT * len(world.bodies)


def _most_rows(settings: Any) -> int:
    """Return the greatest capacity of the logs of a compiled run, in rows."""
    return COMPILED_ROWS if getattr(settings, "keep_rows", 1) == 1 else DROPPED_ROWS


def _first_rows(settings: Any) -> int:
    """Return the initial capacity of the logs of a compiled run, in rows."""
    stops = [getattr(settings, name, UNLIMITED) for name in ("stop_collisions", "stop_bounces")]
    return COMPILED_ROWS if COMPILED_ROWS < min(stops) < UNLIMITED else FIRST_ROWS


def _get(records: Any, field: str) -> Any:
    """Return a field of the only record, in an array or a list of interpreted records."""
    return records[field][0] if isinstance(records, np.ndarray) else getattr(records[0], field)


def _set(records: Any, field: str, value: Any) -> None:
    """Set a field of the only record, in an array or a list of interpreted records."""
    if isinstance(records, np.ndarray):
        records[field] = value
    else:
        setattr(records[0], field, value)


def with_logs(
    loop: EventLoop,
    world: Any,
    engine_name: str,
    logs: Mapping[str, Any],
    clock: Mapping[str, Any] | None = None,
) -> Any:
    """Return the world of a run with these logs, for the kernels that read logs.

    It belongs to `engine_name`, ``"python"`` or ``"compiled"``; the clock of `world` is modified in
    place if it is an array. `clock` has the clock's fields when the logs were written; None leaves
    them.
    """
    compiles = engine_name == "compiled"
    if compiles and not isinstance(world.clock, np.ndarray):
        world = compiled_world(loop, world, world._replace(**logs))
    counts = {used: len(logs[name]) for name, used in loop.logs.items()}
    for field, value in {**(clock or {}), **counts}.items():
        _set(world.clock, field, value)
    if not compiles:
        logs = {name: rows_of(loop.records[name], rows.tolist()) for name, rows in logs.items()}
    return world._replace(**logs)


def called(kernel: Any, overrides: Overrides, world: Any, *arguments: Any) -> Any:
    """Call a kernel with a world of either engine, and with numbers, arrays and records.

    Records are structured arrays, or named tuples of them. The interpreter works on copies, which
    are written back.
    """
    if isinstance(world.clock, np.ndarray):
        return compiled(kernel, overrides)(world, *arguments)
    hints = _hints(kernel)[1:]
    copies = [_interpreted(one, hint) for one, hint in zip(arguments, hints, strict=False)]
    found = overrides.interpreted(kernel)(world, *copies)
    for one, copy in zip(arguments, copies, strict=True):
        _write_back(one, copy)
    return found


@cache
def _hints(of: Any) -> list[Any]:
    """Return the declared types of a kernel's parameters or of a named tuple's fields."""
    return list(get_type_hints(of).values())


def _interpreted(value: Any, hint: Any) -> Any:
    if isinstance(value, tuple):
        return type(value)(*map(_interpreted, value, _hints(type(value))))
    if isinstance(value, np.ndarray) and value.dtype.names:
        return rows_of(get_args(hint)[0], value.tolist())
    return value


def _write_back(value: Any, copy: Any) -> None:
    if isinstance(value, tuple):
        for one, its in zip(value, copy, strict=True):
            _write_back(one, its)
    elif isinstance(value, np.ndarray) and value.dtype.names:
        for place, record in enumerate(copy):
            value[place] = tuple(getattr(record, name) for name in value.dtype.names)


CHECKPOINT_FORMAT = 8


class CannotContinue(VibroError, ValueError):
    """An earlier run cannot be continued; the message says why."""


def checkpoint_of(
    end_cause: str,
    end_time: float,
    clock: Mapping[str, Any],
    rows: Mapping[str, int],
    state: Mapping[str, Any],
) -> dict[str, Any]:
    """Return a checkpoint as plain values: why and when (s) a run stopped, with its clock then.

    `rows` are the lengths of its logs, `state` its complete state after the last event.
    """
    head = {"format": CHECKPOINT_FORMAT, "end_cause": end_cause, "end_time": end_time}
    counts = {kind: int(clock[kind]) for kind in COUNTED if kind in clock}
    return {**head, **counts, "rows": dict(rows), "state": state}


def earlier_part(
    checkpoint: Mapping[str, Any],
    history: Mapping[str, Any] | None,
    loop: EventLoop,
    limits: Limits,
) -> Earlier | None:
    """Return the part of a run before its checkpoint, after checking that it can be continued.

    Returns None if the run must be solved again from its start. `limits` are those of the
    continued run. Raises `CannotContinue` if the earlier run had ended for good or is past a stop.
    """
    check_continuable(checkpoint, limits)
    if history is None or set(history) != set(loop.logs):
        raise CannotContinue("a checkpoint needs the history of its run")
    (clock,) = rows_of(loop.records["clock"], checkpoint["state"]["clock"])
    hurried = loop.hurried and getattr(clock, loop.hurried)
    return None if hurried else Earlier(checkpoint["state"], dict(history))


def check_continuable(checkpoint: Mapping[str, Any], limits: Limits) -> None:
    """Raise `CannotContinue` unless a checkpoint can be continued, see :func:`earlier_part`."""
    if checkpoint.get("format") != CHECKPOINT_FORMAT:
        raise CannotContinue("the checkpoint was written by another version")
    if checkpoint["end_cause"] in FINAL:
        raise CannotContinue(f"the run had ended for good: {checkpoint['end_cause']}")
    reached = checkpoint["end_time"]
    if limits.time is not None and limits.time <= reached:
        raise CannotContinue(f"the run is at t = {reached!r} s; expected a later stop.time")
    for kind, words in COUNTED.items():
        most = getattr(limits, kind)
        if most is not None and most <= checkpoint[kind]:
            count = checkpoint[kind]
            raise CannotContinue(f"the run has {count} {words}; expected a greater stop.{kind}")


# numpy copies records field by field. Copying bytes takes a third of the time, and `take` a
# twentieth of the time of indexing.


def zeros(count: int, cls: Any) -> Any:
    """Return an array of zeroed structs; those with lanes begin a line of the processor's cache."""
    kind = dtype(cls)
    room = np.zeros(count * kind.itemsize + cls.alignment, np.uint8)
    start = -room.ctypes.data % cls.alignment
    return room[start : start + count * kind.itemsize].view(kind)


def angles_of(y: Any, x: Any) -> Any:
    """Return the angles (rad, -pi to pi) of vectors, with the same bits on every processor.

    numpy's arctan2 differs from the C library's on processors with wide registers.
    """
    angles = np.empty(len(y))
    compiled(fill_angles)(np.ascontiguousarray(y), np.ascontiguousarray(x), angles)
    return angles


def joined(parts: Sequence[Any]) -> Any:
    """Concatenate arrays of records of one type; a single array is returned without a copy."""
    if len(parts) == 1:
        return parts[0]
    return np.concatenate([part.view(np.uint8) for part in parts]).view(parts[0].dtype)


def chosen(rows: Any, flags: Any) -> Any:
    """Return the flagged records, or rows of records."""
    return rows.take(np.flatnonzero(flags), axis=0)


def record_array(rows: Any, cls: type) -> Any:
    """Copy records of either engine into a new structured array."""
    if isinstance(rows, np.ndarray):
        return rows.copy()
    values = attrgetter(*cls.fields)  # type: ignore[attr-defined]
    return np.array([values(row) for row in rows], dtype=dtype(cls))


def plain_rows(rows: Any, cls: type) -> list[list[Any]]:
    """Return records of either engine as plain values, from which `set_rows` restores them."""
    if isinstance(rows, np.ndarray):
        return [[_plain(value) for value in row.tolist()] for row in rows]
    names = tuple(cls.fields)  # type: ignore[attr-defined]
    return [[_plain(getattr(row, name)) for name in names] for row in rows]


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    return list(value) if isinstance(value, list) else value


def rows_of(cls: type, values: Sequence[Sequence[Any]]) -> list[Any]:
    """Return new interpreted records with plain values, such as those of `plain_rows`."""
    rows = [cls() for _ in values]
    set_rows(rows, cls, values)
    return rows


def set_rows(rows: Sequence[Any], cls: type, values: Sequence[Sequence[Any]]) -> None:
    """Set interpreted records to values returned by `plain_rows`.

    Raises `ValueError` if the numbers of records or of fields differ.
    """
    names = tuple(cls.fields)  # type: ignore[attr-defined]
    if len(rows) != len(values) or any(len(value) != len(names) for value in values):
        raise ValueError(f"the state of {cls.__name__} does not belong to this scenario")
    for row, value in zip(rows, values, strict=True):
        for field, number in zip(names, value, strict=True):
            setattr(row, field, _plain(number))


def body_record(body: Body, gravity: float = 0.0) -> BodyData:
    """Return the record of a body; its weight is 0 where gravity (m/s²) plays no part."""
    data = BodyData()
    data.radius = body.radius
    data.kappa = body.kappa
    data.mass = body.mass
    data.rolling_mass = body.rolling_mass
    data.weight = body.mass * gravity
    return data


def law_and_stops(settings: Any, system: Any, limits: Limits) -> None:
    """Fill in the law and the stop by impacts, settings that all systems share."""
    settings.law = LAW_NAMES.index(system.law)
    settings.substitute = int(system.inadmissible == "normal-impulse")
    settings.stop_collisions = UNLIMITED if limits.collisions is None else limits.collisions
