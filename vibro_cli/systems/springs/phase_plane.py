"""The phase plane of bodies on springs: singular points, separatrix, periods, level curves.

Bodies in lasting contact move as one, so their motion is that of one point q, the displacement of
the first, in a potential: U(q) = Σ c/2 (√(b² + (q + d)²) - l)² / Σ κ m, and v² = 2 (E - U) (C (4)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibro_cli.mechanics.system import touching_distance
from vibro_cli.systems.springs.system import (
    Spring,
    SpringsSystem,
    separatrix_speed,
    singular_points,
)

TYPES = {1: "one centre", 3: "saddle between two centres (trigger)"}
"""Types of portraits by number of singular points (C, part 3)."""


def point_names(system: SpringsSystem, index: int) -> tuple[str, ...]:
    """Return the names of a body's (from 0) singular points, numbered by kind from the left."""
    kinds = [kind for _, kind in singular_points(system.springs[index])]
    return tuple(
        f"{'S' if kind == 'saddle' else 'C'}{kinds[: place + 1].count(kind)}"
        for place, kind in enumerate(kinds)
    )


def springs_record(system: SpringsSystem, index: int) -> dict[str, Any]:
    """Return the type and the singular points of a body's portrait (from 0) as plain values.

    Positions are in m along the line and from the spring's foot, energies of the spring in J. The
    greatest speed on the separatrix (m/s), reached at the centres, is None without a separatrix.
    """
    spring, body = system.springs[index], system.bodies[index]
    points = singular_points(spring)
    speed = None
    if len(points) == 3:
        speed = separatrix_speed(spring, system.frequencies[index], points[0][0])
    return {
        "ball": index + 1,
        "body": body.kind,
        "radius": body.radius,
        "type": TYPES[len(points)],
        "frequency": system.frequencies[index],
        "separatrix_speed": speed,
        "points": [
            {
                "name": name,
                "kind": kind,
                "displacement": place,
                "x": spring.foot + place,
                "energy": spring.energy(place),
                "stressed": kind == "saddle" or spring.length < spring.height,
            }
            for name, (place, kind) in zip(point_names(system, index), points, strict=True)
        ],
    }


Array = NDArray[np.float64]

_SCANNED = 4096
"""Intervals in which equilibria of several springs together are searched."""
_QUADRATURE = 128
"""Points of a quadrature that gives times to a few percent."""


class Level(NamedTuple):
    """Energy levels, each given by a state: differences of energies would lose digits."""

    place: Array
    """Displacement (m)."""
    square: Array
    """Square of the speed there (m²/s²)."""


