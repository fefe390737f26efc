"""The trace: a plane curve of valleys, humps and lines with a common tangent at every junction.

Its numbers may be arrays (see ``numerics.elementwise``), for many traces of the same shapes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from vibro_cli.numerics import elementwise

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

VALLEY = "valley"
HUMP = "hump"
LINE = "line"

Point = tuple[float, float]
Along = TypeVar("Along", float, "NDArray[np.float64]")
"""A coordinate along a piece, or an array of them."""

_SIGN = {VALLEY: 1.0, HUMP: -1.0, LINE: 0.0}


def sine_cosine(angle: float) -> Point:
    """Return (sin, cos) of an angle (rad), with exact zeros at multiples of π/2.

    A sine within half a unit in the last place of the angle is that of the double nearest to a
    multiple of π, and is returned as 0; likewise the cosine at odd multiples of π/2.
    """
    rounding = 0.5 * elementwise.last_place(angle)
    sine = elementwise.sine(angle)
    cosine = elementwise.cosine(angle)
    return (
        elementwise.zero_where(abs(sine) <= rounding, sine),
        elementwise.zero_where(abs(cosine) <= rounding, cosine),
    )


def bends(shape: str, start_slope: float, end_slope: float) -> Any:
    """Return whether the slope rises, as in a valley, or falls, as on a hump."""
    return _SIGN[shape] * (end_slope - start_slope) > 0.0


@dataclass(frozen=True)
class ArcShape:
    """Description of a piece: shape, with radius (m) and end slope (rad), or length (m)."""

    shape: str
    radius: float | None = None
    length: float | None = None
    end_slope: float | None = None


@dataclass(frozen=True)
class Piece:
    """One arc or line of the trace, with its place in the plane.

    The coordinate of a body on a piece (`position` below) is φ = α in a valley, ψ = −α on a hump,
    both in rad and growing to the right, and the distance in m from the left end on a line.
    """

    index: int
    """Number of the piece, from 0."""
    shape: str
    """`valley`, `hump` or `line`."""
    sign: float
    """+1 valley, −1 hump, 0 line: the curvature is sign/radius."""
    radius: float
    """Radius R of the arc (m); inf for a line."""
    start_slope: float
    """Slope angle α of the tangent at the left end (rad)."""
    end_slope: float
    """Slope angle α of the tangent at the right end (rad)."""
    length: float
    """Arc length (m)."""
    start_s: float
    """Arc length of the left end, from the left end of the trace (m)."""
    start: Point
    """Left end (m)."""
    end: Point
    """Right end (m)."""
    centre: Point
    """Centre O of the arc (m); (nan, nan) for a line."""
    angle_start: float
    """Coordinate of the left end: φ or ψ (rad); 0 on a line."""
    angle_end: float
    """Coordinate of the right end: φ or ψ (rad); the length on a line (m)."""

    @property
    def is_line(self) -> bool:
        """Whether the piece is straight."""
        return self.sign == 0.0

    def path_radius(self, body_radius: float) -> float:
        """Return ρ (m), the radius of the path of a body's centre: R − r, R + r, inf on a line."""
        return math.inf if self.is_line else self.radius - self.sign * body_radius

    def path_scale(self, body_radius: float) -> float:
        """Return the ratio of speed to rate of position: ρ (m) on an arc, 1 on a line."""
        return 1.0 if self.is_line else self.path_radius(body_radius)

    def slope(self, position: float) -> float:
        """Return the slope angle α (rad) at a position on this piece."""
        return self.start_slope if self.is_line else self.sign * position

    def arc_length(self, position: Along) -> Along:
        """Return s (m), the arc length of the contact point from the left end of the trace."""
        along = position if self.is_line else self.radius * (position - self.angle_start)
        return self.start_s + along

    def body_centre(self, position: float, body_radius: float) -> Point:
        """Return the centre (m) of a body of the given radius (m) at a position on this piece.

        Valley O + ρ(sin φ, −cos φ), hump O + ρ(sin ψ, cos ψ), line P + r n; radius 0 gives the
        contact point.
        """
        return self.centre_and_tangent(position, body_radius)[0]

    def centre_and_tangent(self, position: float, body_radius: float) -> tuple[Point, Point]:
        """Return the centre (m) of a body, see `body_centre`, and the tangent of its path."""
        sine, cosine = sine_cosine(self.slope(position))
        if self.is_line:
            centre = (
                elementwise.exact_sum((self.start[0], position * cosine, -body_radius * sine)),
                elementwise.exact_sum((self.start[1], position * sine, body_radius * cosine)),
            )
        else:  # its slope is sign · φ or sign · ψ
            rho = self.sign * self.path_radius(body_radius)
            centre = (self.centre[0] + rho * sine, self.centre[1] - rho * cosine)
        return centre, (cosine, sine)

    def contact_point(self, position: float) -> Point:
        """Return the point (m) of the trace at a position on this piece."""
        return self.body_centre(position, 0.0)


