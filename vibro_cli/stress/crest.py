"""Starts from a crest, 1e-3 to 1e-300 rad off it: when the body leaves, and where it goes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibro_cli.stress.fifty_digits import multiprecision
from vibro_cli.stress.finding import Document, Finding, Plan, Worst
from vibro_cli.stress.scenes import GRAVITY, THREE_ARCS, ball, scene, solve

CHECK = "crest"
HUMP, RADIUS, KAPPA, VALLEY = 0.5, 0.1, 1.4, 1.0
JUNCTION = math.radians(50.0)
RETURNS = 6


def check(plan: Plan) -> list[Finding]:
    """Departure and first impact against 50 digits; the decision to return over the crest."""
    rng = np.random.default_rng([plan.seed, 13])
    exponents = np.linspace(-3.0, -300.0, plan.amount(12, 199))
    offsets = [float(10.0**e * rng.uniform(1.0, 9.0)) for e in exponents]
    return [*_times(offsets), _decisions(offsets)]


def time_from_rest(mp: Any, w: Any, offset: Any, angle: Any) -> Any:
    """Time (s) from rest at ``offset`` to ``angle`` on a hump: Carlson's form of the integral.

    ``w t = R_F(U12^2, U13^2, U23^2)`` (DLMF 19.29.4) of ``dx / sqrt(x (1-x) (x - x0))``, with
    ``x = sin^2(psi/2)``.
    """
    y, x = mp.sin(offset / 2), mp.sin(angle / 2)
    span = mp.sqrt((x - y) * (x + y))
    one, two = mp.sqrt(1 - x * x), mp.sqrt(1 - y * y)
    return mp.elliprf((y * two / span) ** 2, (x * two / span) ** 2, (one * y / span) ** 2) / w


def _document(offset: float) -> Document:
    """A ball at rest off the crest, another at rest at the bottom of the right valley."""
    balls = [ball(offset, arc=2), ball(0.0, arc=3)]
    return scene(THREE_ARCS, balls, 1.0, collisions=1, time=1.0e6)


def _exact(mp: Any, offset: float) -> tuple[Any, Any]:
    """Instants of the departure from the hump and of the first impact."""
    junction = mp.mpf(5) / 18 * mp.pi
    radius = mp.mpf(RADIUS)
    kappa = mp.mpf(KAPPA)
    rho_hump, rho_valley = mp.mpf(HUMP) + radius, mp.mpf(VALLEY) - radius
    w = mp.sqrt(mp.mpf(GRAVITY) / (kappa * rho_hump))
    departure = time_from_rest(mp, w, mp.mpf(offset), junction)
    y, x = mp.sin(mp.mpf(offset) / 2), mp.sin(junction / 2)
    speed = 2 * w * mp.sqrt((x - y) * (x + y)) * rho_hump
    pull = mp.mpf(GRAVITY) / (kappa * rho_valley)
    beta = 2 * mp.asin(radius / rho_valley)
    start = (speed / rho_valley) ** 2

    def slowness(angle: Any) -> Any:
        return 1 / mp.sqrt(start + 2 * pull * (mp.cos(angle) - mp.cos(junction)))

    return departure, departure + mp.quad(slowness, [-junction, -junction / 2, -beta])


def _times(offsets: list[float]) -> list[Finding]:
    mp = multiprecision()
    departure, impact = Worst(), Worst()
    for offset in offsets:
        document = _document(offset)
        run = solve(document)
        exact = _exact(mp, offset)
        crossings = run.events["t"][run.events["event"] == "crossing"]
        left = float(crossings[0]) if len(crossings) else math.nan
        met = float(run.collisions["t"][0]) if len(run.collisions["t"]) else math.nan
        departure.take(float(abs(left - exact[0]) / exact[0]), document)
        impact.take(float(abs(met - exact[1]) / exact[1]), document)
    tried = "at rest 1e-3 ... 1e-300 rad off a crest, against 50 digits"
    return [
        worst.finding(CHECK, f"relative error of the time of {name}", tried, 1e-12)
        for name, worst in (("departure", departure), ("the first impact", impact))
    ]


def _decisions(offsets: list[float]) -> Finding:
    """A body at rest beside a crest never comes over it; one moving on it always does."""
    worst = Worst()
    for offset in offsets:
        for over in (False, True):
            one = ball(0.0, arc=2, rate=offset) if over else ball(offset, arc=2)
            # Each way down and back takes about 2 ln(1/offset)/w and some seconds.
            time = RETURNS * (2.0 * -math.log(offset) / 3.4 + 4.0)
            document = scene(THREE_ARCS, [one], time=time)
            events = solve(document).events
            crossing = events["event"] == "crossing"
            arcs = np.asarray(events["arc_to"][crossing]).tolist()
            expected = [3, 2, 1, 2] if over else [3, 2, 3, 2]
            enough = len(arcs) >= RETURNS
            right = enough and all(a == expected[n % 4] for n, a in enumerate(arcs))
            worst.take(float(not right), document)
    tried = (
        f"alone on three arcs for {RETURNS} crossings or more, at rest beside or moving on a crest"
    )
    return worst.finding(CHECK, "wrong decisions to return", tried, 0.0)
