"""A slow twin of the solver: the same events, every one of them recomputed to 40 digits.

The twin is told which events happen and, to a few digits, when; it never looks for them. From that
it finds each instant by Newton's iteration on the Taylor series of the motion, and carries out
crossings, walls and impacts by the formulas of the model, written down once more and otherwise.
What it computes from the solver's own doubles differs from the solver's tables by the solver's
rounding errors alone.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from vibro_cli.stress.oracles.scene import Scene
from vibro_cli.stress.oracles.taylor import ArcMotion, Real, mp

ENOUGH = mp.mpf(10) ** -44
# A body farther beyond its piece, or two deeper in one another, have missed an event.
SLACK = mp.mpf(10) ** -9


class Happening(NamedTuple):
    """One event as the solver tells it; bodies and pieces from 0."""

    t: float
    kind: str  # crossing, wall, impact
    a: int
    b: int = -1
    to_right: bool = True
    law: str = ""
    carried_out: bool = True


class Place(NamedTuple):
    """Where a body is and how it moves."""

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
    separation: Real
    loss: Real  # of rolling energy, J
    crossings: int


class Twin:
    """Bodies of a scene on their way.

    Parameters
    ----------
    scene
        What is run.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.crossings = 0
        self.t = mp.zero
        self._motions: list[tuple[int, Real, Any]] = []
        for ball, (piece, place, speed) in enumerate(scene.starts):
            self._motions.append((piece, mp.zero, self._motion(ball, piece, place, speed)))

    def path_radius(self, ball: int, piece: int) -> Real:
        """Radius of the path of the centre on an arc."""
        shape = self.scene.pieces[piece]
        return shape.size - shape.sign * self.scene.bodies[ball].radius

    def _frequency(self, ball: int, piece: int) -> Real:
        kappa = self.scene.bodies[ball].kappa
        return mp.sqrt(self.scene.gravity / (kappa * self.path_radius(ball, piece)))

    def _motion(self, ball: int, piece: int, place: Real, speed: Real) -> Any:
        shape = self.scene.pieces[piece]
        if shape.sign == 0:
            return self._line_motion(ball, piece, place, speed)
        w = self._frequency(ball, piece)
        sine, cosine = mp.sin(place / 2), mp.cos(place / 2)
        # f = phi in a valley; f = psi + pi on a hump, where C = -sin(psi/2) is small at the crest.
        s, c = (sine, cosine) if shape.sign > 0 else (cosine, -sine)
        rho = self.path_radius(ball, piece)
        strength = self.scene.turning_square / self.scene.gravity
        pull = (shape.sign * strength * (shape.origin[0] - self.scene.axis), strength * rho)
        return ArcMotion(w, (s, c, speed / (2 * w * rho)), pull if strength else None)

    def _line_motion(self, ball: int, piece: int, place: Real, speed: Real) -> Any:
        """A parabola; on a trace that turns ``s'' = pull + growth^2 (s - place)``."""
        body, shape = self.scene.bodies[ball], self.scene.pieces[piece]
        slope = shape.slopes[0]
        pull = -self.scene.gravity / body.kappa * mp.sin(slope)
        square = self.scene.turning_square / body.kappa * mp.cos(slope)
        if square == 0:
            return lambda h: (place + h * (speed + h * pull / 2), speed + h * pull)
        x = shape.origin[0] + place * mp.cos(slope) - body.radius * mp.sin(slope)
        pull += square * (x - self.scene.axis)
        growth = mp.sqrt(square * mp.cos(slope))

        def motion(h: Real) -> tuple[Real, Real]:
            cosh, sinh = mp.cosh(growth * h), mp.sinh(growth * h) / growth
            # Not cosh - 1: a line that is upright but for rounding has next to no growth.
            way = speed * sinh + 2 * pull * (mp.sinh(growth * h / 2) / growth) ** 2
            return place + way, speed * cosh + pull * sinh

        return motion

    def at(self, ball: int, t: Real) -> Place:
        """State of a body at an instant of its present flight."""
        piece, start, motion = self._motions[ball]
        shape = self.scene.pieces[piece]
        radius = self.scene.bodies[ball].radius
        x, y = shape.origin
        if shape.sign == 0:
            place, speed = motion(t - start)
            cosine, sine = mp.cos(shape.slopes[0]), mp.sin(shape.slopes[0])
            centre = (x + place * cosine - radius * sine, y + place * sine + radius * cosine)
            return Place(piece, place, speed, centre, (cosine, sine))
        s, c, p = motion.at(t - start)
        half = mp.atan2(s, c) if shape.sign > 0 else mp.atan2(-c, s)
        middle = (shape.low + shape.high) / 4
        place = 2 * (half + 2 * mp.pi * mp.nint((middle - half) / (2 * mp.pi)))
        rho = self.path_radius(ball, piece)
        sine, cosine = mp.sin(place), mp.cos(place)
        return Place(
            piece, place, 2 * self._frequency(ball, piece) * rho * p,
            (x + rho * sine, y - shape.sign * rho * cosine), (cosine, shape.sign * sine),
        )  # fmt: skip

    def _rate(self, ball: int, place: Place) -> Real:
        """Rate of a place: of the angle on an arc, of the distance on a line."""
        on_arc = self.scene.pieces[place.piece].sign
        return place.speed / self.path_radius(ball, place.piece) if on_arc else place.speed

    def _reach(self, ball: int, goal: Real, guess: float) -> Real:
        """Instant at which a body is at a place of its piece."""
        t = mp.mpf(guess)
        for _ in range(12):
            now = self.at(ball, t)
            change = (goal - now.place) / self._rate(ball, now)
            t += change
            if abs(change) < ENOUGH * (1 + abs(t)):
                return t
        raise ArithmeticError(f"body {ball + 1} does not come to {goal} near t = {guess}")

    def _begin(self, ball: int, piece: int, place: Real, speed: Real) -> None:
        self._motions[ball] = (piece, self.t, self._motion(ball, piece, place, speed))

    def cross(self, ball: int, to_right: bool, guess: float) -> Real:
        """Carry a body over the end of its piece onto the next one; return the instant."""
        piece = self._motions[ball][0]
        shape = self.scene.pieces[piece]
        self.t = self._reach(ball, shape.high if to_right else shape.low, guess)
        speed = self.at(ball, self.t).speed
        target = (piece + (1 if to_right else -1)) % len(self.scene.pieces)
        entered = self.scene.pieces[target]
        self._begin(ball, target, entered.low if to_right else entered.high, speed)
        self.crossings += 1
        return self.t

    def rebound(self, ball: int, guess: float) -> Real:
        """Let a body rebound from the wall it moves to; return the instant."""
        piece = self._motions[ball][0]
        shape = self.scene.pieces[piece]
        right = self.at(ball, mp.mpf(guess)).speed > 0
        offset = self.scene.bodies[ball].radius
        if shape.sign:
            offset = mp.asin(offset / self.path_radius(ball, piece))
        goal = shape.high - offset if right else shape.low + offset
        self.t = self._reach(ball, goal, guess)
        restitution: Real = self.scene.walls[1 if right else 0]
        self._begin(ball, piece, goal, -restitution * self.at(ball, self.t).speed)
        return self.t

    def meet(self, a: int, b: int, guess: float) -> Real:
        """Instant at which two bodies touch."""
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

    def _restitution(self, a: int, b: int) -> Real:
        across_seam = abs(a - b) > 1
        return self.scene.restitution[-1 if across_seam else min(a, b)]

    def hit(self, happening: Happening) -> Impact:
        """Carry out an impact (an inadmissible one that ends a run changes nothing)."""
        a, b = happening.a, happening.b
        self.t = self.meet(a, b, happening.t)
        pa, pb = self.at(a, self.t), self.at(b, self.t)
        distance = self.scene.bodies[a].radius + self.scene.bodies[b].radius
        nx = (pb.centre[0] - pa.centre[0]) / distance
        ny = (pb.centre[1] - pa.centre[1]) / distance
        ca = nx * pa.tangent[0] + ny * pa.tangent[1]
        cb = nx * pb.tangent[0] + ny * pb.tangent[1]
        wa, wb = self._law(happening.law, a, b, (ca, cb), (pa.speed, pb.speed))
        loss = mp.zero
        for ball, before, after in ((a, pa.speed, wa), (b, pb.speed, wb)):
            body = self.scene.bodies[ball]
            loss += body.kappa * body.mass * (before - after) * (before + after) / 2
        if happening.carried_out:
            self._begin(a, pa.piece, pa.place, wa)
            self._begin(b, pb.piece, pb.place, wb)
        return Impact(
            self.t, pa, pb, wa, wb,
            ca * pa.speed - cb * pb.speed, cb * wb - ca * wa, loss, self.crossings,
        )  # fmt: skip

    def _law(
        self, law: str, a: int, b: int, along: tuple[Real, Real], speeds: tuple[Real, Real]
    ) -> tuple[Real, Real]:
        """Speeds after an impact: A (3), B (15)-(16) in omega; B (1)-(12) in v; Newton along n."""
        one, two = self.scene.bodies[a], self.scene.bodies[b]
        va, vb = speeds
        k = self._restitution(a, b)
        if law == "normal-impulse":
            ca, cb = along
            ma, mb = one.kappa * one.mass, two.kappa * two.mass
            impulse = (1 + k) * (va * ca - vb * cb) / (ca**2 / ma + cb**2 / mb)
            return va - impulse * ca / ma, vb + impulse * cb / mb
        if law == "translational":
            ratio = one.mass / two.mass
            change = (1 + k) * (va - vb)
            return va - change / (1 + ratio), vb + change / (1 + 1 / ratio)
        ja, jb = (body.kappa * body.mass * body.radius**2 for body in (one, two))
        change = (1 + k) * (va / one.radius - vb / two.radius)
        return (
            va - one.radius * change / (1 + ja / jb),
            vb + two.radius * change / (1 + jb / ja),
        )

    def check(self) -> None:
        """Raise if some body has left its piece without an event, or is inside a neighbour."""
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

    def follow(self, happenings: Iterable[Happening]) -> list[Impact]:
        """Carry out events in their order; return the impacts."""
        impacts = []
        for happening in happenings:
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


