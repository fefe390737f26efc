"""The scenario of `system = "springs"`: disks or balls on a straight line, each held by a spring.

Source: C, part 3, (4)-(7) and figure 5.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

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
    at_most_one,
    exactly_one,
)
from vibro_cli.scenario.models import (
    Collision,
    Data,
    Growth,
    Stop,
    collision_faults,
    faults_in_row,
    output_faults,
    rows,
    spread_restitution,
    stop_faults,
    with_bodies,
)
from vibro_cli.scenario.problems import Fault

# Keys of one table of which at most one may be given.
PLACE = ("position", "touching")
MOTION = ("speed", "omega")


class Spring(Table):
    """The spring between a body's centre and its foot above the line of the centres."""

    stiffness: Annotated[float, kinds.STIFFNESS, Field(title="stiffness c of the spring")]
    """Stiffness c in N/m."""
    length: Annotated[float, kinds.LENGTH, Field(title="natural length l")]
    """Natural length l in m."""
    height: Annotated[float, kinds.LENGTH, Field(title="height b of its foot")]
    """Height b of the foot above the line of the body's centre in m."""
    foot: Annotated[float, kinds.POSITION, Field(title="position of its foot")]
    """Position of the foot along the line in m."""


class SpringBall(BodyTable):
    """A body on the line, held by its spring."""

    rules = (
        *BodyTable.rules,
        exactly_one(*PLACE),
        at_most_one(*MOTION),
    )

    position: Annotated[float | None, kinds.POSITION] = None
    """Initial position of the centre along the line in m, on the same axis as the feet of the
    springs."""
    touching: Annotated[Literal["previous"] | None, kinds.Word(("previous",))] = None
    """previous: the body starts in contact with the one to its left."""
    speed: Annotated[float | None, kinds.SPEED] = Field(
        default=None, json_schema_extra={"default": 0.0}
    )
    """Initial speed of the centre in m/s, positive to the right; 0 if neither speed nor omega is
    given."""
    omega: Annotated[float | None, kinds.ANGULAR_RATE] = None
    """Initial angular velocity of rolling in rad/s: speed of the centre divided by the radius."""
    spring: Spring
    """The spring that holds the body."""


class SpringsScenario(AnyScenario):
    """Bodies rolling on a straight line, each held by a spring, that collide as neighbours."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (MASS, KIND, PLACE, MOTION, SAMPLES)

    system: Annotated[Literal["springs"], kinds.Word(("springs",))]
    """The system to solve: bodies on a line, each held by a spring."""
    balls: Annotated[tuple[SpringBall, ...], Listed("bodies", 1)]
    """The bodies, from left to right."""
    collision: Collision = Collision()
    """The impact law; required if there are two or more bodies."""
    stop: Stop
    """When the run ends."""
    output: Sampling = Sampling()
    """Optional output: sampled motion."""
    analysis: Growth = None
    """Optional analysis of the growth of small perturbations."""

    @classmethod
    def between_fields(cls, data: dict[str, Any]) -> list[Fault]:
        """Return every broken rule between fields."""
        return [
            *_ball_faults(data),
            *collision_faults(data),
            *stop_faults(data),
            *output_faults(data),
        ]

    @classmethod
    def prepared(cls, data: dict[str, Any]) -> dict[str, Any]:
        """Return the data with the defaults that depend on other fields filled in."""
        return with_bodies(spread_restitution(data), _default_motion)


MODEL = SpringsScenario


def _default_motion(ball: Data) -> dict[str, float]:
    return {} if any(key in ball for key in MOTION) else {"speed": 0.0}


def _ball_faults(data: Data) -> Iterator[Fault]:
    for index, ball in rows(data, "balls"):
        yield from faults_in_row(data, index, ball, PLACE, MOTION)
