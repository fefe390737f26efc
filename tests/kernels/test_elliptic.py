"""Jacobi functions by theta series and Carlson's integral, against mpmath at 60 and more digits."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from mpmath import MPContext

from vibro_cli.kernels.numerics.elliptic import (
    ThetaConstants,
    carlson_rf,
    set_theta_constants,
    theta_functions,
)

pytestmark = pytest.mark.long

EPSILON = 2.0**-52
SETTINGS = settings(deadline=None, derandomize=True, max_examples=300)

# 1 - m, from half a libration to far below the resolution of m.
COMPLEMENTS = [0.5, 0.25, 0.2000001, 0.1999999, 0.1, 1e-2, 1e-4, 1e-8, 1e-14, 1e-30, 1e-100, 1e-300]
STEPS = 48  # arguments in a period

mp: Any = MPContext()


def constants(complement: float, rotation: bool = False) -> ThetaConstants:
    """Constants of a libration or a rotation, |1 - m| = complement."""
    theta = ThetaConstants()
    root = math.sqrt(complement)
    if rotation:
        set_theta_constants(theta, 1.0 + complement, -root)
    else:
        set_theta_constants(theta, 1.0 - complement, root)
    return theta


def functions(theta: ThetaConstants, u: float) -> tuple[float, float, float]:
    """The three functions themselves."""
    s, c, d, common = theta_functions(theta, u)
    return s / common, c / common, d / common


def exact(complementary_modulus: float, u: float) -> tuple[Any, Any, Any]:
    """sn, cn, dn with 1 - m = complementary_modulus^2 exactly, in enough digits to hold it.

    A rotation, m > 1, is reduced to 1/m: s = sn(ku)/k, c = dn(ku), d = cn(ku) with k = sqrt(m).
    """
    root = mp.mpf(complementary_modulus)
    mp.dps = 60 - 4 * min(int(mp.floor(mp.log10(abs(root)))), 0)
    if complementary_modulus < 0.0:
        k = mp.sqrt(1 + root**2)
        s, c, d = by_means(k * mp.mpf(u), -root / k)
        return s / k, d, c
    return by_means(mp.mpf(u), root)


def by_means(u: Any, complementary_modulus: Any) -> tuple[Any, Any, Any]:
    """sn, cn, dn by arithmetic and geometric means: Abramowitz and Stegun, 16.4.

    All three at once: hard by the separatrix an eighth of the time of mpmath, which needs sums of
    many terms there, and with which the test below compares.
    """
    a, b, ratios = mp.one, complementary_modulus, []
    while a - b > mp.eps:
        ratios.append((a - b) / (a + b))
        a, b = (a + b) / 2, mp.sqrt(a * b)
    phase = mp.ldexp(a * u, len(ratios))
    for ratio in reversed(ratios):
        phase = (phase + mp.asin(ratio * mp.sin(phase))) / 2
    c = mp.cos(phase)
    return mp.sin(phase), c, mp.hypot(complementary_modulus * mp.sin(phase), c)


@pytest.mark.parametrize("complement", COMPLEMENTS)
def test_the_functions_by_means_are_those_of_mpmath(complement: float) -> None:
    for u in (0.3, -7.0, 1.0e3):
        found = exact(math.sqrt(complement), u)
        m = 1 - mp.mpf(math.sqrt(complement)) ** 2
        for value, name in zip(found, ("sn", "cn", "dn"), strict=True):
            assert abs(value / mp.ellipfun(name, mp.mpf(u), m=m) - 1) <= mp.mpf(10) ** -40


def period(complement: float, rotation: bool) -> float:
    """Return about 4 K of the reduced parameter."""
    scale = math.sqrt(1.0 + complement) if rotation else 1.0
    ratio = complement / (1.0 + complement) if rotation else complement
    return 4.0 * carlson_rf(0.0, ratio, 1.0) / scale


def places(complement: float, rotation: bool) -> Iterator[float]:
    whole = period(complement, rotation)
    for k in range(STEPS + 1):
        yield whole * k / STEPS
    for quarter in (0.25, 0.5, 0.75):
        for off in (-1e-3, -1e-9, 1e-9, 1e-3):
            yield whole * quarter + off


@pytest.mark.parametrize("rotation", [False, True], ids=["libration", "rotation"])
@pytest.mark.parametrize("complement", COMPLEMENTS)
def test_jacobi_functions_over_a_period(complement: float, rotation: bool) -> None:
    theta = constants(complement, rotation)
    for u in places(complement, rotation):
        found = functions(theta, u)
        wanted = exact(theta.complementary_modulus, u)
        allowed = 1e-14 + 2.0 * math.ulp(u)
        for value, true in zip(found, wanted, strict=True):
            assert abs(value - true) <= allowed, u


@pytest.mark.parametrize("rotation", [False, True], ids=["libration", "rotation"])
@pytest.mark.parametrize("complement", COMPLEMENTS)
def test_small_cn_and_dn_keep_their_relative_accuracy(complement: float, rotation: bool) -> None:
    theta = constants(complement, rotation)
    quarter = 0.25 * period(complement, rotation)
    for k in range(STEPS):
        u = quarter * k / STEPS
        _, c, d = functions(theta, u)
        _, true_c, true_d = exact(theta.complementary_modulus, u)
        # Towards a zero a relative error of u is one of u/(distance to the zero) of the function.
        steep = max(1.0, u / (quarter - u))
        for value, true in ((c, true_c), (d, true_d)):
            assert abs(value / true - 1) <= 16.0 * EPSILON * max(1.0, u) * steep, u


def test_the_separatrix_itself_is_hyperbolic() -> None:
    theta = ThetaConstants()
    set_theta_constants(theta, 1.0, 0.0)
    mp.dps = 60
    for u in (-30.0, -2.5, 0.0, 0.7, 5.0, 40.0, 300.0):
        s, c, d = functions(theta, u)
        assert abs(s - mp.tanh(u)) <= 2.0 * EPSILON
        for value in (c, d):
            assert abs(value * mp.cosh(u) - 1) <= 16.0 * EPSILON * max(1.0, abs(u))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_separatrix_is_approached_from_both_sides(sign: float) -> None:
    limit = ThetaConstants()
    set_theta_constants(limit, 1.0, 0.0)
    for exponent in (-20, -60, -69, -71, -75, -100, -150):
        root = 10.0**exponent
        theta = ThetaConstants()
        set_theta_constants(theta, 1.0, sign * root)
        u = 0.25 * -math.log(root)
        for value, at_limit in zip(functions(theta, u), functions(limit, u), strict=True):
            assert value == pytest.approx(at_limit, rel=64 * EPSILON * u)


@SETTINGS
@given(
    m=st.floats(1e-6, 1.0, exclude_max=True),
    rotation=st.booleans(),
    u=st.floats(-60.0, 60.0),
)
def test_the_functions_keep_their_identities(m: float, rotation: bool, u: float) -> None:
    theta = ThetaConstants()
    if rotation:
        set_theta_constants(theta, 1.0 / m, -math.sqrt((1.0 - m) / m))
    else:
        set_theta_constants(theta, m, math.sqrt(1.0 - m))
    s, c, d = functions(theta, u)
    size = max(1.0, theta.parameter)
    assert abs(s * s + c * c - 1.0) <= 1e-14
    assert abs(d * d + theta.parameter * s * s - 1.0) <= 1e-14 * size
    back_s, back_c, back_d = functions(theta, -u)
    assert (back_s, back_c, back_d) == (-s, c, d)


def test_carlson_rf_against_mpmath() -> None:
    mp.dps = 60
    values = [0.0, 1e-300, 1e-30, 1e-12, 1e-5, 0.03, 0.5, 0.9999, 1.0, 1.7, 30.0, 1e6, 1e200]
    for x in values:
        for y in values[1:]:
            for z in values[1:]:
                true = mp.elliprf(mp.mpf(x), mp.mpf(y), mp.mpf(z))
                assert abs(carlson_rf(x, y, z) / true - 1) <= 4.0 * EPSILON, (x, y, z)


@SETTINGS
@given(
    x=st.floats(0.0, 1e3), y=st.floats(1e-12, 1e3), z=st.floats(1e-12, 1e3),
    scale=st.integers(-40, 40),
)  # fmt: skip
def test_carlson_rf_symmetry_and_homogeneity(x: float, y: float, z: float, scale: int) -> None:
    assume(x == 0.0 or x > 1e-250)
    value = carlson_rf(x, y, z)
    assert carlson_rf(z, x, y) == pytest.approx(value, rel=8 * EPSILON)
    assert carlson_rf(y, x, z) == pytest.approx(value, rel=8 * EPSILON)
    four = 4.0**scale
    assert carlson_rf(x * four, y * four, z * four) == pytest.approx(
        value / 2.0**scale, rel=4 * EPSILON
    )


def test_carlson_rf_of_two_zeros_is_infinite() -> None:
    for arguments in ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)):
        assert carlson_rf(*arguments) == math.inf


@pytest.mark.parametrize("complement", COMPLEMENTS)
def test_quarter_period_to_four_units(complement: float) -> None:
    mp.dps = 700
    true = mp.ellipk(1 - mp.mpf(complement))
    assert abs(carlson_rf(0.0, complement, 1.0) / true - 1) <= 4.0 * EPSILON
