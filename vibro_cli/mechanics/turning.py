"""A trace that turns about a vertical axis: its potential on each piece, for one body.

``V = S^2 - tilt S C - spread S^2 C^2`` on an arc (see ``kernels.flow.rotating_flow``): a
trigonometric
polynomial of degree 2 in the angle, whose stationary points are found as roots of a polynomial in
``exp(i f)``. D, perspectives.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from vibro_cli.mechanics.trace import Piece

# Roots this close to the unit circle are angles, double ones too.
_ON_CIRCLE = 1e-6
# A saddle and a centre that have just arisen are told apart from here on.
_RESOLVED = 1.0 + 1e-14


@dataclass(frozen=True)
class Turning:
    """The axis about which a trace turns, and its rate."""

    x: float
    """Horizontal position of the axis, from the trace's left end (m)."""
    rate: float
    """Ω (rad/s)."""

    @property
    def square(self) -> float:
        """Ω² (1/s²)."""
        return self.rate * self.rate


@dataclass(frozen=True)
class Pull:
    """Pull of gravity and turning on an arc: ``-sin f + tilt cos f + spread sin f cos f``.

    In units of g/(κρ), in the angle f = φ of a valley, ψ + π of a hump.
    """

    tilt: float
    spread: float

    @staticmethod
    def on_arc(piece: Piece, body_radius: float, turning: Turning, gravity: float) -> Pull:
        """Return the pull on a body of the given radius (m) on an arc."""
        strength = turning.square / gravity
        return Pull(
            piece.sign * strength * (piece.center[0] - turning.x),
            strength * piece.path_radius(body_radius),
        )

    def potential(self, angle: float) -> float:
        """Return V at an angle f (rad), 0 at f = 0."""
        s, c = math.sin(0.5 * angle), math.cos(0.5 * angle)
        return s * s - s * c * (self.tilt + self.spread * s * c)

    def force(self, angle: float) -> float:
        """Return the pull at an angle f (rad)."""
        sine, cosine = math.sin(angle), math.cos(angle)
        return sine * (self.spread * cosine - 1.0) + self.tilt * cosine

    def stiffness(self, angle: float) -> float:
        """Return the derivative of the pull with the angle."""
        return -math.cos(angle) - self.tilt * math.sin(angle) + self.spread * math.cos(2.0 * angle)

    def bending(self, angle: float) -> float:
        """Return the second derivative of the pull with the angle."""
        sine = math.sin(angle) - 2.0 * self.spread * math.sin(2.0 * angle)
        return sine - self.tilt * math.cos(angle)

    def equilibria(self) -> list[float]:
        """Return the angles f in [-pi, pi) at which nothing pulls.

        On its axis an arc has them in closed form, so that the pitchfork at spread = 1 is exact.
        """
        if self.tilt == 0.0:
            aside = math.acos(1.0 / self.spread) if self.spread > 1.0 else 0.0
            return [-math.pi, *([-aside, 0.0, aside] if aside > 0.0 else [0.0])]
        found = roots(1.0, self.tilt, self.spread, 0)
        resolved = (1.0 + abs(self.tilt) ** (2 / 3)) * _RESOLVED
        if len(found) < 4 or self.spread ** (2 / 3) >= resolved:
            return found
        # Two of them are about to meet, or have met: which of it is known in closed form only.
        gaps = [(found[i] - found[i - 1]) % math.tau for i in range(4)]
        close = gaps.index(min(gaps))
        return [angle for i, angle in enumerate(found) if i not in (close, (close - 1) % 4)]

    def greatest(self, order: int, low: float, high: float) -> float:
        """Return the greatest size of the pull (order 0) or of a derivative of it on an interval.

        Where it is stationary, or at an end.
        """
        value = (self.force, self.stiffness, self.bending)[order]
        stationary = roots(1.0, self.tilt, self.spread, order + 1)
        places = [low, high, *inside(stationary, low, high)]
        return max(abs(value(place)) for place in places)

    def steepest_fall(self, low: float, high: float) -> float:
        """Return the greatest fall of the pull with the angle on an interval, or 1/100 if less."""
        stationary = roots(1.0, self.tilt, self.spread, 2)
        places = [low, high, *inside(stationary, low, high)]
        return max(0.01, *(-self.stiffness(place) for place in places))


def roots(weight: float, tilt: float, spread: float, order: int) -> list[float]:
    """Angles in [-pi, pi) at which a derivative of ``-weight sin f + tilt cos f + ...`` is zero.

    ``... = (spread/2) sin 2f``; ``order`` 0 is the function itself.
    """
    first = (0.5 * tilt + 0.5j * weight) * 1j**order
    return zeros(0.0, first, -0.25j * spread * (2j) ** order)


def zeros(constant: float, first: complex, second: complex) -> list[float]:
    """Angles f in [-pi, pi) at which ``constant + 2 Re(first e^(i f) + second e^(2 i f))`` is 0."""
    import numpy as np

    found = []
    coefficients = [second, first, constant, first.conjugate(), second.conjugate()]
    for z in np.roots(np.trim_zeros(coefficients, trim="f")):
        if abs(abs(z) - 1.0) < _ON_CIRCLE:
            found.append(_polished(math.atan2(z.imag, z.real), constant, first, second))
    return sorted(found)


def _polished(angle: float, constant: float, first: complex, second: complex) -> float:
    """Newton's steps on the trigonometric polynomial itself."""
    for _ in range(4):
        one = complex(math.cos(angle), math.sin(angle))
        two = one * one
        value = constant + 2.0 * (first * one + second * two).real
        slope = 2.0 * (1j * first * one + 2j * second * two).real
        if slope == 0.0 or abs(value / slope) > 1e-3:
            break
        angle -= value / slope
    return angle


def inside(angles: list[float], low: float, high: float) -> list[float]:
    """Return those of some angles, with all whole turns added, that lie within an interval."""
    found = []
    for angle in angles:
        turns = math.ceil((low - angle) / math.tau)
        while angle + turns * math.tau < high:
            if angle + turns * math.tau > low:
                found.append(angle + turns * math.tau)
            turns += 1
    return sorted(found)
