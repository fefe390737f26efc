"""The potential of a body on the trace: heights of pieces, and arcs of a rotating trace.

Near a crest a body's kinetic energy is a small difference of heights, and would keep few digits if
the heights were summed in doubles. So the heights are summed along the pieces in 70 decimal digits,
which hold radii and lengths of ordinary size exactly, and each height above the body's lowest place
is rounded once: level pieces of one height have the same number.

On an arc of a trace that rotates about a vertical axis, ``V = S^2 - tilt S C - spread S^2 C^2``
(see ``kernels.flow.rotating_flow``). This is a trigonometric polynomial of degree 2 in the angle;
its stationary points are found as roots of a polynomial in ``exp(i f)``. D, perspectives.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal, localcontext
from functools import lru_cache
from typing import Any

from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.mechanics.trace import Piece, Trace
from vibro_cli.numerics import elementwise

_DIGITS = 70
_PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640628620900")


def heights(trace: Trace, radius: float) -> list[tuple[float, float]]:
    """Return two heights (m) of a body's centre for each piece, above its lowest on the trace.

    On an arc: the lowest and the highest point of the full circle of the centre's path. On a line:
    the left and the right end. `radius` of the body in m.
    """
    with localcontext() as context:
        context.prec = _DIGITS
        extremes = _extremes(trace, _decimal(radius))
        lowest = elementwise.least_of([low for _, _, low in extremes])
        rises = [(bottom - lowest, top - lowest) for bottom, top, _ in extremes]
        return [(_double(bottom), _double(top)) for bottom, top in rises]


def _decimal(value: elementwise.Some) -> Any:
    """Return a double, or each of an array, as a decimal."""
    return elementwise.each(Decimal, value, kind=object)


def _double(value: Any) -> Any:
    """Return the double nearest to a decimal, or to each of an array.

    Often a height is halfway between two doubles. Its last digits, which depend on the trace's left
    end and on the unit of length, must not decide then: the rest, itself a double, has lost them,
    and the sum is the even one.
    """
    if isinstance(value, Decimal):
        near = float(value)
        return near + float(value - Decimal(near))
    return elementwise.each(_double, value)


def contains_turn(piece: Piece, angle: float) -> bool:
    """Return whether an arc contains ``angle`` (rad) plus a whole number of turns."""
    turns = elementwise.ceiling((piece.angle_start - angle) / math.tau)
    return angle + turns * math.tau <= piece.angle_end  # type: ignore[no-any-return]


def _extremes(trace: Trace, radius: Any) -> list[tuple[Any, Any, Any]]:
    """Return for each piece the heights of the centre at bottom and top, and its lowest height.

    Bottom and top are those of the full circle; on a line, the left and the right end.
    """
    found = []
    cosine = elementwise.each(_cosine, trace.pieces[0].start_slope, kind=object)
    # At slope alpha the body's centre is r cos(alpha) above the contact point.
    contact: Any = Decimal(0)
    for piece in trace.pieces:
        start = contact + radius * cosine
        if piece.is_line:
            sine = elementwise.each(_sine, piece.start_slope, kind=object)
            contact = contact + _decimal(piece.length) * sine
            end = contact + radius * cosine
            found.append((start, end, elementwise.least(start, end)))
            continue
        sign = Decimal(piece.sign)
        centre = contact + sign * _decimal(piece.radius) * cosine
        cosine = elementwise.each(_cosine, piece.end_slope, kind=object)
        contact = centre - sign * _decimal(piece.radius) * cosine
        path_radius = _decimal(piece.radius) - sign * radius
        low = elementwise.least(start, contact + radius * cosine)
        turn = contains_turn(piece, 0.0 if piece.sign > 0.0 else math.pi)
        low = elementwise.choose(turn, centre - path_radius, low)
        found.append((centre - path_radius, centre + path_radius, low))
    return found


@lru_cache(maxsize=4096)  # the scenarios of a grid have the same slopes again and again
def _sine(slope: float) -> Decimal:
    """Return the sine, near 0 with all digits: that of a level line is exactly 0."""
    x = _within_half_a_turn(slope) / 27
    total = _series(x, x, 1)
    for _ in range(3):
        total = 3 * total - 4 * total**3
    return total


@lru_cache(maxsize=4096)
def _cosine(slope: float) -> Decimal:
    total = _series(Decimal(1), _within_half_a_turn(slope) / 8, 0)
    for _ in range(3):
        total = 2 * total * total - 1
    return total


def _within_half_a_turn(slope: float) -> Decimal:
    """Return a slope less whole turns, within [-pi, pi]."""
    x = Decimal(slope)
    return x - 2 * _PI * (x / (2 * _PI)).to_integral_value()


def _series(term: Decimal, x: Decimal, power: int) -> Decimal:
    """Return the Taylor series of sine or cosine at x from its first term, of the given power."""
    total = term
    while abs(term) > abs(total) * Decimal(10) ** -(_DIGITS + 2):
        power += 2
        term = -term * x * x / (power * (power - 1))
        total += term
    return total


# Roots this close to the unit circle count as angles; double roots are less accurate than others.
_ON_CIRCLE = 1e-6
# Factor above the bifurcation from which a new saddle and a new centre count as distinct.
_RESOLVED = 1.0 + 1e-14


@dataclass(frozen=True)
class Turning:
    """Axis and rate of a rotating trace."""

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
    """Force of gravity and rotation along an arc: ``-sin f + tilt cos f + spread sin f cos f``.

    In units of g/(κρ); the angle f is φ in a valley, ψ + π on a hump.
    """

    tilt: float
    spread: float

    @staticmethod
    def on_arc(piece: Piece, body_radius: float, turning: Turning, gravity: float) -> Pull:
        """Return the force on a body of a radius (m) on an arc."""
        strength = turning.square / gravity
        return Pull(
            piece.sign * strength * (piece.centre[0] - turning.x),
            strength * piece.path_radius(body_radius),
        )

    def potential(self, angle: float) -> float:
        """Return V at an angle f (rad), 0 at f = 0."""
        s, c = math.sin(0.5 * angle), math.cos(0.5 * angle)
        return s * s - s * c * (self.tilt + self.spread * s * c)

    def force(self, angle: float) -> float:
        """Return the force at an angle f (rad)."""
        sine, cosine = math.sin(angle), math.cos(angle)
        return sine * (self.spread * cosine - 1.0) + self.tilt * cosine

    def stiffness(self, angle: float) -> float:
        """Return the derivative of the force with respect to the angle."""
        return -math.cos(angle) - self.tilt * math.sin(angle) + self.spread * math.cos(2.0 * angle)

    def bending(self, angle: float) -> float:
        """Return the second derivative of the force with respect to the angle."""
        sine = math.sin(angle) - 2.0 * self.spread * math.sin(2.0 * angle)
        return sine - self.tilt * math.cos(angle)

    def equilibria(self) -> list[float]:
        """Return the angles f in [-pi, pi) at which the force is zero.

        For an arc centred on the axis they are in closed form, so that the pitchfork at spread = 1
        is exact.
        """
        if self.tilt == 0.0:
            aside = math.acos(1.0 / self.spread) if self.spread > 1.0 else 0.0
            return [-math.pi, *([-aside, 0.0, aside] if aside > 0.0 else [0.0])]
        found = roots(1.0, self.tilt, self.spread, 0)
        resolved = (1.0 + abs(self.tilt) ** (2 / 3)) * _RESOLVED
        if len(found) < 4 or self.spread ** (2 / 3) >= resolved:
            return found
        # Drop the two closest roots: by the closed form they do not exist, or are not resolved.
        gaps = [(found[i] - found[i - 1]) % math.tau for i in range(4)]
        close = gaps.index(min(gaps))
        return [angle for i, angle in enumerate(found) if i not in (close, (close - 1) % 4)]

    def greatest(self, order: int, low: float, high: float) -> float:
        """Return the greatest magnitude of the force (order 0) or a derivative on an interval.

        It is reached at a stationary point or at an end.
        """
        value = (self.force, self.stiffness, self.bending)[order]
        stationary = roots(1.0, self.tilt, self.spread, order + 1)
        places = [low, high, *inside(stationary, low, high)]
        return max(abs(value(place)) for place in places)

    def steepest_fall(self, low: float, high: float) -> float:
        """Return the steepest decrease of the force on an interval of angles, at least 1/100."""
        stationary = roots(1.0, self.tilt, self.spread, 2)
        places = [low, high, *inside(stationary, low, high)]
        return max(0.01, *(-self.stiffness(place) for place in places))


def roots(weight: float, tilt: float, spread: float, order: int) -> list[float]:
    """Return the zeros in [-pi, pi) of a derivative of ``-weight sin f + tilt cos f + ...``.

    ``... = (spread/2) sin 2f``; ``order`` 0 is the function itself.
    """
    first = (0.5 * tilt + 0.5j * weight) * 1j**order
    return zeros(0.0, first, -0.25j * spread * (2j) ** order)


def zeros(constant: float, first: complex, second: complex) -> list[float]:
    """Return the zeros f in [-pi, pi) of ``constant + 2 Re(first e^(i f) + second e^(2 i f))``."""
    import numpy as np

    found = []
    coefficients = [second, first, constant, first.conjugate(), second.conjugate()]
    if abs(second) < EPSILON * abs(first):
        # The two roots that the term adds are far from the circle; they would cost the others
        # accuracy.
        coefficients = coefficients[1:-1]
    for z in np.roots(np.trim_zeros(coefficients, trim="f")):
        if abs(abs(z) - 1.0) < _ON_CIRCLE:
            found.append(_refined(math.atan2(z.imag, z.real), constant, first, second))
    return sorted(found)


def _refined(angle: float, constant: float, first: complex, second: complex) -> float:
    """Refine a root by Newton steps on the trigonometric polynomial itself."""
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
    """Return all angles inside an open interval that differ from a given one by whole turns."""
    found = []
    for angle in angles:
        turns = math.ceil((low - angle) / math.tau)
        while angle + turns * math.tau < high:
            if angle + turns * math.tau > low:
                found.append(angle + turns * math.tau)
            turns += 1
    return sorted(found)
