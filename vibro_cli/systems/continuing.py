"""Going on with a run from its checkpoint: what it holds, and whether it can go on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from vibro_cli.errors import VibroError
from vibro_cli.systems.driver import Earlier
from vibro_cli.systems.wanted import Limits

CHECKPOINT_FORMAT = 4
# Ends after which nothing can follow, whatever the stop.
FINAL = ("inadmissible", "end_of_trace", "lift_off", "wall_contact", "accumulation")
# What stops count, in words.
COUNTED = {"collisions": "impacts", "bounces": "bounces on the wall"}


class CannotContinue(VibroError, ValueError):
    """An earlier run cannot go on; the message says why."""


def checkpoint_of(
    end_cause: str,
    end_time: float,
    clock: Mapping[str, Any],
    rows: Mapping[str, int],
    state: Mapping[str, Any],
) -> dict[str, Any]:
    """Return a checkpoint as plain values.

    Parameters
    ----------
    end_cause, end_time
        Why and when (s) the run stopped.
    clock
        Of the run then: from it what its stops may count.
    rows
        How many rows each of its logs had by then.
    state
        All that changes in a run, after the last event.
    """
    head = {"format": CHECKPOINT_FORMAT, "end_cause": end_cause, "end_time": end_time}
    counts = {kind: int(clock[kind]) for kind in COUNTED if kind in clock}
    return {**head, **counts, "rows": dict(rows), "state": state}


def earlier_part(
    checkpoint: Mapping[str, Any],
    history: Mapping[str, Any] | None,
    logs: Iterable[str],
    limits: Limits,
) -> Earlier:
    """Return the part of a run before its checkpoint, once it is known that it can go on.

    Parameters
    ----------
    checkpoint, history
        Of the earlier run.
    logs
        Names of the logs that its history must have.
    limits
        Of the run that goes on.

    Raises
    ------
    CannotContinue
        If the earlier run had ended for good, or is past a stop.
    """
    check_continuable(checkpoint, limits)
    if history is None or set(history) != set(logs):
        raise CannotContinue("a checkpoint needs the history of its run")
    return Earlier(checkpoint["state"], dict(history))


def check_continuable(checkpoint: Mapping[str, Any], limits: Limits) -> None:
    """Raise `CannotContinue` unless a run goes on from a checkpoint, see :func:`earlier_part`."""
    if checkpoint.get("format") != CHECKPOINT_FORMAT:
        raise CannotContinue("the checkpoint was written by another version")
    if checkpoint["end_cause"] in FINAL:
        raise CannotContinue(f"the run had ended for good: {checkpoint['end_cause']}")
    reached = checkpoint["end_time"]
    if limits.time is not None and limits.time <= reached:
        raise CannotContinue(f"the run is at t = {reached!r} s; expected a later stop.time")
    for kind, words in COUNTED.items():
        most = getattr(limits, kind)
        if most is not None and most <= checkpoint[kind]:
            count = checkpoint[kind]
            raise CannotContinue(f"the run has {count} {words}; expected a greater stop.{kind}")
