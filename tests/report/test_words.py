"""Words and units of reports."""

from __future__ import annotations

from typing import Any

from vibro_cli.report.words import method_of, named, validity
from vibro_cli.systems import system_named


def test_keys_have_words_and_units() -> None:
    assert named("spring.stiffness", 6.0) == ("stiffness c of the spring", "6 N/m")
    assert named("semi_axis_x", 1.5) == ("semi-axis along x", "1.5 m")
    assert named("k", [0.9, 0.5]) == ("coefficient of restitution k", "0.9, 0.5")
    assert named("time", 30.0) == ("time", "30 s")
    assert named("corners[1][2]", -1.0) == ("corners[1][2]", "−1 m")


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