@dataclass(frozen=True)
class SpringsLandscape:
    """Potential of bodies that move as one, over the displacement q (m) of the first."""

    springs: tuple[Spring, ...]
    offsets: tuple[float, ...]
    """Displacement of each body from its spring's foot, minus that of the first (m)."""
    mass: float
    """Σ κ m (kg)."""

    @staticmethod
    def of(system: SpringsSystem, first: int, last: int) -> SpringsLandscape:
        """Return the potential of the bodies `first` to `last` (from 0) in contact."""
        members = range(first, last + 1)
        bodies = [system.bodies[n] for n in members]
        springs = tuple(system.springs[n] for n in members)
        places = [0.0]
        for left, right in pairwise(bodies):
            places.append(places[-1] + touching_distance(left, right))
        offsets = tuple(
            place - spring.foot + springs[0].foot
            for place, spring in zip(places, springs, strict=True)
        )
        mass = sum(body.rolling_mass for body in bodies)
        return SpringsLandscape(springs, offsets, mass)

    def potential(self, q: Array) -> Array:
        """Return U(q), the energy of the springs divided by the mass (m²/s²)."""
        total = np.zeros(np.shape(q))
        for spring, offset in zip(self.springs, self.offsets, strict=True):
            stretch = np.hypot(spring.height, q + offset) - spring.length
            total = total + 0.5 * spring.stiffness / self.mass * stretch**2
        return total

    def slope(self, q: float) -> float:
        """Return dU/dq (m/s²)."""
        total = 0.0
        for spring, offset in zip(self.springs, self.offsets, strict=True):
            length = math.hypot(spring.height, q + offset)
            pull = spring.stiffness * (length - spring.length) * (q + offset) / length
            total += pull / self.mass
        return total

    @cached_property
    def level_places(self) -> Array:
        """Equilibria from left to right: minima and maxima of the potential alternate."""
        own = [
            [place - offset for place, _ in singular_points(spring)]
            for spring, offset in zip(self.springs, self.offsets, strict=True)
        ]
        if len(own) == 1:
            return np.array(own[0])
        from scipy.optimize import brentq

        # Left of all equilibria of the single springs, every spring pulls to the right.
        low, high = min(map(min, own)), max(map(max, own))
        size = abs(low) + abs(high) + self.springs[0].height
        room, least = 1e-9 * size, 1e-16 * size
        grid = np.linspace(low - room, high + room, _SCANNED + 1)
        force = np.array([self.slope(place) for place in grid.tolist()])
        changes = np.flatnonzero((force[1:] > 0.0) != (force[:-1] > 0.0))
        return np.array([brentq(self.slope, grid[n], grid[n + 1], xtol=least) for n in changes])

    @property
    def crests(self) -> Array:
        """Maxima of the potential between two minima."""
        return self.level_places[1::2]

    def energy(self, q: Array, speed: Array) -> Array:
        """Return the energy divided by the mass, v²/2 + U (m²/s²)."""
        return 0.5 * speed**2 + self.potential(q)

    def square(self, q: Array, level: Level) -> Array:
        """Return v² (m²/s²) at displacements, negative where the energy does not suffice.

        v² = v₀² − Σ c/Σκm (s − s₀)(s + s₀ − 2 l), where s − s₀ = (q − q₀)(q + q₀ + 2 d)/(s + s₀).
        """
        total = level.square + np.zeros(np.shape(q))
        for spring, offset in zip(self.springs, self.offsets, strict=True):
            x, start = q + offset, level.place + offset
            length, first = np.hypot(spring.height, x), np.hypot(spring.height, start)
            longer = (q - level.place) * (x + start) / (length + first)
            stretch = (length - spring.length) + (first - spring.length)
            total = total - spring.stiffness / self.mass * longer * stretch
        return total

    def reaches(self, q: Array, level: Level) -> tuple[Array, Array]:
        """Return the turning points to the left and right of displacements, at given energies."""
        left, right = (self._turning(q, level, side) for side in (-1.0, 1.0))
        return np.minimum(left, q), np.maximum(right, q)

    def _turning(self, q: Array, level: Level, side: float) -> Array:
        """Return the turning points of bodies that move to one side (-1 left, 1 right)."""
        barred = self._bound(level, side)
        passed = q.copy()
        free = np.ones(len(q), dtype=np.bool_)
        for place in self.level_places[:: int(side)]:
            ahead = free & (side * (place - q) > 0.0)
            stopped = ahead & (self.square(place, level) < 0.0)
            barred = np.where(stopped, place, barred)
            free &= ~stopped
            passed = np.where(ahead & ~stopped, place, passed)
        while True:
            middle = 0.5 * (passed + barred)
            between = np.minimum(passed, barred) < middle, middle < np.maximum(passed, barred)
            if not np.any(between[0] & between[1]):
                return passed
            beyond = self.square(middle, level) < 0.0
            passed, barred = np.where(beyond, passed, middle), np.where(beyond, middle, barred)

    def _bound(self, level: Level, side: float) -> Array:
        """Return a displacement beyond every turning point: one spring alone absorbs the energy."""
        double = level.square + 2.0 * self.potential(level.place)
        bounds = [
            spring.length + np.sqrt(self.mass / spring.stiffness * double) - side * offset
            for spring, offset in zip(self.springs, self.offsets, strict=True)
        ]
        bound: Array = side * np.min(bounds, axis=0)
        return bound

    def level_of(self, energy: float) -> Level:
        """Return the level of an energy divided by the mass (m²/s²)."""
        bottoms = self.level_places[::2]
        heights = self.potential(bottoms)
        lowest = np.argmin(heights)
        return Level(bottoms[lowest], 2.0 * (energy - heights[lowest]))

    def upper_half(self, level: Level, count: int) -> list[tuple[Array, Array]]:
        """Return displacements (m) and speeds (m/s, not negative) of each curve of a level.

        Each part between turning points and crests has `count` points, dense towards its ends. The
        level of a crest at rest is one curve through the crest.
        """
        bottoms = self.level_places[::2]
        reached = bottoms[self.square(bottoms, level) >= 0.0]
        low, high = self.reaches(reached, level)
        spans = dict.fromkeys(zip(low.tolist(), high.tolist(), strict=True))
        curves = []
        for left, right in spans:
            inner = [crest for crest in self.crests.tolist() if left < crest < right]
            ends = [left, *inner, right]
            bend = 0.5 - 0.5 * np.cos(np.linspace(0.0, math.pi, count))
            parts = [one + (other - one) * bend for one, other in pairwise(ends)]
            q = np.concatenate([parts[0], *(part[1:] for part in parts[1:])])
            speed = np.sqrt(np.maximum(self.square(q, level), 0.0))
            speed[0] = speed[-1] = 0.0
            curves.append((q, speed))
        return curves

    def branches(
        self, start: tuple[Array, Array], end: tuple[Array, Array], duration: Array, count: int
    ) -> tuple[Array, Array]:
        """Return the phase curves of motions without impacts, from state to state.

        `start` and `end` are displacements (m) and speeds (m/s), each of shape (motions,), and
        `duration` the times between them (s). The result, of shape (motions, count), has constant
        energy along each curve. A motion of several periods is drawn once around its closed curve
        and on to its end.
        """
        loops = _Loops.of(self, *start)
        first, sweep = loops.swept(start, end, duration)
        whole = np.floor(sweep / loops.round)
        shown = sweep - np.maximum(whole - 1.0, 0.0) * loops.round
        q, speed = loops.states(first[:, None] + shown[:, None] * np.linspace(0.0, 1.0, count))
        q[:, 0], speed[:, 0] = start
        q[:, -1], speed[:, -1] = end
        return q, speed


