"""What a body can touch: its own piece only, and which other bodies; every answer is certified.

The geometry rests on one comparison. Let a stretch of the trace have slopes within a range smaller
than π and a curvature of at most K = 1/R (to the side of the bodies). Then it is a graph over some
direction, and sin(slope) grows along it at most as fast as on a circle of radius R, so that

- it stays outside a disk of radius r < R that touches it (a body touches nothing of that stretch
  but its point of contact), and
- it stays inside the circle of radius R that encloses two touching bodies on it (the pocket between
  two bodies is the largest where the trace is bent the most).

What lies beyond such a stretch is searched by branch and bound (``mechanics.separation``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache, reduce
from itertools import combinations, pairwise
from operator import and_
from typing import Any

from vibro_cli.mechanics.body import Body
from vibro_cli.mechanics.separation import Answer, Path, Window, near, search, whole
from vibro_cli.mechanics.trace import Piece, Trace
from vibro_cli.numerics import alike

_EPSILON = 2.0**-52
# Answers that are kept: the scenarios of a grid ask for the same ones again and again.
_REMEMBERED = 4096


def narrow_valleys(trace: Trace, radius: float) -> tuple[int, ...]:
    """Return the indices of the valleys that a body of the given radius (m) does not fit: r ≥ R."""
    return tuple(p.index for p in trace.pieces if p.sign > 0.0 and radius >= p.radius)


def overlapping_pieces(trace: Trace) -> tuple[int, ...]:
    """Return the indices of the arcs that run over themselves, with a full turn or more.

    A full turn is right only for a single piece that is closed.
    """
    limit = math.tau * (1.0 - 4.0 * _EPSILON)
    if trace.closed and len(trace.pieces) == 1:
        limit = math.tau * (1.0 + 1e-12)
    return tuple(
        p.index for p in trace.pieces if not p.is_line and p.angle_end - p.angle_start > limit
    )


@lru_cache(maxsize=_REMEMBERED)
def touched_pieces(trace: Trace, radius: float) -> tuple[tuple[int, int], ...]:
    """Return the pairs (i, j) such that a body rolling on piece i may touch piece j elsewhere.

    `radius` of the body in m, smaller than that of every valley; 0 finds where the trace meets
    itself. An empty answer is certified; where rounding hides whether a body just touches, the
    pair is listed.
    """
    paths = [Path.of(piece, radius) for piece in trace.pieces]
    pieces = [Path.of(piece, 0.0) for piece in trace.pieces]
    return tuple(
        (i, j)
        for i, j in near(paths, pieces, radius)
        if i != j
        and search(paths[i], pieces[j], Window.of(trace, i, j), radius) is not Answer.CLEAR
    )


def _adjacent(trace: Trace, i: int, j: int) -> bool:
    steps = abs(i - j)
    return steps <= 1 or (trace.closed and steps == len(trace.pieces) - 1)


@lru_cache(maxsize=_REMEMBERED)
def reach(trace: Trace, body_a: Body, body_b: Body) -> tuple[tuple[bool, ...], ...]:
    """Return for each two pieces whether body a and body b on them can never be in contact.

    `far[i][j]` is True when the paths of the two centres are certified to stay further apart
    than r_a + r_b while a is on piece i and b on piece j, else False (also when it could not be
    decided).
    """
    paths_a = [Path.of(piece, body_a.radius) for piece in trace.pieces]
    paths_b = [Path.of(piece, body_b.radius) for piece in trace.pieces]
    needed = body_a.radius + body_b.radius
    far = [[True] * len(paths_b) for _ in paths_a]
    for i, j in near(paths_a, paths_b, needed):
        far[i][j] = (
            not _adjacent(trace, i, j)
            and search(paths_a[i], paths_b[j], whole(trace.pieces[j]), needed) is Answer.CLEAR
        )
    return tuple(map(tuple, far))


def contact_angle(piece: Piece, radius_a: float, radius_b: float) -> float:
    """Return how far apart on one piece touching bodies are: β (rad), on a line in m.

    sin(β/2) = √(r_a r_b/(ρ_a ρ_b)) (A (6), B (48)); 2√(r_a r_b) on a line (C §3). inf when the
    bodies are too large to touch within one valley (r_a + r_b > R): there they would always
    overlap.
    """
    if piece.is_line:
        return 2.0 * alike.square_root(radius_a * radius_b)
    rho_a, rho_b = piece.path_radius(radius_a), piece.path_radius(radius_b)
    fit = (rho_a > 0.0) & (rho_b > 0.0)
    if not alike.occurs(fit):
        return math.inf
    half_sine = alike.square_root(radius_a * radius_b / (rho_a * rho_b))
    reached = fit & (half_sine <= 1.0)
    angle: float = alike.choose(reached, 2.0 * alike.arcsine(half_sine), math.inf)
    return angle


def joined_behind(trace: Trace, radius_a: float, radius_b: float) -> tuple[int, ...]:
    """Return the arcs so nearly a full turn that two bodies touch through the gap.

    Radii in m. There φ_b − φ_a > 2π − β: a contact on one piece on which the bodies are not
    neighbours.
    """
    if trace.closed and len(trace.pieces) == 1:
        return ()
    return tuple(
        p.index
        for p in trace.pieces
        if not p.is_line
        and math.isfinite(beta := contact_angle(p, radius_a, radius_b))
        and p.angle_end - p.angle_start > math.tau - beta - 1e-12
    )


def touch_across(trace: Trace, radius_a: float, radius_b: float) -> tuple[int, int] | None:
    """Return two pieces on which bodies may touch that are not side by side on the trace, or None.

    Radii in m; a is left of b. Side by side are bodies with a stretch between them that turns by
    less than π: what happens there is for `fits_between`. None is certified.
    """
    paths_a = [Path.of(piece, radius_a) for piece in trace.pieces]
    paths_b = [Path.of(piece, radius_b) for piece in trace.pieces]
    needed = radius_a + radius_b
    for i, j in near(paths_a, paths_b, needed):
        if i == j or (i > j and not trace.closed):
            continue
        if search(paths_a[i], paths_b[j], Window.of(trace, i, j), needed) is not Answer.CLEAR:
            return i, j
    return None


def pocket_radius(curvature: float, radius_a: float, radius_b: float) -> float:
    """Return the radius (m) of the largest disk below two touching bodies on the trace.

    `curvature` of the trace in 1/m, positive in a valley; Descartes' theorem of four touching
    circles: 1/r = 1/r_a + 1/r_b − K + 2√(1/(r_a r_b) − K(1/r_a + 1/r_b)). inf when two such
    bodies do not fit side by side in the valley.
    """
    a, b = 1.0 / radius_a, 1.0 / radius_b
    under_root = a * b - curvature * (a + b)
    root = alike.square_root(alike.greatest(under_root, 0.0))
    radius: float = alike.choose(under_root < 0.0, math.inf, 1.0 / (a + b - curvature + 2.0 * root))
    return radius


def fits_between(trace: Trace, outer: tuple[float, float], between: tuple[float, ...]) -> Any:
    """Tell whether two touching bodies may have all of some others between them on the trace.

    Radii in m, in order from left to right. False is certified. On a single piece the answer is
    exact; on a chain the tightest valley decides, and bodies that fit one by one count as
    fitting together.
    """
    curvature = alike.greatest_of([0.0, *(1.0 / p.radius for p in trace.pieces if p.sign > 0.0)])
    largest = pocket_radius(curvature, *outer)
    one_by_one = reduce(and_, [radius <= largest * (1.0 + 1e-12) for radius in between])
    if len(trace.pieces) > 1:
        return one_by_one
    piece = trace.pieces[0]
    row = (outer[0], *between, outer[1])
    room = contact_angle(piece, *outer)
    taken = [contact_angle(piece, a, b) for a, b in pairwise(row)]
    together = alike.exact_sum(taken) <= room * (1.0 + 16.0 * _EPSILON)
    finite = reduce(and_, [angle < math.inf for angle in (room, *taken)])
    return alike.choose(finite, together, one_by_one)


Between = tuple[tuple[int, int], tuple[int, ...]]
"""Two bodies, from left to right, and those between them."""


@dataclass(frozen=True)
class Overreach:
    """Two bodies that may be able to touch, but not as neighbours do."""

    first: int
    """Index of the body on the left."""
    second: int
    """Index of the body on the right."""
    over: tuple[int, ...]
    """Indices of the bodies over which they touch; empty if across a gap of the trace."""
    pieces: tuple[int, int] | None = None
    """Pieces on which they touch across a gap."""


def not_neighbours(count: int, closed: bool) -> Iterator[tuple[int, int]]:
    """Give every two bodies that are not neighbours."""
    for first, second in combinations(range(count), 2):
        if 1 < second - first < (count - 1 if closed else count):
            yield first, second


def over_others(
    count: int, closed: bool, too_long: Callable[[int, tuple[int, ...]], bool] | None = None
) -> Iterator[Between]:
    """Give every two bodies with others between them.

    On a closed trace neighbours too, which have all the others between them the other way round.
    `too_long` tells of a body and a row right of it that no longer row needs to be given.
    """
    for left in range(count):
        row: tuple[int, ...] = ()
        for steps in range(2, count if closed else count - left):
            row = (*row, (left + steps - 1) % count)
            yield (left, (left + steps) % count), row
            if too_long is not None and too_long(left, row):
                break


@dataclass(frozen=True)
class _Room:
    """What a body and any other leave between them at most: what the largest one leaves."""

    trace: Trace
    radii: tuple[float, ...]
    largest: float

    def is_left_by(self, left: int, row: tuple[int, ...]) -> bool:
        """Whether a row right of a body is too long for it, and so every longer one."""
        radius, more_than_rounding = self.radii[left], 1.0 + 1e-9
        if len(self.trace.pieces) > 1:
            bends = (1.0 / p.radius for p in self.trace.pieces if p.sign > 0.0)
            pocket = pocket_radius(max(bends, default=0.0), radius, self.largest)
            return max(self.radii[n] for n in row) > pocket * more_than_rounding
        piece = self.trace.pieces[0]
        if contact_angle(piece, self.largest, self.largest) == math.inf:
            return False
        sizes = (radius, *(self.radii[n] for n in row))
        taken = sum(contact_angle(piece, a, b) for a, b in pairwise(sizes))
        return taken > contact_angle(piece, radius, self.largest) * more_than_rounding


def overreaching(trace: Trace, radii: tuple[float, ...]) -> tuple[Overreach, ...]:
    """Return the pairs of bodies that may be able to touch, but not as neighbours do.

    `radii` in m, in order along the trace. An empty answer certifies that only neighbours ever
    touch, with nothing between them (on a line: no body smaller than a quarter of two equal ones
    around it).
    """
    across: dict[tuple[float, float], tuple[int, int] | None] = {}
    found: list[Overreach] = []
    largest = max(radii, default=0.0)
    room = _Room(trace, radii, largest)
    for (left, right), row in over_others(len(radii), trace.closed, room.is_left_by):
        if fits_between(trace, (radii[left], radii[right]), tuple(radii[n] for n in row)):
            found.append(Overreach(min(left, right), max(left, right), row))
    # The largest body encloses, where it touches the trace, all the others there.
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
