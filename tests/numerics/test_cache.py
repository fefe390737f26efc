"""The cache of machine code: safe with many processes, told about, and never in the way."""

from __future__ import annotations

import resource
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from vibro_cli.numerics.double import time_between
from vibro_cli.numerics.machine_code import digest
from vibro_cli.simulation import loop
from vibro_cli.simulation.points import run_points

# A program with few kernels, so that its compiling takes seconds.
PROGRAM = """
import sys
from vibro_cli.numerics import cache
from vibro_cli.numerics.double import time_between
from vibro_cli.numerics.machine_code import compiled
cache.on_compiling(lambda text: print(text, file=sys.stderr, flush=True))
print(compiled(time_between)(3.0, 0.0, 1.0, 0.5))
"""


ROOT = Path(__file__).parents[2]
COMPILING = "compiling the kernels; this takes some ten seconds"


def start(
    cache: Path, sources: Path = ROOT, largest_file: int | None = None
) -> subprocess.Popen[str]:
    def limit() -> None:
        if largest_file is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))

    return subprocess.Popen(
        [sys.executable, "-B", "-c", PROGRAM],
        cwd=sources,
        env={"VIBRO_CACHE_DIR": str(cache), "PATH": "/usr/bin:/bin"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=limit,
    )


def answers(*processes: subprocess.Popen[str]) -> list[tuple[str, str]]:
    found = [process.communicate(timeout=600) for process in processes]
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
    first, second = words.splitlines()
    assert first == COMPILING
    assert second.startswith(f"compiled kernels cannot be kept in {blocked}/kernels-")
    assert blocked.read_text() == "in the way"


def test_a_full_disk_is_said_and_done_without(tmp_path: Path) -> None:
    ((out, words),) = answers(start(tmp_path, largest_file=500))
    assert out == "1.5\n"
    assert words.splitlines()[0].startswith(COMPILING)
    assert words.splitlines()[1].endswith(" (File too large)")


def test_damaged_files_are_made_anew(tmp_path: Path) -> None:
    answers(start(tmp_path))
    (kept,) = tmp_path.glob("*/*.o")
    damage: tuple[Callable[[bytes], bytes], ...] = (
        lambda content: b"",
        lambda content: b"garbage",
        lambda content: content[: len(content) // 2],  # a file cut short
        lambda content: content[:200] + b"\0" * 200 + content[400:],
        lambda content: bytes([content[0] ^ 1]) + content[1:],
    )
    for change in damage:
        kept.write_bytes(change(kept.read_bytes()))
        ((out, words),) = answers(start(tmp_path))
        assert out == "1.5\n"
        first, second = words.splitlines()
        assert first == f"compiled kernels are damaged: {kept}; they are made anew"
        assert second.startswith(COMPILING)
        assert answers(start(tmp_path)) == [("1.5\n", "")]


def test_machine_code_does_not_depend_on_where_the_sources_are(tmp_path: Path) -> None:
    """A second environment, or a fresh checkout, finds what the first one compiled."""
    answers(start(tmp_path / "cache"))
    (tmp_path / "elsewhere").mkdir()
    shutil.copytree(ROOT / "vibro_cli", tmp_path / "elsewhere/vibro_cli")
    # Files that may not grow: it could not be compiled and kept a second time.
    assert answers(start(tmp_path / "cache", tmp_path / "elsewhere", 0)) == [("1.5\n", "")]


def test_a_constant_of_another_module_is_part_of_the_machine_code(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before = digest.__wrapped__(run_points)
    assert digest.__wrapped__(run_points) == before
    monkeypatch.setattr(loop, "LOG_FULL", 99)
    assert digest.__wrapped__(run_points) != before


def test_machine_code_does_not_depend_on_kernels_that_it_does_not_call(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before = digest.__wrapped__(time_between)
    monkeypatch.setattr(loop, "LOG_FULL", 99)
    assert digest.__wrapped__(time_between) == before


def test_a_process_that_dies_while_compiling_leaves_nothing_that_harms(tmp_path: Path) -> None:
    process = start(tmp_path)
    assert process.stderr is not None
    assert "compiling" in process.stderr.readline()
    process.kill()
    process.communicate()
    ((out, _),) = answers(start(tmp_path))
    assert out == "1.5\n"
