"""The scenario of `system = "table"`: balls rolling on a horizontal plane, with or without a wall.

Source: C, parts 1 and 2, figures 1, 2 and 4.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from vibro_cli.errors import listing
from vibro_cli.scenario import quantities as kinds
from vibro_cli.scenario.base import (
    KIND,
    MASS,
    SAMPLES,
    AnyScenario,
    BodyTable,
    Listed,
    Sampling,
    Table,
    at_least_one,
)
from vibro_cli.scenario.models import (
    Data,
    Growth,
    Inadmissible,
    Law,
    Stop,
    body_faults,
    output_faults,
    rows,
    section,
    stop_faults,
    with_bodies,
)
from vibro_cli.scenario.problems import Fault, shown

Side = Literal["inside", "outside"]

SHAPE_KEYS: dict[str, tuple[str, ...]] = {
    "ellipse": ("semi_axis_x", "semi_axis_y"),
    "circle": ("radius",),
    "rectangle": ("width", "depth"),
    "polygon": ("corners",),
}
"""The keys that give the size of a wall of each shape."""
_POLAR, _CARTESIAN = ("speed", "direction"), ("velocity_x", "velocity_y")
_STOPS = ("time", "collisions", "bounces")

Corner = Annotated[
    tuple[Annotated[float, kinds.POSITION], ...],
    Listed("x and y", 2, 2),
]


class Wall(Table):
    """A vertical wall on the plane; a ball touches it at a distance equal to its radius."""

    shape: Annotated[str, kinds.Word(tuple(SHAPE_KEYS))]
    """ellipse (axes along x and y), circle, rectangle (sides along x and y) or polygon."""
    side: Annotated[Side, kinds.Word(("inside", "outside"))] = "inside"
    """Side of the wall on which the balls are: inside or outside."""
    k: Annotated[float, kinds.RESTITUTION, Field(title="coefficient of restitution k")]
    """Coefficient of restitution of the wall, from 0 to 1, applied to the normal component of the
    velocity."""
    x: Annotated[float, kinds.POSITION] = 0.0
    """x coordinate of the centre of an ellipse, a circle or a rectangle in m."""
    y: Annotated[float, kinds.POSITION] = 0.0
    """y coordinate of the centre of an ellipse, a circle or a rectangle in m."""
    semi_axis_x: Annotated[float | None, kinds.LENGTH, Field(title="semi-axis along x")] = None
    """Semi-axis of an ellipse along x in m."""
    semi_axis_y: Annotated[float | None, kinds.LENGTH, Field(title="semi-axis along y")] = None
    """Semi-axis of an ellipse along y in m."""
    radius: Annotated[float | None, kinds.LENGTH] = None
    """Radius of a circle in m."""
    width: Annotated[float | None, kinds.LENGTH] = None
    """Side of a rectangle along x in m."""
    depth: Annotated[float | None, kinds.LENGTH] = None
    """Side of a rectangle along y in m."""
    corners: Annotated[tuple[Corner, ...] | None, Listed("corners", 3)] = None
    """Corners [x, y] of a polygon in m, in order around it."""


class TableBall(BodyTable):
    """A ball on the plane."""

    x: Annotated[float, kinds.POSITION]
    """Initial x coordinate of the centre in m."""
    y: Annotated[float, kinds.POSITION]
    """Initial y coordinate of the centre in m."""
    speed: Annotated[float | None, kinds.SPEED] = None
    """Initial speed of the centre in m/s; give speed and direction, or velocity_x and
    velocity_y."""
    direction: Annotated[float | None, kinds.ANGLE] = None
    """Direction of the initial velocity in rad, from the x axis towards the y axis."""
    velocity_x: Annotated[float | None, kinds.SPEED, Field(title="velocity along x")] = None
    """x component of the initial velocity in m/s; 0 by default."""
    velocity_y: Annotated[float | None, kinds.SPEED, Field(title="velocity along y")] = None
    """y component of the initial velocity in m/s; 0 by default."""


class TableCollision(Table):
    """The law that gives the velocities of two balls along their horizontal line of centres after
    an impact."""

    law: Law = "hedrih"
    """Name of the impact law."""
    k: Annotated[float | None, kinds.RESTITUTION] = None
    """Coefficient of restitution of every pair, from 0 to 1."""
    inadmissible: Inadmissible = "stop"
    """What happens at an inadmissible impact, after which the balls would pass through one
    another: the run stops, or the normal-impulse law is used for that impact, which is marked."""


class TableStop(Stop):
    """When the run ends: at the first of these limits."""

    rules = (at_least_one(*_STOPS),)

    bounces: Annotated[int | None, kinds.COUNT, Field(title="impacts on the wall")] = None
    """Number of impacts on the wall after which the run ends."""


class TableScenario(AnyScenario):
    """Balls that roll on a horizontal plane: they collide with one another and with a wall."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (
        MASS,
        KIND,
        *product(_POLAR, _CARTESIAN),
        SAMPLES,
    )

    system: Annotated[Literal["table"], kinds.Word(("table",))]
    """The system to solve: balls on a horizontal plane."""
    wall: Wall | None = None
    """A wall around the balls, or an obstacle among them; if omitted, there is no wall."""
    balls: Annotated[tuple[TableBall, ...], Listed("balls", 1)]
    """The balls, in any order."""
    collision: TableCollision = TableCollision()
    """The impact law; required if there are two or more balls."""
    stop: TableStop
    """When the run ends."""
    output: Sampling = Sampling()
    """Optional output: sampled motion."""
    analysis: Growth = None
    """Optional analysis of the growth of small perturbations."""

    @classmethod
    def between_fields(cls, data: dict[str, Any]) -> list[Fault]:
        """Return every broken rule between fields."""
        return [
            *_wall_faults(data),
            *_ball_faults(data),
            *_collision_faults(data),
            *stop_faults(data, _STOPS),
            *output_faults(data),
        ]

    @classmethod
    def prepared(cls, data: dict[str, Any]) -> dict[str, Any]:
        """Return the data with the defaults that depend on other fields filled in."""
        return with_bodies(data, _default_motion)

    def resolved(self) -> dict[str, Any]:
        """Return the scenario as plain data; a polygon has no centre."""
        data = super().resolved()
        if self.wall is not None and self.wall.shape == "polygon":
            del data["wall"]["x"], data["wall"]["y"]
        return data


