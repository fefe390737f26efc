"""Tables as plain data, and runs of them."""

from __future__ import annotations

from typing import Any

from vibro_cli.stress.scenes import solve_any
from vibro_cli.systems.run import Run

Document = dict[str, Any]


def ball(x: float, y: float, vx: float = 0.0, vy: float = 0.0, **more: Any) -> Document:
    return {
        "radius": 0.1,
        "mass": 1.0,
        "x": x,
        "y": y,
        "velocity_x": vx,
        "velocity_y": vy,
        **more,
    }


def particle(x: float, y: float, vx: float, vy: float) -> Document:
    return ball(x, y, vx, vy, body="particle", radius=0.0)


def ellipse(a: float, b: float, k: float = 1.0, **more: Any) -> Document:
    return {"shape": "ellipse", "semi_axis_x": a, "semi_axis_y": b, "k": k, **more}


def box(width: float, depth: float, k: float = 1.0, **more: Any) -> Document:
    return {"shape": "rectangle", "width": width, "depth": depth, "k": k, **more}


def table(
    balls: list[Document], wall: Document | None = None, k: float = 1.0, **stop: Any
) -> Document:
    document: Document = {"system": "table", "balls": balls, "stop": stop}
    if len(balls) > 1:
        document["collision"] = {"k": k}
    return document if wall is None else {**document, "wall": wall}


def solve(document: Document, engine: str = "compiled") -> Run:
    return solve_any(document, engine)
