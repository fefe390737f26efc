"""Special points along a family of orbits, against extremes, differences and closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import cycle

import numpy as np
import pytest

from tests.analysis.test_orbits import FALLING
from vibro_cli import example, orbit, orbit_family
from vibro_cli.analysis import orbit_branch, orbits
from vibro_cli.analysis.orbit_branch import Branch, Family, Point
from vibro_cli.analysis.orbits import (
    NoOrbit,
    Orbit,
    begun_between,
    find_orbit,
    gone_through_once,
    newton,
    scale_of,
    shoot,
    started,
    state_of,
)
from vibro_cli.assemble import build_any, build_system
from vibro_cli.commands.app import run_command_line
from vibro_cli.commands.orbit import _lines, record_of
from vibro_cli.figures.analyses import branch_figure, label_of_number
from vibro_cli.interface.analyses import orbit_columns
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.numerics.elementwise import Floats
from vibro_cli.scenario import load_any
from vibro_cli.scenario.loading import scenario_of
from vibro_cli.stress.scenes import VALLEY, Document, ball, scene, system_of, three_arcs
from vibro_cli.systems.trace import simulate_system

LINE_BETWEEN_VALLEYS = {
    "start_slope": -1.2,
    "arcs": [
        {"shape": "valley", "radius": 1.0, "end_slope": 0.0},
        {"shape": "line", "length": 1.5},
        {"shape": "valley", "radius": 0.7, "end_slope": 1.3},
    ],
}
HOOPS = scene(
    VALLEY,
    [
        ball(0.35645359942878296, body="hoop", mass=1.6890977082453826),
        ball(0.9842166327467572, body="hoop", mass=0.8687721938006587),
    ],
    law="translational",
    time=30.0,
)

THROUGH_ITS_REVERSAL = {
    "collision.k": 1.0,
    "collision.law": "normal-impulse",
    "balls[1].angle": -1.482,
    "balls[1].speed": 0.438,
    "balls[2].angle": 0.5202,
    "balls[2].speed": -0.708,
    "balls[2].density": 2560.0,
}


def _differences(found: Orbit) -> Floats:
    """Return the tangent map by differences of motions beside an orbit."""
    columns, change = [], 1e-6
    for n in range(len(found.state)):
        beside = np.zeros(len(found.state))
        beside[n] = change
        ends = [
            shoot(started(found.system, found.state + sign * beside), found.period).end
            for sign in (1.0, -1.0)
        ]
        columns.append((ends[0] - ends[1]) / (2.0 * change))
    return np.column_stack(columns)


def _place_of_fold(branch: Branch) -> float:
    """Return where the only fold lies between the orbits beside it in the table, from 0 to 1."""
    (fold,) = (one for one in branch.special if one.kind == "fold")
    before, beyond = branch.points[fold.after : fold.after + 2]
    chord = beyond.along - before.along
    return float(chord @ (fold.point.along - before.along) / (chord @ chord))


@pytest.fixture(scope="module")
def folded() -> tuple[Orbit, Branch]:
    """The family of two hoops in a valley, which turns back at the least gravity."""
    first = find_orbit(system_of(HOOPS), 3, None, 30.0)
    return first, orbit_family(scenario_of(HOOPS), first, "gravity", 9.4, 9.9)


@pytest.mark.long
def test_a_fold_is_where_the_value_is_least(folded: tuple[Orbit, Branch]) -> None:
    _, branch = folded
    assert [one.kind for one in branch.special] == ["bound", "fold", "bound"]
    fold = branch.special[1]
    values = np.array([point.value for point in branch.points])
    assert fold.point.value < values.min()
    # That of the parabola through the three orbits next to it, over the way along the branch.
    near = branch.points[fold.after - 1 : fold.after + 3]
    away = [np.linalg.norm(one.along - fold.point.along) for one in near]
    away = [-one if n < 2 else one for n, one in enumerate(away)]
    least = np.polyfit(away, [one.value for one in near], 3)
    roots = np.roots(np.polyder(least))
    turn = roots[np.argmin(np.abs(roots))].real
    assert fold.point.value == pytest.approx(np.polyval(least, turn), abs=1e-5)
    # There a multiplier is 1, by differences: the trace across the orbit is 2.
    assert np.trace(_differences(fold.point.orbit)) == pytest.approx(4.0, abs=1e-4)


@pytest.mark.long
def test_a_family_turns_back_where_its_orbit_is_its_own_reversal() -> None:
    """Both bodies are at rest at once there, one multiplier only touches 1, the value is least.

    Beyond that point the family consists of the time reversals of its earlier orbits.
    """
    scenario = example("three_arcs").replace(THROUGH_ITS_REVERSAL)
    family = orbit_family(scenario, orbit(scenario, impacts=2), "balls[2].density", 2500.0, 2590.0)
    assert [(one.kind, one.fault) for one in family.special] == [
        ("bound", ""), ("fold", ""), ("bound", ""),
    ]  # fmt: skip
    turn = family.special[1].point
    assert np.abs(turn.orbit.state[1::2]).max() < 1e-3  # of 1 m/s at the ends
    assert np.trace(_differences(turn.orbit)) == pytest.approx(4.0, abs=1e-4)
    assert turn.value <= min(point.value for point in family.points)
    assert 0.0 <= _place_of_fold(family) <= 1.0
    one, other = family.points[0].orbit, family.points[-1].orbit
    assert other.period == pytest.approx(one.period, abs=1e-9)
    assert other.state == pytest.approx(one.state * [1.0, -1.0, 1.0, -1.0], abs=1e-9)


@pytest.mark.long
@pytest.mark.parametrize(
    ("low", "high"), [(9.6, 9.9), (9.129, 10.417), (9.0, 10.8), (9.809, 9.815), (9.8099, 9.8129)]
)
def test_a_family_turns_back_where_its_orbit_is_its_own_mirror_image(
    low: float, high: float
) -> None:
    """Equal balls on a symmetric trace turn back at the same point for ranges of any width.

    Beyond that point the family consists of the mirror images of its earlier orbits.
    """
    arcs = [
        {"shape": "valley", "radius": 1.0, "end_slope": 0.7},
        {"shape": "hump", "radius": 0.5, "end_slope": -0.7},
    ]
    last = {"shape": "valley", "radius": 1.0, "end_slope": 1.2}
    trace = {"start_slope": -1.2, "arcs": [*arcs, *arcs, last]}
    balls = [ball(-0.5290514460285581, arc=3), ball(0.5103495734353359, arc=3)]
    document = scene(trace, balls, time=30.0)
    first = find_orbit(system_of(document), 1, None, 30.0)
    family = orbit_family(scenario_of(document), first, "gravity", low, high)
    assert [one.kind for one in family.special] == ["bound", "fold", "bound"]
    turn = family.special[1].point
    assert turn.value == pytest.approx(9.8125653, abs=1e-6)
    assert 0.0 <= _place_of_fold(family) <= 1.0
    assert np.trace(_differences(turn.orbit)) == pytest.approx(4.0, abs=1e-4)
    length = 2.0 * 0.9 * (0.7 + 1.2) + (0.9 + 2.0 * 0.6) * 1.4  # of the path of a centre
    one, other = family.points[0].orbit, family.points[-1].orbit
    assert other.period == pytest.approx(one.period, abs=1e-9)
    mirrored = [length, 0.0, length, 0.0] - one.state[[2, 3, 0, 1]]
    assert other.state == pytest.approx(mirrored, abs=1e-9)
    assert abs(other.state[0] - one.state[0]) > 0.01


@pytest.mark.long
def test_a_family_leaves_orbits_whose_phase_is_free_at_one_value() -> None:
    """Equal balls exchange their speeds, as if they passed through one another: each has a phase.

    When a mass varies, only some of these orbits continue, and there all multipliers are 1.
    """
    places = {"balls[1].position": 0.56, "balls[1].speed": 0.0, "balls[2].position": 1.9}
    equal = {"balls[2].mass": 2.0, "balls[2].speed": 0.0}
    scenario = example("falling_balls").replace(places | equal)
    first = orbit(scenario, impacts=2)
    family = orbit_family(scenario, first, "balls[2].mass", 1.8, 2.3)
    assert [one.kind for one in family.special] == ["bound", "exchange", "bound"]
    assert family.special[1].point.value == pytest.approx(2.0, abs=1e-9)
    for point in (family.points[0], family.points[-1]):
        found = point.orbit
        assert found.energy == pytest.approx(first.energy, rel=1e-12)
        run = simulate_system(found.system, 3.0 * found.period, None)
        times = run.collisions["t"].reshape(3, -1)
        assert np.diff(times, axis=0) == pytest.approx(found.period, rel=1e-9)


@pytest.mark.long
def test_a_family_of_orbits_whose_phase_is_free_is_followed_over_the_value() -> None:
    """Two balls on a level line may both be shifted; the steps are not spent on this shift."""
    balls = [
        {"radius": 0.1, "arc": 2, "mass": mass, "position": way, "speed": speed}
        for mass, way, speed in (
            (1.2247821, 0.1342798, 0.523171),
            (1.0292593, 1.0752161, -0.1115174),
        )
    ]
    document = scene(LINE_BETWEEN_VALLEYS, balls, time=30.0)
    first = find_orbit(system_of(document), 2, None, 30.0)
    family = orbit_family(scenario_of(document), first, "balls[1].mass", 1.2, 1.24)
    assert [one.kind for one in family.special] == ["bound", "bound"]
    values = np.array([point.value for point in family.points])
    assert np.all(np.diff(values) > 0.0)
    for point in (family.points[0], family.points[-1]):
        shot = shoot(point.orbit.system, 2.0 * point.orbit.period)
        assert shot.end == pytest.approx(point.orbit.state, abs=1e-9)


@pytest.mark.long
def test_steps_that_turn_too_far_become_no_shorter_than_the_one_that_is_taken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An orbit exists at every mass, so that the family reaches the end of the range."""
    monkeypatch.setattr(Family, "_excess", lambda _, here, new, *__: 3.0 * (new.value < here.value))
    monkeypatch.setattr(orbit_branch, "MOST_POINTS", 60)
    scenario = example("falling_balls")
    first = orbit(scenario, impacts=1)
    family = orbit_family(scenario, first, "balls[2].mass", 0.9885, 2.0)
    assert [one.kind for one in family.special] == ["bound", "bound"]


