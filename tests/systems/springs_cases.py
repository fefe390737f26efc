"""Bodies on springs as plain data, and runs of them."""

from __future__ import annotations

from typing import Any

from vibro_cli.stress.scenes import solve_any
from vibro_cli.systems.run import Run

Document = dict[str, Any]


def spring(stiffness: float, length: float, height: float, foot: float) -> Document:
    return {"stiffness": stiffness, "length": length, "height": height, "foot": foot}


def disk(position: float, speed: float, held: Document, **more: Any) -> Document:
    return {
        "body": "disk",
        "radius": 0.4,
        "mass": 1.0,
        "position": position,
        "speed": speed,
        "spring": held,
        **more,
    }


def springs(balls: list[Document], k: float | list[float] = 1.0, **stop: Any) -> Document:
    document: Document = {"system": "springs", "balls": balls, "stop": stop}
    return {**document, "collision": {"k": k}} if len(balls) > 1 else document


FIGURE_FIVE = [
    disk(-4.0, 8.5, spring(6.0, 5.0, 1.0, 0.0)),
    disk(7.0, -2.0, spring(9.0, 5.0, 1.5, 3.0), mass=2.0),
]
"""Paper C, figure 5: l = 5, b = 1 and 1.5; the rest is chosen."""

PRESSED = [
    disk(-1.0, 0.0, spring(5.0, 0.5, 1.0, 0.3)),
    disk(1.2, 0.0, spring(8.0, 0.5, 1.0, -0.3), mass=1.5),
    disk(2.4, 0.0, spring(8.0, 0.5, 1.0, 0.0), mass=0.7),
]
"""Springs that press the bodies together."""


def solve(document: Document, engine: str = "compiled") -> Run:
    return solve_any(document, engine)
