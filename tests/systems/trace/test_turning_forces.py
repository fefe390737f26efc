"""Forces on a rotating trace: lift-off, friction along it, lasting contact in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.systems.trace.test_turning import run
from tests.systems.trace.turning_scenes import (
    CIRCLE,
    ball,
    data,
    on_circle,
    on_lines,
    on_three_arcs,
    over_the_hump,
)
from vibro_cli.compile.kernel import Overrides, kernel
from vibro_cli.kernels.cluster.clusters import (
    launch_group,
    launch_group_on_line,
    limit_by_lift_off,
    set_group_flow,
    set_release,
)
from vibro_cli.kernels.cluster.collocation import launch_across
from vibro_cli.kernels.cluster.rotating_clusters import normal_harmonics
from vibro_cli.kernels.cluster.trace_forces import normal_force_now
from vibro_cli.kernels.contact.contact_kinematics import set_normals, set_speed
from vibro_cli.kernels.impact.impulse_chain import contact_forces
from vibro_cli.kernels.numerics.conservative_advancement import harmonic_value
from vibro_cli.kernels.rotating import TURNING
from vibro_cli.kernels.world import World
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import SYSTEM

pytestmark = pytest.mark.long

PLASTIC = {"law": "normal-impulse", "k": 0.4}
FREE = {
    "circle": on_circle(),
    "fast circle": on_circle(rate=3.6),
    "lines": on_lines(),
    "three arcs": on_three_arcs(),
}


def three_bodies(rate: float, x: float) -> dict[str, Any]:
    """Three unequal bodies that come into contact in a valley turning beside its axis."""
    balls = [
        ball(1, "-60 deg"),
        ball(1, "-10 deg") | {"radius": 0.06},
        ball(1, "50 deg") | {"radius": 0.12, "density": 2000},
    ]
    return data(CIRCLE, balls, {"x": x, "rate": rate}, collision=PLASTIC, stop={"time": 25.0})


def up_a_loop(x: float, rate: float) -> dict[str, Any]:
    """Return two balls that roll up together inside a loop whose upper part cannot hold them."""
    arcs = [{"shape": "valley", "radius": 1.0, "end_slope": "170 deg"}]
    follower = {"radius": 0.1, "density": 7800, "arc": 1, "touching": "previous", "rate": 5.5}
    balls = [ball(1, 0.0, rate=5.5), follower]
    found = data(arcs, balls, {"x": x, "rate": rate}, "-170 deg", collision=PLASTIC)
    found["trace"]["surface"] = "one-sided"
    return found


def on_a_slope(slope: str, rate: float, x: float) -> dict[str, Any]:
    """Return three bodies of different inertia that come into contact on a line."""
    kinds = [(0.1, 3.0, 0.4), (0.06, 1.0, 0.9), (0.08, 2.0, 1.0)]
    balls = [
        {"radius": r, "mass": m, "inertia_ratio": k, "arc": 1, "position": 2.5 + 0.3 * i}
        for i, (r, m, k) in enumerate(kinds)
    ]
    arcs = [{"shape": "line", "length": 8.0}, {"shape": "valley", "radius": 1.0, "end_slope": 0.6}]
    return data(arcs, balls, {"x": x, "rate": rate}, slope, collision=PLASTIC, stop={"time": 2.0})


def sampled(found: Run) -> tuple[Any, Any, Any]:
    """Body, normal force and friction (N) of free bodies, from the formulas of the model."""
    system, turning = found.system, found.system.turning
    assert turning is not None
    motion = found.sample(np.linspace(0.0, float(found.summary_record()["end_time"]), 4000))
    normals, frictions = [], []
    for number, arc, angle, x, speed in zip(
        *(motion[name] for name in ("ball", "arc", "angle", "x", "speed")), strict=True
    ):
        body, piece = system.bodies[number - 1], system.trace.pieces[arc - 1]
        slope = piece.start_slope if piece.is_line else piece.slope(angle)
        away = turning.square * (x - turning.x)
        normal = system.gravity * np.cos(slope) + away * np.sin(slope)
        if not piece.is_line:
            normal += piece.sign * speed**2 / piece.path_radius(body.radius)
        drive = away * np.cos(slope) - system.gravity * np.sin(slope)
        normals.append(body.mass * normal)
        frictions.append((1.0 - 1.0 / body.kappa) * body.mass * abs(drive))
    return motion["ball"], np.array(normals), np.array(frictions)


@pytest.mark.parametrize("name", ["circle", "fast circle", "lines"])
def test_extremes_of_the_summary_are_those_of_the_motion(name: str) -> None:
    found = run(FREE[name])
    _, normal, friction = sampled(found)
    record, demand = found.summary_record(), float(np.max(friction / normal))
    assert demand <= record["max_friction_demand"] <= demand * (1.0 + 1e-4)
    least = float(np.min(normal))
    assert least * 0.93 <= record["min_normal_force"] <= least * (1.0 + 1e-12)


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["right of the axis", "left of it"])
def test_forces_on_a_slope_are_least_where_a_body_turns_and_greatest_at_the_start(
    side: float,
) -> None:
    """A body rolls down towards the axis, turns back, and is stopped before it is where it began.

    N = m (g cos a + W^2 (x - X) sin a), D = (1 - 1/kappa) m |W^2 (x - X) cos a - g sin a|.
    The mirror image has the same forces.
    """
    square, axis, slope, speed = 4.0, -3.0, np.radians(20.0), -5.0
    body = {"radius": 0.1, "mass": 2.0, "arc": 1, "position": 4.0, "speed": side * speed}
    line = [{"shape": "line", "length": 8.0}]
    place = axis if side > 0.0 else 8.0 * np.cos(slope) - axis
    keys = {"stop": {"time": 0.6}, "output": {"friction": 0.32}}
    document = data(line, [body], {"x": place, "rate": 2.0}, f"{20.0 * side} deg", **keys)
    del document["collision"]
    found = run(document)
    away = 4.0 * np.cos(slope) - 0.1 * np.sin(slope) - axis
    pull = square * away * np.cos(slope) - 9.81 * np.sin(slope)
    # kappa v^2 = kappa v0^2 + 2 pull d + W^2 cos^2 a d^2, which falls to zero.
    turn = np.roots([square * np.cos(slope) ** 2, 2.0 * pull, 1.4 * speed**2]).max()
    assert side * (found.sample([0.6])["s"][0] - 4.0) < 0.0
    normal = 9.81 * np.cos(slope) + square * away * np.sin(slope)
    least = normal + square * turn * np.cos(slope) * np.sin(slope)
    record = found.summary_record()
    assert record["min_normal_force"] == pytest.approx(2.0 * least, rel=1e-13)
    assert record["max_friction_demand"] == pytest.approx(0.4 / 1.4 * pull / normal, rel=1e-13)
    # At a limit of 0.32 it slips at the start, and again on the way back.
    times = np.linspace(0.0, 0.6, 6001)
    away = side * (found.sample(times)["x"] - place)
    pulls = square * away * np.cos(slope) - 9.81 * np.sin(slope)
    slips = 0.4 / 1.4 * pulls > 0.32 * (9.81 * np.cos(slope) + square * away * np.sin(slope))
    again = times[1:][slips[1:] & ~slips[:-1]]
    told = found.events["t"][found.events["event"] == "slip"]
    assert told == pytest.approx(np.array([0.0, *again]), abs=1.1e-4)
    assert len(told) == 2


@pytest.mark.usefixtures("no_hang")
def test_no_friction_suffices_for_bodies_that_roll_on_together_where_the_trace_pulls() -> None:
    """Down a hump far from the axis: what presses them together also throws them off it."""
    arcs = [{"shape": "hump", "radius": 1.0, "end_slope": "-80 deg"}]
    balls = [ball(1, "40 deg"), {"radius": 0.1, "density": 7800, "arc": 1, "touching": "previous"}]
    axis = {"x": -8.0, "rate": 1.5}
    found = run(data(arcs, balls, axis, "80 deg", collision=PLASTIC, stop={"time": 0.2}))
    assert "contact_opened" not in found.events["event"]
    motion = found.sample(np.linspace(0.0, 0.2, 50))
    slope, away = -motion["angle"], 1.5**2 * (motion["x"] + 8.0)
    # Without the force of contact.
    normal = 9.81 * np.cos(slope) + away * np.sin(slope) - motion["speed"] ** 2 / 1.1
    assert np.all(normal < 0.0)
    record = found.summary_record()
    assert record["min_normal_force"] < 0.0
    assert record["max_friction_demand"] is None


@pytest.mark.parametrize("name", FREE)
@pytest.mark.parametrize("limit", [0.1, 0.15])
def test_slips_are_where_friction_is_not_enough(name: str, limit: float) -> None:
    found = run(FREE[name] | {"output": {"friction": limit}})
    body, normal, friction = sampled(found)
    count = 0
    for number in (1, 2, 3):
        beyond = (friction > limit * normal)[body == number]
        count += int(np.sum(beyond[1:] & ~beyond[:-1])) + int(np.sum(beyond[:1]))
    assert int(np.sum(found.events["event"] == "slip")) == count


def round_and_round(slope: int, speed: float, rate: float, x: float) -> dict[str, Any]:
    """A hoop that goes round a closed circle beside its axis, from seam to seam."""
    hoop = ball(1, f"{slope + 300} deg", speed=speed) | {"body": "hoop", "mass": 1.0}
    del hoop["density"]
    circle = [{"shape": "valley", "radius": 1.0, "end_slope": f"{slope + 360} deg"}]
    scene = data(circle, [hoop], {"x": x, "rate": rate}, f"{slope} deg", stop={"time": 3.0})
    scene["trace"]["closed"] = True
    scene["output"] = {"friction": 0.4}
    return {name: part for name, part in scene.items() if name not in ("ends", "collision")}


@pytest.mark.parametrize("slope", range(-170, -10, 40))
@pytest.mark.parametrize("speed", [-5.5, -4.0, 4.0, 5.5])
def test_forces_over_whole_turns_are_those_of_the_motion(slope: int, speed: float) -> None:
    for rate, x in ((3.4, 2.0), (3.6, 0.4), (2.0, -1.0)):
        found = run(round_and_round(slope, speed, rate, x), "compiled")
        _, normal, friction = sampled(found)
        least = float(np.min(normal))
        record = found.summary_record()
        assert record["crossings"] > 1
        assert record["min_normal_force"] == pytest.approx(least, rel=1e-3, abs=1e-3)
        for name, beyond in (("slip", friction > 0.4 * normal), ("lift_off", normal < 0.0)):
            count = int(np.sum(beyond[1:] & ~beyond[:-1])) + int(beyond[0])
            assert int(np.sum(found.events["event"] == name)) == count, (name, rate)


@pytest.mark.parametrize(("angle", "rate", "limit"), [(-1.2, 1.0, 0.12), (0.3, 6.0, 0.3)])
def test_passages_are_where_and_when_quadrature_says(
    angle: float, rate: float, limit: float
) -> None:
    """Turning points, slip and lift-off of a body alone: time is the integral of df/f'."""
    mp = pytest.importorskip("mpmath").mp.clone()
    mp.dps = 40
    arcs = [{"shape": "valley", "radius": 1.0, "end_slope": "170 deg"}]
    one, turning_at = [ball(1, angle, rate=rate)], {"x": 0.2, "rate": 1.7}
    scene = data(arcs, one, turning_at, "-170 deg", stop={"time": 4.0})
    scene["output"] = {"turning_points": True, "friction": limit}
    del scene["collision"], scene["ends"]
    found = run(scene)
    system, turning = found.system, found.system.turning
    assert turning is not None
    body, piece = system.bodies[0], system.trace.pieces[0]
    rho, kappa, g = mp.mpf(piece.path_radius(body.radius)), mp.mpf(body.kappa), system.gravity
    square, away = mp.mpf(turning.square), mp.mpf(piece.centre[0]) - turning.x

    def drop(f: Any) -> Any:
        """Twice the work done from f = 0 on, over the moment of inertia."""
        x = away + rho * mp.sin(f)
        return 2 * (g * rho * mp.cos(f) + square * x * x / 2) / (kappa * rho * rho)

    energy = mp.mpf(rate) ** 2 - drop(mp.mpf(angle))

    def squared(f: Any) -> Any:
        return energy + drop(f)

    def normal(f: Any) -> Any:
        return g * mp.cos(f) + square * (away + rho * mp.sin(f)) * mp.sin(f) + rho * squared(f)

    def spare(f: Any) -> Any:
        pull = square * (away + rho * mp.sin(f)) * mp.cos(f) - g * mp.sin(f)
        return limit * normal(f) - (1 - 1 / kappa) * abs(pull)

    zeros = {"turning": squared, "slip": spare, "lift_off": normal}
    events = found.events
    first, t = mp.mpf(angle), mp.mpf(0)
    names = set()
    for name, at, s in zip(events["event"], events["t"], events["s"], strict=True):
        if name not in zeros or at == 0.0:
            continue
        guess = piece.angle_start + (s - piece.start_s) / piece.radius
        place = mp.findroot(zeros[name], (guess - 1e-9, guess + 1e-9))
        assert abs(place - guess) < 1e-14
        ways = [first, (first + place) / 2, place]
        t += abs(mp.quad(lambda f: 1 / mp.sqrt(abs(squared(f))), ways))
        assert abs(t - at) < 2e-14 * (1 + t)
        first = place
        names.add(str(name))
    assert len(names) >= 2


