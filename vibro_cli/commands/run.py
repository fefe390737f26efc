"""`vibro run`: solve scenarios, and write the tables, figures and summary of each.

Tables are written while the solver runs.
"""

import contextlib
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibro_cli.commands.shared.error_handling import (
    DONE,
    FAILED,
    INTERRUPTED,
    MISUSED,
    NOT_STRICT,
    CommandError,
    attempt,
    suggestion,
    terminate,
    upon_signals,
)
from vibro_cli.commands.shared.options import (
    Engine,
    FailFast,
    Overrides,
    Strict,
    TableFormat,
    output_option,
    scenario_argument,
)
from vibro_cli.commands.shared.terminal import (
    RunProgress,
    json_text,
    progress_shown,
    say,
    without,
)
from vibro_cli.systems import PLURALS

if TYPE_CHECKING:
    from vibro_cli.commands.shared.loading import Refused
    from vibro_cli.scenario.base import AnyScenario
    from vibro_cli.storage.folders import EarlierRun, StreamedFolder
    from vibro_cli.systems.contract import Sink
    from vibro_cli.systems.run import Streamed

_NONE = ("0", "false", "none")
_DEFAULT = ("default", "1", "true")
_OTHERS = " and ".join([*PLURALS.values()][1:])


@dataclass(frozen=True, kw_only=True)
class RunCommand:
    """Solve scenarios and write tables, figures and summaries."""

    scenarios: Annotated[list[str], scenario_argument(default_factory=list)]
    output: Annotated[
        str | None,
        output_option(
            metavar="DIR",
            help="Folder for the results [default: outputs/<name>]; DIR/<name> for several "
            "scenarios; - streams the collision table instead.",
        ),
    ] = None
    overrides: Overrides
    earlier: Annotated[
        Path | None,
        typer.Option(
            "--continue",
            metavar="DIR",
            help="Continue the run in DIR to a later stop (--set stop.time=…), as if it had "
            "never stopped. The results replace DIR unless -o is given; the same kinds of figures "
            "are drawn unless --figures is given.",
        ),
    ] = None
    figures: Annotated[
        str | None,
        typer.Option(
            metavar="all|NAME,…",
            envvar="VIBRO_FIGURES",
            help="Kinds of figures to draw (vibro help figures lists them), all, 0 for none, or "
            f"default: the phase portraits of traces, figures of the motion for {_OTHERS}.",
        ),
    ] = None
    no_figures: Annotated[bool, typer.Option("--no-figures", help="Draw no figures.")] = False
    engine: Engine = "compiled"
    form: Annotated[
        TableFormat | None,
        typer.Option(
            "--format",
            help="Stream the collision table to standard output in this format; no folder is "
            "written unless -o names one.",
        ),
    ] = None
    summary_as_json: Annotated[
        bool,
        typer.Option(
            "--json",
            help="Print a JSON object for each run, one per line: scenario, overrides, folder and "
            "the columns of its summary, all at one level.",
        ),
    ] = False
    strict: Strict = False
    fail_fast: FailFast = False
    force: Annotated[
        bool, typer.Option("--force", help="Replace a run in DIR even if its parameters differ.")
    ] = False

    def __post_init__(self) -> None:
        drawn = self.figures is not None and "VIBRO_FIGURES" not in os.environ
        if self.no_figures and drawn:
            raise typer.BadParameter("found --figures and --no-figures, expected one of them")
        if (self.earlier is None) == (not self.scenarios):
            raise CommandError(
                "vibro: Missing argument 'SCENARIO', or --continue DIR (see vibro run --help)"
                if self.earlier is None
                else "vibro: found a SCENARIO and --continue, expected one of them"
            )
        if self.stream is not None and len(self.scenarios) > 1:
            raise typer.BadParameter("one table is streamed at a time; expected one SCENARIO")
        if self.stream is not None and self.summary_as_json:
            raise typer.BadParameter("--json and a streamed table both need standard output")
        if self.stream is not None and self.output in (None, "-") and (drawn or self.force):
            raise typer.BadParameter(
                "a streamed table alone has no folder, which --figures and --force need; expected "
                "--format and -o DIR"
            )

    def __call__(self) -> int:
        """Run every scenario, or continue an earlier run."""
        return _run_all(self) if self.earlier is None else _continue(self, self.earlier)

    @property
    def stream(self) -> TableFormat | None:
        """Format in which the collision table is streamed, None if it is not streamed."""
        return "csv" if self.output == "-" and self.form is None else self.form

    def folder_of(self, name: str) -> Path | None:
        """Return the folder of a scenario's results, or None if they are only streamed."""
        if self.output is None:
            if self.stream is not None:
                return None
            return Path("outputs") / name if self.earlier is None else self.earlier
        if self.output == "-":
            return None
        folder = Path(self.output)
        return folder / name if len(self.scenarios) > 1 else folder

    def kinds_of(self, system: str) -> list[str]:
        """Return the kinds of figures to draw of a run of a system.

        Raises `CommandError` for a kind that the system does not have.
        """
        from vibro_cli.systems import system_named

        asked = _kinds_drawn(self.earlier) if self.figures is None else self.figures.strip()
        if self.no_figures or asked.lower() in _NONE:
            return []
        if asked.lower() in _DEFAULT:
            return list(system_named(system).default_figures)
        known = list(system_named(system).figures)
        names = known if asked == "all" else [name.strip() for name in asked.split(",")]
        for name in names:
            if name not in known:
                raise CommandError(
                    f"vibro: --figures: found {name!r}{suggestion(name, known)}, expected all or "
                    f"some of {', '.join(known)} (system {system})"
                )
        return list(dict.fromkeys(names))

    def line_head(self, scenario: str, folder: Path | None) -> dict[str, Any]:
        """Return the first entries of a scenario's JSON line: scenario, overrides and folder."""
        return {
            "scenario": scenario,
            "overrides": plain_overrides(self.overrides),
            "folder": None if folder is None else str(folder),
        }

    def may_replace(self, folder: Path) -> bool:
        """Return whether a run with other parameters may be replaced; a continued run may be."""
        return self.force or (
            self.earlier is not None and self.earlier.resolve() == folder.resolve()
        )


