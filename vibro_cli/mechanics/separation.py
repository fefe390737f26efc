"""Whether a path keeps a distance from another piece of the trace: certified, nothing is sampled.

The distance of a point from an arc is known exactly, and it changes no faster than the point moves,
so that an interval of the path is done when the distance from its middle exceeds what is needed by
more than half its length. What is regarded of the other piece is told by a window: for a stretch
between the two that turns by less than π there are better reasons (see ``mechanics.clearance``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

from vibro_cli.mechanics.trace import Piece, Trace, sine_cosine
from vibro_cli.numerics import alike

_EPSILON = 2.0**-52
_SEARCH_LIMIT = 5000
_RESOLUTION = 1e-9
# Halvings of many paths at once.
_LEVELS = 12
# Stretches (rad, m) of a path that are short enough to give up where the middle seems to touch.
_NARROW = 0.1

Interval = tuple[float, float]


class Answer(Enum):
    """What a search has found out about the distance of two paths."""

    CLEAR = "clear"
    TOUCH = "touch"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Path:
    """The path of the centre of a body on one piece (or the piece itself, for radius 0)."""

    low: float
    high: float
    is_line: bool
    sign: float
    origin: tuple[float, float]
    along: tuple[float, float]
    rate: float

    @staticmethod
    def of(piece: Piece, body_radius: float) -> Path:
        """Return the path of a body of a radius (m)."""
        low, high, sign = piece.angle_start, piece.angle_end, piece.sign
        if not piece.is_line:
            rate = piece.path_radius(body_radius)
            return Path(low, high, False, sign, piece.center, (0.0, 0.0), rate)
        sine, cosine = sine_cosine(piece.start_slope)
        origin = piece.body_center(0.0, body_radius)
        return Path(low, high, True, sign, origin, (cosine, sine), 1.0)

    @property
    def size(self) -> float:
        """Size of the coordinates on the path (m)."""
        farthest: float = alike.greatest(-self.low, self.high)
        return abs(self.origin[0]) + abs(self.origin[1]) + self.rate * farthest

    def point(self, position: float) -> tuple[float, float]:
        """Return the point of the path at a position."""
        x, y = self.origin
        if self.is_line:
            return x + position * self.along[0], y + position * self.along[1]
        return (
            x + self.rate * alike.about("sin", math.sin, position),
            y - self.sign * self.rate * alike.about("cos", math.cos, position),
        )

    def distance(self, x: float, y: float, low: float, high: float) -> float:
        """Return the distance of a point from the stretch of the path between two positions."""
        x = x - self.origin[0]
        y = y - self.origin[1]
        found: float
        if self.is_line:
            along = x * self.along[0] + y * self.along[1]
            across = y * self.along[0] - x * self.along[1]
            inside = alike.least(alike.greatest(along, low), high)
            found = alike.distance(along - inside, across)
            return found
        aside = alike.direction(x, -self.sign * y) - 0.5 * (low + high)
        turns = alike.about("rint", round, aside / math.tau)
        beyond = abs(aside - turns * math.tau) - 0.5 * (high - low)
        radius = alike.distance(x, y)
        half_sine = alike.about("sin", math.sin, 0.5 * alike.greatest(beyond, 0.0))
        chord = 2.0 * alike.square_root(radius * self.rate) * half_sine
        found = alike.distance(radius - self.rate, chord)
        return found


def _rounding(path: Path, other: Path, needed: float) -> float:
    """More than what distances (m) of two paths can be wrong by."""
    return 64.0 * _EPSILON * (path.size + other.size + needed)


def search(path: Path, other: Path, window: Window, needed: float) -> Answer:
    """Tell whether every point of a path keeps more than a distance from another path.

    `window.stretch(low, high)` gives the stretch of the other path that has to be regarded for the
    positions between low and high.
    """
    rounding = _rounding(path, other, needed)
    pending = [(path.low, path.high)]
    for _ in range(_SEARCH_LIMIT):
        if not pending:
            return Answer.CLEAR
        low, high = pending.pop()
        stretch = window.stretch(low, high)
        if stretch[0] >= stretch[1]:
            continue
        middle = 0.5 * (low + high)
        half_length = 0.5 * (high - low) * path.rate
        x, y = path.point(middle)
        if other.distance(x, y, *stretch) - half_length > needed + rounding:
            continue
        at_middle = window.stretch(middle, middle)
        close = other.distance(x, y, *at_middle) < needed - rounding
        if at_middle[0] < at_middle[1] and close:
            return Answer.TOUCH
        if half_length < _RESOLUTION * path.size:
            return Answer.UNDECIDED
        pending.append((low, middle))
        pending.append((middle, high))
    return Answer.UNDECIDED


def near(paths: Sequence[Path], others: Sequence[Path], needed: float) -> list[tuple[int, int]]:
    """Return the pairs (i, j) of paths that may come within a distance (m), in order.

    Of all others a bound certifies that they stay further apart: a path stays within half its
    length of its middle.
    """
    sizes = sum(max((path.size for path in row), default=0.0) for row in (paths, others))
    reach = needed + 256.0 * _EPSILON * (sizes + needed)
    edges = []
    for side, row in enumerate((paths, others)):
        for index, path in enumerate(row):
            middle, half = 0.5 * (path.low + path.high), 0.5 * (path.high - path.low) * path.rate
            aside = middle * path.along[0] if path.is_line else path.rate * math.sin(middle)
            x = path.origin[0] + aside
            edges.append((x - half, x + half + reach, side, index))
    found = []
    open_ones: tuple[dict[int, float], dict[int, float]] = ({}, {})
    for left, right, side, index in sorted(edges):
        beside = open_ones[1 - side]
        for other, end in list(beside.items()):
            if end < left:
                del beside[other]
            else:
                found.append((index, other) if side == 0 else (other, index))
        open_ones[side][index] = right
    return sorted(found)


def surely_clear(path: Path, other: Path, window: Window, needed: Any, count: int) -> Any:
    """Return where each of some paths is certified to keep more than a distance from another.

    Their numbers and `needed` (m) are arrays of `count`, or the same for all. An array of truth
    values; false also where it was not found out soon.
    """
    import numpy as np

    clear = np.ones(count, dtype=bool)
    which = np.arange(count)
    low, high = (np.array(np.broadcast_to(end, count)) for end in (path.low, path.high))
    for _ in range(_LEVELS):
        ahead, beside, between, reach_of = alike.taken((path, other, window, needed), which)
        stretch = between.stretch(low, high)
        middle = 0.5 * (low + high)
        x, y = ahead.point(middle)
        away = beside.distance(x, y, *stretch) - reach_of
        room = away - 0.5 * (high - low) * ahead.rate
        open_ones = (stretch[0] < stretch[1]) & ~(room > _rounding(ahead, beside, reach_of))
        # What is regarded may be more than what there is for the middle: then it is in doubt.
        touched = open_ones & (away < 0.0) & (high - low < _NARROW)
        clear[which[touched]] = False
        open_ones &= clear[which]
        which = np.tile(which[open_ones], 2)
        ends = low[open_ones], middle[open_ones], high[open_ones]
        low, high = np.concatenate(ends[:2]), np.concatenate(ends[1:])
        if not len(which):
            break
    clear[which] = False
    return clear


def _slopes(piece: Piece, low: float, high: float) -> Interval:
    """Return the least and the greatest slope between two positions on a piece."""
    first, last = piece.slope(low), piece.slope(high)
    return alike.least(first, last), alike.greatest(first, last)


def _junction_slopes(trace: Trace, first: int, last: int) -> Interval:
    """Return the range of the slopes from the end of one piece to the start of a later one.

    Past the seam of a closed trace the numbers go on beyond the last piece, and so do the slopes.
    """
    count = len(trace.pieces)
    turn = _turn(trace)
    ends = [trace.pieces[n % count].end_slope + turn * (n // count) for n in range(first, last)]
    return alike.least_of(ends), alike.greatest_of(ends)


def _turn(trace: Trace) -> float:
    return trace.pieces[-1].end_slope - trace.pieces[0].start_slope


def _after(piece: Piece, slopes: Interval) -> Any:
    """Return where a piece leaves the slopes within π of all those before it (its end: nowhere)."""
    low, high = slopes
    within = low + math.pi if piece.sign > 0.0 else math.pi - high
    within = math.inf if piece.is_line else within
    return alike.choose(high - low >= math.pi, piece.angle_start, within)


def _before(piece: Piece, slopes: Interval) -> Any:
    """Return where a piece, going left, leaves the slopes within π of all those behind it."""
    low, high = slopes
    within = high - math.pi if piece.sign > 0.0 else -low - math.pi
    within = -math.inf if piece.is_line else within
    return alike.choose(high - low >= math.pi, piece.angle_end, within)


def _hull(one: Interval, two: Interval, shift: float) -> Interval:
    return alike.least(one[0] + shift, two[0]), alike.greatest(one[1] + shift, two[1])


@dataclass(frozen=True)
class Window:
    """What of a piece no stretch turning less than π joins to a place on another one."""

    here: Piece
    there: Piece
    to_right: Interval | None
    """Slopes between them on the way to the right, None where there is no such way."""
    shift_right: float
    to_left: Interval | None
    shift_left: float

    @staticmethod
    def of(trace: Trace, i: int, j: int) -> Window:
        """Return what of piece j is so, seen from piece i."""
        count, turn = len(trace.pieces), _turn(trace)
        to_right = to_left = None
        shift_right = 0.0 if i < j else -turn
        shift_left = 0.0 if i > j else turn
        if i < j or trace.closed:
            slopes = _junction_slopes(trace, i, j if i < j else j + count)
            to_right = (slopes[0] + shift_right, slopes[1] + shift_right)
        if i > j or trace.closed:
            to_left = _junction_slopes(trace, j, i if i > j else i + count)
        here, there = trace.pieces[i], trace.pieces[j]
        return Window(here, there, to_right, shift_right, to_left, shift_left)

    def stretch(self, low: float, high: float) -> Interval:
        """Return the stretch for the positions between two; its ends in disorder: there is none."""
        first, last = self.there.angle_start, self.there.angle_end
        slopes = _slopes(self.here, low, high)
        if self.to_right is not None:
            hull = _hull(slopes, self.to_right, self.shift_right)
            first = alike.greatest(first, _after(self.there, hull))
        if self.to_left is not None:
            hull = _hull(slopes, self.to_left, self.shift_left)
            last = alike.least(last, _before(self.there, hull))
        return first, last


def whole(piece: Piece) -> Window:
    """Return a window that shows all of a piece, whatever is between."""
    return Window(piece, piece, None, 0.0, None, 0.0)
