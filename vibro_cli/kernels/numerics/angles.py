"""Angles of many vectors at once."""

from __future__ import annotations

import math
from collections.abc import Sequence

from vibro_cli.compile.kernel import kernel


@kernel
def fill_angles(y: Sequence[float], x: Sequence[float], angles: list[float]) -> None:
    """Fill in the angles (rad, -pi to pi) of vectors."""
    for number in range(len(angles)):
        angles[number] = math.atan2(y[number], x[number])
