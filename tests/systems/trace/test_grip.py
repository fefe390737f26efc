"""Lift-off and slip, alone and in lasting contact, against forces from the sampled motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from vibro_cli.stress.scenes import scene, solve_any, three_arcs
from vibro_cli.systems.run import Run

STEP = 1e-5  # of the differences that give accelerations


def solved(case: str, surface: str) -> Run:
    balls, arcs, slope, time, friction = SCENES[case]
    trace = {"start_slope": slope, "surface": surface, "arcs": arcs}
    document = scene(trace, balls, 0.0, time=time) | {"output": {"friction": friction}}
    return solve_any(document)


def pushed(arc: int, rate: float) -> list[dict[str, Any]]:
    """Return a particle that pushes a hoop in front of it."""
    both = {"radius": 0.1, "arc": arc, "rate": rate}
    return [
        both | {"body": "particle", "mass": 3.0, "angle": 0.4},
        both | {"body": "hoop", "mass": 1.0, "touching": "previous"},
    ]


HUMP: list[dict[str, Any]] = [{"shape": "hump", "radius": 1.0, "end_slope": "-85 deg"}]
SCENES: dict[str, tuple[list[dict[str, Any]], list[dict[str, Any]], str, float, float]] = {
    "alone": ([{"radius": 0.1, "mass": 1.0, "arc": 1, "angle": 0.1}], HUMP, "85 deg", 3.0, 0.6),
    "pushed over a hump": (pushed(1, 0.3), HUMP, "85 deg", 3.0, 0.6),
    # Over the end of a hump, so that the junction is between them.
    "pushed into a valley": (pushed(2, 2.2), three_arcs(120)["arcs"], "-120 deg", 1.0, 0.25),
}


def forces(run: Run, t: float) -> list[tuple[float, float]]:
    """Normal force and friction (N) of every body, from Newton's law and differences of speeds."""
    system = run.system
    now, before, after = (run.sample([t + shift]) for shift in (0.0, -STEP, STEP))
    count = len(system.bodies)
    centres = [np.array([now["x"][i], now["y"][i]]) for i in range(count)]
    push = np.zeros(count + 1)  # contact force to the left of each body
    rows = []
    for i, body in enumerate(system.bodies):
        piece = system.trace.pieces[int(now["arc"][i]) - 1]
        alpha = piece.sign * now["angle"][i] if piece.sign else piece.start_slope
        tangent = np.array([math.cos(alpha), math.sin(alpha)])
        normal = np.array([-math.sin(alpha), math.cos(alpha)])
        acceleration = (after["speed"][i] - before["speed"][i]) / (2.0 * STEP)
        weight = body.mass * system.gravity
        along = -weight * math.sin(alpha) - body.kappa * body.mass * acceleration
        bend = piece.sign * now["speed"][i] ** 2 / piece.path_radius(body.radius)
        force = weight * math.cos(alpha) + body.mass * bend
        for side in (-1, 1):
            if not 0 <= i + side < count:
                continue
            line = side * (centres[i + side] - centres[i])
            gap = np.linalg.norm(line) - body.radius - system.bodies[i + side].radius
            line = line / np.linalg.norm(line)
            if side < 0:
                along += push[i] * (line @ tangent)
                force -= push[i] * (line @ normal)
            elif gap < 1e-9:
                push[i + 1] = along / (line @ tangent)
                force += push[i + 1] * (line @ normal)
        rows.append((force, (body.kappa - 1.0) * body.mass * abs(acceleration)))
    return rows


def excess(run: Run, t: float, ball: int, name: str) -> float:
    normal, friction = forces(run, t)[ball]
    if name == "slip" and friction > 0.0:
        return friction - float(run.wanted.friction or 0.0) * normal
    return -normal if name == "lift_off" else -1.0


