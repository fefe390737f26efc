"""The oracle of 40 digits: against the references, closed forms, and conserved quantities."""

from __future__ import annotations

import random
from fractions import Fraction
from itertools import pairwise
from typing import Any

import pytest

from tests import references
from vibro_cli.stress.oracles.motion import (
    BITS,
    Undecided,
    first_zero,
    value_of,
    without_leading_zeros,
)
from vibro_cli.stress.oracles.oracle import History, Oracle
from vibro_cli.stress.oracles.scene import Scene, mp, scene_of_system
from vibro_cli.stress.scenes import Document, ball, scene, system_of

pytestmark = pytest.mark.long

LEVEL: Document = {"start_slope": 0.0, "arcs": [{"shape": "line", "length": 500.0}]}
CLOSE = mp.mpf(10) ** -28


def history_of(
    document: Document, until: Any, times: tuple[Any, ...] = ()
) -> tuple[Scene, History]:
    system = system_of(document)
    found = scene_of_system(system)
    oracle = Oracle(found, system.law, system.inadmissible == "normal-impulse")
    return found, oracle.run(mp.mpf(until), [mp.mpf(t) for t in times])


def on_line(position: float, mass: float, speed: float = 0.0) -> Document:
    return {"radius": 0.25, "mass": mass, "arc": 1, "position": position, "speed": speed}


def energy(found: Scene, row: Any) -> Any:
    """Return the energy of a sample."""
    total = mp.zero
    for body, (state, x, y) in zip(found.bodies, row, strict=True):
        total += body.kappa * body.mass * state.speed**2 / 2 + body.mass * found.gravity * y
        total -= body.mass * found.turning_square * (x - found.axis) ** 2 / 2
    return total


@pytest.mark.parametrize("name", references.NAMES)
def test_first_impacts_of_the_references(name: str) -> None:
    """The twin is given the sequence of events; the oracle finds it."""
    system, impacts = references.system(name), references.twin_of_doubles(name)[:4]
    oracle = Oracle.of(system)
    history = oracle.run(impacts[-1].t + mp.mpf(10) ** -6)
    found = [event.t for event in history.events if event.kind == "impact"]
    if history.end_cause == "inadmissible":
        found.append(history.end_time)
    assert len(found) == len(impacts)
    for t, impact in zip(found, impacts, strict=True):
        assert abs(t - impact.t) < CLOSE


@pytest.mark.parametrize(("ratio", "count"), [(1, 3), (100, 31), (10_000, 314)])
def test_impacts_of_a_heavy_body_a_light_one_and_a_wall(ratio: int, count: int) -> None:
    """Galperin 2003: as many as the digits of pi say."""
    document = scene(LEVEL, [on_line(2.0, 1.0), on_line(4.0, float(ratio), -1.0)], 1.0, time=1e3)
    document["ends"] = {"left": {"wall": 1.0}, "right": "stop"}
    _, history = history_of(document, 1000)
    assert len([event for event in history.events if event.kind in ("impact", "wall")]) == count
    assert history.end_cause == "end_of_trace"


def test_the_instant_at_which_it_stops_is_told_too() -> None:
    document = scene(LEVEL, [on_line(2.0, 1.0, 1.0), on_line(4.0, 1.0)], 1.0, time=1.0)
    for number in range(1, 21):
        until = mp.mpf(number) / 300
        _, history = history_of(document, until, (until,))
        assert len(history.samples) == 1


@pytest.mark.parametrize("k", [0.0, 0.05, 0.5])
def test_a_ball_hits_a_row_at_rest(k: float) -> None:
    """Pair after pair in exact fractions; below 7 - 4 sqrt(3) all go on together."""
    row = [on_line(1.0, 1.0, 1.0), on_line(2.0, 1.0), on_line(2.5, 1.0)]
    document = scene(LEVEL, row, k, time=4.0)
    _, history = history_of(document, 2, (1.5,))
    speeds, share = [Fraction(1), Fraction(0), Fraction(0)], Fraction(k)
    for turn in range(400):
        a = turn % 2
        mean, closing = (speeds[a] + speeds[a + 1]) / 2, speeds[a] - speeds[a + 1]
        if closing > 0:
            half = share * closing / 2
            speeds[a], speeds[a + 1] = mean - half, mean + half
        speeds = [one.limit_denominator(10**60) for one in speeds]
    for (state, _, _), speed in zip(history.samples[0], speeds, strict=True):
        assert abs(state.speed - mp.mpf(speed.numerator) / speed.denominator) < CLOSE


