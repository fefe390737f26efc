"""The potential of one body along the trace, and its rate where its energy is known."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vibro_cli.mechanics.potential import Pull, Turning, inside
from vibro_cli.mechanics.system import Body, System
from vibro_cli.mechanics.trace import Piece, Trace
from vibro_cli.numerics.elementwise import EPSILON

Array = NDArray[np.float64]

_ROUNDING = 64.0 * EPSILON


@dataclass(frozen=True)
class Landscape:
    """Potential energy of one body on the whole trace.

    A position is φ in a valley, ψ on a hump (rad) and the distance from the left end on a line (m);
    the rate is φ̇, ψ̇ (rad/s) or, on a line, the speed (m/s).
    """

    trace: Trace
    body: Body
    gravity: float
    """g (m/s²)."""
    lowest: float
    """Height y (m) of the lowest place the body's centre can have; the potential is 0 there."""
    turning: Turning | None = None
    """On a trace that turns a height is y − Ω² (x − x₀)²/2g, whose weight is the potential."""

    @staticmethod
    def of(system: System, ball: int) -> Landscape:
        """Return the potential of a body of a system, counted from 1."""
        body = system.bodies[ball - 1]
        raw = Landscape(system.trace, body, system.gravity, 0.0, system.turning)
        return replace(raw, lowest=_lowest_height(raw))

    def height(self, piece: Piece, position: float) -> float:
        """Return the height (m) of the body's centre above its lowest place."""
        x, y = piece.body_center(position, self.body.radius)
        return y - self._sunk(x) - self.lowest

    def _sunk(self, x: float) -> float:
        """Height (m) by which turning lowers the potential at a place."""
        if self.turning is None:
            return 0.0
        return 0.5 * self.turning.square / self.gravity * (x - self.turning.x) ** 2

    def pull(self, piece: Piece) -> Pull:
        """Return the pull on an arc of a trace that turns."""
        assert self.turning is not None
        return Pull.on_arc(piece, self.body.radius, self.turning, self.gravity)

    def _turned(self, piece: Piece, place: Array) -> Array:
        """Rise (m) of the height from position 0 on, on a trace that turns."""
        assert self.turning is not None
        strength = self.turning.square / self.gravity
        x = piece.body_center(0.0, self.body.radius)[0] - self.turning.x
        if piece.is_line:
            along = math.cos(piece.start_slope) * place
            rise = _sine(piece.start_slope) * place
        else:
            rho = self.path_scale(piece)
            along = rho * np.sin(place)
            rise = piece.sign * 2.0 * rho * np.sin(0.5 * place) ** 2
        turned: Array = rise - strength * along * (x + 0.5 * along)
        return turned

    def path_scale(self, piece: Piece) -> float:
        """Return speed divided by rate: ρ (m) on an arc, 1 on a line."""
        return 1.0 if piece.is_line else piece.path_radius(self.body.radius)

    def natural_rate(self, piece: Piece) -> float:
        """Return w = √(g/κρ) (rad/s): of small oscillations in a valley; 0 on a line."""
        if piece.is_line:
            return 0.0
        return self.body.natural_rate(self.gravity, self.path_scale(piece))

    def potential(self, piece: Piece, position: ArrayLike) -> Array:
        """Return the potential energy (J) at positions on one piece, of any shape.

        m g (y_C − lowest), with y_C rising by 2ρ sin²(φ/2) from the bottom of a valley, falling
        by 2ρ sin²(ψ/2) from the crest of a hump.
        """
        place = np.asarray(position, dtype=np.float64)
        weight = self.body.mass * self.gravity
        datum = weight * self.height(piece, 0.0)
        if self.turning is not None:
            return datum + weight * self._turned(piece, place)
        if piece.is_line:
            return datum + weight * _sine(piece.start_slope) * place
        rise = 2.0 * self.path_scale(piece) * np.sin(0.5 * place) ** 2
        return datum + piece.sign * weight * rise

    def energy(self, piece: Piece, position: ArrayLike, rate: ArrayLike) -> Array:
        """Return ½ κ m v² + m g (y_C − lowest) (J) at positions and rates on one piece."""
        speed = self.path_scale(piece) * np.asarray(rate, dtype=np.float64)
        kinetic = 0.5 * self.body.kappa * self.body.mass * speed**2
        return kinetic + self.potential(piece, position)

    def rate(self, piece: Piece, position: ArrayLike, energy: float) -> Array:
        """Return the rate, not negative, that an energy (J) leaves at positions on one piece.

        NaN where the energy does not reach. rate² = 2(E − V)/(κ m ρ²), on an arc
        c ∓ 4w² sin²(φ/2) with c its value at the bottom or crest: A (5), B (33), D (2).
        """
        place = np.asarray(position, dtype=np.float64)
        weight = self.body.mass * self.gravity
        datum = weight * self.height(piece, 0.0)
        per_energy = 2.0 / (self.body.kappa * self.body.mass * self.path_scale(piece) ** 2)
        if self.turning is not None:
            fall = per_energy * weight * self._turned(piece, place)
        elif piece.is_line:
            fall = per_energy * weight * _sine(piece.start_slope) * place
        else:
            fall = piece.sign * (2.0 * self.natural_rate(piece) * np.sin(0.5 * place)) ** 2
        square = per_energy * (energy - datum) - fall
        scale = per_energy * (abs(energy) + abs(datum)) + np.abs(fall)
        square = np.where(np.abs(square) <= _ROUNDING * scale, np.maximum(square, 0.0), square)
        return np.sqrt(square, out=np.full_like(square, np.nan), where=square >= 0.0)


