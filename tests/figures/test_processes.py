"""Figures drawn by several processes: results, errors and warnings are those of one."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.commands.processes import environment
from tests.scenario.texts import parse_scenario
from tests.two_balls import SCENARIO
from vibro_cli.api import simulate
from vibro_cli.figures import processes
from vibro_cli.figures.processes import each_drawn
from vibro_cli.interface import files_of
from vibro_cli.report.content import report_html
from vibro_cli.storage.folders import write_run
from vibro_cli.storage.stored import StoredRun, in_memory, open_run

pytestmark = pytest.mark.long

JOBS = 12
PATIENCE = 120.0


@pytest.fixture
def run(tmp_path: Path) -> StoredRun:
    scenario = parse_scenario(SCENARIO)
    write_run(simulate(scenario), scenario, tmp_path / "run", {})
    return open_run(tmp_path / "run")


@pytest.fixture(autouse=True)
def several(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let three processes share few jobs, on any machine."""
    monkeypatch.setattr(processes, "_LEAST", 1)
    monkeypatch.setattr(processes, "available_cores", lambda: 3)


def forbidden(*_: object, **__: object) -> None:
    raise BlockingIOError("no further process is permitted")


def meet(folder: Path, caller: int) -> bool:
    """Return whether this is another process than the caller, which waits until there is one."""
    if os.getpid() != caller:
        (folder / "met").touch()
        return True
    end = time.monotonic() + PATIENCE
    while not (folder / "met").exists():
        assert time.monotonic() < end
        time.sleep(0.01)
    return False


def counted(run: StoredRun, number: int, folder: Path, caller: int) -> tuple[int, int, bool]:
    """Let the caller wait until another process has had an answer taken and begins a second job.

    Otherwise the caller may finish all other jobs, and this one, before the answer is taken.
    """
    begun = folder / f"begun by {os.getpid()}"
    there = os.getpid() != caller
    if not there or begun.exists():
        meet(folder, caller)
    begun.touch()
    return number, int(run.summary["collisions"]), there


def killed(run: StoredRun, number: int, folder: Path, caller: int) -> int:
    if meet(folder, caller):
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def stuck(run: StoredRun, number: int, folder: Path, caller: int) -> int:
    if meet(folder, caller):
        time.sleep(PATIENCE)
    return number


def printing(run: StoredRun, number: int, folder: Path, caller: int) -> int:
    meet(folder, caller)
    os.write(1, b"words that are no answer")
    return number


def failing(run: StoredRun, number: int, folder: Path, caller: int) -> int:
    meet(folder, caller)
    if number >= JOBS // 2:
        raise OSError(5, "cannot be read", f"table {number}")
    return number


def warning(run: StoredRun, number: int, folder: Path, caller: int) -> int:
    meet(folder, caller)
    warnings.warn("this is hard to draw", stacklevel=1)
    return number


def jobs(tmp_path: Path) -> list[tuple[int, tuple[int, Path, int]]]:
    return [(0, (number, tmp_path, os.getpid())) for number in range(JOBS)]


def test_other_processes_give_results_in_order(run: StoredRun, tmp_path: Path) -> None:
    found = each_drawn(counted, [run], jobs(tmp_path))
    assert [number for number, _, _ in found] == list(range(JOBS))
    assert {impacts for _, impacts, _ in found} == {run.summary["collisions"]}
    assert any(there for _, _, there in found)


@pytest.mark.parametrize("draw", [killed, printing])
def test_what_other_processes_do_not_draw_is_drawn_here(
    run: StoredRun, tmp_path: Path, draw: Callable[..., int]
) -> None:
    assert each_drawn(draw, [run], jobs(tmp_path)) == list(range(JOBS))


def test_another_process_is_not_waited_for(run: StoredRun, tmp_path: Path) -> None:
    """It may take long to solve a run whose motion is at hand here."""
    assert each_drawn(stuck, [run], jobs(tmp_path)) == list(range(JOBS))
    assert time.time() - (tmp_path / "met").stat().st_mtime < PATIENCE / 2


def test_an_error_of_another_process_is_raised_here(run: StoredRun, tmp_path: Path) -> None:
    with pytest.raises(OSError, match="cannot be read: 'table") as raised:
        each_drawn(failing, [run], jobs(tmp_path))
    assert raised.value.errno == 5


def test_a_warning_of_another_process_is_given_here(run: StoredRun, tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="this is hard to draw") as warned:
        assert each_drawn(warning, [run], jobs(tmp_path)) == list(range(JOBS))
    assert len(warned) == JOBS


def test_without_other_processes_all_is_drawn_here(
    run: StoredRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "met").touch()
    monkeypatch.setattr(subprocess, "Popen", forbidden)
    expected = [(number, run.summary["collisions"], False) for number in range(JOBS)]
    assert each_drawn(counted, [run], jobs(tmp_path)) == expected


