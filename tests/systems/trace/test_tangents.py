"""Tangent maps against differences of neighbouring motions in 50 digits, and what they conserve."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.highprecision.reference_solver import (
    ArcMotion,
    ReferenceSolver,
    SolverEvent,
    events_of,
)
from tests.systems.tangent_cases import follow_system, solved_and_streamed
from vibro_cli import example
from vibro_cli.assemble import build_system
from vibro_cli.kernels.flow.flight import root_of_state
from vibro_cli.kernels.flow.rotating_flow import TURNING_LINE, set_motion
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.numerics.elliptic import ThetaConstants, set_theta_constants
from vibro_cli.kernels.tangent.flight_jacobian import pendulum_jacobian
from vibro_cli.kernels.tangent.frame import SERIES_ROWS, TERMS
from vibro_cli.kernels.tangent.rotating_jacobian import flight_jacobian
from vibro_cli.kernels.world import Flight
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.scenario import scenario_of
from vibro_cli.storage.folders import write_run
from vibro_cli.stress.oracles.scene import mp, scene_of_system
from vibro_cli.stress.oracles.sensitivity import differences
from vibro_cli.stress.scenes import CIRCLE, THREE_ARCS, VALLEY, ball, scene, system_of
from vibro_cli.systems import driver
from vibro_cli.systems.request import Limits, OutputRequest
from vibro_cli.systems.run import begun
from vibro_cli.systems.tangents import TangentMap, followed
from vibro_cli.systems.trace import SYSTEM, simulate_system
from vibro_cli.systems.trace.system import time_scale

pytestmark = pytest.mark.long

MARK = 1.0e-10
WALLED = {
    "start_slope": "-100 deg",
    "arcs": [
        {"shape": "valley", "radius": 0.8, "end_slope": "10 deg"},
        {"shape": "line", "length": 0.7},
        {"shape": "hump", "radius": 0.9, "end_slope": "-5 deg"},
        {"shape": "valley", "radius": 1.0, "end_slope": "80 deg"},
    ],
}
WALLS = {"left": {"wall": 0.95}, "right": {"wall": 1.0}}


def _unequal(law: str, k: float) -> dict[str, Any]:
    """Two unequal bodies that cross junctions, hit walls, and meet on two pieces."""
    balls = [
        ball(-0.9, radius=0.12, mass=0.7, speed=4.2),
        ball(0.3, arc=4, radius=0.07, mass=1.9, body="hoop", speed=-1.5),
    ]
    document = scene(WALLED, balls, k, law, collisions=2) | {"ends": WALLS}
    document["collision"]["inadmissible"] = "normal-impulse"
    return document


def _turning(document: dict[str, Any], **axis: float) -> dict[str, Any]:
    """Return the same on a rotating trace."""
    return document | {"trace": document["trace"] | {"turning": axis}}


def _three(k: float) -> dict[str, Any]:
    balls = [ball(-0.8, speed=0.4), ball(0.1, mass=2.0, radius=0.08), ball(0.9, body="disk")]
    return scene(VALLEY, balls, k, "normal-impulse", collisions=3)


SCENES = {
    "circle": scene(CIRCLE, [ball(-0.7), ball(0.4, mass=3.0, speed=1.0)], 0.9, collisions=3),
    "rotation": scene(CIRCLE, [ball(0.0, speed=8.0), ball(2.0, speed=-1.0)], 1.0, collisions=3),
    "valley of three": _three(0.8),
    "arcs": scene(
        THREE_ARCS, [ball(-1.3), ball(0.9, arc=3, mass=0.4, radius=0.07)], 1.0, collisions=2
    ),
    "hedrih": _unequal("hedrih", 0.9),
    "normal-impulse": _unequal("normal-impulse", 0.7),
    "translational": _unequal("translational", 1.0),
}
SCENES |= {
    "turning circle": _turning(SCENES["circle"], through_arc=1, rate=2.5),
    "turning rotation": _turning(SCENES["rotation"], x=0.4, rate=6.0),
    "turning valley of three": _turning(SCENES["valley of three"], x=0.3, rate=1.5),
    "turning hedrih": _turning(SCENES["hedrih"], x=1.3, rate=1.1),
    "turning normal-impulse": _turning(SCENES["normal-impulse"], x=1.3, rate=1.1),
    "turning translational": _turning(SCENES["translational"], x=1.3, rate=1.1),
}


def _judge(document: dict[str, Any]) -> tuple[float, float]:
    """Largest errors, relative to the largest elements, of the map and of the impacts' times."""
    system, count = system_of(document), document["stop"]["collisions"]
    found = follow_system(system, None, count)
    matrix, times = differences(simulate_system(system, None, count))
    return (
        float(np.max(np.abs(found.matrix - matrix)) / np.max(np.abs(matrix))),
        float(np.max(np.abs(found.times - times)) / np.max(np.abs(times))),
    )


