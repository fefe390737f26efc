"""Balls on a table to 50 digits: every event the first of all, looked for anew; a twin for tests.

Nothing is shared with the solver. The contact with an ellipse is the root of two equations in time
and eccentric angle, started from a fine search along the path; the others are roots of polynomials.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from mpmath import MPContext

mp: Any = MPContext()
mp.dps = 50
Vector = tuple[Any, Any]


@dataclass
class Ball:
    radius: Any
    inertia: Any  # kappa m
    place: Vector
    velocity: Vector


@dataclass(frozen=True)
class Event:
    t: Any
    kind: str
    balls: tuple[int, ...]
    places: tuple[Vector, ...]
    velocities: tuple[Vector, ...]


def number(value: float) -> Any:
    return mp.mpf(value)


def ball(
    radius: float, inertia: float, place: tuple[float, float], velocity: tuple[float, float]
) -> Ball:
    return Ball(
        number(radius),
        number(inertia),
        (number(place[0]), number(place[1])),
        (number(velocity[0]), number(velocity[1])),
    )


class Ellipse:
    """An elliptic wall around the balls, or among them (side "outside")."""

    def __init__(self, a: float, b: float, k: float, side: str = "inside") -> None:
        self.a, self.b, self.k = number(a), number(b), number(k)
        self.sign = 1 if side == "inside" else -1

    def _centre(self, angle: Any, radius: Any) -> tuple[Any, Any, Any, Any]:
        """Centre of a ball that touches at an eccentric angle, and the normal towards the wall."""
        x, y = self.a * mp.cos(angle), self.b * mp.sin(angle)
        nx, ny = self.sign * x / self.a**2, self.sign * y / self.b**2
        size = mp.sqrt(nx**2 + ny**2)
        return x - radius * nx / size, y - radius * ny / size, nx / size, ny / size

    def _near(self, x: float, y: float) -> tuple[float, float]:
        """Least distance of a place from the ellipse, and the eccentric angle there, roughly."""
        a, b = float(self.a), float(self.b)
        angles = [math.tau * n / 720 for n in range(720)]
        return min((math.hypot(a * math.cos(f) - x, b * math.sin(f) - y), f) for f in angles)

    def _is_free(self, x: float, y: float, radius: float) -> bool:
        """Whether a ball at a position is clear of the wall, on its side of it."""
        a, b = float(self.a), float(self.b)
        if self.sign < 0 and max(abs(x) - a, abs(y) - b) > radius:
            return True
        beyond = (x / a) ** 2 + (y / b) ** 2 > 1
        return beyond == (self.sign < 0) and self._near(x, y)[0] > radius

    def hit(self, one: Ball) -> tuple[Any, Vector] | None:
        """Time until the contact, and the normal there; None if there is none."""
        px, py, vx, vy = map(float, (*one.place, *one.velocity))
        speed, radius = math.hypot(vx, vy), float(one.radius)
        step = 0.01 * float(self.b) / speed
        # Beyond a first bit: the ball may have just left the wall.
        t = step
        while self._is_free(px + vx * t, py + vy * t, radius):
            t += step
            if t * speed > 20.0:
                return None
        angle = self._near(px + vx * t, py + vy * t)[1]

        def equations(time: Any, angle: Any) -> list[Any]:
            x, y, _, _ = self._centre(angle, one.radius)
            return [
                one.place[0] + one.velocity[0] * time - x,
                one.place[1] + one.velocity[1] * time - y,
            ]

        # Start before the contact, to find the root of arrival and not that of departure.
        start = (mp.mpf(t - step), mp.mpf(angle))
        time, angle = mp.findroot(equations, start, tol=mp.mpf(10) ** -80)
        _, _, nx, ny = self._centre(angle, one.radius)
        assert nx * one.velocity[0] + ny * one.velocity[1] > 0
        return time, (nx, ny)


class Circle:
    """A circular wall about the origin, around the balls or among them."""

    def __init__(self, radius: float, k: float, side: str = "inside") -> None:
        self.radius, self.k = number(radius), number(k)
        self.sign = 1 if side == "inside" else -1

    def hit(self, one: Ball) -> tuple[Any, Vector] | None:
        """Time until the contact, and the normal there; None if there is none."""
        time = _time_to_distance(one, (mp.zero, mp.zero), self.radius - self.sign * one.radius,
                                 leaving=self.sign > 0)  # fmt: skip
        if time is None:
            return None
        at = [x + v * time for x, v in zip(one.place, one.velocity, strict=True)]
        size = self.sign * mp.sqrt(at[0] ** 2 + at[1] ** 2)
        return time, (at[0] / size, at[1] / size)


def _time_to_distance(one: Ball, centre: Vector, distance: Any, leaving: bool) -> Any:
    """When the centre of a ball comes to a distance from a place, from outside unless leaving."""
    d = [x - c for x, c in zip(one.place, centre, strict=True)]
    half = d[0] * one.velocity[0] + d[1] * one.velocity[1]
    square = one.velocity[0] ** 2 + one.velocity[1] ** 2
    inside = half**2 - square * (d[0] ** 2 + d[1] ** 2 - distance**2)
    if not leaving and (half >= 0 or inside < 0):
        return None
    return (-half + (1 if leaving else -1) * mp.sqrt(inside)) / square


class Polygon:
    """A wall of straight sides, on whichever side of it the balls are: sides and corners."""

    def __init__(self, corners: list[list[float]], k: float) -> None:
        self.corners = [(number(x), number(y)) for x, y in corners]
        self.k = number(k)

    def hit(self, one: Ball) -> tuple[Any, Vector] | None:
        """Time until the first contact, and the normal there; None if there is none."""
        found: list[tuple[Any, Vector]] = []
        for start, end in zip(self.corners, self.corners[1:] + self.corners[:1], strict=True):
            along = [b - a for a, b in zip(start, end, strict=True)]
            length = mp.sqrt(along[0] ** 2 + along[1] ** 2)
            n = (along[1] / length, -along[0] / length)
            off = sum((s - x) * c for s, x, c in zip(start, one.place, n, strict=True))
            if off < 0:
                n, off = (-n[0], -n[1]), -off
            closing = n[0] * one.velocity[0] + n[1] * one.velocity[1]
            if closing > 0:
                time = (off - one.radius) / closing
                at = [x + v * time for x, v in zip(one.place, one.velocity, strict=True)]
                share = sum((p - s) * c for p, s, c in zip(at, start, along, strict=True))
                if time >= 0 and 0 <= share <= length**2:
                    found.append((time, n))
            time = _time_to_distance(one, start, one.radius, leaving=False)
            if time is not None and time >= 0 and one.radius > 0:
                at = [x + v * time for x, v in zip(one.place, one.velocity, strict=True)]
                n = tuple((s - p) / one.radius for s, p in zip(start, at, strict=True))
                found.append((time, n))
        return min(found, key=lambda one: one[0]) if found else None


def pair_time(one: Ball, other: Ball) -> Any:
    """Return the time until two balls touch, None if they never do."""
    d = [b - a for a, b in zip(one.place, other.place, strict=True)]
    w = [b - a for a, b in zip(one.velocity, other.velocity, strict=True)]
    half = d[0] * w[0] + d[1] * w[1]
    if half >= 0:
        return None
    square = w[0] ** 2 + w[1] ** 2
    rest = d[0] ** 2 + d[1] ** 2 - 4 * one.radius * other.radius
    inside = half**2 - square * rest
    return None if inside < 0 else (-half - mp.sqrt(inside)) / square


def collide(one: Ball, other: Ball, k: Any) -> None:
    """Apply the papers' law, C (3), to the components along the line of centres."""
    d = [b - a for a, b in zip(one.place, other.place, strict=True)]
    size = mp.sqrt(d[0] ** 2 + d[1] ** 2)
    n = (d[0] / size, d[1] / size)
    omegas = [(b.velocity[0] * n[0] + b.velocity[1] * n[1]) / b.radius for b in (one, other)]
    inertia = [b.inertia * b.radius**2 for b in (one, other)]
    relative = omegas[0] - omegas[1]
    changes = (
        -(1 + k) / (1 + inertia[0] / inertia[1]) * relative,
        (1 + k) / (1 + inertia[1] / inertia[0]) * relative,
    )
    for b, change in zip((one, other), changes, strict=True):
        b.velocity = tuple(v + change * b.radius * c for v, c in zip(b.velocity, n, strict=True))