def _run_all(options: RunCommand) -> int:
    """Check all scenarios and folders, then run the scenarios one after the other."""
    from vibro_cli.systems import system_named

    loaded, refused = _checked(options)
    for _, error in refused:
        say(error.lines, "error", problems=error.problems)
    _print_refused(options, refused)
    codes = [MISUSED] * len(refused)
    for scenario, system in loaded:
        for warning in system_named(scenario.system).warnings(scenario, system):
            say(f"{scenario.name}: warning: {warning}", "warning", scenario=scenario.name)
        codes.append(attempt(partial(solve, options, scenario, None)))
        if options.fail_fast and codes[-1] in (FAILED, MISUSED):
            break
    worst_first = (FAILED, MISUSED, NOT_STRICT)
    return next((code for code in worst_first if code in codes), DONE)


def _checked(options: RunCommand) -> "tuple[list[tuple[AnyScenario, Any]], list[Refused]]":
    """Load the scenarios as `load_each` does, and check that their runs can be written."""
    from vibro_cli.commands.shared.loading import check_names, load_each, together

    loaded, refused = load_each(options.scenarios, options.overrides)
    for scenario, _ in loaded:
        options.kinds_of(scenario.system)
    check_names([scenario for scenario, _ in loaded])
    if refused and (options.fail_fast or not loaded):
        _print_refused(options, refused)
        raise together(refused)
    _check_folders(options, [scenario for scenario, _ in loaded])
    return loaded, refused


def _continue(options: RunCommand, folder: Path) -> int:
    from vibro_cli.commands.shared.loading import read_earlier, refusals_reported
    from vibro_cli.scenario.loading import load_stored

    source, found = read_earlier(folder, options.overrides)
    with refusals_reported(str(source)):
        scenario = load_stored(source, options.overrides)
    options.kinds_of(scenario.system)
    _check_folders(options, [scenario])
    return solve(options, scenario, found)


def _check_folders(options: RunCommand, scenarios: "Sequence[AnyScenario]") -> None:
    """Raise `FolderRefused`, before any run, if some results could not be put in their folder."""
    from vibro_cli.storage.folders import check_run_folder

    for scenario in scenarios:
        folder = options.folder_of(scenario.name)
        if folder is not None:
            check_run_folder(folder, scenario, options.may_replace(folder))


def _print_refused(options: RunCommand, refused: "list[Refused]") -> None:
    """Print a JSON line for each scenario that cannot be run, if --json was given."""
    if options.summary_as_json:
        for source, error in refused:
            line = {
                **options.line_head(source, None),
                "status": "invalid",
                "reason": str(error),
                "problems": error.problems,
            }
            print(json_text(line), flush=True)


