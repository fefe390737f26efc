"""A run streamed in stretches has the tables of a run held in memory, to the bit."""

from __future__ import annotations

import json
import tracemalloc
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vibro_cli.api import recalled, simulate, simulate_streamed
from vibro_cli.assemble import build_any
from vibro_cli.kernels.world import PairTrack, TrackData
from vibro_cli.mechanics.potential import heights
from vibro_cli.mechanics.reachability import reach
from vibro_cli.scenario import load_any
from vibro_cli.systems import driver, system_named
from vibro_cli.systems.driver import plain_rows
from vibro_cli.systems.trace.world import make_world

GALLERY = Path(__file__).parents[3] / "scenarios"
HARD = Path(__file__).parents[2] / "hard_cases"
ASKED = ["output.turning_points=true", "output.friction=0.3", "output.step=0.01"]
SCENES = {
    "three_arcs": [],
    "closed_three_balls": [],
    "five_balls": [],
    "line_between_valleys": [],
    "lone_particle": [],
    "turning_three_arcs": ["stop.collisions=12"],
    "unequal_hedrih": [],
}
SYSTEM_SCENES = {
    "table/billiards": ["stop.time=60", "collision.k=1", "wall.k=1"],
    "table/elliptic_wall": ["stop.bounces=60", "stop.time=1e6"],
    "springs/two_disks": [],
    "springs/stressed_at_rest": ["stop.time=8"],
}
HARD_SCENES = ("five_balls_half", "contact_opens_in_valley", "released_at_a_junction")


def in_stretches(scenario: Any, rows: int, monkeypatch: pytest.MonkeyPatch, **more: Any) -> Any:
    """Return the tables by name of a run in stretches of some rows, and the rest of it."""
    monkeypatch.setattr("vibro_cli.systems.run.LEAST_ROWS", rows)
    monkeypatch.setattr(driver, "INTERPRETED_ROWS", rows)
    parts: dict[str, list[Any]] = {}
    run = simulate_streamed(
        scenario, lambda name, columns: parts.setdefault(name, []).append(columns), "python", **more
    )
    joined: Any = np.ma.concatenate
    tables = {
        name: {column: joined([one[column] for one in each]) for column in each[0]}
        for name, each in parts.items()
    }
    for declared in system_named(scenario.system).tables():
        if declared.file in tables:
            tables[declared.file] = declared.in_words(tables[declared.file])
    return tables, run, max(len(each) for each in parts.values())


def assert_same(table: Any, other: Any) -> None:
    assert set(table) == set(other)
    for name, values in table.items():
        one, two = np.ma.asarray(values), np.ma.asarray(other[name])
        assert np.array_equal(np.ma.getmaskarray(one), np.ma.getmaskarray(two)), name
        numbers = two.dtype != object
        assert np.array_equal(one.filled(), two.filled(), equal_nan=numbers), name


