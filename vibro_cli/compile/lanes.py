"""Numbers in lanes: the same quantity of several scenarios, in one SIMD register of the processor.

A kernel without jumps may work on lanes in place of numbers: each lane then undergoes the same
operations in the same order as the number would, and has the same bits. Where lanes differ in what
is to be done, both are done and :func:`choose` takes one for each lane. Lanes are there in compiled
kernels only; what is written here is their meaning for one number.
"""

from __future__ import annotations

# Lanes of a register of 512 bits; on processors with shorter ones the compiler takes several.
LANES = 8

# For the type checker lanes are like numbers, and comparisons of them like truth values.
Lanes = float
# Two lanes: the same quantity of both bodies of a pair.
Two = float


def choose(condition: bool, yes: float, no: float) -> float:
    """Return one of two numbers, in each lane by the lane's own condition."""
    return yes if condition else no


def any_lane(condition: bool) -> bool:
    """Tell whether a condition holds in any lane."""
    return condition


def both(one: bool, other: bool) -> bool:
    """Tell in each lane whether two conditions hold."""
    return one and other


def either(one: bool, other: bool) -> bool:
    """Tell in each lane whether one of two conditions holds."""
    return one or other


def opposite(condition: bool) -> bool:
    """Tell in each lane whether a condition does not hold."""
    return not condition


def has_bit(x: float, bit: int) -> bool:
    """Tell in each lane whether a whole number has a bit, given by its value."""
    return int(x) & bit != 0


def two_lanes(first: float, second: float) -> float:
    """Return two lanes of numbers."""
    assert first == second
    return first


def in_lane(lanes: float, number: int) -> float:
    """Return the number in one lane."""
    assert number == 0
    return lanes


def with_lane(lanes: float, number: int, value: float) -> float:
    """Return lanes with another number in one of them."""
    assert number == 0
    return value if number == 0 else lanes
