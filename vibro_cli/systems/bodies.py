"""What is solved in every system besides the trace: bodies, and how they collide."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from vibro_cli.mechanics.system import Body


@dataclass(frozen=True)
class ImpactSystem(ABC):
    """Bodies and the law of their impacts."""

    bodies: tuple[Body, ...]
    law: str
    """`hedrih`, `normal-impulse` or `translational`."""
    inadmissible: str
    """What follows an inadmissible impact: `stop` or `normal-impulse`."""

    @property
    def law_keeps_energy(self) -> bool:
        """Whether impacts with k = 1 take no energy: the translational law needs equal κ."""
        return self.law != "translational" or len({body.kappa for body in self.bodies}) == 1

    @abstractmethod
    def keeps_energy(self, clock: Mapping[str, Any]) -> bool:
        """Whether nothing takes energy in a run, whose clock at its end is given."""


def touching_distance(one: Body, other: Body) -> float:
    """Return 2 √(r_a r_b), the horizontal distance (m) of two touching bodies' centres."""
    if one.radius == other.radius:
        return 2.0 * one.radius
    return 2.0 * math.sqrt(one.radius * other.radius)
