"""`vibro run`: solve scenarios; tables, figures and a summary of each."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vibro_cli.commands.shared.error_handling import DONE, FAILED, MISUSED, CommandError, attempt
from vibro_cli.commands.shared.options import (
    CollisionStream,
    Engine,
    FailFast,
    Overrides,
    Scenarios,
    Strict,
    Task,
)
from vibro_cli.commands.shared.solving import Wishes, solve
from vibro_cli.commands.shared.terminal import json_text, say

if TYPE_CHECKING:
    from collections.abc import Sequence

    from vibro_cli.assemble import AnySystem
    from vibro_cli.commands.shared.loading import Refused
    from vibro_cli.scenario.base import AnyScenario

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
Earlier = Annotated[
    Path | None,
    typer.Option(
        "--continue",
        metavar="DIR",
        help="Continue the run in DIR to a later stop (--set stop.time=…), as if it had "
        "never stopped; the results replace DIR unless -o says otherwise, and the kinds of figures "
        "that it holds are drawn again unless --figures does.",
    ),
]
FiguresWanted = Annotated[
    str | None,
    typer.Option(
        "--figures",
        metavar="all|NAME,…",
        envvar="VIBRO_FIGURES",
        help="Draw these kinds of figures, or all there are; vibro help figures names them. "
        "default: for traces the phase portraits, for tables and springs what shows the motion; "
        "0: none.",
    ),
]


def run(
    scenarios: Scenarios = [],  # noqa: B006 (typer copies it)
    output: OutputFolder = None,
    overrides: Overrides = [],  # noqa: B006
    earlier: Earlier = None,
    figures: FiguresWanted = None,
    no_figures: Annotated[bool, typer.Option("--no-figures", help="Draw nothing.")] = False,
    engine: Engine = "compiled",
    stream: CollisionStream = None,
    summary_as_json: Annotated[
        bool,
        typer.Option(
            "--json",
            help="Print a JSON line for each run: scenario, overrides, folder and, at the same "
            "level, the columns of its summary.",
        ),
    ] = False,
    strict: Strict = False,
    fail_fast: FailFast = False,
    force: Annotated[
        bool, typer.Option("--force", help="Replace a run in DIR that has other parameters.")
    ] = False,
) -> Task:
    """Solve scenarios: tables, phase portraits and a summary of each."""
    if (earlier is None) == (not scenarios):
        raise CommandError(
            "vibro: Missing argument 'SCENARIO', or --continue DIR (see vibro run --help)"
            if earlier is None
            else "vibro: found a SCENARIO and --continue, expected one of them"
        )
    if output == "-" and stream is None:
        stream = "csv"
    if stream is not None and len(scenarios) > 1:
        raise typer.BadParameter("one table is streamed at a time; expected one SCENARIO")
    if stream is not None and summary_as_json:
        raise typer.BadParameter("--json and a streamed table both need standard output")
    wishes = Wishes(
        sources=scenarios,
        overrides=overrides,
        earlier=earlier,
        engine=engine,
        output=output,
        stream=stream,
        summary_as_json=summary_as_json,
        figures="0" if no_figures else figures,
        strict=strict,
        fail_fast=fail_fast,
        force=force,
    )
    return partial(_run_all if earlier is None else _continue, wishes)


def _run_all(wishes: Wishes) -> int:
    """Check everything that can be checked, then run one scenario after the other."""
    from vibro_cli.commands.shared.loading import check_names, load_each, together

    loaded, refused = load_each(wishes.sources, wishes.overrides)
    for scenario, _ in loaded:
        wishes.kinds_of(scenario.system)
    check_names([scenario for scenario, _ in loaded])
    if refused and (wishes.fail_fast or not loaded):
        _print_refused(wishes, refused)
        raise together(refused)
    _check_folders(wishes, [scenario for scenario, _ in loaded])
    for one in refused:
        say(str(one.error), "error", problems=one.error.problems)
    _print_refused(wishes, refused)
    codes = [MISUSED] * len(refused)
    for scenario, system in loaded:
        _warn(scenario, system)
        codes.append(attempt(partial(solve, wishes, scenario, None)))
        if wishes.fail_fast and codes[-1] in (FAILED, MISUSED):
            break
    return _worst(codes)


def _continue(wishes: Wishes) -> int:
    """Go on with an earlier run."""
    from vibro_cli.commands.shared.loading import load_any, read_earlier

    assert wishes.earlier is not None
    source, found = read_earlier(wishes.earlier, wishes.overrides)
    scenario, _ = load_any(str(source), wishes.overrides)
    wishes.kinds_of(scenario.system)
    _check_folders(wishes, [scenario])
    return solve(wishes, scenario, found)


def _worst(codes: list[int]) -> int:
    """The exit code of several scenarios: failed, then invalid, then not strict, then done."""
    return next((code for code in (FAILED, MISUSED) if code in codes), max(codes, default=DONE))


def _check_folders(wishes: Wishes, scenarios: "Sequence[AnyScenario]") -> None:
    """Raise `CommandError` before anything runs if some results could not take their place."""
    from vibro_cli.storage.files import FolderRefused
    from vibro_cli.storage.folders import check_run_folder

    for scenario in scenarios:
        folder = wishes.folder_of(scenario.name)
        try:
            if folder is not None:
                check_run_folder(folder, scenario, wishes.may_replace(folder))
        except FolderRefused as error:
            raise CommandError(f"vibro: {error}") from error


def _print_refused(wishes: Wishes, refused: "list[Refused]") -> None:
    """With --json, a line for each scenario that cannot be run, as there is for those that can."""
    if wishes.summary_as_json:
        for one in refused:
            line = {
                **wishes.line_head(one.source, None),
                "status": "invalid",
                "reason": str(one.error),
                "problems": one.error.problems,
            }
            print(json_text(line), flush=True)


def _warn(scenario: "AnyScenario", system: "AnySystem") -> None:
    """Say what is doubtful about a scenario."""
    from vibro_cli.assemble import warnings_of

    for warning in warnings_of(scenario, system):
        say(f"{scenario.name}: warning: {warning}", "warning", scenario=scenario.name)
