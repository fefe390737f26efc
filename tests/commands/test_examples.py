"""Every example in the help and in the gallery is run as written."""

import re
import shlex
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from tests.commands import processes
from tests.commands.conftest import Vibro
from vibro_cli.commands.app import EXAMPLES, application

pytestmark = pytest.mark.long

GALLERY = Path(__file__).parents[2] / "scenarios"
COMMANDS: Any = typer.main.get_group(application()).commands
REDIRECTED = re.compile(r"[|<>;&$*?~]")
"""What a shell may have to interpret."""
OPTION = re.compile(r"e\.g\. (--[\w-]+ \S+?)[.,;)]?(?:\s|$)")


def test_every_command_has_examples_in_its_help(vibro: Vibro) -> None:
    assert set(EXAMPLES) == set(COMMANDS)
    for command, lines in EXAMPLES.items():
        text = vibro(command, "--help").text
        assert text.endswith("\n  Examples:\n" + "".join(f"    {line}\n" for line in lines))
        assert all(shlex.split(line)[:2] == ["vibro", command] for line in lines)


@pytest.fixture
def done(
    vibro: Vibro, monkeypatch: pytest.MonkeyPatch, undrawn: None
) -> Callable[[Path, str], None]:
    """Run a command line in a folder: in this process, unless it needs a shell."""
    monkeypatch.setenv("VIBRO_FIGURES", "0")

    def run(folder: Path, line: str) -> None:
        if REDIRECTED.search(line):
            outcome = processes.in_shell(folder, line)
            assert outcome.returncode == 0, (line, outcome.stderr)
        else:
            monkeypatch.chdir(folder)
            program, *arguments = shlex.split(line, comments=True)
            assert program == "vibro"
            told = vibro(*arguments)
            assert told.code == 0, (line, told.err)

    return run


def test_the_examples_run_one_after_the_other(
    tmp_path: Path, done: Callable[[Path, str], None]
) -> None:
    for lines in EXAMPLES.values():
        for line in lines:
            done(tmp_path, line)
    assert (tmp_path / "impacts.csv").read_bytes().startswith(b'"n","t",')
    assert (tmp_path / "outputs/elastic/summary.json").exists()


def test_the_first_steps_are_among_the_examples(vibro: Vibro) -> None:
    lines = re.findall(r"^    (vibro .*)$", vibro("--help").text, re.MULTILINE)
    assert len(lines) == 3
    assert set(lines) < {line for lines in EXAMPLES.values() for line in lines}


def option_examples() -> Iterator[tuple[str, str]]:
    """Every command that has an example in the help of an option, and the example."""
    for name, command in COMMANDS.items():
        for parameter in command.params:
            for example in OPTION.findall(getattr(parameter, "help", None) or ""):
                yield name, example


def test_every_example_of_an_option_is_found() -> None:
    told = "".join(p.help or "" for c in COMMANDS.values() for p in c.params if hasattr(p, "help"))
    assert len(list(option_examples())) == told.count("e.g.") > 0


@pytest.mark.parametrize(("command", "example"), list(option_examples()))
def test_an_example_of_an_option_runs(
    command: str, example: str, tmp_path: Path, done: Callable[[Path, str], None]
) -> None:
    shutil.copytree(GALLERY, tmp_path / "gallery")
    file = "gallery/three_arcs.toml"
    if command == "grid":
        file = "gallery/grids/three_arcs_grid.toml"
        example += " --dry-run"
    if command == "orbit":
        file = "gallery/falling_balls.toml"
        example += " --impacts 1"
    done(tmp_path, f"vibro {command} {file} {example}")


def gallery_examples() -> Iterator[Any]:
    """Every scenario of the gallery with command lines in its comments."""
    for path in sorted(GALLERY.rglob("*.toml")):
        lines = re.findall(r"^# +(vibro .*)$", path.read_text(), re.MULTILINE)
        if lines:
            yield pytest.param(path, lines, id=path.stem)


@pytest.mark.parametrize(("path", "lines"), list(gallery_examples()))
def test_the_commands_of_the_gallery_run_one_after_the_other(
    path: Path, lines: list[str], tmp_path: Path, done: Callable[[Path, str], None]
) -> None:
    folder = tmp_path / "gallery"
    shutil.copytree(GALLERY, folder)
    for line in lines:
        done(folder / path.parent.relative_to(GALLERY), line)
