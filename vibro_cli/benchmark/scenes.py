"""The scenes that every method is measured on, as scenarios."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from vibro_cli.build import build_system
from vibro_cli.mechanics.system import System
from vibro_cli.scenario import scenario_of
from vibro_cli.stress.scenes import CIRCLE, three_arcs, valley

Document = dict[str, Any]

_STEEL, _ALUMINIUM, _LIGHT_STEEL, _GLASS = 7800.0, 2700.0, 6000.0, 2500.0
VALLEY, THREE_ARCS = valley(160), three_arcs(150)


@dataclass(frozen=True)
class Scene:
    """A motion to be computed."""

    name: str
    title: str
    trace: Document
    balls: tuple[Document, ...]
    law: str = "hedrih"
    k: float = 1.0
    compared: int = 10
    """Impacts from the start whose times are compared with the reference."""
    most: int | None = None
    """Impacts of the whole motion, if it ends."""

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
    def system(self) -> System:
        """The system that every method gets, in doubles."""
        return build_system(scenario_of(self.document))


def ball(angle: float | str, density: float, arc: int = 1, **more: Any) -> Document:
    """A ball of radius 0.1 m."""
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