@pytest.mark.long
def test_a_family_of_very_many_orbits_ends_as_such(monkeypatch: pytest.MonkeyPatch) -> None:
    """This holds even if steps are shortened on the way: here each first try fails."""
    corrected, fails = Family._corrected, cycle((True, False))

    def failing(self: Family, guess: Floats, tangent: Floats) -> Point:
        if next(fails):
            raise NoOrbit("the events change")
        return corrected(self, guess, tangent)

    monkeypatch.setattr(Family, "_corrected", failing)
    monkeypatch.setattr(orbit_branch, "MOST_POINTS", 2)
    scenario = example("falling_balls")
    family = orbit_family(scenario, orbit(scenario, impacts=1), "balls[2].mass", 0.8, 2.5)
    assert [family.special[n].kind for n in (0, -1)] == ["points", "points"]


@pytest.mark.long
@pytest.mark.parametrize(("kind", "number"), [("doubling", -1.0), ("exchange", 1.0)])
def test_two_changes_within_one_step_are_found(
    monkeypatch: pytest.MonkeyPatch, kind: str, number: float
) -> None:
    """The distance is below zero on only a twentieth of a step."""

    def distance(found: Orbit, at: float) -> float:
        return (found.system.bodies[1].mass - 1.503) ** 2 - 1e-6 if at == number else 1.0

    monkeypatch.setattr(orbit_branch, "_distance", distance)
    scenario = example("falling_balls")
    first = orbit(scenario, impacts=1)
    family = orbit_family(scenario, first, "balls[2].mass", 0.8, 1.9)
    assert [one.kind for one in family.special] == ["bound", kind, kind, "bound"]
    values = [one.point.value for one in family.special[1:3]]
    assert values == pytest.approx([1.502, 1.504], abs=1e-10)


