"""Periodic orbits against those known in closed form, and against simulations beside them."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.integrate import solve_ivp

from tests.scaling import scaled
from vibro_cli import Scenario, example, orbit, orbit_family, simulate
from vibro_cli.analysis import orbit_branch, orbits
from vibro_cli.analysis.orbit_branch import Branch, Family
from vibro_cli.analysis.orbits import (
    NoOrbit,
    Orbit,
    admitted,
    begun_between,
    energy_gradient,
    energy_of,
    find_orbit,
    nearest_return,
    newton,
    shoot,
    started,
    state_at,
    state_of,
    velocity,
)
from vibro_cli.assemble import build_any, build_system
from vibro_cli.commands.app import run_command_line
from vibro_cli.commands.orbit import parsed_range
from vibro_cli.figures import style
from vibro_cli.figures.analyses import branch_figure
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.scenario import load_any, scenario_of
from vibro_cli.scenario.problems import ScenarioError
from vibro_cli.stress.scenes import (
    CIRCLE,
    THREE_ARCS,
    VALLEY,
    WALLS,
    ball,
    scene,
    system_of,
    three_arcs,
    valley,
)
from vibro_cli.systems.trace import simulate_system

FALLING = Path(__file__).parents[2] / "scenarios" / "falling_balls.toml"
PULL = 9.81 * math.sin(math.radians(30.0))


def _falling(upper: float = 1.0) -> TraceSystem:
    system: TraceSystem = build_any(load_any(FALLING))
    one, other = system.bodies
    return replace(system, bodies=(one, replace(other, mass=upper)))


def _by_hand(lower: float, upper: float, speed: float) -> Any:
    """The map of one impact and one bounce, as a product of flights and saltation matrices.

    The bodies meet with opposite momenta, so that the impact and the bounce turn all speeds round;
    ``speed`` is that of the upper body at the impact.
    """
    v = np.array([speed * upper / lower, -speed])
    flight = np.eye(4)
    flight[0, 1] = flight[2, 3] = speed / PULL
    total = lower + upper
    speeds = np.array([[lower - upper, 2 * upper], [2 * lower, upper - lower]]) / total
    jump = np.zeros((4, 4))
    jump[0, 0] = jump[2, 2] = 1.0
    jump[1::2, 1::2] = speeds
    before = np.array([v[0], -PULL, v[1], -PULL])
    after = np.array([-v[0], -PULL, -v[1], -PULL])
    gap = np.array([-1.0, 0.0, 1.0, 0.0])
    impact = jump + np.outer(after - jump @ before, gap) / (gap @ before)
    down = -(speed * upper / lower + speed)
    bounce = np.eye(4)
    bounce[0, 0] = bounce[1, 1] = -1.0
    bounce[1, 0] = 2.0 * -PULL / down
    return flight @ bounce @ flight @ impact


@pytest.mark.long
@pytest.mark.parametrize("upper", [0.5, 1.0, 3.0])
def test_the_orbit_of_one_impact_and_one_bounce_is_that_in_closed_form(upper: float) -> None:
    orbit = (
        find_orbit(_falling(upper), 1)
        if upper == 1.0
        else _branch(0.5, 3.0).points[0 if upper == 0.5 else -1].orbit
    )
    assert orbit.shot.word == ("12", "1|")
    assert orbit.residual < 1e-13
    # The period is the time in which the upper body moves up and down again.
    speed = 0.5 * orbit.period * PULL
    run = simulate_system(orbit.system, orbit.period, None)
    assert run.collisions["speed_b_pre"][0] == pytest.approx(-speed, rel=1e-12)
    expected = np.linalg.eigvals(_by_hand(2.0, upper, speed))
    expected = expected[np.argsort(-np.abs(expected - 1.0))][:2]
    found = orbit.multipliers
    np.testing.assert_allclose(sorted(found, key=_key), sorted(expected, key=_key), atol=1e-7)
    assert abs(np.prod(found) - 1.0) < 1e-10
    assert orbit.stable == (upper > 2.0)


def test_the_events_of_a_body_are_those_of_its_own_number() -> None:
    """Among twelve bodies, 1 and 2 had the events of 10, 11 and 12 too; against the tables."""
    balls = [
        {**ball(-2.75 + 0.5 * number), "radius": 0.05, "speed": 2.0 * (-1.0) ** number}
        for number in range(12)
    ]
    balls[0]["speed"] = -8.0
    system = system_of(scene(CIRCLE, balls, time=1.0))
    shot, run = shoot(system, 1.0), simulate_system(system, 1.0, None)
    pairs = np.column_stack([run.collisions["ball_a"], run.collisions["ball_b"]])
    crossing = run.events["ball"][run.events["event"] == "crossing"]
    own = [np.count_nonzero(pairs == n) + np.count_nonzero(crossing == n) for n in range(1, 13)]
    assert [len(word) for word in shot.jumps] == own
    assert {"9-10", "10-11", "12-1"} <= set(shot.word)
    assert len({word for word in shot.word if word[-1].isdigit()}) == len({*map(tuple, pairs)})


@pytest.mark.parametrize("number", [1, 4, 7])
def test_the_nearest_return_of_an_orbit_is_its_period(number: int) -> None:
    """This holds however often the orbit is traversed, and from a start beside it."""
    orbit = find_orbit(_falling(), 1)
    found = nearest_return(orbit.system, number, 60.0)
    assert found == pytest.approx(number * orbit.period, rel=1e-6)
    beside = started(orbit.system, orbit.state * (1.0 + 1e-9))
    assert find_orbit(beside, number).period == pytest.approx(orbit.period, rel=1e-6)


@pytest.mark.parametrize("upper", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("speed", [1.5, 4.0])
def test_a_start_on_an_orbit_finds_this_orbit(upper: float, speed: float) -> None:
    """Not one of another energy: the motion is known in closed form, as in `_by_hand`.

    The lower body falls from the impact to the wall in the time in which the upper one stops.
    """
    system, slower = _falling(upper), speed * upper / 2.0
    place = system.bodies[0].radius + speed * (2.0 * slower + speed) / (2.0 * PULL)
    since = 0.3 * speed / PULL  # after the impact
    fallen = 0.5 * PULL * since * since
    lower = [place - slower * since - fallen, -slower - PULL * since]
    distance = 2.0 * system.bodies[0].radius
    state = np.array([*lower, place + distance + speed * since - fallen, speed - PULL * since])
    found = find_orbit(started(system, state), 1)
    assert found.period == pytest.approx(2.0 * speed / PULL, rel=1e-12)
    assert found.energy == pytest.approx(energy_of(system, state), rel=1e-12)


def _key(value: complex) -> tuple[float, float]:
    return (round(value.real, 6), value.imag)


def _branch(low: float, high: float) -> Branch:
    return Family(_falling, find_orbit(_falling(), 1), 1.0, low, high).follow()


@pytest.mark.long
def test_an_orbit_with_both_multipliers_at_one_is_neutral(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """They are 1 ± 1e-5i: the root of 1e-10, to which this orbit closes."""
    path = FALLING.with_name("one_circle.toml")
    assert run_command_line(["orbit", str(path), "--set", "collision.k=1"]) == 0
    told = capsys.readouterr().out
    assert re.search(r"\n  multipliers  .*: neutral\n", told)


@pytest.mark.parametrize(
    ("multipliers", "verdict"),
    [
        ([2.0, 0.5], "unstable"),
        ([-1.001, -1.0 / 1.001], "unstable"),
        ([0.6 + 0.8j, 0.6 - 0.8j], "stable"),
        ([1.0 + 1e-5, 1.0 - 1e-5], "neutral"),
        ([1.0 + 1e-5j, 1.0 - 1e-5j], "neutral"),
        ([-1.0 + 1e-5j, -1.0 - 1e-5j], "neutral"),
        ([1j, -1j, 1.0, 1.0], "neutral"),
        ([2.0, 0.5, 1.0, 1.0], "unstable"),
    ],
)
def test_the_verdict_on_multipliers(
    monkeypatch: pytest.MonkeyPatch, multipliers: list[complex], verdict: str
) -> None:
    orbit = find_orbit(_falling(), 1)
    monkeypatch.setattr(Orbit, "multipliers", np.array(multipliers))
    assert orbit.verdict == verdict
    assert orbit.stable == (verdict != "unstable")


def _departure(orbit: Orbit, periods: int) -> float:
    """Return the growth of the distance of a motion that starts beside an orbit on its energy."""
    change = np.array([1.0, 0.3, -0.4, 0.5]) * 1e-7
    gradient = energy_gradient(orbit.system, orbit.state)
    change -= gradient * (gradient @ change) / (gradient @ gradient)
    beside = started(orbit.system, orbit.state + change)
    end = orbit.period * periods
    count = 2 * periods
    times = [
        simulate_system(one, end, count).collisions["speed_a_pre"] for one in (orbit.system, beside)
    ]
    least = min(map(len, times))
    return float(np.max(np.abs(times[0][:least] - times[1][:least])) / 1e-7)


def test_every_orbit_of_a_family_is_that_in_closed_form() -> None:
    """Around equal masses, where the period doubles; the range begins beside the first orbit."""
    first = find_orbit(_falling(1.986), 1)
    family = Family(_falling, first, 1.986, 1.985, 2.005)
    branch = family.follow()
    values = np.array([point.value for point in branch.points])
    assert (values[0], values[-1]) == (1.985, 2.005)
    assert np.all(np.diff(values) > 0.0)
    assert np.max(np.diff(values)) < 0.06 * 0.02
    for point in branch.points:
        found = point.orbit
        assert found.system.bodies[1].mass == point.value
        assert found.energy == pytest.approx(first.energy, rel=1e-12)
        expected = np.linalg.eigvals(_by_hand(2.0, point.value, 0.5 * found.period * PULL))
        expected = expected[np.argsort(-np.abs(expected - 1.0))][:2]
        assert sorted(found.multipliers, key=_key) == pytest.approx(
            sorted(expected, key=_key), abs=1e-7
        )
    # Along the tangent the period changes with the mass as between the neighbours.
    before, here, after = branch.points[10:13]
    chord = after.along - before.along
    tangent = family._tangent(here, chord)
    assert tangent[-2] / tangent[-1] == pytest.approx(chord[-2] / chord[-1], rel=1e-3)
    start, doubling, end = branch.special
    assert (start.kind, doubling.kind, end.kind) == ("bound", "doubling", "bound")
    assert (start.after, end.after) == (0, len(values) - 1)
    assert doubling.point.value == pytest.approx(2.0, abs=1e-9)
    assert values[doubling.after] <= doubling.point.value < values[doubling.after + 1]
    # Orbits follow closely where the multipliers part.
    assert doubling.point.value - values[doubling.after] < 0.1 * np.max(np.diff(values))
    assert doubling.fault == ""


def test_a_family_that_passes_the_end_of_its_range_ends_with_the_orbit_there() -> None:
    """It is found from those on both sides; here Newton's method finds it from another start."""
    first = find_orbit(_falling(), 1)
    family = Family(_falling, first, 1.0, 0.9, 1.02)
    one, beyond, last = (
        begun_between(newton(_falling(mass), first.state, first.period, first.energy))
        for mass in (1.01, 1.05, 1.02)
    )
    found = family._at_value(family._point(1.01, one), family._point(1.05, beyond), 1.02)
    assert found.value == pytest.approx(1.02, abs=1e-15)
    assert found.orbit.period == pytest.approx(last.period, rel=1e-12)


