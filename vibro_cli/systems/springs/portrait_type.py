"""The phase portrait of a body on a spring: singular points, their energies, the separatrix."""

from __future__ import annotations

from typing import Any

from vibro_cli.systems.springs.system import SpringsSystem, separatrix_speed, singular_points

TYPES = {1: "one centre", 3: "saddle between two centres (trigger)"}
"""By the number of singular points (C, part 3)."""


def point_names(system: SpringsSystem, index: int) -> tuple[str, ...]:
    """Return the names of the singular points of a body (from 0), each kind from the left."""
    kinds = [kind for _, kind in singular_points(system.springs[index])]
    return tuple(
        f"{'S' if kind == 'saddle' else 'C'}{kinds[: place + 1].count(kind)}"
        for place, kind in enumerate(kinds)
    )


def springs_record(system: SpringsSystem, index: int) -> dict[str, Any]:
    """Return type and singular points of a body (from 0) as plain values.

    Places are in m along the line and from the spring's foot, energies of the spring in J; the
    greatest speed on the separatrix, over the centres, in m/s, where there is one.
    """
    spring, body = system.springs[index], system.bodies[index]
    points = singular_points(spring)
    speed = None
    if len(points) == 3:
        speed = separatrix_speed(spring, system.frequency(index), points[0][0])
    return {
        "ball": index + 1,
        "body": body.kind,
        "radius": body.radius,
        "type": TYPES[len(points)],
        "frequency": system.frequency(index),
        "separatrix_speed": speed,
        "points": [
            {
                "name": name,
                "kind": kind,
                "displacement": place,
                "x": spring.foot + place,
                "energy": spring.energy(place),
                "stressed": kind == "saddle" or spring.length < spring.height,
            }
            for name, (place, kind) in zip(point_names(system, index), points, strict=True)
        ],
    }
