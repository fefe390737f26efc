"""What every method offers to be measured: a run that can be repeated, and what came of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from vibro_cli.benchmark.methods.motion import Motion, State

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
