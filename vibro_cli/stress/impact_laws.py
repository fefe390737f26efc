"""Checks of single and simultaneous impacts against their law and against 50 digits.

Energy is conserved over a million impacts at k = 1, and lost as the law says for k < 1, by one pair
and by several. Accumulations end at the time computed in 50 digits, and the runs continue. Several
pairs collide simultaneously in Newton's cradle, by hits from both sides and with small k.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.mechanics.reachability import contact_angle
from vibro_cli.stress.oracles.arrangement import solve_rows
from vibro_cli.stress.oracles.oracle import Oracle
from vibro_cli.stress.oracles.scene import Pair, mp, scene_of_system, weight_and_response
from vibro_cli.stress.scenes import (
    CIRCLE,
    FAILED,
    THREE_ARCS,
    VALLEY,
    WALLS,
    Document,
    Finding,
    Plan,
    attempted,
    ball,
    energy_at,
    energy_gained,
    scene,
    solve,
    system_of,
)
from vibro_cli.stress.symmetry import run_of_image
from vibro_cli.systems.run import Run

COEFFICIENTS = (0.0, 1.0e-300, 0.05, 0.5, 0.8, 0.95, 0.999, 1.0 - 2.0**-53)
QUANTITY = "error of {} loss (ulp, beyond the rounding of the relative speeds)"

# Weight q and response h of the left and of the right body of a pair under its law.
Factors = tuple[Pair, Pair]


def single_losses(plan: Plan) -> Finding:
    """Check the loss of every impact of one pair against the law, from the speeds of its row."""
    tried = "every law, k = 0, 1e-300 ... 1 - 2^-53, against 50 digits"
    error = Finding(QUANTITY.format("an impact's"), tried, 4.0)
    for law in LAW_NAMES:
        for k in COEFFICIENTS:
            first: Document = {"mass": 2.5} if law == "hedrih" else {"mass": 2.5, "radius": 0.08}
            balls = [ball(-1.1, body="disk", **first), ball(0.8, body="disk")]
            document = scene(VALLEY, balls, k, law, collisions=plan.amount(40, 400), time=60.0)
            document["collision"]["inadmissible"] = "normal-impulse"
            run = solve(document)
            for row in range(len(run.collisions["n"])):
                if not run.collisions["substituted"][row] and not run.collisions["contact"][row]:
                    error.take(_error(run, [row], [k]), document)
    return error


def simultaneous_losses(plan: Plan) -> Finding:
    """Check the loss of every pair in simultaneous impacts of two to five pairs."""
    tried = "3 to 6 bodies in a row that all close at one instant, every law, against 50 digits"
    error = Finding(QUANTITY.format("a simultaneous impact's"), tried, 4.0)
    rng = np.random.default_rng([plan.seed, 37])
    for _ in range(plan.amount(40, 2000)):
        document = _closing_row(rng)
        run = solve(document)
        pairs = len(document["balls"]) - 1
        if run.collisions["substituted"].any() or not run.collisions["simultaneous"][:pairs].all():
            continue
        error.take(_error(run, range(pairs), document["collision"]["k"]), document)
    return error


def _closing_row(rng: np.random.Generator) -> Document:
    """Return bodies in contact at the start, each with a greater angular rate than the next one.

    On an arc, pairs close if their angular rates do; a larger body with a greater speed may part.
    """
    equal = bool(rng.random() < 0.3)
    balls, rate = [], 2.0
    for number in range(int(rng.integers(3, 7))):
        radius, mass = (0.1, 1.0) if equal else (rng.uniform(0.05, 0.1), rng.uniform(0.3, 3.0))
        speed = float(rate * (1.0 - radius))  # of the centre, in a valley of 1 m
        own = ball(-0.8, radius=float(radius), mass=float(mass), body="disk", speed=speed)
        if number > 0:
            del own["angle"]
            own["touching"] = "previous"
        rate -= float(rng.uniform(0.1, 2.0))
        balls.append(own)
    law = str(rng.choice(LAW_NAMES))
    document = scene(VALLEY, balls, 1.0, law, collisions=len(balls) - 1, time=1.0)
    k = [float(rng.choice(COEFFICIENTS)) for _ in balls[1:]]
    document["collision"] |= {"k": k, "inadmissible": "normal-impulse"}
    return document


def _error(run: Run, rows: Sequence[int], k: Sequence[float]) -> float:
    """Return the greatest error (ulp) of the losses in one impact of neighbouring pairs.

    A relative speed is a difference of two speeds, and has their absolute accuracy. The loss is
    proportional to its square; in simultaneous impacts, to it and to the impulse, to which all
    pairs contribute.
    """
    table = run.collisions
    bodies = scene_of_system(run.system).bodies
    first = int(table["ball_a"][rows[0]]) - 1
    law, size = str(table["law"][rows[0]]), mp.mpf(run.system.trace.pieces[0].radius)
    factors = [_factors(law, size, *bodies[first + n : first + n + 2]) for n in range(len(rows))]
    relative, resolved = [], []
    for row, ((qa, _), (qb, _)) in zip(rows, factors, strict=True):
        va, vb = (mp.mpf(float(table[f"speed_{end}_pre"][row])) for end in "ab")
        relative.append(qa * va - qb * vb)
        resolved.append(max(abs(qa * va), abs(qb * vb)) / abs(relative[-1]))
    # For every pair, the row of its relative speed, and the changes by its unit of impulse.
    speeds, changes = (
        [{n: pair[0][which], n + 1: -pair[1][which]} for n, pair in enumerate(factors)]
        for which in (0, 1)
    )
    change = [(1 + mp.mpf(one)) * u for one, u in zip(k, relative, strict=True)]
    impulses = solve_rows(speeds, changes, change)
    lost = [u * r for u, r in zip(change, resolved, strict=True)]
    rounded = solve_rows(speeds, changes, lost)
    worst = 0.0
    for n, row in enumerate(rows):
        exact = (1 - mp.mpf(k[n])) / 2 * impulses[n] * relative[n]
        # Convert the sum of q v^2/h, which is conserved at k = 1, to energy: all are disks.
        body, (weight, response) = bodies[first + n], factors[n][0]
        exact *= body.kappa * body.mass * response / weight
        found = mp.mpf(float(table["energy_loss"][row]))
        units = abs(found - exact) / max(math.ulp(float(exact)), 5e-324)
        worst = max(worst, float(units - 2 * (resolved[n] + rounded[n] / impulses[n])))
    return worst


def _factors(law: str, size: Any, one: Any, two: Any) -> Factors:
    """Return the factors of two bodies in contact in a valley of radius `size` (m)."""
    paths = [size - one.radius, size - two.radius]
    beta = 2 * mp.asin(mp.sqrt(one.radius * two.radius / (paths[0] * paths[1])))
    normals = [path * mp.sin(beta) / (one.radius + two.radius) for path in reversed(paths)]
    return weight_and_response(law, one, normals[0]), weight_and_response(law, two, normals[1])


SEEDS = 64
# Standard error of the exponent of growth from the RMS of 64 runs at two lengths, doubled.
EXPONENT = 0.5 + 2.0 * (2.0 / 128.0) ** 0.5 / math.log(16.0)


def check_energy(plan: Plan) -> list[Finding]:
    """Check drift and corrections at k = 1, growth of the RMS over seeds, and losses of impacts."""
    return [*_drift(plan), _growth(plan), single_losses(plan), simultaneous_losses(plan)]


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
    tried = f"k = 1, {impacts} impacts each: {', '.join(_long_scenes())}"
    drift = Finding("relative drift of energy", tried, 1e-12)
    corrections = Finding("sum of |corrections| / energy", tried, None)
    for document in _long_scenes().values():
        document = {**document, "stop": {"collisions": impacts}}
        run = solve(document, "compiled")
        summary = run.summary_record()
        start = energy_at(run, 0.0, "before")
        scale = summary["energy_start"]
        end = energy_at(run, summary["end_time"], "after")
        drift.take(abs(end - start) / scale, document)
        corrections.take(summary["energy_correction"] / scale, document)
    return [drift, corrections]


def _growth(plan: Plan) -> Finding:
    """Return the exponent with which the RMS of the drift grows with the number of impacts."""
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
        "exponent of the growth of the RMS drift", tried, EXPONENT, cases=SEEDS, worst=exponent
    )


SHORT = (0.0, 0.05, 0.3, 0.5, 0.8)
LONG = (*SHORT, 1.0e-300, 0.1, 0.2, 0.4, 0.6, 0.7, 0.85, 0.9, 0.95, 0.97, 0.98, 0.99)
LONGEST = 4000.0  # s
SLOW = 0.95  # k from which runs have thousands of impacts: fewer cases


def check_accumulation(plan: Plan) -> list[Finding]:
    """Check the time of accumulation of a pair in a valley, and that the run then continues."""
    rng = np.random.default_rng([plan.seed, 17])
    tried = "two balls in a valley, k = 0, 1e-300 ... 0.99" if plan.full else "k = 0 ... 0.8"
    error = Finding(
        "relative error of the time of accumulation", f"{tried}, against 50 digits", 1e-10
    )
    ended = Finding("runs that do not go on to their stop", tried, 0.0)
    for k in LONG if plan.full else SHORT:
        for _ in range(2 if k >= SLOW else plan.amount(2, 4)):
            balls = [ball(float(rng.uniform(-1.2, -0.3))), ball(float(rng.uniform(0.3, 1.2)))]
            balls[0]["mass"] = float(rng.uniform(0.3, 3.0))
            document = scene(VALLEY, balls, k, time=LONGEST if k > 0.9 else 400.0)
            document |= WALLS  # a light ball may reach them
            run = solve(document)
            closed = run.events["event"] == "contact_closed"
            found = float(run.events["t"][closed][0]) if closed.any() else float("nan")
            history = Oracle.of(run.system).run(mp.mpf(LONGEST), last=("contact_closed",))
            exact = history.events[-1].t
            error.take(float(abs(found - exact) / exact), document)
            ended.take(float(run.end_cause != "time"), document)
    return [error, ended]


# Accumulations of many bodies take tens of thousands of impacts; beyond this a run has failed.
MOST_IMPACTS = 200_000


def _touching(masses: list[float]) -> list[Document]:
    """Return balls at rest in contact, centred on the bottom of a valley."""
    two = system_of(scene(VALLEY, [ball(-0.5), ball(0.5)], time=1.0))
    beta = contact_angle(two.trace.pieces[0], 0.1, 0.1)
    first = -0.5 * beta * (len(masses) - 1)
    balls = [ball(first, mass=masses[0])]
    balls += [{"radius": 0.1, "mass": m, "arc": 1, "touching": "previous"} for m in masses[1:]]
    return balls


def check_cradle(plan: Plan) -> list[Finding]:
    """Check the speeds after a cradle's hit, symmetric scenes, and that every run ends."""
    return [*_cradles(plan), *_symmetric(plan)]


