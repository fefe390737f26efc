"""Bodies as records of the kernels."""

from __future__ import annotations

from vibro_cli.kernels.structs import BodyData
from vibro_cli.mechanics.body import Body


def body_record(body: Body, gravity: float = 0.0) -> BodyData:
    """Return the record of a body; without gravity (m/s²), where it plays no part, no weight."""
    data = BodyData()
    data.radius = body.radius
    data.kappa = body.kappa
    data.mass = body.mass
    data.rolling_mass = body.kappa * body.mass
    data.weight = body.mass * gravity
    return data
