"""`vibro new` and `vibro schema`: what a user starts from."""

import json
import os
import re
import shlex
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from tests.commands.conftest import Vibro
from tests.two_balls import SCENARIO
from vibro_cli.commands.help import tables
from vibro_cli.grids.document import load_grid
from vibro_cli.systems import NAMES
from vibro_cli.systems.trace import tables as of_trace

GALLERY = Path(__file__).parents[2] / "scenarios"


def test_list_names_the_gallery_with_titles(vibro: Vibro) -> None:
    text = vibro("new", "--list").text
    assert max(map(len, text.splitlines())) <= 80
    listed = [line.split(None, 1) for line in re.sub(r"\n +", " ", text).splitlines()]
    paths = sorted(
        GALLERY.rglob("*.toml"), key=lambda path: (path.parent.name == "grids", path.stem)
    )
    titles = [path.read_text().splitlines()[0].removeprefix("# ") for path in paths]
    assert listed == [[path.stem, title] for path, title in zip(paths, titles, strict=True)]
    assert all(title.endswith(".") for title in titles)  # whole sentences


def test_a_scenario_is_written_with_its_comments_and_is_valid(vibro: Vibro) -> None:
    outcome = vibro("new", "three_arcs")
    assert outcome.code == 0
    first, _, rest = Path("three_arcs.toml").read_text().partition("\n")
    assert first == "#:schema ./vibro-trace.schema.json"
    assert rest == (GALLERY / "three_arcs.toml").read_text()
    assert "vibro run three_arcs.toml" in outcome.err
    told = vibro("new", "three_arcs", "-o", "my file.toml").err.partition("solve it with: ")[2]
    assert shlex.split(told) == ["vibro", "run", "my file.toml"]
    assert vibro("check", "three_arcs.toml").code == 0


@pytest.mark.parametrize("name", ["one_circle", "billiards", "two_disks"])
def test_the_schema_that_is_named_stands_beside_and_fits(vibro: Vibro, name: str) -> None:
    Path("study").mkdir()
    assert vibro("new", name, "-o", f"study/{name}.toml").code == 0
    text = Path(f"study/{name}.toml").read_text()
    named = Path("study", text.splitlines()[0].removeprefix("#:schema "))
    found = json.loads(named.read_text())
    system = tomllib.loads(text).get("system", "trace")
    assert found == json.loads(vibro("schema", "--system", system).text)
    jsonschema.validate(tomllib.loads(text), found)


def test_the_whole_gallery_is_written_and_valid(vibro: Vibro) -> None:
    outcome = vibro("new", "--all", "--json")
    assert outcome.code == 0
    files = [Path(one) for one in json.loads(outcome.text)["files"]]
    there = sorted(path.relative_to(GALLERY) for path in GALLERY.rglob("*.toml"))
    assert sorted(path.relative_to("scenarios") for path in files) == there
    for path in files:
        first, _, rest = path.read_text().partition("\n")
        assert (path.parent / first.removeprefix("#:schema ")).exists()
        assert rest == (GALLERY / path.relative_to("scenarios")).read_text()
    assert vibro("check", *map(str, files)).code == 0
    again = vibro("new", "--all")
    assert again.code == 2
    assert "exists; --force replaces it" in again.err
    assert vibro("new", "--all", "--force").code == 0
    assert vibro("new", "three_arcs", "--all").code == 2
    missing = vibro("run", "elsewhere/one_circle.toml")
    assert "vibro new one_circle writes that of the gallery" in missing.err


@pytest.mark.parametrize(
    ("name", "base"), [("three_arcs_grid", "three_arcs"), ("billiards_grid", "billiards")]
)
def test_a_grid_is_written_with_its_scenario_and_is_valid(
    vibro: Vibro, name: str, base: str
) -> None:
    outcome = vibro("new", name)
    assert outcome.code == 0
    told = f"{name}.toml and {base}.toml written; solve it with: vibro grid {name}.toml\n"
    assert outcome.err == told
    named = Path(Path(f"{name}.toml").read_text().splitlines()[0].removeprefix("#:schema "))
    jsonschema.validate(
        tomllib.loads(Path(f"{name}.toml").read_text()), json.loads(named.read_text())
    )
    load_grid(f"{name}.toml")
    Path(f"{base}.toml").write_text("mine")
    assert vibro("new", name, "--force").err.startswith(f"{name}.toml written; ")
    assert Path(f"{base}.toml").read_text() == "mine"


def test_a_file_of_others_in_the_place_of_the_schema_is_kept(vibro: Vibro) -> None:
    Path("vibro-trace.schema.json").write_text('{"mine": true}')
    assert vibro("new", "three_arcs").code == 0
    assert Path("vibro-trace.schema.json").read_text() == '{"mine": true}'


