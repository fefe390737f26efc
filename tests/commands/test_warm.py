"""`vibro warm` as processes of their own, with the cache that all tests share."""

import json
import os
import subprocess
import sys
from pathlib import Path

from vibro_cli.numerics.cache import cache_folder

ROOT = Path(__file__).parents[2]
VIBRO = [sys.executable, "-m", "vibro_cli"]


def call(*arguments: str) -> tuple[str, str]:
    outcome = subprocess.run(
        [*VIBRO, *arguments], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return outcome.stdout, outcome.stderr


def test_after_warming_nothing_is_compiled(tmp_path: Path) -> None:
    out, _ = call("warm", "--json")
    found = json.loads(out)
    assert Path(found["cache"]) == cache_folder()
    assert found["seconds"] > 0
    out, words = call("warm")
    assert out == ""
    assert words.startswith(f"the kernels are compiled and kept in {cache_folder()} (")
    _, words = call(
        "run", "scenarios/three_arcs.toml", "--engine", "numba", "--no-figures",
        "--set", "stop.collisions=5", "-o", str(tmp_path / "run"),
    )  # fmt: skip
    assert "compiling" not in words
    assert "ended at t = " in words


def test_warming_fails_where_nothing_can_be_kept(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    outcome = subprocess.run(
        [*VIBRO, "warm", "--json", "-q"], cwd=ROOT, capture_output=True, text=True, check=False,
        env={**os.environ, "VIBRO_CACHE_DIR": str(blocked)},
    )  # fmt: skip
    assert (outcome.returncode, outcome.stdout) == (1, "")
    assert outcome.stderr.splitlines()[-1] == f"vibro: the kernels cannot be kept in {blocked}"
