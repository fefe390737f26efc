"""Interrupt a long run at random moments and go on with it; the bytes must be those of one run.

    python -m tests.commands.interrupt --times 100

Each time a run that has stopped early is continued to its later stop, and is ended on the way by
SIGINT, SIGTERM or SIGKILL, once or several times. The short form of it is a test.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.commands.processes import ROOT, VIBRO, begun
from tests.grids.kill import CODES, content

SCENE = ROOT / "tests" / "scenes" / "circle.toml"


def solve(folder: Path, impacts: int) -> None:
    """Run the scene to a number of impacts."""
    stop = f"stop.collisions={impacts}"
    command = [*VIBRO, "run", str(SCENE), "--set", stop, "--no-figures", "-q", "-o", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True)


def reached(folder: Path) -> int:
    """Return the number of impacts of the run in a folder."""
    summary: dict[str, int] = json.loads((folder / "summary.json").read_text())
    return summary["collisions"]


def interrupt_and_go_on(
    folder: Path, impacts: int, draw: random.Random, longest: float
) -> list[signal.Signals]:
    """Continue a run to a number of impacts, interrupted until it ends by itself.

    Returns the signals that have ended it on the way.
    """
    on = ["run", "--continue", str(folder), "--set", f"stop.collisions={impacts}"]
    ended: list[signal.Signals] = []
    while True:
        before = content(folder)
        process = begun([*on, "--no-figures", "-q"])
        end = draw.choice(list(CODES))
        try:
            # The first time and again with even chances.
            wait = draw.uniform(0.1, longest) if not ended or draw.random() < 0.5 else None
            _, told = process.communicate(timeout=wait)
        except subprocess.TimeoutExpired:
            process.send_signal(end)
            _, told = process.communicate()
        if process.returncode == 0:
            return ended
        # A process that is still loading its libraries is ended by the signal itself.
        assert process.returncode in (CODES[end], -end), told.decode()
        after = content(folder)
        ended.append(end)
        if reached(folder) == impacts:
            # The signal came when the end of the run had been solved: the folder is complete.
            return ended
        assert end != signal.SIGKILL or after == before, "a killed run changed its folder"


def main() -> int:
    """Interrupt runs as often as asked for; the exit code is 1 if the bytes ever differ."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--times", type=int, default=100)
    parser.add_argument("--impacts", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--longest", type=float, default=8.0, help="time before a signal, s")
    asked = parser.parse_args()
    # If a shell has started this in the background, SIGINT is ignored, also by child processes.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    draw = random.Random(asked.seed)
    counts = dict.fromkeys(CODES, 0)
    with tempfile.TemporaryDirectory() as place:
        early, whole, folder = (Path(place) / name for name in ("early", "whole", "folder"))
        solve(early, 1000)
        solve(whole, asked.impacts)
        wanted = content(whole)
        while sum(counts.values()) < asked.times:
            shutil.rmtree(folder, ignore_errors=True)
            shutil.copytree(early, folder)
            for end in interrupt_and_go_on(folder, asked.impacts, draw, asked.longest):
                counts[end] += 1
            if content(folder) != wanted:
                print(f"the bytes differ after {sum(counts.values())} interruptions")
                return 1
            left = [path.name for path in Path(place).glob(".*partial*")]
            if left:
                print(f"left behind: {left}")
                return 1
            told = ", ".join(f"{count} by {end.name}" for end, count in counts.items())
            print(f"{sum(counts.values())} interruptions ({told}), the same bytes", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
