"""The portrait of bodies on springs without a run."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from matplotlib.figure import Figure

from vibro_cli.systems.springs.phase_plane import spring_periods, springs_record
from vibro_cli.systems.springs.portrait import springs_structure
from vibro_cli.systems.springs.system import SpringsSystem


def swings(system: SpringsSystem) -> Iterator[dict[str, float | None]]:
    """Return ω₀ (1/s) of each body and its periods (s), None where there is none."""
    for ball in range(1, len(system.bodies) + 1):
        small, own = (
            period if math.isfinite(period) else None for period in spring_periods(system, ball)
        )
        yield {"omega_0": system.frequency(ball - 1), "small_period": small, "period": own}


def portrait(
    system: SpringsSystem, width: str, drawn: bool
) -> tuple[dict[str, Any], dict[str, Figure]]:
    """Return the singular points of each body, and a figure of each."""
    balls = range(1, len(system.bodies) + 1)
    bodies = [springs_record(system, ball - 1) for ball in balls]
    figures = {f"portrait_{n}": springs_structure(system, n, width) for n in balls if drawn}
    return {"system": "springs", "bodies": bodies}, figures


def portrait_lines(found: dict[str, Any]) -> Iterator[str]:
    """Return the table as text."""
    for body in found["bodies"]:
        yield f"ball {body['ball']}: {body['body']}, r = {body['radius']:g} m: {body['type']}"
        yield from _lines(body)


def _lines(body: dict[str, Any]) -> Iterator[str]:
    yield "  point  kind    from foot [m]       x [m]      E [J]  spring"
    for point in body["points"]:
        state = "stressed" if point["stressed"] else "unstressed"
        yield (
            f"  {point['name']:5}  {point['kind']:6}  {point['displacement']:13.9f}  "
            f"{point['x']:10.6f}  {point['energy']:9.6g}  {state}"
        )
    yield f"  ω₀ = {body['frequency']:.9g} 1/s"
    if body["separatrix_speed"] is not None:
        yield f"  on the separatrix at most {body['separatrix_speed']:.9g} m/s, over the centres"
