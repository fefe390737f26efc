"""Scenes of the systems that once failed, each a file with one line on the fault it revealed."""

from __future__ import annotations

import math
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from vibro_cli.api import simulate
from vibro_cli.scenario.loading import load_any

CASES = sorted((Path(__file__).parent / "hard_cases").glob("*.toml"))


@pytest.mark.usefixtures("no_hang")
@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_ends_without_penetration(path: Path) -> None:
    assert path.read_text().startswith("# ")
    scenario = load_any(path)
    run = simulate(scenario, "python")
    summary = run.summary_record()
    motion = run.sample(np.linspace(0.0, summary["end_time"], 500))
    bodies = len(run.system.bodies)
    x = motion["x"].reshape(-1, bodies)
    y = motion["y"].reshape(-1, bodies) if "y" in motion else np.zeros_like(x)
    for a, b in combinations(range(bodies), 2):
        reach = 2.0 * math.sqrt(run.system.bodies[a].radius * run.system.bodies[b].radius)
        assert np.min(np.hypot(x[:, b] - x[:, a], y[:, b] - y[:, a])) >= reach - 1e-12
    assert np.max(np.abs(run.collisions["gap"])) <= 1e-13
    assert summary["energy_end"] <= summary["energy_start"] * (1.0 + 1e-12)
    if path.stem != "springs_ends_within_an_instant":
        assert summary["end_cause"] != "inadmissible"
