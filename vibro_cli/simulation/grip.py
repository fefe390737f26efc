"""Events of lift-off and slip: where the trace would have to pull a body, or grip beyond friction.

On an arc, alone or in contact, the normal force of a flight is ``a + b cos f + c sin f`` and the
friction that rolling needs ``q |sin f|`` in the angle f of its pendulum: the instants at which one
of them passes a limit are known in closed form. On a line both are constant. Segments of a motion
in contact across pieces are short against its time scales; there the ends of each one decide.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

from vibro_cli.mechanics.flight import squared_rate_at
from vibro_cli.mechanics.flow import flow
from vibro_cli.mechanics.records import Flight
from vibro_cli.mechanics.trace import sine_cosine
from vibro_cli.mechanics.turning_flow import TURNING_LINE
from vibro_cli.simulation.contact_forces import (
    Harmonic,
    forces_at,
    groups_of,
    harmonics,
    is_pendulum,
)
from vibro_cli.simulation.paths import Paths
from vibro_cli.simulation.turning_forces import (
    alone_on_arc,
    force_alone,
    group_on_arc,
    passages_on_arc,
    passages_on_line,
)


class Passage(NamedTuple):
    """An event on a flight: its row in ``Paths``, the time (s) from its start, the force (N)."""

    row: int
    after: float
    normal: float


class _Grip(NamedTuple):
    """Normal force and friction (N) along one flight, and where their limits are passed."""

    at: Callable[[float], tuple[float, float]]
    passages: Callable[[float | None], list[float]] | None  # None: the ends of the flight decide


def lift_offs(paths: Paths) -> Iterator[Passage]:
    """Instants at which the normal force of a body turns negative."""
    yield from _passages(paths, None)


def slips(paths: Paths, friction: float) -> Iterator[Passage]:
    """Instants from which rolling needs more than ``friction`` times the normal force."""
    yield from _passages(paths, friction)


def _passages(paths: Paths, friction: float | None) -> Iterator[Passage]:
    """Passages of all flights; one that begins beyond the limit counts if none before it was."""
    grips = _grips(paths)
    beyond = False
    for index in range(len(paths.log)):
        if index == 0 or paths.body[index] != paths.body[index - 1]:
            beyond = False
        duration = float(paths.duration[index])
        if index not in grips or (duration == 0.0 and not paths.last[index]):
            continue
        grip = grips[index]
        normal, force = grip.at(0.0)
        if _beyond(normal, force, friction) and not beyond:
            yield Passage(index, 0.0, normal)
        for after in _growing(paths, index, grip, friction):
            yield Passage(index, after, grip.at(after)[0])
        beyond = _beyond(*grip.at(duration), friction)


def _beyond(normal: float, force: float, friction: float | None) -> bool:
    """Whether a body is beyond the limit, by more than the rounding of its forces."""
    size = 1e-12 * (abs(normal) + force)
    if friction is None:
        return normal < -size
    return force > 0.0 and force - friction * normal > size


def _growing(paths: Paths, index: int, grip: _Grip, friction: float | None) -> list[float]:
    """Times within a flight at which a body passes the limit."""
    duration = float(paths.duration[index])
    if grip.passages is None:
        if _beyond(*grip.at(0.0), friction) or not _beyond(*grip.at(duration), friction):
            return []
        return [_bisected(grip, friction, duration)]
    return sorted(after for after in grip.passages(friction) if 0.0 < after <= duration)


def _of_harmonic(paths: Paths, index: int, harmonic: Harmonic) -> Callable[[float | None], Any]:
    """Return what finds the times (s) at which a flight on an arc passes a limit."""

    def passages(friction: float | None) -> list[float]:
        flight = paths.flight(index)
        found: list[float] = []
        for angle, slope in _limits(harmonic, friction):
            for s, c, p in _states(flight, angle, slope):
                found += paths.passages(index, s, c, p)
        return found

    return passages


def _bisected(grip: _Grip, friction: float | None, duration: float) -> float:
    low, high = 0.0, duration
    while low < (middle := 0.5 * (low + high)) < high:
        if _beyond(*grip.at(middle), friction):
            high = middle
        else:
            low = middle
    return high


def _limits(harmonic: Harmonic, friction: float | None) -> list[tuple[float, float]]:
    """Angles (rad) at which a limit is met, each with the slope there of what exceeds it."""
    a, b, c, q = harmonic
    if friction is None:
        # -N grows beyond zero.
        return _zeros(-a, -b, -c)
    found = []
    for side in (1.0, -1.0) if q > 0.0 else ():
        for angle, slope in _zeros(-friction * a, -friction * b, side * q - friction * c):
            if math.sin(angle) * side > 0.0:
                found.append((angle, slope))
    return found


def _zeros(a: float, b: float, c: float) -> list[tuple[float, float]]:
    """Zeros of ``a + b cos f + c sin f`` in a turn, each with the slope there."""
    size = math.hypot(b, c)
    if size <= abs(a):
        return []
    middle, width = math.atan2(c, b), math.acos(-a / size)
    return [(middle + side * width, -side * size * math.sin(width)) for side in (1.0, -1.0)]


def _states(flight: Flight, angle: float, slope: float) -> Iterator[tuple[float, float, float]]:
    """States of a flight's pendulum at an angle, moving so that what has this slope grows."""
    for turn in (1.0, -1.0):
        s, c = turn * math.sin(0.5 * angle), turn * math.cos(0.5 * angle)
        square = squared_rate_at(flight, s, c)
        if square <= 0.0 or (flight.root_complement >= 0.0 and c * flight.flow_c < 0.0):
            continue
        p = math.copysign(math.sqrt(square), slope)
        if flight.root_complement < 0.0 and p * flight.flow_p <= 0.0:
            continue
        yield s, c, p