@pytest.mark.parametrize("scene", [on_three_arcs(), over_the_hump()])
def test_a_one_sided_run_ends_at_the_first_lift_off(scene: dict[str, Any]) -> None:
    events = run(scene).events
    first = float(events["t"][events["event"] == "lift_off"][0])
    alone = run(scene | {"trace": scene["trace"] | {"surface": "one-sided"}})
    assert alone.end_cause == "lift_off"
    assert alone.summary_record()["end_time"] == pytest.approx(first, rel=1e-13)
    assert alone.events["event"][-1] == "lift_off"


def test_a_one_sided_line_that_turns_loses_a_body() -> None:
    # N/m = g cos a + Omega^2 (x_C - x0) sin a: left of the axis, uphill to the right.
    scene = data(
        [{"shape": "line", "length": 6.0}], [ball(1, None, position=1.5, speed=-1.0)],
        {"x": 5.0, "rate": 1.6}, "40 deg", stop={"time": 20.0},
    )  # fmt: skip
    scene["trace"]["surface"] = "one-sided"
    found = run(scene)
    assert found.end_cause == "lift_off"
    end = float(found.summary_record()["end_time"])
    assert end > 0.1
    state = found.sample([end])
    slope = np.radians(40.0)
    away = 1.6**2 * (state["x"][0] - 5.0)
    assert abs(9.81 * np.cos(slope) + away * np.sin(slope)) < 1e-12


