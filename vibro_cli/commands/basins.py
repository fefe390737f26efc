"""`vibro basins`: where and how the runs of a grid end, and how finely the outcomes are mixed."""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibro_cli.commands.shared.error_handling import DONE, CommandError
from vibro_cli.commands.shared.options import Task
from vibro_cli.commands.shared.terminal import json_text, say

if TYPE_CHECKING:
    from vibro_cli.analysis.basins import Basins, Estimate
    from vibro_cli.figures.grids.basins import Mapped
    from vibro_cli.storage.stored import StoredGrid

_STOPS = ("time", "collisions", "bounces")
_MANY = 0.05
"""A smaller share of runs that were stopped leaves the map as it is."""


def basins(
    grid: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder of a grid over one axis or two.")
    ],
    outcome: Annotated[
        list[str],
        typer.Option(
            metavar="COLUMN",
            help="Column of the summary that states the outcome, in words or whole numbers; "
            "repeatable: the outcome is their combination [default: end_cause and, on a "
            "trace of several pieces, arc_1, arc_2, …].",
            show_default=False,
        ),
    ] = [],  # noqa: B006 (typer copies it)
    output: Annotated[
        str | None,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Folder of results [default: DIR-basins]."
        ),
    ] = None,
    figures: Annotated[
        bool, typer.Option("--figures/--no-figures", help="Draw the map and the scaling.")
    ] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was found as JSON.")] = False,
) -> Task:
    """Map where the runs of a grid end. Basin entropy, uncertainty exponent."""
    target = Path(output) if output is not None else grid.with_name(f"{grid.name}-basins")
    return partial(_basins, grid, outcome, target, figures, as_json)


def _basins(
    source: Path, outcome: Sequence[str], target: Path, figures: bool, as_json: bool
) -> int:
    """Read, measure, draw, write and print."""
    from vibro_cli.analysis.basins import NoBasins
    from vibro_cli.figures.grids.basins import mapped_basins
    from vibro_cli.storage.files import FolderRefused, check_replaceable
    from vibro_cli.storage.folders import write_results
    from vibro_cli.storage.stored import NotAGrid, open_grid

    try:
        check_replaceable(target, "basins")
        stored = open_grid(source)
        found = mapped_basins(stored, outcome)
        record = record_of(found.basins, [one.path for one in found.shown.coordinates])
        drawn = _drawn(found) if figures else {}
        write_results("basins", target, drawn, record=record)
    except NoBasins as error:
        raise CommandError(f"vibro: {source}: no basins: {error}") from error
    except (NotAGrid, FolderRefused) as error:
        raise CommandError(f"vibro: {error}") from error
    if as_json:
        print(json_text(record))
    else:
        print("\n".join(_lines(stored.name, found)))
    _warn_of_stops(stored, found)
    say(f"{stored.name}: files in {target}")
    return DONE


def _warn_of_stops(stored: "StoredGrid", found: "Mapped") -> None:
    """Say so where the outcome of many runs is only what there was when they were stopped."""
    causes = stored.summary["end_cause"][found.shown.rows].tolist()
    share = sum(cause in _STOPS for cause in causes) / len(causes)
    if share > _MANY:
        say(
            f"{stored.name}: warning: {100.0 * share:.3g} % of the runs were stopped while the "
            "bodies still moved: their outcome is that of this instant, and a later stop may "
            "give another",
            "warning",
        )


def record_of(found: "Basins", axes: Sequence[str]) -> dict[str, Any]:
    """What was found as plain values."""
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


def _plain(one: "Estimate | None") -> dict[str, float | None] | None:
    return None if one is None else {"value": one.value, "error": one.error}


def _lines(name: str, mapped: "Mapped") -> Iterator[str]:
    """What was found as text."""
    found = mapped.basins
    axes = " x ".join(
        f"{len(one.different)} values of {one.path}" for one in mapped.shown.coordinates
    )
    yield f"{name}: {axes}"
    if mapped.shown.held:
        yield f"  held      {mapped.shown.held}"
    for outcome, share in zip(found.outcomes, found.shares, strict=True):
        yield f"  {100.0 * share:6.2f} %  {outcome}"
    yield f"  basin entropy           {_shown(found.entropy)}"
    if found.boundary_entropy is not None:
        fractal = "; above ln 2 = 0.6931, a sign of a fractal boundary" if found.fractal else ""
        yield f"  boundary basin entropy  {_shown(found.boundary_entropy)}{fractal}"
    if found.exponent is not None:
        number = f"; from {len(found.distances)} distances"
        yield f"  uncertainty exponent    {_shown(found.exponent)}{number}"
        yield f"  boundary dimension      {found.boundary_dimension:.4f}"


def _shown(one: "Estimate") -> str:
    return f"{one.value:.4f}" if one.error is None else f"{one.value:.4f} ± {one.error:.4f}"


def _drawn(found: "Mapped") -> dict[str, bytes]:
    """The figures that there are, each in both forms."""
    from vibro_cli.figures.style import render

    drawn = {"basins": found.map("double"), "uncertainty": found.scaling("single")}
    return {
        f"{name}.{form}": render(figure, form)
        for name, figure in drawn.items()
        if figure is not None
        for form in ("png", "pdf")
    }
