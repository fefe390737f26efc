"""Laws that every run of bodies on springs obeys, several in contact at once too."""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from tests.strategies import SETTINGS
from tests.systems.springs_cases import FIGURE_FIVE, PRESSED, solve, springs
from vibro_cli.scenario import ScenarioError
from vibro_cli.systems.run import Run
from vibro_cli.systems.springs import SYSTEM

FEW = settings(SETTINGS, max_examples=25)


def _short(value: float) -> float:
    """A number of few digits: shrunk examples stay readable."""
    return round(value, 3)


@st.composite
def documents(draw: st.DrawFn) -> dict[str, Any]:
    """Two to five bodies, many of them touching, whose springs often press them together."""
    balls: list[dict[str, Any]] = []
    place = -1.0
    for number in range(draw(st.integers(2, 5))):
        spring = {
            "stiffness": draw(st.sampled_from([6.0, 20.0, 50.0])),
            "length": draw(st.sampled_from([0.5, 1.0, 5.0])),
            "height": draw(st.sampled_from([0.5, 1.0, 1.5])),
            "foot": draw(st.sampled_from([0.0, 0.5, -0.5])),
        }
        ball: dict[str, Any] = {
            "body": draw(st.sampled_from(["ball", "disk", "hoop"])),
            "radius": draw(st.sampled_from([0.1, 0.2])),
            "mass": draw(st.sampled_from([1.0, 2.0, 0.37])),
            "spring": spring,
        }
        if number and draw(st.booleans()):
            ball["touching"] = "previous"
        else:
            place += draw(st.floats(0.6, 1.2).map(_short))
            ball["position"] = _short(place)
        if draw(st.booleans()):
            ball["speed"] = draw(st.floats(-4.0, 4.0).map(_short))
        balls.append(ball)
    return {
        "system": "springs",
        "balls": balls,
        "stop": {"time": 1.5, "collisions": 80},
        "collision": {
            "k": draw(st.sampled_from([0.0, 1e-300, 0.05, 0.3, 0.6, 0.9, 1.0])),
            "law": draw(st.sampled_from(["hedrih", "normal-impulse"])),
            "inadmissible": "normal-impulse",
        },
    }


def in_units(document: dict[str, Any], time: float, length: float) -> dict[str, Any]:
    """Return the same scenario with times and lengths scaled by factors."""
    balls = []
    for ball in document["balls"]:
        spring = ball["spring"]
        ways = {name: length * spring[name] for name in ("length", "height", "foot")}
        scaled = {name: length * ball[name] for name in ("radius", "position")}
        scaled |= {"mass": time**2 * ball["mass"], "speed": length / time * ball["speed"]}
        balls.append({**ball, **scaled, "spring": {**spring, **ways}})
    stop = {**document["stop"], "time": time * document["stop"]["time"]}
    return {**document, "balls": balls, "stop": stop, "analysis": {"lyapunov": True}}


ORDINARY = [
    (springs(FIGURE_FIVE, 0.9, collisions=4, time=20.0), "python"),
    (springs(FIGURE_FIVE, 0.9, collisions=40, time=80.0), "compiled"),
    (springs(PRESSED, 0.5, collisions=400, time=9.0), "compiled"),
]


@cache
def ordinary(case: int) -> Run:
    document, engine = ORDINARY[case]
    return solve(in_units(document, 1.0, 1.0), engine)


@pytest.mark.parametrize("case", range(3))
@pytest.mark.parametrize(("time", "length"), [(-44, 0), (-90, -60), (90, 0), (140, 80)])
def test_fast_and_slow_motions_have_the_bits_of_ordinary_ones(
    case: int, time: int, length: int
) -> None:
    """Powers of two of the units of time and length round nothing: periods of 1e-27 to 1e42 s."""
    second, metre = 2.0**time, 2.0**length
    (document, engine), known = ORDINARY[case], ordinary(case)
    run = solve(in_units(document, second, metre), engine)
    units = {"s": second, "m": metre, "m/s": metre / second, "rad/s": 1.0 / second}
    units |= {"1/s": 1.0 / second, "J": metre**2, "N s": metre * second}
    units["N m s"] = metre**2 * second
    tables = (*SYSTEM.tables(), SYSTEM.summary(len(document["balls"]), grown=True))
    units_of = {column.name: column.unit for table in tables for column in table.columns}
    for name in ("collisions", "events", "exponents", "summary"):
        for column, values in getattr(known, name).items():
            unit = units_of[column]
            there = values * units[unit] if unit else values
            np.testing.assert_array_equal(getattr(run, name)[column], there, column)


@pytest.mark.usefixtures("no_hang")
@FEW
@given(document=documents())
def test_no_penetration_no_energy_from_nowhere_speeds_of_contacts(document: dict[str, Any]) -> None:
    try:
        run = solve(document, "python")
    except ScenarioError:
        reject()
    summary = run.summary_record()
    motion = run.sample(np.linspace(0.0, summary["end_time"], 400))
    bodies = len(document["balls"])
    places = motion["x"].reshape(-1, bodies)
    radii = [ball["radius"] for ball in document["balls"]]
    touch = np.array([2.0 * math.sqrt(a * b) for a, b in pairwise(radii)])
    assert np.min(np.diff(places, axis=1) - touch, initial=0.0) >= -1e-12
    rows = run.collisions
    assert np.max(np.abs(rows["gap"]), initial=0.0) <= 1e-13
    assert np.all(rows["separation_speed"] >= -1e-12)
    lost = float(np.sum(rows["energy_loss"]))
    start, end = summary["energy_start"], summary["energy_end"]
    assert start - end == pytest.approx(lost, abs=1e-11 * start)
    assert np.all(rows["energy_loss"] >= -1e-13 * start)
