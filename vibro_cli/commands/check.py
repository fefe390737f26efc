"""`vibro check`: validate scenarios and grids, and show what was understood."""

from collections.abc import Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibro_cli.commands.boundary import DONE, MISUSED, CommandError, say
from vibro_cli.commands.options import FailFast, Overrides, Quiet, Scenarios, Task
from vibro_cli.commands.streams import json_text

if TYPE_CHECKING:
    from vibro_cli.assemble import AnySystem
    from vibro_cli.grids.document import Grid
    from vibro_cli.scenario.base import AnyScenario


def check(
    scenarios: Scenarios,
    overrides: Overrides = [],  # noqa: B006 (typer copies it)
    as_json: Annotated[bool, typer.Option("--json", help="Print it as JSON, a line each.")] = False,
    fail_fast: FailFast = False,
    quiet: Quiet = False,
) -> Task:
    """Validate scenarios or grids and show what was understood."""
    return partial(_check_all, scenarios, overrides, as_json, fail_fast, quiet)


def _check_all(
    sources: Sequence[str],
    overrides: Sequence[str],
    as_json: bool,
    fail_fast: bool,
    quiet: bool,
) -> int:
    """Show what was understood of each scenario, or what is wrong with it, in their order."""
    from vibro_cli.commands.loading import check_standard_input, load_scenario_or_grid

    check_standard_input(sources)
    code = DONE
    for source in sources:
        try:
            found, lines = _understood(load_scenario_or_grid(source, overrides))
        except CommandError as error:
            if as_json:
                refusal = {"source": source, "valid": False, "problems": error.problems}
                print(json_text(refusal))
            if fail_fast or len(sources) == 1:
                raise
            say(str(error), "error", problems=error.problems)
            code = MISUSED
            continue
        if as_json:
            print(json_text(found))
        elif not quiet:
            print("\n".join(lines))
    return code


def _understood(
    read: "tuple[AnyScenario, AnySystem] | Grid",
) -> tuple[dict[str, Any], Iterable[str]]:
    """What a scenario or a grid means, as plain values and as lines of text."""
    if not isinstance(read, tuple):
        from vibro_cli.commands.checking_grids import lines_of_grid, understood_grid

        found = understood_grid(read)
        return found, lines_of_grid(found)
    from vibro_cli.systems import system_named

    scenario, system = read
    kind = system_named(scenario.system)
    found = kind.understood(scenario, system)
    return found, kind.understood_lines(found)
