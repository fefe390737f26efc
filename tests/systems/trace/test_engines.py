"""Interpreted and compiled kernels are the same functions: every number has the same bits."""

from __future__ import annotations

import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vibro_cli.api import simulate
from vibro_cli.kernels.contact import arc_contact, first_contact
from vibro_cli.kernels.events import event_detection
from vibro_cli.kernels.flow.flow import POLYNOMIAL
from vibro_cli.kernels.world import Flight
from vibro_cli.scenario import load_any, scenario_of
from vibro_cli.stress.scenes import CIRCLE, ball, scene
from vibro_cli.systems import driver
from vibro_cli.systems.run import Run

FOLDER = Path(__file__).parents[3] / "scenarios"
NAMES = sorted(path.stem for path in FOLDER.glob("*.toml"))
CASES = Path(__file__).parents[2] / "hard_cases"
# Groups in lasting contact, of which the gallery has few; the other hard cases are long tests.
HARD = (
    "hit_on_a_group_across",
    "level_lines_1388",
    "opened_and_closed_at_a_junction",
    "slow_group_turns_beyond_a_wall",
    "turning_group_on_a_level_line",
)
# Long enough for crossings, accumulation and lasting contact, short enough for the interpreter.
AT_MOST = 300


def shortened(path: Path) -> list[str]:
    text = path.read_text(encoding="utf-8")
    return [f"stop.collisions={AT_MOST}"] if "[collision]" in text else []


def bits(table: dict[str, Any]) -> bytes:
    """Return all columns, to the bit (including a nan and its payload)."""
    columns = []
    for name, column in table.items():
        values = column.filled(-1) if isinstance(column, np.ma.MaskedArray) else column
        columns.append((name, values.tolist() if values.dtype == object else values.tobytes()))
    return pickle.dumps(columns)


def both(name: str) -> tuple[Run, Run]:
    path = (CASES if name in HARD else FOLDER) / f"{name}.toml"
    scenario = load_any(path, shortened(path))
    return simulate(scenario, "python"), simulate(scenario, "compiled")


@pytest.mark.parametrize("name", [*NAMES, *HARD])
def test_same_bits(name: str) -> None:
    interpreted, machine = both(name)
    assert (interpreted.engine, machine.engine) == ("python", "compiled")
    assert interpreted.end_cause == machine.end_cause
    assert bits(interpreted.collisions) == bits(machine.collisions)
    assert bits(interpreted.flights()) == bits(machine.flights())
    assert bits(interpreted.events) == bits(machine.events)
    assert interpreted.summary_record() == machine.summary_record()
    for field in ("searches", "evaluations", "skipped_apart"):
        assert interpreted.clock[field] == machine.clock[field]