@pytest.mark.long
def test_a_family_doubles_its_period_where_the_masses_are_equal() -> None:
    branch = _branch(0.8, 2.5)
    kinds = [one.kind for one in branch.special]
    assert kinds == ["bound", "doubling", "bound"]
    doubling = branch.special[1].point
    assert doubling.value == pytest.approx(2.0, abs=1e-9)
    np.testing.assert_allclose(doubling.orbit.multipliers, [-1.0, -1.0], atol=1e-4)
    for point in branch.points:
        assert point.orbit.residual < 1e-12
        assert point.orbit.energy == pytest.approx(branch.points[0].orbit.energy, rel=1e-12)
    # Simulated on both sides: a small change grows with the multiplier, or does not.
    unstable, stable = branch.points[0].orbit, branch.points[-1].orbit
    assert not unstable.stable
    assert stable.stable
    growth = abs(unstable.multipliers[0]) ** 20
    assert 0.01 * growth < _departure(unstable, 20) < 100.0 * growth
    assert _departure(stable, 20) < 60.0


@pytest.mark.long
@pytest.mark.parametrize(
    ("path", "low", "high", "changes"),
    [
        ("balls[2].mass", 1e-3, 2.5, {}),
        ("balls[2].inertia_ratio", 0.0, 0.4, {"balls[2].inertia_ratio": 0.2}),
        ("balls[2].inertia_ratio", 0.0, 0.4, {"balls[2].inertia_ratio": 0.0}),
    ],
)
def test_a_family_goes_to_the_end_of_what_a_scenario_may_have(
    path: str, low: float, high: float, changes: dict[str, float]
) -> None:
    """No value beyond the range is used, where the scenario might be invalid."""
    scenario = example("falling_balls").replace({"collision.law": "hedrih", **changes})
    family = orbit_family(scenario, orbit(scenario, impacts=1), path, low, high)
    kinds = [one.kind for one in family.special]
    assert (kinds[0], kinds[-1]) == ("bound", "bound")
    assert (family.points[0].value, family.points[-1].value) == (low, high)
    for point in family.points:
        assert point.orbit.residual < 1e-12
        assert point.orbit.energy == pytest.approx(family.points[0].orbit.energy, rel=1e-12)


