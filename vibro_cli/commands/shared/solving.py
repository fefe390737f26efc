"""Solving one scenario of `vibro run`, and putting its results where they were asked.

Tables are written while the solver goes on.
"""

import contextlib
import re
import signal
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

from vibro_cli.commands.shared.error_handling import (
    DONE,
    NOT_STRICT,
    CommandError,
    Terminated,
    leaving,
    suggestion,
)
from vibro_cli.commands.shared.options import TableFormat
from vibro_cli.commands.shared.terminal import RunProgress, json_text, say

if TYPE_CHECKING:
    from vibro_cli.scenario.base import AnyScenario
    from vibro_cli.storage.folders import EarlierRun, StreamedFolder
    from vibro_cli.storage.stored import StoredRun
    from vibro_cli.systems.contract import Sink
    from vibro_cli.systems.run import Run, Streamed

_FORMS = ("png", "pdf")
_NONE = ("0", "false", "none")


@dataclass(frozen=True)
class Wishes:
    """What was asked of `vibro run`; None where nothing was said."""

    sources: Sequence[str]
    overrides: Sequence[str]
    earlier: Path | None
    engine: str
    output: str | None
    stream: TableFormat | None
    summary_as_json: bool
    figures: str | None
    strict: bool
    fail_fast: bool
    force: bool

    def folder_of(self, name: str) -> Path | None:
        """Where the results of a scenario go, or None where they are only streamed."""
        if self.output is None:
            if self.stream is not None:
                return None
            return Path("outputs") / name if self.earlier is None else self.earlier
        if self.output == "-":
            return None
        folder = Path(self.output)
        return folder / name if len(self.sources) > 1 else folder

    def kinds_of(self, system: str) -> list[str]:
        """The kinds of figures that are drawn of a run of a system.

        Raises `CommandError` for a name that is none of its kinds.
        """
        from vibro_cli.systems import system_named

        asked = _kinds_drawn(self.earlier) if self.figures is None else self.figures.strip()
        if asked.lower() in _NONE:
            return []
        if asked.lower() in ("default", "1", "true"):
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
        """What the JSON line of a scenario begins with: what was run, and where its results are."""
        return {
            "scenario": scenario,
            "overrides": overrides_told(self.overrides),
            "folder": None if folder is None else str(folder),
        }

    def unwritten(self, name: str) -> str:
        """What is said of a run that is interrupted before its folder is written."""
        if len(self.sources) > 1:
            return f"nothing of {name} was written, what was finished is kept"
        return "nothing was written"

    def may_replace(self, folder: Path) -> bool:
        """Whether a run of other parameters may be replaced: the one that is continued may be."""
        return self.force or (
            self.earlier is not None and self.earlier.resolve() == folder.resolve()
        )


def _kinds_drawn(earlier: Path | None) -> str:
    """The kinds of figures that an earlier run has, as `--figures` takes them."""
    from vibro_cli.storage.files import read_manifest

    manifest = None if earlier is None else read_manifest(earlier)
    if manifest is None:
        return "default"
    pictures = [Path(file).stem for file in manifest["files"] if file.endswith(".png")]
    # Where there is a figure of each body, its number follows the kind: portrait_1.png.
    return ",".join(re.sub(r"_\d+$", "", stem) for stem in pictures) or "0"


def overrides_told(texts: Sequence[str]) -> dict[str, Any]:
    """Overrides as plain values by their paths; what JSON has no form for, as it was given."""
    from vibro_cli.scenario.overrides import parse_value

    told: dict[str, Any] = {}
    for text in texts:
        path, _, given = (part.strip() for part in text.partition("="))
        try:
            told[path] = parse_value(given)
            json_text(told[path])
        except ValueError:
            told[path] = given
    return told


def solve(wishes: Wishes, scenario: "AnyScenario", earlier: "EarlierRun | None") -> int:
    """Run a scenario and put its results where they were asked; return the exit code."""
    folder = wishes.folder_of(scenario.name)
    return _told(wishes, scenario, folder, stream_run(wishes, scenario, earlier, folder))


def _told(
    wishes: Wishes,
    scenario: "AnyScenario",
    folder: Path | None,
    result: "Streamed",
) -> int:
    """Say what came of a run; return the exit code."""
    from vibro_cli.commands.shared.terminal import summary_text
    from vibro_cli.systems import system_named

    record = result.summary_record()
    if wishes.summary_as_json:
        print(json_text({**wishes.line_head(scenario.name, folder), **record}), flush=True)
    one_sided = system_named(scenario.system).one_sided(scenario)
    say(summary_text(scenario.name, record, folder, one_sided), scenario=scenario.name)
    for omission in result.skipped:
        say(f"  skipped    {omission}", "detail", scenario=scenario.name)
    return DONE if is_sound(record) or not wishes.strict else NOT_STRICT


@contextlib.contextmanager
def followed(wishes: Wishes, scenario: "AnyScenario") -> Iterator[None]:
    """Tell how far a run in the block is, and say why it cannot go on."""
    from vibro_cli.systems.driver import CannotContinue, TooQuiet
    from vibro_cli.systems.wanted import watched_by

    progress = RunProgress(scenario.name, scenario.stop.time, scenario.stop.collisions)
    try:
        with watched_by(progress.tell):
            yield
    except TooQuiet as error:
        raise CommandError(f"vibro: {scenario.name}: {error}") from error
    except CannotContinue as error:
        raise CommandError(f"vibro: {wishes.earlier} cannot be continued: {error}") from error
    finally:
        progress.end()


