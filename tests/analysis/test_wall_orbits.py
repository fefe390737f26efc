"""Singular points of the bounces inside an ellipse, against the solver's own bounces."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.systems.table_cases import ellipse, solve, table
from vibro_cli.systems.table.portrait import focal_product, multiplier, two_bounce_orbits
from vibro_cli.systems.table.system import Wall


def bounced(a: float, b: float, radius: float, angle: float, share: float) -> tuple[float, float]:
    """Return the bounce after one near the end of the x axis: normal direction and component."""
    nx, ny = math.cos(angle), math.sin(angle)
    height = math.hypot(a * nx, b * ny)
    inward = math.sqrt(1.0 - share * share)
    body = {"body": "particle"} if radius == 0.0 else {}
    ball = {
        "x": (a * a / height - radius) * nx * (1 - 1e-15),
        "y": (b * b / height - radius) * ny * (1 - 1e-15),
        "velocity_x": -share * ny - inward * nx, "velocity_y": share * nx - inward * ny,
        "radius": radius, "mass": 1.0, **body,
    }  # fmt: skip
    rows = solve(table([ball], ellipse(a, b), bounces=1)).bounces
    return float(rows["normal_angle"][0]), float(rows["tangential_speed"][0])


@pytest.mark.parametrize("radius", [0.0, 0.05, 0.3])
@pytest.mark.parametrize(("a", "b"), [(1.5, 1.0), (1.0, 1.5), (2.0, 1.9)])
def test_the_trace_of_a_bounce_on_the_x_axis(a: float, b: float, radius: float) -> None:
    wall = Wall("ellipse", True, 1.0, semi_axes=(a, b))
    orbit = two_bounce_orbits(wall, radius)[0]
    h = 1e-5
    columns = []
    for angle, share in ((h, 0.0), (0.0, h)):
        ends = [bounced(a, b, radius, sign * angle, sign * share) for sign in (1.0, -1.0)]
        turned = [((f - math.pi) % math.tau + math.pi) % math.tau - math.pi for f, _ in ends]
        columns.append([(turned[0] - turned[1]) / (2 * h), (ends[0][1] - ends[1][1]) / (2 * h)])
    trace = columns[0][0] + columns[1][1]
    assert abs(abs(trace) - abs(orbit.trace)) <= 1e-6 * max(abs(orbit.trace), 1.0)
    assert orbit.kind == ("saddle" if abs(trace) > 2.0 else "centre")


def test_at_r_0_a_saddle_grows_by_its_eccentricity() -> None:
    saddle, centre = two_bounce_orbits(Wall("ellipse", True, 1.0, semi_axes=(1.5, 1.0)), 0.0)
    e = math.sqrt(1.0 - 1.0 / 2.25)
    assert multiplier(saddle) == pytest.approx((1.0 + e) / (1.0 - e), rel=1e-14)
    assert multiplier(centre) is None


def test_the_focal_product_is_kept_by_the_bounces() -> None:
    wall = Wall("ellipse", True, 1.0, semi_axes=(1.5, 1.0))
    ball = {"x": 0.3, "y": 0.1, "velocity_x": 0.6, "velocity_y": 0.8, "radius": 0.0, "mass": 1.0}
    rows = solve(table([{**ball, "body": "particle"}], ellipse(1.5, 1.0), bounces=300)).bounces
    product = focal_product(wall, rows["normal_angle"], rows["tangential_speed"])
    assert np.max(np.abs(product - product[0])) <= 1e-13


def test_on_a_circle_all_diameters_are_alike() -> None:
    orbits = two_bounce_orbits(Wall("circle", True, 1.0, semi_axes=(1.3, 1.3)), 0.2)
    assert {orbit.kind for orbit in orbits} == {"degenerate"}
    assert [orbit.trace for orbit in orbits] == [2.0, 2.0]
