"""The tables of a run on the table, from its logs."""

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
from vibro_cli.systems.table.system import POLYGON, TableSystem


def collision_table(systems: Sequence[TableSystem], rows: Any, run: Any) -> Table:
    """Columns of ``collisions.parquet`` of some runs, a row for each impact of two balls.

    Parameters
    ----------
    systems
        Of each run.
    rows, run
        The log of all runs, and the number of the run of each row, from 0, not falling.
    """
    table = when_columns(rows, run)
    table["ball_a"] = rows["a"] + 1
    table["ball_b"] = rows["b"] + 1
    for letter in "ab":
        table[f"x_{letter}"] = rows[f"x_{letter}"]
        table[f"y_{letter}"] = rows[f"y_{letter}"]
    table["normal_angle"] = np.arctan2(rows["normal_y"], rows["normal_x"])
    for when in ("pre", "post"):
        for letter in "ab":
            for axis in "xy":
                table[f"velocity_{axis}_{letter}_{when}"] = rows[f"v{axis}_{letter}_{when}"]
    for when in ("pre", "post"):
        for letter in "ab":
            table[f"normal_speed_{letter}_{when}"] = rows[f"normal_{letter}_{when}"]
    for letter in "ab":
        across = rows[f"vy_{letter}_pre"] * rows["normal_x"]
        table[f"tangential_speed_{letter}"] = across - rows[f"vx_{letter}_pre"] * rows["normal_y"]
    masses = of_bodies(systems, lambda body: body.kappa * body.mass)
    for when in ("pre", "post"):
        for letter in "ab":
            square = rows[f"vx_{letter}_{when}"] ** 2 + rows[f"vy_{letter}_{when}"] ** 2
            table[f"energy_{letter}_{when}"] = 0.5 * masses[run, rows[letter]] * square
    table["energy_loss"] = rows["loss"]
    inertias = of_bodies(systems, lambda body: body.rolling_inertia)[run, rows["b"]]
    radii = of_bodies(systems, lambda body: body.radius)
    change = rows["normal_b_post"] - rows["normal_b_pre"]
    table["impulse_moment"] = _over(inertias * change, radii[run, rows["b"]])
    inclined = inclinations(radii[run, rows["a"]], radii[run, rows["b"]])
    table["approach_speed"] = inclined * (rows["normal_a_pre"] - rows["normal_b_pre"])
    table["separation_speed"] = inclined * (rows["normal_b_post"] - rows["normal_a_post"])
    table["gap"] = rows["gap"]
    table["law"] = np.array(LAW_NAMES, dtype=object)[rows["law"]]
    return table | impact_flags(rows)


def _over(values: Any, radii: Any) -> Any:
    return np.divide(values, radii, out=np.zeros_like(values), where=radii > 0.0)


def bounce_table(systems: Sequence[TableSystem], rows: Any, run: Any) -> Table:
    """Columns of ``bounces.parquet`` of some runs, a row for each impact of a ball on the wall."""
    table = when_columns(rows, run)
    table["ball"] = rows["ball"] + 1
    curved = np.array([one.wall is None or one.wall.shape != POLYGON for one in systems])
    table["edge"] = np.ma.MaskedArray(rows["edge"] + 1, mask=curved[run])
    table["x"], table["y"] = rows["x"], rows["y"]
    table["normal_angle"] = np.arctan2(rows["normal_y"], rows["normal_x"])
    for when in ("pre", "post"):
        for axis in "xy":
            table[f"velocity_{axis}_{when}"] = rows[f"v{axis}_{when}"]
    for when in ("pre", "post"):
        across = rows[f"vx_{when}"] * rows["normal_x"] + rows[f"vy_{when}"] * rows["normal_y"]
        table[f"normal_speed_{when}"] = across
    along = rows["vy_pre"] * rows["normal_x"] - rows["vx_pre"] * rows["normal_y"]
    table["tangential_speed"] = along
    table["energy_loss"] = rows["loss"]
    table["grazing"] = rows["grazing"] == 1
    return table
