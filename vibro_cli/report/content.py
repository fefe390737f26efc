"""What stands in a report, as plain values for its template."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vibro_cli.figures.source import first_of
from vibro_cli.mechanics.system import Body, TraceSystem, mechanics_warnings
from vibro_cli.report.html import figures_of_run
from vibro_cli.report.papers import analogy, series_rows
from vibro_cli.report.words import END_CAUSES, LAWS, cell, flat, link, number, validity, versions
from vibro_cli.storage.stored import StoredRun
from vibro_cli.storage.tables import Column, table_named

FIRST_ROWS = 100
"""Rows of the table of impacts that stand in the report."""
MOST_JUMPS = 40
"""Jumps across the figure eight, or between regimes, that stand in the report, about."""
_COLUMNS = (
    "n", "t", "dt", "ball_a", "ball_b", "arc_a", "arc_b", "angle_a", "angle_b", "s_a", "s_b",
    "omega_a_pre", "omega_a_post", "omega_b_pre", "omega_b_post", "energy_a_post",
    "energy_b_post", "energy_loss", "impulse_moment", "approach_speed", "separation_speed", "gap",
    "admissible", "substituted", "contact",
)  # fmt: skip


def page(runs: Sequence[StoredRun], beside: Path, version: str) -> dict[str, Any]:
    """Return the values of a report of runs whose file is to stand in the folder `beside`."""
    names = names_of(runs)
    sections = [run.kind.report(run, name, beside) for run, name in zip(runs, names, strict=True)]
    return {
        "title": names[0] if len(names) == 1 else f"{len(names)} runs compared",
        "version": version,
        "runs": [
            {
                "anchor": f"run{place}",
                "name": name,
                "folder": run.folder and str(run.folder),
                "ending": END_CAUSES.get(run.summary["end_cause"], str(run.summary["end_cause"])),
                "versions": versions(run.manifest),
                **section,
            }
            for place, (run, name, section) in enumerate(zip(runs, names, sections, strict=True), 1)
        ],
        "comparison": compared(runs, names, sections) if len(runs) > 1 else None,
    }


def names_of(runs: Sequence[StoredRun]) -> list[str]:
    """Return names that tell the runs apart: those of the scenarios, else with the folders'."""
    names = [run.scenario.name for run in runs]
    if len(set(names)) == len(names):
        return names
    return [f"{name} in {run.folder}" for name, run in zip(names, runs, strict=True)]


def section(run: StoredRun, name: str, beside: Path) -> dict[str, Any]:
    """Return what a report says of a run on a trace."""
    summary = run.summary
    return {
        "key_figures": key_figures(run),
        "setting": _setting(run),
        "tables": _tables(run, name),
        "figures": list(figures_of_run(run, name)),
        "series": series_rows(run),
        "analogy": analogy(run.system, run.collisions),
        "energy": energy_balance(run),
        "validity": validity(
            summary,
            any(body.kappa > 1.0 for body in run.system.bodies),
            _refused(run),
            mechanics_warnings(run.system, summary["end_time"]),
        ),
        "accuracy": _accuracy(run),
        "sides": _jumps(run, "eight"),
        "regimes": _jumps(run, "regime"),
        "logs": [_impacts(run, name, beside)],
    }


def _refused(run: StoredRun) -> int:
    return int(np.sum(~np.asarray(run.collisions["admissible"], dtype=np.bool_)))


def key_figures(run: StoredRun) -> list[tuple[str, str]]:
    """Return what came out, as labels and values with units."""
    summary = run.summary
    found = [
        ("End", number(summary["end_time"], "s")),
        ("Impacts", number(summary["collisions"])),
        ("First impact", number(summary["first_collision_time"], "s")),
        ("Last impact", number(summary["last_collision_time"], "s")),
        ("Junctions crossed", number(summary["crossings"])),
        ("Lasting contacts begun", number(summary["contacts"])),
        ("No impact possible since", number(summary["quiet_from"], "s")),
        ("Energy at the start", number(summary["energy_start"], "J")),
        ("Energy at the end", number(summary["energy_end"], "J")),
        ("Largest gap left at an impact", number(summary["max_gap"], "m", 2)),
    ]
    return [(label, value) for label, value in found if value != "–"]


def _rotation(system: TraceSystem) -> list[tuple[str, str]]:
    """Return how the trace turns, if it does."""
    turning = system.turning
    if turning is None:
        return []
    axis = f"about the vertical at x = {number(turning.x, 'm')}"
    return [("Rotation of the trace", f"Ω = {number(turning.rate, 'rad/s')} {axis}")]


def _setting(run: StoredRun) -> list[tuple[str, str]]:
    system, scenario = run.system, run.scenario
    kind = "closed" if system.trace.closed else "open"
    stop = scenario.stop
    limits = [
        number(stop.time, "s"),
        "" if stop.collisions is None else f"{stop.collisions} impacts",
    ]
    found = [
        ("Trace", f"{kind}, {system.surface}, length {number(system.trace.length, 'm')}"),
        *_rotation(system),
        ("Gravity", number(system.gravity, "m/s²")),
        ("Impact law", f"{system.law}: {LAWS[system.law]}"),
        ("Coefficient of restitution k", ", ".join(number(k) for k in system.restitution) or "–"),
        ("Inadmissible impacts", system.inadmissible),
        ("Stop", " or ".join(text for text in limits if text not in ("", "–"))),
    ]
    return [(label, value) for label, value in found if value != "–"]


