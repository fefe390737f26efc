"""On which side of the figure eight a body moves (D)."""

from __future__ import annotations

from vibro_cli.analysis.portrait_type import Portrait
from vibro_cli.analysis.trigger import FIGURE_EIGHT

LEFT = "left loop"
RIGHT = "right loop"
ON = "on it"
OUTSIDE = "outside"

_EQUAL = 1e-12
"""Energies closer than this fraction of the saddle's lie on the figure eight."""


def side(portrait: Portrait, s: float, energy: float) -> str | None:
    """Return where a state lies: within a loop of a figure eight, on it, or outside of all.

    `s` is the arc length of the contact point (m), `energy` that of the body (J). Below the
    saddle's energy a body between the turning points of the separatrix is within one loop. None
    where the portrait has no figure eight.
    """
    eights = [one for one in portrait.triggers if one.orbit == FIGURE_EIGHT]
    if not eights:
        return None
    for trigger in eights:
        assert trigger.turning_left is not None
        assert trigger.turning_right is not None
        if not trigger.turning_left <= s <= trigger.turning_right:
            continue
        saddle = trigger.saddle
        if abs(energy - saddle.energy) <= _EQUAL * saddle.energy:
            return ON
        if energy < saddle.energy:
            return LEFT if s < saddle.s else RIGHT
    return OUTSIDE
