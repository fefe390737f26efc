"""Singular points of a body's phase portrait, and the type of the portrait (D).

The type consists of the kinds of the singular points and of their separatrices. A trigger is a set
of coupled singular points: a saddle between two centres.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import count, pairwise
from typing import Any

from vibro_cli.analysis.levels import (
    Landscape,
    Reach,
    connected_reaches,
    end_width,
    half_turn,
    level_positions,
)
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.mechanics.trace import VALLEY, Piece

_ROUNDING = 64.0 * EPSILON
CENTRE = "centre"
SADDLE = "saddle"
DEGENERATE = "degenerate"
"""A level line, or a level junction with a rise on one side and a fall on the other."""


@dataclass(frozen=True)
class SingularPoint:
    """A position at which the body can stay at rest."""

    kind: str
    """`centre`, `saddle` or `degenerate`."""
    piece: int
    """Index of its piece, from 0; at a junction the index of the left piece."""
    position: float
    """φ or ψ (rad); for a level line the distance of its left end, 0."""
    extent: float
    """Length of a level line (m), else 0."""
    s: float
    """Arc length of the contact point from the left end of the trace (m)."""
    slope: float
    """Slope angle of the trace there (rad); a multiple of π if the trace is at rest."""
    energy: float
    """Energy of the body at rest there (J), relative to its lowest position on the trace."""


def singular_points(landscape: Landscape) -> tuple[SingularPoint, ...]:
    """Return the singular points of a body from left to right along the trace.

    Bottoms of valleys and undersides of humps are centres; crests and tops of loops (φ = ±π) are
    saddles; a level line is degenerate as a whole. A level junction, or a level end of the trace,
    has the kind of its sides, or is degenerate if these differ. On a closed trace the seam belongs
    to the left end. On a rotating trace singular points are the equilibria of gravity and
    centrifugal force, with centres at minima of the potential; likewise at junctions and ends.
    """
    found: list[SingularPoint] = []
    for piece in landscape.trace.pieces:
        found += _at_junction(landscape, piece.index)
        found += _within(landscape, piece)
    if not landscape.trace.closed:
        found += _at_junction(landscape, len(landscape.trace.pieces))
    return tuple(found)


def _within(landscape: Landscape, piece: Piece) -> list[SingularPoint]:
    if landscape.turning is not None:
        places = _balanced_within(landscape, piece)
    elif not piece.is_line:
        places = level_positions(piece)
    elif half_turn(piece.start_slope) is None:
        return []
    else:
        return [_point(landscape, DEGENERATE, piece, 0.0, piece.length)]
    return [_point(landscape, _kind(landscape, piece, place), piece, place) for place in places]


def _balanced_within(landscape: Landscape, piece: Piece) -> list[float]:
    """Return the equilibria within a piece of a rotating trace, without those at its junctions."""
    near = end_width(landscape, piece)
    low, high = piece.angle_start, piece.angle_end
    after = low + near if _balances(landscape, piece.index) else low
    before = high - near if _balances(landscape, piece.index + 1) else high
    return [place for place in landscape.equilibria[piece.index] if after < place < before]


def _at_junction(landscape: Landscape, number: int) -> list[SingularPoint]:
    """Return the singular point, if any, at a piece's left end, or the trace's right end."""
    sides = _sides(landscape, number)
    # A level line is a singular point as a whole, including its ends.
    on_line = landscape.turning is None and any(piece.is_line for piece, _ in sides)
    if on_line or not _balances(landscape, number):
        return []
    kinds = {_kind(landscape, *side) for side in sides}
    kind = kinds.pop() if len(kinds) == 1 else DEGENERATE
    return [_point(landscape, kind, *sides[-1 if number == 0 else 0])]


def _sides(landscape: Landscape, number: int) -> list[tuple[Piece, float]]:
    """Return the pieces that meet at a piece's left end, or at the trace's right end."""
    pieces = landscape.trace.pieces
    left, right = pieces[number - 1], pieces[number % len(pieces)]
    sides = [(left, left.angle_end), (right, right.angle_start)]
    if landscape.trace.closed:
        return sides
    return sides[1:] if number == 0 else sides[:1] if number == len(pieces) else sides


def _balances(landscape: Landscape, number: int) -> bool:
    """Return whether a piece's left end, or the trace's right end, is an equilibrium.

    On a rotating trace both pieces must agree: near a junction, one of them may place at it an
    equilibrium that lies within the other.
    """
    sides = _sides(landscape, number)
    if landscape.turning is None:
        return all(half_turn(piece.slope(end)) is not None for piece, end in sides)
    return all(
        any(
            abs(place - end) <= end_width(landscape, piece)
            for place in landscape.equilibria[piece.index]
        )
        for piece, end in sides
    )


def _kind(landscape: Landscape, piece: Piece, position: float) -> str:
    """Return the kind of an equilibrium, judged by one piece alone."""
    if landscape.turning is None:
        upright = round(piece.slope(position) / math.pi) % 2 == 0
        return CENTRE if upright == (piece.shape == VALLEY) else SADDLE
    if piece.is_line:
        return SADDLE  # the centrifugal force drives a body away from an equilibrium on a line
    stiffness = landscape.stiffness(piece, position)
    return SADDLE if stiffness > 0.0 else CENTRE if stiffness < 0.0 else DEGENERATE


def _point(
    landscape: Landscape, kind: str, piece: Piece, position: float, extent: float = 0.0
) -> SingularPoint:
    height = landscape.height(piece, position)
    y = piece.body_centre(position, landscape.body.radius)[1]
    if abs(height) <= _ROUNDING * (abs(y) + abs(y - height) + abs(landscape.lowest)):
        height = 0.0  # the lowest position, or one equally low
    return SingularPoint(
        kind=kind,
        piece=piece.index,
        position=position,
        extent=extent,
        s=piece.arc_length(position),
        slope=piece.slope(position),
        energy=landscape.weight * height,
    )


FIGURE_EIGHT = "figure eight"
"""The separatrix closes on both sides: a homoclinic orbit in the shape of an eight."""
HETEROCLINIC = "heteroclinic"
"""The separatrix is bounded and runs to another saddle with the same energy."""
OPEN = "open"
"""The separatrix leaves the trace on either side, or runs around a closed one."""

_OF_TRIGGERS = 4.0 * EPSILON
_EQUAL = 1e-12
"""Energies closer than this fraction of the saddle's count as equal."""


