"""The potential of a body along the trace, and level curves of its energy, in closed form.

A branch of a phase trajectory is the path of a body in free flight between two events.
"""

from __future__ import annotations

import math
from bisect import bisect, bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import groupby, pairwise
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.mechanics.potential import Pull, Turning, inside, zeros
from vibro_cli.mechanics.system import Body, TraceSystem
from vibro_cli.mechanics.trace import Piece, Trace

Array = NDArray[np.float64]

_ROUNDING = 64.0 * EPSILON
_CLEAR = 1e-6
"""Share of heights, beyond all their rounding, by which a body surely passes a piece."""


@dataclass(frozen=True)
class Landscape:
    """Potential energy of one body on the whole trace.

    Positions are φ in a valley, ψ on a hump (rad) and the distance from the left end on a line (m);
    rates are φ̇, ψ̇ (rad/s) or, on a line, the speed (m/s).
    """

    trace: Trace
    body: Body
    gravity: float
    """g (m/s²)."""
    lowest: float
    """Height y (m) of the lowest position of the body's centre, where the potential is 0."""
    turning: Turning | None = None
    """Rotation of the trace; heights are then y − Ω² (x − x₀)²/2g (effective potential)."""

    @staticmethod
    def of(system: TraceSystem, ball: int) -> Landscape:
        """Return the potential of a body (from 1) of a system."""
        body = system.bodies[ball - 1]
        raw = Landscape(system.trace, body, system.gravity, 0.0, system.turning)
        return replace(raw, lowest=_lowest_height(raw))

    @property
    def weight(self) -> float:
        """Weight m g of the body (N)."""
        return self.body.mass * self.gravity

    def height(self, piece: Piece, position: float) -> float:
        """Return the height (m) of the body's centre above its lowest position."""
        x, y = piece.body_centre(position, self.body.radius)
        if self.turning is not None:
            y -= 0.5 * self.turning.square / self.gravity * (x - self.turning.x) ** 2
        return y - self.lowest

    def pull(self, piece: Piece) -> Pull:
        """Return the pull of gravity and rotation on an arc of a rotating trace."""
        assert self.turning is not None
        return Pull.on_arc(piece, self.body.radius, self.turning, self.gravity)

    def stiffness(self, piece: Piece, position: float) -> float:
        """Return the derivative of the pull with respect to the angle, on an arc that rotates."""
        return self.pull(piece).stiffness(position + centre_of(piece))

    def _rise(self, piece: Piece, place: Array) -> Array:
        """Return the height (m) relative to position 0.

        It is 2ρ sin²(φ/2) from the bottom of a valley, −2ρ sin²(ψ/2) from the crest of a hump.
        """
        rho = self.path_scale(piece)
        if piece.is_line:
            rise: Array = _sine(piece.start_slope) * place
        else:
            rise = piece.sign * 2.0 * rho * np.sin(0.5 * place) ** 2
        if self.turning is None:
            return rise
        along = math.cos(piece.start_slope) * place if piece.is_line else rho * np.sin(place)
        x = piece.body_centre(0.0, self.body.radius)[0] - self.turning.x
        return rise - self.turning.square / self.gravity * along * (x + 0.5 * along)

    def path_scale(self, piece: Piece) -> float:
        """Return the ratio of speed to rate, see :meth:`Piece.path_scale`."""
        return piece.path_scale(self.body.radius)

    def natural_rate(self, piece: Piece) -> float:
        """Return w = √(g/κρ) (rad/s) of an arc, the frequency of small oscillations in a valley."""
        return self.body.natural_rate(self.gravity, self.path_scale(piece))

    def potential(self, piece: Piece, position: ArrayLike) -> Array:
        """Return the potential energy m g (y_C − lowest) (J) at positions on a piece."""
        place = np.asarray(position, dtype=np.float64)
        return self.datum(piece) + self.weight * self._rise(piece, place)

    def datum(self, piece: Piece) -> float:
        """Return the potential energy (J) at position 0 of a piece, which may be off it."""
        return self.weight * self._heights[piece.index]

    @cached_property
    def _heights(self) -> tuple[float, ...]:
        """Heights (m) at position 0 of each piece, which every level curve needs."""
        return tuple(self.height(piece, 0.0) for piece in self.trace.pieces)

    @cached_property
    def equilibria(self) -> tuple[list[float], ...]:
        """Equilibrium positions on each piece of a rotating trace, including its ends.

        Rounding may put an equilibrium at an end slightly beyond it.
        """
        return tuple(_equilibria(self, piece) for piece in self.trace.pieces)

    @cached_property
    def tops(self) -> Array:
        """Energies (J) with more than which a body surely passes each piece, shape (pieces,)."""
        tops = [max(_extremes(self, piece)) for piece in self.trace.pieces]
        return self.weight * ((1.0 + _CLEAR) * np.array(tops) + _CLEAR * self.trace.length)

    def energy(self, piece: Piece, position: ArrayLike, rate: ArrayLike) -> Array:
        """Return the energy ½ κ m v² + m g (y_C − lowest) (J) at positions and rates on a piece."""
        speed = self.path_scale(piece) * np.asarray(rate, dtype=np.float64)
        kinetic = 0.5 * self.body.rolling_mass * speed**2
        return kinetic + self.potential(piece, position)

    def rate(self, piece: Piece, position: ArrayLike, energy: float) -> Array:
        """Return the rate (not negative) of a body with an energy (J) at positions on a piece.

        NaN where the energy does not suffice. rate² = 2(E − V)/(κ m ρ²), which on an arc is
        c ∓ 4w² sin²(φ/2) with c its value at the bottom or crest: A (5), B (33), D (2).
        """
        return _rate(energy, *self._terms(piece, np.asarray(position, dtype=np.float64)))

    def _terms(self, piece: Piece, place: Array) -> tuple[float, float, Array]:
        """Return rate² per energy, the datum (J) and the fall of rate² from there to positions."""
        per_energy = 2.0 / (self.body.rolling_mass * self.path_scale(piece) ** 2)
        return per_energy, self.datum(piece), per_energy * self.weight * self._rise(piece, place)

    @cached_property
    def wholes(self) -> tuple[Reach, ...]:
        """All pieces as parts that a body passes."""
        return tuple(map(_whole, self.trace.pieces))

    @cached_property
    def _samples(self) -> dict[int, tuple[Array, ...]]:
        return {}

    def samples(self, count: int) -> tuple[Array, ...]:
        """Return arc lengths (m), path scales and terms of rates at `count` points of each piece.

        The shapes are (pieces, count), or (pieces, 1) for what is the same on a piece.
        """
        if count not in self._samples:
            places = [(whole.piece, _positions(whole, count)) for whole in self.wholes]
            rows = [
                (piece.arc_length(place), self.path_scale(piece), *self._terms(piece, place))
                for piece, place in places
            ]
            columns = zip(*rows, strict=True)
            self._samples[count] = tuple(np.array(one).reshape(len(rows), -1) for one in columns)
        return self._samples[count]