MODEL = TableScenario


def _default_motion(ball: Data) -> dict[str, float]:
    given = set(ball)
    return {} if given & set(_POLAR) else {key: 0.0 for key in _CARTESIAN if key not in given}


def _wall_faults(data: Data) -> Iterator[Fault]:
    wall = section(data, "wall")
    shape = wall.get("shape")
    if not isinstance(shape, str) or shape not in SHAPE_KEYS:
        return
    for key in SHAPE_KEYS[shape]:
        if key not in wall:
            yield Fault(("wall", key), "nothing", f"the {key} of the {shape}")
    others = {key for keys in SHAPE_KEYS.values() for key in keys} - set(SHAPE_KEYS[shape])
    if shape == "polygon":
        others |= {"x", "y"}
    for key in wall:
        if key in others:
            expected = f"no {key}: the {shape} has {listing(SHAPE_KEYS[shape], 'and')}"
            yield Fault(("wall", key), shown(wall[key]), expected, on_key=True)


def _ball_faults(data: Data) -> Iterator[Fault]:
    for index, ball in rows(data, "balls"):
        loc = ("balls", index)
        yield from body_faults(ball, loc, lone=len(data["balls"]) == 1)
        polar, cartesian = ([k for k in keys if k in ball] for keys in (_POLAR, _CARTESIAN))
        if polar and cartesian:
            expected = "speed with direction, or velocity_x and velocity_y"
            yield Fault((*loc, cartesian[0]), listing([*polar, *cartesian], "and"), expected, True)
        elif len(polar) == 1:
            (missing,) = set(_POLAR) - set(polar)
            yield Fault((*loc, missing), "nothing", f"the {missing} beside the {polar[0]}")


def _collision_faults(data: Data) -> Iterator[Fault]:
    balls, collision = data.get("balls"), data.get("collision", {})
    several = isinstance(balls, list) and len(balls) > 1
    if several and isinstance(collision, dict) and "k" not in collision:
        loc = ("collision", "k") if "collision" in data else ("collision",)
        expected = "the coefficient of restitution k, a number from 0 to 1"
        yield Fault(loc, "nothing", expected)