@pytest.fixture
def integrated(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Run a scene with its groups integrated in short segments, by collocation."""
    closed = {launch_group_on_line, set_group_flow, set_release, limit_by_lift_off}
    kept = {one: other for one, other in TURNING.replaced.items() if one not in closed}
    variant = Overrides("integrated", {**kept, launch_group: launch_across})

    def solved(scene: dict[str, Any]) -> Run:
        monkeypatch.setattr(SYSTEM, "overrides", lambda _: variant)
        return run(scene, "python")

    return solved


@pytest.mark.parametrize(
    "scene",
    [
        on_circle(collision=PLASTIC, stop={"time": 14.0}),
        three_bodies(2.0, 0.3),
        three_bodies(3.3, 0.3),
        three_bodies(1.0, 5.0),
        up_a_loop(0.7, 2.0),
        up_a_loop(1.7, 2.0),
        on_a_slope("-15 deg", 0.5, 4.0),
        on_a_slope("-30 deg", 1.0, 1.0),
    ],
)
def test_groups_in_closed_form_are_those_integrated(scene: dict[str, Any], integrated: Any) -> None:
    closed, other = run(scene, "python"), integrated(scene)
    one, two = closed.summary_record(), other.summary_record()
    assert one["contacts"] >= 1
    for name in ("end_cause", "collisions", "arc_1", "arc_2"):
        assert one[name] == two[name]
    for name in ("end_time", "energy_end", "s_1", "s_2", "speed_1", "speed_2"):
        assert one[name] == pytest.approx(two[name], rel=1e-9, abs=1e-9), name
    if one["end_cause"] != "lift_off":
        for name in ("min_normal_force", "max_friction_demand"):
            assert one[name] == pytest.approx(two[name], rel=1e-7), name
    opened = [found.events["event"] == "contact_opened" for found in (closed, other)]
    assert closed.events["t"][opened[0]] == pytest.approx(other.events["t"][opened[1]], abs=1e-9)


COMPARED: list[float] = []


@kernel
def compared(world: World, first: int, count: int) -> None:
    """Compare the polynomials that say when a body lifts off with the forces of an instant."""
    for step in range(count):
        set_speed(world, first + step)
    for step in range(count - 1):
        set_normals(world, first + step)
    contact_forces(world, first, count - 1)
    forces = [normal_force_now(world, first, count, step) for step in range(count)]
    flight = world.flights[first]
    for step, force in enumerate(forces):
        h = normal_harmonics(world, first, count, step)
        s, c = flight.flow_s, flight.flow_c
        value = harmonic_value(h, 2.0 * s * c, (c - s) * (c + s))
        assert value == pytest.approx(force, rel=1e-11)
        COMPARED.append(value)


def test_normal_forces_of_a_group_are_those_of_its_bodies(monkeypatch: pytest.MonkeyPatch) -> None:
    COMPARED.clear()
    variant = Overrides("compared", {**TURNING.replaced, limit_by_lift_off: compared})
    monkeypatch.setattr(SYSTEM, "overrides", lambda _: variant)
    scene = up_a_loop(0.7, 2.0)
    scene["balls"].append(scene["balls"][1] | {"density": 3000})
    run(scene, "python")
    assert len(COMPARED) >= 3
