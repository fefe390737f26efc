"""Balls on a table: walls met exactly, nobody escapes, laws to rounding, energy kept."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibro_cli.api import simulate
from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.scenario import any_scenario_of
from vibro_cli.stress.finding import Document, Finding, Plan, Worst
from vibro_cli.stress.oracles.fifty_digits import multiprecision
from vibro_cli.stress.oracles.neighbours import check_maps
from vibro_cli.systems.run import Run
from vibro_cli.systems.stream import Stretch
from vibro_cli.systems.table.twin import Twin, told_of

CHECK = "table"
Generator = np.random.Generator


def check(plan: Plan) -> list[Finding]:
    """Elliptic walls, skew impacts, the break of a rack, and many balls in a box."""
    return [*_foci(plan), _contact(plan), *_skew(plan), _rack(plan), *_gas(plan)]


def solve(document: Document, engine: str = "compiled") -> Run:
    """Run the document of a table."""
    return simulate(any_scenario_of(document), engine)


def _ball(rng: Generator, radius: float, reach: float = 0.3) -> Document:
    direction = float(rng.uniform(0.0, math.tau))
    x, y = map(float, rng.uniform(-reach, reach, 2))
    body: Document = {"body": "particle"} if radius == 0.0 else {}
    motion = {"velocity_x": math.cos(direction), "velocity_y": math.sin(direction)}
    return {"radius": radius, "mass": 1.0, "x": x, "y": y, **motion, **body}


def _ellipse(rng: Generator, side: str = "inside") -> Document:
    a, b = float(rng.uniform(1.0, 2.0)), float(rng.uniform(0.8, 2.0))
    axes = {"semi_axis_x": a, "semi_axis_y": b}
    return {"shape": "ellipse", **axes, "k": 1.0, "side": side}


def _foci(plan: Plan) -> list[Finding]:
    """The product of the angular momenta about the foci at r = 0, k = 1; who gets out."""
    bounces, far = plan.amount(10_000, 100_000), plan.amount(50_000, 1_000_000)
    product, escape = Worst(), Worst()
    rng = np.random.default_rng([plan.seed, 1])
    for _ in range(plan.amount(4, 12)):
        wall, particle = _ellipse(rng), _ball(rng, 0.0)
        document = {"system": "table", "wall": wall, "balls": [particle]}
        run = solve({**document, "stop": {"bounces": bounces}})
        product.take(_product_drift(run, wall), document)
    for radius in (0.0, 0.05, 0.2):
        wall, ball = _ellipse(rng), _ball(rng, radius)
        document = {"system": "table", "wall": wall, "balls": [ball], "stop": {"bounces": far}}
        escape.take(_beyond(solve(document), wall, radius), document)
    return [
        product.finding(
            CHECK,
            "product of angular momenta about the foci, relative change",
            f"r = 0, k = 1, {bounces} bounces each",
            1e-10,
        ),
        escape.finding(
            CHECK,
            "place of contact off the elliptic wall, (x/a)^2 + (y/b)^2 - 1",
            f"r = 0, 0.05, 0.2, {far} bounces each",
            1e-14,
        ),
    ]


def _product_drift(run: Run, wall: Document) -> float:
    a, b = wall["semi_axis_x"], wall["semi_axis_y"]
    c = math.sqrt(abs((a - b) * (a + b)))
    fx, fy = (c, 0.0) if a > b else (0.0, c)
    path = run.trajectory.balls[0]  # type: ignore[attr-defined]
    product = np.ones(len(path["t"]))
    for sign in (1.0, -1.0):
        product *= (path["x"] - sign * fx) * path["vy"] - (path["y"] - sign * fy) * path["vx"]
    size = float(np.max(np.abs(product)))
    least = max(abs(float(product[0])), 1e-3 * size)
    return float(np.max(np.abs(product - product[0]))) / least


def _beyond(run: Run, wall: Document, radius: float) -> float:
    rows = run.bounces
    if run.end_cause != "bounces" or not np.all(np.diff(rows["t"]) >= 0.0):
        return math.inf
    x = rows["x"] + radius * np.cos(rows["normal_angle"])
    y = rows["y"] + radius * np.sin(rows["normal_angle"])
    off = (x / wall["semi_axis_x"]) ** 2 + (y / wall["semi_axis_y"]) ** 2 - 1.0
    return float(np.max(np.abs(off)))


def _contact(plan: Plan) -> Finding:
    """Time of the first contact with the offset curve, against 50 digits, also when it grazes."""
    mp = multiprecision()
    worst = Worst()
    rng = np.random.default_rng([plan.seed, 2])
    for _ in range(plan.amount(40, 400)):
        side = str(rng.choice(["inside", "outside"]))
        wall, radius = _ellipse(rng, side), float(rng.uniform(0.0, 0.25))
        ball = _ball(rng, radius)
        if side == "outside":
            ball["x"], ball["y"] = -3.0 * ball["velocity_x"], -3.0 * ball["velocity_y"]
        document = {"system": "table", "wall": wall, "balls": [ball], "stop": {"bounces": 1}}
        rows = solve(document, "python").bounces
        worst.take(_time_error(mp, rows, wall, ball, side), document)
    return worst.finding(
        CHECK,
        "time of contact with an elliptic wall, error over 3 m",
        "inside and outside, r up to 0.25, against 50 digits",
        1e-14,
    )


def _time_error(mp: Any, rows: Any, wall: Document, ball: Document, side: str) -> float:
    """Newton's method for time and eccentric angle together, from the place that was found."""
    a, b, r = (mp.mpf(v) for v in (wall["semi_axis_x"], wall["semi_axis_y"], ball["radius"]))
    x, y, vx, vy = (mp.mpf(ball[name]) for name in ("x", "y", "velocity_x", "velocity_y"))
    sign = 1 if side == "inside" else -1

    def equations(t: Any, f: Any) -> list[Any]:
        c, s = mp.cos(f), mp.sin(f)
        size = mp.sqrt((b * c) ** 2 + (a * s) ** 2)
        return [
            x + vx * t - (a * c - sign * r * b * c / size),
            y + vy * t - (b * s - sign * r * a * s / size),
        ]

    t = float(rows["t"][0])
    normal = float(rows["normal_angle"][0]) + (0.0 if side == "inside" else math.pi)
    f = math.atan2(float(b) * math.sin(normal), float(a) * math.cos(normal))
    exact = mp.findroot(equations, (mp.mpf(t), mp.mpf(f)), tol=mp.mpf(10) ** -70)[0]
    return float(abs(exact - mp.mpf(t) - mp.mpf(float(rows["t_low"][0])))) / 3.0