@dataclass(frozen=True)
class Trigger:
    """A saddle between two centres: a trigger of coupled singular points."""

    left: SingularPoint
    saddle: SingularPoint
    right: SingularPoint
    margin_left: float
    """Energy (J) of the greatest barrier on the left, minus that of the saddle.

    On three arcs m g ((R − r)(1 − cos θ_end) − (R + R₀)(1 − cos J)), J the slope at the junction.
    """
    margin_right: float
    """The same (J) on the right."""
    turning_left: float | None
    """Arc length s (m) of the separatrix's left turning point, which may be an equally high saddle.

    None if the separatrix leaves the trace.
    """
    turning_right: float | None
    """The same (m) on the right."""
    orbit: str
    """The separatrix: `figure eight`, `heteroclinic` or `open`."""


def triggers(landscape: Landscape) -> tuple[Trigger, ...]:
    """Return all saddles whose neighbouring singular points are centres on both sides.

    The figure eight is decided by energies of singular points, so it depends on the radius of the
    body and not on κ. On a closed trace the neighbours are found across the seam too, and must be
    two different centres.
    """
    points = singular_points(landscape)
    hills = [(point.energy, point.s) for point in points if point.kind != CENTRE]
    places: dict[float, list[float]] = {}
    for energy, s in hills:
        places.setdefault(energy, []).append(s)
    around = (*points[-1:], *points, *points[:1]) if landscape.trace.closed else points

    @cache  # many crests may be equally high
    def runs_at(energy: float) -> list[list[Reach]]:
        return connected_reaches(landscape, energy, places[energy])

    return tuple(
        _trigger(landscape, hills, (left, saddle, right), runs_at)
        for left, saddle, right in zip(around, around[1:], around[2:], strict=False)
        if (left.kind, saddle.kind, right.kind) == (CENTRE, SADDLE, CENTRE) and left is not right
    )


