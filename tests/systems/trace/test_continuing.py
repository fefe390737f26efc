"""A run that is stopped and continued is the run that was never stopped, to the bit."""

from __future__ import annotations

import json
from functools import cache

import pytest

from tests.systems.trace.test_engines import FOLDER, NAMES, bits
from vibro_cli.api import simulate
from vibro_cli.scenario import load_any
from vibro_cli.systems.driver import CannotContinue
from vibro_cli.systems.request import FINAL
from vibro_cli.systems.run import Run

AT_MOST = "stop.collisions=200"


@cache
def whole_run(name: str) -> Run:
    return simulate(load_any(FOLDER / f"{name}.toml", [AT_MOST]))


def continued(name: str, earlier: Run) -> Run:
    """Return the same run in two parts, the second by the other engine, its state from a file."""
    engine = "python" if earlier.engine == "compiled" else "compiled"
    checkpoint = json.loads(json.dumps(earlier.checkpoint()))
    scenario = load_any(FOLDER / f"{name}.toml", [AT_MOST])
    return simulate(scenario, engine, checkpoint, earlier.history())


def assert_same_results(one: Run, other: Run) -> None:
    for table in ("collisions", "events"):
        assert bits(getattr(one, table)) == bits(getattr(other, table))
    assert bits(one.flights()) == bits(other.flights())
    assert one.summary_record() == other.summary_record()


def assert_same(one: Run, other: Run) -> None:
    """Check that both results, and the known contacts to come, are equal."""
    assert_same_results(one, other)
    assert one.checkpoint() == other.checkpoint()


@pytest.mark.parametrize(("share", "engine"), [(0.3, "python"), (0.7, "compiled")])
@pytest.mark.parametrize("name", NAMES)
def test_stopped_by_time(name: str, share: float, engine: str) -> None:
    whole = whole_run(name)
    stop = share * whole.summary_record()["end_time"]
    scenario = load_any(FOLDER / f"{name}.toml", [f"stop.time={stop!r}"])
    earlier = simulate(scenario, engine)
    assert earlier.end_cause == "time"
    assert_same(whole, continued(name, earlier))


@pytest.mark.parametrize("name", ["three_arcs", "closed_three_balls", "five_balls", "one_circle"])
def test_stopped_by_collisions(name: str) -> None:
    whole = whole_run(name)
    counts = {"python": 1, "compiled": whole.summary_record()["collisions"] // 2}
    for engine, count in counts.items():
        scenario = load_any(FOLDER / f"{name}.toml", [f"stop.collisions={count}"])
        earlier = simulate(scenario, engine)
        assert earlier.end_cause == "collisions"
        assert_same(whole, continued(name, earlier))


def test_continuing_twice() -> None:
    name = "three_arcs"
    first = simulate(load_any(FOLDER / f"{name}.toml", ["stop.time=10"]), "python")
    later = load_any(FOLDER / f"{name}.toml", ["stop.time=20"])
    second = simulate(later, "python", first.checkpoint(), first.history())
    assert_same(whole_run(name), continued(name, second))


def test_what_cannot_go_on_is_refused() -> None:
    scenario = load_any(FOLDER / "unequal_hedrih.toml")
    ended = simulate(scenario, "python")
    assert ended.end_cause in FINAL
    with pytest.raises(ValueError, match="ended for good: inadmissible"):
        simulate(scenario, "python", ended.checkpoint(), ended.history())
    scenario = load_any(FOLDER / "three_arcs.toml", ["stop.time=5"])
    run = simulate(scenario, "python")
    with pytest.raises(CannotContinue, match=r"at t = 5.0 s; expected a later stop.time"):
        simulate(scenario, "python", run.checkpoint(), run.history())
    few = load_any(FOLDER / "three_arcs.toml", ["stop.time=50", "stop.collisions=1"])
    with pytest.raises(CannotContinue, match=r"expected a greater stop.collisions"):
        simulate(few, "python", run.checkpoint(), run.history())
    scenario = load_any(FOLDER / "three_arcs.toml", ["stop.time=6"])
    with pytest.raises(CannotContinue, match="needs the history"):
        simulate(scenario, "python", run.checkpoint())
    with pytest.raises(ValueError, match="another version"):
        simulate(scenario, "python", {**run.checkpoint(), "format": 0}, run.history())
    other = load_any(FOLDER / "five_balls.toml", ["stop.time=6"])
    with pytest.raises(ValueError, match="does not belong to this scenario"):
        simulate(other, "python", run.checkpoint(), run.history())
