"""Bodies on springs: against 50 digits, theorems and laws."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any, cast

import numpy as np
import pytest
from mpmath import mp

from tests.highprecision import springs as twin
from tests.highprecision.springs_references import CASES, COLUMNS, references, twin_of
from tests.systems.springs_cases import FIGURE_FIVE, PRESSED, disk, solve, spring, springs
from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.kernels.springs.loop import farthest
from vibro_cli.kernels.springs.world import SpringBody
from vibro_cli.mechanics.system import Body
from vibro_cli.scenario import any_scenario_of
from vibro_cli.systems.springs.build import build
from vibro_cli.systems.springs.phase_plane import SpringsLandscape, spring_periods
from vibro_cli.systems.springs.portrait import springs_trajectory
from vibro_cli.systems.springs.scenario import SpringsScenario
from vibro_cli.systems.springs.system import Spring, separatrix_speed, singular_points


@pytest.mark.parametrize("name", CASES)
def test_the_first_ten_impacts_against_fifty_digits(name: str) -> None:
    balls, k = CASES[name]
    rows = solve(springs(balls, k, collisions=10)).collisions
    known = references()[name]
    assert len(known) == 10
    for row, values in enumerate(known):
        for column, text in zip(COLUMNS, values, strict=True):
            value = twin.mp.mpf(text)
            scale = abs(value) if column == "t" else 1 + abs(value)
            assert abs(float(rows[column][row]) - value) <= 1e-12 * scale, (row, column)


def test_the_references_are_what_their_program_says() -> None:
    name = "one singular point each"
    balls, k = CASES[name]
    (again,) = twin.run(twin_of(balls[0]), twin_of(balls[1]), k, 1)
    assert [twin.mp.nstr(value, 30) for value in again] == references()[name][0]


@pytest.mark.parametrize(
    "shape", [(5.0, 1.0), (5.0, 1.5), (2.0, 2.0), (1.0, 3.0), (1.0, 1.0 - 1e-9)]
)
def test_singular_points_and_separatrix(shape: tuple[float, float]) -> None:
    length, height = shape
    held = Spring(6.0, length, height, 0.0)
    points = singular_points(held)
    if length <= height:
        assert points == ((0.0, "centre"),)
        return
    away = float(twin.mp.sqrt(twin.mp.mpf(length) ** 2 - twin.mp.mpf(height) ** 2))
    assert [kind for _, kind in points] == ["centre", "saddle", "centre"]
    for place, known in zip((place for place, _ in points), (-away, 0.0, away), strict=True):
        assert abs(place - known) <= 4e-16 * away
    # On the separatrix it reaches the saddle, and no further.
    w = math.sqrt(6.0 / 1.5)
    speed = separatrix_speed(held, w, away)
    assert speed == pytest.approx(w * (length - height), rel=1e-15)
    for factor, passes in ((1.0 + 1e-6, True), (1.0 - 1e-6, False)):
        one = disk(away, -speed * factor, spring(6.0, length, height, 0.0))
        times = np.linspace(0.0, 60.0 if length < 2.0 else 20.0, 400)
        place = solve(springs([one], time=float(times[-1]))).sample(times)["x"]
        if length - height > 0.1:
            assert bool(np.min(place) < 0.0) == passes


def test_at_rest_in_a_centre_or_a_saddle_a_body_stays() -> None:
    for place in (-3.0, 0.0, 3.0):
        run = solve(springs([disk(place, 0.0, spring(6.0, 5.0, 4.0, 0.0))], time=20.0))
        final = run.sample([20.0])
        assert abs(final["x"][0] - place) <= 1e-12
        assert abs(final["speed"][0]) <= 1e-12


@pytest.mark.parametrize("height", [0.3, 0.7, 0.9])
def test_energy_at_rest_where_the_spring_is_unstressed_does_not_drift(height: float) -> None:
    """Its energy is the square of a rounding; relative to that it changed by up to 46."""
    place = math.sqrt(1.1**2 - height**2)
    run = solve(springs([disk(place, 0.0, spring(6.0, 1.1, height, 0.0))], time=5.0))
    record = run.summary_record()
    assert record["energy_start"] <= 1e-30
    assert abs(record["energy_drift"]) <= 1e-14


@pytest.mark.parametrize("size", [1e-3, 1e-5, 1e-7, 1e-9, 1e-40, 1e-150])
def test_phase_curves_of_small_swings_are_ellipses(size: float) -> None:
    """About a stressed centre: x² + (v/ω)² = a² with ω² = ω₀² (1 − l/b), off by terms in x²."""
    rate = math.sqrt(6.0 / 1.5 * (1.0 - 0.5))
    run = solve(springs([disk(size, 0.3 * size * rate, spring(6.0, 1.0, 2.0, 0.0))], time=1.7))
    (branches,) = springs_trajectory(run, 1).branches
    radius = np.hypot(branches.position, branches.rate / rate) / (size * math.hypot(1.0, 0.3))
    assert len(radius[0]) > 100
    assert np.ptp(branches.position) > size
    assert np.max(np.abs(radius - 1.0)) < size**2 + 1e-14


@pytest.mark.parametrize(
    ("length", "place", "speed"),
    [
        *((0.5, 0.4, speed) for speed in (1.3, -0.7)),  # in one well
        *((2.0, place, speed) for place, speed in ((1.5, 0.3), (2.2, -0.3))),  # in one of two
        *((2.0, place, 4.0) for place in (0.01, -1.5, 2.0)),  # over both
        (2.0, -1.5, -4.0),
    ],
)
@pytest.mark.parametrize("share", [0.45, 0.97, 1.03, 2.4])
def test_phase_curves_are_the_motion_and_after_periods_their_whole_loop(
    length: float, place: float, speed: float, share: float
) -> None:
    """Against the sampled motion: the way along the loop, and the states that it passes."""
    run = solve(springs([disk(place, speed, spring(6.0, length, 1.0, 0.3))], time=60.0))
    period = spring_periods(run.system, 1)[1]

    def motion(duration: float) -> tuple[Any, Any]:
        found = run.sample(np.linspace(0.0, duration, 6001))
        return found["displacement"], found["speed"]

    def way(places: Any) -> float:
        return float(np.sum(np.abs(np.diff(places))))

    q, v = motion(share * period)
    ends = (q[:1], v[:1]), (q[-1:], v[-1:])
    hills = SpringsLandscape.of(run.system, 0, 0)
    curve, rates = (one[0] for one in hills.branches(*ends, np.array([share * period]), 6001))
    drawn = way(q) if share < 2.0 else way(q) - way(motion(period)[0])
    assert way(curve) == pytest.approx(drawn, rel=1e-5)
    step = np.max(np.hypot(np.diff(curve), np.diff(rates)))
    for number in range(0, 6001, 600):
        assert np.min(np.hypot(curve - q[number], rates - v[number])) <= step
    energy = hills.energy(curve, rates)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-11)


def test_phase_curves_after_several_impacts_at_one_instant() -> None:
    """A third disk strikes two that are pressed together: C (7) with the last speed it leaves."""
    coming = disk(2.9, -1.5, spring(8.0, 0.5, 1.0, 0.0), mass=0.7)
    pair = [PRESSED[0], disk(-0.2, 0.0, spring(8.0, 0.5, 1.0, -0.3), mass=1.5)]
    run = solve(springs([*pair, coming], [0.3, 0.3], time=3.0))
    rows = run.collisions
    (branches,) = springs_trajectory(run, 1).branches
    checked = 0
    free = ~branches.contact
    curves = branches.time[free], branches.position[free], branches.rate[free]
    for time, x, v in zip(*curves, strict=True):
        mine = np.flatnonzero((rows["t"] == time) & (rows["ball_a"] == 1))
        if len(mine) == 0:
            continue
        at, left = rows["displacement_a"][mine[-1]], rows["speed_a_post"][mine[-1]]
        longer = np.hypot(1.0, x) - math.hypot(1.0, at)
        square = left**2 - 5.0 / 1.5 * (x**2 - at**2 - 2.0 * 0.5 * longer)
        assert np.max(np.abs(v**2 - square)) < 1e-12
        checked += int(np.sum(rows["t"] == time) > 1)
    assert checked > 0


@pytest.mark.parametrize("height", [1e-10, 1e-13, 1e-16, 1e-30])
def test_a_body_passes_its_foot_however_near_the_line_that_is(height: float) -> None:
    """With the foot on the line |x| - l swings harmonically, from each passage to the next."""
    w, length = 2.0, 5.0
    start = complex(4.0 - length, 20.5 / w)  # a e^(i phase), moving towards the foot
    passing = math.acos(-length / abs(start))
    held = spring(6.0, length, height, 0.0)
    run = solve(springs([disk(-4.0, 20.5, held)], time=6.0))
    assert abs(run.summary_record()["energy_drift"]) <= 1e-14
    times = np.linspace(0.0, 6.0, 25)
    phase = math.atan2(start.imag, start.real) + w * times + passing
    passages, phase = np.divmod(phase, 2.0 * passing)
    known = np.where(passages % 2 == 0, -1.0, 1.0) * (length + abs(start) * np.cos(phase - passing))
    assert passages[-1] >= 2.0
    np.testing.assert_allclose(run.sample(times)["x"], known, rtol=0.0, atol=1e-12)


def test_energy_over_ten_thousand_impacts() -> None:
    """A hundred thousand in `vibro stress --full`."""
    run = solve(springs(FIGURE_FIVE, collisions=10_000))
    summary = run.summary_record()
    assert summary["collisions"] == 10_000
    assert abs(summary["energy_drift"]) <= 1e-13
    assert summary["max_gap"] <= 1e-14
    assert np.all(run.collisions["approach_speed"] >= 0.0)


@pytest.mark.parametrize("mass_b", [0.7, 0.3, 2.9])
def test_rounding_takes_as_often_energy_of_an_impact_as_it_gives_some(mass_b: float) -> None:
    """By exact sums of the rows: a pair used to lose 2e-16 of its energy in each impact."""
    left, right = spring(5.0, 1.5, 1.0, 0.3), spring(8.0, 1.5, 1.0, -0.3)
    balls = [disk(-1.0, 2.0, left), disk(0.5, -1.7, right, mass=mass_b, radius=0.3)]
    document = springs(balls, collisions=5000)
    document["collision"]["law"] = "normal-impulse"
    rows = solve(document).collisions
    gained = np.zeros(5000)
    for n in range(5000):
        for body, mass in {"a": 1.0, "b": mass_b}.items():
            before, after = (Fraction(rows[f"speed_{body}_{when}"][n]) for when in ("pre", "post"))
            gained[n] += float(Fraction(mass) * (after - before) * (after + before))
    assert np.any(gained != 0.0)
    assert abs(np.mean(gained)) <= 5.0 * np.std(gained) / math.sqrt(len(gained))


def test_both_engines_give_the_same_bits() -> None:
    for k in (1.0, 0.6, 0.0):
        document = springs(FIGURE_FIVE, k, collisions=60, time=200.0)
        one, other = solve(document, "python"), solve(document)
        for name in ("collisions", "events", "summary"):
            for column, values in getattr(one, name).items():
                np.testing.assert_array_equal(values, getattr(other, name)[column], column)


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("k", [0.0, 0.5, 0.8])
def test_springs_press_bodies_into_lasting_contact(k: float, count: int) -> None:
    run = solve(springs(PRESSED[:count], k, time=30.0))
    assert run.clock["contacts"] >= count - 1
    summary = run.summary_record()
    lost = float(np.sum(run.collisions["energy_loss"]))
    start, end = summary["energy_start"], summary["energy_end"]
    assert start - end == pytest.approx(lost, rel=1e-9)
    state = run.sample(np.linspace(0.0, 30.0, 500))
    x = state["x"].reshape(-1, count)
    assert np.all(np.diff(x, axis=1) >= 0.8 - 1e-9)
    assert np.max(np.abs(np.diff(x[-1]) - 0.8)) <= 1e-9
    held = state["speed"].reshape(-1, count)[-1]
    assert np.ptp(held) <= 1e-12


def test_a_contact_opens_where_its_force_ends() -> None:
    balls = [
        disk(-0.4, 3.0, spring(5.0, 0.5, 1.0, 0.0)),
        disk(0.4, 3.0, spring(3.0, 0.5, 1.0, -0.2), mass=2.0),
    ]
    run = solve(springs(balls, 0.0, time=20.0))
    kinds = list(run.events["event"])
    assert "contact_opened" in kinds
    for t in run.events["t"][run.events["event"] == "contact_opened"]:
        # There both would have the same acceleration if they were free.
        x = run.sample([t])["displacement"]
        accelerations = [
            -c * d * (1.0 - 0.5 / math.hypot(1.0, d)) / (1.5 * m)
            for c, m, d in zip((5.0, 3.0), (1.0, 2.0), x, strict=True)
        ]
        assert accelerations[0] == pytest.approx(accelerations[1], abs=1e-9)


def test_where_they_can_never_meet_the_run_ends_at_once() -> None:
    balls = [
        disk(-4.5, 0.5, spring(6.0, 5.0, 1.0, 0.0)),
        disk(7.5, -0.5, spring(9.0, 5.0, 1.5, 3.0)),
    ]
    run = solve(springs(balls, 1.0, collisions=5))
    assert run.end_cause == "no_more_collisions"


def test_motion_is_the_same_from_either_side_of_an_event() -> None:
    run = solve(springs(FIGURE_FIVE, 0.9, collisions=4))
    rows = run.collisions
    for when in ("pre", "post"):
        state = run.sample(rows["t"], "before" if when == "pre" else "after")
        for end, first in (("a", 0), ("b", 1)):
            assert np.max(np.abs(state["x"][first::2] - rows[f"x_{end}"])) <= 1e-13
            assert np.max(np.abs(state["speed"][first::2] - rows[f"speed_{end}_{when}"])) <= 1e-12


def test_the_frequency_is_the_papers() -> None:
    document = springs([disk(0.0, 0.0, spring(6.0, 5.0, 1.0, 0.0))], time=1.0)
    system = solve(document).system
    body = Body("disk", 0.4, 1.0, 0.5)
    assert system.frequencies[0] == pytest.approx(
        math.sqrt(6.0 * 0.4**2 / body.rolling_inertia), rel=1e-15
    )


def test_all_impacts_that_are_solved_together_are_marked() -> None:
    """A body at rest between two that meet it at once, its mirror image: it stays at rest."""
    balls = [
        disk(place, speed, spring(1.0, 1.0, 1.0, place), radius=0.1)
        for place, speed in ((0.0, 1.0), (0.2, 0.0), (0.4, -1.0))
    ]
    rows = solve(springs(balls, 0.5, collisions=2, time=1.0)).collisions
    np.testing.assert_allclose(rows["t"], [0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(rows["speed_b_post"], [0.0, -rows["speed_a_post"][0]], atol=1e-15)
    assert rows["simultaneous"].tolist() == [True, True]


@pytest.mark.parametrize("law", LAW_NAMES)
def test_bodies_that_nearly_stop_one_another_at_k_0_collide_once(law: str) -> None:
    """What is left of their speeds is small; their momentum says how much."""
    draw = np.random.default_rng(7)
    for left in (0.0, 1e-3, -1e-2):
        for _ in range(8):
            mass = draw.uniform(0.3, 3.0)
            # Of weak springs at rest: the speeds hardly change on the way.
            one = disk(0.0, 1.0, spring(1e-9, 1.0, 1.0, 0.0))
            other = disk(1.0, -(1.0 + left) / mass, spring(1e-9, 1.0, 1.0, 1.0), mass=mass)
            document = springs([one, other], time=1.0)
            run = solve({**document, "collision": {"k": 0.0, "law": law}})
            assert len(run.collisions["t"]) == 1
            for end in "ab":
                common = run.collisions[f"speed_{end}_post"][0]
                assert abs(common + left / (1.0 + mass)) <= 1e-9


@pytest.mark.parametrize(
    ("length", "height", "place", "speed"),
    [
        *((0.5, 1.0, place, 0.0) for place in (0.3, 1e-3, 1e-5, 1e-8)),  # about a stressed centre
        *((1.0, 1.0, place, 0.0) for place in (0.3, 1e-3, 1e-5)),  # where nothing pulls at once
        *((2.0, 1.0, place, 0.0) for place in (1e-2, 1e-6, math.sqrt(3.0) + 1e-7)),  # in one well
        *((2.0, 1.0, 0.0, speed) for speed in (1e-1, 1e-4, 1e-8)),  # over the saddle
        (2.0, 1e-3, 0.5, 5.0),
        (2.0, 1e-3, 0.5, 1.0),
        *((5.0, 1.0, 0.0, speed) for speed in (0.1, 1e-3, 1e-9)),  # past a high saddle
        *((5.0, 1.0, place, 0.0) for place in (1e-3, 1e-8)),  # from just beside it
        (5.0, 1.0, -4.0, 8.5),
        (1.2, 1.0, 1e-6, 0.0),
        (0.8, 1.0, 0.0, 1e-4),
        (1.0, 1.0, 0.1, 0.0),
    ],
)
def test_periods_against_quadrature_in_sixty_digits(
    length: float, height: float, place: float, speed: float
) -> None:
    one = disk(place, speed, spring(6.0, length, height, 0.0))
    document = any_scenario_of(springs([one], time=1.0))
    _, own = spring_periods(build(cast(SpringsScenario, document)), 1)
    mp = twin.mp
    with mp.workdps(60):
        b, long, square = mp.mpf(height), mp.mpf(length), mp.mpf(6) / mp.mpf("1.5")
        start = mp.sqrt(b**2 + mp.mpf(place) ** 2) - long
        reach = mp.sqrt(mp.mpf(speed) ** 2 / square + start**2)
        high = mp.sqrt((long + reach) ** 2 - b**2)
        passes = long - reach <= b
        low = -high if passes else mp.sqrt((long - reach) ** 2 - b**2)

        def pace(angle: Any) -> Any:
            x = (high + low) / 2 + (high - low) / 2 * mp.sin(angle)
            left = square * (reach**2 - (mp.sqrt(b**2 + x**2) - long) ** 2)
            return (high - low) / 2 * mp.cos(angle) / mp.sqrt(abs(left))

        # Beside a saddle the body is slow: there the interval is cut finely.
        slow = mp.mpf(0) if passes else -mp.pi / 2
        cuts = {-mp.pi / 2, slow, mp.pi / 2}
        cuts |= {slow + sign * mp.mpf(10) ** -n for n in range(12) for sign in (-1, 1)}
        parts = sorted(cut for cut in cuts if abs(cut) <= mp.pi / 2)
        half, error = mp.quad(pace, parts, method="gauss-legendre", maxdegree=5, error=True)
        known = 2 * half
    assert error <= 1e-16 * known
    assert abs(own - known) <= 1e-13 * known


@pytest.mark.parametrize("engine", ["compiled", "python"])
def test_many_pairs_that_collide_at_one_instant(engine: str) -> None:
    """Equal bodies exchange speeds until these ascend: one exchange for each pair out of order."""
    count = 60
    held = [spring(4.0, 1.0, 0.7, 0.04 * place) for place in range(count)]
    balls = [
        {"radius": 0.02, "mass": 1.0, "speed": 1.0 - 2.0 * (place % 2), "spring": one}
        | ({"touching": "previous"} if place else {"position": 0.0})
        for place, one in enumerate(held)
    ]
    run = solve(springs(balls, 1.0, time=1e-3), engine)
    assert len(run.collisions["n"]) == 30 * 31 // 2
    assert set(run.collisions["t"]) == {0.0}
    speeds = run.sample([0.0])["speed"]
    assert speeds.tolist() == [-1.0] * 30 + [1.0] * 30


@pytest.mark.parametrize("engine", ["compiled", "python"])
def test_many_pairs_that_stay_together_at_one_instant(engine: str) -> None:
    """Rows of three far apart, more than the first log can hold: each behaves as if alone."""
    balls = [
        {
            "radius": 0.02,
            "mass": 1.0,
            "speed": (1.0, -1.0, 0.0)[place % 3],
            "spring": spring(4.0, 0.5, 0.7, 10.0 * (place // 3)),
        }
        | ({"touching": "previous"} if place % 3 else {"position": 10.0 * (place // 3) - 0.04})
        for place in range(60)
    ]
    three = solve(springs(balls[:3], 0.0, time=1e-3), engine).collisions["contact"]
    assert three.tolist() == [True]
    run = solve(springs(balls, 0.0, time=1e-3), engine)
    assert run.collisions["contact"].tolist() == [True] * 20


def test_what_ends_an_instant_does_not_depend_on_the_length_of_the_logs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Bounces that contract: impacts follow one another at instants that had come to an end."""
    speeds = (0.5, 0.5, 0.5, 0.0, 0.5, -1.0, 1.0, 0.5, 0.0, 0.5, 0.5, 0.5)
    feet = (0.0, 0.0, -0.02, 0.0, 0.0, 0.0, -0.02, -0.02, 0.0, 0.02, -0.02, -0.02)
    balls, place = [], 0.0
    for ball, (speed, foot) in enumerate(zip(speeds, feet, strict=True)):
        held = spring(4.0 if ball in (0, 3, 4, 9) else 9.0, 0.5, 0.7, place + foot)
        apart = ball in (0, 3, 5, 6, 7, 9)
        place += 0.041 if apart else 0.04
        where = {"position": place} if apart else {"touching": "previous"}
        balls.append({"radius": 0.02, "mass": 1.0, "speed": speed, "spring": held} | where)
    scene = springs(balls, 0.7, time=0.5)
    whole = solve(scene).collisions
    for name in ("FIRST_ROWS", "COMPILED_ROWS"):
        monkeypatch.setattr(f"vibro_cli.systems.driver.{name}", 1)
    short = solve(scene).collisions
    assert whole["contact"].sum() > 10
    for name, values in whole.items():
        assert values.tobytes() == short[name].tobytes(), name


