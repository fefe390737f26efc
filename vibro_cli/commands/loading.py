"""Scenarios from the command line: all of them are read, and all their problems told at once."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from vibro_cli.commands.boundary import CommandError, reason

if TYPE_CHECKING:
    from vibro_cli.mechanics.system import System
    from vibro_cli.scenario import Scenario


@dataclass(frozen=True)
class Refused:
    """A scenario that cannot be used, and why."""

    source: str
    error: CommandError


def load(source: str, overrides: Sequence[str]) -> tuple["Scenario", "System"]:
    """A scenario with the system it describes.

    Raises `CommandError` with every problem of it.
    """
    from vibro_cli.build import build_system
    from vibro_cli.scenario import ScenarioError, load_scenario

    try:
        scenario = load_scenario(source, overrides)
        return scenario, build_system(scenario)
    except ScenarioError as error:
        problems = [asdict(problem) for problem in error.problems]
        raise CommandError(str(error), problems=problems) from error
    except OSError as error:
        text = f"cannot be read: {reason(OSError(error.errno, error.strerror))}"
        problem = {"path": "", "message": text, "file": source}
        raise CommandError(f"{source}: {text}", problems=[problem]) from error


def load_each(
    sources: Sequence[str], overrides: Sequence[str]
) -> tuple[list[tuple["Scenario", "System"]], list[Refused]]:
    """Every scenario that can be used, and every one that cannot."""
    if sources.count("-") > 1:
        raise CommandError("vibro: standard input (-) can be read only once")
    loaded, refused = [], []
    for source in sources:
        try:
            loaded.append(load(source, overrides))
        except CommandError as error:
            refused.append(Refused(source, error))
    return loaded, refused


def load_all(sources: Sequence[str], overrides: Sequence[str]) -> list[tuple["Scenario", "System"]]:
    """Every scenario with the system it describes.

    Raises `CommandError` with every problem of every scenario.
    """
    loaded, refused = load_each(sources, overrides)
    if refused:
        raise together(refused)
    return loaded


def together(refused: Sequence[Refused]) -> CommandError:
    """One error with the problems of all scenarios that cannot be used."""
    return CommandError(
        "\n".join(str(one.error) for one in refused),
        problems=[problem for one in refused for problem in one.error.problems],
    )


def check_names(scenarios: Sequence["Scenario"]) -> None:
    """Raise `CommandError` unless the names, which are also those of folders, are different."""
    for name, times in Counter(scenario.name for scenario in scenarios).items():
        if times > 1:
            raise CommandError(
                f"vibro: {times} scenarios are called {name!r}; expected different names "
                "(each has a folder of that name)"
            )
