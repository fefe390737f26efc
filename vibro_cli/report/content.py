"""The report of runs: its content as plain values for the template, and the page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vibro_cli.errors import counted
from vibro_cli.figures.kinds import draw_one, listed
from vibro_cli.figures.processes import each_drawn
from vibro_cli.figures.source import first_of
from vibro_cli.mechanics.system import LAWS, Body, TraceSystem, mechanics_warnings
from vibro_cli.report.html import pictured, rendered
from vibro_cli.report.papers import analogy, series_rows
from vibro_cli.report.words import (
    cell,
    ending,
    flat,
    link,
    method_of,
    named,
    number,
    validity,
    versions,
)
from vibro_cli.scenario.base import BodyTable
from vibro_cli.scenario.fields import written
from vibro_cli.storage.stored import StoredRun
from vibro_cli.systems.columns import Column, made
from vibro_cli.systems.describe import own_settings

FIRST_ROWS = 100
"""Number of rows of the table of impacts in the report."""
MOST_JUMPS = 40
"""Approximate number of jumps across the figure eight, or between regimes, in the report."""
_COLUMNS = (
    "n", "t", "dt", "ball_a", "ball_b", "arc_a", "arc_b", "angle_a", "angle_b", "s_a", "s_b",
    "omega_a_pre", "omega_a_post", "omega_b_pre", "omega_b_post", "energy_a_post",
    "energy_b_post", "energy_loss", "impulse_moment", "approach_speed", "separation_speed", "gap",
    "admissible", "substituted", "contact",
)  # fmt: skip
"""Columns shown of impacts on a trace."""
_LEFT_OUT = ("t_low", "law", "simultaneous", "grazing")
"""Columns left out of the impacts of other systems."""
_KEY_FIGURES = (
    ("End", "end_time", "s"),
    ("Impacts", "collisions", ""),
    ("Impacts on the wall", "bounces", ""),
    ("First impact", "first_collision_time", "s"),
    ("Last impact", "last_collision_time", "s"),
    ("Junctions crossed", "crossings", ""),
    ("Lasting contacts", "contacts", ""),
    ("No further impact possible from", "quiet_from", "s"),
    ("Energy at the start", "energy_start", "J"),
    ("Energy at the end", "energy_end", "J"),
    ("Largest gap left at an impact", "max_gap", "m"),
)
_ACCURACY = (
    ("Relative change in energy, where it should be conserved", "energy_drift", ""),
    ("Corrections that keep the energy constant, sum of absolute values", "energy_correction", "J"),
)
_ROUNDING = ("max_gap", "energy_drift", "energy_correction")
"""Columns of rounding errors, of which only the order of magnitude is shown."""


def report_html(runs: Sequence[StoredRun], beside: Path) -> bytes:
    """Return the report of one run, or of several compared, as the bytes of an HTML file.

    `beside` is the folder of the file, from which its links to the tables start.
    """
    method = dict.fromkeys(
        line for run in runs for line in method_of(run.kind, run.scenario.resolved())
    )
    names = names_of(runs)
    figures = pictures_of(runs, names)
    sections = [run.kind.report(run, name, beside) for run, name in zip(runs, names, strict=True)]
    values = {
        "title": names[0] if len(names) == 1 else f"{len(names)} runs compared",
        "method": tuple(method),
        "runs": [
            {
                "anchor": f"run{place}",
                "name": name,
                "folder": run.folder and str(run.folder),
                "ending": ending(run.summary["end_cause"], run.summary["end_time"]),
                "versions": versions(run.manifest),
                "figures": shown,
                **section,
            }
            for place, (run, name, shown, section) in enumerate(
                zip(runs, names, figures, sections, strict=True), 1
            )
        ],
        "comparison": compared(runs, names, sections) if len(runs) > 1 else None,
    }
    return rendered("report", values)


def names_of(runs: Sequence[StoredRun]) -> list[str]:
    """Return distinct names of the runs: those of the scenarios, with folders if necessary."""
    names = [run.scenario.name for run in runs]
    if len(set(names)) == len(names):
        return names
    return [f"{name} in {run.folder}" for name, run in zip(names, runs, strict=True)]


def pictures_of(runs: Sequence[StoredRun], names: Sequence[str]) -> list[list[dict[str, Any]]]:
    """Return the figures of each run as values for the page; empty figures are left out."""
    jobs = [
        (place, (kind, body, f"run {name}"))
        for place, (run, name) in enumerate(zip(runs, names, strict=True))
        for kind, body in listed(run)
    ]
    found: list[list[dict[str, Any]]] = [[] for _ in runs]
    for (place, _), picture in zip(jobs, each_drawn(_picture, runs, jobs), strict=True):
        found[place] += [] if picture is None else [picture]
    return found


def _picture(run: StoredRun, kind: str, body: int, of: str) -> dict[str, Any] | None:
    """Return one figure as values for the page, None if it is empty; `of` names the run."""
    wide, narrow = (draw_one(run, kind, body, width) for width in ("double", "single"))
    return None if wide is None or narrow is None else pictured(wide, narrow, of)


def section_of_trace(run: StoredRun, name: str, beside: Path) -> dict[str, Any]:
    """Return the content of the section on a run on a trace."""
    notes = mechanics_warnings(run.system, run.summary["end_time"])
    return {
        **_section(run, name, notes, "Largest distance left between the surfaces at an impact"),
        "setting": _setting_of_trace(run),
        "tables": _tables(run, name),
        "series": series_rows(run),
        "sides": _jumps(run, "eight"),
        "regimes": _jumps(run, "regime"),
        "logs": [_impacts(run, name, beside)],
    }


def section(run: StoredRun, name: str, beside: Path) -> dict[str, Any]:
    """Return the content of the section on a run of another system."""
    notes = run.kind.warnings(run.scenario, run.system)
    return {
        **_section(run, name, notes, "Largest distance left between bodies at an impact"),
        "setting": setting(run),
        "tables": [_bodies(run, name)],
        "series": [],
        "sides": [],
        "regimes": [],
        "logs": _logs(run, name, beside),
    }


def _section(run: StoredRun, name: str, notes: Sequence[str], gap: str) -> dict[str, Any]:
    """Return the content common to the sections of all systems."""
    rolls = not all(body.slides for body in run.system.bodies)
    refused = int(np.sum(~run.collisions["admissible"]))
    return {
        "key_figures": key_figures(run),
        # The comparison is that of paper B, with its speeds and one k for each pair.
        "analogy": analogy(run.system, run.collisions) if "B" in run.kind.papers else None,
        "energy": energy_balance(run),
        "validity": validity(run.summary, rolls, refused, notes),
        "accuracy": _labelled(run, ((gap, "max_gap", "m"), *_ACCURACY)),
    }


def key_figures(run: StoredRun) -> list[tuple[str, str]]:
    """Return the key figures as labels and values with units."""
    return _labelled(run, _KEY_FIGURES)


def _labelled(run: StoredRun, wanted: Sequence[tuple[str, str, str]]) -> list[tuple[str, str]]:
    """Return labels and values of the wanted columns of the summary, without missing ones."""
    known = [one for one in wanted if run.summary.get(one[1]) is not None]
    return [
        (label, number(run.summary[name], unit, 2 if name in _ROUNDING else 6))
        for label, name, unit in known
    ]


def _rotation(system: TraceSystem) -> list[tuple[str, str]]:
    turning = system.turning
    if turning is None:
        return []
    axis = f"about the vertical axis at x = {number(turning.x, 'm')}"
    return [("Rotation of the trace", f"Ω = {number(turning.rate, 'rad/s')} {axis}")]


def _setting_of_trace(run: StoredRun) -> list[tuple[str, str]]:
    system, scenario = run.system, run.scenario
    kind = "closed" if system.trace.closed else "open"
    stop = scenario.stop
    limits = [
        number(stop.time, "s"),
        "" if stop.collisions is None else counted(stop.collisions, "impact"),
    ]
    found = [
        ("Trace", f"{kind}, {system.surface}, length {number(system.trace.length, 'm')}"),
        *_rotation(system),
        ("Gravity", number(system.gravity, "m/s²")),
        ("Impact law", f"{system.law}: {LAWS[system.law].summary}"),
        ("Coefficient of restitution k", ", ".join(number(k) for k in system.restitution) or "–"),
        ("Inadmissible impacts", system.inadmissible),
        ("Stop after", " or ".join(text for text in limits if text not in ("", "–"))),
    ]
    return [(label, value) for label, value in found if value != "–"]


def _tables(run: StoredRun, name: str) -> list[tuple[str, Sequence[str], list[list[str]]]]:
    """Return captions, heads and rows of the tables of pieces and of bodies."""
    return [
        (
            f"Pieces of the trace of {name}, from left to right",
            ("Arc", "Shape", "Radius", "Slope at the left end", "Slope at the right end", "Length"),
            [_piece(run, index) for index in range(len(run.system.trace.pieces))],
        ),
        (
            f"Bodies of {name}, from left to right, and their initial states",
            (*BODY_HEADS, "Arc", "Angle or position", "Speed"),
            [_body(run, index) for index in range(len(run.system.bodies))],
        ),
    ]


def _piece(run: StoredRun, index: int) -> list[str]:
    piece = run.system.trace.pieces[index]
    radius = number(piece.radius, "m") if math.isfinite(piece.radius) else "–"
    slopes = [number(math.degrees(slope), "°") for slope in (piece.start_slope, piece.end_slope)]
    return [str(index + 1), piece.shape, radius, *slopes, number(piece.length, "m")]


def _body(run: StoredRun, index: int) -> list[str]:
    state = run.system.initial[index]
    on_line = run.system.trace.pieces[state.piece].is_line
    return [
        *body_cells(index, run.system.bodies[index]),
        str(state.piece + 1),
        number(state.position, "m" if on_line else "rad"),
        number(state.speed, "m/s"),
    ]


def setting(run: StoredRun) -> list[tuple[str, str]]:
    """Return the settings of a system other than a trace, as labels and values with units."""
    data, system = run.scenario.resolved(), run.system
    found: list[tuple[str, str]] = [("System", run.scenario.system)]
    for table, values in own_settings(data).items():
        found += _settings(run, table, values)
    if "law" not in data["collision"]:  # the system has only one law
        found += _settings(run, "collision", data["collision"])
    elif len(system.bodies) > 1:
        restitution = flat(data["collision"]["k"]).values()  # one for all pairs, or one per pair
        found += [
            ("Impact law", f"{system.law}: {LAWS[system.law].summary}"),
            ("Coefficient of restitution k", ", ".join(map(number, restitution))),
            ("Inadmissible impacts", system.inadmissible),
        ]
    return [*found, *_settings(run, "stop", data["stop"])]


def _settings(run: StoredRun, table: str, values: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the settings of a table of the scenario, or of none (""), labelled by their keys."""
    found = []
    for key, value in flat(values).items():
        words, unit = named(table, key, type(run.scenario))
        label = f"{table.capitalize()}, {words}" if table else words.capitalize()
        found.append((label, number(value, written(unit))))
    return found


