"""The table of events: everything but impacts that happens at an instant."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from vibro_cli.mechanics.flight import squared_rate_at
from vibro_cli.mechanics.flow import LINE, POLYNOMIAL, flow
from vibro_cli.mechanics.records import Flight
from vibro_cli.simulation.paths import Paths
from vibro_cli.simulation.world import (
    CROSSING,
    END_LIFT_OFF,
    END_OF_TRACE,
    WALL,
)

_INTEGER = ("ball", "other", "arc_from", "arc_to")
_NUMBER = ("t", "s", "speed", "value")


class Event(NamedTuple):
    """One row of ``events.parquet``; ``None`` stands for null."""

    t: float
    event: str
    ball: int | None = None
    other: int | None = None
    arc_from: int | None = None
    arc_to: int | None = None
    s: float | None = None
    speed: float | None = None
    value: float | None = None


def event_table(
    paths: Paths,
    touches: Any,
    end_cause: int,
    end_ball: int,
    turning_points: bool,
    friction: float | None,
) -> dict[str, Any]:
    """Return the columns of ``events.parquet``, in order of time."""
    events = [*_boundaries(paths), *_contacts(paths, touches), *_lift_offs(paths)]
    if turning_points:
        events += _turnings(paths)
    if friction is not None:
        events += _slips(paths, friction)
    if end_cause in (END_OF_TRACE, END_LIFT_OFF) and end_ball >= 0:
        events.append(_end(paths, end_cause, end_ball))
    events.sort(key=lambda event: event.t)
    return _columns(events)


def _columns(events: list[Event]) -> dict[str, Any]:
    table: dict[str, Any] = {}
    for name in Event._fields:
        values = [getattr(event, name) for event in events]
        if name in _NUMBER:
            table[name] = np.array([np.nan if v is None else v for v in values], dtype=np.float64)
        elif name in _INTEGER:
            filled = np.array([0 if v is None else v for v in values], dtype=np.int64)
            table[name] = np.ma.MaskedArray(filled, mask=[v is None for v in values])
        else:
            table[name] = np.array(values, dtype=object)
    return table


def _boundaries(paths: Paths) -> list[Event]:
    """Crossings and walls, from the starts of flights."""
    names = {CROSSING: "crossing", WALL: "wall"}
    log, places = paths.log, paths.places
    caused = np.isin(log["cause"], list(names))
    # A group is launched anew as a whole: only the body that came to an end of its piece counts.
    moved = np.append(False, paths.piece[1:] != paths.piece[:-1]) | (log["grouped"] == 0)
    rows = np.flatnonzero(caused & moved)
    position = places.position(paths.piece[rows], log["s"][rows], log["c"][rows])
    s = places.arc_length(paths.piece[rows], position)
    speed = places.speed_factor(paths.body[rows], paths.piece[rows]) * log["p"][rows]
    before = places.speed_factor(paths.body[rows], paths.piece[rows - 1]) * log["before_p"][rows]
    events = []
    for number, row in enumerate(rows):
        cause = int(log["cause"][row])
        value = None if cause == CROSSING else float(before[number])
        events.append(
            Event(
                t=float(log["t"][row]),
                event=names[cause],
                ball=int(paths.body[row]) + 1,
                arc_from=int(paths.piece[row - 1]) + 1,
                arc_to=int(paths.piece[row]) + 1,
                s=float(s[number]),
                speed=float(speed[number]),
                value=value,
            )
        )
    return events


def _contacts(paths: Paths, touches: Any) -> list[Event]:
    """Lasting contacts that close (``value``: duration of the accumulation, s) or open."""
    places = paths.places
    position = places.position(touches["piece_b"], touches["b_s"], touches["b_c"])
    s = places.arc_length(touches["piece_b"], position)
    events = []
    for number, row in enumerate(touches):
        opened = bool(row["opened"])
        events.append(
            Event(
                t=float(row["t"]) + float(row["delay"]),
                event="contact_opened" if opened else "contact_closed",
                ball=int(row["a"]) + 1,
                other=int(row["b"]) + 1,
                arc_from=int(row["piece_a"]) + 1,
                arc_to=int(row["piece_b"]) + 1,
                s=float(s[number]),
                speed=float(row["speed"]),
                value=None if opened else float(row["delay"]),
            )
        )
    return events


def _at(paths: Paths, index: int, after: float, name: str, value: float | None) -> Event:
    """An event during a flight, ``after`` seconds from its start."""
    state = flow(paths.flight(index), after)
    piece, body = int(paths.piece[index]), int(paths.body[index])
    column = [np.array([number]) for number in state]
    position = paths.places.position(np.array([piece]), column[0], column[1])
    factor = paths.places.speed_factor(np.array([body]), np.array([piece]))[0]
    return Event(
        t=float(paths.log["t"][index]) + after,
        event=name,
        ball=body + 1,
        arc_from=piece + 1,
        arc_to=piece + 1,
        s=float(paths.places.arc_length(np.array([piece]), position)[0]),
        speed=float(factor * state[2]),
        value=value,
    )


def _turnings(paths: Paths) -> list[Event]:
    """Turning points; ``value`` is the angle there (on a line the position)."""
    events = []
    for index in range(len(paths.log)):
        for after in _turning_times(paths, index):
            event = _at(paths, index, after, "turning", None)
            state = flow(paths.flight(index), after)
            piece = np.array([paths.piece[index]])
            place = paths.places.position(piece, np.array([state[0]]), np.array([state[1]]))
            events.append(event._replace(value=float(place[0]), speed=0.0))
    return events


def _turning_times(paths: Paths, index: int) -> list[float]:
    flight = paths.flight(index)
    duration = float(paths.duration[index])
    if flight.form == POLYNOMIAL:
        return _turning_on_segment(flight, duration)
    if flight.form == LINE:
        a = flight.line_acceleration
        after = -flight.p / a if a != 0.0 else -1.0
        return [after] if 0.0 < after < duration else []
    if flight.root_complement <= 0.0 or flight.at_rest:
        return []
    s = math.sqrt(flight.parameter)
    c = math.copysign(flight.root_complement, flight.flow_c)
    times = [*paths.passages(index, s, c, 0.0), *paths.passages(index, -s, c, 0.0)]
    return sorted(after for after in times if 0.0 < after < duration)


def _turning_on_segment(flight: Flight, duration: float) -> list[float]:
    """Turning point on a short segment across pieces, where the speed is nearly linear in time."""
    low, high = 0.0, duration
    start, end = flow(flight, low)[2], flow(flight, high)[2]
    if start * end >= 0.0:
        return []
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            return [middle]
        if flow(flight, middle)[2] * start > 0.0:
            low = middle
        else:
            high = middle


def _passing_times(paths: Paths, index: int, s2: float) -> list[tuple[float, float]]:
    """Times at which a flight passes ``S^2``, each with the sign of the change of ``S^2`` there."""
    flight = paths.flight(index)
    s0, c0 = math.sqrt(s2), math.sqrt(max(1.0 - s2, 0.0))
    found = []
    for s in (s0, -s0):
        for c in (c0, -c0):
            square = squared_rate_at(flight, s, c)
            if square <= 0.0 or (flight.root_complement >= 0.0 and c * flight.c < 0.0):
                continue
            for p in (math.sqrt(square), -math.sqrt(square)):
                if flight.root_complement < 0.0 and p * flight.p <= 0.0:
                    continue
                found += [(t, s * c * p) for t in paths.passages(index, s, c, p)]
    piece = paths.places.system.trace.pieces[flight.piece]
    inside = []
    for after, growth in sorted(found):
        state = flow(flight, after)
        angle = paths.places.position(
            np.array([flight.piece]), np.array([state[0]]), np.array([state[1]])
        )[0]
        if piece.angle_start <= angle <= piece.angle_end and after <= paths.duration[index]:
            inside.append((after, growth))
    return inside


def _lift_offs(paths: Paths) -> list[Event]:
    """Instants at which the normal force turns negative; ``value`` is that force (N) afterwards.

    On a two-sided surface they only mark where a one-sided trace could not hold the body. Flights
    in lasting contact are left out.
    """
    places = paths.places
    kappa = places.kappa[paths.body]
    sign = places.sign[paths.piece]
    limit = (1.0 + 4.0 * paths.log["parameter"] / kappa) / (2.0 + 4.0 / kappa)
    start = paths.log["s"] ** 2
    outside = sign * (start - limit) > 0.0
    events = []
    for index in np.flatnonzero((sign != 0.0) & (paths.log["grouped"] == 0)):
        was_outside = index > 0 and bool(
            outside[index - 1] and paths.body[index - 1] == paths.body[index]
        )
        if outside[index] and not was_outside:
            events.append(_at(paths, int(index), 0.0, "lift_off", None))
        if 0.0 < limit[index] < min(1.0, paths.log["parameter"][index]):
            for after, growth in _passing_times(paths, int(index), float(limit[index])):
                if growth * sign[index] > 0.0:
                    events.append(_at(paths, int(index), after, "lift_off", 0.0))
    return events


def _slips(paths: Paths, friction: float) -> list[Event]:
    """Instants from which free rolling needs more friction than there is (``value``).

    ``|sin f| (1 - 1/kappa) = mu (A + B cos f)`` is a quadratic in ``cos f``.
    """
    places = paths.places
    events = []
    for index in range(len(paths.log)):
        kappa = float(places.kappa[paths.body[index]])
        sign = float(places.sign[paths.piece[index]])
        if kappa == 1.0 or sign == 0.0 or paths.log["grouped"][index]:
            continue
        m = float(paths.log["parameter"][index])
        a, b = sign * (4.0 * m - 2.0) / kappa, sign * (1.0 + 2.0 / kappa)
        force = 1.0 - 1.0 / kappa
        roots = _quadratic(
            force**2 + (friction * b) ** 2,
            2.0 * friction**2 * a * b,
            (friction * a) ** 2 - force**2,
        )
        for cosine in roots:
            if abs(cosine) < 1.0 and a + b * cosine > 0.0:
                # Growth of force - mu N with S^2, that is with falling cos f.
                sine = math.sqrt(1.0 - cosine * cosine)
                slope = force * cosine / sine + friction * b
                for after, growth in _passing_times(paths, index, 0.5 * (1.0 - cosine)):
                    if growth * slope > 0.0:
                        events.append(_at(paths, index, after, "slip", friction))
    return events


def _quadratic(a: float, b: float, c: float) -> list[float]:
    """Real roots of ``a x^2 + b x + c``, ``a > 0``, by the stable formula."""
    discriminant = b * b - 4.0 * a * c
    if discriminant < 0.0:
        return []
    q = -0.5 * (b + math.copysign(math.sqrt(discriminant), b))
    return sorted({q / a, c / q}) if q != 0.0 else [0.0]


def _end(paths: Paths, end_cause: int, ball: int) -> Event:
    """The event that ended the run: the end of the trace, or lift-off from a one-sided one."""
    rows = np.flatnonzero((paths.body == ball) & paths.last)
    index = int(rows[0])
    name = "end" if end_cause == END_OF_TRACE else "lift_off"
    return _at(paths, index, float(paths.duration[index]), name, None)
