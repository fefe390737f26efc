"""Certified tests of which other pieces and bodies a body can touch.

The geometry rests on one comparison. Let a stretch of the trace have slopes within a range smaller
than π and a curvature of at most K = 1/R (to the side of the bodies). Then it is a graph over some
direction, and sin(slope) grows along it at most as fast as on a circle of radius R, so that

- it stays outside a disk of radius r < R that touches it (a body touches that stretch at its point
  of contact only), and
- it stays inside the circle of radius R that encloses two touching bodies on it (the pocket between
  two bodies is largest where the trace is most strongly curved).

The rest of the trace is searched by branch and bound, without sampling. The distance of a point
from an arc is known exactly and changes no faster than the point moves. So an interval of the path
is clear if the distance from its middle exceeds the needed one by more than half its length. A
`Window` selects the stretch of the other piece that must be searched: it leaves out what is joined
to the path by a stretch that turns by less than π, for which the comparison above holds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial, reduce
from itertools import combinations, pairwise, permutations
from operator import and_
from typing import Any

from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.mechanics.system import Body
from vibro_cli.mechanics.trace import Piece, Trace, sine_cosine
from vibro_cli.numerics import elementwise

_SEARCH_LIMIT = 5000
_RESOLUTION = 1e-9
# Number of halvings of the intervals when many paths are searched at once.
_LEVELS = 12
# Length (rad) of an interval below which the search gives up if its middle seems to touch.
_NARROW = 0.1

Interval = tuple[float, float]


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
        """Return the path of the centre of a body of radius `body_radius` (m)."""
        low, high, sign = piece.angle_start, piece.angle_end, piece.sign
        rate = piece.path_scale(body_radius)
        if not piece.is_line:
            return Path(low, high, False, sign, piece.centre, (0.0, 0.0), rate)
        sine, cosine = sine_cosine(piece.start_slope)
        origin = piece.body_centre(0.0, body_radius)
        return Path(low, high, True, sign, origin, (cosine, sine), rate)

    @property
    def size(self) -> float:
        """Upper bound of the coordinates on the path (m)."""
        farthest: float = elementwise.greatest(-self.low, self.high)
        return abs(self.origin[0]) + abs(self.origin[1]) + self.rate * farthest

    def point(self, position: float) -> tuple[float, float]:
        """Return the point of the path at a position."""
        x, y = self.origin
        if self.is_line:
            return x + position * self.along[0], y + position * self.along[1]
        return (
            x + self.rate * elementwise.about("sin", math.sin, position),
            y - self.sign * self.rate * elementwise.about("cos", math.cos, position),
        )

    def distance(self, x: float, y: float, low: float, high: float) -> float:
        """Return the distance of a point from the stretch of the path between two positions."""
        x = x - self.origin[0]
        y = y - self.origin[1]
        found: float
        if self.is_line:
            along = x * self.along[0] + y * self.along[1]
            across = y * self.along[0] - x * self.along[1]
            inside = elementwise.least(elementwise.greatest(along, low), high)
            found = elementwise.distance(along - inside, across)
            return found
        aside = elementwise.direction(x, -self.sign * y) - 0.5 * (low + high)
        turns = elementwise.about("rint", round, aside / math.tau)
        beyond = abs(aside - turns * math.tau) - 0.5 * (high - low)
        radius = elementwise.distance(x, y)
        half_sine = elementwise.about("sin", math.sin, 0.5 * elementwise.greatest(beyond, 0.0))
        chord = 2.0 * elementwise.square_root(radius * self.rate) * half_sine
        found = elementwise.distance(radius - self.rate, chord)
        return found


def _rounding(path: Path, other: Path, needed: float) -> float:
    """Return an upper bound of the rounding error of distances (m) between two paths."""
    return 64.0 * EPSILON * (path.size + other.size + needed)


def is_clear(path: Path, other: Path, window: Window, needed: float) -> bool:
    """Return whether a path is certified to stay farther than `needed` (m) from another one.

    `window.stretch(low, high)` gives the stretch of the other path that must be searched for the
    positions between low and high. Also False if the search remained undecided.
    """
    rounding = _rounding(path, other, needed)
    pending = [(path.low, path.high)]
    for _ in range(_SEARCH_LIMIT):
        if not pending:
            return True
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
        touches = at_middle[0] < at_middle[1] and close
        if touches or half_length < _RESOLUTION * path.size:
            return False
        pending += [(low, middle), (middle, high)]
    return False


def near(paths: Sequence[Path], others: Sequence[Path], needed: float) -> list[tuple[int, int]]:
    """Return the sorted pairs (i, j) of paths that may come within a distance (m).

    All other pairs are certified to stay farther apart: a path stays within half its length of its
    middle.
    """
    sizes = sum(max((path.size for path in row), default=0.0) for row in (paths, others))
    reach = needed + 256.0 * EPSILON * (sizes + needed)
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
    """Return for each of many paths whether it is certified to stay farther than `needed` (m).

    As `is_clear`, with arrays of `count` numbers, or numbers that all share. The result is an array
    of booleans, also False where a few halvings left the search undecided.
    """
    import numpy as np

    clear = np.ones(count, dtype=bool)
    which = np.arange(count)
    low, high = (np.array(np.broadcast_to(end, count)) for end in (path.low, path.high))
    for _ in range(_LEVELS):
        ahead, beside, between, reach_of = elementwise.taken((path, other, window, needed), which)
        stretch = between.stretch(low, high)
        middle = 0.5 * (low + high)
        x, y = ahead.point(middle)
        away = beside.distance(x, y, *stretch) - reach_of
        room = away - 0.5 * (high - low) * ahead.rate
        open_ones = (stretch[0] < stretch[1]) & ~(room > _rounding(ahead, beside, reach_of))
        # On an arc the stretch for the interval may exceed that for its middle: a long one stays
        # open. On a line both are the same.
        touched = open_ones & (away < 0.0)
        if not ahead.is_line:
            touched &= high - low < _NARROW
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
    return elementwise.least(first, last), elementwise.greatest(first, last)


def _junction_slopes(trace: Trace, first: int, last: int) -> Interval:
    """Return the range of the slopes from the end of one piece to the start of a later one.

    Past the seam of a closed trace the piece numbers continue beyond the last piece, and the slopes
    continue as well.
    """
    count = len(trace.pieces)
    turn = _turn(trace)
    ends = [trace.pieces[n % count].end_slope + turn * (n // count) for n in range(first, last)]
    return elementwise.least_of(ends), elementwise.greatest_of(ends)


def _turn(trace: Trace) -> float:
    return trace.pieces[-1].end_slope - trace.pieces[0].start_slope


def _after(piece: Piece, slopes: Interval) -> Any:
    """Return the position from which a piece's slopes span π or more with the slopes before it."""
    low, high = slopes
    within = low + math.pi if piece.sign > 0.0 else math.pi - high
    within = math.inf if piece.is_line else within
    return elementwise.choose(high - low >= math.pi, piece.angle_start, within)


