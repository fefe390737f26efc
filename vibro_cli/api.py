"""Run scenarios of any system."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from vibro_cli.assemble import build_any
from vibro_cli.errors import Failure
from vibro_cli.systems import run, system_named
from vibro_cli.systems.contract import Motion, Sink
from vibro_cli.systems.driver import CannotContinue, TooQuiet, check_continuable
from vibro_cli.systems.run import Run, Streamed, begun, stream

if TYPE_CHECKING:
    from vibro_cli.scenario.base import AnyScenario

__all__ = ["CannotContinue", "Run", "TooQuiet", "simulate", "simulate_streamed"]


def simulate(
    scenario: AnyScenario,
    engine: str = "compiled",
    checkpoint: dict[str, Any] | None = None,
    history: dict[str, Any] | None = None,
) -> Run:
    """Run a scenario to its end; both engines give the same bits.

    Given ``checkpoint()`` and ``history()`` of an earlier run of the scenario with an earlier stop,
    the run continues as if it had not been interrupted. Raises ``ScenarioError``, with all problems
    and their places, if the scenario is mechanically impossible; ``TooQuiet`` as
    ``systems.run.simulate``; ``CannotContinue`` if the earlier run had ended for good or is past
    the stop.
    """
    system = build_any(scenario)
    kind = system_named(scenario.system)
    return run.simulate(
        kind, system, kind.limits(scenario), engine, kind.wanted(scenario),
        checkpoint, history,
    )  # fmt: skip


def simulate_streamed(
    scenario: AnyScenario,
    sink: Sink,
    engine: str = "compiled",
    checkpoint: dict[str, Any] | None = None,
    figures: bool = False,
    interrupted: Callable[[], bool] = lambda: False,
    **more: Any,
) -> Streamed:
    """Run a scenario to its end, and pass the rows of its tables to a sink as they are computed.

    The sink receives the name of a table and further rows of it, in order of time; `more` are
    arguments of ``systems.run.stream``. With `figures`, systems that are slow to solve keep the
    motion. When `interrupted` returns true, the run ends after its last event, and its motion may
    lack samples. Raises ``CannotContinue`` unless a run from the checkpoint can be continued.
    """
    kind = system_named(scenario.system)
    limits = kind.limits(scenario)
    if checkpoint is not None:
        check_continuable(checkpoint, limits)
    system = build_any(scenario)
    stretches = begun(kind, system, limits, engine)
    wanted = replace(kind.wanted(scenario), figures=figures, interrupted=interrupted)
    return stream(kind, system, stretches, sink, wanted, **more)


class NotRecalled(Failure):
    """A run that was solved again does not end in its stored state."""


def recalled(scenario: AnyScenario, checkpoint: Mapping[str, Any]) -> Run:
    """Return a finished run with its motion, by solving it again from its start to the same bits.

    Raises ``NotRecalled`` if the bits differ, as sines may be rounded differently on another
    machine.
    """
    kind = system_named(scenario.system)
    limits = kind.limits(scenario)
    cut = checkpoint["end_cause"] == "interrupted"
    if cut:  # its last event may have been later than the nearest double before it
        limits = replace(limits, time=math.nextafter(checkpoint["end_time"], math.inf))
    again = run.simulate(kind, build_any(scenario), limits, wanted=kind.wanted(scenario), cut=cut)
    if cut:
        return again.cut_back(checkpoint)
    _check_recalled(again.state, checkpoint)
    return again


def recalled_motion(scenario: AnyScenario, checkpoint: Mapping[str, Any]) -> Motion:
    """Return the motion of a finished run; otherwise as :func:`recalled`.

    No log is kept for a long run.
    """
    kind, cut = system_named(scenario.system), checkpoint["end_cause"] == "interrupted"
    limits, rows = kind.limits(scenario), checkpoint["rows"]
    motion = kind.long_motion(build_any(scenario), limits, rows, cut)
    # The interpreter checks for interruption more often, so its run may have ended elsewhere.
    if motion is None or (cut and motion.state != checkpoint["state"]):
        return recalled(scenario, checkpoint)
    _check_recalled(motion.state, checkpoint)
    return motion


def _check_recalled(state: Mapping[str, Any], checkpoint: Mapping[str, Any]) -> None:
    """Raise ``NotRecalled`` unless the state at the end equals that of the checkpoint."""
    if state != checkpoint["state"]:
        raise NotRecalled(
            "solved again, the run does not end in the stored state; expected a run from this "
            "machine or one like it"
        )
