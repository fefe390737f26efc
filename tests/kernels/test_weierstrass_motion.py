"""Motion under a quartic, against independent Taylor series of many digits."""

from __future__ import annotations

import math
import random
from typing import Any

import numpy as np
import pytest

from tests.highprecision.reference_solver import ArcMotion
from vibro_cli.kernels.flow.rotating_flow import (
    flow,
    half_way,
    set_motion,
    time_of_flight,
    time_to_turn,
)
from vibro_cli.kernels.numerics.elliptic import QuarticConstants
from vibro_cli.kernels.numerics.weierstrass_motion import (
    period_of,
    quartic_motion,
    set_quartic_constants,
    squared_rate,
    time_to_place,
)
from vibro_cli.kernels.world import Flight
from vibro_cli.mechanics.potential import Pull
from vibro_cli.stress.oracles.scene import mp

# tilt, spread, angle, P, whether the body turns over, and how near rounding may bring it.
ORBITS = [
    pytest.param(0.0, 0.3, -1.0, 0.2, 0, 1e-14, id="one well"),
    pytest.param(0.0, 2.5, 0.9, 0.1, 0, 1e-14, id="one of two wells"),
    pytest.param(0.0, 2.5, 0.9, 0.6, 0, 1e-14, id="over the middle"),
    pytest.param(-0.7, 1.4, 2.0, -0.3, 0, 2e-13, id="off the axis"),
    pytest.param(0.4, 0.8, 1.1, 1.9, 1, 1e-14, id="rotation"),
    pytest.param(-0.6, 0.2, -2.7, -2.3, 1, 1e-14, id="rotation to the left"),
    pytest.param(0.0, 2.0, 1e-9, 0.0, 0, 1e-12, id="next to a saddle"),
    pytest.param(0.0, 0.5, 1e-9, 1e-9, 0, 1e-13, id="next to a centre"),
    pytest.param(0.0, 1.0, 0.3, 0.0, 0, 1e-13, id="at the pitchfork"),
    pytest.param(1.3, 0.0, 0.5, 0.0, 0, 1e-14, id="without spread"),
    pytest.param(0.0, 0.02, 2.44, 0.32, 0, 3e-14, id="turns below a crest"),
    pytest.param(0.1, 1.0, -2.4, 0.385, 0, 3e-14, id="through the far side"),
    pytest.param(-0.4, 1.2, 2.6, 0.0, 0, 3e-14, id="from rest through the far side"),
]


def motion(tilt: float, spread: float, angle: float, p: float, over: int) -> QuarticConstants:
    """Return the motion by the module's formula: the quartic of ``P^2`` about the start."""
    sine, cosine = math.sin(angle), math.cos(angle)
    along, across = cosine + tilt * sine, tilt * cosine - sine
    double_sine, double_cosine = spread * sine * cosine, spread * math.cos(2.0 * angle)
    found = QuarticConstants()
    a0, a2 = p * p - along, (2.0 * p * p - along + double_cosine) / 6.0
    a1, a3 = 0.25 * (across - double_sine), 0.25 * (across + double_sine)
    set_quartic_constants(found, a0, a1, a2, a3, p, over)
    return found


@pytest.mark.parametrize("t", [1e-13, 1e-9, 1e-5, 1e-2])
def test_rates_soon_after_the_start_are_as_good_as_the_start(t: float) -> None:
    """Such rates decide whether bodies that touch approach."""
    for tilt, spread, angle, p in ((-0.8, 0.46, 0.7, -0.31), (0.3, 2.5, -1.1, 0.8)):
        quartic = motion(tilt, spread, angle, p, 0)
        half = mp.mpf(angle) / 2
        start = (mp.sin(half), mp.cos(half), mp.mpf(p))
        exact = ArcMotion(mp.one, start, (mp.mpf(tilt), mp.mpf(spread))).at(mp.mpf(t))[2]
        assert abs(quartic_motion(quartic, t)[2] - exact) <= 2 * math.ulp(p)


