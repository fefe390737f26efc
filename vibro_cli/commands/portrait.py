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
)
from vibro_cli.commands.options import Overrides, Quiet, Task
from vibro_cli.commands.portrait_systems import lines_of, portrait_of_system
from vibro_cli.commands.streams import json_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vibro_cli.analysis.portrait_type import Portrait
    from vibro_cli.mechanics.system import System
    from vibro_cli.scenario import Scenario

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
            metavar="PATH=LOW:HIGH:N",
            help="A family of N portraits, and where their type changes, "
            "e.g. --vary balls[1].radius=0.05:0.3:6 (SI units, radians).",
        ),
    ] = None,
    compare: Annotated[
        str | None,
        typer.Option(
            metavar="PATH=A,B,…",
            help="A few portraits one over the other, e.g. "
            "--compare balls[1].body=particle,disk,ball.",
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
    """Phase portrait of each body on the whole trace: singular points, separatrices, their type."""
    wishes = _Wishes(scenario, overrides, vary, compare, output, width, figures, as_json, quiet)
    if vary is not None:
        parsed_range(vary)  # a wrong usage is told before anything is read
    if compare is not None:
        parsed_values(compare)
    return partial(_portray, wishes)


def _portray(wishes: _Wishes) -> int:
    """Analyse, draw, write and print."""
    from vibro_cli.commands.loading import load_any
    from vibro_cli.mechanics.system import System
    from vibro_cli.scenario import Scenario
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
        if isinstance(scenario, Scenario) and isinstance(system, System):
            found, drawn = _analysed(wishes, scenario, system)
            lines = _lines
        else:
            found, drawn = _of_other_system(wishes, scenario.name, system)
            lines = lines_of
        if folder is not None:
            write_portraits(scenario, found, folder, drawn)
    except FolderRefused as error:
        raise CommandError(f"vibro: {error}") from error
    if wishes.as_json:
        print(json_text(found))
    elif not wishes.quiet:
        print("\n".join(lines(found)))
    if folder is not None and not wishes.quiet:
        say(f"{scenario.name}: files in {folder}")
    return DONE


def _analysed(
    wishes: _Wishes, scenario: "Scenario", system: "System"
) -> tuple[dict[str, Any], dict[str, bytes]]:
    """The table of the singular points of each body, and the figures' files."""
    from vibro_cli.analysis.landscape import Landscape
    from vibro_cli.analysis.portrait_type import as_record, portrait_of

    portraits = [portrait_of(Landscape.of(system, n + 1)) for n in range(len(system.bodies))]
    bodies = [{"ball": n, **as_record(one)} for n, one in enumerate(portraits, 1)]
    found: dict[str, Any] = {"name": scenario.name, "bodies": bodies}
    drawn = _drawn(portraits, wishes.width) if wishes.figures else {}
    source = Source(wishes.source, tuple(wishes.overrides), wishes.width)
    draw = _files if wishes.figures else None
    if wishes.vary is not None:
        found["family"], more = varied(source, wishes.vary, draw)
        drawn |= more
    if wishes.compare is not None:
        found["comparison"], more = compared(source, wishes.compare, draw)
        drawn |= more
    return found, drawn


def _of_other_system(
    wishes: _Wishes, name: str, system: Any
) -> tuple[dict[str, Any], dict[str, bytes]]:
    """The singular points of a system other than the trace, and the figures' files."""
    if wishes.vary or wishes.compare:
        raise CommandError(f"vibro: {name}: --vary and --compare are of traces")
    found, figures = portrait_of_system(name, system, wishes.width, wishes.figures)
    files: dict[str, bytes] = {}
    for stem, figure in figures.items():
        files |= _files(stem, figure)
    return found, files


def _files(stem: str, figure: "Figure") -> dict[str, bytes]:
    """A figure in all forms."""
    from vibro_cli.figures.output import render

    return {f"{stem}.{form}": render(figure, form) for form in _FORMS}


def _drawn(portraits: "Sequence[Portrait]", width: str) -> dict[str, bytes]:
    """The portraits; bodies of equal radius and inertia share theirs."""
    from vibro_cli.figures.structure import structure

    groups: dict[tuple[float, float], list[int]] = {}
    for ball, one in enumerate(portraits, 1):
        body = one.landscape.body
        groups.setdefault((body.radius, body.kappa), []).append(ball)
    files: dict[str, bytes] = {}
    for balls in groups.values():
        index = ",".join(map(str, balls))
        figure = structure(portraits[balls[0] - 1], width, index if len(groups) > 1 else "")
        files |= _files(f"portrait_{index.replace(',', '_')}", figure)
    return files


def _lines(found: dict[str, Any]) -> Iterator[str]:
    """The table as text."""
    for body in found["bodies"]:
        yield f"ball {body['ball']}: {body['body']}, r = {body['radius']:g} m: {body['type']}"
        yield "  point  kind        arc  angle [rad]     s [m]      E [J]   E/(m g) [m]"
        for point in body["points"]:
            angle = "         -" if point["angle"] is None else f"{point['angle']:10.6f}"
            yield (
                f"  {point['name']:5}  {point['kind']:10}  {point['arc']:3}  {angle}  "
                f"{point['s']:9.6f}  {point['energy']:9.6g}  {point['height']:9.6g}"
            )
        for trigger in body["triggers"]:
            yield f"  {trigger['points']}: {trigger['orbit']}; {trigger['condition']}"
    if "family" in found:
        yield from family_lines(found["family"])
    if "comparison" in found:
        yield from comparison_lines(found["comparison"])
