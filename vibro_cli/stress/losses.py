"""What every impact takes from the energy, against its law in 50 digits: one pair, and several."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from vibro_cli.mechanics.body import Body
from vibro_cli.simulation.run import Run
from vibro_cli.stress.finding import Document, Finding, Plan, Worst
from vibro_cli.stress.highprecision.scene import KAPPA
from vibro_cli.stress.highprecision.taylor import Real, mp
from vibro_cli.stress.scenes import VALLEY, ball, scene, solve

CHECK = "energy"
LAWS = ("hedrih", "translational", "normal-impulse")
COEFFICIENTS = (0.0, 1.0e-300, 0.05, 0.5, 0.8, 0.95, 0.999, 1.0 - 2.0**-53)
QUANTITY = "error of {} loss (ulp, beyond the rounding of the relative speeds)"

# Weight q and response h of the left and of the right body of a pair under its law.
Factors = tuple[tuple[Real, Real], tuple[Real, Real]]


def single_losses(plan: Plan) -> Finding:
    """Loss of every impact of one pair against the law, from the row's own speeds."""
    worst = Worst()
    for law in LAWS:
        for k in COEFFICIENTS:
            first: Document = {"mass": 2.5} if law == "hedrih" else {"mass": 2.5, "radius": 0.08}
            balls = [ball(-1.1, body="disk", **first), ball(0.8, body="disk")]
            document = scene(VALLEY, balls, k, law, collisions=plan.amount(40, 400), time=60.0)
            document["collision"]["inadmissible"] = "normal-impulse"
            run = solve(document)
            for row in range(len(run.collisions["n"])):
                if not run.collisions["substituted"][row] and not run.collisions["contact"][row]:
                    worst.take(_error(run, [row], [k]), document)
    tried = "three laws, k = 0, 1e-300 ... 1 - 2^-53, against 50 digits"
    return worst.finding(CHECK, QUANTITY.format("an impact's"), tried, 4.0)


def joint_losses(plan: Plan) -> Finding:
    """Loss of every pair of an impact of two to five pairs at one instant."""
    worst, rng = Worst(), np.random.default_rng([plan.seed, 37])
    for _ in range(plan.amount(40, 2000)):
        document = _closing_row(rng)
        run = solve(document)
        pairs = len(document["balls"]) - 1
        if run.collisions["substituted"].any() or not run.collisions["simultaneous"][:pairs].all():
            continue
        worst.take(_error(run, range(pairs), document["collision"]["k"]), document)
    tried = "3 to 6 bodies in a row that all close at one instant, three laws, against 50 digits"
    return worst.finding(CHECK, QUANTITY.format("a joint impact's"), tried, 4.0)


def _closing_row(rng: np.random.Generator) -> Document:
    """Bodies in contact at the start, each faster than the next one."""
    equal = bool(rng.random() < 0.3)
    balls, speed = [], 2.0
    for number in range(int(rng.integers(3, 7))):
        radius, mass = (0.1, 1.0) if equal else (rng.uniform(0.05, 0.1), rng.uniform(0.3, 3.0))
        own = ball(-0.8, radius=float(radius), mass=float(mass), body="disk", speed=speed)
        if number > 0:
            del own["angle"]
            own["touching"] = "previous"
        speed -= float(rng.uniform(0.1, 2.0))
        balls.append(own)
    law = str(rng.choice(LAWS))
    document = scene(VALLEY, balls, 1.0, law, collisions=len(balls) - 1, time=1.0)
    k = [float(rng.choice(COEFFICIENTS)) for _ in balls[1:]]
    document["collision"] |= {"k": k, "inadmissible": "normal-impulse"}
    return document


def _error(run: Run, rows: Sequence[int], k: Sequence[float]) -> float:
    """Greatest error of the losses (ulp) of rows that are one impact of neighbouring pairs.

    A relative speed is a difference of two speeds, and resolved no better than they are; the loss
    goes with its square, in a joint impact with it and the impulse, to which all pairs contribute.
    """
    table = run.collisions
    bodies = run.system.bodies
    first = int(table["ball_a"][rows[0]]) - 1
    law, size = str(table["law"][rows[0]]), mp.mpf(run.system.trace.pieces[0].radius)
    factors = [_factors(law, size, *bodies[first + n : first + n + 2]) for n in range(len(rows))]
    relative, resolved = [], []
    for row, ((qa, _), (qb, _)) in zip(rows, factors, strict=True):
        va, vb = (mp.mpf(float(table[f"speed_{end}_pre"][row])) for end in "ab")
        relative.append(qa * va - qb * vb)
        resolved.append(max(abs(qa * va), abs(qb * vb)) / abs(relative[-1]))
    matrix = _matrix(factors)
    change = [(1 + mp.mpf(one)) * u for one, u in zip(k, relative, strict=True)]
    impulses = mp.lu_solve(matrix, mp.matrix(change))
    rounded = mp.lu_solve(matrix, mp.matrix([u * r for u, r in zip(change, resolved, strict=True)]))
    worst = 0.0
    for n, row in enumerate(rows):
        exact = (1 - mp.mpf(k[n])) / 2 * impulses[n] * relative[n]
        if law == "translational":
            exact *= KAPPA[bodies[first + n].kind]
        found = mp.mpf(float(table["energy_loss"][row]))
        units = abs(found - exact) / max(math.ulp(float(exact)), 5e-324)
        worst = max(worst, float(units - 2 * (resolved[n] + rounded[n] / impulses[n])))
    return worst


def _factors(law: str, size: Real, one: Body, two: Body) -> Factors:
    """The factors of two bodies in contact in a valley of this radius (m)."""
    masses = [KAPPA[body.kind] * mp.mpf(body.mass) for body in (one, two)]
    radii = [mp.mpf(body.radius) for body in (one, two)]
    if law == "translational":
        return (mp.one, 1 / mp.mpf(one.mass)), (mp.one, 1 / mp.mpf(two.mass))
    if law == "hedrih":
        weights = [1 / radius for radius in radii]
    else:
        paths = [size - radius for radius in radii]
        beta = 2 * mp.asin(mp.sqrt(radii[0] * radii[1] / (paths[0] * paths[1])))
        weights = [path * mp.sin(beta) / sum(radii) for path in reversed(paths)]
    left, right = ((q, q / mass) for q, mass in zip(weights, masses, strict=True))
    return left, right


def _matrix(factors: Sequence[Factors]) -> Any:
    """Change of every pair's relative speed by every pair's impulse."""
    matrix = mp.zeros(len(factors))
    for n, ((qa, ha), (qb, hb)) in enumerate(factors):
        matrix[n, n] = qa * ha + qb * hb
        if n > 0:
            matrix[n, n - 1] = -qa * factors[n - 1][1][1]
        if n < len(factors) - 1:
            matrix[n, n + 1] = -qb * factors[n + 1][0][1]
    return matrix