def run(balls: list[Ball], wall: Any, k: float, events: int) -> list[Event]:
    """Return the first events, one after another."""
    t = mp.zero
    found: list[Event] = []
    while len(found) < events:
        options: list[tuple[Any, tuple[int, ...], Any]] = []
        for a, one in enumerate(balls):
            if wall is not None and one.velocity != (0, 0):
                hit = wall.hit(one)
                if hit is not None:
                    options.append((hit[0], (a,), hit[1]))
            for b in range(a + 1, len(balls)):
                time = pair_time(one, balls[b])
                if time is not None:
                    options.append((time, (a, b), None))
        if not options:
            return found
        time, who, normal = min(options, key=lambda option: option[0])
        t += time
        for one in balls:
            one.place = tuple(x + v * time for x, v in zip(one.place, one.velocity, strict=True))
        if normal is not None:
            (one,) = (balls[n] for n in who)
            across = one.velocity[0] * normal[0] + one.velocity[1] * normal[1]
            one.velocity = tuple(
                v - (1 + wall.k) * across * c for v, c in zip(one.velocity, normal, strict=True)
            )
        else:
            collide(balls[who[0]], balls[who[1]], number(k))
        moved = [balls[n] for n in who]
        found.append(
            Event(
                t,
                "bounce" if normal is not None else "impact",
                who,
                tuple(one.place for one in moved),
                tuple(one.velocity for one in moved),
            )
        )
    return found
