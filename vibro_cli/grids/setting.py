"""From the values of a point to what the solver starts with, for many points at once.

Points that share trace, radii, laws and ends make one setting: it is built once by the ordinary
reader, and what its points differ in (starts, masses, k, stops) is worked out for all of them at
once. Only what is sure to be a valid scenario is taken so: every other point goes through the
ordinary reader alone, which also says what is wrong with it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from vibro_cli.grids.axes import Column
from vibro_cli.grids.points import Point
from vibro_cli.mechanics.body import mass_from_density
from vibro_cli.mechanics.clearance import contact_angle
from vibro_cli.mechanics.placement import wall_position
from vibro_cli.mechanics.system import System
from vibro_cli.mechanics.trace import Piece
from vibro_cli.scenario import Scenario
from vibro_cli.scenario.problems import KeyPath
from vibro_cli.simulation.geometry import centres
from vibro_cli.simulation.prepare import half_angle, initial_flight

Values = Mapping[KeyPath, Column]

# Closer than this share to the edge of what is possible, the ordinary reader decides.
_SURE = 1.0e-9
_LEAST_MASS, _MOST_MASS, _MOST_SPEED = 1.0e-99, 1.0e99, 1.0e29
_LARGEST_COUNT = 2**63 - 1


@dataclass(frozen=True)
class Starts:
    """What the solver starts some points with; rows of points that are not sure mean nothing."""

    sure: Column
    """Whether a point is known to be a valid scenario."""
    piece: Column
    """[point, ball]"""
    s: Column
    c: Column
    p: Column
    mass: Column
    restitution: Column
    """[point, pair]"""
    stop_t: Column
    """s; nan without a stop."""
    stop_collisions: Column
    """0 without a stop."""

    def at(self, rows: Any) -> Starts:
        """Return the starts of some of the points."""
        return Starts(*(getattr(self, one.name)[rows] for one in fields(self)))


@dataclass(frozen=True)
class Setting:
    """A setting, known from one valid point of it."""

    scenario: Scenario
    system: System

    @cached_property
    def pairs(self) -> int:
        """Number of pairs of neighbours that the solver looks at."""
        bodies, closed = len(self.system.bodies), self.system.trace.closed
        return bodies if closed and bodies >= 2 else bodies - 1

    def starts(self, values: Values, count: int) -> Starts:
        """Return the starts of points with these values (a column for each path of an axis)."""
        sure = np.ones(count, dtype=bool)
        bodies = len(self.system.bodies)
        states = [self._state(ball, values, sure) for ball in range(bodies)]
        masses = [self._mass(ball, values, sure) for ball in range(bodies)]
        with np.errstate(invalid="ignore"):
            self._check_order(states, sure)
            self._check_walls(states, sure)
        stop_t, stop_collisions = self._stops(values, sure)
        columns = [self._start(ball, *states[ball]) for ball in range(bodies)]
        piece, half_s, half_c, p = (
            np.stack([column[i] for column in columns], axis=1) for i in range(4)
        )
        mass = np.stack(masses, axis=1)
        k = self._restitution(values, sure)
        return Starts(sure, piece, half_s, half_c, p, mass, k, stop_t, stop_collisions)

    def starts_of(self, points: Sequence[Point]) -> Starts:
        """Return the starts of valid points of this setting that were read alone."""
        systems = [point.system for point in points if point.system is not None]
        stops = [point.scenario.stop for point in points if point.scenario is not None]
        bodies = range(len(self.system.bodies))
        flights = [[initial_flight(system, ball) for ball in bodies] for system in systems]
        state = {
            name: np.array([[getattr(one, name) for one in row] for row in flights])
            for name in ("piece", "s", "c", "p")
        }
        k = [
            [one.restitution[min(pair, len(one.restitution) - 1)] for pair in range(self.pairs)]
            for one in systems
        ]
        return Starts(
            sure=np.ones(len(points), dtype=bool),
            **state,
            mass=np.array([[body.mass for body in system.bodies] for system in systems]),
            restitution=np.array(k).reshape(len(points), self.pairs),
            stop_t=np.array([np.nan if stop.time is None else stop.time for stop in stops]),
            stop_collisions=np.array([stop.collisions or 0 for stop in stops], dtype=np.int64),
        )

    @staticmethod
    def _given(path: KeyPath, values: Values, fixed: Any, count: int) -> Column | None:
        """The column of a value, or a constant one; None where the scenario does not have it."""
        if path in values:
            return values[path]
        return None if fixed is None else np.full(count, fixed)

    def _state(self, ball: int, values: Values, sure: Column) -> tuple[Column, Column, Piece]:
        """Position and speed of the centre of one body; where they are in doubt, not sure."""
        given, count = self.scenario.balls[ball], len(sure)
        piece = self.system.trace.pieces[given.arc - 1]
        key = "position" if piece.is_line else "angle"
        position = self._given(("balls", ball, key), values, getattr(given, key), count)
        if position is None:
            position = self._touching(ball, values, sure)
            piece = self.system.trace.pieces[self.system.initial[ball].piece]
        speed = self._speed(ball, piece, values, sure)
        low, high = piece.angle_start, piece.angle_end
        sure &= (low < position) & (position < high)
        sure &= np.isfinite(speed) & np.isfinite(position)
        return position, speed, piece

    def _speed(self, ball: int, piece: Piece, values: Values, sure: Column) -> Column:
        """Speed of the centre of one body, from whichever of rate, omega and speed is given."""
        given, body = self.scenario.balls[ball], self.system.bodies[ball]
        for name in ("speed", "omega", "rate"):
            path = ("balls", ball, name)
            rate = self._given(path, values, getattr(given, name), len(sure))
            if rate is None:
                continue
            sure &= np.abs(rate) < _MOST_SPEED
            if name == "speed":
                return rate
            if name == "omega":
                return rate * body.radius
            # A rate of 0 is a speed of 0.0, also on a line and without a sign.
            return np.where(rate != 0.0, rate * piece.path_radius(body.radius), 0.0)
        return np.zeros(len(sure))

    def _touching(self, ball: int, values: Values, sure: Column) -> Column:
        """The place of a body that starts in contact with another, if it is the same for all."""
        moved = [
            path for path in values if path[0] == "balls" and path[-1] in ("angle", "position")
        ]
        if moved:
            sure[:] = False
        return np.full(len(sure), self.system.initial[ball].position)

    def _start(
        self, ball: int, position: Column, speed: Column, piece: Piece
    ) -> tuple[Column, Column, Column, Column]:
        """Piece, S, C and P of one body, as ``simulation.prepare`` has them for one point."""
        distinct, where = np.unique(position, return_inverse=True)
        halves = np.array([half_angle(piece, value) for value in distinct.tolist()])
        p = speed
        if not piece.is_line:
            body = self.system.bodies[ball]
            rho = piece.path_radius(body.radius)
            p = speed / (2.0 * math.sqrt(self.system.gravity / (body.kappa * rho)) * rho)
        index = np.full(len(position), piece.index)
        return index, halves[where, 0], halves[where, 1], p

    def _mass(self, ball: int, values: Values, sure: Column) -> Column:
        given, count = self.scenario.balls[ball], len(sure)
        mass = values.get(("balls", ball, "mass"))
        if mass is None:
            density = values.get(("balls", ball, "density"))
            if density is None:
                return np.full(count, self.system.bodies[ball].mass)
            of_one = mass_from_density(
                self.system.bodies[ball].kind,
                given.radius,
                density,  # type: ignore[arg-type]
                given.thickness,
            )
            mass = np.asarray(of_one)
        sure &= (mass > _LEAST_MASS) & (mass < _MOST_MASS)
        return mass

    def _restitution(self, values: Values, sure: Column) -> Column:
        fixed, count = self.system.restitution, len(sure)
        for path, k in values.items():
            if path[:2] == ("collision", "k"):
                sure &= (k >= 0.0) & (k <= 1.0)
        columns = []
        for pair in range(self.pairs):
            number = min(pair, len(fixed) - 1)
            one = values.get(("collision", "k"), values.get(("collision", "k", number)))
            columns.append(np.full(count, fixed[number]) if one is None else one)
        return np.stack(columns, axis=1) if columns else np.zeros((count, 0))

    def _stops(self, values: Values, sure: Column) -> tuple[Column, Column]:
        count, stop = len(sure), self.scenario.stop
        time = self._given(("stop", "time"), values, stop.time, count)
        most = self._given(("stop", "collisions"), values, stop.collisions, count)
        if time is not None:
            sure &= (time > 0.0) & np.isfinite(time)
        if most is not None:
            sure &= most >= 1
        return (
            np.full(count, np.nan) if time is None else time,
            np.zeros(count, dtype=np.int64) if most is None else most,
        )

    def _check_order(self, states: list[tuple[Column, Column, Piece]], sure: Column) -> None:
        """Leave sure only points whose neighbours are in order and clear of one another."""
        count = len(states)
        pairs = [(n, n + 1) for n in range(count - 1)]
        if self.system.trace.closed and count > 2:
            pairs.append((count - 1, 0))
        for a, b in pairs:
            (place_a, _, piece_a), (place_b, _, piece_b) = states[a], states[b]
            radius_a, radius_b = (self.system.bodies[n].radius for n in (a, b))
            if piece_a is not piece_b:
                if b > a and piece_b.index < piece_a.index:
                    sure[:] = False
                sure &= _clear(piece_a, place_a, radius_a, piece_b, place_b, radius_b)
                continue
            along = place_b - place_a if b > a else place_a - place_b
            needed = contact_angle(piece_a, radius_a, radius_b) * (1.0 + _SURE)
            sure &= along > needed + _SURE
            if not piece_a.is_line:
                sure &= along < math.tau - needed - _SURE

    def _check_walls(self, states: list[tuple[Column, Column, Piece]], sure: Column) -> None:
        pieces = self.system.trace.pieces
        for wall, ball, piece, side in (
            (self.system.left_end, 0, pieces[0], 1.0),
            (self.system.right_end, len(states) - 1, pieces[-1], -1.0),
        ):
            position, _, here = states[ball]
            if wall is None or here is not piece:
                continue
            touch = wall_position(piece, self.system.bodies[ball].radius, side < 0.0)
            if touch is None:
                sure[:] = False
            else:
                sure &= side * (position - touch) > _SURE * max(1.0, abs(touch))


def _clear(
    piece_a: Piece,
    place_a: Column,
    radius_a: float,
    piece_b: Piece,
    place_b: Column,
    radius_b: float,
) -> Column:
    """Whether bodies on two pieces are surely apart."""
    ax, ay = centres(piece_a, place_a, radius_a)
    bx, by = centres(piece_b, place_b, radius_b)
    contact = radius_a + radius_b
    size = np.abs(ax) + np.abs(ay) + np.abs(bx) + np.abs(by) + contact
    clear: Column = np.hypot(bx - ax, by - ay) > contact + _SURE * size
    return clear
