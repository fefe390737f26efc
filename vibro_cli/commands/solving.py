"""Solving one scenario of `vibro run`, and putting its results where they were asked."""

from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibro_cli.commands.boundary import DONE, NOT_STRICT, CommandError, say
from vibro_cli.commands.options import TableFormat
from vibro_cli.commands.progress import RunProgress
from vibro_cli.commands.streams import json_text
from vibro_cli.commands.suggesting import suggestion

if TYPE_CHECKING:
    from collections.abc import Iterator

    from vibro_cli.scenario.base import AnyScenario
    from vibro_cli.storage.runs import EarlierRun
    from vibro_cli.storage.stored import StoredRun
    from vibro_cli.systems.run import Run
    from vibro_cli.systems.stream import Streamed

_FORMS = ("png", "pdf")
_NONE = ("0", "false", "none")


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
    figures: str
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

        asked = self.figures.strip()
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
    from vibro_cli.commands.following import stream_run

    folder = wishes.folder_of(scenario.name)
    return _told(wishes, scenario, folder, stream_run(wishes, scenario, earlier, folder))


def _told(
    wishes: Wishes,
    scenario: "AnyScenario",
    folder: Path | None,
    result: "Streamed",
) -> int:
    """Say what came of a run; return the exit code."""
    from vibro_cli.commands.words import summary_text
    from vibro_cli.systems import system_named

    record = result.summary_record()
    if wishes.summary_as_json:
        print(json_text({**wishes.line_head(scenario.name, folder), **record}), flush=True)
    one_sided = system_named(scenario.system).one_sided(scenario)
    say(summary_text(scenario.name, record, folder, one_sided), scenario=scenario.name)
    for omission in result.skipped:
        say(f"  skipped    {omission}", "detail", scenario=scenario.name)
    return DONE if is_sound(record) or not wishes.strict else NOT_STRICT


@contextmanager
def followed(wishes: Wishes, scenario: "AnyScenario") -> "Iterator[None]":
    """Tell how far a run in the block is, and say why it cannot go on."""
    from vibro_cli.api import CannotContinue, TooQuiet
    from vibro_cli.systems.watching import watched_by

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
    from vibro_cli.figures.kinds import draw_all
    from vibro_cli.figures.output import render

    drawn = draw_all(result, names, result.kind.figure_width(result.system))
    return {f"{one.name}.{form}": render(one.figure, form) for one in drawn for form in _FORMS}
