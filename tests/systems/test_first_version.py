"""The program with a first version of a system, which lacks the optional parts."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from vibro_cli import NoFilm, NoPortrait, systems
from vibro_cli.report.content import setting
from vibro_cli.report.papers import analogy
from vibro_cli.scenario.fields import json_schema, settings
from vibro_cli.storage.stored import StoredRun
from vibro_cli.stress import suite
from vibro_cli.systems.contract import System
from vibro_cli.systems.describe import lines_of, own_settings

NAME = "newton"
OBJECT = f'''
from vibro_cli.systems.contract import System

class OfNewton(System):
    name = "{NAME}"
    default_figures = ("intervals",)

    def mechanics_warnings(self, scenario, system):
        return ()

    def method(self, scenario):
        return "In closed form."

SYSTEM = OfNewton()
'''
MODEL = f'''
from typing import Annotated, Literal

from vibro_cli.scenario import quantities as kinds
from vibro_cli.scenario.base import AnyScenario, BodyTable, Listed, Sampling, Table
from vibro_cli.scenario.models import Stop

class Drive(Table):
    """What moves."""

    rate: Annotated[float, kinds.ANGULAR_RATE]
    """Rate."""

class OwnCollision(Table):
    """A k, and no choice of a law."""

    k: Annotated[float, kinds.RESTITUTION]
    """k."""

class MODEL(AnyScenario):
    """A body and what is driven."""

    system: Annotated[Literal["{NAME}"], kinds.Word(("{NAME}",))]
    """What is solved."""
    gravity: Annotated[float, kinds.GRAVITY] = 9.81
    """Gravity."""
    drive: Drive
    """The drive."""
    balls: Annotated[tuple[BodyTable, ...], Listed("balls", 1, 1)]
    """The body."""
    collision: OwnCollision
    """How it is struck."""
    stop: Stop
    """The end."""
    output: Sampling = Sampling()
    """Motion."""

    @classmethod
    def between_fields(cls, data):
        return []

    @classmethod
    def prepared(cls, data):
        return data
'''
TABLES = f'''
from vibro_cli.systems.columns import Table, impact_head, number, summary_head
from vibro_cli.systems.contract import ImpactLog

COLLISIONS = Table("{NAME}.collisions", "one impact", tuple(impact_head()))
IMPACT_LOGS = {{"collisions": ImpactLog("impacts", COLLISIONS, object)}}
OTHER_TABLES = ()
SUMMARY = Table("{NAME}.summary", "one run", tuple(summary_head("time")))

def final_state(ball):
    yield number(f"x_{{ball}}", "m", "final place")
'''
FIGURES = """
from vibro_cli.figures.kinds import INTERVALS

FIGURES = {"intervals": INTERVALS}
"""
DATA: dict[str, Any] = {
    "name": "one",
    "system": NAME,
    "gravity": 9.81,
    "drive": {"rate": 2.0},
    "balls": [{"body": "ball", "radius": 0.1, "mass": 1.0}],
    "collision": {"k": 0.5},
    "stop": {"time": 1.0},
    "output": {},
}
BODY = {"ball": 1, "body": "ball", "radius": 0.1, "mass": 1.0, "kappa": 1.4}


@pytest.fixture
def kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[System]:
    """Register a system that has an object, a model, tables and a figure, and no other module."""
    folder = tmp_path / NAME
    folder.mkdir()
    (folder / "__init__.py").write_text(OBJECT, encoding="utf-8")
    (folder / "scenario.py").write_text(MODEL, encoding="utf-8")
    (folder / "tables.py").write_text(TABLES, encoding="utf-8")
    (folder / "figures.py").write_text(FIGURES, encoding="utf-8")
    monkeypatch.setattr(systems, "__path__", [*systems.__path__, str(tmp_path)])
    monkeypatch.setattr(systems, "NAMES", (*systems.NAMES, NAME))
    yield systems.system_named(NAME)
    for module in [name for name in sys.modules if name.startswith(f"vibro_cli.systems.{NAME}")]:
        del sys.modules[module]


def test_it_is_of_no_paper_and_has_no_timed_scene_and_no_portrait(kind: System) -> None:
    assert kind.papers == ()
    assert kind.shown_of_papers.rows == {}
    assert kind.timed_scenes == {}
    with pytest.raises(NoPortrait, match=f'found system = "{NAME}", expected a system that has'):
        kind.portrait(None, "single", drawn=())


def test_it_has_no_films(kind: System) -> None:
    with pytest.raises(NoFilm, match=f'found system = "{NAME}", expected a system that has films'):
        kind.film(cast(StoredRun, None), np.zeros(1))


def test_the_stress_suite_has_no_check_of_it(kind: System) -> None:
    assert NAME in systems.NAMES
    names = runpy.run_path(str(suite.__file__))["NAMES"]
    assert names == suite.NAMES
    assert {"table", "springs"} <= set(names)


def test_without_tangent_maps_its_tables_have_no_exponents(kind: System) -> None:
    assert kind.exponents == 0
    names = {table.file: [one.name for one in table.columns] for table in kind.tables()}
    assert list(names) == ["collisions", "summary"]
    assert names["collisions"] == ["n", "t", "t_low", "dt"]
    assert names["summary"] == ["status", "reason", "end_cause", "end_time", "x_i"]


def test_its_collision_may_be_required(kind: System) -> None:
    schema = json_schema(NAME)
    assert "collision" in schema["required"]
    assert "default" not in schema["properties"]["collision"]


def test_what_only_it_has_is_understood_and_a_law_only_where_there_is_a_choice(
    kind: System,
) -> None:
    bodies = [BODY | {"rolling_inertia": 0.014}]
    found = {"name": "one", "scenario": DATA, "bodies": bodies, "warnings": []}
    lines = list(lines_of(found, partial(settings, kind.model), kind.body_lines))
    assert lines[2:4] == ["  gravity = 9.81 m/s²", "  drive rate = 2 rad/s"]
    assert lines[5:] == ["  k = 0.5", "  stop time = 1 s"]
    assert own_settings(DATA) == {"": {"gravity": 9.81}, "drive": {"rate": 2.0}}
    assert own_settings({"system": NAME, "balls": []}) == {}


def test_a_report_shows_these_settings(kind: System) -> None:
    run = SimpleNamespace(scenario=kind.model.model_validate(DATA))
    run.system = SimpleNamespace(bodies=[BODY])
    assert setting(cast(StoredRun, run)) == [
        ("System", NAME),
        ("Gravity", "9.81 m/s²"),
        ("Drive, rate", "2 rad/s"),
        ("Collision, k", "0.5"),
        ("Stop, time", "1 s"),
    ]


def test_impacts_that_name_no_pair_have_no_form_of_two_bodies() -> None:
    assert analogy(None, {"n": [1]}) is None