def _bodies(run: StoredRun, name: str) -> tuple[str, list[str], list[list[str]]]:
    """Return caption, heads and rows of the table of bodies and their initial states."""
    # Besides the properties of the body itself: its start, and what holds it.
    given = [
        flat({key: value for key, value in ball.items() if key not in BodyTable.model_fields})
        for ball in run.scenario.resolved()["balls"]
    ]
    keys = list(dict.fromkeys(key for ball in given for key in ball))
    rows = [
        [*body_cells(index, body), *(number(ball.get(key)) for key in keys)]
        for index, (body, ball) in enumerate(zip(run.system.bodies, given, strict=True))
    ]
    model = type(run.scenario)
    heads = [
        f"{words} [{unit}]" if unit else words
        for words, unit in (named("balls", key, model) for key in keys)
    ]
    return f"Bodies of {name} and their initial states", [*BODY_HEADS, *heads], rows


BODY_HEADS = ("Body", "Kind", "Radius", "Mass", "κ", "J_P")


def body_cells(index: int, body: Body) -> list[str]:
    """Return the cells of a body under `BODY_HEADS`; `index` counts from 0."""
    return [
        str(index + 1),
        body.kind,
        number(body.radius, "m"),
        number(body.mass, "kg"),
        number(body.kappa),
        number(body.rolling_inertia, "kg m²"),
    ]