@pytest.mark.parametrize("name", SCENES)
def test_the_map_is_that_of_neighbouring_motions_in_50_digits(name: str) -> None:
    errors = _judge(SCENES[name])
    assert max(errors) < MARK, errors


@pytest.mark.parametrize("name", SCENES)
def test_both_engines_give_the_same_bits(name: str) -> None:
    system, count = system_of(SCENES[name]), SCENES[name]["stop"]["collisions"]
    one, other = (follow_system(system, None, count, engine) for engine in driver.ENGINES)
    for field in ("matrix", "amplification", "smooth", "times", "sums"):
        np.testing.assert_array_equal(getattr(one, field), getattr(other, field))


def _exact_flow(s: Any, c: Any, p: Any, u: Any) -> tuple[Any, Any, Any]:
    """State of a pendulum from mpmath's elliptic functions, by the addition theorems."""
    mp = mpmath.mp
    m = s * s + p * p
    if m <= 1:
        sn, cn, dn = (mp.ellipfun(name, u, m=m) for name in ("sn", "cn", "dn"))
    else:
        root = mp.sqrt(m)
        sn = mp.ellipfun("sn", root * u, m=1 / m) / root
        cn, dn = (mp.ellipfun(name, root * u, m=1 / m) for name in ("dn", "cn"))
    common = cn * cn + (sn * c) ** 2
    return (
        (s * cn * dn + p * c * sn) / common,
        (c * dn - s * p * sn * cn) / common,
        (p * cn - s * c * sn * dn) / common,
    )


def _exact_jacobian(s: float, c: float, p: float, u: float) -> list[Any]:
    """Derivative of angle and rate by central differences in 60 digits."""
    mp = mpmath.mp
    big = [mp.mpf(one) for one in (s, c, p, u)]
    h = mp.mpf(10) ** -20 * min(1, abs(big[1]) + abs(big[2]))
    base = _exact_flow(*big)
    half = mp.atan2(big[0], big[1])
    columns = []
    for rate in (0, 1):
        ends = []
        for change in (h, -h):
            angle = half + change / 2 * (1 - rate)
            state = _exact_flow(mp.sin(angle), mp.cos(angle), big[2] + change / 2 * rate, big[3])
            turned = mp.atan2(
                state[0] * base[1] - state[1] * base[0], state[1] * base[1] + state[0] * base[0]
            )
            ends.append((2 * turned, 2 * state[2]))
        columns.append([(a - b) / (2 * h) for a, b in zip(*ends, strict=True)])
    return [columns[0][0], columns[1][0], columns[0][1], columns[1][1]]


