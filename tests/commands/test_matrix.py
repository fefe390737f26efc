"""Every command on a terminal, in a pipe, in a closed pipe, on a full disk, in a read-only folder,
and interrupted: real processes, and one line of words where it cannot succeed.
"""

import shutil
import signal
from pathlib import Path

import pytest

from tests.commands import processes
from vibro_cli.commands.app import COMMANDS

pytestmark = pytest.mark.long

FALLING = str(Path(__file__).parents[2] / "scenarios" / "falling_balls.toml")
STARTS = """
base = "small.toml"
[[axes]]
path = "stop.time"
linspace = [0.1, 2.0, 40]
"""
INTERPRETED = ("--engine", "python")
# Every command in a form that prints results to standard output.
PRINTING = {
    "run": ["run", "small.toml", "--format", "jsonl"],
    "run --json": ["run", "small.toml", "--json", "--no-figures"],
    "grid": ["grid", "grid.toml", "--dry-run", "--json", *INTERPRETED],
    "section": ["section", "done", "--column", "s_a", "--column", "t", "--json"],
    "basins": ["basins", "starts", "--json", "--no-figures"],
    "orbit": ["orbit", FALLING, "--json", "--impacts", "1"],
    "fit": ["fit", "small.toml", "done/collisions.parquet", "--free", "gravity", "--json"],
    "portrait": ["portrait", "small.toml", "--json", "--no-figures"],
    "report": ["report", "done", "-o", "-"],
    "check": ["check", "small.toml"],
    "show": ["show", "done/collisions.parquet"],
    "verify": ["verify", "done", "--json"],
    "schema": ["schema"],
    "new": ["new", "three_arcs", "-o", "-"],
    "stress": ["stress", "--only", "elliptic"],
    "bench": ["bench", "--references", "times", "--scene", "five_balls"],
    "help": ["help", "tables"],
}
# Every command that writes files, in a form that writes them into `locked`.
WRITING = {
    "run": ["run", "small.toml", "--no-figures", "-o", "locked/out"],
    "run --continue": [
        "run", "--continue", "done", "--set", "stop.collisions=5", "--no-figures", "-o", "locked/on"
    ],
    "grid": ["grid", "grid.toml", "-o", "locked/grid", *INTERPRETED],
    "section": ["section", "done", "--column", "s_a", "--column", "t", "-o", "locked/s.png"],
    "basins": ["basins", "starts", "-o", "locked/basins"],
    "orbit": ["orbit", FALLING, "--impacts", "1", "-o", "locked/orbit"],
    "fit": [
        "fit", "small.toml", "done/collisions.parquet", "--free", "gravity", "-o", "locked/fit"
    ],
    "portrait": ["portrait", "small.toml", "--no-figures", "-o", "locked/portrait"],
    "report": ["report", "done", "-o", "locked/page.html"],
    "new": ["new", "three_arcs", "-o", "locked/new.toml"],
    "stress": ["stress", "--only", "elliptic", "-o", "locked/stress"],
    "bench": ["bench", "--references", "locked/times", "--scene", "five_balls"],
}  # fmt: skip
# These write only to standard output.
PRINTING_ONLY = {"check", "show", "verify", "schema", "help"}


def command_of(name: str) -> str:
    return name.split()[0]


