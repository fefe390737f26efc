"""The system to solve: a trace, its rolling or sliding bodies, their start and impact law."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from operator import and_
from typing import Any

from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.mechanics.potential import Turning
from vibro_cli.mechanics.trace import Piece, Trace
from vibro_cli.numerics import elementwise

BALL = "ball"
DISK = "disk"
HOLLOW_BALL = "hollow_ball"
HOOP = "hoop"
PARTICLE = "particle"
CUSTOM = "custom"
"""Kind of a body defined by its inertia ratio."""

INERTIA_RATIO = {BALL: 2 / 5, DISK: 1 / 2, HOLLOW_BALL: 2 / 3, HOOP: 1.0, PARTICLE: 0.0}
"""J_C/(m r²) of each kind of body."""

_KAPPA = {BALL: 7 / 5, DISK: 3 / 2, HOLLOW_BALL: 5 / 3, HOOP: 2.0, PARTICLE: 1.0}

NEEDS_THICKNESS = (DISK, HOLLOW_BALL, HOOP)
"""Kinds that need a thickness to compute the mass from a density."""


def mass_from_density(
    kind: str, radius: float, density: float, thickness: float | None = None
) -> float:
    """Return the mass (kg) of a homogeneous body.

    `radius` and `thickness` in m, `density` in kg/m³. Ball and particle: ⁴⁄₃π r³ ρ. Disk of
    thickness t: π r² t ρ. Thin hollow ball: 4π r² t ρ. Hoop, a thin ring of square cross-section
    t × t: 2π r t² ρ. As in their moments of inertia (⅔ m r² and m r²), all the matter of a
    hollow ball or hoop is taken to be at radius r.
    Raises ValueError for any other kind, or if the thickness is missing.
    """
    if kind in (BALL, PARTICLE):
        return 4.0 / 3.0 * math.pi * elementwise.power(radius, 3) * density
    if kind not in NEEDS_THICKNESS:
        raise ValueError(f"the mass of a body of kind {kind!r} does not follow from its density")
    if thickness is None:
        raise ValueError(f"a {kind} with a density needs a thickness")
    if kind == DISK:
        return math.pi * elementwise.power(radius, 2) * thickness * density
    if kind == HOLLOW_BALL:
        return 4.0 * math.pi * elementwise.power(radius, 2) * thickness * density
    return 2.0 * math.pi * radius * elementwise.power(thickness, 2) * density


def natural_rate(gravity: float, kappa: float, rho: float) -> float:
    """Return w = √(g/κρ), see :meth:`Body.natural_rate`."""
    return elementwise.square_root(gravity / (kappa * rho))


@dataclass(frozen=True)
class Body:
    """A body of revolution on the trace."""

    kind: str
    """`ball`, `disk`, `hollow_ball`, `hoop`, `particle`, or `custom` (by its inertia ratio)."""
    radius: float
    """Radius r (m)."""
    mass: float
    """Mass m (kg)."""
    inertia_ratio: float
    """J_C/(m r²), of the moment of inertia about the centre."""

    @property
    def kappa(self) -> float:
        """κ = 1 + J_C/(m r²): ball 7/5, disk 3/2, hollow ball 5/3, hoop 2, sliding particle 1."""
        if self.kind != CUSTOM and self.inertia_ratio == INERTIA_RATIO.get(self.kind):
            return _KAPPA[self.kind]  # 1 + 2/3 in doubles is not the double nearest to 5/3
        return 1.0 + self.inertia_ratio

    @property
    def slides(self) -> bool:
        """Whether the body slides without turning: κ = 1."""
        return self.kappa == 1.0

    @property
    def rolling_mass(self) -> float:
        """κ m (kg): the kinetic energy is κ m v²/2 at speed v of the centre."""
        return self.kappa * self.mass

    @property
    def rolling_inertia(self) -> float:
        """J_P = κ m r² (kg m²), about the point of contact with the trace."""
        return self.rolling_mass * self.radius**2

    def natural_rate(self, gravity: float, rho: float) -> float:
        """Return w = √(g/κρ) (rad/s), the rate of small oscillations at the bottom of a valley.

        ``gravity`` is in m/s²; ``rho`` is the radius (m) of the path of the body's centre. Both
        may be arrays or carry derivatives (see ``numerics.elementwise``).
        """
        return natural_rate(gravity, self.kappa, rho)


@dataclass(frozen=True)
class Wall:
    """A plane across an end of the trace; at an impact v⁺ = −restitution v⁻.

    A body touches it when its centre is at distance r.
    """

    restitution: float


@dataclass(frozen=True)
class InitialState:
    """Initial position and speed of a body."""

    piece: int
    """Index of its piece, from 0."""
    position: float
    """φ or ψ on an arc (rad), distance from the left end on a line (m)."""
    speed: float
    """Speed of the centre, positive to the right along the trace (m/s)."""


@dataclass(frozen=True)
class TraceSystem:
    """Bodies on a trace, from left to right, and everything that determines their motion."""

    gravity: float
    """g (m/s²), downwards."""
    trace: Trace
    bodies: tuple[Body, ...]
    initial: tuple[InitialState, ...]
    """State of each body at time 0."""
    restitution: tuple[float, ...]
    """k of each pair of neighbours, in the order of `neighbours`."""
    law: str
    """Name of the impact law in `LAWS`."""
    inadmissible: str
    """Response to an inadmissible impact: `stop` or `normal-impulse`."""
    surface: str
    """`two-sided` or `one-sided`."""
    left_end: Wall | None
    """Wall at the left end of an open trace; if None, the run stops there."""
    right_end: Wall | None
    """Wall at the right end of an open trace; if None, the run stops there."""
    turning: Turning | None
    """Vertical axis and rate of the trace's rotation; None at rest."""

    def restitution_of(self, pair: int) -> float:
        """Return k of a pair (from 0).

        Two bodies on a closed trace make two pairs, which share one k.
        """
        return self.restitution[min(pair, len(self.restitution) - 1)]

    def fastest_rate(self, body: Body, piece: Piece) -> float:
        """Return √(Ω² + a/κρ) (rad/s), an upper bound of a body's rate of oscillation on an arc.

        a is the acceleration at the centre of the arc (`drive`): far from the axis of a rotating
        trace it is many times that of gravity.
        """
        turning = 0.0 if self.turning is None else self.turning.square
        drive = self.drive(piece) / (body.kappa * piece.path_radius(body.radius))
        return math.sqrt(turning + drive)

    def drive(self, piece: Piece) -> float:
        """Return the acceleration at the centre of an arc (m/s²): √(g² + (Ω² (O_x − x₀))²)."""
        if self.turning is None:
            return self.gravity
        return math.hypot(self.gravity, self.turning.square * (piece.centre[0] - self.turning.x))


