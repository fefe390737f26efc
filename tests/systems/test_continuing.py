"""A run in parts is the run in one, to the last bit, on a table and with springs."""

from __future__ import annotations

import hashlib
import json
import math
import tomllib
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.systems.springs_cases import FIGURE_FIVE, disk, spring, springs
from tests.systems.table_cases import ball, box, ellipse, table
from vibro_cli.api import simulate
from vibro_cli.scenario import any_scenario_of
from vibro_cli.systems import NAMES, system_named
from vibro_cli.systems.driver import CHECKPOINT_FORMAT, CannotContinue

Document = dict[str, Any]
HARD_CASES = Path(__file__).parent / "hard_cases"
GAS = [ball(0.3 * n - 0.9, 0.1 * (-1) ** n, 0.7 - 0.3 * n, 0.4 * n) for n in range(6)]
PRESSED = springs(
    [
        disk(-1.0, 0.0, spring(stiffness=9.0, height=1.0, length=1.0, foot=0.4)),
        disk(1.0, 0.0, spring(stiffness=9.0, height=1.0, length=1.0, foot=-0.4)),
    ],
    k=0.5,
)
# A light body between heavy ones that springs press together: an instant of a thousand impacts,
# the last of which begin contact and are told of its loss.
ROW = springs(
    [
        disk(place, speed, spring(9.0, 1.0, 1.0, 0.4 - 0.4 * place), mass=mass)
        for place, speed, mass in ((0.0, 1.0, 1.0), (0.8, 0.0, 1e-4), (1.6, -0.5, 2.0))
    ],
    k=0.1,
)
# Two held pairs are struck, and hold after the impacts that follow.
THREE_PRESSED = tomllib.loads((HARD_CASES / "springs_three_pressed.toml").read_text())
CASES: dict[str, tuple[Document, list[Document]]] = {
    "gas": (
        table(GAS, box(3.0, 2.0), k=0.97),
        [{"time": 0.31}, {"collisions": 9}, {"bounces": 30}, {"time": 12.5}],
    ),
    "ellipse": (table([ball(0.3, 0.1, 0.9, 0.7)], ellipse(2.0, 1.2)), [{"time": 3.0}, {"time": 9}]),
    "figure 5": (
        springs(FIGURE_FIVE),
        [{"time": 1.1}, {"collisions": 4}, {"time": 12.3}, {"time": 12.4}, {"time": 20.0}],
    ),
    "within an instant": (ROW, [*({"collisions": count} for count in (3, 4, 400)), {"time": 1.0}]),
    "three pressed": (THREE_PRESSED, [{"collisions": 300}, {"collisions": 301}, {"time": 5.3}]),
    "lasting contact": (PRESSED, [{"time": 0.7}, {"collisions": 12}, {"time": 4.0}, {"time": 9.0}]),
}


def solved(document: Document, stop: Document, *earlier: Any, engine: str = "compiled") -> Any:
    return simulate(any_scenario_of({**document, "stop": stop}), engine, *earlier)


@cache
def whole_of(name: str) -> Any:
    document, stops = CASES[name]
    return solved(document, stops[-1])


@pytest.mark.parametrize(
    ("name", "engine"),
    [
        *((name, "compiled") for name in CASES),
        *((name, "python") for name in CASES if name != "within an instant"),
        pytest.param("within an instant", "python", marks=pytest.mark.long),
    ],
)
def test_a_run_in_parts_has_the_bits_of_one(name: str, engine: str) -> None:
    document, stops = CASES[name]
    whole = whole_of(name)
    part = solved(document, stops[0], engine=engine)
    for stop in stops[1:]:
        checkpoint = json.loads(json.dumps(part.checkpoint()))
        part = solved(document, stop, checkpoint, part.history(), engine=engine)
    assert part.summary_record() == whole.summary_record()
    assert part.checkpoint() == whole.checkpoint()
    history = part.history()
    for log, rows in whole.history().items():
        assert len(rows) > (1 if log != "pair_log" or name == "gas" else -1)
        np.testing.assert_array_equal(history[log], rows)
    for side in ("before", "after"):
        times = np.linspace(0.0, whole.end_time, 97)
        found = part.sample(times, side)
        for column, values in whole.sample(times, side).items():
            np.testing.assert_array_equal(found[column], values)
    final = whole.sample([whole.end_time])
    for body in range(1, len(document["balls"]) + 1):
        assert whole.summary_record()[f"x_{body}"] == final["x"][body - 1]


