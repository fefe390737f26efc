"""Phase portraits of a body on a trace that rotates about a vertical axis."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.analysis.traces import BALL, DEGREE, hump, line, system, valley
from tests.scaling import scaled
from tests.systems.trace.turning_scenes import on_lines, on_three_arcs
from vibro_cli.analysis.levels import Landscape, level_curves, reaches
from vibro_cli.analysis.singular import (
    CENTRE,
    DEGENERATE,
    FIGURE_EIGHT,
    SADDLE,
    Portrait,
    changes,
    portrait_of,
    singular_points,
)
from vibro_cli.mechanics.potential import Pull, Turning
from vibro_cli.mechanics.trace import ArcShape, Piece
from vibro_cli.stress.scenes import system_of


def on_circle(rate: float, x: float = 1.0) -> Landscape:
    """Return a body in a valley of radius 1 m, whose centre is at x = 1 m."""
    return Landscape.of(system(-90.0, valley(1.0, 90), turning=Turning(x, rate)), 1)


def test_pitchfork_is_where_turning_balances_gravity() -> None:
    probe = on_circle(1.0)
    rho = probe.path_scale(probe.trace.pieces[0])
    centre = probe.trace.pieces[0].centre[0]
    rates = [1.0, 2.0, 3.0, 4.0]
    found = changes(lambda rate: portrait_of(on_circle(rate, centre)).type, rates)
    # At the pitchfork itself the point is degenerate, if a double is exactly there.
    assert 1 <= len(found) <= 2
    assert found[0].low ** 2 == pytest.approx(probe.gravity / rho, rel=1e-12)
    assert found[-1].high ** 2 == pytest.approx(probe.gravity / rho, rel=1e-12)
    assert found[0].before == "centre"
    assert found[-1].after == "centre, saddle, centre; figure eight"


@pytest.mark.parametrize("beyond", [10.0**-n for n in range(1, 16)])
def test_the_type_beyond_the_pitchfork_holds_up_to_it(beyond: float) -> None:
    """The ends of the trace are high above the saddle: the separatrix closes on both sides."""
    probe = on_circle(1.0)
    piece = probe.trace.pieces[0]
    rate = math.sqrt(probe.gravity / probe.path_scale(piece)) * (1.0 + beyond)
    portrait = portrait_of(on_circle(rate, piece.centre[0]))
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
    landscape = Landscape.of(system_of(scene), 1)
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
    landscape = Landscape.of(system_of(on_three_arcs(rate=1.7)), 1)
    places = [
        (piece, np.linspace(piece.angle_start, piece.angle_end, 4001))
        for piece in landscape.trace.pieces
    ]
    least = min(float(np.min(landscape.potential(*place))) for place in places)
    assert 0.0 <= least < 1e-4


def test_equilibria_are_found_once_for_all_junctions(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each junction sought those of both of its pieces again, half of a portrait's time."""
    equilibria, asked = Pull.equilibria, []

    def counted(pull: Pull) -> list[float]:
        asked.append(equilibria(pull))
        return asked[-1]

    monkeypatch.setattr(Pull, "equilibria", counted)
    landscape = Landscape.of(system_of(on_three_arcs(rate=1.7)), 1)
    points = portrait_of(landscape).points
    assert len(asked) == 2 * len(landscape.trace.pieces)  # for the lowest place, and relative to it
    h = 1e-5
    for point in points:  # gravity and the centrifugal force balance
        piece = landscape.trace.pieces[point.piece]
        before, after = landscape.potential(piece, point.position + np.array([-h, h]))
        assert abs(after - before) < 1e-11 * landscape.weight


@pytest.mark.parametrize("rate", [0.3, 1.7, 3.0, 9.0])
def test_a_body_with_more_than_the_top_of_a_piece_passes_it(rate: float) -> None:
    for scene in (on_three_arcs(rate=rate), on_lines()):
        landscape = Landscape.of(system_of(scene), 1)
        for piece, top in zip(landscape.trace.pieces, landscape.tops.tolist(), strict=True):
            places = np.linspace(piece.angle_start, piece.angle_end, 4001)
            assert float(np.max(landscape.potential(piece, places))) < top
            (reach,) = reaches(landscape, piece, math.nextafter(top, math.inf))
            assert reach.is_whole


@pytest.mark.parametrize("share", [0.02, 0.4, 0.9, 1.3])
def test_level_curves_have_their_energy(share: float) -> None:
    landscape = Landscape.of(system_of(on_three_arcs(rate=1.7)), 1)
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


