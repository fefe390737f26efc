"""`vibro bench` and `vibro stress`: speed and accuracy of the solver, measured on this machine.

`vibro bench` draws run time against error; `vibro stress` prints each mark and the result reached.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibro_cli.commands.shared.error_handling import DONE, FAILED, CommandError
from vibro_cli.commands.shared.options import json_option, output_option, repeatable
from vibro_cli.commands.shared.terminal import each_with_progress, print_found, say

if TYPE_CHECKING:
    from vibro_cli.benchmark.measurement import Row


@dataclass(frozen=True, kw_only=True)
class BenchCommand:
    """Measure run time against error. Compare this solver with others that are installed."""

    quick: Annotated[bool, typer.Option("--quick", help="Quick trial: one scene, few repeats.")] = (
        False
    )
    full: Annotated[bool, typer.Option("--full", help="More repeats, up to 1e6 scenarios.")] = False
    scene: Annotated[
        list[str], repeatable(metavar="NAME", help="Measure only this scene; repeatable.")
    ]
    output: Annotated[
        str, output_option(metavar="DIR", help="Folder for the table, figures and page.")
    ] = "outputs/benchmark"
    references: Annotated[
        str | None,
        typer.Option(
            metavar="DIR",
            help="Recompute the references to 40 digits, write them to this folder and print how "
            "they differ from those in use; measure nothing.",
        ),
    ] = None
    as_json: Annotated[
        bool, json_option(help="Print a JSON object for each row of the table, one per line.")
    ] = False

    def __post_init__(self) -> None:
        if self.quick and self.full:
            raise typer.BadParameter("--quick cannot be combined with --full")
        measured = self.quick or self.full or self.as_json or self.output != type(self).output
        if self.references is not None and measured:
            raise typer.BadParameter(
                "--references measures nothing; it can be combined with --scene only"
            )

    def __call__(self) -> int:
        """Measure, or compute the references anew."""
        if self.references is not None:
            return _renew(Path(self.references), self.scene)
        return _measure(self, "quick" if self.quick else "full" if self.full else "default")


def _check_names(option: str, what: str, names: Sequence[str], known: Collection[str]) -> None:
    """Raise `CommandError` if a name given to an option is unknown."""
    unknown = sorted(set(names) - set(known))
    if unknown:
        expected = ", ".join(known)
        text = f"vibro: {option}: no {what} {unknown[0]!r}; expected one of {expected}"
        raise CommandError(text)


def _measure(options: BenchCommand, form: str) -> int:
    from vibro_cli.benchmark import methods, suite
    from vibro_cli.benchmark.measurement import PLANS, describe_machine
    from vibro_cli.benchmark.scenes import BY_NAME
    from vibro_cli.storage.files import check_replaceable

    _check_names("--scene", "scene", options.scene, BY_NAME)
    details = {"machine": describe_machine(), "plan": form}
    missing = sorted(set(methods.PEERS) - set(methods.installed_peers()))
    if missing:
        names = ", ".join(missing)
        say(f"vibro: not measured because not installed: {names} (pip install 'vibro-cli[peers]')")
    rows: list[Row] = []
    target = Path(options.output)
    check_replaceable(target, "benchmark")
    results = suite.run(PLANS[form], tuple(options.scene))
    try:
        for found in each_with_progress("measuring", results):
            rows += found
            for row in found:
                print_found(vars(row), [_line(row)], options.as_json)
    except KeyboardInterrupt as end:
        end.add_note("nothing was written")  # except temporary folders, whose writing is measured
        raise
    _write(rows, details, target)
    say(f"vibro: wrote {target / 'benchmark.html'}")
    return DONE


def _line(row: "Row") -> str:
    name = row.method if row.size is None else f"{row.method}, {row.part} {row.size}"
    time = "" if row.per_impact is None else f"{row.per_impact * 1e6:10.3g} µs per impact"
    error = "" if row.error is None else f"  error {row.error:.1e}"
    note = "" if row.status == "ok" else f"  {row.status}: {row.note}"
    return f"{row.scene:12} {name:24} {row.setting:10}{time:24}{error}{note}"


def _write(rows: "list[Row]", details: dict[str, Any], target: Path) -> None:
    from vibro_cli.benchmark.measurement import parquet
    from vibro_cli.interface import pictures
    from vibro_cli.report.benchmark_page import benchmark_html, drawn
    from vibro_cli.storage.files import write_folder

    wide = drawn(rows)
    files = {
        "benchmark.parquet": parquet(rows, details),
        "benchmark.html": benchmark_html(rows, details, wide),
        **pictures(wide),
    }
    write_folder("benchmark", target, files, details)


def _renew(target: Path, names: Sequence[str]) -> int:
    """Compute the references anew and print how they differ from those in use."""
    from vibro_cli.benchmark.scenes import (
        BY_NAME,
        SCENES,
        computed_reference,
        reference_difference,
    )
    from vibro_cli.storage.files import check_replaceable, json_bytes, write_folder

    _check_names("--scene", "scene", names, BY_NAME)
    files = {}
    check_replaceable(target, "references")
    try:
        for scene in SCENES:
            if names and scene.name not in names:
                continue
            content = computed_reference(scene)
            files[f"{scene.name}.json"] = json_bytes(content)
            print_found(content, [f"{scene.name}: {reference_difference(scene, content)}"], False)
    except ModuleNotFoundError as error:
        raise CommandError(
            "vibro: mpmath is missing; install it with: pip install 'vibro-cli[stress]'"
        ) from error
    write_folder("references", target, files, {})
    return DONE


@dataclass(frozen=True, kw_only=True)
class StressCommand:
    """Try to break the solver. Print the worst error of each check. Exit code 1: one too large."""

    full: Annotated[
        bool,
        typer.Option("--full", help="Run the long suite: under half an hour instead of a minute."),
    ] = False
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="Seed of the random cases.")] = 1
    only: Annotated[list[str], repeatable(metavar="NAME", help="Run only this check; repeatable.")]
    cases: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            help="Number of random scenes in each of the checks drawn, digits and tangent "
            "[default: depends on the check].",
        ),
    ] = None
    as_json: Annotated[
        bool, json_option(help="Print a JSON object for each finding, one per line.")
    ] = False
    output: Annotated[
        str | None,
        output_option(
            metavar="DIR",
            help="Write the table and the scenarios of the worst cases to this folder.",
        ),
    ] = None

    def __call__(self) -> int:
        """Run the suite and print its findings."""
        from vibro_cli.storage.files import check_replaceable
        from vibro_cli.stress.scenes import Plan
        from vibro_cli.stress.suite import NAMES, line_of, record_of, run
        from vibro_cli.stress.suite import write as write_folder

        _check_names("--only", "check", self.only, NAMES)
        folder = None if self.output is None else Path(self.output)
        plan = Plan(self.seed, self.full, self.cases)
        findings = []
        if folder is not None:
            check_replaceable(folder, "stress")
        for finding in each_with_progress("checking", run(plan, tuple(self.only))):
            findings.append(finding)
            print_found(record_of(finding), [line_of(finding)], self.as_json)
        if folder is not None:
            write_folder(findings, plan, folder)
        missed = sum(not finding.met for finding in findings)
        if missed:
            say(f"vibro: {missed} of {len(findings)} marks missed")
        return FAILED if missed else DONE
