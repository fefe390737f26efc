"""Bodies that cross junctions for ever and never meet again end a run without a stop by time."""

from __future__ import annotations

import copy
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from random import Random
from typing import Any

import numpy as np
import pytest
from mpmath import mp

from tests.systems.trace.test_engines import FOLDER, bits
from vibro_cli.api import simulate
from vibro_cli.kernels.events.event_detection import horizontal_extent
from vibro_cli.kernels.events.event_loop import start
from vibro_cli.scenario import ScenarioError, load_any, scenario_of
from vibro_cli.stress.drawing import draw
from vibro_cli.stress.impacts import LINE_BETWEEN
from vibro_cli.stress.scenes import THREE_ARCS, ball, scene, solve, system_of, valley
from vibro_cli.systems import driver
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system
from vibro_cli.systems.trace.world import make_world

Document = dict[str, Any]
# Started at this angle (rad), ball 1 of three_arcs.toml has the energy of the crest (by halving).
CREST = -1.1542046197210436


def three_arcs(first: Document, second: Document | None = None) -> Document:
    """Return the scene of three_arcs.toml, without a stop by time."""
    document = copy.deepcopy(load_any(FOLDER / "three_arcs.toml").resolved())
    for own, changes in zip(document["balls"], (first, second or {}), strict=True):
        del own["rate"]
        own.update(changes)
    document["stop"] = {"collisions": 1000}
    return document


def until(document: Document, time: float) -> Run:
    return simulate(scenario_of(document | {"stop": {"collisions": 100_000, "time": time}}))


@pytest.mark.parametrize(
    "document",
    [
        three_arcs({"angle": -1.1}),
        three_arcs({"angle": -1.1}, {"angle": 1.1}),
        three_arcs({"angle": CREST + 1e-8}),
        # One at rest on the crest.
        three_arcs({"angle": -0.9}, {"arc": 2, "angle": 0.0}),
    ],
)
def test_bodies_that_the_crest_keeps_apart(document: Document) -> None:
    compiled, interpreted = (simulate(scenario_of(document), one) for one in driver.ENGINES)
    found = compiled.summary_record()
    assert (found["end_cause"], found["collisions"]) == ("no_more_collisions", 0)
    assert found["crossings"] == 16
    assert found["quiet_from"] == found["end_time"]
    assert found == interpreted.summary_record()
    assert bits(compiled.flights()) == bits(interpreted.flights())
    assert until(document, 100.0 * found["end_time"]).summary_record()["collisions"] == 0


def test_bodies_apart_once_walls_have_taken_energy() -> None:
    """The proof is tried after each impact on a wall, whatever the number of crossings."""
    document = three_arcs({"angle": -0.5, "speed": 3.0}, {"angle": 0.2})
    document["trace"]["start_slope"] = -0.95
    document["trace"]["arcs"][2]["end_slope"] = 0.95
    document["collision"] = {"k": 1.0, "law": "normal-impulse"}
    document["ends"] = {side: {"wall": 0.9} for side in ("left", "right")}
    run = simulate(scenario_of(document))
    found = run.summary_record()
    assert (found["end_cause"], found["collisions"]) == ("no_more_collisions", 3)
    later = until(document, 100.0 * found["end_time"])
    assert bits(later.collisions) == bits(run.collisions)
    assert later.summary_record()["crossings"] > found["crossings"]


ON_LINE: Document = {"radius": 0.1, "mass": 1.0, "arc": 2, "position": 0.4}


@pytest.mark.parametrize(
    ("trace", "one"),
    [
        (THREE_ARCS, ball(0.2, speed=3.0)),
        (THREE_ARCS, ball(-0.2, arc=3, speed=-3.0)),
        (THREE_ARCS, ball(-1.2)),
        (THREE_ARCS, ball(0.1, speed=-3.5)),
        (THREE_ARCS, ball(0.1, speed=0.5)),
        (THREE_ARCS, ball(0.1, arc=2, speed=1.0)),
        (THREE_ARCS, ball(0.1, arc=2, speed=-1.0)),
        (LINE_BETWEEN, ON_LINE | {"speed": 1.0}),
        (LINE_BETWEEN, ON_LINE | {"speed": -1.0}),
        (valley(120), ball(0.0, speed=4.0)),
    ],
)
def test_a_flight_has_the_extent_that_it_covers(trace: Document, one: Document) -> None:
    """Bodies behind it are proved apart without a search; sampled motion tells what it covers."""
    document = scene(trace, [one], time=20.0)
    world = make_world(system_of(document))
    start(world)
    last = min(world.flights[0].exit_t, 20.0)
    x = solve(document).sample(np.linspace(0.0, last, 10_001), "before")["x"]
    assert horizontal_extent(world, 0) == pytest.approx((x.min(), x.max()), abs=1e-6)


