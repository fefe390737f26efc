"""The report of a grid: its content as plain values for the template, and the page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from heapq import nsmallest
from pathlib import Path
from typing import Any

import numpy as np

from vibro_cli.figures.kinds import draw_grid
from vibro_cli.figures.maps import COLOURS, ended
from vibro_cli.report.html import pictured, rendered
from vibro_cli.report.words import (
    cell,
    ending,
    flat,
    link,
    method_of,
    number,
    versions,
)
from vibro_cli.scenario.fields import unit_at, written
from vibro_cli.scenario.problems import parsed_path
from vibro_cli.storage.stored import StoredGrid
from vibro_cli.systems import system_named
from vibro_cli.systems.columns import Column

FIRST_ROWS = 200
"""Number of rows of the table of points in the report."""
_MOST_REASONS = 20
_QUANTITIES = (
    "collisions", "bounces", "contacts", "crossings", "end_time", "first_collision_time",
    "last_collision_time", "energy_start", "energy_end", "energy_drift", "max_gap",
    "min_normal_force", "max_friction_demand",
)  # fmt: skip
_OF_POINTS = (
    "status", "end_cause", "collisions", "bounces", "contacts", "end_time", "energy_start",
    "energy_end", "min_normal_force",
)  # fmt: skip


def grid_html(grid: StoredGrid, beside: Path, columns: Sequence[str] = ()) -> bytes:
    """Return the report of a grid as the bytes of an HTML file in the folder `beside`.

    Maps of `columns` of the summary are shown, too.
    """
    wide, narrow = (draw_grid(grid, width, columns) for width in ("double", "single"))
    both = zip(wide, narrow, strict=True)
    values = {
        "title": grid.name,
        "folder": str(grid.folder),
        "said": f"{grid.unsolved or f'All {grid.points} points are solved'}.",
        "endings": _endings(grid),
        "setting": _setting(grid),
        "axes": [_axis(grid, path) for path in grid.axes],
        "common": _common(grid),
        "figures": [pictured(*widths, f"grid {grid.name}") for widths in both],
        "quantities": [
            row for name in _QUANTITIES if name in grid.summary for row in _quantity(grid, name)
        ],
        "refused": _refused(grid),
        "points": _points(grid),
        "link": link(grid.place / "summary", beside),
        "versions": versions(grid.manifest),
        "method": method_of(system_named(grid.system), grid.definition["scenario"]),
    }
    return rendered("grid", values)


def _endings(grid: StoredGrid) -> list[list[str]]:
    """Return the end causes, or statuses of points without one, with their numbers of points."""
    counts = Counter(ended(grid).tolist())
    return [
        [cause.replace("_", " "), str(counts[cause]), ending(cause)]
        for cause in COLOURS
        if cause in counts
    ]


def _setting(grid: StoredGrid) -> list[tuple[str, str]]:
    keep = grid.definition["keep"]
    found = [
        ("Combination of the axes", str(grid.definition["mode"])),
        ("Points", str(grid.manifest["points"])),
        ("Impacts kept", "yes" if keep["collisions"] else "no, only the summaries"),
    ]
    if grid.definition["mode"] in ("latin-hypercube", "sobol"):
        found.append(("Seed", str(grid.definition["seed"])))
    return found


def _axis(grid: StoredGrid, path: str) -> list[str]:
    values = grid.summary[path]
    if values.dtype == object:
        words = sorted(set(values.astype(str)))
        return [path, "", ", ".join(words[:_MOST_REASONS]), "–", "–"]
    different = np.unique(values)
    ends = [number(different[place].item()) for place in (0, -1)]
    return [path, grid.units[path] or "1", str(len(different)), *ends]


def _common(grid: StoredGrid) -> list[list[str]]:
    """Return the keys of the scenario that no axis changes, and their values with units."""
    settings, model = flat(grid.definition["scenario"]), system_named(grid.system).model
    return [
        [path, number(value, written(unit_at(parsed_path(path), model)))]
        for path, value in settings.items()
        if path not in grid.axes
    ]


def _quantity(grid: StoredGrid, name: str) -> list[list[str]]:
    """Return a row with the least, median and greatest value of a column, if it has any."""
    values = np.asarray(grid.summary[name], dtype=np.float64)
    finite = values[np.isfinite(values)]
    if not len(finite):
        return []
    unit = grid.units[name]
    shown = [number(float(of(finite)), unit) for of in (np.min, np.median, np.max)]
    return [[name.replace("_", " "), *shown]]


def _refused(grid: StoredGrid) -> list[list[str]]:
    """Return the reasons why points could not be solved, the most frequent first."""
    both = zip(grid.summary["status"].tolist(), grid.summary["reason"].tolist(), strict=True)
    counts = Counter((status, str(reason)) for status, reason in both if status != "ok")
    most = nsmallest(_MOST_REASONS, counts.items(), key=lambda one: (-one[1], one[0]))
    shown = [[str(count), *pair] for pair, count in most]
    left = len(counts) - len(shown)
    return [*shown, ["…", "", f"{left} further reasons"]] if left else shown


def _points(grid: StoredGrid) -> dict[str, Any]:
    known = {column.name: column for column in system_named(grid.system).summary(0).columns}
    axes = [_axis_column(grid, path) for path in grid.axes]
    first = Column("scenario", "int64", "", "number of the scenario in the grid, from 1")
    columns = [first, *axes, *(known[name] for name in _OF_POINTS if name in known)]
    rows = range(min(grid.points, FIRST_ROWS))
    return {
        "columns": columns,
        "rows": [[cell(grid.summary, column, row) for column in columns] for row in rows],
        "total": grid.points,
    }


def _axis_column(grid: StoredGrid, path: str) -> Column:
    words = grid.summary[path].dtype == object
    meaning = "value of this key of the scenario"
    return Column(path, "string" if words else "float64", grid.units[path], meaning)