def test_a_heavy_ball_presses_a_light_one_against_a_wall() -> None:
    """It ends: the impacts of one instant have a limit, and the bounces of both too."""
    arcs = [{"shape": "valley", "radius": 1.0, "end_slope": "60 deg"}]
    balls = [ball(-0.87), ball(-0.3, mass=0.1)]
    document = scene({"start_slope": "-60 deg", "arcs": arcs}, balls, 0.4, time=3.0)
    document["ends"] = {"left": {"wall": 0.3}, "right": {"wall": 0.3}}
    found, history = history_of(document, 3, (0.0, 1.0, 2.0, 2.9))
    assert history.end_cause == "time"
    energies = [energy(found, row) for row in history.samples]
    assert all(after <= before + CLOSE for before, after in pairwise(energies))


TRACE: Document = {
    "start_slope": -1.0,
    "arcs": [
        {"shape": "valley", "radius": 1.0, "end_slope": 0.4},
        {"shape": "line", "length": 0.7},
        {"shape": "hump", "radius": 0.8, "end_slope": 0.1},
        {"shape": "valley", "radius": 1.2, "end_slope": 1.4},
    ],
}


@pytest.mark.parametrize("turning", [None, {"through_arc": 1, "rate": 1.5}])
def test_a_group_across_pieces_keeps_its_energy_and_its_contact(turning: Any) -> None:
    balls = [
        ball(-0.3, speed=1.0, body="hoop"),
        {"radius": 0.06, "mass": 0.4, "arc": 1, "touching": "previous", "speed": 1.0},
    ]
    trace = TRACE if turning is None else {**TRACE, "turning": turning}
    times = (0.1, 0.5, 0.6, 0.7)
    found, history = history_of(scene(trace, balls, 0.0, time=1.0), 0.8, times)
    opened = [event.t for event in history.events if event.kind == "contact_opened"]
    together = [
        row for t, row in zip(times, history.samples, strict=True)
        if not opened or t < opened[0]
    ]  # fmt: skip
    assert len({row[1][0].piece for row in together}) > 1
    assert len({row[0][0].piece for row in together}) > 1
    for row in together:
        assert abs(energy(found, row) - energy(found, together[0])) < CLOSE
        (_, ax, ay), (_, bx, by) = row
        assert abs(mp.hypot(bx - ax, by - ay) - (mp.mpf(0.1) + mp.mpf(0.06))) < CLOSE


def test_first_zeros_of_polynomials_with_known_ones() -> None:
    chance = random.Random(5)
    for _ in range(300):
        roots = [Fraction(chance.randint(-900, 1900), 1000) for _ in range(chance.randint(1, 6))]
        series = [Fraction(1)]
        for root in roots:
            series = [
                (series[k - 1] if k else 0) - root * (series[k] if k < len(series) else 0)
                for k in range(len(series) + 1)
            ]
        if series[0] == 0:
            continue
        sign = 1 if series[0] > 0 else -1
        whole = [int(sign * value * 2**BITS) for value in series]
        inside = [root for root in roots if 0 < root <= 1 and roots.count(root) % 2 == 1]
        expected = min(inside, default=None)
        if any(roots.count(root) > 1 and 0 < root <= 1 for root in roots):
            continue  # a double zero may be seen or not
        found = first_zero(whole, 1 << BITS)
        assert (found is None) == (expected is None)
        if found is not None and expected is not None:
            assert abs(Fraction(found, 2**BITS) - expected) < Fraction(1, 10**30)


def test_a_polynomial_that_begins_with_zeros() -> None:
    one = 1 << BITS
    assert without_leading_zeros([0, 3, one, -one]) == [one, -one]
    assert without_leading_zeros([0, 1, 2]) == []
    assert value_of([one, one], one >> 1) == 3 * one >> 1
    with pytest.raises(Undecided):
        first_zero([-one, one], one)
