"""Comparison of runs with the papers: translation against rolling, and the series for times.

The impacts of a run are given as translation and as rolling (B table 1), and the exact times of its
first intervals beside those of the series (A (7)–(9), B (58)–(61), (83)–(84)). The papers expand
both roots of the elliptic integral to second order. For a motion with turning points, their series
is summed leg by leg.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from vibro_cli.analysis.paper_formulas import (
    CentralImpact,
    Pair,
    Swing,
    printed_time,
    series_time,
    squared_rate,
)
from vibro_cli.mechanics.trace import VALLEY
from vibro_cli.report.words import number
from vibro_cli.storage.stored import StoredRun
from vibro_cli.systems.columns import made


def forms(system: Any, table: Mapping[str, Any], row: int) -> tuple[CentralImpact, CentralImpact]:
    """Return the impact in a row of the table (from 0) as translation and as rolling.

    On a table, the velocity components along the line of centres are used, C (1)–(3).
    """
    balls = [int(table[f"ball_{side}"][row]) for side in "ab"]
    bodies = [system.bodies[ball - 1] for ball in balls]
    given = system.restitution
    restitution = given if isinstance(given, float) else given[balls[0] - 1]
    speed = _speed_of(table)
    speeds = tuple(float(table[f"{speed}_{end}_pre"][row]) for end in "ab")
    rates = tuple(v / body.radius for v, body in zip(speeds, bodies, strict=True))
    masses = bodies[0].mass, bodies[1].mass
    inertias = bodies[0].rolling_inertia, bodies[1].rolling_inertia
    return (
        CentralImpact(masses, (speeds[0], speeds[1]), restitution),
        CentralImpact(inertias, (rates[0], rates[1]), restitution),
    )


_NORMAL = "normal_speed"


def _speed_of(table: Mapping[str, Any]) -> str:
    """Return the prefix of the columns of the speeds on which the laws act."""
    return _NORMAL if f"{_NORMAL}_a_pre" in table else "speed"


def analogy(system: Any, table: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the tables of the impacts of rolling bodies as values for the page.

    Simultaneous impacts that do not follow the two-body formulas are left out. Returns None if no
    impact is left, if rows name no pair (such as a body and a driven support), or if a body slides.
    """
    if "ball_a" not in table:
        return None
    rows = [
        row
        for row in np.flatnonzero(made(table))[: 10 * _MOST].tolist()
        if _is_of_two(system, table, row)
    ]
    if not rows:
        return None
    row = rows[0]
    if any(system.bodies[int(table[f"ball_{side}"][row]) - 1].slides for side in "ab"):
        return None  # a particle slides, so there is no rolling to compare
    translation, rolling = forms(system, table, row)
    law = str(table["law"][row])
    return {
        "impact": str(int(table["n"][row])),
        "law": law,
        "used": _USED.get(law, "neither"),
        "of_normal_parts": _speed_of(table) == _NORMAL,
        "rows": [
            [label, describe(translation, _UNITS[0]), describe(rolling, _UNITS[1])]
            for label, describe in _ROWS
        ],
        "heads": _HEADS,
        "every": [_line(system, table, each) for each in rows[:_MOST]],
    }


def _is_of_two(system: Any, table: Mapping[str, Any], row: int) -> bool:
    """Return whether an impact obeys the two-body formulas of its law, if the law has any."""
    law, speed = str(table["law"][row]), _speed_of(table)
    if law not in _USED or not bool(table["simultaneous"][row]):
        return True
    translation, rolling = forms(system, table, row)
    used = translation if law == "translational" else rolling
    for end, value, before in zip("ab", used.after, used.before, strict=True):
        radius = system.bodies[int(table[f"ball_{end}"][row]) - 1].radius
        unit = 1.0 if law == "translational" else radius
        size = abs(value) + abs(before) + abs(used.closing)
        if abs(float(table[f"{speed}_{end}_post"][row]) - unit * value) > _ROUNDING * unit * size:
            return False
    return True


_USED = {"translational": "translation", "hedrih": "rolling"}
"""Form of the laws that are those of translation or of rolling."""
_ROUNDING = 1e-9
"""Relative difference below which speeds count as equal."""
_MOST = 100
"""Number of impacts that the report gives in both forms."""
_HEADS = [
    "Impact", "Pair", "k", "Impulse", "E before", "E after", "Loss", "Moment of impulse",
    "E before, rolling", "E after, rolling", "Loss, rolling",
]  # fmt: skip


