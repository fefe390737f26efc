"""`vibro orbit`: periodic orbits, their multipliers, and how they change with a number."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from vibro_cli.commands.shared.error_handling import DONE, CommandError
from vibro_cli.commands.shared.options import Task, scenario_keys
from vibro_cli.commands.shared.terminal import json_text, say

if TYPE_CHECKING:
    from vibro_cli.analysis.orbit_branch import Branch
    from vibro_cli.analysis.orbits import Orbit
    from vibro_cli.scenario.models import Scenario


@dataclass(frozen=True)
class _Wishes:
    """What was asked of `vibro orbit`."""

    source: str
    overrides: Sequence[str]
    impacts: int | None
    period: float | None
    vary: str | None
    output: str | None
    figures: bool
    as_json: bool


def orbit(
    scenario: Annotated[
        str, typer.Argument(metavar="SCENARIO", help="Scenario file, or - for standard input.")
    ],
    overrides: Annotated[
        list[str],
        typer.Option(
            "--set",
            metavar="PATH=VALUE",
            help="Override a value of the scenario, e.g. --set balls[2].mass=1.2; repeatable.",
            show_default=False,
            autocompletion=scenario_keys,
        ),
    ] = [],  # noqa: B006 (typer copies it)
    impacts: Annotated[
        int | None,
        typer.Option(min=1, help="Impacts of one period [default: those of the nearest return]."),
    ] = None,
    period: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="A guess of the period, instead.")
    ] = None,
    vary: Annotated[
        str | None,
        typer.Option(
            metavar="PATH=LOW:HIGH",
            help="Follow the orbit over a number of the scenario (SI units, radians), at constant "
            "energy, e.g. --vary balls[2].mass=0.9:1.1, or the energy: --vary energy=5:20 (J).",
        ),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option(
            "--output",
            "-o",
            metavar="DIR",
            help="Folder of the table [default: outputs/<name>-orbit, with --vary].",
        ),
    ] = None,
    figures: Annotated[
        bool, typer.Option("--figures/--no-figures", help="Draw a family of orbits.")
    ] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was found as JSON.")] = False,
) -> Task:
    """Find the periodic orbit of impacts near the start. Period, events, multipliers."""
    if vary is not None:
        parsed_span(vary)  # a wrong usage is told before anything is read
    wishes = _Wishes(scenario, overrides, impacts, period, vary, output, figures, as_json)
    return partial(_find, wishes)


def parsed_span(vary: str) -> tuple[str, float, float]:
    """Path, lowest and highest value of `--vary`."""
    path, _, values = vary.rpartition("=")
    try:
        low, high = map(float, values.split(":"))
    except ValueError:
        low = high = 0.0
    if not path.strip() or not -float("inf") < low < high < float("inf"):
        raise typer.BadParameter(
            f"--vary: found {vary!r}, expected PATH=LOW:HIGH with LOW < HIGH, "
            "both in SI units and radians"
        )
    return path.strip(), low, high


def _find(wishes: _Wishes) -> int:
    """Find, follow, draw, write and print."""
    from vibro_cli.analysis.orbit_branch import family_of
    from vibro_cli.analysis.orbits import NoOrbit, find_orbit
    from vibro_cli.commands.shared.loading import load_any
    from vibro_cli.storage.files import FolderRefused, check_replaceable
    from vibro_cli.storage.folders import write_results
    from vibro_cli.systems import system_named

    scenario, system = load_any(wishes.source, wishes.overrides)
    if not system_named(scenario.system).has_orbits:
        raise CommandError(f"vibro: {scenario.name}: orbits are of bodies on a trace")
    folder = None
    if wishes.vary is not None or wishes.output is not None:
        folder = Path(wishes.output or Path("outputs") / f"{scenario.name}-orbit")
    longest = scenario.stop.time or 1000.0
    try:
        if folder is not None:
            check_replaceable(folder, "orbit")
        found = find_orbit(system, wishes.impacts, wishes.period, longest)
        branch = None
        if wishes.vary is not None:
            branch = family_of(cast("Scenario", scenario), found, *parsed_span(wishes.vary))
        if folder is not None:
            columns = orbit_columns(found, branch)
            drawn = {}
            if wishes.vary is not None and wishes.figures:
                drawn = _drawn(columns, _axis(parsed_span(wishes.vary)[0]))
            write_results("orbit", folder, drawn, scenario, columns=columns)
    except NoOrbit as error:
        raise CommandError(f"vibro: {scenario.name}: no orbit: {error}") from error
    except FolderRefused as error:
        raise CommandError(f"vibro: {error}") from error
    if wishes.as_json:
        print(json_text(record_of(found, branch)))
    else:
        print("\n".join(_lines(scenario.name, found, branch)))
    if folder is not None:
        say(f"{scenario.name}: files in {folder}")
    return DONE


def orbit_columns(found: "Orbit", branch: "Branch | None") -> dict[str, Any]:
    """The columns of ``orbits.parquet``: the points of a family, or the one orbit."""
    import numpy as np

    points: list[tuple[float, Orbit, str]] = [(float("nan"), found, "")]
    if branch is not None:
        marked = {id(one.point.orbit): one.kind for one in branch.special}
        points = [(p.value, p.orbit, marked.pop(id(p.orbit), "")) for p in branch.points]
        for one in branch.special:
            if id(one.point.orbit) in marked:
                values = [abs(value - one.point.value) for value, *_ in points]
                at = int(np.argmin(values))
                at += points[at][0] < one.point.value
                points.insert(at, (one.point.value, one.point.orbit, one.kind))
    orbits = [orbit for _, orbit, _ in points]
    columns: dict[str, Any] = {
        "value": np.array([value for value, *_ in points]),
        "special": np.array([kind or None for *_, kind in points], dtype=object),
        "period": np.array([one.period for one in orbits]),
        "energy": np.array([one.energy for one in orbits]),
        "residual": np.array([one.residual for one in orbits]),
        "multiplier": np.array([float(abs(one.multipliers[0])) for one in orbits]),
        "stable": np.array([one.stable for one in orbits]),
        "least_speed": np.array([one.shot.approach for one in orbits]),
        "word": np.array([" ".join(one.shot.word) for one in orbits], dtype=object),
    }
    for body, _ in enumerate(found.system.bodies):
        starts = [one.system.initial[body] for one in orbits]
        columns[f"arc_{body + 1}"] = np.array([start.piece + 1 for start in starts])
        columns[f"position_{body + 1}"] = np.array([start.position for start in starts])
        columns[f"speed_{body + 1}"] = np.array([start.speed for start in starts])
    return columns


def record_of(found: "Orbit", branch: "Branch | None") -> dict[str, Any]:
    """What was found as plain values."""
    record: dict[str, Any] = _plain(found)
    if branch is not None:
        record["special"] = [
            {"kind": one.kind, "value": one.point.value, **_plain(one.point.orbit)}
            for one in branch.special
        ]
        record["points"] = len(branch.points)
    return record


def _plain(one: "Orbit") -> dict[str, Any]:
    return {
        "period": one.period,
        "events": list(one.shot.word),
        "energy": one.energy,
        "residual": one.residual,
        "stable": one.stable,
        "verdict": one.verdict,
        "multipliers": [[float(mu.real), float(mu.imag)] for mu in one.multipliers],
        "start": [
            {"arc": state.piece + 1, "position": state.position, "speed": state.speed}
            for state in one.system.initial
        ],
    }


def _lines(name: str, found: "Orbit", branch: "Branch | None") -> Iterator[str]:
    """What was found as text."""
    yield f"{name}: period {found.period:.15g} s, closed to {found.residual:.1e}"
    yield f"  events       {' '.join(found.shot.word)}"
    yield f"  energy       {found.energy:.12g} J above the trace's left end"
    told = ", ".join(_complex(mu) for mu in found.multipliers)
    yield f"  multipliers  {told}: {found.verdict}"
    for body, state in enumerate(found.system.initial, 1):
        unit = "m" if found.system.trace.pieces[state.piece].is_line else "rad"
        yield (
            f"  ball {body}       arc {state.piece + 1}, {state.position:.15g} {unit}, "
            f"{state.speed:.15g} m/s"
        )
    if branch is not None:
        yield f"  family       {len(branch.points)} orbits"
        for one in branch.special:
            orbit = one.point.orbit
            told = ", ".join(_complex(mu) for mu in orbit.multipliers)
            yield f"  {one.kind:11}  at {one.point.value:.12g}: period {orbit.period:.9g} s; {told}"


def _complex(value: complex) -> str:
    return f"{value.real:.9g}" if value.imag == 0.0 else f"{value.real:.9g}{value.imag:+.9g}i"


def _axis(path: str) -> str:
    """The label of the axis of a family over the number at a path."""
    from vibro_cli.analysis.orbit_branch import ENERGY
    from vibro_cli.figures.grids.maps import words_of
    from vibro_cli.scenario.fields import unit_at
    from vibro_cli.scenario.source import parsed_path

    if path == ENERGY:
        return "energy [J]"
    unit = unit_at(parsed_path(path))
    return f"{words_of(path)} [{unit}]" if unit else words_of(path)


def _drawn(columns: dict[str, Any], label: str) -> dict[str, bytes]:
    """The figure of a family in both forms."""
    from vibro_cli.figures.analyses import branch_figure
    from vibro_cli.figures.style import render

    told = columns | {"special": [kind or "" for kind in columns["special"]]}
    figure = branch_figure(told, label, "single")
    return {f"orbits.{form}": render(figure, form) for form in ("png", "pdf")}
