"""Bodies on springs: energy kept, motion reversed, losses of accumulations in the balance."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibro_cli.api import simulate
from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.scenario import any_scenario_of
from vibro_cli.stress.finding import Document, Finding, Plan, Worst
from vibro_cli.stress.oracles.neighbours import check_maps
from vibro_cli.systems.run import Run
from vibro_cli.systems.springs.system import singular_points
from vibro_cli.systems.springs.twin import Twin, told_of
from vibro_cli.systems.stream import Stretch

CHECK = "springs"


def check(plan: Plan) -> list[Finding]:
    """Drift of energy at k = 1, time reversal, singular points, balance of accumulations."""
    return [*_energy(plan), _reversal(plan), _at_rest(plan), _balance(plan)]


def solve(document: Document, engine: str = "compiled") -> Run:
    """Run the document of bodies on springs."""
    return simulate(any_scenario_of(document), engine)


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
    drift, gap = Worst(), Worst()
    for balls in _scenes().values():
        document = _document(balls, 1.0, collisions=impacts)
        summary = solve(document).summary_record()
        drift.take(abs(summary["energy_drift"]), document)
        gap.take(summary["max_gap"] / math.ulp(8.0), document)
    tried = f"k = 1, {impacts} impacts each: {', '.join(_scenes())}"
    return [
        drift.finding(CHECK, "relative drift of energy", tried, 1e-12),
        gap.finding(CHECK, "distance left at an impact (ulp of 8 m)", tried, 8.0),
    ]


def _reversal(plan: Plan) -> Finding:
    """Forward, then back with the speeds reversed, through the same impacts."""
    worst = Worst()
    for balls in _scenes().values():
        for duration in (1.0, 3.0, plan.amount(6, 10)):
            forward = solve(_document(balls, 1.0, time=duration), "python").sample([duration])
            back = [
                ball | {"position": float(forward["x"][n]), "speed": -float(forward["speed"][n])}
                for n, ball in enumerate(balls)
            ]
            document = _document(back, 1.0, time=duration)
            final = solve(document, "python").sample([duration])
            for n, ball in enumerate(balls):
                worst.take(abs(float(final["x"][n]) - ball["position"]), document)
                worst.take(abs(float(final["speed"][n]) + ball["speed"]), document)
    tried = "up to 10 s and back, through the impacts"
    return worst.finding(CHECK, "error of return (m, m/s)", tried, 1e-12)


def _at_rest(plan: Plan) -> Finding:
    """In each singular point a body stays."""
    worst = Worst()
    rng = np.random.default_rng([plan.seed, 5])
    for _ in range(plan.amount(10, 100)):
        shape = float(rng.uniform(0.5, 5.0)), float(rng.uniform(0.5, 5.0))
        system = solve(_document([_body(0.0, 0.0, shape, 0.0)], 1.0, time=0.1), "python").system
        for place, kind in singular_points(system.springs[0]):
            if kind == "centre":
                document = _document([_body(place, 0.0, shape, 0.0)], 1.0, time=20.0)
                final = solve(document, "python").sample([20.0])
                worst.take(abs(float(final["x"][0]) - place), document)
    return worst.finding(
        CHECK, "distance from the centre after 20 s at rest in it (m)", "random springs", 1e-14
    )


def _balance(plan: Plan) -> Finding:
    """With springs that press bodies together: start less end is the sum of the rows' losses."""
    worst = Worst()
    for k in (0.0, 0.3, 0.6, 0.9, 0.99):
        balls = [
            _body(-1.0, 0.0, (0.5, 1.0), 0.3),
            _body(1.2, 0.0, (0.5, 1.0), -0.3) | {"mass": 1.5},
            _body(2.4, 0.0, (0.5, 1.0), 0.0) | {"mass": 0.7},
        ][: plan.amount(2, 3)]
        document = _document(balls, k, time=20.0)
        run = solve(document)
        summary = run.summary_record()
        lost = summary["energy_start"] - summary["energy_end"]
        found = float(np.sum(run.collisions["energy_loss"]))
        worst.take(abs(lost - found) / summary["energy_start"], document)
    return worst.finding(
        CHECK,
        "energy lost without a row, relative",
        "bodies pressed together, k = 0 ... 0.99",
        1e-12,
    )


def drawn(rng: np.random.Generator) -> Document:
    """A scene at random: two or three bodies, springs of one or three singular points, any law."""
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
    """Tangent maps of scenes drawn at random against neighbouring motions in 50 digits."""
    tried = "bodies on springs drawn at random, up to 4 impacts, any law, lasting contact"
    return [check_maps(plan, drawn, neighbours, tried)]


def neighbours(system: Any, whole: Stretch) -> Any:
    """Return the start of a run, and what leads from others through the same events."""
    told = told_of(whole.logs["impacts"], whole.logs["states"], len(system.bodies))
    twin = Twin(system)
    start = [number for one in system.initial for number in (one.position, one.speed)]
    return start, lambda moved: twin.end_of(moved, told, whole.end[0])
