"""Energy: kept over a million impacts at k = 1, lost by the law below it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibro_cli.stress.fifty_digits import multiprecision
from vibro_cli.stress.finding import Document, Finding, Plan, Worst
from vibro_cli.stress.scenes import (
    CIRCLE,
    THREE_ARCS,
    VALLEY,
    ball,
    energy_at,
    scene,
    solve,
)

CHECK = "energy"
SEEDS = 64
# Standard error of the exponent of growth from the RMS of 64 runs at two lengths, doubled.
EXPONENT = 0.5 + 2.0 * (2.0 / 128.0) ** 0.5 / math.log(16.0)


def check(plan: Plan) -> list[Finding]:
    """Drift and corrections at k = 1, growth of the RMS over seeds, loss of single impacts."""
    return [*_drift(plan), _growth(plan), _losses(plan)]


def _long_scenes() -> dict[str, Document]:
    heavy: Document = {"mass": 2.5}
    light: Document = {"radius": 0.07}
    return {
        "one circle": scene(CIRCLE, [ball(-0.9, **heavy), ball(0.8, **light)]),
        "one valley, equal balls": scene(VALLEY, [ball(-1.2), ball(0.7)]),
        "three arcs with crossings": scene(
            THREE_ARCS, [ball(-1.5, rate=1.0, **heavy), ball(1.0, arc=3)]
        ),
    }


def _drift(plan: Plan) -> list[Finding]:
    impacts = plan.amount(10_000, 1_000_000)
    drift, corrections = Worst(), Worst()
    for document in _long_scenes().values():
        document = {**document, "stop": {"collisions": impacts}}
        run = solve(document, "numba")
        summary = run.summary_record()
        start = energy_at(run, 0.0, "before")
        scale = summary["energy_start"]
        end = energy_at(run, summary["end_time"], "after")
        drift.take(abs(end - start) / scale, document)
        corrections.take(summary["energy_correction"] / scale, document)
    tried = f"k = 1, {impacts} impacts each: {', '.join(_long_scenes())}"
    return [
        Finding(
            CHECK, "relative drift of energy", tried, drift.cases, drift.value, 1e-12,
            drift.scenario,
        ),
        Finding(
            CHECK, "sum of |corrections| / energy", tried, drift.cases, corrections.value, None,
            corrections.scenario,
        ),
    ]  # fmt: skip


def _growth(plan: Plan) -> Finding:
    """Growth of the RMS of the drift with the number of impacts, as an exponent."""
    short = plan.amount(100, 4000)
    squares = [0.0, 0.0]
    for seed in range(SEEDS):
        rng = np.random.default_rng([plan.seed, seed])
        balls = [ball(float(rng.uniform(-1.5, -0.4))), ball(float(rng.uniform(0.4, 1.5)))]
        balls[0]["mass"] = float(rng.uniform(0.3, 3.0))
        for n, length in enumerate((short, 16 * short)):
            run = solve(scene(VALLEY, balls, collisions=length), "numba")
            summary = run.summary_record()
            squares[n] += (summary["energy_drift"] or 0.0) ** 2
    exponent = 0.5 * math.log(squares[1] / squares[0]) / math.log(16.0)
    tried = f"k = 1, one valley, RMS over {SEEDS} seeds at {short} and {16 * short} impacts"
    return Finding(
        CHECK, "exponent of the growth of the RMS drift", tried, SEEDS, exponent, EXPONENT
    )


def _losses(plan: Plan) -> Finding:
    """Loss of every impact against the law, from the row's own speeds, beyond what they resolve."""
    worst = Worst()
    for law in ("hedrih", "translational", "normal-impulse"):
        for k in (0.0, 1.0e-300, 0.05, 0.5, 0.8, 0.95, 0.999, 1.0 - 2.0**-53):
            first: Document = {"mass": 2.5} if law == "hedrih" else {"mass": 2.5, "radius": 0.08}
            balls = [ball(-1.1, body="disk", **first), ball(0.8, body="disk")]
            document = scene(VALLEY, balls, k, law, collisions=plan.amount(40, 400), time=60.0)
            document["collision"]["inadmissible"] = "normal-impulse"
            run = solve(document)
            for row in range(len(run.collisions["n"])):
                if not run.collisions["substituted"][row] and not run.collisions["contact"][row]:
                    worst.take(_loss_error(run, row, k), document)
    tried = "three laws, k = 0, 1e-300 ... 1 - 2^-53, against 50 digits"
    return Finding(
        CHECK, "error of an impact's loss (ulp, beyond the rounding of the relative speed)",
        tried, worst.cases, worst.value, 4.0, worst.scenario,
    )  # fmt: skip


def _loss_error(run: Any, row: int, k: float) -> float:
    mp, table = multiprecision(), run.collisions
    va, vb = (mp.mpf(float(table[f"speed_{end}_pre"][row])) for end in "ab")
    one, two = run.system.bodies
    law = str(table["law"][row])
    inertias = [mp.mpf(body.kappa) * mp.mpf(body.mass) for body in (one, two)]
    if law == "hedrih":
        factors = [1 / mp.mpf(body.radius) for body in (one, two)]
    elif law == "translational":
        factors = [mp.one, mp.one]
    else:
        size = mp.mpf(run.system.trace.pieces[0].radius)
        rho = [size - body.radius for body in (one, two)]
        beta = 2 * mp.asin(mp.sqrt(mp.mpf(one.radius) * two.radius / (rho[0] * rho[1])))
        touch = mp.mpf(one.radius) + two.radius
        factors = [rho[1] * mp.sin(beta) / touch, rho[0] * mp.sin(beta) / touch]
    reduced = 1 / sum(f**2 / inertia for f, inertia in zip(factors, inertias, strict=True))
    speeds = (factors[0] * va, factors[1] * vb)
    relative = speeds[0] - speeds[1]
    exact = (1 - mp.mpf(k) ** 2) / 2 * reduced * relative**2
    resolved = max(abs(speed) for speed in speeds) / abs(relative)
    found = float(table["energy_loss"][row])
    units = float(abs(mp.mpf(found) - exact)) / max(math.ulp(float(exact)), 5e-324)
    # The relative speed is a difference of two speeds, and resolved no better than they are; the
    # loss goes with its square.
    return units - 4.0 * float(resolved)