def energy_balance(run: StoredRun) -> list[tuple[str, str]]:
    """Return the energy balance: start, losses in tabulated impacts and elsewhere, end."""
    tables = {name: log.words for name, log in run.kind.impact_logs.items()}
    elsewhere, digits = "Lost elsewhere (ends of accumulations), and rounding", 6
    if not tables:  # on a trace impacts on walls have no table
        tables = {"collisions": "tabulated impacts"}
        elsewhere, digits = "Lost elsewhere (walls, ends of accumulations), and rounding", 3
    rest, end = run.summary["energy_start"], run.summary["energy_end"]
    rows = [("At the start", number(rest, "J"))]
    for name, words in tables.items():
        table = run.table(name)
        losses = np.asarray(table["energy_loss"], dtype=np.float64)
        lost = math.fsum((losses[made(table)] if "admissible" in table else losses).tolist())
        rows.append((f"Lost in the {words}", number(lost, "J")))
        rest -= lost
    rows.append((elsewhere, number(rest - end, "J", digits)))
    return [*rows, ("At the end", number(end, "J"))]


def _jumps(run: StoredRun, column: str) -> list[list[str]]:
    """Return the first impacts that took place and changed a column of words for a body."""
    table, found = run.collisions, []
    before, after = (
        [np.asarray(table[f"{column}_{end}_{when}"], dtype=object) for end in "ab"]
        for when in ("pre", "post")
    )
    leaps = [one != other for one, other in zip(before, after, strict=True)]
    for row in np.flatnonzero((leaps[0] | leaps[1]) & made(table)).tolist():
        for place, end in enumerate("ab"):
            if leaps[place][row]:
                time = number(float(table["t"][row]), "s")
                ball = str(int(table[f"ball_{end}"][row]))
                words = str(before[place][row]), str(after[place][row])
                found.append([str(int(table["n"][row])), time, ball, *words])
        if len(found) >= MOST_JUMPS:
            break
    return found


