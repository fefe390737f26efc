"""Times in two doubles."""

from __future__ import annotations

from fractions import Fraction

from hypothesis import given, settings
from hypothesis import strategies as st

from vibro_cli.kernels.numerics.double_double import add_to_time, time_between

SETTINGS = settings(deadline=None, derandomize=True, max_examples=500)


@SETTINGS
@given(
    high=st.floats(0.0, 1e6),
    share=st.floats(-1.0, 1.0),
    step=st.floats(0.0, 1e4),
)
def test_only_the_sum_of_the_small_parts_is_rounded(high: float, share: float, step: float) -> None:
    low = share * 2.0**-54 * high
    total, rest = add_to_time(high, low, step)
    error = Fraction(total) + Fraction(rest) - Fraction(high) - Fraction(low) - Fraction(step)
    # step + low is rounded once; adding it to the high part loses nothing.
    assert error == Fraction(step + low) - Fraction(step) - Fraction(low)
    assert abs(Fraction(rest)) <= Fraction(2) ** -53 * Fraction(total)
    assert total + rest == total


@SETTINGS
@given(high=st.floats(0.0, 1e6), step=st.floats(0.0, 1e4))
def test_without_a_low_part_the_sum_is_exact(high: float, step: float) -> None:
    total, rest = add_to_time(high, 0.0, step)
    assert Fraction(total) + Fraction(rest) == Fraction(high) + Fraction(step)


@SETTINGS
@given(steps=st.lists(st.floats(1e-6, 2.0), min_size=2, max_size=60))
def test_many_steps_keep_twice_the_digits(steps: list[float]) -> None:
    high = low = 0.0
    for step in steps:
        high, low = add_to_time(high, low, step)
    exact = sum(map(Fraction, steps), Fraction(0))
    error = abs(Fraction(high) + Fraction(low) - exact)
    # Each step's own last place at most, however long the time has grown.
    assert error <= len(steps) * Fraction(2) ** -53 * 2


@SETTINGS
@given(
    high=st.floats(1.0, 1e6), share=st.floats(-1.0, 1.0), step=st.floats(2.0**-30, 1.0),
)  # fmt: skip
def test_time_between_undoes_a_step(high: float, share: float, step: float) -> None:
    low = share * 2.0**-54 * high
    later, later_low = add_to_time(high, low, step)
    back = time_between(later, later_low, high, low)
    assert abs(Fraction(back) - Fraction(step)) <= Fraction(2) ** -51 * Fraction(step + abs(low))
