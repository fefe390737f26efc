"""The table of events: all instantaneous events but impacts."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibro_cli.compile.kernel import dtype
from vibro_cli.kernels.events.liftoff_slip import (
    LIFT_OFF,
    MOST_PLACES,
    SLIP,
    TURNING,
    Course,
    Passage,
    Progress,
    Search,
    Span,
    find_passages,
)
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.world import CROSSING, END_LIFT_OFF, END_OF_TRACE, RUNNING, WALL, Flight
from vibro_cli.systems.driver import called, chosen, joined, zeros
from vibro_cli.systems.request import OutputRequest
from vibro_cli.systems.trace.motion import Paths

NAMES = (
    "crossing", "wall", "contact_closed", "contact_opened", "lift_off", "turning", "slip", "end",
)  # fmt: skip
# Order of the names above at one instant; equal ones are ordered by body.
_SORTS = (0, 0, 1, 1, 2, 3, 4, 5)
# Indices of names by kind of passage.
_PASSED = np.array([NAMES.index(name) for name in ("turning", "lift_off", "slip")])
ROW = np.dtype(
    [
        ("t", np.float64), ("name", np.int64), ("ball", np.int64), ("other", np.int64),
        ("arc_from", np.int64), ("arc_to", np.int64), ("s", np.float64), ("speed", np.float64),
        ("value", np.float64), ("sort", np.int64), ("place", np.int64),
    ]
)  # fmt: skip
"""Row of the table; a ball or arc of 0 and a value of nan stand for null."""
OPEN = np.dtype(
    [
        ("found", dtype(Span)["found"]),
        *((name, np.int64) for name in ("begun", "lift_end", "slip_end")),
    ]
)
"""State of a body between stretches: the passages found so far on the flight in progress, whether
its start has been reported, and on which side of each limit the flight before it ended."""
# Passages that one call of the kernel can return.
_ROOM = 1024

Rows = Any


class Events:
    """Finds the events of a run, stretch by stretch, as requested by ``OutputRequest``."""

    def __init__(self, bodies: int, wanted: OutputRequest) -> None:
        self._wanted = wanted
        self._open = np.zeros(bodies, dtype=OPEN)
        self._waiting = _rows(0)
        self._placed = 0

    def take(self, paths: Paths) -> Rows:
        """Return the rows that no later row can precede, in order of time.

        At the end of the run these are all that remain.
        """
        stretch = paths.stretch
        rows = joined([self._waiting, self._rows(paths)])
        if stretch.cause == RUNNING:
            # A flight in progress is searched up to now, a segment across pieces once it has ended.
            until = paths.log["t"] + np.where(_is_segment(paths.log), 0.0, paths.duration)
            ready = rows["t"] < min(float(until[paths.last].min()), stretch.settled)
            self._waiting = chosen(rows, ~ready)
            return _in_order(chosen(rows, ready))
        ball = int(stretch.clock["last_ball"])
        if stretch.cause in (END_OF_TRACE, END_LIFT_OFF) and ball >= 0:
            last = _end(paths, ball)
            # A normal force that vanishes at the end of the run gives this event only.
            rows = joined([chosen(rows, rows["name"] != last["name"]), last])
        return _in_order(rows)

    def _rows(self, paths: Paths) -> Rows:
        passages = self._passages(paths)
        parts = (
            boundaries(paths),
            _contacts(paths),
            _events_of(paths, passages, self._wanted.friction),
        )
        for rows in parts:
            rows["place"] += self._placed
            self._placed += len(rows)
        return joined(parts)

    def _passages(self, paths: Paths) -> Any:
        """Return the passages of all flights as records of ``Passage``, with rows of `paths`."""
        ended = paths.stretch.cause != RUNNING
        spans, found = self._find(paths, self._spans(paths, ended))
        # Of several launches at one instant only the last counts: the others have no duration.
        counted = (paths.duration != 0.0) | (paths.last & ended)
        counted &= (paths.log["grouped"] == 0) | (paths.duration > 0.0)
        counted &= (spans["ended"] == 1) | ~_is_segment(paths.log)
        begun = [self._begun_beyond(paths, spans, counted, kind) for kind in (LIFT_OFF, SLIP)]
        self._keep_open(paths, spans, counted)
        return joined([found, *begun])

    def _find(self, paths: Paths, spans: Any) -> tuple[Any, Any]:
        """Return the spans as completed by the kernel, and the passages that it found."""
        # The kernel needs the order of the log, where bodies in contact are adjacent.
        order = np.empty_like(paths.number)
        order[paths.number] = np.arange(len(order))
        progress: Any = zeros(1, Progress)
        progress["turning_points"] = self._wanted.turning_points
        friction = self._wanted.friction
        progress["friction"] = -1.0 if friction is None else friction
        rooms = zeros(_ROOM, Passage), zeros(MOST_PLACES, Course), zeros(2, Flight)
        search = Search(spans.take(order), progress, *rooms)
        found = []
        filled = _ROOM
        while filled == _ROOM:
            filled = called(find_passages, paths.overrides, paths.world, search)
            found.append(rooms[0][:filled].copy())
        passages = joined(found)
        passages["span"] = order[passages["span"]]
        return np.asarray(search.spans).take(paths.number), passages

    def _spans(self, paths: Paths, ended: bool) -> Any:
        """Return the flights of a stretch, with what was found earlier on those in progress."""
        spans = zeros(len(paths.log), Span)
        spans["row"], spans["duration"] = paths.number, paths.duration
        spans["ended"] = np.where(paths.last, ended, 1)
        before = np.flatnonzero(paths.number < paths.stretch.known)
        for name in ("found", "begun"):
            spans[name][before] = self._open[name][paths.body[before]]
        return spans

    def _begun_beyond(self, paths: Paths, spans: Any, counted: Any, kind: int) -> Any:
        """Return the starts of flights beyond a limit whose predecessor ended within it."""
        name = "lift" if kind == LIFT_OFF else "slip"
        beyond = (spans[f"{name}_start"] == 1) & (spans["begun"] == 0) & counted
        begun = np.flatnonzero(beyond)
        if len(begun):
            # The previous flight that counts, or the state kept from the stretch before.
            places = np.where(counted, np.arange(len(counted)), -1)
            last = np.append(-1, np.maximum.accumulate(places))[begun]
            body = paths.body[begun]
            ended = np.where(
                (last >= 0) & (paths.body[last] == body),
                spans[f"{name}_end"][last],
                self._open[f"{name}_end"][body],
            )
            begun = begun[ended == 0]
        found = _at(paths, begun, np.zeros(len(begun)))
        found["kind"], found["normal"] = kind, spans["normal"][begun]
        return found

    def _keep_open(self, paths: Paths, spans: Any, counted: Any) -> None:
        """Keep the state of the flights in progress for the next stretch."""
        over = np.flatnonzero(counted & (spans["ended"] == 1))
        # The last row of each body wins.
        for name in ("lift_end", "slip_end"):
            self._open[name][paths.body[over]] = spans[name][over]
        last = np.flatnonzero(paths.last)
        self._open["found"][paths.body[last]] = spans["found"][last]
        self._open["begun"][paths.body[last]] = counted[last]


def _in_order(rows: Rows) -> Rows:
    ball = np.where(rows["sort"] == 1, 0, rows["ball"])
    order = np.argsort(rows["t"], kind="stable")
    t = rows["t"][order]
    if np.any(t[1:] == t[:-1]):
        order = np.lexsort((rows["place"], ball, rows["sort"], rows["t"]))
    return rows.take(order)


def event_columns(rows: Rows) -> dict[str, Any]:
    """Return the columns of ``events.parquet``, with events as indices into `NAMES`."""
    table: dict[str, Any] = {"t": rows["t"].copy(), "event": rows["name"].copy()}
    for name in ("ball", "other", "arc_from", "arc_to"):
        values = rows[name].copy()
        table[name] = np.ma.MaskedArray(values, mask=values == 0)
    return table | {name: rows[name].copy() for name in ("s", "speed", "value")}


def _rows(count: int) -> Rows:
    rows = np.zeros(count, dtype=ROW)
    rows["value"] = np.nan
    return rows


def boundaries(paths: Paths) -> Rows:
    """Return crossings and impacts on walls, from the flights that start in this stretch."""
    log, places = paths.log, paths.places
    caused = (log["cause"] == CROSSING) | (log["cause"] == WALL)
    caused &= paths.number >= paths.stretch.known
    # A whole group is launched again; only the body that reached an end of its piece counts.
    moved = np.append(False, paths.piece[1:] != paths.piece[:-1]) | (log["cause"] == WALL)
    # At the seam of a circle of one piece, a full turn reverses the sign of (S, C).
    moved |= log["s"] * log["before_s"] + log["c"] * log["before_c"] < 0.0
    at = np.flatnonzero(caused & moved)
    body, piece, before = paths.body[at], paths.piece[at], paths.piece[at - 1]
    rows = _rows(len(at))
    wall = log["cause"][at] == WALL
    rows["t"] = log["t"][at]
    rows["name"] = np.where(wall, NAMES.index("wall"), NAMES.index("crossing"))
    rows["ball"], rows["arc_from"], rows["arc_to"] = body + 1, before + 1, piece + 1
    position = places.position(piece, log["s"][at], log["c"][at])
    rows["s"] = places.arc_length(piece, position)
    rows["speed"] = places.speed_factor(body, piece) * log["p"][at]
    rows["value"] = np.where(wall, places.speed_factor(body, before) * log["before_p"][at], np.nan)
    rows["sort"], rows["place"] = 0, np.arange(len(at))
    return rows


def _contacts(paths: Paths) -> Rows:
    """Return lasting contacts that close (``value``: duration of the accumulation, s) or open."""
    places, touches = paths.places, paths.stretch.logs["touches"]
    rows = _rows(len(touches))
    opened = touches["opened"] == 1
    rows["t"] = touches["t"] + touches["delay"]
    rows["name"] = np.where(opened, NAMES.index("contact_opened"), NAMES.index("contact_closed"))
    rows["ball"], rows["other"] = touches["a"] + 1, touches["b"] + 1
    rows["arc_from"], rows["arc_to"] = touches["piece_a"] + 1, touches["piece_b"] + 1
    position = places.position(touches["piece_a"], touches["s"], touches["c"])
    rows["s"] = places.arc_length(touches["piece_a"], position)
    rows["speed"] = places.speed_factor(touches["a"], touches["piece_a"]) * touches["p"]
    rows["value"] = np.where(opened, np.nan, touches["delay"])
    rows["sort"], rows["place"] = 1, np.arange(len(touches))
    return rows


def _events_of(paths: Paths, passages: Any, friction: float | None) -> Rows:
    """Return turning points, lift-off and slip, the events during flights."""
    at, places = passages["span"], paths.places
    body, piece = paths.body[at], paths.piece[at]
    position = places.position(piece, passages["s"], passages["c"])
    turning, slip = passages["kind"] == TURNING, passages["kind"] == SLIP
    rows = _rows(len(at))
    rows["t"] = paths.log["t"][at] + passages["after"]
    rows["name"] = _PASSED[passages["kind"]]
    rows["ball"], rows["arc_from"], rows["arc_to"] = body + 1, piece + 1, piece + 1
    rows["s"] = places.arc_length(piece, position)
    speed = places.speed_factor(body, piece) * passages["p"]
    rows["speed"] = np.where(turning, 0.0, speed)
    rows["value"] = np.where(turning, position, passages["normal"])
    if friction is not None:
        rows["value"][slip] = friction
    rows["sort"] = np.array(_SORTS)[rows["name"]]
    order = np.lexsort((passages["after"], at))
    rows["place"][order] = np.arange(len(at))
    return rows


def _is_segment(log: Any) -> Any:
    """Return flags of flights that are short segments of motion in contact across pieces."""
    grouped = log["grouped"] == 1
    if not grouped.any():
        return grouped
    moving = grouped & (log["at_rest"] == 0)
    return moving & (log["segment"] > 0.0) & (log["segment"] < NEVER)


def _at(paths: Paths, rows: Any, after: Any) -> Any:
    """Return records of ``Passage`` at times (s) after the starts of flights."""
    found = zeros(len(rows), Passage)
    found["span"], found["after"] = rows, after
    if len(rows):
        states = paths.states(rows, after)
        for name in "scp":
            found[name] = states[name]
    return found


def _end(paths: Paths, ball: int) -> Rows:
    """Return the event that ended the run: end of the trace, or lift-off from a one-sided one."""
    row = np.flatnonzero((paths.body == ball) & paths.last)[:1]
    passage = _at(paths, row, paths.duration[row])
    passage["kind"], passage["normal"] = LIFT_OFF, np.nan
    rows = _events_of(paths, passage, None)
    rows["t"] = paths.t_end[row]
    if paths.stretch.cause == END_OF_TRACE:
        rows["name"] = NAMES.index("end")
    rows["sort"] = _SORTS[NAMES.index("end")]
    return rows
