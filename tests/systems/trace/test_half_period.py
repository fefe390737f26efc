"""Bounds on half a period decide as half a period itself does."""

from __future__ import annotations

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from vibro_cli.kernels.flow.flow import half_period
from vibro_cli.kernels.numerics.elliptic import quarter_period
from vibro_cli.kernels.world import FlightRow

FREQUENCY = 2.8


@settings(deadline=None, derandomize=True, max_examples=1000)
@given(
    st.one_of(st.floats(0.0, 3.0), st.floats(0.0, 1e-6), st.floats(0.999, 1.001)),
    st.one_of(st.floats(0.01, 2.5), st.sampled_from([0.5, 1.0])),
    st.sampled_from([0.0, 1e-12, -1e-12, 1e-8, -1e-8, 1e-5, -1e-5, 1e-3, -1e-3]),
)
def test_durations_are_told_from_half_a_period_and_a_quarter(
    m: float, share: float, off: float
) -> None:
    row = FlightRow()
    row.parameter, row.complementary_modulus = m, math.copysign(math.sqrt(abs(1.0 - m)), 1.0 - m)
    if row.complementary_modulus == 0.0:
        return
    exact = 2.0 * quarter_period(row.parameter, row.complementary_modulus) / FREQUENCY
    duration = share * exact * (1.0 + off)
    found = half_period(row, FREQUENCY, duration)
    assert (duration >= found) == (duration >= exact)
    assert (duration >= 0.5 * found) == (duration >= 0.5 * exact)
