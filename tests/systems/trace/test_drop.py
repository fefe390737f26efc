"""Two equal balls dropped in one valley at k = 0.5: accumulation, then one pendulum, to the end."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from mpmath import mpf

from vibro_cli.stress.scenes import ball, scene, solve_any, valley
from vibro_cli.systems.run import Run

GRAVITY, VALLEY, RADIUS, K = 9.81, 1.0, 0.1, 0.5
STOP = 40.0
RHO = mpf(VALLEY) - mpf(RADIUS)
FREQUENCY = mpmath.sqrt(mpf(GRAVITY) / (mpf(7) / 5 * RHO))
HALF_BETA = mpmath.asin(mpf(RADIUS) / RHO)


def drop(left: float, right: float, engine: str) -> Run:
    document = scene(valley(120), [ball(left), ball(right)], K, "hedrih", time=STOP)
    return solve_any(document | {"output": {"turning_points": True}}, engine)


def contact_closed(run: Run) -> float:
    closed = np.flatnonzero(run.events["event"] == "contact_closed")
    assert len(closed) == 1
    return float(run.events["t"][closed[0]])


def time_up(rate: mpf) -> mpf:
    """Time from the angle of contact, left at this rate, up to the turning point."""
    modulus = mpmath.sin(HALF_BETA / 2) ** 2 + (rate / (2 * FREQUENCY)) ** 2
    reached = mpmath.asin(mpmath.sin(HALF_BETA / 2) / mpmath.sqrt(modulus))
    return (mpmath.ellipk(modulus) - mpmath.ellipf(reached, modulus)) / FREQUENCY


def test_time_of_accumulation_is_its_geometric_limit(engine: str) -> None:
    """From equal heights each ball bounces as if off a wall, at half the rate each time."""
    height = 1.1
    run = drop(-height, height, engine)
    with mpmath.workdps(50):
        rate = FREQUENCY * mpmath.sqrt(2 * (mpmath.cos(HALF_BETA) - mpmath.cos(mpf(height))))
        expected = time_up(rate) + mpmath.nsum(
            lambda n: 2 * time_up(rate * mpf(K) ** int(n)), [1, 160], method="direct"
        )
        assert abs(mpf(contact_closed(run)) - expected) <= 1e-10 * expected
    # The rows say the same: their intervals shrink as a geometric series.
    times = run.collisions["t"] + run.collisions["t_low"]
    last = float(times[-1] - times[-2])
    assert contact_closed(run) == pytest.approx(float(times[-1]) + last * K / (1.0 - K), rel=1e-10)


def test_the_pair_swings_as_one_pendulum_to_the_stop(engine: str) -> None:
    run = drop(-1.1, 0.3, engine)
    closed = contact_closed(run)
    assert run.end_cause == "time"
    assert run.summary_record()["end_time"] == STOP
    assert run.collisions["t"][-1] <= closed
    assert not np.any(run.events["event"] == "contact_opened")
    turned = (run.events["event"] == "turning") & (run.events["t"] > closed)
    left, right = ((turned & (run.events["ball"] == ball)) for ball in (1, 2))
    times, angles = run.events["t"][left], run.events["value"][left]
    assert len(times) > 20
    assert run.events["t"][right].tolist() == pytest.approx(times.tolist(), abs=1e-13 * STOP)
    with mpmath.workdps(50):
        # Its middle swings about the bottom, g reduced by cos(beta/2).
        frequency = FREQUENCY * mpmath.sqrt(mpmath.cos(HALF_BETA))
        swing = max(abs(mpf(float(angle)) + HALF_BETA) for angle in angles)
        period = 4 * mpmath.ellipk(mpmath.sin(swing / 2) ** 2) / frequency
        whole = (len(times) - 1) // 2
        measured = mpf(float(times[2 * whole])) - mpf(float(times[0]))
        assert abs(measured - whole * period) <= 1e-12 * whole * period
        for angle in angles:
            assert abs(abs(mpf(float(angle)) + HALF_BETA) - swing) <= 1e-13