@pytest.mark.parametrize("name", ["lift_off", "slip"])
@pytest.mark.parametrize("case", SCENES)
def test_events_are_where_the_forces_of_the_motion_change(case: str, name: str) -> None:
    run = solved(case, "two-sided")
    end = run.summary_record()["end_time"]
    breaks = {0.0, end, *run.events["t"].tolist(), *run.collisions["t"].tolist()}
    found = 0
    for ball in range(len(run.system.bodies)):
        chosen = (run.events["event"] == name) & (run.events["ball"] == ball + 1)
        instants = run.events["t"][chosen].tolist()
        for t in instants:
            if t < 1e-3:
                continue
            found += 1
            before, after = (excess(run, t + shift, ball, name) for shift in (-1e-4, 1e-4))
            assert before < 0.0 < after, (t, before, after)
        # And it becomes positive nowhere else.
        grid = [
            t for t in np.linspace(1e-3, end - 1e-3, 150) if all(abs(t - b) > 2e-4 for b in breaks)
        ]
        values = [excess(run, t, ball, name) > 0.0 for t in grid]
        for left, right, was, now in zip(grid, grid[1:], values, values[1:], strict=False):
            if now and not was:
                assert any(left < t < right for t in instants), (left, right)
    assert found


@pytest.mark.parametrize("case", SCENES)
def test_a_one_sided_trace_ends_the_run_there(case: str) -> None:
    free, held = solved(case, "two-sided"), solved(case, "one-sided")
    lifted = np.flatnonzero(free.events["event"] == "lift_off")[0]
    assert held.end_cause == "lift_off"
    assert held.events["event"][-1] == "lift_off"
    assert held.events["ball"][-1] == free.events["ball"][lifted]
    first = float(free.events["t"][lifted])
    assert held.summary_record()["end_time"] == pytest.approx(first, abs=1e-12)


# On a line a small heavy hoop holds up a large light particle, which would slide faster.
TILT = math.asin((0.3 - 0.05) / (0.3 + 0.05))
SHARE = 3.0 / (1.0 + 2.0 * 3.0)  # of the particle's pull down the line that the hoop takes
STEEPEST = math.atan(1.0 / (SHARE * math.tan(TILT)))


def pair_on_a_line(slope: float, surface: str, friction: float | None = None) -> Run:
    trace = {"start_slope": -slope, "surface": surface, "arcs": [{"shape": "line", "length": 4.0}]}
    balls = [
        {"body": "particle", "radius": 0.3, "mass": 1.0, "arc": 1, "position": 1.0},
        {"body": "hoop", "radius": 0.05, "mass": 3.0, "arc": 1, "touching": "previous"},
    ]
    document = scene(trace, balls, 0.0, time=0.5)
    if friction is not None:
        document["output"] = {"friction": friction}
    return solve_any(document)


@pytest.mark.parametrize("surface", ["one-sided", "two-sided"])
@pytest.mark.parametrize("off", [-0.3, -1e-3, -1e-9, 1e-9, 1e-3, 0.3])
def test_a_pair_in_contact_on_a_line_lifts_off_where_the_push_outweighs_it(
    off: float, surface: str
) -> None:
    slope = STEEPEST + off
    run = pair_on_a_line(slope, surface)
    lifted = run.events["event"] == "lift_off"
    if off < 0.0:
        assert run.end_cause == "time"
        assert not lifted.any()
    else:
        assert run.events["ball"][lifted].tolist() == [1]
        assert run.events["t"][lifted].tolist() == [0.0]
        assert run.end_cause == ("lift_off" if surface == "one-sided" else "time")
    if run.end_cause == "time":
        weight = 1.0 * 9.81
        force = weight * (math.cos(slope) - SHARE * math.sin(slope) * math.tan(TILT))
        found = run.summary_record()["min_normal_force"]
        assert found == pytest.approx(force, rel=1e-13, abs=1e-14 * weight)


@pytest.mark.parametrize("slope", [0.2, 0.6, 0.9, 1.1])
def test_a_pair_in_contact_on_a_line_slips_beyond_its_friction(slope: float) -> None:
    push = SHARE * 9.81 * math.sin(slope)  # along the line
    friction = 3.0 * 9.81 * math.sin(slope) + push
    friction *= (2.0 - 1.0) / 2.0  # of a hoop: the share (kappa - 1)/kappa of what pulls it
    demand = friction / (3.0 * 9.81 * math.cos(slope) + push * math.tan(TILT))
    run = pair_on_a_line(slope, "one-sided")
    assert run.summary_record()["max_friction_demand"] == pytest.approx(demand, rel=1e-13)
    for share, slips in ((1.0 + 1e-9, []), (1.0 - 1e-9, [2])):
        run = pair_on_a_line(slope, "one-sided", share * demand)
        assert run.events["ball"][run.events["event"] == "slip"].tolist() == slips


