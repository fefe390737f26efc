"""Extreme sizes, gravities, masses and coefficients of restitution; penetration at impacts."""

from __future__ import annotations

import math

import numpy as np

from vibro_cli.simulation.run import Run
from vibro_cli.stress.finding import Document, Finding, Plan, Worst
from vibro_cli.stress.highprecision.quantities import solved
from vibro_cli.stress.highprecision.scene import scene_of_system
from vibro_cli.stress.highprecision.taylor import mp
from vibro_cli.stress.highprecision.twin import Twin
from vibro_cli.stress.scenes import (
    THREE_ARCS,
    VALLEY,
    ball,
    energy_at,
    scene,
    solve,
)
from vibro_cli.stress.watched import fault_of

CHECK = "extremes"
# Powers of two: sizes and gravity over 12 orders of magnitude, exactly representable.
SCALES = (-20, -13, -7, 7, 13, 20)
ROWS = 5
COEFFICIENTS = (0.0, 1.0e-300, 0.5, 1.0 - 2.0**-53, 1.0)


def check(plan: Plan) -> list[Finding]:
    """Scaled scenes against the one they are scaled from, mass ratios and k at their ends."""
    rng = np.random.default_rng([plan.seed, 23])
    return [_scaled(rng, plan.amount(3, 20)), *_ratios(plan), _penetration(rng, plan)]


def _scene(rng: np.random.Generator) -> Document:
    """Two balls on three arcs; the angles of the trace in radians, so that scaling is exact."""
    arcs = [{**arc, "end_slope": 0.9 * (-1.0) ** n} for n, arc in enumerate(THREE_ARCS["arcs"])]
    arcs[2]["end_slope"] = 2.0
    trace = {"start_slope": -2.0, "arcs": arcs}
    balls = [
        ball(float(rng.uniform(-1.5, -1.0)), mass=float(rng.uniform(0.5, 3.0)), speed=0.0),
        ball(float(rng.uniform(0.2, 0.9)), arc=3, speed=float(rng.normal(0.0, 0.5))),
    ]
    return scene(trace, balls, 0.9, collisions=ROWS, time=60.0)


def _times_as_large(document: Document, length: float, gravity: float) -> Document:
    """The same scene, all lengths times ``length`` and gravity times ``gravity``."""
    speed = math.sqrt(length * gravity)
    arcs = [{**arc, "radius": arc["radius"] * length} for arc in document["trace"]["arcs"]]
    balls = [
        {**old, "radius": old["radius"] * length, "speed": old["speed"] * speed}
        for old in document["balls"]
    ]
    time = document["stop"]["time"] * math.sqrt(length / gravity)
    return {
        **document, "gravity": document["gravity"] * gravity, "balls": balls,
        "trace": {**document["trace"], "arcs": arcs}, "stop": {**document["stop"], "time": time},
    }  # fmt: skip


def _scaled(rng: np.random.Generator, count: int) -> Finding:
    worst = Worst()
    for _ in range(count):
        document = _scene(rng)
        base = solve(document).collisions["t"]
        for power in SCALES:
            for other in (power, -power, 0):
                # Times change by a power of two too, so that nothing is rounded by scaling.
                if (power - other) % 2:
                    continue
                changed = _times_as_large(document, 2.0**power, 2.0**other)
                unit = math.sqrt(2.0 ** (power - other))
                times = solve(changed).collisions["t"] / unit
                same = len(times) == len(base)
                off = np.abs(times - base) / base if same else np.array([math.inf])
                worst.take(float(np.max(off, initial=0.0)), changed)
    tried = f"two balls on three arcs, sizes and gravity times 2^-20 ... 2^20, {ROWS} impacts"
    return worst.finding(CHECK, "relative change of the times of impacts", tried, 1e-12)


def _ratios(plan: Plan) -> list[Finding]:
    """Mass ratios to 1e9 with k at its ends: every run ends, no energy is gained."""
    ended, gained = Worst(), Worst()
    for exponent in (0, 9) if not plan.full else (0, 3, 6, 9):
        for k in COEFFICIENTS:
            balls = [ball(-1.1, mass=10.0**exponent), ball(0.8)]
            document = scene(VALLEY, balls, k, collisions=1000, time=10.0)
            ends = not fault_of(document)
            ended.take(float(not ends), document)
            if ends:
                gained.take(_gain(solve(document)), document)
    tried = "two balls, mass ratios to 1e9, k = 0, 1e-300, 0.5, 1 - 2^-53, 1"
    return [
        ended.finding(CHECK, "runs that hang or fail", tried, 0.0),
        gained.finding(CHECK, "relative energy gained", tried, 1e-12),
    ]


def _gain(run: Run) -> float:
    before = energy_at(run, 0.0, "before")
    after = energy_at(run, run.checkpoint()["end_time"], "after")
    return max((after - before) / abs(before), 0.0)


def _penetration(rng: np.random.Generator, plan: Plan) -> Finding:
    """Overlap at the impacts, in units in the last place of the positions."""
    worst = Worst()
    for _ in range(plan.amount(20, 400)):
        document = _scene(rng)
        document["stop"] = {"collisions": 50, "time": 20.0}
        run = solve(document)
        twin = Twin(scene_of_system(run.system))
        for row in range(len(run.collisions["n"])):
            worst.take(_overlap(twin, run, row), document)
    tried = "two balls on three arcs, k = 0.9, up to 50 impacts each, distances to 50 digits"
    return worst.finding(CHECK, "penetration (ulp of the positions)", tried, 8.0)


def _overlap(twin: Twin, run: Run, row: int) -> float:
    """How far the bodies of an impact are in one another, from their angles, in ulp of places."""
    centres = []
    for ball_number, end in enumerate("ab"):
        piece = int(run.collisions[f"arc_{end}"][row]) - 1
        shape, angle = twin.scene.pieces[piece], solved(run, f"place_{end}", row)
        rho = twin.path_radius(ball_number, piece)
        x, y = shape.origin
        centres.append((x + rho * mp.sin(angle), y - shape.sign * rho * mp.cos(angle)))
    (ax, ay), (bx, by) = centres
    touch = sum(body.radius for body in twin.scene.bodies)
    largest = max(abs(float(value)) for centre in centres for value in centre)
    return max(float(touch - mp.hypot(bx - ax, by - ay)), 0.0) / math.ulp(largest)
