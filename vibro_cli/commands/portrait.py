"""`vibro portrait`: phase portraits and singular points, without solving collisions.

`--vary` draws a family of portraits over one number; `--compare` overlays a few values of any key.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibro_cli.commands.shared.error_handling import DONE, CommandError
from vibro_cli.commands.shared.options import (
    Overrides,
    Width,
    json_option,
    output_option,
    scenario_argument,
)
from vibro_cli.commands.shared.terminal import print_found, progress_shown, say

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vibro_cli.scenario.base import AnyScenario
    from vibro_cli.systems.contract import System

MOST_COMPARED = 6


def ball_of(path: str) -> int:
    """Return the number of the body that a path changes: i of `balls[i]`, else 1."""
    number = path.partition("balls[")[2].partition("]")[0]
    return int(number) if number.isdecimal() else 1


def parsed_range(vary: str) -> tuple[str, str, str, int]:
    """Return the path, first and last values as written, and number of members of `--vary`."""
    path, _, values = vary.rpartition("=")
    try:
        first, last, number = (text.strip() for text in values.split(":"))
        parsed = (path.strip(), first, last, int(number))
    except ValueError:
        parsed = ("", "", "", 0)
    of_digits = all(text.lstrip("+-.")[:1].isdigit() for text in parsed[1:3])
    if not parsed[0] or not of_digits or parsed[1] == parsed[2] or not 2 <= parsed[3] <= 1000:
        raise typer.BadParameter(
            f"--vary: found {vary!r}, expected PATH=FROM:TO:N with two different numbers (SI units "
            "and radians, or with their units) and N from 2 to 1000"
        )
    return parsed


def parsed_values(compare: str) -> tuple[str, list[str]]:
    """Return the path and values of `--compare`."""
    path, _, values = compare.rpartition("=")
    found = [value.strip() for value in values.split(",")]
    if (
        not path.strip()
        or not all(found)
        or not 2 <= len(set(found)) == len(found) <= MOST_COMPARED
    ):
        raise typer.BadParameter(
            f"--compare: found {compare!r}, expected PATH=A,B,… with 2 to {MOST_COMPARED} "
            "different values"
        )
    return path.strip(), found


Figures = dict[str, "Figure"]
"""Figures by the stems of their files."""


def varied(options: "PortraitCommand", vary: str, kind: "System") -> tuple[dict[str, Any], Figures]:
    """Return the types of a family and where they change, and the figure of its portraits."""
    from vibro_cli.analysis.singular import IMPOSSIBLE, changes

    path, *ends, number = parsed_range(vary)
    ball, portraits = ball_of(path), kind.part("portrait")
    (first, last), unit = _numbers(path, ends, kind.model)
    values = [first + (last - first) * step / (number - 1) for step in range(number)]
    found = {value: _member(options, path, value) for value in values}
    reasons = {value: one for value, one in found.items() if isinstance(one, str)}
    members = {value: one for value, one in found.items() if value not in reasons}
    if not members:
        raise CommandError(f"vibro: --vary: no portrait is possible: {reasons[values[0]]}")

    @cache
    def type_of(value: float) -> str:
        one = found[value] if value in found else _member(options, path, value)
        return IMPOSSIBLE if isinstance(one, str) else portraits.family_type(one, ball)

    record = {
        "path": path,
        "unit": unit,
        "ball": ball,
        "members": [
            {"value": value, "type": type_of(value)}
            | ({"reason": reasons[value]} if value in reasons else {})
            for value in values
        ],
        "changes": [vars(change) for change in changes(type_of, sorted(values))],
    }
    if not options.figures:
        return record, {}
    from vibro_cli.figures.maps import words_of

    titled = [
        (f"{words_of(path)} = {f'{value:.6g} {unit}'.rstrip()}", one)
        for value, one in members.items()
    ]
    return record, {"family": portraits.family_figure(titled, ball, options.width)}


def _numbers(path: str, texts: Sequence[str], model: Any) -> tuple[list[float], str]:
    """Return the values (SI) of numbers written for a path, with or without units; their unit."""
    from vibro_cli.commands.shared.loading import in_si_units
    from vibro_cli.grids.axes import kind_of
    from vibro_cli.scenario.loading import path_of
    from vibro_cli.scenario.problems import Fault
    from vibro_cli.scenario.quantities import Quantity

    try:
        kind = kind_of(path_of(path), model)
    except Fault as error:
        raise CommandError(f"vibro: --vary: {error}") from error
    if not isinstance(kind, Quantity):
        expected = "a number of the scenario that need not be whole"
        raise CommandError(f"vibro: --vary: found {path}, expected {expected}")
    return in_si_units(f"--vary: {path}", texts, kind), kind.unit


def _with(options: "PortraitCommand", path: str, value: str) -> Any:
    """Build the system with one more override; raise `ScenarioError` if it is invalid."""
    from vibro_cli.assemble import build_any
    from vibro_cli.scenario.loading import load_any

    return build_any(load_any(options.scenario, [*options.overrides, f"{path}={value}"]))


def _member(options: "PortraitCommand", path: str, value: float) -> Any:
    """Return the system at one value of a family, or a text that says why it is invalid."""
    from vibro_cli.scenario.problems import ScenarioError

    try:
        return _with(options, path, repr(value))
    except ScenarioError as error:
        first = error.problems[0]
        return f"{first.path}: found {first.found}, expected {first.expected}"


def compared(options: "PortraitCommand", compare: str) -> tuple[dict[str, Any], Figures]:
    """Return the singular points of the compared members, and one figure of all of them."""
    from vibro_cli.analysis.levels import Landscape
    from vibro_cli.analysis.singular import as_record, portrait_of
    from vibro_cli.scenario.problems import ScenarioError

    path, values = parsed_values(compare)
    ball = ball_of(path)
    try:
        systems = {value: _with(options, path, value) for value in values}
    except ScenarioError as error:
        raise CommandError(f"vibro: --compare: {error}") from error
    members = {value: portrait_of(Landscape.of(one, ball)) for value, one in systems.items()}
    traces = [one.landscape.trace for one in members.values()]
    if any(trace != traces[0] for trace in traces):
        raise CommandError(f"vibro: --compare: {path} changes the trace; expected the same trace")
    record = {
        "path": path,
        "ball": ball,
        "members": [{"value": value, **as_record(one)} for value, one in members.items()],
    }
    if not options.figures:
        return record, {}
    from vibro_cli.figures.portraits.trace_phase_plane import comparison

    return record, {"comparison": comparison(list(members.items()), options.width)}


def family_lines(family: dict[str, Any]) -> Iterator[str]:
    """Yield the types of a family as lines of text."""
    unit = f" [{family['unit']}]" if family["unit"] else ""
    yield f"{family['path']}{unit}, portrait of ball {family['ball']}:"
    for member in family["members"]:
        reason = f" ({member['reason']})" if "reason" in member else ""
        yield f"  {member['value']:<12.6g} {member['type']}{reason}"
    for change in family["changes"]:
        yield f"  changes at {change['high']!r}: {change['before']} -> {change['after']}"


def comparison_lines(comparison: dict[str, Any]) -> Iterator[str]:
    """Yield the compared members as lines of text: κ, and height and natural rate ω of points."""
    yield f"{comparison['path']}, portrait of ball {comparison['ball']}:"
    for member in comparison["members"]:
        yield f"  {member['value']}: κ = {member['kappa']:.6g}; {member['type']}"
        for point in member["points"]:
            rate = point["natural_rate"]
            own = "" if rate is None else f", ω = {rate:.6g} 1/s"
            yield f"    {point['name']}: E/(m g) = {point['height']:.6g} m{own}"


@dataclass(frozen=True, kw_only=True)
class PortraitCommand:
    """Draw phase portraits without a run. Print each body's singular points and portrait type."""

    scenario: Annotated[str, scenario_argument(help="Scenario file, or - for standard input.")]
    overrides: Overrides
    vary: Annotated[
        str | None,
        typer.Option(
            metavar="PATH=FROM:TO:N",
            help="Draw a family of N portraits and find where their type changes, e.g. --vary "
            "'balls[1].radius=0.05:0.3:6' (SI units, or with units: 5 cm:30 cm:6).",
        ),
    ] = None
    compare: Annotated[
        str | None,
        typer.Option(
            metavar="PATH=A,B,…",
            help="Overlay a few portraits, e.g. --compare 'balls[1].body=particle,ball'.",
        ),
    ] = None
    output: Annotated[
        str | None,
        output_option(
            metavar="DIR", help="Folder for the results [default: outputs/<name>-portrait]."
        ),
    ] = None
    width: Width = "double"
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw the portraits.")] = (
        True
    )
    as_json: Annotated[bool, json_option(help="Print the table of singular points as JSON.")] = (
        False
    )

    def __post_init__(self) -> None:
        if self.vary is not None:
            parsed_range(self.vary)
        if self.compare is not None:
            parsed_values(self.compare)

    def __call__(self) -> int:
        """Analyse, draw, write and print."""
        from vibro_cli.commands.shared.loading import load_any
        from vibro_cli.storage.files import check_replaceable
        from vibro_cli.storage.folders import write_results

        scenario, system = load_any(self.scenario, self.overrides)
        if (self.vary or self.compare) and self.scenario == "-":
            raise CommandError(
                "vibro: --vary and --compare read the scenario several times; expected a file, "
                "not -"
            )
        folder = None
        if self.figures or self.output is not None:
            folder = Path(self.output or Path("outputs") / f"{scenario.name}-portrait")
            check_replaceable(folder, "portrait")
        with progress_shown():
            found, drawn = _analysed(self, scenario, system)
        if folder is not None:
            write_results("portrait", folder, drawn, scenario, found)
        print_found(found, _lines(scenario, found), self.as_json)
        if folder is not None:
            say(f"{scenario.name}: files in {folder}")
        return DONE


