"""The phase trajectory of one body in a run: branches between events, jumps at impacts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibro_cli.analysis.branches import free_branches
from vibro_cli.analysis.landscape import Landscape
from vibro_cli.figures.source import Array, Recorded, Table
from vibro_cli.mechanics.trace import Piece

Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

MOST_BRANCHES = 4000
"""Of more branches than this an even choice is drawn; more would only make a stain."""

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
    made: Flags
    """Whether the bodies did so: not at an inadmissible impact that ended the run."""


@dataclass(frozen=True)
class Trajectory:
    """What a body ran through, piece by piece."""

    branches: tuple[Branches, ...]
    """One entry for each piece of the trace."""
    jumps: Jumps
    start: tuple[int, float, float]
    """Index of the piece, position and rate at the start."""
    end: float
    """Time (s) at which the run ended."""
    every: int
    """1 if every branch and every jump is there, else n for one in n."""


def trajectory(run: Recorded, ball: int) -> Trajectory:
    """Return the phase trajectory of a body (from 1) of a run.

    Free flights are curves of constant energy in closed form; those in lasting contact, and those
    on a turning trace, are sampled from the run.
    """
    flights = run.flights()
    mine = np.flatnonzero(np.asarray(flights["ball"]) == ball)
    every = max(1, math.ceil(len(mine) / MOST_BRANCHES))
    jumps = jumps_of(run, ball, every)
    first = mine[0]
    start = (
        int(flights["arc"][first]) - 1,
        float(flights["angle_start"][first]),
        float(flights["rate_start"][first]),
    )
    chosen = mine[::every]
    count = _points(len(chosen))
    free = _free(run, ball, flights, mine)[::every]
    branches = tuple(
        _branches(run, ball, flights, piece, chosen, free, count)
        for piece in run.system.trace.pieces
    )
    end = float(np.max(flights["t_end"][mine]))
    return Trajectory(branches, jumps, start, end, every)


def _points(branches: int) -> int:
    """Return the points of each branch: fewer where there are many."""
    return int(np.clip(60000 // max(branches, 1), 40, 161))


def _free(run: Recorded, ball: int, flights: Table, mine: Integers) -> Flags:
    """Return which flights of a body are free: on a trace at rest and not in lasting contact."""
    if run.system.turning is not None:
        return np.zeros(len(mine), dtype=np.bool_)
    causes = np.asarray(flights["cause_start"], dtype=object)[mine]
    # the body may be in contact on both sides: count what has closed and not opened again
    closed = np.cumsum(causes == "contact_closed") - np.cumsum(causes == "contact_opened")
    landscape = Landscape.of(run.system, ball)
    least = _NO_ENERGY * landscape.body.mass * landscape.gravity * landscape.trace.length
    kept = np.zeros(len(mine), dtype=np.bool_)
    for piece in run.system.trace.pieces:
        here = np.asarray(flights["arc"])[mine] == piece.index + 1
        rows = mine[here]
        start = landscape.energy(piece, flights["angle_start"][rows], flights["rate_start"][rows])
        end = landscape.energy(piece, flights["angle_end"][rows], flights["rate_end"][rows])
        kept[here] = np.abs(end - start) <= _SAME_ENERGY * np.maximum(start, end) + least
    free: Flags = kept & (closed <= 0)
    return free


def _branches(
    run: Recorded,
    ball: int,
    flights: Table,
    piece: Piece,
    chosen: Integers,
    free: Flags,
    count: int,
) -> Branches:
    here = np.asarray(flights["arc"])[chosen] == piece.index + 1
    rows = chosen[here & free]
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
    bound = chosen[here & ~free]
    sampled = [run.flight_curve(int(index), count) for index in bound]
    return Branches(
        np.concatenate([position, *(curve[1][None, :] for curve in sampled)]),
        np.concatenate([rate, *(curve[2][None, :] for curve in sampled)]),
        flights["t_start"][np.concatenate([rows, bound])].astype(np.float64),
    )


def jumps_of(run: Recorded, ball: int, every: int = 1) -> Jumps:
    """Return the jumps of a body (from 1) at its impacts, or at one in n, in the order of time."""
    parts = [_jumps_as(run, ball, side) for side in ("a", "b")]
    number = np.concatenate([part.number for part in parts])
    order = np.argsort(number, kind="stable")[::every]

    def merged(name: str) -> NDArray[np.generic]:
        values: NDArray[np.generic] = np.concatenate([getattr(part, name) for part in parts])
        return values[order]

    return Jumps(**{name: merged(name) for name in Jumps.__dataclass_fields__})  # type: ignore[arg-type]


def _jumps_as(run: Recorded, ball: int, side: str) -> Jumps:
    """Return the jumps of a body where it is body a, or body b, of the pair."""
    table = run.collisions
    rows = np.flatnonzero(np.asarray(table[f"ball_{side}"]) == ball)
    piece = np.asarray(table[f"arc_{side}"], dtype=np.int64)[rows] - 1
    position = np.array(table[f"angle_{side}"][rows], dtype=np.float64)
    before = np.array(table[f"rate_{side}_pre"][rows], dtype=np.float64)
    after = np.array(table[f"rate_{side}_post"][rows], dtype=np.float64)
    for line in (line for line in run.system.trace.pieces if line.is_line):
        on_line = piece == line.index  # the table has no angles there
        position[on_line] = table[f"s_{side}"][rows][on_line] - line.start_s
        before[on_line] = table[f"speed_{side}_pre"][rows][on_line]
        after[on_line] = table[f"speed_{side}_post"][rows][on_line]
    made = np.asarray(table["admissible"], dtype=np.bool_) | np.asarray(
        table["substituted"], dtype=np.bool_
    )
    return Jumps(
        number=np.asarray(table["n"], dtype=np.int64)[rows],
        piece=piece,
        position=position,
        before=before,
        after=after,
        time=np.array(table["t"][rows], dtype=np.float64),
        made=made[rows],
    )
