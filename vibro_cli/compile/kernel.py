"""Declaring kernels and structs: what is interpreted and what is compiled are the same functions.

A kernel is a short function of numbers and structs. Decorated with :func:`kernel` it stays a plain
Python function; ``native.compiled`` returns its compiled form. A struct is a class of annotated
fields: an object with slots for the interpreter, an element of a structured array for the machine.
Both evaluate the same floating-point operations in the same order (no contraction, no
reassociation), so they give the same bits. Nothing heavy is imported here: this is needed to build.

A kernel without jumps may work on lanes in place of numbers: each lane then undergoes the same
operations in the same order as the number would, and has the same bits. Where lanes differ in what
is to be done, both are done and :func:`select` takes one for each lane. Lanes are there in compiled
kernels only; what is written here is their meaning for one number.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import cache, update_wrapper
from operator import attrgetter
from types import FunctionType
from typing import Any, TypeVar

Kernel = Callable[..., Any]
Function = TypeVar("Function", bound=Kernel)
StructClass = TypeVar("StructClass", bound=type)

# Lanes of a register of 512 bits; on processors with shorter ones the compiler takes several.
LANES = 8

# For the type checker lanes are like numbers, and comparisons of them like truth values.
Lanes = float
# Two lanes: the same quantity of both bodies of a pair.
Two = float
# Entries of a Series: the nodes of a collocation segment.
SERIES_LENGTH = 8
Series = list[float]
# Arrays of two axes and more in C order; for the type checker they are numpy's.
FloatMatrix = Any
IntMatrix = Any
BoolMatrix = Any
FloatArray3 = Any
FloatArray4 = Any

_kernels: set[Kernel] = set()


def kernel(function: Function) -> Function:
    """Register a function as a kernel; it stays a plain Python function."""
    _kernels.add(function)
    return function


def is_kernel(value: Any) -> bool:
    """Tell whether a value is a function decorated with :func:`kernel`."""
    return isinstance(value, FunctionType) and value in _kernels


def kernel_names() -> set[str]:
    """Return the names of all kernels."""
    return {function.__name__ for function in _kernels}


def is_struct(value: Any) -> bool:
    """Tell whether a value is a class decorated with :func:`struct`."""
    return isinstance(value, type) and hasattr(value, "fields")


def struct(cls: StructClass) -> StructClass:
    """Turn a class of annotated fields into one with slots and zero values.

    The mapping ``fields`` of the result gives their names and kinds: ``float``, ``int``, ``Series``
    (a short row of floats, such as the coefficients of a polynomial), ``Lanes`` or ``Two``. The
    fields of base classes that are structs come first.
    """
    fields: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        fields.update(getattr(base, "fields", {}))
    fields.update(cls.__annotations__)
    zeros: dict[str, Callable[[], Any]] = {"int": int, "Series": lambda: [0.0] * SERIES_LENGTH}
    values = [(name, zeros.get(kind, float)) for name, kind in fields.items()]

    def initialise(self: object) -> None:
        for name, zero in values:
            setattr(self, name, zero())

    body = {
        "__slots__": tuple(fields),
        "__init__": initialise,
        "__doc__": cls.__doc__,
        "__module__": cls.__module__,
        "fields": fields,
    }
    return type(cls.__name__, (), body)  # type: ignore[return-value]


@cache
def dtype(cls: type) -> Any:
    """Return the structured numpy type of a struct."""
    import numpy as np

    kinds: dict[str, Any] = {
        "float": np.float64,
        "int": np.int64,
        "Series": (np.float64, (SERIES_LENGTH,)),
        "Lanes": (np.float64, (1, LANES)),
        "Two": (np.float64, (1, 2)),
    }
    fields = cls.fields  # type: ignore[attr-defined]
    return np.dtype([(name, kinds[kind]) for name, kind in fields.items()])


def interpreted_copies(rows: Any, cls: type) -> list[Any]:
    """Return interpreted structs with the contents of a structured array."""
    fields = cls.fields.items()  # type: ignore[attr-defined]
    copies = [cls() for _ in rows]
    for copy, values in zip(copies, rows.tolist(), strict=True):
        for (name, kind), value in zip(fields, values, strict=True):
            setattr(copy, name, list(value) if kind == "Series" else value)
    return copies


def compiled_rows(rows: Sequence[Any], cls: type) -> Any:
    """Return a structured array with the contents of interpreted structs."""
    import numpy as np

    values = attrgetter(*cls.fields)  # type: ignore[attr-defined]
    return np.array([values(row) for row in rows], dtype=dtype(cls))


def fused(a: float, b: float, c: float) -> float:
    """Return ``a b + c``, rounded once (IEEE 754 fusedMultiplyAdd)."""
    return float(Fraction(a) * Fraction(b) + Fraction(c))


class Overrides:
    """Kernels that stand for others: the same event loop for another mechanics.

    A name in a kernel means what it means in its module, or what stands for that in ``replaced``,
    with the same parameters and result. The kernels themselves know nothing of it, so what is not
    asked for costs nothing. Their name is part of those of their entry points in the library.
    """

    def __init__(self, name: str, replaced: Mapping[Kernel, Kernel]) -> None:
        self.name = name
        self.replaced = replaced
        self._functions: dict[Kernel, Kernel] = {}
        self._namespaces: dict[str, dict[str, Any]] = {}

    def resolved(self, value: Any) -> Any:
        """Return what a kernel's name means; other values as they are."""
        return self.replaced.get(value, value) if isinstance(value, FunctionType) else value

    def interpreted(self, function: Function) -> Function:
        """Return a kernel as the interpreter calls it, names looked up with the overrides."""
        meant = self.resolved(function)
        if meant not in self._functions:
            namespace = self._namespace(meant.__module__)
            copy = FunctionType(meant.__code__, namespace, meant.__name__)
            self._functions[meant] = update_wrapper(copy, meant)
        return self._functions[meant]  # type: ignore[return-value]

    def _namespace(self, module: str) -> dict[str, Any]:
        """Names of a module, where those of kernels mean what they do with the overrides."""
        if module not in self._namespaces:
            self._namespaces[module] = names = dict(vars(sys.modules[module]))
            for name, value in list(names.items()):
                if is_kernel(value):
                    names[name] = self.interpreted(value)
        return self._namespaces[module]


def interpreted(function: Function, overrides: Overrides | None) -> Function:
    """Return a kernel as the interpreter calls it with overrides; itself without."""
    return function if overrides is None else overrides.interpreted(function)


def select(condition: bool, yes: float, no: float) -> float:
    """Return one of two numbers, in each lane by the lane's own condition."""
    return yes if condition else no


def any_lane(condition: bool) -> bool:
    """Tell whether a condition holds in any lane."""
    return condition


def mask_and(one: bool, other: bool) -> bool:
    """Tell in each lane whether two conditions hold."""
    return one and other


def mask_or(one: bool, other: bool) -> bool:
    """Tell in each lane whether one of two conditions holds."""
    return one or other


def mask_not(condition: bool) -> bool:
    """Tell in each lane whether a condition does not hold."""
    return not condition


def has_bit(x: float, bit: int) -> bool:
    """Tell in each lane whether a whole number has a bit, given by its value."""
    return int(x) & bit != 0


def pack(first: float, second: float) -> float:
    """Return two lanes of numbers."""
    assert first == second
    return first


def extract(lanes: float, number: int) -> float:
    """Return the number in one lane."""
    assert number == 0
    return lanes


def insert(lanes: float, number: int, value: float) -> float:
    """Return lanes with another number in one of them."""
    assert number == 0
    return value if number == 0 else lanes