@pytest.mark.long
def test_a_change_that_is_not_located_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """The nearest orbit replaces it, together with the error of the search."""

    def distance(found: Orbit, at: float) -> float:
        return found.system.bodies[1].mass - 1.503 if at < 0.0 else 1.0

    def between(*_: object) -> Point:
        raise NoOrbit("the events change")

    monkeypatch.setattr(orbit_branch, "_distance", distance)
    monkeypatch.setattr(Family, "_between", between)
    scenario = example("falling_balls")
    first = orbit(scenario, impacts=1)
    family = orbit_family(scenario, first, "balls[2].mass", 0.9, 1.6)
    assert [one.fault for one in family.special] == ["", "the events change", ""]
    nearest = min((point.value for point in family.points), key=lambda value: abs(value - 1.503))
    assert family.special[1].point.value == nearest
    assert record_of(first, family)["special"][1]["fault"] == "the events change"
    told = [line for line in _lines("falling_balls", first, family) if "warning" in line]
    assert told == ["  warning      this is the nearest orbit found: the events change"]


BOUNCING = scene(
    {"start_slope": -0.0516, "arcs": [{"shape": "valley", "radius": 2.47, "end_slope": 0.644}]},
    [ball(0.10181, mass=1.23, rate=0.37131), ball(0.31907, rate=-0.17806)],
    time=30.0,
) | {"gravity": 9.0886, "ends": {"left": {"wall": 1.0}, "right": {"wall": 1.0}}}  # fmt: skip
SWINGING = scene(
    VALLEY,
    [
        ball(-2.6240478219, rate=0.0053442879),
        ball(-0.0648760735, mass=0.9838735473, rate=0.0479785087),
    ],
    time=30.0,
)


