"""The scenario as pydantic models: names, defaults and descriptions of every field.

The descriptions also make the JSON Schema and the texts of errors. What one field alone can tell
is checked here; what needs several fields is in `rules`, run by `Scenario` in the same pass, so
that all errors of a file come at once.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, get_args

from pydantic import BeforeValidator, Discriminator, Field, Tag, WithJsonSchema

from vibro_cli.scenario import quantities as kinds
from vibro_cli.scenario.base import AnyScenario, BodyTable, Sampling, Table, as_tuple
from vibro_cli.scenario.problems import Fault
from vibro_cli.scenario.rules import ALTERNATIVES, all_faults, prepared
from vibro_cli.systems import NAMES

Shape = Literal["valley", "hump", "line"]
Surface = Literal["two-sided", "one-sided"]
_LawName = Literal["hedrih", "normal-impulse", "translational"]
Law = Annotated[_LawName, kinds.Word(get_args(_LawName))]
_WhatFollows = Literal["stop", "normal-impulse"]
Inadmissible = Annotated[_WhatFollows, kinds.Word(get_args(_WhatFollows))]


def _as_turning(value: object) -> object:
    if value is None:  # left out is None too, but null in a file is an error
        raise kinds.fault("null", "a table")
    return value


def _restitutions(value: object) -> object:
    """Return the coefficients as a tuple, where one number stands for every pair."""
    if isinstance(value, (list, tuple)):
        return tuple(value)
    return (kinds.RESTITUTION.read(value),)


def _end_tag(value: object) -> str | None:
    if isinstance(value, (dict, Wall)):
        return "<wall>"
    return "<stop>" if isinstance(value, str) else None


_K_SCHEMA = kinds.RESTITUTION.schema()


class Arc(Table):
    """A piece of the trace: a circular arc (valley or hump) or a straight line."""

    shape: Annotated[Shape, kinds.Word(("valley", "hump", "line"))]
    """valley (concave, the body above its lowest point), hump (convex) or line."""
    radius: Annotated[float | None, kinds.LENGTH] = None
    """Radius of the arc in m; a line has none."""
    length: Annotated[float | None, kinds.LENGTH] = None
    """Length of a line in m; an arc has none, its end slope gives it."""
    end_slope: Annotated[float | None, kinds.ANGLE] = None
    """Slope of the tangent where the arc ends, in rad: greater than at its start in a valley,
    less on a hump; a line keeps its slope."""


class Turning(Table):
    """The trace turns about a vertical axis at a constant rate."""

    through_arc: Annotated[int | None, kinds.COUNT] = None
    """The axis passes through the centre of this arc, counted from 1."""
    x: Annotated[float | None, kinds.POSITION] = None
    """Horizontal position of the axis in m, from the trace's left end."""
    rate: Annotated[float, kinds.ANGULAR_RATE]
    """Rate of turning in rad/s."""


class Trace(Table):
    """The trace: a chain of pieces that share their tangents, from left to right."""

    start_slope: Annotated[float, kinds.ANGLE]
    """Slope of the tangent at the left end, in rad."""
    closed: Annotated[bool, kinds.FLAG] = False
    """Whether the trace ends where and how it began."""
    surface: Annotated[Surface, kinds.Word(("two-sided", "one-sided"))] = "two-sided"
    """two-sided: the trace also holds a body back, and lift-off is marked; one-sided: lift-off
    ends the run."""
    turning: Annotated[Turning | None, BeforeValidator(_as_turning)] = None
    """The trace turns about a vertical axis; left out, it stands still."""
    arcs: Annotated[tuple[Arc, ...], BeforeValidator(as_tuple), Field(min_length=1)]
    """The pieces, from left to right."""


class Ball(BodyTable):
    """A body on the trace."""

    arc: Annotated[int, kinds.COUNT]
    """The piece of the trace the body starts on, counted from 1."""
    angle: Annotated[float | None, kinds.ANGLE] = None
    """Angle on the arc in rad: phi from the lowest point of a valley, psi from the crest of a
    hump, growing to the right."""
    position: Annotated[float | None, kinds.POSITION] = None
    """Distance along a line in m, from its left end."""
    touching: Annotated[Literal["previous"] | None, kinds.Word(("previous",))] = None
    """previous: the body starts in contact with the one to its left."""
    rate: Annotated[float | None, kinds.ANGULAR_RATE] = Field(
        default=None, json_schema_extra={"default": 0.0}
    )
    """Rate of the angle in rad/s, 0 if no motion is given; on a line: speed or omega."""
    omega: Annotated[float | None, kinds.ANGULAR_RATE] = None
    """Angular velocity of rolling in rad/s, speed of the centre over the radius."""
    speed: Annotated[float | None, kinds.SPEED] = None
    """Speed of the centre in m/s, positive to the right."""