def _trigger(
    landscape: Landscape,
    hills: Hills,
    coupled: tuple[SingularPoint, SingularPoint, SingularPoint],
    runs_at: Callable[[float], list[list[Reach]]],
) -> Trigger:
    left, saddle, right = coupled
    beside = _hills_beside(landscape, hills, saddle)
    ways = _barriers(landscape, beside, saddle)
    margin_left, margin_right = margins = [max(way)[0] - saddle.energy for way in ways]
    # The margin decides whether the separatrix turns (within rounding, it does), not the turning
    # point: near a bifurcation, where centres and saddle differ by less than rounding, turning
    # points are lost while the barriers are still known.
    rounding = _OF_TRIGGERS * (abs(saddle.energy) + landscape.weight * landscape.trace.length)
    closes = [margin >= -rounding for margin in margins]
    # There it is near the saddle, unless the level runs on over barriers as high as the saddle.
    lost = [
        next(place for energy, place in way if energy - saddle.energy >= -rounding)
        if -rounding <= margin <= rounding
        else saddle.s
        for margin, way in zip(margins, ways, strict=True)
    ]
    turnings = _turnings(landscape, runs_at(saddle.energy), saddle)
    turning_left, turning_right = (
        (instead if place is None else place) if closed else None
        for place, instead, closed in zip(turnings, lost, closes, strict=True)
    )
    joined = any(_meets_another_saddle(way, saddle) for way in beside)
    orbit = OPEN if not all(closes) else HETEROCLINIC if joined else FIGURE_EIGHT
    return Trigger(
        left, saddle, right, margin_left, margin_right, turning_left, turning_right, orbit
    )


Hills = list[tuple[float, float]]
"""Energy (J) and arc length (m) of points that are no centres, and of ends of the trace."""


def _hills_beside(landscape: Landscape, hills: Hills, saddle: SingularPoint) -> tuple[Hills, Hills]:
    """Return the hills to the left and to the right of a saddle, the nearest first."""
    place = hills.index((saddle.energy, saddle.s))
    before, after = hills[:place], hills[place + 1 :]
    if landscape.trace.closed:
        before = after = after + before
    return before[::-1], after


def _meets_another_saddle(way: Hills, saddle: SingularPoint) -> bool:
    """Return whether the first hill on a way that is not lower is as high as a saddle."""
    rounding = _EQUAL * saddle.energy
    over = (energy - saddle.energy for energy, _ in way)
    return next((hill for hill in over if hill >= -rounding), math.inf) <= rounding


def _barriers(
    landscape: Landscape, beside: tuple[Hills, Hills], saddle: SingularPoint
) -> tuple[Hills, Hills]:
    """Return the barriers to the left and to the right of a saddle, the nearest first."""
    before, after = beside
    if landscape.trace.closed:
        # Without another hill the separatrix returns to its own saddle.
        own = (saddle.energy, saddle.s)
        return before or [own], after or [own]
    first, last = landscape.trace.pieces[0], landscape.trace.pieces[-1]
    left_end = float(landscape.potential(first, first.angle_start)), 0.0
    right_end = float(landscape.potential(last, last.angle_end)), landscape.trace.length
    return [*before, left_end], [*after, right_end]


def _turnings(
    landscape: Landscape, runs: Sequence[Sequence[Reach]], saddle: SingularPoint
) -> tuple[float | None, float | None]:
    """Return the left and right turning points (s, m) of the separatrix through a saddle.

    `runs` are the connected accessible parts of the trace at its energy. None where no turning
    point is found.
    """
    if not runs:
        return saddle.s, saddle.s  # everything below it is lost in rounding
    # The run through the saddle, or the nearest one if rounding excludes the saddle itself.
    run = min(runs, key=lambda run: max(run[0].left_s - saddle.s, saddle.s - run[-1].right_s, 0.0))
    leftmost, rightmost = run[0], run[-1]
    if not landscape.trace.closed:
        left, right = _turning(leftmost, rightmost)
        return (
            None if left is None else min(left, saddle.s),
            None if right is None else max(right, saddle.s),
        )
    length = landscape.trace.length
    if leftmost.left_s <= 0.0 and rightmost.right_s >= length:
        return None, None  # the level runs all the way round
    if leftmost.left_s <= 0.0:
        leftmost = runs[-1][0]
    elif rightmost.right_s >= length:
        rightmost = runs[0][-1]
    return _turning(leftmost, rightmost)


