"""Scenarios from the command line: all of them are read, and all their problems told at once."""

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from vibro_cli.commands.boundary import CommandError, reason

if TYPE_CHECKING:
    from vibro_cli.mechanics.system import System
    from vibro_cli.scenario import Scenario


def load_all(sources: Sequence[str], overrides: Sequence[str]) -> list[tuple["Scenario", "System"]]:
    """Every scenario with the system it describes.

    Raises `CommandError` with every problem of every scenario.
    """
    from vibro_cli.build import build_system
    from vibro_cli.scenario import ScenarioError, load_scenario

    if sources.count("-") > 1:
        raise CommandError("vibro: standard input (-) can be read only once")
    loaded, problems = [], []
    for source in sources:
        try:
            scenario = load_scenario(source, overrides)
            loaded.append((scenario, build_system(scenario)))
        except ScenarioError as error:
            problems.append(str(error))
        except OSError as error:
            problems.append(f"{source}: cannot be read: {reason(error)}")
    if problems:
        raise CommandError("\n".join(problems))
    return loaded


def check_names(scenarios: Sequence["Scenario"]) -> None:
    """Raise `CommandError` unless the names, which are also those of folders, are different."""
    for name, times in Counter(scenario.name for scenario in scenarios).items():
        if times > 1:
            raise CommandError(
                f"vibro: {times} scenarios are called {name!r}; expected different names "
                "(each has a folder of that name)"
            )
