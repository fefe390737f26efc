"""`vibro run --continue`: a run of ours, with a later stop."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from vibro_cli.commands.boundary import CommandError

if TYPE_CHECKING:
    from vibro_cli.storage.runs import EarlierRun

CHANGEABLE = ("stop", "output")


def read_earlier(folder: Path, overrides: Sequence[str]) -> "tuple[Path, EarlierRun | None]":
    """The scenario that goes on, and what a folder keeps of its run.

    That is None where a run was killed on its way there: it is solved from its start.

    Raises `CommandError` when it holds no run that can be continued, and for overrides that would
    make it another run.
    """
    from vibro_cli.storage.runs import NotContinuable, read_earlier_run, scenario_of_killed_run

    for text in overrides:
        section = text.partition("=")[0].strip().partition(".")[0]
        if section not in CHANGEABLE:
            raise CommandError(
                f"--set {text}: found a value of {section!r}, expected one of stop or output "
                "(with --continue the rest of the scenario stays as it was)"
            )
    killed = scenario_of_killed_run(folder)
    if killed is not None:
        return killed, None
    try:
        found = read_earlier_run(folder)
        return found.scenario, found
    except NotContinuable as error:
        raise CommandError(f"vibro: {error}") from error
