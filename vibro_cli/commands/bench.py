"""`vibro bench`, `vibro stress`: how fast and how exact the solver is, measured on this machine.

Run time against error is drawn; the stability suite tells every mark and what was reached.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibro_cli.commands.shared.error_handling import DONE, FAILED, CommandError
from vibro_cli.commands.shared.options import Quiet, Task
from vibro_cli.commands.shared.terminal import json_text, say

if TYPE_CHECKING:
    from vibro_cli.benchmark.measurement import Row


@dataclass(frozen=True)
class _BenchOptions:
    """What was asked of `vibro bench`."""

    form: str
    scenes: tuple[str, ...]
    output: str
    as_json: bool
    quiet: bool


def bench(
    quick: Annotated[
        bool, typer.Option("--quick", help="One scene, few repeats: a trial.")
    ] = False,
    full: Annotated[
        bool, typer.Option("--full", help="More repeats, up to 1e6 scenarios.")
    ] = False,
    scene: Annotated[
        list[str],
        typer.Option("--scene", metavar="NAME", help="Only this scene; repeatable."),
    ] = [],  # noqa: B006 (typer copies it)
    output: Annotated[
        str,
        typer.Option("--output", "-o", metavar="DIR", help="Folder of table, figures and page."),
    ] = "outputs/benchmark",
    references: Annotated[
        str | None,
        typer.Option(
            "--references",
            metavar="DIR",
            help="Compute the references anew to 40 digits, write them to this folder, say what "
            "differs from those in use, and measure nothing.",
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print each row of the table as a JSON line.")
    ] = False,
    quiet: Quiet = False,
) -> Task:
    """Measure run time against error. Of this solver and of others that are installed."""
    if quick and full:
        raise typer.BadParameter("--quick does not go with --full")
    if references is not None:
        return partial(_renew, references, tuple(scene))
    form = "quick" if quick else "full" if full else "default"
    return partial(_measure, _BenchOptions(form, tuple(scene), output, as_json, quiet))


def _check_scenes(names: tuple[str, ...]) -> None:
    from vibro_cli.benchmark.scenes import BY_NAME

    unknown = sorted(set(names) - set(BY_NAME))
    if unknown:
        expected = ", ".join(BY_NAME)
        raise CommandError(f"vibro: --scene: no scene {unknown[0]!r}; expected one of {expected}")


def _measure(wishes: _BenchOptions) -> int:
    from vibro_cli.benchmark import methods, suite
    from vibro_cli.benchmark.measurement import PLANS, describe_machine
    from vibro_cli.benchmark.scenes import ReferenceOutdated
    from vibro_cli.storage.files import FolderRefused, check_replaceable

    _check_scenes(wishes.scenes)
    details = {"machine": describe_machine(), "plan": wishes.form}
    missing = sorted(set(methods.PEERS) - set(methods.installed_peers()))
    if missing and not wishes.quiet:
        names = ", ".join(missing)
        say(f"vibro: not measured because not installed: {names} (pip install 'vibro-cli[peers]')")
    rows: list[Row] = []
    try:
        check_replaceable(Path(wishes.output), "benchmark")
        for found in suite.run(PLANS[wishes.form], wishes.scenes):
            rows += found
            _tell(found, wishes)
        _write(rows, details, Path(wishes.output))
    except (FolderRefused, ReferenceOutdated) as error:
        raise CommandError(f"vibro: {error}") from error
    if not wishes.quiet:
        say(f"vibro: wrote {Path(wishes.output) / 'benchmark.html'}")
    return DONE


def _tell(rows: "list[Row]", wishes: _BenchOptions) -> None:
    for row in rows:
        if wishes.as_json:
            print(json_text(vars(row)), flush=True)
        elif not wishes.quiet:
            name = row.method if row.size is None else f"{row.method}, {row.part} {row.size}"
            time = "" if row.per_impact is None else f"{row.per_impact * 1e6:10.3g} µs an impact"
            error = "" if row.error is None else f"  error {row.error:.1e}"
            note = "" if row.status == "ok" else f"  {row.status}: {row.note}"
            print(f"{row.scene:12} {name:24} {row.setting:10}{time:23}{error}{note}", flush=True)


def _write(rows: "list[Row]", details: dict[str, Any], target: Path) -> None:
    from vibro_cli import __version__
    from vibro_cli.benchmark.measurement import parquet
    from vibro_cli.figures.style import render
    from vibro_cli.figures.work_precision import growth, work_precision
    from vibro_cli.report.benchmark_page import benchmark_html
    from vibro_cli.storage.files import (
        MANIFEST_NAME,
        check_replaceable,
        json_bytes,
        manifest,
        new_folder,
    )

    files = {
        "benchmark.parquet": parquet(rows, details),
        "benchmark.html": benchmark_html(rows, details, __version__),
    }
    figures: dict[str, Callable[..., Any]] = {"work_precision": work_precision}
    if any(row.part == "bodies" for row in rows):
        figures["growth"] = growth
    for name, draw in figures.items():
        for form in ("png", "pdf"):
            files[f"{name}.{form}"] = render(draw(rows), form)
    with new_folder(target, partial(check_replaceable, kind="benchmark")) as folder:
        for name, content in files.items():
            folder.write(name, content)
        folder.write(MANIFEST_NAME, json_bytes(manifest("benchmark", files, details)))


def _renew(target: str, names: tuple[str, ...]) -> int:
    from vibro_cli.benchmark.scenes import (
        SCENES,
        computed_reference,
        reference_difference,
        reference_file,
    )
    from vibro_cli.storage.files import (
        MANIFEST_NAME,
        FolderRefused,
        check_replaceable,
        json_bytes,
        manifest,
        new_folder,
    )

    _check_scenes(names)
    files, check = {}, partial(check_replaceable, kind="references")
    try:
        check(Path(target))
        for scene in SCENES:
            if names and scene.name not in names:
                continue
            content = computed_reference(scene)
            files[reference_file(scene)] = json_bytes(content)
            print(f"{scene.name}: {reference_difference(scene, content)}", flush=True)
        with new_folder(Path(target), check) as folder:
            for name, bytes_ in files.items():
                folder.write(name, bytes_)
            folder.write(MANIFEST_NAME, json_bytes(manifest("references", files, {})))
    except ModuleNotFoundError as error:
        raise CommandError(
            "vibro: mpmath is missing; install it with: pip install 'vibro-cli[stress]'"
        ) from error
    except FolderRefused as error:
        raise CommandError(f"vibro: {error}") from error
    return DONE


@dataclass(frozen=True)
class _StressOptions:
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
            help="How many scenes the checks drawn and digits draw [default: as many as each has].",
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
    wishes = _StressOptions(full, seed, tuple(only), cases, as_json, output, quiet)
    return partial(_run_suite, wishes)


def _run_suite(wishes: _StressOptions) -> int:
    from vibro_cli.storage.files import FolderRefused
    from vibro_cli.stress.scenes import Plan
    from vibro_cli.stress.suite import (
        NAMES,
        MissingLibrary,
        check_stress_folder,
        line_of,
        record_of,
        run,
        write,
    )

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
