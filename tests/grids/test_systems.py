"""Grids over tables and springs: every point is the run of its scenario, to the last bit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.grids.test_same_as_run import plain, rows_of
from vibro_cli.api import simulate
from vibro_cli.grids.document import Grid, document_at, load_grid, reason_of
from vibro_cli.grids.solving import solver_of, summary_table
from vibro_cli.grids.workers import expected_impacts
from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.scenario import ScenarioError, any_scenario_of
from vibro_cli.scenario.loading import Document

SCENARIOS = Path(__file__).parents[2] / "scenarios"
GRIDS: dict[str, tuple[str, dict[str, list[Any]], set[str]]] = {
    "billiards": (
        "table/billiards.toml",
        {
            "balls[1].velocity_y": [-0.3, 0.1, 0.0],
            "balls[2].radius": ["25 mm", 0.02, 0.04],
            "wall.k": [0.9, 1.0, 1.3],
            "wall.width": [2.4, 2.5, 1.0],
        },
        {"ok", "invalid"},
    ),
    "a lone ball": (
        "table/elliptic_wall.toml",
        {"wall.semi_axis_x": [1.5, 2.5], "wall.k": [0.9, 0.3], "balls[1].radius": [0.05, 0.9]},
        {"ok", "invalid"},
    ),
    "corners": (
        "table/polygon",
        {"wall.corners[2][1]": [1.0, 3.0, -2.5], "wall.side": ["inside", "outside"]},
        {"ok", "invalid"},
    ),
    "springs": (
        "springs/two_disks.toml",
        {
            "balls[1].spring.stiffness": [3.0, "8 N/m"],
            "balls[2].spring.length": [0.5, 4.0],
            "collision.k[1]": [0.0, 1.0, 1.5],
            "collision.law": [*LAW_NAMES],
        },
        {"ok", "invalid"},
    ),
}
POLYGON = """
system = "table"
wall = {shape = "polygon", corners = [[-2, -1], [2, -1], [2, 1], [-2, 1]], k = 1.0}
balls = [{radius = 0.1, mass = 1.0, x = 0.0, y = 0.1, velocity_x = 4.0, velocity_y = 3.0}]
stop = {bounces = 5}
"""


def grid_of(tmp_path: Path, base: str, axes: dict[str, list[Any]]) -> Grid:
    """Return a product of lists of values."""
    if base == "table/polygon":
        (tmp_path / "polygon.toml").write_text(POLYGON)
    home = tmp_path / "polygon.toml" if base == "table/polygon" else SCENARIOS / base
    lines = [f'base = "{home}"']
    for path, values in axes.items():
        lines += ["[[axes]]", f'path = "{path}"', f"values = {values}"]
    lines += ["[keep]", "collisions = true"]
    (tmp_path / "grid.toml").write_text("\n".join(lines))
    return load_grid(tmp_path / "grid.toml", ["stop={time = 1.5, collisions = 30}"])


def run_or_reason(document: Document) -> Any:
    """Return the run of a scenario, or what is wrong with it."""
    try:
        return simulate(any_scenario_of(document), "python")
    except ScenarioError as error:
        return reason_of(error)


@pytest.mark.parametrize("name", GRIDS)
def test_points_are_runs(name: str, tmp_path: Path) -> None:
    base, axes, seen = GRIDS[name]
    grid = grid_of(tmp_path, base, axes)
    indices = np.arange(grid.design.points)
    solved = solver_of(grid, "python").solve(indices)
    tables = {name: kept.to_pydict() for name, kept in solved.kept.items()}
    values = grid.design.columns(indices)
    impacts = 0
    for row, found in zip(indices.tolist(), rows_of(solved.summary), strict=True):
        run = run_or_reason(document_at(grid.base, {path: values[path][row] for path in values}))
        if isinstance(run, str):
            assert (found["status"], found["reason"]) == ("invalid", run)
            continue
        assert found == run.summary_record()
        for table, columns in tables.items():
            here = [i for i, number in enumerate(columns["scenario"]) if number == row + 1]
            impacts += len(here)
            for key, column in getattr(run, table).items():
                assert [columns[key][i] for i in here] == plain(column), key
    assert set(solved.summary["status"]) == seen
    assert impacts == solved.impacts > 0


def test_axes_have_the_units_of_their_system(tmp_path: Path) -> None:
    base, axes, _ = GRIDS["springs"]
    table = summary_table(grid_of(tmp_path, base, axes))
    units = {column.name: column.unit for column in table.columns}
    assert units["balls[1].spring.stiffness"] == "N/m"
    assert units["balls[2].spring.length"] == "m"


def test_the_size_of_chunks_takes_bounces_into_account(tmp_path: Path) -> None:
    grid = grid_of(tmp_path, "table/elliptic_wall.toml", {"wall.k": [1.0, 0.99]})
    runs = [simulate(any_scenario_of(document_at(grid.base, {}))) for _ in "1"]
    expected = expected_impacts(grid)
    assert expected.mean >= 0.9 * len(runs[0].history()["bounce_log"]) > 0


@pytest.mark.parametrize(
    ("axis", "message"),
    [
        ('path = "system"\nvalues = ["table", "springs"]', "of one system"),
        ('path = "analysis.lyapunov"\nvalues = [false, true]', "for all points or for none"),
        ('path = "balls[1].angle"\nvalues = [0.1]', 'the unknown key "angle"'),
        ('path = "wall.corners"\nvalues = [1]', "expected one value"),
    ],
)
def test_what_is_no_axis_of_a_table(axis: str, message: str, tmp_path: Path) -> None:
    text = f'base = "{SCENARIOS / "table/skew_impact.toml"}"\n[[axes]]\n{axis}\n'
    (tmp_path / "grid.toml").write_text(text)
    with pytest.raises(ScenarioError, match=message):
        load_grid(tmp_path / "grid.toml")