@pytest.mark.parametrize(
    ("angle", "rate", "u"),
    [
        *(
            (0.3, 0.2, 5.0),
            (2.5, -0.4, 9.0),
            (1.0e-7, 2.0e-7, 3.0),
            (-1.0, 0.0, 60.0),
        ),  # librations
        *((1.0, 1.3, 4.0), (-2.9, -2.0, 3.0), (0.1, 1.0, 3.0), (3.0, 0.0708, 2.0)),  # over the top
        *((3.1, 0.02, 9.0), (math.pi - 1.0e-9, 0.0, 30.0), (3.1415926, 1.0e-8, 25.0)),  # crest
    ],
)
def test_a_flight_is_differentiated_to_rounding(angle: float, rate: float, u: float) -> None:
    with mpmath.workdps(60):
        c = math.cos(0.5 * angle)
        s = math.copysign(math.sqrt((1.0 - c) * (1.0 + c)), angle)
        if abs(s) < 0.5:
            s = math.sin(0.5 * angle)
            c = math.sqrt((1.0 - s) * (1.0 + s))
        theta = ThetaConstants()
        set_theta_constants(theta, s * s + rate * rate, root_of_state(c, rate))
        found = pendulum_jacobian(theta, s, c, rate, u)
        expected = _exact_jacobian(s, c, rate, u)
        size = float(max(abs(one) for one in expected))
        error = max(abs(float(a - b)) for a, b in zip(found, expected, strict=True))
    # A unit in the last place of a state moves the argument of a long flight.
    assert error < 40.0 * 2.0**-52 * size * (1.0 + u)


def _exact_turning_jacobian(flight: Flight, t: float) -> list[Any]:
    """Derivative of angle and rate by central differences of the oracle's series."""
    h = mp.mpf(10) ** -18
    w = mp.mpf(flight.frequency)
    pull = (mp.mpf(flight.tilt), mp.mpf(flight.spread))

    def end(angle: Any, rate: Any) -> list[Any]:
        half = mp.atan2(mp.mpf(flight.flow_s), mp.mpf(flight.flow_c)) + angle / 2
        p = mp.mpf(flight.flow_p) + rate / (2 * w)
        s, c, p = ArcMotion(w, (mp.sin(half), mp.cos(half), p), pull).at(mp.mpf(t))
        return [2 * mp.atan2(s, c), 2 * w * p]

    found = []
    for change in ((h, 0), (0, h)):
        ahead, back = end(*change), end(*(-one for one in change))
        turn = [a - b for a, b in zip(ahead, back, strict=True)]
        turn[0] -= 4 * mp.pi * mp.nint(turn[0] / (4 * mp.pi))
        found.append([one / (2 * h) for one in turn])
    return [found[0][0], found[1][0], found[0][1], found[1][1]]


@pytest.mark.parametrize(
    ("angle", "rate", "tilt", "spread", "u"),
    [
        *((0.3, 0.2, 0.0, 0.57, 5.0), (0.3, 0.1, 0.4, 3.0, 20.0), (1.0, 3.0, -0.7, 1.5, 4.0)),
        *((1.0e-6, 0.0, 0.0, 2.0, 9.0), (1.2661, 0.0, 0.3, 0.0, 3.0), (3.0, 0.01, 0.0, 8.0, 2.0)),
        *((0.0, 0.0, 0.0, 0.5, 4.0), (0.0, 0.0, 0.0, 3.0, 6.0), (0.0, 1.0e-9, 0.0, 3.0, 9.0)),
        *((3.1, -6.0, 0.2, 1.0, 5.0), (0.5, 0.7, 0.2, 0.6, 300.0)),
        # Parts that prove too long are halved.
        *((1.83733, 1.11675, 0.0, 0.0, 1.70061), (0.85636, 20.54769, 0.0, 118.70839, 0.05565)),
    ],
)
def test_a_flight_on_a_turning_arc_is_differentiated_to_rounding(
    angle: float, rate: float, tilt: float, spread: float, u: float
) -> None:
    flight = Flight()
    flight.saddle_root = NEVER
    flight.frequency, flight.tilt, flight.spread = 1.7, tilt, spread
    flight.flow_s, flight.flow_c, flight.flow_p = math.sin(angle / 2), math.cos(angle / 2), rate
    flight.turns_over = 1 if abs(rate) > 2.0 else 0
    set_motion(flight)
    flight.at_rest = 1 if rate == 0.0 and flight.quartic_3 == 0.0 else 0
    found = flight_jacobian(flight, u / 1.7, np.zeros((SERIES_ROWS, TERMS + 1)))
    expected = _exact_turning_jacobian(flight, u / 1.7)
    size = float(max(abs(one) for one in expected))
    error = max(abs(float(a - b)) for a, b in zip(found, expected, strict=True))
    # The same, and the closed form that tells the states on the way has roundings of its own.
    assert error < 100.0 * 2.0**-52 * size * (1.0 + u)


