"""Starts hard by a crest, down to 1e-300, over two valleys and back over the crest, in many digits.

All times are closed forms of mpmath's own integrals, fed with the doubles of the scenario.
"""

from __future__ import annotations

import math
from typing import Any

import pytest
from mpmath import MPContext

from vibro_cli.stress.scenes import GRAVITY, THREE_ARCS, Document, ball, scene, solve

mp: Any = MPContext()

EXPONENTS = [-1, -20, -100, -149, -151, -160, -200, -250, -299]
CROSSINGS = 6
HUMP, VALLEY, RADIUS, KAPPA = 0.5, 1.0, 0.1, 1.4


def frequency(path_radius: Any) -> Any:
    """Return the frequency of small oscillations (rad/s)."""
    return mp.sqrt(mp.mpf(GRAVITY) / (mp.mpf(KAPPA) * path_radius))


def half_way(start: Any, rate: Any, end: Any) -> Any:
    """``w t`` from sin(psi/2) = ``start`` with P = ``rate`` to sin(psi/2) = ``end`` on a hump.

    ``dx/sqrt((1 - x^2)(x^2 + P^2 - x0^2))``, one of x0 and P zero: Carlson's R_F with ``z = 1/x^2``
    (from the crest), or the integral of DLMF 19.29.4 (from rest).
    """
    if rate:
        z = (rate / end) ** 2
        return mp.elliprf(z, z - rate * rate, z + 1)
    span = mp.sqrt((end - start) * (end + start))
    one, two = mp.sqrt(1 - end * end), mp.sqrt(1 - start * start)
    return mp.elliprf((start * two / span) ** 2, (end * two / span) ** 2, (one * start / span) ** 2)


def crossings(angle: float, rate: float) -> list[Any]:
    """Return the instants of the first crossings of one body."""
    junction = mp.mpf(5) / 18 * mp.pi
    rho = mp.mpf(HUMP) + mp.mpf(RADIUS), mp.mpf(VALLEY) - mp.mpf(RADIUS)
    w, w_valley = frequency(rho[0]), frequency(rho[1])
    start, p, end = mp.sin(mp.mpf(angle) / 2), mp.mpf(rate) / (2 * w), mp.sin(junction / 2)
    down = half_way(start, p, end) / w
    # The speed at the junction, then up to where it turns in the valley and back.
    speed = 2 * w * rho[0] * mp.sqrt(end * end - start * start + p * p)
    m = end * end + (speed / (2 * w_valley * rho[1])) ** 2
    k = mp.ellipk(m) + mp.ellipf(mp.asin(end / mp.sqrt(m)), m)
    valley = 2 * k / w_valley
    times, t = [], down
    for number in range(CROSSINGS):
        times.append(t)
        t += 2 * down if number % 2 else valley
    return times


@pytest.mark.parametrize("moving", [False, True], ids=["at rest beside it", "moving on it"])
@pytest.mark.parametrize("exponent", EXPONENTS)
def test_across_the_pieces_and_back(exponent: int, moving: bool) -> None:
    off = 7.0 * 10.0**exponent / 10.0
    angle, rate = (0.0, off) if moving else (off, 0.0)
    mp.dps = 60 - 2 * exponent
    expected = crossings(angle, rate)
    one = ball(angle, arc=2, rate=rate)
    run = solve(scene(THREE_ARCS, [one], time=float(expected[-1]) + 0.1))
    crossing = run.events["event"] == "crossing"
    found = run.events["t"][crossing].tolist()
    assert len(found) == CROSSINGS
    for t, true in zip(found, expected, strict=True):
        assert abs(t - true) <= 1e-12 * true
    # On the separatrix it passes to the other side, beside it it returns.
    arcs = run.events["arc_to"][crossing].tolist()
    assert arcs == ([3, 2, 1, 2, 3, 2] if moving else [3, 2] * 3)


@pytest.mark.parametrize("engine", ["compiled", "python"])
@pytest.mark.parametrize("surface", ["two-sided", "one-sided"])
@pytest.mark.parametrize("angle", [0.0, -0.1, -0.25, -0.3])
def test_up_to_the_crest_for_ever_or_at_rest_on_it(angle: float, surface: str, engine: str) -> None:
    """On the separatrix sin(psi/2) = sech(w t + c); the body leaves neither kind of surface."""
    w = math.sqrt(GRAVITY / (KAPPA * (1.0 + RADIUS)))
    arcs = [{"shape": "hump", "radius": 1.0, "end_slope": -0.6}]
    trace: Document = {"start_slope": 0.6, "surface": surface, "arcs": arcs}
    one = ball(angle, rate=-2.0 * w * math.sin(angle / 2.0))
    summary = solve(scene(trace, [one], time=2.0), engine).summary_record()
    assert summary["end_cause"] == "time"
    after = 1.0 / math.cosh(w * 2.0 + math.acosh(-1.0 / math.sin(angle / 2.0))) if angle else 0.0
    assert abs(summary["angle_1"] + 2.0 * math.asin(after)) < 1e-13
    assert abs(summary["speed_1"] - (1.0 + RADIUS) * 2.0 * w * after) < 1e-12
