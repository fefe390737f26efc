"""Every command as a process of its own: on terminals, pipes, full disks, read-only folders."""

import json
import os
import pty
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.commands.conftest import SCENARIO
from vibro_cli.commands.boundary import EXIT_CODES

ROOT = Path(__file__).parents[2]
VIBRO = [sys.executable, "-m", "vibro_cli"]
# Every command in a form that prints results to standard output.
PRINTING = {
    "run": ["run", "small.toml", "--format", "jsonl"],
    "run --json": ["run", "small.toml", "--json", "--no-figures"],
    "check": ["check", "small.toml"],
    "show": ["show", "done/collisions.parquet"],
    "schema": ["schema"],
    "new": ["new", "three_arcs", "-o", "-"],
    "help": ["help", "tables"],
    "portrait": ["portrait", "small.toml", "--json", "--no-figures"],
}
# Every command that writes files, and where.
WRITING = {
    "run": ["run", "small.toml", "--no-figures", "-o", "locked/out"],
    "run --continue": ["run", "--continue", "locked/done", "--set", "stop.collisions=5"],
    "new": ["new", "three_arcs", "-o", "locked/new.toml"],
    "portrait": ["portrait", "small.toml", "--no-figures", "-o", "locked/portrait"],
}
# Without losses a run with many impacts asked for goes on for minutes, without compiling anything.
LONG = ["--engine", "python", "--set", "collision.k=1", "--set", "balls[1].angle=-0.5"]


