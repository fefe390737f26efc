"""The motion of balls on a table in 50 digits, told which events happen; it finds their instants.

From Cartesian equations and the laws as the papers print them: nothing of the solver is used.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.stress.oracles.pair_laws import speed_changes
from vibro_cli.systems.table.system import POLYGON, TableSystem


@dataclass(frozen=True)
class Told:
    """An impact of the solver's run: of two balls, or of one on the wall."""

    t: float
    """Its time (s), as the solver has found it."""
    balls: tuple[int, ...]
    """From 0."""
    normal: float
    """Direction of the normal (rad), from the first ball to the other or to the wall."""
    law: str = ""
    edge: int = 0


def told_of(pairs: Any, bounces: Any) -> list[Told]:
    """Return the impacts of a run from its logs, in order."""
    found: list[tuple[int, Told]] = []
    for row in pairs:
        normal = math.atan2(row["normal_y"], row["normal_x"])
        balls = (int(row["a"]), int(row["b"]))
        one = Told(float(row["t"]), balls, normal, LAW_NAMES[row["law"]])
        found.append((int(row["event"]), one))
    for row in bounces:
        normal = math.atan2(row["normal_y"], row["normal_x"])
        one = Told(float(row["t"]), (int(row["ball"]),), normal, edge=int(row["edge"]))
        found.append((int(row["event"]), one))
    return [one for _, one in sorted(found, key=lambda each: each[0])]


class Twin:
    """Balls on a table in the numbers of a context of mpmath."""

    def __init__(self, mp: Any, system: TableSystem) -> None:
        self.mp = mp
        self.system = system
        self.radii = [mp.mpf(body.radius) for body in system.bodies]
        self.masses = [mp.mpf(body.mass) for body in system.bodies]
        self.rolling = [mp.mpf(body.kappa) * body.mass for body in system.bodies]

    def end_of(self, start: Sequence[Any], told: Sequence[Told], end: float) -> list[Any]:
        """Return the state ``x, y, vx, vy`` of each ball at a time (s), ball after ball.

        The impacts that are told happen on the way, from a state of the same form.
        """
        state = [list(start[4 * n : 4 * n + 4]) for n in range(len(self.radii))]
        now = self.mp.zero
        for one in told:
            step, normal = self._contact(state, now, one)
            for ball in state:
                ball[0] += step * ball[2]
                ball[1] += step * ball[3]
            now += step
            if len(one.balls) == 2:
                self._collide(state, one)
            else:
                self._rebound(state[one.balls[0]], normal)
        step = self.mp.mpf(end) - now
        return [
            number
            for x, y, vx, vy in state
            for number in (x + step * vx, y + step * vy, vx, vy)
        ]  # fmt: skip

    def _contact(self, state: list[list[Any]], now: Any, one: Told) -> tuple[Any, Any]:
        """How long until an impact (s), and the normal of the wall there."""
        if len(one.balls) == 2:
            a, b = one.balls
            touch = 2 * self.mp.sqrt(self.radii[a] * self.radii[b])
            way = [state[b][n] - state[a][n] for n in range(4)]
            return self._fall(way, touch), None
        ball = one.balls[0]
        wall = self.system.wall
        assert wall is not None
        if wall.shape != POLYGON:
            return self._curved(state[ball], self.radii[ball], self.mp.mpf(one.t) - now, one)
        corners = [[self.mp.mpf(v) for v in corner] for corner in wall.corners]
        (x, y), (ex, ey) = corners[one.edge], corners[(one.edge + 1) % len(corners)]
        side = 1 if wall.inside else -1
        length = self.mp.sqrt((ex - x) ** 2 + (ey - y) ** 2)
        normal = side * (ey - y) / length, -side * (ex - x) / length
        if math.cos(one.normal) * normal[0] + math.sin(one.normal) * normal[1] > 1.0 - 1e-12:
            px, py, vx, vy = state[ball]
            left = (x - px) * normal[0] + (y - py) * normal[1] - self.radii[ball]
            return left / (vx * normal[0] + vy * normal[1]), normal
        px, py, vx, vy = state[ball]
        step = self._fall([px - x, py - y, vx, vy], self.radii[ball])
        return step, self._unit(x - px - step * vx, y - py - step * vy)

    def _fall(self, way: Sequence[Any], distance: Any) -> Any:
        """When the length of ``(x, y) + (vx, vy) t`` falls to a distance (s)."""
        x, y, vx, vy = way
        square, along = vx**2 + vy**2, x * vx + y * vy
        beyond = x**2 + y**2 - distance**2
        return (-along - self.mp.sqrt(along**2 - square * beyond)) / square

    def _unit(self, x: Any, y: Any) -> tuple[Any, Any]:
        size = self.mp.sqrt(x**2 + y**2)
        return x / size, y / size

    def _curved(self, ball: list[Any], r: Any, guess: Any, one: Told) -> tuple[Any, Any]:
        """Time to and normal of a contact with a conic, by Newton from where it was found."""
        mp, wall = self.mp, self.system.wall
        assert wall is not None
        a, b = (mp.mpf(axis) for axis in wall.semi_axes)
        x, y = (ball[n] - mp.mpf(wall.center[n]) for n in (0, 1))
        side = 1 if wall.inside else -1

        def outer(angle: Any) -> Any:
            return self._unit(b * mp.cos(angle), a * mp.sin(angle))

        def equations(t: Any, angle: Any) -> list[Any]:
            n = outer(angle)
            return [
                x + ball[2] * t - (a * mp.cos(angle) - side * r * n[0]),
                y + ball[3] * t - (b * mp.sin(angle) - side * r * n[1]),
            ]

        cosine, sine = side * math.cos(one.normal), side * math.sin(one.normal)
        angle = math.atan2(float(b) * sine, float(a) * cosine)
        tolerance = mp.mpf(10) ** (6 - 2 * mp.dps)
        t, angle = mp.findroot(equations, (guess, mp.mpf(angle)), tol=tolerance)
        n = outer(angle)
        return t, (side * n[0], side * n[1])

    def _rebound(self, ball: list[Any], normal: tuple[Any, Any]) -> None:
        wall = self.system.wall
        assert wall is not None
        speed = ball[2] * normal[0] + ball[3] * normal[1]
        for axis in (0, 1):
            ball[2 + axis] -= (1 + self.mp.mpf(wall.restitution)) * speed * normal[axis]

    def _collide(self, state: list[list[Any]], one: Told) -> None:
        """Change the components along the line of centres by the law."""
        pair = one.balls
        n = self._unit(*(state[pair[1]][axis] - state[pair[0]][axis] for axis in (0, 1)))
        numbers = ([of[ball] for ball in pair] for of in (self.radii, self.masses, self.rolling))
        speeds = [state[ball][2] * n[0] + state[ball][3] * n[1] for ball in pair]
        changes = speed_changes(one.law, self.mp.mpf(self.system.restitution), speeds, *numbers)
        for ball, change in zip(pair, changes, strict=True):
            for axis in (0, 1):
                state[ball][2 + axis] += change * n[axis]
