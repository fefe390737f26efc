"""`vibro section`: impacts in a plane, a Poincaré section of a run or a bifurcation diagram."""

import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from vibro_cli.commands.shared.error_handling import DONE, CommandError
from vibro_cli.commands.shared.options import Task
from vibro_cli.commands.shared.terminal import json_text, say

if TYPE_CHECKING:
    from vibro_cli.interface.grids import Grid

FORMS = (".png", ".pdf", ".svg")


def section(
    folder: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="Folder of a run, or of a grid that kept its impacts."),
    ],
    columns: Annotated[
        list[str],
        typer.Option(
            "--column",
            metavar="COLUMN",
            help="A column of the impacts; may be given twice, or as two with a comma. Of a run "
            "the first stands along and the second up; of a grid each has a panel over the axis "
            "with the most values [default: place and speed].",
            show_default=False,
        ),
    ] = [],  # noqa: B006 (typer copies it)
    pair: Annotated[
        str | None,
        typer.Option(metavar="A-B", help="Impacts of these bodies only, such as 1-2."),
    ] = None,
    transient: Annotated[
        int | None,
        typer.Option(
            min=0,
            metavar="N",
            help="Impacts left out at the beginning of each run [default: a run shows every "
            "impact, a grid the last 20 of each run that has more].",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Picture: .png, .pdf or .svg [default: DIR-section.png].",
        ),
    ] = None,
    width: Annotated[
        Literal["single", "double"],
        typer.Option(help="One column of a journal (85 mm) or two (170 mm)."),
    ] = "double",
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the file written as JSON.")
    ] = False,
) -> Task:
    """Draw impacts: Poincaré section of a run, bifurcations of a grid."""
    found = None if pair is None else re.fullmatch(r"([1-9][0-9]*)-([1-9][0-9]*)", pair)
    if pair is not None and found is None:
        raise typer.BadParameter(f"--pair: found {pair!r}, expected two bodies, such as 1-2")
    bodies = None if found is None else (int(found[1]), int(found[2]))
    names = [name for some in columns for name in some.split(",")]
    target = folder.with_name(f"{folder.name}-section.png") if output is None else output
    if target.suffix.lower() not in FORMS:
        raise typer.BadParameter(f"-o: found {target}, expected a file {', '.join(FORMS)}")
    return partial(_section, folder, names, bodies, transient, target, width, as_json)


def _section(
    folder: Path,
    columns: Sequence[str],
    pair: tuple[int, int] | None,
    transient: int | None,
    target: Path,
    width: str,
    as_json: bool,
) -> int:
    """Open, draw and write."""
    from vibro_cli.interface.grids import open_grid
    from vibro_cli.interface.runs import open_run
    from vibro_cli.storage.folders import NotContinuable
    from vibro_cli.storage.stored import NotAGrid, is_grid

    try:
        shown = ""
        if is_grid(folder):
            grid = open_grid(folder)
            drawn = grid.section(columns, pair, transient, width)
            shown = _runs_shown(grid, pair, transient)
        else:
            drawn = open_run(folder).section(columns, pair, transient or 0, width)
    except (NotAGrid, NotContinuable) as error:  # they name the folder
        raise CommandError(f"vibro: {error}") from error
    except ValueError as error:
        raise CommandError(f"vibro: {folder}: {error}") from error
    drawn.save(target)
    if as_json:
        print(json_text({"file": str(target)}))
    if shown:
        say(shown)
    say(f"section in {target}")
    return DONE


def _runs_shown(grid: "Grid", pair: tuple[int, int] | None, transient: int | None) -> str:
    """How many runs of a grid are shown, empty where all of them are."""
    from vibro_cli.figures.grids.bifurcation import LAST

    impacts, least = grid.impacts_of_runs(pair), LAST if transient is None else transient
    shown = int((impacts > least).sum())
    if least == 0 or shown == len(impacts):
        return ""
    have = "has" if shown == 1 else "have"
    more = f"{shown:,} of {len(impacts):,} runs {have} more than {least} impacts"
    return f"{more}; --transient 0 shows every impact"
