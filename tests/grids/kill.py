"""Kill a grid at random moments and go on, again and again; the bytes must be those of one run.

    python -m tests.grids.kill --times 200

The short form of it is a test (`tests/grids/test_dataset.py`).
"""

from __future__ import annotations

import argparse
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from tests.commands.processes import ROOT, begun, call

GRID = """
chunk_points = {chunk}
base = "{base}"
[[axes]]
path = "balls[1].angle"
linspace = [-1.45, -0.3, {count}]
[[axes]]
path = "collision.k"
linspace = [0.5, 1.0, {count}]
[keep]
collisions = true
"""
# What a process says when it was asked to end, rather than killed.
CODES = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGKILL: -9}


def content(folder: Path) -> dict[str, bytes]:
    """Every file of a folder but its lock."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != ".lock"
    }


def kill_and_go_on(
    arguments: Callable[[Path], list[str]],
    folder: Path,
    end: signal.Signals,
    draw: random.Random,
    times: int,
    longest: float = 3.0,
) -> int:
    """Start a grid and end it after a random time, some times, then let it finish.

    Returns how often it was ended before it had finished by itself.
    """
    ended = 0
    for _ in range(times):
        process = begun(arguments(folder))
        try:
            _, told = process.communicate(timeout=draw.uniform(0.05, longest))
        except subprocess.TimeoutExpired:
            process.send_signal(end)
            _, told = process.communicate(timeout=120)
            # It may just have finished, or still be loading its libraries.
            if process.returncode not in (0, CODES[end], -end):
                raise AssertionError(told.decode()) from None
            ended += process.returncode != 0
        if b"Traceback" in told and b"KeyboardInterrupt" not in told:
            raise AssertionError(told.decode())
    whole = call(ROOT, *arguments(folder))
    if whole.returncode != 0:
        raise AssertionError(whole.stderr.decode())
    return ended


def main() -> int:
    """Kill grids as often as asked for; the exit code is 1 if the bytes ever differ."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--times", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--points", type=int, default=40_000)
    asked = parser.parse_args()
    draw = random.Random(asked.seed)
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        count = round(asked.points**0.5)
        grid = work / "grid.toml"
        base = ROOT / "scenarios" / "three_arcs.toml"
        grid.write_text(GRID.format(base=base, count=count, chunk=2 * count))

        def arguments(folder: Path) -> list[str]:
            more = ["-q", "--set", "stop.collisions=30", "--engine", "compiled"]
            return ["grid", str(grid), "-o", str(folder), *more]

        begin = time.monotonic()
        call(ROOT, *arguments(work / "whole")).check_returncode()
        longest = time.monotonic() - begin
        wanted = content(work / "whole")
        killed = rounds = 0
        while killed < asked.times:
            left = min(asked.times - killed, draw.randint(1, 8))
            folder = work / "cut"
            killed += kill_and_go_on(arguments, folder, signal.SIGKILL, draw, left, longest=longest)
            rounds += 1
            if content(folder) != wanted:
                print(f"round {rounds}: the bytes differ after {killed} kills")
                return 1
            shutil.rmtree(folder)
            print(f"{killed} kills, {rounds} grids finished, the same bytes each time", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
