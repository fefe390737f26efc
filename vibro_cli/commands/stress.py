"""`vibro stress`: the stability suite, every mark of the solver and what was reached."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from vibro_cli.commands.shared.error_handling import DONE, FAILED, CommandError, say
from vibro_cli.commands.shared.options import Quiet, Task
from vibro_cli.commands.shared.streams import json_text


@dataclass(frozen=True)
class _Wishes:
    """What was asked of `vibro stress`."""

    full: bool
    seed: int
    only: tuple[str, ...]
    cases: int | None
    as_json: bool
    output: str | None
    quiet: bool


def stress(
    full: Annotated[
        bool, typer.Option("--full", help="The long form: under half an hour, not a minute.")
    ] = False,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the random cases.")] = 1,
    only: Annotated[
        list[str],
        typer.Option("--only", metavar="NAME", help="Only this check; repeatable."),
    ] = [],  # noqa: B006 (typer copies it)
    cases: Annotated[
        int | None,
        typer.Option(
            "--cases",
            metavar="N",
            min=1,
            help="How many scenes the checks drawn and digits draw (else as many as they think).",
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print it as JSON, a line for each finding.")
    ] = False,
    output: Annotated[
        str | None,
        typer.Option(
            "--output",
            "-o",
            metavar="DIR",
            help="Write the table and the scenarios of the worst cases to this folder.",
        ),
    ] = None,
    quiet: Quiet = False,
) -> Task:
    """Try to break the solver. Every mark, what was tried, the worst found. Exit code 1: missed."""
    wishes = _Wishes(full, seed, tuple(only), cases, as_json, output, quiet)
    return partial(_run_suite, wishes)


def _run_suite(wishes: _Wishes) -> int:
    from vibro_cli.storage.provenance import FolderRefused
    from vibro_cli.stress.finding import Plan
    from vibro_cli.stress.oracles.fifty_digits import MissingLibrary
    from vibro_cli.stress.suite import NAMES, check_stress_folder, line_of, record_of, run, write

    unknown = sorted(set(wishes.only) - set(NAMES))
    if unknown:
        expected = ", ".join(NAMES)
        raise CommandError(f"vibro: --only: no check {unknown[0]!r}; expected one of {expected}")
    plan = Plan(wishes.seed, wishes.full, wishes.cases)
    findings = []
    try:
        if wishes.output is not None:
            check_stress_folder(Path(wishes.output))
        for finding in run(plan, wishes.only):
            findings.append(finding)
            if wishes.as_json:
                print(json_text(record_of(finding)), flush=True)
            elif not wishes.quiet:
                print(line_of(finding), flush=True)
        if wishes.output is not None:
            write(findings, plan, Path(wishes.output))
    except (FolderRefused, MissingLibrary) as error:
        raise CommandError(f"vibro: {error}") from error
    missed = sum(not finding.met for finding in findings)
    if missed and not wishes.quiet:
        say(f"vibro: {missed} of {len(findings)} marks missed")
    return FAILED if missed else DONE