def _before(piece: Piece, slopes: Interval) -> Any:
    """Return the position up to which a piece's slopes span π or more with the slopes after it."""
    low, high = slopes
    within = high - math.pi if piece.sign > 0.0 else -low - math.pi
    within = -math.inf if piece.is_line else within
    return elementwise.choose(high - low >= math.pi, piece.angle_end, within)


def _hull(one: Interval, two: Interval, shift: float) -> Interval:
    return elementwise.least(one[0] + shift, two[0]), elementwise.greatest(one[1] + shift, two[1])


@dataclass(frozen=True)
class Window:
    """The part of a piece that must be searched for a stretch of a path on another piece.

    It leaves out what a stretch of the trace that turns by less than π joins to that path.
    """

    here: Piece
    there: Piece
    to_right: Interval | None
    """Range of slopes on the way from here to the right; None if that way does not lead there."""
    shift_right: float
    to_left: Interval | None
    shift_left: float

    @staticmethod
    def of(trace: Trace, i: int, j: int) -> Window:
        """Return the window from piece i on piece j."""
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
        """Return the stretch for positions between two; it is empty if its ends are reversed."""
        first, last = self.there.angle_start, self.there.angle_end
        slopes = _slopes(self.here, low, high)
        if self.to_right is not None:
            hull = _hull(slopes, self.to_right, self.shift_right)
            first = elementwise.greatest(first, _after(self.there, hull))
        if self.to_left is not None:
            hull = _hull(slopes, self.to_left, self.shift_left)
            last = elementwise.least(last, _before(self.there, hull))
        return first, last