@pytest.mark.parametrize(("tilt", "spread", "angle", "p", "over", "near"), ORBITS)
@pytest.mark.parametrize("t", [0.01, 0.7, 2.9, 6.1])
def test_states_are_those_of_the_equation_of_motion(
    tilt: float, spread: float, angle: float, p: float, over: int, near: float, t: float
) -> None:
    quartic = motion(tilt, spread, angle, p, over)
    half = mp.mpf(angle) / 2
    start = (mp.sin(half), mp.cos(half), mp.mpf(p))
    s, c, rate = ArcMotion(mp.one, start, (mp.mpf(tilt), mp.mpf(spread))).at(mp.mpf(t))
    sine, cosine = s * start[1] - c * start[0], c * start[1] + s * start[0]
    found = quartic_motion(quartic, t)
    sizes = (abs(sine) + abs(p), 1, abs(rate) + abs(sine))
    for value, exact, size in zip(found, (sine, cosine, rate), sizes, strict=True):
        assert abs(value - exact) <= 4.0 * near * max(size, 1e-3 * near)


def test_a_motion_that_turns_just_before_infinity_keeps_its_digits_there() -> None:
    """Weierstrass's form lost nine of them, a0 being -5e-6: a body came to be 1e-9 m/s off."""
    spread, angle, p = 0.9795368620779458, 0.5139312536297346, 0.9331739833561361
    half = mp.mpf(angle) / 2
    start = (mp.sin(half), mp.cos(half), mp.mpf(p))
    exact_motion = ArcMotion(mp.one, start, (mp.zero, mp.mpf(spread)))
    quartic = motion(0.0, spread, angle, p, 0)
    for t in np.linspace(2.2, 2.7, 26).tolist():
        s, c, rate = exact_motion.at(mp.mpf(t))
        exact = (s * start[1] - c * start[0], c * start[1] + s * start[0], rate)
        for value, true in zip(quartic_motion(quartic, t), exact, strict=True):
            assert abs(value - true) <= 2e-14


@pytest.mark.parametrize("p", [1e-7, -1e-10, 1e-20, -1e-40])
def test_a_slow_motion_leaves_a_saddle_by_the_hyperbolic_sine(p: float) -> None:
    """It passed close to two conjugate roots, and was off by 6 % at 1e-7 rad for ``p = 1e-20``."""
    spread = 2.5
    rate = math.sqrt(spread - 1.0)
    quartic = motion(0.0, spread, 0.0, p, 0)
    for share in (0.2, 0.5, 0.8, 1.0):
        t = share * math.asinh(1e-7 * rate / abs(p)) / rate
        sine, cosine, found = quartic_motion(quartic, t)
        assert sine == pytest.approx(p * math.sinh(rate * t) / rate, rel=2e-13)
        assert cosine == pytest.approx(1.0, rel=1e-15)
        assert found == pytest.approx(p * math.cosh(rate * t), rel=2e-13)
        assert time_to_place(quartic, sine, cosine, found) == pytest.approx(t, rel=1e-12)


