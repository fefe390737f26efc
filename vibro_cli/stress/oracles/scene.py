"""Scenes in high precision, from the solver's own doubles; the laws as printed in the papers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from mpmath import MPContext

from vibro_cli.mechanics.system import TraceSystem

mp: Any = MPContext()
mp.dps = 50
Real = Any  # a number of this context

Pair = Sequence[Any]


def weight_and_response(law: str, body: Any, normal: Any) -> Pair:
    """Return a body's weight and response under a law.

    The weight is the factor of its speed in the relative speed that the law reverses; the response
    is the change of its speed by a unit of impulse. ``normal`` is the component of its path along
    the line of centres. The body has a radius, a mass and kappa.
    """
    if law == "hedrih":
        return 1 / body.radius, 1 / (body.kappa * body.mass * body.radius)
    if law == "translational":
        return mp.one, 1 / body.mass
    if law == "normal-impulse":
        return normal, normal / (body.kappa * body.mass)
    raise KeyError(law)


def speed_changes(
    law: str, k: Any, speeds: Pair, radii: Pair, masses: Pair, rolling: Pair
) -> tuple[Any, Any]:
    """Return the changes by an impact of two speeds along the line of centres, or along a line.

    `k` is the coefficient of restitution; `rolling` are the rolling masses κ m of both bodies.
    """
    more = 1 + k
    if law == "hedrih":  # C (3), with moments of inertia about the contacts
        ja, jb = (mass * r**2 for mass, r in zip(rolling, radii, strict=True))
        slip = speeds[0] / radii[0] - speeds[1] / radii[1]
        return -more * slip * jb / (ja + jb) * radii[0], more * slip * ja / (ja + jb) * radii[1]
    a, b = {"translational": masses, "normal-impulse": rolling}[law]
    approach = speeds[0] - speeds[1]
    return -more * approach * b / (a + b), more * approach * a / (a + b)


KAPPA = {
    "ball": mp.mpf(7) / 5,
    "disk": mp.mpf(3) / 2,
    "hollow_ball": mp.mpf(5) / 3,
    "hoop": mp.mpf(2),
    "particle": mp.mpf(1),
}
SIGN = {"valley": 1, "hump": -1, "line": 0}


@dataclass(frozen=True)
class Piece:
    """One piece of the trace; a place on it is phi = slope, psi = -slope, or a distance."""

    sign: int
    size: Real  # radius of an arc, length of a line, m
    slopes: tuple[Real, Real]
    origin: tuple[Real, Real]  # centre of an arc, place 0 of a line
    begin: Real = mp.zero  # place of the left end of a line

    @property
    def low(self) -> Real:
        """The place of the left end."""
        return self.sign * self.slopes[0] if self.sign else self.begin

    @property
    def high(self) -> Real:
        """The place of the right end."""
        return self.sign * self.slopes[1] if self.sign else self.begin + self.size


@dataclass(frozen=True)
class Body:
    """One body."""

    radius: Real
    mass: Real
    kappa: Real
    force: Any = None
    """Acceleration along the path by another force than gravity, rotation and contacts, or None.

    A function of a step (s) that returns an object, whose `append(k, place, speed)` returns
    coefficient k of its series from those of place and speed, for k = 0, 1, 2, ... in turn.
    """


@dataclass(frozen=True)
class Scene:
    """All data from which a run starts."""

    gravity: Real
    pieces: tuple[Piece, ...]
    closed: bool
    bodies: tuple[Body, ...]
    starts: tuple[tuple[int, Real, Real], ...]  # piece from 0, place, speed of the centre
    restitution: tuple[Real, ...]
    walls: tuple[Real | None, Real | None]
    axis: Real = mp.zero  # x of the axis about which the trace rotates, m
    turning_square: Real = mp.zero  # square of its rate, 1/s^2
    endless: bool = False  # whether bodies stay on their pieces, which extend beyond their ends


class Path:
    """The path of a body's centre on a piece."""

    def __init__(self, scene: Scene, ball: int, piece: int) -> None:
        self.shape = scene.pieces[piece]
        self.body = scene.bodies[ball]
        self.rho = self.shape.size - self.shape.sign * self.body.radius
        on_arc = self.shape.sign != 0
        self.curvature = self.shape.sign / self.rho if on_arc else mp.zero
        self.per_length = 1 / self.rho if on_arc else mp.one  # change of the coordinate

    def centre(self, place: Real) -> tuple[Real, Real]:
        """Return the centre of the body (m)."""
        x, y = self.shape.origin
        cosine, sine = self.tangent(place)
        if self.shape.sign == 0:
            radius = self.body.radius
            return x + place * cosine - radius * sine, y + place * sine + radius * cosine
        return x + self.shape.sign * self.rho * sine, y - self.shape.sign * self.rho * cosine

    def tangent(self, place: Real) -> tuple[Real, Real]:
        """Return the unit vector in which the centre moves to the right."""
        slope = self.shape.sign * place if self.shape.sign else self.shape.slopes[0]
        return mp.cos(slope), mp.sin(slope)

    def at_wall(self, right: bool) -> Real:
        """Return the place at which the body touches a wall at the right or left end."""
        offset = mp.asin(self.body.radius / self.rho) if self.shape.sign else self.body.radius
        return self.shape.high - offset if right else self.shape.low + offset


