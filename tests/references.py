"""The reference files: their scenarios, their rows, and runs of them."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from tests.highprecision.decimals import scene_of_decimals
from tests.highprecision.reference_solver import Impact, ReferenceSolver, events_of
from vibro_cli.api import simulate
from vibro_cli.assemble import build_system
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.scenario import Scenario, scenario_of
from vibro_cli.stress import impacts
from vibro_cli.stress.oracles.scene import Scene, mp, scene_of_system
from vibro_cli.stress.oracles.sensitivity import amplification
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system

FOLDER = Path(__file__).parent / "reference"
NAMES = tuple(sorted(path.stem for path in FOLDER.glob("*.json")))


def separation(impact: Impact) -> Any:
    """Return the speed of separation along the line of centres, from the twin's positions."""
    a, b = impact.a, impact.b
    line = [there - here for here, there in zip(a.centre, b.centre, strict=True)]
    along_a, along_b = (
        mp.fdot(zip(line, one.tangent, strict=True)) / mp.hypot(*line) for one in (a, b)
    )
    return along_b * impact.after_b - along_a * impact.after_a


# Name in the collision table: name in the reference files, and how the twin has it.
PLACES: dict[str, tuple[str, Callable[[Impact], Any]]] = {
    "t": ("t", lambda impact: impact.t),
    "place_a": ("angle_a", lambda impact: impact.a.place),
    "place_b": ("angle_b", lambda impact: impact.b.place),
}
SPEEDS: dict[str, tuple[str, Callable[[Impact], Any]]] = {
    "speed_a_pre": ("v_a_pre", lambda impact: impact.a.speed),
    "speed_b_pre": ("v_b_pre", lambda impact: impact.b.speed),
    "speed_a_post": ("v_a_post", lambda impact: impact.after_a),
    "speed_b_post": ("v_b_post", lambda impact: impact.after_b),
    "separation_speed": ("rel", separation),
}
QUANTITIES = PLACES | SPEEDS


def solved(run: Run, quantity: str, row: int) -> Any:
    """Return a quantity of the collision table, without rounding."""
    if quantity in SPEEDS:
        return mp.mpf(float(run.collisions[quantity][row]))
    return impacts.solved(run, quantity, row)


def check_impacts(found: Run, impacts: list[Impact], tolerance: float) -> None:
    """Compare the impacts of a run with those of a reference, relative to times and speeds."""
    for row, impact in enumerate(impacts):
        for quantity, (_, value) in QUANTITIES.items():
            exact, size = value(impact), 1.0
            if quantity == "t":
                size = float(exact)
            elif quantity in SPEEDS:
                size = float(max(abs(impact.a.speed), abs(impact.b.speed)))
            off = float(abs(solved(found, quantity, row) - exact))
            assert off <= tolerance * size, (row + 1, quantity)


def columns(run: Run) -> dict[str, list[float]]:
    """Return all quantities of all rows, in doubles."""
    count = len(run.collisions["n"])
    return {name: [float(solved(run, name, row)) for row in range(count)] for name in QUANTITIES}


@cache
def document(name: str) -> dict[str, Any]:
    """Return a reference file: ``scenario`` and ``rows``."""
    text = (FOLDER / f"{name}.json").read_text(encoding="utf-8")
    content: dict[str, Any] = json.loads(text)
    return content


def collisions(name: str) -> list[dict[str, Any]]:
    """Return the rows that are collisions."""
    return [row for row in document(name)["rows"] if row["event"] == "collision"]


@cache
def scenario(name: str) -> Scenario:
    """Return the scenario of a reference file."""
    return scenario_of(document(name)["scenario"])


@cache
def system(name: str) -> TraceSystem:
    """Return the system that the solver gets, in doubles."""
    return build_system(scenario(name))


@cache
def run(name: str, engine: str = "python") -> Run:
    """Return the solver's run of a reference file."""
    return simulate(scenario(name), engine)


@cache
def twin_of_doubles(name: str) -> list[Impact]:
    """The impacts in high precision, from the doubles that the solver gets."""
    return _follow(scene_of_system(system(name)), name)


@cache
def twin_of_decimals(name: str) -> list[Impact]:
    """The impacts in high precision, from the decimals of the file."""
    return _follow(scene_of_decimals(document(name)["scenario"]), name)


def _follow(scene: Scene, name: str) -> list[Impact]:
    return ReferenceSolver(scene).follow(events_of(run(name)))


def deviation(quantity: str, value: Any, exact: Any, row: Impact) -> float:
    """Difference of a quantity of a row, relative.

    A time to itself; an angle to itself or 1 rad, a distance to 1 m (angles pass through zero); a
    speed to the fastest of the impact, since a small one is a difference of larger ones.
    """
    if quantity == "t":
        size = abs(exact)
    elif quantity in PLACES:
        size = max(abs(exact), 1)
    else:
        size = max(abs(speed) for speed in (row.a.speed, row.b.speed, row.after_a, row.after_b))
    return float(abs(value - exact) / size)


def mark(quantity: str, row: int) -> float:
    """Return the accuracy to which a row (from 0) of a reference file is to be reproduced."""
    if quantity in SPEEDS:
        return 1e-11
    return 1e-12 if row < 9 else 1e-10


def solve(name: str, changed: TraceSystem) -> Run:
    """Run a changed system with the stop of a reference file."""
    stop = scenario(name).stop
    return simulate_system(changed, stop.time, stop.collisions)


@cache
def amplified(name: str) -> dict[str, list[float]]:
    """How much a relative change of an input changes each quantity of each row, at most."""
    return amplification(system(name), lambda changed: columns(solve(name, changed)))
