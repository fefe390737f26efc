"""Checks of very fast, very long and very unequal motions, and of penetration at impacts.

They cover extreme sizes, gravities, masses and coefficients of restitution. Motions and first
contacts are compared with those in 50 digits.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.scenario.problems import ScenarioError
from vibro_cli.stress.impacts import solved
from vibro_cli.stress.oracles.oracle import first_contact
from vibro_cli.stress.oracles.scene import Path, Scene, mp, scene_of_system
from vibro_cli.stress.scenes import (
    CIRCLE,
    FAILED,
    THREE_ARCS,
    VALLEY,
    Document,
    Finding,
    Plan,
    attempted,
    ball,
    energy_gained,
    fault_of,
    scene,
    solve,
    system_of,
)
from vibro_cli.systems.run import Run

# Powers of two: sizes and gravity over 12 orders of magnitude, exactly representable.
SCALES = (-20, -13, -7, 7, 13, 20)
ROWS = 5
COEFFICIENTS = (0.0, 1.0e-300, 0.5, 1.0 - 2.0**-53, 1.0)


def check_extremes(plan: Plan) -> list[Finding]:
    """Check scaled scenes against their original, extreme mass ratios and k, and penetration."""
    rng = np.random.default_rng([plan.seed, 23])
    return [_scaled(rng, plan.amount(3, 20)), *_ratios(plan), _penetration(rng, plan)]


def _scene(rng: np.random.Generator) -> Document:
    """Return two balls on three arcs, with slopes in radians, so that scaling is exact."""
    arcs = [{**arc, "end_slope": 0.9 * (-1.0) ** n} for n, arc in enumerate(THREE_ARCS["arcs"])]
    arcs[2]["end_slope"] = 2.0
    trace = {"start_slope": -2.0, "arcs": arcs}
    balls = [
        ball(float(rng.uniform(-1.5, -1.0)), mass=float(rng.uniform(0.5, 3.0)), speed=0.0),
        ball(float(rng.uniform(0.2, 0.9)), arc=3, speed=float(rng.normal(0.0, 0.5))),
    ]
    return scene(trace, balls, 0.9, collisions=ROWS, time=60.0)


def _times_as_large(document: Document, length: float, gravity: float) -> Document:
    """Return the scene with all lengths times ``length`` and gravity times ``gravity``."""
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
    tried = f"two balls on three arcs, sizes and gravity times 2^-20 ... 2^20, {ROWS} impacts"
    change = Finding("relative change of the times of impacts", tried, 1e-12)
    for _ in range(count):
        document = _scene(rng)
        base = solve(document).collisions["t"]
        for power in SCALES:
            for other in (power, -power, 0):
                # Times, too, must change by a power of two, so that scaling does not round.
                if (power - other) % 2:
                    continue
                changed = _times_as_large(document, 2.0**power, 2.0**other)
                unit = math.sqrt(2.0 ** (power - other))
                times = solve(changed).collisions["t"] / unit
                same = len(times) == len(base)
                off = np.abs(times - base) / base if same else np.array([math.inf])
                change.take(float(np.max(off, initial=0.0)), changed)
    return change


def _ratios(plan: Plan) -> list[Finding]:
    """Check that runs with mass ratios up to 1e9 and extreme k end and gain no energy."""
    tried = "two balls, mass ratios to 1e9, k = 0, 1e-300, 0.5, 1 - 2^-53, 1"
    failed = Finding(FAILED, tried, 0.0)
    gained = Finding("relative energy gained", tried, 1e-12)
    for exponent in (0, 9) if not plan.full else (0, 3, 6, 9):
        for k in COEFFICIENTS:
            balls = [ball(-1.1, mass=10.0**exponent), ball(0.8)]
            document = scene(VALLEY, balls, k, collisions=1000, time=10.0)
            run = attempted(document, failed)
            if run is not None:
                gained.take(max(energy_gained(run), 0.0), document)
    return [failed, gained]


def _penetration(rng: np.random.Generator, plan: Plan) -> Finding:
    """Measure the overlap at impacts, in units in the last place of the positions."""
    tried = "two balls on three arcs, k = 0.9, up to 50 impacts each, distances to 50 digits"
    penetration = Finding("penetration (ulp of the positions)", tried, 8.0)
    for _ in range(plan.amount(20, 400)):
        document = _scene(rng)
        document["stop"] = {"collisions": 50, "time": 20.0}
        run = solve(document)
        exact = scene_of_system(run.system)
        for row in range(len(run.collisions["n"])):
            penetration.take(_overlap(exact, run, row), document)
    return penetration


def _overlap(scene: Scene, run: Run, row: int) -> float:
    """Return the overlap of the bodies of an impact, from their angles, in ulp of the places."""
    centres = []
    for ball_number, end in enumerate("ab"):
        piece = int(run.collisions[f"arc_{end}"][row]) - 1
        path = Path(scene, ball_number, piece)
        centres.append(path.centre(solved(run, f"place_{end}", row)))
    (ax, ay), (bx, by) = centres
    touch = sum(body.radius for body in scene.bodies)
    largest = max(abs(float(value)) for centre in centres for value in centre)
    return max(float(touch - mp.hypot(bx - ax, by - ay)), 0.0) / math.ulp(largest)


TURNS = 1.0e6
PERIODS = 1.0e9
RATIOS = (1.0, 1.0e2, 1.0e4)
ANGLE = "error of the angle / (eps x amplification)"


def check_limits(plan: Plan) -> list[Finding]:
    """Check a million turns, a billion periods, extreme ratios, the ends of the number range."""
    rng = np.random.default_rng([plan.seed, 31])
    return [turns(rng, plan), swings(rng, plan), *unequal(rng, plan), ends_of_range(plan)]


def _state(rate: Any, t: float) -> tuple[Any, Any]:
    """Return sine and cosine of half the angle of a ball of 0.1 m in a valley of 1 m at a time (s).

    The ball starts at the bottom with ``rate`` (rad/s).
    ``S = k sn(w t | k^2)`` for a libration, ``S = sn(k w t | 1/k^2)`` for a rotation, where
    ``k = rate/(2 w)`` is the ratio to the rate that just reaches the top (DLMF 22.19.2-3).
    """
    rho = mp.mpf(1) - mp.mpf(0.1)
    w = mp.sqrt(mp.mpf(9.81) / (mp.mpf(7) / 5 * rho))
    k = mp.mpf(rate) / (2 * w)
    if k < 1:
        return k * mp.ellipfun("sn", w * t, m=k * k), mp.ellipfun("dn", w * t, m=k * k)
    u = k * w * mp.mpf(t)
    return mp.ellipfun("sn", u, m=1 / k**2), mp.ellipfun("cn", u, m=1 / k**2)


def _phase_error(document: Document, t: float) -> float:
    """Return the error of a ball's angle in eps x the effect of a relative change of its rate."""
    run = solve(document, "compiled")
    # The solver gets the speed of the centre, which is the rate times the radius of its path.
    rate = mp.mpf(run.system.initial[0].speed) / (mp.mpf(1) - mp.mpf(0.1))
    sine, cosine = _state(rate, t)
    sample = run.sample([t])
    half = mp.mpf(float(sample["angle"][0])) / 2
    # The sine of half the difference does not depend on whole turns.
    off = 2 * abs(mp.sin(half) * cosine - mp.cos(half) * sine)
    path = abs(float(sample["speed"][0])) / 0.9 * t
    return float(off / (EPSILON * max(path, 1.0)))


