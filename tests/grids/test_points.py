"""Points parsed like a known one get the scenario, or the reason, that the reader gives."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest

from vibro_cli.assemble import build_system
from vibro_cli.grids.axes import Array
from vibro_cli.grids.document import document_at, load_grid
from vibro_cli.grids.solving import columns_of_records, solver_of
from vibro_cli.scenario import ScenarioError
from vibro_cli.scenario.forms import Scanner, places
from vibro_cli.scenario.loading import load_document, scenario_of
from vibro_cli.systems.trace import grid_solver, system_template
from vibro_cli.systems.trace.system_template import Reader, SystemTemplate

SCENARIOS = Path(__file__).parents[2] / "scenarios"
END = 0.8726646259971648  # of the first arc of three_arcs, 50 deg
# Allowed, at an edge, and refused; the last three of the angles overlap, or are beyond the arc.
VALUES = {
    ("balls", 0, "angle"): (-1.0, END, 0.7, 0.9, -3.0),
    ("balls", 1, "angle"): (0.4, -END, -1.0),
    ("collision", "k"): (1.0, 0.0, 1.2),
    ("balls", 0, "radius"): (0.1, 0.3, 0.0, 5.0),
    ("gravity",): (9.81, -1.0),
    ("balls", 1, "density"): (2700.0, 0.0, float("nan")),
}


def test_points_are_what_the_reader_says() -> None:
    base = load_document(SCENARIOS / "three_arcs.toml")
    reader = Reader(base)
    seen = set()
    for values in product(*VALUES.values()):
        point = dict(zip(VALUES, values, strict=True))
        found = reader.read(point)
        try:
            scenario = scenario_of(document_at(base, point))
            system = build_system(scenario)
        except ScenarioError as error:
            lines = [f"{p.path}: found {p.found}, expected {p.expected}" for p in error.problems]
            assert found == "; ".join(lines)
            seen.add(found.partition(":")[0])
        else:
            assert found == SystemTemplate(scenario, system)
            seen.add("valid")
    assert {"valid", "collision.k", "gravity", "balls[1].radius", "balls[2].angle"} <= seen


def test_words_are_read_alone() -> None:
    base = load_document(SCENARIOS / "three_arcs.toml")
    reader = Reader(base)
    for law, k in (("hedrih", 0.5), ("translational", 0.6), ("nonsense", 0.7)):
        found = reader.read({("collision", "law"): law, ("collision", "k"): k})
        if law == "nonsense":
            assert isinstance(found, str)
            assert found.startswith("collision.law: ")
            continue
        assert isinstance(found, SystemTemplate)
        assert (found.system.law, found.system.restitution) == (law, (k,))


def test_what_invalid_points_share_is_done_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The text was searched for places, and a table of one row made, for each: 0.4 ms a point."""
    done: list[str] = []

    def counted(act: Callable[..., Any], name: str) -> Callable[..., Any]:
        def counting(*given: Any) -> Any:
            done.append(name)
            return act(*given)

        return counting

    path = tmp_path / "half.toml"
    path.write_text(
        f'base = "{SCENARIOS / "three_arcs.toml"}"\n'
        '[[axes]]\npath = "balls[1].angle"\nlinspace = [-9.0, 9.0, 40]\n'
    )
    solver = solver_of(load_grid(path, ["stop.collisions=1"]))
    monkeypatch.setattr(Scanner, "scan", counted(Scanner.scan, "places"))
    make_table = counted(columns_of_records, "table")
    monkeypatch.setattr(grid_solver, "columns_of_records", make_table)
    places.cache_clear()
    solved = solver.solve(np.arange(40))
    assert done == ["places", "table"]
    for angle, status in zip(np.linspace(-9.0, 9.0, 40), solved.summary["status"], strict=True):
        assert (status == "invalid") == (not -2.1 < angle < END)


def test_invalid_points_before_the_first_valid_one_are_read_like_later_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each was read as a whole document, in twice the time."""
    path = tmp_path / "late.toml"
    path.write_text(
        f'base = "{SCENARIOS / "one_circle.toml"}"\n'
        '[[axes]]\npath = "balls[1].angle"\nlinspace = [1.5, -0.1, 40]\n'
    )
    read: list[Any] = []

    def counted(document: Any) -> Any:
        read.append(document)
        return scenario_of(document)

    monkeypatch.setattr(system_template, "scenario_of", counted)
    grid = load_grid(path, ["stop.collisions=1"])
    reasons = solver_of(grid).solve(np.arange(20)).summary["reason"]
    assert len(read) < 8  # until one of points tried at random is valid
    for angle, reason in zip(np.linspace(1.5, -0.1, 40), reasons, strict=False):
        with pytest.raises(ScenarioError) as refused:
            build_system(scenario_of(document_at(grid.base, {("balls", 0, "angle"): angle})))
        (problem,) = refused.value.problems
        assert reason == f"{problem.path}: found {problem.found}, expected {problem.expected}"


def test_random_values_are_uniform_and_each_axis_has_its_own(tmp_path: Path) -> None:
    def shares(seed: int) -> list[Array]:
        path = tmp_path / "random.toml"
        path.write_text(
            f'base = "{SCENARIOS / "three_arcs.toml"}"\nseed = {seed}\n'
            '[[axes]]\npath = "collision.k"\nuniform = [0.2, 0.9, 400]\n'
            '[[axes]]\npath = "balls[1].angle"\nuniform = [-1.4, -1.0, 400]\n'
        )
        one, other = (axis.at(np.arange(400))[0] for axis in load_grid(path).design.axes)
        return [(one - 0.2) / 0.7, (other + 1.4) / 0.4]

    axes = [*shares(1), *shares(2)]
    for number, one in enumerate(axes):
        assert kstest(one, "uniform").pvalue > 1e-3
        for other in [one[:-1], *(other[1:] for other in axes[:number])]:
            # Neither successive values of an axis nor two axes are correlated.
            assert abs(np.corrcoef(one[1:], other)[0, 1]) < 4.0 / np.sqrt(399)
    assert [one.tolist() for one in shares(1)] == [one.tolist() for one in axes[:2]]