def test_every_command_is_in_the_matrix() -> None:
    every = set(COMMANDS)
    assert {command_of(name) for name in PRINTING} == every
    assert {command_of(name) for name in WRITING} == every - PRINTING_ONLY


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a scenario and the results of one run."""
    folder = tmp_path_factory.mktemp("matrix")
    processes.prepare(folder)
    (folder / "starts.toml").write_text(STARTS)
    outcome = processes.call(folder, "grid", "starts.toml", "-o", "starts", "-q")
    assert outcome.returncode == 0, outcome.stderr
    (folder / "locked").mkdir()
    return folder


@pytest.mark.parametrize("name", PRINTING)
def test_on_a_terminal(folder: Path, name: str) -> None:
    code, seen = processes.on_terminal(folder, PRINTING[name], TERM="dumb", NO_COLOR="1")
    assert code == 0
    assert seen.strip()
    assert b"\x1b" not in seen


@pytest.mark.parametrize("name", PRINTING)
def test_in_a_pipe(folder: Path, name: str) -> None:
    outcome = processes.call(folder, *PRINTING[name])
    assert outcome.returncode == 0, outcome.stderr
    assert outcome.stdout.strip()
    assert b"\x1b" not in outcome.stdout + outcome.stderr
    assert b"\r" not in outcome.stderr  # nothing is overwritten: nobody is looking


@pytest.mark.parametrize("name", PRINTING)
def test_in_a_closed_pipe(folder: Path, name: str) -> None:
    outcome = processes.into_closed_pipe(folder, PRINTING[name])
    assert outcome.returncode == 0
    assert b"vibro:" not in outcome.stderr
    assert b"rror" not in outcome.stderr


@pytest.mark.parametrize("name", PRINTING)
def test_with_a_full_disk_behind_standard_output(folder: Path, name: str) -> None:
    outcome = processes.onto_full_device(folder, PRINTING[name])
    assert outcome.returncode == 1
    assert outcome.stderr.count(b"vibro: No space left on device\n") == 1
    assert b"Traceback" not in outcome.stderr


@pytest.mark.parametrize("name", PRINTING)
def test_interrupted_while_nobody_reads(folder: Path, name: str) -> None:
    code, words = processes.interrupted_while_printing(folder, PRINTING[name], signal.SIGINT)
    assert code == 130
    wrote = name in ("run --json", "section", "basins")  # before they print
    left = b"finished results are kept" if wrote else b"nothing was written"
    assert words.splitlines()[-1] == b"vibro: interrupted; " + left
    assert b"Traceback" not in words


@pytest.mark.parametrize("name", WRITING)
def test_on_a_full_disk(folder: Path, name: str) -> None:
    outcome, left = processes.in_mounts(folder, processes.FULL, WRITING[name])
    assert_refused(outcome, b"No space left on device")
    assert_nothing_left(name, set(left) - {"locked", "locked/others"})


@pytest.mark.parametrize("name", WRITING)
def test_where_files_may_not_grow(folder: Path, name: str) -> None:
    assert_refused(processes.with_short_files(folder, WRITING[name]), b"File too large")
    assert_nothing_left(name, clean(folder / "locked"))


@pytest.mark.parametrize("name", WRITING)
def test_in_a_read_only_folder(folder: Path, name: str) -> None:
    outcome, left = processes.in_mounts(folder, processes.READ_ONLY, WRITING[name])
    assert_refused(outcome, b"Read-only file system")
    assert_nothing_left(name, set(left) - {"locked"})


def test_a_mount_point_is_refused_before_anything_is_solved(folder: Path) -> None:
    mounting = "mount -t tmpfs tmpfs locked"
    outcome, _ = processes.in_mounts(folder, mounting, ["run", "small.toml", "-o", "locked"])
    refusal = b"a mount point, which cannot be replaced; expected a folder within it"
    assert (outcome.returncode, outcome.stderr) == (2, b"vibro: locked is " + refusal + b"\n")


def assert_nothing_left(name: str, left: set[str]) -> None:
    """Nothing; of a grid the dataset that was begun, to be taken up, without a file in the making.

    (It is, where there is room: see `tests/grids`.)
    """
    if name == "grid":
        left = {path for path in left if "/grid" not in path or ".partial-" in path}
    assert left == set()


def clean(folder: Path) -> set[str]:
    """Remove what a folder holds, and return all the paths that were in it."""
    found = {str(path) for path in folder.rglob("*")}
    for path in folder.iterdir():
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    return found


def assert_refused(outcome: processes.Outcome, reason: bytes) -> None:
    assert outcome.returncode == 1, outcome.stderr
    (words,) = [line for line in outcome.stderr.splitlines() if reason in line]
    assert words.startswith(b"vibro: ")
    assert b"locked" in words
    assert b"Traceback" not in outcome.stderr


@pytest.mark.parametrize("name", WRITING)
def test_a_folder_in_which_all_is_well(folder: Path, name: str) -> None:
    """The commands above do write where they can."""
    outcome = processes.call(folder, *WRITING[name])
    assert outcome.returncode == 0, outcome.stderr
    assert clean(folder / "locked")


def test_typing_control_c(folder: Path) -> None:
    code, seen = processes.on_terminal(folder, ["check", "-"], b"\x03", processes.TELLING)
    assert code in (130, -signal.SIGINT)  # the latter: before Python was there to hear it
    assert b"Traceback" not in seen
