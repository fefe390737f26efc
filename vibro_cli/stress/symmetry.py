"""Checks of mirror images, time reversal, and runs continued from a checkpoint."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np

from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.stress.physics import mirrored_system
from vibro_cli.stress.scenes import (
    THREE_ARCS,
    VALLEY,
    Document,
    Finding,
    Plan,
    ball,
    scene,
    solve,
    system_of,
)
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system


def check_symmetry(plan: Plan) -> list[Finding]:
    """Check mirror images on one arc and on three, reversed motions, and runs in two parts."""
    rng = np.random.default_rng([plan.seed, 11])
    count = plan.amount(20, 400)
    return [
        _mirror_on_one_arc(rng, count),
        _mirror_on_three(rng, count),
        _reversal(rng, count),
        _continued(rng, plan.amount(6, 60)),
    ]


def _balls(rng: np.random.Generator, count: int, low: float, high: float) -> list[Document]:
    """Return balls of random masses and speeds, each in its own interval of one arc."""
    edges = np.linspace(low, high, count + 1)
    return [
        ball(
            float(rng.uniform(edges[n] + 0.12, edges[n + 1] - 0.12)),
            mass=float(rng.uniform(0.3, 3.0)), speed=float(rng.normal(0.0, 1.0)),
        )
        for n in range(count)
    ]  # fmt: skip


def run_of_image(run: Run, document: Document) -> Run:
    """Solve the mirror image of the scene of a run and its document."""
    stop = document["stop"]
    image = mirrored_system(run.system)
    return simulate_system(image, stop.get("time"), stop.get("collisions"), "python")


def _pairs_of_columns(run: Run, image: Run) -> list[tuple[Any, Any]]:
    """Return columns of a run, each with that of its image mirrored back.

    Simultaneous impacts of separate pairs are in order from left to right, which is reversed in the
    image.
    """
    one, other = run.collisions, image.collisions
    rows = np.lexsort((one["ball_a"], one["t_low"], one["t"]))
    mirrored_rows = np.lexsort((-other["ball_b"], other["t_low"], other["t"]))
    names = [("t", "t", 1.0), ("t_low", "t_low", 1.0)]
    for a, b in ("ab", "ba"):
        names.append((f"angle_{a}", f"angle_{b}", -1.0))
        names.append((f"speed_{a}_post", f"speed_{b}_post", -1.0))
    return [(one[name][rows], sign * other[same][mirrored_rows]) for name, same, sign in names]


DIFFER = "runs that differ"


def _mirror_on_one_arc(rng: np.random.Generator, count: int) -> Finding:
    tried = "2 to 4 balls in a valley and their mirror images, up to 60 impacts, to the bit"
    differ = Finding(DIFFER, tried, 0.0)
    for _ in range(count):
        balls = _balls(rng, int(rng.integers(2, 5)), -2.0, 2.0)
        k = float(rng.choice([1.0, 0.9, 0.6]))
        document = scene(VALLEY, balls, k, collisions=60, time=20.0)
        run = solve(document)
        image = run_of_image(run, document)
        different = len(run.collisions["t"]) != len(image.collisions["t"])
        if not different:
            pairs = _pairs_of_columns(run, image)
            different = any(not np.array_equal(one, other) for one, other in pairs)
        differ.take(float(different), document)
    return differ


CHANGE = 2.0**-30


def _growth(
    document: Document, values: Any, values_of: Callable[[Run], Any], changed: Callable[..., float]
) -> Any:
    """Return the greatest change of values of a run per change of each number of its start."""
    greatest = np.zeros(len(values))
    for number, old in enumerate(document["balls"]):
        for key in ("angle", "speed"):
            balls = list(document["balls"])
            balls[number] = {**old, key: changed(old.get(key, 0.0))}
            others = values_of(solve({**document, "balls": balls}))
            rows = min(len(others), len(values))
            moved = np.abs(others[:rows] - values[:rows]) / CHANGE
            greatest[:rows] = np.maximum(greatest[:rows], moved)
    return greatest


def _mirror_on_three(rng: np.random.Generator, count: int) -> Finding:
    tried = "two balls on three arcs and their mirror images, times of the first 10 impacts"
    difference = Finding("difference / (eps x amplification)", tried, 64.0)
    for _ in range(count):
        balls = [*_balls(rng, 1, -1.4, 0.5), *_balls(rng, 1, -0.5, 1.4)]
        balls[1]["arc"] = 3
        document = scene(THREE_ARCS, balls, 1.0, collisions=10, time=60.0)
        run = solve(document)
        image = run_of_image(run, document)
        times, others = run.collisions["t"], image.collisions["t"]
        rows = min(len(times), len(others))
        if rows == 0:
            continue
        grown = _growth(
            document, times, lambda run: run.collisions["t"], lambda value: value * (1.0 + CHANGE)
        )
        off = np.abs(times[:rows] - others[:rows]) / np.maximum(times, grown)[:rows]
        difference.take(float(np.max(off)) / EPSILON, document)
    return difference


def _reversal(rng: np.random.Generator, count: int) -> Finding:
    """Check that a motion with all speeds reversed returns to the start."""
    tried = "two balls in a valley for 4 s, all speeds reversed, back for 4 s"
    distance = Finding("distance from the start / (eps x amplification)", tried, 64.0)
    for _ in range(count):
        document = scene(VALLEY, _balls(rng, 2, -1.5, 1.5), 1.0, time=4.0)
        run = solve(document)
        if run.end_cause != "time":
            continue
        end = run.sample([4.0])
        balls = [
            {**old, "angle": float(angle), "speed": -float(speed)}
            for old, angle, speed in zip(document["balls"], end["angle"], end["speed"], strict=True)
        ]
        back = solve({**document, "balls": balls}).sample([4.0])["angle"]
        start = np.array([old["angle"] for old in document["balls"]])
        grown = _growth(
            document, end["angle"], lambda run: run.sample([4.0])["angle"],
            lambda value: value + CHANGE,
        )  # fmt: skip
        allowed = EPSILON * max(1.0, float(np.max(grown)))
        distance.take(float(np.max(np.abs(back - start))) / allowed, document)
    return distance


def _continued(rng: np.random.Generator, count: int) -> Finding:
    tried = "one run and the same run in two parts, joined at a checkpoint, to the bit"
    differ = Finding(DIFFER, tried, 0.0)
    for number in range(count):
        trace, first = (VALLEY, 1) if number % 2 else (THREE_ARCS, 3)
        balls = [*_balls(rng, 1, -1.4, 0.5), *_balls(rng, 1, 0.6, 1.4)]
        balls[1]["arc"] = first
        k = float(rng.choice([1.0, 0.7]))
        document = scene(trace, balls, k, time=8.0)
        whole = solve(document)
        part = float(rng.uniform(0.5, 7.5))
        begun = solve({**document, "stop": {"time": part}})
        if begun.end_cause != "time":
            continue
        checkpoint = json.loads(json.dumps(begun.checkpoint()))
        rest = simulate_system(
            system_of(document), 8.0, None, "python", checkpoint=checkpoint,
            history=begun.history(),
        )  # fmt: skip
        same = whole.checkpoint() == rest.checkpoint()
        same &= whole.summary_record() == rest.summary_record()
        for name, column in whole.collisions.items():
            if column.dtype != object:
                equal = np.array_equal(column, rest.collisions[name], equal_nan=True)
                same &= bool(equal)
        differ.take(float(not same), document)
    return differ
