"""Runs in lanes have the bits of single runs, whatever their events."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vibro_cli.compile.kernel import struct
from vibro_cli.kernels.contact.libration_contact_lanes import BodyLanes
from vibro_cli.kernels.ensemble.records import Points
from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.statistics.run_statistics import Results
from vibro_cli.kernels.world import LOG_FULL
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.stress.scenes import scene, system_of, three_arcs, valley
from vibro_cli.systems.trace.ensemble import (
    Batch,
    empty_results,
    make_points,
    same_in_every_lane,
)

CIRCLE = valley(160)
TRACES = {"circle": CIRCLE, "walls": valley(80), "three arcs": three_arcs(150)}
POINTS = 400


def _system(trace: dict[str, Any], law: str, radius: float) -> TraceSystem:
    ball = {"radius": 0.1, "density": 7800.0, "arc": 1}
    balls = [ball | {"angle": -0.7}, ball | {"angle": 0.5, "radius": radius}]
    ends = {"left": {"wall": 0.9}, "right": {"wall": 1.0}}
    return system_of(scene(trace, balls, 1.0, law, collisions=9) | {"ends": ends})


def _starts(rng: Any, low: float, high: float) -> tuple[Any, Any, Any]:
    """``(S, C, P)`` of both bodies, of different kinds: at rest, symmetric, fast."""
    angles = np.sort(rng.uniform(low, high, (POINTS, 2)), axis=1)
    angles[:, 1] = np.maximum(angles[:, 1], angles[:, 0] + 0.4)
    p = rng.uniform(-0.4, 0.4, (POINTS, 2)) * (rng.random((POINTS, 1)) < 0.6)
    symmetric = rng.random(POINTS) < 0.1
    angles[symmetric, 0] = -np.abs(angles[symmetric, 1])
    p[symmetric] = 0.0
    apart = angles[:, 1] - angles[:, 0] > 0.35
    return np.sin(0.5 * angles[apart]), np.cos(0.5 * angles[apart]), p[apart]


def _points(seed: int, low: float, high: float) -> Points:
    rng = np.random.default_rng(seed)
    s, c, p = _starts(rng, low, high)
    count = len(s)
    mass = rng.uniform(0.5, 5.0, (count, 2))
    mass[rng.random(count) < 0.2] = 1.0
    k = np.where(rng.random((count, 1)) < 0.5, 1.0, rng.uniform(0.2, 1.0, (count, 1)))
    stop_t = np.where(rng.random(count) < 0.5, NEVER, rng.uniform(0.1, 60.0, count))
    most = rng.integers(1, 120, count)
    return make_points(stop_t, most, np.zeros((count, 2), dtype=np.int64), s, c, p, mass, k)


def _assert_same(ours: Results, theirs: Results) -> None:
    # In lanes, the log of a run is shorter: it may be solved where it is too long otherwise.
    outcomes: Any = theirs.outcomes
    whole = outcomes["end_cause"] != LOG_FULL
    for one, other, scratch in (
        (ours.outcomes, theirs.outcomes, ""),
        (ours.finals, theirs.finals, "latest"),
    ):
        a, b = np.asarray(one).reshape(len(whole), -1), np.asarray(other).reshape(len(whole), -1)
        for name in a.dtype.names or ():
            if name != scratch:
                np.testing.assert_array_equal(a[name][whole], b[name][whole], name)


@pytest.mark.parametrize("law", LAW_NAMES)
@pytest.mark.parametrize("radius", [0.1, 0.17])
@pytest.mark.parametrize("trace", list(TRACES))
def test_same_bits_as_single_runs(trace: str, radius: float, law: str) -> None:
    system = _system(TRACES[trace], law, radius)
    low, high = {"circle": (-2.2, 1.6), "walls": (-1.2, 0.9), "three arcs": (-1.9, 0.6)}[trace]
    points = _points(len(trace) + len(law), low, high)
    own: Any = points.own
    lanes, alone = Batch(system), Batch(system, in_lanes=False)
    ours = lanes.run_all(points, empty_results(len(own), 2, 0))
    theirs = alone.run_all(points, empty_results(len(own), 2, 0))
    _assert_same(ours, theirs)
    outcomes: Any = theirs.outcomes
    assert alone.impacts_in_lanes == 0
    assert 0.05 * outcomes["collisions"].sum() < lanes.impacts_in_lanes
    assert lanes.impacts_in_lanes < outcomes["collisions"].sum()
    met = outcomes["impacts"] > 0
    assert outcomes["max_gap"][met].max() < 1e-14
    if trace == "three arcs":
        assert outcomes["crossings"].sum() > len(own)
    else:
        assert outcomes["contacts"].sum() + (outcomes["end_cause"] > 2).sum() > 0


@pytest.mark.parametrize("law", LAW_NAMES)
@pytest.mark.parametrize("trace", list(TRACES))
def test_impacts_that_are_kept_have_the_bits_of_the_event_loop(trace: str, law: str) -> None:
    """Then the two bodies of a run are in lanes, not the runs."""
    system = _system(TRACES[trace], law, 0.17)
    low, high = {"circle": (-2.2, 1.6), "walls": (-1.2, 0.9), "three arcs": (-1.9, 0.6)}[trace]
    points = _points(7 * len(trace) + len(law), low, high)
    count = len(points.own)
    ours, theirs = (
        Batch(system, in_lanes=in_lanes).run_all(points, empty_results(count, 2, 1024))
        for in_lanes in (True, False)
    )
    _assert_same(ours, theirs)
    outcomes: Any = theirs.outcomes
    rows = int(outcomes["kept"].sum())
    assert rows == int(outcomes["collisions"][outcomes["end_cause"] != LOG_FULL].sum()) > 10 * count
    one, other = np.asarray(ours.impacts)[:rows], np.asarray(theirs.impacts)[:rows]
    for name in one.dtype.names or ():
        np.testing.assert_array_equal(one[name], other[name], name)


@struct
class _MoreOfABody(BodyLanes):
    reference_speed: float


def test_lanes_have_all_of_a_body_that_is_the_same_in_them() -> None:
    """Without it they would give up at every impact that needs it, unseen."""
    assert same_in_every_lane(_MoreOfABody) == ["radius", "kappa", "reference_speed"]


def test_long_elastic_runs_stay_in_lanes() -> None:
    system = _system(CIRCLE, "hedrih", 0.1)
    count = 40
    half = 0.5 * np.linspace(-1.0, -0.4, count)
    s = np.stack([np.sin(half), np.full(count, np.sin(0.27))], axis=1)
    whole = np.full((count, 2), 0, dtype=np.int64)
    mass = np.tile([32.7, 11.3], (count, 1))
    points = make_points(
        np.full(count, NEVER), np.full(count, 500), whole, s, np.sqrt(1.0 - s * s), 0.0 * s, mass,
        np.ones((count, 1)),
    )  # fmt: skip
    lanes, alone = Batch(system), Batch(system, in_lanes=False)
    ours = lanes.run_all(points, empty_results(count, 2, 0))
    _assert_same(ours, alone.run_all(points, empty_results(count, 2, 0)))
    assert lanes.impacts_in_lanes > 0.95 * 500 * count
