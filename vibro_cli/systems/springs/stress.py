"""Stress tests of bodies on springs: energy, time reversal, energy balance of accumulations.

The reference solves ``x' = v, v' = -w^2 (x - l x u), u' = -x v u^3`` with ``u = 1/sqrt(b^2 + x^2)``
by Taylor series in integer arithmetic, with the laws as printed in the papers. It uses neither the
solver nor the energy. Bodies in lasting contact share the weighted mean of their accelerations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.kernels.springs.world import CONTACT_CLOSED, CONTACT_OPENED
from vibro_cli.stress.oracles.motion import Series, Whole, product, real, scaled, value_of, whole
from vibro_cli.stress.oracles.scene import mp, speed_changes
from vibro_cli.stress.oracles.sensitivity import check_maps
from vibro_cli.stress.scenes import Document, Finding, Plan, solve_any
from vibro_cli.systems.run import Stretch
from vibro_cli.systems.springs.system import SpringsSystem, singular_points

ORDER = 44
# Step as a fraction of the time scale of a spring; it is shortened if the last term of a series
# exceeds `_LEFT_OUT`.
_SHARE = mp.mpf("0.4")
_LEFT_OUT = mp.mpf(2) ** -120
_NEWTON = 6  # Newton steps from a root accurate to double precision


@dataclass(frozen=True)
class SolverEvent:
    """An impact or the end of a lasting contact in the solver's run."""

    t: float
    """Time (s) found by the solver."""
    pair: int
    """Index of the left body, from 0."""
    law: str = ""
    """Law of an impact; empty for an end of contact."""
    closes: bool = False
    """Whether lasting contact begins with it."""


def solver_events(impacts: Any, states: Any, bodies: int) -> list[SolverEvent]:
    """Return the impacts and ends of contact from the logs of a run, in order."""
    found, known = [], 0
    for row in states[::bodies]:
        closes = bool(row["cause"] == CONTACT_CLOSED)
        for impact in impacts[known : row["event"]]:
            law = LAW_NAMES[impact["law"]]
            found.append(SolverEvent(float(impact["t"]), int(impact["pair"]), law, closes))
        if row["cause"] == CONTACT_OPENED:
            found.append(SolverEvent(float(row["t"]), int(row["pair"])))
        known = row["event"]
    return found


