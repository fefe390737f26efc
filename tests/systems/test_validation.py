"""Tables and springs against closed forms, as docs/validation.md lists them."""

from __future__ import annotations

import math
from typing import Any

import mpmath as mp
import numpy as np
import pytest

from vibro_cli.numerics.elementwise import Floats
from vibro_cli.stress.scenes import Document, solve_any

LONG, SHORT = 2.0, 1.0
"""Semi-axes of an ellipse (m)."""


def _rotation(caustic: Any) -> Any:
    """Return the turns for each bounce of paths tangent to the ellipse a^2 - c, b^2 - c.

    It is F(x, k)/2K(k) with sin x = sqrt(c)/b, k^2 = (a^2 - b^2)/(a^2 - c).
    """
    m = (LONG**2 - SHORT**2) / (LONG**2 - caustic)
    return mp.ellipf(mp.asin(mp.sqrt(caustic) / SHORT), m) / (2 * mp.ellipk(m))


def _tangent_to(caustic: float, place: float, bounces: int) -> Document:
    """Return a particle in an elliptic wall, on a tangent of an ellipse with the same foci."""
    long, short = math.sqrt(LONG**2 - caustic), math.sqrt(SHORT**2 - caustic)
    x, y = long * math.cos(place), short * math.sin(place)
    direction = math.atan2(short * math.cos(place), -long * math.sin(place))
    particle = {"body": "particle", "radius": 0.0, "mass": 1.0, "x": x, "y": y}
    wall = {"shape": "ellipse", "semi_axis_x": LONG, "semi_axis_y": SHORT, "k": 1.0}
    return {
        "system": "table",
        "wall": wall,
        "balls": [{**particle, "speed": 1.0, "direction": direction}],
        "stop": {"bounces": bounces},
    }


@pytest.mark.parametrize(("turns", "bounces"), [(1, 3), (1, 4), (1, 5), (2, 5), (1, 12)])
def test_paths_with_the_same_caustic_close_together(turns: int, bounces: int) -> None:
    """Poncelet: all of them close if one does, and they have the same length."""
    share = mp.mpf(turns) / bounces
    ends = mp.mpf("1e-4"), mp.mpf("0.9999999")
    caustic = float(mp.findroot(lambda c: _rotation(c) - share, ends, solver="bisect"))
    lengths = []
    for place in (0.3, 1.0, 2.2, 4.0):
        impacts = solve_any(_tangent_to(caustic, place, bounces + 1)).bounces
        x, y, t = impacts["x"], impacts["y"], impacts["t"]
        away = np.hypot(x - x[0], y - y[0])
        assert away[-1] < 1e-11 < np.min(away[1:-1])
        lengths.append(t[-1] - t[0])
    np.testing.assert_allclose(lengths, lengths[0], rtol=1e-12)
    if bounces == 4:
        assert lengths[0] == pytest.approx(4.0 * math.hypot(LONG, SHORT), rel=1e-12)


@pytest.mark.parametrize("caustic", [0.1, 0.37, 0.8, 0.9])
def test_the_winding_number_of_an_ellipse_is_that_of_elliptic_integrals(caustic: float) -> None:
    """It is a mean with weights that vanish smoothly at both ends, which converges very fast."""
    count = 1500
    impacts = solve_any(_tangent_to(caustic, 0.3, count + 1)).bounces
    angle = np.unwrap(np.arctan2(impacts["y"] / SHORT, impacts["x"] / LONG))
    place = np.arange(1, count + 1) / (count + 1)
    weights = np.exp(-1.0 / (place * (1.0 - place)))
    found = float(weights @ np.diff(angle) / np.sum(weights)) / (2.0 * math.pi)
    assert found == pytest.approx(float(_rotation(caustic)), abs=1e-11)


WIDTH, DEPTH, RADIUS = 2.0, 1.3, 0.2
INNER = np.array([WIDTH, DEPTH]) / 2.0 - RADIUS
"""Greatest coordinates (m) of the centre of a disk in a rectangle."""


def _velocities(seed: int) -> Floats:
    """Return the four velocity components of two disks with a total kinetic energy of 1 J."""
    drawn = np.random.default_rng(seed).normal(size=4)
    return math.sqrt(2.0) * drawn / np.linalg.norm(drawn)


STARTS = np.array([-0.5, 0.1, 0.5, -0.1])


def _two_disks(seed: int, impacts: int) -> Document:
    numbers = zip(STARTS.reshape(2, 2), _velocities(seed).reshape(2, 2), strict=True)
    disk = {"body": "particle", "radius": RADIUS, "mass": 1.0}
    return {
        "system": "table",
        "wall": {"shape": "rectangle", "width": WIDTH, "depth": DEPTH, "k": 1.0},
        "balls": [
            {**disk, "x": x, "y": y, "velocity_x": u, "velocity_y": v} for (x, y), (u, v) in numbers
        ],
        "collision": {"law": "translational", "k": 1.0},
        "stop": {"collisions": impacts},
    }


