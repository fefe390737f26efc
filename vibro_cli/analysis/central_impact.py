"""One central impact in the two analogous forms: translation (m, v) and rolling (J_P, ω).

B table 1: whatever holds of two bodies in translation with masses and velocities holds of two
rolling ones with moments of inertia about their contact points and angular velocities.
"""

from __future__ import annotations

from dataclasses import dataclass

Pair = tuple[float, float]


@dataclass(frozen=True)
class CentralImpact:
    """An impact of two bodies in one of the forms, with coefficient of restitution k."""

    inertia: Pair
    """Masses m (kg), or moments of inertia J_P about the contact points (kg m²)."""
    before: Pair
    """Velocities v (m/s), or angular velocities ω (rad/s), before."""
    restitution: float
    """k, from 0 to 1."""

    @property
    def momentum(self) -> float:
        """What is kept: I_a u_a + I_b u_b (kg m/s, or kg m²/s); B (1), (13)."""
        return sum(one * u for one, u in zip(self.inertia, self.before, strict=True))

    @property
    def reduced(self) -> float:
        """I_a I_b/(I_a + I_b) (kg, or kg m²)."""
        one, other = self.inertia
        return one * other / (one + other)

    @property
    def closing(self) -> float:
        """Relative velocity u_a − u_b before (m/s, or rad/s)."""
        return self.before[0] - self.before[1]

    @property
    def impulse(self) -> float:
        """Impulse on b (N s), or its moment (N m s): (1 + k) I_a I_b/(I_a + I_b) (u_a − u_b)."""
        return (1.0 + self.restitution) * self.reduced * self.closing

    @property
    def after(self) -> Pair:
        """Velocities after: u_a − P/I_a, u_b + P/I_b; B (15)–(16)."""
        (one, other), impulse = self.inertia, self.impulse
        return self.before[0] - impulse / one, self.before[1] + impulse / other

    @property
    def energy_before(self) -> float:
        """Kinetic energy of both before (J): Σ ½ I u²; B (7), (18)."""
        return sum(0.5 * one * u * u for one, u in zip(self.inertia, self.before, strict=True))

    @property
    def energy_after(self) -> float:
        """The same after (J); B (8), (19)."""
        return sum(0.5 * one * u * u for one, u in zip(self.inertia, self.after, strict=True))

    @property
    def loss(self) -> float:
        """Lost kinetic energy (J): ½(1 − k²) I_a I_b/(I_a + I_b) (u_a − u_b)²; B (20)."""
        return 0.5 * (1.0 - self.restitution**2) * self.reduced * self.closing**2

    @property
    def carnot(self) -> float:
        """The same (J) by Carnot's theorem: (1 − k)/(1 + k) Σ ½ I (Δu)²; B (23)."""
        terms = zip(self.inertia, self.before, self.after, strict=True)
        lost = sum(0.5 * inertia * (u - after) ** 2 for inertia, u, after in terms)
        return (1.0 - self.restitution) / (1.0 + self.restitution) * lost

    def with_restitution(self, restitution: float) -> CentralImpact:
        """Return the same impact with another k: 0 is the plastic one, 1 the ideally elastic."""
        return CentralImpact(self.inertia, self.before, restitution)
