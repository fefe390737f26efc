"""The kernels of the checks of first contacts: the solver on many starts, and flights backwards."""

from __future__ import annotations

import math
from collections.abc import Sequence

from vibro_cli.compile.kernel import FloatMatrix, kernel
from vibro_cli.kernels.events.event_loop import proceed
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.world import World

# Columns of a start: piece, S, C, P of each body, and the longest time to look ahead.
START_COLUMNS = 9
# Columns of an answer: contact (1) or none (0), its instant in two doubles, the horizon looked to,
# and whether the solver called it grazing.
MET, T, T_LOW, HORIZON, GRAZING = range(5)
ANSWER_COLUMNS = 5

ORDER = 18  # of the series of a flight
SINE, COSINE, RATE = range(3)  # its rows
_STEP = 0.15  # of a step in w t max(1, f'/w)


@kernel
def _reset(world: World, fresh: World, starts: FloatMatrix, number: int) -> None:
    """Two bodies at the start of a flight, nothing known of it."""
    world.clock[0] = fresh.clock[0]  # type: ignore[index]
    for j in range(len(world.pairs)):
        world.pairs[j] = fresh.pairs[j]  # type: ignore[index]
    for ball in range(2):
        world.flights[ball] = fresh.flights[ball]  # type: ignore[index]
        world.flights[ball].piece = int(starts[number, 4 * ball])
        world.flights[ball].s = starts[number, 4 * ball + 1]
        world.flights[ball].c = starts[number, 4 * ball + 2]
        world.flights[ball].p = starts[number, 4 * ball + 3]


@kernel
def find_first_contacts(
    world: World, fresh: World, starts: FloatMatrix, answers: FloatMatrix
) -> None:
    """Fill in the first contact of each start (see :func:`first_contacts`)."""
    settings = world.settings[0]
    for number in range(len(starts)):
        _reset(world, fresh, starts, number)
        settings.stop_t = starts[number, 8]
        proceed(world, True)
        horizon = starts[number, 8]
        for ball in range(2):
            horizon = min(horizon, world.flights[ball].exit_t)
        settings.stop_t = horizon
        answers[number, HORIZON] = horizon
        if horizon > 0.0:
            proceed(world, False)
        met = world.clock[0].impact_rows > 0
        answers[number, MET] = 1.0 if met else 0.0
        answers[number, T] = world.impacts[0].t if met else NEVER
        answers[number, T_LOW] = world.impacts[0].t_low if met else 0.0
        answers[number, GRAZING] = float(world.impacts[0].grazing) if met else 0.0


@kernel
def follow(
    sign: float, w: float, angle: float, rate: float, t: float, series: FloatMatrix
) -> tuple[float, float]:
    """Return angle and rate of ``f'' = -sign w^2 sin f`` after a time t."""
    v = rate / w
    steps = math.ceil(abs(w * t) * (2.0 + abs(v)) / _STEP) + 1
    h = w * t / steps
    f = angle
    for _ in range(steps):
        series[SINE, 0], series[COSINE, 0], series[RATE, 0] = math.sin(f), math.cos(f), v
        power, moved, gained = h, 0.0, 0.0
        for k in range(ORDER):
            moved += series[RATE, k] * power / (k + 1.0)
            along, against = 0.0, 0.0
            for j in range(k + 1):
                along += series[COSINE, j] * series[RATE, k - j]
                against += series[SINE, j] * series[RATE, k - j]
            series[SINE, k + 1] = along / (k + 1.0)
            series[COSINE, k + 1] = -against / (k + 1.0)
            series[RATE, k + 1] = -sign * series[SINE, k] / (k + 1.0)
            gained += series[RATE, k + 1] * power
            power *= h
        f += moved
        v += gained
    return f, v * w


@kernel
def follow_all(
    sign: float,
    w: float,
    angles: list[float],
    rates: list[float],
    times: Sequence[float],
    series: FloatMatrix,
) -> None:
    """Follow many flights, in place; ``series`` is room to work with."""
    for number in range(len(angles)):
        angles[number], rates[number] = follow(
            sign, w, angles[number], rates[number], times[number], series
        )
