"""The laws of the impact of two bodies as the papers print them, in numbers of any kind."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

Pair = Sequence[Any]


def speed_changes(
    law: str, k: Any, speeds: Pair, radii: Pair, masses: Pair, rolling: Pair
) -> tuple[Any, Any]:
    """Return what an impact changes of two speeds along the line of centres, or along a line.

    Parameters
    ----------
    law, k
        Its name, and the coefficient of restitution.
    speeds, radii, masses
        Of both bodies.
    rolling
        Masses with what the bodies' rolling adds, κ m.
    """
    more = 1 + k
    if law == "hedrih":  # C (3), with moments of inertia about the contacts
        ja, jb = (mass * r**2 for mass, r in zip(rolling, radii, strict=True))
        slip = speeds[0] / radii[0] - speeds[1] / radii[1]
        return -more * slip * jb / (ja + jb) * radii[0], more * slip * ja / (ja + jb) * radii[1]
    a, b = masses if law == "translational" else rolling
    approach = speeds[0] - speeds[1]
    return -more * approach * b / (a + b), more * approach * a / (a + b)
