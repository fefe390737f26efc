"""The high-precision twin itself: against the reference files, and against conserved quantities."""

from __future__ import annotations

import pytest

from tests import references
from tests.highprecision.reference_solver import ArcMotion
from tests.references import QUANTITIES
from vibro_cli.stress.oracles.scene import mp, slope_of

pytestmark = pytest.mark.long


@pytest.mark.parametrize("name", references.NAMES)
def test_twin_of_the_decimals_is_the_reference(name: str) -> None:
    rows, impacts = references.collisions(name), references.twin_of_decimals(name)
    assert len(rows) == len(impacts)
    for row, impact in zip(rows, impacts, strict=True):
        assert (row["arc_a"] - 1, row["arc_b"] - 1) == (impact.a.piece, impact.b.piece)
        assert row["crossings"] == impact.crossings
        for key, value in QUANTITIES.values():
            exact = mp.mpf(row[key])
            # Thirty printed digits; a position near zero is a difference of values near one.
            assert abs(value(impact) - exact) <= 1e-28 * max(abs(exact), 1), key


@pytest.mark.parametrize("rate", ["0.3", "0.9", "1.7", "12"])
def test_series_keep_energy_and_the_unit_circle(rate: str) -> None:
    angle, p = mp.mpf("2.4"), mp.mpf(rate)
    s, c = mp.sin(angle / 2), mp.cos(angle / 2)
    motion = ArcMotion(mp.mpf("2.7"), (s, c, p))
    for t in (mp.mpf("0.11"), mp.mpf("1.3"), mp.mpf("9.7")):
        s1, c1, p1 = motion.at(t)
        assert abs(s1**2 + c1**2 - 1) < mp.mpf(10) ** -40
        assert abs(s1**2 + p1**2 - s**2 - p**2) < mp.mpf(10) ** -40


def test_series_solve_the_equation_of_motion() -> None:
    w, h = mp.mpf("1.9"), mp.mpf(10) ** -12
    motion = ArcMotion(w, (mp.sin(mp.mpf("0.8")), mp.cos(mp.mpf("0.8")), mp.mpf("0.6")))
    for t in (mp.mpf("0.07"), mp.mpf("2.2")):
        angles = [2 * mp.atan2(*motion.at(t + step)[:2]) for step in (-h, mp.zero, h)]
        second = (angles[0] - 2 * angles[1] + angles[2]) / h**2
        assert abs(second + w**2 * mp.sin(angles[1])) < mp.mpf(10) ** -15


def test_right_angles_are_meant_exactly() -> None:
    assert slope_of(-3.141592653589793) == -mp.pi
    assert slope_of(1.5707963267948966) == mp.pi / 2
    assert slope_of(1.5707963267948968) == mp.mpf(1.5707963267948968)
    assert slope_of(0.3) == mp.mpf(0.3)
