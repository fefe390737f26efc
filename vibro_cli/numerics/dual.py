"""Numbers that carry their derivatives to some parameters: forward differentiation, exact.

What is written for numbers and arrays alike (``numerics.elementwise``) takes them too. A function
whose derivative is not known here is refused, so that none is lost.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]


class Dual:
    """A number and its derivatives, an array."""

    __slots__ = ("change", "value")
    __array_ufunc__ = None  # numbers of numpy leave sums and products to it

    def __init__(self, value: float, change: Floats) -> None:
        self.value = float(value)
        self.change = change

    def _joined(self, other: Any, value: float, mine: float, its: float) -> Dual:
        change = mine * self.change
        return Dual(value, change + its * other.change if isinstance(other, Dual) else change)

    def __add__(self, other: Any) -> Dual:
        return self._joined(other, self.value + value_of(other), 1.0, 1.0)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Dual:
        return self._joined(other, self.value - value_of(other), 1.0, -1.0)

    def __rsub__(self, other: Any) -> Dual:
        return self._joined(other, value_of(other) - self.value, -1.0, 1.0)

    def __mul__(self, other: Any) -> Dual:
        its = value_of(other)
        return self._joined(other, self.value * its, its, self.value)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Dual:
        its = value_of(other)
        ratio = self.value / its
        return self._joined(other, ratio, 1.0 / its, -ratio / its)

    def __rtruediv__(self, other: Any) -> Dual:
        ratio = value_of(other) / self.value
        return self._joined(other, ratio, -ratio / self.value, 1.0 / self.value)

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
        """Whether both are the same and stay so: a number that changes is no constant."""
        its = other.change if isinstance(other, Dual) else 0.0
        return self.value == value_of(other) and bool(np.all(self.change == its))

    __hash__ = None  # type: ignore[assignment]


def value_of(number: Any) -> float:
    """Return a number without its derivatives."""
    return number.value if isinstance(number, Dual) else float(number)


def change_of(number: Any, size: int) -> Floats:
    """Return the derivatives of a number to ``size`` parameters, zero for a constant."""
    return number.change if isinstance(number, Dual) else np.zeros(size)


_SLOPES: dict[Callable[..., Any], Callable[[float], float]] = {
    math.sin: math.cos,
    math.cos: lambda x: -math.sin(x),
    math.asin: lambda x: 1.0 / math.sqrt((1.0 - x) * (1.0 + x)),
    math.sqrt: lambda x: 0.5 / math.sqrt(x),
}
_STEPS = (math.ulp, round, math.ceil)


def through(function: Callable[..., Any], *arguments: Any) -> Any:
    """Return a function of numbers of which some have derivatives.

    Raises
    ------
    TypeError
        If its derivative is not known.
    """
    values = [value_of(one) for one in arguments]
    if function in _STEPS:
        return function(*values)
    if function is math.fsum:
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