def _kinds_drawn(earlier: Path | None) -> str:
    """Return the kinds of figures of an earlier run, drawn or not, as a `--figures` value."""
    if earlier is None:
        return "default"
    from vibro_cli.interface import kinds_in
    from vibro_cli.storage.files import read_manifest

    manifest = read_manifest(earlier)
    if manifest is None:
        return "default"
    return ",".join(manifest.get("undrawn") or kinds_in(manifest["files"])) or "0"


def plain_overrides(texts: Sequence[str]) -> dict[str, Any]:
    """Return overrides as plain values by path; values that JSON cannot hold stay as text."""
    from vibro_cli.scenario.loading import parse_value

    found: dict[str, Any] = {}
    for text in texts:
        path, _, given = (part.strip() for part in text.partition("="))
        try:
            found[path] = parse_value(given)
            json_text(found[path])
        except (TypeError, ValueError):  # a date in a table, an infinite number
            found[path] = given
    return found


def solve(options: RunCommand, scenario: "AnyScenario", earlier: "EarlierRun | None") -> int:
    """Run a scenario, store or stream its results, print its summary; return the exit code."""
    from vibro_cli.commands.shared.terminal import summary_text
    from vibro_cli.systems import system_named

    folder = options.folder_of(scenario.name)
    result = stream_run(options, scenario, earlier, folder)
    record = result.summary_record()
    if options.summary_as_json:
        print(json_text({**options.line_head(scenario.name, folder), **record}), flush=True)
    one_sided = system_named(scenario.system).one_sided(scenario)
    sound = record["status"] == "ok" and record["end_cause"] != "inadmissible"
    code = DONE if sound or not options.strict else NOT_STRICT
    ending = result.not_made, result.exponent_error
    lines = summary_text(scenario.name, record, folder, one_sided, *ending).split("\n")
    say(lines, "info" if code == DONE else "error", scenario=scenario.name)
    for omission in result.skipped:
        say(f"  skipped    {omission}", "detail", scenario=scenario.name)
    return code


@contextlib.contextmanager
def followed(options: RunCommand, scenario: "AnyScenario") -> Iterator[None]:
    """Show the progress of the run in the block; report a run that cannot be continued."""
    from vibro_cli.progress import RUN
    from vibro_cli.systems.driver import CannotContinue
    from vibro_cli.systems.request import TooManyInstants

    progress = RunProgress(scenario.name, scenario.stop.time, scenario.stop.collisions)
    try:
        with RUN.to(progress.update):
            yield
    except CannotContinue as error:
        raise CommandError(f"vibro: {options.earlier} cannot be continued: {error}") from error
    except TooManyInstants as error:
        raise CommandError(f"vibro: {scenario.name}: {error}") from error
    finally:
        progress.end()


class Interruption:
    """Records the first signal, at which the run ends early and keeps its tables."""

    def __init__(self) -> None:
        self.number: int | None = None
        self.left = "finished results are kept"
        """Message on what is left on the disk."""

    def __bool__(self) -> bool:
        return self.number is not None

    def note(self, number: int, frame: FrameType | None) -> None:
        """Record a signal; a second one ends the program at once."""
        if self.number is not None:
            terminate(number)
        self.number = number

    def lacking(self, name: str, result: "Streamed", kinds: list[str]) -> dict[str, Any]:
        """Return what the signal left out of a run; `kinds` are those of its figures."""
        if not self:
            return {}
        found: dict[str, Any] = {"undrawn": kinds} if kinds else {}
        if result.unsampled_from is not None:
            found["unsampled_from"] = result.unsampled_from
        if found:
            self.left += f", {name} {without(found)}"
        return found

    def passed_on(self) -> None:
        """Raise the exception of the recorded signal, now that the tables are written."""
        if self.number is not None:
            try:
                terminate(self.number)
            except KeyboardInterrupt as end:
                end.add_note(self.left)
                raise


