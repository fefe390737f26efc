"""The tables of a run of bodies on springs, from its logs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vibro_cli.mechanics.laws import LAW_NAMES
from vibro_cli.systems.impact_columns import (
    Table,
    impact_flags,
    inclinations,
    of_bodies,
    when_columns,
)
from vibro_cli.systems.springs.system import SpringsSystem
from vibro_cli.systems.springs.world import CONTACT_CLOSED, CONTACT_OPENED


def collision_table(systems: Sequence[SpringsSystem], rows: Any, run: Any) -> Table:
    """Columns of ``collisions.parquet`` of some runs, a row for each impact.

    Parameters
    ----------
    systems
        Of each run.
    rows, run
        The log of all runs, and the number of the run of each row, from 0, not falling.
    """
    table = when_columns(rows, run)
    ends = {"a": rows["pair"], "b": rows["pair"] + 1}
    radii = of_bodies(systems, lambda body: body.radius)
    inertias = of_bodies(systems, lambda body: body.rolling_inertia)
    masses = of_bodies(systems, lambda body: body.kappa * body.mass)
    feet = np.array([[spring.foot for spring in system.springs] for system in systems])
    for end, body in ends.items():
        table[f"ball_{end}"] = body + 1
    for end in "ab":
        table[f"x_{end}"] = rows[f"x_{end}"]
    for end, body in ends.items():
        table[f"displacement_{end}"] = rows[f"x_{end}"] - feet[run, body]
    for when in ("pre", "post"):
        for end, body in ends.items():
            table[f"omega_{end}_{when}"] = rows[f"v_{end}_{when}"] / radii[run, body]
    for when in ("pre", "post"):
        for end in "ab":
            table[f"speed_{end}_{when}"] = rows[f"v_{end}_{when}"]
    for when in ("pre", "post"):
        for end, body in ends.items():
            stored = _stored(systems, run, body, table[f"displacement_{end}"])
            table[f"energy_{end}_{when}"] = (
                0.5 * masses[run, body] * rows[f"v_{end}_{when}"] ** 2 + stored
            )
    table["energy_loss"] = rows["loss"]
    change = table["omega_b_post"] - table["omega_b_pre"]
    table["impulse_moment"] = inertias[run, ends["b"]] * change
    inclined = inclinations(radii[run, ends["a"]], radii[run, ends["b"]])
    table["approach_speed"] = inclined * (rows["v_a_pre"] - rows["v_b_pre"])
    table["separation_speed"] = inclined * (rows["v_b_post"] - rows["v_a_post"])
    table["gap"] = rows["gap"]
    table["law"] = np.array(LAW_NAMES, dtype=object)[rows["law"]]
    return table | impact_flags(rows) | {"contact": rows["contact"] == 1}


def _stored(systems: Sequence[SpringsSystem], run: Any, bodies: Any, displacements: Any) -> Any:
    """Energy of the springs, J."""
    springs = [[(s.stiffness, s.height, s.length) for s in system.springs] for system in systems]
    stiffness, height, length = np.array(springs)[run, bodies].reshape(-1, 3).T
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
