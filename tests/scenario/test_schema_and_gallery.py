from __future__ import annotations

import gc
import json
import sys
import threading
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from tests.scenario.texts import parse_any, parse_scenario
from vibro_cli.scenario import Scenario, ScenarioError, gallery
from vibro_cli.scenario.fields import descriptions, json_schema
from vibro_cli.scenario.loading import any_scenario_of, apply, parse
from vibro_cli.scenario.models import Collision

SCENARIOS = Path(__file__).parents[2] / "scenarios"


def test_the_gallery_is_the_folder_of_scenarios() -> None:
    assert gallery.names() == sorted(
        path.stem for path in SCENARIOS.rglob("*.toml") if path.parent.name != "grids"
    )
    assert {
        "three_arcs",
        "one_circle",
        "particle_on_arcs",
        "disk_on_arcs",
        "ball_on_arcs",
        "horizontal_line_1_2",
        "horizontal_line_1_3",
        "horizontal_line_2_3",
        "five_balls",
        "unequal_hedrih",
        "unequal_normal_impulse",
        "unequal_translational",
    } <= set(gallery.names())
    with pytest.raises(ScenarioError, match='did you mean "three_arcs"'):
        gallery.text("three_arc")


@pytest.mark.parametrize("name", gallery.names())
def test_the_gallery_is_valid_and_says_what_it_is(name: str) -> None:
    source = gallery.text(name)
    assert parse_any(source).balls
    assert source.startswith("# ")
    assert max(map(len, source.splitlines())) <= 100


def test_the_three_bodies_side_by_side_differ_by_their_kind_alone() -> None:
    def changed(name: str) -> dict[str, Any]:
        resolved = parse_scenario(gallery.text(name)).resolved()
        for body in resolved["balls"]:
            assert body.pop("body") == name.partition("_")[0]
        return resolved

    ball = changed("ball_on_arcs")
    assert changed("disk_on_arcs") == changed("particle_on_arcs") == ball


def test_the_unequal_scenarios_differ_by_their_law_alone() -> None:
    laws = []
    rests = []
    for name in ("unequal_hedrih", "unequal_normal_impulse", "unequal_translational"):
        resolved = parse_scenario(gallery.text(name)).resolved()
        laws.append(resolved["collision"].pop("law"))
        rests.append(resolved)
    assert laws == ["hedrih", "normal-impulse", "translational"]
    assert rests[0] == rests[1] == rests[2]


def test_bs_ratios_are_on_the_horizontal_lines() -> None:
    for small, large in ((1, 2), (1, 3), (2, 3)):
        scenario = parse_scenario(gallery.text(f"horizontal_line_{small}_{large}"))
        first, second = scenario.balls
        assert second.radius * large == pytest.approx(first.radius * small, rel=1e-15)
        assert first.density == second.density
        assert scenario.trace.start_slope == 0.0


def _tables(schema: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {"Scenario": schema, **schema["$defs"]}


def test_a_table_of_the_collision_with_more_keys_gives_no_default_of_k_either() -> None:
    class Own(Collision):
        """The law by which two bodies of another system leave an impact."""

    assert "default" not in Own.model_json_schema()["properties"]["k"]


def test_the_schema_describes_every_key() -> None:
    schema = json_schema()
    json.dumps(schema)
    assert schema["required"] == ["gravity", "trace", "balls", "stop"]
    tables = _tables(schema)
    assert set(tables) == {
        *("Scenario", "Trace", "Arc", "Turning", "Ball", "Collision"),
        *("Stop", "Ends", "Wall", "Output", "Analysis"),
    }
    assert list(tables["Scenario"]["properties"]) == list(Scenario.model_fields)
    for table in tables.values():
        assert table["additionalProperties"] is False
        for key, value in table["properties"].items():
            assert value.get("description"), key
            assert value["description"].split(" ") == value["description"].split()
    assert "null" not in json.dumps(schema)


@pytest.mark.parametrize("name", gallery.names())
def test_the_gallery_fits_the_schema_with_and_without_its_name(name: str) -> None:
    data = tomllib.loads(gallery.text(name))
    schema = json_schema(data.get("system", "trace"))
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(data, schema)
    text = json.dumps({"$schema": "./vibro.schema.json", **data})
    jsonschema.validate(json.loads(text), schema)
    assert parse_any(text, "json").resolved() == parse_any(gallery.text(name)).resolved()


def test_the_name_of_a_schema_is_a_text() -> None:
    with pytest.raises(ScenarioError, match=r"unknown key.*\$schema|\$schema"):
        parse_scenario('"$schema" = 3\n' + gallery.text("three_arcs"))


def test_the_schema_takes_units_where_there_is_a_dimension() -> None:
    properties = json_schema()["$defs"]["Ball"]["properties"]
    kinds = {option["type"] for option in properties["density"]["anyOf"]}
    assert kinds == {"number", "string"}
    assert properties["inertia_ratio"]["type"] == "number"
    assert properties["body"]["enum"] == ["ball", "disk", "hollow_ball", "hoop", "particle"]
    assert properties["body"]["default"] == "ball"


@pytest.mark.parametrize(
    ("name", "key", "entries"),
    [
        ("three_arcs", "trace.arcs", 0),
        ("three_arcs", "balls", 0),
        ("two_disks", "balls", 0),
        ("elliptic_wall", "balls", 0),
        ("elliptic_wall", "wall.corners", 2),
    ],
)
def test_schema_and_reader_refuse_lists_of_wrong_lengths(name: str, key: str, entries: int) -> None:
    data = tomllib.loads(gallery.text(name))
    path, value = parse(f"{key}={[[0.0, 1.0]] * entries if entries == 2 else [1.0] * entries}")
    changed = apply(data, path, value)
    schema = json_schema(data.get("system", "trace"))
    assert not jsonschema.Draft202012Validator(schema).is_valid(changed)
    with pytest.raises(ScenarioError, match=r"expected a list of at (least|most)"):
        any_scenario_of(changed)


class Litter:
    """Garbage that runs code when it is collected."""

    def __init__(self) -> None:
        self.own = self

    def __del__(self) -> None:
        for _ in range(300):
            pass


def test_fields_are_described_in_several_threads_while_garbage_is_collected() -> None:
    """Python 3.11 by itself fails at this in most of the turns."""
    alone, found = descriptions(Scenario), []

    def describe(depth: int) -> None:
        if depth:
            return describe(depth - 1)
        return found.append(descriptions(Scenario))

    thresholds, interval = gc.get_threshold(), sys.getswitchinterval()
    gc.set_threshold(200, 1, 1)
    sys.setswitchinterval(1e-6)
    try:
        for _ in range(6):
            descriptions.cache_clear()
            threads = [threading.Thread(target=describe, args=(depth,)) for depth in (0, 5, 10)]
            litter = [Litter() for _ in range(2000)]
            for thread in threads:
                thread.start()
            del litter
            for thread in threads:
                thread.join()
    finally:
        gc.set_threshold(*thresholds)
        sys.setswitchinterval(interval)
    assert found == 18 * [alone]
