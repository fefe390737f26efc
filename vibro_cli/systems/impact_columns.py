"""Columns that the impacts of every system have."""

from __future__ import annotations

from typing import Any

import numpy as np

Table = dict[str, Any]
"""Columns by their names."""


def when_columns(rows: Any) -> Table:
    """Return number and time of each row, and the time since the row before."""
    count = len(rows)
    between = np.full(count, np.nan)
    if count > 1:
        between[1:] = np.diff(rows["t"]) + np.diff(rows["t_low"])
    return {
        "n": np.arange(1, count + 1),
        "t": rows["t"],
        "t_low": rows["t_low"],
        "dt": between,
    }


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
