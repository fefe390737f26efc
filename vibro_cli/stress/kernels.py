"""The kernels of the checks of first contacts: the solver on many starts, and flights backwards."""

from __future__ import annotations

import math
from collections.abc import Sequence

from vibro_cli.compile.kernel import FloatMatrix, kernel, struct
from vibro_cli.kernels.events.event_loop import proceed
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.world import Flight, World


@struct
class Answer:
    """The first contact of two bodies that the solver finds."""

    horizon: float  # s: how long to look ahead; then how long it did, to the first end of a flight
    met: int  # 0 if there is none
    t: float  # s


ORDER = 18  # of the series of a flight
SINE, COSINE, RATE = range(3)  # its rows
_STEP = 0.15  # of a step in w t max(1, f'/w)


@kernel
def find_first_contacts(
    world: World, fresh: World, starts: Sequence[Flight], answers: Sequence[Answer]
) -> None:
    """Find the first contact of the two bodies from one start after another.

    Of ``fresh`` clock and pairs are taken, which know nothing of what was before.
    """
    settings = world.settings[0]
    for number in range(len(answers)):
        answer = answers[number]
        world.clock[0] = fresh.clock[0]  # type: ignore[index]
        for j in range(len(world.pairs)):
            world.pairs[j] = fresh.pairs[j]  # type: ignore[index]
        for ball in range(2):
            world.flights[ball] = starts[2 * number + ball]  # type: ignore[index]
        settings.stop_t = answer.horizon
        proceed(world, True)
        for ball in range(2):
            answer.horizon = min(answer.horizon, world.flights[ball].exit_t)
        settings.stop_t = answer.horizon
        if answer.horizon > 0.0:
            proceed(world, False)
        answer.met = world.clock[0].impact_rows
        answer.t = world.impacts[0].t if answer.met > 0 else NEVER


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
