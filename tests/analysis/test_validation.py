"""Orbits, families and fits against closed forms, as docs/validation.md lists them."""

from __future__ import annotations

import math
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import brentq, least_squares

from tests.systems.tangent_cases import follow_system
from vibro_cli import example, fit, orbit, orbit_family, simulate
from vibro_cli.analysis.orbits import Orbit, find_orbit, gone_through_once, newton, size_of
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.numerics.elementwise import Floats
from vibro_cli.scenario.loading import scenario_of
from vibro_cli.stress.scenes import GRAVITY, WALLS, Document, ball, scene, system_of, valley
from vibro_cli.systems.trace import simulate_system

KAPPA, RHO = 1.4, 0.9
RATE = math.sqrt(GRAVITY / (KAPPA * RHO))
HALF = math.asin(0.1 / RHO)
"""Half the angle between two balls of radius 0.1 m that touch in a valley of radius 1 m."""


def _two_equal_balls(angle: float, rate: float = 0.0) -> Document:
    """Return two equal balls at rest at opposite angles: they meet at the bottom of a valley."""
    trace = valley(170)
    if rate > 0.0:
        trace["turning"] = {"through_arc": 1, "rate": rate}
    return scene(trace, [ball(-angle), ball(angle)], law="hedrih", time=30.0)


def _rate_at_impact(found: Orbit) -> float:
    """Return the angular velocity (rad/s) of each ball at the impact of a symmetric orbit."""
    return found.shot.approach / (2.0 * math.cos(HALF) * RHO)


def _period(rate: Any) -> Any:
    """Return the time (s) after which a pendulum that leaves `HALF` at a rate (rad/s) is back.

    It is 2 [K(k) - F(x, k)]/w, with k the sine of half the greatest angle, k sin x = sin(HALF/2).
    """
    place = mp.sin(0.5 * HALF)
    modulus = mp.hypot(place, 0.5 * rate / RATE)
    return 2.0 / RATE * (mp.ellipk(modulus**2) - mp.ellipf(mp.asin(place / modulus), modulus**2))


def _sum_of_multipliers(rate: float) -> float:
    """Return the sum of the multipliers of the symmetric orbit of two equal balls.

    A change that moves both balls alike passes the impact unchanged. J of the flight back to the
    same place has the trace -2 - 2 a dT/dp: a is the acceleration at the impact, p the rate.
    """
    return float(-2.0 + 2.0 * RATE**2 * math.sin(HALF) * mp.diff(_period, rate))


@pytest.mark.parametrize("angle", [0.15, 0.5, 1.2, 2.2])
def test_the_symmetric_orbit_of_two_equal_balls_is_that_of_elliptic_integrals(angle: float) -> None:
    found = find_orbit(system_of(_two_equal_balls(angle)), 1, None, 30.0)
    assert found.shot.word == ("12",)
    rate = _rate_at_impact(found)
    assert found.period == pytest.approx(float(_period(rate)), rel=1e-13)
    assert np.sum(found.multipliers) == pytest.approx(_sum_of_multipliers(rate), abs=1e-11)
    assert np.prod(found.multipliers) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.long
def test_the_symmetric_orbit_loses_its_stability_where_its_multipliers_reach_one() -> None:
    document = _two_equal_balls(2.6)
    first = find_orbit(system_of(document), 1, None, 30.0)
    low, high = first.energy - 0.5, first.energy + 1.0
    family = orbit_family(scenario_of(document), first, "energy", low, high)
    (change,) = [one.point.orbit for one in family.special if one.kind == "exchange"]
    greatest = 2.0 * RATE * math.cos(0.5 * HALF)  # on the separatrix
    ends = 0.9 * greatest, 0.999 * greatest
    expected = brentq(lambda rate: _sum_of_multipliers(rate) - 2.0, *ends, rtol=1e-14)
    assert _rate_at_impact(change) == pytest.approx(expected, rel=1e-10)


@pytest.mark.long
def test_the_symmetric_orbit_doubles_where_balls_that_touch_are_in_balance() -> None:
    """On a rotating trace a vanishes where Omega^2 cos(HALF) = g/rho, at any energy."""
    document = _two_equal_balls(0.9, 3.3)
    first = find_orbit(system_of(document), 1, None, 30.0)
    family = orbit_family(scenario_of(document), first, "trace.turning.rate", 3.29, 3.33)
    (change,) = [one.point.value for one in family.special if one.kind == "doubling"]
    assert change == pytest.approx(math.sqrt(GRAVITY / (RHO * math.cos(HALF))), rel=1e-11)