def turns(rng: np.random.Generator, plan: Plan) -> Finding:
    """Check a ball that goes round its circle, up to a million turns."""
    tried = f"one ball on a circle, {plan.amount(1, 100) / 100 * TURNS:g} turns, against 50 digits"
    error = Finding(ANGLE, tried, 64.0)
    for _ in range(plan.amount(1, 4)):
        rate = float(10.0 ** rng.uniform(2.0, 6.0))
        t = plan.amount(1, 100) / 100 * TURNS * 2.0 * math.pi / rate
        document = scene(CIRCLE, [ball(0.0, rate=rate)], time=t)
        error.take(_phase_error(document, t), document)
    return error


def swings(rng: np.random.Generator, plan: Plan) -> Finding:
    """Check a ball that swings undisturbed for a billion periods."""
    tried = f"one ball in a valley, about {PERIODS:g} periods without an event, against 50 digits"
    error = Finding(ANGLE, tried, 64.0)
    for _ in range(plan.amount(5, 40)):
        rate = float(rng.uniform(0.1, 5.0))
        t = PERIODS * float(rng.uniform(2.0, 3.0))
        document = scene(VALLEY, [ball(0.0, rate=rate)], time=t)
        error.take(_phase_error(document, t), document)
    return error


def unequal(rng: np.random.Generator, plan: Plan) -> list[Finding]:
    """Check radii to 1 : 1e4 with masses to 1 : 1e9 and extreme k: solved or refused."""
    tried = "two balls, radii to 1 : 1e4, masses to 1 : 1e9, k = 0, 1e-300, 0.5, 1 - 2^-53, 1"
    first = Finding("relative error of the first impact", f"{tried}, against 50 digits", 1e-13)
    gained = Finding("relative energy gained", tried, 1e-12)
    failed = Finding(FAILED, tried, 0.0)
    count = plan.amount(10, 150)
    refused = Finding("refused with the reason", tried, None, cases=count, worst=0)
    for number in range(count):
        radii = [0.1, 0.1 / float(rng.choice(RATIOS))]
        masses = [1.0, float(10.0 ** rng.uniform(-9.0, 9.0))]
        order = int(rng.integers(2))
        balls = [
            ball(float(place), radius=radii[n ^ order], mass=masses[n ^ order])
            for n, place in enumerate((rng.uniform(-1.3, -0.3), rng.uniform(0.3, 1.3)))
        ]
        document = scene(VALLEY, balls, COEFFICIENTS[number % 5], collisions=200, time=10.0)
        try:
            system = system_of(document)
        except ScenarioError:
            refused.worst += 1
            continue
        run = attempted(document, failed)
        if run is None:
            continue
        gained.take(max(energy_gained(run), 0.0), document)
        exact = first_contact(scene_of_system(system), mp.mpf(10))
        first.take(float(abs(solved(run, "t", 0) - exact) / exact), document)
    return [first, gained, failed, refused]


def ends_of_range(plan: Plan) -> Finding:
    """Check times and gravities near the ends of the range of doubles: solved or refused."""
    tried = "stop.time to 1.7e308 s, gravity from 1e-320 to 1.7e308 m/s^2: right or refused"
    failed = Finding(FAILED, tried, 0.0)
    pair, alone = [ball(-0.5), ball(0.5)], [ball(0.5)]
    for k in COEFFICIENTS if plan.full else (0.5,):
        for time in (1.0e15, 1.0e300, 1.7e308):
            for balls in (pair, alone):
                document = scene(VALLEY, balls, k, collisions=1000, time=time)
                failed.take(float(bool(fault_of(document))), document)
        for gravity in (1.0e-320, 1.0e-300, 1.0e300, 1.7e308):
            document = scene(VALLEY, pair, k, collisions=100, time=1.0e300)
            document["gravity"] = gravity
            failed.take(float(bool(fault_of(document))), document)
    return failed