def is_sound(record: dict[str, Any]) -> bool:
    """Whether a summary is of a run that --strict accepts."""
    return bool(record["status"] == "ok" and record["end_cause"] != "inadmissible")


def figures_of(result: "Run | StoredRun", names: Sequence[str]) -> dict[str, bytes]:
    """Kinds of figures of a run: names of files and their contents."""
    from vibro_cli.figures.runs.kinds import draw_all
    from vibro_cli.figures.style import render

    drawn = draw_all(result, names, result.kind.figure_width(result.system))
    return {f"{one.name}.{form}": render(one.figure, form) for one in drawn for form in _FORMS}


_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")


class Interruption:
    """The first signal that asks a run to end: it ends after its last event, with its tables."""

    def __init__(self) -> None:
        self.number: int | None = None

    def __bool__(self) -> bool:
        return self.number is not None

    def note(self, number: int, frame: FrameType | None) -> None:
        """Take a signal; a second one ends the program at once."""
        if self.number is not None:
            raise _exception(number)
        self.number = number

    def passed_on(self) -> None:
        """Raise what the signal would have raised, now that the tables are written."""
        if self.number is not None:
            raise _exception(self.number)


def _exception(number: int) -> BaseException:
    return KeyboardInterrupt() if number == signal.SIGINT else Terminated(number)


@contextlib.contextmanager
def _heard(interruption: Interruption) -> Iterator[None]:
    """Have signals noted, but for those that whoever started us wants ignored (nohup)."""
    before: dict[int, Any] = {}
    try:
        for name in _SIGNALS:
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) != signal.SIG_IGN:
                before[number] = signal.signal(number, interruption.note)
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def stream_run(
    wishes: Wishes, scenario: "AnyScenario", earlier: "EarlierRun | None", target: Path | None
) -> "Streamed":
    """Run a scenario; its tables are in the folder, and streamed, when this returns.

    A run that is interrupted is written as far as it came; then the signal is passed on.
    """
    from vibro_cli.storage.files import FolderRefused
    from vibro_cli.storage.folders import streamed_folder

    interruption = Interruption()
    try:
        with contextlib.ExitStack() as open_ones:
            open_ones.enter_context(leaving(wishes.unwritten(scenario.name)))
            sinks: list[Sink] = []
            folder = None
            if target is not None:
                made = streamed_folder(scenario, target, wishes.may_replace(target))
                folder = open_ones.enter_context(made)
                sinks.append(folder.add)
            if wishes.stream is not None:
                sinks.append(open_ones.enter_context(_standard_output(wishes.stream, scenario)))
            result = _streamed(wishes, scenario, earlier, sinks, interruption)
            if folder is not None:
                figures = _figures(wishes, scenario, result, folder)
                folder.finish(result, figures)
    except FolderRefused as error:
        raise CommandError(f"vibro: {error}") from error
    interruption.passed_on()
    return result


def _streamed(
    wishes: Wishes,
    scenario: "AnyScenario",
    earlier: "EarlierRun | None",
    sinks: "list[Sink]",
    interruption: Interruption,
) -> "Streamed":
    """The run, told of to some sinks as it goes on."""
    from vibro_cli.api import simulate_streamed
    from vibro_cli.systems import system_named

    def add(name: str, rows: Any) -> None:
        for sink in sinks:
            sink(name, rows)

    checkpoint = None if earlier is None else earlier.checkpoint
    of_system = [table.file for table in system_named(scenario.system).tables()]
    names = of_system if len(sinks) > (wishes.stream is not None) else ["collisions"]
    # A reader of the stream may be slow, or have stopped: a signal is to end the waiting for it.
    heard = _heard(interruption) if len(names) > 1 else contextlib.nullcontext()
    with followed(wishes, scenario), heard:
        return simulate_streamed(
            scenario, add, wishes.engine, checkpoint, names=names,
            interrupted=interruption.__bool__, in_background=wishes.stream is None,
        )  # fmt: skip


@contextlib.contextmanager
def _standard_output(form: str, scenario: "AnyScenario") -> "Iterator[Sink]":
    """Standard output as a sink of the collision table."""
    from vibro_cli.storage.folders import origin_of
    from vibro_cli.storage.tables import StreamedTable, table_named

    streams: list[StreamedTable] = []

    def add(name: str, rows: Any) -> None:
        if name != "collisions":
            return
        if not streams:
            table = table_named(name, list(rows), scenario.system)
            streams.append(StreamedTable(sys.stdout.buffer, form, table, origin_of(scenario)))
        streams[0].add(rows)

    yield add
    for stream in streams:
        stream.finish()


def _figures(
    wishes: Wishes, scenario: "AnyScenario", result: "Streamed", folder: "StreamedFolder"
) -> dict[str, bytes]:
    """The figures of the run, which is solved again for them."""
    from vibro_cli.storage.stored import stored_run

    names = wishes.kinds_of(scenario.system)
    if not names:
        return {}
    written, summary = folder.end_tables(), result.summary_record()
    run = stored_run(written, scenario, result.checkpoint(), {}, summary)
    return figures_of(run.whole or run, names)
