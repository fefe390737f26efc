"""What stands in a report of runs of a system besides the trace, for the template of all runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vibro_cli.build import warnings_of
from vibro_cli.report.content import (
    BODY_HEADS,
    body_cells,
    compared,
    first_rows,
    flat,
    names_of,
    page_of,
)
from vibro_cli.report.images import figures_of_system_run
from vibro_cli.report.words import LAWS, number
from vibro_cli.storage.schema import table_named
from vibro_cli.storage.stored import StoredSystemRun
from vibro_cli.systems.table.run import TableRun

_FIGURES = (
    ("End", "end_time", "s"),
    ("Impacts", "collisions", ""),
    ("Impacts on the wall", "bounces", ""),
    ("First impact", "first_collision_time", "s"),
    ("Last impact", "last_collision_time", "s"),
    ("Lasting contacts begun", "contacts", ""),
    ("Energy at the start", "energy_start", "J"),
    ("Energy at the end", "energy_end", "J"),
    ("Largest gap left at an impact", "max_gap", "m"),
)
_ACCURACY = (
    ("Largest distance left at an impact", "max_gap", "m"),
    ("Relative drift of the energy, where it should be kept", "energy_drift", ""),
    ("Corrections that keep the energy, sum of absolute values", "energy_correction", "J"),
)
_LEFT_OUT = ("t_low", "law", "simultaneous", "grazing")
"""Columns of the tables that are not shown."""


def system_page(runs: Sequence[StoredSystemRun], beside: Path, version: str) -> dict[str, Any]:
    """Return the values of a report of runs whose file is to stand in the folder `beside`."""
    names = names_of(runs)
    results = [dict(_labelled(run, _FIGURES)) for run in runs]
    sections = [_run(run, name, beside) for run, name in zip(runs, names, strict=True)]
    comparison = compared(runs, names, results) if len(runs) > 1 else None
    return page_of(runs, names, sections, comparison, version)


def _run(stored: StoredSystemRun, name: str, beside: Path) -> dict[str, Any]:
    return {
        "key_figures": _labelled(stored, _FIGURES),
        "setting": _setting(stored),
        "tables": [_bodies(stored, name)],
        "figures": list(figures_of_system_run(stored.run, name)),
        "analogy": None,
        "sides": [],
        "energy": _energy_balance(stored),
        "validity": _validity(stored),
        "accuracy": _labelled(stored, _ACCURACY),
        "logs": _logs(stored, name, beside),
    }


def _labelled(
    stored: StoredSystemRun, wanted: Sequence[tuple[str, str, str]]
) -> list[tuple[str, str]]:
    """Some columns of the summary in words, those that there are."""
    known = [one for one in wanted if stored.summary.get(one[1]) is not None]
    return [(label, number(stored.summary[name], unit)) for label, name, unit in known]


def _setting(stored: StoredSystemRun) -> list[tuple[str, str]]:
    data, system = stored.scenario.resolved(), stored.run.system
    found: list[tuple[str, str]] = [("System", stored.scenario.system)]
    found += [(f"Wall, {key}", number(value)) for key, value in flat(data.get("wall", {})).items()]
    if len(system.bodies) > 1:
        found += [
            ("Impact law", f"{system.law}: {LAWS[system.law]}"),
            ("Coefficient of restitution k", number(data["collision"]["k"])),
            ("Inadmissible impacts", system.inadmissible),
        ]
    return [*found, *((f"Stop, {key}", number(value)) for key, value in data["stop"].items())]


def _bodies(stored: StoredSystemRun, name: str) -> tuple[str, list[str], list[list[str]]]:
    """Caption, heads and rows of the table of bodies: what they are, and how they start."""
    given = [flat(_started(ball)) for ball in stored.scenario.resolved()["balls"]]
    keys = list(dict.fromkeys(key for ball in given for key in ball))
    rows = [
        [*body_cells(index, body), *(number(ball.get(key)) for key in keys)]
        for index, (body, ball) in enumerate(zip(stored.run.system.bodies, given, strict=True))
    ]
    return f"Bodies of {name}, and how they start", [*BODY_HEADS, *keys], rows


def _started(ball: dict[str, Any]) -> dict[str, Any]:
    """What a scenario says of a body's start, and of its spring."""
    body = ("body", "radius", "mass", "density", "inertia_ratio", "thickness")
    return {key: value for key, value in ball.items() if key not in body}


def _energy_balance(stored: StoredSystemRun) -> list[tuple[str, str]]:
    """Where the energy went: in impacts of two bodies, on the wall, and what is left."""
    run, summary = stored.run, stored.summary
    table = run.collisions
    made = table["admissible"] | table["substituted"]
    lost = math.fsum(table["energy_loss"][made].tolist())
    wall = math.fsum(run.bounces["energy_loss"].tolist()) if isinstance(run, TableRun) else 0.0
    rest = summary["energy_start"] - lost - wall - summary["energy_end"]
    rows = [("At the start", summary["energy_start"]), ("Lost in the impacts of two bodies", lost)]
    if isinstance(run, TableRun):
        rows.append(("Lost on the wall", wall))
    rows += [("Rounding, and ends of accumulations", rest), ("At the end", summary["energy_end"])]
    return [(label, number(value, "J")) for label, value in rows]


def _validity(stored: StoredSystemRun) -> list[str]:
    """What there is to say on whether the motion is possible as it was computed."""
    table = stored.run.collisions
    refused = int(np.sum(~table["admissible"]))
    said = ["Every impact is admissible: the bodies separate after it."]
    if refused:
        said = [f"Inadmissible impacts: {refused}."]
    notes = warnings_of(stored.scenario, stored.run.system)
    return [*said, *(f"Note: {note}." for note in notes)]


def _logs(stored: StoredSystemRun, name: str, beside: Path) -> list[dict[str, Any]]:
    """The first rows of the tables of impacts."""
    tables = {"collisions": ("Impacts", "impacts", "was no impact of two bodies")}
    if stored.scenario.system == "table":
        tables["bounces"] = ("Impacts on the wall", "impacts on the wall", "was none on the wall")
    found = []
    for table, (label, words, none) in tables.items():
        known = table_named(table, (), stored.scenario.system).columns
        columns = [column for column in known if column.name not in _LEFT_OUT]
        said = {
            "label": f"{label} of {name}",
            "caption": f"{label} of {name}",
            "words": words,
            "none": none,
        }
        file = stored.folder / f"{table}.parquet"
        found.append(said | first_rows(stored.run.impact_table(table), columns, file, beside))
    return found
