"""Exact times of the first intervals beside the papers' series (A (7)–(9), B (58)–(61), (83)–(84)).

The papers expand both roots of the elliptic integral to second order. Of a way with turning points
their series is summed leg by leg.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from vibro_cli.analysis.swings import (
    Swing,
    printed_time,
    series_time,
    squared_rate,
)
from vibro_cli.mechanics.trace import VALLEY
from vibro_cli.report.words import number
from vibro_cli.storage.stored import StoredRun

MOST_INTERVALS = 6
_SAME = 1e-9
"""Two instants closer than this share of their time are one."""


def series_rows(run: StoredRun) -> list[list[str]]:
    """Return a row for each body of the first intervals that lie in one valley, as in the papers.

    Interval, body, angles from and to, turning points, and times: exact, by the series as printed,
    and by the series with its coefficient corrected.
    """
    if run.system.turning is not None:
        return []
    found = []
    for row in range(min(MOST_INTERVALS, len(run.collisions["n"]))):
        for end in "ab":
            way = _way(run, row, end)
            if way is not None:
                found.append(_row(run, row, end, way))
    return found


def _way(run: StoredRun, row: int, end: str) -> tuple[Swing, float, float] | None:
    """Return the swing of a body before an impact, the angle there (rad) and the time (s) of it.

    None unless it swung freely in one valley since its impact before, or the start.
    """
    table, flights = run.collisions, run.flights()
    t, ball = float(table["t"][row]), int(table[f"ball_{end}"][row])
    # Flights stand body by body in order of time.
    first, beyond = np.searchsorted(flights["ball"], (ball, ball + 1))
    ends = flights["t_end"][first:beyond]
    flight = int(first + np.searchsorted(ends, t - _SAME * max(t, 1e-300)))
    if flight == beyond or flights["t_end"][flight] - t > _SAME * max(t, 1e-300):
        return None
    piece = run.system.trace.pieces[int(flights["arc"][flight]) - 1]
    free = not bool(flights["contact"][flight])
    begun = str(flights["cause_start"][flight]) in ("start", "collision")
    if piece.shape != VALLEY or not (free and begun):
        return None
    angle, rate = (float(flights[name][flight]) for name in ("angle_start", "rate_start"))
    swing = Swing(squared_rate(run.system, ball, piece), angle, rate)
    if swing.scale == 0.0:  # at rest at the bottom: no swing
        return None
    lasts = t - float(flights["t_start"][flight])
    return swing, float(table[f"angle_{end}"][row]), lasts


def _row(run: StoredRun, row: int, end: str, way: tuple[Swing, float, float]) -> list[str]:
    swing, angle, lasts = way
    ball = int(run.collisions[f"ball_{end}"][row])
    turns = turning_points(swing, angle, lasts)
    # The last bracket of A (9) and B (61) has the constants of ball 1 in the same interval.
    other = _way(run, row, "a" if end == "b" else "b")
    first = other[0] if ball == 2 and other is not None else None
    printed = time_between(swing, angle, turns, lambda u: printed_time(swing, u, first))
    corrected = time_between(swing, angle, turns, lambda u: series_time(swing, u))
    return [
        str(int(run.collisions["n"][row])),
        str(ball),
        number(swing.angle, "rad"),
        number(angle, "rad"),
        number(swing.modulus),
        str(turns),
        number(lasts, "s", 9),
        number(printed, "s", 5),
        number(corrected, "s", 5),
    ]


def turning_points(swing: Swing, angle: float, lasts: float) -> int:
    """Return how many turning points lie on the way to an angle that takes a time (s)."""
    if swing.modulus <= 1.0:
        return 0
    counts = range(2 * math.ceil(2.0 * lasts / swing.period) + 3)
    times = [time_between(swing, angle, count, swing.from_bottom) for count in counts]
    return int(np.argmin([abs(time - lasts) for time in times]))


def time_between(
    swing: Swing, angle: float, turns: int, from_bottom: Callable[[float], float]
) -> float:
    """Return the time (s) of a way with some turning points, by times from the bottom to u.

    A body that starts at rest begins at a turning point, which is not counted.
    """
    start, end = math.sin(0.5 * swing.angle), math.sin(0.5 * angle)
    way = math.copysign(1.0, swing.rate) if swing.rate else -math.copysign(1.0, swing.angle)
    if not turns:
        return way * (from_bottom(end) - from_bottom(start))
    reach = from_bottom(1.0 / swing.modulus)
    last = way if turns % 2 == 0 else -way
    first_leg = reach - way * from_bottom(start)
    return first_leg + (turns - 1) * 2.0 * reach + reach + last * from_bottom(end)
