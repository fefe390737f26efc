"""Columns of places and speeds from the half-angle variables, for whole tables at once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.mechanics.system import System
from vibro_cli.mechanics.trace import Piece
from vibro_cli.numerics import elementwise
from vibro_cli.systems.trace.world import turns_of

Floats = NDArray[np.float64]


def centres(piece: Piece, positions: Floats, body_radius: float) -> tuple[Floats, Floats]:
    """Centres (m) of a body at positions on a piece, to rounding (one: ``Piece.body_center``)."""
    if piece.is_line:
        sine, cosine = elementwise.sine(piece.start_slope), elementwise.cosine(piece.start_slope)
        return (
            piece.start[0] + positions * cosine - body_radius * sine,
            piece.start[1] + positions * sine + body_radius * cosine,
        )
    rho = piece.path_radius(body_radius)
    return (
        piece.center[0] + rho * np.sin(positions),
        piece.center[1] - piece.sign * rho * np.cos(positions),
    )


class Places:
    """Geometry of every body on every piece, as arrays indexed ``[body, piece]`` or ``[piece]``.

    Parameters
    ----------
    system
        Its numbers may be arrays (see ``numerics.elementwise``), of several systems.
    of_rows
        Then the system of each row of a table of runs, from 0; the arrays have a last axis for the
        rows, and pieces are to be given for each.
    """

    def __init__(self, system: System, of_rows: Any = None) -> None:
        self._of_rows = of_rows
        pieces, bodies = system.trace.pieces, system.bodies
        self.sign = np.array([piece.sign for piece in pieces])
        self.radius = self._numbers([0.0 if piece.is_line else piece.radius for piece in pieces])
        self.centre_x = self._numbers([piece.center[0] for piece in pieces])
        self.centre_y = self._numbers([piece.center[1] for piece in pieces])
        self.start_s = self._numbers([piece.start_s for piece in pieces])
        self.angle_start = self._numbers([piece.angle_start for piece in pieces])
        self.angle_end = self._numbers([piece.angle_end for piece in pieces])
        self.turn = self._numbers([math.tau * turns_of(piece) for piece in pieces])
        self.body_radius = self._numbers([body.radius for body in bodies])
        self.kappa = self._numbers([body.kappa for body in bodies])
        self.mass = self._numbers([body.mass for body in bodies])
        self.gravity: float = self.of_rows(system.gravity)
        radii = [[0.0 if p.is_line else p.path_radius(b.radius) for p in pieces] for b in bodies]
        flat = self._numbers([radius for row in radii for radius in row])
        self.path_radius = flat.reshape(len(bodies), len(pieces), *flat.shape[1:])
        self.system = system

    def of_rows(self, numbers: Any) -> Any:
        """Return a number of the system, or that of the system of each row."""
        return numbers if np.ndim(numbers) == 0 else numbers[self._of_rows]

    def _numbers(self, values: Sequence[Any]) -> Floats:
        table: Floats = np.stack(np.broadcast_arrays(*map(self.of_rows, values)))
        return table

    @staticmethod
    def _at(table: Floats, *index: Any) -> Any:
        """Entries of a table; of one with an axis for rows, those of each row."""
        if table.ndim == len(index):
            return table[index]
        return table[(*index, np.arange(table.shape[-1]))]

    @cached_property
    def weight(self) -> Floats:
        """Weights of the bodies (N)."""
        return self.mass * self.gravity

    @cached_property
    def frequencies(self) -> Floats:
        """``[body, piece]``, see `frequency`."""
        return self.frequency(*np.indices(self.path_radius.shape))

    @cached_property
    def speed_factors(self) -> Floats:
        """``[body, piece]``, see `speed_factor`."""
        return self.speed_factor(*np.indices(self.path_radius.shape))

    def position(self, piece: Any, s: Floats, c: Floats) -> Floats:
        """Angle phi or psi (rad) on arcs, distance from the left end (m) on lines."""
        sign = self.sign[piece]
        hump = sign < 0.0
        half = np.arctan2(np.where(hump, -c, s), np.where(hump, s, c))
        angle = 2.0 * half + self._at(self.turn, piece)
        ends = self._at(self.angle_start, piece), self._at(self.angle_end, piece)
        angle = np.clip(angle, *ends)
        return np.where(sign == 0.0, s, angle)

    def angle(self, piece: Any, s: Floats, c: Floats) -> Floats:
        """Angle phi or psi (rad), nan on lines."""
        return np.where(self.sign[piece] == 0.0, np.nan, self.position(piece, s, c))

    def arc_length(self, piece: Any, position: Floats) -> Floats:
        """Arc length (m) of the contact point from the left end of the trace."""
        begin = self._at(self.angle_start, piece)
        along = self._at(self.radius, piece) * (position - begin)
        start = self._at(self.start_s, piece)
        s: Floats = start + np.where(self.sign[piece] == 0.0, position, along)
        return s

    def centre(self, body: Any, piece: Any, s: Floats, c: Floats) -> tuple[Floats, Floats]:
        """Centre (m) of bodies at ``(S, C)``."""
        rho = self.path_radius[body, piece]
        x = self.centre_x[piece] + self.sign[piece] * rho * (2.0 * s * c)
        y = self.centre_y[piece] - rho * ((c - s) * (c + s))
        for index, data in enumerate(self.system.trace.pieces):
            if data.is_line:
                here = piece == index
                radius = self.body_radius[body][here] if np.ndim(body) else self.body_radius[body]
                tangent = (math.cos(data.start_slope), math.sin(data.start_slope))
                x[here] = data.start[0] + s[here] * tangent[0] - radius * tangent[1]
                y[here] = data.start[1] + s[here] * tangent[1] + radius * tangent[0]
        return x, y

    def centre_of(self, body: int, piece: int, s: float, c: float) -> tuple[float, float]:
        """Centre (m) of one body at ``(S, C)``."""
        data = self.system.trace.pieces[piece]
        if data.is_line:
            radius = self.system.bodies[body].radius
            cosine, sine = math.cos(data.start_slope), math.sin(data.start_slope)
            return (
                data.start[0] + s * cosine - radius * sine,
                data.start[1] + s * sine + radius * cosine,
            )
        rho = data.path_radius(self.system.bodies[body].radius)
        return (
            data.center[0] + data.sign * rho * (2.0 * s * c),
            data.center[1] - rho * ((c - s) * (c + s)),
        )

    def parts_of_weight(self, x: float, sine: float, cosine: float) -> tuple[float, float]:
        """Gravity (m/s^2) back along a slope and onto it, with what turning adds at ``x`` (m)."""
        turning = self.system.turning
        away = 0.0 if turning is None else turning.square * (x - turning.x)
        return self.gravity * sine - away * cosine, self.gravity * cosine + away * sine

    def frequency(self, body: Any, piece: Any) -> Floats:
        """``w = sqrt(g/(kappa rho))`` (rad/s), 0 on lines."""
        rho = self._at(self.path_radius, body, piece)
        with np.errstate(divide="ignore"):
            return np.where(rho > 0.0, np.sqrt(self.gravity / (self.kappa[body] * rho)), 0.0)

    def speed_factor(self, body: Any, piece: Any) -> Floats:
        """``v/P``: ``2 w rho`` on arcs, 1 on lines."""
        rho = self._at(self.path_radius, body, piece)
        return np.where(rho > 0.0, 2.0 * self.frequency(body, piece) * rho, 1.0)

    def rate(self, body: Any, piece: Any, speed: Floats) -> Floats:
        """Rate of the angle (rad/s) from the speed of the centre, nan on lines."""
        rho = self.path_radius[body, piece]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(rho > 0.0, speed / rho, np.nan)
