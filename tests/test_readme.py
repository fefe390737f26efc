"""README.md and docs/ are correct: their commands, their scenario, their Python."""

import re
import shutil
import tomllib
from pathlib import Path

import pytest

from tests.pages import DOCS, README, ROOT, blocks, pages, text_of
from vibro_cli.assemble import build_any
from vibro_cli.commands.app import COMMANDS, run_command_line
from vibro_cli.commands.help import TOPICS
from vibro_cli.grids.document import load_grid
from vibro_cli.scenario import load_any

PAGES = pages()


@pytest.mark.parametrize("topic", TOPICS)
def test_the_reference_is_what_the_program_says(
    topic: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """To renew it: python -m tests.renew_reference."""
    told = "".join(text_of(page) for page in PAGES)
    (found,) = re.findall(
        rf"^<!-- reference: {topic} -->\n\n(.*?)\n<!-- end -->", told, re.MULTILINE | re.DOTALL
    )
    assert run_command_line(["help", "--markdown", topic]) == 0
    assert found == capsys.readouterr().out


def test_every_command_has_its_place() -> None:
    page = text_of(DOCS / "reference-commands.md")
    described = re.findall(r"^\| `vibro (\w+)", page, re.MULTILINE)
    assert described == list(COMMANDS)


def test_the_scenario_is_valid(tmp_path: Path) -> None:
    (text,) = blocks(DOCS / "reference-scenarios.md", "toml")
    path = tmp_path / "scenario.toml"
    path.write_text(text)
    scenario = load_any(path)
    assert len(build_any(scenario).bodies) == 2
    given = tomllib.loads(text)
    assert set(scenario.resolved()) == set(given)


def test_the_grid_is_understood(tmp_path: Path) -> None:
    (text,) = blocks(DOCS / "grids.md", "toml")
    (tmp_path / "grid.toml").write_text(text)
    shutil.copy(ROOT / "scenarios" / "three_arcs.toml", tmp_path)
    grid = load_grid(tmp_path / "grid.toml")
    assert grid.design.points == 3000
    assert set(grid.resolved()["keep"]["columns"]) == {"n", "t", "angle_a"}


def test_the_first_commands_set_up_run_and_test() -> None:
    lines = [block for block in blocks(README, "sh") if block.startswith("python3")]
    run_it, test_it = (
        next(block for block in lines if word in block)
        for word in ("vibro run scenarios/three_arcs.toml", "pytest")
    )
    assert run_it.count("\n") == test_it.count("\n") == 1


def test_the_version_stands_in_one_place() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert project["project"]["dynamic"] == ["version"]
    assert project["tool"]["hatch"]["version"]["path"] == "vibro_cli/__init__.py"
    assert "version:" not in (ROOT / "CITATION.cff").read_text().replace("cff-version:", "")


def test_every_library_has_its_reason() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    names = {re.split(r"[<>=\[]", text)[0] for text in project["dependencies"]}
    table = text_of(DOCS / "libraries.md")
    assert set(re.findall(r"^\| ([\w.]+) \|", table, re.MULTILINE)) - {"library"} == names


def test_readme_is_short_and_its_pictures_are_small() -> None:
    assert len(text_of(README).splitlines()) <= 150
    pictures = list((DOCS / "pictures").iterdir())
    shown = re.findall(r"!\[.+\]\((.+)\)", text_of(README))
    assert {ROOT / name for name in shown} == set(pictures)
    assert sum(picture.stat().st_size for picture in pictures) < 400_000