def test_without_a_known_executable_all_is_drawn_here(
    run: StoredRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in a program that embeds Python."""
    (tmp_path / "met").touch()
    monkeypatch.setattr(sys, "executable", None)
    expected = [(number, run.summary["collisions"], False) for number in range(JOBS)]
    assert each_drawn(counted, [run], jobs(tmp_path)) == expected


def test_what_is_no_string_in_the_path_of_modules_is_ignored(
    run: StoredRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", [tmp_path, *sys.path])
    found = each_drawn(counted, [run], jobs(tmp_path))
    assert [number for number, _, _ in found] == list(range(JOBS))
    assert any(there for _, _, there in found)


def test_runs_in_memory_and_few_figures_start_no_process(
    run: StoredRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "met").touch()
    monkeypatch.setattr(processes, "_started", lambda: pytest.fail("a process was started"))
    in_process = in_memory(simulate(parse_scenario(SCENARIO)), parse_scenario(SCENARIO))
    assert len(each_drawn(counted, [in_process], jobs(tmp_path))) == JOBS
    monkeypatch.setattr(processes, "_LEAST", JOBS)
    assert len(each_drawn(counted, [run], jobs(tmp_path))) == JOBS


def test_a_long_run_starts_no_process(
    run: StoredRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each process would hold its impacts."""
    (tmp_path / "met").touch()
    monkeypatch.setattr(processes, "_started", lambda: pytest.fail("a process was started"))
    monkeypatch.setattr(processes, "_MOST_IMPACTS", 2 * run.summary["collisions"] - 1)
    assert len(each_drawn(counted, [run], jobs(tmp_path))) == JOBS


def test_the_page_has_the_bytes_of_one_process(
    run: StoredRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = parse_scenario(SCENARIO.replace("k = 0.9", "k = 0.5"))
    write_run(simulate(scenario), scenario, tmp_path / "other", {})

    def page() -> bytes:
        return report_html([open_run(tmp_path / name) for name in ("run", "other")], tmp_path)

    shared = page()
    monkeypatch.setattr(processes, "_MOST", 1)
    monkeypatch.setattr(processes, "_started", lambda: pytest.fail("a process was started"))
    assert page() == shared


def test_files_of_figures_have_the_bytes_of_one_process(
    run: StoredRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = parse_scenario(SCENARIO.replace("k = 0.9", "k = 0.5"))
    write_run(simulate(scenario), scenario, tmp_path / "other", {})
    kinds = ("portrait", "energy", "intervals")

    def files() -> dict[str, bytes]:
        runs = {f"{name}_": open_run(tmp_path / name) for name in ("run", "other")}
        return files_of(runs, kinds, "single", ("png", "pdf", "svg"))

    shared = files()
    monkeypatch.setattr(processes, "_MOST", 1)
    monkeypatch.setattr(processes, "_started", lambda: pytest.fail("a process was started"))
    alone = files()
    assert list(alone) == list(shared)
    assert alone == shared
    stems = ("portrait_1", "portrait_2", "energy", "intervals")
    assert list(alone)[::3] == [f"{run}_{stem}.png" for run in ("run", "other") for stem in stems]


def slow(run: StoredRun, folder: Path, caller: int, seconds: float) -> None:
    """Take so long in another process than the caller, which takes long."""
    (folder / f"{os.getpid()}.met").touch()
    time.sleep(PATIENCE if os.getpid() == caller else seconds)


def is_running(number: str) -> bool:
    found = subprocess.run(["ps", "-o", "stat=", "-p", number], capture_output=True, check=False)
    return found.stdout.strip()[:1] not in (b"", b"Z")


COMMAND = """
import os, sys
from pathlib import Path
from tests.figures.test_processes import slow
from vibro_cli.commands.shared.error_handling import perform
from vibro_cli.figures import processes
from vibro_cli.storage.stored import open_run

def task():
    jobs = [(0, (Path.cwd(), os.getpid(), float(sys.argv[1])))] * 40
    processes.each_drawn(slow, [open_run(Path("run"))], jobs)
    return 0

processes.available_cores = lambda: 2
sys.exit(perform(lambda: task, "text"))
"""


@pytest.mark.parametrize(
    ("number", "seconds", "code", "words"),
    [
        (signal.SIGINT, PATIENCE, 130, b"vibro: interrupted; nothing was written\n"),
        (signal.SIGTERM, PATIENCE, 143, b"vibro: terminated; nothing was written\n"),
        (signal.SIGKILL, 1.0, -9, b""),  # the other learns of it when it answers
    ],
)
def test_a_signal_ends_all_processes_without_further_words(
    run: StoredRun, tmp_path: Path, number: signal.Signals, seconds: float, code: int, words: bytes
) -> None:
    """The signal goes to a group of processes, as Ctrl-C does."""
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, str(seconds)],
        cwd=tmp_path, env=environment(), stderr=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip
    while len(met := list(tmp_path.glob("*.met"))) < 2:
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    os.killpg(process.pid, number)
    end = time.monotonic() + PATIENCE / 2
    assert process.communicate(timeout=PATIENCE / 2)[1] == words
    assert process.returncode == code
    while any(is_running(path.stem) for path in met):
        assert time.monotonic() < end
        time.sleep(0.05)