def refused(document: Document, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(driver, "QUIET_ROWS", 2000)
    with pytest.raises(driver.TooQuiet, match="no impact among the last 2,000 flights"):
        simulate(scenario_of(document))


@pytest.mark.parametrize("below", [0.0, 1e-15, 1e-13, 1e-11])
def test_energies_so_near_a_crest_that_rounding_may_decide_prove_nothing(
    below: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    document = three_arcs({"angle": CREST + below}, {"arc": 3, "angle": 0.0, "rate": 0.0})
    found = until(document, 60.0).summary_record()
    if found["collisions"] == 0:
        refused(document, monkeypatch)
    else:
        assert simulate(scenario_of(document)).summary_record()["collisions"] > 0


def test_an_open_end_that_is_reached_late_ends_the_run() -> None:
    """Ball 1 swings across junctions; ball 2 rolls towards the end of a long line."""
    document = three_arcs({"angle": -1.0})
    document["trace"]["arcs"][2:] = [{"shape": "line", "length": 60.0}]
    document["trace"]["arcs"][1]["end_slope"] = 0.0
    document["balls"][1] = {"radius": 0.1, "mass": 1.0, "arc": 3, "position": 1.0, "speed": 0.5}
    open_ended = simulate(scenario_of(document)).summary_record()
    assert (open_ended["end_cause"], open_ended["crossings"] > 32) == ("end_of_trace", True)
    # Nor does a wall, from which ball 2 comes back to meet ball 1 or passes the crest.
    document["ends"] = {"right": {"wall": 0.5}}
    assert simulate(scenario_of(document)).summary_record()["collisions"] > 0


def test_a_body_that_only_strikes_a_wall() -> None:
    """Two bodies on their sides of a crest, each between it and a wall, cross no junction."""
    for wall in (1.0, 0.9):
        document = three_arcs({"arc": 1, "angle": -0.4}, {"arc": 1, "angle": 0.4})
        hump = {"shape": "hump", "radius": 1.0, "end_slope": "-50 deg"}
        document["trace"] = {"start_slope": "50 deg", "arcs": [hump]}
        document["ends"] = {"left": {"wall": wall}, "right": {"wall": wall}}
        run = simulate(scenario_of(document))
        found = run.summary_record()
        assert (found["end_cause"], found["crossings"]) == ("no_more_collisions", 0)
        assert until(document, 60.0).summary_record()["collisions"] == 0


def test_a_body_with_almost_no_energy_still_rolls_along_a_level_line() -> None:
    """Two bodies lose nearly all their energy at walls and meet 90 times, ever more slowly."""
    run = simulate_system(system_of(draw(2, 265)), None, 90, "compiled")
    assert run.summary_record()["collisions"] == 90


def on_a_level_line(speed: float, **stop: float) -> Document:
    """Return two bodies between walls, k and both walls 0.9: their impacts never end."""
    ball = {"radius": 0.04, "arc": 1}
    return {
        "gravity": 9.81,
        "trace": {"start_slope": 0.0, "arcs": [{"shape": "line", "length": 2.0}]},
        "balls": [
            {**ball, "mass": 1.0, "position": 0.5, "speed": speed},
            {**ball, "mass": 2.0, "position": 1.5, "speed": 0.0},
        ],
        "collision": {"k": 0.9},
        "ends": {side: {"wall": 0.9} for side in ("left", "right")},
        "stop": stop,
    }


def impacts_on_a_level_line(speed: float, count: int) -> list[float]:
    """Return the instants (s) of the first impacts there, computed in 60 digits."""
    with mp.workdps(60):
        k, left, right = mp.mpf(0.9), mp.mpf(0.04), 2 - mp.mpf(0.04)
        t, x, v = mp.mpf(0), [mp.mpf(0.5), mp.mpf(1.5)], [mp.mpf(speed), mp.mpf(0)]
        found: list[float] = []
        while len(found) < count:
            after = [
                (left - x[0]) / v[0] if v[0] < 0 else mp.inf,
                (right - x[1]) / v[1] if v[1] > 0 else mp.inf,
                (x[1] - x[0] - 2 * left) / (v[0] - v[1]) if v[0] > v[1] else mp.inf,
            ]
            step = min(after)
            t, x = t + step, [place + rate * step for place, rate in zip(x, v, strict=True)]
            if step < after[2]:
                v[after.index(step)] *= -k
                continue
            approach = (1 + k) * (v[0] - v[1]) / 3
            v = [v[0] - 2 * approach, v[1] + approach]
            found.append(float(t))
        return found


@pytest.mark.parametrize("engine", driver.ENGINES)
def test_impacts_on_a_level_line_that_never_end(engine: str) -> None:
    """They ended at 1e163 s with "no further impact is possible", 0.16 m apart at the last."""
    record = simulate(scenario_of(on_a_level_line(0.3, collisions=10_000)), engine).summary_record()
    assert (record["end_cause"], record["end_time"]) == ("time", 1e100)
    assert record["collisions"] > 1300
    assert record["last_collision_time"] > 1e98
    assert record["quiet_from"] is None
    assert record["max_gap"] < 1e-15


@pytest.mark.parametrize("speed", [0.3, 1e-200])
def test_instants_of_impacts_on_a_level_line(speed: float) -> None:
    """The squares of slow speeds are zero: the first impact was found twice as late."""
    run = simulate(scenario_of(on_a_level_line(speed, collisions=30, time=1e300)))
    exact = impacts_on_a_level_line(speed, 30)
    assert run.collisions["t"] == pytest.approx(exact, rel=1e-12)


def drawn(number: int) -> Document:
    """Draw valleys with humps and lines between them, walls or open ends, and slow bodies."""
    rng = Random(number)
    steep = rng.random() < 0.7
    start = slope = -rng.uniform(1.0, 2.2) if steep else rng.uniform(-0.6, 0.6)
    arcs: list[Document] = []
    spans: list[tuple[float, float]] = []
    for _ in range(rng.randint(1, 3)):
        for shape, end in (
            ("valley", max(slope, 0.0) + rng.uniform(0.2, 0.7)),
            ("hump", rng.uniform(-0.8, -0.2)),
        ):
            arcs.append({"shape": shape, "radius": rng.uniform(0.5, 1.4), "end_slope": end})
            spans.append((slope, end))
            slope = end
            if rng.random() < 0.3:
                arcs.append({"shape": "line", "length": rng.uniform(0.1, 0.6)})
                spans.append((slope, slope))
    if steep:
        arcs.append({"shape": "valley", "radius": 1.0, "end_slope": rng.uniform(1.0, 2.2)})
        spans.append((slope, arcs[-1]["end_slope"]))
    balls = []
    for place in sorted(rng.uniform(0.0, len(arcs)) for _ in range(rng.randint(2, 5))):
        piece, share = int(place), place % 1.0
        low, high = spans[piece]
        angle = low + share * (high - low)
        ball: Document = {"radius": 0.04, "mass": rng.uniform(0.2, 3.0), "arc": piece + 1}
        ball["speed"] = rng.choice([0.0, 0.05, 0.3, 1.0]) * rng.uniform(-1.2, 1.2)
        if arcs[piece]["shape"] == "line":
            ball["position"] = share * arcs[piece]["length"]
        else:
            ball["angle"] = angle if arcs[piece]["shape"] == "valley" else -angle
        balls.append(ball)
    return {
        "gravity": 9.81,
        "trace": {"start_slope": start, "arcs": arcs},
        "balls": balls,
        "collision": {"k": rng.choice([1.0, 0.9, 0.4]), "law": "normal-impulse"},
        "ends": {side: {"wall": rng.choice([1.0, 0.9, 0.5])} for side in ("left", "right")},
        "stop": {"collisions": 400},
    }


@pytest.mark.long
@pytest.mark.parametrize(("source", "least"), [(drawn, 20), (partial(draw, 2), 4)])
def test_no_impact_follows_where_a_drawn_run_ends(
    source: Callable[[int], Document], least: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Judge: the same scene solved with a stop by time a hundred times later, without the proof."""
    ended = 0
    for number in range(300):
        try:
            system = system_of(source(number))
        except ScenarioError:
            continue
        monkeypatch.setattr(driver, "QUIET_ROWS", 2000)
        try:
            run = simulate_system(system, None, 400, "compiled")
        except driver.TooQuiet:
            continue
        found = run.summary_record()
        if found["end_cause"] != "no_more_collisions" or found["end_time"] > 1e4:
            continue
        monkeypatch.setattr(driver, "QUIET_ROWS", 2_000_000)
        later = simulate_system(system, 100.0 * found["end_time"] + 100.0, 500, "compiled")
        assert bits(later.collisions) == bits(run.collisions)
        ended += int(later.summary_record()["crossings"] > found["crossings"])
    assert ended > least


@pytest.mark.parametrize("name", ["three_arcs", "line_between_valleys"])
def test_no_run_is_quiet_before_an_impact_that_it_would_still_reach(name: str) -> None:
    document = load_any(FOLDER / f"{name}.toml").resolved()
    document["stop"] = {"collisions": 12}
    times = [0.0, *simulate(scenario_of(document)).collisions["t"].tolist()]
    for before, after in pairwise(times):
        for share in (0.1, 0.5, 0.9):
            run = until(document, before + share * (after - before))
            assert run.summary_record()["quiet_from"] is None
