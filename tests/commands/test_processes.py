"""The program as a process of its own: signals, locales, variables, completion, links, names."""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.commands.processes import ROOT, VIBRO, call, environment, prepare
from tests.two_balls import SCENARIO
from vibro_cli.commands.shared.error_handling import EXIT_CODES

pytestmark = pytest.mark.long

# Without losses a run with many impacts takes minutes, without compiling anything.
LONG = ["--engine", "python", "--set", "collision.k=1", "--set", "balls[1].angle=-0.5"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a scenario and the results of one run."""
    folder = tmp_path_factory.mktemp("processes")
    prepare(folder)
    return folder


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize(
    "arguments",
    [["run", "small.toml", "-o", "-"], ["schema", "scenario"], ["report", "done", "-o-"]],
)
def test_output_that_has_room_for_a_part_only_is_no_success(
    folder: Path, tmp_path: Path, arguments: list[str], unbuffered: str
) -> None:
    """With PYTHONUNBUFFERED, usual in containers, Python drops what the system does not take."""
    changes = {"PYTHONUNBUFFERED": unbuffered, "PYTHONDONTWRITEBYTECODE": "1"}
    with open(tmp_path / "part", "wb") as part:
        outcome = subprocess.run(
            [*VIBRO, *arguments], cwd=folder, env=environment(**changes), stdout=part,
            stderr=subprocess.PIPE, check=False,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100)),
        )  # fmt: skip
    assert (outcome.returncode, outcome.stderr) == (1, b"vibro: File too large\n")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_words_that_nobody_takes_change_nothing(folder: Path) -> None:
    for arguments, code in ((["check", "none.toml"], 2), (["run", "small.toml"], 0)):
        with open("/dev/full", "wb") as full:
            outcome = subprocess.run(
                [*VIBRO, *arguments], cwd=folder, env=environment(), stderr=full, check=False
            )
        assert outcome.returncode == code


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
    while not list(tmp_path.glob("all/.long.partial-*/collisions.parquet")):
        assert process.poll() is None
        time.sleep(0.01)
    process.send_signal(number)
    _, words = process.communicate(timeout=300)
    assert process.returncode == code
    assert words.splitlines()[-1].endswith("finished results are kept")
    assert "Traceback" not in words
    assert sorted(os.listdir(tmp_path / "all")) == ["long", "small"]
    summary = json.loads((tmp_path / "all" / "long" / "summary.json").read_bytes())
    assert summary["end_cause"] == "interrupted"
    assert call(tmp_path, "verify", "all/long").returncode == 0
    assert code in EXIT_CODES


def test_a_signal_that_is_ignored_stays_so(folder: Path) -> None:
    """As under `nohup`."""
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


def test_folders_may_be_named_in_other_letters(folder: Path, tmp_path: Path) -> None:
    """For example in Latin-1."""
    named = os.fsdecode(b"gr\xfcn")
    try:
        (tmp_path / named).mkdir()
    except OSError:
        pytest.skip("the system takes names in UTF-8 alone")
    shutil.copy(folder / "small.toml", tmp_path / named)
    kept = (folder / "grid.toml").read_text() + "[keep]\ncollisions = true\n"
    (tmp_path / named / "grid.toml").write_text(kept)
    run, grid = f"{named}/run", f"{named}/grid"
    for arguments in (
        ("run", f"{named}/small.toml", "-o", run, "--figures", "default", "--json"),
        ("report", run),
        ("grid", f"{named}/grid.toml", "-o", grid, "--json"),
        ("section", grid, "--column", "t", "--transient", "0", "--json"),
        ("report", grid, "-o", "page.html"),
    ):
        outcome = call(tmp_path, *arguments)
        assert outcome.returncode == 0, outcome.stderr
        if "--json" in arguments:
            json.loads(outcome.stdout)
    assert b"gr%FCn/grid/" in (tmp_path / "page.html").read_bytes()
    shown = call(tmp_path, "show", f"{run}/collisions.parquet", "--format", "csv").stdout
    assert shown == call(folder, "run", "small.toml", "--format", "csv").stdout


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
    """This holds for the program itself; libraries may look for their own files."""
    (tmp_path / ".config/vibro").mkdir(parents=True)
    for name in (".vibrorc", ".vibro.toml", ".config/vibro/config.toml"):
        (tmp_path / name).write_text("this is no configuration")
    plain = call(folder, "run", "small.toml", "--format", "csv")
    at_home = call(folder, "run", "small.toml", "--format", "csv", HOME=str(tmp_path))
    assert (at_home.returncode, at_home.stdout) == (0, plain.stdout)


@pytest.mark.parametrize("backend", ["nonsense", "tkagg", "module://none"])
def test_figures_do_not_depend_on_the_backend_of_the_user(
    folder: Path, tmp_path: Path, backend: str
) -> None:
    for name, changes in (("plain", {}), ("other", {"MPLBACKEND": backend})):
        target = str(tmp_path / name)
        outcome = call(folder, "run", "small.toml", "--figures", "energy", "-o", target, **changes)
        assert outcome.returncode == 0, outcome.stderr
    files = {file.name: file.read_bytes() for file in (tmp_path / "plain").iterdir()}
    assert "energy.png" in files
    assert files == {file.name: file.read_bytes() for file in (tmp_path / "other").iterdir()}


def test_a_home_folder_that_cannot_be_written_is_no_matter(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    outcome = call(
        folder, "portrait", "small.toml", "-o", str(tmp_path / "drawn"), "--log-format", "json",
        HOME=str(tmp_path / "file"), MPLCONFIGDIR="", XDG_CONFIG_HOME="", XDG_CACHE_HOME="",
    )  # fmt: skip
    assert outcome.returncode == 0
    lines = [json.loads(line)["message"] for line in outcome.stderr.splitlines()]
    assert lines == [f"small: files in {tmp_path / 'drawn'}"]


def completions(words: str, **changes: str) -> list[str]:
    """Return what bash would offer at the end of a command line."""
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
        ("vibro run --fo", ["--format", "--force"]),
        ("vibro run --engine c", ["compiled"]),
        ("vibro run scenarios/three", ["scenarios/three_arcs.toml"]),
        ("vibro orbit scenarios/three", ["scenarios/three_arcs.toml"]),
        ("vibro fit scenarios/three", ["scenarios/three_arcs.toml"]),
        ("vibro portrait scenarios/three", ["scenarios/three_arcs.toml"]),
        ("vibro run --set collision.l", ["collision.law="]),
        ("vibro check x.toml --set balls[2].an", ["balls[2].angle="]),
        ("vibro new three", ["three_arcs", "three_arcs_grid"]),
        ("vibro help exit", ["exit-codes"]),
    ],
)
def test_completion_in_the_shell(words: str, offered: list[str]) -> None:
    assert completions(words) == offered


def test_what_a_shell_asks_wrongly_fails(folder: Path) -> None:
    outcome = call(folder, **environment(_VIBRO_COMPLETE="nonsense_bash"))
    assert outcome.returncode == 1
    assert b"nonsense" in outcome.stderr


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