def _row(speeds: Any, masses: Any, held: Any) -> list[dict[str, Any]]:
    """Disks of one size that start in contact, each with a spring from ``held``."""
    return [
        {"body": "disk", "radius": 0.05, "mass": mass, "speed": speed, "spring": one}
        | ({"touching": "previous"} if place else {"position": 1.0})
        for place, (speed, mass, one) in enumerate(zip(speeds, masses, held, strict=True))
    ]


def _equally_accelerated(*shapes: tuple[float, float, float]) -> list[dict[str, Any]]:
    """Springs of unit rolling mass with the acceleration of the first, of place, length, height."""
    pulls = [x * (1.0 - length / math.hypot(height, x)) for x, length, height in shapes]
    return [
        spring(6.0 * pulls[0] / pull, length, height, 1.0 + 0.1 * i - x)
        for i, (pull, (x, length, height)) in enumerate(zip(pulls, shapes, strict=True))
    ]


# The first derivative of the gap that is not zero, the speed, and both springs.
TIES = {
    3: (1.0, [spring(6.0, 0.0625, 0.7, 1.0), spring(7.0, 0.0625, 0.7, 1.1)]),
    4: (0.0, _equally_accelerated((0.9, 0.25, 0.7), (0.4, 0.5, 0.8))),
    5: (-2.0, [spring(6.0, 0.25, 0.5, 1.0), spring(6.0, 0.5, 1.0, 1.1)]),
}