def _rate(energy: float, per_energy: Any, datum: Any, fall: Array) -> Array:
    square = per_energy * (energy - datum) - fall
    scale = per_energy * (abs(energy) + abs(datum)) + np.abs(fall)
    square = np.where(np.abs(square) <= _ROUNDING * scale, np.maximum(square, 0.0), square)
    rate: Array = np.sqrt(square, out=np.full_like(square, np.nan), where=square >= 0.0)
    return rate


def centre_of(piece: Piece) -> float:
    """Return the angle of the singular point at the bottom of an arc's circle: φ = 0 or ψ = π.

    The angle f from it is φ in a valley, ψ + π or ψ − π on a hump.
    """
    return 0.0 if piece.sign > 0.0 else math.pi


def level_positions(piece: Piece) -> list[float]:
    """Return the angles (rad) strictly within an arc at which it is level: multiples of π."""
    ends = piece.angle_start, piece.angle_end
    return [
        angle
        for angle in inside([0.0, math.pi], *ends)
        if not any(same_angle(angle, end) for end in ends)
    ]


def same_angle(one: float, other: float) -> bool:
    """Return whether two angles (rad) differ by no more than their rounding."""
    return abs(one - other) <= 4.0 * EPSILON * max(1.0, abs(one), abs(other))


def half_turn(slope: float) -> int | None:
    """Return n if a slope (rad) is level, that is, nπ; None for any other slope."""
    turn = round(slope / math.pi)
    return turn if same_angle(slope, turn * math.pi) else None


def _sine(slope: float) -> float:
    return 0.0 if half_turn(slope) is not None else math.sin(slope)


