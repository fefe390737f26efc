"""A real Dask scheduler with two workers, and what is left when they are killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from tests.grids.conftest import Write
from tests.grids.kill import content
from vibro_cli.grids.workers import UnsafeAddress, check_address

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]
# Loaded by every worker: a chunk that kills its worker as long as a file exists, and chunks that
# wait where there are as many parts as another file says.
PRELOAD = """
import os, signal, time
from pathlib import Path
from vibro_cli.grids import workers

# A preloaded file may be loaded more than once.
workers.real = real = getattr(workers, "real", workers.solve_chunk)

def held(folder):
    most = folder.parent / "most"
    return most.exists() and len([*folder.glob("summary/part-*")]) >= int("0" + most.read_text())

def poisoned(run, grid, chunks, chunk, folder, engine):
    if chunk == 1 and (Path(folder).parent / "poison").exists():
        os.kill(os.getpid(), signal.SIGKILL)
    while held(Path(folder)):
        time.sleep(0.02)
    return real(run, grid, chunks, chunk, folder, engine)

workers.solve_chunk = poisoned
"""
WAITING = """
import sys
from distributed import Client
Client(sys.argv[1]).wait_for_workers(int(sys.argv[2]))
"""
PATIENCE = 120.0


class Cluster:
    """A scheduler and two workers, which can be killed and started again."""

    def __init__(self, work: Path) -> None:
        self._work = work
        self._runs = 0
        self.processes: list[subprocess.Popen[bytes]] = []
        self.address = ""
        """The address on which the scheduler listens."""
        (work / "preload.py").write_text(PRELOAD)

    def start(self) -> None:
        """Start a scheduler and two workers, and wait until they know each other."""
        self._runs += 1
        self._file = self._work / f"scheduler-{self._runs}.json"
        listen = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-show"]
        self._call("scheduler", *listen, "--scheduler-file", str(self._file))
        self.address = ""
        while not self.address:
            assert self.processes[0].poll() is None
            time.sleep(0.05)
            with suppress(FileNotFoundError, ValueError):  # not yet written, or not to its end
                self.address = json.loads(self._file.read_text())["address"]
        self.add_workers(2)

    def add_workers(self, count: int) -> None:
        """Start more workers, without a nanny: a killed worker stays dead."""
        file = ["--scheduler-file", str(self._file), "--preload", str(self._work / "preload.py")]
        for _ in range(count):
            self._call("worker", *file, "--no-nanny", "--nthreads", "1", "--no-dashboard")
        known = [sys.executable, "-c", WAITING, self.address, str(len(self.processes) - 1)]
        subprocess.run(known, check=True, timeout=PATIENCE)

    def _call(self, what: str, *arguments: str) -> None:
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", *arguments]
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        with open(self._work / f"{what}.log", "ab") as log:
            self.processes.append(
                subprocess.Popen(command, stdout=log, stderr=log, env=environment, cwd=self._work)
            )

    def stop(self) -> None:
        """End the processes that still run, and wait for them."""
        for process in self.processes:
            process.kill()
            process.wait()
        self.processes = []


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    running = Cluster(tmp_path)
    try:
        running.start()
        yield running
    finally:
        running.stop()


def sweep(grid: Path, folder: Path, address: str | None) -> subprocess.Popen[bytes]:
    call = [sys.executable, "-m", "vibro_cli", "grid", str(grid), "-o", str(folder)]
    call += ["--engine", "python", "--set", "stop.collisions=4"]
    call += ["--dask", address] if address is not None else []
    # The time after which a lost scheduler is given up.
    patience = {"DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "3s"}
    return subprocess.Popen(call, stderr=subprocess.PIPE, cwd=ROOT, env={**os.environ, **patience})


def solve_parts(folder: Path, count: int, process: subprocess.Popen[bytes]) -> None:
    """Let the workers go on until there are so many parts (each may make one more)."""
    (folder.parent / "most").write_text(str(count))
    while len(list(folder.glob("summary/part-*"))) < count:
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)


def test_killed_workers_and_schedulers_lose_nothing(
    small: Write, tmp_path: Path, cluster: Cluster
) -> None:
    grid = small(head="chunk_points = 1\n")
    _, told = (alone := sweep(grid, tmp_path / "alone", None)).communicate()
    assert alone.returncode == 0, told
    whole = content(tmp_path / "alone")
    assert len(whole) == 2 * 12 + 2

    calm = sweep(grid, tmp_path / "calm", cluster.address)
    _, told = calm.communicate(timeout=PATIENCE)
    assert calm.returncode == 0, told
    assert content(tmp_path / "calm") == whole

    folder = tmp_path / "disturbed"
    (tmp_path / "most").write_text("0")
    process = sweep(grid, folder, cluster.address)
    solve_parts(folder, 2, process)
    cluster.processes[1].send_signal(signal.SIGKILL)  # a worker: the other one takes over
    solve_parts(folder, 5, process)
    cluster.processes[0].send_signal(signal.SIGKILL)  # the scheduler
    _, told = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert b"scheduler" in told
    assert b"Traceback" not in told
    cluster.stop()

    (tmp_path / "most").unlink()
    cluster.start()
    _, told = (resumed := sweep(grid, folder, cluster.address)).communicate(timeout=PATIENCE)
    assert resumed.returncode == 0, told
    assert b"continuing after" in told
    assert content(folder) == whole


def test_a_chunk_that_kills_its_workers_is_left_out(
    small: Write, tmp_path: Path, cluster: Cluster
) -> None:
    grid = small(head="chunk_points = 3\n")
    (tmp_path / "poison").touch()
    cluster.add_workers(4)  # the scheduler gives up on a task after its fourth worker
    folder = tmp_path / "poisoned"
    _, told = (process := sweep(grid, folder, cluster.address)).communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert b"1 of 4 chunks were not solved; chunk 1: KilledWorker" in told, told
    parts = sorted(path.name for path in folder.glob("summary/*"))
    assert parts == [f"part-00000{chunk}.parquet" for chunk in (0, 2, 3)]
    (tmp_path / "poison").unlink()
    _, told = (process := sweep(grid, folder, cluster.address)).communicate(timeout=PATIENCE)
    assert process.returncode == 0, told
    _, _ = sweep(grid, tmp_path / "alone", None).communicate()
    assert content(folder) == content(tmp_path / "alone")


@pytest.mark.parametrize(
    ("address", "good"),
    [
        ("tls://10.0.0.1:8786", True),
        ("tcp://localhost:8786", True),
        ("tcp://127.0.0.1:8786", True),
        ("tcp://[::1]:8786", True),
        ("tcp://10.0.0.1:8786", False),
        ("tcp://localhost.example.org:8786", False),
        ("localhost:8786", False),
        ("http://localhost:8786", False),
    ],
)
def test_nothing_goes_over_a_network_in_the_open(address: str, good: bool) -> None:
    if good:
        check_address(address)
        return
    with pytest.raises(UnsafeAddress, match="expected tls://"):
        check_address(address)


def test_no_scheduler_is_one_line(
    small: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from vibro_cli.grids import workers as module

    monkeypatch.setattr(module, "_CONNECT", "1s")
    from vibro_cli.commands.app import run_command_line

    arguments = ["grid", str(small()), "-o", str(tmp_path / "o"), "--dask", "tcp://127.0.0.1:1"]
    assert run_command_line(arguments) == 1
