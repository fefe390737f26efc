"""A slow twin of the solver: the same events, each of them recomputed to 40 digits.

On an arc the angle f from the lowest point of the full circle obeys ``f'' = -w^2 sin f``. In
``S = sin(f/2)``, ``C = cos(f/2)``, ``P = f'/(2w)`` that is ``S' = wPC, C' = -wPS, P' = -wSC``;
their Taylor coefficients follow from one another by products of series. On a rotating trace
``P' = w(-SC + tilt (C^2 - S^2)/2 + spread SC(C^2 - S^2))``. Neither elliptic functions nor periods
nor the energy are used.

The twin gets the list of events with approximate instants; it does not search for them. It finds
each instant by Newton's iteration on the Taylor series of the motion, and carries out crossings,
walls and impacts by an independent implementation of the formulas of the model. Since it starts
from the solver's own doubles, its results differ from the solver's tables only by the solver's
rounding errors.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from operator import mul
from typing import Any, NamedTuple

from vibro_cli.stress.oracles.scene import Path, Real, Scene, mp, speed_changes

State = tuple[Real, Real, Real]
Series = list[int]

# The nearest singularity of S, C, P in complex time is at least about pi/(2w sqrt(max(m, 1))) away,
# m = S^2 + P^2; the terms left out of a step of 0.25/w are about (0.25/1.57)^60 = 1e-48.
TERMS = 60
STEP = mp.mpf("0.25")
# Sums are of whole multiples of a unit, which is by so many bits finer than the last digit.
GUARD = 24


def product(one: Series, other: Series) -> int:
    """Return the last known coefficient of the product of two series, not yet shifted back."""
    return sum(map(mul, one, reversed(other)))


def series(
    state: Sequence[int], step: int, pull: tuple[int, int] | None, bits: int
) -> tuple[Series, Series, Series]:
    """Return the Taylor coefficients of S, C, P at 0, in shares of a step of ``w t``.

    All numbers are multiples of ``2^-bits``; ``pull`` is as in `ArcMotion`.
    """
    s, c, p = ([value] for value in state)
    sines: Series = []  # of S C and of C^2 - S^2
    cosines: Series = []
    for k in range(1, TERMS + 1):
        sines.append(product(s, c) >> bits)
        force = -sines[-1]
        if pull is not None:
            tilt, spread = pull
            cosines.append((product(c, c) - product(s, s)) >> bits)
            both = product(sines, cosines) >> bits
            force += (tilt * cosines[-1] // 2 + spread * both) >> bits
        turned, back = product(p, c) >> bits, product(p, s) >> bits
        for column, rate in ((s, turned), (c, -back), (p, force)):
            column.append((rate * step >> bits) // k)
    return s, c, p


class ArcMotion:
    """The half-angle variables of a body on an arc as functions of time; series are cached.

    Parameters
    ----------
    frequency
        ``w = sqrt(g/(kappa rho))``, 1/s.
    state
        ``(S, C, P)`` at time 0.
    pull
        ``(tilt, spread)`` of a rotating trace.
    """

    def __init__(
        self, frequency: Real, state: State, pull: tuple[Real, Real] | None = None
    ) -> None:
        self.frequency = frequency
        size = state[0] ** 2 + state[2] ** 2
        if pull is not None:
            # The distance of the singularities falls with the square root of the strongest pull.
            size += 2 * (abs(pull[0]) + abs(pull[1]))
        self._step = STEP / mp.sqrt(max(size, 1))
        # The smallest number of the start has all its digits, too.
        least = min(abs(value) for value in (*state, mp.one) if value)
        self._bits = mp.prec + GUARD - int(mp.floor(mp.log(least, 2)))
        self._pull = pull and (self._whole(pull[0]), self._whole(pull[1]))
        self._series = [self._expand([self._whole(value) for value in state])]

    def at(self, t: Real) -> State:
        """Return ``(S, C, P)`` at a time t (s) after the start, which may be slightly negative."""
        u = self.frequency * t / self._step
        number = max(int(mp.floor(u)), 0)
        while len(self._series) <= number:
            self._series.append(self._expand(self._sum(-1, 1 << self._bits)))
        s, c, p = (
            mp.ldexp(mp.mpf(value), -self._bits)
            for value in self._sum(number, self._whole(u - number))
        )
        return s, c, p

    def _whole(self, value: Real) -> int:
        return int(mp.nint(mp.ldexp(value, self._bits)))

    def _expand(self, state: Sequence[int]) -> tuple[Series, Series, Series]:
        return series(state, self._whole(self._step), self._pull, self._bits)

    def _sum(self, number: int, share: int) -> list[int]:
        sums = []
        for column in self._series[number]:
            total = 0
            for coefficient in reversed(column):
                total = (total * share >> self._bits) + coefficient
            sums.append(total)
        return sums


ENOUGH = mp.mpf(10) ** -44
# Distance beyond a piece, or depth of an overlap, above which an event has been missed.
SLACK = mp.mpf(10) ** -9


class SolverEvent(NamedTuple):
    """One event from the solver's tables; bodies are counted from 0."""

    t: float
    kind: str  # crossing, wall, impact
    a: int
    b: int = -1
    to_right: bool = True
    law: str = ""
    carried_out: bool = True