def test_a_flight_on_a_turning_line_is_differentiated_to_rounding() -> None:
    flight = Flight()
    flight.form, flight.line_growth = TURNING_LINE, 0.7
    found = flight_jacobian(flight, 2.0, np.zeros((SERIES_ROWS, TERMS + 1)))
    sine, cosine = math.sinh(1.4), math.cosh(1.4)
    assert found == pytest.approx((cosine, sine / 0.7, 0.7 * sine, cosine), rel=1e-15)
    flight.line_growth = 0.0  # upright
    assert flight_jacobian(flight, 2.0, np.zeros((SERIES_ROWS, TERMS + 1))) == (1.0, 2.0, 0.0, 1.0)


@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize("k", [1.0, 0.999, 0.9])
def test_volumes_shrink_by_the_square_of_the_restitution_at_each_impact(
    k: float, turns: bool
) -> None:
    document = SCENES["turning normal-impulse" if turns else "normal-impulse"]
    system = system_of(document | {"collision": {"law": "normal-impulse", "k": k}})
    assert system.left_end is not None
    walls = replace(system, left_end=replace(system.left_end, restitution=1.0))
    found = follow_system(walls, 30.0, 40)
    impacts = len(found.smooth)
    assert impacts > 8
    assert np.sum(found.sums) == pytest.approx(2.0 * impacts * math.log(k), abs=1e-11)
    if k == 1.0:
        # Symplectic: in pairs that cancel, up to what the frame still remembers of its start.
        long = follow_system(walls, None, 3000)
        exponents, _ = long.growth.exponents(per_impact=True)
        assert exponents[0] > 0.05
        np.testing.assert_allclose(exponents[:2], -exponents[:1:-1], atol=0.002)


@pytest.mark.parametrize("name", ["rotation", "valley of three", "normal-impulse"])
@pytest.mark.parametrize("turning", [{}, {"x": 0.3, "rate": 1.1}])
def test_the_map_of_elastic_motion_is_symplectic(name: str, turning: dict[str, float]) -> None:
    """In q and κ m v of each body, through junctions, walls, and impacts on two pieces."""
    document = SCENES[name] | {"collision": {"law": "normal-impulse", "k": 1.0}}
    document |= {"ends": {end: {"wall": 1.0} for end in WALLS}} if "ends" in document else {}
    system = system_of(_turning(document, **turning) if turning else document)
    matrix = follow_system(system, None, 4).matrix
    weights = np.diag([body.rolling_mass for body in system.bodies])
    form = np.kron(weights, [[0.0, 1.0], [-1.0, 0.0]])
    kept = matrix.T @ form @ matrix - form
    assert np.max(np.abs(kept)) < 1e-13 * np.max(weights) * np.max(np.abs(matrix)) ** 2
    values = np.linalg.eigvals(matrix)
    for value in values:  # in pairs of μ and 1/μ
        assert np.min(np.abs(values * value - 1.0)) < 1e-6


@pytest.mark.parametrize("rate", [0.0, 1.5])
def test_at_rest_on_a_crest_exponents_are_those_of_a_saddle(rate: float) -> None:
    """Vectors grow so much in the one flight that without care all become parallel to rounding."""
    hump = {"shape": "hump", "radius": 0.5, "end_slope": -0.6}
    trace: dict[str, Any] = {"start_slope": 0.6, "arcs": [hump]}
    if rate > 0.0:
        trace["turning"] = {"through_arc": 1, "rate": rate}
    system = system_of(scene(trace, [ball(0.0, arc=1)], time=20.0))
    found = follow_system(system, 20.0, None)
    radius = 0.5 + system.bodies[0].radius
    growth = math.sqrt((system.gravity / radius + rate * rate) / system.bodies[0].kappa)
    tau = float(time_scale(system))
    sine, cosine = math.sinh(20.0 * growth), math.cosh(20.0 * growth)
    exact = np.array([[cosine, sine / growth], [growth * sine, cosine]])
    np.testing.assert_allclose(found.matrix, exact, rtol=1e-12)
    first = math.log(math.hypot(cosine, tau * growth * sine))
    assert found.sums == pytest.approx([first, -first], abs=1e-11)