@pytest.mark.long
def test_a_family_ends_where_an_impact_grazes() -> None:
    """At three times the mass another impact grazes the orbit of two impacts and three bounces."""
    system = _falling(1.5)
    one, other = system.bodies
    system = replace(system, bodies=(replace(one, mass=1.0), other))
    start = [0.525487566038615 + 0.0, 0.0, 1.433816428304394, 0.0]
    first = find_orbit(started(system, np.array(start)), 2)
    assert [word for word in first.shot.word if word == "12"] == ["12", "12"]

    def at(upper: float) -> TraceSystem:
        return replace(system, bodies=(system.bodies[0], replace(other, mass=upper)))

    branch = Family(at, first, 1.5, 1.2, 6.0).follow()
    end = branch.special[-1]
    assert end.kind == "grazing"
    assert end.point.value < 5.9
    # Simulated on both sides: the orbit closes with its events, and a little farther along the
    # family the motion has others, one of them at next to no speed.
    before, last = branch.points[-2:]
    assert last.orbit.residual < 1e-10
    assert last.orbit.shot.word == first.shot.word
    ahead = 1e-3 / (last.value - before.value)
    state = last.orbit.state + ahead * (last.orbit.state - before.orbit.state)
    period = last.orbit.period + ahead * (last.orbit.period - before.orbit.period)
    beyond = shoot(started(at(last.value + 1e-3), state), period)
    assert len(beyond.word) != len(last.orbit.shot.word)
    assert beyond.approach < 0.1 * last.orbit.shot.approach


def test_energy_is_kept_by_motions_and_impacts_on_a_trace_that_turns() -> None:
    balls = [ball(-1.2), ball(0.3, arc=3, mass=1.3)]
    document = scene(THREE_ARCS, balls, 1.0, "normal-impulse", time=5.0)
    document["trace"] = document["trace"] | {"turning": {"through_arc": 1, "rate": 1.5}}
    system = system_of(document)
    run = simulate_system(system, 5.0, None)
    assert len(run.collisions["t"]) == 3
    energies = [energy_of(system, state) for state in state_at(run, np.linspace(0.0, 5.0, 37))]
    np.testing.assert_allclose(energies, energies[0], rtol=1e-12)


def test_an_orbit_on_a_trace_that_turns() -> None:
    document = scene(CIRCLE, [ball(-0.6), ball(0.6, mass=1.3)], 1.0, "normal-impulse", collisions=1)
    document["trace"] = document["trace"] | {"turning": {"through_arc": 1, "rate": 0.5}}
    found = find_orbit(system_of(document), 1, None, 100.0)
    assert found.residual < 1e-13
    assert np.prod(found.multipliers) == pytest.approx(1.0, abs=1e-12)
    again = simulate_system(found.system, 20.0 * found.period, None)
    gaps = np.diff(again.collisions["t"])
    assert len(gaps) == 19
    np.testing.assert_allclose(gaps, found.period, rtol=1e-11)


