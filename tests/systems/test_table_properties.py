"""Laws that every run of balls on a table obeys, wedged between others and a wall too."""

from __future__ import annotations

import math
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from tests.strategies import SETTINGS
from tests.systems.table_cases import solve
from vibro_cli.scenario import ScenarioError

WALLS: dict[str, dict[str, Any]] = {
    "ellipse": {"semi_axis_x": 1.2, "semi_axis_y": 0.9},
    "circle": {"radius": 1.0},
    "rectangle": {"width": 2.0, "depth": 1.4},
    "polygon": {"corners": [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [0.0, 0.7], [-1.0, 1.0]]},
}
AXES = {"ellipse": (1.2, 0.9), "circle": (1.0, 1.0)}
COEFFICIENTS = [0.0, 1e-300, 0.05, 0.3, 0.9, 1.0 - 2.0**-53, 1.0]


@st.composite
def documents(draw: st.DrawFn) -> dict[str, Any]:
    """One to six balls on a lattice, many of them touching, within a wall."""
    cells = st.tuples(st.integers(-4, 3), st.integers(-3, 2))
    speeds = st.sampled_from([0.0, 1.0, -1.0, 0.37, -2.9])
    balls = [
        {
            "radius": 0.05,
            "mass": draw(st.sampled_from([1.0, 2.0, 9.2])),
            "x": 0.1 * column,
            "y": 0.1 * row,
            "velocity_x": draw(speeds),
            "velocity_y": draw(speeds),
        }
        for column, row in draw(st.lists(cells, min_size=1, max_size=6, unique=True))
    ]
    shape = draw(st.sampled_from(sorted(WALLS)))
    law = draw(st.sampled_from(["hedrih", "normal-impulse", "translational"]))
    return {
        "system": "table",
        "balls": balls,
        "wall": {"shape": shape, "k": draw(st.sampled_from(COEFFICIENTS)), **WALLS[shape]},
        "collision": {"k": draw(st.sampled_from(COEFFICIENTS)), "law": law},
        "stop": {"time": 6.0, "collisions": 100, "bounces": 100},
    }


@pytest.mark.usefixtures("no_hang")
@SETTINGS
@given(document=documents())
def test_no_penetration_and_no_energy_from_nowhere(document: dict[str, Any]) -> None:
    try:
        run = solve(document, "python")
    except ScenarioError:
        reject()
    summary = run.summary_record()
    assert np.max(np.abs(run.collisions["gap"]), initial=0.0) <= 1e-13
    motion = run.sample(np.linspace(0.0, summary["end_time"], 200))
    places = np.stack([motion["x"], motion["y"]]).reshape(2, 200, -1)
    for one, other in combinations(range(len(document["balls"])), 2):
        assert np.min(np.hypot(*(places[:, :, one] - places[:, :, other]))) >= 0.1 - 1e-12
    x, y = places
    if document["wall"]["shape"] in AXES:
        a, b = AXES[document["wall"]["shape"]]
        # Where a ball of radius r touches, its centre is within the ellipse shorter by r.
        assert np.max((x / (a - 0.05)) ** 2 + (y / (b - 0.05)) ** 2) <= 1.02
    else:
        assert np.max(np.abs(x)) <= 0.95 + 1e-12
    energy = motion["energy"].reshape(200, -1).sum(axis=1)
    assert np.all(np.diff(energy) <= 1e-12 * energy[0])
    impacts = run.collisions
    done = impacts["admissible"] | impacts["substituted"]
    lost = math.fsum(impacts["energy_loss"][done]) + math.fsum(run.bounces["energy_loss"])
    # These laws send equal balls apart, whatever the speeds.
    assert run.end_cause != "inadmissible"
    start, end = summary["energy_start"], summary["energy_end"]
    assert start - end == pytest.approx(lost, abs=1e-11 * start)