_AT_END = 1e-12
"""Fraction of the trace's length within which a position counts as the end of a piece."""


def _equilibria(landscape: Landscape, piece: Piece) -> list[float]:
    assert landscape.turning is not None
    near = end_width(landscape, piece)
    low, high = piece.angle_start - near, piece.angle_end + near
    if not piece.is_line:
        offset = centre_of(piece)
        angles = landscape.pull(piece).equilibria()
        return [f - offset for f in inside(angles, low + offset, high + offset)]
    if half_turn(piece.start_slope - 0.5 * math.pi) is not None:
        return []
    x, cosine, strength = _line_terms(landscape, piece)
    place = (_sine(piece.start_slope) / strength - x) / cosine
    return [place] if low < place < high else []


def _line_terms(landscape: Landscape, piece: Piece) -> tuple[float, float, float]:
    """Return a line's left end from the axis (m), cos(slope), and cos(slope) Ω²/g (1/m)."""
    assert landscape.turning is not None
    x = piece.body_centre(0.0, landscape.body.radius)[0] - landscape.turning.x
    cosine = math.cos(piece.start_slope)
    return x, cosine, landscape.turning.square / landscape.gravity * cosine


def end_width(landscape: Landscape, piece: Piece) -> float:
    """Return the distance (rad, m on a line) within which a position counts as a piece's end.

    On an arc it is at most a full turn, after which positions repeat.
    """
    width = _AT_END * landscape.trace.length
    return width if piece.is_line else min(width / piece.radius, math.tau)


def _lowest_height(landscape: Landscape) -> float:
    return min(min(_extremes(landscape, piece)) for piece in landscape.trace.pieces)


def _extremes(landscape: Landscape, piece: Piece) -> list[float]:
    """Return the heights (m) at the ends of a piece and where it is level between them."""
    within: list[float] = []
    if landscape.turning is not None:
        within = landscape.equilibria[piece.index]
    elif not piece.is_line:
        within = level_positions(piece)
    return [
        landscape.height(piece, place) for place in (piece.angle_start, *within, piece.angle_end)
    ]


_POINTS = 121
"""Points of a level curve on one piece."""
_JOINED = 1e-9
"""Parts of a curve closer than this fraction of the trace's length are joined."""


@dataclass(frozen=True)
class Reach:
    """A part of a piece that is accessible with an energy."""

    piece: Piece
    low: float
    """Leftmost position: φ or ψ (rad), distance on a line (m)."""
    high: float
    """Rightmost position."""
    turns_low: bool
    """Whether the body turns back at the left end instead of rolling on to the next piece."""
    turns_high: bool
    """Whether the body turns back at the right end."""

    @cached_property
    def left_s(self) -> float:
        """Arc length of its left end (m)."""
        return self.piece.arc_length(self.low)

    @cached_property
    def right_s(self) -> float:
        """Arc length of its right end (m)."""
        return self.piece.arc_length(self.high)

    @cached_property
    def is_whole(self) -> bool:
        """Whether it is the whole piece, at neither end of which the body turns."""
        return self == _whole(self.piece)


def _whole(piece: Piece) -> Reach:
    return Reach(piece, piece.angle_start, piece.angle_end, False, False)


@dataclass(frozen=True)
class LevelCurve:
    """The upper half of a level curve on one piece; the lower half is its mirror image."""

    piece: int
    """Index of the piece, from 0; 0 for a curve along the whole trace."""
    position: Array
    """φ or ψ (rad), distance on a line, arc length along the trace (m); shape (n,), rising."""
    rate: Array
    """φ̇ or ψ̇ (rad/s), speed on a line or along the trace (m/s); shape (n,), not negative."""


def reaches(landscape: Landscape, piece: Piece, energy: float) -> tuple[Reach, ...]:
    """Return the parts of a piece accessible to a body with an energy (J), from left to right.

    On an arc the body turns where sin²(f/2) = q. Here f is the angle from the nearest centre (φ
    from the bottom of a valley, ψ − π from the underside of a hump), and q the energy above it in
    units of 2 m g ρ. A part with the energy of a saddle extends through it.
    """
    if landscape.turning is not None:
        return _turning_reaches(landscape, piece, energy)
    if piece.is_line:
        return _line_reaches(landscape, piece, energy)
    unit = 2.0 * landscape.weight * landscape.path_scale(piece)
    above = energy - landscape.datum(piece)  # bottom of a valley, crest of a hump
    above_centre, below_saddle = (above, unit - above) if piece.sign > 0 else (unit + above, -above)
    tolerance = _ROUNDING * (abs(energy) + abs(energy - above) + unit)
    if below_saddle <= tolerance:
        return (_whole(piece),)
    if above_centre < -tolerance:
        return ()
    swing = 2.0 * math.atan2(math.sqrt(max(above_centre, 0.0)), math.sqrt(below_saddle))
    return _swings(piece, swing)


