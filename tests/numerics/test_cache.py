"""The cache of machine code: safe with many processes, told about, and never in the way."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

# A program with few kernels, so that its compiling takes seconds.
PROGRAM = """
import sys
from vibro_cli.numerics import engine
from vibro_cli.numerics.double import time_between
engine.on_compiling(lambda text: print(text, file=sys.stderr, flush=True))
print(engine.compiled_once(time_between)(3.0, 0.0, 1.0, 0.5))
"""


def start(cache: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM],
        cwd=Path(__file__).parents[2],
        env={"VIBRO_CACHE_DIR": str(cache), "PATH": "/usr/bin:/bin"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def answers(*processes: subprocess.Popen[str]) -> list[tuple[str, str]]:
    found = [process.communicate(timeout=120) for process in processes]
    assert [process.returncode for process in processes] == [0] * len(processes), found
    return found


def test_ten_processes_with_a_cold_cache_all_succeed_and_one_compiles(tmp_path: Path) -> None:
    found = answers(*(start(tmp_path) for _ in range(10)))
    assert [out for out, _ in found] == ["1.5\n"] * 10
    assert sum("compiling the kernels" in words for _, words in found) == 1
    (again,) = answers(start(tmp_path))
    assert again == ("1.5\n", "")


def test_a_cache_that_cannot_be_written_is_said_and_done_without(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    ((out, words),) = answers(start(blocked))
    assert out == "1.5\n"
    assert words.startswith(f"compiled kernels cannot be kept in {blocked}")
    assert blocked.read_text() == "in the way"


def test_a_process_that_dies_while_compiling_leaves_nothing_that_harms(tmp_path: Path) -> None:
    process = start(tmp_path)
    assert process.stderr is not None
    assert "compiling" in process.stderr.readline()
    process.kill()
    process.communicate()
    ((out, _),) = answers(start(tmp_path))
    assert out == "1.5\n"