@pytest.mark.parametrize(
    ("trace", "ends", "angles", "words"),
    [
        (VALLEY, {}, [0.3, 3.1], "body 2 would start off the trace"),
        (VALLEY, {}, [0.3, -0.3], "body 2 would start left of body 1"),
        (VALLEY, {}, [0.3, 0.4], "bodies 1 and 2 would start overlapping"),
        (VALLEY, {"left": {"wall": 1.0}}, [math.radians(-169.0), 0.3], "body 1 would start in a"),
        (VALLEY, {"right": {"wall": 1.0}}, [0.3, math.radians(169.0)], "body 2 would start in a"),
        (CIRCLE, {}, [0.3, -3.0], "body 2 would start left of body 1"),
        (CIRCLE, {}, [-3.1, 3.1], "bodies 1 and 2 would start overlapping"),
        (CIRCLE, {}, [-3.1, 0.3, 3.1], "bodies 1 and 3 would start overlapping"),
    ],
)
def test_a_start_that_a_scenario_may_not_have_is_no_start_of_an_orbit(
    trace: dict[str, Any], ends: dict[str, Any], angles: list[float], words: str
) -> None:
    document = scene(trace, [ball(angle) for angle in angles], time=9.0) | {"ends": ends}
    with pytest.raises(ScenarioError):
        system_of(document)
    places = [-1.0, 0.0, 1.0][: len(angles)]
    system = system_of(document | {"balls": [ball(place) for place in places]})
    state = np.zeros(2 * len(angles))
    left = system.trace.pieces[0].angle_start
    state[::2] = [0.9 * (angle - left) for angle in angles]
    with pytest.raises(NoOrbit, match=words):
        admitted(system, state)


@pytest.mark.long
def test_a_step_over_the_seam_of_a_circle_is_none() -> None:
    """Newton's method moves the upper ball across the seam, into the other ball."""
    document = scene(CIRCLE, [ball(1.0), ball(2.5, mass=5.0, rate=-1.3)], time=15.0)
    system = system_of(document)
    with pytest.raises(NoOrbit, match="would start"):
        admitted(system, np.array([4.9, -3.4, 0.34, 0.92]))
    with pytest.raises(NoOrbit, match="does not converge"):
        find_orbit(system, 1)


def test_an_orbit_round_a_circle_begins_with_its_balls_in_order() -> None:
    """Between the two events that are farthest apart only one ball has crossed the seam."""
    balls = [ball(-1.13, rate=8.94), ball(-0.587, mass=1.3, rate=4.1)]
    document = scene(CIRCLE, balls, time=20.0)
    found = find_orbit(system_of(document), 2)
    assert found.shot.word == ("12", "2>", "12", "1>")
    assert found.residual < 1e-12
    again = [
        one | {"angle": start.position, "rate": start.speed / 0.9}
        for one, start in zip(balls, found.system.initial, strict=True)
    ]
    run = simulate_system(system_of(document | {"balls": again}), 10.0 * found.period, None)
    times = run.collisions["t"]
    assert len(times) == 20
    np.testing.assert_allclose(times[2:] - times[:-2], found.period, rtol=1e-11)


def test_an_orbit_begins_midway_between_the_two_events_that_are_farthest_apart() -> None:
    """This holds wherever the start lies on the orbit, here of two impacts and three bounces."""
    system = _falling(1.5)
    lower, upper = system.bodies
    system = replace(system, bodies=(replace(lower, mass=1.0), upper))
    known = find_orbit(started(system, np.array([0.525487566, 0.0, 1.433816428, 0.0])), 2)
    run = simulate_system(known.system, known.period, None)
    times = np.array([*known.shot.times, known.shot.times[0] + known.period])
    assert len(times) == 6
    for middle in 0.5 * (times[1:] + times[:-1]):
        found = find_orbit(started(system, state_at(run, middle % known.period)), 2)
        after, before = found.shot.times[0], found.period - found.shot.times[-1]
        assert after == pytest.approx(before, rel=1e-9)
        assert after + before == pytest.approx(np.max(np.diff(times)), rel=1e-9)


def test_a_motion_of_very_many_impacts_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    found = find_orbit(_falling(), 1)
    monkeypatch.setattr(orbits, "MOST_IMPACTS", 5)
    with pytest.raises(NoOrbit, match="found 5 impacts in a period, expected fewer"):
        shoot(found.system, 6.0 * found.period)


@pytest.mark.long
@pytest.mark.parametrize("mass", [1.2, 1.5, 2.0])
@pytest.mark.parametrize("angle", [0.4, 0.5])
@pytest.mark.parametrize("impacts", [1, 2, 3])
def test_orbits_are_found_from_starts_that_are_not_next_to_one(
    mass: float, angle: float, impacts: int
) -> None:
    """Motions around stable orbits nearly close; simulation shows where they do close."""
    left, right = ball(-0.4, rate=0.1), ball(angle, omega=-0.1, mass=mass)
    found = find_orbit(system_of(scene(VALLEY, [left, right], time=30.0)), impacts, None, 30.0)
    assert found.stable
    end = simulate_system(found.system, 2.0 * found.period, None, "python").summary
    for body, start in enumerate(found.system.initial, 1):
        come = end[f"angle_{body}"][0], end[f"speed_{body}"][0]
        assert come == pytest.approx((start.position, start.speed), abs=1e-9)


def _after_pendulums(orbit: Orbit) -> Any:
    """Return angles and rates a period later, from two pendulums with contact by Runge-Kutta."""
    one, other = orbit.system.bodies
    radius, total = 0.9, one.mass + other.mass
    closed = 2.0 * math.asin(0.1 / radius)

    def rates(_: float, z: Any) -> list[float]:
        pull = orbit.system.gravity / (one.kappa * radius)
        return [z[1], -pull * math.sin(z[0]), z[3], -pull * math.sin(z[2])]

    def gap(_: float, z: Any) -> float:
        return float(z[2] - z[0] - closed)

    gap.terminal, gap.direction = True, -1.0  # type: ignore[attr-defined]
    t = 0.0
    z = np.ravel([(start.position, start.speed / radius) for start in orbit.system.initial])
    while t < orbit.period:
        found = solve_ivp(
            rates, (t, orbit.period), z, method="DOP853", events=gap, rtol=1e-13, atol=1e-14
        )
        t, z = found.t[-1], found.y[:, -1].copy()
        if found.status == 1:
            mean = (one.mass * z[1] + other.mass * z[3]) / total
            z[1::2] = 2.0 * mean - z[1::2]
    return z


