"""Runs interrupted at random moments and continued have the bytes of uninterrupted runs."""

from __future__ import annotations

import random
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.commands.interrupt import SCENE, interrupt_and_go_on, solve
from tests.commands.processes import ROOT, START, VIBRO
from tests.grids.kill import content

pytestmark = pytest.mark.long

IMPACTS = 300_000
KILLED = """
import os, signal
from vibro_cli.storage import folders

def add(self, name, rows, real=folders.StreamedFolder.add):
    real(self, name, rows)
    if name == "collisions":
        os.kill(os.getpid(), signal.SIGKILL)

folders.StreamedFolder.add = add
"""
"""Kills the program as soon as it has written the first impacts."""


def test_interrupted_runs_go_on_to_the_same_bytes(tmp_path: Path) -> None:
    solve(tmp_path / "early", 1000)
    solve(tmp_path / "whole", IMPACTS)
    draw = random.Random(7)
    count = 0
    while count < 3:
        shutil.copytree(tmp_path / "early", tmp_path / "folder")
        count += len(interrupt_and_go_on(tmp_path / "folder", IMPACTS, draw, 2.5))
        assert content(tmp_path / "folder") == content(tmp_path / "whole")
        assert not list(tmp_path.glob(".*"))
        shutil.rmtree(tmp_path / "folder")


def test_a_killed_run_is_taken_up_where_there_was_none(tmp_path: Path) -> None:
    """Only its scenario is needed, which was not given again."""
    solve(tmp_path / "whole", 200_000)
    target = tmp_path / "folder"
    command = ["run", str(SCENE), "--set", "stop.collisions=200000", "-o", str(target)]
    killed = [sys.executable, "-c", KILLED + START, *command, "--no-figures", "-q"]
    assert subprocess.run(killed, cwd=ROOT, check=False).returncode == -signal.SIGKILL
    assert list(tmp_path.glob(".folder.partial-*/collisions.parquet"))
    assert not target.exists()
    on = [*VIBRO, "run", "--continue", str(target), "--no-figures", "-q"]
    assert subprocess.run(on, cwd=ROOT, check=False).returncode == 0
    assert content(target) == content(tmp_path / "whole")
    assert not list(tmp_path.glob(".*"))
    # Now it is like any other run: it has reached its stop.
    again = subprocess.run(on, cwd=ROOT, check=False, capture_output=True)
    assert again.returncode == 2
    assert b"expected a greater stop.collisions" in again.stderr
