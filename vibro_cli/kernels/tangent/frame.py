"""The frame of tangent vectors: its orthogonalisation after an impact, and what it has grown.

G. Benettin, L. Galgani, A. Giorgilli, J.-M. Strelcyn, "Lyapunov characteristic exponents for smooth
dynamical systems and for Hamiltonian systems", *Meccanica* 15 (1980): the frame is made orthonormal
again and again, and the logarithms of what its vectors have grown by are added up.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.tangent.world import SCALE, Tangents

# What is left of a vector below this share of it, where directions have been lost, is rounding.
LOST = 1.0e-10


@kernel
def begin_frame(tangents: Tangents) -> None:
    """Set the tangent map of the start: nothing has changed."""
    state = tangents.state[0]
    state.scalings = 0
    state.lost = 0
    for row in range(len(tangents.frame)):
        tangents.sums[0, row] = 0.0
        for column in range(len(tangents.frame)):
            value = 1.0 if row == column else 0.0
            tangents.frame[row, column] = value
            if len(tangents.product) > 0:
                tangents.product[row, column] = value


@kernel
def orthogonalise(tangents: Tangents) -> None:
    """Make the frame orthonormal (Gram and Schmidt, twice); the product takes what it had grown."""
    size = len(tangents.frame)
    frame, step = tangents.frame, tangents.step
    state = tangents.state[0]
    for column in range(size):
        before = _length(tangents, column)
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
        if state.lost == 1 and length < LOST * before:
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
    """Put the triangular factor of an impact in front of the product."""
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
    """A number that the frame and the product give, with what has been taken out of the product."""
    scalings = tangents.state[0].scalings
    factor = SCALE if scalings > 0 else 1.0 / SCALE
    for _ in range(min(abs(scalings), 6)):
        value *= factor
    return value


@kernel
def growth_of_pair(tangents: Tangents, a: int, b: int, numbers: int) -> float:
    """Root mean square growth of a change of the start in the states of two bodies.

    The state of each is so many numbers; ``a`` and ``b`` may be the same body.
    """
    total = 0.0
    for end in range(2 * numbers):
        row = numbers * (a if end < numbers else b) + end % numbers
        for column in range(len(tangents.frame)):
            value = from_start(tangents, row, column)
            total += value * value
    return scaled_back(tangents, math.sqrt(total / (2 * numbers)))


@kernel
def from_start(tangents: Tangents, row: int, column: int) -> float:
    """Element of the tangent map from the start, but for what has been taken out of the product."""
    value = 0.0
    for other in range(column + 1):
        value += tangents.frame[row, other] * tangents.product[other, column]
    return value
