"""The tables of a run of bodies on springs, from its logs."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibro_cli.mechanics.laws import LAW_NAMES
from vibro_cli.systems.impact_columns import Table, impact_flags, when_columns
from vibro_cli.systems.springs.system import SpringsSystem
from vibro_cli.systems.springs.world import CONTACT_CLOSED, CONTACT_OPENED


def collision_table(system: SpringsSystem, rows: Any) -> Table:
    """Columns of ``collisions.parquet``, a row for each impact."""
    table = when_columns(rows)
    ends = {"a": rows["pair"], "b": rows["pair"] + 1}
    radii = np.array([body.radius for body in system.bodies])
    inertias = np.array([body.rolling_inertia for body in system.bodies])
    masses = np.array([body.kappa * body.mass for body in system.bodies])
    feet = np.array([spring.foot for spring in system.springs])
    for end, body in ends.items():
        table[f"ball_{end}"] = body + 1
    for end in "ab":
        table[f"x_{end}"] = rows[f"x_{end}"]
    for end, body in ends.items():
        table[f"displacement_{end}"] = rows[f"x_{end}"] - feet[body]
    for when in ("pre", "post"):
        for end, body in ends.items():
            table[f"omega_{end}_{when}"] = rows[f"v_{end}_{when}"] / radii[body]
    for when in ("pre", "post"):
        for end in "ab":
            table[f"speed_{end}_{when}"] = rows[f"v_{end}_{when}"]
    for when in ("pre", "post"):
        for end, body in ends.items():
            stored = _stored(system, body, table[f"displacement_{end}"])
            table[f"energy_{end}_{when}"] = (
                0.5 * masses[body] * rows[f"v_{end}_{when}"] ** 2 + stored
            )
    table["energy_loss"] = rows["loss"]
    change = table["omega_b_post"] - table["omega_b_pre"]
    table["impulse_moment"] = inertias[ends["b"]] * change
    one, other = radii[ends["a"]], radii[ends["b"]]
    inclined = np.where(one == other, 1.0, 2.0 * np.sqrt(one * other) / (one + other))
    table["approach_speed"] = inclined * (rows["v_a_pre"] - rows["v_b_pre"])
    table["separation_speed"] = inclined * (rows["v_b_post"] - rows["v_a_post"])
    table["gap"] = rows["gap"]
    table["law"] = np.array(LAW_NAMES, dtype=object)[rows["law"]]
    return table | impact_flags(rows) | {"contact": rows["contact"] == 1}


def _stored(system: SpringsSystem, bodies: Any, displacements: Any) -> Any:
    """Energy of the springs, J."""
    columns = np.array([(s.stiffness, s.height, s.length) for s in system.springs])[bodies]
    stiffness, height, length = columns.reshape(-1, 3).T
    return 0.5 * stiffness * (np.hypot(height, displacements) - length) ** 2


def event_table(states: Any, bodies: int) -> Table:
    """Columns of ``events.parquet``: where lasting contacts begin and end."""
    rows = states.reshape(-1, bodies)
    rows = rows[np.isin(rows["cause"][:, 0], (CONTACT_CLOSED, CONTACT_OPENED))]
    pair = rows["pair"][:, 0] if len(rows) else np.zeros(0, dtype=np.int64)
    closed = rows["cause"][:, 0] == CONTACT_CLOSED
    speeds = rows["v"][np.arange(len(rows)), pair] if len(rows) else np.zeros(0)
    names = np.array(["contact_opened", "contact_closed"], dtype=object)
    return {
        "t": rows["t"][:, 0],
        "event": names[closed.astype(int)],
        "ball": pair + 1,
        "other": pair + 2,
        "speed": speeds,
        "value": np.where(closed, rows["value"][:, 0], np.nan),
    }
