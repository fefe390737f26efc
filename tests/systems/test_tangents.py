"""Growth of small changes in runs on tables and springs, and in grids over them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tests.grids.test_same_as_run import grid_of, rows_of
from tests.systems.springs_cases import FIGURE_FIVE, springs
from tests.systems.table_cases import table
from tests.systems.tangent_cases import solved_and_streamed
from tests.systems.test_table_tangents import ELLIPSE, TWO
from vibro_cli.api import simulate, simulate_streamed
from vibro_cli.figures.kinds import draw_all
from vibro_cli.grids.document import document_at
from vibro_cli.grids.solving import solver_of
from vibro_cli.scenario import ScenarioError, any_scenario_of
from vibro_cli.storage.folders import write_run
from vibro_cli.storage.stored import open_run
from vibro_cli.stress.scenes import Document

GROWN: Document = {"analysis": {"lyapunov": True}}
DOCUMENTS: dict[str, Document] = {
    "table": table(TWO, ELLIPSE, 0.95, collisions=30) | GROWN,
    "springs": springs(FIGURE_FIVE, 0.95, collisions=8) | GROWN,
}
SYSTEMS = pytest.mark.parametrize("system", DOCUMENTS)


@SYSTEMS
def test_a_run_tells_of_exponents_in_all_its_tables(system: str, tmp_path: Path) -> None:
    scenario = any_scenario_of(DOCUMENTS[system])
    run, tables = solved_and_streamed(scenario)
    assert ("bounces" in tables) == (system == "table")
    assert len(run.exponents["n"]) <= 256
    record = run.summary_record()
    rates = [value for name, value in record.items() if name.startswith("lyapunov_")]
    impacts = sum(len(rows["n"]) for name, rows in tables.items() if name != "exponents")
    expected = 2.0 * len(run.collisions["n"]) * math.log(0.95)
    assert sum(rates) * record["end_time"] == pytest.approx(expected, abs=1e-11 * impacts)
    write_run(run, scenario, tmp_path / "run", {})
    stored = open_run(tmp_path / "run")
    assert stored.exponents is not None
    np.testing.assert_array_equal(stored.exponents["lyapunov_1"], run.exponents["lyapunov_1"])
    assert [one.name for one in draw_all(stored, ["exponents"])] == ["exponents"]


@SYSTEMS
def test_several_stretches_are_one_run(system: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = any_scenario_of(DOCUMENTS[system] | {"stop": {"collisions": 60}})
    whole = simulate(scenario).summary_record()
    monkeypatch.setattr("vibro_cli.systems.driver.COMPILED_ROWS", 32)
    monkeypatch.setattr("vibro_cli.systems.run.LEAST_ROWS", 16)
    assert simulate_streamed(scenario, lambda *_: None).summary_record() == whole


GRIDS: dict[str, tuple[str, dict[str, list[float]], str]] = {
    "table": ("table/elliptic_wall.toml", {"balls[1].x": [-0.1, 0.1]}, "stop={bounces = 40}"),
    "springs": ("springs/two_disks.toml", {"balls[1].speed": [6.0, 9.0]}, "collision.k=0.5"),
}


@pytest.mark.parametrize("keep", ["true", "false"])
@SYSTEMS
def test_exponents_of_points_are_those_of_runs(system: str, keep: str, tmp_path: Path) -> None:
    path, axes, more = GRIDS[system]
    grid = grid_of(tmp_path, path, axes, ["analysis={lyapunov = true}", more], keep)
    indices = np.arange(4)
    solved = solver_of(grid).solve(indices)
    values = grid.design.columns(indices)
    for row, found in zip(indices.tolist(), rows_of(solved.summary), strict=True):
        scenario = any_scenario_of(
            document_at(grid.base, {p: c[row].item() for p, c in values.items()})
        )
        assert found == simulate(scenario).summary_record()
        assert found["lyapunov_1"] is not None


@SYSTEMS
def test_null_is_no_analysis(system: str) -> None:
    with pytest.raises(ScenarioError, match="analysis"):
        any_scenario_of(DOCUMENTS[system] | {"analysis": None})
