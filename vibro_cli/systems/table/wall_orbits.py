"""The map of a ball's bounces on a wall around it: its singular points and first integral.

A ball of radius r inside an ellipse with semi-axes a, b moves to and fro along either axis. Its
centre meets a curve with the radius of curvature R there (``b^2/a - r`` at the ends of the x axis)
after chords of the length L (``2 (a - r)``): by the symmetry of both ends one bounce turns small
deviations with the trace ``2 (L/R - 1)``, so the orbit is a centre for L < 2 R and a saddle for
L > 2 R. At r = 0 and k = 1 the product of the angular momenta about the foci is kept.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibro_cli.systems.table.system import CIRCLE, ELLIPSE, Wall

Floats = NDArray[np.float64]


class TwoBounce(NamedTuple):
    """A motion to and fro along an axis of the wall."""

    axis: str
    kind: str
    """centre, saddle or degenerate."""
    length: float
    """L of the chord of the ball's centre, m."""
    curvature_radius: float
    """R of the curve of the centres at its ends, m."""
    trace: float
    """Of one bounce, 2 (L/R - 1)."""
    normal: float
    """Direction of the wall's normal at one end, rad from the x axis."""


def has_wall_portrait(wall: Wall | None) -> bool:
    """Return whether bounces on a wall have a portrait: on an ellipse or circle around the ball."""
    return wall is not None and wall.inside and wall.shape in (CIRCLE, ELLIPSE)


def two_bounce_orbits(wall: Wall, radius: float) -> tuple[TwoBounce, ...]:
    """Return the motions along both axes of a ball (radius in m); on a circle all are alike."""
    (a, b), found = wall.semi_axes, []
    for axis, along, across, normal in (("x", a, b, 0.0), ("y", b, a, 0.5 * math.pi)):
        length = 2.0 * (along - radius)
        curvature = across * across / along - radius
        kind = "degenerate" if a == b else "centre" if length < 2.0 * curvature else "saddle"
        trace = 2.0 * (length / curvature - 1.0)
        found.append(TwoBounce(axis, kind, length, curvature, trace, normal))
    return tuple(found)


def multiplier(orbit: TwoBounce) -> float | None:
    """Return by what a small deviation grows at each bounce of a saddle; None for others."""
    if orbit.kind != "saddle":
        return None
    half = 0.5 * abs(orbit.trace)
    return half + math.sqrt(half * half - 1.0)


def focal_product(wall: Wall, normal: Any, share: Any) -> Floats:
    """Return the product of the angular momenta about the foci over v^2 (m^2), at r = 0.

    `normal` is the direction of the wall's outer normal (rad), `share` the component of the unit
    velocity along the wall, anticlockwise.
    """
    a, b = wall.semi_axes
    nx, ny = np.cos(normal), np.sin(normal)
    height = np.sqrt((a * nx) ** 2 + (b * ny) ** 2)
    x, y = a * a * nx / height, b * b * ny / height
    inward = np.sqrt(1.0 - np.square(share))
    vx, vy = -share * ny - inward * nx, share * nx - inward * ny
    focus = math.sqrt(abs(a * a - b * b))
    fx, fy = (focus, 0.0) if a >= b else (0.0, focus)
    one = (x - fx) * vy - (y - fy) * vx
    other = (x + fx) * vy - (y + fy) * vx
    product: Floats = one * other
    return product


def wall_record(wall: Wall, radius: float) -> dict[str, Any]:
    """Return the singular points of the map of bounces as plain values."""
    orbits = two_bounce_orbits(wall, radius)
    kinds = sorted({orbit.kind for orbit in orbits})
    names = {"degenerate": "diameters, all alike"}
    return {
        "type": " and ".join(names.get(kind, kind) for kind in kinds),
        "points": [{**orbit._asdict(), "multiplier": multiplier(orbit)} for orbit in orbits],
    }