def _turning_reaches(landscape: Landscape, piece: Piece, energy: float) -> tuple[Reach, ...]:
    """Return the accessible parts on a rotating trace, between the zeros of E − V.

    On an arc this is a trigonometric polynomial of degree 2.
    """
    low, high = piece.angle_start, piece.angle_end
    cuts = [low, *_turning_zeros(landscape, piece, energy), high]
    tolerance = _ROUNDING * (abs(energy) + abs(landscape.datum(piece)))
    scale = landscape.weight * (landscape.path_scale(piece) if not piece.is_line else piece.length)
    tolerance += _ROUNDING * scale
    parts: list[Reach] = []
    for left, right in pairwise(cuts):
        middle = float(landscape.potential(piece, 0.5 * (left + right)))
        if middle > energy + tolerance or left == right:
            continue
        if parts and parts[-1].high == left:  # a saddle with exactly this energy
            parts[-1] = Reach(piece, parts[-1].low, right, parts[-1].turns_low, right < high)
        else:
            parts.append(Reach(piece, left, right, left > low, right < high))
    return tuple(parts)


def _turning_zeros(landscape: Landscape, piece: Piece, energy: float) -> list[float]:
    """Return the positions within a piece at which a body with an energy (J) has no speed."""
    weight = landscape.weight
    above = energy / weight - landscape.height(piece, 0.0)
    if piece.is_line:
        return _line_zeros(landscape, piece, above)
    offset = centre_of(piece)
    pull, rho = landscape.pull(piece), landscape.path_scale(piece)
    # E - V in units of 2 rho, with V = 0 at f = 0; position 0 of a hump is f = pi.
    level = 0.5 * above / rho + pull.potential(offset)
    constant = level - 0.5 + 0.125 * pull.spread
    angles = zeros(constant, 0.25 * complex(1.0, -pull.tilt), -0.0625 * pull.spread + 0j)
    low, high = piece.angle_start + offset, piece.angle_end + offset
    return [f - offset for f in inside(angles, low, high)]


def _line_zeros(landscape: Landscape, piece: Piece, above: float) -> list[float]:
    """Return the positions on a line where the potential height is `above` that of its left end."""
    x, cosine, strength = _line_terms(landscape, piece)
    slope, square = _sine(piece.start_slope) - strength * x, -0.5 * strength * cosine
    root = slope * slope + 4.0 * square * above
    far = -0.5 * (slope + math.copysign(math.sqrt(max(root, 0.0)), slope))
    if root < 0.0 or far == 0.0:
        return []
    places = [-above / far, *([far / square] if square != 0.0 else [])]
    return sorted(place for place in places if 0.0 < place < piece.length)


def _swings(piece: Piece, swing: float) -> tuple[Reach, ...]:
    """Return the parts of an arc within the angle `swing` of its centres."""
    offset = centre_of(piece)
    full = 2.0 * math.pi
    first = math.floor((piece.angle_start - offset) / full)
    last = math.ceil((piece.angle_end - offset) / full)
    parts = []
    for turn in range(first, last + 1):
        centre = offset + turn * full
        low, high = max(centre - swing, piece.angle_start), min(centre + swing, piece.angle_end)
        if low <= high:
            turns_low = centre - swing >= piece.angle_start
            turns_high = centre + swing <= piece.angle_end
            parts.append(Reach(piece, low, high, turns_low, turns_high))
    return tuple(parts)


def _line_reaches(landscape: Landscape, piece: Piece, energy: float) -> tuple[Reach, ...]:
    spare = energy - landscape.datum(piece)
    tolerance = _ROUNDING * (abs(energy) + abs(energy - spare))
    rise = landscape.weight * _sine(piece.start_slope)
    if rise * piece.length <= spare + tolerance and spare >= -tolerance:
        return (_whole(piece),)
    if rise == 0.0:
        return ()
    turning = spare / rise
    if rise > 0.0:
        return (Reach(piece, 0.0, turning, False, True),) if spare >= 0.0 else ()
    return (Reach(piece, turning, piece.length, True, False),) if turning <= piece.length else ()