@pytest.mark.parametrize("engine", ["compiled", "python"])
@pytest.mark.parametrize("system", ["trace", "table"])
def test_what_happens_at_the_stop_itself_still_happens(system: str, engine: str) -> None:
    """A disk at 0.5 m/s meets one at rest after 0.5 m, and that one a wall after as much again."""
    disks = [{"body": "disk", "radius": 0.25, "mass": 1.0} for _ in range(2)]
    document: Document = {"collision": {"k": 1.0}}
    if system == "table":
        document |= {"system": "table", "wall": {"shape": "rectangle", "k": 1.0}}
        document["wall"] |= {"width": 5.5, "depth": 8.0}
        places = {"x": 1.0, "y": 0.0, "velocity_x": 0.5}, {"x": 2.0, "y": 0.0}
    else:
        arcs = [{"shape": "line", "length": 2.75}]
        document |= {"gravity": 8.0, "trace": {"start_slope": 0.0, "arcs": arcs}}
        document["ends"] = {"right": {"wall": 1.0}}
        places = {"arc": 1, "position": 1.0, "speed": 0.5}, {"arc": 1, "position": 2.0}
    document["balls"] = [one | place for one, place in zip(disks, places, strict=True)]
    before = solved(document, {"time": math.nextafter(1.0, 0.0)}, engine=engine)
    assert before.summary_record()["collisions"] == 0
    part = solved(document, {"time": 1.0}, engine=engine)
    assert part.end_cause == "time"
    assert part.collisions["t"].tolist() == [1.0]
    assert part.sample([1.0])["speed"].tolist() == [0.0, 0.5]
    name = "bounces" if system == "table" else "events"
    for end, impacts, others in ((2.0, [1.0], [2.0]), (3.0, [1.0, 3.0], [2.0])):
        earlier = json.loads(json.dumps(part.checkpoint())), part.history()
        part = solved(document, {"time": end}, *earlier, engine=engine)
        assert part.collisions["t"].tolist() == impacts
        assert getattr(part, name)["t"].tolist() == others
        whole = solved(document, {"time": end}, engine=engine)
        assert part.summary_record() == whole.summary_record()


@pytest.mark.parametrize("engine", ["compiled", "python"])
@pytest.mark.parametrize("system", ["trace", "table", "springs"])
def test_an_impact_later_than_the_stop_by_less_than_rounding_does_not_happen(
    system: str, engine: str
) -> None:
    """The time of an impact is t + t_low, of which t alone may be the stop."""
    scenarios = Path(__file__).parents[2] / "scenarios"
    document: Document = {
        "trace": tomllib.loads((scenarios / "three_arcs.toml").read_text()),
        "table": table(GAS, box(3.0, 2.0)),
        "springs": springs(FIGURE_FIVE, k=1.0),
    }[system]
    whole = solved(document, {"collisions": 12}).collisions
    times = [Fraction(t) + Fraction(low) for t, low in zip(whole["t"], whole["t_low"], strict=True)]
    sides = set()
    for stop, exact in zip(whole["t"].tolist(), times, strict=True):
        made = solved(document, {"time": stop}, engine=engine).collisions
        assert made["t"].tolist() == [
            t for t, e in zip(whole["t"], times, strict=True) if e <= Fraction(stop)
        ]
        sides.add(exact > Fraction(stop))
    assert sides == {True, False}


def test_what_cannot_go_on_is_refused() -> None:
    document, _ = CASES["gas"]
    run = solved(document, {"bounces": 3, "time": 4.0})
    for stop, message in (
        ({"time": 0.1}, "expected a later stop.time"),
        ({"bounces": 3}, "has 3 impacts on the wall; expected a greater stop.bounces"),
    ):
        with pytest.raises(CannotContinue, match=message):
            solved(document, stop, run.checkpoint(), run.history())
    lost = solved(table([ball(0.0, 0.0, 1.0, 0.4)], ellipse(2.0, 1.2, 0.5)), {"time": 100.0})
    with pytest.raises(CannotContinue, match="ended for good: wall_contact"):
        solved(document, {"time": 200.0}, lost.checkpoint(), lost.history())


def test_another_layout_of_the_state_has_another_format() -> None:
    """A field added under the same format would be read from the place of another."""
    loops = [system_named(name).loop for name in NAMES]
    layout = [[list(loop.records[name].fields) for name in loop.state] for loop in loops]  # type: ignore[attr-defined]
    digest = hashlib.sha256(json.dumps(layout).encode()).hexdigest()[:16]
    assert (CHECKPOINT_FORMAT, digest) == (8, "140a0c21b60e01bc")
