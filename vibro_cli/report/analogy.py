"""Translation and rolling side by side for the impacts of a run (B table 1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vibro_cli.analysis.central_impact import CentralImpact, Pair
from vibro_cli.report.words import number


def forms(system: Any, table: Mapping[str, Any], row: int) -> tuple[CentralImpact, CentralImpact]:
    """Return the impact in a row of the table (from 0) as translation and as rolling.

    On a table those are the components along the line of centres, C (1)–(3).
    """
    balls = [int(table[f"ball_{side}"][row]) for side in "ab"]
    bodies = [system.bodies[ball - 1] for ball in balls]
    given = system.restitution
    restitution = given if isinstance(given, float) else given[balls[0] - 1]
    speed = "normal_speed" if "normal_speed_a_pre" in table else "speed"
    speeds = tuple(float(table[f"{speed}_{end}_pre"][row]) for end in "ab")
    rates = tuple(v / body.radius for v, body in zip(speeds, bodies, strict=True))
    masses = bodies[0].mass, bodies[1].mass
    inertias = bodies[0].rolling_inertia, bodies[1].rolling_inertia
    return (
        CentralImpact(masses, (speeds[0], speeds[1]), restitution),
        CentralImpact(inertias, (rates[0], rates[1]), restitution),
    )


def analogy(system: Any, table: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the tables of the impacts that rolling bodies made; None without one."""
    made = np.asarray(table["admissible"], dtype=np.bool_) | np.asarray(
        table["substituted"], dtype=np.bool_
    )
    if not np.any(made):
        return None
    row = int(np.argmax(made))
    if any(system.bodies[int(table[f"ball_{side}"][row]) - 1].kappa == 1.0 for side in "ab"):
        return None  # a particle slides: there is no rolling to compare
    translation, rolling = forms(system, table, row)
    law = str(table["law"][row])
    return {
        "impact": str(int(table["n"][row])),
        "used": {"translational": "translation", "hedrih": "rolling"}.get(law, "neither"),
        "rows": [
            [label, describe(translation, _UNITS[0]), describe(rolling, _UNITS[1])]
            for label, describe in _ROWS
        ],
        "heads": _HEADS,
        "every": [_line(system, table, each) for each in np.flatnonzero(made)[:_MOST].tolist()],
    }


_MOST = 100
"""Impacts that stand in both forms in the report."""
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
"""Of inertia, velocity, momentum and impulse, in translation and in rolling."""


def _pair(values: Pair, unit: str) -> str:
    return f"{number(values[0])}, {number(values[1])} {unit}"


def _special(one: CentralImpact, restitution: float, unit: str) -> str:
    """Velocities after with another k, and the loss."""
    special = one.with_restitution(restitution)
    return f"{_pair(special.after, unit)}; loss {number(special.loss, 'J')}"


_ROWS: tuple[tuple[str, Any], ...] = (
    ("Inertia: m; J_P", lambda one, unit: _pair(one.inertia, unit[0])),
    ("Velocities before: v; ω", lambda one, unit: _pair(one.before, unit[1])),
    ("Momentum, kept: Σ m v; Σ J_P ω", lambda one, unit: number(one.momentum, unit[2])),
    ("Coefficient of restitution k", lambda one, _: number(one.restitution)),
    ("Kinetic energy before", lambda one, _: number(one.energy_before, "J")),
    ("Velocities after, with the run's k", lambda one, unit: _pair(one.after, unit[1])),
    ("Impulse; its moment", lambda one, unit: number(one.impulse, unit[3])),
    ("Kinetic energy after", lambda one, _: number(one.energy_after, "J")),
    ("Loss of kinetic energy", lambda one, _: number(one.loss, "J")),
    ("The same by Carnot's theorem", lambda one, _: number(one.carnot, "J")),
    ("After a plastic impact, k = 0", lambda one, unit: _special(one, 0.0, unit[1])),
    ("After an ideally elastic one, k = 1", lambda one, unit: _special(one, 1.0, unit[1])),
)