def level_curves(landscape: Landscape, piece: Piece, energy: float) -> tuple[LevelCurve, ...]:
    """Return the level curves of an energy (J) on one piece.

    Points are dense towards both ends, where a curve turns or passes near a saddle.
    """
    return tuple(
        LevelCurve(piece.index, *_sampled(landscape, part, energy))
        for part in reaches(landscape, piece, energy)
    )


def arc_separatrix(landscape: Landscape, piece: Piece) -> LevelCurve | None:
    """Return the separatrix of an arc's own equation of motion, within the arc.

    In a valley φ̇ = 2w cos(φ/2), through φ = ±π; on a hump ψ̇ = 2w sin(ψ/2), through the crest;
    w² = g/κρ. It belongs to the saddle of the full circle, whether or not the arc reaches it. None
    on a line and on a rotating trace.
    """
    if piece.is_line or landscape.turning is not None:
        return None
    position = np.linspace(piece.angle_start, piece.angle_end, _POINTS)
    if piece.angle_start < 0.0 < piece.angle_end:
        position[np.argmin(np.abs(position))] = 0.0
    half = 0.5 * position
    shape = np.cos(half) if piece.sign > 0 else np.sin(half)
    return LevelCurve(piece.index, position, 2.0 * landscape.natural_rate(piece) * np.abs(shape))


def connected_reaches(
    landscape: Landscape, energy: float, saddles: Sequence[float] | None = None
) -> list[list[Reach]]:
    """Return the accessible parts of the trace at an energy (J), grouped across junctions.

    On a closed trace a part across the seam appears at both ends of the list, unjoined. Given the
    arc lengths (m) of `saddles`, only groups on their pieces or connected with these are returned.
    """
    if saddles is not None:
        return _joined(landscape, _followed(landscape, energy, saddles))
    pieces = landscape.trace.pieces
    return _joined(landscape, [part for one in pieces for part in reaches(landscape, one, energy)])


def _joined(landscape: Landscape, parts: Sequence[Reach]) -> list[list[Reach]]:
    tolerance = _JOINED * landscape.trace.length
    runs: list[list[Reach]] = []
    end = -math.inf
    for part in parts:
        if part.left_s - end <= tolerance:
            runs[-1].append(part)
        else:
            runs.append([part])
        end = part.right_s
    return runs


def _followed(landscape: Landscape, energy: float, saddles: Sequence[float]) -> list[Reach]:
    """Return the parts on the pieces of saddles, and those to which the level runs on from there.

    It ends where it turns, even if a piece is accessible again beyond a crest: a trace of thousands
    of crests would take minutes if every crest's level were sought on the whole of it.
    """
    trace = landscape.trace
    pieces, near = trace.pieces, 2.0 * _JOINED * trace.length
    places = [bisect(pieces, s, key=attrgetter("start_s")) - 1 for s in saddles]
    # Pieces, with the direction in which the level enters each; 0 at a saddle, left both ways.
    waiting = [(place + beside, 0) for place in reversed(places) for beside in (1, 0, -1)]
    barriers = [-1, *np.flatnonzero(landscape.tops >= energy).tolist(), len(pieces)]
    followed: set[tuple[int, int]] = set()
    found: dict[int, list[list[Reach]]] = {}
    while waiting:
        index, step = waiting.pop()
        index = index % len(pieces) if trace.closed else index
        if not 0 <= index < len(pieces) or (index, step) in followed:
            continue
        followed.add((index, step))
        at = bisect_left(barriers, index) if step > 0 else bisect(barriers, index) - 1
        if step and abs(barriers[at] - index) > 1:  # at once to where the level may turn
            stop = barriers[at]
            found |= {one: [[landscape.wholes[one]]] for one in range(index, stop, step)}
            waiting.append((stop, step))
            continue
        piece = pieces[index]
        if index not in found:
            found[index] = _joined(landscape, reaches(landscape, piece, energy))
        runs = found[index]
        entered = runs[-1:] if step < 0 else runs[:1] if step > 0 else runs
        if step <= 0 and entered and entered[0][0].left_s - piece.start_s <= near:
            waiting.append((index - 1, -1))
        if step >= 0 and entered and piece.start_s + piece.length - entered[-1][-1].right_s <= near:
            waiting.append((index + 1, 1))
    return [part for index in sorted(found) for run in found[index] for part in run]


