"""The phase trajectory of one body in a run: branches between events, jumps at impacts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from vibro_cli.analysis.levels import Landscape, free_branches
from vibro_cli.figures.source import (
    SPEEDS,
    Array,
    Flags,
    Integers,
    Recorded,
    Table,
    flights_of,
    goes_through,
    kept,
    made,
)
from vibro_cli.mechanics.trace import Piece, Trace

MOST_NUMBERS = 12
"""Impacts that are numbered and marked one by one."""
MOST_BRANCHES = 4000
"""Of more branches than this an even choice is drawn; more would only make a stain."""

_PER_PERIOD = 64
"""Points of a small oscillation in lasting contact."""
_FIRST_PERIODS = 3.0
"""Of a long flight at first, then twice as many, until it has come round."""
_FINER = 4.0
"""As many times as the points that are drawn are sampled of several flights in one branch."""
_TINY = 1e-3
"""Branches within this share of the extent of the others, in place and in rate, are left out."""
_TURNS = 2
"""Turning points after which, at the next, an oscillation has come round."""

_SAME_ENERGY = 1e-9
"""A free flight keeps its energy at least to this fraction, ..."""
_NO_ENERGY = 1e-12
"""... or to this fraction of what it would need to rise by the length of the trace."""


@dataclass(frozen=True)
class Branches:
    """Curves between events on one piece."""

    position: Array
    """φ or ψ (rad), distance on a line (m); shape (branches, points)."""
    rate: Array
    """φ̇ or ψ̇ (rad/s), speed on a line (m/s); the same shape."""
    time: Array
    """Time (s) at which each begins; shape (branches,)."""
    contact: Flags
    """Whether each is one of lasting contact."""


@dataclass(frozen=True)
class Jumps:
    """Jumps of one body at its impacts; arrays of shape (impacts,)."""

    number: Integers
    """Number n of the impact in the run."""
    piece: Integers
    """Index of the piece, from 0."""
    position: Array
    """φ or ψ (rad), distance on a line (m)."""
    before: Array
    """Rate before the impact (rad/s, on a line m/s)."""
    after: Array
    """Rate after it."""
    time: Array
    """Time (s)."""
    through: Flags
    """Whether the law would send the bodies through one another."""
    made: Flags
    """Whether the bodies did so: not at an impact at which the run ended instead."""

    def some(self, chosen: slice) -> Jumps:
        """Return some of the jumps."""
        fields = Jumps.__dataclass_fields__
        return Jumps(**{name: getattr(self, name)[chosen].copy() for name in fields})


@dataclass(frozen=True)
class Trajectory:
    """What a body ran through, piece by piece."""

    branches: tuple[Branches, ...]
    """One entry for each piece of the trace."""
    jumps: Jumps
    first: Jumps
    """The jumps at the first impacts, which are marked and numbered one by one."""
    start: tuple[int, float, float]
    """Index of the piece, position and rate at the start."""
    end: float
    """Time (s) at which the run ended."""
    every: int
    """1 if every branch and every jump is there, else n for one in n."""


@kept
def trajectory(run: Recorded, ball: int) -> Trajectory:
    """Return the phase trajectory of a body (from 1) of a run.

    Free flights are curves of constant energy in closed form; those in lasting contact, and those
    on a rotating trace, are sampled from the run.
    """
    flights = run.flights()
    mine = flights_of(flights, ball)
    first, last = strands(flights, mine)
    seen = _large_enough(run, ball, flights, first, last)
    first, last = first[seen], last[seen]
    every = max(1, math.ceil(len(first) / MOST_BRANCHES))
    some = _passages(flights, first, 2 * len(run.system.trace.pieces)) % every == 0
    ends = first[some], last[some]
    count = points_each(len(ends[0]))
    free = _free(run, ball, flights, ends[0])
    branches = tuple(
        _branches(run, flights, ball, piece, ends, free, count) for piece in run.system.trace.pieces
    )
    start = (
        int(flights["arc"][mine[0]]) - 1,
        float(flights["angle_start"][mine[0]]),
        float(flights["rate_start"][mine[0]]),
    )
    end = float(np.max(flights["t_end"][mine]))
    jumps = jumps_of(run.collisions, ball, every, partial(_states_on, run.system.trace))
    return Trajectory(branches, *jumps, start, end, every)


def strands(flights: Table, mine: Integers) -> tuple[Integers, Integers]:
    """Return the first and the last flight of each branch of one body.

    A flight is a branch, but lasting contact across pieces, which the run has in short segments,
    is one as long as the body stays on a piece. `mine` are the rows of the body's flights.
    """
    contact = flights["contact"][mine]
    arc = flights["arc"][mine]
    segment = flights["cause_start"][mine] == "segment"
    goes_on = segment[1:] & contact[1:] & contact[:-1] & (arc[1:] == arc[:-1])
    begins = np.append(True, ~goes_on)
    ends = np.append(~goes_on, True)
    return mine[begins], mine[ends]


def _large_enough(
    run: Recorded, ball: int, flights: Table, first: Integers, last: Integers
) -> Flags:
    """Return which branches can be seen beside the largest on their piece.

    Hundreds of bounces on a wall come to their end within a hair's breadth; were they counted, the
    others would be drawn one in so many, and as faint as a thousand lines are.
    """
    large: Flags = first != last
    for piece in run.system.trace.pieces:
        here = np.flatnonzero((flights["arc"][first] == piece.index + 1) & ~large)
        if not len(here):
            continue
        rows = first[here]
        start, end = flights["angle_start"][rows], flights["angle_end"][rows]
        rate = np.maximum(np.abs(flights["rate_start"][rows]), np.abs(flights["rate_end"][rows]))
        lasts = flights["t_end"][rows] - flights["t_start"][rows]
        # A short flight has its greatest rate at one of its ends; a long one may go far and return.
        way = np.where(lasts * _fastest(run, ball, piece) < 1.0, rate * lasts, math.inf)
        extent = max(np.max(start), np.max(end)) - min(np.min(start), np.min(end))
        tiny = (way < _TINY * extent) & (rate < _TINY * np.max(rate))
        large[here] = ~tiny | (rate == 0.0)  # rest is not a bounce
    return large


def _passages(flights: Table, first: Integers, most: int) -> Integers:
    """Return the number of the passage to which each branch belongs, from 0.

    One goes on across the pieces until another event, or for `most` branches: whatever is chosen of
    it is there on every piece. `first` are the first flights of the branches.
    """
    begins = flights["cause_start"][first] != "crossing"
    begins[0] = True
    since = np.arange(len(first))
    since -= np.maximum.accumulate(np.where(begins, since, 0))
    return np.cumsum(since % most == 0) - 1


def points_each(branches: int) -> int:
    """Return the points of each branch, one more than a power of 2: fewer where there are many."""
    return int(2 ** np.clip(round(math.log2(160000 / max(branches, 1))), 6, 8)) + 1


def _free(run: Recorded, ball: int, flights: Table, rows: Integers) -> Flags:
    """Return which flights of a body are free: on a trace at rest and not in lasting contact."""
    if run.system.turning is not None:
        return np.zeros(len(rows), dtype=np.bool_)
    landscape = Landscape.of(run.system, ball)
    least = _NO_ENERGY * landscape.weight * landscape.trace.length
    kept = np.zeros(len(rows), dtype=np.bool_)
    for piece in run.system.trace.pieces:
        here = flights["arc"][rows] == piece.index + 1
        mine = rows[here]
        start = landscape.energy(piece, flights["angle_start"][mine], flights["rate_start"][mine])
        end = landscape.energy(piece, flights["angle_end"][mine], flights["rate_end"][mine])
        kept[here] = np.abs(end - start) <= _SAME_ENERGY * np.maximum(start, end) + least
    held = (flights["rate_start"][rows] == 0.0) & (flights["rate_end"][rows] == 0.0)
    held &= flights["angle_start"][rows] == flights["angle_end"][rows]  # at rest, as at a wall
    free: Flags = kept & ~held & ~flights["contact"][rows]
    return free


def _branches(
    run: Recorded,
    flights: Table,
    ball: int,
    piece: Piece,
    ends: tuple[Integers, Integers],
    free: Flags,
    count: int,
) -> Branches:
    """Return the branches on one piece, of those that begin and end with the given flights."""
    first, last = ends
    here = flights["arc"][first] == piece.index + 1
    rows = first[here & free]
    position = np.empty((0, count))
    rate = np.empty((0, count))
    if len(rows):
        position, rate = free_branches(
            Landscape.of(run.system, ball),
            piece,
            (flights["angle_start"][rows], flights["rate_start"][rows]),
            (flights["angle_end"][rows], flights["rate_end"][rows]),
            flights["t_end"][rows] - flights["t_start"][rows],
            count,
        )
    pace = _pace(run, ball, piece)
    bound = here & ~free
    spans = [
        range(one, other + 1)
        for one, other in zip(first[bound].tolist(), last[bound].tolist(), strict=True)
    ]
    if spans:
        run.look_at(np.concatenate(spans))
    sampled = [_sampled(run, flights, span, pace, count) for span in spans]
    begin = np.concatenate([rows, first[bound]])
    return Branches(
        np.concatenate([position, *(curve[None, :, 0] for curve in sampled)]),
        np.concatenate([rate, *(curve[None, :, 1] for curve in sampled)]),
        flights["t_start"][begin].astype(np.float64),
        flights["contact"][begin],
    )


def _pace(run: Recorded, ball: int, piece: Piece) -> float:
    """Return how many points a body's motion on a piece wants per second."""
    if piece.is_line:
        return 0.0
    return _PER_PERIOD * _fastest(run, ball, piece) / (2.0 * math.pi)