# On the lines of a scene of 8 m, of a picometre's and of a planet's size.
@pytest.mark.parametrize("length", [0, -40, -20, 20, 40])
def test_bodies_turn_on_lines_of_any_size_where_their_energy_is_potential(length: int) -> None:
    landscape = Landscape.of(system_of(scaled(on_lines(), length, length // 2)), 1)
    lines = [piece for piece in landscape.trace.pieces if piece.is_line]
    highest = max(point.energy for point in singular_points(landscape))
    found = 0
    for energy in highest * np.array([0.1, 0.4, 0.7, 0.95]):
        for part in (part for piece in lines for part in reaches(landscape, piece, energy)):
            for place, turns in ((part.low, part.turns_low), (part.high, part.turns_high)):
                if turns:
                    potential = float(landscape.potential(part.piece, place))
                    assert potential == pytest.approx(energy, rel=1e-13)
                    found += 1
    assert found == 4


def test_several_figure_eights() -> None:
    # Above the pitchfork of the valleys and with the hump between them.
    circle = portrait_of(on_circle(4.0, on_circle(1.0).trace.pieces[0].centre[0]))
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


def in_pieces(cuts: tuple[float, ...], rate: float, x: float) -> Portrait:
    """A valley of radius 1 m from -80 to 80 degrees, cut at some angles (rad)."""
    ends = [*sorted(cuts), 80.0 * DEGREE]
    shapes = [ArcShape("valley", radius=1.0, end_slope=end) for end in ends]
    return portrait_of(Landscape.of(system(-80.0, *shapes, turning=Turning(x, rate)), 1))


MIDDLE = math.sin(80.0 * DEGREE)
PITCHFORK = math.sqrt(9.81 / 0.9)


@pytest.mark.parametrize("beside", [0.0, 1e-15, -1e-15, 1e-13, 1e-11, -1e-9, 1e-7])
@pytest.mark.parametrize(
    ("rate", "x"),
    [
        (1.0, MIDDLE),
        (PITCHFORK * (1.0 + 1e-12), MIDDLE),
        (3.7, MIDDLE),
        (1.0, MIDDLE - 0.05),
        (3.8, MIDDLE - 0.02),
    ],
)
def test_a_cut_changes_no_singular_point(rate: float, x: float, beside: float) -> None:
    whole = in_pieces((), rate, x)
    places = [point.position for point in whole.points]
    for cuts in ((0.3,), *((place + beside,) for place in places), tuple(places)):
        cut = in_pieces(cuts, rate, x)
        assert cut.type == whole.type
        for point, same in zip(cut.points, whole.points, strict=True):
            assert point.s == pytest.approx(same.s, abs=1e-11)
            assert point.energy == pytest.approx(same.energy, rel=1e-9, abs=1e-14)
        for trigger, same_one in zip(cut.triggers, whole.triggers, strict=True):
            assert trigger.margin_left == pytest.approx(same_one.margin_left, rel=1e-9)
            assert trigger.turning_right == pytest.approx(same_one.turning_right, rel=1e-7)


def closed_circle(rate: float, seam: float = -math.pi, cuts: tuple[float, ...] = ()) -> Portrait:
    """A closed circle of radius 1 m on its axis, with its seam at an angle (rad)."""
    ends = [*(seam + cut for cut in cuts), seam + math.tau]
    shapes = [ArcShape("valley", radius=1.0, end_slope=end) for end in ends]
    turning = Turning(-math.sin(seam) if abs(seam) < math.pi else 0.0, rate)
    circle = system(seam / DEGREE, *shapes, closed=True, turning=turning)
    return portrait_of(Landscape.of(circle, 1))


def test_pitchfork_of_a_closed_circle() -> None:
    found = changes(lambda rate: closed_circle(rate).type, [1.0, 2.0, 4.0])
    gravity, rho = 9.81, 1.0 - BALL.radius
    assert 1 <= len(found) <= 2
    assert found[0].low ** 2 == pytest.approx(gravity / rho, rel=1e-12)
    assert found[0].before == "saddle, centre"
    assert found[-1].after == "saddle, centre, saddle, centre; open, figure eight"
    for rate in (3.4, 4.0, 9.0):
        aside = math.acos(gravity / (rho * rate * rate))
        points = closed_circle(rate).points
        angles = [point.position for point in points]
        assert angles == pytest.approx([-math.pi, -aside, 0.0, aside], abs=1e-15)
        # V = m g rho (1 - cos f) - m Omega^2 rho^2 sin^2 f / 2, from its least value
        lift = 0.5 * rho * (rate * rate * rho * (1.0 - math.cos(aside)) ** 2)
        assert points[2].energy == pytest.approx(BALL.mass * lift, rel=1e-12)
        assert points[0].energy == pytest.approx(
            BALL.mass * (lift + 2.0 * gravity * rho), rel=1e-12
        )


@pytest.mark.parametrize("rate", [1.0, 4.0])
@pytest.mark.parametrize("seam", [0.0, 0.7, -0.7, "centre", -3.0])
@pytest.mark.parametrize("cuts", [(), (1.0, 3.0), (math.pi,)])
def test_the_seam_of_a_closed_circle_changes_no_singular_point(
    rate: float, seam: float | str, cuts: tuple[float, ...]
) -> None:
    whole = closed_circle(rate)
    start = whole.points[1].position if isinstance(seam, str) else seam
    moved = closed_circle(rate, start, cuts)
    near = 1e-9  # m, so that what is at the seam stays at the left
    order = sorted(whole.points, key=lambda point: (point.s - math.pi - start + near) % math.tau)
    assert [point.kind for point in moved.points] == [point.kind for point in order]
    for point, same in zip(moved.points, order, strict=True):
        assert point.s == pytest.approx((same.s - math.pi - start + near) % math.tau - near)
        assert point.energy == pytest.approx(same.energy, rel=1e-12, abs=1e-13)
    orbits = sorted(trigger.orbit for trigger in whole.triggers)
    assert sorted(trigger.orbit for trigger in moved.triggers) == orbits


def test_a_junction_without_pull_is_what_its_sides_make_it() -> None:
    """Two valleys meet at their bottoms, on the axis: each has its own pitchfork."""

    def kinds(rate: float, *right: ArcShape) -> list[str]:
        shapes = (valley(1.0, 0), *right)
        one = system(-80.0, *shapes, turning=Turning(MIDDLE, rate))
        return [point.kind for point in singular_points(Landscape.of(one, 1))]

    assert kinds(3.0, valley(0.5, 80)) == [CENTRE]
    assert kinds(4.0, valley(0.5, 80)) == [CENTRE, DEGENERATE]
    assert kinds(6.0, valley(0.5, 80)) == [CENTRE, SADDLE, CENTRE]
    # On a line the rotation always drives a body away.
    assert kinds(3.0, line(1.0)) == [DEGENERATE]
    assert kinds(4.0, line(1.0)) == [CENTRE, SADDLE]


def test_ends_without_pull_are_singular() -> None:
    circle = system(-180.0, valley(1.0, 180), turning=Turning(0.0, 2.0))
    points = singular_points(Landscape.of(circle, 1))
    assert [point.kind for point in points] == [SADDLE, CENTRE, SADDLE]
    assert points[2].s == pytest.approx(math.tau, rel=1e-15)
    half = system(-90.0, valley(1.0, 0), turning=Turning(1.0, 4.0))
    assert [point.kind for point in singular_points(Landscape.of(half, 1))] == [CENTRE, SADDLE]


@pytest.mark.parametrize("beside", [0.0, 1e-15, -3e-14, 1e-12, -1e-11, 1e-9])
@pytest.mark.parametrize("right", [valley(2.0, 60), hump(0.3, 0), hump(4.0, 0), line(1.5)])
@pytest.mark.parametrize("left", [valley(0.7, 35), hump(0.9, 35)])
@pytest.mark.parametrize("rate", [0.7, 2.0, 6.0])
def test_what_is_beside_a_junction_is_found_once(
    rate: float, left: ArcShape, right: ArcShape, beside: float
) -> None:
    """The axis is placed so that the forces balance at the junction, or next to it."""
    slope = 35.0 * DEGREE
    start = slope / DEGREE + (-60.0 if left.shape == "valley" else 60.0)
    first = system(start, left, right).trace.pieces[0]
    x = first.body_centre(first.angle_end, BALL.radius)[0]
    axis = Turning(x - 9.81 * math.tan(slope) / rate**2 + beside, rate)
    landscape = Landscape.of(system(start, left, right, turning=axis), 1)
    points = singular_points(landscape)
    at = [point for point in points if abs(point.s - first.length) < 1e-12]
    if beside == 0.0:
        assert len(at) == 1

    def pull(piece: Piece, position: float) -> float:
        away = piece.body_centre(position, BALL.radius)[0] - axis.x
        slope = piece.slope(position)
        return rate**2 / 9.81 * away * math.cos(slope) - math.sin(slope)

    # From the left a body is pulled to a centre, and away from a saddle; these alternate.
    last = landscape.trace.pieces[-1]
    signs = [pull(first, first.angle_start), pull(last, last.angle_end)]
    pulled = {CENTRE: (True, False), SADDLE: (False, True)}
    sides = [side for point in points for side in pulled.get(point.kind, ())]
    expected = [signs[0] > 0.0, *sides, signs[1] > 0.0]
    assert expected[::2] == expected[1::2]


def test_an_arc_of_almost_no_length_has_the_points_of_a_small_one() -> None:
    """The whole arc counts as an end of itself, but the same points are found."""

    def points(radius: float) -> list[tuple[str, float]]:
        shapes = valley(1.0, 50), hump(radius, -50), valley(1.0, 120)
        middle = 2.0 * math.sin(120.0 * DEGREE) + 0.2 * math.sin(50.0 * DEGREE)
        one = Landscape.of(system(-120.0, *shapes, turning=Turning(middle, 1.0)), 1)
        return [(point.kind, point.slope) for point in singular_points(one)]

    small = points(1e-9)
    assert [kind for kind, _ in small] == [CENTRE, SADDLE, CENTRE]
    for radius in (1e-15, 1e-20, 1e-30):
        found = points(radius)
        assert [kind for kind, _ in found] == [CENTRE, SADDLE, CENTRE]
        expected = [slope for _, slope in small]
        assert [slope for _, slope in found] == pytest.approx(expected, abs=1e-7)
