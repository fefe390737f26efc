"""Driving the event loop with either engine, and handing a run from one to the other."""

from __future__ import annotations

from typing import Any

from vibro_cli.numerics import engine
from vibro_cli.simulation.loop import advance, start
from vibro_cli.simulation.record import Log
from vibro_cli.simulation.world import LOG_FULL, RECORDS, FlightRow, ImpactRow, World

# Room in the logs, in rows; the interpreter's are made of objects and stay small.
INTERPRETED_ROWS = 256
COMPILED_ROWS = 16384
# A run left to itself is compiled once it has had this many flights: it depends on the scenario
# alone, and below it compiling would cost more time than it saves.
COMPILE_AFTER_FLIGHTS = 8192


class Driver:
    """One run in progress."""

    def __init__(self, world: World, engine_name: str) -> None:
        self.impacts = Log(ImpactRow)
        self.flights = Log(FlightRow)
        self.engine = "numba" if engine_name == "numba" else "python"
        self._may_compile = engine_name == "auto"
        self._flights_done = 0
        self.world = _interpreted_logs(world)
        if self.engine == "numba":
            self._compile()

    def run(self) -> int:
        """Run to the end; return the cause (see ``simulation.world``)."""
        self._call(start)
        while True:
            cause = self._advance()
            self._collect()
            if cause != LOG_FULL:
                return cause
            if self._may_compile and self._flights_done >= COMPILE_AFTER_FLIGHTS:
                self._compile()

    def _call(self, function: Any, *arguments: Any) -> Any:
        if self.engine == "numba":
            function = engine.compiled(function)
        return function(self.world, *arguments)

    def _advance(self) -> int:
        return int(self._call(advance, len(self.world.impacts), len(self.world.log)))

    def _collect(self) -> None:
        impacts = int(self.clock_value("impact_rows"))
        flights = int(self.clock_value("flight_rows"))
        self.impacts.take(self.world.impacts, impacts)
        self.flights.take(self.world.log, flights)
        self._flights_done += flights
        self._reset("impact_rows")
        self._reset("flight_rows")

    def clock_value(self, name: str) -> float:
        """Return a field of the run's clock, whichever engine holds it."""
        clock: Any = self.world.clock[0]
        return float(clock[name] if self.engine == "numba" else getattr(clock, name))

    def _reset(self, name: str) -> None:
        clock: Any = self.world.clock[0]
        if self.engine == "numba":
            clock[name] = 0
        else:
            setattr(clock, name, 0)

    def _compile(self) -> None:
        self.engine = "numba"
        self._may_compile = False
        self.world = compiled_world(self.world)


def _interpreted_logs(world: World) -> World:
    room = INTERPRETED_ROWS + 4 * len(world.flights)
    return world._replace(
        impacts=engine.interpreted_rows(ImpactRow, room),
        log=engine.interpreted_rows(FlightRow, 2 * room),
    )


def compiled_world(world: World) -> World:
    """Return a world of arrays with the contents of one of interpreted records."""
    import numpy as np

    arrays = {
        name: engine.compiled_rows(getattr(world, name), cls)
        for name, cls in RECORDS.items()
        if name not in ("impacts", "log")
    }
    room = COMPILED_ROWS + 4 * len(world.flights)
    return World(
        **arrays,
        far=np.array(world.far, dtype=np.int64),  # type: ignore[arg-type]
        impacts=np.zeros(room, dtype=engine.dtype(ImpactRow)),  # type: ignore[arg-type]
        log=np.zeros(2 * room, dtype=engine.dtype(FlightRow)),  # type: ignore[arg-type]
    )