def _rates() -> tuple[float, float]:
    """Return the mean rates (1/s) of impacts of two disks, and on the wall, for total speed sqrt 2.

    Of a billiard in a space of d dimensions the share A of its boundary is met at the rate
    V A |B^(d-1)|/(Q |S^(d-1)|), Q its volume (Santalo; Chernov, J. Stat. Phys. 88 (1997) 1). For
    two disks d = 4, and |B^3|/|S^3| = 2/(3 pi).
    """
    w, h = 2.0 * INNER
    reach = 2.0 * RADIUS
    volume = (w * h) ** 2
    volume -= math.pi * reach**2 * w * h - (w + h) * 4.0 * reach**3 / 3.0 + reach**4 / 2.0
    pair = math.sqrt(2.0) * reach * (2.0 * math.pi * w * h - 4.0 * reach * (w + h) + 2.0 * reach**2)
    # Each side, times the area left for the other disk while one is there.
    area, taken = w * h, 0.5 * math.pi * reach**2
    sides = sum(side * area - (side * taken - 2.0 * reach**3 / 3.0) for side in (w, h))
    unit = math.sqrt(2.0) * 2.0 / (3.0 * math.pi) / volume
    return unit * pair, unit * 4.0 * sides


def test_two_disks_in_a_rectangle_collide_as_often_as_their_phase_space_says() -> None:
    runs = [solve_any(_two_disks(seed, 40_000)).summary_record() for seed in range(4)]
    found = [[run[name] / run["end_time"] for name in ("collisions", "bounces")] for run in runs]
    errors = np.std(found, axis=0, ddof=1) / math.sqrt(len(found))
    assert np.all(errors < 0.01 * np.mean(found, axis=0))
    assert np.all(np.abs(np.mean(found, axis=0) - _rates()) < 4.0 * errors)


STIFFNESS, TOUCH = 10.0, 0.1
"""Stiffness for each mass (1/s^2), and distance of two particles that touch (m)."""


def _on_linear_springs(k: float, apart: float, mass: float) -> Document:
    """Return two particles on springs of no length, whose force is linear, of equal rates.

    `apart` is the distance of the feet of the springs.
    """
    spring = {"length": 1e-30, "height": 1.0}
    bodies = [(0.0, 1.0, -0.3, 1.1), (apart, mass, apart + 0.35, -0.2)]
    return {
        "system": "springs",
        "balls": [
            {
                "body": "particle",
                "radius": 0.5 * TOUCH,
                "mass": m,
                "position": x,
                "speed": v,
                "spring": {**spring, "foot": foot, "stiffness": STIFFNESS * m},
            }
            for foot, m, x, v in bodies
        ],
        "collision": {"law": "translational", "k": k},
        "stop": {"collisions": 60},
    }


@pytest.mark.parametrize("mass", [1.0, 3.0])
@pytest.mark.parametrize("k", [1.0, 0.9])
@pytest.mark.parametrize("apart", [0.0625, 0.1, 0.25, 0.5])
def test_the_impacts_of_two_linear_oscillators_are_those_in_closed_form(
    apart: float, k: float, mass: float
) -> None:
    """The distance oscillates by itself about that of the feet; each impact leaves k of its speed.

    From a speed u at contact it is back after 2 acos(c/A)/w, w A = sqrt(w^2 c^2 + u^2), where c is
    the distance at contact less that of the feet: after pi/w if c = 0, ever sooner if the springs
    press the bodies together, and ever nearer to 2 pi/w if they hold them apart.
    """
    run = solve_any(_on_linear_springs(k, apart, mass))
    with mp.workdps(30):
        rate, c = mp.sqrt(STIFFNESS), mp.mpf(TOUCH) - mp.mpf(apart)
        place, speed = (
            mp.mpf(apart + 0.35) - mp.mpf(apart) + mp.mpf(0.3),
            mp.mpf(-0.2) - mp.mpf(1.1),
        )
        size = mp.hypot(place, speed / rate)
        t = (mp.acos(c / size) - mp.atan2(-speed / rate, place)) / rate
        expected, u = [t], rate * mp.sqrt(size**2 - c**2)
        for _ in range(59):
            u *= k
            t += 2 * mp.acos(c / mp.hypot(c, u / rate)) / rate
            expected.append(t)
    assert len(run.collisions["t"]) == 60
    np.testing.assert_allclose(run.collisions["t"], np.array(expected, dtype=float), rtol=1e-13)
    speeds = run.collisions["approach_speed"]
    np.testing.assert_allclose(speeds[1:], k * speeds[:-1], rtol=1e-7)
