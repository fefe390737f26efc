"""Random flights of two bodies, as the solver and as the judge are told of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from vibro_cli.build import build_system
from vibro_cli.mechanics.system import System
from vibro_cli.mechanics.trace import Piece
from vibro_cli.scenario import ScenarioError, scenario_of
from vibro_cli.simulation.geometry import centres
from vibro_cli.simulation.prepare import half_angle
from vibro_cli.stress.judge import BODY_COLUMNS, COLUMNS
from vibro_cli.stress.kernels import START_COLUMNS

Document = dict[str, Any]

KINDS = (
    "valley", "hump", "line", "valley hump", "hump valley", "valley line", "line valley",
    "hump line", "line hump", "valley valley", "hump hump",
)  # fmt: skip
BODIES = ("ball", "disk", "hollow_ball", "hoop", "particle")
GRAVITY = 9.81
# Bodies start at least this far apart, in units of the sum of their radii.
LEAST_GAP = 1.0e-6


@dataclass(frozen=True)
class Family:
    """A trace with two bodies, whose initial states vary."""

    kind: str
    document: Document
    system: System

    @property
    def pieces(self) -> tuple[Piece, Piece]:
        """The pieces of the left and of the right body: the first and the last."""
        return self.system.trace.pieces[0], self.system.trace.pieces[-1]


def random_family(rng: np.random.Generator, number: int) -> Family:
    """A random family, every kind in turn; what the mechanics refuse is drawn again."""
    kind = KINDS[number % len(KINDS)]
    while True:
        document = _document(rng, kind)
        try:
            return Family(kind, document, build_system(scenario_of(document)))
        except ScenarioError:
            continue


def _document(rng: np.random.Generator, kind: str) -> Document:
    shapes = kind.split()
    slope = _first_slope(rng, shapes)
    arcs, start = [], slope
    for shape in shapes:
        if shape == "line":
            arcs.append({"shape": shape, "length": float(rng.uniform(1.0, 4.0))})
            continue
        turn = float(rng.uniform(0.6, 1.6 if len(shapes) > 1 else 2.6))
        slope += turn if shape == "valley" else -turn
        arcs.append({"shape": shape, "radius": float(rng.uniform(0.5, 3.0)), "end_slope": slope})
    largest = float(rng.uniform(0.02, 0.15))
    radii = (largest, largest if rng.random() < 0.3 else largest * float(rng.uniform(0.3, 1.0)))
    balls = []
    for ball, radius in enumerate(radii):
        arc = 1 if ball == 0 else len(shapes)
        own: Document = {
            "body": str(rng.choice(BODIES)), "radius": radius,
            "mass": float(rng.uniform(0.1, 3.0)), "arc": arc,
        }  # fmt: skip
        balls.append(own | _middle(arcs, start, arc - 1, 0.3 if ball == 0 else 0.7))
    return {
        "gravity": GRAVITY,
        "trace": {"start_slope": start, "arcs": arcs},
        "balls": balls,
        "collision": {"law": "normal-impulse", "k": 1.0},
        "stop": {"collisions": 1, "time": 100.0},
    }


def _first_slope(rng: np.random.Generator, shapes: list[str]) -> float:
    """A slope at the left end such that the middle of the trace is about level."""
    if shapes[0] == "line":
        return float(rng.uniform(-0.6, 0.6))
    return float(rng.uniform(0.3, 1.3)) * (-1.0 if shapes[0] == "valley" else 1.0)


def _middle(arcs: list[Document], start: float, index: int, share: float) -> Document:
    """A place within a piece."""
    arc = arcs[index]
    if arc["shape"] == "line":
        return {"position": share * arc["length"]}
    before = [other["end_slope"] for other in arcs[:index] if "end_slope" in other]
    first = before[-1] if before else start
    sign = 1.0 if arc["shape"] == "valley" else -1.0
    return {"angle": sign * (first + share * (arc["end_slope"] - first))}


@dataclass(frozen=True)
class States:
    """Initial states of a family's two bodies: places (rad, m), speeds (m/s), longest time (s)."""

    places: Any  # (n, 2)
    speeds: Any  # (n, 2)
    horizon: Any  # (n,)

    def part(self, chosen: Any) -> States:
        """Those of some flights."""
        return States(self.places[chosen], self.speeds[chosen], self.horizon[chosen])


