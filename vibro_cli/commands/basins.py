"""`vibro basins` and `vibro section`: maps of how the runs of a grid end; sections of impacts."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibro_cli.commands.shared.error_handling import DONE, CommandError, check_place
from vibro_cli.commands.shared.options import (
    Width,
    beside,
    json_option,
    output_option,
    repeatable,
)
from vibro_cli.commands.shared.terminal import json_text, print_found, say
from vibro_cli.errors import counted, listing

if TYPE_CHECKING:
    from vibro_cli.analysis.basins import Basins, Estimate
    from vibro_cli.figures.analyses import Mapped
    from vibro_cli.interface.grids import Grid
    from vibro_cli.storage.stored import StoredGrid

_LISTED = 20
"""Number of outcomes that are printed if there are at least two more; basins.json has all."""


@dataclass(frozen=True, kw_only=True)
class BasinsCommand:
    """Map the basins of a grid: how its runs end. Print basin entropy and uncertainty exponent."""

    grid: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder of a grid over one or two axes.")
    ]
    outcome: Annotated[
        list[str],
        repeatable(
            metavar="COLUMN",
            help="Summary column of words or whole numbers that defines the outcome; repeatable, "
            "to combine several [default: end_cause and, on a trace of several pieces, arc_1, "
            "arc_2, …].",
        ),
    ]
    output: Annotated[
        str | None,
        output_option(metavar="DIR", help="Folder for the results [default: DIR-basins]."),
    ] = None
    figures: Annotated[
        bool, typer.Option("--figures/--no-figures", help="Draw the map and the scaling.")
    ] = True
    as_json: Annotated[bool, json_option(help="Print the results as JSON.")] = False

    def __call__(self) -> int:
        """Read, measure, draw, write and print."""
        from vibro_cli.analysis.basins import NoBasins
        from vibro_cli.figures.analyses import mapped_basins
        from vibro_cli.interface import pictures
        from vibro_cli.storage.files import check_replaceable
        from vibro_cli.storage.folders import write_results
        from vibro_cli.storage.stored import open_grid

        source = self.grid
        target = Path(self.output or beside(source, "-basins"))
        check_replaceable(target, "basins")
        stored = open_grid(source)
        try:
            found = mapped_basins(stored, self.outcome)
        except NoBasins as error:
            raise CommandError(f"vibro: {source}: no basins: {error}") from error
        drawn = {}
        if self.figures:
            shown = {"basins": found.map("double"), "uncertainty": found.scaling("single")}
            drawn = pictures({name: one for name, one in shown.items() if one is not None})
        record = record_of(found.basins, [one.path for one in found.shown.coordinates])
        write_results("basins", target, drawn, record=record)
        print_found(record, _lines(stored.name, found), self.as_json)
        _warn_of_unsolved(stored)
        if found.doubt:
            say(f"{stored.name}: warning: {found.doubt}", "warning")
        say(f"{stored.name}: files in {target}")
        return DONE


def _warn_of_unsolved(stored: StoredGrid) -> None:
    if stored.unsolved:
        say(f"{stored.name}: warning: {stored.unsolved}", "warning")


def record_of(found: Basins, axes: Sequence[str]) -> dict[str, Any]:
    """Return the results as plain values for JSON."""
    return {
        "axes": list(axes),
        "cells": list(reversed(found.cells.shape)),
        "outcomes": [
            {"outcome": name, "share": float(share)}
            for name, share in zip(found.outcomes, found.shares, strict=True)
        ],
        "basin_entropy": _plain(found.entropy),
        "boundary_basin_entropy": _plain(found.boundary_entropy),
        "distances": found.distances.tolist(),
        "uncertain": found.uncertain.tolist(),
        "uncertainty_exponent": _plain(found.exponent),
        "boundary_dimension": found.boundary_dimension,
    }


def _plain(one: Estimate | None) -> dict[str, float | None] | None:
    return None if one is None else {"value": one.value, "error": one.error}


def _lines(name: str, mapped: Mapped) -> Iterator[str]:
    found = mapped.basins
    axes = " x ".join(
        f"{counted(len(one.different), 'value')} of {one.path}" for one in mapped.shown.coordinates
    )
    yield f"{name}: {axes}"
    if mapped.shown.held:
        yield f"  held      {mapped.shown.held}"
    listed = _LISTED if len(found.outcomes) > _LISTED + 1 else len(found.outcomes)
    for outcome, share in zip(found.outcomes[:listed], found.shares[:listed], strict=True):
        yield f"  {100.0 * share:6.2f} %  {outcome}"
    if listed < len(found.outcomes):
        rest = 100.0 * sum(found.shares[listed:])
        yield f"  {rest:6.2f} %  {len(found.outcomes) - listed} others, see basins.json"
    yield f"  basin entropy           {found.entropy}"
    if found.boundary_entropy is not None:
        fractal = "; above ln 2 = 0.6931, a sign of a fractal boundary" if found.fractal else ""
        yield f"  boundary basin entropy  {found.boundary_entropy}{fractal}"
    if found.exponent is not None:
        number = f"; from {len(found.distances)} distances"
        yield f"  uncertainty exponent    {found.exponent}{number}"
        yield f"  boundary dimension      {found.boundary_dimension:.4f}"


FORMS = (".png", ".pdf", ".svg")


@dataclass(frozen=True, kw_only=True)
class SectionCommand:
    """Draw the Poincaré section of a run or bifurcations of a grid."""

    folder: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="Folder of a run, or of a grid that kept its impacts."),
    ]
    columns: Annotated[
        list[str],
        repeatable(
            "--column",
            metavar="COLUMN",
            help="Column of the impacts; repeat it or write A,B for two. For a run the first is "
            "the horizontal axis, the second the vertical one; for a grid each has a panel over "
            "the axis with the most values [default: position and speed].",
        ),
    ]
    pair: Annotated[
        str | None,
        typer.Option(metavar="A-B", help="Show only impacts of these two bodies, such as 1-2."),
    ] = None
    transient: Annotated[
        int | None,
        typer.Option(
            min=0,
            metavar="N",
            help="Skip the first N impacts of each run [default: show all impacts of a run, but of "
            "a grid only the last 20 of each run that has more].",
        ),
    ] = None
    output: Annotated[
        Path | None,
        output_option(
            metavar="FILE",
            help="File of the figure: .png, .pdf or .svg [default: DIR-section.png].",
        ),
    ] = None
    width: Width = "double"
    as_json: Annotated[bool, json_option(help="Print the path of the file as JSON.")] = False

    def __post_init__(self) -> None:
        if self.bodies is None and self.pair is not None:
            text = f"--pair: found {self.pair!r}, expected two bodies, such as 1-2"
            raise typer.BadParameter(text)
        if self.target.suffix.lower() not in FORMS:
            found = f"-o: found {self.target}, expected a {listing(FORMS)} file"
            raise typer.BadParameter(found)

    @property
    def bodies(self) -> tuple[int, int] | None:
        """The two bodies whose impacts are shown, None for all bodies."""
        found = re.fullmatch(r"([1-9][0-9]*)-([1-9][0-9]*)", self.pair or "")
        return None if found is None else (int(found[1]), int(found[2]))

    @property
    def target(self) -> Path:
        """Path of the picture."""
        return self.output or beside(self.folder, "-section.png")

    def __call__(self) -> int:
        """Open, draw and write."""
        from vibro_cli.interface.grids import open_grid
        from vibro_cli.interface.runs import open_run
        from vibro_cli.storage.stored import is_grid

        columns = [name for some in self.columns for name in some.split(",")]
        shown: list[str] = []
        check_place(self.target)
        try:
            if is_grid(self.folder):
                grid = open_grid(self.folder)
                drawn = grid.section(columns, self.bodies, self.transient, self.width)
                shown = list(_runs_shown(grid, self.bodies, self.transient))
                _warn_of_unsolved(grid.stored)
            else:
                run = open_run(self.folder)
                drawn = run.section(columns, self.bodies, self.transient or 0, self.width)
        except ValueError as error:
            raise CommandError(f"vibro: {self.folder}: {error}") from error
        drawn.save(self.target)
        if self.as_json:
            print(json_text({"file": str(self.target)}))
        for words in shown:
            say(words)
        say(f"section in {self.target}")
        return DONE


def _runs_shown(grid: Grid, pair: tuple[int, int] | None, transient: int | None) -> Iterator[str]:
    """Yield the fixed values of the other axes, and how many runs are shown if not all are."""
    from vibro_cli.figures.over_axis import LAST

    if grid.shown is not None and grid.shown.held:
        yield f"held: {grid.shown.held}"
    impacts, least = grid.impacts_of_runs(pair), LAST if transient is None else transient
    shown = int((impacts > least).sum())
    if least == 0 or shown == len(impacts):
        return
    have = "has" if shown == 1 else "have"
    most = counted(least, "impact")
    more = f"{shown:,} of {len(impacts):,} runs {have} more than {most}"
    yield f"{more}; --transient 0 shows every impact"