@pytest.mark.parametrize("engine", ["compiled", "python"])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("order", TIES)
def test_bodies_with_one_acceleration_part_by_the_next_derivative(
    order: int, turned: bool, engine: str
) -> None:
    """Equal speeds too: against the series of fifty digits."""
    speed, held = TIES[order]
    if turned:
        shifts = (0.1, -0.1)
        held = [one | {"foot": one["foot"] + by} for one, by in zip(held, shifts, strict=True)][
            ::-1
        ]
    run = solve(springs(_row([speed] * 2, [1.0] * 2, held), 0.0, time=0.05), engine)
    one, other = (
        twin.series(twin.body(1.5, 0.05, tuple(own.values()), 1.0 + 0.1 * i, speed))
        for i, own in enumerate(held)
    )
    terms = [right - left for left, right in zip(one, other, strict=True)]
    assert max(map(abs, terms[2:order])) < 1e-14 < 1e-2 < abs(terms[order])
    times = np.linspace(0.0, 0.05, 11)
    left, right = run.sample(times)["x"].reshape(-1, 2).T
    known = [twin.at(terms, time)[0] - terms[0] if terms[order] > 0 else 0.0 for time in times]
    np.testing.assert_allclose(right - left - 0.1, np.array(known, float), rtol=0.0, atol=2e-15)
    assert len(run.collisions["n"]) == 0
    assert run.events["event"].tolist() == ([] if terms[order] > 0 else ["contact_closed"])