def _through(landscape: Landscape, energy: float, saddles: Sequence[float]) -> list[list[Reach]]:
    """Return the groups of `connected_reaches` that contain a saddle (arc lengths, m).

    The others are ordinary level curves with the same energy.
    """
    runs = connected_reaches(landscape, energy, saddles)
    tolerance = _JOINED * landscape.trace.length
    spans = [(run[0].left_s - tolerance, run[-1].right_s + tolerance) for run in runs]
    found = [any(low <= s <= high for s in saddles) for low, high in spans]
    ends = [low <= 0.0 or high >= landscape.trace.length for low, high in spans]
    seam = [landscape.trace.closed and at_end for at_end in ends]  # parts joined across the seam
    over = any(one and other for one, other in zip(found, seam, strict=True))
    kept = [one or (over and other) for one, other in zip(found, seam, strict=True)]
    return [run for run, is_one in zip(runs, kept, strict=True) if is_one]


def separatrix_curves(
    landscape: Landscape, pieces: Sequence[Piece], energy: float, saddles: Sequence[float]
) -> tuple[LevelCurve, ...]:
    """Return the level curves of an energy (J) through saddles at arc lengths (m), on some pieces.

    The saddles may be on other pieces.
    """
    shown = {piece.index for piece in pieces}
    return tuple(
        LevelCurve(part.piece.index, *_sampled(landscape, part, energy))
        for run in _through(landscape, energy, saddles)
        for part in run
        if part.piece.index in shown
    )


def speed_curves(
    landscape: Landscape,
    count: int,
    energy: float,
    saddles: Sequence[float] | None = None,
    shown: range | None = None,
) -> tuple[LevelCurve, ...]:
    """Return the level curves of an energy (J) along the trace, `count` points per piece.

    They give the centre's speed against the arc length of the contact point, continuous at
    junctions, on the pieces `shown`, given by their indices, by default on all. Given the arc
    lengths (m) of `saddles`, which may be on any piece, only curves through one are returned.
    """
    find = connected_reaches if saddles is None else partial(_through, saddles=saddles)
    runs = find(landscape, energy)
    if shown is not None:
        runs = [[part for part in run if part.piece.index in shown] for run in runs]
    return tuple(_along(landscape, run, energy, count) for run in runs if run)


def _along(landscape: Landscape, run: Sequence[Reach], energy: float, count: int) -> LevelCurve:
    places, speeds = [], []
    for is_whole, parts in groupby(run, attrgetter("is_whole")):
        if is_whole:
            pieces = [part.piece.index for part in parts]
            s, scale, *terms = (column[pieces] for column in landscape.samples(count))
            places.append(s.ravel())
            speeds.append((scale * _rate(energy, *terms)).ravel())
            continue
        for part in parts:
            position, rate = _sampled(landscape, part, energy, count)
            places.append(part.piece.arc_length(position))
            speeds.append(landscape.path_scale(part.piece) * rate)
    return LevelCurve(0, np.concatenate(places), np.concatenate(speeds))


def _sampled(
    landscape: Landscape, part: Reach, energy: float, count: int = _POINTS
) -> tuple[Array, Array]:
    position = _positions(part, count)
    rate = landscape.rate(part.piece, position, energy)
    if part.turns_low:
        rate[0] = 0.0
    if part.turns_high:
        rate[-1] = 0.0
    return position, rate


def _positions(part: Reach, count: int) -> Array:
    """Return positions on a part of a piece, dense towards both ends."""
    bend = 0.5 - 0.5 * np.cos(np.linspace(0.0, math.pi, count))
    position: Array = part.low + (part.high - part.low) * bend
    position[-1] = part.high
    return position


_NO_TURN = 1e-6
"""A sweep within this angle (rad) of 0 or a full turn is decided by the duration."""


