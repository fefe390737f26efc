"""Declare kernels and structs; the same functions are interpreted and compiled.

A kernel is a short function of numbers and structs. Decorated with :func:`kernel` it stays a plain
Python function; ``native.compiled`` returns its compiled form. A struct is a class of annotated
fields: the interpreter uses an object with slots, compiled code an element of a structured array.
Both evaluate the same floating-point operations in the same order (no contraction, no
reassociation), so they give the same bits. The build needs it, so nothing heavy is imported here.

A kernel without branches may work on lanes instead of numbers. Each lane then undergoes the same
operations in the same order as a single number, and has the same bits. Where lanes differ in a
condition, both values of ``a if condition else b`` are computed, and each lane takes its own. Only
compiled kernels have lanes; the functions here define their meaning for a single number.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import cache, update_wrapper
from types import FunctionType
from typing import Annotated, Any, TypeVar

from vibro_cli.compile import kinds as t

Kernel = Callable[..., Any]
Function = TypeVar("Function", bound=Kernel)
StructClass = TypeVar("StructClass", bound=type)

LANES = t.LANES
SERIES_LENGTH = t.SERIES_LENGTH
# For the type checker, lanes are numbers and comparisons of them booleans.
Lanes = Annotated[float, t.lanes_of(t.LANES)]
# Two lanes: the same quantity of both bodies of a pair.
Two = Annotated[float, t.lanes_of(2)]
Series = Annotated[list[float], t.SERIES]
# Arrays of two or more axes in C order; the type checker does not check them.
FloatMatrix = Annotated[Any, t.array_of(t.FLOAT, 2)]
IntMatrix = Annotated[Any, t.array_of(t.INT, 2)]
BoolMatrix = Annotated[Any, t.array_of(t.BOOL, 2)]
FloatArray3 = Annotated[Any, t.array_of(t.FLOAT, 3)]
FloatArray4 = Annotated[Any, t.array_of(t.FLOAT, 4)]

_kernels: set[Kernel] = set()


def kernel(function: Function) -> Function:
    """Register a function as a kernel; it stays a plain Python function."""
    _kernels.add(function)
    return function


def is_kernel(value: Any) -> bool:
    """Return whether a value is a function decorated with :func:`kernel`."""
    return isinstance(value, FunctionType) and value in _kernels


def struct(cls: StructClass) -> StructClass:
    """Turn a class of annotated fields into one with slots and zeros as initial values.

    The mapping ``fields`` of the result gives the type of each field by name: ``float``, ``int``,
    ``Series`` (a short row of floats, such as the coefficients of a polynomial), ``Lanes`` or
    ``Two``. The fields of a base class that is a struct come first, and those in lanes before all,
    with which a struct has the ``alignment`` (bytes) of a line of the cache.
    """
    fields: dict[str, Any] = {**getattr(cls, "fields", {}), **t.kinds_in(cls)}
    fields = dict(sorted(fields.items(), key=lambda field: field[1].size != t.LANES))
    zeros: dict[str, Any] = {t.INT.cpp: int, t.SERIES.cpp: lambda: [0.0] * t.SERIES_LENGTH}
    values = [(name, zeros.get(kind.cpp, float)) for name, kind in fields.items()]

    def initialise(self: object) -> None:
        for name, zero in values:
            setattr(self, name, zero())

    body = {
        "__slots__": tuple(fields),
        "__init__": initialise,
        "__doc__": cls.__doc__,
        "__module__": cls.__module__,
        "fields": fields,
        "alignment": t.CACHE_LINE if t.LANES in [kind.size for kind in fields.values()] else 1,
    }
    return type(cls.__name__, (), body)  # type: ignore[return-value]


@cache
def dtype(cls: Any) -> Any:
    """Return the structured numpy type of a struct; one with lanes fills whole cache lines."""
    import numpy as np

    formats = [kind.stored for kind in cls.fields.values()]
    size = np.dtype({"names": list(cls.fields), "formats": formats}).itemsize
    size += -size % cls.alignment
    return np.dtype({"names": list(cls.fields), "formats": formats, "itemsize": size})


def fused(a: float, b: float, c: float) -> float:
    """Return ``a b + c``, rounded once (IEEE 754 fusedMultiplyAdd)."""
    return float(Fraction(a) * Fraction(b) + Fraction(c))


class Overrides:
    """Kernels that replace others, for the same event loop with different mechanics.

    A kernel that is called by name is looked up in its module; if it is a key of ``replaced``, the
    value is called instead, with the same parameters and result. Kernels do not refer to overrides,
    so programs without them pay no cost. ``name`` prefixes the entry points in the library.
    """

    def __init__(self, name: str, replaced: Mapping[Kernel, Kernel]) -> None:
        self.name = name
        self.replaced = replaced
        self._functions: dict[Kernel, Kernel] = {}
        self._namespaces: dict[str, dict[str, Any]] = {}

    def resolved(self, value: Any) -> Any:
        """Return the override of a kernel if it has one, else the value itself."""
        return self.replaced.get(value, value) if isinstance(value, FunctionType) else value

    def symbol(self, kernel: Kernel) -> str:
        """Return the name under which the library exports a kernel that is an entry point."""
        return f"{self.name}.{kernel.__module__}.{kernel.__name__}".lstrip(".").replace(".", "_")

    def interpreted(self, function: Function) -> Function:
        """Return a kernel for the interpreter, with overrides for all kernels that it calls."""
        if not self.replaced:
            return function
        meant = self.resolved(function)
        if meant not in self._functions:
            namespace = self._namespace(meant.__module__)
            copy = FunctionType(meant.__code__, namespace, meant.__name__)
            self._functions[meant] = update_wrapper(copy, meant)
        return self._functions[meant]  # type: ignore[return-value]

    def _namespace(self, module: str) -> dict[str, Any]:
        """Return the names of a module, with its kernels replaced by their overrides."""
        if module not in self._namespaces:
            self._namespaces[module] = names = dict(vars(sys.modules[module]))
            for name, value in list(names.items()):
                if is_kernel(value):
                    names[name] = self.interpreted(value)
        return self._namespaces[module]


NO_OVERRIDES = Overrides("", {})


def any_lane(condition: bool) -> bool:
    """Return whether a condition holds in any lane."""
    return condition


def has_bit(x: float, bit: int) -> bool:
    """Return in each lane whether an integer has a bit set; ``bit`` is the bit's value."""
    return int(x) & bit != 0


def pack(first: float, second: float) -> float:
    """Return two numbers as two lanes."""
    assert first == second
    return first


def extract(lanes: float, number: int) -> float:
    """Return the number in one lane."""
    assert number == 0
    return lanes


def insert(lanes: float, number: int, value: float) -> float:
    """Return lanes with the number in one of them replaced."""
    assert number == 0
    return value if number == 0 else lanes
