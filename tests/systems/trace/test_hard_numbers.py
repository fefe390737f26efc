"""Expected results of the scenes of tests/hard_cases, where another method gives them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from vibro_cli.api import simulate
from vibro_cli.scenario import load_any
from vibro_cli.stress.scenes import scene, solve_any
from vibro_cli.systems.run import Run

CASES = Path(__file__).parents[2] / "hard_cases"


def run_of(name: str, *changes: str) -> Run:
    return simulate(load_any(CASES / f"{name}.toml", list(changes)), "python")


def impacts_of(run: Run) -> Any:
    return {name: np.asarray(column) for name, column in run.collisions.items()}


def test_equal_balls_on_a_closed_line_exchange_their_speeds_from_behind_too() -> None:
    impacts = impacts_of(run_of("closed_line_from_behind"))
    # Instants by a Runge-Kutta method of order 8 (tolerance 1e-13) and bisection.
    known = [0.9872701458162764, 2.1358006275817085, 3.151574332918341, 4.324924724607165]
    assert impacts["t"][:4] == pytest.approx(known, rel=1e-12)
    on_a_line = np.isin(impacts["arc_a"], [2, 4]) & (impacts["arc_a"] == impacts["arc_b"])
    assert on_a_line.any()
    assert -1 in impacts["side"][on_a_line]
    assert impacts["admissible"].all()
    assert (impacts["approach_speed"] > 0.0).all()
    assert impacts["speed_a_post"] == pytest.approx(impacts["speed_b_pre"], rel=1e-14)
    assert impacts["speed_b_post"] == pytest.approx(impacts["speed_a_pre"], rel=1e-14)


@pytest.mark.parametrize(
    ("name", "known"),
    [
        ("level_lines_open", [0.4186247574320898]),
        ("level_lines_of_a_stadium", [0.4805708901073129, 1.4910079921673036, 2.50144224255107]),
        ("level_lines_752", [0.8440151256765851, 3.6761795771219576]),
        ("level_lines_1178", [0.24720053270386597, 0.7071016894442288, 1.0446088802322204]),
    ],
)
def test_bodies_on_level_lines_meet_when_they_should(name: str, known: list[float]) -> None:
    # Instants by a Runge-Kutta method of order 8 (tolerance 1e-13) and bisection.
    assert impacts_of(run_of(name))["t"][: len(known)] == pytest.approx(known, rel=1e-12)


def test_a_body_creeps_along_a_level_line_at_the_speed_that_its_walls_leave() -> None:
    """Each wall takes all but 2^-10 of the speed, a power of two, which is kept to the next."""
    scenario = {
        "gravity": 9.81,
        "trace": {"start_slope": 0.0, "arcs": [{"shape": "line", "length": 2.0}] * 3},
        "balls": [{"radius": 0.1, "mass": 1.0, "arc": 1, "position": 0.1, "speed": 1.0}],
        "ends": {"left": {"wall": 2.0**-10}, "right": {"wall": 2.0**-10}},
        "stop": {"time": 1e60},
    }
    events = solve_any(scenario, "python").events
    walls = events["event"] == "wall"
    assert walls.sum() == 20
    speeds = [(-1.0) ** n * 2.0 ** (-10 * n) for n in range(21)]
    assert events["value"][walls].tolist() == speeds[:-1]
    assert events["speed"][walls].tolist() == speeds[1:]
    times = np.cumsum([5.8 * 2.0 ** (10 * n) for n in range(20)])
    np.testing.assert_allclose(events["t"][walls], times, rtol=1e-15)


def test_a_body_crosses_the_underside_of_a_hump_at_once() -> None:
    run = run_of("hump_upside_down")
    crossings = run.events["t"][run.events["event"] == "crossing"]
    # By a Runge-Kutta method of order 8 (tolerance 1e-13) and bisection.
    assert crossings == pytest.approx([0.3860976840466331, 0.4427527238008595], rel=1e-12)


@pytest.mark.parametrize(("first", "last"), [(-30, 200), (-100, 240), (10, 300), (170, 350)])
@pytest.mark.parametrize("mirror", [1, -1])
def test_a_hump_is_crossed_in_the_time_that_its_quadrature_gives(
    first: int, last: int, mirror: int
) -> None:
    """From any slope beyond 180 degrees to any other: t = integral of (R + r) d psi/v(psi)."""
    hump, line = (0.6, 0.1), 0.05
    ends = [math.radians(-mirror * end) for end in (first, last)[::mirror]]
    arcs = [
        {"shape": "line", "length": line},
        {"shape": "hump", "radius": hump[0], "end_slope": ends[1]},
        {"shape": "line", "length": line},
    ]
    ball = {"radius": hump[1], "mass": 1.0, "arc": 2 - mirror, "position": 0.5 * line}
    document = scene(
        {"start_slope": ends[0], "arcs": arcs}, [ball | {"speed": 9.0 * mirror}], time=3.0
    )
    run = solve_any(document, "python")
    at = run.events["event"] == "crossing"
    entered, left = run.events["t"][at]
    v = float(run.events["speed"][at][0])
    start = math.radians(first)

    def slowness(psi: float) -> float:
        gain = 2.0 * 9.81 / 1.4 * sum(hump) * (math.cos(start) - math.cos(psi))
        return sum(hump) / math.sqrt(v * v + gain)

    expected, _ = quad(slowness, start, math.radians(last), epsabs=1e-14, epsrel=1e-13)
    assert left - entered == pytest.approx(expected, rel=1e-12)


def test_no_one_sided_trace_holds_a_body_from_above() -> None:
    run = run_of("one_sided_overhanging_line")
    assert run.end_cause == "lift_off"
    # It rolls up to the line, 100 degrees steep, in this time (Runge-Kutta of order 8).
    assert run.summary_record()["end_time"] == pytest.approx(0.1709583559689896, rel=1e-12)
    assert run.events["event"].tolist() == ["crossing", "lift_off"]


def test_an_inner_body_need_not_fit_before_the_wall() -> None:
    impacts = impacts_of(run_of("wall_too_short_for_an_inner_body"))
    # By a Runge-Kutta method of order 8 (tolerance 1e-13) and bisection.
    known = [0.7348855141158622, 0.7648774823647003, 0.776420867586427, 0.8485987152951007]
    assert impacts["t"][:4] == pytest.approx(known, rel=1e-12)


def sampled_forces(run: Run) -> tuple[float, float]:
    """Least normal force and greatest demand of friction of bodies alone, from samples.

    ``N = m g cos(alpha) + m Omega^2 (x - x0) sin(alpha) + m v^2/rho`` on arcs.
    """
    system = run.system
    rate, axis = (system.turning.rate, system.turning.x) if system.turning else (0.0, 0.0)
    least, demand = np.inf, 0.0
    end = run.summary_record()["end_time"]
    motions = [run.sample(np.linspace(0.0, end, 20001)), run.sample([end], "before")]
    for ball, body in enumerate(system.bodies):
        for motion in motions:
            own = {name: column[motion["ball"] == ball + 1] for name, column in motion.items()}
            pieces = [system.trace.pieces[number - 1] for number in own["arc"].tolist()]
            sign = np.array([piece.sign for piece in pieces])
            rho = np.array([piece.path_radius(body.radius) for piece in pieces])
            slope = sign * own["angle"]
            away = rate * rate * (own["x"] - axis)
            normal = system.gravity * np.cos(slope) + away * np.sin(slope)
            normal += sign * own["speed"] ** 2 / rho
            pull = system.gravity * np.sin(slope) - away * np.cos(slope)
            least = min(least, float(body.mass * normal.min()))
            demand = max(demand, float((abs(pull) * (1.0 - 1.0 / body.kappa) / normal).max()))
    return least, demand


@pytest.mark.parametrize(
    "name",
    [
        "rest_on_a_hump_at_a_wall",
        "turning_last_flight_at_the_bottom",
        "turning_last_flights",
        "turning_whole_turns",
    ],
)
def test_the_summary_has_the_forces_of_the_motion_and_no_others(name: str) -> None:
    run = run_of(name)
    summary = run.summary_record()
    least, demand = sampled_forces(run)
    assert summary["min_normal_force"] == pytest.approx(least, rel=1e-3)
    assert summary["max_friction_demand"] == pytest.approx(demand, rel=1e-3)


def test_a_group_from_rest_needs_most_at_its_far_turning_point() -> None:
    summary = run_of("group_from_rest").summary_record()
    # By a Taylor method of 40 digits.
    assert summary["min_normal_force"] == pytest.approx(0.91468, abs=5e-6)
    assert summary["max_friction_demand"] == pytest.approx(0.52883, abs=5e-6)


def test_round_a_turning_circle_a_body_passes_the_seam_at_every_turn() -> None:
    run = run_of("turning_whole_turns")
    system = run.system
    rho, rate = system.trace.pieces[0].path_radius(0.1), 1.2
    centre = system.trace.pieces[0].centre[0] - 0.3

    def motion(_: float, state: Any) -> list[float]:
        angle, speed = state
        away = rate * rate * (centre + rho * math.sin(angle))
        pull = -system.gravity * math.sin(angle) + away * math.cos(angle)
        return [speed, pull / (system.bodies[0].kappa * rho)]

    start = [-3.0, -3.8 / rho]
    known = solve_ivp(motion, (0.0, 3.4), start, method="DOP853", rtol=1e-13, atol=1e-14)
    turns = int(-(known.y[0, -1] - math.pi) // (2.0 * math.pi))
    assert run.events["event"].tolist() == ["crossing"] * turns
    end = run.sample([3.4])
    difference = float(end["angle"][0]) - known.y[0, -1]
    assert math.remainder(difference, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-11)


def test_the_times_of_impacts_tell_of_the_one_that_ended_the_run_too() -> None:
    run = run_of("../../scenarios/unequal_hedrih", "collision.inadmissible=stop")
    impacts, summary = impacts_of(run), run.summary_record()
    assert run.end_cause == "inadmissible"
    assert summary["collisions"] == len(impacts["t"])
    assert summary["first_collision_time"] == impacts["t"][0]
    assert summary["last_collision_time"] == impacts["t"][-1]
    assert summary["max_gap"] == np.abs(impacts["gap"]).max()


def test_a_passage_of_a_rotation_is_one_event() -> None:
    # Where two half angles stand for one place, the lift-off was told twice.
    events = run_of("contact_on_a_turning_line").events
    lifts = events["t"][events["event"] == "lift_off"]
    assert len(lifts) > 0
    assert len(set(lifts.tolist())) == len(lifts)


def test_a_contact_outlasts_the_opening_of_the_one_beside_it() -> None:
    run = run_of("opened_with_a_speed_of_rounding")
    opened = run.events["t"][run.events["event"] == "contact_opened"]
    # By the oracle of 40 digits.
    assert opened == pytest.approx([0.35641071639856453, 0.374530161009445], abs=1e-12)
    assert len(run.collisions["t"]) == 0


def test_a_group_over_the_end_of_a_level_line_takes_few_flights() -> None:
    run = run_of("turning_group_on_a_level_line")
    # It took millions, 1e-17 s each, from t = 3.5714 on.
    assert len(run.flights()["t_start"]) < 1000


def test_the_row_that_stands_for_the_rest_of_a_sequence_is_marked() -> None:
    impacts = impacts_of(run_of("limit_of_a_sequence_at_a_wall"))
    at_rest = (impacts["separation_speed"] == 0.0) & (impacts["speed_a_post"] == 0.0)
    assert at_rest.sum() == 1
    assert impacts["simultaneous"][at_rest].all()
