"""Scenes on a trace that rotates about a vertical axis."""

from __future__ import annotations

from typing import Any

CIRCLE = [{"shape": "valley", "radius": 1.0, "end_slope": "90 deg"}]
THREE_ARCS = [
    {"shape": "valley", "radius": 1.0, "end_slope": "50 deg"},
    {"shape": "hump", "radius": 0.5, "end_slope": "-50 deg"},
    {"shape": "valley", "radius": 1.0, "end_slope": "90 deg"},
]
LINES = [
    {"shape": "line", "length": 0.5},
    {"shape": "valley", "radius": 1.0, "end_slope": 0.0},
    {"shape": "line", "length": 1.5},
    {"shape": "valley", "radius": 0.7, "end_slope": "80 deg"},
]


def ball(arc: int, angle: float | str | None = None, **more: Any) -> dict[str, Any]:
    place = {} if angle is None else {"angle": angle}
    return {"radius": 0.1, "density": 7800, "arc": arc, **place, **more}


def data(
    arcs: list[dict[str, Any]],
    balls: list[dict[str, Any]],
    turning: dict[str, Any] | None,
    start_slope: str = "-90 deg",
    **more: Any,
) -> dict[str, Any]:
    """Return a scenario, by default with walls at the ends and ten collisions."""
    trace = {"start_slope": start_slope, "arcs": arcs}
    return {
        "gravity": 9.81,
        "trace": trace if turning is None else trace | {"turning": turning},
        "balls": balls,
        "collision": {"k": 0.95},
        "stop": {"collisions": 10},
        "ends": {"left": {"wall": 1.0}, "right": {"wall": 1.0}},
        **more,
    }


def on_circle(rate: float = 2.5, **more: Any) -> dict[str, Any]:
    """Two balls in one valley that turns about its own vertical."""
    turning = {"through_arc": 1, "rate": rate}
    return data(CIRCLE, [ball(1, "-60 deg"), ball(1, "50 deg")], turning, **more)


def on_three_arcs(rate: float = 0.8, **more: Any) -> dict[str, Any]:
    """Two balls on three arcs that turn about the vertical of the hump."""
    turning = {"through_arc": 2, "rate": rate}
    balls = [ball(1, "-70 deg", rate=-5.0), ball(3, "60 deg", rate=5.0)]
    return data(THREE_ARCS, balls, turning, **more)


def over_the_hump(**more: Any) -> dict[str, Any]:
    """Return two balls that roll slowly over the hump of three arcs, and lift off it."""
    balls = [ball(1, "-80 deg"), ball(3, "60 deg", rate=3.5)]
    return data(THREE_ARCS, balls, {"through_arc": 2, "rate": 0.8}, **more)


def on_lines(**more: Any) -> dict[str, Any]:
    """Two balls and a disk between them on lines and valleys that turn about another vertical."""
    disk = {"body": "disk", "thickness": 0.05, "radius": 0.08, "density": 7800}
    balls = [ball(2, "-32 deg"), disk | {"arc": 3, "position": 0.9}, ball(4, 0.5)]
    law = {"law": "normal-impulse", "k": 0.97}
    return data(LINES, balls, {"x": 1.3, "rate": 1.2}, "-60 deg", **({"collision": law} | more))
