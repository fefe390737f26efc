"""The summary of runs, and the final state of every body."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from vibro_cli.kernels.world import END_NAMES, NEVER
from vibro_cli.systems.trace.flights import Floats, Places
from vibro_cli.systems.wanted import Wanted


def conserves_energy(
    places: Places, restitution: Floats, outcomes: Any
) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Tell whether the law of each run keeps the energy of rolling.

    ``restitution`` has a row for each run, with the k of each pair.
    """
    system = places.system
    ends = (system.left_end, system.right_end)
    walls = [places.of_rows(end.restitution) for end in ends if end is not None]
    lossy = sum((wall < 1.0 for wall in walls), start=np.False_)
    equal = np.all(places.kappa == places.kappa[0], axis=0)
    law_keeps = equal | (system.law != "translational")
    keeps = law_keeps & np.all(restitution == 1.0, axis=1)
    kept: np.ndarray[Any, np.dtype[np.bool_]] = np.where(outcomes["impacts"] > 0, keeps, True)
    kept &= ~(lossy & (outcomes["walls"] > 0))
    return kept


def summary_columns(
    places: Places, restitution: Floats, outcomes: Any, finals: Any
) -> dict[str, Any]:
    """Return the columns of ``summary.parquet`` for runs of one system.

    Parameters
    ----------
    places
        Geometry of the system; initial states and masses may differ from run to run.
    restitution
        k of each pair, a row for each run.
    outcomes, finals
        From ``kernels.statistics.run_statistics``: a row for each run, and one for each of its
        bodies.
    """
    count = len(outcomes)
    finals = finals.reshape(count, -1)
    start, end = _total(finals["start_energy"]), _total(finals["end_energy"])
    kept = conserves_energy(places, restitution, outcomes) & (start > 0.0)
    demand = outcomes["most_demand"]
    # A particle slides: it neither needs friction nor tells of any.
    rolls = np.any(places.kappa > 1.0, axis=0)
    some = outcomes["collisions"] > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        drift = np.where(kept, (end - start) / start, np.nan)
    names = np.empty(max(END_NAMES) + 1, dtype=object)
    names[list(END_NAMES)] = list(END_NAMES.values())
    columns: dict[str, Any] = {
        "status": np.full(count, "ok", dtype=object),
        "reason": np.full(count, None, dtype=object),
        "end_cause": names[outcomes["end_cause"]],
        "end_time": outcomes["end_t"].copy(),
        "quiet_from": np.where(outcomes["quiet_t"] < NEVER, outcomes["quiet_t"], np.nan),
        "collisions": outcomes["collisions"].copy(),
        "crossings": outcomes["crossings"].copy(),
        "contacts": outcomes["contacts"].copy(),
        "first_collision_time": np.where(some, outcomes["first_t"], np.nan),
        "last_collision_time": np.where(some, outcomes["last_t"], np.nan),
        "energy_start": start,
        "energy_end": end,
        "energy_drift": drift,
        "energy_correction": outcomes["correction"].copy(),
        "max_gap": np.where(some, outcomes["max_gap"], np.nan),
        "min_normal_force": np.where(
            outcomes["least_force"] < NEVER, outcomes["least_force"], np.nan
        ),
        "max_friction_demand": np.where(np.isfinite(demand) & rolls, demand, np.nan),
    }
    columns.update(_final_states(places, finals))
    return columns


def skipped(clock: Mapping[str, Any], wanted: Wanted, end: float) -> tuple[str, ...]:
    """Say what was not computed of a run with this clock and end (s), and why."""
    notes = []
    apart, searches = int(clock["skipped_apart"]), int(clock["searches"])
    if apart:
        notes.append(f"{apart} of {searches} searches for a contact: the bodies are proved apart")
    if not searches:
        notes.append("every search for a contact: none was needed")
    if clock["quiet_t"] < NEVER:
        notes.append(f"no search after t = {clock['quiet_t']:.6g} s: no impact is possible")
    if not wanted.turning_points:
        notes.append("turning points: not asked for (output.turning_points)")
    if wanted.friction is None:
        notes.append("slip events: no coefficient of friction given (output.friction)")
    return (*notes, *wanted.left_out(end))


def _total(energies: Floats) -> Floats:
    """Sum over the bodies of each run, rounded once."""
    if energies.shape[1] <= 2:
        total: Floats = np.sum(energies, axis=1)
        return total
    return np.array([math.fsum(row) for row in energies.tolist()])


def _final_states(places: Places, finals: Any) -> dict[str, Any]:
    """``arc_i, angle_i, s_i, speed_i`` of every body at the end."""
    columns: dict[str, Any] = {}
    for body in range(finals.shape[1]):
        state = finals[:, body]
        piece, s, c, p = (state[name].copy() for name in ("piece", "s", "c", "p"))
        number = body + 1
        columns[f"arc_{number}"] = piece + 1
        columns[f"angle_{number}"] = places.angle(piece, s, c)
        columns[f"s_{number}"] = places.arc_length(piece, places.position(piece, s, c))
        columns[f"speed_{number}"] = places.speed_factor(body, piece) * p
    return columns