def _tables(run: StoredRun, name: str) -> list[tuple[str, Sequence[str], list[list[str]]]]:
    """Captions, heads and rows of the tables of the problem."""
    return [
        (
            f"Pieces of the trace of {name}, from left to right",
            ("Arc", "Shape", "Radius", "Slope at the left end", "Slope at the right end", "Length"),
            [_piece(run, index) for index in range(len(run.system.trace.pieces))],
        ),
        (
            f"Bodies of {name}, from left to right, and how they start",
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


BODY_HEADS = ("Body", "Kind", "Radius", "Mass", "κ", "J_P")


def body_cells(index: int, body: Body) -> list[str]:
    """Return what a body is, as `BODY_HEADS` says; `index` counts from 0."""
    return [
        str(index + 1),
        body.kind,
        number(body.radius, "m"),
        number(body.mass, "kg"),
        number(body.kappa),
        number(body.rolling_inertia, "kg m²"),
    ]


def energy_balance(run: StoredRun) -> list[tuple[str, str]]:
    """Return where the energy went: in impacts, elsewhere, and what is left."""
    table = run.collisions
    made = np.asarray(table["admissible"], dtype=np.bool_) | np.asarray(
        table["substituted"], dtype=np.bool_
    )
    lost = math.fsum(np.asarray(table["energy_loss"], dtype=np.float64)[made])
    start, end = run.summary["energy_start"], run.summary["energy_end"]
    rest = start - lost - end
    return [
        ("At the start", number(start, "J")),
        ("Lost in the impacts of the table", number(lost, "J")),
        ("Lost elsewhere (walls, ends of accumulations) and rounding", number(rest, "J", 3)),
        ("At the end", number(end, "J")),
    ]


def _jumps(run: StoredRun, column: str) -> list[list[str]]:
    """The first impacts at which a body jumps from one word of a column to another."""
    table, found = run.collisions, []
    before, after = (
        [np.asarray(table[f"{column}_{end}_{when}"], dtype=object) for end in "ab"]
        for when in ("pre", "post")
    )
    leaps = [one != other for one, other in zip(before, after, strict=True)]
    for row in np.flatnonzero(leaps[0] | leaps[1]).tolist():
        for place, end in enumerate("ab"):
            if leaps[place][row]:
                time = number(float(table["t"][row]), "s")
                ball = str(int(table[f"ball_{end}"][row]))
                words = str(before[place][row]), str(after[place][row])
                found.append([str(int(table["n"][row])), time, ball, *words])
        if len(found) >= MOST_JUMPS:
            break
    return found


def _accuracy(run: StoredRun) -> list[tuple[str, str]]:
    summary = run.summary
    found = [
        ("Largest distance of the surfaces left at an impact", number(summary["max_gap"], "m", 2)),
        (
            "Relative drift of the energy, where it should be kept",
            number(summary["energy_drift"], digits=2),
        ),
        (
            "Corrections that keep the energy, sum of absolute values",
            number(summary["energy_correction"], "J", 2),
        ),
    ]
    return [(label, value) for label, value in found if value != "–"]


def _impacts(run: StoredRun, name: str, beside: Path) -> dict[str, Any]:
    known = {column.name: column for column in table_named("collisions", ()).columns}
    columns = [known[name] for name in _COLUMNS]
    words = {
        "words": "impacts",
        "none": "was no impact",
        "label": f"Impacts of {name}",
        "caption": f"Impacts of {name}, a to the left of b",
    }
    return words | first_rows(run.collisions, columns, run.folder, "collisions", beside)


def first_rows(
    table: Mapping[str, Any],
    columns: Sequence[Column],
    folder: Path | None,
    name: str,
    beside: Path,
) -> dict[str, Any]:
    """Return the first rows of a table, with what each column means and where the others are.

    `folder` is that of the file of the table `name`, None where there is none.
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
    """Return the key figures of several runs side by side, and what differs in the scenarios."""
    results = [dict(section["key_figures"]) for section in sections]
    labels = list(dict.fromkeys(label for result in results for label in result))
    settings = [flat(run.scenario.resolved()) for run in runs]
    paths = list(dict.fromkeys(path for setting in settings for path in setting))
    differing = [
        path for path in paths if len({repr(setting.get(path)) for setting in settings}) > 1
    ]
    endings = [END_CAUSES.get(run.summary["end_cause"], "") for run in runs]
    return {
        "names": list(names),
        "results": [
            ["Ending", *endings],
            *([label, *(result.get(label, "–") for result in results)] for label in labels),
        ],
        "settings": [
            [path, *(number(setting.get(path)) for setting in settings)]
            for path in differing
            if path != "name"
        ],
    }
