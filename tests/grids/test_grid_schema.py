"""The JSON Schema of grids accepts and refuses what the reader of grids does."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from tests.two_balls import SCENARIO
from vibro_cli.grids.axes import GENERATORS
from vibro_cli.grids.document import grid_schema, load_grid
from vibro_cli.scenario import ScenarioError
from vibro_cli.systems import NAMES as SYSTEMS

GALLERY = Path(__file__).parents[2] / "scenarios"
AXIS = '[[axes]]\npath = "collision.k"\n'
BASE = 'base = "base.toml"\n'
INLINE = (
    "scenario."
    + SCENARIO.replace("[collision]\nk = 0.9", "")
    .replace("[[balls", "[[scenario.balls")
    .replace("[trace", "[scenario.trace")
    .replace("[stop", "[scenario.stop")
    .lstrip()
)
VALID = {
    "values": BASE + AXIS + "values = [0.9]",
    "linspace": BASE + '[[axes]]\npath = "balls[1].angle"\nlinspace = ["-60 deg", -0.5, 3]',
    "several paths": BASE + '[[axes]]\npaths = ["balls[1].mass", "gravity"]\nvalues = [[1, 9]]',
    "a design": BASE + 'mode = "sobol"\nn = 4\nseed = 2\n' + AXIS + "uniform = [0.1, 0.9]",
    "random values": BASE + AXIS + "uniform = [0.1, 0.9, 5]",
    "kept": BASE + "chunk_points = 2\n" + AXIS + 'values = [1]\n[keep]\ncollisions = true\n'
    'columns = ["t"]',
    "inline, without what the axes give": INLINE + AXIS + "values = [0.9]",
}  # fmt: skip
WRONG = {
    "no axes": BASE,
    "an empty list of axes": BASE + "axes = []",
    "neither base nor scenario": AXIS + "values = [0.9]",
    "no generator": BASE + AXIS,
    "two generators": BASE + AXIS + "values = [0.9]\nlinspace = [0, 1, 2]",
    "no path": BASE + "[[axes]]\nvalues = [0.9]",
    "two kinds of path": BASE + AXIS + 'paths = ["gravity"]\nvalues = [1]',
    "more than a count": BASE + AXIS + "linspace = [0, 1, 2, 3]",
    "more than random values": BASE + AXIS + "uniform = [0, 1, 2, 3]",
    "no count": BASE + AXIS + "linspace = [0, 1]",
    "an unknown mode": BASE + 'mode = "random"\n' + AXIS + "values = [0.9]",
    "a design without n": BASE + 'mode = "sobol"\n' + AXIS + "uniform = [0.1, 0.9]",
    "n of a product": BASE + "n = 4\n" + AXIS + "values = [0.9]",
    "an unknown key": BASE + "chunks = 4\n" + AXIS + "values = [0.9]",
    "an unknown column": BASE + AXIS + 'values = [1]\nkeep = {collisions = true, columns = ["u"]}',
    "no columns": BASE + AXIS + "values = [1]\nkeep = {collisions = true, columns = []}",
    "columns without collisions": BASE + AXIS + 'values = [1]\nkeep = {columns = ["t"]}',
    "a negative seed": BASE + "seed = -1\n" + AXIS + "values = [0.9]",
}


def is_valid(text: str) -> bool:
    return bool(jsonschema.Draft202012Validator(grid_schema()).is_valid(tomllib.loads(text)))


def is_read(folder: Path, text: str) -> bool:
    (folder / "base.toml").write_text(SCENARIO)
    (folder / "grid.toml").write_text(text)
    try:
        load_grid(folder / "grid.toml")
    except ScenarioError:
        return False
    return True


@pytest.mark.parametrize("system", SYSTEMS)
def test_it_is_a_schema(system: str) -> None:
    jsonschema.Draft202012Validator.check_schema(grid_schema(system))


@pytest.mark.parametrize("text", VALID.values(), ids=VALID)
def test_schema_and_reader_accept(text: str, tmp_path: Path) -> None:
    assert is_read(tmp_path, text)
    assert is_valid(text)


@pytest.mark.parametrize("text", WRONG.values(), ids=WRONG)
def test_schema_and_reader_refuse(text: str, tmp_path: Path) -> None:
    assert not is_read(tmp_path, text)
    assert not is_valid(text)


def test_every_key_has_a_description() -> None:
    schema = grid_schema()
    tables: dict[str, dict[str, Any]] = schema["$defs"]
    assert set(GENERATORS) < set(tables["AxisTable"]["properties"])
    for table in (schema, tables["AxisTable"], tables["Keep"]):
        assert all(value["description"] for value in table["properties"].values())


@pytest.mark.parametrize("path", sorted((GALLERY / "grids").glob("*.toml")), ids=lambda p: p.stem)
def test_the_grids_of_the_gallery_fit(path: Path) -> None:
    system = "table" if "billiards" in path.stem else "trace"
    jsonschema.validate(tomllib.loads(path.read_text()), grid_schema(system))


@pytest.mark.parametrize("name", ['"../beside"', "5", '""', '"a/b"'])
def test_a_name_is_one_of_a_folder(name: str, tmp_path: Path) -> None:
    text = f"name = {name}\n" + BASE + AXIS + "values = [0.9]"
    assert not is_read(tmp_path, text)
    assert not is_valid(text)
