"""The summary of a run, and the final state of every body."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibro_cli.simulation.forces import extremes
from vibro_cli.simulation.geometry import Places
from vibro_cli.simulation.impacts import residual_gap
from vibro_cli.simulation.paths import Paths
from vibro_cli.simulation.world import END_INADMISSIBLE, END_NAMES, WALL


def conserves_energy(places: Places, impacts: int, walls: int) -> bool:
    """Tell whether the law of the run keeps the energy of rolling."""
    system = places.system
    if walls and any(
        end is not None and end.restitution < 1.0 for end in (system.left_end, system.right_end)
    ):
        return False
    if not impacts:
        return True
    equal = len({body.kappa for body in system.bodies}) == 1
    keeps = system.law != "translational" or equal
    return keeps and all(k == 1.0 for k in system.restitution)


def summarise(
    places: Places, paths: Paths, impacts: Any, end_cause: int, clock: dict[str, float]
) -> dict[str, Any]:
    """Return the record of ``summary.json``: plain values, None for null."""
    log = paths.log
    start = math.fsum(paths.start_energies())
    end = math.fsum(paths.end_energies())
    if end_cause == END_INADMISSIBLE:
        impacts = impacts[:-1]
    walls = int(np.count_nonzero(log["cause"] == WALL))
    kept = conserves_energy(places, len(impacts), walls)
    gaps = np.abs(residual_gap(places, impacts))
    quiet = clock["quiet_t"]
    forces = extremes(paths)
    record: dict[str, Any] = {
        "status": "ok",
        "reason": None,
        "end_cause": END_NAMES[end_cause],
        "end_time": clock["t"],
        "quiet_from": quiet if quiet < 1e300 else None,
        "collisions": int(clock["collisions"]),
        "crossings": int(clock["crossings"]),
        "contacts": int(clock["contacts"]),
        "first_collision_time": float(impacts["t"][0]) if len(impacts) else None,
        "last_collision_time": float(impacts["t"][-1]) if len(impacts) else None,
        "energy_start": start,
        "energy_end": end,
        "energy_drift": (end - start) / start if kept and start > 0.0 else None,
        "energy_correction": clock["energy_correction"],
        "max_gap": float(np.max(gaps)) if len(gaps) else None,
        "min_normal_force": forces["min_normal_force"],
        "max_friction_demand": _null(forces["max_friction_demand"]),
    }
    record.update(_final_states(places, paths))
    return record


def _null(value: float) -> float | None:
    return None if math.isnan(value) else value


def _final_states(places: Places, paths: Paths) -> dict[str, Any]:
    """``arc_i, angle_i, s_i, speed_i`` of every body at the end."""
    rows = np.flatnonzero(paths.last)
    body, piece = paths.body[rows], paths.piece[rows]
    s, c, p = paths.end_s[rows], paths.end_c[rows], paths.end_p[rows]
    angle = places.angle(piece, s, c)
    length = places.arc_length(piece, places.position(piece, s, c))
    speed = places.speed_factor(body, piece) * p
    record: dict[str, Any] = {}
    for number in range(len(rows)):
        ball = int(body[number]) + 1
        record[f"arc_{ball}"] = int(piece[number]) + 1
        record[f"angle_{ball}"] = _null(float(angle[number]))
        record[f"s_{ball}"] = float(length[number])
        record[f"speed_{ball}"] = float(speed[number])
    return record