@pytest.mark.parametrize("p", [-1e-3, 1e-20, 1e-60, -1e-100])
@pytest.mark.parametrize("share", [0.1, 0.24, 0.3, 0.49, 0.52, 0.7, 0.96])
def test_a_very_slow_start_on_a_saddle_keeps_its_digits(p: float, share: float) -> None:
    """Products underflowed, states were NaN below 1e-36. Compared with Jacobi's sd and sc."""
    for a0, a2 in ((p * p - 1.0, (2.0 * p * p + 1.5) / 6.0), (p * p + 1.0, 0.3)):
        quartic = QuarticConstants()
        set_quartic_constants(quartic, a0, 0.0, a2, 0.0, p, int(a0 > 0.0))
        t = share * period_of(quartic)
        with mp.workdps(400):
            # u'^2 = a0 u^4 + 6 a2 u^2 + p^2, with m (1 - m) w^4 = -p^2 a0 or (1 - m) w^4 = p^2 a0
            half, last = mp.mpf(3.0 * a2), mp.mpf(p) ** 2 * mp.mpf(a0)
            root = mp.sqrt(half**2 - last)
            square = root + half if a0 > 0.0 else 2 * root
            m = 1 - last / square**2 if a0 > 0.0 else (half + root) / square
            rate = mp.sqrt(square)
            s, c, d = (mp.ellipfun(name, rate * t, m=m) for name in ("sn", "cn", "dn"))
            x, y, moved = (p / rate * s, c, p * d) if a0 > 0.0 else (p / rate * s, d, p * c)
            norm = mp.sqrt(x * x + y * y)
            exact = x / norm, y / norm, moved / norm**2
        for value, true in zip(quartic_motion(quartic, t), exact, strict=True):
            assert value == pytest.approx(float(true), rel=3e-13, abs=0.0)


def test_the_sign_of_a_state_does_not_underflow() -> None:
    """The product of a tiny speed and a short way was zero: `sin h` and `cos h` changed sign."""
    turning, slow = motion(0.5, 1.3, -2.9, 0.0, 0), motion(0.5, 1.3, -2.9, -1e-300, 0)
    for t in (1e-20, 1e-10, 1.0):
        assert quartic_motion(slow, t) == pytest.approx(
            quartic_motion(turning, t), rel=1e-13, abs=0.0
        )


@pytest.mark.parametrize(("tilt", "spread", "angle", "p", "over", "near"), ORBITS)
@pytest.mark.parametrize("share", [0.05, 0.31, 0.62, 0.93])
def test_time_of_a_place_is_the_inverse(
    tilt: float, spread: float, angle: float, p: float, over: int, near: float, share: float
) -> None:
    quartic = motion(tilt, spread, angle, p, over)
    period = period_of(quartic)
    sine, cosine, rate = quartic_motion(quartic, share * period)
    found = time_to_place(quartic, sine, cosine, rate)
    assert found == pytest.approx(share * period, rel=1e3 * near)
    assert squared_rate(quartic, sine, cosine) == pytest.approx(rate * rate, rel=2e-14, abs=2e-14)


def test_a_place_is_passed_again_after_a_period() -> None:
    quartic = motion(-0.7, 1.4, 2.0, -0.3, 0)
    first = quartic_motion(quartic, 0.4)
    again = quartic_motion(quartic, 0.4 + 3.0 * period_of(quartic))
    assert again == pytest.approx(first, abs=1e-13)
    # Back at the start the other way round.
    back = time_to_place(quartic, 0.0, 1.0, 0.3)
    assert quartic_motion(quartic, back) == pytest.approx((0.0, 1.0, 0.3), abs=1e-14)


@pytest.mark.parametrize("seed", range(4))
def test_a_motion_keeps_its_energy_and_never_jumps(seed: int) -> None:
    chance = random.Random(seed)
    for _ in range(25):
        tilt, spread = chance.uniform(-1.5, 1.5), chance.choice([0.02, chance.uniform(0.0, 3.0)])
        angle = chance.uniform(-math.pi, math.pi)
        p = chance.choice([0.0, chance.uniform(-1.0, 1.0)])
        highest = Pull(tilt, spread)
        top = max(highest.potential(place) for place in highest.equilibria())
        energy = p * p + highest.potential(angle)
        if abs(energy - top) < 1e-3:
            continue
        quartic = motion(tilt, spread, angle, p, int(energy > top))
        before = (0.0, 1.0)
        for t in np.linspace(0.0, 2.2 * period_of(quartic), 1000).tolist():
            sine, cosine, rate = quartic_motion(quartic, t)
            assert abs(squared_rate(quartic, sine, cosine) - rate * rate) < 1e-12
            assert sine * before[0] + cosine * before[1] > 0.0
            before = (sine, cosine)


