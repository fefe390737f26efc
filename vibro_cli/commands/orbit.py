"""`vibro orbit`, `vibro fit`: periodic orbits, and numbers from measured instants of impacts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from vibro_cli.commands.shared.error_handling import DONE, CommandError
from vibro_cli.commands.shared.options import json_option, output_option, scenario_keys, set_option
from vibro_cli.commands.shared.terminal import print_found, say

if TYPE_CHECKING:
    from vibro_cli.analysis.fit import Fit, Free
    from vibro_cli.analysis.orbit_branch import Branch
    from vibro_cli.analysis.orbits import Orbit
    from vibro_cli.scenario.models import Scenario


@dataclass(frozen=True, kw_only=True)
class OrbitCommand:
    """Find the periodic orbit of impacts near the start. Period, events, multipliers."""

    scenario: Annotated[
        str, typer.Argument(metavar="SCENARIO", help="Scenario file, or - for standard input.")
    ]
    overrides: Annotated[
        list[str],
        set_option(
            help="Override a value of the scenario, e.g. --set balls[2].mass=1.2; repeatable."
        ),
    ]
    impacts: Annotated[
        int | None,
        typer.Option(min=1, help="Impacts of one period [default: those of the nearest return]."),
    ] = None
    period: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="A guess of the period, instead.")
    ] = None
    vary: Annotated[
        str | None,
        typer.Option(
            metavar="PATH=LOW:HIGH",
            help="Follow the orbit over a number of the scenario (SI units, radians), at constant "
            "energy, e.g. --vary balls[2].mass=0.9:1.1, or the energy: --vary energy=5:20 (J).",
        ),
    ] = None
    output: Annotated[
        str | None,
        output_option(
            metavar="DIR",
            help="Folder of the table [default: outputs/<name>-orbit, with --vary].",
        ),
    ] = None
    figures: Annotated[
        bool, typer.Option("--figures/--no-figures", help="Draw a family of orbits.")
    ] = True
    as_json: Annotated[bool, json_option(help="Print what was found as JSON.")] = False

    def __post_init__(self) -> None:
        from vibro_cli.scenario.base import checked
        from vibro_cli.scenario.quantities import Count, Quantity

        if self.vary is not None:
            parsed_span(self.vary)
        try:
            if self.period is not None:
                checked("--period", self.period, Quantity(above=0.0))
            if self.impacts is not None:
                checked("--impacts", self.impacts, Count())
        except ValueError as error:
            raise typer.BadParameter(str(error)) from error

    def __call__(self) -> int:
        """Find, follow, draw, write and print."""
        from vibro_cli.analysis.orbit_branch import family_of
        from vibro_cli.analysis.orbits import NoOrbit, find_orbit
        from vibro_cli.storage.files import check_replaceable
        from vibro_cli.storage.folders import write_results

        scenario, system = _on_a_trace(self.scenario, self.overrides, "orbits are")
        span = None if self.vary is None else parsed_span(self.vary)
        folder = None
        if span is not None or self.output is not None:
            folder = Path(self.output or Path("outputs") / f"{scenario.name}-orbit")
            check_replaceable(folder, "orbit")
        branch = None
        try:
            found = find_orbit(system, self.impacts, self.period, scenario.stop.time or 1000.0)
            if span is not None:
                branch = family_of(scenario, found, *span)
        except NoOrbit as error:
            raise CommandError(f"vibro: {scenario.name}: no orbit: {error}") from error
        if folder is not None:
            columns = orbit_columns(found, branch)
            drawn = {} if span is None or not self.figures else _drawn(columns, _axis(span[0]))
            write_results("orbit", folder, drawn, scenario, columns=columns)
        print_found(record_of(found, branch), _lines(scenario.name, found, branch), self.as_json)
        if folder is not None:
            say(f"{scenario.name}: files in {folder}")
        return DONE


def _on_a_trace(source: str, overrides: Sequence[str], what: str) -> tuple[Scenario, Any]:
    """A scenario with its system, if tangent maps lead there: `what` is of bodies on a trace."""
    from vibro_cli.commands.shared.loading import load_any
    from vibro_cli.systems import system_named

    scenario, system = load_any(source, overrides)
    if not system_named(scenario.system).has_orbits:
        raise CommandError(f"vibro: {scenario.name}: {what} of bodies on a trace")
    return cast("Scenario", scenario), system


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


def orbit_columns(found: Orbit, branch: Branch | None) -> dict[str, Any]:
    """The columns of ``orbits.parquet``: the points of a family, or the one orbit."""
    import numpy as np

    points: list[tuple[float, Orbit, str]] = [(float("nan"), found, "")]
    if branch is not None:
        points = []
        for n, point in enumerate(branch.points):
            here = [one for one in branch.special if one.after == n]
            if all(one.point is not point for one in here):
                points.append((point.value, point.orbit, ""))
            points += [(one.point.value, one.point.orbit, one.kind) for one in here]
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


def record_of(found: Orbit, branch: Branch | None) -> dict[str, Any]:
    """What was found as plain values."""
    record: dict[str, Any] = _plain(found)
    if branch is not None:
        record["special"] = [
            {"kind": one.kind, "value": one.point.value, "fault": one.fault}
            | _plain(one.point.orbit)
            for one in branch.special
        ]
        record["points"] = len(branch.points)
    return record


def _plain(one: Orbit) -> dict[str, Any]:
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


def _lines(name: str, found: Orbit, branch: Branch | None) -> Iterator[str]:
    """What was found as text."""
    yield f"{name}: period {found.period:.15g} s, closed to {found.residual:.1e}"
    yield f"  events       {' '.join(found.shot.word)}"
    yield f"  energy       {found.energy:.12g} J above the trace's left end"
    yield f"  multipliers  {_multipliers(found)}: {found.verdict}"
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
            told = f"period {orbit.period:.9g} s; {_multipliers(orbit)}"
            yield f"  {one.kind:11}  at {one.point.value:.12g}: {told}"
            if one.fault:
                yield f"  warning      that is the nearest orbit found: {one.fault}"


def _multipliers(found: Orbit) -> str:
    pairs = ((f"{mu.real:.9g}", f"{mu.imag:+.9g}i" if mu.imag else "") for mu in found.multipliers)
    return ", ".join(map("".join, pairs))


def _axis(path: str) -> str:
    """The label of the axis of a family over the number at a path."""
    from vibro_cli.analysis.orbit_branch import ENERGY
    from vibro_cli.figures.maps import words_of
    from vibro_cli.figures.ticks import Ticks, axis_words
    from vibro_cli.scenario.fields import unit_at
    from vibro_cli.scenario.problems import parsed_path

    if path == ENERGY:
        return "energy [J]"
    return axis_words(words_of(path), unit_at(parsed_path(path)), Ticks((), ()))


def _drawn(columns: dict[str, Any], label: str) -> dict[str, bytes]:
    """The figure of a family."""
    from vibro_cli.figures.analyses import branch_figure
    from vibro_cli.interface import pictures

    return pictures({"orbits": branch_figure(columns, label, "single")})


DOUBTFUL = 1.0e-6
"""A likelihood below this is told of as a warning."""


@dataclass(frozen=True, kw_only=True)
class FitCommand:
    """Fit numbers of a scenario to measured instants of impacts. Each has its standard error."""

    scenario: Annotated[
        str,
        typer.Argument(
            metavar="SCENARIO",
            help="Scenario file, or - for standard input; its numbers are those to begin with.",
        ),
    ]
    measured: Annotated[
        Path,
        typer.Argument(
            metavar="MEASURED",
            help="CSV or parquet file with the instants of impacts: column t (s); if some are "
            "missing, n, the number of the impact from 1; if their errors differ, error (s), the "
            "standard deviation; if the bodies are known, ball_a and ball_b.",
        ),
    ]
    free: Annotated[
        list[str],
        typer.Option(
            metavar="PATH[=LOW:HIGH]",
            help="A number of the scenario to be fitted, and its bounds (SI units, radians), such "
            "as balls[2].mass=0.1:10; repeatable.",
            autocompletion=scenario_keys,
        ),
    ]
    noise: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            help="Standard deviation of the instants [default: estimated from the residuals].",
        ),
    ] = None
    overrides: Annotated[
        list[str],
        set_option(help="Override a value of the scenario; repeatable."),
    ]
    output: Annotated[
        str | None,
        output_option(metavar="DIR", help="Folder of results [default: none is written]."),
    ] = None
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw the residuals.")] = (
        True
    )
    as_json: Annotated[bool, json_option(help="Print what was found as JSON.")] = False

    def __post_init__(self) -> None:
        from vibro_cli.analysis.fit import check_noise

        try:
            check_noise("--noise", self.noise)
        except ValueError as error:
            raise typer.BadParameter(str(error)) from error

    def __call__(self) -> int:
        """Read, fit, draw, write and print."""
        from vibro_cli.analysis.fit import NoFit, fit_impacts, read_measured
        from vibro_cli.storage.files import check_replaceable
        from vibro_cli.storage.folders import write_results

        scenario, _ = _on_a_trace(self.scenario, self.overrides, "numbers are fitted")
        folder = None if self.output is None else Path(self.output)
        free = parsed_free(self.free)
        if folder is not None:
            check_replaceable(folder, "fit")
        try:
            measured = read_measured(self.measured)
            found = fit_impacts(scenario, measured, free, self.noise)
        except NoFit as error:
            raise CommandError(f"vibro: {scenario.name}: no fit: {error}") from error
        except OSError as error:
            if error.filename != str(self.measured):
                raise
            text = f"vibro: {self.measured}: cannot be read: {error.strerror}"
            raise CommandError(text) from error
        if folder is not None:
            columns = residual_columns(found)
            drawn = _residuals_drawn(columns) if self.figures else {}
            write_results("fit", folder, drawn, found.scenario, record_of_fit(found), columns)
        print_found(record_of_fit(found), _lines_of_fit(found), self.as_json)
        if folder is not None:
            say(f"{scenario.name}: files in {folder}")
        return DONE


def parsed_free(texts: Sequence[str]) -> list[Free]:
    """Paths and bounds of `--free`."""
    from vibro_cli.analysis.fit import Free

    found = []
    for text in texts:
        path, equals, values = text.partition("=")
        try:
            low, high = map(float, values.split(":")) if equals else (-math.inf, math.inf)
            found.append(Free.of(path, low, high))
        except (TypeError, ValueError) as error:
            raise CommandError(
                f"vibro: --free: found {text!r}, expected PATH or PATH=LOW:HIGH with LOW < HIGH"
            ) from error
    return found


def residual_columns(found: Fit) -> dict[str, Any]:
    """The columns of ``residuals.parquet``."""
    return {
        "n": found.measured.number,
        "t": found.measured.t,
        "noise": found.noise,
        "residual": found.residuals,
        "first": found.first,
    }


def record_of_fit(found: Fit) -> dict[str, Any]:
    """What was found as plain values."""
    rows = zip(found.free, found.start, found.values, found.errors, found.interval, strict=True)
    return {
        "numbers": [
            {
                "path": one.name,
                "start": float(start),
                "value": float(value),
                "error": float(error),
                "interval": [float(end) for end in interval],
            }
            for one, start, value, error, interval in rows
        ],
        "covariance": found.covariance.tolist(),
        "correlation": found.correlation.tolist(),
        "impacts": len(found.residuals),
        "freedom": found.freedom,
        "noise_known": found.noise_known,
        "chi_square": found.chi_square,
        "likelihood": found.likelihood,
        "residual": float((found.residuals**2).mean() ** 0.5),
        "same_events": found.same_events,
        "events": list(found.word),
        "evaluations": found.evaluations,
    }


def _lines_of_fit(found: Fit) -> Iterator[str]:
    """What was found as text."""
    record = record_of_fit(found)
    yield f"{found.scenario.name}: {record['impacts']} impacts, {found.evaluations} motions solved"
    for one in record["numbers"]:
        value, low, high = (
            _rounded(number, one["error"]) for number in (one["value"], *one["interval"])
        )
        yield (
            f"  {one['path']:20} {value} ± {one['error']:.2g}, 95 % within {low} to {high}; "
            f"it was {one['start']:.10g}"
        )
    names = [one.name for one in found.free]
    for row, name in enumerate(names):
        for column, other in enumerate(names[:row]):
            yield f"  correlation          {other}, {name}: {found.correlation[row, column]:.4f}"
    yield f"  residuals            {record['residual']:.3g} s, root mean square"
    if found.likelihood is None:
        yield "  noise                not given: the errors are those the residuals tell"
    else:
        yield (
            f"  chi square           {found.chi_square:.4g} of {found.freedom} degrees of freedom: "
            f"as large or larger in {100.0 * found.likelihood:.2g} % of such measurements"
        )
        if found.likelihood < DOUBTFUL:
            yield (
                "  warning              model or noise are wrong, impacts were missed (give n), or "
                "it is not the lowest minimum (fit fewer impacts, then all from what they give)"
            )
    if not found.same_events:
        yield (
            "  events               change within the 95 % region: the errors are those of the "
            "order of events found"
        )


def _rounded(value: float, error: float) -> str:
    """A number to two digits of its error, or as short as its double allows if that has fewer."""
    digits = 2 + math.floor(math.log10(abs(value) / error)) if abs(value) > error else 2
    return f"{value:#.{digits}g}" if digits < 17 else repr(float(value))


def _residuals_drawn(columns: dict[str, Any]) -> dict[str, bytes]:
    """The figure of the residuals."""
    from vibro_cli.figures.analyses import fit_figure
    from vibro_cli.interface import pictures

    return pictures({"residuals": fit_figure(columns)})
