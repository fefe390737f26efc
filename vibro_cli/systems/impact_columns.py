"""Columns that the impacts of every system have."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from vibro_cli.mechanics.body import Body
from vibro_cli.systems.system import ImpactSystem

Table = dict[str, Any]
"""Columns by their names."""


def when_columns(rows: Any, run: Any) -> Table:
    """Return number and time of each row in its run, and the time since the row before.

    `run` is the number of the run of each row, not falling.
    """
    number = np.arange(1, len(rows) + 1) - np.searchsorted(run, run)
    between = np.full(len(rows), np.nan)
    between[1:] = np.diff(rows["t"]) + np.diff(rows["t_low"])
    between[number == 1] = np.nan
    return {
        "n": number,
        "t": rows["t"],
        "t_low": rows["t_low"],
        "dt": between,
    }


def of_bodies(systems: Sequence[ImpactSystem], value: Callable[[Body], float]) -> Any:
    """Return a value of every body of every system: [system, body]."""
    return np.array([[value(body) for body in system.bodies] for system in systems])


def inclinations(one: Any, other: Any) -> Any:
    """Return the cosines between lines of centres and the plane, from the bodies' radii (m)."""
    return np.where(one == other, 1.0, 2.0 * np.sqrt(one * other) / np.maximum(one + other, 1e-300))


def impact_flags(rows: Any) -> Table:
    """Return the truth values that the rows hold as numbers."""
    flags = ("admissible", "substituted", "simultaneous", "grazing")
    return {flag: rows[flag] == 1 for flag in flags}


def summary_columns(totals: list[tuple[str, Any]]) -> Table:
    """Return a summary as columns of one row."""
    return {
        name: np.array([value], dtype=object if value is None or isinstance(value, str) else None)
        for name, value in totals
    }


def summary_values(totals: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a summary as plain values, None for null."""
    return {
        name: None if isinstance(value, float) and value != value else value
        for name, value in totals
    }


def impact_totals(pairs: Any) -> list[tuple[str, Any]]:
    """Return the times of the first and the last impact."""
    times = pairs["t"]
    return [
        ("first_collision_time", float(times[0]) if len(times) else np.nan),
        ("last_collision_time", float(times[-1]) if len(times) else np.nan),
    ]


def energy_totals(start: float, end: float, kept: bool, correction: float) -> list[tuple[str, Any]]:
    """Return the balance of energy (J); `kept` says whether it should be kept."""
    return [
        ("energy_start", start),
        ("energy_end", end),
        ("energy_drift", (end - start) / start if start > 0.0 and kept else np.nan),
        ("energy_correction", correction),
    ]


def largest_gap(pairs: Any) -> float:
    """Return the largest distance left at an impact (m), nan without any."""
    return float(np.max(np.abs(pairs["gap"]))) if len(pairs) else float("nan")
