"""The tangent map of any motion by differences of its neighbours, in 50 digits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Of a number of the start, in m or m/s: the differences are right to twice its digits.
CHANGE = 18


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
