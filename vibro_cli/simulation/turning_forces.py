"""Events on flights of a turning trace: turning points, and where its forces pass a limit.

On an arc the normal force and the friction along the trace are trigonometric polynomials of degree
2 in the angle from the start of a flight, alone or in contact; on a line they are linear in the
place.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vibro_cli.mechanics.records import Flight
from vibro_cli.mechanics.turning import zeros
from vibro_cli.mechanics.turning_fall import press_harmonics, pull_harmonics, scaled
from vibro_cli.mechanics.turning_flow import TURNING_LINE, pull_of
from vibro_cli.mechanics.turning_passage import half_way, time_on_line, turn_on_line
from vibro_cli.numerics.harmonics import Harmonics, harmonic_slope, harmonic_value
from vibro_cli.numerics.quartic import squared_rate
from vibro_cli.simulation.contact_forces import forces_of, motion_at
from vibro_cli.simulation.paths import Paths

Forces = Callable[[float], tuple[float, float]]


class ArcForces(NamedTuple):
    """Normal force and, with its sign, friction (N) in the angle from the start of a flight."""

    normal: Harmonics
    friction: Harmonics


def turning_times(paths: Paths, index: int) -> list[float]:
    """Times (s) within a flight at which the body turns back."""
    flight = paths.flight(index)
    duration = float(paths.duration[index])
    if flight.at_rest or flight.turns_over:
        return []
    if flight.form == TURNING_LINE:
        way = turn_on_line(flight)
        times = [time_on_line(flight, way, 0.0)] if way * flight.flow_p > 0.0 else []
    else:
        times = []
        for side in (1.0, -1.0):
            half = side * half_way(flight, side)
            times += paths.passages(index, *_turned(flight, half), 0.0)
    return sorted(after for after in times if 0.0 < after < duration)


def _turned(flight: Flight, half: float) -> tuple[float, float]:
    """``(S, C)`` half an angle (rad) from the start of a flight."""
    s, c = math.sin(half), math.cos(half)
    return flight.flow_s * c + flight.flow_c * s, flight.flow_c * c - flight.flow_s * s


def force_alone(paths: Paths, index: int, flight: Flight, t: float) -> tuple[float, float]:
    """Return normal force and friction (N) of a body alone, a time (s) after its flight began."""
    places, body, piece = paths.places, int(paths.body[index]), int(paths.piece[index])
    s, c, p = paths.state(flight, t)
    speed = float(places.speed_factors[body, piece]) * p
    acceleration = paths.acceleration(index, flight, t)
    motion = motion_at(places, body, piece, (s, c), speed * speed, acceleration)
    return forces_of(places, [motion])[0]


def alone_on_arc(paths: Paths, index: int) -> ArcForces:
    """Return the forces of a body alone on an arc."""
    assert paths.tracks is not None
    flight = paths.flight(index)
    body, piece = int(paths.body[index]), int(paths.piece[index])
    track = paths.tracks[body][piece]
    weight, kappa = float(paths.places.weight[body]), float(paths.places.kappa[body])
    press = press_harmonics(flight, track.tilt, track.spread, kappa)
    return ArcForces(
        scaled(weight * float(paths.places.sign[piece]), press),
        scaled(weight * (1.0 - 1.0 / kappa), pull_harmonics(flight)),
    )


def group_on_arc(paths: Paths, members: list[int], flights: list[Flight]) -> list[ArcForces]:
    """Return the forces of the bodies of a group on one arc, fitted at five angles."""
    angles = math.tau / 5.0 * np.arange(5)
    table = np.array([_normal_forces(paths, members, flights, x) for x in angles.tolist()])
    places, found = paths.places, []
    for i, (member, flight) in enumerate(zip(members, flights, strict=True)):
        values = table[:, i]
        waves = [(np.cos(n * angles), np.sin(n * angles)) for n in (1, 2)]
        (b, c), (d, e) = [(0.4 * float(values @ x), 0.4 * float(values @ y)) for x, y in waves]
        body, piece = int(paths.body[member]), int(paths.piece[member])
        mass, kappa = float(places.mass[body]), float(places.kappa[body])
        size = (kappa - 1.0) * mass * float(places.path_radius[body, piece]) * flight.frequency**2
        normal = (float(np.mean(values)), b, c, d, e)
        found.append(ArcForces(normal, scaled(size, pull_harmonics(flight))))
    return found


def _normal_forces(
    paths: Paths, members: list[int], flights: list[Flight], angle: float
) -> list[float]:
    """Normal forces (N) of a group at an angle (rad) from its start, at its energy."""
    motions = []
    sine, cosine = math.sin(0.5 * angle), math.cos(0.5 * angle)
    for member, flight in zip(members, flights, strict=True):
        s, c = _turned(flight, 0.5 * angle)
        body, piece = int(paths.body[member]), int(paths.piece[member])
        rho, w = float(paths.places.path_radius[body, piece]), flight.frequency
        half = (s * flight.shift_c + c * flight.shift_s, c * flight.shift_c - s * flight.shift_s)
        squared = 4.0 * (rho * w) ** 2 * squared_rate(flight, sine, cosine)
        acceleration = rho * w * w * pull_of(flight, s, c)
        motions.append(motion_at(paths.places, body, piece, half, squared, acceleration))
    return [normal for normal, _ in forces_of(paths.places, motions)]


def passages_on_arc(
    paths: Paths, index: int, flight: Flight, forces: ArcForces, friction: float | None
) -> list[float]:
    """Return the times (s) at which a flight on an arc passes a limit, growing beyond it.

    That is where the normal force falls through zero, or with a coefficient of friction where
    rolling needs more than that times the normal force.
    """
    found = []
    for side in (0.0,) if friction is None else (1.0, -1.0):
        share = 1.0 if friction is None else friction
        pairs = zip(forces.friction, forces.normal, strict=True)
        a, b, c, d, e = (side * f - share * n for f, n in pairs)
        slope = harmonic_slope((a, b, c, d, e))
        for angle in zeros(a, 0.5 * complex(b, -c), 0.5 * complex(d, -e)):
            sine, cosine = math.sin(angle), math.cos(angle)
            if side * harmonic_value(forces.friction, sine, cosine) >= 0.0:
                grows = harmonic_value(slope, sine, cosine)
                for turn in (-math.pi, 0.0, math.pi):
                    found += _passages(paths, index, flight, 0.5 * angle + turn, grows)
    return found


def _passages(paths: Paths, index: int, flight: Flight, half: float, slope: float) -> list[float]:
    """Passages of a place half an angle (rad) from the start, so that what has the slope grows."""
    square = squared_rate(flight, math.sin(half), math.cos(half))
    if square <= 0.0:
        return []
    rate = math.copysign(math.sqrt(square), slope)
    if flight.turns_over:
        ahead = half * flight.flow_p > 0.0 and rate * flight.flow_p > 0.0
    else:
        ahead = -half_way(flight, -1.0) <= half <= half_way(flight, 1.0)
    return paths.passages(index, *_turned(flight, half), rate) if ahead else []


def passages_on_line(
    paths: Paths, index: int, flight: Flight, at: Forces, friction: float | None
) -> list[float]:
    """Return the times (s) at which a flight on a line passes a limit, growing beyond it.

    Between its ends, its turning point and the place at which nothing pulls, what exceeds the
    limit is monotonic.
    """

    def excess(t: float) -> float:
        normal, force = at(t)
        return -normal if friction is None else force - friction * normal

    duration = float(paths.duration[index])
    marks = [t for t in (*turning_times(paths, index), *_balance(flight)) if 0.0 < t < duration]
    found = []
    for low, high in pairwise([0.0, *sorted(marks), duration]):
        if excess(low) <= 0.0 < excess(high):
            while low < (middle := 0.5 * (low + high)) < high:
                if excess(middle) <= 0.0:
                    low = middle
                else:
                    high = middle
            found.append(high)
    return found


def _balance(flight: Flight) -> list[float]:
    """Time at which a body passes where nothing pulls on a line: ``tanh(b t) = -a/(b v)``."""
    a, moved = flight.line_acceleration, flight.line_growth * flight.flow_p
    if moved == 0.0 or not 0.0 < -a / moved < 1.0:
        return []
    return [math.atanh(-a / moved) / flight.line_growth]