def _skew(plan: Plan) -> list[Finding]:
    """Components of skew impacts: tangential ones stay, equal balls part at a right angle."""
    stays, angle = Worst(), Worst()
    rng = np.random.default_rng([plan.seed, 3])
    for _ in range(plan.amount(300, 3000)):
        radii = [float(r) for r in rng.uniform(0.05, 0.2, 2)]
        if rng.random() < 0.5:
            radii[1] = radii[0]
        balls = [_ball(rng, radii[0]), _ball(rng, radii[1])]
        balls[1] |= {"x": balls[0]["x"] + balls[0]["velocity_x"] + float(rng.uniform(-0.1, 0.1)),
                     "y": balls[0]["y"] + balls[0]["velocity_y"]}  # fmt: skip
        equal = radii[0] == radii[1] and rng.random() < 0.5
        if equal:
            balls[1] |= {"velocity_x": 0.0, "velocity_y": 0.0}
        document = {
            "system": "table", "balls": balls, "stop": {"collisions": 1, "time": 10.0},
            "collision": {"k": 1.0, "inadmissible": "normal-impulse"},
        }  # fmt: skip
        rows = solve(document, "python").collisions
        if len(rows["n"]) == 0:
            continue
        row = {name: values[0] for name, values in rows.items()}
        n = math.cos(row["normal_angle"]), math.sin(row["normal_angle"])
        for end in "ab":
            pre, post = ([row[f"velocity_{c}_{end}_{w}"] for c in "xy"] for w in ("pre", "post"))
            change = [after - before for before, after in zip(pre, post, strict=True)]
            stays.take(abs(change[1] * n[0] - change[0] * n[1]), document)
        if equal:
            product = [row[f"velocity_{c}_a_post"] * row[f"velocity_{c}_b_post"] for c in "xy"]
            angle.take(abs(sum(product)), document)
    tried = "random skew impacts at speeds up to 1 m/s"
    return [
        stays.finding(CHECK, "change of a tangential component (m/s)", tried, 1e-15),
        angle.finding(
            CHECK,
            "scalar product of the velocities after, equal balls, one at rest, k = 1",
            tried,
            1e-15,
        ),
    ]


