"""`vibro new` and `vibro schema`: what a user starts from."""

import json
from pathlib import Path

import pytest

from tests.commands.conftest import Vibro
from tests.two_balls import SCENARIO
from vibro_cli.storage import schema

GALLERY = Path(__file__).parents[2] / "scenarios"


def test_list_names_the_gallery_with_titles(vibro: Vibro) -> None:
    listed = [line.split(None, 1) for line in vibro("new", "--list").text.splitlines()]
    paths = sorted(
        (path for path in GALLERY.rglob("*.toml") if path.parent.name != "grids"),
        key=lambda path: path.stem,
    )
    titles = [path.read_text().splitlines()[0].removeprefix("# ") for path in paths]
    assert listed == [[path.stem, title] for path, title in zip(paths, titles, strict=True)]


def test_a_scenario_is_written_with_its_comments_and_is_valid(vibro: Vibro) -> None:
    outcome = vibro("new", "three_arcs")
    assert outcome.code == 0
    assert Path("three_arcs.toml").read_bytes() == (GALLERY / "three_arcs.toml").read_bytes()
    assert "vibro run three_arcs.toml" in outcome.err
    assert vibro("check", "three_arcs.toml").code == 0


def test_a_dash_prints_it(vibro: Vibro) -> None:
    outcome = vibro("new", "three_arcs", "-o", "-")
    assert outcome.out == (GALLERY / "three_arcs.toml").read_bytes()
    assert list(Path.cwd().iterdir()) == []


def test_an_existing_file_is_kept_unless_forced(vibro: Vibro) -> None:
    Path("mine.toml").write_text(SCENARIO)
    outcome = vibro("new", "three_arcs", "-o", "mine.toml")
    assert outcome.code == 2
    assert "mine.toml exists; --force replaces it" in outcome.err
    assert Path("mine.toml").read_text() == SCENARIO
    assert vibro("new", "three_arcs", "-o", "mine.toml", "--force", "-q").err == ""
    assert Path("mine.toml").read_text() != SCENARIO


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["four_arcs"], 'gallery: found "four_arcs", expected ball_on_arcs, '),
        ([], "expected the NAME of a scenario, or --list"),
        (["../pyproject"], 'found "../pyproject"'),
    ],
)
def test_what_is_not_in_the_gallery_is_wrong_usage(
    vibro: Vibro, arguments: list[str], message: str
) -> None:
    outcome = vibro("new", *arguments)
    assert outcome.code == 2
    assert message in outcome.err


def test_schema_is_a_json_schema_of_scenarios(vibro: Vibro) -> None:
    found = json.loads(vibro("schema").text)
    assert found["$schema"].startswith("https://json-schema.org/")
    assert {"gravity", "trace", "balls", "stop"} <= set(found["required"])


def test_schema_tables_describes_every_column(vibro: Vibro) -> None:
    found = json.loads(vibro("schema", "tables").text)
    assert list(found) == ["collisions/1", "events/1", "motion/1", "summary/1"]
    assert len(found["motion/1"]["columns"]) == len(schema.motion().columns)
    assert vibro("schema", "tables", "--markdown").text == schema.as_markdown()
    assert vibro("schema", "--markdown").code == 2
