"""The scenes on which all methods are measured, with their references; those of this solver alone.

The folder ``references`` holds the times of the first impacts. They come from
``stress.oracles.oracle``, a Taylor integration in 50 digits that starts from the same doubles as
the methods.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from importlib.resources import files
from typing import Any

from vibro_cli.assemble import build_system
from vibro_cli.errors import Failure
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.scenario.loading import scenario_of
from vibro_cli.stress.scenes import CIRCLE, three_arcs, valley
from vibro_cli.systems import NAMES, system_named
from vibro_cli.systems.contract import Document, TimedScene

_STEEL, _ALUMINIUM, _LIGHT_STEEL, _GLASS = 7800.0, 2700.0, 6000.0, 2500.0
VALLEY, THREE_ARCS = valley(160), three_arcs(150)


@dataclass(frozen=True)
class Scene:
    """A motion to compute."""

    name: str
    title: str
    trace: Document
    balls: tuple[Document, ...]
    law: str = "hedrih"
    k: float = 1.0
    compared: int = 10
    """Number of first impacts whose times are compared with the reference."""
    most: int | None = None
    """Number of impacts of the whole motion, if it ends."""

    @property
    def document(self) -> Document:
        """The scenario as a document."""
        return {
            "gravity": 9.81,
            "trace": self.trace,
            "balls": list(self.balls),
            "collision": {"law": self.law, "k": self.k},
            "stop": {"collisions": self.compared},
        }

    @cached_property
    def system(self) -> TraceSystem:
        """The system that every method solves, in doubles."""
        return build_system(scenario_of(self.document))


def ball(angle: float | str, density: float, arc: int = 1, **more: Any) -> Document:
    """Return a ball of radius 0.1 m."""
    return {"radius": 0.1, "density": density, "arc": arc, "angle": angle, **more}


SCENES = (
    Scene(
        "circle", "two balls in one circle", VALLEY,
        (ball(-0.72, _STEEL), ball(0.54, _ALUMINIUM)),
    ),
    Scene(
        "wrap_around", "over the top of a closed circle", CIRCLE,
        (ball(-0.6, _STEEL, rate=-7.0), ball(0.7, _ALUMINIUM, rate=5.0)),
    ),
    Scene(
        "three_arcs", "three arcs, with crossings", THREE_ARCS,
        (ball(-1.3, _STEEL), ball(0.2, _LIGHT_STEEL, 3)), law="normal-impulse",
    ),
    Scene(
        "five_balls", "five balls in one valley", VALLEY,
        tuple(
            ball(angle, density)
            for angle, density in (
                (-1.1, _STEEL), (-0.5, _ALUMINIUM), (0.0, _STEEL), (0.45, _GLASS),
                (0.95, _ALUMINIUM),
            )
        ),
    ),
    Scene(
        "separatrix", "from 1e-9 rad beside the crest", THREE_ARCS,
        (ball(1e-9, _STEEL, 2), ball(0.2, _LIGHT_STEEL, 3)), law="normal-impulse", compared=6,
    ),
    Scene(
        "dissipative", "impacts that accumulate (k = 0.9)", VALLEY,
        (ball(-0.72, _STEEL), ball(0.54, _ALUMINIUM)), k=0.9, compared=60, most=100,
    ),
)  # fmt: skip
BY_NAME = {scene.name: scene for scene in SCENES}


def _circle(**trace: Any) -> TimedScene:
    document = {
        "gravity": 9.81, "trace": valley(90) | trace,
        "balls": [ball("-60 deg", _STEEL), ball("50 deg", _STEEL)],
        "collision": {"k": 1.0}, "stop": {"collisions": 1},
    }  # fmt: skip
    return TimedScene(document)


_CIRCLES = {
    "circle at rest": _circle(),
    "circle turning about its axis": _circle(turning={"through_arc": 1, "rate": 2.5}),
}


def timed_scenes(part: str) -> dict[str, TimedScene]:
    """Return the scenes of a part of the benchmark that measures this solver alone."""
    found = dict(_CIRCLES)
    for name in NAMES:
        found |= system_named(name).timed_scenes
    return {name: scene for name, scene in found.items() if part in scene.parts}


DIGITS = 40
_LONGEST = 1e4  # s: later than the compared impacts of every scene


class ReferenceOutdated(Failure):
    """Raised if a reference is missing or of another scene; the message says how to renew it."""


def reference_times(scene: Scene) -> list[str]:
    """Return the times (s) of the first impacts of a scene as decimals of ``DIGITS`` digits.

    Raises `ReferenceOutdated` if there is no reference of exactly this scene.
    """
    path = files("vibro_cli.benchmark") / "references" / f"{scene.name}.json"
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        found = {}
    if found.get("scenario") != json.loads(json.dumps(scene.document)):
        raise ReferenceOutdated(
            f"{path}: found no reference of the scene {scene.name!r} as it is; expected what "
            "`vibro bench --references DIR` writes"
        )
    times: list[str] = found["times"]
    return times


def computed_reference(scene: Scene) -> dict[str, Any]:
    """Compute the content of a scene's reference file; mpmath is required."""
    from vibro_cli.stress.oracles.oracle import Oracle
    from vibro_cli.stress.oracles.scene import mp

    impacts = Oracle.of(scene.system).impacts(scene.compared, mp.mpf(_LONGEST))
    return {
        "scenario": scene.document,
        "unit": "s",
        "digits": DIGITS,
        "times": [mp.nstr(one.t, DIGITS) for one in impacts],
    }


def errors_of_times(times: Sequence[float | str], exact: list[str]) -> list[float]:
    """Return the relative errors of times, computed as exact fractions and rounded once."""
    pairs = zip(times, exact, strict=False)
    return [float(abs(Fraction(time) - Fraction(true)) / Fraction(true)) for time, true in pairs]


def reference_difference(scene: Scene, content: dict[str, Any]) -> str:
    """Return a text on how newly computed content differs from the reference in use."""
    try:
        used = reference_times(scene)
    except ReferenceOutdated:
        return "no reference in use"
    worst = max(errors_of_times(used, content["times"]))
    return f"{len(used)} times, greatest relative difference {worst:.1e}"
