"""Normal force and friction demand of whole flights, in closed form.

On an arc ``N/(m g) = sign(cos f + (4/kappa) P^2)`` is linear in ``S^2`` (f = phi in a valley, psi
+ pi on a hump, whose sign is -1), so its extremes over a flight lie at the extremes of ``S^2``;
the friction that rolling needs, ``|F|/N`` with ``F = m g sin(alpha)(1 - 1/kappa)``, is stationary
also where ``cos f = -B/A``, ``N/m = A + B cos f``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vibro_cli.simulation.contact_forces import contact_extremes
from vibro_cli.simulation.geometry import Floats
from vibro_cli.simulation.paths import Paths


class Range(NamedTuple):
    """Least and greatest ``S^2`` that each flight passes."""

    low: Floats
    high: Floats


def ranges(paths: Paths) -> Range:
    """Return the extremes of ``S^2`` over each flight on an arc (meaningless on a line)."""
    log = paths.log
    start, end = log["s"] ** 2, paths.end_s**2
    m = log["parameter"]
    low, high = np.minimum(start, end), np.maximum(start, end)
    libration = log["root_complement"] >= 0.0
    half = np.array([_half_period(paths, i) for i in range(len(log))])
    whole = paths.duration >= half
    reversed_ = log["p"] * paths.end_p <= 0.0
    moving = (log["p"] != 0.0) | (log["s"] * log["c"] != 0.0)
    turned = libration & moving & (whole | reversed_ & (log["p"] != 0.0))
    high = np.where(turned, m, high)
    high = np.where(~libration & (whole | (log["c"] * paths.end_c < 0.0)), 1.0, high)
    # The bottom: passed when S changes sign, or between two turning points.
    crossed = log["s"] * paths.end_s < 0.0
    inward = log["s"] * log["c"] * log["p"] < 0.0
    again = libration & moving & inward & (paths.duration >= 0.5 * half)
    low = np.where(crossed | (moving & whole) | again, 0.0, low)
    return Range(low, high)


def _half_period(paths: Paths, index: int) -> float:
    if paths.log["grouped"][index] or paths.places.sign[paths.piece[index]] == 0.0:
        return np.inf
    return paths.half_period(index)


def normal_force(paths: Paths, s2: Floats) -> Floats:
    """Normal force (N) of each flight where it passes ``S^2``; on a line ``m g cos(alpha)``."""
    places = paths.places
    kappa = places.kappa[paths.body]
    sign = places.sign[paths.piece]
    m = paths.log["parameter"]
    arc = sign * ((1.0 + 4.0 * m / kappa) - (2.0 + 4.0 / kappa) * s2)
    slopes = np.array([piece.start_slope for piece in places.system.trace.pieces])
    line = np.cos(slopes[paths.piece])
    force: Floats = places.weight[paths.body] * np.where(sign == 0.0, line, arc)
    return force


def friction_demand(paths: Paths, s2: Floats) -> Floats:
    """Coefficient of friction that rolling needs where each flight passes ``S^2``.

    Inf for N <= 0.
    """
    places = paths.places
    sign = places.sign[paths.piece]
    slopes = np.array([piece.start_slope for piece in places.system.trace.pieces])[paths.piece]
    sine = np.where(
        sign == 0.0, np.abs(np.sin(slopes)), 2.0 * np.sqrt(np.clip(s2 * (1 - s2), 0, 1))
    )
    force = places.weight[paths.body] * sine * (1.0 - 1.0 / places.kappa[paths.body])
    normal = normal_force(paths, s2)
    with np.errstate(divide="ignore", invalid="ignore"):
        demand = np.where(normal > 0.0, force / normal, np.inf)
    return np.where(force == 0.0, np.where(normal >= 0.0, 0.0, np.inf), demand)


def extremes(paths: Paths) -> dict[str, Any]:
    """Return the least normal force (N) and the greatest friction demand over all flights."""
    free = paths.log["grouped"] == 0
    span = ranges(paths)
    least = np.minimum(normal_force(paths, span.low), normal_force(paths, span.high))[free]
    candidates = [friction_demand(paths, span.low), friction_demand(paths, span.high)]
    stationary = _stationary(paths, span)
    candidates.append(friction_demand(paths, stationary))
    demands = np.max(candidates, axis=0)[free]
    in_contact = contact_extremes(paths)
    least = np.append(least, [forces.least for forces in in_contact])
    demand = float(np.max(np.append(demands, [forces.demand for forces in in_contact])))
    return {
        "min_normal_force": float(np.min(least)),
        "max_friction_demand": demand if np.isfinite(demand) else np.nan,
    }


def _stationary(paths: Paths, span: Range) -> Floats:
    """``S^2`` where the demand is stationary, ``cos f = -B/A``, kept within the flight's range."""
    places = paths.places
    kappa = places.kappa[paths.body]
    m = paths.log["parameter"]
    # N/(m g) = sign (A + B cos f) with S^2 = (1 - cos f)/2.
    b = 1.0 + 2.0 / kappa
    a = 4.0 * m / kappa - 2.0 / kappa
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = np.where(np.abs(a) > b, -b / a, np.nan)
    s2 = 0.5 * (1.0 - cosine)
    inside = (s2 >= span.low) & (s2 <= span.high)
    return np.where(inside, s2, span.low)