@pytest.mark.long
@pytest.mark.parametrize(
    ("document", "period", "times", "path", "low", "high"),
    [
        (BOUNCING, 1.8287, 2, "gravity", 9.085, 9.12),
        (BOUNCING, 1.8287, 2, "gravity", 9.0, 9.12),
        (SWINGING, 15.8194085, 4, "balls[2].mass", 0.9833, 0.9840),
    ],
)
def test_a_family_ends_where_its_orbits_come_to_have_half_their_period(
    document: Document, period: float, times: int, path: str, low: float, high: float
) -> None:
    """Orbits of n periods branch off where a multiplier of the short orbit is an nth root of 1."""
    scenario = scenario_of(document)
    first = find_orbit(system_of(document), None, period)
    family = orbit_family(scenario, first, path, low, high)
    assert sorted(one.kind for one in family.special) == ["bound", "halving"]
    end = next(one.point for one in family.special if one.kind == "halving")
    assert end.orbit.energy == pytest.approx(first.energy, rel=1e-12)
    once = gone_through_once(end.orbit)
    assert end.orbit.period == pytest.approx(times * once.period, rel=1e-12)
    expected = 2.0 * math.cos(2.0 * math.pi / times)
    assert np.trace(once.reduced) == pytest.approx(expected, abs=1e-9)
    # By differences of motions.
    assert np.trace(_differences(once)) - 2.0 == pytest.approx(expected, abs=1e-5)


@pytest.mark.long
@pytest.mark.parametrize("share", [1.0e-3, 1.0e-4])
def test_beside_a_halving_there_is_nothing_else(share: float) -> None:
    """Rounding moves the values of orbits that nearly repeat, and mixes two tangents there."""
    path, low, high = "balls[2].mass", 0.9833, 0.9840
    scenario = scenario_of(SWINGING)

    def at(mass: float) -> TraceSystem:
        return build_system(scenario.replace({path: mass}))

    first = find_orbit(at(0.9838735473), None, 15.8194085)
    whole = Family(at, first, 0.9838735473, low, high)
    halved, beside, *_ = whole.follow().points
    near = whole._between(halved, beside, share)
    assert near.value == pytest.approx(halved.value, rel=1e-10)
    family = orbit_family(scenario.replace({path: near.value}), near.orbit, path, low, high)
    assert [one.kind for one in family.special] == ["halving", "bound"]
    assert family.points[0].value == pytest.approx(halved.value, rel=1e-11)
    # A multiplier of the short orbit is a fourth root of 1, by differences of motions.
    once = gone_through_once(family.points[0].orbit)
    assert np.trace(_differences(once)) - 2.0 == pytest.approx(0.0, abs=1e-5)


ROUND = {"shape": "valley", "radius": 1.0, "end_slope": math.pi}
CIRCLE = {"start_slope": -math.pi, "closed": True, "arcs": [ROUND]}


@pytest.mark.long
def test_a_family_goes_on_where_balls_are_half_a_round_from_where_they_were() -> None:
    """The gap over half the period then changes its sign without vanishing: nothing halves."""
    balls = [ball(-1.7225, mass=2.0, rate=-1.8473), ball(0.8535, mass=1.5228)]
    document = scene(CIRCLE, balls, time=10.0)
    first = orbit(scenario_of(document), 4)
    family = orbit_family(scenario_of(document), first, "balls[2].mass", 0.8, 2.9)
    values = np.array([one.value for one in family.points])
    assert {one.kind for one in family.special} == {"bound", "fold", "doubling"}
    assert values[0] == values[-1] == 2.9
    # Between the neighbours of the place where the sign changes, by differences of motions.
    for one in family.points[:2]:
        trace = np.trace(_differences(one.orbit)) - 2.0
        assert np.sum(one.orbit.multipliers).real == pytest.approx(trace, rel=1e-5)
        run = simulate_system(one.orbit.system, 3.0 * one.orbit.period, None)
        np.testing.assert_allclose(np.diff(run.collisions["t"][::2]), one.orbit.period, rtol=1e-9)


@pytest.mark.long
def test_a_halving_is_no_exchange_too() -> None:
    """At an orbit traversed twice a multiplier is at 1: its rounding is no passage."""
    balls = [
        ball(-1.294264428775199, mass=2.0, rate=-0.13656633397682774),
        ball(0.506952109300433, mass=2.0760791890079835),
    ]
    document = scene(CIRCLE, balls, law="hedrih", time=10.0)
    first = orbit(scenario_of(document), 2)
    family = orbit_family(scenario_of(document), first, "balls[2].mass", 1.03804, 4.152158)
    assert [one.kind for one in family.special] == ["halving", "doubling", "bound"]
    # The multipliers of all other orbits are on one side of 1, by differences of motions too.
    for one in (family.points[1], family.points[2], family.points[-1]):
        assert np.linalg.det(one.orbit.reduced - np.eye(2)) > 0.0
        assert 4.0 - np.trace(_differences(one.orbit)) > 0.0


