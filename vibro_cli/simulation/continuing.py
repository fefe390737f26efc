"""Going on with a run from its checkpoint: what it holds, and whether it can go on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from vibro_cli.simulation.drive import Earlier

CHECKPOINT_FORMAT = 2
# Ends after which nothing can follow, whatever the stop.
FINAL = ("inadmissible", "end_of_trace", "lift_off", "wall_contact", "accumulation")


class CannotContinue(ValueError):
    """An earlier run cannot go on; the message says why."""


def checkpoint_of(
    end_cause: str, end_time: float, counts: Mapping[str, int], state: Mapping[str, Any]
) -> dict[str, Any]:
    """Return a checkpoint as plain values.

    Parameters
    ----------
    end_cause, end_time
        Why and when (s) the run stopped.
    counts
        What its stops may count: ``collisions``, on a table ``bounces`` too.
    state
        All that changes in a run, after the last event.
    """
    head = {"format": CHECKPOINT_FORMAT, "end_cause": end_cause, "end_time": end_time}
    return {**head, **counts, "state": state}


def earlier_part(
    checkpoint: Mapping[str, Any],
    history: Mapping[str, Any] | None,
    logs: Iterable[str],
    stop_time: float | None,
    **limits: int | None,
) -> Earlier:
    """Return the part of a run before its checkpoint, once it is known that it can go on.

    Parameters
    ----------
    checkpoint, history
        Of the earlier run.
    logs
        Names of the logs that its history must have.
    stop_time, limits
        The stops of the run that goes on: s, and the greatest count of each kind.

    Raises
    ------
    CannotContinue
        If the earlier run had ended for good, or is past a stop.
    """
    if checkpoint.get("format") != CHECKPOINT_FORMAT:
        raise CannotContinue("the checkpoint was written by another version")
    if checkpoint["end_cause"] in FINAL:
        raise CannotContinue(f"the run had ended for good: {checkpoint['end_cause']}")
    if history is None or set(history) != set(logs):
        raise CannotContinue("a checkpoint needs the history of its run")
    reached = checkpoint["end_time"]
    if stop_time is not None and stop_time <= reached:
        raise CannotContinue(f"the run is at t = {reached!r} s; expected a later stop.time")
    for kind, most in limits.items():
        count = checkpoint[kind]
        if most is not None and most <= count:
            words = "impacts" if kind == "collisions" else f"{kind} on the wall"
            raise CannotContinue(f"the run has {count} {words}; expected a greater stop.{kind}")
    return Earlier(checkpoint["state"], dict(history))
