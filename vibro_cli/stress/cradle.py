"""Several pairs at one instant: Newton's cradle, hits from both sides, small k."""

from __future__ import annotations

import math

import numpy as np

from vibro_cli.mechanics.clearance import contact_angle
from vibro_cli.simulation.run import Run
from vibro_cli.stress.finding import Document, Finding, Plan, Worst
from vibro_cli.stress.scenes import VALLEY, ball, energy_at, scene, solve, system_of
from vibro_cli.stress.symmetry import mirrored
from vibro_cli.stress.watched import fault_of

CHECK = "cradle"
EPSILON = 2.0**-52
# Accumulations of many bodies take tens of thousands of impacts; more than this is no end.
MOST_IMPACTS = 200_000


def _touching(masses: list[float], middle: float = 0.0) -> list[Document]:
    """Balls at rest in contact, about the bottom of a valley."""
    two = system_of(scene(VALLEY, [ball(-0.5), ball(0.5)], time=1.0))
    beta = contact_angle(two.trace.pieces[0], 0.1, 0.1)
    first = middle - 0.5 * beta * (len(masses) - 1)
    balls = [ball(first, mass=masses[0])]
    balls += [{"radius": 0.1, "mass": m, "arc": 1, "touching": "previous"} for m in masses[1:]]
    return balls


def check(plan: Plan) -> list[Finding]:
    """Speeds after a cradle's hit, symmetric scenes, and that every run ends."""
    return [*_cradles(plan), *_symmetric(plan)]


def _cradles(plan: Plan) -> list[Finding]:
    """One ball hits n at rest: energy is kept, and the same speed leaves at the other end."""
    kept, passed, ended = Worst(), Worst(), Worst()
    for count in range(2, plan.amount(4, 9)):
        for k in (1.0, 0.7, 0.05, 0.0):
            balls = [ball(-1.9), *_touching([1.0] * count)]
            document = scene(VALLEY, balls, k, collisions=MOST_IMPACTS, time=6.0)
            document["collision"]["inadmissible"] = "normal-impulse"
            hangs = bool(fault_of(document))
            ended.take(float(hangs), document)
            if hangs:
                continue
            run = solve(document)
            ended.take(float(run.end_cause != "time"), document)
            end = run.checkpoint()["end_time"]
            before, after = energy_at(run, 0.0, "before"), energy_at(run, end, "after")
            gain = (after - before) / abs(before)
            kept.take(abs(gain) if k == 1.0 else max(gain, 0.0), document)
            if k == 1.0:
                passed.take(_not_passed_on(run), document)
    tried = "a ball against a row at rest in contact, k = 1, 0.7, 0.05, 0"
    return [
        kept.finding(CHECK, "relative energy gained (k = 1: changed)", tried, 1e-13),
        passed.finding(
            CHECK, "speed not passed on to the last ball at k = 1, relative", tried, 64.0 * EPSILON
        ),
        ended.finding(CHECK, "runs that hang or fail", tried, 0.0),
    ]


def _not_passed_on(run: Run) -> float:
    """How far the speeds just after the first hit are from 0, ..., 0, v."""
    first = float(run.collisions["t"][0])
    incident = float(run.collisions["speed_a_pre"][0])
    same = np.abs(run.collisions["t"] - first) < 1.0e-9
    speeds = {}
    for row in np.flatnonzero(same):
        for end in "ab":
            ball_number = int(run.collisions[f"ball_{end}"][row])
            speeds[ball_number] = float(run.collisions[f"speed_{end}_post"][row])
    last = speeds.pop(len(run.system.bodies), 0.0)
    rest = max(abs(speed) for speed in speeds.values())
    return max(abs(last - incident), rest) / abs(incident)


def _symmetric(plan: Plan) -> list[Finding]:
    """Masses 1:2:1 and rows struck from both sides stay their own mirror images, to the bit."""
    worst, ended = Worst(), Worst()
    rng = np.random.default_rng([plan.seed, 19])
    for _ in range(plan.amount(8, 60)):
        k = float(rng.choice([1.0, 0.8, 0.3, 0.05, 0.0]))
        angle, outer = float(rng.uniform(0.6, 1.6)), float(rng.uniform(0.5, 2.0))
        balls = [ball(-angle, mass=outer), ball(0.0, mass=2.0), ball(angle, mass=outer)]
        document = scene(VALLEY, balls, k, collisions=MOST_IMPACTS, time=6.0)
        hangs = bool(fault_of(document))
        ended.take(float(hangs), document)
        if hangs:
            continue
        run, image = solve(document), solve(mirrored(document))
        if run.end_cause != "time":
            ended.take(1.0, document)
            continue
        end = [state.sample([6.0])["angle"] for state in (run, image)]
        lopsided = float(np.max(np.abs(end[0] + end[0][::-1])))
        different = float(np.max(np.abs(end[0] + end[1][::-1])))
        bad = lopsided + different
        worst.take(bad if math.isfinite(bad) else math.inf, document)
    tried = "masses m : 2 : m struck from both sides at one instant, k = 1 ... 0"
    return [
        worst.finding(CHECK, "distance from the mirror image (rad)", tried, 0.0),
        ended.finding(CHECK, "runs that hang or fail", tried, 0.0),
    ]
