"""The tridiagonal system of a chain of touching bodies: impulses at one instant, contact forces.

A row belongs to a pair of neighbours. The system is solved from both ends to the middle, so that a
mirror image has mirrored results to the bit.
"""

from __future__ import annotations

from collections.abc import Sequence

from vibro_cli.compile.kernel import kernel, struct


@struct
class ChainRow:
    """One row: what the impulse or the force of a pair does, and its solution."""

    part_a: float  # both bodies' parts of the diagonal
    part_b: float
    lower: float  # what stands beside it
    upper: float
    right: float
    solution: float


@kernel
def _quotient(value: float, divisor: float) -> float:
    return value / divisor if divisor > 0.0 else 0.0


@kernel
def solve_from_both_ends(rows: Sequence[ChainRow], pairs: int, first: int, count: int) -> None:
    """Solve the system held in ``count`` rows from ``first`` on, of ``pairs`` in a circle.

    A diagonal is the sum of what both bodies of a pair yield, ``part_a + part_b``, and the product
    of ``lower`` and the ``upper`` before it that of two parts of one body; those of the ends of the
    chain, beside which nothing stands, are not asked for. Eliminating a pair from
    the left leaves of the next one's ``part_a`` the share ``part_a/(part_a + part_b)`` of the pair
    before: nothing is subtracted, and where all pairs close every impulse is right to a few units
    in its last place, however much one pair makes another one's.

    A row of bodies from one wall to the other has a diagonal of zero in the end: what they press
    one another with is not determined, and the middle pair is left without any.
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