@pytest.mark.long
@pytest.mark.parametrize(
    ("slope", "angles", "mass", "impacts"),
    [
        (60, (-0.81, 0.006), 1.00007, 3),
        (60, (-0.427, 0.269), 2.69, 5),
        (170, (0.3946, 1.0176), 1.0, 5),
    ],
)
def test_orbits_are_found_where_many_motions_nearly_close(
    slope: int, angles: tuple[float, float], mass: float, impacts: int
) -> None:
    """The bodies are nearly equal, or the period hardly depends on the amplitude."""
    balls = [ball(angles[0]), ball(angles[1], mass=mass)]
    found = find_orbit(system_of(scene(valley(slope), balls, time=50.0)), impacts, None, 50.0)
    assert found.residual < 1e-13
    start = [(start.position, start.speed / 0.9) for start in found.system.initial]
    np.testing.assert_allclose(_after_pendulums(found), np.ravel(start), atol=1e-10)


@pytest.mark.long
@pytest.mark.parametrize(
    ("left", "right"), [((0.5, 0.07, 0.0), (0.7, 0.06, -0.2)), ((1.6, 0.1, 0.2), (1.8, 0.06, -0.1))]
)
def test_bodies_at_rest_are_no_orbit(
    left: tuple[float, float, float], right: tuple[float, float, float]
) -> None:
    """On a level line bodies part for good after an impact, unless they reach a wall."""
    trace = {"start_slope": 0.0, "arcs": [{"shape": "line", "length": 3.0}]}
    balls = [
        {"radius": radius, "mass": mass, "arc": 1, "position": way, "speed": speed}
        for mass, (way, radius, speed) in zip((1.0, 2.0), (left, right), strict=True)
    ]
    walls = {"left": {"wall": 1.0}, "right": {"wall": 1.0}}
    document = scene(trace, balls, law="hedrih", time=30.0) | {"ends": walls}
    with pytest.raises(NoOrbit, match="no speed"):
        find_orbit(system_of(document), 1, None, 30.0)


def test_a_body_on_a_junction_is_found_again_on_its_piece() -> None:
    """A scenario accepts no position beyond the piece."""
    for slope in np.linspace(-0.9, 0.8, 86).tolist():
        first = {"shape": "valley", "radius": 1.0, "end_slope": slope}
        trace = {"start_slope": -1.2, "arcs": [first, {**first, "end_slope": 1.2}]}
        system = system_of(scene(trace, [ball(slope), ball(1.1, arc=2)], time=1.0))
        begun = started(system, state_of(system))
        end = system.trace.pieces[0].angle_end
        assert begun.initial[0].piece == 0
        assert end - 1e-14 < begun.initial[0].position <= end


def test_bodies_that_stay_in_contact_have_no_orbit() -> None:
    """Their motion goes on, with a tangent map, but cannot return to a start without contact."""
    with pytest.raises(NoOrbit, match="bodies stay in contact"):
        shoot(system_of(scene(VALLEY, [ball(-0.3), ball(0.2)], 0.0, time=9.0)), 3.0)


def test_impacts_that_take_energy_have_no_orbit() -> None:
    system = system_of(scene(VALLEY, [ball(-0.7), ball(0.6)], 0.8, time=9.0))
    with pytest.raises(NoOrbit):
        find_orbit(system, 1)


def test_the_multipliers_under_the_translational_law_are_those_of_the_full_map() -> None:
    """With unequal κ it conserves the sum of each body's energy divided by its κ."""
    two = [ball(-0.91, body="hoop", mass=0.67), ball(0.92, body="disk", mass=0.68)]
    three = [ball(-0.78, body="disk", mass=0.7), ball(-0.3, body="hoop", mass=0.64)]
    three.append(ball(-0.06, mass=1.73))
    for impacts, balls in enumerate((two, three), 1):
        document = scene(VALLEY, balls, law="translational", time=20.0)
        found = find_orbit(system_of(document), impacts)
        values = np.linalg.eigvals(found.shot.matrix)
        values = values[np.argsort(np.abs(values - 1.0))]
        np.testing.assert_allclose(values[:2], 1.0, atol=1e-5)
        expected = sorted(values[2:], key=_key)
        np.testing.assert_allclose(sorted(found.multipliers, key=_key), expected, atol=1e-7)
        np.testing.assert_allclose(np.abs(expected), 1.0, atol=1e-7)
        assert found.verdict == "stable"
        run = simulate_system(found.system, found.period, None)
        instants = found.period * np.linspace(0.01, 0.99, 9)
        energies = [energy_of(found.system, state_at(run, float(t))) for t in instants]
        np.testing.assert_allclose(energies, found.energy, rtol=1e-13)


def _beside_an_orbit(name: str) -> TraceSystem:
    """Return a system with an orbit close by, on a line, three arcs, a circle or a turning line."""
    line = {"start_slope": 0.2, "arcs": [{"shape": "line", "length": 3.0}]}
    lone = {"radius": 0.1, "arc": 1, "mass": 1.0, "position": 0.3, "speed": 0.0}
    balls = [lone, lone | {"position": 1.0, "mass": 0.7, "speed": 0.5}]
    turning = line | {"turning": {"rate": 0.5, "x": 1.0}}
    documents = {
        "line": scene(line, balls, time=20.0) | WALLS,
        "arcs": scene(three_arcs(100), [ball(-0.5, arc=3), ball(0.5, arc=3, mass=1.5)], time=20.0),
        "circle": scene(CIRCLE, [ball(-0.5), ball(0.5, mass=1.5)], time=20.0),
        "turning": scene(turning, balls, time=20.0) | WALLS,
    }
    return system_of(documents[name])


