"""What is solved on the table: balls, the wall, how they start and how they collide."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from vibro_cli.systems.bodies import ImpactSystem

ELLIPSE = "ellipse"
CIRCLE = "circle"
POLYGON = "polygon"

Point = tuple[float, float]


@dataclass(frozen=True)
class Wall:
    """A vertical wall; a ball meets it where its centre is at the distance of its radius."""

    shape: str
    """`ellipse` (axes along x and y), `circle` or `polygon`."""
    inside: bool
    """Whether the balls are inside."""
    restitution: float
    """k of the component across the wall."""
    center: Point = (0.0, 0.0)
    """Of an ellipse or a circle, m."""
    semi_axes: Point = (0.0, 0.0)
    """Along x and y, m; equal for a circle, unused for a polygon."""
    corners: tuple[Point, ...] = ()
    """Of a polygon, m, anticlockwise."""


@dataclass(frozen=True)
class InitialState:
    """Where a ball starts and how fast."""

    place: Point
    velocity: Point


@dataclass(frozen=True)
class TableSystem(ImpactSystem):
    """Balls on a plane and everything their motion depends on."""

    initial: tuple[InitialState, ...]
    wall: Wall | None
    restitution: float
    """k of every pair."""

    def keeps_energy(self, clock: Mapping[str, Any]) -> bool:
        """Whether nothing takes energy: neither the wall nor, of two balls or more, an impact."""
        kept = self.wall is None or self.wall.restitution == 1.0
        if len(self.bodies) > 1:
            kept = kept and self.restitution == 1.0 and self.law_keeps_energy
        return kept
