"""The tridiagonal system of a chain of touching bodies, for joint impulses or contact forces.

Each row belongs to a pair of neighbours. The system is solved from both ends to the middle, so that
a mirror image has mirrored results to the bit.
"""

from __future__ import annotations

from collections.abc import Sequence

from vibro_cli.compile.kernel import kernel, struct


@struct
class ChainRow:
    """One row: the coefficients of the impulse or force of a pair, and its solution."""

    part_a: float  # contributions of both bodies to the diagonal
    part_b: float
    lower: float  # elements below and above the diagonal
    upper: float
    right: float  # right-hand side
    solution: float


@kernel
def _quotient(value: float, divisor: float) -> float:
    return value / divisor if divisor > 0.0 else 0.0


@kernel
def solve_from_both_ends(rows: Sequence[ChainRow], pairs: int, first: int, count: int) -> None:
    """Solve the system held in ``count`` rows from ``first`` on, of ``pairs`` in a circle.

    A diagonal element is the sum of what both bodies of a pair contribute, ``part_a + part_b``. The
    product of ``lower`` and the ``upper`` before it equals that of two parts of one body. ``lower``
    of the first row and ``upper`` of the last one are not used. Eliminating a pair from the left
    multiplies ``part_a`` of the next pair by ``part_a/(part_a + part_b)`` of the eliminated one:
    nothing is subtracted. Where all pairs close, every impulse is therefore accurate to a few units
    in its last place, however strongly the pairs are coupled.

    A row of bodies from one wall to the other ends with a zero diagonal: the forces between the
    bodies are not determined, and the middle pair gets none.
    """
    half = (count - 1) // 2
    for step in range(half):
        left = rows[(first + step) % pairs]
        next_left = rows[(first + step + 1) % pairs]
        right = rows[(first + count - 1 - step) % pairs]
        next_right = rows[(first + count - 2 - step) % pairs]
        diagonal_left = left.part_a + left.part_b
        diagonal_right = right.part_a + right.part_b
        next_left.part_a *= left.part_a / diagonal_left
        next_right.part_b *= right.part_b / diagonal_right
        value_left = next_left.lower / diagonal_left * left.right
        value_right = next_right.upper / diagonal_right * right.right
        if step == half - 1 and count % 2 == 1:
            next_left.right -= value_left + value_right
        else:
            next_left.right -= value_left
            next_right.right -= value_right
    left = rows[(first + half) % pairs]
    if count % 2 == 1:
        left.solution = _quotient(left.right, left.part_a + left.part_b)
    else:
        right = rows[(first + half + 1) % pairs]
        diagonal_left = left.part_a + left.part_b
        diagonal_right = right.part_a + right.part_b
        # Product of the diagonals less lower times upper, which is left.part_b right.part_a.
        product = left.part_a * right.part_a + left.part_b * right.part_b
        determinant = product + left.part_a * right.part_b
        value = left.right * diagonal_right - left.upper * right.right
        other = right.right * diagonal_left - right.lower * left.right
        right.solution = _quotient(other, determinant)
        left.solution = _quotient(value, determinant)
    for step in range(half - 1, -1, -1):
        left = rows[(first + step) % pairs]
        inner = rows[(first + step + 1) % pairs]
        left.solution = (left.right - left.upper * inner.solution) / (left.part_a + left.part_b)
        right = rows[(first + count - 1 - step) % pairs]
        inner = rows[(first + count - 2 - step) % pairs]
        value = right.right - right.lower * inner.solution
        right.solution = value / (right.part_a + right.part_b)
