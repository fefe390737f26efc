"""Formulas of the papers: the central impact in two forms, and a swing on one arc.

By the analogy of B table 1, formulas for two bodies in translation, with masses and velocities,
apply to two rolling bodies with moments of inertia about their contact points and angular
velocities.

With ω² = 2g/κρ, Ω² = φ̇₀² + 2ω² sin²(φ₀/2) and the modulus k = √2 ω/Ω (B (50)–(54)), the time
between two angles is t = (2/Ω) ∫ du/[√(1 − u²) √(1 − k²u²)] with u = sin(φ/2). For k > 1 the body
oscillates between u = ±1/k, for k < 1 it rotates.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.kernels.numerics.elliptic import carlson_rf, quarter_period
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.mechanics.trace import VALLEY, Piece

Pair = tuple[float, float]


@dataclass(frozen=True)
class CentralImpact:
    """An impact of two bodies in translation or rolling, with coefficient of restitution k."""

    inertia: Pair
    """Masses m (kg), or moments of inertia J_P about the contact points (kg m²)."""
    before: Pair
    """Velocities v (m/s), or angular velocities ω (rad/s), before the impact."""
    restitution: float
    """k, from 0 to 1."""

    @property
    def momentum(self) -> float:
        """Conserved momentum I_a u_a + I_b u_b (kg m/s, or kg m²/s); B (1), (13)."""
        return sum(one * u for one, u in zip(self.inertia, self.before, strict=True))

    @property
    def reduced(self) -> float:
        """Reduced inertia I_a I_b/(I_a + I_b) (kg, or kg m²)."""
        one, other = self.inertia
        return one * other / (one + other)

    @property
    def closing(self) -> float:
        """Relative velocity u_a − u_b before the impact (m/s, or rad/s)."""
        return self.before[0] - self.before[1]

    @property
    def impulse(self) -> float:
        """Impulse on b (N s), or its moment (N m s): (1 + k) I_a I_b/(I_a + I_b) (u_a − u_b)."""
        return (1.0 + self.restitution) * self.reduced * self.closing

    @property
    def after(self) -> Pair:
        """Velocities after the impact: u_a − P/I_a, u_b + P/I_b; B (15)–(16)."""
        (one, other), impulse = self.inertia, self.impulse
        return self.before[0] - impulse / one, self.before[1] + impulse / other

    @property
    def energy_before(self) -> float:
        """Kinetic energy of both before the impact (J): Σ ½ I u²; B (7), (18)."""
        return sum(0.5 * one * u * u for one, u in zip(self.inertia, self.before, strict=True))

    @property
    def energy_after(self) -> float:
        """Kinetic energy of both after the impact (J); B (8), (19)."""
        return sum(0.5 * one * u * u for one, u in zip(self.inertia, self.after, strict=True))

    @property
    def loss(self) -> float:
        """Lost kinetic energy (J): ½(1 − k²) I_a I_b/(I_a + I_b) (u_a − u_b)²; B (20)."""
        return 0.5 * (1.0 - self.restitution**2) * self.reduced * self.closing**2

    @property
    def carnot(self) -> float:
        """Loss (J) by Carnot's theorem: (1 − k)/(1 + k) Σ ½ I (Δu)², I Δu = ∓P; B (23)."""
        # Δu from the impulse: for fast bodies a difference of velocities would be rounding.
        lost = sum(0.5 * self.impulse**2 / inertia for inertia in self.inertia)
        return (1.0 - self.restitution) / (1.0 + self.restitution) * lost


PRINTED = 3.0 / (2.0 * 4.0 * 6.0)
"""Coefficient of k⁴u⁵ as printed in A (8)–(9) and B (58)."""
CORRECT = 3.0 / (2.0 * 4.0 * 5.0)
"""Correct coefficient of k⁴u⁵."""