def neighbours(count: int, closed: bool) -> list[tuple[int, int]]:
    """Return the pairs of neighbours on a trace, from left to right.

    With three or more bodies on a closed trace, the pair across the seam is last.
    """
    pairs = list(pairwise(range(count)))
    return [*pairs, (count - 1, 0)] if closed and count > 2 else pairs


# Descriptions of the impact laws for users. Kernels implement the laws (kernels/impact/laws.py),
# and identify each by its number.


@dataclass(frozen=True)
class ImpactLaw:
    """Description of an impact law."""

    statement: str
    """Text of the help, with formulas."""
    summary: str
    """Text of a report, with its source."""
    separates_on_lines: bool
    """Whether bodies of unequal radii on one line always separate; else an impact of theirs can be
    inadmissible."""
    separates_on_arcs: bool
    """The same on arcs."""
    balances_mass: bool
    """Whether the law conserves Σ m v of two bodies, instead of Σ κ m v; as in the kernels."""


LAWS: Mapping[str, ImpactLaw] = {
    "hedrih": ImpactLaw(
        "the papers' law: the moments of momentum about the contact points, J_Pa ω_a + "
        "J_Pb ω_b with J_P = κ m r², are conserved, and ω_b⁺ − ω_a⁺ = k (ω_a⁻ − ω_b⁻)",
        "conservation of the moments of momentum about the contact points, and restitution of the "
        "angular velocities: A (3), B (15)–(16), C (3)",
        separates_on_lines=False,
        separates_on_arcs=False,
        balances_mass=False,
    ),
    "normal-impulse": ImpactLaw(
        "an impulse along the line of centres, Newton's restitution on the speed of "
        "approach, rolling kept; it always separates the bodies, and equals `hedrih` for equal "
        "radii on one piece of the trace",
        "impulse along the line of centres, continued rolling, and restitution of the speed of "
        "approach",
        separates_on_lines=True,
        separates_on_arcs=True,
        balances_mass=False,
    ),
    "translational": ImpactLaw(
        "the classical central impact: as `hedrih`, with m for J_P and v for ω; with "
        "bodies of unequal κ it does not conserve the energy of rolling, not even at k = 1",
        "classical central impact of bodies in translation: B (1)–(12)",
        separates_on_lines=True,
        separates_on_arcs=False,
        balances_mass=True,
    ),
}


