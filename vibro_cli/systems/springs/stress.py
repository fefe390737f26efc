"""Stress tests of bodies on springs: energy, time reversal, energy balance of accumulations.

Tangent maps are compared with motions of the oracle, which takes springs as forces on a level line.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.stress.oracles import sensitivity
from vibro_cli.stress.oracles.motion import Series, Whole, product, real, scaled, square, whole
from vibro_cli.stress.oracles.scene import Body, Piece, Scene, mp
from vibro_cli.stress.oracles.sensitivity import Neighbours, check_maps
from vibro_cli.stress.scenes import Document, Finding, Plan, solve_any
from vibro_cli.systems.run import Stretch
from vibro_cli.systems.springs.system import Spring, SpringsSystem, singular_points

# The line on which bodies move, far longer than their motions (m).
_LINE = Piece(0, mp.mpf(200), (mp.zero, mp.zero), (mp.zero, mp.zero), mp.mpf(-100))


class _Force:
    """Series of a spring's acceleration ``-w^2 (x - l x u)`` over a step, as the oracle takes it.

    x is measured from the foot; ``u = 1/sqrt(b^2 + x^2)`` obeys ``u' = -x v u^3``.
    """

    def __init__(self, spring: Spring, rolling: Any, h: Whole) -> None:
        self._h, self._square = h, whole(mp.mpf(spring.stiffness) / rolling)
        self._length, self._height = whole(mp.mpf(spring.length)), mp.mpf(spring.height)
        self._foot = whole(mp.mpf(spring.foot))
        self._x: Series = []
        self._u: Series = []
        self._uu: Series = []
        self._uuu: Series = []
        self._xv: Series = []

    def append(self, k: int, place: Series, v: Series) -> Whole:
        """Return coefficient k of the acceleration, the next one."""
        if k == 0:
            self._x.append(place[0] - self._foot)
            self._u.append(whole(1 / mp.hypot(self._height, real(self._x[0]))))
        else:
            self._uu.append(square(self._u, k - 1))
            self._uuu.append(product(self._uu, self._u, k - 1))
            self._xv.append(product(self._x, v, k - 1))
            self._u.append(-scaled(self._h, product(self._xv, self._uuu, k - 1)) // k)
            self._x.append(place[k])
        stretch = self._x[k] - scaled(self._length, product(self._x, self._u, k))
        return -scaled(self._square, stretch)


def _scene(system: SpringsSystem) -> Scene:
    bodies = []
    for body, spring in zip(system.bodies, system.springs, strict=True):
        mass, kappa = mp.mpf(body.mass), mp.mpf(body.kappa)
        bodies.append(Body(mp.mpf(body.radius), mass, kappa, partial(_Force, spring, kappa * mass)))
    starts = ((0, mp.mpf(one.position), mp.mpf(one.speed)) for one in system.initial)
    return Scene(
        gravity=mp.one,  # of no effect on a level line
        pieces=(_LINE,),
        closed=False,
        bodies=tuple(bodies),
        starts=tuple(starts),
        restitution=tuple(map(mp.mpf, system.restitution)),
        walls=(None, None),
    )


def check(plan: Plan) -> list[Finding]:
    """Check energy drift at k = 1, time reversal, singular points, balance of accumulations."""
    return [*_energy(plan), _reversal(plan), _at_rest(plan), _balance(plan)]


def _body(position: float, speed: float, shape: tuple[float, float], foot: float) -> Document:
    length, height = shape
    spring = {"stiffness": 6.0, "length": length, "height": height, "foot": foot}
    start = {"position": position, "speed": speed}
    return {"body": "disk", "radius": 0.4, "mass": 1.0, **start, "spring": spring}


def _scenes() -> dict[str, list[Document]]:
    """Bodies that meet again and again: with three singular points each, and with one."""
    heavy: Document = {"mass": 2.0}
    return {
        "three singular points (C fig. 5)": [
            _body(-4.0, 8.5, (5.0, 1.0), 0.0), _body(7.0, -2.0, (5.0, 1.5), 3.0) | heavy,
        ],
        "one singular point": [
            _body(-1.0, 2.0, (0.8, 1.0), 0.0), _body(0.5, -1.5, (1.0, 1.2), 0.4) | heavy,
        ],
    }  # fmt: skip


def _document(balls: list[Document], k: float, **stop: float) -> Document:
    document: Document = {"system": "springs", "balls": balls, "stop": stop}
    return {**document, "collision": {"k": k}} if len(balls) > 1 else document


def _energy(plan: Plan) -> list[Finding]:
    impacts = plan.amount(3_000, 100_000)
    tried = f"k = 1, {impacts} impacts each: {', '.join(_scenes())}"
    drift = Finding("relative drift of energy", tried, 1e-12)
    gap = Finding("distance left at an impact (ulp of 8 m)", tried, 8.0)
    for balls in _scenes().values():
        document = _document(balls, 1.0, collisions=impacts)
        summary = solve_any(document).summary_record()
        drift.take(abs(summary["energy_drift"]), document)
        gap.take(summary["max_gap"] / math.ulp(8.0), document)
    return [drift, gap]


def _reversal(plan: Plan) -> Finding:
    """Forward, then back with the speeds reversed, through the same impacts."""
    tried = "up to 10 s and back, through the impacts"
    error = Finding("error of return (m, m/s)", tried, 1e-12)
    for balls in _scenes().values():
        for duration in (1.0, 3.0, plan.amount(6, 10)):
            forward = solve_any(_document(balls, 1.0, time=duration), "python").sample([duration])
            back = [
                ball | {"position": float(forward["x"][n]), "speed": -float(forward["speed"][n])}
                for n, ball in enumerate(balls)
            ]
            document = _document(back, 1.0, time=duration)
            final = solve_any(document, "python").sample([duration])
            for n, ball in enumerate(balls):
                error.take(abs(float(final["x"][n]) - ball["position"]), document)
                error.take(abs(float(final["speed"][n]) + ball["speed"]), document)
    return error


def _at_rest(plan: Plan) -> Finding:
    """Check that a body at rest in a centre stays there."""
    quantity = "distance from the centre after 20 s at rest in it (m)"
    distance = Finding(quantity, "random springs", 1e-14)
    rng = np.random.default_rng([plan.seed, 5])
    for _ in range(plan.amount(10, 100)):
        shape = float(rng.uniform(0.5, 5.0)), float(rng.uniform(0.5, 5.0))
        system = solve_any(_document([_body(0.0, 0.0, shape, 0.0)], 1.0, time=0.1), "python").system
        for place, kind in singular_points(system.springs[0]):
            if kind == "centre":
                document = _document([_body(place, 0.0, shape, 0.0)], 1.0, time=20.0)
                final = solve_any(document, "python").sample([20.0])
                distance.take(abs(float(final["x"][0]) - place), document)
    return distance


def _balance(plan: Plan) -> Finding:
    """Check the energy balance of bodies pressed together: all losses must be in the table."""
    tried = "bodies pressed together, k = 0 ... 0.99"
    missing = Finding("energy lost without a row, relative", tried, 1e-12)
    for k in (0.0, 0.3, 0.6, 0.9, 0.99):
        balls = [
            _body(-1.0, 0.0, (0.5, 1.0), 0.3),
            _body(1.2, 0.0, (0.5, 1.0), -0.3) | {"mass": 1.5},
            _body(2.4, 0.0, (0.5, 1.0), 0.0) | {"mass": 0.7},
        ][: plan.amount(2, 3)]
        document = _document(balls, k, time=20.0)
        run = solve_any(document)
        summary = run.summary_record()
        lost = summary["energy_start"] - summary["energy_end"]
        found = float(np.sum(run.collisions["energy_loss"]))
        missing.take(abs(lost - found) / summary["energy_start"], document)
    return missing


def drawn(rng: np.random.Generator) -> Document:
    """Draw a random scene: two or three bodies, springs with 1 or 3 singular points, any law."""
    balls: list[Document] = []
    restitution: list[float] = []
    for number in range(int(rng.integers(2, 4))):
        place = number + float(rng.uniform(-0.04, 0.04))
        shape = float(rng.uniform(0.3, 2.5)), float(rng.uniform(0.5, 1.5))
        foot = place + float(rng.uniform(-0.8, 0.8))
        ball = _body(place, float(rng.uniform(-3.0, 3.0)), shape, foot)
        ball["spring"]["stiffness"] = float(rng.uniform(3.0, 12.0))
        radius, mass = float(rng.uniform(0.3, 0.45)), float(rng.uniform(0.5, 3.0))
        ball |= {"body": str(rng.choice(["disk", "ball"])), "radius": radius, "mass": mass}
        balls.append(ball)
        restitution.append(float(rng.choice([1.0, 0.0, rng.uniform(0.2, 1.0)])))
    collision = {"k": restitution[1:], "law": str(rng.choice(LAW_NAMES))}
    collision["inadmissible"] = "normal-impulse"
    stop = {"collisions": 4, "time": 2.0}
    return {"system": "springs", "balls": balls, "collision": collision, "stop": stop}


def check_tangent(plan: Plan) -> list[Finding]:
    """Compare tangent maps of random scenes with neighbouring motions in 50 digits."""
    tried = "bodies on springs drawn at random, up to 4 impacts, any law, lasting contact"
    return [check_maps(plan, drawn, neighbours, tried)]


def neighbours(system: Any, whole: Stretch) -> Neighbours:
    """Return the start of a run, and the oracle's map from starts nearby."""
    impacts = whole.logs["impacts"]
    # A pair may have several impacts at one instant, which are one of the oracle.
    rows = dict.fromkeys(zip(impacts["t"].tolist(), impacts["pair"].tolist(), strict=True))
    pairs = [(pair, pair + 1) for _, pair in rows]
    return sensitivity.neighbours(system, _scene(system), pairs, whole.end[0])
