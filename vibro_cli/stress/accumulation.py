"""Accumulating impacts: when they end, against a continuation in 50 digits; and what follows."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibro_cli.stress.fifty_digits import multiprecision
from vibro_cli.stress.finding import Document, Finding, Plan, Worst
from vibro_cli.stress.scenes import VALLEY, ball, scene, solve

CHECK = "accumulation"
SHORT = (0.0, 0.05, 0.3, 0.5, 0.8)
LONG = (*SHORT, 1.0e-300, 0.1, 0.2, 0.4, 0.6, 0.7, 0.85, 0.9, 0.95, 0.97, 0.98, 0.99)
STEP = 0.1  # s
LEFT_OUT = 32.0  # decimal digits that a Taylor step keeps
SINGULARITY = 0.45  # s: in the complex plane nearest to any instant of these motions
ENOUGH = 1.0e-9  # s: impacts closer than this follow as a geometric series, to their square
NOTHING = 1.0e-20  # a coefficient of restitution that lengthens no time that counts
SLOW = 0.95  # thousands of impacts from here on: fewer cases


def check(plan: Plan) -> list[Finding]:
    """Time of accumulation of a pair in a valley; lasting contact and the end of the run."""
    rng = np.random.default_rng([plan.seed, 17])
    mp = multiprecision()
    off, ended = Worst(), Worst()
    for k in LONG if plan.full else SHORT:
        for _ in range(2 if k >= SLOW else plan.amount(2, 4)):
            balls = [ball(float(rng.uniform(-1.2, -0.3))), ball(float(rng.uniform(0.3, 1.2)))]
            balls[0]["mass"] = float(rng.uniform(0.3, 3.0))
            document = scene(VALLEY, balls, k, time=4000.0 if k > 0.9 else 400.0)
            run = solve(document)
            closed = run.events["event"] == "contact_closed"
            found = float(run.events["t"][closed][0]) if closed.any() else float("nan")
            exact = _accumulation(mp, document, k)
            off.take(float(abs(found - exact) / exact), document)
            ended.take(float(run.end_cause != "time"), document)
    tried = "two balls in a valley, k = 0, 1e-300 ... 0.99" if plan.full else "k = 0 ... 0.8"
    return [
        off.finding(
            CHECK,
            "relative error of the time of accumulation",
            f"{tried}, against 50 digits",
            1e-10,
        ),
        ended.finding(CHECK, "runs that do not go on to their stop", tried, 0.0),
    ]


class _Pendulum:
    """One ball between impacts: its angle as a Taylor series about the last instant."""

    def __init__(self, mp: Any, angle: Any, rate: Any, w2: Any) -> None:
        self.mp, self.w2 = mp, w2
        self.angle, self.rate = angle, rate

    def series(self, terms: int) -> list[Any]:
        mp = self.mp
        f, s, c = [self.angle, self.rate], [mp.sin(self.angle)], [mp.cos(self.angle)]
        for k in range(terms - 1):
            f.append(-self.w2 * s[k] / ((k + 1) * (k + 2)))
            rates = [(j + 1) * f[j + 1] for j in range(k + 1)]
            s.append(mp.fdot(zip(c, reversed(rates), strict=True)) / (k + 1))
            c.append(-mp.fdot(zip(s[: k + 1], reversed(rates), strict=True)) / (k + 1))
        return f


def _accumulation(mp: Any, document: Document, k: float) -> Any:
    """Instant (s) at which the impacts of two equal balls in one valley end.

    Flights in short Taylor steps, every contact by Newton's iteration; at the end the flights
    shorten as a geometric series of ratio k.
    """
    one, two = document["balls"]
    rho = mp.mpf(document["trace"]["arcs"][0]["radius"]) - mp.mpf(one["radius"])
    w2 = mp.mpf(document["gravity"]) / (mp.mpf(1.4) * rho)
    beta = 2 * mp.asin(mp.mpf(one["radius"]) / rho)
    bodies = [_Pendulum(mp, mp.mpf(b["angle"]), mp.zero, w2) for b in (one, two)]
    share = mp.mpf(two["mass"]) / (mp.mpf(one["mass"]) + mp.mpf(two["mass"]))
    t, flight, ratio = mp.zero, mp.mpf(STEP), mp.mpf(k)
    while True:
        flight = _to_contact(mp, bodies, beta, flight)
        t += flight
        relative = bodies[0].rate - bodies[1].rate
        if ratio < NOTHING or flight < ENOUGH:
            return t + flight * ratio / (1 - ratio)
        bodies[0].rate -= (1 + ratio) * share * relative
        bodies[1].rate += (1 + ratio) * (1 - share) * relative
        # From now on the gap is exactly zero.
        bodies[1].angle = bodies[0].angle + beta


def _to_contact(mp: Any, bodies: list[_Pendulum], beta: Any, expected: Any) -> Any:
    """Time to the next contact, expected after about the given one; the bodies are taken there."""
    t, step = mp.zero, mp.mpf(STEP)
    if expected < STEP / 2:
        step = 2 * expected
    terms = 2 + int(LEFT_OUT / -mp.log10(step / SINGULARITY))
    while True:
        rows = [body.series(terms) for body in bodies]
        gap = [b - a for a, b in zip(*rows, strict=True)]
        gap[0] -= beta
        parting = t == 0 and abs(gap[0]) < mp.mpf(10) ** -40
        root = _root(mp, gap[1:] if parting else gap, step)
        h = step if root is None else root
        for body, row in zip(bodies, rows, strict=True):
            body.angle, body.rate = mp.polyval(row, h, derivative=True, asc=True)
        t += h
        if root is not None:
            return t


def _root(mp: Any, coefficients: list[Any], step: Any) -> Any:
    """First root of a polynomial on a step, None if it has none."""
    row = coefficients
    low = mp.zero
    for k in range(1, 9):
        high = step * k / 8
        if mp.polyval(row, high, asc=True) <= 0:
            break
        low = high
    else:
        return None
    # A root much shorter than the step is first bracketed by its own size.
    while low == 0 and mp.polyval(row, high / 8, asc=True) <= 0:
        high /= 8
    u = high
    for _ in range(60):
        value, slope = mp.polyval(row, u, derivative=True, asc=True)
        following = u - value / slope if slope else low
        if not low <= following <= high:
            following = (low + high) / 2
        if mp.polyval(row, following, asc=True) <= 0:
            high = following
        else:
            low = following
        if abs(following - u) <= abs(u) * mp.mpf(10) ** -45:
            return following
        u = following
    return u
