"""Sine and cosine of one argument together."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import MPContext

from vibro_cli.kernels.numerics.elliptic import REDUCTION_LIMIT, sine_cosine

SETTINGS = settings(deadline=None, derandomize=True, max_examples=500)
EPSILON = 2.0**-52
mp: Any = MPContext()
mp.dps = 60


@SETTINGS
@given(st.floats(-1e6, 1e6))
def test_absolute_error(x: float) -> None:
    s, c = sine_cosine(x)
    assert abs(s - mp.sin(mp.mpf(x))) <= EPSILON
    assert abs(c - mp.cos(mp.mpf(x))) <= EPSILON


@SETTINGS
@given(st.floats(-0.25 * math.pi, 0.25 * math.pi))
def test_relative_error_in_the_first_octants(x: float) -> None:
    s, c = sine_cosine(x)
    assert abs(s - mp.sin(mp.mpf(x))) <= 1.25 * math.ulp(s)
    assert abs(c - mp.cos(mp.mpf(x))) <= 1.25 * math.ulp(c)


@SETTINGS
@given(st.floats(-1e5, 1e5))
def test_parity_and_unit_circle(x: float) -> None:
    s, c = sine_cosine(x)
    back_s, back_c = sine_cosine(-x)
    assert abs(s + back_s) <= EPSILON
    assert abs(c - back_c) <= EPSILON
    assert abs(s * s + c * c - 1.0) <= 3.0 * EPSILON


@pytest.mark.parametrize("n", [*range(-9, 10), 1000, 65537, -99999])
def test_near_multiples_of_a_right_angle(n: int) -> None:
    for x in (0.5 * math.pi * n, math.nextafter(0.5 * math.pi * n, 1e9)):
        s, c = sine_cosine(x)
        assert abs(s - mp.sin(mp.mpf(x))) <= EPSILON
        assert abs(c - mp.cos(mp.mpf(x))) <= EPSILON


def test_beyond_the_reduction() -> None:
    for x in (math.nextafter(REDUCTION_LIMIT, 1e9), -3.0e8, 1e15):
        assert sine_cosine(x) == (math.sin(x), math.cos(x))
