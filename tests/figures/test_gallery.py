"""Portraits of the gallery's runs: branches follow the exact motion, and nothing overlaps."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.figures.layout import WIDTHS, assert_texts_are_apart
from vibro_cli.api import Run, simulate
from vibro_cli.figures.portraits.portrait import phase_portrait
from vibro_cli.figures.portraits.trajectory import trajectory
from vibro_cli.scenario import load_any

SCENARIOS = sorted((Path(__file__).parents[2] / "scenarios").glob("*.toml"))
NAMES = [path.stem for path in SCENARIOS]


@cache
def run_of(path: Path) -> Run:
    return simulate(load_any(path, ["stop.collisions=40"]))


@pytest.mark.parametrize("path", SCENARIOS, ids=NAMES)
def test_branches_run_through_the_exact_motion(path: Path) -> None:
    """Every state of a flight lies on its curve, within the error of the straight parts."""
    run = run_of(path)
    flights = run.flights()
    for ball in range(1, len(run.system.bodies) + 1):
        branches = trajectory(run, ball).branches
        for piece in run.system.trace.pieces:
            rows = np.flatnonzero((flights["ball"] == ball) & (flights["arc"] == piece.index + 1))
            drawn = branches[piece.index]
            segments = flights["contact"][rows] & (flights["cause_start"][rows] == "segment")
            assert len(drawn.time) <= len(rows) <= len(drawn.time) + np.count_nonzero(segments)
            for row in [*rows[:12], *rows[-4:]]:
                _, position, rate = run.flight_curve(int(row), 9)
                begun = drawn.time[drawn.time <= flights["t_start"][row]]
                for state in np.column_stack([position, rate]):
                    near = [
                        distance(points, state) / (1.0 + float(np.ptp(points)))
                        for points in (
                            np.column_stack([drawn.position[n], drawn.rate[n]])
                            for n in np.flatnonzero(drawn.time == np.max(begun))
                        )
                    ]
                    assert min(near) < 2e-3


def distance(points: NDArray[np.float64], state: NDArray[np.float64]) -> float:
    """Return the distance of a state from the line through points."""
    ends, starts = points[1:], points[:-1]
    along = ends - starts
    square = np.maximum(np.sum(along**2, axis=1), np.finfo(np.float64).tiny)
    share = np.clip(np.sum((state - starts) * along, axis=1) / square, 0.0, 1.0)
    nearest = starts + share[:, None] * along
    return float(np.min(np.hypot(*(nearest - state).T)))


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("path", SCENARIOS, ids=NAMES)
def test_no_text_is_cut_off_or_overlaps_another(path: Path, width: str) -> None:
    run = run_of(path)
    for ball in range(1, len(run.system.bodies) + 1):
        assert_texts_are_apart(phase_portrait(run, ball, width))


@pytest.mark.parametrize("path", SCENARIOS, ids=NAMES)
def test_curves_of_flights_begin_and_end_as_the_table_says(path: Path) -> None:
    run = run_of(path)
    flights = run.flights()
    rows = np.flatnonzero(flights["contact"])
    for row in [*rows[:20].tolist(), *rows[-5:].tolist(), 0]:
        _, position, rate = run.flight_curve(row, 3)
        for place, when in ((0, "start"), (-1, "end")):
            assert position[place] == pytest.approx(flights[f"angle_{when}"][row], abs=1e-12)
            assert rate[place] == pytest.approx(flights[f"rate_{when}"][row], rel=1e-9, abs=1e-9)