def environment(**changes: str) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT), "VIBRO_FIGURES": "0", **changes}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a scenario and the results of one run."""
    folder = tmp_path_factory.mktemp("processes")
    (folder / "small.toml").write_text(SCENARIO)
    subprocess.run(
        [*VIBRO, "run", "small.toml", "-o", "done", "-q"], cwd=folder, env=environment(), check=True
    )
    return folder


def call(folder: Path, *arguments: str, **changes: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [*VIBRO, *arguments],
        cwd=folder,
        env=environment(**changes),
        capture_output=True,
        check=False,
        timeout=60,
    )


def on_terminal(folder: Path, arguments: list[str], **changes: str) -> tuple[int, bytes]:
    """Exit code and all output of a command whose three streams are a terminal."""
    process, terminal = pty.fork()
    if process == 0:
        os.chdir(folder)
        os.execve(sys.executable, [*VIBRO, *arguments], environment(**changes))
    output = b""
    while True:
        try:
            more = os.read(terminal, 65536)
        except OSError:  # the other side is closed (Linux)
            break
        if not more:
            break
        output += more
    os.close(terminal)
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), output


@pytest.mark.parametrize("name", PRINTING)
def test_on_a_terminal_and_in_a_pipe(folder: Path, name: str) -> None:
    piped = call(folder, *PRINTING[name])
    assert piped.returncode == 0, piped.stderr
    assert piped.stdout
    assert b"\x1b" not in piped.stdout + piped.stderr
    code, seen = on_terminal(folder, PRINTING[name], NO_COLOR="1", TERM="dumb")
    assert code == 0
    assert b"\x1b" not in seen
    if name != "show":  # its columns are cut to fit the terminal
        assert piped.stdout.splitlines()[0] in seen


@pytest.mark.parametrize("name", PRINTING)
def test_into_a_closed_pipe(folder: Path, name: str) -> None:
    process = subprocess.Popen(
        [*VIBRO, *PRINTING[name], *([] if name == "help" else ["-q"])],
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    assert process.stderr.read() == b""
    process.stderr.close()
    assert process.wait(timeout=60) == 0


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
@pytest.mark.parametrize("name", PRINTING)
def test_onto_a_full_disk(folder: Path, name: str) -> None:
    with open("/dev/full", "wb") as full:
        outcome = subprocess.run(
            [*VIBRO, *PRINTING[name]],
            cwd=folder,
            env=environment(),
            stdout=full,
            stderr=subprocess.PIPE,
            check=False,
        )
    assert outcome.returncode == 1
    assert outcome.stderr.splitlines()[-1] == b"vibro: No space left on device"
    assert b"Traceback" not in outcome.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_words_that_nobody_takes_change_nothing(folder: Path) -> None:
    for arguments, code in ((["check", "none.toml"], 2), (["run", "small.toml"], 0)):
        with open("/dev/full", "wb") as full:
            outcome = subprocess.run(
                [*VIBRO, *arguments], cwd=folder, env=environment(), stderr=full, check=False
            )
        assert outcome.returncode == code


@pytest.fixture
def small_disk(folder: Path) -> Iterator[Path]:
    """A folder whose files may not grow: the next best thing to a full disk."""
    locked = folder / "locked"
    shutil.copytree(folder / "done", locked / "done")
    yield locked
    shutil.rmtree(locked)


def listing(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


@pytest.mark.parametrize("name", WRITING)
def test_files_that_may_not_grow_leave_nothing_behind(
    folder: Path, small_disk: Path, name: str
) -> None:
    before = listing(small_disk)
    outcome = subprocess.run(
        [*VIBRO, *WRITING[name]],
        cwd=folder,
        env=environment(PYTHONDONTWRITEBYTECODE="1"),
        capture_output=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100)),
    )
    assert outcome.returncode == 1
    assert outcome.stderr.count(b"\n") == 1
    assert b"File too large" in outcome.stderr
    assert listing(small_disk) == before


@pytest.mark.parametrize("name", WRITING)
def test_where_nothing_can_be_written(folder: Path, small_disk: Path, name: str) -> None:
    before = listing(small_disk)
    arguments = list(WRITING[name])
    if os.geteuid() == 0:  # root may write anywhere: a file where a folder should be stops it too
        if name == "run --continue":
            pytest.skip("root writes into every folder")
        (small_disk / "file").write_text("")
        before = listing(small_disk)
        arguments[-1] = arguments[-1].replace("locked/", "locked/file/")
    else:
        small_disk.chmod(0o555)
    outcome = call(folder, *arguments)
    small_disk.chmod(0o755)
    assert outcome.returncode == 1
    assert outcome.stderr.startswith(b"vibro: ")
    assert outcome.stderr.count(b"\n") == 1
    assert listing(small_disk) == before


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]
)
def test_a_signal_ends_a_run_in_the_middle(
    folder: Path, tmp_path: Path, number: signal.Signals, code: int
) -> None:
    (tmp_path / "long.toml").write_text(
        SCENARIO.replace("collisions = 3", "collisions = 100000000")
    )
    process = subprocess.Popen(
        [*VIBRO, "run", str(folder / "small.toml"), "long.toml", "-o", "all", *LONG],
        cwd=tmp_path,
        env=environment(),
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    while "files" not in process.stderr.readline():  # the first scenario is done
        assert process.poll() is None
    time.sleep(0.3)
    process.send_signal(number)
    _, words = process.communicate(timeout=60)
    assert process.returncode == code
    assert words.splitlines()[-1].endswith("what was finished is kept")
    assert "Traceback" not in words
    assert os.listdir(tmp_path / "all") == ["small"]
    assert code in EXIT_CODES


def test_a_signal_that_is_ignored_stays_so(folder: Path) -> None:
    """As `nohup` asks for."""
    command = (
        f"trap '' HUP; {sys.executable} -m vibro_cli check small.toml -q & kill -HUP $!; wait $!"
    )
    outcome = subprocess.run(["bash", "-c", command], cwd=folder, env=environment(), check=False)
    assert outcome.returncode == 0


def test_letters_of_every_locale(folder: Path) -> None:
    whole = call(folder, "check", "small.toml", PYTHONUTF8="1").stdout.decode()
    assert "κ = 1.4" in whole
    for name in ("C", "POSIX", "C.UTF-8"):
        plain = call(folder, "check", "small.toml", LC_ALL=name, PYTHONCOERCECLOCALE="0")
        assert plain.returncode == 0
        assert plain.stderr == b""
        assert b" = 1.4" in plain.stdout
    ascii_only = call(folder, "check", "small.toml", PYTHONIOENCODING="ascii", PYTHONUTF8="0")
    assert b"\\u03ba = 1.4" in ascii_only.stdout


def test_flags_go_before_the_environment_and_this_before_defaults(folder: Path) -> None:
    def summary(*arguments: str, **changes: str) -> int:
        return call(folder, "run", "small.toml", "--json", "-q", *arguments, **changes).returncode

    assert summary(VIBRO_ENGINE="python") == 0
    assert summary(VIBRO_ENGINE="steam") == 2
    assert summary("--engine", "python", VIBRO_ENGINE="steam") == 0
    outcome = call(folder, "check", "none.toml", VIBRO_LOG_FORMAT="json")
    assert json.loads(outcome.stderr)["level"] == "error"
    outcome = call(folder, "check", "none.toml", "--log-format", "text", VIBRO_LOG_FORMAT="json")
    assert outcome.stderr.startswith(b"none.toml: ")


def test_nothing_is_read_from_the_home_folder(folder: Path, tmp_path: Path) -> None:
    """Not by this program: what it imports is of the libraries, which may look for their own."""
    (tmp_path / ".config/vibro").mkdir(parents=True)
    for name in (".vibrorc", ".vibro.toml", ".config/vibro/config.toml"):
        (tmp_path / name).write_text("this is no configuration")
    plain = call(folder, "run", "small.toml", "--format", "csv")
    at_home = call(folder, "run", "small.toml", "--format", "csv", HOME=str(tmp_path))
    assert (at_home.returncode, at_home.stdout) == (0, plain.stdout)


def completions(words: str, **changes: str) -> list[str]:
    """What bash would offer at the end of a command line."""
    count = str(len(words.split(" ")) - 1)
    outcome = call(
        ROOT,
        **environment(
            _VIBRO_COMPLETE="complete_bash", COMP_WORDS=words, COMP_CWORD=count, **changes
        ),
    )
    return outcome.stdout.decode().split()


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("vibro che", ["check"]),
        ("vibro run --fo", ["--format"]),
        ("vibro run --engine n", ["numba"]),
        ("vibro run scenarios/three", ["scenarios/three_arcs.toml"]),
        ("vibro run --set collision.l", ["collision.law="]),
        ("vibro check x.toml --set balls[2].an", ["balls[2].angle="]),
        ("vibro new three", ["three_arcs"]),
        ("vibro help exit", ["exit-codes"]),
    ],
)
def test_completion_in_the_shell(words: str, offered: list[str]) -> None:
    assert completions(words) == offered


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_of_each_shell(folder: Path, shell: str) -> None:
    outcome = call(folder, **environment(_VIBRO_COMPLETE=f"source_{shell}"))
    assert b"_VIBRO_COMPLETE" in outcome.stdout
    if shutil.which(shell):
        check = subprocess.run([shell, "-n"], input=outcome.stdout, check=False)
        assert check.returncode == 0


def test_links_and_existing_files(folder: Path, tmp_path: Path) -> None:
    """A link to a folder is followed; a file in the way is never replaced."""
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    small = str(folder / "small.toml")
    assert call(tmp_path, "run", small, "-o", "link").returncode == 0
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "elsewhere/summary.json").exists()
    (tmp_path / "file").write_text("mine")
    assert call(tmp_path, "run", small, "-o", "file").returncode == 2
    assert (tmp_path / "file").read_text() == "mine"
    (tmp_path / "new.toml").symlink_to(tmp_path / "file")
    assert call(tmp_path, "new", "three_arcs", "-o", "new.toml").returncode == 2
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize("name", ["../outside", "/tmp/outside", "a/b", "..", "", "a\\u0000b"])
def test_a_name_leads_nowhere_else(folder: Path, tmp_path: Path, name: str) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    (inner / "x.toml").write_text(f'name = "{name}"\n{SCENARIO}')
    outcome = call(inner, "run", "x.toml")
    assert outcome.returncode == 2
    assert b"name: found" in outcome.stderr
    assert os.listdir(tmp_path) == ["inner"]
    assert os.listdir(inner) == ["x.toml"]