def assert_told_as_held(
    scenario: Any, rows: int, least: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    tables, run, count = in_stretches(scenario, rows, monkeypatch)
    held = simulate(scenario)
    assert count >= least
    names = {table.file for table in system_named(scenario.system).tables()} - {"summary"}
    if not held.wanted.lyapunov:
        names -= {"exponents"}
    assert set(tables) == names
    for name in names:
        assert_same(tables[name], getattr(held, name))
    assert run.summary_record() == held.summary_record()
    assert run.checkpoint() == held.checkpoint()
    assert run.skipped == held.skipped


@pytest.mark.parametrize("name", SCENES)
def test_scenes_of_the_gallery(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = load_any(GALLERY / f"{name}.toml", [*ASKED, *SCENES[name]])
    assert_told_as_held(scenario, 8, 2, monkeypatch)


@pytest.mark.parametrize("name", HARD_SCENES)
def test_scenes_with_lasting_contact(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    stop = ["stop.time=4", "stop.collisions=60"]
    scenario = load_any(HARD / f"{name}.toml", [*ASKED, *stop])
    assert_told_as_held(scenario, 8, 3, monkeypatch)


@pytest.mark.parametrize("rows", [6, 7, 10])
def test_stretches_end_between_instants(rows: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether an impact is smooth depends on later events at its instant."""
    stop = ["analysis.lyapunov=true", "output.step=0.1", "stop.time=6", "stop.collisions=60"]
    scenario = load_any(HARD / "cradle_of_three.toml", stop)
    assert_told_as_held(scenario, rows, 4, monkeypatch)


@pytest.mark.parametrize("name", SYSTEM_SCENES)
def test_tables_and_springs(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = load_any(GALLERY / f"{name}.toml", ["output.step=0.01", *SYSTEM_SCENES[name]])
    assert_told_as_held(scenario, 8, 2, monkeypatch)


@pytest.mark.parametrize("name", SYSTEM_SCENES)
def test_tables_and_springs_that_are_interrupted(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was told is the beginning of the whole, and solved again it is the same, to the bit."""
    more = ["output.step=0.01", *SYSTEM_SCENES[name]]
    scenario = load_any(GALLERY / f"{name}.toml", more)
    tables, run, _ = in_stretches(scenario, 8, monkeypatch, interrupted=lambda: True)
    assert run.end_cause == "interrupted"
    end = run.summary_record()["end_time"]
    assert 0.0 < end < simulate(scenario).end_time
    again = recalled(scenario, json.loads(json.dumps(run.checkpoint())))
    for table in tables:
        assert_same(tables[table], getattr(again, table))
    assert again.summary_record() == run.summary_record()
    assert again.checkpoint() == run.checkpoint()
    whole = simulate(scenario).collisions
    for column, values in tables["collisions"].items():
        assert np.array_equal(
            values, whole[column][: len(values)], equal_nan=values.dtype != object
        )


def test_an_interrupted_run_is_the_beginning_of_the_whole(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scenario = load_any(GALLERY / "three_arcs.toml")
    asked = iter([False, False, True])
    tables, run, _ = in_stretches(scenario, 8, monkeypatch, interrupted=lambda: next(asked))
    whole = simulate(scenario)
    assert run.end_cause == "interrupted"
    record = run.summary_record()
    count = record["collisions"]
    assert 0 < count < whole.summary_record()["collisions"]
    begun = {name: values[:count] for name, values in whole.collisions.items()}
    assert_same(tables["collisions"], begun)
    before = whole.events["t"] < record["end_time"]
    assert_same(
        {name: values[: before.sum()] for name, values in tables["events"].items()},
        {name: values[before] for name, values in whole.events.items()},
    )
    again = recalled(scenario, run.checkpoint())
    assert_same(again.collisions, begun)
    assert again.summary_record() == record


@pytest.mark.parametrize("engine", ["compiled", "python"])
def test_where_bodies_can_never_meet_is_asked_for_the_solver_alone(
    engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once for each pair of neighbours; the tables, which do not need it, leave its room empty."""
    scenario = load_any(GALLERY / "three_arcs.toml")
    system = build_any(scenario)
    meeting = reach(system.trace, *system.bodies)
    pieces = range(len(system.trace.pieces))
    far = np.array([[(i, j) not in meeting for j in pieces] for i in pieces])
    assert far.any()
    assert np.array_equal(np.equal(make_world(system).meeting, 0), far)
    assert not np.any(make_world(system, far_apart=False).meeting)
    asked = []

    def counted(*given: Any) -> Any:
        asked.append(given)
        return reach(*given)

    monkeypatch.setattr("vibro_cli.systems.trace.world.reach", counted)
    simulate_streamed(scenario.replace({"stop.collisions": 3}), lambda *_: None, engine)
    assert asked == [(system.trace, *system.bodies)]


def test_where_bodies_may_meet_takes_memory_for_the_few_pieces_on_which_they_do() -> None:
    """Thousands of arcs have millions of pairs: a truth value for each was gigabytes."""
    pieces = 2000
    arcs = [
        {"shape": shape, "radius": 0.5, "end_slope": f"{slope} deg"}
        for shape, slope in [("valley", 40), ("hump", -40)] * (pieces // 2)
    ]
    changed = {"trace.start_slope": "-40 deg", "trace.arcs": arcs, "balls[1].angle": -0.5}
    system = build_any(load_any(GALLERY / "three_arcs.toml").replace(changed))

    def peak(far_apart: bool) -> int:
        tracemalloc.start()
        make_world(system, far_apart=far_apart)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    make_world(system)
    reach.cache_clear()
    assert peak(far_apart=True) < peak(far_apart=False) + pieces * pieces


@pytest.mark.parametrize("name", ["three_arcs", "turning_three_arcs"])
def test_equal_bodies_share_the_records_of_their_shape(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of a body alone on the trace; a hundred balls on 1,001 arcs took six seconds."""
    system = build_any(load_any(GALLERY / f"{name}.toml"))
    small, large = (replace(system.bodies[0], radius=radius) for radius in (0.05, 0.1))
    heavy = replace(small, mass=2.0)
    states = tuple(system.initial[0] for _ in range(5))
    many = replace(system, bodies=(small, large, heavy, small, large), initial=states)
    alone = [
        make_world(replace(system, bodies=(body,), initial=states[:1])) for body in many.bodies
    ]
    asked: list[float] = []

    def counted(trace: Any, radius: float) -> Any:
        asked.append(radius)
        return heights(trace, radius)

    monkeypatch.setattr("vibro_cli.systems.trace.world.heights", counted)
    world = make_world(many)
    assert asked == [small.radius, large.radius]
    own = [plain_rows(one.tracks, TrackData) for one in alone]
    assert plain_rows(world.tracks, TrackData) == [row for rows in own for row in rows]
    pair = make_world(replace(system, bodies=(large, heavy), initial=states[:2]))
    second = plain_rows(world.contacts, PairTrack)[len(pair.contacts) : 2 * len(pair.contacts)]
    assert second == plain_rows(pair.contacts, PairTrack)