@dataclass(frozen=True)
class _Loops:
    """Closed level curves, each parametrised by a phase.

    The phase runs along the upper half from the left turning point to the right one, then back
    along the lower half. It grows by 1 from one turning point or crest to the next.
    """

    landscape: SpringsLandscape
    level: Level
    """Arrays of shape (loops, 1)."""
    nodes: Array
    """Turning points and the crests between them, shape (loops, nodes); crests outside a loop are
    moved to its ends."""
    marks: Array
    """Phase of each node on the upper half."""

    @staticmethod
    def of(landscape: SpringsLandscape, q: Array, speed: Array) -> _Loops:
        low, high = landscape.reaches(q, Level(q, speed**2))
        inner = np.clip(landscape.crests[None, :], low[:, None], high[:, None])
        nodes = np.column_stack([low, inner, high])
        parts = np.where(np.diff(nodes, axis=1) > 0.0, 1.0, 0.0)
        parts[:, 0] += np.where(np.sum(parts, axis=1) == 0.0, 1.0, 0.0)  # a body at rest
        marks = np.column_stack([np.zeros(len(q)), np.cumsum(parts, axis=1)])
        level = Level(q[:, None], speed[:, None] ** 2)
        return _Loops(landscape, level, nodes, marks)

    @property
    def round(self) -> Array:
        """Phase of a full turn."""
        return 2.0 * self.marks[:, -1]

    def phase(self, q: Array, speed: Array) -> Array:
        """Return the phases of states."""
        inner, end = self.nodes[:, 1:-1], self.nodes[:, -1:]
        part = np.sum((inner <= q[:, None]) & (inner < end), axis=1)  # not an empty part at the end
        left, right = self._at(self.nodes, part), self._at(self.nodes, part + 1)
        wide = np.where(right > left, right - left, 1.0)
        share = np.clip((q - left) / wide, 0.0, 1.0)
        # Half the angle, from the distances to both ends: near an end `share` has lost its digits.
        bend = 2.0 * np.arctan2(np.sqrt(share), np.sqrt(np.clip((right - q) / wide, 0.0, 1.0)))
        upper = self._at(self.marks, part) + bend / math.pi
        return np.where(speed >= 0.0, upper, self.round - upper)

    @staticmethod
    def _at(values: Array, part: NDArray[np.int64]) -> Array:
        return np.take_along_axis(values, part[:, None], axis=1)[:, 0]

    def _places(self, phase: Array) -> tuple[Array, Array]:
        """Return displacements q at phases of shape (loops, points), and |dq/dphase|."""
        turn = np.mod(phase, self.round[:, None])
        folded = np.minimum(turn, self.round[:, None] - turn)
        q = np.empty_like(phase)
        rate = np.empty_like(phase)
        for part in range(self.nodes.shape[1] - 1):
            low, high = self.nodes[:, part, None], self.nodes[:, part + 1, None]
            begins, ends = self.marks[:, part, None], self.marks[:, part + 1, None]
            angle = math.pi * (folded - begins)
            bent = low + (high - low) * np.sin(0.5 * angle) ** 2
            here = (folded >= begins) & (folded <= ends) & (ends > begins)
            q = np.where(here, bent, q)
            rate = np.where(here, 0.5 * math.pi * (high - low) * np.abs(np.sin(angle)), rate)
        return q, rate

    def states(self, phase: Array) -> tuple[Array, Array]:
        """Return displacements (m) and speeds (m/s) at phases of shape (loops, points)."""
        q, _ = self._places(phase)
        square = self.landscape.square(q, self.level)
        turn = np.mod(phase, self.round[:, None])
        back = turn > 0.5 * self.round[:, None]
        speed = np.where(back, -1.0, 1.0) * np.sqrt(np.maximum(square, 0.0))
        return q, speed

    def swept(
        self, start: tuple[Array, Array], end: tuple[Array, Array], duration: Array
    ) -> tuple[Array, Array]:
        """Return the phases at the starts, and their growth up to the ends after `duration` (s)."""
        first = self.phase(*start)
        sweep = np.mod(self.phase(*end) - first, self.round)
        turns = np.round((duration - self._time(first, sweep)) / self.period)
        return first, np.maximum(sweep + np.maximum(turns, -1.0) * self.round, 0.0)

    @cached_property
    def period(self) -> Array:
        """Time of a full turn (s); infinite at rest."""
        time = self._time(np.zeros(len(self.nodes)), self.round)
        return np.where(time > 0.0, time, math.inf)

    def _time(self, first: Array, sweep: Array) -> Array:
        """Return the time (s) of phase intervals, accurate enough to count turns."""
        share = (np.arange(_QUADRATURE) + 0.5) / _QUADRATURE
        q, rate = self._places(first[:, None] + sweep[:, None] * share)
        speed = np.sqrt(np.maximum(self.landscape.square(q, self.level), 0.0))
        paces = np.divide(rate, speed, out=np.zeros_like(rate), where=speed > 0.0)
        time: Array = np.mean(paces, axis=1) * sweep
        return time


