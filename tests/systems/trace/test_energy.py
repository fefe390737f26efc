"""Energy: conserved at k = 1 over many impacts, lost by the law at k < 1."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vibro_cli.api import simulate
from vibro_cli.scenario import load_any, scenario_of
from vibro_cli.scenario.base import AnyScenario
from vibro_cli.stress.oracles.scene import Real, Scene, mp, scene_of_system
from vibro_cli.stress.scenes import CIRCLE, Document, ball, scene, solve_any, three_arcs
from vibro_cli.systems.run import Run

FOLDER = Path(__file__).parents[3] / "scenarios"
HARD_CASES = Path(__file__).parents[2] / "hard_cases"
IMPACTS = 100_000
EPSILON = 2.0**-52


def _ball(angle: float, density: float, arc: int = 1) -> dict[str, Any]:
    return {"radius": 0.1, "density": density, "arc": arc, "angle": angle}


ON_CIRCLE = scene(
    CIRCLE, [_ball(-0.72, 7800.0), _ball(0.54, 2700.0)], 1.0, "hedrih", collisions=IMPACTS
)
# Both balls roam over the hump; hedrih would end inadmissible at a touch on two different arcs.
ON_THREE_ARCS = scene(
    three_arcs(150), [_ball(-1.3, 7800.0), _ball(0.2, 6000.0, 3)], collisions=IMPACTS
)


@pytest.mark.parametrize("document", [ON_CIRCLE, ON_THREE_ARCS], ids=["circle", "three arcs"])
def test_no_drift_over_many_elastic_impacts(document: dict[str, Any]) -> None:
    run = simulate(scenario_of(document), "compiled")
    table, record = run.collisions, run.summary_record()
    assert len(table["n"]) == IMPACTS
    assert record["end_cause"] == "collisions"
    assert abs(record["energy_drift"]) < 1e-12
    # The stored energy is not the only evidence: the states themselves have it.
    before, after = (state_energy(run, when) for when in ("pre", "post"))
    start = float(before[0])
    assert np.max(np.abs(before - start)) < 1e-12 * start
    assert np.max(np.abs(after - start)) < 1e-12 * start
    # What was corrected to keep it stays of the order of rounding for each impact.
    assert record["energy_correction"] < 64 * EPSILON * IMPACTS * start


def rotating_valley(balls: list[dict[str, Any]], **stop: Any) -> Run:
    """Return bodies between two elastic walls."""
    trace = {
        "start_slope": -1.2,
        "arcs": [{"shape": "valley", "radius": 1.0, "end_slope": 1.2}],
        "turning": {"x": 0.3, "rate": 1.7},
    }
    document = scene(trace, [{"arc": 1, **ball} for ball in balls], **stop)
    document["ends"] = {"left": {"wall": 1.0}, "right": {"wall": 1.0}}
    return solve_any(document)


FIVE = [
    {"angle": -0.8 + 0.4 * i, "rate": rate, "mass": mass, "radius": 0.02 + 0.005 * i}
    for i, (rate, mass) in enumerate([(0.5, 1.0), (-1.0, 0.7), (0.3, 2.1), (0.8, 0.4), (-0.2, 1.5)])
]
ONE = [{"angle": -0.5, "rate": 5.0, "mass": 1.0, "radius": 0.03}]


@pytest.mark.parametrize(
    ("balls", "stop"),
    [(FIVE, {"collisions": IMPACTS}), (ONE, {"time": 50_000.0})],
    ids=["five", "one at the walls"],
)
def test_states_on_a_rotating_trace_keep_the_energy_that_is_carried(
    balls: list[dict[str, Any]], stop: dict[str, float]
) -> None:
    run = rotating_valley(balls, **stop)
    record = run.summary_record()
    ends = []
    for when in (0.0, record["end_time"]):
        state = run.sample([when])
        total = 0.0
        for body, angle, speed in zip(
            run.system.bodies, state["angle"], state["speed"], strict=True
        ):
            rho = 1.0 - body.radius
            x = math.sin(1.2) + rho * math.sin(angle)
            total += 0.5 * body.kappa * body.mass * speed**2 - 9.81 * body.mass * rho * math.cos(
                angle
            )
            total -= 0.5 * body.mass * 1.7**2 * (x - 0.3) ** 2
        ends.append(total)
    assert record["end_cause"] == next(iter(stop))
    assert abs(ends[1] - ends[0]) < 1e-12 * record["energy_start"]


def state_energy(run: Run, when: str) -> Any:
    """Energy of both bodies at each impact from their places and speeds, above the first bottom."""
    table = run.collisions
    total = np.zeros(len(table["n"]))
    for number, end in enumerate("ab"):
        body = run.system.bodies[number]
        lowest = -min(
            -piece.body_centre(0.0, body.radius)[1]
            for piece in run.system.trace.pieces if piece.sign > 0.0
        )  # fmt: skip
        height = table[f"y_{end}"] - lowest
        speed = table[f"speed_{end}_{when}"]
        total += body.mass * (0.5 * body.kappa * speed**2 + run.system.gravity * height)
    return total


LOSSES = {
    "one_circle": ["collision.k=0.8"],
    "three_arcs": [],
    "line_between_valleys": [],
    "closed_three_balls": ["collision.k=0.6"],
    "five_balls": [],
    "unequal_normal_impulse": [],
    "unequal_translational": [],
    "unequal_hedrih": ["collision.inadmissible=normal-impulse"],
    "disk_on_arcs": ["collision.k=0.7", "collision.law=normal-impulse"],
}


def lossy(name: str) -> AnyScenario:
    return load_any(FOLDER / f"{name}.toml", [*LOSSES[name], "stop.collisions=60"])


@pytest.mark.parametrize("name", LOSSES)
def test_each_impact_takes_what_the_law_says(name: str) -> None:
    run = simulate(lossy(name))
    table, scene = run.collisions, scene_of_system(run.system)
    checked = 0
    for row in range(len(table["n"])):
        if table["simultaneous"][row] or table["contact"][row]:
            continue
        exact, approach = law_loss(scene, run, row)
        allowed = 4.0 + 4.0 * approach
        assert abs(float(table["energy_loss"][row]) - exact) <= allowed * math.ulp(float(exact)), (
            row
        )
        checked += 1
    assert checked >= 3


def test_impacts_that_follow_one_another_at_one_instant_have_the_energies_between_them() -> None:
    """A ball strikes two that touch: each impact changes the energies by its own speeds alone."""
    run = simulate(load_any(HARD_CASES / "cradle_of_three.toml", ["stop.collisions=3"]))
    table = run.collisions
    pairs = [(int(a), int(b)) for a, b in zip(table["ball_a"], table["ball_b"], strict=True)]
    assert pairs == [(1, 2), (2, 3), (1, 2)]
    assert len(set(table["t"].tolist())) == 1
    energies: dict[int, float] = {}
    for row, pair in enumerate(pairs):
        for body, end in zip(pair, "ab", strict=True):
            before, after = (float(table[f"energy_{end}_{when}"][row]) for when in ("pre", "post"))
            u, v = (float(table[f"speed_{end}_{when}"][row]) for when in ("pre", "post"))
            # 1 kg, 7/5 of it rolling.
            assert after - before == pytest.approx(0.7 * (v**2 - u**2), rel=1e-12)
            assert before == pytest.approx(energies.get(body, before), rel=1e-12)
            energies[body] = after


def law_loss(scene: Scene, run: Run, row: int) -> tuple[Real, float]:
    """Loss of a row from its own speeds before, B (20) and its like; and the digits lost in them.

    The relative speed u is a difference of doubles that are exact; its rounding in the solver,
    eps max|v|/|u|, is no error of the law's and comes on top of the 4 units.
    """
    table = run.collisions
    a, b = int(table["ball_a"][row]) - 1, int(table["ball_b"][row]) - 1
    one, two = scene.bodies[a], scene.bodies[b]
    va, vb = (mp.mpf(float(table[f"speed_{end}_pre"][row])) for end in "ab")
    k = scene.restitution[-1 if abs(a - b) > 1 else min(a, b)]
    law = str(table["law"][row])
    if law == "hedrih":
        ja, jb = (body.kappa * body.mass * body.radius**2 for body in (one, two))
        u, mass = va / one.radius - vb / two.radius, ja * jb / (ja + jb)
        size = max(abs(va / one.radius), abs(vb / two.radius))
    elif law == "translational":
        u, size = va - vb, max(abs(va), abs(vb))
        mass = one.kappa * one.mass * two.mass / (one.mass + two.mass)
    else:
        ca, cb = normals(scene, run, row)
        u, size = va * ca - vb * cb, max(abs(va * ca), abs(vb * cb))
        mass = 1 / (ca**2 / (one.kappa * one.mass) + cb**2 / (two.kappa * two.mass))
    return (1 - k**2) / 2 * mass * u**2, float(size / abs(u))


def normals(scene: Scene, run: Run, row: int) -> tuple[Real, Real]:
    """n t of both bodies in contact: on one arc from the contact angle alone."""
    table = run.collisions
    a, b = int(table["ball_a"][row]) - 1, int(table["ball_b"][row]) - 1
    ra, rb = scene.bodies[a].radius, scene.bodies[b].radius
    piece = scene.pieces[int(table["arc_a"][row]) - 1]
    if table["arc_a"][row] == table["arc_b"][row] and piece.sign:
        rho_a, rho_b = (piece.size - piece.sign * r for r in (ra, rb))
        sine_beta = mp.sin(2 * mp.asin(mp.sqrt(ra * rb / (rho_a * rho_b))))
        return rho_b * sine_beta / (ra + rb), rho_a * sine_beta / (ra + rb)
    found = []
    centres = [[mp.mpf(float(table[f"{axis}_{end}"][row])) for axis in "xy"] for end in "ab"]
    n = [(centres[1][i] - centres[0][i]) / (ra + rb) for i in (0, 1)]
    for end in "ab":
        shape = scene.pieces[int(table[f"arc_{end}"][row]) - 1]
        slope = shape.slopes[0]
        if shape.sign:
            slope = shape.sign * mp.mpf(float(table[f"angle_{end}"][row]))
        found.append(n[0] * mp.cos(slope) + n[1] * mp.sin(slope))
    return found[0], found[1]


@pytest.mark.parametrize("name", LOSSES)
def test_energies_chain_from_row_to_row(name: str) -> None:
    """A body's energy after an impact is the one before its next; each impact's balance closes."""
    run = simulate(lossy(name))
    table = run.collisions
    contacts = set(run.events["event"].tolist()) & {"contact_closed", "contact_opened"}
    last: dict[int, float] = {}
    scale = run.summary_record()["energy_start"]
    for row in range(len(table["n"])):
        if contacts and table["contact"][row]:
            break  # from here on bodies in contact exchange energy between impacts
        for end in "ab":
            ball = int(table[f"ball_{end}"][row])
            before = float(table[f"energy_{end}_pre"][row])
            if not table["simultaneous"][row]:
                assert before == pytest.approx(last.get(ball, before), abs=4 * EPSILON * scale)
            last[ball] = float(table[f"energy_{end}_post"][row])
        if not table["simultaneous"][row]:
            change = sum(
                float(table[f"energy_{end}_pre"][row] - table[f"energy_{end}_post"][row])
                for end in "ab"
            )
            loss = float(table["energy_loss"][row])
            assert change == pytest.approx(loss, abs=8 * EPSILON * scale)


PRESSED = {
    "gravity": 9.81,
    "trace": {
        "start_slope": 0.318,
        "arcs": [{"shape": "hump", "radius": 2.848, "end_slope": -0.398}],
    },
    "balls": [
        {"body": "hoop", "radius": 0.035, "mass": 0.289, "arc": 1, "angle": -0.2475},
        {"body": "hoop", "radius": 0.035, "mass": 0.816, "arc": 1, "angle": -0.0239, "rate": 2.31},
        {"body": "hoop", "radius": 0.035, "mass": 0.0217, "arc": 1, "touching": "previous",
         "rate": 2.31},
        {"body": "hoop", "radius": 0.035, "mass": 3.28e-5, "arc": 1, "angle": 0.0721,
         "rate": -2.139},
    ],
    "collision": {"law": "hedrih", "k": [1.0, 1.0, 0.719], "inadmissible": "normal-impulse"},
    "stop": {"time": 1.594},
    "ends": {"left": "stop", "right": {"wall": 0.0}},
}  # fmt: skip


def test_the_energy_before_the_limit_of_a_sequence_goes_with_the_speed_before() -> None:
    """A light body is pressed to a wall by heavy ones, which takes its speed before the last row.

    An impact leaves a body at its height: its energy but for that of its motion stays.
    """
    table = simulate(scenario_of(PRESSED)).collisions
    last = len(table["n"]) - 1
    size = float(table["energy_b_pre"][last - 1])  # what its energy was within the instant
    heights = [
        table[f"energy_b_{when}"] - table[f"kinetic_energy_b_{when}"] for when in ("pre", "post")
    ]
    assert table["speed_b_pre"][last] == 0.0
    assert abs(heights[0][last] - heights[1][last]) <= 64.0 * EPSILON * size


def not_made(name: str) -> Document:
    """Scenes that end at impacts that are not made: two at once, one that lifts a body off."""
    if name == "inadmissible":
        trace = {"start_slope": 0.0, "arcs": [{"shape": "line", "length": 5.0}]}
        great = {"radius": 0.2, "mass": 1.0, "arc": 1, "position": 1.0, "speed": 1.0}
        small = {"radius": 0.1, "mass": 1.0, "arc": 1, "touching": "previous"}
        balls: list[Document] = [great, {**small, "speed": 0.8}, {**small, "speed": -1.0}]
        return scene(trace, balls, 0.9, "hedrih", time=1.0)
    arcs = [{"shape": "hump", "radius": 1.0, "end_slope": -0.6}]
    trace = {"start_slope": 0.6, "surface": "one-sided", "arcs": arcs}
    return scene(trace, [ball(-0.3, speed=1.0), ball(0.05)], 0.5, time=3.0)


@pytest.mark.parametrize(("name", "rows"), [("inadmissible", 2), ("lift_off", 1)])
def test_impacts_that_are_not_made_take_no_energy(name: str, rows: int) -> None:
    run = solve_any(not_made(name))
    table, record = run.collisions, run.summary_record()
    assert record["end_cause"] == name
    assert len(table["n"]) == rows
    assert not np.any(table["admissible"] | table["substituted"])
    assert record["energy_drift"] == 0.0
    assert record["energy_end"] == record["energy_start"]
    for end in "ab":
        last = table[f"ball_{end}"][-1]
        assert abs(record[f"speed_{last}"] - table[f"speed_{end}_pre"][-1]) < 1e-15
