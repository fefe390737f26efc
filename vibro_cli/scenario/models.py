"""The scenario of a trace as pydantic models: names, defaults, descriptions and rules of fields.

The descriptions also appear in the JSON Schema and in errors. A single field is checked by its
kind, several fields together by rules. Both run in the same pass, so that all errors of a file are
reported at once. Rules work on the plain data of a file, before it becomes a model; they treat an
invalid value as unknown, since its field reports it. Paths count from 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, get_args

from pydantic import BeforeValidator, Discriminator, Field, Tag, WithJsonSchema

from vibro_cli.errors import listing
from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.scenario import quantities as kinds
from vibro_cli.scenario.base import (
    KIND,
    MASS,
    SAMPLES,
    AnyScenario,
    BodyTable,
    Listed,
    Rule,
    Sampling,
    Table,
    at_least_one,
    at_most_one,
    exactly_one,
)
from vibro_cli.scenario.problems import Fault, shown
from vibro_cli.systems import NAMES

Data = Mapping[str, Any]
_NEEDS_THICKNESS = ("disk", "hollow_ball", "hoop")

# Keys of one table of which at most one may be given.
START = ("angle", "position", "touching")
MOTION = ("rate", "omega", "speed")
AXIS = ("through_arc", "x")


@dataclass(frozen=True)
class Piece:
    """Properties of a piece of the trace, None where unknown."""

    shape: str | None
    start_slope: float | None
    end_slope: float | None
    length: float | None

    def angles(self) -> tuple[float, float] | None:
        """Return the angles at its ends: φ = α in a valley, ψ = −α on a hump (model, part 1)."""
        if self.start_slope is None or self.end_slope is None:
            return None
        if self.shape == "hump":
            return 0.0 - self.start_slope, 0.0 - self.end_slope  # no -0.0
        return self.start_slope, self.end_slope


def with_bodies(data: Data, default_motion: Callable[[Data], dict[str, float]]) -> dict[str, Any]:
    """Return the data with default kinds and motions of the bodies filled in."""
    balls = data.get("balls")
    if not isinstance(balls, list):
        return dict(data)
    return {**data, "balls": [_with_defaults(ball, default_motion) for ball in balls]}


def _with_defaults(ball: object, default_motion: Callable[[Data], dict[str, float]]) -> object:
    if not isinstance(ball, Mapping):
        return ball
    kind = {} if set(KIND) & set(ball) else {"body": "ball"}
    return {**ball, **kind, **default_motion(ball)}


def spread_restitution(data: Data) -> dict[str, Any]:
    """Return the data with a single k expanded to a list for all pairs."""
    filled = dict(data)
    collision = data.get("collision", {})
    if isinstance(collision, Mapping):
        k, pairs = collision.get("k"), pair_count(data)
        single = None if isinstance(k, list) else kinds.RESTITUTION.read_or_none(k)
        if single is not None and pairs is not None:
            filled["collision"] = {**collision, "k": [single] * pairs}
    return filled


def pair_count(data: Data) -> int | None:
    """Return the number of pairs of neighbours, or None if the bodies are not a list."""
    balls, closed = data.get("balls"), section(data, "trace").get("closed") is True
    if not isinstance(balls, list):
        return None
    return len(balls) if closed and len(balls) > 2 else max(len(balls) - 1, 0)


def section(data: Data, key: str) -> Data:
    """Return a table of the data, empty if missing."""
    value = data.get(key)
    return value if isinstance(value, Mapping) else {}


def rows(data: Data, key: str) -> list[tuple[int, Data]]:
    """Return the tables in a list of the data, with their indices."""
    value = data.get(key)
    if not isinstance(value, list):
        return []
    return [(i, row) for i, row in enumerate(value) if isinstance(row, Mapping)]


def _pieces(data: Data) -> list[Piece]:
    """Return the chain of pieces, as far as the data determine it."""
    trace = section(data, "trace")
    slope = kinds.SLOPE.read_or_none(trace.get("start_slope"))
    arcs = trace.get("arcs")
    pieces = []
    for arc in arcs if isinstance(arcs, list) else []:
        given: Data = arc if isinstance(arc, Mapping) else {}
        shape = given.get("shape")
        known = shape if shape in get_args(Shape) else None
        end = slope if known == "line" else kinds.SLOPE.read_or_none(given.get("end_slope"))
        length = kinds.LENGTH.read_or_none(given.get("length")) if known == "line" else None
        pieces.append(Piece(known, slope, end, length))
        slope = end
    return pieces


def _piece_of(ball: Data, pieces: list[Piece]) -> Piece | None:
    index = kinds.COUNT.read_or_none(ball.get("arc"))
    return pieces[index - 1] if index is not None and index <= len(pieces) else None


def one_of(
    table: Data, keys: tuple[str, ...], loc: tuple[str | int, ...], needed: bool
) -> Iterator[Fault]:
    """Check that exactly one of some keys is given, or at most one unless `needed`."""
    given = [key for key in keys if key in table]
    one = f"one of {listing(keys)}"
    if len(given) > 1:
        last = max(given, key=list(table).index)
        expected = one if needed else f"at most {one}"
        yield Fault((*loc, last), listing(given, "and"), expected, on_key=True)
    elif needed and not given:
        yield Fault(loc, "none of them", one)


def _trace_faults(data: Data) -> Iterator[Fault]:
    pieces = _pieces(data)
    for index, arc in rows(section(data, "trace"), "arcs"):
        loc = ("trace", "arcs", index)
        if arc.get("shape") == "line":
            if "length" not in arc:
                yield Fault((*loc, "length"), "nothing", "the length of the line")
            for key in ("radius", "end_slope"):
                if key in arc:
                    expected = f"no {key} on a line, which has a length and keeps its slope"
                    yield Fault((*loc, key), shown(arc[key]), expected, on_key=True)
        elif arc.get("shape") in ("valley", "hump"):
            yield from _arc_faults(arc, loc, pieces[index])


def _arc_faults(arc: Data, loc: tuple[str | int, ...], piece: Piece) -> Iterator[Fault]:
    for key in ("radius", "end_slope"):
        if key not in arc:
            yield Fault((*loc, key), "nothing", f"the {key} of the {piece.shape}")
    if "length" in arc:
        expected = "no length on an arc, which has a radius and an end_slope"
        yield Fault((*loc, "length"), shown(arc["length"]), expected, on_key=True)
    start, end = piece.start_slope, piece.end_slope
    if start is None or end is None:
        return
    if (end <= start) if piece.shape == "valley" else (end >= start):
        word = "greater" if piece.shape == "valley" else "less"
        expected = f"a slope {word} than at the {piece.shape}'s start, {_slope(start)}"
        yield Fault((*loc, "end_slope"), _with_number(arc["end_slope"], end), expected)


def _slope(value: float) -> str:
    return f"{value!r} rad ({math.degrees(value):.6g} deg)"


def _with_number(given: object, number: float) -> str:
    return f"{shown(given)} ({number!r} rad)" if isinstance(given, str) else shown(given)


def _turning_faults(data: Data) -> Iterator[Fault]:
    turning = section(data, "trace").get("turning")
    if not isinstance(turning, Mapping):
        return
    loc = ("trace", "turning")
    yield from one_of(turning, AXIS, loc, needed=True)
    index, pieces = kinds.COUNT.read_or_none(turning.get("through_arc")), _pieces(data)
    if index is None or not pieces:
        return
    if index > len(pieces):
        yield Fault((*loc, "through_arc"), str(index), f"an arc from 1 to {len(pieces)}")
    elif pieces[index - 1].shape == "line":
        yield Fault((*loc, "through_arc"), f"{index}, a line", "an arc: a line has no centre")


def _ball_faults(data: Data) -> Iterator[Fault]:
    balls, pieces = rows(data, "balls"), _pieces(data)
    for index, ball in balls:
        yield from faults_in_row(data, index, ball, START, MOTION)
        yield from _start_faults(ball, ("balls", index), pieces)


def faults_in_row(
    data: Data, index: int, ball: Data, start: tuple[str, ...], motion: tuple[str, ...]
) -> Iterator[Fault]:
    """Check a body in a row of bodies; the last key of `start` is `touching`."""
    loc = ("balls", index)
    yield from body_faults(ball, loc, lone=len(data["balls"]) == 1)
    yield from one_of(ball, start, loc, needed=True)
    yield from one_of(ball, motion, loc, needed=False)
    if index == 0 and "touching" in ball:
        expected = f"{listing(start[:-1])}: the first body has none to its left"
        yield Fault((*loc, "touching"), shown(ball["touching"]), expected, on_key=True)


def body_faults(ball: Data, loc: tuple[str | int, ...], lone: bool) -> Iterator[Fault]:
    """Check the properties of a body: mass or density, thickness if needed, a radius of 0."""
    yield from one_of(ball, MASS, loc, needed=True)
    if "inertia_ratio" in ball:
        yield from one_of(ball, KIND, loc, needed=False)
        if "density" in ball and "mass" not in ball:
            expected = "mass, as inertia_ratio does not determine the volume"
            yield Fault((*loc, "density"), "density with inertia_ratio", expected, on_key=True)
    body = ball.get("body")
    if body in _NEEDS_THICKNESS and "density" in ball and "thickness" not in ball:
        words = str(body).replace("_", " ")
        expected = f"the thickness of the {words}, which its density needs, or mass"
        yield Fault((*loc, "thickness"), "nothing", expected)
    if kinds.RADIUS.read_or_none(ball.get("radius")) != 0:
        return
    if not lone or body != "particle":
        yield Fault(
            (*loc, "radius"),
            shown(ball["radius"]),
            "a number greater than 0 (0 only for a lone particle)",
        )
    elif "density" in ball:
        yield Fault((*loc, "density"), "density with radius 0", "mass", on_key=True)
    if "omega" in ball:
        expected = "rate or speed: a body of radius 0 does not roll"
        yield Fault((*loc, "omega"), "omega with radius 0", expected, on_key=True)


def _start_faults(ball: Data, loc: tuple[str | int, ...], pieces: list[Piece]) -> Iterator[Fault]:
    """Check that a body starts on its piece, given in the coordinate of that piece."""
    index = kinds.COUNT.read_or_none(ball.get("arc"))
    if index is not None and pieces and index > len(pieces):
        yield Fault((*loc, "arc"), str(index), f"a whole number from 1 to {len(pieces)}")
    piece = _piece_of(ball, pieces)
    if piece is None or piece.shape is None:
        return
    if piece.shape == "line":
        unfit = {"angle": "position (a line has no angle)", "rate": "speed or omega on a line"}
    else:
        unfit = {"position": f"angle (in a {piece.shape})"}
    for key, expected in unfit.items():
        if key in ball:
            yield Fault((*loc, key), f"{key} on a {piece.shape}", expected, on_key=True)
    yield from _range_faults(ball, loc, piece)


def _range_faults(ball: Data, loc: tuple[str | int, ...], piece: Piece) -> Iterator[Fault]:
    if piece.shape == "line":
        position = kinds.POSITION.read_or_none(ball.get("position"))
        if position is None or piece.length is None or 0 <= position <= piece.length:
            return
        expected = f"a position on the line, from 0 to {piece.length!r} m"
        yield Fault((*loc, "position"), shown(ball["position"]), expected)
        return
    angle, ends = kinds.ANGLE.read_or_none(ball.get("angle")), piece.angles()
    if angle is None or ends is None or ends[0] >= ends[1] or ends[0] <= angle <= ends[1]:
        return
    degrees = f"{math.degrees(ends[0]):.6g} to {math.degrees(ends[1]):.6g} deg"
    expected = f"an angle of this {piece.shape}, from {ends[0]!r} to {ends[1]!r} rad ({degrees})"
    yield Fault((*loc, "angle"), _with_number(ball["angle"], angle), expected)


def collision_faults(data: Data) -> Iterator[Fault]:
    """Check that each pair of neighbours has a coefficient of restitution."""
    pairs = pair_count(data)
    if pairs is None:
        return
    collision = data.get("collision", {})
    if not isinstance(collision, Mapping):
        return
    k = collision.get("k")
    if isinstance(k, list) and len(k) != pairs:
        each = "one for each pair of neighbours" if pairs else "a lone body has no neighbour"
        found = "an empty list" if not k else f"a list of {len(k)}"
        yield Fault(("collision", "k"), found, f"one number or a list of {pairs}: {each}")
    elif "collision" not in data and pairs > 0:
        yield Fault(("collision",), "nothing", "the table of the impact law with its k")
    elif "k" not in collision and pairs > 0:
        expected = "the coefficient of restitution k, a number from 0 to 1"
        yield Fault(("collision", "k"), "nothing", expected)


def stop_faults(data: Data, keys: Collection[str] = ("time", "collisions")) -> Iterator[Fault]:
    """Check that the run has a stop."""
    stop = data.get("stop")
    if isinstance(stop, Mapping) and not set(keys) & set(stop):
        found = "neither" if len(keys) == 2 else "none of them"
        yield Fault(("stop",), found, f"at least one of {listing(keys)}")


def _end_faults(data: Data) -> Iterator[Fault]:
    if section(data, "trace").get("closed") is not True:
        return
    for side in ("left", "right"):
        if isinstance(section(data, "ends").get(side), Mapping):
            expected = "no wall: a closed trace has no ends"
            yield Fault(("ends", side), "a wall on a closed trace", expected)


def output_faults(data: Data) -> Iterator[Fault]:
    """Check that the sampled motion has ascending times, or a step whose multiples are exact."""
    output = section(data, "output")
    yield from one_of(output, SAMPLES, ("output",), needed=False)
    step = kinds.TIME.read_or_none(output.get("step"))
    end = kinds.TIME.read_or_none(section(data, "stop").get("time"))
    if step and end and end > 2**53 * step:  # their numbers are not exact beyond
        expected = f"a step that is not shorter than stop.time / 2^53 = {end / 2**53:.3g} s"
        yield Fault(("output", "step"), shown(output["step"]), expected)
    times = output.get("times")
    if not isinstance(times, list):
        return
    before = -math.inf
    for index, value in enumerate(times):
        time = kinds.INSTANT.read_or_none(value)
        if time is not None and time <= before:
            expected = f"a time later than the one before it, {before!r}"
            yield Fault(("output", "times", index), shown(value), expected)
        before = before if time is None else time


Shape = Literal["valley", "hump", "line"]
Surface = Literal["two-sided", "one-sided"]
Law = Annotated[str, kinds.Word(tuple(sorted(LAW_NAMES)))]
_WhatFollows = Literal["stop", "normal-impulse"]
Inadmissible = Annotated[_WhatFollows, kinds.Word(get_args(_WhatFollows))]


def _not_null(value: object) -> object:
    if value is None:  # a missing key is fine, but null in a file is an error
        raise kinds.fault("null", "a table")
    return value


def _restitutions(value: object) -> object:
    """Return the coefficients as a tuple; a single number stands for all pairs."""
    if isinstance(value, (list, tuple)):
        return tuple(value)
    return (kinds.RESTITUTION.read(value),)


def _end_tag(value: object) -> str | None:
    if isinstance(value, (dict, Wall)):
        return "<wall>"
    return "<stop>" if value == "stop" else None


_K_SCHEMA = kinds.RESTITUTION.schema()


def _shape(words: list[str], needed: list[str], unfit: list[str]) -> Rule:
    """Return the rule for the keys of pieces of these shapes."""
    then = {"required": needed, "not": {"anyOf": [{"required": [key]} for key in unfit]}}
    return {"if": {"properties": {"shape": {"enum": words}}}, "then": then}


class Arc(Table):
    """A piece of the trace: a circular arc (valley or hump) or a straight line."""

    rules = (
        _shape(["line"], ["length"], ["radius", "end_slope"]),
        _shape(["valley", "hump"], ["radius", "end_slope"], ["length"]),
    )

    shape: Annotated[Shape, kinds.Word(get_args(Shape))]
    """valley (an arc that is concave towards the bodies), hump (one that is convex) or line."""
    radius: Annotated[float | None, kinds.LENGTH] = None
    """Radius of the arc in m; a line has none."""
    length: Annotated[float | None, kinds.LENGTH] = None
    """Length of a line in m; that of an arc follows from its end_slope and is not given."""
    end_slope: Annotated[float | None, kinds.SLOPE] = None
    """Slope of the tangent at the right end of the arc, in rad: greater than at its left end in a
    valley, smaller on a hump; a line keeps its slope."""


class Turning(Table):
    """The trace rotates about a vertical axis at a constant rate."""

    rules = (exactly_one(*AXIS),)

    through_arc: Annotated[int | None, kinds.COUNT] = None
    """Arc through whose centre the axis passes, counted from 1."""
    x: Annotated[float | None, kinds.POSITION] = None
    """Horizontal position of the axis in m, from the trace's left end."""
    rate: Annotated[float, kinds.ANGULAR_RATE]
    """Angular velocity of the trace about the axis in rad/s."""