class _Pen:
    """The end of the chain drawn so far.

    Its coordinates are kept as exact sums, so that symmetric traces stay symmetric.
    """

    def __init__(self, slope: float) -> None:
        self.slope = slope
        self._x: list[float] = []
        self._y: list[float] = []
        self._s: list[float] = []

    def _place(self, *more: float) -> Point:
        """Return the end of the chain, shifted by (x, y) if given, rounded once."""
        return (
            elementwise.exact_sum([*self._x, *more[:1]]),
            elementwise.exact_sum([*self._y, *more[1:]]),
        )

    def arc_length(self) -> float:
        """Return the length of the chain drawn so far."""
        return elementwise.exact_sum(self._s)

    def draw(self, index: int, shape: str, radius: float, length: float, end_slope: float) -> Piece:
        """Append a piece to the chain and return it."""
        sign, start, start_s = _SIGN[shape], self._place(), self.arc_length()
        start_slope, self.slope = self.slope, end_slope
        sine, cosine = sine_cosine(start_slope)
        if shape == LINE:
            centre, ends = (math.nan, math.nan), (0.0, length)
            self._x.append(length * cosine)
            self._y.append(length * sine)
        else:
            # contact point P = O + sign R (sin α, −cos α), for valley and hump alike
            reach = sign * radius
            to_centre = (-reach * sine, reach * cosine)
            centre, ends = self._place(*to_centre), (sign * start_slope, sign * end_slope)
            sine, cosine = sine_cosine(end_slope)
            self._x += (to_centre[0], reach * sine)
            self._y += (to_centre[1], -reach * cosine)
        self._s.append(length)
        self._x, self._y, self._s = map(elementwise.fewer_terms, (self._x, self._y, self._s))
        return Piece(
            index=index,
            shape=shape,
            sign=sign,
            radius=radius,
            start_slope=start_slope,
            end_slope=end_slope,
            length=length,
            start_s=start_s,
            start=start,
            end=self._place(),
            centre=centre,
            angle_start=ends[0],
            angle_end=ends[1],
        )


def _draw(pen: _Pen, index: int, described: ArcShape) -> Piece:
    shape = described.shape
    if shape not in _SIGN:
        raise ValueError(f"piece {index + 1}: unknown shape {shape!r}")
    if shape == LINE:
        if described.length is None or not elementwise.holds(described.length > 0.0):
            raise ValueError(f"piece {index + 1}: a line needs a length greater than 0")
        return pen.draw(index, shape, math.inf, described.length, pen.slope)
    radius, end_slope = described.radius, described.end_slope
    if radius is None or not elementwise.holds(radius > 0.0):
        raise ValueError(f"piece {index + 1}: a {shape} needs a radius greater than 0")
    if end_slope is None:
        raise ValueError(f"piece {index + 1}: a {shape} needs an end slope")
    if not elementwise.holds(bends(shape, pen.slope, end_slope)):
        turn = "rise" if shape == VALLEY else "fall"
        raise ValueError(f"piece {index + 1}: the slope of a {shape} must {turn}")
    return pen.draw(index, shape, radius, radius * abs(end_slope - pen.slope), end_slope)


@dataclass(frozen=True)
class Trace:
    """A chain of pieces with a common tangent at every junction; the left end is the origin."""

    pieces: tuple[Piece, ...]
    closed: bool
    """Whether the right end of the last piece is joined to the left end of the first."""
    length: float
    """Arc length of the whole chain (m)."""

    @staticmethod
    def chain(start_slope: float, shapes: Sequence[ArcShape], closed: bool = False) -> Trace:
        """Build the trace from the slope at its left end and the descriptions of its pieces.

        `start_slope` in rad. Valleys turn left (α grows with s), humps right; x to the right, y up.
        Raises ValueError if a piece lacks a dimension or its slope changes against its shape. The
        caller must test with `closing_error` that a closed chain closes.
        """
        if not shapes:
            raise ValueError("a trace needs at least one piece")
        pen = _Pen(start_slope)
        pieces = tuple(_draw(pen, index, described) for index, described in enumerate(shapes))
        return Trace(pieces, closed, pen.arc_length())

    def mirrored(self) -> Trace:
        """Return the mirror image, with left and right exchanged."""
        shapes = [
            ArcShape(piece.shape, length=piece.length)
            if piece.is_line
            else ArcShape(piece.shape, radius=piece.radius, end_slope=-piece.start_slope)
            for piece in reversed(self.pieces)
        ]
        return Trace.chain(-self.pieces[-1].end_slope, shapes, self.closed)

    def closing_error(self) -> tuple[float, float]:
        """Return the distance between the ends (m) and the difference of their slopes (rad)."""
        first, last = self.pieces[0], self.pieces[-1]
        distance = math.hypot(last.end[0] - first.start[0], last.end[1] - first.start[1])
        return distance, last.end_slope - first.start_slope
