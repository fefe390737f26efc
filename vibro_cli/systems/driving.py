"""Driving the event loop of a system with either engine, chunk by chunk of its logs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vibro_cli.numerics import engine
from vibro_cli.numerics.machine_code import compiled
from vibro_cli.simulation.drive import Earlier
from vibro_cli.simulation.record import Log, plain_rows, set_rows

INTERPRETED_ROWS = 256
COMPILED_ROWS = 16384
# An event adds at most so many rows for each body.
ROWS_OF_AN_EVENT = 8
# A run left to itself is compiled once its loop has come back this often, with full logs or after
# so much work: it depends on the scenario alone.
COMPILE_AFTER = 16


@dataclass(frozen=True)
class Library:
    """What a system's kernels are called by."""

    advance: Callable[[Any], int]
    """The event loop; it returns ``log_full`` when it is to be called again."""
    records: Mapping[str, type]
    logs: Mapping[str, str]
    """Logs, and the field of the clock that counts their rows."""
    log_full: int
    state: tuple[str, ...]
    """The records that change in a run, which are its state."""


class Driver:
    """One run in progress; its ``world`` is a named tuple of interpreted records at first."""

    def __init__(
        self, library: Library, world: Any, engine_name: str, earlier: Earlier | None = None
    ) -> None:
        if engine_name not in ("auto", "python", "numba"):
            raise ValueError(f"engine must be auto, python or numba, not {engine_name!r}")
        self._library = library
        self.logs = {name: Log(library.records[name]) for name in library.logs}
        self.engine = "python"
        self._may_compile = engine_name == "auto"
        self._rounds = 0
        self.world = world
        if earlier is not None:
            self._take_up(earlier)
        self._make_room(self._room(INTERPRETED_ROWS))
        if engine_name == "numba":
            self._compile()

    def _take_up(self, earlier: Earlier) -> None:
        """Go on where an earlier run has stopped."""
        for name in self._library.state:
            rows = getattr(self.world, name)
            set_rows(rows, self._library.records[name], earlier.state[name])
        for name, rows in earlier.logs.items():
            self.logs[name].take(rows, len(rows))

    def state(self) -> dict[str, Any]:
        """Return all that changes in a run, exactly, as plain values."""
        records = self._library.records
        return {n: plain_rows(getattr(self.world, n), records[n]) for n in self._library.state}

    def finish(self) -> None:
        """Have the loop go on from its last step to the stop, which `settings.finishing` asks."""
        settings: Any = self.world.settings[0]
        if self.engine == "numba":
            settings["finishing"] = 1
        else:
            settings.finishing = 1
        self._advance()

    def run(self) -> int:
        """Run to the end; return the cause."""
        while True:
            cause = self._advance()
            self._collect()
            if cause != self._library.log_full:
                return cause
            self._rounds += 1
            if self._may_compile and self._rounds >= COMPILE_AFTER:
                self._compile()

    def _advance(self) -> int:
        if self.engine == "numba":
            return int(compiled(self._library.advance)(self.world))
        return self._library.advance(self.world)

    def value(self, name: str) -> float:
        """Return a field of the run's clock, whichever engine holds it."""
        clock: Any = self.world.clock[0]
        return float(clock[name] if self.engine == "numba" else getattr(clock, name))

    def clock(self) -> dict[str, float]:
        """Return all fields of the run's clock."""
        names = self._library.records["clock"].fields  # type: ignore[attr-defined]
        return {name: self.value(name) for name in names}

    def _collect(self) -> None:
        clock: Any = self.world.clock[0]
        for name, used in self._library.logs.items():
            count = int(self.value(used))
            rows = getattr(self.world, name)
            if self.engine == "numba":
                clock[used] = 0
                room = self._room(COMPILED_ROWS)
                if 4 * count > room:
                    self._replace_log(name, room)
                else:
                    rows = rows[:count].copy()  # a few rows do not keep a whole log
            else:
                setattr(clock, used, 0)
            self.logs[name].take(rows, count)

    def _replace_log(self, name: str, room: int) -> None:
        kind = engine.dtype(self._library.records[name])
        self.world = self.world._replace(**{name: np.zeros(2 * room, dtype=kind)})

    def _room(self, rows: int) -> int:
        """So many rows, or as many as one event may add."""
        return max(rows, ROWS_OF_AN_EVENT * len(self.world.bodies))

    def _make_room(self, room: int) -> None:
        self.world.settings[0].room = room
        records = self._library.records
        rows = {n: engine.interpreted_rows(records[n], 2 * room) for n in self._library.logs}
        self.world = self.world._replace(**rows)

    def _compile(self) -> None:
        self._may_compile = False
        self.engine = "numba"
        room = self._room(COMPILED_ROWS)
        self.world.settings[0].room = room
        arrays: dict[str, Any] = {}
        for name, rows in self.world._asdict().items():
            cls = self._library.records.get(name)
            if name in self._library.logs:
                arrays[name] = np.zeros(2 * room, dtype=engine.dtype(cls))
            elif cls is None:
                kind = np.float64 if isinstance(rows[0], float) else np.int64
                arrays[name] = np.array(rows, dtype=kind)
            else:
                arrays[name] = engine.compiled_rows(rows, cls)
        self.world = type(self.world)(**arrays)
