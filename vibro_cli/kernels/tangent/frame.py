"""The frame of tangent vectors: its arrays, orthogonalisation and growth.

G. Benettin, L. Galgani, A. Giorgilli, J.-M. Strelcyn, "Lyapunov characteristic exponents for smooth
dynamical systems and for Hamiltonian systems", *Meccanica* 15 (1980): the frame is repeatedly made
orthonormal, and the logarithms of the growth of its vectors are added up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from vibro_cli.compile.kernel import FloatMatrix, IntMatrix, kernel, struct
from vibro_cli.kernels.world import Instant

# The product of the triangular factors is kept between the reciprocal of this and this.
SCALE = 2.0**400
# Number of rows of the series of a flight besides one for each body, and number of their terms.
SERIES_ROWS = 4
TERMS = 41
# Number of columns of the scratch rows of simultaneous impacts.
WIDTH = 4


@struct
class TangentState:
    """The state that passes from one part of a run to the next."""

    time_scale: float  # tau, s: a speed counts as the displacement in this time
    scalings: int  # how often SCALE has been divided out of the product
    lost: int  # 1: directions have been lost since the last orthogonalisation
    rough: int  # 1: an event since the last impact has no derivative
    begin_t: float  # start of the run, s
    end_t: float  # end of the last part, s


class Tangents(NamedTuple):
    """Tangent vectors of a run: an orthonormal frame, and the product that leads to it.

    The tangent map from the start is ``frame product SCALE^scalings``. It has two rows for each
    body, displacement along the path of its centre (m) and tau times its speed (m), at the start of
    the body's present flight.
    """

    state: Sequence[TangentState]
    """one"""
    frame: FloatMatrix
    """[2 body + 0 or 1, direction]; orthonormal after each impact, and at the end"""
    product: FloatMatrix
    """[direction, direction], upper triangular; without rows if only the growth of the frame is
    computed, not the map from the start: then there is no amplification"""
    step: FloatMatrix
    """scratch: the triangular factor of one orthogonalisation"""
    sums: FloatMatrix
    """[0, direction] sum of the logarithms of the growth so far"""
    current: IntMatrix
    """[0, body] row of the log with the body's flight; [1, body] scratch: first body of the group
    in which it arrived at its last event, or the body itself"""
    arriving: FloatMatrix
    """[body, 0 or 1] scratch: speed (m/s) and acceleration (m/s^2) before the instant"""
    delay: FloatMatrix
    """[body, direction] scratch: derivative of the time of the body's last event (s), or
    [0, direction] of all events at an instant"""
    turning: FloatMatrix
    """[pair, ...] scratch for rows of simultaneous impacts, see kernels.tangent.follow"""
    series: FloatMatrix
    """[SERIES_ROWS and one for each body, power] scratch for motion by power series: on a rotating
    trace, see kernels.tangent.rotating_jacobian, and in other systems"""
    amplification: FloatMatrix
    """[0, impact] output: growth of a rounding error of the start"""
    smooth: IntMatrix
    """[0, impact] output: 1 if the motion depends differentiably on its start"""
    times: FloatMatrix
    """[impact, 2 body + 0 or 1] output if it has enough rows: derivative of the impact's time (s)
    with respect to the displacement (m) and tau times the speed (m) of each body at the start"""
    growth: FloatMatrix
    """[impact, direction] output: the sums of logarithms after the impact"""


# After directions have been lost, a vector below this share of the longest one is rounding.
LOST = 1.0e-10


# Once vectors have grown by this, fewer than ten digits are left of their transverse parts.
MOST = 2.0**10


@kernel
def begin_frame(tangents: Tangents) -> None:
    """Set the tangent map of the start: the identity."""
    state = tangents.state[0]
    state.scalings = 0
    state.lost = 0
    state.rough = 0
    for row in range(len(tangents.frame)):
        tangents.sums[0, row] = 0.0
        for column in range(len(tangents.frame)):
            value = 1.0 if row == column else 0.0
            tangents.frame[row, column] = value
            if len(tangents.product) > 0:
                tangents.product[row, column] = value


@kernel
def orthogonalise(tangents: Tangents) -> None:
    """Make the frame orthonormal (Gram-Schmidt, twice); move its growth into the product."""
    size = len(tangents.frame)
    frame, step = tangents.frame, tangents.step
    state = tangents.state[0]
    longest = 0.0
    if state.lost == 1:
        for column in range(size):
            longest = max(longest, _length(tangents, column))
    for column in range(size):
        for other in range(column):
            step[other, column] = 0.0
        for _ in range(2):
            for other in range(column):
                along = 0.0
                for row in range(size):
                    along += frame[row, other] * frame[row, column]
                for row in range(size):
                    frame[row, column] -= along * frame[row, other]
                step[other, column] += along
        length = _length(tangents, column)
        if length < LOST * longest:
            length = 0.0
        step[column, column] = length
        for row in range(size):
            frame[row, column] = frame[row, column] / length if length > 0.0 else 0.0
        if length > 0.0:
            tangents.sums[0, column] += math.log(length)
        else:
            tangents.sums[0, column] = -math.inf
    state.lost = 0
    if len(tangents.product) > 0:
        _multiply(tangents)


@kernel
def _length(tangents: Tangents, column: int) -> float:
    square = 0.0
    for row in range(len(tangents.frame)):
        square += tangents.frame[row, column] * tangents.frame[row, column]
    return math.sqrt(square)


@kernel
def _multiply(tangents: Tangents) -> None:
    """Multiply the product from the left by the triangular factor, and rescale it."""
    size = len(tangents.frame)
    product, step = tangents.product, tangents.step
    greatest = 0.0
    for row in range(size):
        for column in range(row, size):
            total = 0.0
            for other in range(row, column + 1):
                total += step[row, other] * product[other, column]
            product[row, column] = total
            greatest = max(greatest, abs(total))
    factor = 1.0
    if greatest > SCALE:
        factor = 1.0 / SCALE
        tangents.state[0].scalings += 1
    elif 0.0 < greatest < 1.0 / SCALE:
        factor = SCALE
        tangents.state[0].scalings -= 1
    if factor != 1.0:
        for row in range(size):
            for column in range(row, size):
                product[row, column] *= factor


@kernel
def scaled_back(tangents: Tangents, value: float) -> float:
    """Return a value computed from the product, multiplied by ``SCALE^scalings``."""
    scalings = tangents.state[0].scalings
    factor = SCALE if scalings > 0 else 1.0 / SCALE
    for _ in range(min(abs(scalings), 6)):
        value *= factor
    return value


@kernel
def from_start(tangents: Tangents, rows: FloatMatrix, row: int, column: int) -> float:
    """Return element (row, column) of the matrix product of ``rows`` and the product.

    With the rows of the frame this is an element of the tangent map, without its scalings.
    """
    value = 0.0
    for other in range(column + 1):
        value += rows[row, other] * tangents.product[other, column]
    return value


@kernel
def store_growth(tangents: Tangents, impact: int, count: int) -> None:
    """Make the frame orthonormal after an event, and fill in the growth at its impacts."""
    orthogonalise(tangents)
    for number in range(impact, impact + count):
        _store_sums(tangents, number)


@kernel
def _store_sums(tangents: Tangents, impact: int) -> None:
    for column in range(len(tangents.frame)):
        tangents.growth[impact, column] = tangents.sums[0, column]


@kernel
def store_smooth(tangents: Tangents, impact: int, count: int, fine: bool) -> None:
    """Fill in whether the motion is differentiable at the impacts of an event."""
    for number in range(impact, impact + count):
        tangents.smooth[0, number] = 1 if fine and tangents.state[0].rough == 0 else 0


@kernel
def store_amplification(tangents: Tangents, impact: int, a: int, b: int, numbers: int) -> None:
    """Fill in the amplification at an impact of two bodies, or of a single body (``a == b``).

    It is the root mean square growth of a change of the start in the states of both, which have
    ``numbers`` components each.
    """
    if len(tangents.product) == 0:
        return
    total = 0.0
    for end in range(2 * numbers):
        row = numbers * (a if end < numbers else b) + end % numbers
        for column in range(len(tangents.frame)):
            value = from_start(tangents, tangents.frame, row, column)
            total += value * value
    growth = math.sqrt(total / (2 * numbers))
    tangents.amplification[0, impact] = scaled_back(tangents, growth)


@kernel
def store_no_impact(tangents: Tangents, impact: int) -> None:
    """Fill in the results at an impact that was not carried out: no amplification, not smooth."""
    tangents.amplification[0, impact] = math.nan
    tangents.smooth[0, impact] = 0
    _store_sums(tangents, impact)


@kernel
def spoil(tangents: Tangents, impacts: Sequence[Instant], end: int, t: float, t_low: float) -> None:
    """Mark the impacts at an instant before row ``end`` as not smooth: their order matters."""
    number = end - 1
    while number >= 0 and impacts[number].t == t and impacts[number].t_low == t_low:
        tangents.smooth[0, number] = 0
        number -= 1


@kernel
def carry_vectors(
    tangents: Tangents, body: int, one: float, two: float, three: float, four: float
) -> None:
    """Multiply a body's tangent vectors by ``[[one, two], [three, four]]``.

    This matrix is the derivative of displacement and speed (m, m/s).
    """
    tau = tangents.state[0].time_scale
    _multiply_body(tangents, body, one, two / tau, three * tau, four)


@kernel
def _multiply_body(
    tangents: Tangents, body: int, one: float, two: float, three: float, four: float
) -> None:
    frame = tangents.frame
    for column in range(len(frame)):
        way = frame[2 * body, column]
        rate = frame[2 * body + 1, column]
        frame[2 * body, column] = one * way + two * rate
        frame[2 * body + 1, column] = three * way + four * rate


@kernel
def carry_far(
    tangents: Tangents, body: int, one: float, two: float, three: float, four: float
) -> None:
    """Do the same as `carry_vectors` with a derivative of determinant 1 and of any magnitude.

    Near a saddle the vectors grow so much that they would become parallel. So
    ``J = U diag(g, 1/g) V^T`` is applied in parts, and the frame made orthonormal after each.
    """
    tau = tangents.state[0].time_scale
    greatest = max(max(abs(one), abs(two) / tau), max(abs(three) * tau, abs(four)))
    if greatest <= MOST or greatest == math.inf:
        carry_vectors(tangents, body, one, two, three, four)
        return
    a, b, c, d = one / greatest, two / tau / greatest, three * tau / greatest, four / greatest
    turn = 0.5 * math.atan2(2.0 * (a * b + c * d), a * a + c * c - b * b - d * d)
    cos, sin = math.cos(turn), math.sin(turn)
    x, y = a * cos + b * sin, c * cos + d * sin
    length = math.sqrt(x * x + y * y)
    _multiply_body(tangents, body, cos, sin, -sin, cos)
    left = length * greatest
    while left > 1.0:
        part = min(left, MOST)
        _multiply_body(tangents, body, part, 0.0, 0.0, 1.0 / part)
        orthogonalise(tangents)
        left /= part
    x, y = x / length, y / length
    _multiply_body(tangents, body, x, -y, y, x)


@kernel
def change_force(tangents: Tangents, body: int, jump: float, late: int) -> None:
    """Apply the jump of a body's acceleration (m/s^2) at an event to its tangent vectors.

    ``late`` is the row of the event's delays.
    """
    jump *= tangents.state[0].time_scale
    if jump != 0.0:
        for column in range(len(tangents.frame)):
            tangents.frame[2 * body + 1, column] -= jump * tangents.delay[late, column]
