"""The report as one HTML file: nothing is loaded from elsewhere, and nothing can be."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from vibro_cli.report.content import page
from vibro_cli.report.grid_content import grid_page
from vibro_cli.report.html import rendered
from vibro_cli.report.words import method_of
from vibro_cli.storage.stored import StoredGrid, StoredRun
from vibro_cli.systems import system_named

GENERATOR = "vibro report"


def report_html(runs: Sequence[StoredRun], beside: Path, version: str) -> bytes:
    """Return the report of one run, or of several compared, as the bytes of an HTML file.

    `beside` is the folder in which the file is to stand, for its links to the tables.
    """
    values = page(runs, beside, version)
    method = dict.fromkeys(
        line for run in runs for line in method_of(run.kind, run.scenario.resolved())
    )
    return rendered("report", values | {"generator": GENERATOR, "method": tuple(method)})


def grid_html(grid: StoredGrid, beside: Path, version: str, columns: Sequence[str] = ()) -> bytes:
    """Return the report of a grid as the bytes of an HTML file that is to stand in `beside`.

    `columns` are those of the summary whose maps are shown too.
    """
    values = grid_page(grid, beside, version, columns)
    method = method_of(system_named(grid.system), grid.definition["scenario"])
    values |= {"generator": GENERATOR, "method": method}
    return rendered("grid", values, assets="report")


def is_report(content: bytes, generator: str = GENERATOR) -> bool:
    """Return whether the bytes are those of a report of ours, or of another page of ours."""
    return f'<meta name="generator" content="{generator}">'.encode() in content[:2000]
