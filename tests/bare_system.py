"""A system on a trace without a scenario, as `vibro_cli.assemble` builds it."""

from __future__ import annotations

from typing import Any

from vibro_cli.mechanics.system import Body, InitialState, TraceSystem
from vibro_cli.mechanics.trace import Trace

GRAVITY = 9.81


def bare_system(
    trace: Trace, bodies: tuple[Body, ...], initial: tuple[InitialState, ...], **fields: Any
) -> TraceSystem:
    """Return a system on a trace at rest without walls, k = 1, except for the given fields."""
    rest: dict[str, Any] = {
        "gravity": GRAVITY,
        "restitution": (1.0,) * max(len(bodies) - 1, 1),
        "law": "normal-impulse",
        "inadmissible": "stop",
        "surface": "two-sided",
        "left_end": None,
        "right_end": None,
        "turning": None,
    }
    return TraceSystem(trace=trace, bodies=bodies, initial=initial, **{**rest, **fields})
