"""Types of portraits and the parameter values at which they change, against the formula."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import pytest

from tests.analysis.traces import BALL, DEGREE, circle, hump, landscape, three_arcs, valley
from vibro_cli.analysis.levels import Landscape
from vibro_cli.analysis.singular import as_record, changes, condition, portrait_of
from vibro_cli.api import simulate
from vibro_cli.scenario.loading import scenario_of

OUTER = 70.0
# (R − r)(1 − cos θ_end) = (R + R₀)(1 − cos J) with R = 1, R₀ = 0.5, J = 50°
THRESHOLD = 1.0 - 1.5 * (1.0 - math.cos(50 * DEGREE)) / (1.0 - math.cos(OUTER * DEGREE))


def type_at(radius: float) -> str:
    return portrait_of(three_arcs(OUTER, replace(BALL, radius=radius))).type


def test_three_arcs_have_two_centres_a_saddle_and_a_figure_eight() -> None:
    portrait = portrait_of(three_arcs())
    assert portrait.type == "centre, saddle, centre; figure eight"
    assert portrait.names == ("C1", "S1", "C2")
    saddle = portrait.points[1]
    assert portrait.height(saddle.energy) == pytest.approx(1.5 * (1 - math.cos(50 * DEGREE)))


def test_the_circle_has_no_trigger() -> None:
    portrait = portrait_of(circle())
    assert portrait.type == "saddle, centre"
    assert portrait.triggers == ()


def test_the_figure_eight_opens_at_the_radius_of_the_condition() -> None:
    values = [0.05, 0.10, 0.15, 0.20, 0.25]
    assert 0.15 < THRESHOLD < 0.20
    (change,) = changes(type_at, values)
    assert change.low == pytest.approx(THRESHOLD, rel=1e-14)
    assert change.high == math.nextafter(change.low, 1.0)
    assert change.before.endswith("figure eight")
    assert change.after.endswith("open")


def test_several_changes_between_two_values_are_all_found() -> None:
    def type_of(value: float) -> str:
        return str(sum(value >= step for step in (0.1, 0.5, 0.7)))

    found = changes(type_of, [0.0, 1.0])
    assert [change.high for change in found] == [0.1, 0.5, 0.7]
    assert [change.before + change.after for change in found] == ["01", "12", "23"]


def test_a_type_of_one_value_is_the_change_itself() -> None:
    def type_of(value: float) -> str:
        return "equal" if abs(value - 0.3) < 1e-11 else "below" if value < 0.3 else "above"

    (change,) = changes(type_of, [0.0, 1.0])
    assert (change.before, change.after) == ("below", "above")
    assert change.low < 0.3 < change.high < change.low + 1e-10


@pytest.mark.parametrize("values", [(0.4, 0.5, 0.6), (0.4, 0.45, 0.6)])
def test_a_type_of_one_value_between_equal_ones_is_no_change(values: tuple[float, ...]) -> None:
    """Of two humps the separatrices join where both have one radius, among the values or not."""

    def type_of(radius: float) -> str:
        shapes = valley(1.0, 40), hump(0.5, -40), valley(1.0, 40), hump(radius, -40)
        return portrait_of(landscape(-60.0, *shapes, valley(1.0, 60))).type

    assert type_of(0.5).endswith("; heteroclinic, heteroclinic")
    assert type_of(0.4) == type_of(0.6) == type_of(0.5).replace("heteroclinic", "figure eight")
    assert changes(type_of, values) == ()


def test_the_condition_says_which_barrier_is_too_low() -> None:
    portrait = portrait_of(three_arcs(OUTER, replace(BALL, radius=0.2)))
    short = 0.8 * (1 - math.cos(OUTER * DEGREE)) - 1.5 * (1 - math.cos(50 * DEGREE))
    text = condition(portrait, portrait.triggers[0])
    assert f"−{-short:.4g} m" in text
    assert "of S1" in text


def test_the_record_is_plain_and_has_the_points() -> None:
    record = as_record(portrait_of(three_arcs()))
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    assert [point["kind"] for point in record["points"]] == ["centre", "saddle", "centre"]
    assert [point["arc"] for point in record["points"]] == [1, 2, 3]
    assert record["points"][0]["natural_rate"] == pytest.approx(math.sqrt(9.81 / (1.4 * 0.9)))
    assert record["points"][1]["natural_rate"] == pytest.approx(math.sqrt(9.81 / (1.4 * 0.6)))
    assert record["triggers"][0]["points"] == "C1-S1-C2"


BOTTOM_OF_TWO: dict[str, Any] = {
    "gravity": 9.81,
    "trace": {
        "start_slope": "-60 deg",
        "arcs": [
            {"shape": "valley", "radius": 1.0, "end_slope": 0.0},
            {"shape": "valley", "radius": 0.4, "end_slope": "60 deg"},
        ],
    },
    "balls": [{"radius": 0.1, "mass": 2.0, "arc": 1, "angle": -1e-4}],
    "stop": {"time": 10.0},
    "output": {"turning_points": True},
}
"""Two valleys that meet at their lowest points, and a ball that swings about there."""


@pytest.mark.parametrize("rate", [0.0, 2.0])
def test_about_a_junction_half_of_each_swing_is_on_either_side(rate: float) -> None:
    turning = {"x": math.sin(60 * DEGREE), "rate": rate}
    trace = BOTTOM_OF_TWO["trace"] | {"turning": turning}
    run = simulate(scenario_of(BOTTOM_OF_TWO | {"trace": trace}))
    events = run.events
    turns = events["t"][events["event"] == "turning"]
    (point,) = as_record(portrait_of(Landscape.of(run.system, 1)))["points"]
    assert point["kind"] == "centre"
    swings = (len(turns) - 1) // 2
    period = (turns[2 * swings] - turns[0]) / swings
    assert 2.0 * math.pi / point["natural_rate"] == pytest.approx(period, rel=1e-8)


def test_a_saddle_at_a_junction_has_an_exponent_if_both_sides_have_the_same() -> None:
    def rate(*shapes: Any) -> float | None:
        (point,) = as_record(portrait_of(landscape(30.0, *shapes)))["points"]
        assert point["kind"] == "saddle"
        found: float | None = point["natural_rate"]
        return found

    assert rate(hump(0.5, 0.0), hump(0.5, -30.0)) == rate(hump(0.5, -30.0))
    assert rate(hump(0.5, 0.0), hump(0.7, -30.0)) is None
    assert rate(hump(0.5, 0.0)) is None  # the end of the trace