@pytest.mark.parametrize("name", ["line", "arcs", "circle", "turning"])
def test_the_energy_of_an_orbit_is_that_of_its_run(name: str) -> None:
    """The run's is computed by the event loop, from the lowest position of each body."""
    found = find_orbit(_beside_an_orbit(name), 1)
    run = simulate_system(found.system, found.period, None)
    assert found.energy_start == pytest.approx(run.summary["energy_start"], rel=1e-12)


def test_rounding_does_not_choose_between_equal_intervals() -> None:
    """The orbit, of two impacts, is its own time reversal."""
    scenario = scenario_of(scene(valley(150), [ball(-0.54), ball(0.5, mass=1.5)], 1.0, time=30.0))
    system = build_system(scenario)
    near = [state_of(system) * (1.0 + change) for change in np.linspace(-1e-9, 1e-9, 5)]
    found = [find_orbit(started(system, state), 2, None, 30.0) for state in near]
    gaps = np.diff([*found[0].shot.times, found[0].shot.times[0] + found[0].period])
    assert gaps == pytest.approx(0.5 * found[0].period, rel=1e-9)
    for one in found:
        np.testing.assert_allclose(one.state, found[0].state, rtol=1e-3)


def test_impacts_by_two_laws_that_keep_no_energy_have_no_orbit() -> None:
    balls = [ball(-1.22, mass=1.8, radius=0.2), ball(-0.74, body="disk", mass=1.6, radius=0.05)]
    document = scene(THREE_ARCS, balls, law="translational", time=5.0)
    document["collision"]["inadmissible"] = "normal-impulse"
    system = system_of(document)
    run = simulate_system(system, 0.9, None)
    assert list(run.collisions["law"]) == ["translational", "normal-impulse"]
    energies = [energy_of(system, state_at(run, t)) for t in (0.1, 0.6, 0.9)]
    assert energies[1] == pytest.approx(energies[0], rel=1e-13)
    assert energies[2] != pytest.approx(energies[0], rel=1e-3)
    with pytest.raises(NoOrbit, match="do not conserve energy"):
        shoot(system, 0.9)


def test_a_motion_of_no_time_is_no_orbit() -> None:
    """Such a motion closes from any start: Newton's method reaches it if the guess is too short."""
    system = _falling()
    with pytest.raises(NoOrbit, match="the period has become zero"):
        newton(system, state_of(system), 0.01)


def test_balls_that_overlap_for_no_time_are_no_orbit_of_an_impact() -> None:
    """Newton's method would converge to overlapping balls that meet in no time."""
    arcs = [
        {"shape": "valley", "radius": 1.0, "end_slope": 0.0},
        {"shape": "line", "length": 2.0},
        {"shape": "valley", "radius": 0.7, "end_slope": 1.3},
    ]
    balls = [
        {"radius": 0.05, "arc": 2, "mass": mass, "position": position, "speed": speed}
        for mass, position, speed in ((0.54, 0.16, 1.44), (0.32, 1.61, -0.19), (0.24, 1.84, -1.35))
    ]
    document = scene({"start_slope": -1.2, "arcs": arcs}, balls, time=15.0)
    with pytest.raises(NoOrbit, match="does not converge"):
        find_orbit(system_of(document), 1)


def test_an_orbit_begun_elsewhere_has_the_same_events() -> None:
    found = find_orbit(_falling(), 1)
    begun = begun_between(found)
    assert sorted(begun.shot.word) == sorted(found.shot.word)
    other = replace(found, shot=replace(found.shot, jumps=(("12", "12", "1|"), ("12", "12"))))
    with pytest.raises(NoOrbit, match="the events change"):
        begun_between(other, longest=True)


def test_an_orbit_begun_almost_in_the_middle_is_begun_there() -> None:
    """The upper ball turns a quarter of a period from the midpoint."""
    found = begun_between(find_orbit(_falling(), 1))
    for late in (1e-10, -5e-10):
        state = found.state + late * found.period * velocity(found.system, found.state)
        beside = newton(found.system, state, found.period)
        assert abs(beside.shot.times[0] - found.shot.times[0]) > 0.5 * abs(late) * found.period
        begun = begun_between(beside)
        assert abs(begun.state[3]) == pytest.approx(0.25 * PULL * begun.period, rel=1e-12)


def test_a_body_alone_has_no_orbit_of_impacts() -> None:
    with pytest.raises(NoOrbit, match="expected two or more"):
        find_orbit(system_of(scene(VALLEY, [ball(-0.7)], time=9.0)))


@pytest.mark.long
def test_a_family_is_shown_as_curved_as_it_is_next_to_a_doubling() -> None:
    """A multiplier parts from -1 as the root there, so that a chord over a step would be far off.

    Between the orbits shown it is known from the product of maps by hand.
    """
    scenario = example("falling_balls")
    table = orbit_family(scenario, orbit(scenario, impacts=1), "balls[2].mass", 0.9, 2.1).table
    mass, size = table["value"], table["multiplier"]
    for left in range(list(table["special"]).index("doubling")):
        share = np.array([0.25, 0.5, 0.75])
        between = mass[left] + share * (mass[left + 1] - mass[left])
        period = np.interp(between, mass, table["period"])  # its curve is smooth
        maps = [_by_hand(2.0, *one) for one in zip(between, 0.5 * period * PULL, strict=True)]
        known = [np.max(np.abs(np.linalg.eigvals(one))) for one in maps]
        assert size[left] + share * (size[left + 1] - size[left]) == pytest.approx(known, abs=0.01)


