"""What stands in a report of runs of a system besides the trace, for the template of all runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vibro_cli.assemble import warnings_of
from vibro_cli.report.content import BODY_HEADS, body_cells, first_rows
from vibro_cli.report.html import figures_of_run
from vibro_cli.report.papers import analogy
from vibro_cli.report.words import KEYS, LAWS, flat, named, number
from vibro_cli.storage.stored import StoredRun

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
_ROUNDING = ("max_gap", "energy_drift", "energy_correction")
"""Columns whose numbers are those of rounding: their size is shown."""
_LEFT_OUT = ("t_low", "law", "simultaneous", "grazing")
"""Columns of the tables that are not shown."""


def section(stored: StoredRun, name: str, beside: Path) -> dict[str, Any]:
    """Return what a report says of a run."""
    return {
        "key_figures": _labelled(stored, _FIGURES),
        "setting": _setting(stored),
        "tables": [_bodies(stored, name)],
        "figures": list(figures_of_run(stored.run, name)),
        "series": [],
        "analogy": analogy(stored.run.system, stored.run.collisions),
        "sides": [],
        "regimes": [],
        "energy": _energy_balance(stored),
        "validity": _validity(stored),
        "accuracy": _labelled(stored, _ACCURACY),
        "logs": _logs(stored, name, beside),
    }


def _labelled(stored: StoredRun, wanted: Sequence[tuple[str, str, str]]) -> list[tuple[str, str]]:
    """Some columns of the summary in words, those that there are."""
    known = [one for one in wanted if stored.summary.get(one[1]) is not None]
    return [
        (label, number(stored.summary[name], unit, 2 if name in _ROUNDING else 6))
        for label, name, unit in known
    ]


def _setting(stored: StoredRun) -> list[tuple[str, str]]:
    data, system = stored.scenario.resolved(), stored.run.system
    found: list[tuple[str, str]] = [("System", stored.scenario.system)]
    wall = [named(key, value) for key, value in flat(data.get("wall", {})).items()]
    found += [(f"Wall, {words}", value) for words, value in wall]
    if len(system.bodies) > 1:
        found += [
            ("Impact law", f"{system.law}: {LAWS[system.law]}"),
            ("Coefficient of restitution k", named("k", data["collision"]["k"])[1]),
            ("Inadmissible impacts", system.inadmissible),
        ]
    stops = [named(key, value) for key, value in data["stop"].items()]
    return [*found, *((f"Stop, {words}", value) for words, value in stops)]


def _bodies(stored: StoredRun, name: str) -> tuple[str, list[str], list[list[str]]]:
    """Caption, heads and rows of the table of bodies: what they are, and how they start."""
    given = [flat(_started(ball)) for ball in stored.scenario.resolved()["balls"]]
    keys = list(dict.fromkeys(key for ball in given for key in ball))
    rows = [
        [*body_cells(index, body), *(number(ball.get(key)) for key in keys)]
        for index, (body, ball) in enumerate(zip(stored.run.system.bodies, given, strict=True))
    ]
    heads = [f"{words} [{unit}]" if unit else words for words, unit in map(_head, keys)]
    return f"Bodies of {name}, and how they start", [*BODY_HEADS, *heads], rows


def _head(key: str) -> tuple[str, str]:
    return KEYS.get(key, (key, ""))


def _started(ball: dict[str, Any]) -> dict[str, Any]:
    """What a scenario says of a body's start, and of its spring."""
    body = ("body", "radius", "mass", "density", "inertia_ratio", "thickness")
    return {key: value for key, value in ball.items() if key not in body}


def _energy_balance(stored: StoredRun) -> list[tuple[str, str]]:
    """Where the energy went: in impacts of two bodies, on the wall, and what is left."""
    run, summary = stored.run, stored.summary
    rows, rest = [("At the start", summary["energy_start"])], summary["energy_start"]
    for name, kept in run.kind.impact_logs.items():
        table = run.table(name)
        assert table is not None
        losses = table["energy_loss"]
        if "admissible" in table:
            losses = losses[table["admissible"] | table["substituted"]]
        lost = math.fsum(losses.tolist())
        rows.append((f"Lost in the {kept.words}", lost))
        rest -= lost
    rows.append(("Rounding, and ends of accumulations", rest - summary["energy_end"]))
    rows.append(("At the end", summary["energy_end"]))
    return [(label, number(value, "J")) for label, value in rows]


def _validity(stored: StoredRun) -> list[str]:
    """What there is to say on whether the motion is possible as it was computed."""
    table = stored.run.collisions
    refused = int(np.sum(~table["admissible"]))
    said = ["Every impact is admissible: the bodies separate after it."]
    if refused:
        said = [f"Inadmissible impacts: {refused}."]
    notes = warnings_of(stored.scenario, stored.run.system)
    return [*said, *(f"Note: {note}." for note in notes)]


def _logs(stored: StoredRun, name: str, beside: Path) -> list[dict[str, Any]]:
    """The first rows of the tables of impacts."""
    found = []
    for table, kept in stored.kind.impact_logs.items():
        columns = [column for column in kept.table.columns if column.name not in _LEFT_OUT]
        said = {
            "label": f"{kept.title} of {name}",
            "caption": f"{kept.title} of {name}",
            "words": kept.words,
            "none": kept.none,
        }
        rows = stored.run.table(table)
        assert rows is not None
        found.append(said | first_rows(rows, columns, stored.folder, table, beside))
    return found