def test_contacts_that_open_at_one_instant_are_decided_together() -> None:
    """Three disks with equal accelerations return to their start with all speeds reversed."""
    masses = [70.0, 0.14, 0.09]
    held = _equally_accelerated((-1.4, 0.25, 0.7), (-2.0, 0.5, 0.8), (-1.8, 0.75, 0.9))
    for one, mass in zip(held, masses, strict=True):
        one["stiffness"] *= mass
    run = solve(springs(_row([-0.2] * 3, masses, held), 0.0, time=0.3))
    times = np.linspace(0.0, 0.3, 301)
    gaps = np.diff(run.sample(times)["x"].reshape(-1, 3), axis=1) - 0.1
    assert gaps.min() > -1e-14


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("away", [1e3, 1e5])
def test_bodies_at_rest_in_contact_touch_however_far_their_feet_are(
    away: float, turned: bool
) -> None:
    """Positions from a far foot are rounded more than those from the origin; against statics."""
    stretches = [-0.5, 0.0, 0.5]  # of springs from the left: those outside push inwards
    held = [spring(6.0, away - stretch, 0.7, 1.0 - away) for stretch in stretches]
    if turned:
        held = [spring(6.0, away + stretch, 0.7, 1.0 + away) for stretch in stretches]
    run = solve(springs(_row([0.0] * 3, [1.0] * 3, held), 0.5, time=0.1))
    assert len(run.collisions["n"]) == 0
    assert run.events["event"].tolist() == ["contact_closed"] * 2
    assert not any(run.events["t"])