@pytest.mark.long
def test_a_halving_nearer_than_the_first_step_is_told_on_its_side_only() -> None:
    """On the other side the orbits are followed to the end of the range."""
    places = [
        ball(-1.0513933035957386, body="hoop", mass=0.8119980237149687, rate=-0.41248710758035934),
        ball(0.3077680863575177, body="hoop", mass=0.8728959056795111, rate=0.42520927939466313),
    ]
    document = scene(VALLEY, places, time=30.0)
    first = find_orbit(system_of(document), 4, None, 20.0)
    family = orbit_family(scenario_of(document), first, "gravity", 7.030520846, 11.775685308)
    assert [one.kind for one in family.special] == ["halving", "doubling", "bound"]
    once = gone_through_once(family.points[0].orbit)
    assert np.trace(_differences(once)) == pytest.approx(0.0, abs=1e-5)


@pytest.mark.long
def test_a_family_does_not_go_over_to_the_orbit_of_a_third_of_its_period() -> None:
    """The family turns back where a multiplier of that orbit is a cube root of 1."""
    arc = {"shape": "valley", "radius": 1.6510713, "end_slope": 0.7164908}
    trace = {"start_slope": -0.4874369, "arcs": [arc]}
    places = [
        ball(-0.05, mass=0.89105105, rate=0.250731183),
        ball(0.22, mass=1.49556754, rate=-0.087489913),
    ]
    walls = {"left": {"wall": 1.0}, "right": {"wall": 1.0}}
    document = scene(trace, places, time=30.0) | {"ends": walls}
    first = find_orbit(system_of(document), 6, None, 20.0)
    family = orbit_family(scenario_of(document), first, "balls[1].mass", 0.8361535, 0.9571031)
    for point in family.points:
        assert gone_through_once(point.orbit).period == point.orbit.period
    assert [point.value for point in (family.points[0], family.points[-1])] == [0.9571031] * 2
    least = min(family.points, key=lambda point: point.value)
    near = least.orbit
    third = newton(near.system, near.state, near.period / 3.0, first.energy)
    assert np.trace(third.reduced) == pytest.approx(-1.0, abs=1e-4)


@pytest.mark.long
def test_a_family_whose_orbits_last_ever_longer_ends() -> None:
    """On a level line the speeds tend to zero with the energy above the bottom."""
    places = ((0.6440831, 0.1373106, -1.0352607), (0.9873855, 0.8138460, 0.8977933))
    balls = [
        {"radius": 0.1, "arc": 2, "mass": mass, "position": way, "speed": speed}
        for mass, way, speed in places
    ]
    document = scene(LINE_BETWEEN_VALLEYS, balls, law="hedrih", time=30.0)
    first = find_orbit(system_of(document), 5, None, 30.0)
    bottom = 9.81 * (0.6440831 + 0.9873855) * (math.cos(1.2) - 1.0 + 0.1)
    family = orbit_family(scenario_of(document), first, "energy", bottom - 1.0, -7.0)
    assert [one.kind for one in family.special] == ["period", "bound"]
    assert len(family.points) < 300
    last, before = (point.orbit.period for point in family.points[:2])
    assert last > 30.0 * first.period >= before
    moving = [(one.value - bottom) * one.orbit.period**2 for one in family.points[:20]]
    np.testing.assert_allclose(moving, moving[0], rtol=0.2)


def _discriminant(found: Orbit) -> float:
    """Return the discriminant of the sums μ + 1/μ of three bodies, by differences of motions."""
    whole = _differences(found)
    one, two = np.trace(whole) - 2.0, np.trace(whole @ whole) - 2.0
    return float(one**2 - 4.0 * (0.5 * (one**2 - two) - 2.0))


@pytest.mark.long
def test_pairs_of_multipliers_that_meet_leave_the_circle() -> None:
    """The scene is three balls on a slope between walls."""
    places = ((1.0, 1.057, -0.787), (0.8, 1.599, -0.186), (0.86, 2.25, -1.464))
    balls = [
        {"radius": 0.1, "arc": 1, "mass": mass, "position": way, "speed": speed}
        for mass, way, speed in places
    ]
    trace = {"start_slope": 0.2, "arcs": [{"shape": "line", "length": 3.0}]}
    walls = {"ends": {"left": {"wall": 1.0}, "right": {"wall": 1.0}}}
    document = scene(trace, balls, time=20.0) | walls
    first = find_orbit(system_of(document), 4, None, 20.0)
    family = orbit_family(scenario_of(document), first, "balls[2].mass", 0.79, 1.15)
    assert [one.kind for one in family.special] == ["bound", "torus", "bound"]
    torus = family.special[1]
    before, after = family.points[torus.after : torus.after + 2]
    assert (before.orbit.verdict, after.orbit.verdict) == ("unstable", "stable")
    assert _discriminant(before.orbit) < -1e-3
    assert _discriminant(after.orbit) > 1e-3
    assert _discriminant(torus.point.orbit) == pytest.approx(0.0, abs=1e-5)