def spring_periods(system: SpringsSystem, ball: int) -> tuple[float, float]:
    """Return periods (s) of a body (from 1) on its spring: of small and of its own oscillations.

    Small oscillations have the frequency ω₀ √(1 − b²/l²) about a centre beside the foot (l > b), or
    ω₀ √(1 − l/b) below the foot (l < b). Their period is infinite for l = b, where there is no
    linear force. The period of the body's own motion is infinite at the saddle and on its
    separatrix.
    """
    spring, rate = system.springs[ball - 1], system.frequencies[ball - 1]
    b, long = spring.height, spring.length
    share = 1.0 - (b / long) ** 2 if long > b else 1.0 - long / b
    small = 2.0 * math.pi / (rate * math.sqrt(share)) if share > 0.0 else math.inf
    state = system.initial[ball - 1]
    x = state.position - spring.foot
    resting = dict(singular_points(spring)).get(x) if state.speed == 0.0 else None
    if resting is not None:
        return small, small if resting == "centre" else math.inf
    return small, _period_through(spring, rate, x, state.speed)


_STEP = 0.2
"""Step of the sum for a period, whose error falls as exp(−π²/step)."""
_NOTHING = 1e-300
"""Fraction of b that counts as zero."""


def _period_through(spring: Spring, rate: float, x: float, speed: float) -> float:
    """Return the period (s) of the motion through a displacement (m) with a speed (m/s).

    With L = √(1 + x²), lengths in units of b, the speed is ω₀ √((A − L)(L − B)), where A = l + d,
    B = l − d, and d is the stretch at the turning points. A motion that passes the foot has
    x = o sin θ, one beside it x² = i² cos² θ + o² sin² θ, with inner and outer turning points i and
    o. The integrand over θ has a peak at 0 of width k, narrow near the separatrix; substituting
    tan θ = k sinh t makes it smooth.
    """
    b = spring.height
    x, speed, excess = x / b, speed / (rate * b), (spring.length - b) / b
    rise = x * x / (math.hypot(1.0, x) + 1.0)  # L − 1 without cancellation
    stretch = math.hypot(rise - excess, speed)
    total = stretch + abs(excess)
    less = (speed**2 + rise * (rise - 2.0 * excess)) / total if total > 0.0 else 0.0
    beyond, below = (total, less) if excess >= 0.0 else (less, total)  # A − 1, 1 − B
    if abs(below) < _NOTHING:
        return math.inf
    outer, inner = beyond * (beyond + 2.0), 0.0
    if below < 0.0:
        inner = -below * (2.0 - below)
        k = math.sqrt(inner / outer)
    else:
        width = below * (2.0 - below) if below < 1.0 else 1.0
        k = math.sqrt(width / (outer + width))
    t = _STEP * np.arange(math.ceil((math.asinh(1.0 / k) + 38.0) / _STEP))
    tangent = k * np.sinh(t)
    square = (inner + outer * tangent**2) / (1.0 + tangent**2)
    length = np.sqrt(1.0 + square)
    if below < 0.0:
        pace = 2.0 * np.sqrt((1.0 + beyond + length) * (length + 1.0 - below) / square)
    else:
        pace = 4.0 * np.sqrt((1.0 + beyond + length) / (below + square / (length + 1.0)))
    terms = pace * k * np.cosh(t) / (1.0 + tangent**2)
    return _STEP / rate * float(np.sum(terms) - 0.5 * terms[0])