def _cradles(plan: Plan) -> list[Finding]:
    """Check that a ball hitting a row at rest conserves energy and passes on its speed (k = 1)."""
    tried = "a ball against a row at rest in contact, k = 1, 0.7, 0.05, 0"
    gained = Finding("relative energy gained (k = 1: changed)", tried, 1e-13)
    lost = Finding("speed not passed on to the last ball at k = 1, relative", tried, 64.0 * EPSILON)
    failed = Finding(FAILED, tried, 0.0)
    for count in range(2, plan.amount(4, 9)):
        for k in (1.0, 0.7, 0.05, 0.0):
            balls = [ball(-1.9), *_touching([1.0] * count)]
            document = scene(VALLEY, balls, k, collisions=MOST_IMPACTS, time=6.0)
            document["collision"]["inadmissible"] = "normal-impulse"
            run = attempted(document, failed)
            if run is None:
                continue
            failed.take(float(run.end_cause != "time"), document)
            gain = energy_gained(run)
            gained.take(abs(gain) if k == 1.0 else max(gain, 0.0), document)
            if k == 1.0:
                lost.take(_not_passed_on(run), document)
    return [gained, lost, failed]


def _not_passed_on(run: Run) -> float:
    """Return the relative deviation of the speeds just after the first hit from 0, ..., 0, v."""
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
    """Check that symmetric rows struck from both sides stay their own mirror images, to the bit."""
    tried = "masses m : 2 : m struck from both sides at one instant, k = 1 ... 0"
    lopsided = Finding("distance from the mirror image (rad)", tried, 0.0)
    failed = Finding(FAILED, tried, 0.0)
    rng = np.random.default_rng([plan.seed, 19])
    for _ in range(plan.amount(8, 60)):
        k = float(rng.choice([1.0, 0.8, 0.3, 0.05, 0.0]))
        angle, outer = float(rng.uniform(0.6, 1.6)), float(rng.uniform(0.5, 2.0))
        balls = [ball(-angle, mass=outer), ball(0.0, mass=2.0), ball(angle, mass=outer)]
        document = scene(VALLEY, balls, k, collisions=MOST_IMPACTS, time=6.0)
        run = attempted(document, failed)
        if run is None:
            continue
        image = run_of_image(run, document)
        if run.end_cause != "time":
            failed.take(1.0, document)
            continue
        end = [state.sample([6.0])["angle"] for state in (run, image)]
        off = sum(float(np.max(np.abs(end[0] + one[::-1]))) for one in end)
        lopsided.take(off if math.isfinite(off) else math.inf, document)
    return [lopsided, failed]
