"""Stress tests of balls on a table: contacts with walls, escapes, impact laws, energy.

The reference uses Cartesian equations and the laws as printed in the papers, not the solver.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.stress.oracles.scene import mp, speed_changes
from vibro_cli.stress.oracles.sensitivity import check_maps
from vibro_cli.stress.scenes import Document, Finding, Plan, solve_any
from vibro_cli.systems.run import Run, Stretch
from vibro_cli.systems.table.system import TableSystem, on_left


@dataclass(frozen=True)
class SolverEvent:
    """An impact in the solver's run, of two balls or of one on the wall."""

    t: float
    """Time (s) found by the solver."""
    balls: tuple[int, ...]
    """Indices of the balls, from 0."""
    normal: float
    """Direction of the normal (rad), from the first ball to the other or to the wall."""
    law: str = ""
    edge: int = -1
    """Index of the side of the wall, negative on a curve."""


def solver_events(pairs: Any, bounces: Any) -> list[SolverEvent]:
    """Return the impacts from the logs of a run, in order."""
    found: list[tuple[int, SolverEvent]] = []
    for row in pairs:
        normal = math.atan2(row["normal_y"], row["normal_x"])
        balls = (int(row["a"]), int(row["b"]))
        one = SolverEvent(float(row["t"]), balls, normal, LAW_NAMES[row["law"]])
        found.append((int(row["event"]), one))
    for row in bounces:
        normal = math.atan2(row["normal_y"], row["normal_x"])
        one = SolverEvent(float(row["t"]), (int(row["ball"]),), normal, edge=int(row["edge"]))
        found.append((int(row["event"]), one))
    return [one for _, one in sorted(found, key=lambda each: each[0])]