def law_keeps_energy(law: str, kappa: Any) -> Any:
    """Return whether impacts with k = 1 conserve the energy of rolling.

    A law that conserves Σ m v does so only between bodies of equal κ.
    `kappa` has a number, or an array, for each body; with arrays the result is an array.
    """
    return reduce(and_, [one == kappa[0] for one in kappa]) | (not LAWS[law].balances_mass)


DRY_FRICTION = 1.0
"""Coefficient of friction that dry surfaces hardly ever exceed."""


def mechanics_warnings(system: TraceSystem, stop_time: float | None = None) -> tuple[str, ...]:
    """Return warnings about a valid system for its user, one sentence each.

    `stop_time` (s) is the latest time at which its run ends.
    """
    bodies = system.bodies
    pairs = [(bodies[a], bodies[b]) for a, b in neighbours(len(bodies), system.trace.closed)]
    arcs = any(not piece.is_line for piece in system.trace.pieces)
    warnings = law_warnings(system, pairs, arcs)
    longest = _longest_phase(system)
    if stop_time is not None and stop_time > longest:
        warnings.append(
            "positions of moving bodies are not determined in double precision from about"
            f" t = {longest:.2g} s on: rounding alone shifts the phase of their motion by a radian"
        )
    return tuple(warnings)


def law_warnings(
    system: TraceSystem | ImpactSystem, pairs: Sequence[tuple[Body, Body]], arcs: bool = False
) -> list[str]:
    """Return warnings about the system's impact law.

    `pairs` are the bodies that can meet; `arcs` tells whether the trace has arcs.
    """
    law, warnings = LAWS[system.law], []
    unequal_kappa = any(a.kappa != b.kappa for a, b in pairs)
    if law.balances_mass and unequal_kappa:
        warnings.append(
            f"the {system.law} law does not conserve the energy of rolling at k = 1"
            " between bodies of unequal J_C/(m r^2)"
        )
    unequal_radii = any(a.radius != b.radius for a, b in pairs)
    separates = law.separates_on_arcs if arcs else law.separates_on_lines
    if unequal_radii and not separates:
        then = "the normal-impulse law is then used"
        if system.inadmissible == "stop":
            then = "the run then stops; the normal-impulse law always separates them"
        warnings.append(
            f"the {system.law} law between bodies of unequal radii can be inadmissible"
            f" (the bodies would pass through one another): {then}"
        )
    return warnings


def _longest_phase(system: TraceSystem) -> float:
    """Return the time (s) after which rounding alone has turned a phase by a radian, or inf.

    An angle on an arc grows at a rate of at most √(φ̇₀² + 4 w²), w² = g/(κ ρ).
    """
    fastest = 0.0
    for body, state in zip(system.bodies, system.initial, strict=True):
        for piece in system.trace.pieces:
            rho = piece.path_radius(body.radius)
            w = body.natural_rate(system.gravity, rho)
            fastest = max(fastest, math.hypot(state.speed / rho, 2.0 * w))
    return 1.0 / (EPSILON * fastest) if fastest > 0.0 else math.inf


@dataclass(frozen=True)
class ImpactSystem(ABC):
    """Bodies and their impact law."""

    bodies: tuple[Body, ...]
    law: str
    """Name of the impact law in `LAWS`."""
    inadmissible: str
    """Response to an inadmissible impact: `stop` or `normal-impulse`."""

    @property
    def law_keeps_energy(self) -> bool:
        """Whether impacts with k = 1 conserve the energy of rolling."""
        return bool(law_keeps_energy(self.law, [body.kappa for body in self.bodies]))

    @property
    def least_energy(self) -> float:
        """Energy (J), not negative, below which a total of energies may be a mere rounding."""
        return 0.0

    @abstractmethod
    def keeps_energy(self, clock: Mapping[str, Any]) -> bool:
        """Return whether a run conserved energy, given its clock at the end."""


def touching_distance(one: Body, other: Body) -> float:
    """Return 2 √(r_a r_b), the horizontal distance (m) of two touching bodies' centres."""
    if one.radius == other.radius:
        return 2.0 * one.radius
    return 2.0 * math.sqrt(one.radius * other.radius)
