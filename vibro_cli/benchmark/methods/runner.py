"""Interface of the measured methods (a repeatable run and its results), and the equations.

The equations of the model use plain numbers, as a user of an ODE solver would write them.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple

from vibro_cli.analysis.levels import Landscape
from vibro_cli.mechanics.reachability import contact_angle
from vibro_cli.mechanics.system import TraceSystem

INSIDE = 4e-16
"""Distance (rad) inside its new arc at which a body is placed after a crossing: an event function
that is zero at the start of a step would hide a return through the junction within that step."""

State = list[float]
"""Angle and rate of each body, one after the other."""


class Event(NamedTuple):
    """The event that ended a leg: a pair in contact, or a body at a junction (side −1 or +1)."""

    pair: int
    ball: int = -1
    side: int = 0


EventFunction = Callable[[float, Any], Any]
"""Function of time and state that is positive before its event."""


def _room(place: int, side: float, end: float) -> EventFunction:
    """Return the event function of a junction: the remaining angle (rad)."""
    return lambda t, y: side * (end - y[place])


@dataclass
class Course:
    """The results of a run."""

    times: list[float] = field(default_factory=list)
    """Times of the first impacts (s)."""
    impacts: int = 0
    crossings: int | None = None
    energy_drift: float | None = None
    """Relative change of the energy; None if impacts dissipate."""


class Motion:
    """Bodies on a chain of arcs in angles and rates; laws `hedrih` and `normal-impulse` only.

    On an arc φ'' = −sign w² sin φ (ψ on a hump).
    """

    def __init__(self, system: TraceSystem) -> None:
        self.system = system
        self.arcs = system.trace.pieces
        self.bodies = system.bodies
        self.law = system.law
        self.radius = [
            [piece.path_radius(body.radius) for piece in system.trace.pieces]
            for body in system.bodies
        ]
        self.w2 = [
            [arc.sign * system.gravity / (body.kappa * rho) for arc, rho in zip(
                self.arcs, radii, strict=True)]
            for body, radii in zip(system.bodies, self.radius, strict=True)
        ]  # fmt: skip
        self.pieces = tuple(start.piece for start in system.initial)
        self.start = [
            value
            for ball, start in enumerate(system.initial)
            for value in (start.position, start.speed / self.radius[ball][start.piece])
        ]
        self.ring = system.trace.closed and len(self.arcs) == 1
        count = len(system.bodies)
        self.pairs = list(pairwise(range(count)))
        if self.ring:
            self.pairs.append((count - 1, 0))  # across the top: angles continue beyond half a turn

    def least_angle(self, pair: int, piece: int) -> float:
        """Return the angle (rad) from left to right body in contact, less a turn over the top."""
        a, b = self.pairs[pair]
        radii = self.bodies[a].radius, self.bodies[b].radius
        return contact_angle(self.arcs[piece], *radii) - (math.tau if b < a else 0.0)

    def events(
        self, pieces: Sequence[int], sin: Any = math.sin, cos: Any = math.cos
    ) -> list[tuple[Event, EventFunction]]:
        """Return the events that may end a leg on these pieces, with their functions.

        The functions take numbers only, so that they can be compiled, or expressions if `sin` and
        `cos` do.
        """
        found = [
            (Event(pair), self._gap(pair, pieces, sin, cos)) for pair in range(len(self.pairs))
        ]
        for ball, side in self.junctions(pieces):
            arc = self.arcs[pieces[ball]]
            end = arc.angle_end if side > 0 else arc.angle_start
            found.append((Event(-1, ball, side), _room(2 * ball, float(side), end)))
        return found

    def _gap(self, pair: int, pieces: Sequence[int], sin: Any, cos: Any) -> EventFunction:
        """Return the event function of a pair: an angle on one arc, else d² − (r_a + r_b)²."""
        a, b = self.pairs[pair]
        i, j = 2 * a, 2 * b
        if pieces[a] == pieces[b]:
            least = self.least_angle(pair, pieces[a])
            return lambda t, y: y[j] - y[i] - least
        one, two = self.arcs[pieces[a]], self.arcs[pieces[b]]
        rho_a, rho_b = self.radius[a][pieces[a]], self.radius[b][pieces[b]]
        x, height = two.centre[0] - one.centre[0], two.centre[1] - one.centre[1]
        up_a, up_b = one.sign * rho_a, two.sign * rho_b
        touch = (self.bodies[a].radius + self.bodies[b].radius) ** 2
        return lambda t, y: (
            (x + rho_b * sin(y[j]) - rho_a * sin(y[i])) ** 2
            + (height - up_b * cos(y[j]) + up_a * cos(y[i])) ** 2
            - touch
        )

    def centre(self, ball: int, piece: int, y: Sequence[float]) -> tuple[float, float]:
        """Return the centre of a body (m)."""
        arc, rho = self.arcs[piece], self.radius[ball][piece]
        return (
            arc.centre[0] + rho * math.sin(y[2 * ball]),
            arc.centre[1] - arc.sign * rho * math.cos(y[2 * ball]),
        )

    def junctions(self, pieces: Sequence[int]) -> list[tuple[int, int]]:
        """Return the junctions that bodies may cross: (body, −1 or +1)."""
        last = len(self.arcs) - 1
        return [
            (ball, side)
            for ball, piece in enumerate(pieces)
            for side in (-1, 1)
            if 0 <= piece + side <= last
        ]

    def cross(self, ball: int, side: int, pieces: Sequence[int], y: State) -> tuple[int, ...]:
        """Move a body across a junction; return the new pieces of all bodies."""
        old, new = pieces[ball], pieces[ball] + side
        arc = self.arcs[new]
        y[2 * ball] = arc.angle_start + INSIDE if side > 0 else arc.angle_end - INSIDE
        y[2 * ball + 1] *= self.radius[ball][old] / self.radius[ball][new]
        return tuple(new if other == ball else piece for other, piece in enumerate(pieces))

    def jump(
        self, pair: int, pieces: Sequence[int], y: Sequence[float]
    ) -> tuple[float, float, float, float]:
        """Return (p, q, α, β) of an impact: c = p ω_a − q ω_b, ω_a⁺ = ω_a − α c, ω_b⁺ = ω_b + β c.

        ω are the rates of the angles, c is the closing speed; the four are constant on one arc.
        """
        a, b = self.pairs[pair]
        k = self.system.restitution_of(pair)
        rho_a, rho_b = self.radius[a][pieces[a]], self.radius[b][pieces[b]]
        one, two = self.bodies[a], self.bodies[b]
        if self.law == "hedrih":
            ja, jb = one.rolling_inertia, two.rolling_inertia
            alpha = one.radius * (1.0 + k) / (1.0 + ja / jb)
            beta = two.radius * (1.0 + k) / (1.0 + jb / ja)
            return rho_a / one.radius, rho_b / two.radius, alpha / rho_a, beta / rho_b
        ca, cb = self._along(a, b, pieces, y)
        ma, mb = one.kappa * one.mass, two.kappa * two.mass
        share = (1.0 + k) / (ca * ca / ma + cb * cb / mb)
        return rho_a * ca, rho_b * cb, share * ca / ma / rho_a, share * cb / mb / rho_b

    def jump_on_one_arc(self, pair: int, piece: int) -> tuple[float, float, float, float]:
        """Return the constant result of `jump` for a pair on one arc."""
        touching = [0.0] * (2 * len(self.bodies))
        touching[2 * self.pairs[pair][1]] = self.least_angle(pair, piece) % math.tau
        return self.jump(pair, [piece] * len(self.bodies), touching)

    def hit(self, pair: int, pieces: Sequence[int], y: State) -> bool:
        """Apply an impact to the state; return whether the bodies were approaching."""
        a, b = self.pairs[pair]
        p, q, alpha, beta = self.jump(pair, pieces, y)
        closing = p * y[2 * a + 1] - q * y[2 * b + 1]
        if closing <= 0.0:
            return False
        y[2 * a + 1] -= alpha * closing
        y[2 * b + 1] += beta * closing
        return True

    def _along(
        self, a: int, b: int, pieces: Sequence[int], y: Sequence[float]
    ) -> tuple[float, float]:
        """Return the components of the line of centres along the tangents of both paths."""
        (xa, ya), (xb, yb) = self.centre(a, pieces[a], y), self.centre(b, pieces[b], y)
        distance = math.hypot(xb - xa, yb - ya)
        nx, ny = (xb - xa) / distance, (yb - ya) / distance
        ca, cb = (
            nx * math.cos(y[2 * ball]) + ny * self.arcs[pieces[ball]].sign * math.sin(y[2 * ball])
            for ball in (a, b)
        )
        return ca, cb

    def energy(self, pieces: Sequence[int], y: Sequence[float]) -> float:
        """Return the kinetic and potential energy of all bodies (J), from their lowest places."""
        return sum(
            float(Landscape.of(self.system, ball + 1).energy(self.arcs[piece], *y[2 * ball :][:2]))
            for ball, piece in enumerate(pieces)
        )

    def course(
        self, times: list[float], crossings: int | None, pieces: Sequence[int], y: Sequence[float]
    ) -> Course:
        """Return the results of a run that ended in the state `y`."""
        drift = None
        if all(k == 1.0 for k in self.system.restitution):
            first = self.energy(self.pieces, self.start)
            drift = (self.energy(pieces, y) - first) / first
        return Course(list(times), len(times), crossings, drift)


_STUCK = 4


class Lost(Exception):
    """Raised if a method fails to compute a motion; the message says what happened."""


class Runner(ABC):
    """One method with one setting on one scene."""

    @abstractmethod
    def ready(self, impacts: int) -> None:
        """Return to the start and prepare a run of `impacts` impacts; not timed."""

    @abstractmethod
    def go(self) -> None:
        """Run; timed."""

    @abstractmethod
    def course(self) -> Course:
        """Return the results of the last run; not timed."""


@dataclass(frozen=True)
class Setting:
    """The setting of a method: its tolerance, or the order of a series."""

    name: str
    value: float = 0.0


def tolerances(*values: float) -> tuple[Setting, ...]:
    """Return the settings of an integrator."""
    return tuple(Setting(f"{value:g}", value) for value in values)


class Method(NamedTuple):
    """A method: its name in the table, its settings, and how it is set up for a scene."""

    name: str
    settings: tuple[Setting, ...]
    prepare: Callable[[Any, Setting], Runner]
    impacts: int
    """Greatest number of impacts of a timed run."""
    suits: Callable[[Any], bool] = lambda scene: True
    """Whether the method can be used on a scene."""
    repeats: bool = False
    """Whether a run restarts a motion that ends, until it has made all its impacts."""


Leg = Callable[[tuple[int, ...], float, State], tuple[float, Sequence[float], Event]]
"""Function of pieces, time and state: time and state at the next event, and the event."""


class LegRunner(Runner):
    """Runs a library that stops at each event; `leg` integrates to the next one."""

    def __init__(self, motion: Motion, leg: Leg) -> None:
        self._motion = motion
        self._leg = leg
        self.ready(0)

    def ready(self, impacts: int) -> None:
        """Return to the start."""
        self._wanted = impacts
        self._pieces = self._motion.pieces
        self._y = list(self._motion.start)
        self._t = 0.0
        self._times: list[float] = []
        self._crossings = 0

    def go(self) -> None:
        """Integrate from event to event; raise Lost if events repeat without progress."""
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
        """Return times, counts and energy drift."""
        return self._motion.course(self._times, self._crossings, self._pieces, self._y)
