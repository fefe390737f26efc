"""Folders of grids made by hand, with values known beforehand, as `vibro grid` would write them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vibro_cli.storage.files import entry, json_bytes, manifest_of
from vibro_cli.storage.tables import parquet_bytes, to_arrow
from vibro_cli.systems.columns import Column, Table
from vibro_cli.systems.trace import SYSTEM
from vibro_cli.systems.trace.tables import collisions

SCENARIO = {
    "gravity": 9.81,
    "trace": {"start_slope": -1.5, "arcs": [{"shape": "valley", "radius": 1.0, "end_slope": 1.5}]},
    "collision": {"law": "hedrih", "k": 0.9},
    "stop": {"time": 20.0},
}
CAUSES = ("time", "no_more_collisions", "end_of_trace", "inadmissible")
UNITS = {"balls[1].angle": "rad", "balls[1].radius": "m", "gravity": "m/s^2"}


def product(axes: Mapping[str, Sequence[Any]]) -> dict[str, list[Any]]:
    """Return every combination of the axes' values, the last changing fastest."""
    columns: dict[str, list[Any]] = {path: [] for path in axes}
    sizes = [len(values) for values in axes.values()]
    for place in np.ndindex(*sizes):
        for index, (path, values) in zip(place, axes.items(), strict=True):
            columns[path].append(values[index])
    return columns


def write_grid(
    folder: Path,
    columns: Mapping[str, Sequence[Any]],
    name: str = "by-hand",
    kept: bool = True,
    planned: int | None = None,
    bad: Mapping[int, tuple[str, str]] | None = None,
) -> Path:
    """Write a grid whose point n (from 0) has n mod 7 impacts, cause n mod 4 and energy 1/(1 + n).

    `bad` are points with another status, and the reason.
    """
    points = len(next(iter(columns.values())))
    table, values = _summary(columns, points, dict(bad or {}))
    parts = {"summary/part-000000.parquet": _part(table, values)}
    if kept:
        parts["collisions/part-000000.parquet"] = _impacts(points)
    definition: dict[str, Any] = {
        "name": name,
        "scenario": SCENARIO,
        "mode": "product",
        "n": points,
        "seed": 0,
        "axes": [{"paths": [path]} for path in columns],
        "keep": {"collisions": kept, "columns": None},
    }
    files = {"grid.json": json_bytes(definition), **parts}
    details = {"complete": planned is None, "points": planned or points}
    entries = {path: entry(content) for path, content in files.items()}
    files["manifest.json"] = json_bytes(manifest_of("grid", entries, details))
    for path, content in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(content)
    return folder


def _part(table: Table, values: Mapping[str, Any]) -> bytes:
    return parquet_bytes(to_arrow(table, values, json.loads(json.dumps(SCENARIO))))


def _summary(
    columns: Mapping[str, Sequence[Any]], points: int, bad: Mapping[int, tuple[str, str]]
) -> tuple[Table, dict[str, Any]]:
    n = np.arange(points)
    words = {path: isinstance(values[0], str) for path, values in columns.items()}
    axes = [
        Column(path, "string" if words[path] else "float64", UNITS.get(path, ""), "an axis")
        for path in columns
    ]
    first = Column("scenario", "int64", "", "number of the scenario in the grid, from 1")
    table = Table("grid-summary", "one scenario", (first, *axes, *SYSTEM.summary(0).columns))
    status = np.array([bad[i][0] if i in bad else "ok" for i in range(points)], dtype=object)
    values: dict[str, Any] = {
        "scenario": n + 1,
        **{
            path: np.array(own, dtype=object if words[path] else np.float64)
            for path, own in columns.items()
        },
        "status": status,
        "reason": np.array([bad[i][1] if i in bad else None for i in range(points)], dtype=object),
        "end_cause": np.array(
            [None if i in bad else CAUSES[i % 4] for i in range(points)], dtype=object
        ),
        "collisions": n % 7,
        "energy_start": np.ones(points),
        "energy_end": 1.0 / (1.0 + n),
        "first_collision_time": np.where(n % 7 > 0, 0.5 + 0.01 * n, np.nan),
    }
    for column in table.columns:
        empty = np.full(points, np.nan) if column.type == "float64" else np.zeros(points, np.int64)
        values.setdefault(column.name, empty)
    return table, {column.name: values[column.name] for column in table.columns}


def place_of(scenario: int, n: int) -> float:
    """Return the angle of impact n of a scenario, both from 1."""
    return 0.01 * scenario - 0.1 * n


def _impacts(points: int) -> bytes:
    rows = [(i + 1, n) for i in range(points) for n in range(1, i % 7 + 1)]
    known = {column.name: column for column in collisions().columns}
    first = Column("scenario", "int64", "", "number of the scenario in the grid, from 1")
    table = Table("grid-collisions", "one impact", (first, known["n"], known["angle_a"]))
    values = {
        "scenario": np.array([row[0] for row in rows], dtype=np.int64),
        "n": np.array([row[1] for row in rows], dtype=np.int64),
        "angle_a": np.array([place_of(*row) for row in rows]),
    }
    return _part(table, values)
