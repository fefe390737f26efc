"""Normal force and friction demand of flights in lasting contact.

The contact forces of a group follow from its motion, body by body from the left (from the right
if it leans on a wall there, at rest): ``f_i c_a = f_{i-1} c_b - m g sin(alpha) - M v'``; the trace
then carries ``m g cos(alpha) +- m v^2/rho`` less the contact forces along its normal, and friction
is ``(kappa - 1) m |v'|``. On one arc the normal force is ``a + b cos f + c sin f`` in the angle of
the group's pendulum, so its extremes are exact; on a short segment across pieces the ends are
taken, on a line it is constant.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from vibro_cli.mechanics.flow import POLYNOMIAL
from vibro_cli.mechanics.records import Flight
from vibro_cli.mechanics.trace import sine_cosine
from vibro_cli.simulation.geometry import Places
from vibro_cli.simulation.paths import Paths


class Motion(NamedTuple):
    """Place and motion of one body at one instant."""

    body: int
    x: float
    y: float
    slope: tuple[float, float]  # sine and cosine
    bend: float  # v^2/rho, m/s^2, positive in a valley
    acceleration: float  # along the path, m/s^2


class Harmonic(NamedTuple):
    """Normal force ``a + b cos f + c sin f`` and friction ``q |sin f|`` (N) of one body."""

    a: float
    b: float
    c: float
    q: float


def is_pendulum(flight: Flight) -> bool:
    """Tell whether a flight in contact swings on one arc, its forces harmonic in its angle."""
    return flight.form != POLYNOMIAL and flight.frequency != 0.0 and flight.at_rest == 0


def groups_of(paths: Paths) -> Iterator[list[int]]:
    """Yield the rows of each group's flights, from left to right, for every motion that lasts."""
    rows: dict[tuple[int, float, float], int] = {}
    # Of several launches at one instant only the last one lasts.
    grouped = np.flatnonzero((paths.log["grouped"] == 1) & (paths.duration > 0.0))
    for index in grouped:
        rows[_key(paths, index, int(paths.body[index]))] = int(index)
    bodies = len(paths.places.system.bodies)
    for index in grouped:
        first, count = int(paths.log["group_first"][index]), int(paths.log["group_count"][index])
        if first == paths.body[index]:
            yield [rows[_key(paths, index, (first + i) % bodies)] for i in range(count)]


def _key(paths: Paths, index: Any, body: int) -> tuple[int, float, float]:
    return body, float(paths.log["t"][index]), float(paths.log["t_low"][index])


def forces_of(places: Places, motions: list[Motion]) -> list[tuple[float, float]]:
    """Return normal force (N) and friction (N) of each body of a group, from one end of it on."""
    before = 0.0  # force of the contact with the body before
    result = []
    for i, motion in enumerate(motions):
        mass, kappa = float(places.mass[motion.body]), float(places.kappa[motion.body])
        sine, cosine = motion.slope
        back, onto = places.parts_of_weight(motion.x, sine, cosine)
        normal = mass * (onto + motion.bend)
        along = -mass * (back + kappa * motion.acceleration)
        if i > 0:
            nx, ny = _direction(motions[i - 1], motion)
            along += before * (nx * cosine + ny * sine)
            normal -= before * (ny * cosine - nx * sine)
        if i < len(motions) - 1:
            nx, ny = _direction(motion, motions[i + 1])
            before = along / (nx * cosine + ny * sine)
            normal += before * (ny * cosine - nx * sine)
        result.append((normal, (kappa - 1.0) * mass * abs(motion.acceleration)))
    return result


def _direction(a: Motion, b: Motion) -> tuple[float, float]:
    distance = math.hypot(b.x - a.x, b.y - a.y)
    return (b.x - a.x) / distance, (b.y - a.y) / distance


def forces_at(
    paths: Paths, members: list[int], flights: list[Flight], t: float
) -> list[tuple[float, float]]:
    """Normal force (N) and friction (N) of each body of a group a time (s) after its launch."""
    motions = _states(paths, members, flights, t)
    drawn_left = paths.places.parts_of_weight(motions[0].x, *motions[0].slope)[0] > 0.0
    if flights[0].at_rest == 1 and drawn_left:
        # It leans on a wall to the left, whose force is not known: from the free end on.
        return forces_of(paths.places, motions[::-1])[::-1]
    return forces_of(paths.places, motions)


def _states(paths: Paths, members: list[int], flights: list[Flight], t: float) -> list[Motion]:
    motions = []
    for member, flight in zip(members, flights, strict=True):
        s, c, p = paths.state(flight, t)
        acceleration = paths.acceleration(member, flight, t)
        body, piece = int(paths.body[member]), int(paths.piece[member])
        speed = float(paths.places.speed_factors[body, piece]) * p
        motions.append(motion_at(paths.places, body, piece, (s, c), speed * speed, acceleration))
    return motions


def motion_at(
    places: Places,
    body: int,
    piece: int,
    half: tuple[float, float],
    speed_squared: float,
    acceleration: float,
) -> Motion:
    """Return the motion of a body from its place and square of its speed (m^2/s^2)."""
    data = places.system.trace.pieces[piece]
    s, c = half
    x, y = places.centre_of(body, piece, s, c)
    if data.is_line:
        slope, bend = sine_cosine(data.start_slope), 0.0
    else:
        slope = (2.0 * s * c, data.sign * (c - s) * (c + s))
        bend = data.sign * speed_squared / float(places.path_radius[body, piece])
    return Motion(body, x, y, slope, bend, acceleration)


def harmonics(paths: Paths, members: list[int], flights: list[Flight]) -> list[Harmonic]:
    """Return the forces of a group on one arc, fitted at three angles of its pendulum."""
    angles = np.array([0.0, math.tau / 3.0, 2.0 * math.tau / 3.0])
    table = np.array([_at_angle(paths, members, flights, angle) for angle in angles])
    found = []
    for i, flight in enumerate(flights):
        values = table[:, i]
        body, piece = int(paths.body[members[i]]), int(paths.piece[members[i]])
        rho = float(paths.places.path_radius[body, piece])
        mass, kappa = float(paths.places.mass[body]), float(paths.places.kappa[body])
        found.append(
            Harmonic(
                a=float(np.mean(values)),
                b=float(np.mean(values * np.cos(angles)) * 2.0),
                c=float(np.mean(values * np.sin(angles)) * 2.0),
                q=(kappa - 1.0) * mass * rho * flight.frequency**2,
            )
        )
    return found


def _at_angle(paths: Paths, members: list[int], flights: list[Flight], angle: float) -> list[float]:
    """Normal forces (N) of a group whose pendulum is at an angle, at its energy."""
    s, c = math.sin(0.5 * angle), math.cos(0.5 * angle)
    motions = []
    for member, flight in zip(members, flights, strict=True):
        body, piece = int(paths.body[member]), int(paths.piece[member])
        rho = float(paths.places.path_radius[body, piece])
        half = (
            s * flight.shift_c + c * flight.shift_s,
            c * flight.shift_c - s * flight.shift_s,
        )
        rate_squared = 4.0 * flight.frequency**2 * (flight.parameter - s * s)
        acceleration = -rho * flight.frequency**2 * (2.0 * s * c)
        squared = rho * rho * rate_squared
        motions.append(motion_at(paths.places, body, piece, half, squared, acceleration))
    return [normal for normal, _ in forces_of(paths.places, motions)]
