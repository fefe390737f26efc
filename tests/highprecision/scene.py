"""A scene in high precision: from the solver's own doubles, or from the decimals of a scenario."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tests.highprecision.taylor import Real, mp
from vibro_cli.mechanics.system import System

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
    origin: tuple[Real, Real]  # centre of an arc, left end of a line
    end: tuple[Real, Real]

    @property
    def low(self) -> Real:
        """Place of the left end."""
        return self.sign * self.slopes[0] if self.sign else mp.zero

    @property
    def high(self) -> Real:
        """Place of the right end."""
        return self.sign * self.slopes[1] if self.sign else self.size


@dataclass(frozen=True)
class Body:
    """One body."""

    radius: Real
    mass: Real
    kappa: Real


@dataclass(frozen=True)
class Scene:
    """Everything a run starts from."""

    gravity: Real
    pieces: tuple[Piece, ...]
    closed: bool
    bodies: tuple[Body, ...]
    starts: tuple[tuple[int, Real, Real], ...]  # piece from 0, place, speed of the centre
    restitution: tuple[Real, ...]
    walls: tuple[Real | None, Real | None]


def chain(start_slope: Real, shapes: Sequence[tuple[str, Real, Real | None]]) -> tuple[Piece, ...]:
    """Lay (shape, radius or length, end slope) one after another from the origin."""
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
        pieces.append(Piece(sign, size, (start, slope), origin, (x, y)))
    return tuple(pieces)


def slope_of(double: float) -> Real:
    """The angle a double stands for; the double nearest to some right angles stands for them."""
    quarters = round(double / (0.5 * math.pi))
    if quarters and double == quarters * (0.5 * math.pi):
        return quarters * mp.pi / 2
    return mp.mpf(double)


def scene_of_system(system: System) -> Scene:
    """The scene of the very doubles that the solver gets."""
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
    )


def _place(on_line: bool, position: float) -> Real:
    return mp.mpf(position) if on_line else slope_of(position)


def scene_of_decimals(scenario: Mapping[str, Any]) -> Scene:
    """The scene of a reference file, whose decimals stand for decimal numbers."""
    trace = scenario["trace"]
    shapes = [
        (arc["shape"], _decimal(arc.get("radius", arc.get("length"))),
         _decimal(arc["end_slope"]) if "end_slope" in arc else None)
        for arc in trace["arcs"]
    ]  # fmt: skip
    pieces = chain(_decimal(trace["start_slope"]), shapes)
    bodies = tuple(_body(ball) for ball in scenario["balls"])
    starts = []
    for ball, body in zip(scenario["balls"], bodies, strict=True):
        piece = pieces[ball["arc"] - 1]
        if piece.sign:
            path = piece.size - piece.sign * body.radius
            speed = _decimal(ball["rate"]) * path
            starts.append((ball["arc"] - 1, _decimal(ball["angle"]), speed))
        else:
            starts.append((ball["arc"] - 1, _decimal(ball["position"]), _decimal(ball["speed"])))
    pairs = max(len(bodies) - (0 if trace["closed"] and len(bodies) > 2 else 1), 1)
    return Scene(
        gravity=_decimal(scenario["gravity"]),
        pieces=pieces,
        closed=trace["closed"],
        bodies=bodies,
        starts=tuple(starts),
        restitution=(_decimal(scenario["collision"]["k"]),) * pairs,
        walls=(None, None),
    )


def _decimal(value: float | str) -> Real:
    """A number as it is written; degrees become radians."""
    text = value if isinstance(value, str) else repr(value)
    if text.endswith(" deg"):
        return mp.mpf(text.removesuffix(" deg")) * mp.pi / 180
    return mp.mpf(text)


def _body(ball: Mapping[str, Any]) -> Body:
    radius = _decimal(ball["radius"])
    if "mass" in ball:
        mass = _decimal(ball["mass"])
    else:
        mass = mp.mpf(4) / 3 * mp.pi * radius**3 * _decimal(ball["density"])
    return Body(radius, mass, KAPPA[ball["body"]])
