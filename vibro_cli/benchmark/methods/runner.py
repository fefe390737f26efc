"""What every method offers to be measured: a run that can be repeated, and what came of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from vibro_cli.benchmark.methods.motion import Motion, State
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.systems.driver import Driver
from vibro_cli.systems.trace import SYSTEM
from vibro_cli.systems.trace.world import make_world

_STUCK = 4


class Lost(Exception):
    """A method did not get through a motion; the message says what happened."""


@dataclass
class Course:
    """What a run left."""

    times: list[float] = field(default_factory=list)
    """Times of the first impacts (s)."""
    impacts: int = 0
    crossings: int | None = None
    energy_drift: float | None = None
    """Relative change of the energy; None where it is not to be kept."""


class Runner(ABC):
    """One method with one setting on one scene."""

    @abstractmethod
    def ready(self, impacts: int) -> None:
        """Go back to the start, for a run of so many impacts; not timed."""

    @abstractmethod
    def go(self) -> None:
        """Run; timed."""

    @abstractmethod
    def course(self) -> Course:
        """Return what the last run left; not timed."""


@dataclass(frozen=True)
class Setting:
    """How a method is set: its tolerance, or the order of a series."""

    name: str
    value: float | None = None


class Method(NamedTuple):
    """A method: its name in the table, its settings, and how it is set up for a scene."""

    name: str
    settings: tuple[Setting, ...]
    suits: Callable[[Any], bool]
    """Whether the method can be used on a scene at all."""
    prepare: Callable[[Any, Setting], Runner]
    impacts: int
    """Most impacts of a timed run."""
    repeats: bool = False
    """Whether a run begins a motion that ends anew, until it has its impacts."""


class Event(NamedTuple):
    """What ended a leg: a pair in contact, or a body at a junction (side −1 or +1)."""

    pair: int
    ball: int = -1
    side: int = 0


Leg = Callable[[tuple[int, ...], float, State], tuple[float, Sequence[float], Event]]
"""From pieces, time and state to time and state at the next event."""


class LegRunner(Runner):
    """Runs a library that stops at each event: the library goes from event to event.

    Parameters
    ----------
    motion
        What moves.
    leg
        Goes to the next event.
    """

    def __init__(self, motion: Motion, leg: Leg) -> None:
        self._motion = motion
        self._leg = leg
        self.ready(0)

    def ready(self, impacts: int) -> None:
        """Go back to the start."""
        self._wanted = impacts
        self._pieces = self._motion.pieces
        self._y = list(self._motion.start)
        self._t = 0.0
        self._times: list[float] = []
        self._crossings = 0

    def go(self) -> None:
        """Go from event to event; raises Lost when the events repeat without any progress."""
        motion, stuck = self._motion, 0
        while len(self._times) < self._wanted:
            before = self._t
            self._t, state, event = self._leg(self._pieces, self._t, self._y)
            self._y = list(state)
            if event.side:
                self._pieces = motion.cross(event.ball, event.side, self._pieces, self._y)
                self._crossings += 1
            elif motion.hit(event.pair, self._pieces, self._y):
                self._times.append(self._t)
            stuck = stuck + 1 if self._t == before else 0
            if stuck > _STUCK:
                raise Lost(f"the same event again and again at t = {self._t:.6g} s")

    def course(self) -> Course:
        """Return times, counts and drift of energy."""
        return course_of(self._motion, self._times, self._crossings, self._pieces, self._y)


def course_of(
    motion: Motion,
    times: list[float],
    crossings: int | None,
    pieces: Sequence[int],
    y: Sequence[float],
) -> Course:
    """Return what a run left that ended in a state."""
    drift = None
    if all(k == 1.0 for k in motion.restitution):
        first = motion.energy(motion.pieces, motion.start)
        drift = (motion.energy(pieces, y) - first) / first
    return Course(list(times), len(times), crossings, drift)


_FIRST = 64
"""Impacts whose times are told."""


class DriverRunner(Runner):
    """Single runs through the driver; short motions several times over.

    Parameters
    ----------
    system
        What moves.
    engine
        ``"compiled"`` or ``"python"``.
    keep
        Whether the rows of impacts and flights are kept.
    most
        Impacts after which the motion is begun again, if it ends.
    """

    def __init__(
        self, system: TraceSystem, engine: str, keep: bool = False, most: int | None = None
    ) -> None:
        self._system, self._engine, self._keep, self._most = system, engine, keep, most
        self._motion = Motion(system)

    def ready(self, impacts: int) -> None:
        """Make the records of the runs."""
        each = impacts if self._most is None else min(impacts, self._most)
        self._each = each
        self.drivers = []
        for _ in range(impacts // each):
            world = make_world(self._system, None, each)
            world.settings[0].keep = int(self._keep)
            self.drivers.append(Driver(SYSTEM.loop, world, self._engine))

    def go(self) -> None:
        """Run."""
        for driver in self.drivers:
            driver.run()

    def course(self) -> Course:
        """Return what the last of the runs left."""
        driver = self.drivers[-1]
        pieces, y = self._state(driver)
        times = self._times() if len(self.drivers) == 1 else []
        crossings = int(driver.clock_value("crossings"))
        course = course_of(self._motion, times, crossings, pieces, y)
        course.impacts = int(driver.clock_value("collisions"))
        if course.impacts < self._each:
            raise Lost(f"the run ended after {course.impacts} impacts")
        return course

    def _times(self) -> list[float]:
        """Times of the first impacts, from a run that keeps them."""
        driver = Driver(SYSTEM.loop, make_world(self._system, None, _FIRST), self._engine)
        driver.run()
        rows: Any = driver.logs["impacts"].table()
        return [float(t) for t in rows["t"]]

    def _state(self, driver: Driver) -> tuple[list[int], list[float]]:
        """Pieces, angles and rates of the bodies where their last flights began."""
        pieces, y = [], []
        for ball in range(len(self._system.bodies)):
            flight: Any = driver.world.flights[ball]
            read = flight.__getitem__ if driver.engine == "compiled" else flight.__getattribute__
            piece = int(read("piece"))
            s, c, p = (float(read(name)) for name in "scp")
            on_valley = self._motion.arcs[piece].sign > 0.0
            angle = 2.0 * (np.arctan2(s, c) if on_valley else np.arctan2(-c, s))
            w2 = abs(self._motion.w2[ball][piece])
            pieces.append(piece)
            y += [float(angle), 2.0 * float(np.sqrt(w2)) * p]
        return pieces, y
