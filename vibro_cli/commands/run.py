"""`vibro run`: solve scenarios; tables, figures and a summary of each."""

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibro_cli.commands.boundary import DONE, NOT_STRICT, CommandError, say
from vibro_cli.commands.options import (
    CollisionStream,
    Engine,
    Overrides,
    Quiet,
    Scenarios,
    Strict,
    TableFormat,
    Task,
    Verbose,
)

if TYPE_CHECKING:
    from vibro_cli.scenario import Scenario
    from vibro_cli.simulation.run import Run

OutputFolder = Annotated[
    str | None,
    typer.Option(
        "--output",
        "-o",
        metavar="DIR",
        help="Folder of the results [default: outputs/<name>]; of several scenarios DIR/<name>; "
        "- streams the collision table instead.",
    ),
]
_PORTRAIT_FORMS = ("png", "pdf")


@dataclass(frozen=True)
class _Wishes:
    """What was asked of `vibro run`; `output` and `stream` are None where nothing was said."""

    sources: Sequence[str]
    overrides: Sequence[str]
    engine: str
    output: str | None
    stream: TableFormat | None
    summary_as_json: bool
    figures: bool
    strict: bool
    quiet: bool
    verbose: bool


def run(
    scenarios: Scenarios,
    output: OutputFolder = None,
    overrides: Overrides = [],  # noqa: B006 (typer copies it)
    figures: Annotated[
        bool, typer.Option("--figures/--no-figures", help="Draw the phase portraits.")
    ] = True,
    engine: Engine = "auto",
    stream: CollisionStream = None,
    summary_as_json: Annotated[
        bool, typer.Option("--json", help="Print each summary to standard output as a JSON line.")
    ] = False,
    strict: Strict = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> Task:
    """Solve scenarios: tables, phase portraits and a summary of each."""
    if output == "-" and stream is None:
        stream = "csv"
    if stream is not None and len(scenarios) > 1:
        raise typer.BadParameter("one table is streamed at a time; expected one SCENARIO")
    if stream is not None and summary_as_json:
        raise typer.BadParameter("--json and a streamed table both need standard output")
    wishes = _Wishes(
        sources=scenarios,
        overrides=overrides,
        engine=engine,
        output=output,
        stream=stream,
        summary_as_json=summary_as_json,
        figures=figures,
        strict=strict,
        quiet=quiet,
        verbose=verbose,
    )
    return partial(_run_all, wishes)


def _folder_of(wishes: _Wishes, scenario: "Scenario") -> Path | None:
    """Where the results of a scenario go, or None where they are only streamed."""
    if wishes.output is None:
        return None if wishes.stream is not None else Path("outputs") / scenario.name
    if wishes.output == "-":
        return None
    folder = Path(wishes.output)
    return folder / scenario.name if len(wishes.sources) > 1 else folder


def _run_all(wishes: _Wishes) -> int:
    """Check everything that can be checked, then run one scenario after the other."""
    from vibro_cli.build import mechanics_warnings
    from vibro_cli.commands.loading import check_names, load_all
    from vibro_cli.storage.provenance import FolderRefused
    from vibro_cli.storage.runs import check_run_folder

    loaded = load_all(wishes.sources, wishes.overrides)
    check_names([scenario for scenario, _ in loaded])
    try:
        for scenario, _ in loaded:
            folder = _folder_of(wishes, scenario)
            if folder is not None:
                check_run_folder(folder)
        sound = True
        for scenario, system in loaded:
            if not wishes.quiet:
                for warning in mechanics_warnings(system):
                    say(f"{scenario.name}: warning: {warning}")
            sound &= _run_one(wishes, scenario)
    except FolderRefused as error:
        raise CommandError(f"vibro: {error}") from error
    return DONE if sound or not wishes.strict else NOT_STRICT


def _run_one(wishes: _Wishes, scenario: "Scenario") -> bool:
    """Run a scenario and put its results where they were asked; false if it was not sound."""
    from vibro_cli.api import simulate
    from vibro_cli.commands.words import summary_text
    from vibro_cli.storage.runs import write_run

    result = simulate(scenario, engine=wishes.engine)
    folder = _folder_of(wishes, scenario)
    if folder is not None:
        write_run(result, scenario, folder, _portraits(result) if wishes.figures else {})
    record = result.summary_record()
    if wishes.stream is not None:
        _stream_collisions(result, scenario, wishes.stream)
    if wishes.summary_as_json:
        print(json.dumps({"scenario": scenario.name, **record}, allow_nan=False), flush=True)
    if not wishes.quiet:
        say(summary_text(scenario.name, record, folder))
    if wishes.verbose:
        for omission in result.skipped:
            say(f"  skipped    {omission}")
    return _is_sound(record)


def _portraits(result: "Run") -> dict[str, bytes]:
    """The phase portrait of every body: names of files and their contents."""
    from vibro_cli.figures.output import render
    from vibro_cli.figures.portrait import phase_portrait

    width = "double" if len(result.system.trace.pieces) > 1 else "single"
    files = {}
    for ball in range(1, len(result.system.bodies) + 1):
        figure = phase_portrait(result, ball, width)
        for form in _PORTRAIT_FORMS:
            files[f"portrait_{ball}.{form}"] = render(figure, form)
    return files


def _is_sound(record: dict[str, Any]) -> bool:
    """Whether a summary is of a run that --strict accepts."""
    return bool(record["status"] == "ok" and record["end_cause"] != "inadmissible")


def _stream_collisions(result: "Run", scenario: "Scenario", form: TableFormat) -> None:
    """Write the collision table to standard output."""
    from vibro_cli.storage.runs import origin_of, run_table
    from vibro_cli.storage.tables import stream

    stream(run_table(result, "collisions", origin_of(scenario)), form, sys.stdout.buffer)
    sys.stdout.buffer.flush()
