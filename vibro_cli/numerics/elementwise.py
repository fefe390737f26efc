"""Functions of numbers and of arrays of numbers alike, with the same bits.

What a system is built with is written once with them: for one scenario with numbers, which need no
numpy, for many that differ in numbers with arrays, and for its derivatives with numbers that carry
them (``numerics.dual``). Sums, products, quotients and square roots of arrays are rounded as those
of numbers; all else is asked of the same library, one by one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import reduce
from itertools import repeat
from typing import Any

Some = Any
"""A number, an array of numbers with one axis, or a number with derivatives. Where a number goes in
and out, all are said to be numbers, as everywhere else."""

EPSILON = 2.0**-52
"""The distance from 1 to the next double."""

_NUMBERS = (float, int)


def is_number(values: Some) -> bool:
    """Tell whether there is one number, not an array."""
    return isinstance(values, _NUMBERS)


def carries(value: Some) -> bool:
    """Tell whether a number carries derivatives (see ``numerics.dual``)."""
    return hasattr(value, "change")


def each(function: Callable[..., Any], *arguments: Some, kind: type = float) -> Some:
    """Return a function's values, one by one where an argument is an array.

    They are floats, or of another ``kind`` of an array.
    """
    for one in arguments:
        if not isinstance(one, _NUMBERS):
            break
    else:
        return function(*arguments)
    import numpy as np

    if any(map(carries, arguments)):
        from vibro_cli.numerics.dual import through

        return through(function, *arguments)
    if len(arguments) == 1 and kind is float and arguments[0].dtype == np.float64:
        return _each_of_stretches(function, np.ascontiguousarray(arguments[0]))
    columns = [repeat(one) if is_number(one) else one.tolist() for one in arguments]
    return np.fromiter(map(function, *columns), dtype=kind)


def _each_of_stretches(function: Callable[[float], float], values: Any) -> Any:
    """A function's values, asked for once for a stretch of the same numbers."""
    import numpy as np

    bits = values.view(np.int64)
    starts = np.flatnonzero(np.concatenate([[True], bits[1:] != bits[:-1]]))[: len(bits)]
    found = np.fromiter(map(function, values[starts].tolist()), dtype=float, count=len(starts))
    if len(starts) == len(values):
        return found
    return np.repeat(found, np.diff(starts, append=len(values)))


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
    found: float = each(math.asin if carries(value) else _arcsine, value)
    return found


def _arcsine(value: float) -> float:
    return math.asin(value) if -1.0 <= value <= 1.0 else math.nan


def square_root(value: float) -> float:
    """Return the square root; of negative elements of an array nan."""
    if is_number(value):
        return math.sqrt(value)
    import numpy as np

    if carries(value):
        return each(math.sqrt, value)  # type: ignore[no-any-return]
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
    if any(map(carries, given)):
        return each(math.fsum, *given)  # type: ignore[no-any-return]
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


def least_of(values: Sequence[Some]) -> Some:
    """Return the smallest of some."""
    return min(values) if set(map(type, values)) <= {float, int} else reduce(least, values)


def greatest_of(values: Sequence[Some]) -> Some:
    """Return the largest of some."""
    return max(values) if set(map(type, values)) <= {float, int} else reduce(greatest, values)


def holds(condition: Some) -> bool:
    """Tell whether a condition holds everywhere."""
    return bool(condition if isinstance(condition, bool) else condition.all())


def occurs(condition: Some) -> bool:
    """Tell whether a condition holds somewhere."""
    return bool(condition if isinstance(condition, bool) else condition.any())


def taken(numbers: Any, at: Any) -> Any:
    """Return numbers, or what has numbers within, with some elements of every array."""
    if isinstance(numbers, tuple):
        return tuple(taken(one, at) for one in numbers)
    if is_dataclass(numbers) and not isinstance(numbers, type):
        parts = {one.name: taken(getattr(numbers, one.name), at) for one in fields(numbers)}
        return replace(numbers, **parts)
    return numbers[at] if getattr(numbers, "ndim", 0) else numbers


# To rounding only: arrays with the functions of numpy, whose last bits are others.


def about(name: str, function: Callable[..., float], *arguments: Some) -> Any:
    """Return a function of numbers, of arrays the one that numpy has by a name."""
    for one in arguments:
        if not isinstance(one, _NUMBERS):
            break
    else:
        return function(*arguments)
    import numpy as np

    return getattr(np, name)(*arguments)


def distance(x: Some, y: Some) -> Any:
    """Return the length of a vector, to rounding."""
    return about("hypot", math.hypot, x, y)


def direction(y: Some, x: Some) -> Any:
    """Return the angle (rad) of a vector, to rounding."""
    return about("arctan2", math.atan2, y, x)
