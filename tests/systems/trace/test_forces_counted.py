"""Which forces of a run count, and energies beside walls, against statics and formulas."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from vibro_cli.api import simulate
from vibro_cli.scenario import scenario_of
from vibro_cli.systems.run import Run

GRAVITY, RADIUS = 10.0, 0.1
STEEP, FLAT = 1.0, 0.2  # slopes of the two ends of an arc (rad)


def run_of(
    arc: dict[str, Any], start: float, balls: list[dict[str, Any]], **keys: Any
) -> tuple[Run, dict[str, Any]]:
    """Return a run on one piece, and its summary."""
    trace = {"start_slope": start, "arcs": [arc], **keys.pop("trace", {})}
    document = {"gravity": GRAVITY, "trace": trace, "balls": balls, **keys}
    run = simulate(scenario_of(document))
    return run, run.summary_record()


def arc_of(shape: str) -> tuple[dict[str, Any], float, dict[str, float], float, float]:
    """A piece, its slope at the left end, a place at its right wall, and slope and x there."""
    if shape == "line":
        slope = -0.5
        x = 0.9 * math.cos(slope) - RADIUS * math.sin(slope)
        return {"shape": "line", "length": 1.0}, slope, {"position": 0.9}, slope, x
    sign = 1.0 if shape == "valley" else -1.0
    start, end = (-STEEP, -FLAT) if shape == "valley" else (FLAT, -STEEP)
    rho = 1.0 - sign * RADIUS
    slope = end - sign * math.asin(RADIUS / rho)
    x = sign * (rho * math.sin(slope) - math.sin(start))
    arc = {"shape": shape, "radius": 1.0, "end_slope": end}
    return arc, start, {"angle": sign * slope}, slope, x


@pytest.mark.parametrize("rate", [None, 0.5])
@pytest.mark.parametrize("shape", ["line", "valley", "hump"])
def test_a_body_that_rests_at_a_wall_needs_no_friction(shape: str, rate: float | None) -> None:
    arc, start, place, slope, x = arc_of(shape)
    ball = {"body": "hoop", "radius": RADIUS, "mass": 1.0, "arc": 1, **place}
    turning = {} if rate is None else {"turning": {"x": 0.0, "rate": rate}}
    run, summary = run_of(
        arc,
        start,
        [ball],
        trace=turning,
        ends={"right": {"wall": 0.3}},
        stop={"time": 1.0},
        output={"friction": 0.01},
    )
    assert run.end_cause == "time"
    outwards = 0.0 if rate is None else rate * rate * x
    normal = GRAVITY * math.cos(slope) + outwards * math.sin(slope)
    assert summary["min_normal_force"] == pytest.approx(normal, rel=1e-12)
    assert summary["max_friction_demand"] == 0.0
    assert "slip" not in run.events["event"].tolist()


@pytest.mark.parametrize("rate", [None, 1e-6])
def test_speeds_that_last_no_time_have_no_forces(rate: float | None) -> None:
    """A heavy disk hits a light one that another stops: at that speed it would leave the hump."""
    balls = [
        {"body": "disk", "radius": RADIUS, "mass": mass, "arc": 1, **place}
        for mass, place in (
            (1.0, {"angle": -0.2, "speed": 1.9}),
            (0.1, {"touching": "previous"}),
            (1.0, {"touching": "previous"}),
        )
    ]
    turning = {} if rate is None else {"turning": {"x": 1.0, "rate": rate}}
    run, summary = run_of(
        {"shape": "hump", "radius": 1.0, "end_slope": -STEEP},
        STEEP,
        balls,
        trace=turning,
        collision={"law": "normal-impulse", "k": 1.0},
        stop={"time": 0.01},
    )
    impacts = run.collisions
    assert set(impacts["t"]) == {0.0}
    rho = 1.0 + RADIUS
    assert max(impacts["speed_b_post"]) ** 2 > GRAVITY * rho
    motion = run.sample(np.linspace(0.0, 0.01, 2001))
    masses = np.tile([1.0, 0.1, 1.0], 2001)
    sine, cosine = np.sin(motion["angle"]), np.cos(motion["angle"])
    normal = masses * (GRAVITY * cosine - motion["speed"] ** 2 / rho)
    demand = masses * GRAVITY * abs(sine) / 3.0 / normal
    assert summary["min_normal_force"] == pytest.approx(normal.min(), rel=1e-6)
    assert summary["max_friction_demand"] == pytest.approx(demand.max(), rel=1e-6)


@pytest.mark.parametrize("kappa", [1.0, 1.4, 1.5, 2.0])
def test_a_body_leaves_a_hump_once(kappa: float) -> None:
    ball = {"inertia_ratio": kappa - 1.0, "radius": RADIUS, "mass": 1.0, "arc": 1}
    for start in np.linspace(0.01, 0.3, 30):
        run, _ = run_of(
            {"shape": "hump", "radius": 1.0, "end_slope": -1.5},
            STEEP,
            [ball | {"angle": float(start)}],
            trace={"surface": "one-sided"},
            stop={"time": 10.0},
        )
        assert run.events["event"].tolist() == ["lift_off"]
        angle = math.acos(2.0 * math.cos(start) / (2.0 + kappa))
        assert run.events["s"] - 1.0 * STEEP == pytest.approx([angle], rel=1e-12)


@pytest.mark.parametrize("shape", ["line", "hump"])
@pytest.mark.parametrize("rate", [1e-9, 1.3])
def test_energies_beside_a_wall_count_from_the_end_of_the_trace(shape: str, rate: float) -> None:
    """As on a trace at rest, whose walls do not change them."""
    arc, start, place, slope, _ = arc_of(shape)
    key, value = next(iter(place.items()))
    ball = {"body": "hoop", "radius": RADIUS, "mass": 1.0, "arc": 1, key: value - 0.3}
    _, summary = run_of(
        arc,
        start,
        [ball],
        trace={"turning": {"x": 0.0, "rate": rate}},
        ends={"right": {"wall": 0.3}},
        stop={"time": 0.01},
    )

    def potential(along: float) -> float:
        if shape == "line":
            x = along * math.cos(slope) - RADIUS * math.sin(slope)
            y = along * math.sin(slope) + RADIUS * math.cos(slope)
        else:
            x = math.sin(start) + (1.0 + RADIUS) * math.sin(along)
            y = (1.0 + RADIUS) * math.cos(along)
        return GRAVITY * y - 0.5 * (rate * x) ** 2

    end = 1.0 if shape == "line" else STEEP
    energy = potential(value - 0.3) - potential(end)
    assert summary["energy_start"] == pytest.approx(energy, rel=1e-12)


def test_a_body_on_a_slope_is_pressed_by_its_share_of_the_weight() -> None:
    """N = m g cos a, and the friction is (1 - 1/kappa) m g sin a."""
    slope, body = -0.4, {"radius": RADIUS, "mass": 2.0, "arc": 1, "position": 0.5}
    _, record = run_of({"shape": "line", "length": 4.0}, slope, [body], stop={"time": 0.3})
    assert record["min_normal_force"] == pytest.approx(2.0 * GRAVITY * math.cos(slope), rel=1e-15)
    assert record["max_friction_demand"] == pytest.approx(0.4 / 1.4 * math.tan(0.4), rel=1e-15)


@pytest.mark.parametrize(("rate", "time"), [(3.0, 0.15), (-3.0, 0.15), (3.0, 1.2)])
def test_forces_of_bodies_that_roll_together_are_those_of_the_motion(
    rate: float, time: float
) -> None:
    """Up a valley, and stopped before they turn or after.

    The force F between them gives both one acceleration: F cos(b/2) = m g (sin of b - mean sin),
    N = m g cos + m v^2/rho + F sin(b/2), where they touch at the difference b of their angles. The
    friction is (1 - 1/kappa) m g (mean sin).
    """
    body: dict[str, Any] = {"radius": RADIUS, "mass": 2.0, "arc": 1, "rate": rate}
    balls = [body | {"angle": 0.0}, body | {"touching": "previous"}]
    collision = {"law": "normal-impulse", "k": 0.0}
    arc = {"shape": "valley", "radius": 1.0, "end_slope": 1.5}
    run, record = run_of(arc, -1.5, balls, collision=collision, stop={"time": time})
    assert list(run.events["event"]) == ["contact_closed"]
    motion = run.sample(np.linspace(0.0, time, 4001))
    angle, speed = (motion[name].reshape(-1, 2) for name in ("angle", "speed"))
    half, rho = math.asin(RADIUS / 0.9), 0.9
    apart = np.sin(angle[:, 1]) - np.mean(np.sin(angle), axis=1)
    force = 2.0 * GRAVITY * apart / math.cos(half)
    normal = 2.0 * (GRAVITY * np.cos(angle) + speed**2 / rho) + force[:, None] * math.sin(half)
    assert record["min_normal_force"] == pytest.approx(np.min(normal), rel=1e-6)
    assert record["min_normal_force"] <= np.min(normal) * (1.0 + 1e-13)
    friction = 0.8 / 1.4 * GRAVITY * np.abs(np.mean(np.sin(angle), axis=1))[:, None]
    demand = np.max(friction / normal)
    assert record["max_friction_demand"] == pytest.approx(demand, rel=1e-6)
    assert record["max_friction_demand"] >= demand * (1.0 - 1e-13)


@pytest.mark.parametrize("rate", [8.0, -8.0])
def test_the_force_on_a_body_up_a_loop_is_least_where_it_ends_below_the_top(rate: float) -> None:
    """N = m g cos + m v^2/rho falls with the height; it could go on over the top."""
    arc = {"shape": "valley", "radius": 1.0, "end_slope": 2.9}
    body = {"radius": RADIUS, "mass": 2.0, "arc": 1, "angle": 0.0, "rate": rate}
    run, record = run_of(arc, -2.9, [body], stop={"time": 0.32})
    end = run.sample([0.32])
    angle, speed = float(end["angle"][0]), float(end["speed"][0])
    assert 2.0 < abs(angle) < 2.4
    normal = 2.0 * (GRAVITY * math.cos(angle) + speed**2 / 0.9)
    assert record["min_normal_force"] == pytest.approx(normal, rel=1e-13)


@pytest.mark.parametrize("limit", [0.15, 0.25])
@pytest.mark.parametrize("start", [-1.3, 0.9])
def test_a_body_in_a_valley_slips_when_its_motion_says(start: float, limit: float) -> None:
    """Friction (1 - 1/kappa) m g |sin| exceeds its limit times N = m g cos + m v^2/rho."""
    arc = {"shape": "valley", "radius": 1.0, "end_slope": 1.5}
    body = {"radius": RADIUS, "mass": 2.0, "arc": 1, "angle": start}
    keys: dict[str, Any] = {"stop": {"time": 6.0}, "output": {"friction": limit}}
    run, _ = run_of(arc, -1.5, [body], **keys)
    times = np.linspace(0.0, 6.0, 60_001)
    motion = run.sample(times)
    friction = 0.4 / 1.4 * GRAVITY * np.abs(np.sin(motion["angle"]))
    normal = GRAVITY * np.cos(motion["angle"]) + motion["speed"] ** 2 / 0.9
    slips = friction > limit * normal
    begin = [0.0] * int(slips[0]) + times[1:][slips[1:] & ~slips[:-1]].tolist()
    assert len(begin) > 4
    found = run.events["t"][run.events["event"] == "slip"]
    assert found == pytest.approx(np.array(begin), abs=1.1e-4)