def _turning(leftmost: Reach, rightmost: Reach) -> tuple[float | None, float | None]:
    return (
        leftmost.left_s if leftmost.turns_low else None,
        rightmost.right_s if rightmost.turns_high else None,
    )


_SAME = 1e-13
"""Energies closer than this fraction of the highest are reported as equal."""
_LETTER = {CENTRE: "C", SADDLE: "S", DEGENERATE: "D"}


@dataclass(frozen=True)
class Portrait:
    """The structure of the phase portrait of one body on the whole trace."""

    landscape: Landscape
    points: tuple[SingularPoint, ...]
    """Singular points from left to right."""
    names: tuple[str, ...]
    """Names of the points: C1, S1, C2, …, each kind numbered from the left."""
    triggers: tuple[Trigger, ...]

    @property
    def type(self) -> str:
        """Type in words; portraits that can be deformed into one another have the same type."""
        kinds = ", ".join(point.kind for point in self.points) or "no singular point"
        orbits = ", ".join(trigger.orbit for trigger in self.triggers)
        return f"{kinds}; {orbits}" if orbits else kinds

    def name(self, point: SingularPoint) -> str:
        """Return the name of one of the points."""
        return self._named[point]

    @cached_property
    def _named(self) -> dict[SingularPoint, str]:
        return dict(zip(self.points, self.names, strict=True))

    @cached_property
    def highest(self) -> float:
        """The greatest energy (J) of a point, without its sign."""
        return max(abs(point.energy) for point in self.points)

    def height(self, energy: float) -> float:
        """Return E/(m g) (m), the height above its lowest position at which the body is at rest.

        On a rotating trace it is the effective potential as a height above its least value.
        """
        weight = self.landscape.weight
        return energy / weight if weight else 0.0


def portrait_of(landscape: Landscape) -> Portrait:
    """Return the structure of the phase portrait of a body, in closed form (D)."""
    points = singular_points(landscape)
    numbers = {kind: count(1) for kind in _LETTER}
    names = (f"{_LETTER[point.kind]}{next(numbers[point.kind])}" for point in points)
    return Portrait(landscape, points, tuple(names), triggers(landscape))


def condition(portrait: Portrait, trigger: Trigger) -> str:
    """Return in words the condition that decides the separatrix of a trigger.

    The figure eight exists if the barriers on both sides are at least as high as the saddle:
    (R − r)(1 − cos θ_end) ≥ (R + R₀)(1 − cos J) on three arcs (D).
    """
    left, right = (_barrier(portrait, m) for m in (trigger.margin_left, trigger.margin_right))
    saddle = portrait.name(trigger.saddle)
    return (
        f"barriers {_signed(left)} (left) and {_signed(right)} (right) of {saddle}; "
        "a figure eight needs both ≥ 0"
    )


def _barrier(portrait: Portrait, margin: float) -> float:
    """Return a barrier as a height (m), or 0 for saddles equal up to rounding."""
    return portrait.height(margin) if abs(margin) > _SAME * portrait.highest else 0.0


def _signed(height: float) -> str:
    return f"{height:+.4g} m".replace("-", "−")


def as_record(portrait: Portrait) -> dict[str, Any]:
    """Return the structure as plain values: the body, its singular points and its triggers."""
    body = portrait.landscape.body
    return {
        "body": body.kind,
        "radius": body.radius,
        "mass": body.mass,
        "kappa": body.kappa,
        "type": portrait.type,
        "points": [
            _point_row(portrait, name, point)
            for name, point in zip(portrait.names, portrait.points, strict=True)
        ],
        "triggers": [_trigger_row(portrait, trigger) for trigger in portrait.triggers],
    }


def _point_row(portrait: Portrait, name: str, point: SingularPoint) -> dict[str, Any]:
    piece = portrait.landscape.trace.pieces[point.piece]
    x, y = piece.body_centre(point.position, portrait.landscape.body.radius)
    return {
        "name": name,
        "kind": point.kind,
        "arc": piece.index + 1,
        "angle": None if piece.is_line else point.position,
        "s": point.s,
        "extent": point.extent,
        "x": x,
        "y": y,
        "slope": point.slope,
        "energy": point.energy,
        "height": portrait.height(point.energy),
        "natural_rate": rate_near(portrait.landscape, point),
    }


