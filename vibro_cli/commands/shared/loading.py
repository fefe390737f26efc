"""Load the scenarios of a command line, and collect the problems of all of them.

With `--continue` the scenario is that of an earlier run, with a later stop.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibro_cli.commands.shared.error_handling import CommandError, reason
from vibro_cli.commands.shared.options import scenario_files
from vibro_cli.errors import similar

if TYPE_CHECKING:
    from vibro_cli.grids.document import Grid
    from vibro_cli.scenario.base import AnyScenario
    from vibro_cli.scenario.quantities import Quantity
    from vibro_cli.storage.folders import EarlierRun


Refused = tuple[str, CommandError]
"""Source of an invalid scenario, and the error."""


def load_any(source: str, overrides: Sequence[str]) -> tuple["AnyScenario", Any]:
    """Load a scenario of any system and build the mechanical system that it describes.

    Raises `CommandError` with all problems of the scenario.
    """
    from vibro_cli.assemble import build_any
    from vibro_cli.scenario.loading import load_any as load_scenario

    with refusals_reported(source):
        scenario = load_scenario(source, overrides)
        return scenario, build_any(scenario)


@contextmanager
def refusals_reported(source: str) -> Iterator[None]:
    """Raise `CommandError` if what the block reads is invalid or cannot be read."""
    from vibro_cli.scenario.problems import ScenarioError

    try:
        yield
    except ScenarioError as error:
        problems = [asdict(problem) for problem in error.problems]
        raise CommandError(error.lines, problems=problems) from error
    except OSError as error:
        text = f"cannot be read: {reason(OSError(error.errno, error.strerror))}"
        if isinstance(error, FileNotFoundError):
            text += _file_meant(source)
        problem = {"path": "", "message": text, "file": source}
        raise CommandError(f"{source}: {text}", problems=[problem]) from error


def _file_meant(source: str) -> str:
    """Suggest, for a missing file, one of the gallery or one of a similar name."""
    from vibro_cli.scenario.gallery import grid_names, names

    name = Path(source).stem
    if name in (*names(), *grid_names()):
        return f" (vibro new {name} writes that of the gallery, vibro new --all the whole gallery)"
    beside = scenario_files(str(Path(source).parent / "_")[:-1])
    stems = {Path(name).stem: name for name in beside if Path(name).is_file()}
    close = similar(name, stems)
    return "" if close is None else f" (did you mean {stems[close]!r}?)"


def load_scenario_or_grid(
    source: str, overrides: Sequence[str]
) -> "tuple[AnyScenario, Any] | Grid":
    """Load a scenario, with the system that it describes, or a grid, whichever the file holds.

    Raises `CommandError` with all problems of the document.
    """
    from vibro_cli.assemble import build_any
    from vibro_cli.scenario.loading import any_scenario_of, is_grid, load_document

    with refusals_reported(source):
        document = load_document(source)
        if is_grid(document.data):
            from vibro_cli.grids.document import grid_of

            return grid_of(document, Path() if source == "-" else Path(source).parent, overrides)
        scenario = any_scenario_of(document, overrides)
        return scenario, build_any(scenario)


def load_each(
    sources: Sequence[str], overrides: Sequence[str]
) -> tuple[list[tuple["AnyScenario", Any]], list[Refused]]:
    """Load several scenarios; return the valid ones and the invalid ones with their errors."""
    check_standard_input(sources)
    loaded, refused = [], []
    for source in sources:
        try:
            loaded.append(load_any(source, overrides))
        except CommandError as error:
            refused.append((source, error))
    return loaded, refused


def check_standard_input(sources: Sequence[str]) -> None:
    """Raise `CommandError` if standard input is named twice."""
    if sources.count("-") > 1:
        raise CommandError("vibro: standard input (-) can be read only once")


def in_si_units(name: str, texts: Sequence[str], kind: "Quantity") -> list[float]:
    """Return numbers in SI units, written with or without their units, not checked for bounds.

    Raises `CommandError`, which begins with `name`, for any other text.
    """
    from pydantic_core import PydanticCustomError

    from vibro_cli.grids.axes import read_number
    from vibro_cli.scenario.loading import parse_value

    try:
        return [read_number(kind, parse_value(text.strip())) for text in texts]
    except PydanticCustomError as error:
        raise CommandError(f"vibro: {name}: {error.message()}") from error


def together(refused: Sequence[Refused]) -> CommandError:
    """Return one error with the problems of all invalid scenarios."""
    return CommandError(
        [line for _, error in refused for line in error.lines],
        problems=[problem for _, error in refused for problem in error.problems],
    )


def check_names(scenarios: Sequence["AnyScenario"]) -> None:
    """Raise `CommandError` if two scenarios have the same name, which also names their folder."""
    for name, times in Counter(scenario.name for scenario in scenarios).items():
        if times > 1:
            raise CommandError(
                f"vibro: {times} scenarios are called {name!r}; expected different names "
                "(each has a folder of that name)"
            )


def read_earlier(folder: Path, overrides: Sequence[str]) -> "tuple[Path, EarlierRun | None]":
    """Return the path of the scenario to continue, and the stored run in the folder.

    The run is None if it must be solved from its start: because it was killed, or because it has
    ended and lacks only figures or samples of its motion.

    Raises `NotContinuable` if the folder holds no run that can be continued, and `CommandError`
    for overrides of sections other than `CHANGEABLE`.
    """
    from vibro_cli.storage.files import LACKING
    from vibro_cli.storage.folders import read_earlier_run, scenario_of_killed_run
    from vibro_cli.systems.request import CHANGEABLE

    sections = [text.partition("=")[0].strip().partition(".")[0] for text in overrides]
    for text, section in zip(overrides, sections, strict=True):
        if section not in CHANGEABLE:
            raise CommandError(
                f"--set {text}: found a value of {section!r}, expected one of "
                f"{' or '.join(CHANGEABLE)} "
                "(with --continue the rest of the scenario stays as it was)"
            )
    killed = scenario_of_killed_run(folder)
    if killed is not None:
        return killed, None
    found = read_earlier_run(folder)
    has_ended = found.checkpoint["end_cause"] != "interrupted"
    lacking = LACKING & found.manifest.keys()
    return found.scenario, None if has_ended and lacking and "stop" not in sections else found
