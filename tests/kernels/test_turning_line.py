"""Where a force that is linear along a rotating line falls through zero, against a dense scan."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

from vibro_cli.kernels.flow.rotating_flight import (
    next_zero_crossing_on_line,
    zero_crossing_on_line,
)
from vibro_cli.kernels.flow.rotating_flow import TURNING_LINE, flow, time_on_line
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.world import Flight

LONG = 30.0  # of the scan, in units of the time scale of the motion


def _flight(speed: float, acceleration: float, growth: float) -> Flight:
    flight = Flight()
    flight.form, flight.line_growth = TURNING_LINE, growth
    flight.flow_p, flight.line_acceleration, flight.saddle_root = speed, acceleration, NEVER
    return flight


def _fall(flight: Flight, force: float, growth: float) -> float:
    """Return when the force first falls below zero, by a scan refined in 40 digits."""
    v, a, b = flight.flow_p, flight.line_acceleration, flight.line_growth
    t = np.linspace(0.0, LONG / b, 40_001)
    way = v * np.sinh(b * t) / b + 2.0 * a * (np.sinh(0.5 * b * t) / b) ** 2
    found = force + growth * way
    falls = np.flatnonzero((found[:-1] >= 0.0) & (found[1:] < 0.0))
    if len(falls) == 0:
        return NEVER
    first = falls[0]
    if found[first] == 0.0:
        return float(t[first])

    def force_at(time: mpmath.mpf) -> mpmath.mpf:
        moved = v * mpmath.sinh(b * time) / b + a * (mpmath.cosh(b * time) - 1) / (b * b)
        return force + growth * moved

    with mpmath.workdps(40):
        ends = (mpmath.mpf(t[first]), mpmath.mpf(t[first + 1]))
        return float(mpmath.findroot(force_at, ends, solver="anderson"))


@pytest.mark.parametrize("seed", range(6))
def test_a_force_along_a_rotating_line_falls_when_a_scan_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    kinds = set()
    for _ in range(40):
        v, a, growth = rng.normal(size=3)
        flight = _flight(v * rng.integers(2), a, math.exp(0.5 * rng.normal()))
        force = rng.normal() * rng.choice([0.0, 0.01, 1.0])
        expected = _fall(flight, max(force, 0.0), growth)
        kinds.add("never" if expected == NEVER else "at once" if expected == 0.0 else "later")
        found = zero_crossing_on_line(flight, force, growth)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-12), (seed, force)
        again = next_zero_crossing_on_line(flight, force, growth)
        if force != 0.0:
            assert again == pytest.approx(_fall(flight, force, growth), rel=1e-9), (seed, force)
    assert kinds == {"never", "at once", "later"}


@pytest.mark.parametrize("root", [1e-7, -1e-9, 0.0])
@pytest.mark.parametrize("place", [-0.3, 1e-5])
def test_a_motion_beside_the_saddle_of_a_line_keeps_its_digits(root: float, place: float) -> None:
    """Its speed and what it loses to the saddle nearly cancel; compared in 40 digits."""
    with mpmath.workdps(40):
        growth = mpmath.mpf(1.7)
        lost = growth * place
        speed = -mpmath.sign(place) * mpmath.sqrt(lost**2 - mpmath.mpf(root) * abs(root))
        flight = _flight(float(speed), float(growth * lost), float(growth))
        flight.saddle_root = root
        for t in (1e-6, 3.0, 9.0):
            grown, back = (speed + lost) * mpmath.exp(growth * t), mpmath.exp(-growth * t)
            back *= speed - lost
            way, rate = (grown - back) / (2 * growth) - place, (grown + back) / 2
            found, _, found_rate = flow(flight, t)
            assert abs(found - way) <= 1e-15 * abs(way)
            assert abs(found_rate - rate) <= 1e-15 * (abs(grown) + abs(back))
            # At rest beside the saddle a rounding of the position takes long.
            lasts = 4e-16 * (abs(place) + abs(way)) / abs(rate)
            assert abs(time_on_line(flight, found, float(rate)) - t) <= 1e-14 + lasts