def _line(system: Any, table: Mapping[str, Any], row: int) -> list[str]:
    translation, rolling = forms(system, table, row)
    cells = [
        number(value, unit)
        for one, impulse in ((translation, "N s"), (rolling, "N m s"))
        for value, unit in (
            (one.impulse, impulse),
            (one.energy_before, "J"),
            (one.energy_after, "J"),
            (one.loss, "J"),
        )
    ]
    pair = "–".join(str(int(table[f"ball_{side}"][row])) for side in "ab")
    return [str(int(table["n"][row])), pair, number(translation.restitution), *cells]


_UNITS = (("kg", "m/s", "kg m/s", "N s"), ("kg m²", "rad/s", "kg m²/s", "N m s"))
"""Units of inertia, velocity, momentum and impulse, in translation and in rolling."""


def _pair(values: Pair, unit: str) -> str:
    return f"{number(values[0])}, {number(values[1])} {unit}"


def _special(one: CentralImpact, restitution: float, unit: str) -> str:
    """Return the velocities after the impact with another k, and the loss."""
    special = replace(one, restitution=restitution)
    return f"{_pair(special.after, unit)}; loss {number(special.loss, 'J')}"


_ROWS: tuple[tuple[str, Any], ...] = (
    ("Inertia: m; J_P", lambda one, unit: _pair(one.inertia, unit[0])),
    ("Velocities before: v; ω", lambda one, unit: _pair(one.before, unit[1])),
    ("Momentum, conserved: Σ m v; Σ J_P ω", lambda one, unit: number(one.momentum, unit[2])),
    ("Coefficient of restitution k", lambda one, _: number(one.restitution)),
    ("Kinetic energy before", lambda one, _: number(one.energy_before, "J")),
    ("Velocities after, for the k of the run", lambda one, unit: _pair(one.after, unit[1])),
    ("Impulse; its moment", lambda one, unit: number(one.impulse, unit[3])),
    ("Kinetic energy after", lambda one, _: number(one.energy_after, "J")),
    ("Loss of kinetic energy", lambda one, _: number(one.loss, "J")),
    ("Loss by Carnot's theorem", lambda one, _: number(one.carnot, "J")),
    ("After a plastic impact, k = 0", lambda one, unit: _special(one, 0.0, unit[1])),
    ("After an ideally elastic impact, k = 1", lambda one, unit: _special(one, 1.0, unit[1])),
)


MOST_INTERVALS = 6
_SAME = 1e-9
"""Relative difference below which two instants count as equal."""


def series_rows(run: StoredRun) -> list[list[str]]:
    """Return a row for each body and each of the first intervals that lies in one valley.

    Its cells are interval, body, first and last angle, modulus, turning points, and three times:
    exact, by the series as printed, and by the series with its coefficient corrected.
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
    """Return the swing of a body before an impact, its angle there (rad) and its duration (s).

    Returns None unless the body swung freely in one valley since its last impact or the start, and
    not over the top, beyond which u = sin(φ/2) falls again.
    """
    table, flights = run.collisions, run.flights()
    t, ball = float(table["t"][row]), int(table[f"ball_{end}"][row])
    # Flights are sorted by body, then by time.
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
    last = float(table[f"angle_{end}"][row])
    if abs(last - swing.bottom) > math.pi:
        return None
    return swing, last, t - float(flights["t_start"][flight])


def _row(run: StoredRun, row: int, end: str, way: tuple[Swing, float, float]) -> list[str]:
    swing, angle, lasts = way
    ball = int(run.collisions[f"ball_{end}"][row])
    turns = turning_points(swing, angle, lasts)
    # The last bracket of A (9) and B (61), for the papers' ball 2, uses the constants of their
    # ball 1, to its left, in the same interval.
    other = _way(run, row, "a") if end == "b" else None
    first = None if other is None else other[0]
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
    """Return the number of turning points of a swing that reaches an angle after a time (s)."""
    if swing.modulus <= 1.0:
        return 0
    counts = range(2 * math.ceil(2.0 * lasts / swing.period) + 3)
    times = [time_between(swing, angle, count, swing.from_bottom) for count in counts]
    return int(np.argmin([abs(time - lasts) for time in times]))


def time_between(
    swing: Swing, angle: float, turns: int, from_bottom: Callable[[float], float]
) -> float:
    """Return the time (s) of a swing to an angle with `turns` turning points.

    `from_bottom` gives the time from the bottom to u. A body that starts at rest begins at a
    turning point, which is not counted.
    """
    start, end = (math.sin(0.5 * (place - swing.bottom)) for place in (swing.angle, angle))
    way = swing.way
    if not turns:
        return way * (from_bottom(end) - from_bottom(start))
    reach = from_bottom(1.0 / swing.modulus)
    last = way if turns % 2 == 0 else -way
    first_leg = reach - way * from_bottom(start)
    return first_leg + (turns - 1) * 2.0 * reach + reach + last * from_bottom(end)