def _action(found: Orbit) -> float:
    """Return the integral of p dq = kappa m v^2 dt over the period of an orbit (J s)."""
    inertia = np.array([body.kappa * body.mass for body in found.system.bodies])
    run = simulate_system(found.system, found.period, None)
    nodes, weights = np.polynomial.legendre.leggauss(30)
    total = 0.0
    for start, end in zip([0.0, *found.shot.times], [*found.shot.times, found.period], strict=True):
        half = 0.5 * (end - start)
        speed = run.sample(start + half * (nodes + 1.0))["speed"].reshape(len(nodes), -1)
        total += half * float(weights @ (speed**2 @ inertia))
    return total


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("falling_balls", {"balls[2].mass": 3.0}),
        ("one_circle", {"collision.k": 1.0, "balls[2].density": 3000.0}),
    ],
)
def test_the_period_is_the_derivative_of_the_action_by_the_energy(
    name: str, changes: dict[str, float]
) -> None:
    """This holds in every family of a Hamiltonian system with elastic impacts."""
    first = orbit(example(name).replace(changes), 1)
    places = np.linspace(-1.0, 1.0, 7)
    width = 0.02 * first.energy_start
    orbits = [
        newton(first.system, first.state, first.period, first.energy + width * place)
        for place in places
    ]
    slope = np.polynomial.Polynomial.fit(places, [*map(_action, orbits)], len(orbits) - 1).deriv()
    np.testing.assert_allclose(slope(places) / width, [one.period for one in orbits], rtol=1e-9)


def _unequal_balls(rate: float) -> TraceSystem:
    trace = {**valley(150), "turning": {"through_arc": 1, "rate": rate}}
    return system_of(scene(trace, [ball(-0.9), ball(0.9, mass=1.3)], law="hedrih", time=30.0))


def _before_doubling(found: Orbit) -> float:
    """Return det(R + 1) of the map across an orbit, which is 0 where its period doubles."""
    return float(np.linalg.det(found.reduced + np.eye(2)))


def _next_doubling(first: Orbit, rate: float, width: float) -> tuple[Orbit, float]:
    """Return where the orbits that branch off at a doubling double themselves.

    They depart as the root x of their distance from it, rate + width x^2, along the eigenvector of
    the multiplier -1. Starts and periods are extrapolated in x.
    """
    values, vectors = np.linalg.eig(first.shot.matrix)
    side = vectors[:, np.argmin(np.abs(values + 1.0))].real
    size = size_of(first.system, first.state) / size_of(first.system, side)
    places, known = [0.0], [np.append(first.state, 2.0 * first.period)]

    def guess(x: float) -> Floats:
        columns = np.array(known[-4:]).T
        powers = len(columns[0]) - 1
        return np.array([np.polyval(np.polyfit(places[-4:], one, powers), x) for one in columns])

    def at(x: float, start: Floats) -> Orbit:
        return newton(_unequal_balls(rate + width * x**2), start[:-1], start[-1], first.energy)

    def tested(x: float) -> float:
        return _before_doubling(at(x, guess(x)))

    x, step = 0.02, 0.04
    starts = (known[0] + np.append(share * size * side, 0.0) for share in (1e-3, 3e-3, 1e-2))
    found = next(one for one in (at(x, start) for start in starts) if gone_through_once(one) is one)
    while _before_doubling(found) > 0.0:
        places.append(x)
        known.append(np.append(found.state, found.period))
        x, step = x + step, min(1.5 * step, 0.15)
        found = at(x, guess(x))
    x = brentq(tested, places[-1], x, xtol=1e-13)
    return at(x, guess(x)), rate + width * x**2


@pytest.mark.long
def test_periods_double_again_and_again_at_the_ratio_of_area_preserving_maps() -> None:
    """Greene, MacKay, Vivaldi, Feigenbaum, Physica D 3 (1981) 468: 8.721097."""
    start = find_orbit(_unequal_balls(2.0), 1, None, 30.0)

    def at(rate: float) -> Orbit:
        return newton(_unequal_balls(rate), start.state, start.period, start.energy)

    rates, width = [brentq(lambda rate: _before_doubling(at(rate)), 2.0, 2.4, xtol=1e-13)], 1.0
    found = at(rates[0])
    for _ in range(5):
        found, rate = _next_doubling(found, rates[-1], width)
        width = (rate - rates[-1]) / 8.0
        rates.append(rate)
    assert len(found.shot.word) == 32
    apart = np.diff(rates)
    assert apart[-2] / apart[-1] == pytest.approx(8.721097, rel=0.005)