def stream_run(
    options: RunCommand, scenario: "AnyScenario", earlier: "EarlierRun | None", target: Path | None
) -> "Streamed":
    """Run a scenario; write its tables to the folder, stream them, or both.

    An interrupted run is written as far as it came, unless the folder holds more of it; then the
    signal is raised again. A run that has had impacts but none for too long is written too; then a
    `CommandError` is raised.
    """
    from vibro_cli.storage.folders import goes_as_far, streamed_folder

    interruption = Interruption()
    with contextlib.ExitStack() as open_ones:
        folder = None
        if target is not None:
            # Until the folder is in place: no signal loses what was solved. Without a folder one
            # ends the wait for a slow or stopped reader of the stream at once.
            open_ones.enter_context(upon_signals(interruption.note))
            made = streamed_folder(scenario, target, options.may_replace(target))
            folder = open_ones.enter_context(made)
        result, refusal = _solved(options, scenario, earlier, folder, interruption)
        if folder is not None and target is not None:
            names = [] if refusal else options.kinds_of(scenario.system)
            figures = _figures(options, scenario, result, folder, names, interruption)
            end: float = result.summary_record()["end_time"]
            if interruption and goes_as_far(target, scenario, end):
                interruption.left = f"the results in {target}, which go as far or further, are kept"
                interruption.passed_on()  # which discards the unfinished folder
            folder.finish(result, figures, interruption.lacking(scenario.name, result, names))
    interruption.passed_on()
    if refusal:
        raise CommandError(f"{refusal}; the run until then, without figures, is kept in {target}")
    return result


def _solved(
    options: RunCommand,
    scenario: "AnyScenario",
    earlier: "EarlierRun | None",
    folder: "StreamedFolder | None",
    interruption: Interruption,
) -> "tuple[Streamed, str]":
    """Run a scenario, its rows passed to the folder and to standard output, if wanted.

    Also returns why a run with impacts had none for too long, else an empty text. Without a folder
    that keeps these impacts, this is raised as a `CommandError`.
    """
    from vibro_cli.api import simulate_streamed
    from vibro_cli.systems import system_named
    from vibro_cli.systems.driver import TooQuiet

    sinks: list[Sink] = [] if folder is None else [folder.add]

    def add(name: str, rows: Any) -> None:
        for sink in sinks:
            sink(name, rows)

    names, has_figures = ["collisions"], False
    checkpoint = None if earlier is None else earlier.checkpoint
    with contextlib.ExitStack() as open_ones:
        if options.stream is not None:
            sinks.append(open_ones.enter_context(_standard_output(options.stream, scenario)))
        open_ones.enter_context(followed(options, scenario))
        if folder is not None:
            names = [table.file for table in system_named(scenario.system).tables()]
            has_figures = bool(options.kinds_of(scenario.system))
        try:
            return simulate_streamed(
                scenario, add, options.engine, checkpoint, names=names,
                interrupted=interruption.__bool__, in_background=options.stream is None,
                figures=has_figures,
            ), ""  # fmt: skip
        except TooQuiet as error:
            refusal = f"vibro: {scenario.name}: {error}"
            if folder is None or not error.streamed.summary_record()["collisions"]:
                raise CommandError(refusal) from error
            return error.streamed, refusal


@contextlib.contextmanager
def _standard_output(form: str, scenario: "AnyScenario") -> "Iterator[Sink]":
    """Provide a sink that writes the collision table to standard output."""
    from vibro_cli.storage.folders import arrow_table
    from vibro_cli.storage.tables import GrowingTable

    streams: list[GrowingTable] = []

    def add(name: str, rows: Any) -> None:
        if name != "collisions":
            return
        data = arrow_table(name, rows, scenario)
        if not streams:
            streams.append(GrowingTable(sys.stdout.buffer, data.schema, form))
        streams[0].write(data.to_batches())

    yield add
    for stream in streams:
        stream.finish()


def _figures(
    options: RunCommand,
    scenario: "AnyScenario",
    result: "Streamed",
    folder: "StreamedFolder",
    names: Sequence[str],
    interruption: Interruption,
) -> dict[str, bytes]:
    """Draw the figures of the run, solving it again if need be; warn of figures that are empty.

    If the run or the drawing is interrupted, return none; the tables are kept.
    """
    if not names or interruption:
        return {}
    from vibro_cli.interface import figures_of, nothing_shown
    from vibro_cli.storage.stored import StoredRun

    written, summary = folder.end_tables(), result.summary_record()
    run = StoredRun(written, scenario, {}, summary, result.checkpoint(), result.motion)
    try:
        with upon_signals(terminate), progress_shown():
            if interruption:  # while the tables were ended
                return {}
            files = figures_of(run, names)
    except KeyboardInterrupt as end:
        interruption.number = getattr(end, "exit_code", INTERRUPTED) - 128
        return {}
    if (options.figures or "all").strip().lower() not in ("all", *_DEFAULT):
        for text in nothing_shown(run, names, files):
            say(f"{scenario.name}: {text}", "warning", scenario=scenario.name)
    return files