class Trace(Table):
    """The trace: a chain of pieces that share their tangents, from left to right."""

    start_slope: Annotated[float, kinds.SLOPE]
    """Slope of the tangent at the left end, in rad."""
    closed: Annotated[bool, kinds.FLAG] = False
    """Whether the trace is closed: its end joins its start smoothly."""
    surface: Annotated[Surface, kinds.Word(get_args(Surface))] = "two-sided"
    """two-sided: the trace keeps bodies from lifting off, and each point where one would lift off
    is an event; one-sided: lift-off ends the run."""
    turning: Annotated[Turning | None, BeforeValidator(_not_null)] = None
    """Rotation of the trace about a vertical axis; if omitted, the trace is at rest."""
    arcs: Annotated[tuple[Arc, ...], Listed("arcs", 1)]
    """The pieces of the trace, from left to right."""


class Ball(BodyTable):
    """A body on the trace."""

    rules = (*BodyTable.rules, exactly_one(*START), at_most_one(*MOTION))

    arc: Annotated[int, kinds.COUNT]
    """The piece of the trace the body starts on, counted from 1."""
    angle: Annotated[float | None, kinds.ANGLE] = None
    """Initial angle on an arc in rad: phi from the lowest point of a valley, psi from the crest
    of a hump, positive to the right."""
    position: Annotated[float | None, kinds.POSITION] = None
    """Initial position on a line in m, measured from its left end."""
    touching: Annotated[Literal["previous"] | None, kinds.Word(("previous",))] = None
    """previous: the body starts in contact with the one to its left."""
    rate: Annotated[float | None, kinds.ANGULAR_RATE] = Field(
        default=None, json_schema_extra={"default": 0.0}
    )
    """Initial rate of change of the angle in rad/s, 0 if none of rate, omega and speed is given;
    on a line, give omega or speed."""
    omega: Annotated[float | None, kinds.ANGULAR_RATE] = None
    """Initial angular velocity of rolling in rad/s: speed of the centre divided by the radius."""
    speed: Annotated[float | None, kinds.SPEED] = None
    """Initial speed of the centre in m/s, positive to the right."""


