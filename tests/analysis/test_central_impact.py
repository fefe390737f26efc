"""The two analogous forms of a central impact against the papers' statements."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from vibro_cli.analysis.paper_formulas import CentralImpact

INERTIA = st.floats(1e-3, 1e3)
# The energies of slower bodies would have fewer digits than a double.
SPEED = st.floats(-50.0, 50.0).filter(lambda speed: speed == 0.0 or abs(speed) > 1e-140)


@given(INERTIA, INERTIA, SPEED, SPEED, st.floats(0.0, 1.0))
@example(1.0, 1.0, 39.59375, 39.591723495969305, 0.5)  # they come together far slower than they go
def test_momentum_restitution_and_energy(
    one: float, other: float, u: float, w: float, k: float
) -> None:
    impact = CentralImpact((one, other), (u, w), k)
    after = impact.after
    scale = (one + other) * (abs(u) + abs(w) + 1e-9)
    assert one * after[0] + other * after[1] == pytest.approx(impact.momentum, abs=1e-13 * scale)
    assert after[1] - after[0] == pytest.approx(k * (u - w), abs=1e-12 * (abs(u) + abs(w)))
    energy_before = 0.5 * (one * u**2 + other * w**2)
    energy_after = 0.5 * (one * after[0] ** 2 + other * after[1] ** 2)
    rounding = 1e-12 * energy_before
    assert impact.loss == pytest.approx(energy_before - energy_after, abs=rounding)
    assert impact.carnot == pytest.approx(impact.loss, rel=1e-12, abs=1e-12 * rounding)


def test_the_special_cases() -> None:
    """Plastic: one common velocity; elastic and of equal inertia: exchanged velocities."""
    impact = CentralImpact((2.0, 2.0), (3.0, -1.0), 0.5)
    assert replace(impact, restitution=0.0).after == (1.0, 1.0)
    assert replace(impact, restitution=1.0).after == (-1.0, 3.0)
    assert replace(impact, restitution=1.0).loss == 0.0
    assert replace(impact, restitution=0.0).loss == 0.5 * 1.0 * 16.0
    assert (impact.impulse, impact.reduced) == (6.0, 1.0)


@pytest.mark.parametrize(
    ("ratio", "coefficient"), [(2, 32 / 33), (3, 243 / 244), (3 / 2, 243 / 275)]
)
def test_the_large_coefficient_belongs_to_the_smaller_ball(
    ratio: float, coefficient: float
) -> None:
    """B's examples: balls of one density, so that J_P goes with the fifth power of the radius."""
    impact = CentralImpact((1.0, ratio**5), (0.0, 1.0), 0.0)
    assert impact.after[0] == pytest.approx(coefficient, rel=1e-14)