def stationary_positions(piece: Piece) -> tuple[float, ...]:
    """Return the ends of a piece and the places within where its tangent is level."""
    inner = [] if piece.is_line else level_positions(piece)
    return (piece.angle_start, *inner, piece.angle_end)


def level_positions(piece: Piece) -> list[float]:
    """Return the angles (rad) strictly within an arc where its tangent is level: multiples of π."""
    first = math.floor(piece.angle_start / math.pi)
    last = math.ceil(piece.angle_end / math.pi)
    candidates = (turn * math.pi for turn in range(first, last + 1))
    return [
        angle
        for angle in candidates
        if piece.angle_start < angle < piece.angle_end
        and not same_angle(angle, piece.angle_start)
        and not same_angle(angle, piece.angle_end)
    ]


def same_angle(one: float, other: float) -> bool:
    """Return whether two angles (rad) differ by no more than their rounding."""
    return abs(one - other) <= 4.0 * EPSILON * max(1.0, abs(one), abs(other))


def half_turn(slope: float) -> int | None:
    """Return n of a slope (rad) that is nπ, which is to say level; None of any other slope."""
    turn = round(slope / math.pi)
    return turn if same_angle(slope, turn * math.pi) else None


def _sine(slope: float) -> float:
    return 0.0 if half_turn(slope) is not None else math.sin(slope)


def equilibria(landscape: Landscape, piece: Piece) -> list[float]:
    """Return the positions strictly within a piece of a turning trace at which nothing pulls."""
    assert landscape.turning is not None
    if not piece.is_line:
        offset = 0.0 if piece.sign > 0.0 else math.pi
        low, high = piece.angle_start + offset, piece.angle_end + offset
        return [f - offset for f in inside(landscape.pull(piece).equilibria(), low, high)]
    x = piece.body_center(0.0, landscape.body.radius)[0] - landscape.turning.x
    cosine = math.cos(piece.start_slope)
    strength = landscape.turning.square / landscape.gravity * cosine
    if half_turn(piece.start_slope - 0.5 * math.pi) is not None:
        return []
    place = (_sine(piece.start_slope) / strength - x) / cosine
    return [place] if 0.0 < place < piece.length else []


def _lowest_height(landscape: Landscape) -> float:
    def places(piece: Piece) -> Iterable[float]:
        if landscape.turning is None:
            return stationary_positions(piece)
        return (piece.angle_start, *equilibria(landscape, piece), piece.angle_end)

    return min(
        landscape.height(piece, place)
        for piece in landscape.trace.pieces
        for place in places(piece)
    )