def whole(piece: Piece) -> Window:
    """Return a window on all of a piece."""
    return Window(piece, piece, None, 0.0, None, 0.0)


# Size of the caches: the scenarios of a grid repeat the same calls again and again.
_CACHE_SIZE = 4096


def narrow_valleys(trace: Trace, radius: float) -> list[Any]:
    """Return for each piece whether it is a valley too narrow for a body of `radius` (m): r ≥ R."""
    return [piece.sign > 0.0 and radius >= piece.radius for piece in trace.pieces]


def overlapping_pieces(trace: Trace) -> list[Any]:
    """Return for each piece whether it is an arc that overlaps itself: a full turn or more.

    A closed trace of a single piece may make one full turn.
    """
    limit = math.tau * (1.0 - 4.0 * EPSILON)
    if trace.closed and len(trace.pieces) == 1:
        limit = math.tau * (1.0 + 1e-12)
    return [not p.is_line and p.angle_end - p.angle_start > limit for p in trace.pieces]


@lru_cache(maxsize=_CACHE_SIZE)
def touched_pieces(trace: Trace, radius: float) -> tuple[tuple[int, int], ...]:
    """Return the pairs (i, j) such that a body rolling on piece i may touch another piece j.

    `radius` of the body in m, smaller than that of every valley; with 0 the pairs are those where
    the trace meets itself. An empty result is certified; a pair that rounding leaves undecided is
    listed.
    """
    return tuple(_not_clear(trace, radius, 0.0, True))


def _not_clear(
    trace: Trace, radius_a: float, radius_b: float, both_ways: bool
) -> Iterator[tuple[int, int]]:
    """Yield pairs of pieces i < j on which two bodies may touch; also j < i if `both_ways`."""
    paths_a = [Path.of(piece, radius_a) for piece in trace.pieces]
    paths_b = [Path.of(piece, radius_b) for piece in trace.pieces]
    needed = radius_a + radius_b
    for i, j in near(paths_a, paths_b, needed):
        wanted = i < j or (both_ways and i != j)
        if wanted and not is_clear(paths_a[i], paths_b[j], Window.of(trace, i, j), needed):
            yield i, j


def _adjacent(trace: Trace, i: int, j: int) -> bool:
    steps = abs(i - j)
    return steps <= 1 or (trace.closed and steps == len(trace.pieces) - 1)


@lru_cache(maxsize=_CACHE_SIZE)
def reach(trace: Trace, body_a: Body, body_b: Body) -> tuple[tuple[int, int], ...]:
    """Return the pieces (i, j) on which body a and body b may be in contact, in order.

    On all others the paths of the two centres are certified to stay further apart than r_a + r_b
    while a is on piece i and b on piece j. Pieces are there also when it could not be decided.
    """
    paths_a = [Path.of(piece, body_a.radius) for piece in trace.pieces]
    paths_b = [Path.of(piece, body_b.radius) for piece in trace.pieces]
    needed = body_a.radius + body_b.radius
    return tuple(
        (i, j)
        for i, j in near(paths_a, paths_b, needed)
        if _adjacent(trace, i, j)
        or not is_clear(paths_a[i], paths_b[j], whole(trace.pieces[j]), needed)
    )


def contact_angle(piece: Piece, radius_a: float, radius_b: float) -> float:
    """Return the distance along one piece between touching bodies: β (rad), on a line in m.

    sin(β/2) = √(r_a r_b/(ρ_a ρ_b)) (A (6), B (48), whose arccos loses digits); 2√(r_a r_b) on a
    line (C §3). inf if the bodies are too large to touch within one valley (r_a + r_b > R), where
    they would always overlap.
    """
    if piece.is_line:
        return 2.0 * elementwise.square_root(radius_a * radius_b)
    rho_a, rho_b = piece.path_radius(radius_a), piece.path_radius(radius_b)
    fit = (rho_a > 0.0) & (rho_b > 0.0)
    if not elementwise.occurs(fit):
        return math.inf
    half_sine = elementwise.square_root(radius_a * radius_b / (rho_a * rho_b))
    reached = fit & (half_sine <= 1.0)
    angle: float = elementwise.choose(reached, 2.0 * elementwise.arcsine(half_sine), math.inf)
    return angle


