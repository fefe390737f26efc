"""Bodies as records of the kernels."""

from __future__ import annotations

from vibro_cli.mechanics.body import Body
from vibro_cli.mechanics.records import BodyData


def body_record(body: Body) -> BodyData:
    """Return the record of a body; there is no weight where gravity plays no part."""
    data = BodyData()
    data.radius = body.radius
    data.kappa = body.kappa
    data.mass = body.mass
    data.rolling_mass = body.kappa * body.mass
    return data