def rate_near(landscape: Landscape, point: SingularPoint) -> float | None:
    """Return the frequency of small oscillations about a centre, or a saddle's exponent (1/s).

    At a junction each side has half of the oscillation, which takes π/w₁ and π/w₂, so the frequency
    is 2 w₁w₂/(w₁ + w₂). A saddle there has an exponent if both sides have the same. None for lines,
    ends of the trace and degenerate junctions.
    """
    piece = landscape.trace.pieces[point.piece]
    inner = piece.angle_start < point.position < piece.angle_end
    number = piece.index if point.position == piece.angle_start else piece.index + 1
    sides = [(piece, point.position)] if inner else _sides(landscape, number)
    if any(side.is_line for side, _ in sides):
        return None
    if inner:
        return _rate_on(landscape, piece, point.position)
    if len(sides) == 1 or point.kind == DEGENERATE:
        return None
    left, right = (_rate_on(landscape, *side) for side in sides)
    if point.kind == CENTRE:
        return 2.0 * left * right / (left + right)
    return left if abs(left - right) <= _ROUNDING * left else None


def _rate_on(landscape: Landscape, piece: Piece, position: float) -> float:
    """Return the frequency of a body about a centre on an arc, or a saddle's exponent (1/s).

    w = √(g/κρ); on a rotating trace w √|V″| with the dimensionless potential V of the arc.
    """
    w = landscape.natural_rate(piece)
    if landscape.turning is None:
        return w
    return w * math.sqrt(abs(landscape.stiffness(piece, position)))


def _trigger_row(portrait: Portrait, trigger: Trigger) -> dict[str, Any]:
    names = [portrait.name(p) for p in (trigger.left, trigger.saddle, trigger.right)]
    return {
        "points": "-".join(names),
        "orbit": trigger.orbit,
        "condition": condition(portrait, trigger),
        "energy": trigger.saddle.energy,
        "margin_left": trigger.margin_left,
        "margin_right": trigger.margin_right,
        "turning_left": trigger.turning_left,
        "turning_right": trigger.turning_right,
    }


IMPOSSIBLE = "impossible"
"""Type of a member that is not a valid scenario."""
_EVENT = 1e-9
"""Changes closer than this fraction of the parameter count as one."""


@dataclass(frozen=True)
class Change:
    """A change of the portrait's type at a value of the parameter."""

    low: float
    """Largest value found with the type before."""
    high: float
    """Least value found with the type after. It is the next double, unless values in between have a
    type of the transition itself (equal energies, a degenerate point)."""
    before: str
    after: str


def changes(type_of: Callable[[float], str], values: Sequence[float]) -> tuple[Change, ...]:
    """Return the changes of type between neighbouring values, found by bisection.

    `type_of` gives the type at a parameter value, `IMPOSSIBLE` if there is none; `values` must
    ascend. Where several changes lie between two values, some may be missed.
    """
    types = [type_of(value) for value in values]
    found: list[Change] = []
    for (low, before), (high, after) in pairwise(zip(values, types, strict=True)):
        if before != after:
            found += _bisected(type_of, (low, before), (high, after))
    return _events(found)


def _events(found: Sequence[Change]) -> tuple[Change, ...]:
    """Merge changes that are too close for a genuine type in between.

    Such a type needs equal or vanishing energies, which rounding spreads over a narrow interval.
    If the types on both sides of it are the same, there is no change.
    """
    joined: list[Change] = []
    for change in found:
        last = joined[-1] if joined else change
        far = _EVENT * max(abs(last.low), abs(change.high))
        if joined and change.high - last.low <= far:
            joined[-1] = Change(last.low, change.high, last.before, change.after)
        else:
            joined.append(change)
    return tuple(change for change in joined if change.before != change.after)


def _bisected(
    type_of: Callable[[float], str], left: tuple[float, str], right: tuple[float, str]
) -> list[Change]:
    """Return the first change right of the left value, and any further ones up to the right."""
    (low, before), (high, after) = left, right
    while low < (middle := 0.5 * (low + high)) < high:
        kind = type_of(middle)
        if kind == before:
            low = middle
        else:
            high, after = middle, kind
    change = Change(low, high, before, after)
    if after == right[1]:
        return [change]
    return [change, *_bisected(type_of, (high, after), right)]