def test_an_orbit_of_two_impacts_of_a_body_at_one_instant_has_no_multipliers() -> None:
    """Which is first decides: motions from beside its start end far from it after one period."""
    balls = [ball(-0.9), ball(0.0, mass=2.0), ball(0.9)]
    scenario = scenario_of(scene(VALLEY, balls, collisions=2))
    with pytest.raises(NoOrbit, match="has no multipliers: found an impact without"):
        orbit(scenario, impacts=2)
    period = 2.0 * simulate(scenario).collisions["t"][0]  # all begin at rest, at the same distance
    system = build_system(scenario)
    found = newton(system, state_of(system), period)
    with pytest.raises(NoOrbit, match="has no multipliers: found an impact without"):
        orbit_family(scenario, found, "balls[2].mass", 1.9, 2.1)
    gaps = []
    for beside in (0.0, 1e-8, -1e-8):
        moved = {"balls[1].angle": beside - 0.9, "stop": {"time": period}}
        end = simulate(scenario.replace(moved)).sample([period])["angle"]
        gaps.append(float(np.max(np.abs(end - [-0.9, 0.0, 0.9]))))
    assert gaps[0] < 1e-9
    assert min(gaps[1:]) > 0.1


@pytest.mark.long
def test_the_command_writes_table_and_figure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "orbits"
    vary = "--vary=balls[2].mass=0.9:2.1"
    code = run_command_line(
        ["orbit", str(FALLING), "--impacts", "1", vary, "-o", str(target), "--json"]
    )
    assert code == 0
    told = json.loads(capsys.readouterr().out)
    assert told["events"] == ["12", "1|"]
    written = pq.read_table(target / "orbits.parquet")
    assert written.field("value").metadata[b"unit"] == b"kg"
    table = written.to_pydict()
    assert [kind for kind in table["special"] if kind] == ["bound", "doubling", "bound"]
    assert table["value"] == sorted(table["value"])
    figure = branch_figure(table, "mass", "double")
    assert figure.axes[-1].get_xlabel() == "mass"
    assert (target / "orbits.png").stat().st_size > 1000


@pytest.mark.long
@pytest.mark.parametrize(
    ("document", "place"),
    [
        (example("falling_balls").given(), "s"),
        (scene(VALLEY, [ball(-0.4, rate=0.1), ball(0.5, omega=-0.1)], time=30.0), "angle"),
    ],
    ids=["positions", "angles"],
)
def test_the_scenario_that_is_written_starts_on_the_orbit(
    document: dict[str, Any], place: str, tmp_path: Path
) -> None:
    """Solved from its file alone, the motion returns after a period."""
    (tmp_path / "one.json").write_text(json.dumps(document))
    target = tmp_path / "orbit"
    assert run_command_line(["orbit", str(tmp_path / "one.json"), "-o", str(target)]) == 0
    table = pq.read_table(target / "orbits.parquet")
    assert table.field("position_1").metadata[b"unit"] == (b"m" if place == "s" else b"rad")
    (row,) = table.to_pylist()
    written = load_any(target / "scenario.json")
    run = simulate(written.replace({"stop.time": row["period"]}))
    assert run.summary["collisions"] > 0
    for body, start in enumerate(build_any(written).initial, 1):
        assert (start.piece + 1, start.position, start.speed) == (
            *(row[f"arc_{body}"], row[f"position_{body}"], row[f"speed_{body}"]),
        )
        end = run.summary[f"{place}_{body}"], run.summary[f"speed_{body}"]
        assert end == pytest.approx((start.position, start.speed), abs=1e-11)


