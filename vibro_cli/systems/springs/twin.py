"""The motion of bodies on springs in 50 digits, told which events happen; it finds their instants.

With ``u = 1/sqrt(b^2 + x^2)``: ``x' = v, v' = -w^2 (x - l x u), u' = -x v u^3``, by Taylor series
in whole numbers, and the laws as the papers print them: nothing of the solver is used, nor the
energy. Bodies in lasting contact have the mean of their accelerations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.kernels.springs.world import CONTACT_CLOSED, CONTACT_OPENED
from vibro_cli.stress.oracles.motion import (
    Series,
    Whole,
    product,
    real,
    scaled,
    value_of,
    whole,
)
from vibro_cli.stress.oracles.pair_laws import speed_changes
from vibro_cli.stress.oracles.taylor import mp
from vibro_cli.systems.springs.system import SpringsSystem

ORDER = 44
# A step as a share of the time in which a spring can change much; it is cut where the last term
# of a series would be above this.
_SHARE = mp.mpf("0.4")
_LEFT_OUT = mp.mpf(2) ** -120
_NEWTON = 6  # steps from a root that is known in doubles


@dataclass(frozen=True)
class Told:
    """An impact of the solver's run, or the end of a lasting contact."""

    t: float
    """Its time (s), as the solver has found it."""
    pair: int
    """The left body's number, from 0."""
    law: str = ""
    """Of an impact."""
    closes: bool = False
    """Whether the bodies stay together after it."""


def told_of(impacts: Any, states: Any, bodies: int) -> list[Told]:
    """Return the impacts and ends of contact of a run from its logs, in order."""
    found, known = [], 0
    for row in states[::bodies]:
        closes = bool(row["cause"] == CONTACT_CLOSED)
        for impact in impacts[known : row["event"]]:
            law = LAW_NAMES[impact["law"]]
            found.append(Told(float(impact["t"]), int(impact["pair"]), law, closes))
        if row["cause"] == CONTACT_OPENED:
            found.append(Told(float(row["t"]), int(row["pair"])))
        known = row["event"]
    return found


class _Course(NamedTuple):
    """Series of one body over a step, in shares of it."""

    x: Series
    v: Series
    free: Series  # acceleration without its neighbours
    common: Series  # and with those it stays together with


