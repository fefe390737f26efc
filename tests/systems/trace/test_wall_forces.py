"""Bodies at rest, leaning on one another and on a wall: the forces of the trace against statics."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from vibro_cli.kernels.cluster.trace_forces import AT_TIME, set_forces
from vibro_cli.kernels.world import Flight, World
from vibro_cli.mechanics.system import InitialState
from vibro_cli.stress.scenes import GRAVITY, scene, solve_any
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system

RADII, MASSES = (0.1, 0.2, 0.1), (1.0, 2.0, 0.5)


def leaning(shape: str, side: str, slope: float = 20.0) -> Run:
    """Three balls that roll down to a wall, where an arc has a slope (deg), and come to rest."""
    sign = 1.0 if side == "left" else -1.0
    ends = (math.radians(slope), math.radians(slope + 40.0))
    if side == "right":
        ends = (-ends[1], -ends[0])
    places = [math.radians(slope + 5.0 + 10.0 * n) for n in range(3)]
    arc: dict[str, Any] = {"shape": "valley", "radius": 3.0, "end_slope": ends[1]}
    start, key = ends[0], "angle"
    if shape == "line":
        places = [0.5 + n for n in range(3)] if side == "left" else [2.5 - n for n in range(3)]
        arc, start, key, sign = (
            {"shape": "line", "length": 3.0},
            sign * math.radians(20.0),
            "position",
            1.0,
        )
    balls = [
        {"radius": radius, "mass": mass, "arc": 1, key: sign * place}
        for radius, mass, place in zip(RADII, MASSES, places, strict=True)
    ]
    trace = {"start_slope": start, "arcs": [arc]}
    document = scene(trace, balls if side == "left" else balls[::-1], 0.3, time=4.0)
    document["ends"] = {"left": {"wall": 0.3}, "right": {"wall": 0.3}}
    return solve_any(document, "python")


def statics(run: Run, side: str) -> list[float]:
    """Return normal forces (N) from the balance of each body, from the free end to the wall."""
    now = run.sample([4.0])
    order = [2, 1, 0] if side == "left" else [0, 1, 2]
    piece = run.system.trace.pieces[0]
    forces: dict[int, float] = {}
    push = (0.0, 0.0)
    for number, following in zip(order, [*order[1:], None], strict=True):
        slope = piece.start_slope if piece.is_line else float(now["angle"][number])
        tangent, normal = (math.cos(slope), math.sin(slope)), (-math.sin(slope), math.cos(slope))
        force = [push[0], push[1] - run.system.bodies[number].mass * GRAVITY]
        if following is not None:
            away = [float(now[axis][number] - now[axis][following]) for axis in "xy"]
            along = force[0] * tangent[0] + force[1] * tangent[1]
            held = along / (away[0] * tangent[0] + away[1] * tangent[1])
            push = (held * away[0], held * away[1])
            force = [force[0] - push[0], force[1] - push[1]]
        forces[number] = -(force[0] * normal[0] + force[1] * normal[1])
    return [forces[number] for number in range(3)]


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("shape", ["line", "arc"])
def test_the_trace_carries_what_statics_says(shape: str, side: str) -> None:
    run = leaning(shape, side)
    assert run.end_cause == "time"
    assert not {"lift_off", "slip"} & set(run.events["event"].tolist())
    world: World = run.trajectory.world  # type: ignore[attr-defined]
    row = max(number for number, row in enumerate(world.log) if row.group_first == row.body)
    assert (world.log[row].at_rest, world.log[row].group_count) == (1, 3)
    set_forces(world, row, AT_TIME, 0.0, Flight())
    found = world.forces[:3]
    assert [one.normal for one in found] == pytest.approx(statics(run, side), rel=1e-12)
    assert [one.friction for one in found] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_summary_tells_the_least_of_them(side: str) -> None:
    """Against the same forces, from a run that begins hard by its wall: the rest is the least."""
    whole = leaning("arc", side)
    angles = whole.sample([4.0])["angle"]
    states = tuple(InitialState(0, float(angle), 0.0) for angle in angles)
    run = simulate_system(replace(whole.system, initial=states), 1.0, None, "python")
    least = run.summary_record()["min_normal_force"]
    assert least == pytest.approx(min(statics(whole, side)), rel=1e-9)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("slope", [20.0, 40.0, 70.0, 86.0, 130.0])
def test_a_one_sided_trace_lets_bodies_go_that_it_would_have_to_pull(
    slope: float, side: str
) -> None:
    whole = leaning("arc", side, slope)
    states = tuple(InitialState(0, float(x), 0.0) for x in whole.sample([4.0])["angle"])
    system = replace(whole.system, surface="one-sided", initial=states)
    run = simulate_system(system, 1.0, None, "python")
    forces = statics(whole, side)
    pulled = [number + 1 for number in range(3) if forces[number] < 0.0]
    assert (run.end_cause, run.end_time) == (("lift_off", 0.0) if pulled else ("time", 1.0))
    if pulled:
        assert run.events["event"].tolist() == ["lift_off"]
        assert run.events["ball"][0] in pulled
