"""The summary of runs, and the final state of every body."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibro_cli.mechanics.records import NEVER, Flight
from vibro_cli.numerics import engine
from vibro_cli.simulation.drive import ROWS_USED, compiled_world, restore
from vibro_cli.simulation.entry import enter_tally
from vibro_cli.simulation.geometry import Floats, Places
from vibro_cli.simulation.tally import FinalState, Outcome, tally
from vibro_cli.simulation.world import END_NAMES, LOGS, RECORDS, World


def tally_run(
    world: World,
    engine_name: str,
    logs: dict[str, Any],
    state: dict[str, Any],
    cause: int,
    end: tuple[float, float],
    variant: engine.Variant | None,
) -> tuple[Any, Any]:
    """Return outcome and final states of a run (see ``simulation.tally``), one row and one a body.

    Parameters
    ----------
    world
        The records of the run, interpreted; they are put into its state at the end.
    engine_name
        ``"python"`` or ``"numba"``; both give the same bits.
    logs, state
        The rows of the whole run and the state at its end.
    cause, end
        Why and when (two doubles, s) it ended.
    variant
        Of the kernels, for the system.
    """
    restore(world, state)
    for name, used in ROWS_USED.items():
        setattr(world.clock[0], used, len(logs[name]))
    if engine_name == "numba":
        results = enter_tally(compiled_world(world)._replace(**logs), cause, end, variant)
        return results.outcomes, results.finals
    rows = {name: engine.interpreted_copies(logs[name], RECORDS[name]) for name in LOGS}
    own = engine.interpreted_rows(Outcome, 1)
    states = engine.interpreted_rows(FinalState, len(world.bodies))
    count = engine.interpreted(tally, variant)
    count(world._replace(**rows), 0, cause, *end, own, 0, states, [Flight()])
    return engine.compiled_rows(own, Outcome), engine.compiled_rows(states, FinalState)


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
        From ``simulation.tally``: a row for each run, and one for each of its bodies.
    """
    count = len(outcomes)
    finals = finals.reshape(count, -1)
    start, end = _total(finals["start_energy"]), _total(finals["end_energy"])
    kept = conserves_energy(places, restitution, outcomes) & (start > 0.0)
    demand = outcomes["most_demand"]
    some = outcomes["impacts"] > 0
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
        "max_friction_demand": np.where(np.isfinite(demand), demand, np.nan),
    }
    columns.update(_final_states(places, finals))
    return columns


def summary_record(columns: dict[str, Any]) -> dict[str, Any]:
    """Return the one row of summary columns as plain values, None for null."""
    record = {name: values.tolist()[0] for name, values in columns.items()}
    return {
        name: None if isinstance(value, float) and math.isnan(value) else value
        for name, value in record.items()
    }


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