def _grips(paths: Paths) -> dict[int, _Grip]:
    """Forces of every flight that lasts, by its row."""
    found = {}
    for index in range(len(paths.log)):
        if not paths.log["grouped"][index]:
            turning = paths.tracks is not None
            found[index] = _alone_turning(paths, index) if turning else _alone(paths, index)
    for members in groups_of(paths):
        flights = [paths.flight(member) for member in members]
        rows = _rows_of_group(paths, members, flights)
        for place, member in enumerate(members):

            def at(
                t: float,
                members: list[int] = members,
                flights: list[Flight] = flights,
                place: int = place,
            ) -> tuple[float, float]:
                return forces_at(paths, members, flights, t)[place]

            found[member] = _Grip(at, rows[place] if rows else None)
    return found


def _rows_of_group(paths: Paths, members: list[int], flights: list[Flight]) -> list[Any]:
    """What finds the passages of every body of a group; empty if the ends of the flight decide."""
    if flights[0].form == TURNING_LINE and flights[0].at_rest == 0:
        return [
            partial(passages_on_line, paths, members[0], flights[0], partial(_force_of, at, i))
            for i in range(len(members))
            for at in [partial(forces_at, paths, members, flights)]
        ]
    if not is_pendulum(flights[0]):
        return []
    if paths.tracks is not None:
        forces = group_on_arc(paths, members, flights)
        return [
            partial(passages_on_arc, paths, member, flight, force)
            for member, flight, force in zip(members, flights, forces, strict=True)
        ]
    rows = zip(members, harmonics(paths, members, flights), strict=True)
    return [_of_harmonic(paths, member, harmonic) for member, harmonic in rows]


def _force_of(
    forces: Callable[[float], list[tuple[float, float]]], place: int, t: float
) -> tuple[float, float]:
    return forces(t)[place]


def _alone_turning(paths: Paths, index: int) -> _Grip:
    """Forces of a body alone on a turning trace."""
    flight = paths.flight(index)
    at = partial(force_alone, paths, index, flight)
    if flight.at_rest:
        return _Grip(at, None)
    if flight.form == TURNING_LINE:
        return _Grip(at, partial(passages_on_line, paths, index, flight, at))
    return _Grip(at, partial(passages_on_arc, paths, index, flight, alone_on_arc(paths, index)))


def _alone(paths: Paths, index: int) -> _Grip:
    """Forces of a body alone: ``N = m g sign (cos f + (4/kappa) P^2)`` on an arc."""
    places = paths.places
    body, piece = int(paths.body[index]), int(paths.piece[index])
    weight, kappa = float(places.weight[body]), float(places.kappa[body])
    sign = float(places.sign[piece])
    rolling = weight * (1.0 - 1.0 / kappa)
    if sign == 0.0:
        sine, cosine = sine_cosine(places.system.trace.pieces[piece].start_slope)
        constant = weight * cosine, rolling * abs(sine)
        return _Grip(lambda _: constant, None)
    flight = paths.flight(index)
    harmonic = Harmonic(
        a=sign * weight * (4.0 * flight.parameter - 2.0) / kappa,
        b=sign * weight * (1.0 + 2.0 / kappa),
        c=0.0,
        q=rolling,
    )

    def at(t: float) -> tuple[float, float]:
        s, c, p = flow(flight, t)
        normal = sign * weight * ((c - s) * (c + s) + (4.0 / kappa) * p * p)
        return normal, rolling * abs(2.0 * s * c)

    return _Grip(at, _of_harmonic(paths, index, harmonic))
