"""A small scenario as plain data, to change and to parse."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

from vibro_cli.scenario import Problem, Scenario, ScenarioError, scenario_of


def arc(shape: str, end: Any, radius: Any = 1.0) -> dict[str, Any]:
    return {"shape": shape, "radius": radius, "end_slope": end}


def ball(**changes: Any) -> dict[str, Any]:
    """Return a ball in the first arc; None omits a key."""
    values = {"radius": 0.1, "density": 7800.0, "arc": 1, "angle": -0.5, **changes}
    return {key: value for key, value in values.items() if value is not None}


def data(count: int = 2, **changes: Any) -> dict[str, Any]:
    """Return balls in one valley, 0.4 rad apart."""
    return {
        "gravity": 9.81,
        "trace": {"start_slope": -2.0, "arcs": [arc("valley", 2.0)]},
        "balls": [ball(angle=-1.0 + 0.4 * i) for i in range(count)],
        "collision": {"k": 0.9},
        "stop": {"time": 60.0},
        **changes,
    }


def closed(count: int) -> dict[str, Any]:
    half_turn = "180 deg"
    trace = {"start_slope": f"-{half_turn}", "closed": True, "arcs": [arc("valley", half_turn)]}
    return data(count, trace=trace)


def good(source: dict[str, Any], overrides: Sequence[str] = ()) -> Scenario:
    return scenario_of(source, overrides)


def bad(source: dict[str, Any], overrides: Sequence[str] = ()) -> tuple[Problem, ...]:
    with pytest.raises(ScenarioError) as caught:
        scenario_of(source, overrides)
    return caught.value.problems


def bad_paths(source: dict[str, Any], overrides: Sequence[str] = ()) -> list[str]:
    return [problem.path for problem in bad(source, overrides)]
