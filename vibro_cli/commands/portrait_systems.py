"""What `vibro portrait` finds and draws for systems other than the trace."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from vibro_cli.commands.boundary import CommandError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vibro_cli.systems.springs.system import SpringsSystem
    from vibro_cli.systems.table.system import TableSystem


def portrait_of_system(
    name: str, system: "SpringsSystem | TableSystem", width: str, drawn: bool
) -> tuple[dict[str, Any], dict[str, "Figure"]]:
    """The table of singular points of each body, and the figures by the stems of their files.

    Raises `CommandError` for a table without a portrait.
    """
    from vibro_cli.systems.springs.system import SpringsSystem

    if isinstance(system, SpringsSystem):
        return _of_springs(name, system, width, drawn)
    return _of_table(name, system, width, drawn)


def _of_springs(
    name: str, system: "SpringsSystem", width: str, drawn: bool
) -> tuple[dict[str, Any], dict[str, "Figure"]]:
    from vibro_cli.analysis.springs_portrait_type import springs_record
    from vibro_cli.figures.springs_portrait import springs_structure

    balls = range(1, len(system.bodies) + 1)
    bodies = [springs_record(system, ball - 1) for ball in balls]
    figures = {f"portrait_{n}": springs_structure(system, n, width) for n in balls if drawn}
    return {"name": name, "system": "springs", "bodies": bodies}, figures


def _of_table(
    name: str, system: "TableSystem", width: str, drawn: bool
) -> tuple[dict[str, Any], dict[str, "Figure"]]:
    from vibro_cli.analysis.wall_orbits import has_wall_portrait, wall_record
    from vibro_cli.figures.wall_portrait import wall_portrait

    wall = system.wall
    if wall is None or not has_wall_portrait(wall):
        raise CommandError(
            f"vibro: {name}: found {_described(system)}, expected an ellipse or a circle around "
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
    return {"name": name, "system": "table", "bodies": bodies}, figures


def _described(system: "TableSystem") -> str:
    if system.wall is None:
        return "no wall"
    side = "around" if system.wall.inside else "among"
    return f"a wall of the shape {system.wall.shape} {side} the balls"


def lines_of(found: dict[str, Any]) -> Iterator[str]:
    """The table as text."""
    lines = _springs_lines if found["system"] == "springs" else _table_lines
    for body in found["bodies"]:
        yield f"ball {body['ball']}: {body['body']}, r = {body['radius']:g} m: {body['type']}"
        yield from lines(body)


def _springs_lines(body: dict[str, Any]) -> Iterator[str]:
    yield "  point  kind    from foot [m]       x [m]      E [J]  spring"
    for point in body["points"]:
        state = "stressed" if point["stressed"] else "unstressed"
        yield (
            f"  {point['name']:5}  {point['kind']:6}  {point['displacement']:13.9f}  "
            f"{point['x']:10.6f}  {point['energy']:9.6g}  {state}"
        )
    yield f"  ω₀ = {body['frequency']:.9g} 1/s"
    if body["separatrix_speed"] is not None:
        yield f"  on the separatrix at most {body['separatrix_speed']:.9g} m/s, over the centres"


def _table_lines(body: dict[str, Any]) -> Iterator[str]:
    yield "  to and fro along  kind        chord [m]  radius of curvature [m]  grows by"
    for point in body["points"]:
        grows = "-" if point["multiplier"] is None else f"{point['multiplier']:.6g}"
        yield (
            f"  {point['axis']:16}  {point['kind']:10}  {point['length']:9.6f}  "
            f"{point['curvature_radius']:23.6f}  {grows}"
        )
