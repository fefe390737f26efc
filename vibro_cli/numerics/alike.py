"""Functions of numbers and of arrays of numbers alike, with the same bits.

What a system is built with is written once with them: for one scenario with numbers, which need no
numpy, and for many that differ in numbers with arrays. Sums, products, quotients and square roots
of arrays are rounded as those of numbers; all else is asked of the same library, one by one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from itertools import repeat
from typing import Any

Some = Any
"""A number, or an array of numbers with one axis. Where a number goes in and out, both are said to
be numbers, as everywhere else."""


def is_number(values: Some) -> bool:
    """Tell whether there is one number, not an array."""
    return isinstance(values, float | int)


def each(function: Callable[..., Any], *arguments: Some) -> Some:
    """Return a function's values, one by one where an argument is an array."""
    if all(map(is_number, arguments)):
        return function(*arguments)
    import numpy as np

    columns = [repeat(one) if is_number(one) else one.tolist() for one in arguments]
    return np.array(list(map(function, *columns)))  # of objects, if the values are objects


def sine(angle: float) -> float:
    """Return the sine (of rad)."""
    found: float = each(math.sin, angle)
    return found


def cosine(angle: float) -> float:
    """Return the cosine (of rad)."""
    found: float = each(math.cos, angle)
    return found


def arcsine(value: float) -> float:
    """Return the arcsine (rad), nan beyond 1 and -1."""
    found: float = each(_arcsine, value)
    return found


def _arcsine(value: float) -> float:
    return math.asin(value) if -1.0 <= value <= 1.0 else math.nan


def square_root(value: float) -> float:
    """Return the square root; of negative elements of an array nan."""
    if is_number(value):
        return math.sqrt(value)
    import numpy as np

    with np.errstate(invalid="ignore"):
        found: float = np.sqrt(value)
    return found


def power(base: float, exponent: int) -> float:
    """Return a power."""
    found: float = each(pow, base, exponent)
    return found


def exact_sum(terms: Iterable[float]) -> float:
    """Return a sum, rounded once."""
    given = list(terms)
    if all(map(is_number, given)):
        return math.fsum(given)
    found: float = each(lambda *numbers: math.fsum(numbers), *given)
    return found


def nearest(value: Some) -> Some:
    """Return the nearest whole number, the even one of two."""
    return each(round, value)


def ceiling(value: Some) -> Some:
    """Return the least whole number that is not smaller."""
    return each(math.ceil, value)


def choose(condition: Some, one: Some, other: Some) -> Some:
    """Return the one where a condition holds, else the other."""
    if isinstance(condition, bool):
        return one if condition else other
    import numpy as np

    return np.where(condition, one, other)


def least(one: Some, other: Some) -> Some:
    """Return the smaller of two."""
    return choose(one <= other, one, other)


def greatest(one: Some, other: Some) -> Some:
    """Return the larger of two."""
    return choose(one >= other, one, other)


def holds(condition: Some) -> bool:
    """Tell whether a condition holds everywhere."""
    return bool(condition if isinstance(condition, bool) else condition.all())


def occurs(condition: Some) -> bool:
    """Tell whether a condition holds somewhere."""
    return bool(condition if isinstance(condition, bool) else condition.any())
