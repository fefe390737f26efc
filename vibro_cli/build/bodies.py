"""Bodies of any system from their tables."""

from __future__ import annotations

from collections.abc import Sequence

from vibro_cli.build.findings import Findings
from vibro_cli.mechanics.body import CUSTOM, INERTIA_RATIO, Body, mass_from_density
from vibro_cli.scenario.parts import BodyTable

_MASSES = (1e-100, 1e100)


def bodies_of(balls: Sequence[BodyTable], findings: Findings) -> tuple[Body, ...]:
    """Return the bodies; one of a mass that doubles cannot compute with is a finding."""
    bodies = tuple(map(body_of, balls))
    low, high = _MASSES
    for number, (ball, body) in enumerate(zip(balls, bodies, strict=True), 1):
        if not low <= body.mass <= high:
            key = "mass" if ball.mass is not None else "density"
            found = repr(ball.mass) if ball.mass is not None else f"a mass of {body.mass!r} kg"
            findings.add(f"balls[{number}].{key}", found, f"a mass from {low} to {high} kg")
    return bodies


def body_of(ball: BodyTable) -> Body:
    """Return a body; its numbers may be arrays (see ``numerics.alike``)."""
    if ball.inertia_ratio is not None or ball.body is None:
        kind, ratio = CUSTOM, 0.0 if ball.inertia_ratio is None else ball.inertia_ratio
    else:
        kind, ratio = ball.body, INERTIA_RATIO[ball.body]
    mass = ball.mass
    if mass is None:
        assert ball.density is not None  # one of both is given
        mass = mass_from_density(kind, ball.radius, ball.density, ball.thickness)
    return Body(kind, ball.radius, mass, ratio)