@pytest.mark.parametrize("seed", [6, 11, 12, 21])
def test_approach_by_the_rounding_of_greater_speeds_moves_no_body_into_another(seed: int) -> None:
    """A light body between heavy ones gets impulses of which an instant leaves a small approach."""
    masses = [1e6, 1e-6, 1e6]
    held = [
        spring(mass * stiffness, 1e-16, 0.7, 1.0 + 0.1 * i)
        for i, (mass, stiffness) in enumerate(zip(masses, (6.0, 9.6, 13.2), strict=True))
    ]
    speeds = np.round(np.random.default_rng(seed).normal(size=3), 1).tolist()
    document = springs(_row(speeds, masses, held), 0.3, time=1.5)
    document["collision"]["law"] = "normal-impulse"
    places = solve(document).sample(np.linspace(0.0, 1.5, 151))["x"].reshape(-1, 3)
    assert np.diff(places, axis=1).min() - 0.1 > -1e-14


@pytest.mark.parametrize("ratio", [1e-9, 1.0, 1e9])
def test_contact_opens_where_both_springs_alone_accelerate_alike(ratio: float) -> None:
    """However much heavier one of the bodies is."""
    held = [spring(6.0 * ratio, 0.5, 0.7, 1.5), spring(9.0, 0.25, 0.8, 0.9)]
    run = solve(springs(_row([-9.0] * 2, [ratio, 1.0], held), 0.0, time=0.2))
    states = run.history()["states"].reshape(-1, 2)
    assert states["cause"][:, 0].tolist() == [0, 2, 3]

    def pull(c: float, length: float, b: float, x: Any) -> Any:
        return -mp.mpf(c) * x * (1 - length / mp.sqrt(b * b + x * x))

    def pressing(x: Any) -> Any:
        return pull(6.0, 0.5, 0.7, x) - pull(9.0, 0.25, 0.8, x + (1.6 - 0.9))

    with mp.workdps(40):
        assert abs(states["x"][2, 0] - mp.findroot(pressing, states["x"][2, 0])) <= 2e-15