@pytest.mark.parametrize("mass", [1.0, 2.0, 3.0])
def test_two_particles_between_walls_are_a_billiard_in_a_right_triangle(mass: float) -> None:
    """Its corners are polygonal: no exponent; a path at a right angle to a side comes back."""
    line = {"start_slope": 0.0, "arcs": [{"shape": "line", "length": 10.0}]}
    one = {"body": "particle", "radius": 0.05, "arc": 1, "mass": 1.0, "position": 3.0, "speed": 1.0}
    other = {**one, "mass": mass, "position": 6.0, "speed": -0.37}
    law = "translational"
    system = system_of({**scene(line, [one, other], law=law, time=1.0), **WALLS})
    exponents = follow_system(system, None, 3000).growth.exponents(per_impact=True)[0]
    assert np.max(np.abs(exponents)) < 1.5 * math.log(3000) / 3000
    bodies = [{**one, "position": 0.05 + 1e-9}, {**other, "speed": 0.0}]
    found = find_orbit(system_of({**scene(line, bodies, law=law, time=1.0), **WALLS}), None, None)
    assert found.verdict == "neutral"
    np.testing.assert_allclose(found.multipliers, 1.0, atol=1e-6)


LOWER = 2.0
"""Mass of the lower ball (kg)."""


def _impacts_of_falling_balls(numbers: Floats, count: int) -> Floats:
    """Return instants of impacts of ``falling_balls``: parabolas, without the program.

    Numbers are gravity, the mass of the upper ball and k.
    """
    gravity, upper, k = numbers
    pull = 0.5 * gravity
    low, high, down, up = 0.51, 1.13, 2.0, -1.0  # heights over those of contact, speeds
    t, found = 0.0, list[float]()
    while len(found) < count:
        fall = (down + math.sqrt(down**2 + 2.0 * pull * low)) / pull
        meet = (high - low) / (down - up) if down > up else math.inf
        step = min(fall, meet)
        t += step
        low, high = (
            place + speed * step - 0.5 * pull * step**2
            for place, speed in ((low, down), (high, up))
        )
        down, up = down - pull * step, up - pull * step
        if fall < meet:
            low, down = 0.0, -down
            continue
        low = high = 0.5 * (low + high)
        impulse = (1.0 + k) * (down - up) / (1.0 / LOWER + 1.0 / upper)
        down, up = down - impulse / LOWER, up + impulse / upper
        found.append(t)
    return np.array(found)


def test_the_intervals_of_a_fit_are_those_of_the_profile_likelihood() -> None:
    """It is computed with another simulation and differences, one number at a time."""
    count, sigma, level = 10, 2e-4, 1.959963984540054
    names = ["gravity", "balls[2].mass", "collision.k"]
    true = [9.81, 1.3, 0.95]
    scenario = example("falling_balls").replace(dict(zip(names, true, strict=True)))
    exact = _impacts_of_falling_balls(np.array(true), count)
    run = simulate(scenario.replace({"stop.collisions": count, "analysis.lyapunov": False}))
    np.testing.assert_allclose(run.collisions["t"], exact, atol=1e-12)
    measured = exact + np.random.default_rng(5).normal(0.0, sigma, count)
    found = fit(scenario, measured, names, noise=sigma)

    def least(number: int, value: float) -> float:
        """Return the least chi square with one number held at a value."""
        others = [n for n in range(3) if n != number]
        along = found.covariance[others, number] / found.covariance[number, number]
        start = found.values[others] + along * (value - found.values[number])

        def late(some: Floats) -> Floats:
            numbers = np.insert(some, number, value)
            return (_impacts_of_falling_balls(numbers, count) - measured) / sigma

        best = least_squares(late, start, jac="3-point", x_scale=found.errors[others])
        return 2.0 * float(best.cost)

    for number in range(3):
        for end, side in zip(found.interval[number], (-1.0, 1.0), strict=True):
            beside = [end + side * share * found.errors[number] for share in (-0.02, 0.02)]
            inner, outer = (least(number, value) - found.chi_square for value in beside)
            assert inner < level**2 < outer