@pytest.mark.long
@pytest.mark.parametrize("law", ["hedrih", "normal-impulse"])
def test_a_family_goes_on_where_a_body_comes_to_cross_a_junction(law: str) -> None:
    """Above a certain energy the left ball rolls up onto the hump and back."""
    balls = [ball(-0.5, arc=3), ball(0.5, arc=3, mass=1.5)]
    document = scene(three_arcs(100), balls, law=law, time=20.0)
    first = find_orbit(system_of(document), 1, None, 20.0)
    family = orbit_family(scenario_of(document), first, "energy", -24.5, -20.0)
    assert [one.kind for one in family.special] == ["bound", "bound"]
    words = [point.orbit.shot.word for point in family.points]
    assert (words[0], words[-1]) == (("12",), ("1>", "12", "1<"))
    turn = words.index(words[-1])
    for point in family.points[turn - 2 : turn + 3]:
        found = point.orbit
        run = simulate_system(found.system, 5.0 * found.period, None)
        np.testing.assert_allclose(np.diff(run.collisions["t"]), found.period, rtol=1e-11)
        trace = float(np.trace(_differences(found)))
        assert np.sum(found.multipliers).real == pytest.approx(trace - 2.0, abs=1e-5)


@pytest.mark.long
def test_a_family_round_a_circle_ends_where_an_impact_comes_to_the_seam() -> None:
    """One of the colliding balls reaches the seam there, though the motion is not affected."""
    seam = 0.16402347
    circle = {"shape": "valley", "radius": 1.0, "end_slope": seam + 2.0 * math.pi}
    trace = {"start_slope": seam, "closed": True, "arcs": [circle]}
    places = [
        ball(0.1973394242, mass=1.3, rate=1.37686051496),
        ball(2.0 * math.pi - 1.5562631682, rate=12.05509936177),
    ]
    document = scene(trace, places, time=20.0)
    first = find_orbit(system_of(document), None, 1.0814)
    family = orbit_family(scenario_of(document), first, "balls[1].mass", 1.0, 1.7)
    assert [one.kind for one in family.special] == ["seam", "seam"]
    for one in family.special:
        found = one.point.orbit
        run = simulate_system(found.system, found.period, None)
        angles = run.sample(run.collisions["t"])["angle"] - seam
        ends = np.minimum(np.abs(angles), np.abs(angles - 2.0 * math.pi))
        assert np.min(ends) < 1e-6


@pytest.mark.long
def test_a_family_ends_where_a_body_collides_twice_at_one_instant() -> None:
    """In closed form: the upper ball turns where the lower one meets it at both sides of a bounce.

    With the speed w at this bounce and the ratio r of the masses, upper to lower, the impacts are
    w (1/4 - q^2)/(2 a (1 - q)) before and after it, q = (1 - r)/(1 + r). They reach it at r = 1/3.
    """
    pull = 9.81 * math.sin(math.radians(30.0))

    def speed_and_delay(period: float, ratio: float) -> tuple[float, float]:
        speed, share = 0.25 * period * (1.0 + ratio) * pull, (1.0 - ratio) / (1.0 + ratio)
        return speed, speed * (0.25 - share**2) / (2.0 * pull * (1.0 - share))

    # Both are at rest half a period after the bounce: the lower one after another bounce.
    ratio, period = 0.36, 1.2
    speed, delay = speed_and_delay(period, ratio)
    risen = (0.5 * period - delay) ** 2 * pull / 2.0 + speed * delay - pull * delay**2 / 2.0
    at_rest = {"balls[1].position": 0.05 + speed**2 / (8.0 * pull), "balls[1].speed": 0.0}
    at_rest |= {"balls[2].position": 0.15 + risen, "balls[2].speed": 0.0}
    scenario = example("falling_balls").replace(at_rest | {"balls[2].mass": 2.0 * ratio})
    first = orbit(scenario, impacts=2)
    assert first.period == pytest.approx(period, rel=1e-12)
    family = orbit_family(scenario, first, "balls[2].mass", 0.4, 0.72)
    end, bound = family.special
    assert (end.kind, end.fault, bound.kind) == ("coincidence", "", "bound")
    assert end.point.value == pytest.approx(2.0 / 3.0, abs=1e-7)
    for point in family.points:
        found = point.orbit
        assert found.shot.word == ("1|", "12", "1|", "12", "1|")
        _, delay = speed_and_delay(found.period, 0.5 * point.value)
        between = np.diff(found.shot.times)[1:3]
        np.testing.assert_allclose(between, delay, rtol=1e-7, atol=1e-11)


