"""What is told of impacts where systems follow the log of their own: columns of their rows."""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.tangent.frame import growth_of_pair, orthogonalise
from vibro_cli.kernels.tangent.world import Tangents


@kernel
def tell_event(tangents: Tangents, impact: int, count: int) -> None:
    """Make the frame orthonormal after an event, and fill in what its impacts have grown it by."""
    orthogonalise(tangents)
    for number in range(impact, impact + count):
        for column in range(len(tangents.frame)):
            tangents.growth[number, column] = tangents.sums[0, column]


@kernel
def tell_smooth(tangents: Tangents, impact: int, count: int, fine: bool) -> None:
    """Fill in whether the motion still has a derivative at the impacts of an event."""
    for number in range(impact, impact + count):
        tangents.smooth[0, number] = 1 if fine and tangents.state[0].rough == 0 else 0


@kernel
def tell_growth(tangents: Tangents, impact: int, a: int, b: int, numbers: int) -> None:
    """Fill in the amplification of an impact of two bodies, or of one (twice the same)."""
    if len(tangents.product) > 0:
        tangents.amplification[0, impact] = growth_of_pair(tangents, a, b, numbers)


@kernel
def tell_nothing(tangents: Tangents, impact: int) -> None:
    """Nothing goes on from an impact that is not carried out."""
    tangents.amplification[0, impact] = math.nan
    tangents.smooth[0, impact] = 0
