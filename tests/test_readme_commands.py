"""The commands of README.md are run as they stand there, in a folder like a user's."""

import configparser
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
FEW = ("three_arcs", "one_circle", "lone_particle")
# Stands in for GNU parallel where it is not installed: the same command, one value after another.
ONE_BY_ONE = """#!/bin/sh
[ "$1" = --halt ] && shift 2
command=; while [ "$1" != ::: ]; do command="$command $1"; shift; done; shift
for value in "$@"; do sh -c "$(printf %s "$command" | sed "s/{}/$value/g")" || exit 1; done
"""


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home folder with the checkout in `study`: the program, and some of the scenarios."""
    home = tmp_path_factory.mktemp("home")
    study = home / "study"
    (study / ".venv/bin").mkdir(parents=True)
    program = study / ".venv/bin/vibro"
    program.write_text(f'#!/bin/sh\nPYTHONPATH={ROOT} exec {sys.executable} -m vibro_cli "$@"\n')
    program.chmod(0o755)
    if shutil.which("parallel") is None:
        (study / ".venv/bin/parallel").write_text(ONE_BY_ONE)
        (study / ".venv/bin/parallel").chmod(0o755)
    (study / "scenarios").mkdir()
    for name in FEW:
        shutil.copy(ROOT / f"scenarios/{name}.toml", study / "scenarios")
    for folder in ("grids", "springs", "table"):
        shutil.copytree(ROOT / f"scenarios/{folder}", study / f"scenarios/{folder}")
    return home


def call(home: Path, command: str, folder: str = "study", **variables: str) -> str:
    """Run a command of the shell as a job would be; return its standard output."""
    path = f"{home}/study/.venv/bin:{os.environ['PATH']}"
    outcome = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", command],
        cwd=home / folder,
        env={"HOME": str(home), "PATH": path, "VIBRO_FIGURES": "0", **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    assert outcome.returncode == 0, f"{command}\n{outcome.stderr}"
    return outcome.stdout


def times(folder: Path) -> dict[str, int]:
    return {str(path): path.stat().st_mtime_ns for path in folder.glob("*/manifest.json")}


def test_every_command_line_runs(home: Path) -> None:
    install, *others = [line for block in blocks("sh") for line in block.splitlines()]
    call(home, install.partition("&& .venv/bin/vibro")[1][3:] + install.rpartition("vibro")[2])
    said = {}
    for line in others:
        if not line.startswith("python3 -m venv"):
            # `head` closes the pipe early, which must be no failure either.
            said[line] = call(home, line)
    first = next(text for line, text in said.items() if line.endswith("| head -1"))
    assert re.match(r'\{"n": 1, "t": [\d.]+, ', first)
    assert first.count("\n") == 1
    assert (home / "study/summaries.jsonl").read_text().count('"status": "ok"') == 2
    for k in ("0.7", "0.8", "0.9"):
        assert (home / f"study/results/k-{k}/collisions.parquet").exists()
    end = call(home, ".venv/bin/vibro show outputs/three_arcs/summary.parquet --columns end_time")
    assert end.split()[-1] == "120"


def test_make_runs_what_has_changed_and_nothing_else(home: Path) -> None:
    (text,) = blocks("make")
    (home / "study/Makefile").write_text(text)
    call(home, "make -j2")
    before = times(home / "study/results")
    assert {Path(path).parent.name for path in before} >= set(FEW)
    call(home, "make -q && touch -d '1 minute' scenarios/one_circle.toml && make -j2")
    after = times(home / "study/results")
    changed = {Path(path).parent.name for path in after if after[path] != before.get(path)}
    assert changed == {"one_circle"}


def test_a_task_of_the_slurm_array(home: Path) -> None:
    (text,) = blocks("bash")
    assert text.startswith("#!/bin/bash\n#SBATCH")
    call(home, text, SLURM_ARRAY_TASK_ID="3")
    assert (home / "study/results/k-0.85/summary.json").exists()


def test_the_line_of_cron_with_its_poor_environment(home: Path) -> None:
    (text,) = blocks("crontab")
    fields = text.split(None, 5)
    assert all(re.fullmatch(r"[\d*]+", field) for field in fields[:5])
    assert "%" not in text  # a percent sign ends the command in a crontab
    assert call(home, fields[5], folder=".", PATH="/usr/bin:/bin") == ""
    assert (home / "study/results/nightly/summary.json").exists()


def test_the_units_of_systemd(home: Path) -> None:
    service, timer = blocks("ini")
    units = home / ".config/systemd/user"
    units.mkdir(parents=True)
    for name, text in (("vibro.service", service), ("vibro.timer", timer)):
        (units / name).write_text(text.replace("%h", str(home)))
    parser = configparser.ConfigParser(interpolation=None)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read(units / "vibro.service")
    section = parser["Service"]
    variable, _, value = section["Environment"].partition("=")
    folder = Path(section["WorkingDirectory"]).relative_to(home)
    call(home, section["ExecStart"], folder=str(folder), **{variable: value})
    if shutil.which("systemd-analyze"):
        call(home, f"systemd-analyze verify {units}/vibro.timer", folder=".")
        call(home, "systemd-analyze calendar '*-*-* 02:15:00'", folder=".")