class Place(NamedTuple):
    """Place and motion of a body at an instant."""

    piece: int
    place: Real  # phi, psi or a distance
    speed: Real
    centre: tuple[Real, Real]
    tangent: tuple[Real, Real]


@dataclass(frozen=True)
class Impact:
    """One impact in high precision."""

    t: Real
    a: Place
    b: Place
    after_a: Real
    after_b: Real
    approach: Real  # along the line of centres, m/s
    crossings: int


class ReferenceSolver:
    """The motion of the bodies of a scene through given events."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.crossings = 0
        self.t = mp.zero
        self._motions: dict[int, tuple[int, Path, Real, Any]] = {}
        for ball, start in enumerate(scene.starts):
            self._begin(ball, *start)

    def _frequency(self, path: Path) -> Real:
        return mp.sqrt(self.scene.gravity / (path.body.kappa * path.rho))

    def _motion(self, path: Path, place: Real, speed: Real) -> Any:
        shape, rho = path.shape, path.rho
        if shape.sign == 0:
            return self._line_motion(path, place, speed)
        w = self._frequency(path)
        sine, cosine = mp.sin(place / 2), mp.cos(place / 2)
        # f = phi in a valley; f = psi + pi on a hump, where C = -sin(psi/2) is small at the crest.
        s, c = (sine, cosine) if shape.sign > 0 else (cosine, -sine)
        strength = self.scene.turning_square / self.scene.gravity
        pull = (shape.sign * strength * (shape.origin[0] - self.scene.axis), strength * rho)
        return ArcMotion(w, (s, c, speed / (2 * w * rho)), pull if strength else None)

    def _line_motion(self, path: Path, place: Real, speed: Real) -> Any:
        """Return a parabola; on a rotating trace ``s'' = pull + growth^2 (s - place)``."""
        body, slope = path.body, path.shape.slopes[0]
        pull = -self.scene.gravity / body.kappa * mp.sin(slope)
        square = self.scene.turning_square / body.kappa * mp.cos(slope)
        if square == 0:
            return lambda h: (place + h * (speed + h * pull / 2), speed + h * pull)
        pull += square * (path.centre(place)[0] - self.scene.axis)
        growth = mp.sqrt(square * mp.cos(slope))

        def motion(h: Real) -> tuple[Real, Real]:
            cosh, sinh = mp.cosh(growth * h), mp.sinh(growth * h) / growth
            # Avoid cosh - 1: on a line that is vertical up to rounding, the growth is tiny.
            way = speed * sinh + 2 * pull * (mp.sinh(growth * h / 2) / growth) ** 2
            return place + way, speed * cosh + pull * sinh

        return motion

    def at(self, ball: int, t: Real) -> Place:
        """Return the place and motion of a body at an instant of its present flight."""
        piece, path, start, motion = self._motions[ball]
        if path.shape.sign == 0:
            place, speed = motion(t - start)
        else:
            s, c, p = motion.at(t - start)
            half = mp.atan2(s, c) if path.shape.sign > 0 else mp.atan2(-c, s)
            middle = (path.shape.low + path.shape.high) / 4
            place = 2 * (half + 2 * mp.pi * mp.nint((middle - half) / (2 * mp.pi)))
            speed = 2 * self._frequency(path) * path.rho * p
        return Place(piece, place, speed, path.centre(place), path.tangent(place))

    def _reach(self, ball: int, goal: Real, guess: float) -> Real:
        """Return the instant at which a body reaches a place on its piece."""
        t, path = mp.mpf(guess), self._motions[ball][1]
        for _ in range(12):
            now = self.at(ball, t)
            change = (goal - now.place) / (now.speed * path.per_length)
            t += change
            if abs(change) < ENOUGH * (1 + abs(t)):
                return t
        raise ArithmeticError(f"body {ball + 1} does not come to {goal} near t = {guess}")

    def _begin(self, ball: int, piece: int, place: Real, speed: Real) -> None:
        path = Path(self.scene, ball, piece)
        self._motions[ball] = (piece, path, self.t, self._motion(path, place, speed))

    def cross(self, ball: int, to_right: bool, guess: float) -> None:
        """Move a body across the end of its piece to the next one."""
        piece = self._motions[ball][0]
        shape = self.scene.pieces[piece]
        self.t = self._reach(ball, shape.high if to_right else shape.low, guess)
        speed = self.at(ball, self.t).speed
        target = (piece + (1 if to_right else -1)) % len(self.scene.pieces)
        entered = self.scene.pieces[target]
        self._begin(ball, target, entered.low if to_right else entered.high, speed)
        self.crossings += 1

    def rebound(self, ball: int, guess: float) -> None:
        """Let a body rebound from the wall that it approaches."""
        piece, path, *_ = self._motions[ball]
        right = self.at(ball, mp.mpf(guess)).speed > 0
        goal = path.at_wall(right)
        self.t = self._reach(ball, goal, guess)
        restitution: Real = self.scene.walls[1 if right else 0]
        self._begin(ball, piece, goal, -restitution * self.at(ball, self.t).speed)

    def meet(self, a: int, b: int, guess: float) -> Real:
        """Return the instant at which two bodies touch."""
        touch = (self.scene.bodies[a].radius + self.scene.bodies[b].radius) ** 2
        t = mp.mpf(guess)
        for _ in range(14):
            pa, pb = self.at(a, t), self.at(b, t)
            dx, dy = pb.centre[0] - pa.centre[0], pb.centre[1] - pa.centre[1]
            vx = pb.speed * pb.tangent[0] - pa.speed * pa.tangent[0]
            vy = pb.speed * pb.tangent[1] - pa.speed * pa.tangent[1]
            change = (dx * dx + dy * dy - touch) / (2 * (dx * vx + dy * vy))
            t -= change
            if abs(change) < ENOUGH * (1 + abs(t)):
                return t
        raise ArithmeticError(f"bodies {a + 1}, {b + 1} do not touch near t = {guess}")

    def hit(self, happening: SolverEvent) -> Impact:
        """Carry out an impact; one that is not `carried_out` leaves the motion unchanged."""
        a, b = happening.a, happening.b
        self.t = self.meet(a, b, happening.t)
        pa, pb = self.at(a, self.t), self.at(b, self.t)
        distance = self.scene.bodies[a].radius + self.scene.bodies[b].radius
        nx = (pb.centre[0] - pa.centre[0]) / distance
        ny = (pb.centre[1] - pa.centre[1]) / distance
        ca = nx * pa.tangent[0] + ny * pa.tangent[1]
        cb = nx * pb.tangent[0] + ny * pb.tangent[1]
        wa, wb = self._law(happening.law, a, b, (ca, cb), (pa.speed, pb.speed))
        if happening.carried_out:
            self._begin(a, pa.piece, pa.place, wa)
            self._begin(b, pb.piece, pb.place, wb)
        approach = ca * pa.speed - cb * pb.speed
        return Impact(self.t, pa, pb, wa, wb, approach, self.crossings)

    def _law(
        self, law: str, a: int, b: int, along: tuple[Real, Real], speeds: tuple[Real, Real]
    ) -> tuple[Real, Real]:
        """Return the speeds after an impact.

        Laws: A (3), B (15)-(16) in omega; B (1)-(12) in v; Newton's along n.
        """
        one, two = self.scene.bodies[a], self.scene.bodies[b]
        va, vb = speeds
        across_seam = abs(a - b) > 1
        k = self.scene.restitution[-1 if across_seam else min(a, b)]
        if law == "normal-impulse":
            ca, cb = along
            ma, mb = one.kappa * one.mass, two.kappa * two.mass
            impulse = (1 + k) * (va * ca - vb * cb) / (ca**2 / ma + cb**2 / mb)
            return va - impulse * ca / ma, vb + impulse * cb / mb
        radii, masses = (one.radius, two.radius), (one.mass, two.mass)
        rolling = (one.kappa * one.mass, two.kappa * two.mass)
        changes = speed_changes(law, k, speeds, radii, masses, rolling)
        return va + changes[0], vb + changes[1]

    def check(self) -> None:
        """Raise ArithmeticError if a body is off its piece without an event, or bodies overlap."""
        places = [self.at(ball, self.t) for ball in range(len(self.scene.bodies))]
        for ball, now in enumerate(places):
            shape = self.scene.pieces[now.piece]
            if not shape.low - SLACK <= now.place <= shape.high + SLACK:
                raise ArithmeticError(f"body {ball + 1} is off its piece at t = {self.t}")
        for a in range(len(places)):
            for b in range(a):
                dx = places[a].centre[0] - places[b].centre[0]
                dy = places[a].centre[1] - places[b].centre[1]
                reach = self.scene.bodies[a].radius + self.scene.bodies[b].radius
                if mp.hypot(dx, dy) < reach - SLACK:
                    raise ArithmeticError(f"bodies {b + 1}, {a + 1} overlap at t = {self.t}")

    def follow(self, events: Iterable[SolverEvent]) -> list[Impact]:
        """Carry out events in order; return the impacts."""
        impacts = []
        for happening in events:
            before = self.t
            if happening.kind == "impact":
                impacts.append(self.hit(happening))
            elif happening.kind == "crossing":
                self.cross(happening.a, happening.to_right, happening.t)
            else:
                self.rebound(happening.a, happening.t)
            if self.t < before - SLACK:
                raise ArithmeticError(f"event {happening} precedes the one before it")
            self.check()
        return impacts


def events_of(run: Any) -> list[SolverEvent]:
    """Return the events of a run of the solver, from its tables."""
    found: list[SolverEvent] = []
    events, rows = run.events, run.collisions
    for number, kind in enumerate(events["event"]):
        if kind in ("crossing", "wall"):
            t, ball = float(events["t"][number]), int(events["ball"][number]) - 1
            right = float(events["speed"][number]) > 0.0
            found.append(SolverEvent(t, kind, ball, to_right=right))
        elif kind in ("contact_closed", "contact_opened"):
            raise NotImplementedError("the twin does not follow lasting contact")
    for number in range(len(rows["n"])):
        if rows["simultaneous"][number]:
            raise NotImplementedError("the twin does not follow simultaneous impacts")
        t = float(rows["t"][number])
        a, b = int(rows["ball_a"][number]) - 1, int(rows["ball_b"][number]) - 1
        parted = bool(rows["admissible"][number] or rows["substituted"][number])
        law = str(rows["law"][number])
        found.append(SolverEvent(t, "impact", a, b, law=law, carried_out=parted))
    # If contact and crossing coincide, the crossing comes first.
    return sorted(found, key=lambda event: (event.t, event.kind == "impact"))
