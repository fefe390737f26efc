"""Phase portraits of a body on a trace that turns about a vertical axis."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.analysis.traces import system, valley
from tests.systems.trace.turning_scenes import on_lines, on_three_arcs
from tests.systems.trace.turning_scenes import system as built
from vibro_cli.analysis.levels import Landscape, level_curves, reaches
from vibro_cli.analysis.singular import (
    CENTRE,
    FIGURE_EIGHT,
    SADDLE,
    changes,
    portrait_of,
    singular_points,
)
from vibro_cli.mechanics.potential import Turning


def on_circle(rate: float, x: float = 1.0) -> Landscape:
    """A body in a valley of radius 1 m, whose centre is at x = 1 m."""
    return Landscape.of(system(-90.0, valley(1.0, 90), turning=Turning(x, rate)), 1)


def test_pitchfork_is_where_turning_balances_gravity() -> None:
    probe = on_circle(1.0)
    rho = probe.path_scale(probe.trace.pieces[0])
    center = probe.trace.pieces[0].center[0]
    rates = [1.0, 2.0, 3.0, 4.0]
    found = changes(lambda rate: portrait_of(on_circle(rate, center)).type, rates)
    # At the pitchfork itself the point is degenerate, if a double is just there.
    assert 1 <= len(found) <= 2
    assert found[0].low ** 2 == pytest.approx(probe.gravity / rho, rel=1e-12)
    assert found[-1].high ** 2 == pytest.approx(probe.gravity / rho, rel=1e-12)
    assert found[0].before == "centre"
    assert found[-1].after == "centre, saddle, centre; figure eight"


@pytest.mark.parametrize("beyond", [10.0**-n for n in range(1, 16)])
def test_the_type_beyond_the_pitchfork_holds_up_to_it(beyond: float) -> None:
    """The ends of the trace stand high above the saddle: the separatrix closes on both sides."""
    probe = on_circle(1.0)
    piece = probe.trace.pieces[0]
    rate = math.sqrt(probe.gravity / probe.path_scale(piece)) * (1.0 + beyond)
    portrait = portrait_of(on_circle(rate, piece.center[0]))
    assert portrait.type == "centre, saddle, centre; figure eight"
    (trigger,) = portrait.triggers
    assert trigger.margin_left > 0.0 < trigger.margin_right
    assert trigger.turning_left is not None
    assert trigger.turning_right is not None
    assert trigger.turning_left <= trigger.saddle.s <= trigger.turning_right


def test_saddle_and_centre_meet_off_the_axis() -> None:
    # sin f = spread sin f cos f + tilt cos f; both vanish together with their derivative where
    # tilt^(2/3) + 1 = spread^(2/3) (an astroid, exchanged roles of the two terms).
    def type_of(rate: float) -> str:
        return portrait_of(on_circle(rate, 0.9)).type

    (change,) = changes(type_of, [3.0, 4.1])
    landscape = on_circle(change.low, 0.9)
    pull = landscape.pull(landscape.trace.pieces[0])
    assert abs(pull.tilt) ** (2 / 3) + 1.0 == pytest.approx(pull.spread ** (2 / 3), rel=1e-12)


@pytest.mark.parametrize("scene", [on_three_arcs(rate=1.7), on_lines()])
def test_singular_points_are_where_the_potential_is_stationary(scene: dict[str, object]) -> None:
    landscape = Landscape.of(built(scene), 1)
    points = singular_points(landscape)
    assert len(points) >= 3
    h = 1e-4
    for point in points:
        piece = landscape.trace.pieces[point.piece]
        before, here, after = landscape.potential(piece, point.position + np.array([-h, 0.0, h]))
        assert abs(after - before) < 1e-8 * landscape.body.mass
        assert (after + before > 2.0 * here) == (point.kind == CENTRE)
        assert here == pytest.approx(point.energy, rel=1e-12)


def test_lowest_place_has_no_energy() -> None:
    landscape = Landscape.of(built(on_three_arcs(rate=1.7)), 1)
    places = [
        (piece, np.linspace(piece.angle_start, piece.angle_end, 4001))
        for piece in landscape.trace.pieces
    ]
    least = min(float(np.min(landscape.potential(*place))) for place in places)
    assert 0.0 <= least < 1e-4


@pytest.mark.parametrize("share", [0.02, 0.4, 0.9, 1.3])
def test_level_curves_have_their_energy(share: float) -> None:
    landscape = Landscape.of(built(on_three_arcs(rate=1.7)), 1)
    energy = share * max(point.energy for point in singular_points(landscape))
    found = 0
    for piece in landscape.trace.pieces:
        for curve in level_curves(landscape, piece, energy):
            along = landscape.energy(piece, curve.position, curve.rate)
            assert along == pytest.approx(energy, rel=1e-9)
            found += 1
        for part in reaches(landscape, piece, energy):
            for place, turns in ((part.low, part.turns_low), (part.high, part.turns_high)):
                if turns:
                    assert float(landscape.potential(piece, place)) == pytest.approx(energy)
    assert found > 0


def test_several_figure_eights() -> None:
    # Above the pitchfork of the valleys and with the hump between them.
    circle = portrait_of(on_circle(4.0, on_circle(1.0).trace.pieces[0].center[0]))
    assert [trigger.orbit for trigger in circle.triggers] == [FIGURE_EIGHT]
    saddle = circle.triggers[0].saddle
    assert saddle.kind == SADDLE
    assert saddle.position == 0.0
    turning = circle.triggers[0].turning_right
    assert turning is not None
    piece = circle.landscape.trace.pieces[0]
    angle = (turning - piece.start_s) / piece.radius + piece.angle_start
    height = float(circle.landscape.potential(piece, angle))
    assert height == pytest.approx(saddle.energy, rel=1e-9)
    assert math.cos(angle) == pytest.approx(
        2.0 / circle.landscape.pull(piece).spread - 1.0, rel=1e-9
    )
