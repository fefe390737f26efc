"""`vibro portrait`: phase portrait and singular points, without solving collisions."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from vibro_cli.commands.boundary import DONE, CommandError, say
from vibro_cli.commands.families import (
    Source,
    compared,
    comparison_lines,
    family_lines,
    parsed_range,
    parsed_values,
    varied,
    varied_systems,
)
from vibro_cli.commands.options import Overrides, Quiet, Task
from vibro_cli.commands.streams import json_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vibro_cli.scenario.base import AnyScenario

_FORMS = ("png", "pdf")


@dataclass(frozen=True)
class _Wishes:
    """What was asked of `vibro portrait`."""

    source: str
    overrides: Sequence[str]
    vary: str | None
    compare: str | None
    output: str | None
    width: str
    figures: bool
    as_json: bool
    quiet: bool


def portrait(
    scenario: Annotated[
        str, typer.Argument(metavar="SCENARIO", help="Scenario file, or - for standard input.")
    ],
    overrides: Overrides = [],  # noqa: B006 (typer copies it)
    vary: Annotated[
        str | None,
        typer.Option(
            metavar="PATH=FROM:TO:N",
            help="A family of N portraits, and where their type changes, e.g. --vary "
            "balls[1].radius=0.05:0.3:6 (SI units, or with units: 5 cm:30 cm:6).",
        ),
    ] = None,
    compare: Annotated[
        str | None,
        typer.Option(
            metavar="PATH=A,B,…",
            help="A few portraits one over the other, e.g. --compare balls[1].body=particle,ball.",
        ),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Folder [default: outputs/<name>-portrait]."
        ),
    ] = None,
    width: Annotated[
        Literal["single", "double"], typer.Option(help="One column (85 mm) or two (170 mm).")
    ] = "double",
    figures: Annotated[
        bool, typer.Option("--figures/--no-figures", help="Draw the portraits.")
    ] = True,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the table of singular points as JSON.")
    ] = False,
    quiet: Quiet = False,
) -> Task:
    """Draw phase portraits without a run. Singular points, separatrices and type of each body."""
    wishes = _Wishes(scenario, overrides, vary, compare, output, width, figures, as_json, quiet)
    if vary is not None:
        parsed_range(vary)  # a wrong usage is told before anything is read
    if compare is not None:
        parsed_values(compare)
    return partial(_portray, wishes)


def _portray(wishes: _Wishes) -> int:
    """Analyse, draw, write and print."""
    from vibro_cli.commands.loading import load_any
    from vibro_cli.storage.portraits import check_portrait_folder, write_portraits
    from vibro_cli.storage.provenance import FolderRefused

    scenario, system = load_any(wishes.source, wishes.overrides)
    if (wishes.vary or wishes.compare) and wishes.source == "-":
        raise CommandError(
            "vibro: --vary and --compare read the scenario several times; expected a file, not -"
        )
    folder = None
    if wishes.figures or wishes.output is not None:
        folder = Path(wishes.output or Path("outputs") / f"{scenario.name}-portrait")
    try:
        if folder is not None:
            check_portrait_folder(folder)
        found, drawn = _analysed(wishes, scenario, system)
        if folder is not None:
            write_portraits(scenario, found, folder, drawn)
    except FolderRefused as error:
        raise CommandError(f"vibro: {error}") from error
    if wishes.as_json:
        print(json_text(found))
    elif not wishes.quiet:
        print("\n".join(_lines(scenario, found)))
    if folder is not None and not wishes.quiet:
        say(f"{scenario.name}: files in {folder}")
    return DONE


def _analysed(
    wishes: _Wishes, scenario: "AnyScenario", system: Any
) -> tuple[dict[str, Any], dict[str, bytes]]:
    """The singular points of each body, and the figures' files."""
    from vibro_cli.systems import system_named
    from vibro_cli.systems.contract import NoPortrait

    kind = system_named(scenario.system)
    if wishes.compare and not kind.has_families:
        raise CommandError(f"vibro: {scenario.name}: --compare is of traces")
    if wishes.vary and not kind.has_families and kind.family_type(system, 1) is None:
        raise CommandError(f"vibro: {scenario.name}: --vary is of traces and springs")
    try:
        table, figures = kind.portrait(system, wishes.width, wishes.figures)
    except NoPortrait as error:
        raise CommandError(f"vibro: {scenario.name}: {error}") from error
    found: dict[str, Any] = {"name": scenario.name, **table}
    drawn = {
        name: file for stem, one in figures.items() for name, file in _files(stem, one).items()
    }
    source = Source(wishes.source, tuple(wishes.overrides), wishes.width, kind.model)
    draw = _files if wishes.figures else None
    if wishes.vary is not None:
        of_kind = varied if kind.has_families else partial(varied_systems, kind)
        found["family"], more = of_kind(source, wishes.vary, draw)
        drawn |= more
    if wishes.compare is not None:
        found["comparison"], more = compared(source, wishes.compare, draw)
        drawn |= more
    return found, drawn


def _files(stem: str, figure: "Figure") -> dict[str, bytes]:
    """A figure in all forms."""
    from vibro_cli.figures.output import render

    return {f"{stem}.{form}": render(figure, form) for form in _FORMS}


def _lines(scenario: "AnyScenario", found: dict[str, Any]) -> Iterator[str]:
    """The table as text."""
    from vibro_cli.systems import system_named

    yield from system_named(scenario.system).portrait_lines(found)
    if "family" in found:
        yield from family_lines(found["family"])
    if "comparison" in found:
        yield from comparison_lines(found["comparison"])
