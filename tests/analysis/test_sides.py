"""Sides of the figure eight, of states chosen by hand."""

from __future__ import annotations

import math

import pytest

from tests.analysis.traces import BALL, DEGREE, GRAVITY, circle, three_arcs
from vibro_cli.analysis.portrait_type import portrait_of
from vibro_cli.analysis.sides import LEFT, ON, OUTSIDE, RIGHT, side

# height of the crest above the valleys' lowest places: (R + R₀)(1 − cos J)
CREST = BALL.mass * GRAVITY * 1.5 * (1.0 - math.cos(50 * DEGREE))


@pytest.mark.parametrize(
    ("share", "expected"), [(0.0, LEFT), (0.99, LEFT), (1.0, ON), (1.01, OUTSIDE)]
)
def test_the_energy_decides(share: float, expected: str) -> None:
    portrait = portrait_of(three_arcs())
    assert side(portrait, portrait.points[0].s, share * CREST) == expected


def test_below_the_saddle_the_place_decides() -> None:
    portrait = portrait_of(three_arcs())
    left, saddle, right = portrait.points
    assert side(portrait, left.s, 0.5 * CREST) == LEFT
    assert side(portrait, right.s, 0.5 * CREST) == RIGHT
    assert side(portrait, saddle.s, CREST) == ON


def test_without_a_figure_eight_there_are_no_sides() -> None:
    for hills in (circle(), three_arcs(60.0)):
        portrait = portrait_of(hills)
        assert side(portrait, portrait.points[0].s, 0.0) is None
