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
)
from vibro_cli.mechanics.trace import Piece, Trace
from vibro_cli.systems.columns import made

MOST_NUMBERS = 12
"""Number of first impacts that are numbered and marked individually."""
MOST_BRANCHES = 4000
"""Number of branches above which evenly chosen ones are drawn; more would be indistinguishable."""

_PER_PERIOD = 64
"""Points per small oscillation in lasting contact."""
_FIRST_PERIODS = 3.0
"""Periods of a long flight that are sampled at first; doubled until its curve has closed."""
_FINER = 4.0
"""Ratio of sampled to drawn points of a branch that consists of several flights."""
_TINY = 1e-3
"""Branches smaller than this share of the others, both in place and in rate, are left out."""
_TURNS = 2
"""Number of turning points before the one at which an oscillation has closed its curve."""

_SAME_ENERGY = 1e-9
"""Relative change of energy up to which a flight counts as free, ..."""
_NO_ENERGY = 1e-12
"""... besides this fraction of the energy needed to rise by the length of the trace."""


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
    """Whether the bodies are in lasting contact; shape (branches,)."""


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
    """Whether the bodies would penetrate each other under the impact law."""
    made: Flags
    """Whether the impact took place; False if the run ended there instead."""

    def some(self, chosen: slice) -> Jumps:
        """Return the chosen jumps."""
        fields = Jumps.__dataclass_fields__
        return Jumps(**{name: getattr(self, name)[chosen].copy() for name in fields})


@dataclass(frozen=True)
class Trajectory:
    """The phase trajectory of a body, piece by piece."""

    branches: tuple[Branches, ...]
    """One entry for each piece of the trace."""
    jumps: Jumps
    first: Jumps
    """The jumps at the first impacts, which are marked and numbered individually."""
    start: tuple[int, float, float]
    """Index of the piece, position and rate at the start."""
    end: float
    """Time (s) at which the run ended."""
    every: int
    """1 if every branch and jump is included, n if one in n is."""