class ReferenceSolver:
    """Reference solver of balls on a table."""

    def __init__(self, system: TableSystem) -> None:
        self.system = system
        self.wall: Any = system.wall  # not None where a ball bounces
        self.radii = [mp.mpf(body.radius) for body in system.bodies]
        self.masses = [mp.mpf(body.mass) for body in system.bodies]
        self.rolling = [mp.mpf(body.kappa) * body.mass for body in system.bodies]

    def end_of(self, start: Sequence[Any], events: Sequence[SolverEvent], end: float) -> list[Any]:
        """Return the state at a time (s), after the `events` in between.

        States are ``x, y, vx, vy`` of each ball, ball by ball.
        """
        state = [list(start[4 * n : 4 * n + 4]) for n in range(len(self.radii))]
        now = mp.zero
        for one in events:
            step, normal = self.contact(state, now, one)
            for ball in state:
                ball[0] += step * ball[2]
                ball[1] += step * ball[3]
            now += step
            if len(one.balls) == 2:
                self._collide(state, one)
            else:
                self._rebound(state[one.balls[0]], normal)
        step = mp.mpf(end) - now
        return [
            number
            for x, y, vx, vy in state
            for number in (x + step * vx, y + step * vy, vx, vy)
        ]  # fmt: skip

    def contact(self, state: list[list[Any]], now: Any, one: SolverEvent) -> tuple[Any, Any]:
        """Return the time until an impact (s), and the normal of the wall there."""
        if len(one.balls) == 2:
            a, b = one.balls
            touch = 2 * mp.sqrt(self.radii[a] * self.radii[b])
            way = [state[b][n] - state[a][n] for n in range(4)]
            return self._fall(way, touch), None
        ball = one.balls[0]
        if one.edge < 0:
            return self._curved(state[ball], self.radii[ball], mp.mpf(one.t) - now, one)
        corners = [[mp.mpf(v) for v in corner] for corner in self.wall.corners]
        (x, y), (ex, ey) = corners[one.edge], corners[(one.edge + 1) % len(corners)]
        px, py, vx, vy = state[ball]
        side = on_left(self.wall)
        length = mp.sqrt((ex - x) ** 2 + (ey - y) ** 2)
        normal = side * (ey - y) / length, -side * (ex - x) / length
        if math.cos(one.normal) * normal[0] + math.sin(one.normal) * normal[1] > 1.0 - 1e-12:
            left = (x - px) * normal[0] + (y - py) * normal[1] - self.radii[ball]
            return left / (vx * normal[0] + vy * normal[1]), normal
        step = self._fall([px - x, py - y, vx, vy], self.radii[ball])
        return step, self._unit(x - px - step * vx, y - py - step * vy)

    def _fall(self, way: Sequence[Any], distance: Any) -> Any:
        """Return the time (s) when the length of ``(x, y) + (vx, vy) t`` falls to a distance."""
        x, y, vx, vy = way
        square, along = vx**2 + vy**2, x * vx + y * vy
        beyond = x**2 + y**2 - distance**2
        return (-along - mp.sqrt(along**2 - square * beyond)) / square

    def _unit(self, x: Any, y: Any) -> tuple[Any, Any]:
        size = mp.sqrt(x**2 + y**2)
        return x / size, y / size

    def _curved(self, ball: list[Any], r: Any, guess: Any, one: SolverEvent) -> tuple[Any, Any]:
        """Return time (s) and normal of a contact with a conic, by Newton from the solver's."""
        a, b = (mp.mpf(axis) for axis in self.wall.semi_axes)
        x, y = (ball[n] - mp.mpf(self.wall.centre[n]) for n in (0, 1))
        side = 1 if self.wall.inside else -1

        def outer(angle: Any) -> Any:
            return self._unit(b * mp.cos(angle), a * mp.sin(angle))

        def equations(t: Any, angle: Any) -> list[Any]:
            n = outer(angle)
            return [
                x + ball[2] * t - (a * mp.cos(angle) - side * r * n[0]),
                y + ball[3] * t - (b * mp.sin(angle) - side * r * n[1]),
            ]

        cosine, sine = side * math.cos(one.normal), side * math.sin(one.normal)
        angle = math.atan2(float(b) * sine, float(a) * cosine)
        tolerance = mp.mpf(10) ** (6 - 2 * mp.dps)
        t, angle = mp.findroot(equations, (guess, mp.mpf(angle)), tol=tolerance)
        n = outer(angle)
        return t, (side * n[0], side * n[1])

    def _rebound(self, ball: list[Any], normal: tuple[Any, Any]) -> None:
        speed = ball[2] * normal[0] + ball[3] * normal[1]
        for axis in (0, 1):
            ball[2 + axis] -= (1 + mp.mpf(self.wall.restitution)) * speed * normal[axis]

    def _collide(self, state: list[list[Any]], one: SolverEvent) -> None:
        """Change the components along the line of centres by the law."""
        pair = one.balls
        n = self._unit(*(state[pair[1]][axis] - state[pair[0]][axis] for axis in (0, 1)))
        numbers = ([of[ball] for ball in pair] for of in (self.radii, self.masses, self.rolling))
        speeds = [state[ball][2] * n[0] + state[ball][3] * n[1] for ball in pair]
        changes = speed_changes(one.law, mp.mpf(self.system.restitution), speeds, *numbers)
        for ball, change in zip(pair, changes, strict=True):
            for axis in (0, 1):
                state[ball][2 + axis] += change * n[axis]


Generator = np.random.Generator