TILT, SPREAD = 0.4, 2.5


def potential(half: Any) -> Any:
    both = mp.sin(2 * half) / 2
    return mp.sin(half) ** 2 - both * (TILT + SPREAD * both)


def torque(angle: Any) -> Any:
    return -mp.sin(angle) + TILT * mp.cos(angle) + SPREAD * mp.sin(2 * angle) / 2


@pytest.mark.parametrize("p", [1e-15, -1e-20, 1e-100])
@pytest.mark.parametrize("end", [0.3, -0.3])
def test_a_slower_start_on_a_saddle_is_later_by_the_logarithm(p: float, end: float) -> None:
    """Off the axis it never came round, and was 8e-3 off at 1e-15: the torque is rounding there."""
    saddle = mp.findroot(torque, mp.pi) / 2

    def time(rate: float) -> float:
        flight = Flight()
        flight.tilt, flight.spread, flight.frequency = TILT, SPREAD, 1.0
        flight.turns_over, flight.saddle_root, flight.flow_p = 1, -abs(rate), rate
        flight.saddle_s, flight.saddle_c = float(mp.sin(saddle)), float(mp.cos(saddle))
        flight.flow_s, flight.flow_c = flight.saddle_s, flight.saddle_c
        set_motion(flight)
        s, c = float(mp.sin(saddle + end)), float(mp.cos(saddle + end))
        speed = math.sqrt(potential(saddle) - potential(saddle + end))
        return time_of_flight(flight, s, c, math.copysign(speed, rate))

    first = math.copysign(1e-13, p)
    later = math.log(first / p) / math.sqrt(mp.diff(torque, 2 * saddle))
    assert time(p) - time(first) == pytest.approx(later, abs=3e-13)


@pytest.mark.parametrize("root", [-1e-8, 1e-9], ids=["over the saddle", "turning beside it"])
@pytest.mark.parametrize("about", [-0.3, -3.0], ids=["bottom", "top"])
def test_times_and_places_past_a_saddle_keep_their_digits(about: float, root: float) -> None:
    """Times were up to 1e-9 s off, places 1e-12. Compared with the integral of 1/P on both."""
    saddle = mp.findroot(torque, about) / 2
    energy = potential(saddle) - mp.mpf(root) * abs(root)
    back = 1 if root < 0.0 else -1
    ends = [saddle - mp.mpf("0.004"), saddle + back * mp.mpf("0.0015")]
    rates = [mp.sqrt(energy - potential(end)) for end in ends]
    flight = Flight()
    flight.tilt, flight.spread, flight.frequency = TILT, SPREAD, 1.0
    flight.saddle_root, flight.flow_p = root, float(rates[0])
    flight.turns_over = 1 if root < 0.0 and about < -1.0 else 0
    flight.saddle_s, flight.saddle_c = float(mp.sin(saddle)), float(mp.cos(saddle))
    flight.flow_s, flight.flow_c = float(mp.sin(ends[0])), float(mp.cos(ends[0]))
    set_motion(flight)
    to_s, to_c = float(mp.sin(ends[1])), float(mp.cos(ends[1]))
    found = time_of_flight(flight, to_s, to_c, back * float(rates[1]))

    # Ways from the saddle are in units of the one where it turns, or of about the least rate.
    size = mp.mpf(abs(root))
    if root > 0.0:
        size = mp.findroot(lambda way: energy - potential(saddle - way), size)

    def time(end: Any) -> Any:
        side = mp.sign(end - saddle)

        def slowness(x: Any) -> Any:
            way, moved = (mp.sinh(x), mp.cosh(x)) if root < 0.0 else (mp.cosh(x), mp.sinh(x))
            return size * moved / mp.sqrt(energy - potential(saddle + side * size * way))

        ratio = abs(end - saddle) / size
        last = mp.asinh(ratio) if root < 0.0 else mp.acosh(ratio)
        return mp.quad(slowness, mp.linspace(0, last, 8), method="gauss-legendre", maxdegree=4)

    whole = time(ends[0]) + time(ends[1])
    # A rounding of a place is 1e-13 s.
    assert abs(found - whole) <= 2e-13
    s, c, p = flow(flight, float(whole))
    assert abs(mp.mpf(s) * mp.cos(ends[1]) - mp.mpf(c) * mp.sin(ends[1])) <= 2e-13 * abs(p)
    assert abs(p - back * rates[1]) <= 2e-13 * abs(p)