@kept
def trajectory(run: Recorded, ball: int) -> Trajectory:
    """Return the phase trajectory of a body (from 1) of a run.

    Free flights are curves of constant energy in closed form. Flights in lasting contact and on a
    rotating trace are sampled from the run. Raises IndexError for a body that does not exist.
    """
    if not 1 <= ball <= len(run.system.bodies):
        raise IndexError(f"no body {ball}: the run has {len(run.system.bodies)}")
    flights = run.flights()
    mine = flights_of(flights, ball)
    first, last = strands(flights, mine)
    seen = _large_enough(run, ball, flights, first, last)
    first, last = first[seen], last[seen]
    every = max(1, math.ceil(len(first) / MOST_BRANCHES))
    some = _passages(flights, first, 2 * len(run.system.trace.pieces)) % every == 0
    ends = first[some], last[some]
    count = points_each(len(ends[0]))
    landscape = Landscape.of(run.system, ball)
    free = _free(run, landscape, flights, ends[0])
    if not np.all(free):
        bound = zip(ends[0][~free].tolist(), ends[1][~free].tolist(), strict=True)
        run.look_at(np.concatenate([np.arange(one, other + 1) for one, other in bound]))
    branches = tuple(
        _branches(run, flights, ball, landscape, piece, ends, free, count)
        for piece in run.system.trace.pieces
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

    Each flight is a branch, except in lasting contact across pieces, which a run stores in short
    segments: there the segments on one piece form a branch. `mine` are the rows of the body's
    flights.
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
    """Return which branches are large enough to be visible beside the largest on their piece.

    Hundreds of accumulating bounces on a wall are invisibly small. If they counted, fewer of the
    other branches would be drawn, and more faintly.
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
        # A short flight has its greatest rate at an end; a long one may go far and return.
        way = np.where(lasts * _fastest(run, ball, piece) < 1.0, rate * lasts, math.inf)
        extent = max(np.max(start), np.max(end)) - min(np.min(start), np.min(end))
        tiny = (way < _TINY * extent) & (rate < _TINY * np.max(rate))
        large[here] = ~tiny | (rate == 0.0)  # keep a body at rest
    return large


def _passages(flights: Table, first: Integers, most: int) -> Integers:
    """Return the number, from 0, of the passage to which each branch belongs.

    A passage continues across junctions until another event, up to `most` branches. Whole passages
    are chosen, so that a chosen motion is drawn on every piece. `first` are the first flights of
    the branches.
    """
    begins = flights["cause_start"][first] != "crossing"
    begins[0] = True
    since = np.arange(len(first))
    since -= np.maximum.accumulate(np.where(begins, since, 0))
    return np.cumsum(since % most == 0) - 1


def points_each(branches: int) -> int:
    """Return the number of points per branch, 2ⁿ + 1; it falls with the number of branches."""
    return int(2 ** np.clip(round(math.log2(160000 / max(branches, 1))), 6, 8)) + 1


def _free(run: Recorded, landscape: Landscape, flights: Table, rows: Integers) -> Flags:
    """Return which flights keep their energy: none on a rotating trace, in contact or at rest."""
    if run.system.turning is not None:
        return np.zeros(len(rows), dtype=np.bool_)
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
    landscape: Landscape,
    piece: Piece,
    ends: tuple[Integers, Integers],
    free: Flags,
    count: int,
) -> Branches:
    """Return the branches on one piece; `ends` are the first and last flights of all branches."""
    first, last = ends
    here = flights["arc"][first] == piece.index + 1
    rows = first[here & free]
    position = np.empty((0, count))
    rate = np.empty((0, count))
    if len(rows):
        position, rate = free_branches(
            landscape,
            piece,
            (flights["angle_start"][rows], flights["rate_start"][rows]),
            (flights["angle_end"][rows], flights["rate_end"][rows]),
            flights["t_end"][rows] - flights["t_start"][rows],
            count,
        )
    bound = here & ~free
    spans = [
        range(one, other + 1)
        for one, other in zip(first[bound].tolist(), last[bound].tolist(), strict=True)
    ]
    sampled = [_sampled(run, flights, span, pace(run, ball, piece), count) for span in spans]
    begin = np.concatenate([rows, first[bound]])
    return Branches(
        np.concatenate([position, *(curve[None, :, 0] for curve in sampled)]),
        np.concatenate([rate, *(curve[None, :, 1] for curve in sampled)]),
        flights["t_start"][begin].astype(np.float64),
        flights["contact"][begin],
    )


def pace(run: Recorded, ball: int, piece: Piece) -> float:
    """Return the sampling rate (1/s) of a body's motion in lasting contact on a piece."""
    rate = _fastest(run, ball, piece)
    if piece.is_line:
        slow = run.system.bodies[ball - 1].natural_rate(run.system.gravity, run.system.trace.length)
        rate = math.hypot(slow, rate)
    return _PER_PERIOD * rate / (2.0 * math.pi)


def _fastest(run: Recorded, ball: int, piece: Piece) -> float:
    """Return the fastest rate (rad/s) of a body's motion on a piece; the trace's on a line."""
    if piece.is_line:
        return 0.0 if run.system.turning is None else abs(run.system.turning.rate)
    return run.system.fastest_rate(run.system.bodies[ball - 1], piece)


def _sampled(run: Recorded, flights: Table, rows: range, pace: float, count: int) -> Array:
    """Return `count` states of the run, shape (count, 2), along successive flights.

    A single long flight may be an oscillation: then only one period of its closed curve is taken.
    """
    times = flights["t_end"][rows.start : rows.stop] - flights["t_start"][rows.start : rows.stop]
    if len(rows) == 1:
        return _sampled_flight(run, rows.start, float(times[0]), pace, count)
    share = times / max(float(np.sum(times)), float(np.finfo(np.float64).tiny))
    counts = np.ceil(_FINER * count * share).astype(np.int64) + 1
    return _chosen(np.column_stack(run.flight_curve(np.array(rows), counts)[1:]), count)


def _sampled_flight(run: Recorded, row: int, time: float, pace: float, count: int) -> Array:
    """Return `count` states of the run along one flight, or along one period of a closed curve.

    The period is found from turning points, in a sampled time that is doubled until there are
    enough of them.
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
    """Return `count` points, evenly spaced by index, of the line through points, with both ends."""
    place, known = np.linspace(0.0, len(points) - 1.0, count), np.arange(len(points))
    return np.column_stack([np.interp(place, known, column) for column in points.T])


Own = Callable[..., Array]
"""Returns a column of the impacts for the body, given the parts of its name before and after the
suffix `_a` or `_b`."""


def _states_on(trace: Trace, own: Own) -> tuple[Array, Array, Array, Array]:
    """Return piece, position, and rates before and after the impacts of a body on a trace."""
    piece = own("arc") - 1
    position, before, after = own("angle"), own("rate", "_pre"), own("rate", "_post")
    for line in (line for line in trace.pieces if line.is_line):
        on_line = piece == line.index  # angles are missing in the table
        position[on_line] = own("s")[on_line] - line.start_s
        before[on_line] = own("speed", "_pre")[on_line]
        after[on_line] = own("speed", "_post")[on_line]
    return piece, position, before, after


def jumps_of(
    table: Table, ball: int, every: int, states: Callable[[Own], tuple[Array, Array, Array, Array]]
) -> tuple[Jumps, Jumps]:
    """Return one in `every` jumps of a body (from 1) at its impacts, and the first jumps.

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
