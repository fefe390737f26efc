"""Tables that the scenarios of several systems share: what a body is, and sampled motion."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from vibro_cli.scenario import quantities as kinds
from vibro_cli.scenario.base import Table
from vibro_cli.scenario.problems import shown

BodyKind = Literal["ball", "disk", "hollow_ball", "hoop", "particle"]


def _as_times(value: object) -> object:
    if isinstance(value, (list, tuple)):
        return tuple(value)
    raise kinds.fault(shown(value), "a list of times")


class BodyTable(Table):
    """What a body is: its kind, its radius and its mass."""

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


class Sampling(Table):
    """Sampled motion, if wanted."""

    step: Annotated[float | None, kinds.TIME] = None
    """Time step of the sampled motion in s."""
    times: Annotated[
        tuple[Annotated[float, kinds.INSTANT], ...] | None, BeforeValidator(_as_times)
    ] = None
    """Times of the sampled motion in s, ascending; instead of a step."""
