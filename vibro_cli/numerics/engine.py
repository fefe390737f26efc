"""The switch between interpreted and compiled kernels, which are the same functions.

A kernel is a short function of floats and records. Decorated with :func:`kernel` it stays a plain
Python function; ``machine_code.compiled`` returns its compiled form, in which every kernel it
calls is compiled too. A record is a class of annotated fields: an object with slots for the
interpreter, an element of a structured array for the compiler. Both engines evaluate the same
floating-point operations in the same order (no contraction, no reassociation), so they give the
same bits.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from types import FunctionType, ModuleType
from typing import Any, TypeVar

from vibro_cli.numerics.lanes import LANES

Function = TypeVar("Function", bound=Callable[..., Any])
RecordClass = TypeVar("RecordClass", bound=type)

# Entries of a Series: the nodes of a collocation segment.
SERIES_LENGTH = 8
Series = list[float]

_kernels: dict[str, list[Callable[..., Any]]] = {}
_apart: set[Callable[..., Any]] = set()
_copies: set[str] = set()  # names of the modules that are copies


def kernel(function: Function) -> Function:
    """Register a function as a kernel; it stays a plain Python function."""
    _kernels.setdefault(function.__module__, []).append(function)
    return function


def apart(function: Function) -> Function:
    """Have the machine code of a kernel made once, and not be a part of that of its callers.

    Its parameters are numbers, records and named tuples; it returns a number or nothing.
    """
    _apart.add(function)
    return function


def is_apart(function: Callable[..., Any]) -> bool:
    """Tell whether the machine code of a kernel is apart from that of its callers."""
    return function in _apart


def symbol_of(function: Callable[..., Any]) -> str:
    """Return the name of a kernel in machine code."""
    return f"{function.__module__}.{function.__name__}"


def record(cls: RecordClass) -> RecordClass:
    """Turn a class of annotated fields into one with slots and zero values.

    The mapping ``fields`` of the result gives their names and kinds. Fields are ``float``,
    ``int``, ``Series`` (a short row of floats, such as the coefficients of a polynomial) or
    ``Lanes`` or ``Two`` (see ``numerics.lanes``).
    The fields of base classes that are records come first.
    """
    fields: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        fields.update(getattr(base, "fields", {}))
    fields.update(cls.__annotations__)
    names = tuple(fields)
    scalars = [(name, 0 if kind == "int" else 0.0) for name, kind in fields.items()]
    scalars = [(name, value) for name, value in scalars if fields[name] != "Series"]
    series = [name for name, kind in fields.items() if kind == "Series"]

    def initialise(self: object) -> None:
        for name, value in scalars:
            setattr(self, name, value)
        for name in series:
            setattr(self, name, [0.0] * SERIES_LENGTH)

    body = {
        "__slots__": names,
        "__init__": initialise,
        "__doc__": cls.__doc__,
        "__module__": cls.__module__,
        "fields": fields,
    }
    return type(cls.__name__, (), body)  # type: ignore[return-value]


@cache
def dtype(cls: type) -> Any:
    """Return the structured numpy type of a record."""
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


def interpreted_rows(cls: type, count: int) -> list[Any]:
    """Return ``count`` zero records for the interpreter."""
    return [cls() for _ in range(count)]


def interpreted_copies(rows: Any, cls: type) -> list[Any]:
    """Return interpreted records with the contents of a structured array."""
    names = tuple(cls.fields)  # type: ignore[attr-defined]
    series = [name for name, kind in cls.fields.items() if kind == "Series"]  # type: ignore[attr-defined]
    copies = []
    for values in rows.tolist():
        copy = cls()
        for name, value in zip(names, values, strict=True):
            setattr(copy, name, value)
        for name in series:
            setattr(copy, name, list(getattr(copy, name)))
        copies.append(copy)
    return copies


def compiled_rows(rows: Sequence[Any], cls: type) -> Any:
    """Return a structured array with the contents of interpreted records."""
    import numpy as np

    names = tuple(cls.fields)  # type: ignore[attr-defined]
    array = np.zeros(len(rows), dtype=dtype(cls))
    for position, row in enumerate(rows):
        array[position] = tuple(getattr(row, name) for name in names)
    return array


class Variant:
    """Kernels of which some are replaced: the same program for another mechanics.

    What is not asked for costs nothing: the kernels themselves know nothing of replacements.

    Parameters
    ----------
    name
        Part of the names of its copies of modules.
    replaced
        The replacement, with the same arguments and result, of each kernel that has one.
    """

    def __init__(
        self, name: str, replaced: Mapping[Callable[..., Any], Callable[..., Any]]
    ) -> None:
        self.name = name
        self.replaced = replaced
        self._copies: dict[Callable[..., Any], Callable[..., Any]] = {}
        self._copied: set[str] = set()

    def of(self, function: Function) -> Function:
        """Return a kernel as it is in the variant: a kernel like any other, of a module copied."""
        if function not in self._copies:
            self._copy_modules()
        return self._copies[function]  # type: ignore[return-value]

    def _copy_modules(self) -> None:
        """Copy all modules with kernels; there a kernel's name means what stands for it."""
        modules = [name for name in _kernels if name not in self._copied | _copies]
        copies = {name: self._empty_copy(name) for name in modules}
        for name, module in copies.items():
            vars(module).update(vars(sys.modules[name]) | {"__name__": module.__name__})
            for function in _kernels[name]:
                self._copies[function] = copy = kernel(_copy_of(function, module))
                if is_apart(function):
                    apart(copy)
        for function, replacement in self.replaced.items():
            self._copies[function] = self._copies[replacement]
        for module in copies.values():
            for key, value in list(vars(module).items()):
                if isinstance(value, FunctionType) and value in self._copies:
                    setattr(module, key, self._copies[value])

    def _empty_copy(self, name: str) -> ModuleType:
        self._copied.add(name)
        module = ModuleType(f"{name}_{self.name}")
        _copies.add(module.__name__)
        sys.modules[module.__name__] = module
        return module


def _copy_of(function: Callable[..., Any], module: ModuleType) -> FunctionType:
    """A function whose names are looked up in another module."""
    copy = FunctionType(function.__code__, vars(module), function.__name__, function.__defaults__)
    copy.__module__ = module.__name__
    copy.__annotations__ = function.__annotations__
    copy.__doc__ = function.__doc__
    return copy


def interpreted(function: Function, variant: Variant | None) -> Function:
    """Return a kernel as it is in a variant; itself without one."""
    return function if variant is None else variant.of(function)


def kernels_of(module: str) -> Sequence[Callable[..., Any]]:
    """Return the kernels of a module, by its name."""
    return _kernels.get(module, ())


def modules_of(kernel: Callable[..., Any]) -> list[ModuleType]:
    """Return the modules of all kernels that a kernel can call, by name."""
    found: dict[str, ModuleType] = {}
    open_ones = [kernel.__module__]
    while open_ones:
        name = open_ones.pop()
        if name in found:
            continue
        found[name] = sys.modules[name]
        for value in vars(found[name]).values():
            home = getattr(value, "__module__", None)
            if home in _kernels and value in _kernels[home]:
                open_ones.append(home)
    return [found[name] for name in sorted(found)]


def constants_of(module: ModuleType) -> list[tuple[str, Any]]:
    """Return the plain values of a module, its own and imported: the compiler writes them down."""
    kinds = (bool, int, float, str, tuple)
    return sorted(
        (name, value)
        for name, value in vars(module).items()
        if isinstance(value, kinds) and not name.startswith("__")
    )
