"""Bodies of any system from their tables."""

from __future__ import annotations

from collections.abc import Sequence

from vibro_cli.build.findings import Findings
from vibro_cli.mechanics.body import CUSTOM, INERTIA_RATIO, Body, mass_from_density
from vibro_cli.scenario.parts import BodyTable

_MASSES = (1e-100, 1e100)


def bodies_of(balls: Sequence[BodyTable], findings: Findings) -> tuple[Body, ...]:
    """Return the bodies; one of a mass that doubles cannot compute with is a finding."""
    bodies = tuple(_body(ball) for ball in balls)
    low, high = _MASSES
    for number, (ball, body) in enumerate(zip(balls, bodies, strict=True), 1):
        if not low <= body.mass <= high:
            key = "mass" if ball.mass is not None else "density"
            found = repr(ball.mass) if ball.mass is not None else f"a mass of {body.mass!r} kg"
            findings.add(f"balls[{number}].{key}", found, f"a mass from {low} to {high} kg")
    return bodies


def _body(ball: BodyTable) -> Body:
    if ball.inertia_ratio is not None or ball.body is None:
        kind, ratio = CUSTOM, ball.inertia_ratio or 0.0
    else:
        kind, ratio = ball.body, INERTIA_RATIO[ball.body]
    mass = ball.mass
    if mass is None:
        mass = mass_from_density(kind, ball.radius, ball.density or 0.0, ball.thickness)
    return Body(kind, ball.radius, mass, ratio)
