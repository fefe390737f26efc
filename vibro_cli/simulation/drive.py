"""Driving the event loop with either engine, and handing a run from one to the other."""

from __future__ import annotations

from typing import Any, NamedTuple

from vibro_cli.numerics import engine
from vibro_cli.numerics.engine import Variant
from vibro_cli.simulation.entry import enter_advance
from vibro_cli.simulation.loop import advance, start
from vibro_cli.simulation.record import Log, plain_rows, set_rows
from vibro_cli.simulation.world import LOG_FULL, LOGS, RECORDS, World

# The field of the clock that counts the rows used of each log.
ROWS_USED = {
    "impacts": "impact_rows",
    "log": "flight_rows",
    "touches": "contact_rows",
    "segments": "segment_rows",
}
# The records that change in a run, which are its state.
STATE = ("clock", "flights", "pairs")
# What the solver did, which a continued run counts anew: searches cut short by a stop are repeated.
WORK_DONE = ("searches", "evaluations", "skipped_apart")
# Room in the logs, in rows; the interpreter's are made of objects and stay small.
INTERPRETED_ROWS = 256
COMPILED_ROWS = 16384
# Where rows are dropped, the logs stay in the processor's cache.
DROPPED_ROWS = 64
# A run left to itself is compiled once it has had this many flights: it depends on the scenario
# alone, and below it compiling would cost more time than it saves.
COMPILE_AFTER_FLIGHTS = 8192


# So many flights without an impact are more than a log of them is worth: the run is refused.
QUIET_FLIGHTS = 2_000_000


class TooQuiet(RuntimeError):
    """A run has no impact among very many crossings; the message says how many, and until when."""


class Earlier(NamedTuple):
    """The part of a run that is continued: its state at the end, and its logs."""

    state: dict[str, Any]
    logs: dict[str, Any]


class Driver:
    """One run in progress."""

    def __init__(
        self,
        world: World,
        engine_name: str,
        earlier: Earlier | None = None,
        variant: Variant | None = None,
    ) -> None:
        self._variant = variant
        self.logs = {name: Log(RECORDS[name]) for name in LOGS}
        self.engine = "python"
        self._may_compile = engine_name == "auto"
        self.world = _interpreted_logs(world)
        if earlier is None:
            # Interpreted by either engine: for one call it is not worth compiling.
            engine.interpreted(start, variant)(self.world)
            self._collect()
        else:
            restore(self.world, earlier.state)
            for name, rows in earlier.logs.items():
                self.logs[name].take(rows, len(rows))
        if engine_name == "numba":
            self._compile()

    def run(self) -> int:
        """Run to the end; return the cause (see ``simulation.world``).

        Raises
        ------
        TooQuiet
            After ``QUIET_FLIGHTS`` flights in a row without an impact.
        """
        collisions, flights = -1.0, 0.0
        while True:
            cause = self._advance()
            self._collect()
            if cause != LOG_FULL:
                return cause
            if self.clock_value("collisions") != collisions:
                collisions = self.clock_value("collisions")
                flights = self.clock_value("flights_before")
            if self.clock_value("flights_before") > flights + QUIET_FLIGHTS:
                raise TooQuiet(
                    f"no impact among the last {QUIET_FLIGHTS:,} flights between crossings, until "
                    f"t = {self.clock_value('t'):.6g} s; expected a stop.time not far beyond the "
                    "last impact"
                )
            if self._may_compile and self.clock_value("flights_before") >= COMPILE_AFTER_FLIGHTS:
                self._compile()

    def _advance(self) -> int:
        if self.engine == "numba":
            return enter_advance(self.world, self._variant)
        return engine.interpreted(advance, self._variant)(self.world)

    def _collect(self) -> None:
        flights = 0
        for name, used in ROWS_USED.items():
            count = int(self.clock_value(used))
            self.logs[name].take(getattr(self.world, name), count)
            if count > 0 and self.engine == "numba":
                room = int(self.world.settings[0]["room"])  # type: ignore[index]
                self.world = self.world._replace(**{name: _empty_log(name, room)})
            self._set_clock(used, 0)
            if name == "log":
                flights = count
        self._set_clock("flights_before", int(self.clock_value("flights_before")) + flights)

    def clock_value(self, name: str) -> float:
        """Return a field of the run's clock, whichever engine holds it."""
        clock: Any = self.world.clock[0]
        return float(clock[name] if self.engine == "numba" else getattr(clock, name))

    def _set_clock(self, name: str, value: int) -> None:
        clock: Any = self.world.clock[0]
        if self.engine == "numba":
            clock[name] = value
        else:
            setattr(clock, name, value)

    def _compile(self) -> None:
        self.engine = "numba"
        self._may_compile = False
        self.world = compiled_world(self.world)

    def state(self) -> dict[str, Any]:
        """Return all that changes in a run, exactly, as plain values (see :func:`restore`)."""
        values = {name: plain_rows(getattr(self.world, name), RECORDS[name]) for name in STATE}
        for name in WORK_DONE:
            values["clock"][0][tuple(RECORDS["clock"].fields).index(name)] = 0
        return values


def restore(world: World, state: dict[str, Any]) -> None:
    """Put an interpreted world into a state given by :meth:`Driver.state`.

    Raises
    ------
    ValueError
        If the state does not fit the world.
    """
    for name in STATE:
        set_rows(getattr(world, name), RECORDS[name], state[name])


def _interpreted_logs(world: World) -> World:
    room = INTERPRETED_ROWS + 4 * len(world.flights)
    settings = world.settings[0]
    settings.room = room
    rows = {name: engine.interpreted_rows(RECORDS[name], 2 * room) for name in LOGS}
    return world._replace(**rows)


def _empty_log(name: str, room: int) -> Any:
    import numpy as np

    return np.zeros(2 * room, dtype=engine.dtype(RECORDS[name]))


def compiled_world(world: World, logs_of: World | None = None) -> World:
    """Return a world of arrays with the contents of one of interpreted records.

    Its logs are new, or those of another compiled world with as many bodies.
    """
    import numpy as np

    settings = world.settings[0]
    room = (COMPILED_ROWS if settings.keep == 1 else DROPPED_ROWS) + 4 * len(world.flights)
    settings.room = room
    arrays: dict[str, Any] = {
        name: engine.compiled_rows(getattr(world, name), cls)
        for name, cls in RECORDS.items()
        if name not in LOGS
    }
    logs: dict[str, Any] = {
        name: _empty_log(name, room) if logs_of is None else getattr(logs_of, name) for name in LOGS
    }
    far: Any = np.array(world.far, dtype=np.int64)
    return World(**arrays, far=far, **logs)
