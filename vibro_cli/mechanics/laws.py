"""The impact laws as users meet them: names, words, and what each keeps. Declared once.

What a law does is in the kernels (``kernels/impact/laws.py``), which know it by its number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from operator import and_
from typing import Any


@dataclass(frozen=True)
class ImpactLaw:
    """What is said of a law."""

    statement: str
    """In the help, with formulas."""
    summary: str
    """In a report, with its source."""
    separates_on_lines: bool
    """Whether bodies of unequal radii on one line always part; else impacts can be inadmissible."""
    separates_on_arcs: bool
    """The same on arcs."""
    balances_mass: bool
    """Whether it keeps Σ m v of two bodies, where others keep Σ κ m v, as the kernels have it."""


LAWS: Mapping[str, ImpactLaw] = {
    "hedrih": ImpactLaw(
        "the papers' law: the moments of momentum about the contact points, J_Pa ω_a + "
        "J_Pb ω_b with J_P = κ m r², are conserved, and ω_b⁺ − ω_a⁺ = k (ω_a⁻ − ω_b⁻)",
        "moments of momentum about the contact points and the coefficient of restitution "
        "on the angular velocities: A (3), B (15)–(16), C (3)",
        separates_on_lines=False,
        separates_on_arcs=False,
        balances_mass=False,
    ),
    "normal-impulse": ImpactLaw(
        "an impulse along the line of centres, Newton's restitution on the speed of "
        "approach, rolling kept; it always separates the bodies, and equals `hedrih` for equal "
        "radii on one piece of the trace",
        "an impulse along the line of centres, rolling kept, the coefficient of "
        "restitution on the speed of approach",
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
    """Return whether impacts with k = 1 take no energy of rolling.

    Those of a law that balances Σ m v take none of bodies of equal κ only.
    `kappa` has a number for each body, or an array, for which the result is an array too.
    """
    return reduce(and_, [one == kappa[0] for one in kappa]) | (not LAWS[law].balances_mass)
