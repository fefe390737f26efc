"""Energy: kept over a million impacts at k = 1, lost by the law below it."""

from __future__ import annotations

import math

import numpy as np

from vibro_cli.stress.finding import Document, Finding, Plan, Worst
from vibro_cli.stress.losses import joint_losses, single_losses
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
    """Drift and corrections at k = 1, growth of the RMS over seeds, loss of every impact."""
    return [*_drift(plan), _growth(plan), single_losses(plan), joint_losses(plan)]


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
        run = solve(document, "compiled")
        summary = run.summary_record()
        start = energy_at(run, 0.0, "before")
        scale = summary["energy_start"]
        end = energy_at(run, summary["end_time"], "after")
        drift.take(abs(end - start) / scale, document)
        corrections.take(summary["energy_correction"] / scale, document)
    tried = f"k = 1, {impacts} impacts each: {', '.join(_long_scenes())}"
    return [
        drift.finding(CHECK, "relative drift of energy", tried, 1e-12),
        corrections.finding(CHECK, "sum of |corrections| / energy", tried, None),
    ]


def _growth(plan: Plan) -> Finding:
    """Growth of the RMS of the drift with the number of impacts, as an exponent."""
    short = plan.amount(100, 4000)
    squares = [0.0, 0.0]
    for seed in range(SEEDS):
        rng = np.random.default_rng([plan.seed, seed])
        balls = [ball(float(rng.uniform(-1.5, -0.4))), ball(float(rng.uniform(0.4, 1.5)))]
        balls[0]["mass"] = float(rng.uniform(0.3, 3.0))
        for n, length in enumerate((short, 16 * short)):
            run = solve(scene(VALLEY, balls, collisions=length), "compiled")
            summary = run.summary_record()
            squares[n] += (summary["energy_drift"] or 0.0) ** 2
    exponent = 0.5 * math.log(squares[1] / squares[0]) / math.log(16.0)
    tried = f"k = 1, one valley, RMS over {SEEDS} seeds at {short} and {16 * short} impacts"
    return Finding(
        CHECK, "exponent of the growth of the RMS drift", tried, SEEDS, exponent, EXPONENT
    )