@dataclass(frozen=True)
class Swing:
    """The motion of a body in a valley, given by its angle (rad) and rate (rad/s) at an instant."""

    square: float
    """ω² = 2g/κρ (1/s²)."""
    angle: float
    rate: float

    @property
    def scale(self) -> float:
        """Ω (rad/s), the rate at the bottom."""
        return math.sqrt(self.rate**2 + 2.0 * self.square * math.sin(0.5 * self.angle) ** 2)

    @property
    def modulus(self) -> float:
        """Modulus k = √2 ω/Ω; infinite for a body at rest at the bottom."""
        scale = self.scale
        return math.sqrt(2.0 * self.square) / scale if scale > 0.0 else math.inf

    @property
    def bottom(self) -> float:
        """Angle (rad) of the nearest bottom, a multiple of 2π: slopes may go on beyond a turn."""
        return 2.0 * math.pi * round(self.angle / (2.0 * math.pi))

    @property
    def way(self) -> float:
        """Initial direction, right (1) or left (−1); from rest it is towards the bottom."""
        from_bottom = self.angle - self.bottom
        return math.copysign(1.0, self.rate) if self.rate else -math.copysign(1.0, from_bottom)

    @property
    def small_period(self) -> float:
        """Period (s) of small oscillations, 2π √(κρ/g)."""
        return 2.0 * math.pi / math.sqrt(0.5 * self.square)

    @property
    def below(self) -> float:
        """Distance below the separatrix: 1 − 1/k² = cos²(φ₀/2) − φ̇₀²/2ω², negative above it.

        0 if doubles cannot distinguish it from the separatrix, where k would have lost its digits.
        """
        place, motion = math.cos(0.5 * self.angle) ** 2, self.rate**2 / (2.0 * self.square)
        apart = place - motion
        return apart if abs(apart) > 4.0 * EPSILON * (place + motion) else 0.0

    @property
    def amplitude(self) -> float:
        """Greatest angle from the bottom (rad); π if the body rotates."""
        return 2.0 * math.atan2(1.0 / self.modulus, math.sqrt(max(self.below, 0.0)))

    @property
    def period(self) -> float:
        """Period (s) of the oscillation or rotation; infinite on the separatrix."""
        below = self.below
        if below == 0.0:
            return math.inf
        quarter = quarter_period(1.0 - below, math.copysign(math.sqrt(abs(below)), below))
        return (4.0 if below > 0.0 else 2.0) * quarter / math.sqrt(0.5 * self.square)

    def from_bottom(self, u: float) -> float:
        """Return the exact time (s) from the bottom to u = sin(φ/2), odd in u (DLMF 19.25.5)."""
        way = max(-1.0, min(1.0, self.modulus * u))
        beside, left = ((1.0 - one) * (1.0 + one) for one in (way, u))
        return 2.0 / self.scale * u * carlson_rf(beside, left, 1.0)


def partial_sums(k: float, u: float, coefficient: float) -> tuple[float, float, float]:
    """Return the three brackets of A (8), B (58), the papers' series of Ω t/2 from the bottom.

    Both roots are expanded to second order; `coefficient` multiplies k⁴u⁵ in the first bracket.
    """
    m = k * k
    return (
        u + m * u**3 / 6.0 + coefficient * m * m * u**5,
        u**3 / 6.0 + m * u**5 / 20.0 + 3.0 / 112.0 * m * m * u**7,
        3.0 / 40.0 * u**5 + 3.0 / 112.0 * m * u**7 + 9.0 / 576.0 * m * m * u**9,
    )


def series_time(swing: Swing, u: float) -> float:
    """Return the time (s) from the bottom to u by the papers' series with the right coefficient."""
    return 2.0 / swing.scale * math.fsum(partial_sums(swing.modulus, u, CORRECT))


def printed_time(swing: Swing, u: float, first: Swing | None = None) -> float:
    """Return the time (s) from the bottom to u as printed: A (8), or A (9) with ball 1's swing.

    A (9) and B (61) use Ω₁ and k₁ of ball 1 in the last bracket of ball 2's time.
    """
    last = first or swing
    one, two, _ = partial_sums(swing.modulus, u, PRINTED)
    three = partial_sums(last.modulus, u, PRINTED)[2]
    return 2.0 / swing.scale * (one + two) + 2.0 / last.scale * three


def squared_rate(system: TraceSystem, ball: int, piece: Piece) -> float:
    """Return ω² = 2g/κρ (1/s²) of a body (from 1) on an arc, B (50)."""
    body = system.bodies[ball - 1]
    return 2.0 * system.gravity / (body.kappa * piece.path_radius(body.radius))


def starting_swing(system: TraceSystem, ball: int) -> Swing | None:
    """Return the first swing of a body (from 1), or None unless it starts in a valley at rest."""
    state = system.initial[ball - 1]
    piece = system.trace.pieces[state.piece]
    if piece.shape != VALLEY or system.turning is not None:
        return None
    rate = state.speed / piece.path_radius(system.bodies[ball - 1].radius)
    return Swing(squared_rate(system, ball, piece), state.position, rate)


def stays(swing: Swing, piece: Piece, circle: bool) -> bool:
    """Return whether a swing stays on its arc; on a `circle`, one arc that is closed, all do."""
    if circle or swing.below < 0.0:
        return circle
    if swing.below == 0.0:  # on the separatrix it approaches one top and never returns
        return piece.angle_start <= swing.bottom + swing.way * math.pi <= piece.angle_end
    low, high = swing.bottom - swing.amplitude, swing.bottom + swing.amplitude
    return piece.angle_start <= low and high <= piece.angle_end
