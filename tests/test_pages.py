"""Commands, Python and notebooks of README.md and docs/ run as written, as a user would."""

import configparser
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

from tests.pages import DOCS, ROOT, blocks, every_block, pages

pytestmark = pytest.mark.long

JOBS = DOCS / "jobs.md"
FEW = ("three_arcs", "one_circle", "lone_particle")
# Stands in for GNU parallel where it is not installed: the same command, one value after another.
ONE_BY_ONE = """#!/bin/sh
[ "$1" = --halt ] && shift 2
command=; while [ "$1" != ::: ]; do command="$command $1"; shift; done; shift
for value in "$@"; do sh -c "$(printf %s "$command" | sed "s/{}/$value/g")" || exit 1; done
"""


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a home folder with the checkout in `study`: program, scenarios, README's first run."""
    home = tmp_path_factory.mktemp("home")
    study = home / "study"
    (study / ".venv/bin").mkdir(parents=True)
    program = study / ".venv/bin/vibro"
    program.write_text(f'#!/bin/sh\nPYTHONPATH={ROOT} exec {sys.executable} -m vibro_cli "$@"\n')
    program.chmod(0o755)
    if shutil.which("parallel") is None:
        (study / ".venv/bin/parallel").write_text(ONE_BY_ONE)
        (study / ".venv/bin/parallel").chmod(0o755)
    shutil.copytree(ROOT / "scenarios", study / "scenarios")
    call(home, "vibro run scenarios/three_arcs.toml -q")
    return home


def call(home: Path, command: str, folder: str = "study", **variables: str) -> str:
    """Run a shell command as a job would; return its standard output."""
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


def without_installing(line: str) -> str:
    """Return the line that sets everything up without its installation."""
    return re.sub(r"^python3 -m venv .* && ", "", line)


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.stem)
def test_the_blocks_of_a_page_run(
    page: Path, home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Commands, Python and notebooks of a page, one after the other, in a folder of its own."""
    folder = tmp_path / "study"
    shutil.copytree(home / "study", folder, symlinks=True)
    monkeypatch.chdir(folder)
    names: dict[str, Any] = {}
    said = ""
    for before, language, block in every_block(page):
        if language == "sh":
            lines = [line for line in block.splitlines() if "pytest" not in line]
            said = "".join(
                call(tmp_path, f"{without_installing(line)} 2>&1", COLUMNS="80") for line in lines
            )
        elif language in ("python", "{code-cell}"):
            exec(compile(without_options(block), page.name, "exec"), names)
        elif language == "toml":
            write_named(before, block)
        elif language == "text" and not before.strip() and said:
            # The first run may begin with the message that the kernels are compiled.
            assert said.endswith(block), said


def without_options(cell: str) -> str:
    """Return a cell of a notebook without its options: `:tags: [...]`."""
    return re.sub(r"\A(:[^\n]*\n)+", "", cell)


def write_named(before: str, block: str) -> None:
    """Write a block to the last file that the text before it names, if any."""
    tomllib.loads(block)
    named = re.findall(r"`([\w-]+\.toml)`[^`]*\Z", before)
    if named:
        Path(named[-1]).write_text(block, encoding="utf-8")


def test_one_line_of_a_stream_is_one_line_of_json(home: Path) -> None:
    line = next(line for line in blocks(JOBS, "sh")[0].splitlines() if line.endswith("| head -1"))
    first = call(home, line)
    assert re.match(r'\{"n": 1, "t": [\d.]+, ', first)
    assert first.count("\n") == 1


def test_make_runs_what_has_changed_and_nothing_else(home: Path) -> None:
    (text,) = blocks(JOBS, "make")
    study = shutil.copytree(home / "study", home / "few", symlinks=True)
    for file in (study / "scenarios").glob("*.toml"):
        if file.stem not in FEW:
            file.unlink()
    (study / "Makefile").write_text(text)
    call(home, "make -j2", folder="few")
    before = times(study / "results")
    assert {Path(path).parent.name for path in before} >= set(FEW)
    touched = "touch -d '1 minute' scenarios/one_circle.toml"
    call(home, f"make -q && {touched} && make -j2", folder="few")
    after = times(study / "results")
    changed = {Path(path).parent.name for path in after if after[path] != before.get(path)}
    assert changed == {"one_circle"}


def test_a_task_of_the_slurm_array(home: Path) -> None:
    (text,) = blocks(JOBS, "bash")
    assert text.startswith("#!/bin/bash\n#SBATCH")
    call(home, text, SLURM_ARRAY_TASK_ID="3")
    assert (home / "study/results/k-0.85/summary.json").exists()


def test_the_line_of_cron_with_its_poor_environment(home: Path) -> None:
    (text,) = blocks(JOBS, "crontab")
    fields = text.split(None, 5)
    assert all(re.fullmatch(r"[\d*]+", field) for field in fields[:5])
    assert "%" not in text  # a percent sign ends the command in a crontab
    assert call(home, fields[5], folder=".", PATH="/usr/bin:/bin") == ""
    assert (home / "study/results/nightly/summary.json").exists()


def test_the_units_of_systemd(home: Path) -> None:
    service, timer = blocks(JOBS, "ini")
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
