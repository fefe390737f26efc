"""Random scenes with all features of scenarios, independent of the solver.

They have open and closed traces, lines of every slope (often level ones), walls, bodies that touch
at the start, unequal bodies, all laws, restitution from 0 to 1, and rotating traces. Some are their
own mirror image, with simultaneous impacts. Seed and number determine a scene.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibro_cli.scenario.problems import ScenarioError
from vibro_cli.stress.scenes import Document, system_of

Random = np.random.Generator
Chain = tuple[float, list[Document]]

KINDS = ("ball", "disk", "hoop", "particle", "hollow_ball")
COUNTS = (1, 2, 3, 4, 5, 6)
COUNT_SHARES = (0.03, 0.36, 0.27, 0.24, 0.06, 0.04)
# Under a law that does not act along the line of centres, a row may make millions of impacts.
MOST_IMPACTS = 20_000
# At least one in some hundred attempts gives a mechanically possible scene.
ATTEMPTS = 1000


def draw(seed: int, number: int) -> Document:
    """Return the scene of a number: its first attempt that is mechanically possible."""
    rng = np.random.default_rng([seed, 41, number])
    for _ in range(ATTEMPTS):
        document = _scene(rng)
        document["name"] = f"drawn-{seed}-{number}"
        try:
            system_of(document)
        except ScenarioError:
            continue
        return document
    raise ArithmeticError(f"no scene of seed {seed}, number {number} is mechanically possible")


def _scene(rng: Random) -> Document:
    symmetric = rng.random() < 0.12
    closed = not symmetric and rng.random() < 0.3
    start, arcs = _closed_chain(rng) if closed else _open_chain(rng)
    if symmetric:
        start, arcs = _with_mirror_image(start, arcs)
    trace: Document = {"start_slope": start, "closed": closed, "arcs": arcs}
    if rng.random() < 0.08:
        trace["surface"] = "one-sided"
    if rng.random() < 0.12:
        trace["turning"] = _axis(rng, arcs)
    balls = _bodies(rng, start, arcs)
    if symmetric:
        _mirror_the_bodies(balls, arcs)
    document: Document = {
        "gravity": 9.81,
        "trace": trace,
        "balls": balls,
        "stop": {"time": float(rng.uniform(0.5, 6.0)), "collisions": MOST_IMPACTS},
    }
    if len(balls) > 1:
        document["collision"] = _collision(rng, len(balls), closed, symmetric)
    if not closed:
        left = _end(rng)
        document["ends"] = {"left": left, "right": left if symmetric else _end(rng)}
    return document


def _slope(rng: Random) -> float:
    """Return a slope (rad): mostly less than a right angle, often level, sometimes more."""
    kind = rng.random()
    if kind < 0.2:
        return 0.0
    if kind < 0.25:
        return float(rng.normal(0.0, 1.0) * 10.0 ** rng.uniform(-17.0, -3.0))
    if kind < 0.28:
        return float(rng.choice([-0.5, 0.5]) * math.pi)
    if kind < 0.4:
        return float(rng.uniform(-2.6, 2.6))
    return float(rng.uniform(-1.2, 1.2))


def _line(rng: Random) -> Document:
    return {"shape": "line", "length": float(rng.uniform(0.2, 2.0))}


def _arc(rng: Random, slope: float, end: float) -> Document:
    shape = "valley" if end > slope else "hump"
    return {"shape": shape, "radius": float(rng.uniform(0.3, 2.0)), "end_slope": end}


def _open_chain(rng: Random) -> Chain:
    """Return one to six pieces, mostly downhill at the left end and uphill at the right end."""
    start = slope = float(rng.uniform(-2.0, -0.3)) if rng.random() < 0.7 else _slope(rng)
    count = int(rng.integers(1, 7))
    arcs: list[Document] = []
    for number in range(count):
        if rng.random() < 0.3:
            arcs.append(_line(rng))
            continue
        rising = number == count - 1 and rng.random() < 0.7
        end = float(rng.uniform(0.3, 2.0)) if rising else _slope(rng)
        if abs(end - slope) > 0.02:
            arcs.append(_arc(rng, slope, end))
            slope = end
    return start, arcs or [_line(rng)]


def _closed_chain(rng: Random) -> Chain:
    """Return a closed trace: random pieces, followed by the same pieces turned by 180 degrees."""
    start = float(rng.choice([-math.pi, -0.5 * math.pi, 0.0, rng.uniform(-math.pi, 0.0)]))
    if rng.random() < 0.15:
        radius = float(rng.uniform(0.4, 2.0))
        ring = {"shape": "valley", "radius": radius, "end_slope": start + 2.0 * math.pi}
        return start, [ring]
    half: list[Document] = []
    slope = start
    for _ in range(int(rng.integers(0, 4))):
        if rng.random() < 0.5:
            half.append(_line(rng))
            continue
        end = start + float(rng.uniform(-0.6, 3.6))
        half.append(_arc(rng, slope, end))
        slope = end
    if abs(start + math.pi - slope) > 0.02:
        half.append(_arc(rng, slope, start + math.pi))
    again = [
        {**arc, "end_slope": arc["end_slope"] + math.pi} if "end_slope" in arc else dict(arc)
        for arc in half
    ]
    again_last = again[-1]
    if "end_slope" in again_last:
        again_last["end_slope"] = start + 2.0 * math.pi
    return start, [*half, *again]


def slopes_of(start: float, arcs: list[Document]) -> list[float]:
    """Return the slopes (rad) at the ends of all pieces, from left to right."""
    slopes = [start]
    for arc in arcs:
        slopes.append(arc.get("end_slope", slopes[-1]))
    return slopes


def _with_mirror_image(start: float, arcs: list[Document]) -> Chain:
    """Return a chain followed by its mirror image, level in the middle."""
    arcs = arcs[:3]
    if slopes_of(start, arcs)[-1] != 0.0:
        arcs[-1] = {"shape": "valley", "radius": 1.0, "end_slope": 0.0}
        start = -abs(start) - 0.1
        arcs = arcs[-1:]
    slopes = slopes_of(start, arcs)
    for arc, before in zip(arcs[::-1], slopes[-2::-1], strict=True):
        arcs.append({**arc, "end_slope": -before} if "end_slope" in arc else dict(arc))
    return start, arcs


def _axis(rng: Random, arcs: list[Document]) -> Document:
    rate = float(rng.uniform(-4.0, 4.0))
    curved = [number for number, arc in enumerate(arcs, 1) if arc["shape"] != "line"]
    if curved and rng.random() < 0.5:
        return {"through_arc": int(rng.choice(curved)), "rate": rate}
    return {"x": float(rng.uniform(-1.0, 3.0)), "rate": rate}


def _end(rng: Random) -> Any:
    """Return an end of the trace: a wall, or an open end."""
    if rng.random() < 0.2:
        return "stop"
    restitution = rng.choice([0.0, 0.3, 0.9, 1.0, rng.uniform(0.0, 1.0)])
    return {"wall": float(restitution)}


def restitution(rng: Random) -> float:
    """Return a coefficient of restitution: mostly low, often at an end of its range."""
    kind = rng.random()
    if kind < 0.25:
        return 0.0
    if kind < 0.35:
        return 1.0
    if kind < 0.4:
        return float(rng.choice([1.0e-300, 1.0e-9, 1.0 - 2.0**-53]))
    return float(rng.uniform(0.0, 0.6) if kind < 0.8 else rng.uniform(0.6, 1.0))


def _collision(rng: Random, count: int, closed: bool, symmetric: bool) -> Document:
    pairs = count if closed and count > 2 else count - 1
    k: Any = restitution(rng)
    if rng.random() < 0.2 and not symmetric:
        k = [restitution(rng) for _ in range(pairs)]
    return {
        "law": str(rng.choice(["normal-impulse", "hedrih", "translational"], p=[0.6, 0.25, 0.15])),
        "k": k,
        "inadmissible": "normal-impulse" if rng.random() < 0.75 else "stop",
    }


def _bodies(rng: Random, start: float, arcs: list[Document]) -> list[Document]:
    """Return bodies in order along the trace, some of them in contact with the previous one."""
    count = int(rng.choice(COUNTS, p=COUNT_SHARES))
    lengths, slopes = [], slopes_of(start, arcs)
    for arc, low, high in zip(arcs, slopes, slopes[1:], strict=False):
        lengths.append(arc["length"] if "length" in arc else arc["radius"] * abs(high - low))
    places = np.sort(rng.uniform(0.0, sum(lengths), count))
    alike, kind = rng.random() < 0.45, str(rng.choice(KINDS))
    radius, mass = float(rng.uniform(0.03, 0.15)), float(rng.uniform(0.2, 5.0))
    in_row = rng.random() < 0.35
    together = float(rng.normal(0.0, 1.5))
    still = rng.random() < 0.3
    balls: list[Document] = []
    for place in places:
        equal = alike and rng.random() < 0.9
        ball: Document = {
            "body": kind if equal and rng.random() < 0.7 else str(rng.choice(KINDS)),
            "radius": radius if alike else float(rng.uniform(0.03, 0.15)),
            "mass": mass if equal else float(np.exp(rng.normal(0.0, 1.2))),
        }
        ball |= _place(arcs, lengths, slopes, float(place))
        if balls and rng.random() < (0.7 if in_row else 0.08):
            ball.pop("angle", None)
            ball.pop("position", None)
            ball |= {"touching": "previous", "arc": balls[-1]["arc"]}
        ball["speed"] = _speed(rng, still, together)
        balls.append(ball)
    return balls


def _speed(rng: Random, still: bool, together: float) -> float:
    kind = rng.random()
    if still or kind < 0.25:
        return 0.0
    if kind < 0.4:
        return together
    return float(rng.normal(0.0, 1.5 if kind < 0.95 else 6.0))


def _place(
    arcs: list[Document], lengths: list[float], slopes: list[float], along: float
) -> Document:
    """Return the piece, and the place on it, of an arc length (m)."""
    number = 0
    while number < len(arcs) - 1 and along > lengths[number]:
        along -= lengths[number]
        number += 1
    if "length" in arcs[number]:
        return {"arc": number + 1, "position": along}
    sign = 1.0 if arcs[number]["shape"] == "valley" else -1.0
    return {"arc": number + 1, "angle": sign * slopes[number] + along / arcs[number]["radius"]}


def _mirror_the_bodies(balls: list[Document], arcs: list[Document]) -> None:
    """Replace the bodies on the right half by mirror images of those on the left half."""
    left = [ball for ball in balls if ball["arc"] <= len(arcs) // 2]
    if any("touching" in ball for ball in left):
        left = left[:1]
    right = []
    for ball in left[::-1]:
        image = {**ball, "arc": len(arcs) + 1 - ball["arc"], "speed": -ball["speed"]}
        if "angle" in ball:
            image["angle"] = -ball["angle"]
        else:
            image["position"] = arcs[ball["arc"] - 1]["length"] - ball["position"]
        right.append(image)
    balls[:] = [*left, *right] or balls
