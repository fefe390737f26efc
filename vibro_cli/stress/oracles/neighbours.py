"""The tangent map of any motion by differences of its neighbours, in 50 digits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.scenario.loading import any_scenario_of
from vibro_cli.stress.finding import Document, Finding, Plan, Worst
from vibro_cli.stress.oracles.fifty_digits import multiprecision
from vibro_cli.systems import system_named
from vibro_cli.systems.run import Stretch
from vibro_cli.systems.tangents import followed

# Of a number of the start, in m or m/s: the differences are right to twice its digits.
CHANGE = 18
# Beyond it the rounding of the motion itself shows in its derivatives.
_MOST_GROWTH = 1.0e4

Neighbours = Callable[
    [Any, Stretch], tuple[Sequence[float], Callable[[Sequence[Any]], Sequence[Any]]]
]
"""From a system and its run: the numbers of its start, and what leads from others, with the same
events, to the numbers of the end."""


def differences(
    mp: Any, follow: Callable[[Sequence[Any]], Sequence[Any]], start: Sequence[float]
) -> NDArray[np.float64]:
    """Return the derivative of the end of a motion to its start.

    Parameters
    ----------
    mp
        A context of mpmath.
    follow
        From the numbers of a start to those of the end.
    start
        Where the derivative is taken.
    """
    change = mp.mpf(10) ** -CHANGE
    columns = []
    for number in range(len(start)):
        ends = []
        for sign in (1, -1):
            moved = [mp.mpf(value) for value in start]
            moved[number] += sign * change
            ends.append(follow(moved))
        columns.append([float((p - q) / (2 * change)) for p, q in zip(*ends, strict=True)])
    return np.array(columns).T


def error_of(
    found: NDArray[np.float64], exact: NDArray[np.float64], units: NDArray[np.float64]
) -> float:
    """Greatest error of a map, as a share of its largest element; one unit of each number."""
    found, exact = (one / units[:, None] * units[None, :] for one in (found, exact))
    return float(np.max(np.abs(found - exact)) / np.max(np.abs(exact)))


def check_maps(
    plan: Plan,
    drawn: Callable[[np.random.Generator], Document],
    neighbours: Neighbours,
    tried: str,
) -> Finding:
    """Return the greatest error of the maps of scenes that are drawn."""
    worst, number = Worst(), 0
    while worst.cases < plan.scenes(6, 200):
        document = drawn(np.random.default_rng([plan.seed, 6, number]))
        number += 1
        error = map_error(document, neighbours)
        if error is not None:
            worst.take(error, document)
    return worst.finding("tangent", "error of the map, of its largest element", tried, 1e-10)


def map_error(document: Document, neighbours: Neighbours) -> float | None:
    """Error of the tangent map of a scene, None where it has none or rounding grows too far.

    None also without an impact.
    """
    scenario = any_scenario_of(document)
    kind = system_named(scenario.system)
    system = kind.build(scenario)
    found, columns, whole = followed(kind, system, kind.limits(scenario))
    smooth = all(bool(np.all(rows["smooth"])) for rows in columns.values())
    impacts = sum(len(rows["smooth"]) for rows in columns.values())
    matrix = found.matrix()
    if not smooth or not impacts or np.max(np.abs(matrix)) > _MOST_GROWTH:
        return None
    start, follow = neighbours(system, whole)
    return error_of(matrix, differences(multiprecision(), follow, start), found.units)