def _rack(plan: Plan) -> Finding:
    """A ball breaks a triangle of touching balls along its axis: distance from a mirror image."""
    worst = Worst()
    rng = np.random.default_rng([plan.seed, 5])
    for _ in range(plan.amount(6, 40)):
        rows, radius = int(rng.integers(2, 6)), float(rng.uniform(0.02, 0.3))
        places = [(row, 2 * n - row) for row in range(rows) for n in range(row + 1)]
        apart = [(row * math.sqrt(3.0) * radius, across * radius) for row, across in places]
        still = {"radius": radius, "mass": float(rng.uniform(0.1, 3.0))}
        balls = [{**still, "x": x, "y": y} for x, y in apart]
        coming = {"radius": radius, "mass": float(rng.uniform(0.1, 3.0))}
        balls.insert(0, {**coming, "x": -1.0, "y": 0.0, "velocity_x": 1.0})
        collision = {"k": float(rng.choice([1.0, rng.uniform()]))}
        document = {"system": "table", "balls": balls, "collision": collision}
        document["stop"] = {"time": 5.0}
        final = solve(document, "python").sample([5.0])
        mirror = [0, *(1 + places.index((row, -across)) for row, across in places)]
        off = [final[name] + sign * final[name][mirror] for name, sign in _MIRRORED.items()]
        worst.take(float(np.max(np.abs(off))), document)
    return worst.finding(
        CHECK,
        "break of a rack, distance from its mirror image",
        "3 to 15 touching balls, joint impacts, k = 1 or random",
        0.0,
    )


_MIRRORED = {"x": -1.0, "y": 1.0, "velocity_x": -1.0, "velocity_y": 1.0}


def _gas(plan: Plan) -> list[Finding]:
    """Many balls in a box: energy, gaps at impacts."""
    drift, gap = Worst(), Worst()
    impacts = plan.amount(2_000, 100_000)
    for count in (2, 7, 30):
        rng = np.random.default_rng([plan.seed, 4, count])
        balls = []
        for n in range(count):
            ball = _ball(rng, float(rng.uniform(0.05, 0.12)))
            ball |= {"x": 0.3 * (n % 6) - 0.75, "y": 0.3 * (n // 6) - 0.6, "mass": 1.0 + 0.1 * n}
            balls.append(ball)
        document = {
            "system": "table", "balls": balls, "stop": {"collisions": impacts},
            "wall": {"shape": "rectangle", "width": 2.0, "depth": 1.8, "k": 1.0},
            "collision": {"k": 1.0, "law": "normal-impulse"},
        }  # fmt: skip
        summary = solve(document).summary_record()
        drift.take(abs(summary["energy_drift"]), document)
        gap.take(summary["max_gap"] / math.ulp(1.0), document)
    tried = f"2, 7, 30 balls in a box, k = 1, {impacts} impacts"
    return [
        drift.finding(CHECK, "relative drift of energy", tried, 1e-12),
        gap.finding(CHECK, "distance left at an impact (ulp of 1 m)", tried, 8.0),
    ]


_RECTANGLE = {"shape": "rectangle", "width": 2.4, "depth": 2.0}
_NOTCHED = [[-1.2, -1.0], [1.2, -1.0], [1.2, 1.1], [0.2, 1.0], [0.0, 0.6], [-0.2, 1.0], [-1.2, 1.0]]


def drawn(rng: Generator) -> Document:
    """A scene at random: one to three balls, any law, k from 0.2 to 1, any wall or none."""
    radii = [float(rng.uniform(0.05, 0.15)) for _ in range(int(rng.integers(1, 4)))]
    balls = []
    for number, radius in enumerate(radii):
        turn = math.tau * (number + float(rng.uniform(-0.2, 0.2))) / 3.0
        ball = _ball(rng, radius)
        place = {"x": 0.45 * math.cos(turn), "y": 0.35 * math.sin(turn)}
        balls.append(ball | place | {"mass": float(rng.uniform(0.5, 3.0))})
    shape = str(rng.choice(["ellipse", "circle", "rectangle", "polygon"]))
    walls: dict[str, Document] = {
        "ellipse": _ellipse(rng), "circle": {"shape": "circle", "radius": 1.1},
        "rectangle": _RECTANGLE, "polygon": {"shape": "polygon", "corners": _NOTCHED},
    }  # fmt: skip
    restitution = [float(rng.choice([1.0, rng.uniform(0.2, 1.0)])) for _ in range(2)]
    wall = walls[shape] | {"k": restitution[0]}
    law = str(rng.choice(LAW_NAMES))
    collision = {"k": restitution[1], "law": law, "inadmissible": "normal-impulse"}
    document: Document = {"system": "table", "balls": balls, "wall": wall, "collision": collision}
    return document | {"stop": {"collisions": 3, "bounces": 8, "time": 20.0}}


def check_tangent(plan: Plan) -> list[Finding]:
    """Tangent maps of scenes drawn at random against neighbouring motions in 50 digits."""
    tried = "tables drawn at random, up to 3 impacts of balls, 8 on walls of every shape, any law"
    return [check_maps(plan, drawn, neighbours, tried)]


def neighbours(system: Any, whole: Stretch) -> Any:
    """Return the start of a run, and what leads from others through the same events."""
    told = told_of(whole.logs["pair_log"], whole.logs["bounce_log"])
    twin = Twin(multiprecision(), system)
    start = [number for one in system.initial for number in (*one.place, *one.velocity)]
    return start, lambda moved: twin.end_of(moved, told, whole.end[0])
