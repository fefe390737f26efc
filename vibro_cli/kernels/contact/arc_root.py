"""The contact of two bodies on one arc near a guess: the zero of the sine of half their gap."""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.contact.first_contact import FINAL_CORRECTION, NONE_BEFORE_LIMIT, keep_states
from vibro_cli.kernels.contact.gap import half_gap_sine
from vibro_cli.kernels.flow.flow import (
    POLYNOMIAL,
    angular_acceleration,
    angular_jerk,
    flow_of_two,
    nudge,
)
from vibro_cli.kernels.structs import Clock, Flight, PairData, PairTrack

# A step of the iteration times the frequency: a longer one leads anywhere.
LONGEST_CHANGE = 1.0


@kernel
def refine_on_arc(
    a: Flight,
    b: Flight,
    age_a: float,
    age_b: float,
    h: float,
    contact: PairTrack,
    orientation: float,
    pair: PairData,
    clock: Clock,
) -> float:
    """Zero of the sine of half the gap, by its third-order expansion, with full flows.

    The states there are kept in ``pair``.
    """
    fastest = max(a.own_frequency, b.own_frequency)
    settled = FINAL_CORRECTION
    if a.form == POLYNOMIAL or b.form == POLYNOMIAL:
        # Without the acceleration the iteration is of second order only.
        settled *= FINAL_CORRECTION
    for _ in range(12):
        a_s, a_c, a_p, b_s, b_c, b_p = flow_of_two(a, b, age_a + h, age_b + h)
        clock.evaluations += 1
        rate = 2.0 * (b.own_frequency * b_p - a.own_frequency * a_p)
        second = angular_acceleration(b, b_s, b_c) - angular_acceleration(a, a_s, a_c)
        third = angular_jerk(b, b_s, b_c, b_p) - angular_jerk(a, a_s, a_c, a_p)
        x, cosine = half_gap_sine(contact, a_s, a_c, b_s, b_c, orientation)
        x1, x2, x3 = derivatives_of_sine(x, cosine, rate, second, third)
        if x1 >= 0.0:
            return NONE_BEFORE_LIMIT
        change = inverted(x, x1, x2, x3)
        if not abs(change) * fastest <= LONGEST_CHANGE:
            return NONE_BEFORE_LIMIT
        h += change
        if is_last(change, x1, x2, fastest, settled):
            a_s, a_c, a_p = nudge(a, age_a + h - change, change, a_s, a_c, a_p)
            b_s, b_c, b_p = nudge(b, age_b + h - change, change, b_s, b_c, b_p)
            keep_states(pair, a_s, a_c, a_p, b_s, b_c, b_p)
            return h
    return NONE_BEFORE_LIMIT


@kernel
def derivatives_of_sine(
    x: float, cosine: float, rate: float, second: float, third: float
) -> tuple[float, float, float]:
    """Derivatives with time of the sine of half the gap, from those of the gap."""
    x1 = 0.5 * rate * cosine
    x2 = 0.5 * second * cosine - 0.25 * rate * rate * x
    x3 = 0.5 * third * cosine - 0.75 * rate * second * x - 0.25 * rate * rate * x1
    return x1, x2, x3


@kernel
def is_last(change: float, x1: float, x2: float, fastest: float, settled: float) -> bool:
    """Tell whether the iteration is done with a change of time (s)."""
    return abs(change) * (abs(x2) - fastest * x1) < -settled * x1


@kernel
def inverted(x: float, x1: float, x2: float, x3: float) -> float:
    """Step to the zero of a function of given derivatives, by the inverse series to third order."""
    inverse = 1.0 / x1
    step = -x * inverse
    c2 = 0.5 * (x2 * inverse)
    c3 = (1.0 / 6.0) * (x3 * inverse)
    return step * (1.0 - step * (c2 - step * (2.0 * (c2 * c2) - c3)))