def _fastest(run: Recorded, ball: int, piece: Piece) -> float:
    """Return the fastest rate (rad/s) of a body's motion on a piece: on a line that of turning."""
    if piece.is_line:
        return 0.0 if run.system.turning is None else abs(run.system.turning.rate)
    return run.system.fastest_rate(run.system.bodies[ball - 1], piece)


def _sampled(run: Recorded, flights: Table, rows: range, pace: float, count: int) -> Array:
    """Return `count` states of the run, shape (count, 2), along flights that follow one another.

    An oscillation in lasting contact may go on for long: of its closed curve one period is drawn.
    """
    times = flights["t_end"][rows.start : rows.stop] - flights["t_start"][rows.start : rows.stop]
    if len(rows) == 1:
        return _sampled_flight(run, rows.start, float(times[0]), pace, count)
    share = times / max(float(np.sum(times)), float(np.finfo(np.float64).tiny))
    curves = [
        np.column_stack(run.flight_curve(row, math.ceil(number) + 1)[1:])
        for row, number in zip(rows, (_FINER * count * share).tolist(), strict=True)
    ]
    return _chosen(np.concatenate(curves), count)


def _sampled_flight(run: Recorded, row: int, time: float, pace: float, count: int) -> Array:
    """Return `count` states of the run along one flight, of its closed curve one period.

    An oscillation turns after equal times: where it has hardly turned, as many points find that in
    twice the time.
    """
    lasts = min(time, _FIRST_PERIODS * _PER_PERIOD / pace if pace > 0.0 else math.inf)
    number = max(count - 1, math.ceil(pace * lasts))
    while True:
        points = np.column_stack(run.flight_curve(row, number + 1, lasts)[1:])
        turns = np.flatnonzero(points[1:, 1] * points[:-1, 1] < 0.0)
        shown = turns[_TURNS] + 1 if len(turns) > _TURNS else number
        if shown < number or lasts >= time:
            break
        lasts = min(time, 2.0 * lasts)
    if shown == count - 1:
        return points[:count]
    return np.column_stack(run.flight_curve(row, count, lasts * (shown / number))[1:])


