"""The equations of the model in plain numbers, as a user of an ODE solver would write them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from vibro_cli.mechanics.system import TraceSystem

INSIDE = 4e-16
"""A body that has just crossed is put so far (rad) inside its new arc: an event function that is
zero at the start of a step hides a return through the junction within that step."""

State = list[float]
"""Angle and rate of each body in turn."""


@dataclass(frozen=True)
class Arc:
    """One arc: φ'' = −sign w² sin φ (ψ on a hump), its centre and its ends as angles."""

    sign: float
    x: float
    y: float
    low: float
    high: float


class Motion:
    """Bodies on a chain of arcs, in angles and rates.

    Parameters
    ----------
    system
        What moves; arcs only, the laws ``hedrih`` and ``normal-impulse``.
    """

    def __init__(self, system: TraceSystem) -> None:
        self.gravity = system.gravity
        self.arcs = [
            Arc(p.sign, *p.center, p.angle_start, p.angle_end) for p in system.trace.pieces
        ]
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
        self.restitution = system.restitution
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
            self.pairs.append((count - 1, 0))  # across the top: angles go on beyond half a turn

    def contact_angle(self, a: int, b: int, piece: int) -> float:
        """β (rad): sin(β/2) = √(r_a r_b/(ρ_a ρ_b)), B (48)."""
        product = self.bodies[a].radius * self.bodies[b].radius
        return 2.0 * math.asin(math.sqrt(product / (self.radius[a][piece] * self.radius[b][piece])))

    def gap(self, pair: int, pieces: Sequence[int], y: Sequence[float]) -> float:
        """What is positive while a pair is apart: an angle on one arc, else d² − (r_a + r_b)²."""
        a, b = self.pairs[pair]
        if pieces[a] == pieces[b]:
            turn = math.tau if b < a else 0.0
            return y[2 * b] + turn - y[2 * a] - self.contact_angle(a, b, pieces[a])
        (xa, ya), (xb, yb) = self.centre(a, pieces[a], y), self.centre(b, pieces[b], y)
        touch = self.bodies[a].radius + self.bodies[b].radius
        return (xb - xa) ** 2 + (yb - ya) ** 2 - touch**2

    def centre(self, ball: int, piece: int, y: Sequence[float]) -> tuple[float, float]:
        """Centre of a body (m)."""
        arc, rho = self.arcs[piece], self.radius[ball][piece]
        return (
            arc.x + rho * math.sin(y[2 * ball]),
            arc.y - arc.sign * rho * math.cos(y[2 * ball]),
        )

    def junctions(self, pieces: Sequence[int]) -> list[tuple[int, int]]:
        """Ends of arcs that bodies may cross: (body, −1 or +1)."""
        last = len(self.arcs) - 1
        return [
            (ball, side)
            for ball, piece in enumerate(pieces)
            for side in (-1, 1)
            if 0 <= piece + side <= last
        ]

    def room(self, ball: int, side: int, piece: int, y: Sequence[float]) -> float:
        """Angle left before a junction."""
        arc = self.arcs[piece]
        return arc.high - y[2 * ball] if side > 0 else y[2 * ball] - arc.low

    def cross(self, ball: int, side: int, pieces: Sequence[int], y: State) -> tuple[int, ...]:
        """Carry a body over a junction; return the pieces all bodies are on now."""
        old, new = pieces[ball], pieces[ball] + side
        arc = self.arcs[new]
        y[2 * ball] = arc.low + INSIDE if side > 0 else arc.high - INSIDE
        y[2 * ball + 1] *= self.radius[ball][old] / self.radius[ball][new]
        return tuple(new if other == ball else piece for other, piece in enumerate(pieces))

    def jump(
        self, pair: int, pieces: Sequence[int], y: Sequence[float]
    ) -> tuple[float, float, float, float]:
        """Return (p, q, α, β) of an impact: c = p ω_a − q ω_b, ω_a⁺ = ω_a − α c, ω_b⁺ = ω_b + β c.

        ω are the rates of the angles, c the speed of closing; the four are constant on one arc.
        """
        a, b = self.pairs[pair]
        k = self.restitution[min(pair, len(self.restitution) - 1)]
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

    def hit(self, pair: int, pieces: Sequence[int], y: State) -> bool:
        """Carry out an impact; return whether the bodies were closing in at all."""
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
        """Components of the line of centres along the tangents of both paths."""
        (xa, ya), (xb, yb) = self.centre(a, pieces[a], y), self.centre(b, pieces[b], y)
        distance = math.hypot(xb - xa, yb - ya)
        nx, ny = (xb - xa) / distance, (yb - ya) / distance
        ca, cb = (
            nx * math.cos(y[2 * ball]) + ny * self.arcs[pieces[ball]].sign * math.sin(y[2 * ball])
            for ball in (a, b)
        )
        return ca, cb

    def energy(self, pieces: Sequence[int], y: Sequence[float]) -> float:
        """Kinetic and potential energy of all bodies (J), from the lowest centre on the trace."""
        total = 0.0
        for ball, body in enumerate(self.bodies):
            rho = self.radius[ball][pieces[ball]]
            lowest = min(
                arc.y - radius
                for arc, radius in zip(self.arcs, self.radius[ball], strict=True)
                if arc.sign > 0.0
            )
            height = self.centre(ball, pieces[ball], y)[1] - lowest
            speed = rho * y[2 * ball + 1]
            total += body.mass * (0.5 * body.kappa * speed**2 + self.gravity * height)
        return total
