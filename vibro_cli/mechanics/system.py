"""What the solver solves: bodies on a trace, how they start, how they collide, what the ends do."""

from __future__ import annotations

from dataclasses import dataclass

from vibro_cli.mechanics.body import Body
from vibro_cli.mechanics.trace import Trace
from vibro_cli.mechanics.turning import Turning


@dataclass(frozen=True)
class Wall:
    """A plane across an end of the trace, touched by a body at distance r: v⁺ = −restitution v⁻."""

    restitution: float


@dataclass(frozen=True)
class InitialState:
    """Where a body starts and how fast."""

    piece: int
    """Index of its piece, from 0."""
    position: float
    """φ or ψ on an arc (rad), distance from the left end on a line (m)."""
    speed: float
    """Speed of the centre, positive to the right along the trace (m/s)."""


@dataclass(frozen=True)
class System:
    """Bodies in order from left to right on a trace, and everything their motion depends on."""

    gravity: float
    """g (m/s²), downwards."""
    trace: Trace
    bodies: tuple[Body, ...]
    initial: tuple[InitialState, ...]
    """State of each body at time 0."""
    restitution: tuple[float, ...]
    """k of each pair of neighbours, on a closed trace with three or more bodies the seam's last."""
    law: str
    """`hedrih`, `normal-impulse` or `translational`."""
    inadmissible: str
    """What follows an inadmissible impact: `stop` or `normal-impulse`."""
    surface: str
    """`two-sided` or `one-sided`."""
    left_end: Wall | None
    """Wall at the left end of an open trace; None stops the run there."""
    right_end: Wall | None
    """Wall at the right end of an open trace; None stops the run there."""
    turning: Turning | None
    """The vertical axis about which the trace turns, and its rate; None at rest."""