def test_crossings_without_end_and_without_impact_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two equal rotations never meet again: no proof ends the run, and no log is large enough."""
    monkeypatch.setattr(driver, "QUIET_ROWS", 4000)
    rate = math.sqrt(12.0**2 + 2.0 * 9.81 / (1.4 * 0.9) * (math.cos(1.5) - 1.0))
    balls = [ball(0.0, rate=12.0), ball(1.5, rate=rate)]
    document = scene(CIRCLE, balls, 1.0, "hedrih", collisions=5)
    with pytest.raises(driver.TooQuiet, match="no impact among the last 4,000 flights"):
        simulate(scenario_of(document), "python")


def wells() -> dict[str, Any]:
    """Return a rotating arc with two wells: one ball in the left, two in the right that stick."""
    arc = {"shape": "valley", "radius": 1.0, "end_slope": "90 deg"}
    turning = {"through_arc": 1, "rate": 6.0}
    ball = {"radius": 0.05, "density": 7800.0, "arc": 1}
    return {
        "gravity": 9.81,
        "trace": {"start_slope": "-90 deg", "arcs": [arc], "turning": turning},
        "balls": [{**ball, "angle": angle} for angle in ("-70 deg", "60 deg", "75 deg")],
        "collision": {"k": 0.5},
        "stop": {"collisions": 1000},
    }


def test_a_group_and_a_ball_in_another_well_are_proved_apart() -> None:
    """Nor do groups in both wells of a turning circle meet, over the top either."""
    assert simulate(scenario_of(wells())).end_cause == "no_more_collisions"
    circle = wells()
    circle["trace"]["arcs"][0]["end_slope"] = "180 deg"
    circle["trace"] |= {"start_slope": "-180 deg", "closed": True}
    circle["balls"].append({**circle["balls"][0], "angle": "-60 deg"})
    circle["balls"].sort(key=lambda ball: float(ball["angle"].split()[0]))
    run = simulate(scenario_of(circle))
    assert run.end_cause == "no_more_collisions"
    assert run.summary_record()["contacts"] == 2
    later = simulate(scenario_of(circle, ["stop.time=200"]))
    assert bits(later.collisions) == bits(run.collisions)


def test_a_pair_over_the_top_is_not_searched_for_ever_before_the_other_pair_meets() -> None:
    """The left ball has gone round once: the pair that meets is that across the seam."""
    circle = wells()
    circle["trace"]["arcs"][0]["end_slope"] = "180 deg"
    circle["trace"] |= {"start_slope": "-180 deg", "closed": True}
    circle["trace"]["turning"]["rate"] = 3.3
    balls = [{"radius": 0.03, "density": 100.0, "arc": 1, "angle": -0.39, "rate": 12.0}]
    balls.append({"radius": 0.08, "density": 2700.0, "arc": 1, "angle": -0.023})
    circle["balls"] = balls
    circle["collision"] = {"k": 0.5, "law": "normal-impulse"}
    circle["stop"]["collisions"] = 300
    run = simulate(scenario_of(circle))
    assert (run.end_cause, run.summary_record()["crossings"]) == ("collisions", 1)
    bounded = simulate(scenario_of(circle, [f"stop.time={run.end_time + 1.0}"]))
    assert bits(bounded.collisions) == bits(run.collisions)


def circle_without_stop_by_time(k: float) -> Any:
    document = load_any(FOLDER / "one_circle.toml", [f"collision.k={k}"]).resolved()
    document["stop"] = {"collisions": 100_000}
    return scenario_of(document)


def test_a_search_without_end_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the proof that ends such a run (see below)."""
    monkeypatch.setattr(event_detection, "_moves_as_one", lambda a, b: False)
    monkeypatch.setattr(event_detection, "ROUNDS", 10)
    monkeypatch.setattr(driver, "QUIET_STEPS", 3_000_000)
    with pytest.raises(driver.TooQuiet, match="no impact among the last 3,000,000 steps"):
        simulate(circle_without_stop_by_time(0.3), "python")


@pytest.mark.parametrize("name", ["three_arcs", "one_circle"])
def test_a_search_in_parts_has_the_same_bits(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    scenario = load_any(FOLDER / f"{name}.toml", ["stop.collisions=60"])
    whole = simulate(scenario, "python")
    for module in (arc_contact, first_contact):
        monkeypatch.setattr(module, "STEPS_AT_ONCE", 1)
    parts = simulate(scenario, "python")
    assert bits(parts.collisions) == bits(whole.collisions)
    assert bits(parts.flights()) == bits(whole.flights())


def test_a_group_on_a_circle_does_not_meet_itself_over_the_top() -> None:
    """Once both balls roll in contact no impact can follow: no stop by time is needed."""
    run = simulate(circle_without_stop_by_time(0.9))
    assert run.end_cause == "no_more_collisions"
    until = simulate(load_any(FOLDER / "one_circle.toml", ["stop.collisions=100000"]))
    assert until.end_cause == "time"
    assert bits(run.collisions) == bits(until.collisions)


def test_the_ends_of_a_group_over_several_pieces_are_searched() -> None:
    """Its angles do not keep apart, as those of a group on one arc do."""
    one, other = Flight(), Flight()
    one.grouped = other.grouped = 1
    assert event_detection._moves_as_one(one, other)
    one.form = other.form = POLYNOMIAL
    assert not event_detection._moves_as_one(one, other)
