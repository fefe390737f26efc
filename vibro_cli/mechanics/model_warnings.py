"""What a user should know about a sound system before running it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from vibro_cli.mechanics.system import Body, System
from vibro_cli.numerics.elementwise import EPSILON

DRY_FRICTION = 1.0
"""A coefficient of friction that dry surfaces hardly exceed."""


def mechanics_warnings(system: System, stop_time: float | None = None) -> tuple[str, ...]:
    """Return what a user should know about a sound system before running it, a sentence each.

    `stop_time` (s) is when its run ends at the latest.
    """
    neighbours = list(pairwise(system.bodies))
    if system.trace.closed and len(system.bodies) > 2:
        neighbours.append((system.bodies[-1], system.bodies[0]))
    warnings = law_warnings(system.law, system.inadmissible, neighbours)
    longest = _longest_phase(system)
    if stop_time is not None and stop_time > longest:
        warnings.append(
            "places of bodies that still move are not determined in double precision from about"
            f" t = {longest:.2g} s on: rounding alone turns the phase of their motion by a radian"
        )
    return tuple(warnings)


def law_warnings(law: str, inadmissible: str, pairs: Sequence[tuple[Body, Body]]) -> list[str]:
    """Return what is doubtful about a law between the bodies that can meet."""
    warnings = []
    unequal_kappa = any(a.kappa != b.kappa for a, b in pairs)
    if law == "translational" and unequal_kappa:
        warnings.append(
            "the translational law does not conserve the energy of rolling at k = 1"
            " between bodies of unequal J_C/(m r^2)"
        )
    unequal_radii = any(a.radius != b.radius for a, b in pairs)
    if law == "hedrih" and unequal_radii:
        then = "the run stops there" if inadmissible == "stop" else "normal-impulse is used"
        warnings.append(
            "the hedrih law between bodies of unequal radii can be inadmissible"
            f" (they would go through one another): {then}"
        )
    return warnings


def _longest_phase(system: System) -> float:
    """Return the time (s) after which a phase in double precision is off by a radian, or inf.

    An angle grows at most at a rate of √(φ̇₀² + 4 w²) on an arc, w² = g/(κ ρ).
    """
    fastest = 0.0
    for body, state in zip(system.bodies, system.initial, strict=True):
        for piece in system.trace.pieces:
            if not piece.is_line:
                rho = piece.path_radius(body.radius)
                w = body.natural_rate(system.gravity, rho)
                fastest = max(fastest, math.hypot(state.speed / rho, 2.0 * w))
    return 1.0 / (EPSILON * fastest) if fastest > 0.0 else math.inf