# On a decimetre, and at the size of a planet: there no second impact comes within 1000 s.
@pytest.mark.parametrize("length", [-10, 24])
def test_an_orbit_of_any_size_is_found(length: int) -> None:
    """With no time at which the run stops, a return is waited for as long as it takes."""
    scenario = example("falling_balls")
    found = orbit(scenario, impacts=1)
    assert scenario.stop.time is None
    other = orbit(Scenario.from_dict(scaled(scenario.resolved(), length, length // 2)), impacts=1)
    assert other.period == pytest.approx(math.ldexp(found.period, length // 2), rel=1e-12)
    np.testing.assert_allclose(other.multipliers, found.multipliers, rtol=1e-9)


@pytest.mark.long
def test_python_finds_what_the_command_finds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = example("falling_balls")
    found = orbit(scenario, impacts=1)
    low, high = 0.5 * found.energy, 2.0 * found.energy
    family = orbit_family(scenario, found, "energy", low, high)
    vary = f"--vary=energy={low!r}:{high!r}"
    arguments = ["orbit", str(FALLING), "--impacts", "1", vary, "-o", str(tmp_path / "family")]
    assert run_command_line([*arguments, "--no-figures", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["period"] == found.period
    assert told["points"] == len(family.points)
    written = pq.read_table(tmp_path / "family" / "orbits.parquet")
    assert written.equals(family.table.to_arrow(), check_metadata=True)
    assert family.table.units["value"] == "J"
    assert family.table.units["position_1"] == family.table.units["position_2"] == "m"
    assert family.figure("double").save(tmp_path / "family.pdf").stat().st_size > 1000
    with pytest.raises(ValueError, match="unknown width 'x'"):
        family.figure("x")
    assert repr(found) == f"<Orbit 12 1|: period {found.period:.6g} s, unstable>"
    assert repr(family).startswith(f"<OrbitFamily of falling_balls: {len(family.points)} orbits o")
    with pytest.raises(ValueError, match="expected one of a trace"):
        orbit(example("two_disks"))
    with pytest.raises(ValueError, match="found impacts and period, expected one of them"):
        orbit(example("falling_balls"), impacts=1, period=1.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--vary", "balls[2].mass=3:2"], "expected PATH=LOW:HIGH"),
        (
            ["--vary", "balls[2].mass=3:4"],
            "balls[2].mass: found the range 3:4, expected one with the scenario's value, 1\n",
        ),
        (
            ["--vary", "energy=1:2"],
            "energy: found the range 1:2, expected one with the orbit's, "
            "17.5732 J relative to the trace's left end\n",
        ),
        (
            ["--vary", "energy=1000 mJ:0.002 kJ"],
            "energy: found the range 1:2, expected one with the orbit's, 17.5732 J",
        ),
        (["--vary", "energy=1 kg:2 J"], 'energy: found "1 kg", expected an energy (J, mJ, kJ, ...'),
        (["--vary", "a[=3:4"], '--vary: found "a[", expected a path such as collision.k or balls'),
        (
            ["--vary", "balls[2].mass=900 g:2 m"],
            'mass: found "2 m", expected a mass (kg, g, t, ...',
        ),
        (["--vary", "energy=9:inf"], "--vary: energy: found inf, expected a finite number"),
        (["--vary", "balls[2].density=3:4"], "found no number, expected one given in the scenario"),
        (["--vary", "balls[2].mas=3:4"], 'did you mean "mass"?'),
        (["--vary", "enrgy=3:4"], ', or energy (did you mean "energy"?)'),
        (["--vary", "balls[5].mass=3:4"], "found balls[5] of 2, expected a number from 1 to 2"),
        (["--impacts", "1", "--set", "collision.k=0.9"], "no orbit: impacts of bodies lose energy"),
        (
            ["--set", "ends.left.wall=0.875"],
            "impacts on walls lose energy: found a coefficient of restitution of 0.875, expected 1",
        ),
        (["--vary", "collision.k=0.5:1"], "collision.k: found a coefficient of restitution, exp"),
        (["--vary", "ends.left.wall=0.5:1"], "ends.left.wall: found a coefficient of restitution"),
        (["--period", "nan"], "--period: found nan, expected a finite number greater than 0"),
        (["--period", "-1"], "--period: found -1, expected a number greater than 0"),
        (["--period", "1"], "found --impacts and --period, expected one of them"),
        (
            ["--impacts", f"{2**63}"],
            f"--impacts: found {2**63}, expected a whole number below 2^63",
        ),
    ],
)
def test_what_cannot_be_followed_is_told(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code = run_command_line(["orbit", str(FALLING), "--impacts", "1", *arguments])
    assert code in (1, 2)
    assert words in capsys.readouterr().err


def test_ranges_and_periods_may_have_units(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(orbit_branch, "MOST_POINTS", 2)  # the family itself is tested above

    def told(*arguments: str) -> str:
        options = ["--json", "--no-figures", "-o", str(tmp_path)]
        assert run_command_line(["orbit", str(FALLING), *arguments, *options]) == 0
        return capsys.readouterr().out

    plain = told("--period=0.816", "--vary=balls[2].mass=1:1.1")
    assert told("--period=816 ms", "--vary=balls[2].mass=1000 g:1.1 kg") == plain
    assert parsed_range("--vary", "balls[2].mass=1000 g:1.1 kg") == ("balls[2].mass", 1.0, 1.1)


def test_multipliers_that_do_not_leave_one_are_drawn_as_one() -> None:
    """Rounding splits those of a neutral orbit, by 1e-6 here; the axis does not magnify it."""
    table = {
        "value": np.arange(4.0),
        "stable": np.full(4, True),
        "special": ["halving", None, None, "bound"],
        "period": np.linspace(1.0, 2.0, 4),
        "multiplier": 1.0 + np.array([1e-6, 0.0, 2e-16, 0.0]),
    }
    (_, axes) = branch_figure(table, "mass", "single").axes
    drawn = np.concatenate([line.get_ydata() for line in axes.lines])
    assert np.nanmin(drawn) == np.nanmax(drawn)
    assert np.ptp(axes.get_ylim()) > 0.5
    table["multiplier"] = 1.0 + np.array([0.0, 0.0, 1e-3, 0.0])
    (_, axes) = branch_figure(table, "mass", "single").axes
    assert np.nanmax(axes.lines[0].get_ydata()) == 1.001
    assert np.ptp(axes.get_ylim()) < 2e-3


@pytest.mark.parametrize(
    ("stable", "solid", "dashed"),
    [
        ("UUSSUU", {(2, 3)}, {(0, 1), (1, 2), (3, 4), (4, 5)}),
        ("UUUUSS", {(4, 5)}, {(0, 1), (1, 2), (2, 3), (3, 4)}),
        ("UUSUSS", {(4, 5)}, {(0, 1), (1, 2), (2, 3), (3, 4)}),
        ("SSSSSS", {(n, n + 1) for n in range(5)}, set()),
    ],
)
def test_a_piece_of_a_family_has_the_look_of_its_unstable_end(
    stable: str, solid: set[tuple[int, int]], dashed: set[tuple[int, int]]
) -> None:
    table = {
        "value": np.arange(6.0),
        "stable": np.array([one == "S" for one in stable]),
        "special": [None] * 6,
        "period": np.linspace(1.0, 2.0, 6),
        "multiplier": np.linspace(0.5, 1.5, 6),
    }
    figure = branch_figure(table, "mass", "single")
    named = {text.get_text() for legend in figure.legends for text in legend.get_texts()}
    assert ("stable" in named, "unstable" in named) == (bool(solid), bool(dashed))
    for axes in figure.axes:
        drawn: dict[str, set[tuple[int, int]]] = {style.BLUE: set(), style.VERMILLION: set()}
        for line in axes.lines:
            points = np.asarray(line.get_xydata())
            whole = np.isfinite(points).all(axis=1)
            for n in np.flatnonzero(whole[:-1] & whole[1:]):
                drawn[str(line.get_color())].add((int(points[n, 0]), int(points[n + 1, 0])))
        assert drawn == {style.BLUE: solid, style.VERMILLION: dashed}
