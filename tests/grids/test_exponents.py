"""Exponents of a grid's points are those of their runs, to the last bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.grids.test_same_as_run import GRIDS, MORE, grid_of, rows_of, scenario_at
from vibro_cli.api import simulate
from vibro_cli.kernels.ensemble.points import MOST_LOGS
from vibro_cli.systems import driver
from vibro_cli.systems.trace.grid_solver import TraceSolver

NAMES = (
    "two balls, starts and k",
    "radii and gravity",
    "several balls",
    "walls",
    "arcs",
    "slopes",
    "lines",
    "turning",
)


@pytest.mark.parametrize("name", NAMES)
def test_exponents_of_points_are_those_of_runs(name: str, tmp_path: Path) -> None:
    more = ["analysis={lyapunov = true}", *MORE.get(name, ())]
    indices = np.arange(24)
    grid = grid_of(tmp_path, *GRIDS[name], more)
    points = rows_of(TraceSolver(grid, "compiled").solve(indices).summary)
    # Without their impacts, points may be solved in another way.
    without = TraceSolver(grid_of(tmp_path, *GRIDS[name], more, "false"), "compiled")
    assert rows_of(without.solve(indices).summary) == points
    values = grid.design.columns(indices)
    known = 0
    for row, found in zip(indices.tolist(), points, strict=True):
        if found["status"] != "ok":
            assert found["lyapunov_1"] is None
            continue
        scenario = scenario_at(grid, values, row)
        assert found == simulate(scenario, "python").summary_record()
        known += found["lyapunov_1"] is not None
    assert known >= 1


@pytest.mark.parametrize("impacts", [300, 50 * MOST_LOGS])
def test_long_runs_are_followed_in_parts(
    impacts: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """These are runs that are too long to be followed at once."""
    more = ["analysis={lyapunov = true}", f"stop={{collisions = {impacts}}}", "collision.k=1"]
    grid = grid_of(tmp_path, "one_circle.toml", {"balls[1].angle": [-1.2, -0.3]}, more, "false")
    whole = TraceSolver(grid, "compiled").solve(np.arange(4)).summary
    monkeypatch.setattr(driver, "COMPILED_ROWS", 16)
    parts = TraceSolver(grid, "compiled").solve(np.arange(4)).summary
    assert whole.keys() == parts.keys()
    assert whole["collisions"].tolist() == [impacts] * 4
    for name, column in whole.items():
        np.testing.assert_array_equal(column, parts[name])
