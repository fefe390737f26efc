"""The same flights given to an integrator with sign-change events: SciPy's DOP853."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibro_cli.stress.judge import (
    BODY_A,
    BODY_B,
    GRAVITY,
    HORIZON,
    KAPPA,
    PLACE,
    RADIUS,
    SIDE,
    SIGN,
    SIZE,
    SLOPE,
    SPEED,
)  # fmt: skip

TOLERANCES = (1.0e-9, 1.0e-12)


def first_event(flight: Any, tolerance: float) -> float | None:
    """Instant (s) at which ``solve_ivp`` finds the gap to close, None if it finds no such.

    ``flight`` is a row for the judge; DOP853 with ``rtol = tolerance`` and a hundredth of it as
    ``atol``, an event function for the gap, terminal and falling: as a user writes it.
    """
    from scipy.integrate import solve_ivp

    bodies = (BODY_A, BODY_B)
    touch = flight[BODY_A + RADIUS] + flight[BODY_B + RADIUS]

    def rate(t: float, y: Any) -> list[float]:
        return [*_motion(flight, BODY_A, y[0], y[1]), *_motion(flight, BODY_B, y[2], y[3])]

    def gap(t: float, y: Any) -> float:
        ax, ay = _centre(flight, BODY_A, y[0])
        bx, by = _centre(flight, BODY_B, y[2])
        return math.hypot(bx - ax, by - ay) - float(touch)

    gap.terminal, gap.direction = True, -1.0  # type: ignore[attr-defined]
    start = [value for body in bodies for value in _start(flight, body)]
    solution = solve_ivp(
        rate, (0.0, flight[HORIZON]), start, method="DOP853", rtol=tolerance,
        atol=0.01 * tolerance, events=gap,
    )  # fmt: skip
    found = np.asarray(solution.t_events[0])
    return float(found[0]) if len(found) else None


def _path_radius(flight: Any, body: int) -> float:
    return float(flight[body + SIZE] - flight[body + SIGN] * flight[body + RADIUS])


def _start(flight: Any, body: int) -> tuple[float, float]:
    scale = 1.0 if flight[body + SIGN] == 0.0 else _path_radius(flight, body)
    return float(flight[body + PLACE]), float(flight[body + SPEED] / scale)


def _motion(flight: Any, body: int, place: float, rate: float) -> tuple[float, float]:
    pull = -flight[GRAVITY] / flight[body + KAPPA]
    if flight[body + SIGN] == 0.0:
        return rate, pull * math.sin(flight[SLOPE])
    return rate, flight[body + SIGN] * pull / _path_radius(flight, body) * math.sin(place)


def _centre(flight: Any, body: int, place: float) -> tuple[float, float]:
    """Centre of a body, from the junction of the two pieces (or the centre of the one arc)."""
    sine, cosine = math.sin(flight[SLOPE]), math.cos(flight[SLOPE])
    sign, radius = flight[body + SIGN], flight[body + RADIUS]
    if sign == 0.0:
        along = place - (flight[body + SIZE] if flight[body + SIDE] < 0.0 else 0.0)
        return along * cosine - radius * sine, along * sine + radius * cosine
    rho = _path_radius(flight, body)
    x, y = rho * math.sin(place), -sign * rho * math.cos(place)
    if flight[body + SIDE] != 0.0:
        x, y = x - sign * flight[body + SIZE] * sine, y + sign * flight[body + SIZE] * cosine
    return x, y
