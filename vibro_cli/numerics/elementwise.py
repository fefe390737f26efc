"""Functions of numbers, arrays of numbers and numbers with derivatives, with the same bits.

With them, the code that builds a system is written once. It takes numbers for one scenario, without
numpy; arrays for many scenarios that differ in numbers; and numbers with derivatives for exact
forward differentiation. Sums, products, quotients and square roots of arrays are rounded as those
of numbers; all other functions call the same library for each element.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import reduce
from itertools import repeat
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Some = Any
"""A number, an array of numbers with one axis, or a number with derivatives. Functions from numbers
to numbers are annotated with `float`, as in the rest of the package."""


def is_number(values: Some) -> bool:
    """Return whether a value is a single number without derivatives, not an array."""
    return isinstance(values, (float, int))


def each(function: Callable[..., Any], *arguments: Some, kind: type = float) -> Some:
    """Return a function's value, or an array of values if an argument is an array.

    ``kind`` is the type of the array's elements.
    """
    if all(map(is_number, arguments)):
        return function(*arguments)
    import numpy as np

    if any(isinstance(one, Dual) for one in arguments):
        return through(function, *arguments)
    columns = [repeat(one) if is_number(one) else one.tolist() for one in arguments]
    return np.fromiter(map(function, *columns), dtype=kind)


def sine(angle: float) -> float:
    """Return the sine of an angle (rad)."""
    found: float = each(math.sin, angle)
    return found


def cosine(angle: float) -> float:
    """Return the cosine of an angle (rad)."""
    found: float = each(math.cos, angle)
    return found


def arcsine(value: Some) -> float:
    """Return the arcsine (rad), nan outside [-1, 1]."""
    found: float = each(math.asin if isinstance(value, Dual) else _arcsine, value)
    return found


def _arcsine(value: float) -> float:
    return math.asin(value) if -1.0 <= value <= 1.0 else math.nan


def square_root(value: Some) -> float:
    """Return the square root; nan for negative elements of an array."""
    if is_number(value):
        return math.sqrt(value)
    if isinstance(value, Dual):
        return each(math.sqrt, value)  # type: ignore[no-any-return]
    import numpy as np

    with np.errstate(invalid="ignore"):
        return np.sqrt(value)  # type: ignore[no-any-return]


def last_place(value: Some) -> Some:
    """Return the unit in the last place of a finite number."""
    if is_number(value) or isinstance(value, Dual):
        return math.ulp(value_of(value))
    import numpy as np

    return np.spacing(abs(value))


def power(base: float, exponent: int) -> float:
    """Return ``base ** exponent``."""
    found: float = each(pow, base, exponent)
    return found


def exact_sum(terms: Iterable[float]) -> float:
    """Return a sum, rounded once."""
    given = list(terms)
    if all(map(is_number, given)):
        return math.fsum(given)
    if any(isinstance(one, Dual) for one in given):
        return each(math.fsum, *given)  # type: ignore[no-any-return]
    found: float = each(lambda *numbers: math.fsum(numbers), *given)
    return found


def fewer_terms(terms: list[float]) -> list[float]:
    """Return a few numbers with exactly the same sum as ``terms``.

    Terms that are not all numbers with a finite sum are returned unchanged.
    """
    if not (all(map(is_number, terms)) and math.isfinite(math.fsum(terms))):
        return terms
    fewer: list[float] = []
    while rest := math.fsum([*terms, *(-one for one in fewer)]):
        fewer.append(rest)
    return fewer


def nearest(value: Some) -> Some:
    """Return the nearest integer; of two, the even one."""
    return each(round, value)


def ceiling(value: Some) -> Some:
    """Return the least integer that is not smaller than a value."""
    return each(math.ceil, value)


def choose(condition: Some, one: Some, other: Some) -> Some:
    """Return ``one`` where a condition holds, else ``other``."""
    if isinstance(condition, bool):
        return one if condition else other
    import numpy as np

    return np.where(condition, one, other)


def zero_where(condition: Some, value: Some) -> Some:
    """Return 0 where a condition holds, else the value; derivatives are kept in both cases."""
    if isinstance(value, Dual):
        return Dual(0.0, value.change) if condition else value
    return choose(condition, 0.0, value)


def least(one: Some, other: Some) -> Some:
    """Return the smaller of two values."""
    return choose(one <= other, one, other)


def greatest(one: Some, other: Some) -> Some:
    """Return the larger of two values."""
    return choose(one >= other, one, other)


def least_of(values: Sequence[Some]) -> Some:
    """Return the smallest of several values."""
    return min(values) if set(map(type, values)) <= {float, int} else reduce(least, values)


def greatest_of(values: Sequence[Some]) -> Some:
    """Return the largest of several values."""
    return max(values) if set(map(type, values)) <= {float, int} else reduce(greatest, values)


def holds(condition: Some) -> bool:
    """Return whether a condition holds everywhere."""
    return bool(condition if isinstance(condition, bool) else condition.all())


def occurs(condition: Some) -> bool:
    """Return whether a condition holds somewhere."""
    return bool(condition if isinstance(condition, bool) else condition.any())


def outside(value: Some, low: float, high: float) -> Some:
    """Return whether a value lies outside [``low``, ``high``], or is nan."""
    inside = (low <= value) & (value <= high)
    return not inside if isinstance(inside, bool) else ~inside


def is_nan(value: Some) -> Some:
    """Return whether a value is nan."""
    return value != value


def taken(numbers: Any, at: Any) -> Any:
    """Return the elements ``at`` of every array in a number, tuple or dataclass."""
    if isinstance(numbers, tuple):
        return tuple(taken(one, at) for one in numbers)
    if is_dataclass(numbers) and not isinstance(numbers, type):
        parts = {one.name: taken(getattr(numbers, one.name), at) for one in fields(numbers)}
        return replace(numbers, **parts)
    return numbers[at] if getattr(numbers, "ndim", 0) else numbers


# Equal to rounding only: for arrays these call numpy, whose functions differ in the last bits.


def about(name: str, function: Callable[..., float], *arguments: Some) -> Any:
    """Return a function of numbers; for arrays, call numpy's function ``name`` instead."""
    if all(map(is_number, arguments)):
        return function(*arguments)
    import numpy as np

    return getattr(np, name)(*arguments)


