"""Heights of the arcs above a body's lowest place, each rounded once.

Near a crest a body's kinetic energy is a small difference of heights; heights summed in doubles
would leave it with few digits. Here the chain of pieces is followed in 50 decimal digits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal, localcontext
from functools import lru_cache
from typing import Any

from vibro_cli.mechanics.trace import Piece, Trace
from vibro_cli.numerics import alike

_DIGITS = 50
_CERTAIN_DIGITS = 40
_PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640628620900")


@dataclass(frozen=True)
class Heights:
    """Heights (m) of the centre of one body on one piece above its lowest place on the trace."""

    bottom: float
    """At the lowest point of the full circle of its path; on a line at the left end."""
    top: float
    """At the highest point of the full circle; on a line at the right end."""


def heights(trace: Trace, radius: float) -> tuple[Heights, ...]:
    """Return the heights of each piece for a body of the given radius (m)."""
    with localcontext() as context:
        context.prec = _DIGITS
        extremes = _extremes(trace, _decimal(radius))
        lowest = alike.least_of([low for _, _, low in extremes])
        rises = [(bottom - lowest, top - lowest) for bottom, top, _ in extremes]
        # Between two doubles the last digits, which depend on the trace's left end, do not decide.
        context.prec = _CERTAIN_DIGITS
        return tuple(Heights(_double(bottom), _double(top)) for bottom, top in rises)


def _decimal(value: alike.Some) -> Any:
    """A double, or each of many, as a decimal."""
    return alike.each(Decimal, value, kind=object)


def _double(value: Any) -> Any:
    """The double nearest to a decimal, or to each of many."""
    if isinstance(value, Decimal):
        return float(+value)
    return alike.each(lambda one: float(+one), value)


def contains_turn(piece: Piece, angle: float) -> bool:
    """Tell whether an arc contains ``angle`` (rad) plus some whole turns."""
    turns = alike.ceiling((piece.angle_start - angle) / math.tau)
    return angle + turns * math.tau <= piece.angle_end  # type: ignore[no-any-return]


def _extremes(trace: Trace, radius: Any) -> list[tuple[Any, Any, Any]]:
    """Bottom and top of the path of the centre, and the lowest place on the piece, for each."""
    found = []
    cosine = alike.each(_cosine, trace.pieces[0].start_slope, kind=object)
    # The body's centre is above the contact point by r cos(alpha), at every slope.
    contact: Any = Decimal(0)
    for piece in trace.pieces:
        start = contact + radius * cosine
        if piece.is_line:
            sine = alike.each(_sine, piece.start_slope, kind=object)
            contact = contact + _decimal(piece.length) * sine
            end = contact + radius * cosine
            found.append((start, end, alike.least(start, end)))
            continue
        sign = Decimal(piece.sign)
        centre = contact + sign * _decimal(piece.radius) * cosine
        cosine = alike.each(_cosine, piece.end_slope, kind=object)
        contact = centre - sign * _decimal(piece.radius) * cosine
        path_radius = _decimal(piece.radius) - sign * radius
        low = alike.least(start, contact + radius * cosine)
        turn = contains_turn(piece, 0.0 if piece.sign > 0.0 else math.pi)
        low = alike.choose(turn, centre - path_radius, low)
        found.append((centre - path_radius, centre + path_radius, low))
    return found


def _sine(slope: float) -> Decimal:
    return _cosine_of(Decimal(slope) - _PI / 2)


@lru_cache(maxsize=4096)  # the scenarios of a grid ask for the same ones again and again
def _cosine(slope: float) -> Decimal:
    return _cosine_of(Decimal(slope))


def _cosine_of(x: Decimal) -> Decimal:
    """Cosine by its series, after reduction to [-pi, pi] and three halvings."""
    x -= 2 * _PI * (x / (2 * _PI)).to_integral_value()
    x /= 8
    square = x * x
    term = total = Decimal(1)
    n = 0
    while abs(term) > Decimal(10) ** -(_DIGITS + 2):
        n += 2
        term = -term * square / (n * (n - 1))
        total += term
    for _ in range(3):
        total = 2 * total * total - 1
    return total
