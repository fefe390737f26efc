"""Singular points against values derived by hand from model §7."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from tests.analysis.traces import (
    BALL,
    DEGREE,
    circle,
    hump,
    landscape,
    line,
    three_arcs,
    valley,
)
from tests.bare_system import GRAVITY
from vibro_cli.analysis.singular import CENTRE, DEGENERATE, SADDLE, singular_points

WEIGHT = BALL.mass * GRAVITY


def test_three_arcs_have_two_centres_and_a_saddle_between() -> None:
    left, saddle, right = singular_points(three_arcs())
    assert [point.kind for point in (left, saddle, right)] == [CENTRE, SADDLE, CENTRE]
    assert [point.piece for point in (left, saddle, right)] == [0, 1, 2]
    assert [point.position for point in (left, saddle, right)] == [0.0, 0.0, 0.0]
    assert [point.slope for point in (left, saddle, right)] == [0.0, 0.0, 0.0]
    # arc lengths from the left end: R 120°, R 170° + R₀ 50°, R 170° + R₀ 100° + R 50°
    assert left.s == pytest.approx(120 * DEGREE, rel=1e-15)
    assert saddle.s == pytest.approx((170 + 0.5 * 50) * DEGREE, rel=1e-15)
    assert right.s == pytest.approx((170 + 0.5 * 100 + 50) * DEGREE, rel=1e-15)
    # the crest is (R + R₀)(1 − cos J) above the bottoms, for a ball of any radius
    assert left.energy == pytest.approx(0.0, abs=1e-15 * WEIGHT)
    assert right.energy == pytest.approx(0.0, abs=4e-15 * WEIGHT)
    assert saddle.energy == pytest.approx(WEIGHT * 1.5 * (1 - math.cos(50 * DEGREE)), rel=1e-14)


def test_saddle_energy_does_not_depend_on_radius_or_inertia() -> None:
    particle = replace(BALL, kind="particle", radius=0.0, inertia_ratio=0.0)
    one, other = (singular_points(three_arcs(body=body))[1].energy for body in (BALL, particle))
    assert one == pytest.approx(other, rel=1e-14)


def test_closed_circle_has_its_saddle_once_at_the_seam() -> None:
    saddle, centre = singular_points(circle())
    assert (saddle.kind, saddle.s, saddle.position) == (SADDLE, 0.0, -math.pi)
    assert (centre.kind, centre.position) == (CENTRE, 0.0)
    assert saddle.energy == pytest.approx(WEIGHT * 2 * 0.9, rel=1e-15)


def test_open_circle_has_a_saddle_at_either_end() -> None:
    points = singular_points(landscape(-180.0, valley(1.0, 180)))
    assert [point.kind for point in points] == [SADDLE, CENTRE, SADDLE]
    assert points[2].s == pytest.approx(2 * math.pi, rel=1e-15)


def test_underside_of_a_hump_is_a_centre() -> None:
    """A hump turned from slope −90° to −270°: its underside, at ψ = 180°, is stable."""
    (point,) = singular_points(landscape(-90.0, hump(1.0, -270)))
    assert (point.kind, point.position) == (CENTRE, math.pi)
    assert point.energy == 0.0


def test_top_of_a_loop_within_an_arc_is_a_saddle() -> None:
    points = singular_points(landscape(-60.0, valley(1.0, 260)))
    assert [(point.kind, point.position) for point in points] == [(CENTRE, 0.0), (SADDLE, math.pi)]
    assert points[1].energy == pytest.approx(WEIGHT * 2 * 0.9, rel=1e-15)


def test_level_line_is_degenerate_as_a_whole() -> None:
    (point,) = singular_points(landscape(-60.0, valley(1.0, 0), line(2.0), valley(1.0, 60)))
    assert (point.kind, point.piece, point.position, point.extent) == (DEGENERATE, 1, 0.0, 2.0)
    assert point.energy == pytest.approx(0.0, abs=1e-15 * WEIGHT)


def test_sloping_line_has_no_singular_point() -> None:
    assert singular_points(landscape(-30.0, line(2.0))) == ()


@pytest.mark.parametrize(
    ("start", "shapes", "kind"),
    [
        (-60.0, (valley(1.0, 0), valley(0.5, 60)), CENTRE),
        (60.0, (hump(1.0, 0), hump(0.5, -60)), SADDLE),
        (-60.0, (valley(1.0, 0), hump(0.5, -60)), DEGENERATE),
        (60.0, (hump(1.0, 0), valley(0.5, 60)), DEGENERATE),
    ],
)
def test_level_junction_is_what_its_sides_make_it(
    start: float, shapes: tuple[object, object], kind: str
) -> None:
    (point,) = singular_points(landscape(start, *shapes))  # type: ignore[arg-type]
    assert point.kind == kind
    assert point.s == pytest.approx(60 * DEGREE, rel=1e-15)