def flight_below(tilt: float, spread: float, about: float, way: float) -> tuple[Flight, Any, Any]:
    """Return a flight that turns beside a saddle, its state at the start, and where it turns.

    It starts half an angle `way` from the saddle, away from it; half the angle from the saddle
    to where it turns is returned.
    """

    def torque(f: Any) -> Any:
        return tilt * mp.cos(f) - mp.sin(f) + mp.mpf(spread) / 2 * mp.sin(2 * f)

    def height(half: Any) -> Any:
        sc = mp.sin(half) * mp.cos(half)
        return mp.sin(half) ** 2 - sc * (tilt + spread * sc)

    saddle, root = mp.findroot(torque, about) / 2, 1e-6
    half = saddle + mp.mpf(way)
    turn = mp.findroot(lambda x: height(saddle) - mp.mpf(root) ** 2 - height(saddle - x), root)
    p = mp.sign(way) * mp.sqrt(height(saddle) - mp.mpf(root) ** 2 - height(half))
    flight = Flight()
    flight.tilt, flight.spread, flight.frequency = tilt, spread, 1.0
    flight.saddle_root, flight.flow_p = root, float(p)
    flight.saddle_s, flight.saddle_c = float(mp.sin(saddle)), float(mp.cos(saddle))
    flight.flow_s, flight.flow_c = float(mp.sin(half)), float(mp.cos(half))
    set_motion(flight)
    return flight, (mp.sin(half), mp.cos(half), p), turn


@pytest.mark.parametrize(
    ("tilt", "spread", "about", "way"),
    [
        pytest.param(0.67, 0.31, -2.66, -0.03, id="round below a top"),
        pytest.param(30.0, 100.0, -0.308, 0.001, id="to a crest more than half a turn away"),
        pytest.param(30.0, 100.0, -0.308, 1.773, id="back from there"),
    ],
)
def test_times_to_more_than_half_a_turn_from_a_saddle(
    tilt: float, spread: float, about: float, way: float
) -> None:
    """They were the time back, 40 s for 3 s; from there, the motion was no number."""
    flight, start, _ = flight_below(tilt, spread, about, way)
    exact = ArcMotion(mp.one, start, (mp.mpf(tilt), mp.mpf(spread)))
    for t in (0.1, 1.2, 4.0 if spread < 1.0 else 0.9):
        state = exact.at(mp.mpf(t))
        assert abs(time_of_flight(flight, *map(float, state)) - t) <= 5e-13
        for value, true in zip(flow(flight, t), state, strict=True):
            assert abs(value - true) <= 1e-13 * max(abs(true), 1)


def test_a_motion_does_not_turn_opposite_its_saddle() -> None:
    """The second step is 5e-8 beyond there, which was taken for a place just before the saddle."""
    way = 0.72431747076
    flight, _, turn = flight_below(0.67, 0.31, -2.66, way)
    assert abs(half_way(flight, 1.0) - (mp.pi - way - abs(turn))) <= 1e-12