def check(plan: Plan) -> list[Finding]:
    """Check elliptic walls, skew impacts, the break of a rack, and many balls in a box."""
    return [*_foci(plan), _contact(plan), *_skew(plan), _rack(plan), *_gas(plan)]


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
    """Check the product of angular momenta about the foci (r = 0, k = 1), and that none escapes."""
    bounces, far = plan.amount(10_000, 100_000), plan.amount(50_000, 1_000_000)
    product = Finding(
        "product of angular momenta about the foci, change over that of their largest",
        f"r = 0, k = 1, {bounces} bounces each",
        1e-12,
    )
    escape = Finding(
        "place of contact off the elliptic wall, (x/a)^2 + (y/b)^2 - 1",
        f"r = 0, 0.05, 0.2, {far} bounces each",
        1e-14,
    )
    rng = np.random.default_rng([plan.seed, 1])
    for _ in range(plan.amount(4, 12)):
        wall, particle = _ellipse(rng), _ball(rng, 0.0)
        document = {"system": "table", "wall": wall, "balls": [particle]}
        run = solve_any({**document, "stop": {"bounces": bounces}})
        product.take(_product_drift(run, wall), document)
    for radius in (0.0, 0.05, 0.2):
        wall, ball = _ellipse(rng), _ball(rng, radius)
        document = {"system": "table", "wall": wall, "balls": [ball], "stop": {"bounces": far}}
        escape.take(_beyond(solve_any(document), wall, radius), document)
    return [product, escape]


def _product_drift(run: Run, wall: Document) -> float:
    """Return the change of the product relative to that of the largest momenta.

    The product itself may be nearly 0.
    """
    a, b = wall["semi_axis_x"], wall["semi_axis_y"]
    c = math.sqrt(abs((a - b) * (a + b)))
    fx, fy = (c, 0.0) if a > b else (0.0, c)
    path = run.trajectory.balls[0]  # type: ignore[attr-defined]
    momenta = np.array([
        (path["x"] - sign * fx) * path["vy"] - (path["y"] - sign * fy) * path["vx"]
        for sign in (1.0, -1.0)
    ])  # fmt: skip
    product = momenta.prod(axis=0)
    size = np.abs(momenta).max(axis=1).prod()
    return float(np.max(np.abs(product - product[0])) / size)


def _beyond(run: Run, wall: Document, radius: float) -> float:
    rows = run.bounces
    if run.end_cause != "bounces" or not np.all(np.diff(rows["t"]) >= 0.0):
        return math.inf
    x = rows["x"] + radius * np.cos(rows["normal_angle"])
    y = rows["y"] + radius * np.sin(rows["normal_angle"])
    off = (x / wall["semi_axis_x"]) ** 2 + (y / wall["semi_axis_y"]) ** 2 - 1.0
    return float(np.max(np.abs(off)))


def _contact(plan: Plan) -> Finding:
    """Check times of first contacts with elliptic walls, also grazing ones, against 50 digits."""
    quantity = "time of contact with an elliptic wall, error over 3 m"
    error = Finding(quantity, "inside and outside, r up to 0.25, against 50 digits", 1e-14)
    rng = np.random.default_rng([plan.seed, 2])
    for _ in range(plan.amount(40, 400)):
        side = str(rng.choice(["inside", "outside"]))
        wall, radius = _ellipse(rng, side), float(rng.uniform(0.0, 0.25))
        ball = _ball(rng, radius)
        if side == "outside":
            ball["x"], ball["y"] = -3.0 * ball["velocity_x"], -3.0 * ball["velocity_y"]
        document = {"system": "table", "wall": wall, "balls": [ball], "stop": {"bounces": 1}}
        run = solve_any(document, "python")
        start = [[mp.mpf(ball[name]) for name in ("x", "y", "velocity_x", "velocity_y")]]
        t, t_low, normal = (float(run.bounces[name][0]) for name in ("t", "t_low", "normal_angle"))
        exact, _ = ReferenceSolver(run.system).contact(start, mp.zero, SolverEvent(t, (0,), normal))
        error.take(float(abs(exact - mp.mpf(t) - mp.mpf(t_low))) / 3.0, document)
    return error


def _skew(plan: Plan) -> list[Finding]:
    """Check skew impacts: tangential components persist, equal balls part at a right angle."""
    tried = "random skew impacts at speeds up to 1 m/s"
    stays = Finding("change of a tangential component (m/s)", tried, 1e-15)
    angle = Finding(
        "scalar product of the velocities after, equal balls, one at rest, k = 1", tried, 1e-15
    )
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
        rows = solve_any(document, "python").collisions
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
    return [stays, angle]


