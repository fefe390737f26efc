"""The potential of one body along the trace, and its rate where its energy is known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vibro_cli.mechanics.body import Body
from vibro_cli.mechanics.system import System
from vibro_cli.mechanics.trace import Piece, Trace

Array = NDArray[np.float64]

_EPSILON = float(np.finfo(np.float64).eps)
_ROUNDING = 64.0 * _EPSILON


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

    @staticmethod
    def of(system: System, ball: int) -> Landscape:
        """Return the potential of a body of a system, counted from 1.

        Raises ValueError for a trace that turns about a vertical: its potential is another one.
        """
        if system.turning is not None:
            raise ValueError("the potential of a turning trace is not the height alone")
        body = system.bodies[ball - 1]
        return Landscape(system.trace, body, system.gravity, _lowest_height(system.trace, body))

    def height(self, piece: Piece, position: float) -> float:
        """Return the height (m) of the body's centre above its lowest place."""
        return piece.body_center(position, self.body.radius)[1] - self.lowest

    def path_scale(self, piece: Piece) -> float:
        """Return speed divided by rate: ρ (m) on an arc, 1 on a line."""
        return 1.0 if piece.is_line else piece.path_radius(self.body.radius)

    def natural_rate(self, piece: Piece) -> float:
        """Return w = √(g/κρ) (rad/s): of small oscillations in a valley; 0 on a line."""
        if piece.is_line:
            return 0.0
        return math.sqrt(self.gravity / (self.body.kappa * self.path_scale(piece)))

    def potential(self, piece: Piece, position: ArrayLike) -> Array:
        """Return the potential energy (J) at positions on one piece, of any shape.

        m g (y_C − lowest), with y_C rising by 2ρ sin²(φ/2) from the bottom of a valley, falling
        by 2ρ sin²(ψ/2) from the crest of a hump.
        """
        place = np.asarray(position, dtype=np.float64)
        weight = self.body.mass * self.gravity
        datum = weight * self.height(piece, 0.0)
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
        if piece.is_line:
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
    return abs(one - other) <= 4.0 * _EPSILON * max(1.0, abs(one), abs(other))


def half_turn(slope: float) -> int | None:
    """Return n of a slope (rad) that is nπ, which is to say level; None of any other slope."""
    turn = round(slope / math.pi)
    return turn if same_angle(slope, turn * math.pi) else None


def _sine(slope: float) -> float:
    return 0.0 if half_turn(slope) is not None else math.sin(slope)


def _lowest_height(trace: Trace, body: Body) -> float:
    return min(
        piece.body_center(position, body.radius)[1]
        for piece in trace.pieces
        for position in stationary_positions(piece)
    )
