"""The figure of exponents: what it draws, and that it is omitted without exponents."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.figures.layout import assert_texts_are_apart
from vibro_cli.api import Run, simulate
from vibro_cli.figures.kinds import draw_all
from vibro_cli.figures.runs.over_impacts import exponents
from vibro_cli.scenario import load_any
from vibro_cli.storage.folders import write_run
from vibro_cli.storage.stored import open_run

FALLING = Path(__file__).parents[2] / "scenarios" / "falling_balls.toml"


def _run(*overrides: str) -> Run:
    return simulate(load_any(FALLING, list(overrides)))


@pytest.mark.parametrize("width", ["single", "double"])
@pytest.mark.parametrize("impacts", [2, 300])
def test_it_shows_the_rows_of_the_table(width: str, impacts: int) -> None:
    run = _run(f"stop.collisions={impacts}", "stop.time=1e5")
    figure = exponents(run, width)
    assert figure is not None
    assert run.exponents is not None
    t = run.exponents["t"]
    shown = t >= min(t[0] + 0.1 * (t[-1] - t[0]), t[-2])
    (axes,) = figure.axes
    low, high = axes.get_ylim()
    for n, curve in enumerate(axes.lines[-4:], 1):
        drawn = np.asarray(curve.get_ydata())
        np.testing.assert_array_equal(curve.get_xdata(), t[shown])
        np.testing.assert_array_equal(drawn, run.exponents[f"lyapunov_{n}"][shown])
        assert low < np.min(drawn) <= np.max(drawn) < high
    (band,) = axes.collections
    edges = np.concatenate([np.zeros((1, 2)), *(path.vertices for path in band.get_paths())])[:, 1]
    assert low < np.min(edges) <= np.max(edges) < high
    assert axes.get_xlim()[1] > t[-1]
    assert_texts_are_apart(figure)


def test_without_them_it_is_left_out() -> None:
    assert not list(draw_all(_run("analysis.lyapunov=false", "stop.collisions=5"), ["exponents"]))
    assert not list(draw_all(_run("stop.collisions=1"), ["exponents"]))


def test_a_stored_run_has_it(tmp_path: Path) -> None:
    scenario = load_any(FALLING, ["stop.collisions=40"])
    write_run(simulate(scenario), scenario, tmp_path / "run", {})
    assert [one.name for one in draw_all(open_run(tmp_path / "run"), ["exponents"])] == [
        "exponents"
    ]
