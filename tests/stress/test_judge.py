"""The judge of first contacts: against closed forms, 50 digits, and the solver against it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from vibro_cli.compile.kernel import dtype
from vibro_cli.stress.first_contacts import (
    KINDS,
    Family,
    States,
    for_judge,
    near_grazing,
    random_family,
    random_states,
    scenario_of_flight,
    scene_of_flight,
)
from vibro_cli.stress.oracles.interval_oracle import (
    CONTACT,
    NO_CONTACT,
    JudgedBody,
    JudgedFlight,
    judge_all,
)
from vibro_cli.stress.oracles.oracle import first_contact
from vibro_cli.stress.oracles.scene import mp
from vibro_cli.stress.scenes import solve


def level_line(speed_a: float, speed_b: float, horizon: float) -> Any:
    """The verdict on two balls of radius 1/4 and 1/8 on a level line, their feet 2 m apart."""
    flights = np.array([(9.81, 0.0, horizon)], dtype(JudgedFlight))
    balls = [(0.0, 8.0, 0.25, 1.4, 1.0, speed_a, 0.0), (0.0, 8.0, 0.125, 1.4, 3.0, speed_b, 0.0)]
    return judge_all(flights, np.array(balls, dtype(JudgedBody)))[0]


def test_a_level_line() -> None:
    meeting = (2.0 - 2.0 * math.sqrt(0.25 * 0.125)) / 1.5
    early, late = level_line(1.0, -0.5, meeting - 1e-9), level_line(1.0, -0.5, 3.0)
    assert early["status"] == NO_CONTACT
    assert level_line(1.0, 1.0, 9.0)["status"] == NO_CONTACT
    assert late["status"] == CONTACT
    assert late["low"] <= meeting * (1 + 1e-15)
    assert late["high"] >= meeting * (1 - 1e-15)
    assert late["high"] - late["low"] < 1e-13


def some_flights(kind: int, grazing: bool, count: int) -> tuple[Family, States]:
    rng = np.random.default_rng([5, kind, int(grazing)])
    family = random_family(rng, kind)
    if grazing:
        states, _ = near_grazing(rng, family, 2000)
    else:
        states = random_states(rng, family, 200)
    return family, states.part(slice(0, count))


@pytest.mark.parametrize("grazing", [False, True])
def test_fifty_digits_agree(grazing: bool) -> None:
    judged = 0
    for kind in range(len(KINDS)):
        family, states = some_flights(kind, grazing, 2)
        verdicts = judge_all(*for_judge(family, states, states.horizon))
        for number, (status, low, high, _) in enumerate(verdicts):
            horizon = float(states.horizon[number])
            exact = first_contact(scene_of_flight(family, states, number), mp.mpf(horizon))
            judged += 1
            assert status == (NO_CONTACT if exact is None else CONTACT)
            if exact is not None:
                assert low - 1e-15 * horizon <= exact <= high + 1e-15 * horizon
    assert judged >= 10


@pytest.mark.parametrize("grazing", [False, True])
def test_the_interpreted_solver_agrees(grazing: bool) -> None:
    met = 0
    for kind in range(len(KINDS)):
        family, states = some_flights(kind, grazing, 8)
        for number in range(len(states.places)):
            run = solve(scenario_of_flight(family, states, number))
            flights = run.flights()
            ends = flights["t_end"][flights["t_start"] == 0.0]
            one = states.part(slice(number, number + 1))
            # Just beyond the first end of a flight, which may be a contact, however slow.
            horizon = min([*ends.tolist(), float(one.horizon[0])]) * (1.0 + 1e-7)
            status, _, high, speed = judge_all(*for_judge(family, one, horizon))[0]
            times = run.collisions["t"]
            if len(times) and times[0] <= horizon:
                assert status == CONTACT
                assert abs(times[0] - high) * speed < 1e-12
                met += 1
            else:
                assert status == NO_CONTACT
    assert met >= 10


def test_near_grazing_is_near() -> None:
    """Flights made to overlap meet; flights made to pass mostly do not."""
    outcome = []
    for kind in range(len(KINDS)):
        rng = np.random.default_rng([9, kind])
        family = random_family(rng, kind)
        states, overshoot = near_grazing(rng, family, 1500)
        verdicts = judge_all(*for_judge(family, states, states.horizon))
        outcome += list(zip(overshoot, verdicts["status"].tolist(), strict=True))
    overlapping = [status for size, status in outcome if size > 0.0]
    passing = [status for size, status in outcome if size < 0.0]
    assert min(abs(size) for size, _ in outcome) < 1e-11
    assert set(overlapping) == {CONTACT}
    assert passing.count(NO_CONTACT) > 0.8 * len(passing)
