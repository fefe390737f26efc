"""`vibro orbit` and `vibro fit`: periodic orbits; fits to measured impact times."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from vibro_cli.commands.shared.error_handling import DONE, CommandError
from vibro_cli.commands.shared.options import (
    json_option,
    output_option,
    scenario_argument,
    scenario_keys,
    set_option,
)
from vibro_cli.commands.shared.terminal import print_found, progress_shown, say
from vibro_cli.errors import counted

if TYPE_CHECKING:
    from vibro_cli.analysis.fit import Fit, Free
    from vibro_cli.analysis.orbit_branch import Branch
    from vibro_cli.analysis.orbits import Orbit
    from vibro_cli.scenario.models import Scenario


@dataclass(frozen=True, kw_only=True)
class OrbitCommand:
    """Find the periodic orbit near the start. Print its period, events and multipliers."""

    scenario: Annotated[str, scenario_argument(help="Scenario file, or - for standard input.")]
    overrides: Annotated[
        list[str],
        set_option(
            help="Override a value of the scenario, e.g. --set 'balls[2].mass=1.2'; repeatable."
        ),
    ]
    impacts: Annotated[
        int | None,
        typer.Option(
            min=1, metavar="N", help="Impacts per period [default: those of the nearest return]."
        ),
    ] = None
    period: Annotated[
        str | None,
        typer.Option(
            metavar="SECONDS",
            help="Estimate of the period (s, or with its unit), instead of --impacts.",
        ),
    ] = None
    vary: Annotated[
        str | None,
        typer.Option(
            metavar="PATH=LOW:HIGH",
            help="Follow the orbit at constant energy while a parameter of the scenario varies (SI "
            "units and radians, or with their units), e.g. --vary 'balls[2].mass=0.9:1.1', or "
            "while the energy (J, relative to the trace's left end) does: --vary energy=5:20.",
        ),
    ] = None
    output: Annotated[
        str | None,
        output_option(
            metavar="DIR",
            help="Folder for the table [default: outputs/<name>-orbit with --vary, else none].",
        ),
    ] = None
    figures: Annotated[
        bool, typer.Option("--figures/--no-figures", help="Draw the family of --vary.")
    ] = True
    as_json: Annotated[bool, json_option(help="Print the results as JSON.")] = False

    def __post_init__(self) -> None:
        from vibro_cli.scenario.base import checked
        from vibro_cli.scenario.quantities import Count

        if self.vary is not None:
            parsed_range("--vary", self.vary)
        try:
            _seconds("--period", self.period)
            if self.impacts is not None:
                checked("--impacts", self.impacts, Count())
        except ValueError as error:
            raise typer.BadParameter(str(error)) from error
        if self.impacts is not None and self.period is not None:
            raise typer.BadParameter("found --impacts and --period, expected one of them")

    def __call__(self) -> int:
        """Find, follow, draw, write and print."""
        from vibro_cli.analysis.orbits import NoOrbit
        from vibro_cli.interface import pictures
        from vibro_cli.interface.analyses import orbit, orbit_family, orbit_table
        from vibro_cli.storage.files import check_replaceable
        from vibro_cli.storage.folders import write_results

        scenario = _on_a_trace(self.scenario, self.overrides, "orbits are found")
        span = None if self.vary is None else parsed_range("--vary", self.vary)
        period = _seconds("--period", self.period)
        folder = None
        if span is not None or self.output is not None:
            folder = Path(self.output or Path("outputs") / f"{scenario.name}-orbit")
            check_replaceable(folder, "orbit")
        try:
            with progress_shown("searching"):
                found = orbit(scenario, self.impacts, period)
            with progress_shown("following"):
                family = None if span is None else orbit_family(scenario, found, *span)
        except NoOrbit as error:
            raise CommandError(f"vibro: {scenario.name}: no orbit: {error}") from error
        drawn = {}
        if family is not None and self.figures:
            drawn = pictures({"orbits": family.figure().figure})
        if folder is not None:
            start = found.as_start(scenario)
            table = orbit_table(found, start) if family is None else family.table
            write_results("orbit", folder, drawn, start, table=table)
        print_found(record_of(found, family), _lines(scenario.name, found, family), self.as_json)
        if folder is not None:
            say(f"{scenario.name}: files in {folder}")
        return DONE


def _on_a_trace(source: str, overrides: Sequence[str], what: str) -> Scenario:
    """Load a scenario; raise `CommandError`, which begins with `what`, unless it has orbits."""
    from vibro_cli.commands.shared.loading import load_any
    from vibro_cli.systems import system_named

    scenario, _ = load_any(source, overrides)
    if not system_named(scenario.system).has_orbits:
        raise CommandError(f"vibro: {scenario.name}: {what} only for bodies on a trace")
    return cast("Scenario", scenario)


def parsed_range(option: str, text: str, infinite: bool = False) -> tuple[str, float, float]:
    """Return the path, lowest and highest value (SI) of a text `PATH=LOW:HIGH`.

    The values may have units, or be `infinite`, as "-inf", "inf" or "+inf". Raises `CommandError`
    for other texts.
    """
    from vibro_cli.analysis.fit import START_TIME
    from vibro_cli.analysis.orbit_branch import ENERGY
    from vibro_cli.commands.shared.loading import in_si_units
    from vibro_cli.scenario.fields import kind_at
    from vibro_cli.scenario.loading import path_of
    from vibro_cli.scenario.models import Scenario
    from vibro_cli.scenario.problems import Fault
    from vibro_cli.scenario.quantities import TIME, Quantity

    others = {START_TIME: TIME, ENERGY: Quantity("energy")}  # parameters that no scenario has
    path, _, values = (part.strip() for part in text.rpartition("="))
    ends = [end.strip() for end in values.split(":")]
    form = "PATH or PATH=LOW:HIGH" if infinite else "PATH=LOW:HIGH"
    expected = f"{form} with LOW < HIGH (SI units and radians, or with their units)"
    if not path or len(ends) != 2:
        raise CommandError(f"vibro: {option}: found {text!r}, expected {expected}")
    try:
        kind = others.get(path) or kind_at(path_of(path), Scenario)
    except Fault as error:
        raise CommandError(f"vibro: {option}: {error}") from error
    number = kind if isinstance(kind, Quantity) else Quantity()
    low, high = (
        float(end)
        if infinite and end in ("-inf", "inf", "+inf")
        else in_si_units(f"{option}: {path}", [end], number)[0]
        for end in ends
    )
    if not low < high:
        raise CommandError(f"vibro: {option}: found {text!r}, expected {expected}")
    return path, low, high


def _seconds(option: str, text: str | None) -> float | None:
    """Return a time (s), written with or without a unit, None if there is none.

    Raises `ValueError` unless it is greater than 0.
    """
    from vibro_cli.scenario.base import checked
    from vibro_cli.scenario.loading import parse_value
    from vibro_cli.scenario.quantities import Quantity

    if text is None:
        return None
    found: float = checked(option, parse_value(text), Quantity("time", above=0.0))
    return found


def record_of(found: Orbit, branch: Branch | None) -> dict[str, Any]:
    """Return the results as plain values for JSON."""
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
        "energy_start": one.energy_start,
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
    yield f"{name}: period {found.period:.15g} s, closes to within {found.residual:.1e}"
    yield f"  events       {' '.join(found.shot.word)}"
    yield (
        f"  energy       {found.energy:.12g} J relative to the trace's left end; energy_start of "
        f"its run {found.energy_start:.12g} J"
    )
    yield f"  multipliers  {_multipliers(found)}: {found.verdict}"
    for body, state in enumerate(found.system.initial, 1):
        unit = "m" if found.system.trace.pieces[state.piece].is_line else "rad"
        yield (
            f"  ball {body}       arc {state.piece + 1}, {state.position:.15g} {unit}, "
            f"{state.speed:.15g} m/s"
        )
    if branch is not None:
        yield f"  family       {counted(len(branch.points), 'orbit')}"
        for one in branch.special:
            orbit = one.point.orbit
            words = f"period {orbit.period:.9g} s; {_multipliers(orbit)}"
            yield f"  {one.kind:11}  at {one.point.value:.12g}: {words}"
            if one.fault:
                yield f"  warning      this is the nearest orbit found: {one.fault}"


def _multipliers(found: Orbit) -> str:
    pairs = ((f"{mu.real:.9g}", f"{mu.imag:+.9g}i" if mu.imag else "") for mu in found.multipliers)
    return ", ".join(map("".join, pairs))


@dataclass(frozen=True, kw_only=True)
class FitCommand:
    """Fit parameters of a scenario to measured impact times. Print each with its standard error."""

    scenario: Annotated[
        str,
        scenario_argument(
            help="Scenario file, or - for standard input; its values are the initial guess."
        ),
    ]
    measured: Annotated[
        Path,
        typer.Argument(
            metavar="MEASURED",
            help="CSV or parquet file of the measured times: column t (s). Optional columns: n, "
            "the number of the impact from 1, if some are missing; error (s), the standard "
            "deviation, if it varies; ball_a and ball_b, if the bodies are known.",
        ),
    ]
    free: Annotated[
        list[str],
        typer.Option(
            metavar="PATH[=LOW:HIGH]",
            help="Parameter to fit, and its bounds (SI units and radians, or with their units), "
            "such as 'balls[2].mass=100 g:10 kg', or start_time, the time (s) of the start of the "
            "motion, if it is not 0; repeatable.",
            autocompletion=scenario_keys,
        ),
    ]
    noise: Annotated[
        str | None,
        typer.Option(
            metavar="SECONDS",
            help="Standard deviation of the times (s, or with its unit), if they have no column "
            "error [default: estimated from the residuals].",
        ),
    ] = None
    overrides: Annotated[
        list[str],
        set_option(help="Override a value of the scenario; repeatable."),
    ]
    output: Annotated[
        str | None,
        output_option(metavar="DIR", help="Folder for the results [default: none is written]."),
    ] = None
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw the residuals.")] = (
        True
    )
    as_json: Annotated[bool, json_option(help="Print the results as JSON.")] = False

    def __post_init__(self) -> None:
        try:
            _seconds("--noise", self.noise)
        except ValueError as error:
            raise typer.BadParameter(str(error)) from error

    def __call__(self) -> int:
        """Read, fit, draw, write and print."""
        from vibro_cli.analysis.fit import NoFit, fit_impacts, has_start_time, read_measured
        from vibro_cli.interface import pictures
        from vibro_cli.interface.analyses import Fit
        from vibro_cli.storage.files import check_replaceable
        from vibro_cli.storage.folders import write_results

        scenario = _on_a_trace(self.scenario, self.overrides, "parameters are fitted")
        folder = None if self.output is None else Path(self.output)
        free, noise = parsed_free(self.free), _seconds("--noise", self.noise)
        if folder is not None:
            check_replaceable(folder, "fit")
        try:
            measured = read_measured(self.measured, not has_start_time(free))
        except OSError as error:
            text = " ".join(str(error.strerror or error).split())
            raise CommandError(f"vibro: {self.measured}: cannot be read: {text}") from error
        try:
            with progress_shown("fitting"):
                found = Fit.of(fit_impacts(scenario, measured, free, noise))
        except NoFit as error:
            raise CommandError(f"vibro: {scenario.name}: no fit: {error}") from error
        drawn = {}
        if folder is not None and self.figures:
            drawn = pictures({"residuals": found.figure().figure})
        if folder is not None:
            write_results("fit", folder, drawn, found.scenario, record_of_fit(found), found.table)
        print_found(record_of_fit(found), _lines_of_fit(found), self.as_json)
        if folder is not None:
            say(f"{scenario.name}: files in {folder}")
        return DONE


def parsed_free(texts: Sequence[str]) -> list[Free]:
    """Return the paths and bounds of `--free`."""
    from vibro_cli.analysis.fit import Free

    found = []
    for text in texts:
        alone = text, -math.inf, math.inf
        ranged = parsed_range("--free", text, infinite=True) if "=" in text else alone
        try:
            found.append(Free.of(*ranged))
        except ValueError as error:
            raise CommandError(f"vibro: --free: {error}") from error
    return found


def record_of_fit(found: Fit) -> dict[str, Any]:
    """Return the results as plain values for JSON."""
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
        "misplaced": found.misplaced,
        "residual": float((found.residuals**2).mean() ** 0.5),
        "same_events": found.same_events,
        "events": list(found.word),
        "evaluations": found.evaluations,
    }


def _line_of_number(one: dict[str, Any], free: Free) -> str:
    """Return a fitted number, its error and its interval as a line of text."""
    numbers = (one["value"], *one["interval"])
    value, low, high = (_rounded(number, one["error"]) for number in numbers)
    error, high, start = map(free.with_unit, (f"{one['error']:.2g}", high, f"{one['start']:.10g}"))
    return f"  {one['path']:20} {value} ± {error}, 95 % interval {low} to {high}; initially {start}"


def _lines_of_fit(found: Fit) -> Iterator[str]:
    record = record_of_fit(found)
    impacts, motions = counted(record["impacts"], "impact"), counted(found.evaluations, "motion")
    yield f"{found.scenario.name}: {impacts}, {motions} solved"
    for number, one in zip(record["numbers"], found.free, strict=True):
        yield _line_of_number(number, one)
    yield from _lines_of_bounds(found)
    for row, one in enumerate(found.free):
        for column, other in enumerate(found.free[:row]):
            value = found.correlation[row, column]
            yield f"  correlation          {other.name}, {one.name}: {value:.4f}"
    shares = abs(found.residuals / found.noise)
    row = int(shares.argmax())
    largest = f"{found.residuals[row]:.3g} s, {shares[row]:.3g} times its noise"
    yield f"  residuals            {record['residual']:.3g} s, root mean square"
    yield f"  largest residual     {largest}, of impact {found.measured.number[row]}"
    if not found.noise_known:
        yield "  noise                not given: errors are estimated from the residuals"
    elif found.likelihood is not None:
        yield (
            f"  chi square           {found.chi_square:.4g} with {found.freedom} degrees of "
            f"freedom: as large or larger in {100.0 * found.likelihood:.3g} % of such measurements"
        )
    if found.doubt:
        yield f"  warning              {found.doubt}"
    if not found.same_events:
        yield (
            "  events               change within the 95 % region: the errors hold for the "
            "events found"
        )


def _lines_of_bounds(found: Fit) -> Iterator[str]:
    """Yield a line for each bound inside a 95 % interval, where the normal law does not hold."""
    for one, (low, high) in zip(found.free, found.interval, strict=True):
        for bound in one.bounds:
            if low < bound < high:
                value = one.with_unit(f"{bound:.10g}")
                yield (
                    f"  bounds               {one.name} is bounded by {value}, within its 95 % "
                    "interval: error and interval ignore the bound"
                )


def _rounded(value: float, error: float) -> str:
    """Return a number to two digits of its error, or its `repr` if that takes 17 or more."""
    digits = 2
    if abs(value) > error:
        digits += math.floor(math.log10(abs(value))) - math.floor(math.log10(error))
    return f"{value:#.{digits}g}" if digits < 17 else repr(float(value))