@pytest.mark.parametrize(
    ("spread", "top", "way", "p"),
    [
        pytest.param(1.4, False, 8e-10, -5.0596442e-10, id="within 1e-9 rad, and turns"),
        pytest.param(0.0, True, 2.8e-12, -2.800000000001e-12, id="within 1e-9 rad, and passes"),
        pytest.param(0.4, True, 1.4e-9, -1.652e-9, id="turns on the other side, too"),
        pytest.param(0.13, True, 8e-9, 1e-13, id="hard by where it turns"),
        pytest.param(1.4737861687870821, False, 0.6028448107458996, 0.0, id="at the far turn"),
    ],
)
def test_a_motion_past_its_saddle_keeps_its_digits_wherever_it_starts(
    spread: float, top: bool, way: float, p: float
) -> None:
    """The place where it turns was lost in rounding: up to 4e-9 s, or half a period, were lost."""
    flight = Flight()
    flight.spread, flight.frequency, flight.flow_p = spread, 1.0, p
    flight.saddle_s, flight.saddle_c = (1.0, 0.0) if top else (0.0, 1.0)
    sine, cosine = math.sin(way), math.cos(way)
    flight.flow_s, flight.flow_c = (cosine, -sine) if top else (sine, cosine)
    s, c = mp.mpf(flight.flow_s), mp.mpf(flight.flow_c)
    s, c = s / mp.hypot(s, c), c / mp.hypot(s, c)
    lower = c * c * (1 + spread * s * s) if top else s * s * (spread * c * c - 1)
    energy = mp.mpf(p) ** 2 - lower
    flight.saddle_root = float(-mp.sign(energy) * mp.sqrt(abs(energy)))
    flight.turns_over = int(top and energy > 0)
    set_motion(flight)
    exact_motion = ArcMotion(mp.one, (s, c, mp.mpf(p)), (mp.zero, mp.mpf(spread)))
    for share in (0.03, 0.45, 0.55):
        t = share * period_of(flight)
        s, c, rate = exact_motion.at(mp.mpf(t))
        force = s * c * abs(spread * (c - s) * (c + s) - 1)
        size = abs(rate) + abs(force)
        found = flow(flight, t)
        assert abs(found[0] * c - found[1] * s) <= 2e-13 * size
        assert abs(found[2] - rate) <= 2e-13 * size
        place_lasts = 4e-16 / abs(rate)  # a rounding of the position
        found_time = time_of_flight(flight, float(s), float(c), float(rate))
        assert abs(found_time - t) <= 2e-13 + place_lasts


def test_a_place_ahead_by_a_rounding_is_not_a_whole_period_away() -> None:
    """Both times from the place nearest to the saddle are rounded: their difference was -4e-15."""
    flight = Flight()
    flight.spread, flight.frequency, flight.turns_over = 0.4, 1.0, 1
    flight.saddle_s, flight.saddle_c, flight.saddle_root = 1.0, 0.0, -0.0006922705395527882
    flight.flow_s, flight.flow_c, flight.flow_p = (
        float.fromhex(number)
        for number in ("0x1.901b60888e663p-1", "0x1.3f77428bf7527p-1", "0x1.645abd674dfa1p-1")
    )
    set_motion(flight)
    s, c = math.nextafter(flight.flow_s, 1.0), math.nextafter(flight.flow_c, 0.0)
    rate = flight.flow_p - 3.0 * math.ulp(flight.flow_p)
    assert 0.0 <= time_of_flight(flight, s, c, rate) <= 1e-14


@pytest.mark.parametrize("way", [1e-20, 1e-149])
def test_from_rest_beside_a_top_a_body_turns_on_its_other_side_half_a_period_later(
    way: float,
) -> None:
    """It was to turn 8 s too early, and 1e-42 rad from its start."""
    flight = Flight()
    flight.spread, flight.frequency, flight.saddle_root = 0.5, 1.0, way * math.sqrt(1.5)
    flight.saddle_s, flight.saddle_c, flight.flow_s, flight.flow_c = 1.0, 0.0, 1.0, -way
    set_motion(flight)
    assert time_to_turn(flight, 1.0) == pytest.approx(0.5 * period_of(flight), rel=1e-15)
    assert time_to_turn(flight, -1.0) == 0.0
    assert half_way(flight, 1.0) == pytest.approx(math.pi, rel=1e-15)