def free_branches(
    landscape: Landscape,
    piece: Piece,
    start: tuple[Array, Array],
    end: tuple[Array, Array],
    duration: Array,
    count: int,
) -> tuple[Array, Array]:
    """Return the phase curves of free flights on one piece, from state to state.

    `start` and `end` are positions and rates, each of shape (flights,), and `duration` the times
    (s) between them. The result is positions and rates of shape (flights, count), with constant
    energy along each curve. A flight of several periods is drawn once around its closed curve and
    on to its end. On an arc the curve is part of the circle S² + P² = q with S = sin(f/2),
    P = ḟ/2w, f the angle from the centre of the oscillation, or a curve without turning (q ≥ 1).
    """
    fraction = np.linspace(0.0, 1.0, count)
    if piece.is_line:
        acceleration = -landscape.gravity / landscape.body.kappa * math.sin(piece.start_slope)
        time = duration[:, None] * fraction
        rate = start[1][:, None] + acceleration * time
        position = start[0][:, None] + 0.5 * (start[1][:, None] + rate) * time
    else:
        position, rate = _on_arc(landscape, piece, start, end, duration, fraction)
    position[:, 0], rate[:, 0] = start
    position[:, -1], rate[:, -1] = end
    return position, rate


def _on_arc(
    landscape: Landscape,
    piece: Piece,
    start: tuple[Array, Array],
    end: tuple[Array, Array],
    duration: Array,
    fraction: Array,
) -> tuple[Array, Array]:
    position = start[0][:, None] + (end[0] - start[0])[:, None] * fraction
    w = landscape.natural_rate(piece)
    # Without a turning point the body keeps its direction.
    fall, from_start = (2.0 * w * np.sin(0.5 * angle) for angle in (position, start[0]))
    square = (start[1] ** 2 + piece.sign * from_start**2)[:, None] - piece.sign * fall**2
    rate = np.copysign(np.sqrt(np.maximum(square, 0.0)), start[1][:, None])
    offset = centre_of(piece)
    centre = offset + 2.0 * math.pi * np.round((start[0] - offset) / (2.0 * math.pi))
    q = np.sin(0.5 * (start[0] - centre)) ** 2 + (0.5 / w * start[1]) ** 2
    # Flags of flights that oscillate; on the separatrix their ends decide, not q.
    turned = start[1] * end[1] < 0.0
    passed = np.abs(end[0] - centre) > math.pi
    swings = ((q < 1.0) & ~passed) | turned
    one, other = (((angle - centre)[swings], at[swings]) for angle, at in (start, end))
    angles, rate[swings] = _oscillation(w, one, other, duration[swings], fraction)
    position[swings] = centre[swings, None] + angles
    return position, rate


def _oscillation(
    w: float,
    start: tuple[Array, Array],
    end: tuple[Array, Array],
    duration: Array,
    fraction: Array,
) -> tuple[Array, Array]:
    """Return angles and rates about a centre: S = √q sin θ, P = √q cos θ, with increasing θ."""
    s_start, p_start = np.sin(0.5 * start[0]), 0.5 / w * start[1]
    s_end, p_end = np.sin(0.5 * end[0]), 0.5 / w * end[1]
    theta = np.arctan2(s_start, p_start)
    modulus = np.hypot(s_start, p_start)
    period = _period(w, modulus)
    sweep = np.mod(np.arctan2(s_end, p_end) - theta, 2.0 * math.pi)
    short = duration < 0.5 * period
    sweep = np.where((sweep > 2.0 * math.pi - _NO_TURN) & short, 0.0, sweep)
    again = (duration >= period) | ((sweep < _NO_TURN) & ~short)
    sweep = np.where(again, sweep + 2.0 * math.pi, sweep)
    along = theta[:, None] + sweep[:, None] * fraction
    sine = np.minimum(modulus[:, None], 1.0) * np.sin(along)
    return 2.0 * np.arcsin(sine), 2.0 * w * modulus[:, None] * np.cos(along)


def _period(w: float, modulus: Array) -> Array:
    """Return the periods (s) of oscillations of modulus k: 4K(k)/w, by Gauss's mean."""
    upper = np.ones_like(modulus)
    lower = np.sqrt(np.maximum((1.0 - modulus) * (1.0 + modulus), 0.0))
    for _ in range(8):
        upper, lower = 0.5 * (upper + lower), np.sqrt(upper * lower)
    mean = np.maximum(0.5 * (upper + lower), np.finfo(np.float64).tiny)
    period: Array = 2.0 * math.pi / (w * mean)
    return period