# A hoop that the trace carries, and a particle that it holds back.
HELD: dict[str, list[dict[str, Any]]] = {
    "on an arc": [{"radius": 0.1, "arc": 1, "angle": 0.3}, {"radius": 0.1, "arc": 1, "angle": 2.0}],
    "on a line": [
        {"radius": 0.1, "arc": 1, "angle": 0.3},
        {"radius": 0.1, "arc": 2, "position": 2.0},
    ],
    "touching": [
        {"radius": 0.3, "arc": 1, "angle": 1.05},
        {"radius": 0.3, "arc": 1, "touching": "previous"},
    ],
}


@pytest.mark.parametrize("turning", [None, 1e-9])
@pytest.mark.parametrize("where", HELD)
def test_a_particle_that_the_trace_holds_back_needs_no_friction(
    where: str, turning: float | None
) -> None:
    trace: dict[str, Any] = {
        "start_slope": -2.2,
        "arcs": [
            {"shape": "valley", "radius": 1.0, "end_slope": 2.2},
            {"shape": "line", "length": 3.0},
        ],
    }
    if turning is not None:
        trace["turning"] = {"x": 0.0, "rate": turning}
    bodies = [{"body": "hoop", "mass": 1.0}, {"body": "particle", "mass": 0.1}]
    balls = [a | b for a, b in zip(bodies, HELD[where], strict=True)]
    run = solve_any(scene(trace, balls, 0.0, "hedrih", time=0.1))
    instants = np.linspace(2.0 * STEP, 0.1 - 2.0 * STEP, 101)
    normal, friction = np.transpose([forces(run, t) for t in instants], (2, 0, 1))
    assert min(normal[:, 0]) > 0.0 > max(normal[:, 1])
    found = run.summary_record()["max_friction_demand"]
    assert found == pytest.approx(max(friction[:, 0] / normal[:, 0]), rel=1e-3)


@pytest.mark.parametrize("turning", [None, 1e-9])
@pytest.mark.parametrize("body", ["disk", "particle"])
def test_what_rolls_slips_where_a_hump_that_begins_level_cannot_hold_it(
    body: str, turning: float | None
) -> None:
    # N = m (g cos psi - v^2/rho) < 0 from the crest on, where F = 0 at that instant alone.
    speed, rho = 6.0, 0.55
    trace: dict[str, Any] = {
        "start_slope": 0.0,
        "arcs": [
            {"shape": "line", "length": 1.0},
            {"shape": "hump", "radius": 0.5, "end_slope": -1.2},
        ],
    }
    if turning is not None:
        trace["turning"] = {"x": 1.0, "rate": turning}
    ball = {"body": body, "radius": 0.05, "mass": 1.0, "arc": 1, "position": 0.4, "speed": speed}
    events = solve_any(scene(trace, [ball], time=0.15) | {"output": {"friction": 0.3}}).events
    assert 9.81 - speed**2 / rho < 0.0
    for name, times in (("lift_off", [0.1]), ("slip", [0.1] if body == "disk" else [])):
        assert events["t"][events["event"] == name] == pytest.approx(times)


VALLEY = {"shape": "valley", "radius": 1.0, "end_slope": 1.2}
LEVEL = {"shape": "line", "length": 1.0}
CIRCLE = {"shape": "valley", "radius": 1.0, "end_slope": math.tau}
# Trace, start of the ball, and when it begins to slip for good, or until it is on a level line.
FRICTIONLESS: list[tuple[dict[str, Any], dict[str, Any], list[float]]] = [
    ({"start_slope": 0.0, "arcs": [LEVEL, VALLEY]}, {"position": 0.5, "speed": 1.0}, [0.5]),
    ({"start_slope": -1.2, "arcs": [VALLEY]}, {"angle": -0.5}, [0.0]),
    ({"start_slope": 0.0, "arcs": [CIRCLE], "closed": True}, {"angle": 1.0, "speed": 8.0}, [0.0]),
    (
        {"start_slope": -1.2, "arcs": [VALLEY], "turning": {"x": 0.3, "rate": 1.0}},
        {"angle": -0.5},
        [0.0],
    ),
]


