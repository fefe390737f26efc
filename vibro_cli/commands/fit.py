"""`vibro fit`: numbers of a scenario from measured instants of impacts."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from vibro_cli.commands.shared.error_handling import DONE, CommandError, reason, say
from vibro_cli.commands.shared.options import scenario_keys
from vibro_cli.commands.shared.terminal import print_found

if TYPE_CHECKING:
    from vibro_cli.analysis.fit import Fit, Free
    from vibro_cli.scenario.models import Scenario

DOUBTFUL = 1.0e-6
"""A likelihood below this is told of as a warning."""


@dataclass(frozen=True, kw_only=True)
class FitCommand:
    """Fit numbers of a scenario to measured instants of impacts, with their standard errors."""

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
            "--free",
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
        typer.Option(
            "--set",
            default_factory=list,
            metavar="PATH=VALUE",
            help="Override a value of the scenario; repeatable.",
            show_default=False,
            autocompletion=scenario_keys,
        ),
    ]
    output: Annotated[
        str | None,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Folder of results [default: none is written]."
        ),
    ] = None
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw the residuals.")] = (
        True
    )
    as_json: Annotated[bool, typer.Option("--json", help="Print what was found as JSON.")] = False

    def __post_init__(self) -> None:
        """Tell a wrong usage before anything is read."""
        if self.noise is not None and not 0.0 < self.noise < float("inf"):
            text = f"--noise: found {self.noise!r}, expected seconds, greater than 0"
            raise typer.BadParameter(text)

    def __call__(self) -> int:
        """Read, fit, draw, write and print."""
        from vibro_cli.analysis.fit import NoFit, fit_impacts, read_measured
        from vibro_cli.commands.shared.loading import load_any
        from vibro_cli.storage.folders import check_fit_folder, write_fit
        from vibro_cli.systems import system_named

        scenario, _ = load_any(self.scenario, self.overrides)
        if not system_named(scenario.system).has_orbits:
            raise CommandError(f"vibro: {scenario.name}: numbers are fitted of bodies on a trace")
        folder = None if self.output is None else Path(self.output)
        free = parsed_free(self.free)
        if folder is not None:
            check_fit_folder(folder)
        try:
            measured = read_measured(self.measured)
            found = fit_impacts(cast("Scenario", scenario), measured, free, self.noise)
        except NoFit as error:
            raise CommandError(f"vibro: {scenario.name}: no fit: {error}") from error
        except OSError as error:
            if error.filename != str(self.measured):
                raise
            text = f"vibro: {self.measured}: cannot be read: {reason(error)}"
            raise CommandError(text) from error
        if folder is not None:
            columns = residual_columns(found)
            drawn = _drawn(columns) if self.figures else {}
            write_fit(found.scenario, record_of(found), columns, folder, drawn)
        print_found(record_of(found), _lines(found), self.as_json)
        if folder is not None:
            say(f"{scenario.name}: files in {folder}")
        return DONE


def parsed_free(texts: Sequence[str]) -> "list[Free]":
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


def residual_columns(found: "Fit") -> dict[str, Any]:
    """The columns of ``residuals.parquet``."""
    return {
        "n": found.measured.number,
        "t": found.measured.t,
        "noise": found.noise,
        "residual": found.residuals,
        "first": found.first,
    }


def record_of(found: "Fit") -> dict[str, Any]:
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


def _lines(found: "Fit") -> Iterator[str]:
    """What was found as text."""
    record = record_of(found)
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
    if found.likelihood is not None and found.likelihood < DOUBTFUL:
        yield "  warning              model or noise are wrong, or impacts were missed (give n)"
    if not found.same_events:
        yield (
            "  events               change within the 95 % region: the errors are those of the "
            "order of events found"
        )


def _rounded(value: float, error: float) -> str:
    """A number to two digits of its error."""
    digits = 2 + math.floor(math.log10(abs(value) / error)) if abs(value) > error else 2
    return f"{value:#.{min(digits, 17)}g}"


def _drawn(columns: dict[str, Any]) -> dict[str, bytes]:
    """The figure of the residuals."""
    from vibro_cli.figures.analyses import fit_figure
    from vibro_cli.interface import pictures

    return pictures({"residuals": fit_figure(columns, "single")})