class Collision(Table):
    """The law that gives the velocities of two neighbours after an impact."""

    law: Law = "hedrih"
    """Name of the impact law."""
    k: Annotated[
        tuple[Annotated[float, kinds.RESTITUTION], ...],
        BeforeValidator(_restitutions),
        WithJsonSchema({"anyOf": [_K_SCHEMA, {"type": "array", "items": _K_SCHEMA}]}),
        # Its default depends on the bodies.
        Field(json_schema_extra=lambda schema: schema.pop("default", None)),
    ] = ()
    """Coefficient of restitution from 0 to 1: one number, or one for each pair of neighbours."""
    inadmissible: Inadmissible = "stop"
    """What happens at an inadmissible impact, after which the bodies would pass through one
    another: the run stops, or the normal-impulse law is used for that impact, which is marked."""


class Stop(Table):
    """When the run ends: at the first of these limits."""

    rules = (at_least_one("time", "collisions"),)

    time: Annotated[float | None, kinds.TIME] = None
    """Time at which the run ends, in s; events at exactly this time (t + t_low) are included."""
    collisions: Annotated[int | None, kinds.COUNT, Field(title="impacts")] = None
    """Number of impacts after which the run ends; others solved jointly with the last of them are
    included."""


class Wall(Table):
    """A plane wall across an end of the trace; a body touches it at a distance equal to its
    radius."""

    wall: Annotated[float, kinds.RESTITUTION]
    """Coefficient of restitution of the wall, from 0 to 1."""