def _chosen(points: Array, count: int) -> Array:
    """Return `count` points of the line through points, evenly, with both ends."""
    place, known = np.linspace(0.0, len(points) - 1.0, count), np.arange(len(points))
    return np.column_stack([np.interp(place, known, column) for column in points.T])


Own = Callable[..., Array]
"""Gives the values of a column of the impacts at the body: from its name without the end of the
pair, and what follows that."""


def _states_on(trace: Trace, own: Own) -> tuple[Array, Array, Array, Array]:
    """Return piece, position, and rates before and after impacts of a body on a trace."""
    piece = own("arc") - 1
    position, before, after = own("angle"), own("rate", "_pre"), own("rate", "_post")
    for line in (line for line in trace.pieces if line.is_line):
        on_line = piece == line.index  # the table has no angles there
        position[on_line] = own("s")[on_line] - line.start_s
        before[on_line] = own("speed", "_pre")[on_line]
        after[on_line] = own("speed", "_post")[on_line]
    return piece, position, before, after


def jumps_of(
    table: Table, ball: int, every: int, states: Callable[[Own], tuple[Array, Array, Array, Array]]
) -> tuple[Jumps, Jumps]:
    """Return one in so many jumps of a body (from 1) at its impacts, and the first ones.

    `states` gives piece, position, and rates before and after.
    """
    left = np.asarray(table["ball_a"]) == ball
    rows = np.flatnonzero(left | (np.asarray(table["ball_b"]) == ball))
    some, firsts = rows[::every], rows[:MOST_NUMBERS]
    rows = np.concatenate([some, firsts])

    def column(name: str) -> Array:
        return np.asarray(table[name])[rows]

    def own(name: str, after: str = "") -> Array:
        return np.where(left[rows], *(column(f"{name}_{side}{after}") for side in "ab"))

    piece, position, before, after = states(own)
    jumps = Jumps(
        number=column("n").astype(np.int64),
        piece=piece.astype(np.int64),
        position=position,
        before=before,
        after=after,
        time=column("t").astype(np.float64),
        through=goes_through({name: column(name) for name in SPEEDS}),
        made=made({name: column(name) for name in ("admissible", "substituted")}),
    )
    return jumps.some(slice(0, len(some))), jumps.some(slice(len(some), None))
