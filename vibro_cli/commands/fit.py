"""`vibro fit`: numbers of a scenario from measured instants of impacts."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from vibro_cli.commands.shared.error_handling import DONE, CommandError, reason
from vibro_cli.commands.shared.options import Task, scenario_keys
from vibro_cli.commands.shared.terminal import json_text, say

if TYPE_CHECKING:
    from vibro_cli.analysis.fit import Fit, Free
    from vibro_cli.scenario.models import Scenario

DOUBTFUL = 1.0e-6
"""A likelihood below this is told of as a warning."""


@dataclass(frozen=True)
class _Wishes:
    """What was asked of `vibro fit`."""

    source: str
    measured: Path
    free: Sequence[str]
    noise: float | None
    overrides: Sequence[str]
    output: str | None
    figures: bool
    as_json: bool


def fit(
    scenario: Annotated[
        str,
        typer.Argument(
            metavar="SCENARIO",
            help="Scenario file, or - for standard input; its numbers are those to begin with.",
        ),
    ],
    measured: Annotated[
        Path,
        typer.Argument(
            metavar="MEASURED",
            help="CSV or parquet file with the instants of impacts: column t (s); if some are "
            "missing, n, the number of the impact from 1; if their errors differ, error (s), the "
            "standard deviation; if the bodies are known, ball_a and ball_b.",
        ),
    ],
    free: Annotated[
        list[str],
        typer.Option(
            "--free",
            metavar="PATH[=LOW:HIGH]",
            help="A number of the scenario to be fitted, and its bounds (SI units, radians), such "
            "as balls[2].mass=0.1:10; repeatable.",
            autocompletion=scenario_keys,
        ),
    ],
    noise: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            help="Standard deviation of the instants [default: estimated from the residuals].",
        ),
    ] = None,
    overrides: Annotated[
        list[str],
        typer.Option(
            "--set",
            metavar="PATH=VALUE",
            help="Override a value of the scenario; repeatable.",
            show_default=False,
            autocompletion=scenario_keys,
        ),
    ] = [],  # noqa: B006 (typer copies it)
    output: Annotated[
        str | None,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Folder of results [default: none is written]."
        ),
    ] = None,
    figures: Annotated[
        bool, typer.Option("--figures/--no-figures", help="Draw the residuals.")
    ] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was found as JSON.")] = False,
) -> Task:
    """Fit numbers of a scenario to measured instants of impacts, with their standard errors."""
    if noise is not None and not 0.0 < noise < float("inf"):
        raise typer.BadParameter(f"--noise: found {noise!r}, expected seconds, greater than 0")
    wishes = _Wishes(scenario, measured, free, noise, overrides, output, figures, as_json)
    return partial(_fit, wishes)


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


def _fit(wishes: _Wishes) -> int:
    """Read, fit, draw, write and print."""
    from vibro_cli.analysis.fit import NoFit, NotMeasured, fit_impacts, read_measured
    from vibro_cli.commands.shared.loading import load_any
    from vibro_cli.storage.files import FolderRefused, check_replaceable
    from vibro_cli.storage.folders import write_results
    from vibro_cli.systems import system_named

    scenario, _ = load_any(wishes.source, wishes.overrides)
    if not system_named(scenario.system).has_orbits:
        raise CommandError(f"vibro: {scenario.name}: numbers are fitted of bodies on a trace")
    folder = None if wishes.output is None else Path(wishes.output)
    free = parsed_free(wishes.free)
    try:
        if folder is not None:
            check_replaceable(folder, "fit")
        measured = read_measured(wishes.measured)
        found = fit_impacts(cast("Scenario", scenario), measured, free, wishes.noise)
        if folder is not None:
            columns = residual_columns(found)
            drawn = _drawn(columns) if wishes.figures else {}
            write_results("fit", folder, drawn, found.scenario, record_of(found), columns)
    except NoFit as error:
        raise CommandError(f"vibro: {scenario.name}: no fit: {error}") from error
    except (NotMeasured, FolderRefused) as error:
        raise CommandError(f"vibro: {error}") from error
    except OSError as error:
        if error.filename != str(wishes.measured):
            raise
        raise CommandError(f"vibro: {wishes.measured}: cannot be read: {reason(error)}") from error
    print(json_text(record_of(found)) if wishes.as_json else "\n".join(_lines(found)))
    if folder is not None:
        say(f"{scenario.name}: files in {folder}")
    return DONE


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
    """The figure of the residuals in both forms."""
    from vibro_cli.figures.analyses import fit_figure
    from vibro_cli.figures.style import render

    figure = fit_figure(columns, "single")
    return {f"residuals.{form}": render(figure, form) for form in ("png", "pdf")}