def test_volumes_shrink_by_impacts_alone_where_a_body_lingers_at_a_crest() -> None:
    arcs = [
        {"shape": "valley", "radius": 1.0, "end_slope": 0.8},
        {"shape": "hump", "radius": 0.5, "end_slope": -0.8},
        {"shape": "valley", "radius": 1.0, "end_slope": 1.2},
    ]
    balls = [ball(0.2, arc=1), ball(-1e-14, arc=2)]
    system = system_of(scene({"start_slope": -1.2, "arcs": arcs}, balls, 0.9, time=16.0))
    found = follow_system(system, 16.0, None)
    impacts = len(found.smooth)
    assert impacts > 5
    assert np.sum(found.sums) == pytest.approx(2.0 * impacts * math.log(0.9), abs=1e-9)


def test_a_run_in_several_stretches_is_one_run(monkeypatch: pytest.MonkeyPatch) -> None:
    system = system_of(SCENES["translational"])
    whole = follow_system(system, None, 60)
    for rows in ("FIRST_ROWS", "COMPILED_ROWS"):
        monkeypatch.setattr(driver, rows, 32)
    monkeypatch.setattr("vibro_cli.systems.run.LEAST_ROWS", 16)
    parts = TangentMap(SYSTEM, system, times=True)
    stretches = begun(SYSTEM, system, Limits(None, 60)).until(lambda: False)
    found = [parts.take(stretch)["collisions"] for stretch in stretches]
    assert len(found) > 2
    joined = {name: np.concatenate([one[name] for one in found]) for name in found[0]}
    joined |= {"matrix": parts.matrix(), "sums": parts.sums}
    for field in ("matrix", "amplification", "smooth", "times", "sums"):
        np.testing.assert_array_equal(getattr(whole, field), joined[field])


def _between_walls() -> dict[str, Any]:
    """Two bodies on a level line, all of whose changes shrink at each impact on a wall."""
    line = {"start_slope": 0.0, "arcs": [{"shape": "line", "length": 3.0}]}
    starts = (0.9, 2.0, 1.0), (1.9, -1.5, 0.4)
    balls = [
        {"radius": 0.1, "mass": mass, "arc": 1, "position": x, "speed": speed}
        for x, speed, mass in starts
    ]
    walls = {"left": {"wall": 0.1}, "right": {"wall": 0.1}}
    return scene(line, balls, 0.5, "normal-impulse", collisions=12) | {"ends": walls}


