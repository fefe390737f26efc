"""Scenes that several checks share, and running them."""

from __future__ import annotations

import math
from typing import Any

from vibro_cli.build import build_system
from vibro_cli.mechanics.system import System
from vibro_cli.scenario import scenario_of
from vibro_cli.simulation.run import Run, simulate_system
from vibro_cli.stress.finding import Document

GRAVITY = 9.81
CIRCLE: Document = {
    "start_slope": "-180 deg",
    "closed": True,
    "arcs": [{"shape": "valley", "radius": 1.0, "end_slope": "180 deg"}],
}


def valley(slope: int) -> Document:
    """One valley of radius 1 m between two slopes (deg) of that size."""
    return {
        "start_slope": f"-{slope} deg",
        "arcs": [{"shape": "valley", "radius": 1.0, "end_slope": f"{slope} deg"}],
    }


def three_arcs(slope: int) -> Document:
    """Two valleys of radius 1 m and a hump of half of it, between slopes (deg) of that size."""
    return {
        "start_slope": f"-{slope} deg",
        "arcs": [
            {"shape": "valley", "radius": 1.0, "end_slope": "50 deg"},
            {"shape": "hump", "radius": 0.5, "end_slope": "-50 deg"},
            {"shape": "valley", "radius": 1.0, "end_slope": f"{slope} deg"},
        ],
    }


VALLEY, THREE_ARCS = valley(170), three_arcs(120)


def ball(angle: float, arc: int = 1, **more: Any) -> Document:
    """A ball of radius 0.1 m and mass 1 kg at an angle of an arc."""
    return {"radius": 0.1, "mass": 1.0, "arc": arc, "angle": angle, **more}


def scene(
    trace: Document, balls: list[Document], k: float = 1.0, law: str = "normal-impulse", **stop: Any
) -> Document:
    """A scenario as a document."""
    document: Document = {"gravity": GRAVITY, "trace": trace, "balls": balls, "stop": stop}
    if len(balls) > 1:
        document["collision"] = {"law": law, "k": k}
    return document


def system_of(document: Document) -> System:
    """The system of a document."""
    return build_system(scenario_of(document))


def solve(document: Document, engine: str = "python") -> Run:
    """Run a document."""
    stop = document["stop"]
    return simulate_system(system_of(document), stop.get("time"), stop.get("collisions"), engine)


def energy_at(run: Run, t: float, side: str) -> float:
    """Energy (J) from places and speeds alone, on either side of an instant."""
    sample, system = run.sample([t], side), run.system
    parts = []
    for body, speed, y in zip(system.bodies, sample["speed"], sample["y"], strict=True):
        parts += [0.5 * body.kappa * body.mass * float(speed) ** 2]
        parts += [body.mass * system.gravity * float(y)]
    return math.fsum(parts)
