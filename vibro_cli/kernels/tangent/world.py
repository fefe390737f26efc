"""What the tangent map of a run works on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from vibro_cli.compile.kernel import FloatMatrix, IntMatrix, struct

# The product of the triangular factors is kept between this and its reciprocal.
SCALE = 2.0**400
# Rows of the series of a flight that are not of one body, and the greatest power of time in them.
SERIES_ROWS = 4
TERMS = 41


@struct
class TangentState:
    """What goes on from one part of a run to the next."""

    time_scale: float  # tau, s: a speed counts as the way in this time
    scalings: int  # so many times has SCALE been taken out of the product
    lost: int  # 1: directions have been lost since the last orthogonalisation
    rough: int  # 1: an event since the last impact has no derivative
    begin_t: float  # of the run, s
    end_t: float  # of the part told of last, s


class Tangents(NamedTuple):
    """Tangent vectors of a run, in an orthonormal frame and the product that leads to it.

    The tangent map from the start is ``frame product SCALE^scalings``; of each body it has two
    rows, way along the path of its centre (m) and tau times its speed (m), at the start of the
    body's present flight.
    """

    state: Sequence[TangentState]
    """One."""
    frame: FloatMatrix
    """[2 body + 0 or 1, direction]; orthonormal after each impact, and at the end"""
    product: FloatMatrix
    """[direction, direction], upper triangular; without rows where the growth of the frame alone is
    wanted, and not the map from the start: then there is no amplification"""
    step: FloatMatrix
    """scratch: the triangular factor of one impact"""
    sums: FloatMatrix
    """[0, direction] sum of the logarithms of the growth so far"""
    current: IntMatrix
    """[0, body] row of the log that its flight is"""
    arriving: FloatMatrix
    """[body, 0 or 1] scratch: speed (m/s) and acceleration (m/s^2) before the instant"""
    delay: FloatMatrix
    """[0, direction] scratch: derivative of the time of the instant's first impact (s)"""
    turning: FloatMatrix
    """[pair, ...] scratch: what the rows of a joint impact need, see kernels.tangent.impacts"""
    series: FloatMatrix
    """scratch of flights on a trace that turns, see kernels.tangent.rotating_jacobian, and on
    springs, see kernels.springs.variation: SERIES_ROWS, and one for each body"""
    amplification: FloatMatrix
    """[0, impact] filled in: growth of one rounding of the start"""
    smooth: IntMatrix
    """[0, impact] filled in: 1 where the motion depends differentiably on its start"""
    times: FloatMatrix
    """[impact, 2 body + 0 or 1] filled in if it has as many rows: derivative of the impact's time
    (s) to the start, times of ways and speeds divided by tau"""
    growth: FloatMatrix
    """[impact, direction] filled in: the sums of logarithms after the impact"""