def _analysed(
    options: PortraitCommand, scenario: "AnyScenario", system: Any
) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Return the singular points of each body, and the files of the figures."""
    from vibro_cli.errors import NoPortrait
    from vibro_cli.interface import pictures
    from vibro_cli.systems import system_named

    kind = system_named(scenario.system)
    if options.compare and not kind.has_comparisons:
        capable = _systems_with(lambda one: one.has_comparisons)
        raise CommandError(f"vibro: {scenario.name}: --compare is for {capable} only")
    if options.vary and not kind.has_families:
        capable = _systems_with(lambda one: one.has_families)
        raise CommandError(f"vibro: {scenario.name}: --vary is for {capable} only")
    try:
        drawn = range(1, len(system.bodies) + 1) if options.figures else ()
        table, figures = kind.portrait(system, options.width, drawn)
    except NoPortrait as error:
        raise CommandError(f"vibro: {scenario.name}: {error}") from error
    found: dict[str, Any] = {"name": scenario.name, **table}
    if options.vary is not None:
        found["family"], more = varied(options, options.vary, kind)
        figures |= more
    if options.compare is not None:
        found["comparison"], more = compared(options, options.compare)
        figures |= more
    return found, pictures(figures)


def _systems_with(capable: "Callable[[System], bool]") -> str:
    """Return the names of the systems that `capable` accepts, joined by "and"."""
    from vibro_cli.systems import PLURALS, system_named

    return " and ".join(word for name, word in PLURALS.items() if capable(system_named(name)))


def _lines(scenario: "AnyScenario", found: dict[str, Any]) -> Iterator[str]:
    from vibro_cli.systems import system_named

    yield from system_named(scenario.system).portrait_lines(found)
    if "family" in found:
        yield from family_lines(found["family"])
    if "comparison" in found:
        yield from comparison_lines(found["comparison"])