def distance(x: Some, y: Some) -> Any:
    """Return the length of a vector, equal to rounding."""
    return about("hypot", math.hypot, x, y)


def direction(y: Some, x: Some) -> Any:
    """Return the angle (rad) of a vector, equal to rounding."""
    return about("arctan2", math.atan2, y, x)


Floats: TypeAlias = "NDArray[np.float64]"


class Dual:
    """A number with its derivatives with respect to some parameters, in an array."""

    __slots__ = ("change", "value")
    __array_ufunc__ = None  # numpy scalars defer sums and products to this class

    def __init__(self, value: float, change: Floats) -> None:
        self.value = float(value)
        self.change = change

    def __add__(self, other: Any) -> Dual:
        if isinstance(other, Dual):
            return Dual(self.value + other.value, self.change + other.change)
        return Dual(self.value + float(other), self.change)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Dual:
        if isinstance(other, Dual):
            return Dual(self.value - other.value, self.change - other.change)
        return Dual(self.value - float(other), self.change)

    def __rsub__(self, other: Any) -> Dual:
        return Dual(float(other) - self.value, -self.change)

    def __mul__(self, other: Any) -> Dual:
        if isinstance(other, Dual):
            change = other.value * self.change + self.value * other.change
            return Dual(self.value * other.value, change)
        its = float(other)
        return Dual(self.value * its, its * self.change)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Dual:
        its = value_of(other)
        ratio, change = self.value / its, 1.0 / its * self.change
        if isinstance(other, Dual):
            change = change - ratio / its * other.change
        return Dual(ratio, change)

    def __rtruediv__(self, other: Any) -> Dual:
        ratio = float(other) / self.value
        return Dual(ratio, -ratio / self.value * self.change)

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.change)

    def __abs__(self) -> Dual:
        return -self if self.value < 0.0 else self

    def __lt__(self, other: Any) -> bool:
        return self.value < value_of(other)

    def __le__(self, other: Any) -> bool:
        return self.value <= value_of(other)

    def __gt__(self, other: Any) -> bool:
        return self.value > value_of(other)

    def __ge__(self, other: Any) -> bool:
        return self.value >= value_of(other)

    def __eq__(self, other: object) -> bool:
        """Return whether values and derivatives are equal; a constant has derivatives of zero."""
        import numpy as np

        its = other.change if isinstance(other, Dual) else 0.0
        return self.value == value_of(other) and bool(np.all(self.change == its))

    __hash__ = None  # type: ignore[assignment]


def value_of(number: Any) -> float:
    """Return a number without its derivatives."""
    return number.value if isinstance(number, Dual) else float(number)


def change_of(number: Any, size: int) -> Floats:
    """Return the derivatives with respect to ``size`` parameters, zero for a constant."""
    import numpy as np

    return number.change if isinstance(number, Dual) else np.zeros(size)


_SLOPES: dict[Callable[..., Any], Callable[[float], float]] = {
    math.sin: math.cos,
    math.cos: lambda x: -math.sin(x),
    math.asin: lambda x: 1.0 / math.sqrt((1.0 - x) * (1.0 + x)),
    math.sqrt: lambda x: 0.5 / math.sqrt(x),
}
_STEPS: tuple[Callable[..., Any], ...] = (round, math.ceil)


def through(function: Callable[..., Any], *arguments: Any) -> Any:
    """Return the value of a function, with derivatives if some arguments have them.

    Values of piecewise constant functions have no derivatives.

    Raises
    ------
    TypeError
        If the derivative of the function is not known.
    """
    values = [value_of(one) for one in arguments]
    if function in _STEPS:
        return function(*values)
    if function is math.fsum:
        import numpy as np

        changes = [one.change for one in arguments if isinstance(one, Dual)]
        return Dual(math.fsum(values), np.sum(changes, axis=0))
    if function is pow and not isinstance(arguments[1], Dual):
        base, exponent = arguments
        slope = exponent * base.value ** (exponent - 1)
        return Dual(base.value**exponent, slope * base.change)
    if function in _SLOPES and len(arguments) == 1:
        (x,) = values
        return Dual(function(x), _SLOPES[function](x) * arguments[0].change)
    raise TypeError(f"the derivative of {function!r} is not known")
