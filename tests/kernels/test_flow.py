"""The flow of one body on one piece, and its inverse, against Taylor series in 50 digits."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.highprecision.reference_solver import ArcMotion
from tests.kernels.kernel_records import flight_on_arc
from vibro_cli.kernels.contact.first_contact import displacement
from vibro_cli.kernels.flow.flow import LINE, advance_slightly, flow, time_of_flight
from vibro_cli.kernels.numerics.elliptic import set_theta_constants
from vibro_cli.kernels.world import Flight
from vibro_cli.stress.oracles.scene import Real, mp

EPSILON = 2.0**-52
SETTINGS = settings(deadline=None, derandomize=True, max_examples=200)
FREQUENCY = 2.79

# (f, P): librations that turn first or pass the bottom first, and rotations.
STARTS = {
    "small libration": (0.1, 0.02),
    "from rest": (-1.3, 0.0),
    "high from rest": (2.9, 0.0),
    "rising": (0.9, 0.4),
    "falling": (0.9, -0.4),
    "past the horizontal": (-2.0, 0.3),
    "slow rotation": (-1.0, 0.9),
    "rotation": (-2.5, 1.5),
    "rotation backwards": (3.0, -1.1),
    "fast rotation": (0.3, 6.0),
}


def half_angle(f: float) -> tuple[float, float]:
    return math.sin(0.5 * f), math.cos(0.5 * f)


def on_circle(s: float, c: float, p: float) -> tuple[Real, Real, Real]:
    """The state that doubles stand for, its place drawn onto the circle.

    The flow of a flight is that of its orbit; S and C are rounded, so that S^2 + C^2 = 1 + eps.
    """
    size = mp.sqrt(mp.mpf(s) ** 2 + mp.mpf(c) ** 2)
    return mp.mpf(s) / size, mp.mpf(c) / size, mp.mpf(p)


@pytest.mark.parametrize("name", STARTS)
def test_flow_against_series(name: str) -> None:
    f, p = STARTS[name]
    flight = flight_on_arc(FREQUENCY, *half_angle(f), p)
    motion = ArcMotion(mp.mpf(FREQUENCY), on_circle(flight.s, flight.c, p))
    for t in (1e-9, 0.003, 0.4, 1.1, 2.7, 6.0):
        u = FREQUENCY * t
        for value, true in zip(flow(flight, t), motion.at(mp.mpf(t)), strict=True):
            # Rates of S, C, P are at most max(1, P), of the state's error more near the top.
            size = max(1.0, abs(p)) ** 2
            steep = 1.0 + u * size + 1.0 / max(abs(flight.complementary_modulus), 0.05)
            assert abs(value - true) <= 8.0 * EPSILON * steep * size, t


@pytest.mark.parametrize("name", STARTS)
def test_displacement_is_good_to_the_last_places_however_short(name: str) -> None:
    f, p = STARTS[name]
    flight = flight_on_arc(FREQUENCY, *half_angle(f), p)
    s0, c0, _ = on_circle(flight.s, flight.c, p)
    motion = ArcMotion(mp.mpf(FREQUENCY), on_circle(flight.s, flight.c, p))
    for t in (1e-12, 1e-7, 0.003, 0.1, 0.3):
        s1, c1, _ = motion.at(mp.mpf(t))
        sine, cosine = displacement(flight, t)
        # At most so far it may go: by its rate, and by its acceleration.
        way = FREQUENCY * t * (abs(p) + FREQUENCY * t * abs(math.sin(f)))
        assert abs(sine - (s1 * c0 - c1 * s0)) <= 16.0 * EPSILON * way * max(1.0, abs(p)), t
        assert abs(cosine - (c1 * c0 + s1 * s0)) <= 16.0 * EPSILON * max(1.0, abs(p)), t


@pytest.mark.parametrize("name", STARTS)
def test_flow_at_the_start_is_the_start(name: str) -> None:
    f, p = STARTS[name]
    flight = flight_on_arc(FREQUENCY, *half_angle(f), p)
    for value, start in zip(flow(flight, 0.0), (flight.s, flight.c, p), strict=True):
        assert value == pytest.approx(start, rel=4 * EPSILON)


@pytest.mark.parametrize("name", STARTS)
def test_flow_backwards_in_time_is_the_mirrored_flow(name: str) -> None:
    f, p = STARTS[name]
    s, c = half_angle(f)
    mirrored = flow(flight_on_arc(FREQUENCY, -s, c, p), 0.7)
    back = flow(flight_on_arc(FREQUENCY, s, c, p), -0.7)
    assert back == pytest.approx((-mirrored[0], mirrored[1], mirrored[2]), abs=1e-14 * (1 + p * p))


def next_time(name: str, share: float) -> tuple[Flight, float, tuple[float, float, float]]:
    """A flight, a time ahead within its first period, and the state there."""
    f, p = STARTS[name]
    flight = flight_on_arc(FREQUENCY, *half_angle(f), p)
    root = abs(flight.complementary_modulus)
    reduced = root if flight.complementary_modulus > 0.0 else root / math.sqrt(flight.parameter)
    quarter = mp.ellipk(1 - mp.mpf(reduced) ** 2)
    turn = flight.complementary_modulus < 0.0
    whole = 2 * quarter / mp.sqrt(flight.parameter) if turn else 4 * quarter
    t = share * float(whole) / FREQUENCY
    s, c, p = (float(value) for value in _exact(flight, t))
    return flight, t, (s, c, p)


def _exact(flight: Flight, t: float) -> tuple[Real, Real, Real]:
    motion = ArcMotion(mp.mpf(FREQUENCY), on_circle(flight.s, flight.c, flight.p))
    return motion.at(mp.mpf(t))


@pytest.mark.parametrize("share", [0.001, 0.05, 0.2, 0.26, 0.45, 0.55, 0.7, 0.8, 0.95])
@pytest.mark.parametrize("name", STARTS)
def test_time_to_is_the_inverse_of_the_flow(name: str, share: float) -> None:
    flight, t, state = next_time(name, share)
    found = time_of_flight(flight, *state)
    # The rounding of the state alone moves the time by eps over the state's own rate.
    s, c, p = (abs(value) for value in state)
    rate = FREQUENCY * max(p * max(s, c), s * c)
    allowed = 16.0 * EPSILON * t + 8.0 * EPSILON * max(1.0, abs(flight.p)) / rate
    assert abs(found - t) <= allowed


@SETTINGS
@given(
    f=st.floats(-3.0, 3.0), p=st.floats(-3.0, 3.0), share=st.floats(0.01, 0.99)
)  # fmt: skip
def test_time_to_inverts_the_flow_anywhere(f: float, p: float, share: float) -> None:
    s, c = half_angle(f)
    assume(abs(abs(p) - c) > 1e-3 and (abs(p) > 1e-3 or abs(s) > 1e-2))
    flight = flight_on_arc(FREQUENCY, s, c, p)
    root = abs(flight.complementary_modulus)
    if flight.complementary_modulus > 0.0:
        whole = float(4 * mp.ellipk(1 - mp.mpf(root) ** 2))
    else:
        m = flight.parameter
        whole = float(2 * mp.ellipk(1 / mp.mpf(m)) / mp.sqrt(m))
    t = share * whole / FREQUENCY
    state = flow(flight, t)
    # The half angles of a piece are within (-pi, pi): no body is more than a turn from its middle.
    assume(flight.complementary_modulus > 0.0 or state[1] > 0.0 or state[0] * p > 0.0)
    found = time_of_flight(flight, *state)
    s1, c1, p1 = (abs(value) for value in state)
    rate = FREQUENCY * max(p1 * max(s1, c1), s1 * c1)
    assert abs(found - t) <= 32.0 * EPSILON * t + 64.0 * EPSILON * max(1.0, p * p) / rate


@pytest.mark.parametrize("exponent", [-3, -6, -8, -12, -16, -30, -70, -71, -100, -160, -200, -300])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_start_from_rest_hard_by_a_crest(exponent: int, side: float) -> None:
    """Released 10^exponent rad off a crest, a body reaches 50 degrees after ln(..)/w."""
    psi = side * 10.0**exponent
    s, c = math.cos(0.5 * psi), -math.sin(0.5 * psi)
    flight = flight_on_arc(FREQUENCY, s, c, 0.0)
    end = math.radians(50.0) * side
    end_s, end_c = math.cos(0.5 * end), -math.sin(0.5 * end)
    # m - S^2 = C^2 - (1 - m); from rest 1 - m = C0^2.
    p = side * math.sqrt((end_c - c) * (end_c + c))
    found = time_of_flight(flight, end_s, end_c, p)
    assert abs(found / crest_departure(psi, end) - 1) <= 1e-12


def crest_departure(psi: float, end: float) -> Real:
    """Time from rest at psi to the angle ``end`` on a hump, by the incomplete integral.

    psi'^2 = 4w^2 (sin^2(psi/2) - sin^2(psi0/2)); with sin(psi/2) = sin(psi0/2) cosh(x) that is
    2 w dt = 2 dx/cos(psi/2), a smooth integrand over ln(2 sin(psi/2)/sin(psi0/2)).
    """
    low = mp.sin(mp.mpf(abs(psi)) / 2)
    high = mp.sin(mp.mpf(abs(end)) / 2)
    top = mp.acosh(high / low)
    points = [mp.zero] + [top - step for step in (40, 20, 10, 5, 2) if step < top] + [top]
    integral = mp.quad(lambda x: 1 / mp.sqrt(1 - (low * mp.cosh(x)) ** 2), points)
    return integral / mp.mpf(FREQUENCY)


@pytest.mark.parametrize("exponent", [-3, -8, -16, -40, -100, -150])
def test_passing_hard_over_a_crest(exponent: int) -> None:
    """A rotation 10^exponent above the separatrix passes the top, at the right time."""
    start = -math.radians(50.0)
    root = 10.0**exponent
    s, c = math.cos(0.5 * start), -math.sin(0.5 * start)
    flight = Flight()
    flight.frequency = FREQUENCY
    p = math.hypot(c, root)
    flight.s, flight.c, flight.p = s, c, p
    flight.flow_s, flight.flow_c, flight.flow_p = s, c, p
    set_theta_constants(flight, 1.0 + root * root, -root)
    found = time_of_flight(flight, s, -c, p)
    # By symmetry twice the time from the crest: with sin(psi/2) = root sinh(x) it is dx/cos(psi/2).
    top = mp.asinh(mp.sin(mp.mpf(-start) / 2) / mp.mpf(root))
    points = [mp.zero] + [top - step for step in (40, 20, 10, 5, 2) if step < top] + [top]
    exact = 2 * mp.quad(lambda x: 1 / mp.sqrt(1 - (root * mp.sinh(x)) ** 2), points)
    assert abs(found * FREQUENCY / exact - 1) <= 1e-12


@pytest.mark.parametrize("name", STARTS)
def test_a_small_step_is_of_second_order(name: str) -> None:
    f, p = STARTS[name]
    s, c = half_angle(f)
    motion = ArcMotion(mp.mpf(FREQUENCY), (mp.mpf(s), mp.mpf(c), mp.mpf(p)))
    for dt in (1e-6, -1e-6, 1e-7):
        stepped = advance_slightly(FREQUENCY, dt, s, c, p)
        third = (FREQUENCY * abs(dt) * max(1.0, abs(p))) ** 3 * max(1.0, abs(p))
        for value, true in zip(stepped, motion.at(mp.mpf(dt)), strict=True):
            assert abs(value - true) <= third + 4.0 * EPSILON * max(1.0, abs(p))


def test_on_a_line_the_flow_is_a_parabola() -> None:
    flight = Flight()
    flight.form = LINE
    flight.flow_s, flight.flow_c, flight.flow_p = 0.4, 1.0, -1.25
    flight.line_acceleration = 2.5
    assert flow(flight, 0.0) == (0.4, 1.0, -1.25)
    assert flow(flight, 0.5) == (0.4 - 0.625 + 0.3125, 1.0, 0.0)
    assert flow(flight, 2.0) == (0.4 - 2.5 + 5.0, 1.0, 3.75)


def test_in_equilibrium_nothing_moves() -> None:
    flight = flight_on_arc(FREQUENCY, 0.0, 1.0, 0.0)
    flight.at_rest = 1
    assert flow(flight, 123.0) == (0.0, 1.0, 0.0)