@pytest.mark.parametrize("name", ["three_arcs", "three_arcs_grid"])
def test_an_interrupted_call_is_made_up_for_by_the_next(
    vibro: Vibro, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    def written() -> dict[str, bytes]:
        return {path.name: path.read_bytes() for path in Path().iterdir()}

    assert vibro("new", name).code == 0
    whole, replace = written(), os.replace
    for files in range(1, len(whole)):
        for path in Path().iterdir():
            path.unlink()
        left = iter(range(files - 1, -1, -1))

        def struck(*paths: Any, left: Iterator[int] = left) -> None:
            replace(*paths)
            if next(left) == 0:
                raise KeyboardInterrupt

        with monkeypatch.context() as patch:
            patch.setattr(os, "replace", struck)
            assert vibro("new", name).code == 130
        assert len(written()) == files
        assert vibro("new", name).code == 0
        assert written() == whole


def test_a_dash_prints_it(vibro: Vibro) -> None:
    outcome = vibro("new", "three_arcs", "-o", "-")
    assert outcome.out == (GALLERY / "three_arcs.toml").read_bytes()
    assert list(Path.cwd().iterdir()) == []


@pytest.mark.parametrize("more", [(), ("--force",)])
def test_no_folder_is_replaced_by_a_file(vibro: Vibro, more: tuple[str, ...]) -> None:
    Path("here").mkdir()
    outcome = vibro("new", "three_arcs", "-o", "here", *more)
    assert (outcome.code, outcome.err) == (
        2,
        "vibro: here is a folder; expected a file name\n",
    )


def test_the_gallery_is_not_written_into_a_file(vibro: Vibro) -> None:
    Path("here").write_text("kept")
    outcome = vibro("new", "--all", "-o", "here")
    assert (outcome.code, outcome.err) == (1, "vibro: here: Not a directory\n")
    assert Path("here").read_text() == "kept"


def test_an_existing_file_is_kept_unless_forced(vibro: Vibro) -> None:
    Path("mine.toml").write_text(SCENARIO)
    outcome = vibro("new", "three_arcs", "-o", "mine.toml")
    assert outcome.code == 2
    assert "mine.toml exists; --force replaces it" in outcome.err
    assert Path("mine.toml").read_text() == SCENARIO
    assert vibro("new", "three_arcs", "-o", "mine.toml", "--force", "-q").err == ""
    assert Path("mine.toml").read_text() != SCENARIO


def test_what_is_no_regular_file_is_never_replaced(vibro: Vibro) -> None:
    os.mkfifo("mine.toml")
    outcome = vibro("new", "three_arcs", "-o", "mine.toml", "--force")
    assert outcome.code == 1
    assert outcome.err == "vibro: mine.toml: not a regular file; it is left as it is\n"
    assert list(Path.cwd().iterdir()) == [Path.cwd() / "mine.toml"]
    assert Path("mine.toml").is_fifo()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["four_arcs"], 'gallery: found "four_arcs", expected ball_on_arcs, '),
        ([], "expected the NAME of a scenario, or --list"),
        (["three_arcs", "--list"], "expected the NAME of a scenario, or --list"),
        (["--all", "--list"], "expected the NAME of a scenario, or --list"),
        (["../pyproject"], 'found "../pyproject"'),
        (["--list", "-o", "names.txt"], "--list writes no file"),
        (["--list", "--force"], "--list writes no file"),
        (["three_arcs", "-o", "-", "--json"], "--json and a printed scenario both need standard"),
        (["three_arcs", "-o", "mine.yaml"], "--output: found 'mine.yaml', expected a .toml file"),
        (["three_arcs_grid", "-o", "mine"], "--output: found 'mine', expected a .toml file"),
    ],
)
def test_what_is_not_in_the_gallery_or_cannot_be_written_is_wrong_usage(
    vibro: Vibro, arguments: list[str], message: str
) -> None:
    outcome = vibro("new", *arguments)
    assert outcome.code == 2
    assert message in outcome.err
    assert list(Path.cwd().iterdir()) == []


def test_schema_is_a_json_schema_of_scenarios(vibro: Vibro) -> None:
    found = json.loads(vibro("schema").text)
    assert found["$schema"].startswith("https://json-schema.org/")
    assert {"gravity", "trace", "balls", "stop"} <= set(found["required"])


def test_schema_tables_describes_every_column(vibro: Vibro) -> None:
    found = json.loads(vibro("schema", "tables").text)
    assert list(found) == ["collisions/1", "events/1", "motion/1", "summary/1", "exponents/1"]
    assert len(found["motion/1"]["columns"]) == len(of_trace.MOTION.columns)
    assert vibro("schema", "tables", "--markdown").text == tables()
    assert vibro("schema", "--markdown").code == 2


def test_schema_describes_grids_over_every_system(vibro: Vibro) -> None:
    for system in NAMES:
        found = json.loads(vibro("schema", "grid", "--system", system).text)
        assert found["$id"] == f"urn:vibro:schema:grid-{system}"
        assert {"base", "scenario", "axes", "keep"} <= set(found["properties"])
    assert vibro("schema", "tables", "--system", "table").code == 2


def test_the_schema_is_json_unless_markdown_is_asked_for(vibro: Vibro) -> None:
    assert vibro("schema", "--json").text == vibro("schema").text
    both = vibro("schema", "tables", "--json", "--markdown")
    assert (both.code, both.text) == (2, "")
    assert "expected one of --markdown and --json" in both.err