class Collision(Table):
    """How two neighbours leave an impact."""

    law: Law = "hedrih"
    """The impact law."""
    k: Annotated[
        tuple[Annotated[float, kinds.RESTITUTION], ...],
        BeforeValidator(_restitutions),
        WithJsonSchema({"anyOf": [_K_SCHEMA, {"type": "array", "items": _K_SCHEMA}]}),
    ] = ()
    """Coefficient of restitution from 0 to 1: one number, or one for each pair of neighbours."""
    inadmissible: Inadmissible = "stop"
    """What happens at an impact after which the law would send the bodies through one another:
    the run stops, or the normal-impulse law is used for that impact, which is marked."""


class Stop(Table):
    """When the run ends: whichever comes first."""

    time: Annotated[float | None, kinds.TIME] = None
    """End of the run in s."""
    collisions: Annotated[int | None, kinds.COUNT] = None
    """The run ends with this collision, or with others solved jointly with it."""


class Wall(Table):
    """A plane across the trace's end, touched by a body at the distance of its radius."""

    wall: Annotated[float, kinds.RESTITUTION]
    """Coefficient of restitution of the wall, from 0 to 1."""


End = Annotated[
    Annotated[Literal["stop"], kinds.Word(("stop",)), Tag("<stop>")]
    | Annotated[Wall, Tag("<wall>")],
    Discriminator(_end_tag),
]


class Ends(Table):
    """What the ends of an open trace do."""

    left: End = "stop"
    """stop: the run ends when a contact point gets to the left end; or a wall."""
    right: End = "stop"
    """stop: the run ends when a contact point gets to the right end; or a wall."""


class Output(Sampling):
    """What is written besides collisions, events and the summary."""

    turning_points: Annotated[bool, kinds.FLAG] = False
    """Whether turning points are written as events."""
    friction: Annotated[float | None, kinds.RATIO] = None
    """Coefficient of friction of the trace: slip events where rolling would need more."""


class Analysis(Table):
    """What is computed about a motion besides the motion itself."""

    lyapunov: Annotated[bool, kinds.FLAG] = False
    """Whether the growth of small changes of the start is followed: digits that are left of each
    impact, Lyapunov exponents in the summary, and how they converge."""


def _as_analysis(value: object) -> object:
    if value is None:
        raise kinds.fault("null", "a table")
    return value


Growth = Annotated[Analysis | None, BeforeValidator(_as_analysis)]
"""The growth of small changes, if wanted."""


class Scenario(AnyScenario):
    """A vibro-impact scenario: trace, bodies, impact law, and when to stop."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = ALTERNATIVES

    system: Annotated[Literal["trace"], kinds.Word(NAMES)] = Field("trace", exclude=True)
    """What is solved: bodies on a trace, or another system, whose scenarios have other keys."""
    gravity: Annotated[float, kinds.GRAVITY]
    """Acceleration of gravity in m/s^2."""
    trace: Trace
    """The trace the bodies roll on."""
    balls: Annotated[tuple[Ball, ...], BeforeValidator(as_tuple), Field(min_length=1)]
    """The bodies, from left to right."""
    collision: Collision = Collision()
    """The impact law; needed with two bodies or more."""
    stop: Stop
    """When the run ends."""
    ends: Ends = Ends()
    """What happens at the two ends of an open trace."""
    output: Output = Output()
    """Sampled motion and further events, if wanted."""
    analysis: Growth = None
    """The growth of small changes, if wanted."""

    @classmethod
    def between_fields(cls, data: dict[str, Any]) -> list[Fault]:
        """Return every broken rule between fields."""
        return all_faults(data)

    @classmethod
    def prepared(cls, data: dict[str, Any]) -> dict[str, Any]:
        """Return the data with the defaults that depend on other fields filled in."""
        return prepared(data)
