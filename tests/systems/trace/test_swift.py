"""Bodies that are fast for their weight: they turn much faster than their pendulums oscillate."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from vibro_cli import Scenario
from vibro_cli.api import simulate

CIRCLE = [{"shape": "valley", "radius": 1.0, "end_slope": "360 deg"}]
STADIUM = [
    {"shape": "valley", "radius": 1.0, "end_slope": "180 deg"},
    {"shape": "line", "length": 0.7},
    {"shape": "valley", "radius": 1.0, "end_slope": "360 deg"},
    {"shape": "line", "length": 0.7},
]


def scenario(arcs: list[dict[str, Any]], gravity: float, turning: bool, number: int) -> Any:
    rng = np.random.default_rng([number, 31])
    balls = [
        {
            "radius": float(rng.uniform(0.03, 0.1)), "mass": float(rng.uniform(0.2, 3.0)),
            "arc": 1, "angle": 0.3 + place, "speed": float(rng.normal(0.0, 2.0)),
        }
        for place in range(2)
    ]  # fmt: skip
    trace: dict[str, Any] = {"start_slope": 0.0, "closed": True, "arcs": arcs}
    if turning:
        trace["turning"] = {"x": 0.3, "rate": 0.3 * math.sqrt(gravity)}
    return Scenario.from_dict(
        {
            "gravity": gravity, "trace": trace, "balls": balls,
            "collision": {"law": "normal-impulse", "k": 1.0}, "stop": {"collisions": 40},
        }
    )  # fmt: skip


@pytest.mark.parametrize("gravity", [1e-1, 1e-3, 1e-6, 1e-10])
@pytest.mark.parametrize("turning", [False, True])
@pytest.mark.parametrize("arcs", [CIRCLE, STADIUM], ids=["circle", "stadium"])
def test_they_touch_at_their_impacts(
    arcs: list[dict[str, Any]], turning: bool, gravity: float
) -> None:
    for number in range(10):
        run = simulate(scenario(arcs, gravity, turning, number))
        assert run.summary_record()["collisions"] == 40
        assert np.max(np.abs(run.collisions["gap"])) < 1e-14
