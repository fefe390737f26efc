"""`vibro section`: impacts in a plane, a Poincaré section of a run or a bifurcation diagram."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from vibro_cli.commands.shared.error_handling import DONE, CommandError, say
from vibro_cli.commands.shared.terminal import json_text

if TYPE_CHECKING:
    from vibro_cli.interface.grids import Grid

FORMS = (".png", ".pdf", ".svg")


@dataclass(frozen=True, kw_only=True)
class SectionCommand:
    """Draw impacts: Poincaré section of a run, bifurcations of a grid."""

    folder: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="Folder of a run, or of a grid that kept its impacts."),
    ]
    columns: Annotated[
        list[str],
        typer.Option(
            "--column",
            default_factory=list,
            metavar="COLUMN",
            help="A column of the impacts; may be given twice, or as two with a comma. Of a run "
            "the first stands along and the second up; of a grid each has a panel over the axis "
            "with the most values [default: place and speed].",
            show_default=False,
        ),
    ]
    pair: Annotated[
        str | None,
        typer.Option(metavar="A-B", help="Impacts of these bodies only, such as 1-2."),
    ] = None
    transient: Annotated[
        int | None,
        typer.Option(
            min=0,
            metavar="N",
            help="Impacts left out at the beginning of each run [default: a run shows every "
            "impact, a grid the last 20 of each run that has more].",
        ),
    ] = None
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Picture: .png, .pdf or .svg [default: DIR-section.png].",
        ),
    ] = None
    width: Annotated[
        Literal["single", "double"],
        typer.Option(help="One column of a journal (85 mm) or two (170 mm)."),
    ] = "double"
    as_json: Annotated[bool, typer.Option("--json", help="Print the file written as JSON.")] = False

    def __post_init__(self) -> None:
        """Tell a wrong usage before anything is read."""
        if self.bodies is None and self.pair is not None:
            text = f"--pair: found {self.pair!r}, expected two bodies, such as 1-2"
            raise typer.BadParameter(text)
        if self.target.suffix.lower() not in FORMS:
            found = f"-o: found {self.target}, expected a file {', '.join(FORMS)}"
            raise typer.BadParameter(found)

    @property
    def bodies(self) -> tuple[int, int] | None:
        """The bodies whose impacts are shown, None for all."""
        found = re.fullmatch(r"([1-9][0-9]*)-([1-9][0-9]*)", self.pair or "")
        return None if found is None else (int(found[1]), int(found[2]))

    @property
    def target(self) -> Path:
        """The picture."""
        return self.output or self.folder.with_name(f"{self.folder.name}-section.png")

    def __call__(self) -> int:
        """Open, draw and write."""
        from vibro_cli.interface.grids import open_grid
        from vibro_cli.interface.runs import open_run
        from vibro_cli.storage.stored import is_grid

        columns = [name for some in self.columns for name in some.split(",")]
        shown = ""
        try:
            if is_grid(self.folder):
                grid = open_grid(self.folder)
                drawn = grid.section(columns, self.bodies, self.transient, self.width)
                shown = _runs_shown(grid, self.bodies, self.transient)
            else:
                run = open_run(self.folder)
                drawn = run.section(columns, self.bodies, self.transient or 0, self.width)
        except ValueError as error:
            raise CommandError(f"vibro: {self.folder}: {error}") from error
        drawn.save(self.target)
        if self.as_json:
            print(json_text({"file": str(self.target)}))
        if shown:
            say(shown)
        say(f"section in {self.target}")
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
