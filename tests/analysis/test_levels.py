"""Level curves: the energy along them and their turning points, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.analysis.traces import (
    BALL,
    circle,
    hump,
    landscape,
    line,
    three_arcs,
    valley,
)
from tests.bare_system import GRAVITY
from vibro_cli.analysis.levels import (
    Landscape,
    arc_separatrix,
    connected_reaches,
    level_curves,
    reaches,
    speed_curves,
)
from vibro_cli.analysis.singular import SADDLE, singular_points

WEIGHT = BALL.mass * GRAVITY
LINES = landscape(-60.0, valley(1.0, -20), line(1.5), valley(0.8, 30), line(2.0))
LOOP = landscape(-60.0, valley(1.0, 260))
UNDERSIDE = landscape(-90.0, hump(1.0, -270))


def levels(hills: Landscape) -> list[float]:
    top = max(
        float(np.max(hills.potential(p, [p.angle_start, p.angle_end]))) for p in hills.trace.pieces
    )
    saddles = [point.energy for point in singular_points(hills) if point.kind == SADDLE]
    return [0.01 * top, 0.3 * top, 0.7 * top, 1.001 * top, 3.0 * top, *saddles]


@pytest.mark.parametrize("hills", [three_arcs(), circle(), LINES, LOOP, UNDERSIDE])
def test_energy_is_constant_along_every_curve(hills: Landscape) -> None:
    drawn = 0
    for energy in levels(hills):
        for piece in hills.trace.pieces:
            for curve in level_curves(hills, piece, energy):
                drawn += 1
                along = hills.energy(piece, curve.position, curve.rate)
                np.testing.assert_allclose(along, energy, rtol=1e-12, atol=0.0)
                assert np.all(np.diff(curve.position) > 0.0)
                assert np.all(curve.rate >= 0.0)
    assert drawn >= len(levels(hills))


@pytest.mark.parametrize("hills", [three_arcs(), circle(), LINES, LOOP, UNDERSIDE])
def test_a_body_with_more_than_the_top_of_a_piece_passes_it(hills: Landscape) -> None:
    for piece, top in zip(hills.trace.pieces, hills.tops.tolist(), strict=True):
        places = np.linspace(piece.angle_start, piece.angle_end, 4001)
        room = 1e-5 * WEIGHT * hills.trace.length
        assert top == pytest.approx(float(np.max(hills.potential(piece, places))), abs=room)
        (reach,) = reaches(hills, piece, math.nextafter(top, math.inf))
        assert reach.is_whole


def test_rate_is_that_of_the_papers() -> None:
    """φ̇² = φ̇₀² + 2a(cos φ − cos φ₀) in a valley, with the other sign on a hump; a = g/κρ."""
    hills = three_arcs()
    for piece, rho, sign in zip(hills.trace.pieces, (0.9, 0.6, 0.9), (1, -1, 1), strict=True):
        a = GRAVITY / (1.4 * rho)
        start, rate = 0.3, 2.5
        energy = float(hills.energy(piece, start, rate))
        angle = np.linspace(-0.6, 0.6, 7)
        expected = np.sqrt(rate**2 + sign * 2 * a * (np.cos(angle) - math.cos(start)))
        np.testing.assert_allclose(hills.rate(piece, angle, energy), expected, rtol=1e-14)


def test_rate_is_nan_where_the_energy_does_not_reach() -> None:
    hills = circle()
    energy = float(hills.potential(hills.trace.pieces[0], 0.5))
    rate = hills.rate(hills.trace.pieces[0], [0.4, 0.6, math.pi], energy)
    assert np.isfinite(rate[0])
    assert np.isnan(rate[1:]).all()


def test_curve_turns_where_the_potential_equals_the_energy() -> None:
    hills = three_arcs()
    piece = hills.trace.pieces[0]
    (reach,) = reaches(hills, piece, float(hills.potential(piece, -1.9)))
    assert reach.low == pytest.approx(-1.9, rel=1e-14)
    assert reach.turns_low
    assert not reach.turns_high  # rolls on over the junction
    (curve,) = level_curves(hills, piece, float(hills.potential(piece, -0.4)))
    np.testing.assert_allclose(curve.position[[0, -1]], [-0.4, 0.4], rtol=1e-14)
    np.testing.assert_array_equal(curve.rate[[0, -1]], 0.0)


def test_below_the_crest_a_hump_is_reached_from_both_sides() -> None:
    hills = three_arcs()
    piece = hills.trace.pieces[1]
    left, right = reaches(hills, piece, float(hills.potential(piece, 0.25)))
    assert left.low == piece.angle_start
    assert left.high == pytest.approx(-0.25, rel=1e-14)
    assert right.low == pytest.approx(0.25, rel=1e-14)
    assert right.high == piece.angle_end
    assert (left.turns_low, left.turns_high) == (False, True)


def test_beyond_the_top_of_a_loop_there_is_a_second_part() -> None:
    piece = LOOP.trace.pieces[0]
    energy = float(LOOP.potential(piece, 3.0))
    first, second = reaches(LOOP, piece, energy)
    assert first.high == pytest.approx(3.0, rel=1e-14)
    assert second.low == pytest.approx(2 * math.pi - 3.0, rel=1e-14)
    assert second.high == piece.angle_end


def test_body_turns_on_a_slope() -> None:
    """On a line of slope α the energy m g x sin α is used up at distance x."""
    hills = landscape(30.0, line(2.0))
    (reach,) = reaches(hills, hills.trace.pieces[0], WEIGHT * 0.7 * math.sin(math.pi / 6))
    assert (reach.low, reach.turns_low, reach.turns_high) == (0.0, False, True)
    assert reach.high == pytest.approx(0.7, rel=1e-14)
    assert reaches(hills, hills.trace.pieces[0], -1.0) == ()


def test_separatrix_of_a_circle() -> None:
    """φ̇ = 2w cos(φ/2), w² = g/κρ, the level curve through the top."""
    hills = circle()
    piece = hills.trace.pieces[0]
    curve = arc_separatrix(hills, piece)
    assert curve is not None
    w = math.sqrt(GRAVITY / (1.4 * 0.9))
    np.testing.assert_allclose(curve.rate, 2 * w * np.abs(np.cos(curve.position / 2)), rtol=1e-15)
    energy = singular_points(hills)[0].energy
    np.testing.assert_allclose(hills.energy(piece, curve.position, curve.rate), energy, rtol=1e-14)
    (level,) = level_curves(hills, piece, energy)
    assert (level.position[0], level.position[-1]) == (-math.pi, math.pi)


def test_separatrix_of_a_hump_meets_the_crest() -> None:
    hills = three_arcs()
    curve = arc_separatrix(hills, hills.trace.pieces[1])
    assert curve is not None
    at_crest = np.flatnonzero(curve.position == 0.0)
    assert curve.rate[at_crest] == [0.0]
    assert (
        arc_separatrix(landscape(0.0, line(1.0)), landscape(0.0, line(1.0)).trace.pieces[0]) is None
    )


def test_speed_is_continuous_at_the_junctions() -> None:
    hills = three_arcs()
    saddle = singular_points(hills)[1]
    for energy in (0.5 * saddle.energy, saddle.energy, 1.5 * saddle.energy):
        for curve in speed_curves(hills, 121, energy):
            assert np.all(np.diff(curve.position) > -1e-15 * hills.trace.length)
            joints = np.flatnonzero(np.diff(curve.position) <= 1e-14 * hills.trace.length)
            np.testing.assert_allclose(curve.rate[joints], curve.rate[joints + 1], rtol=1e-12)


def test_level_below_the_crest_has_a_part_in_each_valley() -> None:
    hills = three_arcs()
    energy = singular_points(hills)[1].energy
    assert len(connected_reaches(hills, 0.9 * energy)) == 2
    (through,) = connected_reaches(hills, energy)
    assert [part.piece.index for part in through] == [0, 1, 2]


def test_level_line_is_reached_whole_by_its_own_energy() -> None:
    hills = landscape(-60.0, valley(1.0, 0), line(2.0), valley(1.0, 60))
    (reach,) = reaches(hills, hills.trace.pieces[1], singular_points(hills)[0].energy)
    assert (reach.low, reach.high) == (0.0, 2.0)