@pytest.mark.parametrize("grows", [True, False])
def test_powers_of_two_taken_out_of_the_product_change_no_bit(
    grows: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With 2^4 instead of 2^400 they are taken out after a few impacts, and put back."""
    document = SCENES["translational"] if grows else _between_walls()
    system, count = system_of(document), 40 if grows else 12
    whole = follow_system(system, None, count, "python")
    size = whole.amplification[-1]
    assert size > 2.0**20 if grows else size < 2.0**-8
    for module in ("kernels.tangent.frame", "systems.tangents"):
        monkeypatch.setattr(f"vibro_cli.{module}.SCALE", 2.0**4)
    parts = follow_system(system, None, count, "python")
    for field in ("matrix", "amplification", "times"):
        np.testing.assert_array_equal(getattr(parts, field), getattr(whole, field))


def _by_neighbours(system: TraceSystem, end: float, change: float) -> Any:
    """The map by differences of the solver's own runs, in doubles."""

    def state(component: int, by: float) -> list[float]:
        number, part = divmod(component, 2)
        initial = list(system.initial)
        one = initial[number]
        piece = system.trace.pieces[one.piece]
        per_way = 1.0 if piece.is_line else 1.0 / piece.path_radius(system.bodies[number].radius)
        if part == 0:
            initial[number] = replace(one, position=one.position + by * per_way)
        else:
            initial[number] = replace(one, speed=one.speed + by)
        run = simulate_system(replace(system, initial=tuple(initial)), end, None)
        sample, found = run.sample([end]), []
        for body in range(len(system.bodies)):
            on = system.trace.pieces[int(sample["arc"][body]) - 1]
            place = float(sample["angle"][body]) * (
                1.0 if on.is_line else on.path_radius(system.bodies[body].radius)
            )
            found += [place, float(sample["speed"][body])]
        return found

    size = 2 * len(system.bodies)
    columns = [
        (np.array(state(n, change)) - np.array(state(n, -change))) / (2.0 * change)
        for n in range(size)
    ]
    return np.array(columns).T


@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize("k", [0.0, 0.3])
def test_lasting_contact_takes_two_directions(k: float, turns: bool) -> None:
    balls = [ball(-0.5, mass=2.0), ball(0.3, radius=0.06, body="hoop")]
    document = scene(VALLEY, balls, k, "normal-impulse", time=2.0)
    system = system_of(_turning(document, x=1.0, rate=1.5) if turns else document)
    run = simulate_system(system, 2.0, None)
    assert "contact_closed" in run.events["event"]
    found = follow_system(system, 2.0, None)
    values = np.linalg.svd(found.matrix, compute_uv=False)
    assert values[1] > 0.1
    assert values[2] < 1e-12
    assert not found.smooth[-1]
    assert np.all(np.isneginf(found.sums[2:]))
    assert np.all(np.isneginf(found.growth.exponents()[0][2:]))
    np.testing.assert_allclose(found.matrix, _by_neighbours(system, 2.0, 1e-6), atol=1e-8)


def test_a_wall_without_a_bounce_takes_one_direction() -> None:
    """A ball rolls up to it, stops there, and rolls down: only when it starts can change."""
    slope, up, end = -0.3, -2.2, 1.5
    line = {"start_slope": slope, "arcs": [{"shape": "line", "length": 3.0}]}
    body = {"radius": 0.1, "mass": 1.0, "arc": 1, "position": 0.5, "speed": up}
    system = system_of(scene(line, [body], time=end) | {"ends": {"left": {"wall": 0.0}}})
    pull = system.gravity / 1.4 * math.sin(-slope)
    speed = -math.sqrt(up * up - 2.0 * pull * 0.4)
    t = (speed - up) / pull
    later = -np.array([1.0, t]) / speed
    exact = np.outer([-pull * (end - t), -pull], later)
    found = follow_system(system, end, None)
    np.testing.assert_allclose(found.matrix, exact, rtol=1e-13)
    tau = float(time_scale(system))
    growth = math.hypot(pull * (end - t), tau * pull) / -speed
    assert found.sums[0] == pytest.approx(math.log(growth), abs=1e-13)
    assert found.sums[1] == -math.inf


@pytest.mark.parametrize("k", [0.0, 0.3])
@pytest.mark.parametrize("third", [False, True])
def test_contact_of_unequal_kinds_closes_by_the_mass_that_translational_keeps(
    k: float, third: bool
) -> None:
    """Bounces keep sum m v, lasting contact sum kappa m v; a third body comes to a held pair."""
    balls = [ball(-0.9, mass=2.0), ball(0.2, body="hoop")]
    balls += [ball(0.7, mass=0.7, body="disk")] if third else []
    document = scene(VALLEY, balls, k, "translational", time=3.0)
    if third:
        document["collision"]["k"] = [k, 0.0]
    system = system_of(document)
    assert "contact_closed" in simulate_system(system, 3.0, None).events["event"]
    found = follow_system(system, 3.0, None).matrix
    np.testing.assert_allclose(found, _by_neighbours(system, 3.0, 1e-4), atol=5e-7)


@pytest.mark.parametrize("k", [0.0, 0.3])
def test_two_held_pairs_that_are_struck_at_one_instant_are_each_as_late_as_their_own_impact(
    k: float,
) -> None:
    """Two mirror images on one arc: what happens to one of them alone, and neighbouring runs."""
    left = [
        ball(-1.25, radius=0.04, body="particle"),
        ball(-0.95, radius=0.04),
        ball(-0.846, radius=0.04, mass=2.0, body="hoop"),
    ]
    right = [one | {"angle": -one["angle"]} for one in left[::-1]]
    maps, instants = [], []
    for balls, restitution in ((left, [0.8, k]), (left + right, [0.8, k, 0.9, k, 0.8])):
        document = scene(VALLEY, balls, 0.0, "normal-impulse", time=0.5)
        document["collision"]["k"] = restitution
        system = system_of(document)
        run = simulate_system(system, 0.5, None)
        assert "contact_closed" in run.events["event"]
        maps.append(follow_system(system, 0.5, None))
        instants.append(maps[-1].times[run.collisions["ball_a"] == 1])
    alone, both = maps
    np.testing.assert_allclose(both.matrix[:6, :6], alone.matrix, atol=1e-12)
    np.testing.assert_allclose(both.matrix, _by_neighbours(system, 0.5, 1e-6), atol=1e-7)
    np.testing.assert_allclose(instants[1][:, :6], instants[0], atol=1e-12)
    assert not np.any(instants[1][:, 6:])


def test_joint_impacts_are_marked() -> None:
    balls = [ball(-0.6), ball(0.0), {"radius": 0.1, "mass": 1.0, "arc": 1, "angle": 0.6}]
    found = follow_system(system_of(scene(VALLEY, balls, 1.0, collisions=2)), None, 2)
    assert not found.smooth.any()
    assert np.isfinite(found.amplification).all()


def _falling(rng: np.random.Generator) -> TraceSystem:
    """Return two particles that fall onto a floor, the heavier one below: chaotic."""
    places = (rng.uniform(0.2, 0.8), rng.uniform(1.2, 2.0))
    balls = [
        {
            "body": "particle", "radius": 0.05, "mass": float(mass), "arc": 1,
            "position": float(place), "speed": float(rng.normal(0.0, 0.5)),
        }
        for place, mass in zip(places, (rng.uniform(1.2, 5.0), 1.0), strict=True)
    ]  # fmt: skip
    slope = {"start_slope": 0.5, "arcs": [{"shape": "line", "length": 1.0e4}]}
    document = scene(slope, balls, 1.0, "translational", collisions=25)
    return system_of(document | {"ends": {"left": {"wall": 1.0}}})


def _told(run: Any) -> list[SolverEvent]:
    """Return the events of a run while three digits are left: after that neighbours have others."""
    told: list[SolverEvent] = []
    impacts = 0
    for happening in events_of(run):
        if happening.kind == "impact":
            if run.collisions["digits_left"][impacts] < 3.0:
                break
            impacts += 1
        told.append(happening)
    return told


def _true_errors(system: TraceSystem, run: Any) -> list[float]:
    """Error of both states after each impact at one time, as a share of the start's size."""
    tau = float(time_scale(system))
    found, errors = run.collisions, []
    size = math.sqrt(
        sum(one.position**2 + (tau * one.speed) ** 2 for one in system.initial)
        / (2 * len(system.initial))
    )
    pull = -system.gravity * math.sin(0.5)
    twin = ReferenceSolver(scene_of_system(system))
    for row, impact in enumerate(twin.follow(_told(run))):
        t = mpmath.mpf(float(found["t"][row])) + mpmath.mpf(float(found["t_low"][row]))
        late, total = float(t - impact.t), 0.0
        for body, place, speed in (
            ("a", impact.a, impact.after_a),
            ("b", impact.b, impact.after_b),
        ):
            way = float(mpmath.mpf(float(found[f"s_{body}"][row])) - place.place)
            rate = float(mpmath.mpf(float(found[f"speed_{body}_post"][row])) - speed)
            total += (way - float(speed) * late) ** 2 + (tau * (rate - pull * late)) ** 2
        errors.append(math.sqrt(total / 4.0) / size)
    return errors


@pytest.mark.parametrize(
    ("position", "speed", "slope", "law", "smooth"),
    [
        (4.0, 0.0, "-10 deg", "hedrih", 1),  # stops at the junction
        (4.0, 0.0, 0.0, "hedrih", 0),  # rests there
        (3.0, 1.0, 0.0, "hedrih", 1),  # is struck there
        (3.0, 1.0, 0.0, "normal-impulse", 0),
    ],
)
def test_an_impact_at_a_junction_is_smooth_unless_the_side_of_the_junction_matters(
    position: float, speed: float, slope: Any, law: str, smooth: int
) -> None:
    """As differences of motions say (``tests/analysis/test_impact_times.py``)."""
    valley = {"shape": "valley", "radius": 3.0, "end_slope": "80 deg"}
    trace = {"start_slope": slope, "arcs": [{"shape": "line", "length": 4.0}, valley]}
    balls = [
        {"radius": radius, "mass": 1.0, "arc": 1, "position": place, "speed": rate}
        for radius, place, rate in ((0.125, 1.5, 2.0), (0.5, position, speed))
    ]
    document = scene(trace, balls, 0.9, law, collisions=1)
    document["collision"]["inadmissible"] = "normal-impulse"
    assert follow_system(system_of(document), None, 1).smooth.tolist() == [smooth]


def test_digits_left_are_those_that_agree_with_50_digits() -> None:
    rng = np.random.default_rng(11)
    ratios, last, fewest, lucky = [], [], 16.0, 0
    for _ in range(100):
        system = _falling(rng)
        run = simulate_system(system, None, 25, wanted=OutputRequest(lyapunov=True))
        left = run.collisions["digits_left"]
        errors = np.array(_true_errors(system, run))
        ratios.append(errors * 10.0 ** left[: len(errors)])
        last.append(ratios[-1][-1])
        # What rounding gives to the one direction that grows is as a normal variable: in 2.7 of
        # 100 runs below a thirtieth of its deviation.
        lucky += bool(np.min(ratios[-1]) < 1.0 / 30.0)
        fewest = min(fewest, float(left.min()))
    assert fewest < 1.0
    rows = np.concatenate(ratios)
    assert len(rows) > 1500
    assert np.max(rows) < 8.0
    assert 0.5 < np.median(rows) < 2.0
    assert np.mean(rows > 1.0 / 30.0) > 0.97
    assert lucky < 6
    # The logarithm of a normal variable's size deviates by pi/sqrt(8).
    assert np.std(np.log(last)) == pytest.approx(math.pi / math.sqrt(8.0), rel=0.2)


def test_the_error_of_an_exponent_is_the_spread_of_runs_from_other_starts() -> None:
    """All runs of one energy have the same exponent, as the motion is chaotic and ergodic."""
    scenario: Any = example("falling_balls")
    (lower, upper), slope = scenario.balls, 0.5 * scenario.gravity
    energy = sum(one.mass * (slope * one.position + 0.5 * one.speed**2) for one in (lower, upper))
    rng, rates, errors = np.random.default_rng(1), [], []
    for _ in range(40):
        place, speed = rng.uniform(0.7, 1.2), rng.uniform(-0.5, 0.5)
        left = energy - lower.mass * (slope * 0.3 + 0.5 * speed**2) - upper.mass * slope * place
        starts = {"balls[1].position": 0.3, "balls[1].speed": speed, "balls[2].position": place}
        starts["balls[2].speed"] = math.sqrt(2.0 * left / upper.mass)
        system = build_system(scenario.replace(starts))
        tangents, _, _ = followed(SYSTEM, system, Limits(None, 2000))
        rates.append(tangents.growth.exponents()[0][0])
        errors.append(tangents.error)
    # The spread of 40 normal numbers deviates by 11 %, the mean error of 16 blocks by less.
    assert np.mean(errors) == pytest.approx(np.std(rates, ddof=1), rel=0.35)


def test_a_run_tells_of_exponents_in_all_its_tables(tmp_path: Path) -> None:
    document = SCENES["arcs"] | {"stop": {"collisions": 40}, "analysis": {"lyapunov": True}}
    scenario = scenario_of(document)
    run, _ = solved_and_streamed(scenario)
    record = run.summary_record()
    assert record["lyapunov_1"] > 0.1
    assert sum(record[f"lyapunov_{n}"] for n in range(1, 5)) == pytest.approx(0.0, abs=1e-9)
    write_run(run, scenario, tmp_path / "run", {})
    table = pq.read_table(tmp_path / "run" / "exponents.parquet")
    assert table.column("lyapunov_1")[-1].as_py() == run.exponents["lyapunov_1"][-1]