@pytest.mark.parametrize(("trace", "start", "begins"), FRICTIONLESS)
def test_without_friction_a_body_slips_wherever_rolling_needs_any(
    trace: dict[str, Any], start: dict[str, Any], begins: list[float]
) -> None:
    """It is not over with that at a bottom or a crest, where friction vanishes for no time."""
    ball = {"radius": 0.1, "mass": 1.0, "arc": 1, **start}
    run = solve_any(scene(trace, [ball], time=2.5) | {"output": {"friction": 0.0}})
    times = np.linspace(1e-3, 2.5 - 1e-3, 997)
    earlier, later = (run.sample(times + shift)["speed"] for shift in (-STEP, STEP))
    needed = np.abs(later - earlier) > 1e-9
    slips = np.zeros(len(times), dtype=bool)
    for t in begins:
        slips |= times > t
    on_arc = run.sample(times)["arc"] == len(trace["arcs"])
    assert np.array_equal(needed, slips & on_arc)
    found = run.events["event"] == "slip"
    assert run.events["t"][found] == pytest.approx(begins, abs=1e-12)


def over_a_junction(speed: float, surface: str, **keys: Any) -> Run:
    """Two bodies in contact roll into a valley; the left one then hardly presses its line."""
    balls: list[dict[str, Any]] = [
        {"inertia_ratio": 0.6, "radius": 0.085, "mass": 1.0, "arc": 1, "position": 0.3},
        {"inertia_ratio": 0.85, "radius": 0.05, "mass": 1.3, "arc": 1, "touching": "previous"},
    ]
    arcs = [
        {"shape": "line", "length": 1.8},
        {"shape": "valley", "radius": 0.7, "end_slope": 0.6},
    ]
    trace = {"start_slope": -1.2, "surface": surface, "arcs": arcs}
    document = scene(trace, [ball | {"speed": speed} for ball in balls], 0.5, time=0.7)
    return solve_any(document | {"gravity": 3.9} | keys)


@pytest.mark.parametrize("speed", [1.5, 1.75, 2.0])
def test_extremes_across_pieces_are_those_between_segments_too(speed: float) -> None:
    run = over_a_junction(speed, "two-sided")
    first, second = run.events["t"][run.events["event"] == "crossing"]
    found = [forces(run, t)[0] for t in np.linspace(first + 2 * STEP, second - 2 * STEP, 501)]
    least = min(normal for normal, _ in found)
    most = max(friction / normal for normal, friction in found)
    summary = run.summary_record()
    assert summary["min_normal_force"] == pytest.approx(least, rel=2e-6)
    assert summary["max_friction_demand"] >= most * (1.0 - 1e-6)
    limit = summary["max_friction_demand"]
    for friction, slips in ((limit * (1.0 - 1e-6), True), (limit * (1.0 + 1e-6), False)):
        events = over_a_junction(speed, "two-sided", output={"friction": friction}).events
        assert ("slip" in events["event"]) == slips


def test_a_body_that_lifts_off_between_segments_ends_a_one_sided_run_or_is_told() -> None:
    for speed in (2.29967, 2.2999, 2.3002):
        held, free = (over_a_junction(speed, surface) for surface in ("one-sided", "two-sided"))
        assert held.end_cause == "lift_off"
        assert free.summary_record()["min_normal_force"] < 0.0
        lifted = free.events["t"][free.events["event"] == "lift_off"]
        assert lifted == pytest.approx([held.end_time], abs=1e-9)
        before, after = (forces(free, lifted[0] + shift)[0][0] for shift in (-1e-4, 1e-4))
        assert after < 0.0 < before


@pytest.mark.parametrize("turning", [None, {"x": 0.3, "rate": 0.7}])
def test_no_friction_suffices_where_the_normal_force_vanishes(turning: Any) -> None:
    """A ball that rolls off a crest leaves it on the slope: friction is needed until N = 0."""
    hump = {"shape": "hump", "radius": 1.0, "end_slope": -1.4}
    trace = {"start_slope": 0.9, "surface": "one-sided", "arcs": [hump]}
    trace |= {"turning": turning} if turning else {}
    for speed in np.linspace(0.05, 1.5, 12):
        rolling = {"radius": 0.1, "mass": 1.0, "arc": 1, "angle": 0.02, "speed": float(speed)}
        run = solve_any(scene(trace, [rolling], time=20.0))
        assert run.end_cause == "lift_off"
        assert run.summary_record()["max_friction_demand"] is None