def joined_behind(trace: Trace, radius_a: float, radius_b: float) -> list[Any]:
    """Return for each piece whether its gap to a full turn lets two bodies touch across it.

    Radii in m. At such a contact φ_b − φ_a > 2π − β: the bodies touch on one piece, but not as
    neighbours along it.
    """
    ring = trace.closed and len(trace.pieces) == 1
    return [not ring and _is_joined(piece, radius_a, radius_b) for piece in trace.pieces]


def _is_joined(piece: Piece, radius_a: float, radius_b: float) -> Any:
    sweep = piece.angle_end - piece.angle_start
    if piece.is_line or not elementwise.occurs(sweep > 3.0):
        return False  # β is π at most
    beta = contact_angle(piece, radius_a, radius_b)
    return (beta < math.inf) & (sweep > math.tau - beta - 1e-12)


def touch_across(trace: Trace, radius_a: float, radius_b: float) -> tuple[int, int] | None:
    """Return two pieces on which bodies that are not side by side may touch, or None.

    Radii in m; a is left of b. Bodies are side by side if the trace between them turns by less than
    π; `fits_between` decides about those. The result None is certified.
    """
    return next(_not_clear(trace, radius_a, radius_b, trace.closed), None)


def pocket_radius(curvature: float, radius_a: float, radius_b: float) -> float:
    """Return the radius (m) of the largest disk between the trace and two touching bodies on it.

    `curvature` K of the trace in 1/m, positive in a valley. By Descartes' theorem of four touching
    circles, 1/r = 1/r_a + 1/r_b − K + 2√(1/(r_a r_b) − K(1/r_a + 1/r_b)). inf if the two bodies do
    not fit side by side in the valley.
    """
    a, b = 1.0 / radius_a, 1.0 / radius_b
    under_root = a * b - curvature * (a + b)
    root = elementwise.square_root(elementwise.greatest(under_root, 0.0))
    radius: float = elementwise.choose(
        under_root < 0.0, math.inf, 1.0 / (a + b - curvature + 2.0 * root)
    )
    return radius


def fits_between(trace: Trace, outer: tuple[float, float], between: tuple[float, ...]) -> Any:
    """Return whether two touching bodies may enclose all of the given others on the trace.

    Radii in m, in order from left to right. The result False is certified. On a single piece the
    result is exact; on a chain the tightest valley decides, and bodies that fit one by one count as
    fitting together.
    """
    curvature = elementwise.greatest_of(
        [0.0, *(1.0 / p.radius for p in trace.pieces if p.sign > 0.0)]
    )
    largest = pocket_radius(curvature, *outer)
    one_by_one = reduce(and_, [radius <= largest * (1.0 + 1e-12) for radius in between])
    if len(trace.pieces) > 1:
        return one_by_one
    piece = trace.pieces[0]
    row = (outer[0], *between, outer[1])
    room = contact_angle(piece, *outer)
    taken = [contact_angle(piece, a, b) for a, b in pairwise(row)]
    together = elementwise.exact_sum(taken) <= room * (1.0 + 16.0 * EPSILON)
    finite = reduce(and_, [angle < math.inf for angle in (room, *taken)])
    return elementwise.choose(finite, together, one_by_one)


Between = tuple[tuple[int, int], tuple[int, ...]]
"""Two bodies, from left to right, and the bodies between them."""


@dataclass(frozen=True)
class Overreach:
    """Two bodies that may be able to touch although they do not meet as neighbours."""

    first: int
    """Index of the body on the left."""
    second: int
    """Index of the body on the right."""
    over: tuple[int, ...]
    """Indices of the bodies over which they touch; empty if across a gap of the trace."""
    pieces: tuple[int, int] | None = None
    """Pieces on which they touch across a gap, else None."""


def not_neighbours(count: int, closed: bool) -> Iterator[tuple[int, int]]:
    """Yield every pair of bodies that are not neighbours."""
    for first, second in combinations(range(count), 2):
        if 1 < second - first < (count - 1 if closed else count):
            yield first, second


