"""Tables have the same bytes on processors with short registers and with long ones."""

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from vibro_cli.systems.driver import angles_of

SCENARIOS = Path(__file__).parents[2] / "scenarios"
MORE = ("--set", "output.step=0.05", "--set", "output.turning_points=true")


def test_angles_are_those_of_the_c_library() -> None:
    generator = np.random.default_rng(20261125)
    vectors = generator.standard_normal((2, 20_000)) * 10.0 ** generator.integers(-9, 9, 20_000)
    vectors = np.hstack([vectors, [[0.0, -0.0, 1.0, 0.0, 1.0], [-1.0, -1.0, 0.0, 0.0, -0.0]]])
    y, x = vectors
    assert angles_of(y, x).tolist() == list(map(math.atan2, y.tolist(), x.tolist()))


def test_tables_do_not_depend_on_the_registers_that_numpy_uses(tmp_path: Path) -> None:
    found = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    tables = {}
    for name, without in (("long", []), ("short", found)):
        environment = {**os.environ, "NPY_DISABLE_CPU_FEATURES": " ".join(without)}
        scenarios = (SCENARIOS / "three_arcs.toml", SCENARIOS / "table" / "billiards.toml")
        for scenario, more in zip(scenarios, (MORE, MORE[:2]), strict=True):
            folder = tmp_path / name / scenario.stem
            command = [sys.executable, "-m", "vibro_cli", "run", str(scenario), *more]
            command += ["--no-figures", "-q", "-o", str(folder)]
            subprocess.run(command, env=environment, check=True)
        files = (tmp_path / name).rglob("*.parquet")
        tables[name] = {path.parent.name + path.name: path.read_bytes() for path in files}
    assert len(tables["long"]) >= 7
    assert tables["long"] == tables["short"]