def test_contact_opens_over_a_foot_nearly_on_the_line_where_its_force_ends() -> None:
    """The spring turns from pressing to pulling within 1e-8 m; against fifty digits."""
    left, right = (6.0, 1.0, 0.125, -1.7), (5.0, 2.0, 1e-8, -0.5)

    def pressing(x: Any) -> Any:
        places = (x - 0.5 - mp.mpf(0.8) + mp.mpf(1.7), x)
        pulls = [
            -mp.mpf(c) * at * (1 - length / mp.hypot(b, at))
            for (c, length, b, _), at in zip((left, right), places, strict=True)
        ]
        return pulls[0] / 3 - pulls[1]

    with mp.workdps(50):
        opens = mp.findroot(pressing, (-1e-8, 1e-8), solver="anderson")
    for speed in np.linspace(0.9, 1.2, 20):
        balls = [
            disk(-1.4, float(speed), spring(*left), mass=3.0),
            disk(-0.6, float(speed), spring(*right)),
        ]
        run = solve(springs(balls, 0.0, time=0.2))
        states = run.history()["states"].reshape(-1, 2)
        assert states["cause"][:, 0].tolist() == [0, 2, 3]
        assert abs(states["x"][2, 1] - opens) <= 4e-16  # rounding of places of 1.4 m


@pytest.mark.parametrize("law", LAW_NAMES)
def test_pairs_that_meet_at_one_instant_of_a_run_collide_jointly(law: str) -> None:
    """Linear springs of one frequency: what parts at once is together again after half a period."""
    masses = np.array([1.0, 0.2, 3.0, 0.5])
    speeds = np.array([-1.0, -0.2, 0.3, 0.9])
    held = [spring(6.0 * m, 1e-16, 0.7, 1.0 + 0.1 * i) for i, m in enumerate(masses)]
    document = springs(_row(speeds, masses, held), 0.8, time=1.8 * math.pi)
    document["collision"]["law"] = law
    run = solve(document)
    # Every relative speed is turned, times k, and the momentum is kept.
    differences = np.diff(np.eye(4), axis=0)
    equations = np.vstack([differences, masses])
    rows, after = run.collisions, -speeds
    for number in range(3):
        instant = rows["n"][3 * number : 3 * number + 3] - 1
        np.testing.assert_allclose(rows["t"][instant], (number + 1) * math.pi / 2.0, rtol=1e-15)
        np.testing.assert_allclose(rows["speed_a_pre"][instant], after[:-1], rtol=1e-13)
        known = [*(-0.8 * differences @ after), masses @ after]
        after = np.linalg.solve(equations, known)
        np.testing.assert_allclose(rows["speed_a_post"][instant], after[:-1], rtol=1e-13)
        np.testing.assert_allclose(rows["speed_b_post"][instant], after[1:], rtol=1e-13)
        assert all(rows["simultaneous"][instant])
        after = -after
    assert len(rows["n"]) == 9


