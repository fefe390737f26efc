"""Quantities of an impact: in the solver's tables, and of the twin."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from vibro_cli.simulation.run import Run
from vibro_cli.stress.highprecision.taylor import mp
from vibro_cli.stress.highprecision.twin import Impact

# Name in the collision table: name in the reference files, and how the twin has it.
SPEEDS: dict[str, tuple[str, Callable[[Impact], Any]]] = {
    "speed_a_pre": ("v_a_pre", lambda impact: impact.a.speed),
    "speed_b_pre": ("v_b_pre", lambda impact: impact.b.speed),
    "speed_a_post": ("v_a_post", lambda impact: impact.after_a),
    "speed_b_post": ("v_b_post", lambda impact: impact.after_b),
    "separation_speed": ("rel", lambda impact: impact.separation),
}
PLACES: dict[str, tuple[str, Callable[[Impact], Any]]] = {
    "place_a": ("angle_a", lambda impact: impact.a.place),
    "place_b": ("angle_b", lambda impact: impact.b.place),
}
TIME: dict[str, tuple[str, Callable[[Impact], Any]]] = {"t": ("t", lambda impact: impact.t)}
QUANTITIES = {**TIME, **PLACES, **SPEEDS}


def solved(run: Run, quantity: str, row: int) -> Any:
    """A quantity of the collision table, without rounding: the time as the sum of both doubles."""
    table = run.collisions
    if quantity == "t":
        return mp.mpf(float(table["t"][row])) + mp.mpf(float(table["t_low"][row]))
    if quantity in SPEEDS:
        return mp.mpf(float(table[quantity][row]))
    end = quantity[-1]
    angle = float(table[f"angle_{end}"][row])
    if math.isnan(angle):
        piece = run.system.trace.pieces[int(table[f"arc_{end}"][row]) - 1]
        return mp.mpf(float(table[f"s_{end}"][row])) - mp.mpf(piece.start_s)
    return mp.mpf(angle)


def columns(run: Run) -> dict[str, list[float]]:
    """All quantities of all rows, in doubles."""
    count = len(run.collisions["n"])
    return {name: [float(solved(run, name, row)) for row in range(count)] for name in QUANTITIES}