def chain(start_slope: Real, shapes: Sequence[tuple[str, Real, Real | None]]) -> tuple[Piece, ...]:
    """Chain pieces, given as (shape, radius or length, end slope), from the origin."""
    pieces: list[Piece] = []
    slope, x, y = start_slope, mp.zero, mp.zero
    for shape, size, end_slope in shapes:
        sign, start = SIGN[shape], slope
        if sign == 0:
            origin = (x, y)
            x, y = x + size * mp.cos(slope), y + size * mp.sin(slope)
        else:
            slope = end_slope
            origin = (x - sign * size * mp.sin(start), y + sign * size * mp.cos(start))
            x, y = origin[0] + sign * size * mp.sin(slope), origin[1] - sign * size * mp.cos(slope)
        pieces.append(Piece(sign, size, (start, slope), origin))
    return tuple(pieces)


def slope_of(double: float) -> Real:
    """Return the angle meant by a double: multiples of a right angle are exact."""
    quarters = round(double / (0.5 * math.pi))
    if quarters and double == quarters * (0.5 * math.pi):
        return quarters * mp.pi / 2
    return mp.mpf(double)


def scene_of_system(system: TraceSystem) -> Scene:
    """Return the scene with exactly the doubles that the solver gets."""
    pieces = system.trace.pieces
    shapes = [
        (piece.shape, mp.mpf(piece.length if piece.is_line else piece.radius),
         slope_of(piece.end_slope))
        for piece in pieces
    ]  # fmt: skip
    walls = [
        mp.mpf(end.restitution) if end else None for end in (system.left_end, system.right_end)
    ]
    return Scene(
        gravity=mp.mpf(system.gravity),
        pieces=chain(slope_of(pieces[0].start_slope), shapes),
        closed=system.trace.closed,
        bodies=tuple(
            Body(
                mp.mpf(body.radius),
                mp.mpf(body.mass),
                KAPPA[body.kind] if body.kind in KAPPA else 1 + mp.mpf(body.inertia_ratio),
            )
            for body in system.bodies
        ),
        starts=tuple(
            (state.piece, _place(pieces[state.piece].is_line, state.position), mp.mpf(state.speed))
            for state in system.initial
        ),
        restitution=tuple(mp.mpf(k) for k in system.restitution),
        walls=(walls[0], walls[1]),
        axis=mp.mpf(system.turning.x) if system.turning else mp.zero,
        turning_square=mp.mpf(system.turning.rate) ** 2 if system.turning else mp.zero,
    )


def _place(on_line: bool, position: float) -> Real:
    return mp.mpf(position) if on_line else slope_of(position)