@pytest.mark.parametrize("law", LAW_NAMES)
@pytest.mark.parametrize("masses", [(1.0, 1e10), (1e10, 1.0), (1e-7, 0.3), (2.0, 3.0)])
def test_a_pair_that_stays_together_has_the_speed_of_its_momentum(
    masses: tuple[float, float], law: str
) -> None:
    """This holds to rounding, whichever body is heavier, and to the bit for its mirror image."""
    pressing = [spring(mass, 0.3, 0.4, 1.05) for mass in masses]
    for speeds in ((1.0, 0.0), (0.0, -1.0), (0.7, 0.1), (0.3 / masses[0], -0.2 / masses[1])):
        found = []
        for sign in (1, -1):
            pair = [sign * speed for speed in speeds[::sign]]
            document = springs(_row(pair, masses[::sign], pressing), 0.0, time=1e-9)
            document["collision"]["law"] = law
            rows = solve(document).collisions
            assert rows["contact"].tolist() == [True]
            assert rows["speed_a_post"][0] == rows["speed_b_post"][0]
            found.append(sign * rows["speed_a_post"][0])
        with mp.workdps(40):
            momenta = [mp.mpf(m) * mp.mpf(v) for m, v in zip(masses, speeds, strict=True)]
            error = sum(map(mp.mpf, masses)) * mp.mpf(found[0]) - sum(momenta)
            assert abs(error) <= 4e-16 * sum(map(abs, momenta))
        assert found[0] == found[1]


def _nearest_ascending(speeds: Any, masses: Any) -> list[float]:
    """Return the nearest ascending speeds in kinetic energy: violators are pooled."""
    pools: list[tuple[float, float, int]] = []
    for speed, mass in zip(speeds, masses, strict=True):
        pool = (speed * mass, mass, 1)
        while pools and pools[-1][0] * pool[1] >= pool[0] * pools[-1][1]:
            last = pools.pop()
            pool = (last[0] + pool[0], last[1] + pool[1], last[2] + pool[2])
        pools.append(pool)
    return [momentum / mass for momentum, mass, count in pools for _ in range(count)]


@pytest.mark.parametrize("law", LAW_NAMES)
def test_a_row_at_k_0_takes_the_nearest_motion_that_closes_no_contact(law: str) -> None:
    """Also of light bodies between heavy ones, whose impacts at the instant have no end."""
    draw = np.random.default_rng(3)
    cases = [([1.0, -0.5, -0.5], [1.0, 1.0, 1.0]), ([1.0, 0.5, 0.5], [1.0, 1e-6, 1.0])]
    for _ in range(12):
        count = int(draw.integers(2, 7))
        cases.append(
            (draw.normal(size=count).tolist(), (10 ** draw.uniform(-4, 4, count)).tolist())
        )
    for speeds, masses in cases:
        weak = [spring(1e-9 * mass, 0.3, 0.4, 1.0 + 0.1 * i) for i, mass in enumerate(masses)]
        document = springs(_row(speeds, masses, weak), 0.0, time=1e-9)
        document["collision"]["law"] = law
        run = solve(document)
        assert run.summary["end_cause"] == "time"
        own = [run.summary[f"speed_{number + 1}"][0] for number in range(len(masses))]
        np.testing.assert_allclose(own, _nearest_ascending(speeds, masses), atol=1e-10)
        change = sum(
            0.75 * m * (v - w) * (v + w) for m, v, w in zip(masses, speeds, own, strict=True)
        )
        energy = sum(0.75 * m * v * v for m, v in zip(masses, speeds, strict=True))
        assert run.collisions["energy_loss"].sum() == pytest.approx(change, abs=1e-10 * energy)


@pytest.mark.parametrize(
    ("speeds", "k"),
    [([0.2, -1.7, -0.1], 0.9), ([-0.3, 1.0, -1.2], 0.9), ([-0.1, 1.4, -0.4], 0.8)],
)
def test_the_limit_of_impacts_at_one_instant_is_never_inadmissible(
    speeds: list[float], k: float
) -> None:
    """Bodies that part and those that close are solved as one: what is left is rounded more."""
    masses = [100.0, 0.01, 100.0]
    weak = [spring(1e-9 * mass, 0.3, 0.4, 1.0 + 0.1 * i) for i, mass in enumerate(masses)]
    document = springs(_row(speeds, masses, weak), k, time=1e-9)
    document["collision"]["law"] = "normal-impulse"
    run = solve(document)
    assert run.summary["end_cause"] == "time"
    own = [run.summary[f"speed_{number}"][0] for number in (1, 2, 3)]
    common = sum(m * v for m, v in zip(masses, speeds, strict=True)) / sum(masses)
    np.testing.assert_allclose(own, common, atol=1e-12)


@pytest.mark.parametrize("k", [0.0, 0.3, 0.7])
def test_under_the_translational_law_bounces_add_to_mass_times_speed(k: float) -> None:
    """Feet 100 km away pull with constant forces: each bounce lasts 2 u/A, the next one k times it.

    Until the bounces end impacts keep the sum of m v, which the free accelerations change; from
    then on the bodies roll as one. The bounces left out last up to 3e-5 s here.
    """
    far, masses, kappas, pulls = 1e5, (1.0, 2.0), (2.0, 1.4), (1.0, -0.4)
    speeds, end = (0.01, 0.0), 0.05
    balls = [
        disk(
            x,
            speed,
            spring(kappa * mass * abs(pull) / far, 1e-3, 1.0, x + math.copysign(far, pull)),
        )
        | {"body": body, "mass": mass, "radius": 0.1}
        for x, speed, body, mass, kappa, pull in zip(
            (0.0, 0.2), speeds, ("hoop", "ball"), masses, kappas, pulls, strict=True
        )
    ]
    document = springs(balls, k, time=end)
    run = solve({**document, "collision": {"k": k, "law": "translational"}})
    (m, n), (a, b) = masses, pulls
    lasting = 2.0 * k * (speeds[0] - speeds[1]) / ((a - b) * (1.0 - k))
    speed = (m * speeds[0] + n * speeds[1] + lasting * (m * a + n * b)) / (m + n)
    rolling = kappas[0] * m, kappas[1] * n
    common = (rolling[0] * a + rolling[1] * b) / sum(rolling)
    final = run.sample([end])["speed"]
    # Within a millimetre the pull changes by its 1e8th part.
    assert final == pytest.approx(2 * [speed + (end - lasting) * common], abs=1e-9)
    summary = run.summary_record()
    lost = summary["energy_start"] - summary["energy_end"]
    # The springs store 1e5 J each.
    assert abs(np.sum(run.collisions["energy_loss"]) - lost) <= 1e-10


