"""The time at which the bounces of a free pair end, against their continuation in 50 digits."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

from vibro_cli.stress.oracles.oracle import Oracle
from vibro_cli.stress.oracles.scene import mp, scene_of_system
from vibro_cli.stress.scenes import scene, system_of
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system

ENDS = 100.0  # s


def _run(law: str, k: float, balls: list[dict[str, Any]], **trace: Any) -> Run:
    one_valley = {
        "start_slope": "-170 deg",
        "arcs": [{"shape": "valley", "radius": 1.3, "end_slope": "170 deg"}],
    }
    bodies = [
        {"radius": 0.12, "mass": 1.7, "arc": 1, "angle": -0.9, **balls[0]},
        {"radius": 0.12, "mass": 0.6, "arc": 1, "angle": 0.4, **balls[1]},
    ]
    document = scene(one_valley | trace, bodies, k, law, time=ENDS)
    document["collision"]["inadmissible"] = "normal-impulse"
    return simulate_system(system_of(document), ENDS, None)


TURNING = {"turning": {"through_arc": 1, "rate": 1.4}}


PAIRS: list[tuple[str, list[dict[str, Any]]]] = [
    ("normal-impulse", [{}, {"radius": 0.08}]),
    ("normal-impulse", [{"body": "disk"}, {"body": "hoop"}]),
    ("hedrih", [{"body": "hoop"}, {}]),
    ("translational", [{}, {}]),
]


@pytest.mark.parametrize(
    ("k", "median", "worst"),
    [
        (0.2, 1e-14, 1e-11),
        pytest.param(0.6, 1e-14, 1e-11, marks=pytest.mark.long),
        pytest.param(0.9, 2e-12, 1e-10, marks=pytest.mark.long),
    ],
)
def test_bounces_end_when_their_continuation_does(k: float, median: float, worst: float) -> None:
    """A place rounded the other way at a low bounce moves the end by more than most are off."""
    errors = []
    for (law, balls), trace in product(PAIRS, ({}, TURNING)):
        run = _run(law, k, balls, **trace)
        closed = run.events["event"] == "contact_closed"
        found, lasted = (float(run.events[name][closed][0]) for name in ("t", "value"))
        told = Oracle(scene_of_system(run.system), run.system.law, True).run(
            mp.mpf(ENDS), last=("contact_closed",)
        )
        errors.append(float(abs(found / told.events[-1].t - 1)))
        assert lasted > 1e-6
        _assert_low(run, found, lasted, k)
    assert float(np.median(errors)) <= median
    assert max(errors) <= worst


VALLEYS = {
    "start_slope": "-80 deg",
    "arcs": [
        {"shape": "valley", "radius": 1.3, "end_slope": "0 deg"},
        {"shape": "valley", "radius": 0.9, "end_slope": "80 deg"},
    ],
}
ACROSS = {"arc": 2, "angle": 0.4}


@pytest.mark.parametrize(
    ("k", "kinds", "starts", "trace"),
    [
        (0.6, ("ball", "particle"), [{}, {}], {}),
        (0.8, ("hoop", "disk"), [{}, {}], {}),
        pytest.param(0.9, ("ball", "particle"), [{}, {}], {}, marks=pytest.mark.long),
        pytest.param(0.8, ("hoop", "disk"), [{}, {}], TURNING, marks=pytest.mark.long),
        pytest.param(0.9, ("hoop", "disk"), [{}, {}], TURNING, marks=pytest.mark.long),
        (0.9, ("disk", "hoop"), [{"angle": -0.5}, ACROSS], VALLEYS),
    ],
)
def test_rounding_of_places_is_not_taken_back_in_the_times_of_the_last_bounces(
    k: float, kinds: tuple[str, str], starts: list[dict[str, Any]], trace: dict[str, Any]
) -> None:
    """Bodies of unequal kappa under ``translational``: their bounces are not summed before 1e-6 s.

    A change of the start by its rounding moves the end by less than 1e-14 s; what the places of
    both had gathered by rounding moved it by 2e-9 to 4e-8 s, on a rotating trace by 2e-11 s.
    """
    balls = [{"body": kind, **start} for kind, start in zip(kinds, starts, strict=True)]
    run = _run("translational", k, balls, **trace)
    closed = run.events["event"] == "contact_closed"
    found, lasted = (float(run.events[name][closed][0]) for name in ("t", "value"))
    told = Oracle(scene_of_system(run.system), run.system.law, True).run(
        mp.mpf(ENDS), last=("contact_closed",)
    )
    assert lasted < 2e-6
    assert abs(float(found - told.events[-1].t)) <= 1e-11
    assert np.abs(run.collisions["gap"]).max() <= 8.0 * 2.0**-52 * 1.3


def _assert_low(run: Run, end: float, lasted: float, k: float) -> None:
    """What is told by contact is as low as the documentation says."""
    rows = run.collisions
    last = int(np.flatnonzero(rows["t"] < end)[-1])
    assert end - float(rows["t"][last]) == pytest.approx(lasted, rel=1e-9)
    speed = abs(float(rows["separation_speed"][last]))
    assert 0.25 * speed * lasted * (1.0 - k) <= 1.01e-10 / (1.0 - k) * 0.24


PAIR = [
    {"radius": 0.05, "mass": 1.0, "arc": 1, "angle": -0.5},
    {"radius": 0.05, "mass": 2.0, "arc": 1, "angle": -0.3},
]
DISH = {"start_slope": -1.5, "arcs": [{"shape": "valley", "radius": 1.0, "end_slope": 1.5}]}


@pytest.mark.parametrize("left", [True, False])
def test_bounces_are_not_summed_beyond_the_hit_of_a_third_body(left: bool) -> None:
    # It comes amid the last 1e-5 s of the bounces, which would be summed without it.
    third = {"radius": 0.05, "mass": 1.5, "arc": 1, "angle": 0.9, "speed": 2.1805346625256923}
    balls = [*PAIR, third]
    if left:
        balls = [{**ball, "angle": -ball["angle"]} for ball in reversed(balls)]
        balls[0]["speed"] = -third["speed"]
    run = simulate_system(system_of(scene(DISH, balls, 0.3, time=0.868)), 0.868, None)
    oracle = Oracle.of(run.system)
    oracle.run(mp.mpf(0.868))
    exact = [float(state.speed) for state in oracle.now.states]
    np.testing.assert_allclose(run.sample([0.868])["speed"], exact, rtol=0.0, atol=1e-13)


def test_bounces_end_when_they_do_without_a_body_far_away() -> None:
    closed = []
    trace = {**DISH, "start_slope": -3.1}
    for far in ([], [{**PAIR[0], "angle": -3.0}]):
        run = simulate_system(system_of(scene(trace, [*far, *PAIR], 0.3, time=0.9)), 0.9, None)
        row = list(run.events["event"]).index("contact_closed")
        closed.append((run.events["t"][row], run.events["value"][row]))
    assert closed[0] == closed[1]


def test_a_run_without_a_stop_ends_when_its_last_bounces_do() -> None:
    run = simulate_system(system_of(scene(DISH, PAIR, 0.5, collisions=99)), None, 99)
    (end,) = run.events["t"][run.events["event"] == "contact_closed"]
    (lasted,) = run.events["value"][run.events["event"] == "contact_closed"]
    assert run.end_cause == "no_more_collisions"
    assert lasted > 0.0
    assert run.summary_record()["quiet_from"] == run.end_time == end
    stopped = simulate_system(system_of(scene(DISH, PAIR, 0.5, collisions=99)), end + 1.0, None)
    assert stopped.summary_record()["quiet_from"] == end
    for name, values in stopped.sample([end]).items():
        np.testing.assert_array_equal(run.sample([end])[name], values, err_msg=name)
    parts = run.checkpoint(), run.history()
    continued = simulate_system(run.system, end + 1.0, None, "compiled", None, *parts)
    assert continued.checkpoint() == stopped.checkpoint()


def test_impacts_are_still_possible_while_bounces_are_summed() -> None:
    run = simulate_system(system_of(scene(DISH, PAIR, 0.5, collisions=99)), None, 99)
    last = float(run.collisions["t"][-1])
    stopped = simulate_system(
        system_of(scene(DISH, PAIR, 0.5, collisions=99)), 0.5 * (last + run.end_time), None
    )
    assert stopped.summary_record()["quiet_from"] is None
    assert stopped.events["t"].max(initial=0.0) <= stopped.end_time
