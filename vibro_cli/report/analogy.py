"""Translation and rolling side by side for one impact of a run (B table 1)."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibro_cli.analysis.central_impact import CentralImpact, Pair
from vibro_cli.report.words import number
from vibro_cli.storage.stored import StoredRun


def forms(run: StoredRun, row: int) -> tuple[CentralImpact, CentralImpact]:
    """Return the impact in a row of the table (from 0) as translation and as rolling."""
    table = run.collisions
    balls = [int(table[f"ball_{side}"][row]) for side in "ab"]
    bodies = [run.system.bodies[ball - 1] for ball in balls]
    restitution = run.system.restitution[balls[0] - 1]

    def before(name: str) -> Pair:
        return float(table[f"{name}_a_pre"][row]), float(table[f"{name}_b_pre"][row])

    masses = bodies[0].mass, bodies[1].mass
    inertias = bodies[0].rolling_inertia, bodies[1].rolling_inertia
    return (
        CentralImpact(masses, before("speed"), restitution),
        CentralImpact(inertias, before("omega"), restitution),
    )


def analogy(run: StoredRun) -> dict[str, Any] | None:
    """Return the table of the first impact that the bodies made; None without one."""
    table = run.collisions
    made = np.asarray(table["admissible"], dtype=np.bool_) | np.asarray(
        table["substituted"], dtype=np.bool_
    )
    if not np.any(made):
        return None
    row = int(np.argmax(made))
    translation, rolling = forms(run, row)
    law = str(table["law"][row])
    return {
        "impact": str(int(table["n"][row])),
        "used": {"translational": "translation", "hedrih": "rolling"}.get(law, "neither"),
        "rows": [
            [label, describe(translation, _UNITS[0]), describe(rolling, _UNITS[1])]
            for label, describe in _ROWS
        ],
    }


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
    ("Velocities after, with the run's k", lambda one, unit: _pair(one.after, unit[1])),
    ("Impulse; its moment", lambda one, unit: number(one.impulse, unit[3])),
    ("Loss of kinetic energy", lambda one, _: number(one.loss, "J")),
    ("The same by Carnot's theorem", lambda one, _: number(one.carnot, "J")),
    ("After a plastic impact, k = 0", lambda one, unit: _special(one, 0.0, unit[1])),
    ("After an ideally elastic one, k = 1", lambda one, unit: _special(one, 1.0, unit[1])),
)