def test_a_contact_that_the_next_double_does_not_have_is_grazing() -> None:
    """A body oscillates up to another one at rest, from farther and farther away."""

    def touched(position: float) -> Any:
        held = [spring(5.0, 0.5, 1.0, foot) for foot in (0.0, 3.0)]
        return solve(springs([disk(position, 0.0, held[0]), disk(3.0, 0.0, held[1])], time=4.0))

    meets, passes = -2.5, -2.0
    while meets < (middle := 0.5 * (meets + passes)) < passes:
        if len(touched(middle).collisions["t"]):
            meets = middle
        else:
            passes = middle
    assert touched(meets).collisions["grazing"].tolist() == [True]
    # 1e-12 m more is thousands of units in the last place of the places.
    assert not touched(meets - 1e-12).collisions["grazing"].any()


def test_energy_is_kept_until_an_impact_takes_it() -> None:
    held = [spring(6.0, 1.0, 0.5, at) for at in (-1.0, 1.0)]
    document = springs([disk(-1.0, 0.2, held[0]), disk(1.0, 0.2, held[1])], k=0.5, time=1.0)
    record = solve(document).summary_record()
    assert record["collisions"] == 0
    assert abs(record["energy_drift"]) <= 1e-14


@pytest.mark.parametrize("length", [-60, -20, 40])
def test_places_without_force_are_as_exact_in_any_unit_of_length(length: int) -> None:
    def places(power: int) -> list[float]:
        far, near = math.ldexp(5.0, power), math.ldexp(1.0, power)
        pair = Spring(6.0, far, near, 0.0), Spring(9.0, far, 1.5 * near, 3.0 * near)
        return [float(q) for q in SpringsLandscape(pair, (0.0, -2.3 * near), 2.0).level_places]

    assert len(places(0)) == 3
    assert places(length) == [math.ldexp(place, length) for place in places(0)]


@pytest.mark.parametrize(("length", "height"), [(0.4, 1.0), (1.0, 1.0), (1.5, 1.0), (2.0, 0.1)])
@pytest.mark.parametrize("x", [-1.1, -0.3, 0.2, 2.0])
def test_a_body_goes_as_far_as_its_energy_takes_it(length: float, height: float, x: float) -> None:
    """Against a scan of the potential energy from the body outwards, w^2 (s - l)^2/2."""
    spring = SpringBody()
    spring.square, spring.length, spring.height, spring.x = 9.0, length, height, x
    for energy_of_motion in (0.0, 0.01, 0.3, 5.0):
        spring.energy = energy_of_motion + 4.5 * (math.hypot(x, height) - length) ** 2
        for side in (-1.0, 1.0):
            scan = x + side * np.linspace(0.0, 5.0, 50_001)[1:]
            beyond = 4.5 * (np.hypot(scan, height) - length) ** 2 > spring.energy
            turn = abs(float(scan[np.argmax(beyond)]) - x)
            assert side * x + turn == pytest.approx(farthest(spring, side), abs=2.5e-4)


def test_inadmissible_joint_impacts_stop_the_run_or_are_substituted() -> None:
    """A large disk overtakes two small ones that close too, all at one instant.

    The normal-impulse law, by which (v_b - v_a)' = -k (v_b - v_a) for both pairs, and the sum of
    M v decide.
    """
    held = spring(1.0, 0.5, 1.0, 0.0)
    speeds, masses, k = (1.0, 0.5, 0.1), (1.0, 0.2, 0.3), 0.5
    apart = 2.0 * math.sqrt(0.4 * 0.1)
    places = (0.0, apart, apart + 0.2)
    balls = [
        disk(x, v, held, radius=radius, mass=mass)
        for x, v, radius, mass in zip(places, speeds, (0.4, 0.1, 0.1), masses, strict=True)
    ]
    document = springs(balls, k, collisions=2)
    run = solve(document)
    assert run.end_cause == "inadmissible"
    assert list(run.collisions["admissible"]) == [False, False]
    document["collision"]["inadmissible"] = "normal-impulse"
    run = solve(document)
    assert list(run.collisions["substituted"]) == [True, True]
    assert list(run.collisions["simultaneous"]) == [True, True]
    found = run.sample([run.end_time])["speed"]
    rules = [[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0], masses]
    total = sum(m * v for m, v in zip(masses, speeds, strict=True))
    expected = np.linalg.solve(np.array(rules), [k * 0.5, k * 0.4, total])
    assert found == pytest.approx(expected, abs=1e-14)