End = Annotated[
    Annotated[Literal["stop"], kinds.Word(("stop",)), Tag("<stop>")]
    | Annotated[Wall, Tag("<wall>")],
    Discriminator(_end_tag),
]


class Ends(Table):
    """What happens at the two ends of an open trace."""

    left: End = "stop"
    """stop, which ends the run when a contact point reaches the left end, or a wall."""
    right: End = "stop"
    """stop, which ends the run when a contact point reaches the right end, or a wall."""


class Output(Sampling):
    """Optional output: sampled motion and additional events."""

    turning_points: Annotated[bool, kinds.FLAG] = False
    """Whether turning points are recorded as events."""
    friction: Annotated[float | None, kinds.RATIO] = None
    """Coefficient of friction of the trace; where rolling would require a greater one, a slip
    event is recorded."""


class Analysis(Table):
    """Optional analysis of the growth of small perturbations."""

    lyapunov: Annotated[bool, kinds.FLAG] = False
    """Whether to follow the growth of small perturbations of the initial state: accurate digits
    left at each impact, Lyapunov exponents in the summary, and a table of their convergence."""


Growth = Annotated[Analysis | None, BeforeValidator(_not_null)]
"""Optional analysis of the growth of small perturbations."""


class Scenario(AnyScenario):
    """A vibro-impact scenario: trace, bodies, impact law, and when the run ends."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (MASS, START, MOTION, KIND, AXIS, SAMPLES)

    system: Annotated[Literal["trace"], kinds.Word(NAMES)] = Field("trace", exclude=True)
    """The system to solve: bodies on a trace; scenarios of other systems have other keys."""
    gravity: Annotated[float, kinds.GRAVITY]
    """Acceleration of gravity in m/s^2."""
    trace: Trace
    """The trace the bodies roll on."""
    balls: Annotated[tuple[Ball, ...], Listed("bodies", 1)]
    """The bodies, from left to right."""
    collision: Collision = Collision()
    """The impact law; required if there are two or more bodies."""
    stop: Stop
    """When the run ends."""
    ends: Ends = Ends()
    """What happens at the two ends of an open trace."""
    output: Output = Output()
    """Optional output: sampled motion and additional events."""
    analysis: Growth = None
    """Optional analysis of the growth of small perturbations."""

    @classmethod
    def between_fields(cls, data: dict[str, Any]) -> list[Fault]:
        """Return every broken rule between fields."""
        return [
            *_trace_faults(data),
            *_turning_faults(data),
            *_ball_faults(data),
            *collision_faults(data),
            *stop_faults(data),
            *_end_faults(data),
            *output_faults(data),
        ]

    @classmethod
    def prepared(cls, data: dict[str, Any]) -> dict[str, Any]:
        """Return the data with the defaults that depend on other fields filled in."""
        pieces = _pieces(data)

        def default_motion(ball: Data) -> dict[str, float]:
            if set(MOTION) & set(ball):
                return {}
            piece = _piece_of(ball, pieces)
            return {"speed" if piece is not None and piece.shape == "line" else "rate": 0.0}

        return with_bodies(spread_restitution(data), default_motion)
