"""The tables of a grid's parts: their columns, and parts as files."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any

from vibro_cli import __version__
from vibro_cli.grids.document import Grid
from vibro_cli.grids.paths import Model, kind_of, type_of, unit_of
from vibro_cli.scenario import fields
from vibro_cli.scenario.problems import KeyPath, path_text
from vibro_cli.storage.parts import PartFile
from vibro_cli.storage.schema import Column, Table, summary, table_named
from vibro_cli.storage.tables import Origin, arrow_schema

SUMMARY = "grid-summary"
# Columns of impacts that readers of a few scenarios or moments look at first.
_ORDERED = ("scenario", "n", "t")
_NUMBER = Column("scenario", "int64", "", "number of the scenario in the grid, from 1")


def axis_column(path: KeyPath, root: Model) -> Column:
    """Return the column of an axis' values, of scenarios with the model `root`."""
    kind = kind_of(path, root)
    text = fields.description(path, root) or "value of this key of the scenario"
    return Column(path_text(path), type_of(kind), unit_of(kind), text[:1].lower() + text[1:])


def summary_table(grid: Grid) -> Table:
    """Return the table of summaries of a grid's scenarios."""
    axes = [axis_column(path, grid.root) for path in grid.design.paths]
    of_runs = summary(ball_count(grid), grid.system, is_followed(grid)).columns
    return Table(SUMMARY, "one scenario", (_NUMBER, *axes, *of_runs))


def impact_table_of(grid: Grid, name: str = "collisions") -> Table:
    """Return a table of the impacts that a grid keeps."""
    table = table_named(name, ["side"] if _may_be_sided(grid) else [], grid.system)
    kept = grid.keep.columns
    columns = [column for column in table.columns if kept is None or column.name in kept]
    columns = [_nullable(c) if c.name == "side" else c for c in columns]
    return Table(f"grid-{name}", table.row, (_NUMBER, *columns))


def ball_count(grid: Grid) -> int:
    """Return the number of bodies of every scenario of a grid."""
    balls = grid.base.data.get("balls", ())
    return len(balls) if isinstance(balls, list) else 0


def is_followed(grid: Grid) -> bool:
    """Whether exponents of every point are wanted."""
    analysis = grid.base.data.get("analysis", {})
    return isinstance(analysis, dict) and analysis.get("lyapunov") is True


def _may_be_sided(grid: Grid) -> bool:
    """Whether some scenarios have two bodies on a closed trace, which may meet two ways."""
    trace = grid.base.data.get("trace", {})
    closed = isinstance(trace, dict) and trace.get("closed") is True
    return ball_count(grid) == 2 and (closed or ("trace", "closed") in grid.design.paths)


def _nullable(column: Column) -> Column:
    return Column(column.name, column.type, column.unit, column.description, nullable=True)


def part_file(grid: Grid, table: Table, chunk: int, room: Callable[[str, int], Any]) -> PartFile:
    """Return the file of one part, to be filled: the same bytes for the same rows of the same grid.

    ``table`` and ``chunk`` are what it is a part of; ``room(name, size)`` gives memory for it.
    """
    resolved = grid.resolved()
    origin = Origin(resolved["scenario"], __version__, _metadata(resolved, chunk))
    names = [column.name for column in table.columns]
    skipped_by = [name for name in names if table.name == SUMMARY or name in _ORDERED]
    return PartFile(partial(room, f"file of {table.name}"), arrow_schema(table, origin), skipped_by)


def _metadata(resolved: dict[str, Any], chunk: int) -> dict[str, str]:
    return {
        "vibro:grid": json.dumps(resolved, ensure_ascii=False, allow_nan=False),
        "vibro:part": str(chunk),
    }
