"""How long a body on a spring takes to swing (C (4)–(6))."""

from __future__ import annotations

import math

import numpy as np

from vibro_cli.systems.springs.landscape import SpringsLandscape
from vibro_cli.systems.springs.system import SpringsSystem, singular_points

_SUM_POINTS = 4096


def spring_periods(system: SpringsSystem, ball: int) -> tuple[float, float]:
    """Return periods (s) of a body (from 1) on its spring: of small swings, and of its own.

    Small ones about a centre beside the foot: ω₀ √(1 − b²/l²) for l > b, under it ω₀ √(1 − l/b) for
    l < b; infinite for l = b, where nothing of first order pulls. That of the start, infinite at
    rest at the saddle, is 2 ∫ dx/√(2 (E − U)) by a sum that converges like a power.
    """
    spring, rate = system.springs[ball - 1], system.frequency(ball - 1)
    b, long = spring.height, spring.length
    share = 1.0 - (b / long) ** 2 if long > b else 1.0 - long / b if b > 0.0 else 1.0
    small = 2.0 * math.pi / (rate * math.sqrt(share)) if share > 0.0 else math.inf
    state = system.initial[ball - 1]
    x = state.position - spring.foot
    resting = dict(singular_points(spring)).get(x) if state.speed == 0.0 else None
    if resting is not None:
        return small, small if resting == "centre" else math.inf
    return small, _period_through(system, ball, x, state.speed)


def _period_through(system: SpringsSystem, ball: int, x: float, speed: float) -> float:
    """Return the period (s) of the motion through a displacement (m) with a speed (m/s)."""
    hills, spring = SpringsLandscape.of(system, ball - 1, ball - 1), system.springs[ball - 1]
    energy = 0.5 * speed**2 + float(hills.potential(np.array(x)))
    # Where the spring is longer or shorter by so much the body turns.
    reach = math.sqrt(2.0 * energy * hills.mass / spring.stiffness)
    outer = math.sqrt(max((spring.length + reach) ** 2 - spring.height**2, 0.0))
    low, high = -outer, outer
    if spring.length - reach > spring.height:
        inner = math.sqrt((spring.length - reach) ** 2 - spring.height**2)
        low, high = (inner, outer) if x > 0.0 else (-outer, -inner)
    # The midpoint rule in x = m + h cos θ converges like a power for such an integral.
    theta = (np.arange(_SUM_POINTS) + 0.5) * math.pi / _SUM_POINTS
    half = 0.5 * (high - low)
    places = 0.5 * (high + low) - half * np.cos(theta)
    rates = np.sqrt(2.0 * np.maximum(energy - hills.potential(places), 1e-300))
    return 2.0 * float(np.sum(half * np.sin(theta) / rates)) * math.pi / _SUM_POINTS