def in_contact(scene: Scene, a: int, b: int) -> Scene:
    """The scene with body b put where it touches body a, by Newton's iteration from its place."""
    touch = scene.bodies[a].radius + scene.bodies[b].radius
    starts = list(scene.starts)
    for _ in range(8):
        twin = Twin(replace(scene, starts=tuple(starts)))
        one, other = twin.at(a, mp.zero), twin.at(b, mp.zero)
        dx, dy = other.centre[0] - one.centre[0], other.centre[1] - one.centre[1]
        along = dx * other.tangent[0] + dy * other.tangent[1]
        if twin.scene.pieces[other.piece].sign:
            along *= twin.path_radius(b, other.piece)
        piece, place, speed = starts[b]
        starts[b] = (piece, place - (dx * dx + dy * dy - touch * touch) / (2 * along), speed)
    return twin.scene


def happenings_of(run: Any) -> list[Happening]:
    """The events of a run of the solver, from its tables."""
    found: list[tuple[float, int, Happening]] = []
    events, rows = run.events, run.collisions
    for number, kind in enumerate(events["event"]):
        if kind in ("crossing", "wall"):
            t, ball = float(events["t"][number]), int(events["ball"][number]) - 1
            right = float(events["speed"][number]) > 0.0
            found.append((t, 0, Happening(t, kind, ball, to_right=right)))
        elif kind in ("contact_closed", "contact_opened"):
            raise NotImplementedError("the twin does not follow lasting contact")
    for number in range(len(rows["n"])):
        if rows["simultaneous"][number]:
            raise NotImplementedError("the twin does not follow joint impacts")
        t = float(rows["t"][number])
        a, b = int(rows["ball_a"][number]) - 1, int(rows["ball_b"][number]) - 1
        parted = bool(rows["admissible"][number] or rows["substituted"][number])
        law = str(rows["law"][number])
        found.append((t, 1, Happening(t, "impact", a, b, law=law, carried_out=parted)))
    # Contact and crossing at one time: crossing first.
    found.sort(key=lambda event: event[:2])
    return [event for _, _, event in found]