def _rack(plan: Plan) -> Finding:
    """Check the mirror symmetry of a triangle of touching balls broken along its axis."""
    tried = "3 to 15 touching balls, simultaneous impacts, k = 1 or random"
    distance = Finding("break of a rack, distance from its mirror image", tried, 0.0)
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
        final = solve_any(document, "python").sample([5.0])
        mirror = [0, *(1 + places.index((row, -across)) for row, across in places)]
        off = [final[name] + sign * final[name][mirror] for name, sign in _MIRRORED.items()]
        distance.take(float(np.max(np.abs(off))), document)
    return distance


_MIRRORED = {"x": -1.0, "y": 1.0, "velocity_x": -1.0, "velocity_y": 1.0}


def _gas(plan: Plan) -> list[Finding]:
    """Check energy and gaps at impacts for many balls in a box."""
    impacts = plan.amount(2_000, 100_000)
    tried = f"2, 7, 30 balls in a box, k = 1, {impacts} impacts"
    drift = Finding("relative drift of energy", tried, 1e-12)
    gap = Finding("distance left at an impact (ulp of 1 m)", tried, 8.0)
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
        summary = solve_any(document).summary_record()
        drift.take(abs(summary["energy_drift"]), document)
        gap.take(summary["max_gap"] / math.ulp(1.0), document)
    return [drift, gap]


_NOTCHED = [[-1.2, -1.0], [1.2, -1.0], [1.2, 1.1], [0.2, 1.0], [0.0, 0.6], [-0.2, 1.0], [-1.2, 1.0]]
_WALLS: list[Document] = [
    {"shape": "circle", "radius": 1.1},
    {"shape": "rectangle", "width": 2.4, "depth": 2.0},
    {"shape": "polygon", "corners": _NOTCHED},
]
"""Walls of every shape but the ellipse, which is drawn."""


def drawn(rng: Generator) -> Document:
    """Draw a random scene: one to three balls, any law, k from 0.2 to 1, a wall of any shape."""
    radii = [float(rng.uniform(0.05, 0.15)) for _ in range(int(rng.integers(1, 4)))]
    balls = []
    for number, radius in enumerate(radii):
        turn = math.tau * (number + float(rng.uniform(-0.2, 0.2))) / 3.0
        ball = _ball(rng, radius)
        place = {"x": 0.45 * math.cos(turn), "y": 0.35 * math.sin(turn)}
        balls.append(ball | place | {"mass": float(rng.uniform(0.5, 3.0))})
    shape = int(rng.integers(1 + len(_WALLS)))
    form = [_ellipse(rng), *_WALLS][shape]
    restitution = [float(rng.choice([1.0, rng.uniform(0.2, 1.0)])) for _ in range(2)]
    wall = form | {"k": restitution[0]}
    law = str(rng.choice(LAW_NAMES))
    collision = {"k": restitution[1], "law": law, "inadmissible": "normal-impulse"}
    document: Document = {"system": "table", "balls": balls, "wall": wall, "collision": collision}
    return document | {"stop": {"collisions": 3, "bounces": 8, "time": 20.0}}


def check_tangent(plan: Plan) -> list[Finding]:
    """Compare tangent maps of random scenes with neighbouring motions in 50 digits."""
    tried = "tables drawn at random, up to 3 impacts of balls, 8 on walls of every shape, any law"
    return [check_maps(plan, drawn, neighbours, tried)]


def neighbours(system: Any, whole: Stretch) -> Any:
    """Return the start of a run, and a map from nearby starts through the same events."""
    events = solver_events(whole.logs["pair_log"], whole.logs["bounce_log"])
    twin = ReferenceSolver(system)
    start = [number for one in system.initial for number in (*one.place, *one.velocity)]
    return start, lambda moved: twin.end_of(moved, events, whole.end[0])
