"""The table of events: everything but impacts that happens at an instant."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from vibro_cli.mechanics.flow import LINE, POLYNOMIAL, flow
from vibro_cli.mechanics.records import Flight
from vibro_cli.simulation.grip import lift_offs, slips
from vibro_cli.simulation.paths import Paths
from vibro_cli.simulation.turning_forces import turning_times
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
    events = [*_boundaries(paths), *_contacts(paths, touches)]
    events += [_at(paths, row, after, "lift_off", force) for row, after, force in lift_offs(paths)]
    if turning_points:
        events += _turnings(paths)
    if friction is not None:
        events += [
            _at(paths, row, after, "slip", friction) for row, after, _ in slips(paths, friction)
        ]
    if end_cause in (END_OF_TRACE, END_LIFT_OFF) and end_ball >= 0:
        last = _end(paths, end_cause, end_ball)
        # The normal force that vanishes at the end of the run is this event and no other.
        same = [event for event in events if event[:3] == last[:3]]
        events = [event for event in events if event not in same]
        events.append(last)
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
    state = paths.state(paths.flight(index), after)
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
            state = paths.state(paths.flight(index), after)
            piece = np.array([paths.piece[index]])
            place = paths.places.position(piece, np.array([state[0]]), np.array([state[1]]))
            events.append(event._replace(value=float(place[0]), speed=0.0))
    return events


def _turning_times(paths: Paths, index: int) -> list[float]:
    flight = paths.flight(index)
    duration = float(paths.duration[index])
    if flight.form == POLYNOMIAL:
        return _turning_on_segment(flight, duration)
    if paths.tracks is not None:
        return turning_times(paths, index)
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


def _end(paths: Paths, end_cause: int, ball: int) -> Event:
    """The event that ended the run: the end of the trace, or lift-off from a one-sided one."""
    rows = np.flatnonzero((paths.body == ball) & paths.last)
    index = int(rows[0])
    name = "end" if end_cause == END_OF_TRACE else "lift_off"
    return _at(paths, index, float(paths.duration[index]), name, None)
