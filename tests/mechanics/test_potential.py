"""Heights of the arcs, each rounded once, against the chain built in high precision."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.kernels.kernel_records import three_arcs
from vibro_cli.mechanics.potential import Pull, Turning, contains_turn, heights, roots
from vibro_cli.mechanics.trace import ArcShape, Trace
from vibro_cli.stress.oracles.scene import Piece, Real, chain, mp

SETTINGS = settings(deadline=None, derandomize=True, max_examples=60)


def laid(trace: Trace) -> tuple[Piece, ...]:
    """Return the chain in high precision, from the same doubles of the slopes."""
    shapes = [
        (piece.shape, mp.mpf(piece.length if piece.is_line else piece.radius),
         mp.mpf(piece.end_slope))
        for piece in trace.pieces
    ]  # fmt: skip
    return chain(mp.mpf(trace.pieces[0].start_slope), shapes)


def height_at(piece: Piece, radius: Real, place: Real) -> Real:
    """Return the height of a centre on a piece."""
    if piece.sign == 0:
        slope = piece.slopes[0]
        return piece.origin[1] + place * mp.sin(slope) + radius * mp.cos(slope)
    return piece.origin[1] - piece.sign * (piece.size - piece.sign * radius) * mp.cos(place)


def lowest(pieces: tuple[Piece, ...], radius: Real) -> Real:
    """Return the lowest position of the centre: at an end of a piece, or where it is level."""
    found = []
    for piece in pieces:
        places = [piece.low, piece.high]
        if piece.sign:
            level = 0 if piece.sign > 0 else mp.pi
            for turn in (-4, -2, 0, 2, 4):
                place = level + turn * mp.pi
                if piece.low <= place <= piece.high:
                    places.append(place)
        found += [height_at(piece, radius, place) for place in places]
    return min(found)


def check(trace: Trace, radius: float) -> None:
    pieces, r = laid(trace), mp.mpf(radius)
    zero = lowest(pieces, r)
    for piece, found in zip(pieces, heights(trace, radius), strict=True):
        if piece.sign == 0:
            exact = height_at(piece, r, piece.low), height_at(piece, r, piece.high)
        else:
            rho = piece.size - piece.sign * r
            exact = piece.origin[1] - rho, piece.origin[1] + rho
        for value, true in zip(found, exact, strict=True):
            assert abs(value - (true - zero)) <= 0.5000001 * math.ulp(value) + 1e-45


def test_three_arcs() -> None:
    for radius in (0.0, 0.01, 0.1, 0.4):
        check(three_arcs(), radius)


def test_lines_and_arcs() -> None:
    trace = Trace.chain(
        -1.3,
        [
            ArcShape("line", length=0.7), ArcShape("valley", radius=0.8, end_slope=0.6),
            ArcShape("line", length=1.1), ArcShape("hump", radius=0.9, end_slope=-0.4),
            ArcShape("line", length=0.3), ArcShape("valley", radius=2.0, end_slope=1.4),
        ],
    )  # fmt: skip
    check(trace, 0.07)


def test_level_pieces_of_one_height_have_the_same_number() -> None:
    """Bodies may creep along them with energies far below the rounding of a height."""
    shapes = [
        ArcShape("valley", radius=0.8571, end_slope=0.0), ArcShape("line", length=0.3708),
        ArcShape("line", length=1.1), ArcShape("valley", radius=1.0 / 3.0, end_slope=0.6),
    ]  # fmt: skip
    for radius in (0.0, 0.0127, 0.1):
        valley, *lines, other = heights(Trace.chain(-0.6, shapes), radius)
        assert lines == [(0.0, 0.0), (0.0, 0.0)]
        assert valley[0] == other[0] == 0.0


def test_heights_halfway_between_two_doubles_are_even_in_any_unit_of_length() -> None:
    """The greatest height is 2 (R - r), which exact rational arithmetic rounds half to even."""
    halfway = 0
    for radius in (0.1, 0.0127, 1.0 / 3.0):
        for size in (1.0, 1.3, 0.8571, 2.7, 5.1):
            exact = 2 * (Fraction(size) - Fraction(radius))
            halfway += exact.numerator.bit_length() == 54
            for n in range(-20, 21):
                valley = ArcShape("valley", radius=math.ldexp(size, n), end_slope=0.5)
                found = heights(Trace.chain(-0.7, [valley]), math.ldexp(radius, n))
                assert found == [(0.0, math.ldexp(float(exact), n))]
    assert halfway >= 3


@pytest.mark.parametrize("turn", [math.pi, 1.5 * math.pi])
def test_most_of_a_circle(turn: float) -> None:
    check(Trace.chain(-turn, [ArcShape("valley", radius=1.0, end_slope=0.9)]), 0.2)


@SETTINGS
@given(
    slopes=st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=6, unique=True),
    radius=st.floats(0.01, 0.3),
)
def test_random_chains(slopes: list[float], radius: float) -> None:
    shapes = [
        ArcShape("valley" if end > start else "hump", radius=0.5 + abs(end), end_slope=end)
        for start, end in pairwise(slopes)
    ]
    check(Trace.chain(slopes[0], shapes), radius)


def test_contains_turn() -> None:
    valley = Trace.chain(-1.0, [ArcShape("valley", radius=1.0, end_slope=4.0)]).pieces[0]
    assert contains_turn(valley, 0.0)
    assert contains_turn(valley, math.pi)
    assert not contains_turn(valley, 4.5)
    assert contains_turn(valley, 2.0 * math.pi)


@pytest.mark.parametrize("strength", [10.0**-power for power in (3, 9, 15, 16, 17, 18, 20, 24, 40)])
def test_faint_turning_keeps_all_equilibria(strength: float) -> None:
    """At the foot and the crest of the arc, both moved by the tilt, to first order."""
    pull = Pull(tilt=-0.7 * strength, spread=0.4 * strength)
    foot, crest = sorted(pull.equilibria(), key=abs)
    assert foot == pytest.approx(pull.tilt, rel=2.0 * strength, abs=1e-300)
    assert math.remainder(crest - math.pi, math.tau) == pytest.approx(
        pull.tilt, rel=2.0 * strength, abs=2.0**-51
    )
    for order in (1, 2, 3):
        first, second = roots(1.0, pull.tilt, pull.spread, order)
        assert math.remainder(2.0 * (second - first), math.tau) == pytest.approx(
            0.0, abs=16.0 * strength + 2.0**-50
        )


TURNING = Turning(x=0.4, rate=2.9)


@pytest.mark.parametrize("piece", three_arcs().pieces, ids=lambda piece: f"piece {piece.index + 1}")
def test_the_pull_is_the_slope_of_the_height_in_the_turning_frame(piece: Any) -> None:
    """In units of the path's radius, of y - Omega^2 (x - x0)^2/2g; to its third derivative."""
    radius, gravity = 0.1, 9.81
    pull = Pull.on_arc(piece, radius, TURNING, gravity)
    rho = mp.mpf(piece.radius) - piece.sign * mp.mpf(radius)
    turn = 0 if piece.sign > 0.0 else mp.pi  # from f to the angle of the piece

    def height(f: Real) -> Real:
        x = piece.centre[0] + rho * mp.sin(f - turn)
        y = piece.centre[1] - piece.sign * rho * mp.cos(f - turn)
        return (y - mp.mpf(TURNING.rate) ** 2 * (x - TURNING.x) ** 2 / (2 * gravity)) / rho

    values = pull.force, pull.stiffness, pull.bending
    for f in (-2.6, -0.9, 0.3, 1.7, 3.0):
        rise = (height(mp.mpf(f)) - height(mp.mpf(0))) / 2
        assert pull.potential(f) == pytest.approx(float(rise), abs=1e-15)
        for order, value in enumerate(values):
            assert value(f) == pytest.approx(float(-mp.diff(height, f, order + 1)), abs=1e-14)
    for low, high in ((-3.0, -2.0), (-1.2, 0.4), (0.1, 2.9), (-3.1, 3.1)):
        places = np.linspace(low, high, 2001).tolist()
        for order, value in enumerate(values):
            most = max(abs(value(f)) for f in places)
            assert most <= pull.greatest(order, low, high) * (1.0 + 1e-12) <= most * (1.0 + 1e-5)
        fall = max(0.01, *(-pull.stiffness(f) for f in places))
        assert fall <= pull.steepest_fall(low, high) * (1.0 + 1e-12) <= fall * (1.0 + 1e-5)
