"""The scenario as pydantic models: names, defaults and descriptions of every field.

The descriptions also make the JSON Schema and the texts of errors. What one field alone can tell
is checked here; what needs several fields is in `rules`, run by `Scenario` in the same pass, so
that all errors of a file come at once.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    ModelWrapValidatorHandler,
    PrivateAttr,
    Tag,
    ValidationError,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import InitErrorDetails

from vibro_cli.scenario import quantities as kinds
from vibro_cli.scenario.problems import KeyPath, Place, shown
from vibro_cli.scenario.rules import all_faults, prepared
from vibro_cli.scenario.source import Source

Shape = Literal["valley", "hump", "line"]
Surface = Literal["two-sided", "one-sided"]
BodyKind = Literal["ball", "disk", "hollow_ball", "hoop", "particle"]
Law = Literal["hedrih", "normal-impulse", "translational"]
Inadmissible = Literal["stop", "normal-impulse"]


def _as_tuple(value: object) -> object:
    return tuple(value) if isinstance(value, list) else value


def _as_times(value: object) -> object:
    if isinstance(value, (list, tuple)):
        return tuple(value)
    raise kinds.fault(shown(value), "a list of times")


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


class Table(BaseModel):
    """A table of the scenario file: unknown keys are errors, and nothing changes afterwards."""

    model_config = ConfigDict(
        strict=True,
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
        defer_build=True,
    )


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
    arcs: Annotated[tuple[Arc, ...], BeforeValidator(_as_tuple), Field(min_length=1)]
    """The pieces, from left to right."""


class Ball(Table):
    """A body on the trace."""

    body: Annotated[
        BodyKind | None, kinds.Word(("ball", "disk", "hollow_ball", "hoop", "particle"))
    ] = Field(default=None, json_schema_extra={"default": "ball"})
    """Kind of the body, ball if not given; gives its moment of inertia."""
    inertia_ratio: Annotated[float | None, kinds.RATIO] = None
    """J_C/(m r^2) of any other body, instead of its kind; needs the mass."""
    radius: Annotated[float, kinds.RADIUS]
    """Radius of the body in m; 0 only for a lone particle."""
    density: Annotated[float | None, kinds.DENSITY] = None
    """Density in kg/m^3, or else the mass."""
    mass: Annotated[float | None, kinds.MASS] = None
    """Mass in kg, or else the density."""
    thickness: Annotated[float | None, kinds.LENGTH] = None
    """Thickness in m, needed with a density: of a disk, of a thin hollow ball, or of a hoop of
    square section."""
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

    law: Annotated[Law, kinds.Word(("hedrih", "normal-impulse", "translational"))] = "hedrih"
    """The impact law."""
    k: Annotated[
        tuple[Annotated[float, kinds.RESTITUTION], ...],
        BeforeValidator(_restitutions),
        WithJsonSchema({"anyOf": [_K_SCHEMA, {"type": "array", "items": _K_SCHEMA}]}),
    ] = ()
    """Coefficient of restitution from 0 to 1: one number, or one for each pair of neighbours."""
    inadmissible: Annotated[Inadmissible, kinds.Word(("stop", "normal-impulse"))] = "stop"
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


class Output(Table):
    """What is written besides collisions, events and the summary."""

    step: Annotated[float | None, kinds.TIME] = None
    """Time step of the sampled motion in s."""
    times: Annotated[
        tuple[Annotated[float, kinds.INSTANT], ...] | None, BeforeValidator(_as_times)
    ] = None
    """Times of the sampled motion in s, ascending; instead of a step."""
    turning_points: Annotated[bool, kinds.FLAG] = False
    """Whether turning points are written as events."""
    friction: Annotated[float | None, kinds.RATIO] = None
    """Coefficient of friction of the trace: slip events where rolling would need more."""


class Scenario(Table):
    """A vibro-impact scenario: trace, bodies, impact law, and when to stop."""

    name: Annotated[str, kinds.NAME] = "scenario"
    """Name of the scenario and of its folder of results; the file's stem if not given."""
    gravity: Annotated[float, kinds.GRAVITY]
    """Acceleration of gravity in m/s^2."""
    trace: Trace
    """The trace the bodies roll on."""
    balls: Annotated[tuple[Ball, ...], BeforeValidator(_as_tuple), Field(min_length=1)]
    """The bodies, from left to right."""
    collision: Collision = Collision()
    """The impact law; needed with two bodies or more."""
    stop: Stop
    """When the run ends."""
    ends: Ends = Ends()
    """What happens at the two ends of an open trace."""
    output: Output = Output()
    """Sampled motion and further events, if wanted."""

    _source: Source = PrivateAttr(default_factory=Source)

    @model_validator(mode="wrap")
    @classmethod
    def _with_rules(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Check the rules between fields in one pass with the fields themselves."""
        if isinstance(data, cls):
            return handler(data)
        data = plain(data)
        faults = all_faults(data)
        own: list[InitErrorDetails] = [
            {"type": kinds.fault(f.found, f.expected), "loc": f.loc, "input": None} for f in faults
        ]
        try:
            model = handler(prepared(data))
        except ValidationError as error:
            raise ValidationError.from_exception_data(
                "Scenario", [*_details(error), *own]
            ) from None
        if own:
            raise ValidationError.from_exception_data("Scenario", own)
        return model

    def resolved(self) -> dict[str, Any]:
        """Return the scenario as plain data, in SI units and with every default.

        Keys without a value are left out; reading the data again gives an equal scenario.
        """
        return self.model_dump(mode="json", exclude_none=True)

    def place(self, key_path: str | KeyPath) -> Place:
        """Return where a key such as `balls[2].radius` was given, or the nearest table to it."""
        return self._source.place(key_path)


def plain(value: Any) -> Any:
    """Return data in which models are replaced by dictionaries, and tuples by lists."""
    if isinstance(value, BaseModel):
        return value.model_dump(exclude_none=True)
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value


def _details(error: ValidationError) -> list[InitErrorDetails]:
    """Return the errors of a model in the form that makes a new error of them and others."""
    details: list[InitErrorDetails] = []
    for item in error.errors(include_url=False):
        context = item.get("ctx", {})
        kind = item["type"]
        details.append(
            {
                "type": kinds.fault(context["found"], context["expected"])
                if kind == "vibro"
                else kind,
                "loc": item["loc"],
                "input": item["input"],
                "ctx": context,
            }
        )
    return details
