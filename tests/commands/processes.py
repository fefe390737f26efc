"""The program as a process of its own, with its streams in every possible state."""

import os
import pty
import resource
import select
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.two_balls import SCENARIO

ROOT = Path(__file__).parents[2]
VIBRO = [sys.executable, "-m", "vibro_cli"]
GRID = """
base = "small.toml"
[[axes]]
path = "collision.k"
values = [0.8, 0.9]
"""
START = "from vibro_cli.__main__ import main; main()"
# Tells that it has begun: SIGINT ends Python with exit code 1 and a traceback until then.
TELLING = (
    "import signal; signal.signal(signal.SIGINT, signal.SIG_DFL); print('begun', flush=True); "
)
Outcome = subprocess.CompletedProcess[bytes]


def environment(**changes: str) -> dict[str, str]:
    """Return a user's environment: output is buffered, unlike on many test machines."""
    usual = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    return {**usual, "PYTHONPATH": str(ROOT), "VIBRO_FIGURES": "0", **changes}


def prepare(folder: Path) -> None:
    """Put a scenario, a grid, and the results of a run into a folder."""
    (folder / "small.toml").write_text(SCENARIO)
    (folder / "grid.toml").write_text(GRID)
    outcome = call(folder, "run", "small.toml", "-o", "done", "-q")
    assert outcome.returncode == 0, outcome.stderr


def call(folder: Path, *arguments: str, **changes: str) -> Outcome:
    """Run a command with its outputs in pipes that are read."""
    return subprocess.run(
        [*VIBRO, *arguments],
        cwd=folder,
        env=environment(**changes),
        capture_output=True,
        check=False,
        timeout=300,
    )


def begun(arguments: Sequence[str]) -> subprocess.Popen[bytes]:
    """Start a command in the checkout, and return once signals meet the program itself."""
    process = subprocess.Popen(
        [sys.executable, "-c", TELLING + START, *arguments],
        cwd=ROOT, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=0,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == b"begun\n"
    return process


def in_shell(folder: Path, line: str) -> Outcome:
    """Run a line of the shell in which `vibro` is the program."""
    program = f'vibro() {{ {shlex.join(VIBRO)} "$@"; }}\n'
    return subprocess.run(
        ["bash", "-euo", "pipefail", "-c", program + line],
        cwd=folder,
        env=environment(),
        capture_output=True,
        check=False,
        timeout=300,
    )


def on_terminal(
    folder: Path, arguments: list[str], typed: bytes = b"", before: str = "", **changes: str
) -> tuple[int, bytes]:
    """Exit code and all output of a command whose three streams are a terminal.

    What is typed is typed again and again, from the first output until the command ends, as by
    somebody impatient. `before` is Python to be run first.
    """
    command = [sys.executable, "-c", before + START] if before else VIBRO
    process, terminal = pty.fork()
    if process == 0:
        os.chdir(folder)
        variables = environment(**{"TERM": "xterm", **changes})
        os.execve(sys.executable, [*command, *arguments], variables)
    output = b""
    while True:
        while typed and output and not select.select([terminal], [], [], 0.3)[0]:
            os.write(terminal, typed)
        try:
            more = os.read(terminal, 65536)
        except OSError:  # the other side is closed (Linux)
            break
        if not more:
            break
        output += more
    os.close(terminal)
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), output


def into_closed_pipe(folder: Path, arguments: list[str]) -> Outcome:
    """Run a command whose reader has gone before it starts."""
    reading, writing = os.pipe()
    os.close(reading)
    try:
        return subprocess.run(
            [*VIBRO, *arguments], cwd=folder, env=environment(), stdout=writing,
            stderr=subprocess.PIPE, check=False, timeout=300,
        )  # fmt: skip
    finally:
        os.close(writing)


def onto_full_device(folder: Path, arguments: list[str]) -> Outcome:
    """Run a command whose standard output has no room."""
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full on this system")
    with open("/dev/full", "wb") as full:
        return subprocess.run(
            [*VIBRO, *arguments], cwd=folder, env=environment(), stdout=full,
            stderr=subprocess.PIPE, check=False, timeout=300,
        )  # fmt: skip


def interrupted_while_printing(
    folder: Path, arguments: list[str], number: signal.Signals
) -> tuple[int, bytes]:
    """Exit code and words of a command that gets a signal when its reader has stopped reading."""
    if not Path("/proc/self/wchan").exists():
        pytest.skip("the system does not tell what a process waits for")
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    try:
        while True:
            os.write(writing, b"x" * 4096)
    except BlockingIOError:  # the pipe is full
        os.set_blocking(writing, True)
    process = subprocess.Popen(
        [*VIBRO, *arguments], cwd=folder, env=environment(), stdout=writing, stderr=subprocess.PIPE
    )
    os.close(writing)
    while "pipe" not in Path(f"/proc/{process.pid}/wchan").read_text():
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)
    process.send_signal(number)
    _, words = process.communicate(timeout=300)
    os.close(reading)
    return process.returncode, words


def with_short_files(folder: Path, arguments: list[str]) -> Outcome:
    """Run a command whose files may not grow beyond 100 bytes."""
    return subprocess.run(
        [*VIBRO, *arguments],
        cwd=folder,
        env=environment(PYTHONDONTWRITEBYTECODE="1"),
        capture_output=True,
        check=False,
        timeout=300,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100)),
    )


def in_mounts(folder: Path, mounting: str, arguments: list[str]) -> tuple[Outcome, list[str]]:
    """Run a command where `mounting` has been done; also return what is in `locked` afterwards.

    The mounts are seen by this process alone, and need no rights but those of a user namespace.
    """
    command = (
        f"{mounting} || exit 99; {shlex.join([*VIBRO, *arguments])}; code=$?; "
        "find locked >&3; exit $code"
    )
    with open(folder / "found", "w+") as found:
        # bash: file 3 for the list of files
        outcome = subprocess.run(
            ["unshare", "-Urm", "bash", "-c", f"exec 3>>{folder}/found; {command}"],
            cwd=folder, env=environment(), capture_output=True, check=False, timeout=300,
        )  # fmt: skip
        if outcome.returncode == 99 or b"unshare" in outcome.stderr:
            pytest.skip(f"nothing can be mounted here: {outcome.stderr.decode().strip()}")
        return outcome, sorted(found.read().split())


READ_ONLY = "mount --bind locked locked && mount -o remount,ro,bind locked"
FULL = "mount -t tmpfs -o size=64k tmpfs locked && ! cat /dev/zero 2> /dev/null > locked/others"
