"""The papers' series: the elliptic integral of a leg, with both roots expanded and truncated.

With c² = φ̇₀² + 4a sin²(φ₀/2), q² = 4a/c², u = sin(φ/2):
t = (2/c) Σ_{i,j} C_i C_j q^{2i} u^{2(i+j)+1}/(2(i+j)+1), C_n = (2n−1)!!/(2n)!!, for a leg between
turning points (A (8)–(9), B (58)–(61), its misprinted term corrected). The papers stop at i, j ≤ 2.
At a turning point qu = 1, the series of the root diverges, and that of the integral gains a digit
for each hundredfold of its terms. It is used as in the papers, including at turning points.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.optimize import brentq

from vibro_cli.analysis.paper_formulas import Swing
from vibro_cli.benchmark.measurement import SERIES
from vibro_cli.benchmark.methods.runner import (
    Course,
    Lost,
    Method,
    Motion,
    Runner,
    Setting,
)
from vibro_cli.benchmark.scenes import Scene

PAPERS_ORDER = 2
_ORDERS = (PAPERS_ORDER, 8, 32, 128)
_SAMPLES = 66


def coefficients(order: int) -> list[float]:
    """Return C_0 … C_order, the binomial coefficients of 1/√(1 − x)."""
    found = [1.0]
    for n in range(1, order + 1):
        found.append(found[-1] * (2 * n - 1) / (2 * n))
    return found


class Leg:
    """The motion of a body from one turning point to the next.

    `a` is w² of the equation of motion (1/s²), `order` the greatest i and j of the series, and
    `angle` (rad) and `rate` (rad/s) are the state at an instant `t` (s).
    """

    def __init__(self, a: float, order: int, t: float, angle: float, rate: float) -> None:
        swing = Swing(2.0 * a, angle, rate)
        self.amplitude, self.way = swing.amplitude, swing.way
        self._a, self._modulus, self._scale = a, swing.modulus, 2.0 / swing.scale
        self._terms = terms(swing.modulus**2, order)
        self._t = t - self.way * self._from_bottom(angle)
        self.start = angle
        self.t_end = self.time(self.way * self.amplitude)

    def _from_bottom(self, angle: float) -> float:
        """Return the time from the bottom to an angle by the series (s), an odd function."""
        u = math.sin(0.5 * angle)
        x = min(1.0, (self._modulus * u) ** 2)
        total = 0.0
        for term in reversed(self._terms):
            total = total * x + term
        return self._scale * u * total

    def time(self, angle: float) -> float:
        """Return the instant at which the body is at an angle of this leg (s)."""
        return self._t + self.way * self._from_bottom(angle)

    def rate(self, angle: float) -> float:
        """Return the rate at an angle of this leg: exact, from the energy."""
        squares = math.sin(0.5 * self.amplitude) ** 2 - math.sin(0.5 * angle) ** 2
        return self.way * 2.0 * math.sqrt(self._a * max(squares, 0.0))


def terms(q2: float, order: int) -> list[float]:
    """Return the double sum collected by k = i + j, as coefficients of (qu)^{2k}.

    Powers of qu are used instead of u, because powers of q² overflow for a small swing.
    """
    each: Any = np.array(coefficients(order))
    together: Any = np.convolve(each, each * q2 ** -np.arange(order + 1.0))
    found: list[float] = (together / (2.0 * np.arange(2 * order + 1) + 1.0)).tolist()
    return found


class _SeriesRunner(Runner):
    """Two bodies that swing in one valley, leg by leg, by series of a given order."""

    def __init__(self, motion: Motion, order: int) -> None:
        self._motion, self._order = motion, order
        self._beta = motion.least_angle(0, 0)
        self._a = [motion.w2[ball][0] for ball in (0, 1)]
        self.ready(0)

    def ready(self, impacts: int) -> None:
        self._wanted = impacts
        self._times: list[float] = []
        self._y = list(self._motion.start)
        self._begin(0.0)

    def _begin(self, t: float) -> None:
        self._legs = [
            Leg(self._a[ball], self._order, t, self._y[2 * ball], self._y[2 * ball + 1])
            for ball in (0, 1)
        ]

    def go(self) -> None:
        """Integrate from impact to impact; raise Lost if the legs no longer fit together."""
        turns = 0
        while len(self._times) < self._wanted:
            met = self._meeting()
            if met is not None:
                self._impact(met)
                turns = 0
                continue
            turns += 1
            if turns > 64:
                raise Lost("no impact on 64 legs")
            ball = 0 if self._legs[0].t_end <= self._legs[1].t_end else 1
            leg = self._legs[ball]
            angle = leg.way * leg.amplitude
            turned = Leg(self._a[ball], self._order, leg.t_end, angle, 0.0)
            self._legs[ball] = turned

    def _impact(self, angle: float) -> None:
        """Apply an impact with body a at an angle."""
        a, b = self._legs
        self._y = [angle, a.rate(angle), angle + self._beta, b.rate(angle + self._beta)]
        t = a.time(angle)
        if not self._motion.hit(0, (0, 0), self._y):
            raise Lost(f"bodies in contact that part at t = {t:.6g} s")
        self._times.append(t)
        self._begin(t)

    def _meeting(self) -> float | None:
        """Return the angle of body a at which both bodies are in contact, or None."""
        a, b = self._legs
        ends = sorted((a.start, a.way * a.amplitude))
        others = sorted((b.start - self._beta, b.way * b.amplitude - self._beta))
        low, high = max(ends[0], others[0]), min(ends[1], others[1])
        if low >= high or a.way < b.way:
            return None

        def lag(angle: float) -> float:
            return a.time(angle) - b.time(angle + self._beta)

        count = 2 if a.way != b.way else _SAMPLES  # lag is monotonic if they approach head-on
        places = np.linspace(low, high, count) if a.way > 0.0 else np.linspace(high, low, count)
        # Sign of the lag before contact: b comes towards a, or the body behind is still later.
        sign = -1.0 if a.way != b.way else a.way
        values = [sign * lag(float(place)) for place in places]
        for number in range(count - 1):
            if values[number] > 0.0 > values[number + 1]:
                root: float = brentq(lag, places[number], places[number + 1], xtol=1e-15)
                return root
        return None

    def course(self) -> Course:
        return self._motion.course(self._times, None, (0, 0), self._y)


def methods() -> list[Method]:
    """Return the series at the papers' order and at higher ones."""
    settings = tuple(Setting(f"order {order}", float(order)) for order in _ORDERS)

    def suits(scene: Scene) -> bool:
        trace = scene.system.trace
        return len(trace.pieces) == 1 and not trace.closed and len(scene.system.bodies) == 2

    def prepare(scene: Scene, setting: Setting) -> Runner:
        return _SeriesRunner(Motion(scene.system), int(setting.value))

    return [Method(SERIES, settings, prepare, 60, suits)]
