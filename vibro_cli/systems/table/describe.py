"""The portrait of bounces on a wall without a run."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from matplotlib.figure import Figure

from vibro_cli.systems.contract import NoPortrait
from vibro_cli.systems.table.system import TableSystem
from vibro_cli.systems.table.wall_orbits import has_wall_portrait, wall_record
from vibro_cli.systems.table.wall_portrait import wall_portrait


def portrait(
    system: TableSystem, width: str, drawn: bool
) -> tuple[dict[str, Any], dict[str, Figure]]:
    """Return the orbits to and fro of each ball, and a figure for each radius.

    Raises `NoPortrait` for a table without one.
    """
    wall = system.wall
    if wall is None or not has_wall_portrait(wall):
        raise NoPortrait(
            f"found {_described(system)}, expected an ellipse or a circle around "
            "the balls: only the bounces on these have singular points and a portrait"
        )
    bodies: list[dict[str, Any]] = []
    figures: dict[str, Figure] = {}
    radii: dict[float, int] = {}
    for ball, body in enumerate(system.bodies, 1):
        record = {"ball": ball, "body": body.kind, "radius": body.radius}
        bodies.append(record | wall_record(wall, body.radius))
        if drawn and body.radius not in radii:
            figures[f"portrait_{ball}"] = wall_portrait(system, ball, width)
        radii.setdefault(body.radius, ball)
    return {"system": "table", "bodies": bodies}, figures


def _described(system: TableSystem) -> str:
    if system.wall is None:
        return "no wall"
    side = "around" if system.wall.inside else "among"
    return f"a wall of the shape {system.wall.shape} {side} the balls"


def portrait_lines(found: dict[str, Any]) -> Iterator[str]:
    """Return the table as text."""
    for body in found["bodies"]:
        yield f"ball {body['ball']}: {body['body']}, r = {body['radius']:g} m: {body['type']}"
        yield from _lines(body)


def _lines(body: dict[str, Any]) -> Iterator[str]:
    yield "  to and fro along  kind        chord [m]  radius of curvature [m]  grows by"
    for point in body["points"]:
        grows = "-" if point["multiplier"] is None else f"{point['multiplier']:.6g}"
        yield (
            f"  {point['axis']:16}  {point['kind']:10}  {point['length']:9.6f}  "
            f"{point['curvature_radius']:23.6f}  {grows}"
        )