class Twin:
    """Bodies on springs; a state is ``x, v`` of each, x along the line."""

    def __init__(self, system: SpringsSystem) -> None:
        self.radii = [mp.mpf(body.radius) for body in system.bodies]
        self.masses = [mp.mpf(body.mass) for body in system.bodies]
        self.rolling = [mp.mpf(body.kappa) * body.mass for body in system.bodies]
        self.springs = system.springs
        self.restitution = system.restitution
        self.squares = [
            mp.mpf(spring.stiffness) / mass
            for spring, mass in zip(system.springs, self.rolling, strict=True)
        ]
        self._held: set[int] = set()
        self._state: list[list[Any]] = []

    def end_of(self, start: Sequence[Any], told: Sequence[Told], end: float) -> list[Any]:
        """Return the state at a time (s); what is told happens on the way from the start."""
        self._held = set()
        self._state = [
            [start[2 * n] - mp.mpf(spring.foot), start[2 * n + 1]]
            for n, spring in enumerate(self.springs)
        ]
        now = mp.zero
        for one in told:
            now = self._fly(now, mp.mpf(one.t), one)
            if one.law:
                self._collide(one)
            else:
                self._held.remove(one.pair)
        self._fly(now, mp.mpf(end))
        return [
            number
            for (x, v), spring in zip(self._state, self.springs, strict=True)
            for number in (x + mp.mpf(spring.foot), v)
        ]

    def _fly(self, now: Any, until: Any, event: Told | None = None) -> Any:
        """Move to a time, or to an event near it; return when that is."""
        while True:
            length = self._length()
            courses = self._expand(length)
            tail = max(abs(value) for one in courses for value in (*one.x[-2:], *one.v[-2:]))
            share = min(mp.one, mp.root(_LEFT_OUT / max(real(tail), _LEFT_OUT), ORDER))
            last = until - now <= share * length
            if last:
                share = (until - now) / length
            place = whole(share)
            if last and event is not None:
                place = self._root(courses, event, place)
            self._state = [[real(value_of(one, place)) for one in (c.x, c.v)] for c in courses]
            now += real(place) * length
            if last:
                return now

    def _length(self) -> Any:
        """A step (s) that may be too long."""
        longest = mp.inf
        for (x, v), spring, square in zip(self._state, self.springs, self.squares, strict=True):
            size = mp.sqrt(mp.mpf(spring.height) ** 2 + x**2)
            longest = min(longest, size / (abs(v) + mp.sqrt(square) * size))
        return _SHARE * longest

    def _expand(self, length: Any) -> list[_Course]:
        """Series of all bodies over a step (s)."""
        h = whole(length)
        bodies = [
            _Body(h, x, v, spring, square)
            for (x, v), spring, square in zip(self._state, self.springs, self.squares, strict=True)
        ]
        common: list[Series] = [[] for _ in bodies]
        groups = self._groups()
        totals = [mp.fsum(self.rolling[n] for n in group) for group in groups]
        shares = [
            [(n, whole(self.rolling[n] / total)) for n in group]
            for group, total in zip(groups, totals, strict=True)
        ]
        for k in range(ORDER):
            free = [body.force(k) for body in bodies]
            for group in shares:
                mean = sum(scaled(share, free[n]) for n, share in group)
                for n, _ in group:
                    common[n].append(mean)
                    bodies[n].advance(k, mean)
        return [
            _Course(one.x, one.v, one.free, shared)
            for one, shared in zip(bodies, common, strict=True)
        ]

    def _groups(self) -> list[list[int]]:
        """Numbers of the bodies that stay together."""
        found = [[0]]
        for n in range(1, len(self.radii)):
            if n - 1 in self._held:
                found[-1].append(n)
            else:
                found.append([n])
        return found

    def _root(self, courses: list[_Course], event: Told, place: Whole) -> Whole:
        """Where in a step a gap, or the force in a contact, is zero."""
        series = self._gap(courses, event.pair) if event.law else self._force(courses, event.pair)
        slope = [k * value for k, value in enumerate(series)][1:]
        for _ in range(_NEWTON):
            place -= whole(real(value_of(series, place)) / real(value_of(slope, place)))
        return place

    def _gap(self, courses: list[_Course], pair: int) -> Series:
        one, other = pair, pair + 1
        touch = 2 * mp.sqrt(self.radii[one] * self.radii[other])
        away = mp.mpf(self.springs[other].foot) - mp.mpf(self.springs[one].foot) - touch
        series = [b - a for a, b in zip(courses[one].x, courses[other].x, strict=True)]
        series[0] += whole(away)
        return series

    def _force(self, courses: list[_Course], pair: int) -> Series:
        """What presses a pair together, over the mass of those to its left."""
        (group,) = [one for one in self._groups() if pair in one]
        left = [n for n in group if n <= pair]
        return [
            sum(
                scaled(whole(self.rolling[n]), courses[n].free[k] - courses[n].common[k])
                for n in left
            )
            for k in range(ORDER)
        ]

    def _collide(self, one: Told) -> None:
        pair = slice(one.pair, one.pair + 2)
        k = mp.mpf(0 if one.closes else self.restitution[one.pair])
        speeds = [state[1] for state in self._state[pair]]
        changes = speed_changes(
            one.law, k, speeds, self.radii[pair], self.masses[pair], self.rolling[pair]
        )
        for state, change in zip(self._state[pair], changes, strict=True):
            state[1] += change
        if one.closes:
            self._held.add(one.pair)


class _Body:
    """Series of a body, order by order."""

    def __init__(self, h: Whole, x: Any, v: Any, spring: Any, square: Any) -> None:
        self.h, self.square, self.length = h, whole(square), whole(mp.mpf(spring.length))
        self.x, self.v = [whole(x)], [whole(v)]
        self.free: Series = []
        self._u = [whole(1 / mp.sqrt(mp.mpf(spring.height) ** 2 + x**2))]
        self._uu: Series = []
        self._uuu: Series = []
        self._xv: Series = []

    def force(self, k: int) -> Whole:
        """Coefficient k of the free acceleration."""
        stretch = self.x[k] - scaled(self.length, product(self.x, self._u, k))
        self.free.append(-scaled(self.square, stretch))
        return self.free[k]

    def advance(self, k: int, acceleration: Whole) -> None:
        """Coefficient k + 1 of everything that is integrated."""
        self._uu.append(product(self._u, self._u, k))
        self._uuu.append(product(self._uu, self._u, k))
        self._xv.append(product(self.x, self.v, k))
        self._u.append(-scaled(self.h, product(self._xv, self._uuu, k)) // (k + 1))
        self.x.append(scaled(self.h, self.v[k]) // (k + 1))
        self.v.append(scaled(self.h, acceleration) // (k + 1))
