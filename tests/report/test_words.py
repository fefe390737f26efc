"""Texts and units of reports."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.systems.trace.test_energy import not_made
from vibro_cli.commands.show import _text
from vibro_cli.report.words import cell, method_of, named, number, validity
from vibro_cli.stress.scenes import solve_any
from vibro_cli.systems import columns, system_named


def test_keys_have_words_and_units() -> None:
    """Each is declared with the key; what has no words is shown as it is written."""
    springs, table = (system_named(name).model for name in ("springs", "table"))
    stiffness = ("stiffness c of the spring", "N/m")
    assert named("balls", "spring.stiffness", springs) == stiffness
    assert named("balls", "omega", springs) == ("omega", "rad/s")
    assert named("wall", "semi_axis_x", table) == ("semi-axis along x", "m")
    assert named("wall", "k", table) == ("coefficient of restitution k", "")
    assert named("wall", "corners[1][2]", table) == ("corners[1][2]", "m")
    assert named("stop", "time", table) == ("time", "s")
    assert named("stop", "bounces", table) == ("impacts on the wall", "")


def test_a_negative_zero_is_shown_as_zero() -> None:
    assert (number(-0.0, "m"), number(-0.5, "m"), number(-1e-9, "m")) == (
        "0 m",
        "−0.5 m",
        "−1·10⁻⁹ m",
    )
    assert (_text(-0.0), _text(-0.5)) == ("0", "-0.5")


def test_a_trace_that_turns_is_solved_by_other_functions() -> None:
    at_rest: dict[str, Any] = {"trace": {}}
    turns = {"trace": {"turning": {"rate": 1.0}}}
    kind = system_named("trace")
    assert "Jacobi" in method_of(kind, at_rest)[0]
    assert "Weierstrass" in method_of(kind, turns)[0]
    assert method_of(kind, at_rest)[1:] == method_of(kind, turns)[1:]


def test_more_friction_than_dry_surfaces_have_is_told() -> None:
    summary = {"min_normal_force": 1.0, "max_friction_demand": 17.0712}
    assert "Rolling needs a coefficient of friction of 17.07, more than dry surfaces have." in (
        validity(summary, True, 0, ())
    )
    usual = {**summary, "max_friction_demand": 0.25}
    assert "Rolling needs a coefficient of friction of 0.25." in validity(usual, True, 0, ())


def test_of_a_run_that_ends_as_a_body_leaves_the_trace_nothing_else_is_said() -> None:
    summary = {"min_normal_force": 8.5, "max_friction_demand": 0.1}
    assert "The normal force is at least 8.5 N: no body lifts off." in (
        validity(summary, True, 0, ())
    )
    assert "The normal force is at least 8.5 N until a body leaves the trace." in (
        validity({**summary, "end_cause": "lift_off"}, True, 0, ())
    )


def test_an_impact_that_would_lift_a_body_off_is_not_called_inadmissible() -> None:
    run = solve_any(not_made("lift_off"))
    refused = int(np.sum(~run.collisions["admissible"]))
    assert np.all(run.collisions["separation_speed"] > 0.0)  # neither goes through the other
    assert "Inadmissible or prevented impacts: 1." in (
        validity(run.summary_record(), True, refused, ())
    )


def test_a_run_without_an_impact_is_not_said_to_have_only_admissible_ones() -> None:
    summary = {"min_normal_force": 1.0, "max_friction_demand": 0.1, "collisions": 0}
    word = "Every impact is admissible: the bodies separate after it."
    assert word not in validity(summary, True, 0, ())
    assert word in validity({**summary, "collisions": 1}, True, 0, ())


def test_a_trace_that_has_to_hold_bodies_back_is_told() -> None:
    said = validity({"min_normal_force": -2.5, "max_friction_demand": None}, True, 0, ())
    assert said[0].startswith("The trace has to hold bodies back")
    assert "−2.5 N" in said[0]
    assert "no coefficient of friction permits rolling" in said[1]


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (True, "", "yes"), (False, "", "no"), (None, "m", "–"), (float("nan"), "m", "–"),
        ("stop", "", "stop"), (12, "", "12"), (-0.5, "m", "−0.5 m"), (90.0, "°", "90°"),
        (1e-7, "s", "10⁻⁷ s"), (-2.5e20, "", "−2.5·10²⁰"),
    ],
)  # fmt: skip
def test_values_are_written_as_in_print(value: Any, unit: str, text: str) -> None:
    assert number(value, unit) == text


def test_a_cell_without_a_value_is_a_dash_and_sorted_first() -> None:
    column = columns.number("x", "m", "place", True)
    values: list[Any] = [None, float("nan"), np.ma.masked, np.float64(2.5), "no_contact"]
    found = [cell({"x": values}, column, row) for row in range(5)]
    assert found == [("", "–")] * 3 + [("2.5", "2.5"), ("no_contact", "no contact")]