def random_states(rng: np.random.Generator, family: Family, count: int) -> States:
    """States of bodies apart, from nearly touching to far away, slow and fast."""
    first, last = family.pieces
    places = np.empty((count, 2))
    for ball, piece in enumerate((first, last)):
        places[:, ball] = rng.uniform(piece.angle_start, piece.angle_end, count)
    if first is last:
        places.sort(axis=1)
    else:
        near = 10.0 ** rng.uniform(-1.5, 0.0, count)
        places[:, 0] = first.angle_end + (places[:, 0] - first.angle_end) * near
        places[:, 1] = last.angle_start + (places[:, 1] - last.angle_start) * near
    sizes = [piece.length if piece.is_line else piece.radius for piece in (first, last)]
    typical = math.sqrt(GRAVITY * min(sizes))
    speeds = rng.normal(0.0, 1.0, (count, 2)) * typical * 10.0 ** rng.uniform(-1.5, 0.3, (count, 1))
    longest = math.sqrt(max(sizes) / GRAVITY) * 10.0 ** rng.uniform(0.0, 1.0, count)
    states = States(places, speeds, longest)
    touch = sum(body.radius for body in family.system.bodies)
    return states.part(distances(family, states) > touch * (1.0 + LEAST_GAP))


def centres_of(family: Family, states: States) -> list[tuple[Any, Any]]:
    """Centres of both bodies at the start (m)."""
    return [
        centres(piece, states.places[:, ball], family.system.bodies[ball].radius)
        for ball, piece in enumerate(family.pieces)
    ]


def distances(family: Family, states: States) -> Any:
    """Distances of the centres at the start (m)."""
    (ax, ay), (bx, by) = centres_of(family, states)
    return np.hypot(bx - ax, by - ay)


def for_solver(family: Family, states: States) -> Any:
    """Rows for :func:`vibro_cli.stress.engine_batch.first_contacts`."""
    rows = np.empty((len(states.places), START_COLUMNS))
    rows[:, 8] = states.horizon
    for ball, piece in enumerate(family.pieces):
        body = family.system.bodies[ball]
        rows[:, 4 * ball] = piece.index
        places = states.places[:, ball].tolist()
        halves = np.array([half_angle(piece, place) for place in places])
        rows[:, 4 * ball + 1 : 4 * ball + 3] = halves.reshape(-1, 2)
        scale = 1.0
        if not piece.is_line:
            rho = piece.path_radius(body.radius)
            scale = 2.0 * math.sqrt(family.system.gravity / (body.kappa * rho)) * rho
        rows[:, 4 * ball + 3] = states.speeds[:, ball] / scale
    return rows


def for_judge(family: Family, states: States, horizon: Any) -> Any:
    """Rows for :func:`vibro_cli.stress.judge.judge_all`."""
    rows = np.empty((len(states.places), COLUMNS))
    first, last = family.pieces
    rows[:, 0] = family.system.gravity
    rows[:, 1] = first.start_slope if first is last else first.end_slope
    rows[:, 2] = horizon
    for ball, piece in enumerate((first, last)):
        body = family.system.bodies[ball]
        side = 0.0 if first is last else (-1.0 if ball == 0 else 1.0)
        columns = rows[:, 3 + ball * BODY_COLUMNS : 3 + (ball + 1) * BODY_COLUMNS]
        size = piece.length if piece.is_line else piece.radius
        columns[:, :4] = [piece.sign, size, body.radius, body.kappa]
        columns[:, 4] = states.places[:, ball]
        columns[:, 5] = states.speeds[:, ball]
        columns[:, 6] = side
    return rows


def scenario_of_flight(family: Family, states: States, number: int) -> Document:
    """The scenario that reproduces one flight."""
    document: Document = {**family.document, "balls": []}
    for ball, old in enumerate(family.document["balls"]):
        key = "position" if "position" in old else "angle"
        place, speed = float(states.places[number, ball]), float(states.speeds[number, ball])
        document["balls"].append({**old, key: place, "speed": speed})
    stop = {"collisions": 1, "time": float(states.horizon[number])}
    return {**document, "stop": stop}
