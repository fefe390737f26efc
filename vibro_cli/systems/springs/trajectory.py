"""The phase trajectory of one body on a spring in a run: branches between events, and jumps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from vibro_cli.figures.source import Array, Integers
from vibro_cli.figures.trajectory import (
    MOST_BRANCHES,
    MOST_NUMBERS,
    Branches,
    Flags,
    Jumps,
    Trajectory,
    points_each,
)
from vibro_cli.systems.run import Run
from vibro_cli.systems.springs.landscape import SpringsLandscape


@dataclass(frozen=True)
class Motions:
    """What a body does between events that it takes part in; arrays of shape (motions,)."""

    first: Integers
    """The leftmost body (from 0) of those that move with it as one."""
    last: Integers
    """The rightmost."""
    start: Array
    """Time (s)."""
    end: Array
    states: tuple[Array, Array, Array, Array]
    """Displacement (m) and speed (m/s) at the start, and those at the end; NaN for the end of the
    run after a period or more."""

    @property
    def contact(self) -> Flags:
        """Whether the body is in lasting contact."""
        together: Flags = self.last > self.first
        return together

    def some(self, every: int) -> Motions:
        """Return one in n."""
        x, v, x_end, v_end = (column[::every] for column in self.states)
        return Motions(
            self.first[::every],
            self.last[::every],
            self.start[::every],
            self.end[::every],
            (x, v, x_end, v_end),
        )


def motions(run: Run, body: int) -> Motions:
    """Return what a body (from 0) does between events, in the order of time."""
    motion: Any = run.trajectory
    rows, times = motion.states, motion.times
    first, last = _groups(rows["held"], body)
    arriving = _arriving(run, first, last)
    changed = np.append(True, (np.diff(first) != 0) | (np.diff(last) != 0))
    begins = np.flatnonzero(changed | np.isfinite(arriving))
    x, v = rows["x"][:, body], rows["v"][:, body]
    ends = np.append(begins[1:], -1)
    speed = np.where(np.isfinite(arriving[ends]), arriving[ends], v[ends])
    reached, speed[-1] = x[ends], math.nan
    until = np.append(times[begins[1:]], run.end_time)
    states = x[begins], v[begins], reached, speed
    return _finished(run, body, Motions(first[begins], last[begins], times[begins], until, states))


def _groups(held: Any, body: int) -> tuple[Integers, Integers]:
    """Return the outermost bodies of those that move with a body as one, after each event."""
    first = np.full(len(held), body)
    last = first.copy()
    together = np.ones(len(held), dtype=np.bool_)
    for left in range(body - 1, -1, -1):
        together = together & (held[:, left] == 1)
        first = np.where(together, left, first)
    together = np.ones(len(held), dtype=np.bool_)
    for right in range(body + 1, held.shape[1]):
        together = together & (held[:, right - 1] == 1)
        last = np.where(together, right, last)
    return first, last


def _arriving(run: Run, first: Integers, last: Integers) -> Array:
    """Return the speed with which a body comes to each event that is an impact of it or its group.

    NaN at other events. Of several impacts at one instant the first has the speed.
    """
    table = run.collisions
    speeds = np.full(len(first), math.nan)
    motion: Any = run.trajectory
    event: Any = np.searchsorted(motion.times, table["t"], side="left")
    before = np.maximum(event - 1, 0)
    struck = {side: np.asarray(table[f"ball_{side}"], dtype=np.int64) - 1 for side in "ab"}
    own = [(body >= first[before]) & (body <= last[before]) for body in struck.values()]
    speed = np.where(own[0], table["speed_a_pre"], table["speed_b_pre"])
    mine = np.flatnonzero(own[0] | own[1])[::-1]
    speeds[event[mine]] = speed[mine]
    return speeds


def _finished(run: Run, body: int, found: Motions) -> Motions:
    """Return motions with the state at the end of the run, without those that take no time."""
    x, v, x_end, v_end = found.states
    hills = SpringsLandscape.of(run.system, int(found.first[-1]), int(found.last[-1]))
    shift = hills.offsets[body - int(found.first[-1])]
    x_end[-1] = v_end[-1] = math.nan
    if found.end[-1] - found.start[-1] < float(hills.period(x[-1:] - shift, v[-1:])[0]):
        final = run.sample([run.end_time])  # after a period it has run through its whole curve
        x_end[-1], v_end[-1] = final["displacement"][body], final["speed"][body]
    kept = found.end > found.start
    kept[0] = True
    return Motions(
        found.first[kept],
        found.last[kept],
        found.start[kept],
        found.end[kept],
        (x[kept], v[kept], x_end[kept], v_end[kept]),
    )


def springs_trajectory(run: Run, ball: int) -> Trajectory:
    """Return the phase trajectory of a body (from 1): displacement (m) and speed (m/s).

    Every branch is a curve of constant energy, of the body alone or, in lasting contact, of all
    that move as one.
    """
    body = ball - 1
    all_of = motions(run, body)
    every = max(1, math.ceil(len(all_of.start) / MOST_BRANCHES))
    shown = all_of.some(every)
    count = points_each(len(shown.start))
    place, speed = (np.empty((len(shown.start), count)) for _ in range(2))
    for group in set(zip(shown.first.tolist(), shown.last.tolist(), strict=True)):
        rows = np.flatnonzero((shown.first == group[0]) & (shown.last == group[1]))
        hills = SpringsLandscape.of(run.system, *group)
        shift = hills.offsets[body - group[0]]
        x, v, x_end, v_end = (column[rows] for column in shown.states)
        lasts = shown.end[rows] - shown.start[rows]
        q, v = hills.branches((x - shift, v), (x_end - shift, v_end), lasts, count)
        place[rows], speed[rows] = q + shift, v
    branches = Branches(place, speed, shown.start, shown.contact)
    first = run.system.initial[body]
    at = first.position - run.system.springs[body].foot
    jumps = springs_jumps(run, ball)
    some, firsts = jumps.some(slice(None, None, every)), jumps.some(slice(0, MOST_NUMBERS))
    return Trajectory((branches,), some, firsts, (0, at, first.speed), run.end_time, every)


def springs_jumps(run: Run, ball: int) -> Jumps:
    """Return the jumps of a body (from 1) at its impacts, in the order of time."""
    table = run.collisions
    rows = {side: np.flatnonzero(np.asarray(table[f"ball_{side}"]) == ball) for side in "ab"}
    order = np.argsort(np.concatenate([rows["a"], rows["b"]]), kind="stable")

    def merged(name: str, when: str = "") -> Array:
        parts = [np.asarray(table[f"{name}_{side}{when}"])[rows[side]] for side in "ab"]
        return np.concatenate(parts)[order]

    def common(name: str) -> Any:
        values = np.asarray(table[name])[np.concatenate([rows["a"], rows["b"]])][order]
        return values

    number = common("n").astype(np.int64)
    made = np.logical_or(common("admissible"), common("substituted"))
    places = merged("displacement")
    before, after = merged("speed", "_pre"), merged("speed", "_post")
    piece = np.zeros(len(number), dtype=np.int64)
    return Jumps(number, piece, places, before, after, common("t"), made)