def over_others(
    count: int, closed: bool, too_long: Callable[[int, tuple[int, ...]], bool] | None = None
) -> Iterator[Between]:
    """Yield every pair of bodies with the bodies between them.

    On a closed trace this includes neighbours, which have all the others between them the other
    way round. `too_long(left, row)` ends the rows to the right of a body: longer ones are skipped.
    """
    for left in range(count):
        row: tuple[int, ...] = ()
        for steps in range(2, count if closed else count - left):
            row = (*row, (left + steps - 1) % count)
            yield (left, (left + steps) % count), row
            if too_long is not None and too_long(left, row):
                break


def _is_full(
    trace: Trace, radii: tuple[float, ...], largest: float, left: int, row: tuple[int, ...]
) -> bool:
    """Return whether a row to the right of a body, and so any longer one, has no room.

    It does not even fit between the body and the `largest` one, which leaves the most room.
    """
    radius, more_than_rounding = radii[left], 1.0 + 1e-9
    if len(trace.pieces) > 1:
        bends = (1.0 / p.radius for p in trace.pieces if p.sign > 0.0)
        pocket = pocket_radius(max(bends, default=0.0), radius, largest)
        return max(radii[n] for n in row) > pocket * more_than_rounding
    piece = trace.pieces[0]
    if contact_angle(piece, largest, largest) == math.inf:
        return False
    sizes = (radius, *(radii[n] for n in row))
    taken = sum(contact_angle(piece, a, b) for a, b in pairwise(sizes))
    return taken > contact_angle(piece, radius, largest) * more_than_rounding


def overreaching(trace: Trace, radii: tuple[float, ...]) -> tuple[Overreach, ...]:
    """Return the pairs of bodies that may be able to touch although they do not meet as neighbours.

    `radii` in m, in order along the trace. An empty result certifies that only neighbours ever
    touch, with nothing between them (on a line: no body is smaller than a quarter of two equal ones
    around it).
    """
    across: dict[tuple[float, float], tuple[int, int] | None] = {}
    found: list[Overreach] = []
    largest = max(radii, default=0.0)
    is_full = partial(_is_full, trace, radii, largest)
    for (left, right), row in over_others(len(radii), trace.closed, is_full):
        if fits_between(trace, (radii[left], radii[right]), tuple(radii[n] for n in row)):
            found.append(Overreach(min(left, right), max(left, right), row))
    # The largest body, where it touches the trace, encloses every other body at that point.
    if len(radii) < 3 or touch_across(trace, largest, largest) is None:
        return tuple(found)
    for first, second in not_neighbours(len(radii), trace.closed):
        pair = (radii[first], radii[second])
        if pair not in across:
            across[pair] = touch_across(trace, *pair)
        pieces = across[pair]
        if pieces is not None:
            found.append(Overreach(first, second, (), pieces))
    return tuple(found)


def surely_sound(trace: Trace, radii: Sequence[float], count: int) -> Any:
    """Return for each of many traces whether bodies certainly touch own piece and neighbours only.

    Numbers are arrays of `count`, or shared by all; radii in m, of bodies that fit every valley.
    Where the result is True, `overreaching` finds nothing, nor does `touched_pieces` for any of the
    radii or for 0. Those functions search one trace until it is decided; here `surely_clear` makes
    a few halvings for all traces at once. The result is also False where these left it undecided.
    """
    import numpy as np

    sound: Any = np.ones(count, dtype=bool)
    for (left, right), row in over_others(len(radii), trace.closed):
        between = tuple(radii[n] for n in row)
        fits = fits_between(trace, (radii[left], radii[right]), between)
        sound = sound & np.logical_not(fits)
    # The largest body, where it touches the trace, encloses every other body at that point.
    asked = [(elementwise.greatest_of(radii), 0.0, True)]
    asked += [
        (radii[a], radii[b], trace.closed) for a, b in not_neighbours(len(radii), trace.closed)
    ]
    for i, j in permutations(range(len(trace.pieces)), 2):
        window = Window.of(trace, i, j)
        for a, b, both_ways in asked:
            if i < j or both_ways:
                path, other = Path.of(trace.pieces[i], a), Path.of(trace.pieces[j], b)
                sound = sound & surely_clear(path, other, window, a + b, count)
    return sound
