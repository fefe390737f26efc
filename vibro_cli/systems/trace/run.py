"""Running a system of bodies on a trace."""

from __future__ import annotations

from typing import Any

from vibro_cli.mechanics.system import System
from vibro_cli.systems import run
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import SYSTEM
from vibro_cli.systems.wanted import Limits, Wanted

__all__ = ["Run", "Wanted", "simulate_system"]


def simulate_system(
    system: System,
    stop_time: float | None,
    stop_collisions: int | None,
    engine: str = "compiled",
    wanted: Wanted | None = None,
    checkpoint: dict[str, Any] | None = None,
    history: dict[str, Any] | None = None,
) -> Run:
    """Run bodies on a trace until the first of the stops (s and a count), see ``systems.run``."""
    limits = Limits(stop_time, stop_collisions)
    return run.simulate(SYSTEM, system, limits, engine, wanted or Wanted(), checkpoint, history)
