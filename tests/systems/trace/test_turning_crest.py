"""Starts on and hard by a saddle of a rotating trace, down to 1e-200, and round to it again.

On the axis the half angle h from the saddle obeys ``h' = wP`` with ``P^2 = P0^2 + D(h) - D(h0)``,
``D = sin^2 h (1 + sigma cos^2 h)`` at a top and ``sin^2 h (sigma cos^2 h - 1)`` at a bottom. All
times are integrals of that in many digits, with h as a hyperbolic function of the variable, fed
with the doubles of the scenario.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from mpmath import MPContext

from tests.highprecision.reference_solver import ReferenceSolver, events_of
from tests.references import QUANTITIES, check_impacts, solved
from vibro_cli.kernels.flow.rotating_flow import fall_from_saddle
from vibro_cli.kernels.rotating import rate_by_energy
from vibro_cli.mechanics.initial_conditions import wall_position
from vibro_cli.stress.oracles.scene import scene_of_system
from vibro_cli.stress.scenes import (
    GRAVITY,
    WALLS,
    Document,
    ball,
    scene,
    solve,
    solve_any,
    system_of,
    valley,
)
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace.world import make_world

mp: Any = MPContext()
mp.dps = 30
SPEEDS = [1e-20, *(pytest.param(v, marks=pytest.mark.long) for v in (1e-3, 1e-149, 1e-200))]
KAPPA, RADIUS = 1.4, 0.1
RATE = {"top": 1.0, "bottom": 4.0, "hump": 0.8}
HUMPS = [
    {"shape": "valley", "radius": 1.0, "end_slope": "50 deg"},
    {"shape": "hump", "radius": 0.5, "end_slope": "-50 deg"},
    {"shape": "valley", "radius": 1.0, "end_slope": "90 deg"},
]


class Saddle:
    """The motion about a saddle on the axis, on an arc with the path radius `rho` (m)."""

    def __init__(self, kind: str, rho: Any) -> None:
        self.rho = rho
        self.w = mp.sqrt(mp.mpf(GRAVITY) / (mp.mpf(KAPPA) * rho))
        self.spread = mp.mpf(RATE[kind]) ** 2 * rho / mp.mpf(GRAVITY)
        self.sign = -1 if kind == "bottom" else 1

    def time(self, speed: float, off: float, end: Any) -> Any:
        """Return the time (s) to a half angle `end`, from the saddle or from rest at an angle."""
        rate, start = mp.mpf(speed) / (2 * self.w * self.rho), mp.mpf(off) / 2

        def integrand(x: Any) -> Any:
            if rate:
                h, moved = rate * mp.sinh(x), rate * mp.cosh(x)
            else:
                h, moved = start * mp.cosh(x), start * mp.sinh(x)
            way = 2 * start * mp.sinh(x / 2) ** 2 if start else h
            # The difference of D without cancellation.
            fall = self.sign * mp.sin(way) * mp.sin(h + start)
            fall += self.spread * mp.sin(2 * way) * mp.sin(2 * (h + start)) / 4
            return moved / mp.sqrt(rate**2 + fall)

        last = mp.asinh(end / rate) if rate else mp.acosh(end / start)
        cuts = [8 * mp.mpf(k) for k in range(int(last / 8) + 1)] + [
            last - mp.mpf(2) ** -k for k in range(6)
        ]
        # At rest the integrand is 0/0 at 0, but not at the nodes.
        return mp.quad(integrand, sorted({cut for cut in cuts if cut >= 0} | {last})) / self.w


def instants(run: Run, event: str) -> list[float]:
    found = run.events["t"][run.events["event"] == event].tolist()
    return [t for t in found if t > 0.0]


def compare(found: list[float], expected: list[Any]) -> None:
    assert len(found) >= len(expected)
    for t, true in zip(found, expected, strict=False):
        assert abs(t - true) <= 2e-15 * true


def check_energy(run: Run, end: float, start: float) -> None:
    """Check the energy of sampled states; the square of a start below 1e-150 underflows."""
    if start > 1e-150:
        energy = run.sample(np.linspace(0.0, end, 301))["energy"]
        assert np.max(np.abs(energy - energy[0])) <= 1e-14


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize(
    ("slope", "arcs", "arc"),
    [
        pytest.param(-90, 1, 1, id="one arc"),
        pytest.param(-180, 1, 1, id="one arc, joined at the top"),
        pytest.param(-90, 2, 2, id="two arcs"),
        pytest.param(-60, 3, 2, id="three arcs, two joined at the top"),
    ],
)
def test_a_circle_is_passed_lap_after_lap(slope: int, arcs: int, arc: int, speed: float) -> None:
    """It crept back to the top for ever."""
    ends = [slope + 360 * (k + 1) // arcs for k in range(arcs)]
    trace: Document = {
        "start_slope": f"{slope} deg",
        "closed": True,
        "turning": {"through_arc": 1, "rate": RATE["top"]},
        "arcs": [{"shape": "valley", "radius": 1.0, "end_slope": f"{end} deg"} for end in ends],
    }
    saddle = Saddle("top", mp.mpf(1.0) - mp.mpf(RADIUS))
    half = saddle.time(speed, 0.0, mp.pi / 2)
    after = []
    for end in ends:
        turn = (end - 180) % 360 or 360
        way = saddle.time(speed, 0.0, mp.radians(min(turn, 360 - turn)) / 2) if turn < 360 else 0
        after.append(way if turn <= 180 else 2 * half - way)
    expected = sorted(t + 2 * half * lap for t in after for lap in range(3))
    stop = float(expected[-1]) + 0.1
    run = solve(scene(trace, [ball(math.pi, arc=arc, speed=speed)], time=stop), "compiled")
    compare(instants(run, "crossing"), expected)
    check_energy(run, stop, speed)


@pytest.mark.parametrize("moving", [False, True], ids=["at rest beside it", "moving on it"])
@pytest.mark.parametrize("start", SPEEDS)
def test_across_three_arcs_and_back(start: float, moving: bool) -> None:
    """At rest 1e-20 rad off the crest it never ended: it was taken to turn beyond the crest."""
    trace: Document = {"start_slope": "-90 deg", "arcs": HUMPS}
    trace["turning"] = {"through_arc": 2, "rate": RATE["hump"]}
    saddle = Saddle("hump", mp.mpf(0.5) + mp.mpf(RADIUS))
    speed, angle = (start, 0.0) if moving else (0.0, start)
    down = saddle.time(speed, angle, mp.radians(25))
    one = ball(angle, arc=2, speed=speed)
    run = solve({**scene(trace, [one], time=float(7 * down) + 6.0), **WALLS}, "compiled")
    found = instants(run, "crossing")
    valley = mp.mpf(found[1] - found[0])
    expected = [(2 * k + 1) * down + (k + j) * valley for k in range(3) for j in range(2)]
    assert abs(found[0] - down) <= 2e-15 * down
    for t, true in zip(found, expected, strict=False):
        assert abs(t - true) <= 1e-14 * true
    arcs = run.events["arc_to"][run.events["event"] == "crossing"].tolist()
    # On the separatrix it passes to the other side, beside it it returns.
    assert arcs[:6] == ([3, 2, 1, 2, 3, 2] if moving else [3, 2] * 3)
    check_energy(run, float(7 * down), start)


@pytest.mark.parametrize("moving", [False, True], ids=["at rest beside it", "moving on it"])
def test_back_on_an_arc_that_ends_beside_its_saddle(moving: bool) -> None:
    """It was 4e-6 s off on its way back, and 0.04 s where the arc ends at 0.02 deg."""
    end, start = 0.2, 1e-8
    arcs = [
        *HUMPS[:1],
        {"shape": "hump", "radius": 0.5, "end_slope": f"{-end} deg"},
        {"shape": "hump", "radius": 0.8, "end_slope": "-50 deg"},
        *HUMPS[2:],
    ]
    trace: Document = {"start_slope": "-90 deg", "arcs": arcs}
    trace["turning"] = {"through_arc": 2, "rate": RATE["hump"]}
    speed, angle = (start, 0.0) if moving else (0.0, start)
    document = {**scene(trace, [ball(angle, arc=2, speed=speed)], time=20.0), **WALLS}
    run = solve(document, "compiled")
    found = instants(run, "crossing")
    saddle = Saddle("hump", mp.mpf(0.5) + mp.mpf(RADIUS))
    out = saddle.time(speed, angle, mp.radians(end) / 2)
    onward = saddle.time(speed, angle, mp.radians(50) / 2) if moving else out
    compare(found[:1], [out])
    assert abs(found[4] - found[3] - (out + onward)) <= 2e-14


@pytest.mark.parametrize("moving", [False, True], ids=["at rest beside it", "moving on it"])
@pytest.mark.parametrize("start", SPEEDS)
def test_to_and_fro_over_a_bottom_that_is_a_saddle(start: float, moving: bool) -> None:
    arcs = [{"shape": "valley", "radius": 1.0, "end_slope": "60 deg"}]
    trace: Document = {"start_slope": "-60 deg", "arcs": arcs}
    trace["turning"] = {"through_arc": 1, "rate": RATE["bottom"]}
    saddle = Saddle("bottom", mp.mpf(1.0) - mp.mpf(RADIUS))
    speed, angle = (start, 0.0) if moving else (0.0, start)
    document = {**scene(trace, [ball(angle, speed=speed)], time=1.0), **WALLS}
    piece = solve(document).system.trace.pieces[0]
    quarter = saddle.time(speed, angle, mp.mpf(wall_position(piece, RADIUS, True)) / 2)
    document["stop"] = {"time": float(7 * quarter) + 0.1}
    document["output"] = {"turning_points": True}
    run = solve(document, "compiled")
    compare(instants(run, "wall"), [(2 * k + 1) * quarter for k in range(4)])
    walls = run.events["s"][run.events["event"] == "wall"]
    assert np.all(np.diff(walls) != 0.0) if moving else np.all(np.diff(walls) == 0.0)
    check_energy(run, float(7 * quarter), start)


@pytest.mark.long
@pytest.mark.parametrize("k", [1.0, 0.6])
@pytest.mark.parametrize("speed", [1e-3, 1e-10])
def test_impacts_of_a_body_that_started_on_the_top(k: float, speed: float) -> None:
    """Against Taylor series in 50 digits; four impacts amplify an error of the start up to 600."""
    trace: Document = {"start_slope": "-90 deg", "closed": True}
    trace["turning"] = {"through_arc": 1, "rate": RATE["top"]}
    trace["arcs"] = [{"shape": "valley", "radius": 1.0, "end_slope": "270 deg"}]
    balls = [ball(math.pi, speed=speed), ball(4.4)]
    run = solve(scene(trace, balls, k, time=100.0, collisions=4), "compiled")
    impacts = ReferenceSolver(scene_of_system(run.system)).follow(events_of(run))
    assert len(impacts) == 4
    check_impacts(run, impacts, 2e-12)


@pytest.mark.parametrize("off", [1e-6, 1e-20, 1e-100])
def test_it_turns_beside_the_crest_half_way_between_its_crossings(off: float) -> None:
    trace: Document = {"start_slope": "-90 deg", "arcs": HUMPS}
    trace["turning"] = {"through_arc": 2, "rate": RATE["hump"]}
    document = {**scene(trace, [ball(off, arc=2)], time=300.0), **WALLS}
    events = solve_any({**document, "output": {"turning_points": True}}).events
    crossings = events["t"][events["event"] == "crossing"]
    turns = events["t"][events["event"] == "turning"][1::2]  # every other one is in the valley
    assert len(turns) > 0
    for before, turn, after in zip(crossings[1::2], turns, crossings[2::2], strict=False):
        assert turn == pytest.approx(0.5 * (before + after), rel=1e-15)


@pytest.mark.parametrize("overlap", [1e-8, 8e-8])
def test_two_bodies_that_turn_at_contact_beside_a_saddle_collide(overlap: float) -> None:
    """One turns 2e-8 rad before the saddle, the other so near that their paths overlap by little.

    No impact was found: the first was taken to turn up to 2e-7 rad before that.
    """
    turn, angle = 2e-8, 6.8972e-6  # it turns after 3.42 s, the period of the other
    saddle = Saddle("bottom", mp.mpf(1.0) - mp.mpf(RADIUS))

    def fall(half: Any) -> Any:
        return mp.sin(half) ** 2 * (saddle.spread * mp.cos(half) ** 2 - 1)

    rate = mp.sqrt(fall(mp.mpf(angle) / 2) - fall(mp.mpf(turn) / 2))
    touching = 2.0 * math.asin(RADIUS / (1.0 - RADIUS))
    balls = [
        ball(-angle, speed=float(2 * saddle.w * saddle.rho * rate)),
        ball(touching - turn - overlap),
    ]
    arcs = [{"shape": "valley", "radius": 1.0, "end_slope": "85 deg"}]
    trace: Document = {"start_slope": "-85 deg", "arcs": arcs}
    trace["turning"] = {"through_arc": 1, "rate": RATE["bottom"]}
    run = solve({**scene(trace, balls, time=3.5, collisions=1), **WALLS}, "compiled")
    (impact,) = ReferenceSolver(scene_of_system(run.system)).follow(events_of(run))
    # They meet at 1e-5 m/s: a rounding of their places of 1e-16 m takes 1e-11 s.
    assert abs(solved(run, "t", 0) - QUANTITIES["t"][1](impact)) <= 1e-10


@pytest.mark.parametrize("share", [-1e-10, 1e-10, 1e-3])
def test_a_body_nearly_at_rest_above_its_saddle_keeps_its_speed(share: float) -> None:
    """Where its energy is less than its height by a rounding, it was the root of less than zero."""
    trace = {**valley(90), "turning": {"through_arc": 1, "rate": RATE["bottom"]}}
    world = make_world(system_of(scene(trace, [ball(1.25, speed=1e-9)], time=1.0)))
    flight, track = world.flights[0], world.tracks[0]
    saddle = track.pass_s, track.pass_c
    fall = fall_from_saddle(track.tilt, track.spread, *saddle, flight.s, flight.c)
    assert fall < 0.0
    flight.separatrix_piece = 0
    flight.separatrix_root = -math.sqrt(-fall * (1.0 + share))
    assert rate_by_energy(world, 0, flight, track) == flight.p


@pytest.mark.parametrize("x", [1.1, 2.0])
def test_a_crest_off_the_axis_is_the_top_to_the_bit(x: float) -> None:
    """It was 1e-16 rad off, which the least energies below it exceed: bodies would pass it."""
    trace: Document = {
        "start_slope": "-50 deg",
        "arcs": HUMPS[:2],
        "turning": {"x": x, "rate": 1.0},
    }
    track = make_world(system_of(scene(trace, [ball(0.1, arc=2)], time=1.0))).tracks[1]
    assert track.crests == 1
    assert track.crest_s * track.top_c == track.crest_c * track.top_s


@pytest.mark.parametrize("speed", [1e-4, 1e-8])
def test_a_level_line_is_passed_as_slowly_each_time(speed: float) -> None:
    """It was 2e-9 s off at 1e-4 m/s, and at 1e-8 m/s the body never left the line again."""
    trace: Document = {"start_slope": "-60 deg", "arcs": [{**HUMPS[0], "end_slope": "0 deg"}]}
    trace["arcs"] += [{"shape": "line", "length": 2.0}, {**HUMPS[0], "end_slope": "60 deg"}]
    trace["turning"] = {"x": math.sin(math.radians(60)) + 1.0, "rate": 1.0}
    one = {"radius": RADIUS, "mass": 1.0, "arc": 2, "position": 1.0, "speed": speed}
    run = solve_any({**scene(trace, [one], time=200.0), **WALLS})
    found = instants(run, "crossing")
    b = 1.0 / math.sqrt(KAPPA)
    passage = 2.0 * math.asinh(b / speed) / b
    assert len(found) >= 4
    for entered, left in zip(found[1::2], found[2::2], strict=False):
        assert abs(left - entered - passage) <= 1e-13