class ReferenceSolver:
    """Reference solver of bodies on springs; a state is ``x, v`` of each, x along the line."""

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

    def end_of(self, start: Sequence[Any], events: Sequence[SolverEvent], end: float) -> list[Any]:
        """Return the state at a time (s), after the `events` in between."""
        self._held = set()
        self._state = [
            [start[2 * n] - mp.mpf(spring.foot), start[2 * n + 1]]
            for n, spring in enumerate(self.springs)
        ]
        now, before = mp.zero, None
        for one in events:
            # An impact of a neighbour can end a contact; otherwise its force has vanished.
            if one.law or one.t != before:
                now = self._fly(now, mp.mpf(one.t), one)
            before = one.t
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

    def _fly(self, now: Any, until: Any, event: SolverEvent | None = None) -> Any:
        """Advance to a time, or to an event near it; return the time reached."""
        while True:
            length = self._length()
            bodies = self._expand(length)
            tail = max(abs(value) for one in bodies for value in (*one.x[-2:], *one.v[-2:]))
            share = min(mp.one, mp.root(_LEFT_OUT / max(real(tail), _LEFT_OUT), ORDER))
            last = until - now <= share * length
            if last:
                share = (until - now) / length
            place = whole(share)
            if last and event is not None:
                place = self._root(bodies, event, place)
            self._state = [[real(value_of(one, place)) for one in (b.x, b.v)] for b in bodies]
            now += real(place) * length
            if last:
                return now

    def _length(self) -> Any:
        """Return a trial step (s)."""
        longest = mp.inf
        for (x, v), spring, square in zip(self._state, self.springs, self.squares, strict=True):
            size = mp.sqrt(mp.mpf(spring.height) ** 2 + x**2)
            longest = min(longest, size / (abs(v) + mp.sqrt(square) * size))
        return _SHARE * longest

    def _expand(self, length: Any) -> list[_Body]:
        """Return the bodies with their series over a step (s)."""
        h = whole(length)
        bodies = [
            _Body(h, x, v, spring, square)
            for (x, v), spring, square in zip(self._state, self.springs, self.squares, strict=True)
        ]
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
                    bodies[n].advance(k, mean)
        return bodies

    def _groups(self) -> list[list[int]]:
        """Return the indices of the bodies of each group in lasting contact."""
        found = [[0]]
        for n in range(1, len(self.radii)):
            if n - 1 in self._held:
                found[-1].append(n)
            else:
                found.append([n])
        return found

    def _root(self, bodies: list[_Body], event: SolverEvent, place: Whole) -> Whole:
        """Return the fraction of a step at which a gap, or the force in a contact, vanishes."""
        series = self._gap(bodies, event.pair) if event.law else self._force(bodies, event.pair)
        slope = [k * value for k, value in enumerate(series)][1:]
        for _ in range(_NEWTON):
            place -= whole(real(value_of(series, place)) / real(value_of(slope, place)))
        return place

    def _gap(self, bodies: list[_Body], pair: int) -> Series:
        one, other = pair, pair + 1
        touch = 2 * mp.sqrt(self.radii[one] * self.radii[other])
        away = mp.mpf(self.springs[other].foot) - mp.mpf(self.springs[one].foot) - touch
        series = [b - a for a, b in zip(bodies[one].x, bodies[other].x, strict=True)]
        series[0] += whole(away)
        return series

    def _force(self, bodies: list[_Body], pair: int) -> Series:
        """Return the contact force of a pair, from the accelerations of the bodies to its left."""
        (group,) = [one for one in self._groups() if pair in one]
        left = [n for n in group if n <= pair]
        return [
            sum(
                scaled(whole(self.rolling[n]), bodies[n].free[k] - bodies[n].common[k])
                for n in left
            )
            for k in range(ORDER)
        ]

    def _collide(self, one: SolverEvent) -> None:
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
    """Series of one body over a step, in fractions of the step, computed order by order."""

    def __init__(self, h: Whole, x: Any, v: Any, spring: Any, square: Any) -> None:
        self.h, self.square, self.length = h, whole(square), whole(mp.mpf(spring.length))
        self.x, self.v = [whole(x)], [whole(v)]
        self.free: Series = []  # acceleration without contact forces
        self.common: Series = []  # acceleration of its group in lasting contact
        self._u = [whole(1 / mp.sqrt(mp.mpf(spring.height) ** 2 + x**2))]
        self._uu: Series = []
        self._uuu: Series = []
        self._xv: Series = []

    def force(self, k: int) -> Whole:
        """Return coefficient k of the free acceleration."""
        stretch = self.x[k] - scaled(self.length, product(self.x, self._u, k))
        self.free.append(-scaled(self.square, stretch))
        return self.free[k]

    def advance(self, k: int, acceleration: Whole) -> None:
        """Compute coefficient k + 1 of all integrated series."""
        self.common.append(acceleration)
        self._uu.append(product(self._u, self._u, k))
        self._uuu.append(product(self._uu, self._u, k))
        self._xv.append(product(self.x, self.v, k))
        self._u.append(-scaled(self.h, product(self._xv, self._uuu, k)) // (k + 1))
        self.x.append(scaled(self.h, self.v[k]) // (k + 1))
        self.v.append(scaled(self.h, acceleration) // (k + 1))


def check(plan: Plan) -> list[Finding]:
    """Check energy drift at k = 1, time reversal, singular points, balance of accumulations."""
    return [*_energy(plan), _reversal(plan), _at_rest(plan), _balance(plan)]


def _body(position: float, speed: float, shape: tuple[float, float], foot: float) -> Document:
    length, height = shape
    spring = {"stiffness": 6.0, "length": length, "height": height, "foot": foot}
    start = {"position": position, "speed": speed}
    return {"body": "disk", "radius": 0.4, "mass": 1.0, **start, "spring": spring}


def _scenes() -> dict[str, list[Document]]:
    """Bodies that meet again and again: with three singular points each, and with one."""
    heavy: Document = {"mass": 2.0}
    return {
        "three singular points (C fig. 5)": [
            _body(-4.0, 8.5, (5.0, 1.0), 0.0), _body(7.0, -2.0, (5.0, 1.5), 3.0) | heavy,
        ],
        "one singular point": [
            _body(-1.0, 2.0, (0.8, 1.0), 0.0), _body(0.5, -1.5, (1.0, 1.2), 0.4) | heavy,
        ],
    }  # fmt: skip


def _document(balls: list[Document], k: float, **stop: float) -> Document:
    document: Document = {"system": "springs", "balls": balls, "stop": stop}
    return {**document, "collision": {"k": k}} if len(balls) > 1 else document


def _energy(plan: Plan) -> list[Finding]:
    impacts = plan.amount(3_000, 100_000)
    tried = f"k = 1, {impacts} impacts each: {', '.join(_scenes())}"
    drift = Finding("relative drift of energy", tried, 1e-12)
    gap = Finding("distance left at an impact (ulp of 8 m)", tried, 8.0)
    for balls in _scenes().values():
        document = _document(balls, 1.0, collisions=impacts)
        summary = solve_any(document).summary_record()
        drift.take(abs(summary["energy_drift"]), document)
        gap.take(summary["max_gap"] / math.ulp(8.0), document)
    return [drift, gap]


def _reversal(plan: Plan) -> Finding:
    """Forward, then back with the speeds reversed, through the same impacts."""
    tried = "up to 10 s and back, through the impacts"
    error = Finding("error of return (m, m/s)", tried, 1e-12)
    for balls in _scenes().values():
        for duration in (1.0, 3.0, plan.amount(6, 10)):
            forward = solve_any(_document(balls, 1.0, time=duration), "python").sample([duration])
            back = [
                ball | {"position": float(forward["x"][n]), "speed": -float(forward["speed"][n])}
                for n, ball in enumerate(balls)
            ]
            document = _document(back, 1.0, time=duration)
            final = solve_any(document, "python").sample([duration])
            for n, ball in enumerate(balls):
                error.take(abs(float(final["x"][n]) - ball["position"]), document)
                error.take(abs(float(final["speed"][n]) + ball["speed"]), document)
    return error


def _at_rest(plan: Plan) -> Finding:
    """Check that a body at rest in a centre stays there."""
    quantity = "distance from the centre after 20 s at rest in it (m)"
    distance = Finding(quantity, "random springs", 1e-14)
    rng = np.random.default_rng([plan.seed, 5])
    for _ in range(plan.amount(10, 100)):
        shape = float(rng.uniform(0.5, 5.0)), float(rng.uniform(0.5, 5.0))
        system = solve_any(_document([_body(0.0, 0.0, shape, 0.0)], 1.0, time=0.1), "python").system
        for place, kind in singular_points(system.springs[0]):
            if kind == "centre":
                document = _document([_body(place, 0.0, shape, 0.0)], 1.0, time=20.0)
                final = solve_any(document, "python").sample([20.0])
                distance.take(abs(float(final["x"][0]) - place), document)
    return distance


def _balance(plan: Plan) -> Finding:
    """Check the energy balance of bodies pressed together: all losses must be in the table."""
    tried = "bodies pressed together, k = 0 ... 0.99"
    missing = Finding("energy lost without a row, relative", tried, 1e-12)
    for k in (0.0, 0.3, 0.6, 0.9, 0.99):
        balls = [
            _body(-1.0, 0.0, (0.5, 1.0), 0.3),
            _body(1.2, 0.0, (0.5, 1.0), -0.3) | {"mass": 1.5},
            _body(2.4, 0.0, (0.5, 1.0), 0.0) | {"mass": 0.7},
        ][: plan.amount(2, 3)]
        document = _document(balls, k, time=20.0)
        run = solve_any(document)
        summary = run.summary_record()
        lost = summary["energy_start"] - summary["energy_end"]
        found = float(np.sum(run.collisions["energy_loss"]))
        missing.take(abs(lost - found) / summary["energy_start"], document)
    return missing


def drawn(rng: np.random.Generator) -> Document:
    """Draw a random scene: two or three bodies, springs with 1 or 3 singular points, any law."""
    balls: list[Document] = []
    restitution: list[float] = []
    for number in range(int(rng.integers(2, 4))):
        place = number + float(rng.uniform(-0.04, 0.04))
        shape = float(rng.uniform(0.3, 2.5)), float(rng.uniform(0.5, 1.5))
        foot = place + float(rng.uniform(-0.8, 0.8))
        ball = _body(place, float(rng.uniform(-3.0, 3.0)), shape, foot)
        ball["spring"]["stiffness"] = float(rng.uniform(3.0, 12.0))
        radius, mass = float(rng.uniform(0.3, 0.45)), float(rng.uniform(0.5, 3.0))
        ball |= {"body": str(rng.choice(["disk", "ball"])), "radius": radius, "mass": mass}
        balls.append(ball)
        restitution.append(float(rng.choice([1.0, 0.0, rng.uniform(0.2, 1.0)])))
    collision = {"k": restitution[1:], "law": str(rng.choice(LAW_NAMES))}
    collision["inadmissible"] = "normal-impulse"
    stop = {"collisions": 4, "time": 2.0}
    return {"system": "springs", "balls": balls, "collision": collision, "stop": stop}


def check_tangent(plan: Plan) -> list[Finding]:
    """Compare tangent maps of random scenes with neighbouring motions in 50 digits."""
    tried = "bodies on springs drawn at random, up to 4 impacts, any law, lasting contact"
    return [check_maps(plan, drawn, neighbours, tried)]


def neighbours(system: Any, whole: Stretch) -> Any:
    """Return the start of a run, and a map from nearby starts through the same events."""
    events = solver_events(whole.logs["impacts"], whole.logs["states"], len(system.bodies))
    twin = ReferenceSolver(system)
    start = [number for one in system.initial for number in (one.position, one.speed)]
    return start, lambda moved: twin.end_of(moved, events, whole.end[0])