def _impacts(run: StoredRun, name: str, beside: Path) -> dict[str, Any]:
    known = {column.name: column for column in run.kind.table("collisions", ()).columns}
    # Folders written by an older version may have fewer columns.
    columns = [known[name] for name in _COLUMNS if name in run.collisions]
    words = {
        "words": "impacts",
        "none": "was no impact",
        "label": f"Impacts of {name}",
        "caption": f"Impacts of {name}; body a is to the left of body b",
    }
    return words | first_rows(run.collisions, columns, run.place, "collisions", beside)


def _logs(run: StoredRun, name: str, beside: Path) -> list[dict[str, Any]]:
    found = []
    for table, kept in run.kind.impact_logs.items():
        columns = [column for column in kept.table.columns if column.name not in _LEFT_OUT]
        title = f"{kept.title} of {name}"
        said = {"label": title, "caption": title, "words": kept.words, "none": kept.none}
        found.append(said | first_rows(run.table(table), columns, run.place, table, beside))
    return found


def first_rows(
    table: Mapping[str, Any],
    columns: Sequence[Column],
    folder: Path | None,
    name: str,
    beside: Path,
) -> dict[str, Any]:
    """Return the first rows of a table, with its columns and a link to the whole table.

    `folder` holds the file of the table `name`; it is None if there is no file.
    """
    total = len(table["n"])
    table = first_of(table, FIRST_ROWS)
    rows = range(min(total, FIRST_ROWS))
    return {
        "columns": columns,
        "rows": [[cell(table, column, row) for column in columns] for row in rows],
        "total": total,
        "file": f"{name}.parquet",
        "link": folder and link(folder / f"{name}.parquet", beside),
    }


def compared(
    runs: Sequence[StoredRun], names: Sequence[str], sections: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Return the key figures of several runs side by side, and the differences of scenarios."""
    results = [dict(section["key_figures"]) for section in sections]
    labels = list(dict.fromkeys(label for result in results for label in result))
    settings = [flat(run.scenario.resolved()) for run in runs]
    paths = list(dict.fromkeys(path for setting in settings for path in setting))
    differing = [
        path for path in paths if len({repr(setting.get(path)) for setting in settings}) > 1
    ]
    endings = [ending(run.summary["end_cause"], run.summary["end_time"]) for run in runs]
    return {
        "names": list(names),
        "results": [
            ["End cause", *endings],
            *([label, *(result.get(label, "–") for result in results)] for label in labels),
        ],
        "settings": [
            [path, *(number(setting.get(path)) for setting in settings)]
            for path in differing
            if path != "name"
        ],
    }
