"""Steps that never pass the first root, on functions whose derivatives are known to be bounded."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from vibro_cli.kernels.numerics.conservative_advancement import (
    first_return,
    first_root_of_parabola,
    is_clear_before,
    safe_return,
    safe_step_second_order,
    safe_step_third_order,
)
from vibro_cli.stress.oracles.scene import mp

SETTINGS = settings(deadline=None, derandomize=True, max_examples=400)
coefficient = st.floats(-4.0, 4.0).map(lambda x: round(x, 6))
length = st.floats(0.3, 8.0)
POINTS = 400


@dataclass(frozen=True)
class Curve:
    """A function with its first two derivatives, and bounds on the second and third."""

    value: Callable[[float], float]
    first: Callable[[float], float]
    second: Callable[[float], float]
    bound_second: float
    bound_third: float

    def positive_until(self, end: float) -> bool:
        """Whether the function has no root before ``end``, by the same bounds from many points."""
        width = end / POINTS
        for k in range(POINTS):
            low = min(self.value(k * width), self.value((k + 1) * width))
            # Between two points it sags below the lower one by A width^2/8 at most.
            if low < -1e-12 - 0.125 * self.bound_second * width * width:
                return False
        return True


def cubic(g: float, a: float, b: float, c: float, reach: float) -> Curve:
    """g + a t + b t^2/2 + c t^3/6, with bounds over [0, reach]."""
    return Curve(
        lambda t: g + t * (a + t * (b / 2 + t * c / 6)),
        lambda t: a + t * (b + t * c / 2),
        lambda t: b + t * c,
        max(abs(b), abs(b + reach * c), 1e-3),
        max(abs(c), 1e-3),
    )


def waves(terms: list[tuple[float, float, float]], level: float) -> Curve:
    """A level and some sine waves (amplitude, frequency, phase)."""
    return Curve(
        lambda t: level + math.fsum(a * math.sin(w * t + p) for a, w, p in terms),
        lambda t: math.fsum(a * w * math.cos(w * t + p) for a, w, p in terms),
        lambda t: -math.fsum(a * w * w * math.sin(w * t + p) for a, w, p in terms),
        math.fsum(abs(a) * w * w for a, w, _ in terms) + 1e-3,
        math.fsum(abs(a) * w**3 for a, w, _ in terms) + 1e-3,
    )


wave = st.tuples(st.floats(-2.0, 2.0), st.floats(0.2, 6.0), st.floats(-3.0, 3.0))
wavy = st.builds(waves, st.lists(wave, min_size=1, max_size=4), st.floats(-3.0, 6.0))


def check_steps(curve: Curve, reach: float) -> None:
    """Check that both steps from 0 end before the first root (bounds hold within ``reach``)."""
    g, rate, second = curve.value(0.0), curve.first(0.0), curve.second(0.0)
    assume(g >= 0.0)
    plain = safe_step_second_order(g, rate, curve.bound_second)
    better = safe_step_third_order(g, rate, second, curve.bound_second, curve.bound_third)
    assert better >= plain >= 0.0
    assert curve.positive_until(min(better, reach))


@SETTINGS
@given(
    g=st.floats(0.0, 3.0), a=coefficient, b=coefficient, c=coefficient, reach=length
)  # fmt: skip
def test_cubics_are_not_passed(g: float, a: float, b: float, c: float, reach: float) -> None:
    check_steps(cubic(g, a, b, c, reach), reach)


@SETTINGS
@given(curve=wavy)
def test_waves_are_not_passed(curve: Curve) -> None:
    check_steps(curve, 50.0)


@SETTINGS
@given(curve=wavy)
def test_repeated_steps_stop_at_the_first_root(curve: Curve) -> None:
    assume(curve.value(0.0) > 1e-6)
    t = 0.0
    for _ in range(2000):
        g = curve.value(t)
        if g <= 1e-9 or t > 20.0:
            break
        step = safe_step_third_order(
            g, curve.first(t), curve.second(t), curve.bound_second, curve.bound_third
        )
        assert step > 0.0
        t += step
    else:
        pytest.fail("no convergence")
    assert curve.positive_until(min(t, 20.0))


@SETTINGS
@given(g=st.floats(0.0, 3.0), rate=st.floats(-3.0, 3.0))
def test_what_no_force_bends_is_stepped_over_whole(g: float, rate: float) -> None:
    step = safe_step_second_order(g, rate, 0.0)
    assert safe_step_third_order(g, rate, 0.0, 0.0, 0.0) >= step
    longer_than_any_run = 1e20
    if rate < -g / longer_than_any_run:
        assert step == pytest.approx(-g / rate, rel=1e-15)
    elif max(g, rate) > 1e-100:
        assert step >= longer_than_any_run


@SETTINGS
@given(curve=wavy)
def test_out_of_contact_at_rest_there_is_a_step(curve: Curve) -> None:
    second = abs(curve.second(0.0)) + 1e-3
    step = safe_step_third_order(0.0, 0.0, second, curve.bound_second + second, curve.bound_third)
    assert step >= second / curve.bound_third
    # g'' t^2/2 - B t^3/6 is positive up to 3 g''/B.
    assert step <= 3.0 * second / curve.bound_third * (1 + 1e-12)


@SETTINGS
@given(g=st.floats(0.0, 5.0), a=coefficient, b=coefficient)
@example(g=2.2e-311, a=0.0, b=-1.375)
def test_parabola(g: float, a: float, b: float) -> None:
    h = first_root_of_parabola(g, a, b)
    exact = [Fraction(x) for x in (g, a, b)]
    discriminant = exact[1] ** 2 - 2 * exact[2] * exact[0]
    if h < 0.0:
        assert h == -1.0
        never = discriminant < 0 or (a >= 0.0 and b >= 0.0)
        nearly = abs(discriminant) <= 8 * Fraction(2) ** -52 * (exact[1] ** 2 + 1)
        assert never or nearly
        return
    time = Fraction(h)
    left = exact[0] + exact[1] * time + exact[2] * time**2 / 2
    size = exact[0] + abs(exact[1]) * time + abs(exact[2]) * time**2 / 2
    # Among subnormal numbers digits are lost.
    assert abs(left) <= 16 * Fraction(2) ** -52 * size + Fraction(2) ** -1022
    # The first root: halfway there the parabola is still above zero.
    half = time / 2
    assert exact[0] + exact[1] * half + exact[2] * half**2 / 2 >= -16 * Fraction(2) ** -52 * size


def test_parabola_in_contact() -> None:
    assert first_root_of_parabola(0.0, -1.0, 5.0) == 0.0
    assert first_root_of_parabola(0.0, 0.0, -1.0) == 0.0
    assert first_root_of_parabola(0.0, 2.0, -1.0) == 4.0
    assert first_root_of_parabola(0.0, 1.0, 1.0) == -1.0
    assert first_root_of_parabola(0.0, 0.0, 0.0) == -1.0
    assert first_root_of_parabola(3.0, -1e-200, 0.0) == pytest.approx(3e200, rel=1e-15)


rising = st.floats(0.0, 5.0).map(lambda x: round(x, 6))
level = st.floats(0.02, 3.0)
frequency = st.floats(0.5, 20.0)


def oscillation(g: float, rate: float, level: float, w: float) -> float:
    """Return the time after which ``(g + Y) cos wt + (g'/w) sin wt`` has fallen to ``Y``."""
    top, turn = mp.mpf(g) + mp.mpf(level), mp.mpf(rate) / mp.mpf(w)
    return float((mp.atan2(turn, top) + mp.acos(mp.mpf(level) / mp.hypot(top, turn))) / w)


@SETTINGS
@given(rising, coefficient, level, frequency)
def test_a_return_is_no_earlier_than_its_bound(
    g: float, rate: float, level: float, frequency: float
) -> None:
    assume(g > 0.0 or rate > 0.0)
    exact = oscillation(g, rate, level, frequency)
    assume(exact > 1e-3 / frequency)
    assert 0.9 * exact < safe_return(g, rate, level, frequency) <= exact * (1.0 + 1e-12)
    assert first_return(g, rate, level, frequency) == pytest.approx(exact, rel=6e-3)


@SETTINGS
@given(rising, level, frequency)
def test_the_way_back_from_a_zero_is_clear_for_less_than_an_oscillation(
    slope: float, level: float, frequency: float
) -> None:
    exact = oscillation(0.0, slope, level, frequency)
    assert not is_clear_before(exact, slope, level, frequency)
    if slope > 1e-3:
        assert is_clear_before(0.85 * exact, slope, level, frequency)