@pytest.mark.long
def test_a_family_whose_balls_always_bounce_at_once_goes_on() -> None:
    """With zero total momentum they reach both walls at one instant, whatever their masses."""
    line = {"start_slope": 0.0, "arcs": [{"shape": "line", "length": 3.0}]}
    balls = [
        {"radius": 0.1, "arc": 1, "mass": mass, "position": way, "speed": speed}
        for mass, way, speed in ((1.0, 1.0, -1.0), (1.8, 2.0, 0.6))
    ]
    walls = {"ends": {"left": {"wall": 1.0}, "right": {"wall": 1.0}}}
    document = scene(line, balls, law="hedrih", time=20.0) | walls
    first = find_orbit(system_of(document), 1, None, 20.0)
    family = orbit_family(scenario_of(document), first, "balls[2].mass", 1.4, 2.2)
    assert [one.kind for one in family.special] == ["bound", "bound"]
    for point in family.points:
        mass = point.value
        moving = first.energy - (1.0 + mass) * 9.81 * 0.1
        speed = math.sqrt(2.0 * moving / (1.4 * (1.0 + 1.0 / mass)))
        # The path from wall to wall less all radii, there and back.
        period = 2.0 * 2.6 / (speed * (1.0 + 1.0 / mass))
        assert point.orbit.period == pytest.approx(period, rel=1e-12)
        assert point.orbit.verdict == "neutral"


def test_the_figure_of_a_family_shows_very_unstable_orbits_by_powers_of_ten() -> None:
    table = {
        "value": np.arange(3.0),
        "stable": np.array([True, False, False]),
        "special": ["bound", None, "bound"],
        "period": np.array([1.0, 80.0, 90.0]),
        "multiplier": np.array([1.0, 30.0, 1700.0]),
    }
    label = label_of_number("gravity")
    period, multiplier = branch_figure(table, label, "single").axes
    assert (period.get_yscale(), multiplier.get_yscale()) == ("linear", "log")
    assert multiplier.get_xlabel().endswith("[m/s$^2$]")


@pytest.mark.parametrize("value", [1e-18, 3.0, 1e12])
def test_one_orbit_alone_stands_in_the_middle_of_an_axis_of_its_size(value: float) -> None:
    table = {
        "value": np.array([value]),
        "special": np.array(["bound"], dtype=object),
        "stable": np.array([True]),
        "period": np.array([1.0]),
        "multiplier": np.array([1.0]),
    }
    for axes in branch_figure(table, "energy [J]", "single").axes:
        assert axes.get_xlim() == pytest.approx((0.5 * value, 1.5 * value), rel=1e-9)


@pytest.mark.long
def test_the_table_of_a_folded_family_goes_along_it(folded: tuple[Orbit, Branch]) -> None:
    columns = orbit_columns(folded[1])
    values, kinds = columns["value"], columns["special"].tolist()
    turn = kinds.index("fold")
    assert np.all(np.diff(values[: turn + 1]) < 0.0)
    assert np.all(np.diff(values[turn:]) > 0.0)


@pytest.mark.long
def test_multipliers_that_stay_at_minus_one_do_not_pass_it() -> None:
    """Equal falling balls have these multipliers at every gravity: they only exchange speeds."""
    scenario = example("falling_balls").replace({"balls[2].mass": 2.0})
    family = orbit_family(scenario, orbit(scenario, impacts=1), "gravity", 9.0, 10.0)
    assert [one.kind for one in family.special] == ["bound", "bound"]
    for point in family.points:
        assert point.orbit.verdict == "neutral"


def test_an_orbit_has_its_least_period() -> None:
    """Two impacts from this start traverse the orbit of one impact twice."""
    scenario = example("falling_balls")
    once, twice = orbit(scenario, impacts=1), orbit(scenario, impacts=2)
    assert twice.shot.word == ("12", "1|")
    assert twice.residual < 1e-12
    # T = 2u/a with u the speed of the upper ball where they meet; the lower one has u/2 there, and
    # all that is kept is the energy of both above where they bounce.
    for one in (once, twice):
        pull = 9.81 * math.sin(math.radians(30.0))
        u = 0.5 * one.period * pull
        # The lower ball falls back to the wall in half the period.
        way = 0.5 * u * 0.5 * one.period + 0.5 * pull * (0.5 * one.period) ** 2
        heights = 3.0 * 9.81 * 0.05 * (math.cos(math.radians(30.0)) + 0.5)
        gap = 2.0 * 0.05
        energy = heights + 3.0 * pull * way + pull * gap + 0.5 * (2.0 * (0.5 * u) ** 2 + u * u)
        assert one.energy == pytest.approx(energy, rel=1e-9)


