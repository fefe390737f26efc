"""Events on flights of a turning trace: turning points, and where the trace would have to pull.

The normal force of a flight on an arc is a trigonometric polynomial of degree 2 in its angle, on a
line it is linear in the place. In lasting contact it is not computed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

from vibro_cli.mechanics.records import Flight
from vibro_cli.mechanics.turning import zeros
from vibro_cli.mechanics.turning_flight import half_way
from vibro_cli.mechanics.turning_flow import TURNING_LINE
from vibro_cli.numerics.quartic import squared_rate
from vibro_cli.simulation.grip import Passage
from vibro_cli.simulation.paths import Paths
from vibro_cli.simulation.turning import arc_share

# A normal force above -this share of the weight is zero up to rounding.
_ROUNDING = 1e-12


def turning_times(paths: Paths, index: int) -> list[float]:
    """Times (s) within a flight at which the body turns back."""
    flight = paths.flight(index)
    duration = float(paths.duration[index])
    if flight.at_rest:
        return []
    if flight.form == TURNING_LINE:
        return [t for t in _line_turning(flight) if 0.0 < t < duration]
    if flight.turns_over:
        return []
    times = []
    for side in (1.0, -1.0):
        half = side * half_way(flight, side)
        times += paths.passages(index, *_turned(flight, half), 0.0)
    return sorted(after for after in times if 0.0 < after < duration)


def _turned(flight: Flight, half: float) -> tuple[float, float]:
    """``(S, C)`` half an angle (rad) from the start of a flight."""
    s, c = math.sin(half), math.cos(half)
    return flight.flow_s * c + flight.flow_c * s, flight.flow_c * c - flight.flow_s * s


def _line_turning(flight: Flight) -> list[float]:
    """``v cosh(b t) + a sinh(b t)/b = 0``."""
    v, a, b = flight.flow_p, flight.line_acceleration, flight.line_growth
    if v * a >= 0.0:
        return []
    ratio = -b * v / a
    if ratio >= 1.0:
        return []
    return [math.atanh(ratio) / b if b > 0.0 else -v / a]


def turning_lift_offs(paths: Paths) -> Iterator[Passage]:
    """Instants at which the normal force of a body turns negative."""
    for index in range(len(paths.log)):
        if paths.log["grouped"][index]:
            continue
        first = index == 0 or paths.body[index] != paths.body[index - 1]
        if first and (force := _force(paths, index, 0.0)) < -_ROUNDING * _weight(paths, index):
            yield Passage(index, 0.0, force)
        for after in _crossings(paths, index):
            if 0.0 < after <= float(paths.duration[index]):
                yield Passage(index, after, 0.0)


def _weight(paths: Paths, index: int) -> float:
    return float(paths.places.weight[paths.body[index]])


def _force(paths: Paths, index: int, t: float) -> float:
    """Normal force (N) a time (s) after the start of a flight."""
    assert paths.tracks is not None
    assert paths.places.system.turning is not None
    body, piece = int(paths.body[index]), int(paths.piece[index])
    track, shape = paths.tracks[body][piece], paths.places.system.trace.pieces[piece]
    s, c, p = paths.state(paths.flight(index), t)
    if shape.is_line:
        turning = paths.places.system.turning
        x = track.line_x + math.cos(shape.start_slope) * s - turning.x
        pull = turning.square / paths.places.gravity * x * math.sin(shape.start_slope)
        return _weight(paths, index) * (math.cos(shape.start_slope) + pull)
    kappa = float(paths.places.kappa[body])
    return _weight(paths, index) * shape.sign * arc_share(track, kappa, s, c, p * p)


def _crossings(paths: Paths, index: int) -> list[float]:
    """Times (s) from the start of a flight at which its normal force falls through zero."""
    assert paths.tracks is not None
    flight = paths.flight(index)
    body, piece = int(paths.body[index]), int(paths.piece[index])
    if flight.at_rest:
        return []
    if flight.form == TURNING_LINE:
        return _line_crossings(paths, index, flight)
    sign, kappa = float(paths.places.sign[piece]), float(paths.places.kappa[body])
    harmonic, double = 1.0 + 2.0 / kappa, (1.0 + 1.0 / kappa) * flight.spread
    start = sign * _force(paths, index, 0.0) / _weight(paths, index)
    sine = 2.0 * flight.flow_s * flight.flow_c
    cosine = 1.0 - 2.0 * flight.flow_s**2
    constant = start - harmonic * (cosine + flight.tilt * sine) - double * sine * sine
    found = []
    first, second = 0.5 * harmonic * complex(1.0, -flight.tilt), -0.25 * double + 0j
    for angle in zeros(constant + 0.5 * double, first, second):
        slope = sign * (
            harmonic * (flight.tilt * math.cos(angle) - math.sin(angle))
            + double * math.sin(2.0 * angle)
        )
        for turn in (1.0, -1.0):
            s, c = turn * math.sin(0.5 * angle), turn * math.cos(0.5 * angle)
            found += _falling(paths, index, flight, (s, c), slope)
    return sorted(found)


def _falling(
    paths: Paths, index: int, flight: Flight, place: tuple[float, float], slope: float
) -> list[float]:
    """Passages of a place of an arc in the direction in which the force falls."""
    s, c = place
    sine = s * flight.flow_c - c * flight.flow_s
    cosine = c * flight.flow_c + s * flight.flow_s
    square = squared_rate(flight, sine, cosine)
    if square <= 0.0 or cosine < 0.0:
        return []
    half = math.atan2(sine, cosine)
    if not flight.turns_over and not -half_way(flight, -1.0) <= half <= half_way(flight, 1.0):
        return []
    rate = -math.copysign(math.sqrt(square), slope)
    if flight.turns_over and rate * flight.flow_p < 0.0:
        return []
    return paths.passages(index, s, c, rate)


def _line_crossings(paths: Paths, index: int, flight: Flight) -> list[float]:
    """On a line the force is linear in the place: where it is zero, and moves outwards."""
    duration = float(paths.duration[index])
    marks = [0.0, *[t for t in _line_turning(flight) if 0.0 < t < duration], duration]
    found = []
    for low, high in pairwise(marks):
        if _force(paths, index, low) >= 0.0 > _force(paths, index, high):
            while low < (middle := 0.5 * (low + high)) < high:
                if _force(paths, index, middle) >= 0.0:
                    low = middle
                else:
                    high = middle
            found.append(high)
    return found
