"""The search for the first contact: passing touches, decided by the sign of the smallest gap."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.bare_system import bare_system
from tests.highprecision.reference_solver import ArcMotion, ReferenceSolver
from tests.kernels.kernel_records import ball, flight_on_arc, three_arcs
from vibro_cli.assemble import build_any
from vibro_cli.kernels.contact.arc_contact import _released_step, inverted, is_last
from vibro_cli.kernels.contact.first_contact import FINAL_CORRECTION
from vibro_cli.kernels.flow.flight import snap_of_pendulum
from vibro_cli.mechanics.system import Body, InitialState, TraceSystem
from vibro_cli.scenario.loading import load_any
from vibro_cli.stress.oracles.oracle import first_contact
from vibro_cli.stress.oracles.scene import Real, mp, scene_of_system
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system

BODIES = (ball(0.1), Body("hoop", 0.08, 1.0, 1.0))
TRACE = three_arcs()
BEFORE = 0.25  # time from the start to the closest approach, s
OVERLAPS = [10.0**-n for n in range(3, 14)]

# (piece of a, place of a, piece of b, speed of a at the closest approach); b is beside a, to the
# right and uphill. It rolls off more slowly, so that the gap there has its smallest value.
TOUCHES = {
    "valley, rising": (0, 0.5, 0, 1.0),
    "valley, falling": (0, 0.5, 0, -0.6),
    "right valley": (2, 0.8, 2, -0.6),
    "hump": (1, -0.5, 1, 0.4),
    "valley and hump": (0, 0.85, 1, -0.1),
}


def system_of(starts: tuple[InitialState, ...]) -> TraceSystem:
    return bare_system(TRACE, BODIES, starts, restitution=(0.8,))


def gap_rates(twin: ReferenceSolver, t: Real) -> tuple[Real, Real]:
    """Return the distance of the surfaces and its rate."""
    a, b = twin.at(0, t), twin.at(1, t)
    dx, dy = b.centre[0] - a.centre[0], b.centre[1] - a.centre[1]
    distance = mp.hypot(dx, dy)
    vx = b.speed * b.tangent[0] - a.speed * a.tangent[0]
    vy = b.speed * b.tangent[1] - a.speed * a.tangent[1]
    reach = mp.mpf(BODIES[0].radius) + mp.mpf(BODIES[1].radius)
    return distance - reach, (dx * vx + dy * vy) / distance


def beside(name: str, gap: float) -> TraceSystem:
    """A state of closest approach: the surfaces a gap apart, at equal speeds along their line."""
    piece_a, place_a, piece_b, speed = TOUCHES[name]
    a = InitialState(piece_a, place_a, speed)
    shape = TRACE.pieces[piece_b]
    low = place_a if piece_a == piece_b else shape.angle_start
    place = low + (0.15 if piece_a == piece_b else 0.05)
    speed_b = speed
    for _ in range(60):
        before = place, speed_b
        system = system_of((a, InitialState(piece_b, place, speed_b)))
        twin = ReferenceSolver(scene_of_system(system))
        now, rate = gap_rates(twin, mp.zero)
        rest = system_of((replace(a, speed=0.0), InitialState(piece_b, place, 1.0)))
        along = gap_rates(ReferenceSolver(scene_of_system(rest)), mp.zero)[1]
        place -= float((now - gap) / (along * shape.path_radius(BODIES[1].radius)))
        speed_b -= float(rate / along)
        if (place, speed_b) == before:
            break
    return system_of((a, InitialState(piece_b, place, speed_b)))


def earlier(system: TraceSystem) -> TraceSystem:
    """Return the state ``BEFORE`` earlier: the motion with reversed speeds, over no junction."""
    turned = tuple(replace(state, speed=-state.speed) for state in system.initial)
    twin = ReferenceSolver(scene_of_system(replace(system, initial=turned)))
    states = []
    for number, start in enumerate(system.initial):
        now = twin.at(number, mp.mpf(BEFORE))
        shape = TRACE.pieces[now.piece]
        assert shape.angle_start < now.place < shape.angle_end
        states.append(InitialState(start.piece, float(now.place), -float(now.speed)))
    return replace(system, initial=tuple(states))


def closest(system: TraceSystem) -> tuple[Real, Real]:
    """Return instant and size of the smallest gap near the closest approach, in high precision."""
    twin = ReferenceSolver(scene_of_system(system))
    low, high = mp.mpf(BEFORE) - mp.mpf("0.05"), mp.mpf(BEFORE) + mp.mpf("0.05")
    assert gap_rates(twin, low)[1] < 0 < gap_rates(twin, high)[1]
    t = mp.findroot(lambda t: gap_rates(twin, t)[1], (low, high), solver="anderson", tol=1e-60)
    return t, gap_rates(twin, t)[0]


def meets(system: TraceSystem) -> Run:
    return simulate_system(system, BEFORE + 0.04, 1, "python")


@pytest.mark.parametrize("overlap", OVERLAPS)
@pytest.mark.parametrize("name", TOUCHES)
def test_a_passing_touch_is_found(name: str, overlap: float) -> None:
    system = earlier(beside(name, -overlap))
    instant, smallest = closest(system)
    assert smallest < 0
    run = meets(system)
    if abs(smallest) > 2e-15:
        assert len(run.collisions["n"]) == 1
    if len(run.collisions["n"]):
        t = float(run.collisions["t"][0])
        assert t < instant + 1e-7
        gap, _ = gap_rates(ReferenceSolver(scene_of_system(system)), mp.mpf(t))
        assert abs(gap) < 8 * 2.0**-52


@pytest.mark.parametrize("clearance", OVERLAPS)
@pytest.mark.parametrize("name", TOUCHES)
def test_a_near_miss_is_none(name: str, clearance: float) -> None:
    system = earlier(beside(name, clearance))
    _, smallest = closest(system)
    assert smallest > 0
    run = meets(system)
    if smallest > 2e-15:
        assert len(run.collisions["n"]) == 0
        sample = run.sample(np.linspace(0.0, BEFORE + 0.04, 200))
        x, y = sample["x"].reshape(-1, 2), sample["y"].reshape(-1, 2)
        distance = np.hypot(x[:, 1] - x[:, 0], y[:, 1] - y[:, 0])
        reach = math.fsum(body.radius for body in BODIES)
        assert np.min(distance) > reach - 1e-15


def test_the_refinement_does_not_end_where_only_its_series_is_zero() -> None:
    path = Path(__file__).parents[1] / "hard_cases" / "refined_to_a_zero_of_the_series.toml"
    system = build_any(load_any(path))
    exact = first_contact(scene_of_system(system), mp.mpf(1))
    assert exact is not None
    for engine in ("python", "compiled"):
        run = simulate_system(system, None, 1, engine)
        assert run.collisions["t"][0] == pytest.approx(float(exact), rel=1e-15, abs=0.0)
        assert abs(run.collisions["gap"][0]) <= 1e-16


@pytest.mark.parametrize("share", [0.5, 1.0, 2.0])
def test_a_step_is_no_last_one_far_from_the_zero(share: float) -> None:
    """Without x2 the series is step (1 - step^2 x3/(6 x1)), which a long step makes zero."""
    x, x1 = 0.05 * share, -0.1
    x3 = 6.0 * x1 / (x / x1) ** 2
    change = inverted(x, x1, 0.0, x3)
    assert abs(change) <= 1e-12
    assert not is_last(x, change, x1, 0.0, 1.0, FINAL_CORRECTION)
    # Near the zero it is Newton's step, and the last one.
    near = inverted(1e-8, x1, 0.0, x3)
    assert near == pytest.approx(1e-7, rel=1e-6)
    assert is_last(1e-8, near, x1, 0.0, 1.0, FINAL_CORRECTION)


@pytest.mark.parametrize(("angle", "rate"), [(0.9, -1.0), (0.3, -4.0), (-1.2, -2.0), (2.6, 0.4)])
def test_the_step_after_a_release_ends_before_the_bodies_meet_again(
    angle: float, rate: float
) -> None:
    """Both angles have one rate and one acceleration: the gap begins with the difference of jerks.

    A jerk is -w^2 cos(phi) times the rate.
    """
    frequencies = 2.9, 3.3
    places = angle, math.asin((2.9 / 3.3) ** 2 * math.sin(angle))
    flights, states, motions, jerks = [], [], [], []
    for w, place in zip(frequencies, places, strict=True):
        s, c, p = math.sin(0.5 * place), math.cos(0.5 * place), 0.5 * rate / w
        flight = flight_on_arc(w, s, c, p)
        flight.snap_bound = snap_of_pendulum(w * w, flight.parameter)
        flights.append(flight)
        states.append((s, c, p))
        half = mp.mpf(place) / 2
        motions.append(ArcMotion(mp.mpf(w), (mp.sin(half), mp.cos(half), mp.mpf(rate) / (2 * w))))
        jerks.append(-w * w * math.cos(place) * rate)
    left, right = states
    step = _released_step(flights[0], flights[1], (0.0, 0.0), (*left, *right))
    jerk = jerks[1] - jerks[0]
    if jerk <= 0.0:
        assert 0.0 < step < 1e-9
        return
    assert step == pytest.approx(3.0 * jerk / sum(one.snap_bound for one in flights), rel=1e-12)
    for share in (0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0):
        ends = [motion.at(mp.mpf(share * step)) for motion in motions]
        turns = [2 * mp.atan2(s, c) - place for (s, c, _), place in zip(ends, places, strict=True)]
        assert turns[1] > turns[0]