def test_multipliers_where_the_law_does_not_keep_the_volume() -> None:
    """On two pieces `hedrih` separates bodies at a speed other than that of approach."""
    places = ((1.2030059398545987, 0.44478756913435685, 1.2965308835706084),
              (1.95382108740032, 1.1112568843580006, 0.4551221739585616))  # fmt: skip
    balls = [
        {"body": "hoop", "radius": 0.1, "arc": 2, "mass": mass, "position": way, "speed": speed}
        for mass, way, speed in places
    ]
    found = find_orbit(system_of(scene(LINE_BETWEEN_VALLEYS, balls, law="hedrih", time=30.0)))
    rows = simulate_system(found.system, found.period, None).collisions
    expected = np.prod(rows["separation_speed"] / rows["approach_speed"])
    assert abs(expected - 1.0) > 1e-3
    assert np.prod(found.multipliers).real == pytest.approx(expected, rel=1e-9)
    scale = scale_of(found.system)
    differences = _differences(found) * scale[:, None] / scale
    assert np.sum(found.multipliers).real == pytest.approx(np.trace(differences) - 2.0, rel=1e-6)


def test_an_orbit_that_closes_from_its_old_start_only_keeps_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    system = build_any(load_any(FALLING))
    found = newton(system, state_of(system), 0.8)
    assert begun_between(found) is not found
    monkeypatch.setattr(orbits, "residual_of", lambda *_: 1e-5)
    assert begun_between(found) is found
    assert begun_between(found, longest=True) is found


def test_a_family_of_very_unstable_orbits_ends_by_rounding(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    first = find_orbit(system_of(HOOPS), 3, None, 30.0)
    family = Family(None, first, first.energy, first.energy - 1.0, first.energy + 1.0)
    here = Point(first.energy, replace(first), family._first.along)
    still = np.zeros_like(here.along)
    assert family._ending(here, still, 1.0, "the events change") == "the events change"
    monkeypatch.setattr(Orbit, "multipliers", np.array([6e5, 1 / 6e5]))
    here = Point(first.energy, replace(first), family._first.along)
    assert family._ending(here, still, 1.0, "the events change") == "rounding"


def test_the_direction_of_a_family_of_unstable_orbits_keeps_their_symmetry() -> None:
    # Motions of this family are their own reversal in time: midway between impacts both disks are
    # at rest at every mass, so that the direction of the family has no speeds. A change of the
    # start grows 2e4 times in a period. A difference over 5e-8 kg to one side, where only rounding
    # and second derivatives are lost, is off by 1e-3, across by the square of that.
    trace = {
        "start_slope": math.radians(-100),
        "arcs": [
            {"shape": "valley", "radius": 1.0, "end_slope": math.radians(40)},
            {"shape": "hump", "radius": 0.6, "end_slope": math.radians(-35)},
            {"shape": "valley", "radius": 1.2, "end_slope": math.radians(100)},
        ],
    }
    disk: Document = {"body": "disk", "radius": 0.04}
    disks = [ball(-1.2, mass=0.2772541034779619, **disk), ball(0.1, arc=3, mass=0.5, **disk)]
    scenario = scenario_of(scene(trace, disks, law="hedrih", collisions=2))
    system = build_system(scenario)
    found = newton(system, np.array([0.779972555, 0.0, 3.34629146, 0.0]), 6.5464909306)
    assert max(abs(found.multipliers)) > 300.0

    def at(mass: float) -> TraceSystem:
        return build_system(scenario.replace({"balls[1].mass": mass}))

    family = Family(at, found, 0.2772541034779619, 0.1, 0.6)
    tangent = family._tangent(family._first, family._across)
    assert np.max(np.abs(tangent[[1, 3]])) < 1e-5 * abs(tangent[-1])


def test_a_motion_without_impacts_is_told() -> None:
    apart = [ball(-0.3), ball(0.3, arc=3)]
    document = scene(
        {"start_slope": -1.0, "arcs": [
            {"shape": "valley", "radius": 1.0, "end_slope": 1.0},
            {"shape": "hump", "radius": 1.0, "end_slope": -1.0},
            {"shape": "valley", "radius": 1.0, "end_slope": 1.0},
        ]}, apart, time=5.0,
    )  # fmt: skip
    told = r"found 0 until the run ended \(time\), expected more than {}"
    for impacts, least in ((None, 1), (3, 3)):
        with pytest.raises(NoOrbit, match=told.format(least)):
            find_orbit(system_of(document), impacts, None, 5.0)


@pytest.mark.parametrize("path", ["balls[1].position", "balls[2].speed"])
def test_a_family_over_its_start_is_refused(path: str, capsys: pytest.CaptureFixture[str]) -> None:
    vary = f"--vary={path}={'0.5:0.7' if 'position' in path else '-2:2'}"
    assert run_command_line(["orbit", str(FALLING), "--impacts", "1", vary]) == 2
    assert f"{path}: found a parameter on which no orbit depends" in capsys.readouterr().err
