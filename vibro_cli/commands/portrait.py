"""`vibro portrait`: phase portrait and singular points, without solving collisions."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from vibro_cli.commands.boundary import DONE, CommandError, say
from vibro_cli.commands.options import Overrides, Quiet, Task
from vibro_cli.commands.streams import json_text

if TYPE_CHECKING:
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
    wishes = _Wishes(scenario, overrides, vary, output, width, figures, as_json, quiet)
    if vary is not None:
        _parsed(vary)  # a wrong usage is told before anything is read
    return partial(_portray, wishes)


def _parsed(vary: str) -> tuple[str, float, float, int]:
    """Path, first and last value and number of members of `--vary`."""
    path, _, values = vary.rpartition("=")
    try:
        low, high, number = values.split(":")
        parsed = (path.strip(), float(low), float(high), int(number))
    except ValueError:
        parsed = ("", 0.0, 0.0, 0)
    if not parsed[0] or not parsed[1] < parsed[2] < float("inf") or not 2 <= parsed[3] <= 1000:
        raise typer.BadParameter(
            f"--vary: found {vary!r}, expected PATH=LOW:HIGH:N with LOW < HIGH and N from 2 to 1000"
        )
    return parsed


def _portray(wishes: _Wishes) -> int:
    """Analyse, draw, write and print."""
    from vibro_cli.commands.loading import load_all
    from vibro_cli.storage.portraits import check_portrait_folder, write_portraits
    from vibro_cli.storage.provenance import FolderRefused

    ((scenario, system),) = load_all([wishes.source], wishes.overrides)
    if system.turning is not None:
        raise CommandError(
            f"{scenario.name}: the portrait of a trace that turns about a vertical is not available"
        )
    if wishes.vary is not None and wishes.source == "-":
        raise CommandError("vibro: --vary reads the scenario several times; expected a file, not -")
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
        print("\n".join(_lines(found)))
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
    if wishes.vary is not None:
        family, more = _family(wishes, *_parsed(wishes.vary))
        found["family"] = family
        drawn |= more
    return found, drawn


def _drawn(portraits: "Sequence[Portrait]", width: str) -> dict[str, bytes]:
    """The portraits; bodies of equal radius and inertia share theirs."""
    from vibro_cli.figures.output import render
    from vibro_cli.figures.structure import structure

    groups: dict[tuple[float, float], list[int]] = {}
    for ball, one in enumerate(portraits, 1):
        body = one.landscape.body
        groups.setdefault((body.radius, body.kappa), []).append(ball)
    files = {}
    for balls in groups.values():
        index = ",".join(map(str, balls))
        figure = structure(portraits[balls[0] - 1], width, index if len(groups) > 1 else "")
        for form in _FORMS:
            files[f"portrait_{index.replace(',', '_')}.{form}"] = render(figure, form)
    return files


def _family(
    wishes: _Wishes, path: str, low: float, high: float, number: int
) -> tuple[dict[str, Any], dict[str, bytes]]:
    """The types of a family of scenarios, where they change, and the figure of its portraits."""
    from vibro_cli.analysis.family import IMPOSSIBLE, changes

    ball = _ball_of(path)
    values = [low + (high - low) * step / (number - 1) for step in range(number)]
    members = {value: _member(wishes, f"{path}={value!r}", ball) for value in values}

    def type_of(value: float) -> str:
        one = members[value] if value in members else _member(wishes, f"{path}={value!r}", ball)
        return IMPOSSIBLE if one is None else one.type

    found = changes(type_of, values)
    record = {
        "path": path,
        "ball": ball,
        "members": [{"value": value, "type": type_of(value)} for value in values],
        "changes": [vars(change) for change in found],
    }
    drawn: dict[str, bytes] = {}
    shown = [(f"{path} = {value:.6g}", one) for value, one in members.items() if one is not None]
    if wishes.figures and shown:
        from vibro_cli.figures.family import family
        from vibro_cli.figures.output import render

        figure = family(shown, wishes.width)
        drawn = {f"family.{form}": render(figure, form) for form in _FORMS}
    return record, drawn


def _ball_of(path: str) -> int:
    """The body whose portrait a parameter changes: that of `balls[i]`, else the first."""
    number = path.partition("balls[")[2].partition("]")[0]
    return int(number) if number.isdecimal() else 1


def _member(wishes: _Wishes, override: str, ball: int) -> "Portrait | None":
    """The portrait with one more override; None where the scenario is not possible."""
    from vibro_cli.analysis.landscape import Landscape
    from vibro_cli.analysis.portrait_type import portrait_of
    from vibro_cli.build import build_system
    from vibro_cli.scenario import ScenarioError, load_scenario

    try:
        system = build_system(load_scenario(wishes.source, [*wishes.overrides, override]))
    except ScenarioError:
        return None
    return portrait_of(Landscape.of(system, ball))


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
        yield from _family_lines(found["family"])


def _family_lines(family: dict[str, Any]) -> Iterator[str]:
    yield f"{family['path']}, portrait of ball {family['ball']}:"
    for member in family["members"]:
        yield f"  {member['value']:<12.6g} {member['type']}"
    for change in family["changes"]:
        yield f"  changes at {change['high']!r}: {change['before']} -> {change['after']}"
