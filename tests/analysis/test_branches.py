"""Branches between two states, compared with the motion integrated in time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import ellipk

from tests.analysis.traces import circle, hump, landscape, line, three_arcs
from tests.bare_system import GRAVITY
from vibro_cli.analysis.levels import Landscape, free_branches
from vibro_cli.mechanics.trace import Piece

Array = NDArray[np.float64]


def moved(
    hills: Landscape, piece: Piece, position: float, rate: float, time: float
) -> tuple[float, float]:
    """Return the state after a time, by many small Runge-Kutta steps."""
    scale = hills.path_scale(piece)

    def change(state: Array) -> Array:
        slope = piece.slope(float(state[0]))
        return np.array([state[1], -GRAVITY / (1.4 * scale) * math.sin(slope)])

    state = np.array([position, rate])
    steps = 4000
    h = time / steps
    for _ in range(steps):
        k1 = change(state)
        k2 = change(state + 0.5 * h * k1)
        k3 = change(state + 0.5 * h * k2)
        k4 = change(state + h * k3)
        state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return float(state[0]), float(state[1])


def branch(
    hills: Landscape, piece: Piece, position: float, rate: float, time: float, count: int = 401
) -> tuple[Array, Array]:
    end = moved(hills, piece, position, rate, time)
    one = [np.array([value]) for value in (position, rate, *end, time)]
    angles, rates = free_branches(hills, piece, (one[0], one[1]), (one[2], one[3]), one[4], count)
    assert angles.shape == rates.shape == (1, count)
    assert (angles[0, 0], rates[0, 0]) == (position, rate)
    assert (angles[0, -1], rates[0, -1]) == end
    return angles[0], rates[0]


CIRCLE = circle()
BOTTOM = CIRCLE.trace.pieces[0]
HILLS = three_arcs()
CREST = HILLS.trace.pieces[1]
UNDERSIDE = landscape(-90.0, hump(1.0, -270))
SLOPE = landscape(20.0, line(5.0))
PERIOD = 2 * math.pi / math.sqrt(GRAVITY / (1.4 * 0.9))


@pytest.mark.parametrize(
    ("hills", "piece", "position", "rate", "time"),
    [
        (CIRCLE, BOTTOM, -0.7, 0.0, 0.4),  # from rest
        (CIRCLE, BOTTOM, -0.7, 1.5, 0.9),  # over a turning point
        (CIRCLE, BOTTOM, 0.2, -3.0, 1.3),
        (CIRCLE, BOTTOM, -3.0, 0.5, 0.5),  # progressive, q > 1
        (HILLS, CREST, -0.8, 1.0, 0.35),  # turns before the crest
        (HILLS, CREST, -0.8, 4.0, 0.3),  # rolls over it
        (HILLS, CREST, 0.1, 0.0, 0.6),
        (UNDERSIDE, UNDERSIDE.trace.pieces[0], 2.5, 1.0, 1.0),  # about ψ = π
        (SLOPE, SLOPE.trace.pieces[0], 0.5, 2.0, 1.2),
    ],
)
def test_branch_runs_through_the_states_between(
    hills: Landscape, piece: Piece, position: float, rate: float, time: float
) -> None:
    angles, rates = branch(hills, piece, position, rate, time)
    energy = hills.energy(piece, angles, rates)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-10)  # the end is the integrated one
    np.testing.assert_allclose(energy[:-1], energy[0], rtol=1e-12)
    for share in (0.2, 0.5, 0.9):
        expected = moved(hills, piece, position, rate, share * time)
        distance = np.hypot(angles - expected[0], rates - expected[1])
        assert np.min(distance) < 0.02  # the spacing of the points


def test_short_flight_is_not_a_whole_turn() -> None:
    position, rates = branch(CIRCLE, BOTTOM, 0.3, 1.0, 1e-9)
    assert np.ptp(position) < 1e-8
    assert np.ptp(rates) < 1e-7


def test_flight_of_whole_periods_closes_its_curve() -> None:
    position, rates = branch(CIRCLE, BOTTOM, 0.3, 0.0, 2.2 * PERIOD)
    assert np.min(position) == pytest.approx(-0.3, rel=1e-3)
    assert np.max(position) == pytest.approx(0.3, rel=1e-3)
    assert np.max(np.abs(np.diff(rates))) < 0.05  # no chord from turn to end


@pytest.mark.parametrize("share", [0.97, 1.03])
def test_a_swing_is_whole_only_if_the_flight_lasts_its_period(share: float) -> None:
    """Of an amplitude of 2.5 rad, with the period 4 K(sin 1.25)/w: angles swept in all."""
    amplitude, start = 2.5, 1.0
    w = math.sqrt(GRAVITY / (1.4 * 0.9))
    rate = 2.0 * w * math.sqrt(math.sin(0.5 * amplitude) ** 2 - math.sin(0.5 * start) ** 2)
    period = 4.0 * float(ellipk(math.sin(0.5 * amplitude) ** 2)) / w
    position, _ = branch(CIRCLE, BOTTOM, start, rate, share * period, count=4001)
    swept = 4.0 * amplitude + position[-1] - start
    assert float(np.sum(np.abs(np.diff(position)))) == pytest.approx(swept, rel=1e-5)


def test_a_flight_that_rounding_takes_backwards_stays_a_point() -> None:
    start, end = (np.array([0.3]), np.array([1.0])), (np.array([0.3 - 1e-15]), np.array([1.0]))
    angles, rates = free_branches(CIRCLE, BOTTOM, start, end, np.array([1e-16]), 33)
    assert np.ptp(angles) < 1e-14
    assert np.ptp(rates) < 1e-14


def test_body_at_rest_on_the_bottom_stays_a_point() -> None:
    zero = np.zeros(1)
    angles, rates = free_branches(CIRCLE, BOTTOM, (zero, zero), (zero, zero), np.array([5.0]), 11)
    assert not angles.any()
    assert not rates.any()


def test_many_flights_at_once_are_the_same_as_one_by_one() -> None:
    starts = [(-0.7, 0.0, 0.4), (-3.0, 0.5, 0.5), (0.2, -3.0, 1.3)]
    ends = [moved(CIRCLE, BOTTOM, *start) for start in starts]
    columns = np.array([(*start, *end) for start, end in zip(starts, ends, strict=True)]).T
    angles, rates = free_branches(
        CIRCLE, BOTTOM, (columns[0], columns[1]), (columns[3], columns[4]), columns[2], 33
    )
    for row, start in enumerate(starts):
        alone = branch(CIRCLE, BOTTOM, *start, count=33)
        np.testing.assert_array_equal(angles[row], alone[0])
        np.testing.assert_array_equal(rates[row], alone[1])
