"""Jacobi's functions, also close to their zeros, against mpmath at 60 and more digits."""

from __future__ import annotations

import math
from decimal import Decimal
from typing import Any

import pytest

from tests.kernels.test_elliptic import COMPLEMENTS, EPSILON, exact, mp
from vibro_cli.numerics.jacobi import Jacobi

OFF = [sign * 10.0**-exponent for exponent in (15, 13, 12, 10, 8, 6, 3, 2) for sign in (1, -1)]


def roots(complement: float) -> list[float]:
    """Of a libration and of a rotation."""
    return [math.sqrt(complement), -math.sqrt(complement)]


def error(value: float, true: Any) -> float:
    """Return the relative error, in units of the last place of 1."""
    return 0.0 if value == true else float(abs(mp.mpf(value) / true - 1)) / EPSILON


@pytest.mark.parametrize("complement", COMPLEMENTS)
def test_hard_by_the_zeros_every_value_keeps_its_digits(complement: float) -> None:
    # Fewer arguments where hundreds of digits are needed.
    every = 5 if complement < 1e-50 else 1
    for root in roots(complement):
        jacobi = Jacobi(root)
        for quarters in (-7, -1, 1, 2, 3):
            for off in [0.0, *OFF[abs(quarters) % every :: every]]:
                u = float(quarters * jacobi.quarter_period + Decimal(off))
                for value, true in zip(jacobi.functions(u), exact(root, u), strict=True):
                    assert error(value, true) <= 16.0 * max(1.0, abs(u)), (root, u)


@pytest.mark.parametrize("complement", COMPLEMENTS)
def test_over_a_period_and_far_beyond(complement: float) -> None:
    for root in roots(complement):
        jacobi = Jacobi(root)
        s, c, d = jacobi.functions(0.0)
        assert s == 0.0
        assert max(error(c, mp.one), error(d, mp.one)) <= 16.0
        for share in (0.3, 0.8, 1.1, 1.9, 2.2, 3.4, 3.9, 1e3 + 0.7, 1e9 + 1.0, 1e15):
            u = share * float(jacobi.quarter_period)
            for value, true in zip(jacobi.functions(u), exact(root, u), strict=True):
                assert error(value, true) <= 16.0 * max(1.0, abs(u)), (root, u)


def test_far_beyond_the_digits_are_those_of_the_first_period() -> None:
    """As many quarter periods as there are: only their own 80 digits count, not those of u."""
    jacobi = Jacobi(0.6)
    u = float((4 * 10**14 + 1) * jacobi.quarter_period)
    for value, true in zip(jacobi.functions(u), exact(0.6, u), strict=True):
        assert error(value, true) <= 16.0


@pytest.mark.parametrize("complement", COMPLEMENTS)
def test_quarter_period(complement: float) -> None:
    mp.dps = 700
    for root in roots(complement):
        both = mp.mpf(root) ** 2
        larger = mp.one if root > 0.0 else mp.sqrt(1 + both)
        true = mp.ellipk(1 - both / larger**2) / larger
        assert abs(mp.mpf(str(Jacobi(root).quarter_period)) / true - 1) <= mp.mpf("1e-78")


def test_the_separatrix_itself_is_hyperbolic() -> None:
    jacobi = Jacobi(0.0)
    mp.dps = 60
    for u in (-30.0, -0.7, 0.0, 2.5, 300.0):
        wanted = (mp.tanh(u), 1 / mp.cosh(u), 1 / mp.cosh(u))
        for value, true in zip(jacobi.functions(u), wanted, strict=True):
            assert error(value, true) <= 16.0 * max(1.0, abs(u))


@pytest.mark.parametrize("root", [1.5, -1e200, math.nan, math.inf])
def test_what_is_no_complement_is_refused(root: float) -> None:
    with pytest.raises(ValueError, match="complementary_modulus"):
        Jacobi(root)
