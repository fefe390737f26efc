"""README.md tells the truth: its commands, its scenario, its Python."""

import re
import shutil
import tomllib
from pathlib import Path
from typing import Any

import pytest

from vibro_cli.build import build_system
from vibro_cli.commands.app import app, run_command_line
from vibro_cli.commands.reference import TOPICS
from vibro_cli.grids.document import load_grid
from vibro_cli.scenario import load_scenario

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = README + "".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs").glob("*.md"))


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("topic", TOPICS)
def test_the_reference_is_what_the_program_says(
    topic: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """To renew it: python -m tests.renew_reference."""
    (found,) = re.findall(
        rf"^<!-- reference: {topic} -->\n\n(.*?)\n<!-- end -->", PAGES, re.MULTILINE | re.DOTALL
    )
    assert run_command_line(["help", topic]) == 0
    assert found == capsys.readouterr().out


def test_every_command_has_its_place() -> None:
    described = re.findall(r"^\| `vibro (\w+)", README, re.MULTILINE)
    assert described == [command.name for command in app.registered_commands]


def test_the_scenario_is_valid(tmp_path: Path) -> None:
    text, _ = blocks("toml")
    path = tmp_path / "readme.toml"
    path.write_text(text)
    scenario = load_scenario(path)
    assert len(build_system(scenario).bodies) == 2
    given = tomllib.loads(text)
    assert set(scenario.resolved()) == set(given)


def test_the_python_example_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    code, _ = blocks("python")
    names: dict[str, object] = {}
    exec(compile(code, "README.md", "exec"), names)
    assert "run" in names


def test_the_grid_is_understood(tmp_path: Path) -> None:
    _, text = blocks("toml")
    (tmp_path / "grid.toml").write_text(text)
    shutil.copy(ROOT / "scenarios" / "three_arcs.toml", tmp_path)
    grid = load_grid(tmp_path / "grid.toml")
    assert grid.design.points == 3000
    assert set(grid.resolved()["keep"]["columns"]) == {"n", "t", "angle_a"}


def test_a_dataset_is_read_as_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    base = ROOT / "scenarios" / "three_arcs.toml"
    text = f'base = "{base}"\n[[axes]]\npath = "collision.k"\nvalues = [0.9, 0.8]\n'
    Path("three_arcs_grid.toml").write_text(text)
    assert run_command_line(["grid", "three_arcs_grid.toml", "--set", "stop.collisions=2"]) == 0
    _, code = blocks("python")
    names: dict[str, Any] = {}
    exec(compile(code, "README.md", "exec"), names)
    assert names["table"].num_rows == 2
    assert names["table"].schema.field("end_time").metadata[b"unit"] == b"s"


def test_the_first_commands_set_up_run_and_test() -> None:
    run_it, test_it = (
        next(block for block in blocks("sh") if block.startswith("python3") and word in block)
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
    table = README.split("## Libraries")[1]
    assert set(re.findall(r"^\| ([\w.]+) \|", table, re.MULTILINE)) - {"library"} == names
