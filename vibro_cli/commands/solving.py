"""Solving one scenario of `vibro run`, and putting its results where they were asked."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibro_cli.commands.boundary import DONE, NOT_STRICT, CommandError, say
from vibro_cli.commands.options import TableFormat
from vibro_cli.commands.streams import json_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vibro_cli.api import AnyRun
    from vibro_cli.scenario.systems import AnyScenario
    from vibro_cli.simulation.run import Run
    from vibro_cli.storage.runs import EarlierRun

_PORTRAIT_FORMS = ("png", "pdf")


@dataclass(frozen=True)
class Wishes:
    """What was asked of `vibro run`; `output` and `stream` are None where nothing was said."""

    sources: Sequence[str]
    overrides: Sequence[str]
    earlier: Path | None
    engine: str
    output: str | None
    stream: TableFormat | None
    summary_as_json: bool
    figures: bool
    strict: bool
    fail_fast: bool

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


def solve(wishes: Wishes, scenario: "AnyScenario", earlier: "EarlierRun | None") -> int:
    """Run a scenario and put its results where they were asked; return the exit code."""
    from vibro_cli.commands.words import summary_text
    from vibro_cli.storage.provenance import FolderRefused
    from vibro_cli.storage.runs import write_run

    result = _simulate(wishes, scenario, earlier)
    folder = wishes.folder_of(scenario.name)
    if folder is not None:
        try:
            write_run(result, scenario, folder, _figures(result) if wishes.figures else {})
        except FolderRefused as error:
            raise CommandError(f"vibro: {error}") from error
    record = result.summary_record()
    if wishes.stream is not None:
        _stream_collisions(result, scenario, wishes.stream)
    if wishes.summary_as_json:
        print(json_text({"scenario": scenario.name, **record}), flush=True)
    say(summary_text(scenario.name, record, folder), scenario=scenario.name)
    for omission in result.skipped:
        say(f"  skipped    {omission}", "detail", scenario=scenario.name)
    return DONE if is_sound(record) or not wishes.strict else NOT_STRICT


def _simulate(wishes: Wishes, scenario: "AnyScenario", earlier: "EarlierRun | None") -> "AnyRun":
    """The run of a scenario, from its start or from where an earlier run of it stopped."""
    from vibro_cli.api import CannotContinue, TooQuiet, simulate
    from vibro_cli.commands.warm import tell_of_compiling

    tell_of_compiling()
    try:
        if earlier is None:
            return simulate(scenario, engine=wishes.engine)
        return simulate(scenario, wishes.engine, earlier.checkpoint, earlier.history)
    except TooQuiet as error:
        raise CommandError(f"vibro: {scenario.name}: {error}") from error
    except CannotContinue as error:
        raise CommandError(f"vibro: {wishes.earlier} cannot be continued: {error}") from error


def is_sound(record: dict[str, Any]) -> bool:
    """Whether a summary is of a run that --strict accepts."""
    return bool(record["status"] == "ok" and record["end_cause"] != "inadmissible")


def _figures(result: "AnyRun") -> dict[str, bytes]:
    """The figures of a run: names of files and their contents."""
    from vibro_cli.systems.springs.run import SpringsRun
    from vibro_cli.systems.table.run import TableRun

    if isinstance(result, TableRun | SpringsRun):
        from vibro_cli.figures.system_kinds import draw_system

        each = [_files(drawn.name, drawn.figure) for drawn in draw_system(result, "single")]
        return {name: content for files in each for name, content in files.items()}
    return _portraits(result)


def _files(stem: str, figure: "Figure") -> dict[str, bytes]:
    """A figure in both forms."""
    from vibro_cli.figures.output import render

    return {f"{stem}.{form}": render(figure, form) for form in _PORTRAIT_FORMS}


def _portraits(result: "Run") -> dict[str, bytes]:
    """The phase portrait of every body."""
    from vibro_cli.figures.portrait import phase_portrait

    width = "double" if len(result.system.trace.pieces) > 1 else "single"
    files: dict[str, bytes] = {}
    for ball in range(1, len(result.system.bodies) + 1):
        files |= _files(f"portrait_{ball}", phase_portrait(result, ball, width))
    return files


def _stream_collisions(result: "AnyRun", scenario: "AnyScenario", form: TableFormat) -> None:
    """Write the collision table to standard output."""
    from vibro_cli.storage.runs import origin_of, run_table
    from vibro_cli.storage.tables import stream

    stream(run_table(result, "collisions", origin_of(scenario)), form, sys.stdout.buffer)
    sys.stdout.buffer.flush()
